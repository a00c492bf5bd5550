//! The table of faults in `docs/safety.md`, row by row: sensors that fail.
//!
//! The measurements are those of a recorded run in which the object turns; faults are put into them. That the object
//! survives is tested in the closed loop, in `tests/test_safety.py`.
#![allow(non_snake_case)] // the paper's letters, as in fg-core
#![allow(clippy::float_cmp)] // what must be zero must be exactly zero

#[path = "../benches/recording/mod.rs"]
mod recording;
mod replay;

use fg_core::safety::{Fault, SafeMode};
use fg_core::signals::{Measurement, Reference};
use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3, Vector6};
use recording::{Recording, NOISY, ROTATE};
use replay::{Replay, BEGIN, RECOVERY};

const NANS: [f64; 4] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308];

#[test]
fn nothing_is_wrong_with_a_run_whose_sensors_are_fit() {
    for bytes in [ROTATE, NOISY] {
        let recording = Recording::parse(bytes);
        let mut planner = recording.planner();
        for (k, (measurement, reference)) in recording.rows.iter().enumerate() {
            planner.step(measurement, reference).unwrap();
            let d = planner.diagnostics();
            assert!(d.faults.is_empty() && d.safe_mode == SafeMode::Normal, "step {k}: {:?}", d.faults);
        }
        assert!(planner.diagnostics().gaits > 0);
    }
}

#[test]
fn a_measurement_that_is_not_finite_is_ridden_through() {
    for x in NANS {
        Replay::under_way().rides_through(Fault::Encoder, 3, 0.04, |_, m, _| m.q[4] = x);
        Replay::under_way().rides_through(Fault::Pose, 3, 0.04, |_, m, _| m.X_WO.translation.y = x);
        Replay::under_way().rides_through(Fault::Tactile, 3, 0.04, |_, m, _| m.tactile[1].p_FC.z = x);
        Replay::under_way().rides_through(Fault::Reference, 3, 0.04, |_, _, r| r.V_WD[5] = x);
        Replay::under_way().rides_through(Fault::Clock, 3, 0.04, |_, m, _| m.t = x);
    }
    // The step does not use the measured torques.
    Replay::under_way().rides_through(Fault::TorqueSensor, 50, 0.0, |_, m, _| m.tau[0] = f64::NAN);
}

#[test]
fn a_pose_that_jumps_is_replaced_by_what_the_fingers_tell() {
    let jump = |m: &mut Measurement| m.X_WO.translation.vector += Vector3::new(0.03, 0.0, 0.01);
    Replay::under_way().rides_through(Fault::PoseJump, 4, 0.04, |_, m, _| jump(m));
    Replay::under_way().suffers(Fault::PoseJump, SafeMode::Squeeze, 0, |_, m, _| jump(m));
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.5, 0.0));
    Replay::under_way()
        .suffers(Fault::PoseJump, SafeMode::Squeeze, 0, |_, m, _| m.X_WO.rotation = turn * m.X_WO.rotation);
    // While it is off, what K is given stays with the object.
    let mut replay = Replay::under_way();
    replay.run(BEGIN..BEGIN + 50, |_, m, _| jump(m));
    // The recorded object turns on against the reference that stands, as it would with a pose.
    let mut other = Replay::under_way();
    other.run(BEGIN..BEGIN + 50, |_, m, _| m.tactile[3].f_n = 1e3);
    assert!((replay.planner.diagnostics().e - other.planner.diagnostics().e).norm() < 0.01);
}

