//! What holds of every step, whatever comes in.
//!
//! The long version, ten million steps, is `cargo test --release --test invariants -- --ignored`.
#![allow(non_snake_case)] // the paper's letters, as in fg-core

#[path = "../benches/recording/mod.rs"]
mod recording;

mod chaos;

use fg_core::config::{Config, QualityPlane};
use fg_core::hand::{HandModel, TorqueLimits};
use fg_core::manipulation::force::SolverChoice;
use fg_core::manipulation::robust::Controller;
use fg_core::safety::SafeMode;
use fg_core::torque::TorquePid;
use proptest::prelude::*;
use recording::{Recording, NOISY, ROTATE};
use std::sync::LazyLock;

static RECORDING: LazyLock<Recording> = LazyLock::new(|| Recording::parse(ROTATE));

/// A small generator, so that seeds mean the same on every platform (splitmix64).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn bytes(&mut self, n: usize) -> Vec<u8> {
        (0..n.div_ceil(8)).flat_map(|_| self.bits().to_le_bytes()).collect()
    }
}

/// Drives a planner through `steps` steps of anything.
fn chaos(steps: usize, seed: u64) {
    let mut random = Random(seed);
    let noisy = Recording::parse(NOISY);
    let mut planners = vec![
        (RECORDING.planner(), &RECORDING.rows),
        (noisy.planner(), &noisy.rows),
        (RECORDING.planner_with(|c| c.gait.enabled = false), &RECORDING.rows),
    ];
    let mut done = 0;
    while done < steps {
        for (planner, rows) in &mut planners {
            done += chaos::drive(planner, rows, &random.bytes(600));
        }
    }
}

#[test]
fn every_command_is_finite_and_limited_in_two_hundred_thousand_steps_of_anything() {
    chaos(200_000, 1);
}

#[test]
#[ignore = "ten million steps take minutes"]
fn every_command_is_finite_and_limited_in_ten_million_steps_of_anything() {
    chaos(10_000_000, 2);
}

/// Any configuration that validates.
fn config() -> impl Strategy<Value = Config> {
    let number = |low: f64, high: f64| {
        // Evenly over the decades.
        (low.ln()..=high.ln()).prop_map(f64::exp)
    };
    let gait = (number(1e-3, 1e3), number(1e-3, 1e3), number(1e-4, 10.0), number(1e-3, 10.0), any::<bool>());
    let force = (number(1e-6, 1e3), number(1e-6, 1e9), number(0.05, 5.0), 3_usize..=12, number(0.01, 10.0));
    let other = (number(1e-2, 1e2), number(1e-2, 1e3), 0.0..=1.0, any::<bool>(), number(1.0, 1e4));
    (gait, force, other).prop_map(|(gait, force, other)| {
        let mut c = Config::default();
        (c.gait.w1, c.gait.w2, c.gait.sigma, c.gait.unload_time, c.gait.project_rate_box) = gait;
        (c.force.alpha1, c.force.alpha3, c.force.friction, c.force.edges, _) = force;
        c.force.tau_max = Some(force.4);
        let K_v: f64;
        (c.force.f_n_max, K_v, c.robust.anti_windup, c.robust.prefilter, c.force.tau_rate_max) = other;
        c.gait.K_v = Some(K_v.min(100.0));
        c.gait.plane = if c.robust.prefilter { QualityPlane::Object } else { QualityPlane::Contacts };
        c
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Limits hold for any configuration that is accepted, on good measurements and on bad ones.
    #[test]
    fn commands_are_limited_under_any_configuration(config in config(), seed in any::<u64>()) {
        prop_assume!(config.validate().is_ok());
        let mut planner = RECORDING.planner_with(|c| *c = config);
        chaos::drive(&mut planner, &RECORDING.rows, &Random(seed).bytes(100));
    }

    /// Both solvers lead to finite, limited commands.
    #[test]
    fn commands_are_limited_with_clarabel(seed in any::<u64>()) {
        let mut planner = RECORDING.planner_with(|c| c.force.solver = SolverChoice::Clarabel);
        chaos::drive(&mut planner, &RECORDING.rows, &Random(seed).bytes(20));
    }

    /// Once good measurements come in again, everything returns to normal.
    #[test]
    fn good_measurements_bring_the_planner_back(seed in any::<u64>()) {
        let mut planner = RECORDING.planner();
        chaos::drive(&mut planner, &RECORDING.rows[..1000], &Random(seed).bytes(200));
        planner.reset();
        for (measurement, reference) in &RECORDING.rows[1000..1100] {
            planner.step(measurement, reference).unwrap();
        }
        prop_assert_eq!(planner.diagnostics().safe_mode, SafeMode::Normal);
    }

    /// The same measurements give the same commands, bit for bit.
    #[test]
    fn steps_are_deterministic(seed in any::<u64>()) {
        let data = Random(seed).bytes(200);
        let mut rows = [Vec::new(), Vec::new()];
        for row in &mut rows {
            let mut planner = RECORDING.planner();
            chaos::drive(&mut planner, &RECORDING.rows, &data);
            planner.diagnostics().row(row);
        }
        prop_assert!(rows[0].iter().zip(&rows[1]).all(|(a, b)| a.to_bits() == b.to_bits()));
    }

    /// The torque PID's output is finite and limited, whatever it is given.
    #[test]
    fn motor_torques_are_limited(
        tau in prop::collection::vec(prop::array::uniform2(prop::num::f64::ANY), 1..200),
    ) {
        let limits = TorqueLimits::new(&[-0.2], &[0.5], None).unwrap();
        let mut pid = TorquePid::new(limits, 1e-3, &Config::default().torque).unwrap();
        let mut motor = [0.0];
        for [desired, measured] in tau {
            pid.step(&[desired], &[measured], &mut motor).unwrap();
            prop_assert!(motor[0] >= -0.2 && motor[0] <= 0.5);
        }
    }

    /// Texts that are no configuration, hand or artefact are errors, never panics.
    #[test]
    fn parsers_refuse_what_they_do_not_know(at in 0.0..1.0, from in any::<u8>(), length in 0_usize..8) {
        let end = ROTATE.iter().position(|b| *b == b'\n').unwrap();
        let head: serde_json::Value = serde_json::from_slice(&ROTATE[..end]).unwrap();
        for field in ["config", "hand", "controller"] {
            let mut text = head[field].to_string().into_bytes();
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the text")]
            let at = (at * (text.len() - 8) as f64) as usize;
            text.splice(at..at + length, [from]);
            let text = String::from_utf8_lossy(&text);
            let _ = Config::from_json(&text);
            let _ = HandModel::from_json(&text);
            let _ = Controller::from_json(&text);
        }
    }
}
