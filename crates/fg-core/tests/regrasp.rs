//! Set down and take again: the reference that waits, the way round the object, and the state machine against a plant that
//! is no more than a table.
#![allow(non_snake_case)] // the paper's letters, as in fg-core

use fg_core::regrasp::config::RegraspConfig;
use fg_core::regrasp::governor::Governor;
use fg_core::regrasp::path::{smooth, unwrapped, Axis, Place, Way};
use fg_core::signals::Reference;
use fg_core::spatial::{angular, linear, pose_error};
use nalgebra::{Isometry3, UnitQuaternion, Vector3, Vector6};
use std::f64::consts::{FRAC_PI_2, PI};

const DT: f64 = 0.002;

/// What is asked: a turn about z at `rate` rad/s, at the height `z`, since `t` = 0.
fn asked(t: f64, rate: f64, z: f64) -> Reference {
    let X_WD = Isometry3::new(Vector3::new(0.01, -0.02, z), Vector3::new(0.0, 0.0, rate * t));
    Reference { X_WD, V_WD: Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, rate) }
}

#[test]
fn a_reference_that_is_let_alone_is_what_is_asked() {
    let mut governor = Governor::new(DT);
    governor.begin(&asked(0.0, 2.0, 0.05), &Vector3::z());
    for k in 1..1000 {
        let now = asked(f64::from(k) * DT, 2.0, 0.05);
        governor.turn(2.0, 10.0);
        let out = governor.reference(&now);
        assert!(pose_error(&out.X_WD, &now.X_WD).norm() < 1e-9);
        assert!((out.V_WD - now.V_WD).norm() < 1e-9);
    }
}

#[test]
fn the_twist_is_the_motion_of_the_pose_whatever_the_phase() {
    let mut governor = Governor::new(DT);
    governor.begin(&asked(0.0, 2.0, 0.05), &Vector3::z());
    let mut last: Option<Reference> = None;
    for k in 1..2000 {
        let t = f64::from(k) * DT;
        match k {
            0..300 => governor.turn(2.0, 10.0),
            300..600 => governor.turn(0.0, 10.0),
            600..700 => governor.drift(&Vector3::z(), -0.04),
            700..900 => governor.stand(),
            900 => {
                let lies = Isometry3::new(Vector3::new(0.012, -0.02, 0.045), Vector3::new(0.0, 0.0, 1.1));
                governor.pick_up(&asked(t, 2.0, 0.05), &lies);
            }
            901..1101 => {
                let (share, rate) = smooth(f64::from(k - 900) / 200.0);
                governor.lift(share, rate / (200.0 * DT));
                governor.turn(2.0, 10.0);
            }
            _ => {
                governor.land();
                governor.turn(2.0, 10.0);
            }
        }
        let out = governor.reference(&asked(t, 2.0, 0.05));
        let jumps = k == 900 || k == 901 || k == 1101;
        if let (Some(last), false) = (last, jumps) {
            let moved = pose_error(&out.X_WD, &last.X_WD) / DT;
            // The offset is a step ahead of its rate where it is set and not integrated.
            assert!((moved - out.V_WD).norm() < 0.02, "{k}: {moved:?} {:?}", out.V_WD);
        }
        last = Some(out);
    }
    // Back in the place that is asked, behind it by the turn that was missed.
    let out = last.unwrap();
    assert!((linear(&pose_error(&out.X_WD, &asked(1999.0 * DT, 2.0, 0.05).X_WD))).norm() < 1e-9);
    assert!(governor.lag() > 1.0 && (angular(&out.V_WD) - Vector3::z() * 2.0).norm() < 1e-9);
}

#[test]
fn a_lift_starts_at_the_pose_at_which_the_object_lies() {
    let mut governor = Governor::new(DT);
    governor.begin(&asked(0.0, 2.0, 0.05), &Vector3::z());
    governor.turn(0.0, 1e9);
    for k in 1..1000 {
        governor.reference(&asked(f64::from(k) * DT, 2.0, 0.05));
    }
    let lies = Isometry3::new(Vector3::new(0.011, -0.021, 0.044), Vector3::new(0.02, -0.01, 0.3));
    let now = asked(2.0, 2.0, 0.05);
    let height = governor.pick_up(&now, &lies);
    assert!(height > 0.006 && height < 0.0063);
    governor.lift(0.0, 0.0);
    let out = governor.reference(&now);
    assert!(pose_error(&out.X_WD, &lies).norm() < 1e-2 * DT.max(0.01) + 5e-3, "but for one step of lag");
    governor.lift(1.0, 0.0);
    let out = governor.reference(&now);
    // The tilt is gone, the turn is where the object was.
    let error = pose_error(&out.X_WD, &lies);
    assert!((error[5]).abs() < 0.02 && (error[3] + 0.02).abs() < 0.02);
}