#[test]
fn a_pose_that_is_none_squeezes() {
    let zero = UnitQuaternion::new_unchecked(Quaternion::new(0.0, 0.0, 0.0, 0.0));
    Replay::under_way().suffers(Fault::Pose, SafeMode::Squeeze, 0, |_, m, _| m.X_WO.rotation = zero);
    let far = Isometry3::translation(50.0, 0.0, 0.0);
    Replay::under_way().suffers(Fault::Pose, SafeMode::Squeeze, 0, |_, m, _| m.X_WO = far);
    // The fingers press harder, by about what the configuration says.
    let mut replay = Replay::under_way();
    let pressing = |replay: &Replay| (0..4).map(|j| replay.planner.diagnostics().f[3 * j + 2]).sum::<f64>();
    let before = pressing(&replay);
    replay.run(BEGIN..BEGIN + 100, |_, m, _| m.X_WO.translation.x = f64::NAN);
    assert!(pressing(&replay) > before + 1.0, "{before} {}", pressing(&replay));
}

#[test]
fn a_pose_that_goes_stale_squeezes_once_the_object_has_moved() {
    let stale = Replay::under_way().recording.rows[BEGIN].0.X_WO;
    let mut replay = Replay::under_way();
    replay.run(BEGIN..BEGIN + 49, |_, m, _| m.X_WO = stale);
    assert!(!replay.has(Fault::PoseStale), "younger than safety.pose_timeout");
    replay.run(BEGIN + 49..BEGIN + 200, |_, m, _| m.X_WO = stale);
    assert!(replay.has(Fault::PoseStale));
    assert_eq!(replay.mode(), SafeMode::Squeeze);
    replay.run(BEGIN + 200..BEGIN + 200 + RECOVERY, |_, _, _| ());
    assert_eq!(replay.mode(), SafeMode::Normal);
}

#[test]
fn a_pose_that_stands_still_with_the_object_is_fit() {
    let mut replay = Replay::new(|_| ());
    // Nothing moves at all but time, as with a quiet sensor on an object that is where it should be.
    let still = replay.recording.rows[700].0.clone();
    let reference = Reference { X_WD: still.X_WO, V_WD: Vector6::zeros() };
    replay.run(0..700, |_, _, _| ());
    replay.run(700..1100, |k, m, r| {
        *m = Measurement { t: k as f64 / 500.0, tau: m.tau.clone(), ..still.clone() };
        *r = reference;
    });
    assert_eq!(replay.mode(), SafeMode::Normal);
    assert!(replay.planner.diagnostics().faults.is_empty());
}

#[test]
fn an_encoder_that_is_stuck_holds_with_its_last_angle() {
    let mut replay = Replay::under_way();
    let stuck = replay.recording.rows[BEGIN].0.q[7];
    let end = 2100;
    let mut since = None;
    for k in BEGIN..end {
        replay.run(k..k + 1, |_, m, _| m.q[7] = stuck);
        if replay.has(Fault::EncoderStuck) {
            since = since.or(Some(k));
        }
    }
    let since = since.expect("detected");
    assert!(replay.has(Fault::EncoderStuck), "first at {since}");
    assert_eq!(replay.mode(), SafeMode::Hold);
    replay.run(end..end + RECOVERY, |_, _, _| ());
    assert_eq!(replay.mode(), SafeMode::Normal);
}

#[test]
fn an_encoder_out_of_range_or_off_holds_with_its_last_angle() {
    for x in [10.0, -10.0, 1e308, f64::NAN] {
        Replay::under_way().suffers(Fault::Encoder, SafeMode::Hold, 0, |_, m, _| m.q[3] = x);
    }
    Replay::under_way().suffers(Fault::Encoder, SafeMode::Hold, 0, |_, m, _| m.q[2] += 0.5);
}

#[test]
fn an_angle_that_jumped_is_believed_again_where_it_explains_the_contact() {
    // The joint turns with the object while its encoder is off, by more than what passes for the last good angle.
    let (at, end) = (7, 2300);
    let mut replay = Replay::under_way();
    let angle = |k: usize| replay.recording.rows[k].0.q[at];
    assert!((angle(end) - angle(BEGIN)).abs() > 0.1, "{}", angle(end) - angle(BEGIN));
    replay.run(BEGIN..end, |_, m, _| m.q[at] += 0.4);
    assert!(replay.has(Fault::Encoder));
    assert_eq!(replay.mode(), SafeMode::Hold);
    replay.run(end..end + 140, |_, _, _| ());
    assert!(replay.has(Fault::Encoder), "0.3 s are 150 steps");
    replay.run(end + 140..end + 160, |_, _, _| ());
    assert!(!replay.has(Fault::Encoder));
}

