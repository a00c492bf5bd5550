//! The planner's diagnostics tell who answered each force QP, and why a solver passed it on.
#![allow(non_snake_case)] // the paper's letters, as in fg-core

#[path = "../benches/recording/mod.rs"]
mod recording;

use fg_core::manipulation::force::{ForceStatus, SolverChoice, SolverCounters, SolverUsed};
use recording::{Recording, ROTATE};

const STEPS: u64 = 400;

/// Replays the beginning of a run with clarabel or the active set first, with `tau_max` N m at each joint.
fn counts(solver: SolverChoice, tau_max: Option<f64>) -> (SolverCounters, u64) {
    let recording = Recording::parse(ROTATE);
    let mut planner = recording.planner_with(|config| {
        config.force.solver = solver;
        config.force.tau_max = tau_max.or(config.force.tau_max);
    });
    let mut held = 0;
    for (measurement, reference) in &recording.rows[..400] {
        planner.step(measurement, reference).unwrap();
        let d = planner.diagnostics();
        assert_eq!(d.status == ForceStatus::Held, d.solver == SolverUsed::Held);
        held += u64::from(d.solver == SolverUsed::Held);
    }
    let counts = planner.diagnostics().solver_counts;
    planner.reset();
    assert_eq!(planner.diagnostics().solver_counts, SolverCounters::default());
    (counts, held)
}

#[test]
fn every_answer_is_counted_under_its_solver() {
    let (counts, _) = counts(SolverChoice::ActiveSet, None);
    assert_eq!(counts, SolverCounters { active_set: STEPS, ..SolverCounters::default() });
}

#[test]
fn clarabel_answers_where_it_is_chosen() {
    let (counts, _) = counts(SolverChoice::Clarabel, None);
    assert_eq!(counts.clarabel_polished + counts.clarabel + counts.active_set, STEPS);
    assert!(counts.clarabel_polished > STEPS * 99 / 100, "{counts:?}");
}

#[test]
fn held_forces_are_counted_with_their_reason() {
    // The fingers' own weight needs more.
    let (counts, held) = counts(SolverChoice::ActiveSet, Some(1e-3));
    assert!(held > 0);
    assert_eq!(counts.held, held);
    assert_eq!(counts.active_set_infeasible + counts.bounds_inconsistent, held, "{counts:?}");
    let named: u64 = counts.by_name()[..4].iter().map(|(_, count)| count).sum();
    assert_eq!(named, STEPS);
}
