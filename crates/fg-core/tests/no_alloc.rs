//! No step allocates, whatever it is given: a counting allocator around recorded runs and every kind of fault.
#![allow(non_snake_case)] // the paper's letters, as in fg-core
#![allow(unsafe_code)] // an allocator cannot be written without

mod counting;
#[path = "../benches/recording/mod.rs"]
mod recording;

use counting::allocations;
use fg_core::config::{Config, GaitEvent};
use fg_core::manipulation::force::SolverUsed;
use fg_core::safety::SafeMode;
use recording::{Recording, NOISY, ROTATE};

/// Steps through `recording`, each measurement spoilt by `spoil(k, ..)`; asserts that none of the steps allocates where the
/// fast path answers. Returns the phases and modes seen.
fn replay(
    bytes: &[u8],
    spoil: impl Fn(usize, &mut fg_core::signals::Measurement, &mut fg_core::signals::Reference),
) -> (Vec<&'static str>, Vec<&'static str>) {
    replay_with(bytes, |_| (), spoil)
}

/// The same with a configuration that is changed.
fn replay_with(
    bytes: &[u8],
    change: impl FnOnce(&mut Config),
    spoil: impl Fn(usize, &mut fg_core::signals::Measurement, &mut fg_core::signals::Reference),
) -> (Vec<&'static str>, Vec<&'static str>) {
    let recording = Recording::parse(bytes);
    let mut planner = recording.planner_with(change);
    let (mut phases, mut modes) = (Vec::new(), Vec::new());
    let mut slow = 0;
    for (k, (measurement, reference)) in recording.rows.iter().enumerate() {
        let (mut measurement, mut reference) = (measurement.clone(), *reference);
        spoil(k, &mut measurement, &mut reference);
        let ((), count) = allocations(|| {
            planner.step(&measurement, &reference).unwrap();
        });
        let d = planner.diagnostics();
        if d.solver == SolverUsed::ActiveSet {
            assert_eq!(count, 0, "step {k}: {:?} {:?}", d.phase, d.safe_mode);
        } else {
            slow += 1;
        }
        phases.push(d.phase.as_str());
        modes.push(d.safe_mode.as_str());
    }
    assert!(slow <= recording.rows.len() / 1000, "{slow} steps off the fast path");
    for seen in [&mut phases, &mut modes] {
        seen.sort_unstable();
        seen.dedup();
    }
    (phases, modes)
}

#[test]
fn no_step_of_a_run_allocates_in_any_phase() {
    for bytes in [ROTATE, NOISY] {
        let (phases, modes) = replay(bytes, |_, _, _| ());
        assert_eq!(phases, ["hold", "load", "press", "slide", "unload"]);
        assert_eq!(modes, [SafeMode::Normal.as_str()]);
    }
}

#[test]
fn no_step_allocates_where_reserves_start_gaits() {
    let (phases, _) = replay_with(ROTATE, |config| config.gait.event = GaitEvent::Both, |_, _, _| ());
    assert!(phases.contains(&"slide"), "{phases:?}");
}

#[test]
fn no_step_of_a_failing_run_allocates_in_any_mode() {
    let (_, modes) = replay(ROTATE, |k, measurement, reference| match k {
        700..800 => measurement.q[4] = f64::NAN,
        1000..1100 => measurement.X_WO.translation.x = f64::INFINITY,
        1300..1400 => measurement.tactile[2].f_n = 1e308,
        1600..1700 => measurement.t = 0.0,
        1900..2000 => reference.V_WD[0] = f64::NAN,
        2300..2500 => {
            measurement.q[0] = f64::NAN;
            measurement.tactile[0].f_n = 0.0;
        }
        3000.. => measurement.tactile.iter_mut().for_each(|tactile| tactile.f_n = 0.0),
        _ => (),
    });
    assert_eq!(modes, ["hold", "normal", "squeeze"]);
}

#[test]
fn no_step_allocates_in_which_a_finger_is_let_go_or_released_for_want_of_power() {
    let (_, modes) = replay(ROTATE, |k, measurement, _| match k {
        // A finger that was off the object when its encoders failed.
        0..1700 => {
            measurement.tactile[0].f_n = 0.0;
            if k >= 1500 {
                measurement.q[0] = f64::NAN;
            }
        }
        2500..2700 => measurement.tau.rows_mut(6, 3).fill(0.0),
        _ => (),
    });
    assert!(modes.contains(&SafeMode::Damp.as_str()), "{modes:?}");
    assert!(modes.contains(&SafeMode::Hold.as_str()), "{modes:?}");
}

#[test]
fn no_step_allocates_once_nothing_is_held() {
    let (_, modes) = replay(ROTATE, |k, measurement, _| {
        // The fingers close and feel nothing: the object is gone.
        if (1500..2500).contains(&k) {
            let closed = (2e-3 * (k - 1500) as f64).min(0.3);
            for j in 0..4 {
                measurement.q[3 * j] += closed;
                measurement.q[3 * j + 2] += closed;
                measurement.tactile[j].f_n = 0.0;
            }
        }
    });
    assert!(modes.contains(&SafeMode::Stop.as_str()), "{modes:?}");
}

#[test]
fn a_reset_returns_to_the_state_after_construction() {
    let recording = Recording::parse(ROTATE);
    let (mut used, mut fresh) = (recording.planner(), recording.planner());
    for (measurement, reference) in &recording.rows[..2000] {
        used.step(measurement, reference).unwrap();
    }
    used.reset();
    let (mut a, mut b) = (Vec::new(), Vec::new());
    for (measurement, reference) in &recording.rows[..2000] {
        let row = |planner: &mut fg_core::dual_stage::DualStagePlanner, row: &mut Vec<f64>| {
            planner.step(measurement, reference).unwrap();
            row.clear();
            planner.diagnostics().row(row);
        };
        row(&mut used, &mut a);
        row(&mut fresh, &mut b);
        assert!(a.iter().zip(&b).all(|(a, b)| a.to_bits() == b.to_bits()), "t = {}", measurement.t);
    }
}