#[test]
fn a_lag_is_made_up_for_only_once_what_is_asked_stands() {
    let mut governor = Governor::new(DT);
    governor.begin(&asked(0.0, 2.0, 0.05), &Vector3::z());
    governor.turn(0.0, 1e9);
    for k in 1..500 {
        governor.reference(&asked(f64::from(k) * DT, 2.0, 0.05));
    }
    let lag = governor.lag();
    assert!((lag - 2.0).abs() < 0.02);
    assert!((governor.wanted(&asked(1.0, 2.0, 0.05), 10.0) - 2.0).abs() < 1e-12);
    let end = Reference { V_WD: Vector6::zeros(), ..asked(1.0, 2.0, 0.05) };
    let mut steps = 0;
    while governor.lag().abs() > 1e-3 && steps < 2000 {
        let wanted = governor.wanted(&end, 10.0);
        assert!(wanted <= 2.0 + 1e-12);
        governor.turn(wanted, 10.0);
        governor.reference(&end);
        steps += 1;
    }
    assert!(steps > 500 && steps < 800, "{steps}");
    assert!(governor.rate().abs() < 0.3);
}

#[test]
fn ways_stay_clear_of_the_object_while_they_go_round() {
    let axis = Axis::new(&Vector3::new(0.1, 0.2, 0.3), &Vector3::z());
    let place = Place { radius: 0.04, angle: 0.7, height: 0.01 };
    let back = axis.place(&axis.point(&place));
    assert!((back.radius - place.radius).abs() < 1e-12 && (back.angle - place.angle).abs() < 1e-12);
    let from = Place { radius: 0.0425, angle: 1.0, height: -0.002 };
    let to = Place { radius: 0.046, angle: 1.0 - 2.36, height: 0.0 };
    let way = Way { from, to, clear: 0.06 };
    assert!((way.at(0.0).angle - from.angle).abs() < 1e-12 && (way.at(1.0).angle - to.angle).abs() < 1e-12);
    assert!((way.at(0.0).radius - 0.0425).abs() < 1e-12 && (way.at(1.0).radius - 0.046).abs() < 1e-12);
    let time = way.time(5.0);
    let mut most = 0.0_f64;
    for k in 0..1000 {
        let s = f64::from(k) / 1000.0;
        let here = way.at(s);
        // A box that was felt on its faces alone, 32.5 mm away, has corners at 46 mm: a tip of 10 mm stays off them.
        if (0.15..0.85).contains(&((here.angle - from.angle) / (to.angle - from.angle))) {
            assert!(here.radius > 0.056, "{s}: {}", here.radius);
        }
        let h = 1e-3;
        let p = |s: f64| axis.point(&way.at(s));
        let a = (p(s + h) - 2.0 * p(s) + p(s - h)) / (h * h) / (time * time);
        most = most.max(a.norm());
    }
    // Legs overlap, and a turn has its centripetal part.
    assert!(most < 3.0 * 5.0, "{most}");
}

#[test]
fn angles_go_the_way_that_they_are_told() {
    assert!((unwrapped(-PI + 0.1, PI - 0.1) - (PI + 0.1)).abs() < 1e-12);
    assert!((unwrapped(0.2, 0.1) - 0.2).abs() < 1e-12);
    let x = UnitQuaternion::from_scaled_axis(Vector3::x() * FRAC_PI_2) * Vector3::z();
    let axis = Axis::new(&Vector3::zeros(), &x);
    let p = axis.outward(0.3) * 0.05 + x * 0.02;
    let place = axis.place(&p);
    assert!((place.radius - 0.05).abs() < 1e-12 && (place.height - 0.02).abs() < 1e-12);
}

#[test]
fn fields_out_of_range_are_named() {
    RegraspConfig::default().validate().unwrap();
    let bad = [
        (RegraspConfig { stroke: 0.0, ..RegraspConfig::default() }, "regrasp.stroke"),
        (RegraspConfig { preload: 0.1, ..RegraspConfig::default() }, "regrasp.preload"),
        (RegraspConfig { bandwidth: f64::NAN, ..RegraspConfig::default() }, "regrasp.bandwidth"),
    ];
    for (config, field) in bad {
        let message = config.validate().unwrap_err().to_string();
        assert!(message.contains(field), "{message}");
    }
}