#[test]
fn an_encoder_that_is_off_for_good_is_never_believed_while_its_finger_touches() {
    for offset in [0.4, -0.4, 0.25] {
        for at in 0..12 {
            let mut replay = Replay::under_way();
            for k in BEGIN..2200 {
                replay.run(k..k + 1, |_, m, _| m.q[at] += offset);
                assert!(replay.has(Fault::Encoder), "joint {at}, {offset} rad, step {k}");
            }
        }
    }
}

#[test]
fn a_finger_that_does_not_find_the_object_holds() {
    let mut replay = Replay::under_way();
    // It moves in by several millimetres and feels nothing: it has lost the object.
    let closed = |k: usize| (2e-3 * k as f64).min(0.3);
    let lose = |m: &mut Measurement, by: f64| {
        m.q[0] += by;
        m.q[2] += by;
        m.tactile[0].f_n = 0.0;
    };
    replay.run(BEGIN..BEGIN + 200, |k, m, _| lose(m, closed(k - BEGIN)));
    assert!(!replay.has(Fault::FingerLost));
    assert_eq!(replay.mode(), SafeMode::Normal);
    assert_eq!(replay.planner.diagnostics().free_finger, Some(0));
    replay.run(BEGIN + 200..BEGIN + 500, |k, m, _| lose(m, closed(k - BEGIN)));
    assert!(replay.has(Fault::FingerLost));
    assert_eq!(replay.mode(), SafeMode::Hold);
    replay.run(BEGIN + 500..BEGIN + 650, |k, m, _| lose(m, closed(BEGIN + 649 - k)));
    replay.run(BEGIN + 650..BEGIN + 650 + RECOVERY, |_, _, _| ());
    assert!(!replay.has(Fault::FingerLost));
    assert_eq!(replay.mode(), SafeMode::Normal);
}

#[test]
fn a_finger_without_angles_or_contact_is_damped() {
    let mut replay = Replay::under_way();
    replay.run(BEGIN..BEGIN + 400, |_, m, _| {
        m.q[0] = f64::NAN;
        m.q[5] += 1e-12; // not the same number again and again
        m.tactile[0].f_n = 0.0;
        // The finger moves in, so the sensor is believed.
        m.q[2] = f64::NAN;
        m.q[1] = f64::NAN;
    });
    // Its angles being unknown, an advance cannot be seen: the sensor counts as lost, and the finger as holding.
    assert!(replay.has(Fault::Encoder) && replay.has(Fault::TactileLost));
    assert_eq!(replay.mode(), SafeMode::Hold);
    // A finger that was off the object when its encoders failed holds nothing.
    let mut replay = Replay::new(|_| ());
    replay.run(0..BEGIN, |_, m, _| m.tactile[0].f_n = 0.0);
    replay.run(BEGIN..BEGIN + 200, |_, m, _| {
        m.tactile[0].f_n = 0.0;
        m.q[0] = f64::NAN;
    });
    assert_eq!(replay.mode(), SafeMode::Damp);
    let f = &replay.planner.diagnostics().f;
    assert_eq!(f.rows(0, 3).amax(), 0.0);
    // The reference has stood since the sensor was missed, and the recorded object has not: torques saturate.
    replay.run(BEGIN + 200..BEGIN + 200 + RECOVERY, |_, _, _| ());
    assert!(
        replay.mode() <= SafeMode::Hold && !replay.has(Fault::Encoder) && !replay.has(Fault::TactileLost)
    );
}

