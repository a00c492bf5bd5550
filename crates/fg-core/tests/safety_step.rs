//! The table of faults in `docs/safety.md`, row by row: clock, reference, solvers, and a grasp that is lost.
//!
//! The measurements are those of a recorded run in which the object turns; faults are put into them. That the object
//! survives is tested in the closed loop, in `tests/test_safety.py`.
#![allow(non_snake_case)] // the paper's letters, as in fg-core
#![allow(clippy::float_cmp)] // what must be zero must be exactly zero

#[path = "../benches/recording/mod.rs"]
mod recording;
mod replay;

use fg_core::error::Error;
use fg_core::regrasp::config::Change;
use fg_core::safety::config::SafetyConfig;
use fg_core::safety::reference::ReferenceGuard;
use fg_core::safety::{Fault, Faults, SafeMode};
use fg_core::signals::{Measurement, Reference};
use fg_core::spatial::pose_error;
use nalgebra::{DVector, Isometry3, Quaternion, UnitQuaternion, Vector3, Vector6};
use recording::{Recording, ROTATE};
use replay::{Replay, BEGIN, RECOVERY};

const NANS: [f64; 4] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308];

#[test]
fn wrong_lengths_are_an_error_that_changes_nothing() {
    let mut replay = Replay::under_way();
    let (good, reference) = replay.recording.rows[BEGIN].clone();
    let before = replay.planner.diagnostics().clone();
    let spoilt: [fn(&mut Measurement); 4] = [
        |m| m.q = DVector::zeros(11),
        |m| m.tau = DVector::zeros(13),
        |m| m.tactile.truncate(3),
        |m| *m = Measurement::zeros(0, 0),
    ];
    for spoil in spoilt {
        let mut measurement = good.clone();
        spoil(&mut measurement);
        let error = replay.planner.step(&measurement, &reference).unwrap_err();
        assert!(matches!(error, Error::Shape { .. }), "{error}");
    }
    assert_eq!(*replay.planner.diagnostics(), before);
    let mut other = Replay::under_way();
    other.run(BEGIN..BEGIN + 100, |_, _, _| ());
    replay.run(BEGIN..BEGIN + 100, |_, _, _| ());
    assert_eq!(other.tau, replay.tau);
}

#[test]
fn a_first_measurement_that_is_not_finite_commands_nothing() {
    for x in NANS {
        let mut replay = Replay::new(|_| ());
        replay.run(0..20, |_, m, _| m.q[0] = x);
        assert_eq!(replay.mode(), SafeMode::Stop);
        assert_eq!(replay.tau.amax(), 0.0);
        replay.run(20..20 + RECOVERY, |_, _, _| ());
        assert_eq!(replay.mode(), SafeMode::Normal);
    }
    let mut replay = Replay::new(|_| ());
    replay.run(0..20, |_, m, _| m.X_WO.rotation = UnitQuaternion::new_unchecked(Quaternion::default()));
    assert_eq!(replay.mode(), SafeMode::Stop);
    replay.run(20..20 + RECOVERY, |_, _, _| ());
    assert_eq!(replay.mode(), SafeMode::Normal);
}

#[test]
fn time_that_stands_still_repeats_the_command_then_holds() {
    let mut replay = Replay::under_way();
    let t = replay.recording.rows[BEGIN].0.t;
    replay.run(BEGIN..BEGIN + 1, |_, _, _| ());
    let tau = replay.tau.clone();
    replay.run(BEGIN + 1..BEGIN + 11, |_, m, _| m.t = t);
    assert_eq!(replay.tau, tau);
    assert_eq!(replay.mode(), SafeMode::Normal);
    // The sensors live on: the clock alone has failed.
    replay.run(BEGIN + 11..BEGIN + 40, |_, m, _| m.t = t);
    assert!(replay.has(Fault::Clock));
    assert_eq!(replay.mode(), SafeMode::Hold);
    replay.run(BEGIN + 40..BEGIN + 40 + RECOVERY, |_, _, _| ());
    assert_eq!(replay.mode(), SafeMode::Normal);
}

#[test]
fn a_measurement_that_stands_still_altogether_squeezes_on_the_last_wrench() {
    let mut replay = Replay::under_way();
    let (last, _) = replay.recording.rows[BEGIN - 1].clone();
    replay.run(BEGIN..BEGIN + 100, |_, m, _| *m = last.clone());
    assert_eq!(replay.mode(), SafeMode::Squeeze);
    let F = replay.planner.diagnostics().F_des;
    replay.run(BEGIN + 100..BEGIN + 150, |_, m, _| *m = last.clone());
    assert_eq!(replay.planner.diagnostics().F_des, F);
}

#[test]
fn time_that_goes_back_or_jumps_ahead_is_a_step_of_one_period() {
    for shift in [-1e3, 1e3, -1e308, 1e308] {
        let mut replay = Replay::under_way();
        replay.run(BEGIN..BEGIN + 1, |_, m, _| m.t += shift);
        assert!(replay.has(Fault::Clock));
        replay.run(BEGIN + 1..BEGIN + 50, |_, m, _| m.t += shift);
        assert!(shift.abs() > 1e300 || !replay.has(Fault::Clock));
        replay.run(BEGIN + 50..BEGIN + 50 + 2 * RECOVERY, |_, _, _| ());
        assert_eq!(replay.mode(), SafeMode::Normal);
    }
    Replay::under_way().suffers(Fault::Clock, SafeMode::Hold, 1, |k, m, _| m.t -= (k % 2) as f64);
}

