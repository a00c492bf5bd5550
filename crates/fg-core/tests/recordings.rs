//! The recordings are of this controller: a replay commands what the recorded run commanded.
//!
//! Their measurements answer the recorded commands. Where the controller has changed since, they do not answer its own, K
//! runs away, and what benches and tests find on them is no longer what a run would show.
#![allow(non_snake_case)] // the paper's letters, as in fg-core

#[path = "../benches/recording/mod.rs"]
mod recording;

use recording::{Recording, NOISY, ROTATE};

/// N m, of 0.5: rows are rounded to single precision, which passes through K and may shift a gait by a step.
const TOLERANCE: f64 = 0.02;

#[test]
fn a_replay_commands_what_the_run_commanded() {
    for (name, bytes) in [("rotate", ROTATE), ("noisy", NOISY)] {
        let recording = Recording::parse(bytes);
        let mut planner = recording.planner();
        let mut differences: Vec<f64> = Vec::new();
        for ((measurement, reference), tau) in recording.rows.iter().zip(&recording.commands) {
            differences.push((&planner.step(measurement, reference).unwrap().tau - tau).amax());
        }
        differences.sort_by(f64::total_cmp);
        let (median, p99) = (differences[differences.len() / 2], differences[differences.len() * 99 / 100]);
        println!(
            "{name}: median {median:.1e}, p99 {p99:.1e}, max {:.1e} N m",
            differences[differences.len() - 1]
        );
        assert!(p99 <= TOLERANCE, "{name}: {p99} N m; the controller has changed: make recordings");
        assert!(planner.diagnostics().gaits >= 3, "{name}");
    }
}