#[test]
fn a_tactile_sensor_that_is_lost_is_replaced_by_the_force_commanded() {
    // safety.lost_time is 25 steps: a finger may bounce.
    let lost = |m: &mut Measurement, j: usize| m.tactile[j].f_n = 0.0;
    Replay::under_way().suffers(Fault::TactileLost, SafeMode::Hold, 26, |_, m, _| lost(m, 1));
    Replay::under_way()
        .suffers(Fault::TactileLost, SafeMode::Hold, 26, |_, m, _| (0..4).for_each(|j| lost(m, j)));
    let mut replay = Replay::under_way();
    replay.run(BEGIN..BEGIN + 20, |_, m, _| lost(m, 1));
    assert_eq!(replay.mode(), SafeMode::Normal);
    assert!(replay.planner.diagnostics().faults.is_empty());
    let d = replay.planner.diagnostics();
    assert!((d.f_n[1] - d.f[5]).abs() < 0.2, "{} {}", d.f_n[1], d.f[5]);
}

#[test]
fn a_tactile_sensor_that_is_stuck_is_replaced_by_the_force_commanded() {
    for full in [30.0, 50.0, 1e3] {
        Replay::under_way()
            .suffers(Fault::TactileStuck, SafeMode::Hold, 0, |_, m, _| m.tactile[3].f_n = full);
    }
    // A constant below full scale takes safety.stuck_time.
    Replay::under_way().suffers(Fault::TactileStuck, SafeMode::Hold, 52, |_, m, _| m.tactile[3].f_n = 12.0);
    for bad in [f64::NAN, -5.0, 1e308] {
        let mut replay = Replay::under_way();
        replay.run(BEGIN..BEGIN + 100, |_, m, _| m.tactile[3].f_n = bad);
        assert_eq!(replay.mode(), SafeMode::Hold);
    }
}

#[test]
fn a_finger_without_power_is_released_and_comes_back() {
    for finger in 0..4 {
        let mut replay = Replay::under_way();
        let dead = |m: &mut Measurement| m.tau.rows_mut(3 * finger, 3).fill(0.0);
        replay.run(BEGIN..BEGIN + 4, |_, m, _| dead(m));
        assert!(!replay.has(Fault::Motor), "a glitch");
        replay.run(BEGIN + 4..BEGIN + 60, |_, m, _| dead(m));
        // The fingers that are left carry the weight; later on the recorded object moves away from where it is held.
        assert!(replay.planner.diagnostics().psi.rows(0, 3).norm() < 0.1);
        for k in BEGIN + 60..BEGIN + 160 {
            replay.run(k..k + 1, |_, m, _| dead(m));
            assert!(replay.has(Fault::Motor));
            assert_eq!(replay.mode(), SafeMode::Hold);
            let d = replay.planner.diagnostics();
            assert_eq!(d.f.rows(3 * finger, 3).amax(), 0.0);
            assert!(d.tau.rows(3 * finger, 3).amax() < 0.11, "the test and the finger's own weight");
        }
        replay.run(BEGIN + 160..BEGIN + 200 + RECOVERY, |_, _, _| ());
        assert!(replay.planner.diagnostics().faults.is_empty());
        assert_eq!(replay.mode(), SafeMode::Normal);
        assert!(replay.planner.diagnostics().f[3 * finger + 2] > 0.3);
    }
}

#[test]
fn motors_that_are_weak_or_whose_torque_is_not_known_are_none_without_power() {
    for spoil in [|m: &mut Measurement| m.tau *= 0.5, |m: &mut Measurement| m.tau.fill(f64::NAN)] {
        let mut replay = Replay::under_way();
        for k in BEGIN..BEGIN + 200 {
            replay.run(k..k + 1, |_, m, _| spoil(m));
            assert!(!replay.has(Fault::Motor));
        }
    }
}

#[test]
fn without_any_torque_reading_the_fingers_hold_on() {
    // Torque sensors that are not there: it cannot be that all fingers have lost their power and still hold.
    let mut replay = Replay::under_way();
    replay.run(BEGIN..BEGIN + 200, |_, m, _| m.tau.fill(0.0));
    assert!(replay.has(Fault::Motor));
    assert_eq!(replay.mode(), SafeMode::Hold);
    assert!((0..4).all(|j| replay.planner.diagnostics().f[3 * j + 2] > 0.3));
}

