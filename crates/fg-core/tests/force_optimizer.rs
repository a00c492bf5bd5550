//! The force optimiser gives the minimiser of eq. (8): on problems like those of a hand at work, and on arbitrary ones.
#![allow(non_snake_case)]

mod instances;

use fg_core::friction::FrictionPyramid;
use fg_core::manipulation::force::{
    ForceOptimizer, ForceSettings, ForceStatus, SolverChoice, SolverCounters, SolverUsed,
};
use instances::oracle::judge;
use instances::{arbitrary, Random, Sequence, FAMILIES};
use nalgebra::DVector;

/// N: the accuracy promised for every force.
const PROMISED: f64 = 1e-6;

/// Without optimisation the oracle is slow: every how many of the cases are judged.
const STRIDE: usize = if cfg!(debug_assertions) { 10 } else { 1 };

fn clarabel() -> ForceSettings {
    ForceSettings { solver: SolverChoice::Clarabel, ..ForceSettings::default() }
}

/// Runs all families for `n` fingers and `m` edges, judging each answer; counts who answered.
fn work(n: usize, m: usize, settings: &ForceSettings, seed: u64) -> SolverCounters {
    let mut random = Random(seed);
    let mut total = SolverCounters::default();
    for family in FAMILIES {
        let sequence = Sequence::new(&mut random, family, n, m);
        let mut optimizer = ForceOptimizer::new(&sequence.pyramids, 3 * n, settings.clone()).unwrap();
        let mut f_prev = DVector::zeros(3 * n);
        for k in 0..Sequence::LENGTH {
            let instance = sequence.at(k, &f_prev);
            let solution = optimizer.solve(&instance.problem()).unwrap();
            assert_eq!(solution.status, ForceStatus::Solved, "{family:?} step {k}");
            if k % STRIDE == 0 {
                let verdict = judge(&instance, &sequence.pyramids, settings.alpha, &solution.f);
                assert!(verdict.violation <= 1e-7, "{family:?} step {k}: {verdict:?}");
                assert!(verdict.distance <= PROMISED, "{family:?} step {k}: {verdict:?}");
            }
            assert!((&solution.tau - instance.J.transpose() * &solution.f).norm() <= 1e-12);
            f_prev.copy_from(&solution.f);
        }
        let counts = optimizer.counts();
        total.active_set += counts.active_set;
        total.clarabel_polished += counts.clarabel_polished;
        total.clarabel += counts.clarabel;
        total.fast_stopped += counts.fast_stopped;
        total.fast_uncertified += counts.fast_uncertified;
    }
    total
}

#[test]
fn the_active_set_alone_solves_every_step_of_a_hand_at_work() {
    for n in 2..=5 {
        for m in (3..=12).step_by(if cfg!(debug_assertions) { 4 } else { 1 }) {
            let counts = work(n, m, &ForceSettings::default(), (100 * n + m) as u64);
            assert_eq!(counts.clarabel_polished + counts.clarabel, 0, "{n} fingers, {m} edges");
            assert_eq!(counts.fast_stopped + counts.fast_uncertified, 0, "{n} fingers, {m} edges");
            assert_eq!(counts.active_set, (FAMILIES.len() * Sequence::LENGTH) as u64);
        }
    }
}

#[test]
fn clarabel_is_as_exact_once_polished() {
    let sizes = [(3, 4), (4, 8), (2, 5), (5, 12)];
    for (n, m) in &sizes[..if cfg!(debug_assertions) { 1 } else { 4 }] {
        let counts = work(*n, *m, &clarabel(), (10 * n + m) as u64);
        assert_eq!(counts.clarabel, 0, "{n} fingers, {m} edges");
    }
}

#[test]
fn both_ways_agree_on_arbitrary_problems() {
    let mut random = Random(5);
    let mut solved = 0;
    for case in 0..1000 / STRIDE {
        let (pyramids, instance) = arbitrary(&mut random);
        let n_q = instance.J.ncols();
        let mut fast = ForceOptimizer::new(&pyramids, n_q, ForceSettings::default()).unwrap();
        let mut slow = ForceOptimizer::new(&pyramids, n_q, clarabel()).unwrap();
        let a = fast.solve(&instance.problem()).unwrap();
        let b = slow.solve(&instance.problem()).unwrap();
        assert_eq!(a.status, b.status, "case {case}");
        assert!((&a.f - &b.f).norm() <= PROMISED, "case {case}: {} {}", a.f, b.f);
        if a.status == ForceStatus::Solved {
            solved += 1;
            let verdict = judge(&instance, &pyramids, ForceSettings::default().alpha, &a.f);
            assert!(verdict.violation.max(verdict.distance) <= PROMISED, "case {case}: {verdict:?}");
        }
    }
    assert!((50..99).contains(&(solved * STRIDE / 10)), "{solved} solved: the family should hold both kinds");
}