#[test]
fn a_late_step_is_reported_and_many_hold() {
    let mut replay = Replay::under_way();
    // Every tenth step is missing.
    for k in (BEGIN..BEGIN + 300).filter(|k| k % 10 != 0) {
        replay.run(k..k + 1, |_, _, _| ());
        assert_eq!(replay.has(Fault::Late), k % 10 == 1);
        assert_eq!(replay.mode(), SafeMode::Normal);
    }
    let mut replay = Replay::under_way();
    for k in (BEGIN..BEGIN + 300).step_by(2) {
        replay.run(k..k + 1, |_, _, _| ());
    }
    assert!(replay.has(Fault::Late));
    assert_eq!(replay.mode(), SafeMode::Hold);
    replay.run(BEGIN + 300..BEGIN + 300 + RECOVERY, |_, _, _| ());
    assert_eq!(replay.mode(), SafeMode::Normal);
}

#[test]
fn a_reference_that_is_none_stands_still() {
    Replay::under_way()
        .suffers(Fault::Reference, SafeMode::Hold, 0, |_, _, r| r.X_WD.translation.z = f64::NAN);
    Replay::under_way().suffers(Fault::Reference, SafeMode::Hold, 0, |_, _, r| r.X_WD.translation.z = 1e308);
    Replay::under_way().suffers(Fault::Reference, SafeMode::Hold, 0, |_, _, r| r.V_WD[0] = 1e6);
}

#[test]
fn all_contacts_lost_stops() {
    let mut replay = Replay::under_way();
    // The fingers move in by several millimetres while they feel nothing: the object is gone.
    let closed = |k: usize| (2e-3 * k as f64).min(0.3);
    let close = |m: &mut Measurement, by: f64| {
        for j in 0..4 {
            m.q[3 * j] += by;
            m.q[3 * j + 2] += by;
            m.tactile[j].f_n = 0.0;
        }
    };
    replay.run(BEGIN..BEGIN + 300, |k, m, _| close(m, closed(k - BEGIN)));
    assert!(replay.has(Fault::ContactsLost));
    assert_eq!(replay.mode(), SafeMode::Stop);
    let mut weight = vec![0.0; 12];
    let hand = replay.planner.hand().clone();
    let mut state = fg_core::hand::HandState::new(&hand);
    let mut q = replay.recording.rows[BEGIN + 299].0.q.clone();
    for j in 0..4 {
        q[3 * j] += 0.3;
        q[3 * j + 2] += 0.3;
    }
    state.update(&hand, q.as_slice());
    state.gravity_torque(&hand, &mut weight);
    assert!((&replay.tau - DVector::from_vec(weight)).amax() < 0.02, "{}", replay.tau);
    // The hand opens, and the object is put back.
    replay.run(BEGIN + 300..BEGIN + 450, |k, m, _| close(m, closed(BEGIN + 449 - k)));
    replay.run(BEGIN + 450..BEGIN + 450 + RECOVERY, |_, _, _| ());
    assert_eq!(replay.mode(), SafeMode::Normal);
}

#[test]
fn an_infeasible_torque_box_holds_the_last_forces() {
    // Links so heavy that their own weight takes more torque than there is.
    let recording = Recording::parse(ROTATE);
    let mut hand: serde_json::Value = serde_json::to_value(&recording.hand).unwrap();
    for finger in hand["fingers"].as_array_mut().unwrap() {
        finger["joints"][2]["mass"] = 3.0.into();
    }
    let recording =
        Recording { hand: fg_core::hand::HandModel::from_json(&hand.to_string()).unwrap(), ..recording };
    let planner = recording.planner();
    let mut replay = Replay { recording, planner, tau: DVector::zeros(12) };
    replay.run(0..100, |_, _, _| ());
    assert!(replay.has(Fault::TorqueBox));
    assert_eq!(replay.mode(), SafeMode::Hold);
}

#[test]
fn a_solver_that_fails_holds_the_last_forces() {
    // No answer is this accurate.
    let mut replay = Replay::new(|config| config.force.tolerance = 1e-300);
    replay.run(0..50, |_, _, _| ());
    assert!(replay.has(Fault::Solver), "{:?}", replay.planner.diagnostics());
    assert_eq!(replay.mode(), SafeMode::Hold);
    assert_eq!(replay.planner.diagnostics().status.as_str(), "held");
}

#[test]
fn saturation_for_long_holds() {
    // An object that does not come along, however hard the fingers pull.
    let stuck = |_: usize, _: &mut Measurement, r: &mut Reference| r.X_WD.translation.z += 0.3;
    let mut replay = Replay::under_way();
    // safety.saturation_time is 500 steps.
    replay.run(BEGIN..BEGIN + 490, stuck);
    assert_eq!(replay.mode(), SafeMode::Normal);
    replay.run(BEGIN + 490..BEGIN + 700, stuck);
    assert!(replay.has(Fault::Saturated));
    assert_eq!(replay.mode(), SafeMode::Hold);
}