#[test]
fn a_tactile_place_off_the_fingertip_is_replaced_by_the_last_one() {
    for place in [Vector3::new(1.0, 0.0, 0.0), Vector3::zeros(), Vector3::repeat(1e200)] {
        Replay::under_way().suffers(Fault::Tactile, SafeMode::Hold, 0, |_, m, _| m.tactile[2].p_FC = place);
    }
}

#[test]
fn reads_that_fail_now_and_then_are_replaced_and_change_nothing_else() {
    let mut replay = Replay::under_way();
    let gaits = replay.planner.diagnostics().gaits;
    for k in BEGIN..BEGIN + 1200 {
        // Every fifth read, and four in a row now and then.
        let fails = k % 5 == 0 || k % 100 < 4;
        replay.run(k..k + 1, |_, m, _| {
            if fails {
                m.q.fill(0.0);
            }
        });
        assert_eq!(replay.has(Fault::Encoder), fails, "step {k}");
        assert_eq!(replay.mode(), SafeMode::Normal, "step {k}");
    }
    assert!(replay.planner.diagnostics().gaits > gaits);
    // One that fails for good does.
    replay.run(BEGIN + 1201..BEGIN + 1221, |_, m, _| m.q.fill(0.0));
    assert!(replay.has(Fault::Encoder) && replay.mode() >= SafeMode::Hold);
}

#[test]
fn forces_in_another_unit_contradict_the_joint_torques() {
    for factor in [0.1, 102.0] {
        let mut replay = Replay::new(|_| ());
        replay.run(0..1000, |_, m, _| m.tactile.iter_mut().for_each(|reading| reading.f_n *= factor));
        assert!(replay.has(Fault::TactileScale), "{factor}: {:?}", replay.planner.diagnostics().faults);
        assert!(replay.mode() >= SafeMode::Hold);
    }
    // Without torque sensors there is nothing to compare with.
    let mut replay = Replay::new(|config| config.safety.motor_asked = 1.0);
    replay.run(0..400, |_, m, _| {
        m.tau.fill(0.0);
        for reading in &mut m.tactile {
            reading.f_n *= 3.0;
        }
    });
    assert!(!replay.has(Fault::TactileScale));
}

#[test]
fn a_start_that_does_not_fit_the_touching_tips_drives_nothing_until_it_does() {
    let shift =
        |x: &mut Isometry3<f64>, by: f64| x.translation.vector += Vector3::new(0.6 * by, -0.8 * by, 0.0);
    for by in [0.06, 0.1, 0.5] {
        let mut replay = Replay::new(|_| ());
        replay.run(0..100, |_, m, r| {
            shift(&mut m.X_WO, by);
            shift(&mut r.X_WD, by);
        });
        assert!(replay.has(Fault::PoseFrame) && replay.mode() == SafeMode::Stop);
        assert!(replay.tau.amax() < 0.05, "{by}: {}", replay.tau);
        replay.run(100..200, |_, _, _| ());
        assert!(!replay.has(Fault::PoseFrame) && replay.mode() == SafeMode::Normal, "{by}");
    }
    let mut replay = Replay::new(|_| ());
    replay.run(0..100, |_, m, r| {
        shift(&mut m.X_WO, 0.03);
        shift(&mut r.X_WD, 0.03);
    });
    assert!(replay.planner.diagnostics().faults.is_empty() && replay.mode() == SafeMode::Normal);
    let mut replay = Replay::new(|_| ());
    replay.run(0..100, |_, m, _| m.tactile.iter_mut().for_each(|reading| reading.p_FC = reading.p_FC.yxz()));
    assert!(replay.has(Fault::TactileAxes) && replay.mode() == SafeMode::Stop);
}