#[test]
fn weights_of_any_ratio_are_solved() {
    let mut random = Random(6);
    for alpha in [[1.0, 0.0, 1.0], [0.5, 0.5, 0.0], [0.0, 1e-3, 1e4], [1e-3, 1e-3, 1e5]] {
        let settings = ForceSettings { alpha, ..ForceSettings::default() };
        for case in 0..100 / STRIDE {
            let (pyramids, instance) = arbitrary(&mut random);
            let n_q = instance.J.ncols();
            let mut optimizer = ForceOptimizer::new(&pyramids, n_q, settings.clone()).unwrap();
            let solution = optimizer.solve(&instance.problem()).unwrap();
            assert!(solution.kkt.is_finite());
            if solution.status == ForceStatus::Solved {
                // At these weights the gradient's own rounding, over alpha1 + alpha2, is up to 1e-5 N.
                let verdict = judge(&instance, &pyramids, alpha, &solution.f);
                assert!(verdict.violation <= 1e-6, "{alpha:?} case {case}: {verdict:?}");
                assert!(verdict.distance <= 2e-5, "{alpha:?} case {case}: {verdict:?}");
            } else {
                let counts = *optimizer.counts();
                assert_eq!(
                    counts.active_set_infeasible + counts.bounds_inconsistent,
                    1,
                    "{alpha:?} case {case}"
                );
            }
        }
    }
}

#[test]
fn the_past_changes_the_time_but_not_the_answer() {
    let mut random = Random(7);
    for choice in [ForceSettings::default(), clarabel()] {
        let sequence = Sequence::new(&mut random, FAMILIES[2], 4, 8);
        let mut warm = ForceOptimizer::new(&sequence.pyramids, 12, choice.clone()).unwrap();
        let mut f_prev = DVector::zeros(12);
        for k in 0..Sequence::LENGTH {
            let instance = sequence.at(k, &f_prev);
            let mut fresh = ForceOptimizer::new(&sequence.pyramids, 12, choice.clone()).unwrap();
            let a = warm.solve(&instance.problem()).unwrap();
            let b = fresh.solve(&instance.problem()).unwrap();
            assert!((&a.f - &b.f).norm() <= 1e-8, "step {k}");
            f_prev.copy_from(&a.f);
        }
    }
}

#[test]
fn equal_histories_give_equal_bits() {
    let sequence = Sequence::new(&mut Random(8), FAMILIES[4], 3, 6);
    let mut one = ForceOptimizer::new(&sequence.pyramids, 9, ForceSettings::default()).unwrap();
    let mut two = ForceOptimizer::new(&sequence.pyramids, 9, ForceSettings::default()).unwrap();
    let mut f_prev = DVector::zeros(9);
    for k in 0..Sequence::LENGTH {
        let instance = sequence.at(k, &f_prev);
        let a = one.solve(&instance.problem()).unwrap();
        let b = two.solve(&instance.problem()).unwrap();
        assert_eq!(a, b);
        f_prev.copy_from(&a.f);
    }
}

#[test]
fn friction_can_change_at_run_time() {
    let sequence = Sequence::new(&mut Random(9), FAMILIES[1], 4, 6);
    let slippery = FrictionPyramid::inscribed(0.2, 6).unwrap();
    let instance = sequence.at(30, &DVector::zeros(12));
    let mut changed = ForceOptimizer::new(&sequence.pyramids, 12, ForceSettings::default()).unwrap();
    changed.solve(&instance.problem()).unwrap();
    for contact in 0..4 {
        changed.set_pyramid(contact, &slippery).unwrap();
    }
    let mut fresh = ForceOptimizer::new(&vec![slippery.clone(); 4], 12, ForceSettings::default()).unwrap();
    let a = changed.solve(&instance.problem()).unwrap();
    let b = fresh.solve(&instance.problem()).unwrap();
    assert!((&a.f - &b.f).norm() <= 1e-9);
    assert_eq!(a.solver, SolverUsed::ActiveSet);
    assert!(changed.set_pyramid(4, &slippery).is_err());
    assert!(changed.set_pyramid(0, &FrictionPyramid::inscribed(0.2, 5).unwrap()).is_err());
}