#[test]
fn a_fault_ends_a_gait() {
    let mut replay = Replay::new(|_| ());
    let mut k = 0;
    while replay.planner.diagnostics().phase.as_str() != "slide" {
        replay.run(k..k + 1, |_, _, _| ());
        k += 1;
    }
    replay.run(k..k + 20, |_, m, _| m.X_WO.translation.x = f64::NAN);
    assert_eq!(replay.mode(), SafeMode::Squeeze);
    assert!(matches!(replay.planner.diagnostics().phase.as_str(), "press" | "load"));
    replay.run(k + 20..k + 120, |_, m, _| m.X_WO.translation.x = f64::NAN);
    assert_eq!(replay.planner.diagnostics().phase.as_str(), "hold");
}

#[test]
fn the_reference_stands_in_a_fault_and_catches_up_at_a_limited_speed() {
    let config = SafetyConfig::default();
    let mut guard = ReferenceGuard::new(&config, 0.002);
    // The reference turns at 0.2 rad/s and rises at 0.02 m/s.
    let at = |k: u32| {
        let t = 0.002 * f64::from(k);
        let X_WD = Isometry3::new(Vector3::new(0.0, 0.0, 0.02 * t), Vector3::new(0.0, 0.0, 0.2 * t));
        Reference { X_WD, V_WD: Vector6::new(0.0, 0.0, 0.02, 0.0, 0.0, 0.2) }
    };
    let mut last = at(0);
    let X_WO = Isometry3::identity();
    for k in 0..4000 {
        let stands = (1000..2000).contains(&k);
        assert!(guard.take(&at(k), &X_WO, &mut Faults::default()));
        let now = guard.use_now(stands, &X_WO);
        let moved = pose_error(&now.X_WD, &last.X_WD);
        let (rise, turn) =
            if stands { (0.0, 0.0) } else { (0.02 + config.catch_up[0], 0.2 + config.catch_up[1]) };
        assert!(moved[2] <= 0.002 * rise + 1e-9 && moved[5] <= 0.002 * turn + 1e-9, "step {k}");
        // The twist is that of the motion.
        assert!(k == 0 || k == 1000 || (moved / 0.002 - now.V_WD).norm() < 1e-2, "step {k}");
        last = now;
    }
    // 2 s of standing still at 0.2 rad/s take 4 s to make up for at 0.1 rad/s.
    let left = pose_error(&at(3999).X_WD, &last.X_WD);
    assert!(left[2].abs() < 1e-6 && (left[5] - 0.0).abs() < 1e-3, "{left}");
}

#[test]
fn no_order_of_calls_panics() {
    let recording = Recording::parse(ROTATE);
    let mut planner = recording.planner();
    planner.reset();
    planner.reset();
    let empty = Measurement::zeros(0, 0);
    let (first, reference) = recording.rows[0].clone();
    for k in [0, 2000, 3000, 5, 5, 1000, 0] {
        planner.step(&empty, &reference).unwrap_err();
        planner.step(&Measurement::zeros(4, 12), &reference).unwrap();
        planner.step(&recording.rows[k].0, &recording.rows[k].1).unwrap();
        planner.step(&first, &reference).unwrap();
        if k == 5 {
            planner.reset();
        }
        assert!(planner.diagnostics().tau.iter().all(|tau| tau.is_finite()));
    }
}

#[test]
fn an_overdue_grasp_makes_the_desired_motion_stand() {
    // No finger is ever free to go: any slack at all is too much. Nor may the object be set down.
    let mut replay = Replay::new(|config| {
        config.gait.change = Change::Gait;
        config.gait.slack_force = 1e-9;
        config.gait.slack_torque = 1e-9;
        config.gait.overdue_margin = 0.0;
        config.gait.overdue_time = 0.04;
    });
    let mut begun = 0;
    for k in 0..replay.recording.rows.len() {
        replay.run(k..k + 1, |_, _, _| ());
        let d = replay.planner.diagnostics();
        assert_eq!(d.gaits, 0);
        if replay.has(Fault::Overdue) {
            assert!(begun > 0 || d.quality.Q < d.threshold, "step {k}");
            // The fault is found at the end of a step, and the mode decided at the beginning of the next.
            assert!(begun == 0 || replay.mode() == SafeMode::Hold, "step {k}");
            begun += 1;
        } else {
            begun = 0;
        }
    }
    assert!(begun > 10, "to the end");
    // Never without gaits to wait for.
    let mut replay = Replay::new(|config| {
        config.gait.enabled = false;
        config.gait.overdue_margin = 0.0;
        config.gait.overdue_time = 0.04;
    });
    for k in 0..replay.recording.rows.len() {
        replay.run(k..k + 1, |_, _, _| ());
        assert!(!replay.has(Fault::Overdue), "step {k}");
    }
}
