//! What the force optimiser does when it cannot give a minimiser: bad numbers, bounds that nothing satisfies.
#![allow(non_snake_case)]
#![allow(clippy::float_cmp)] // exactly zero is what is promised

mod instances;

use fg_core::error::Error;
use fg_core::friction::FrictionPyramid;
use fg_core::manipulation::force::{
    ForceOptimizer, ForceSettings, ForceSolution, ForceStatus, SolverChoice, SolverUsed,
};
use instances::{arbitrary, Family, Instance, Random, Sequence};
use nalgebra::{DMatrix, DVector, Vector3};
use proptest::prelude::*;

/// A field, and how to put a bad number into it.
type Spoil = (&'static str, fn(&mut Instance, f64));
/// A field, and how to give it a wrong shape.
type Misshape = (&'static str, fn(&mut Instance));

fn held_by_hand() -> (Sequence, Instance) {
    let sequence = Sequence::new(&mut Random(11), Family::Nominal, 4, 8);
    let instance = sequence.at(5, &DVector::zeros(12));
    (sequence, instance)
}

fn optimizer(sequence: &Sequence, solver: SolverChoice) -> ForceOptimizer {
    let settings = ForceSettings { solver, ..ForceSettings::default() };
    ForceOptimizer::new(&sequence.pyramids, 3 * sequence.n, settings).unwrap()
}

const BOTH: [SolverChoice; 2] = [SolverChoice::ActiveSet, SolverChoice::Clarabel];

fn assert_finite(solution: &ForceSolution) {
    assert!(
        solution.f.iter().chain(&solution.tau).chain(&solution.psi).all(|x| x.is_finite()),
        "{solution:?}"
    );
    assert!(solution.kkt.is_finite() && solution.kkt >= 0.0);
}

fn in_cones(pyramids: &[FrictionPyramid], f: &DVector<f64>) -> bool {
    pyramids
        .iter()
        .enumerate()
        .all(|(i, p)| p.contains(&Vector3::new(f[3 * i], f[3 * i + 1], f[3 * i + 2]), 1e-7))
}

#[test]
fn bad_numbers_are_refused_by_name_and_leave_no_trace() {
    for solver in BOTH {
        let (sequence, good) = held_by_hand();
        let mut tested = optimizer(&sequence, solver);
        let mut spared = optimizer(&sequence, solver);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
            let spoil: [Spoil; 4] = [
                ("G[7]", |i, x| i.G[(1, 1)] = x),
                ("J[0]", |i, x| i.J[(0, 0)] = x),
                ("F_des[2]", |i, x| i.F_des[2] = x),
                ("f_prev[11]", |i, x| i.f_prev[11] = x),
            ];
            for (field, spoil) in spoil {
                let mut instance = good.clone();
                spoil(&mut instance, bad);
                let error = tested.solve(&instance.problem()).unwrap_err();
                assert!(matches!(error, Error::Config { .. }));
                assert!(error.to_string().starts_with(field), "{error}");
            }
            let a = tested.solve(&good.problem()).unwrap().clone();
            assert_eq!(&a, spared.solve(&good.problem()).unwrap());
            assert_eq!(a.status, ForceStatus::Solved);
        }
        for (low, high, cap) in [
            (f64::NAN, 1.0, 1.0),
            (f64::INFINITY, 1.0, 1.0),
            (0.0, f64::NAN, 1.0),
            (0.0, f64::NEG_INFINITY, 1.0),
            (0.0, 1.0, f64::NAN),
        ] {
            let mut instance = good.clone();
            (instance.tau_min[3], instance.tau_max[3], instance.f_normal_max[3]) = (low, high, cap);
            assert!(tested.solve(&instance.problem()).is_err(), "{low} {high} {cap}");
        }
    }
}

#[test]
fn huge_and_tiny_numbers_give_commandable_forces() {
    for solver in BOTH {
        let (sequence, good) = held_by_hand();
        for number in [1e59, -1e59, 1e20, 1e-20, 1e-300, 0.0] {
            let spoil: [fn(&mut Instance, f64); 9] = [
                |i, x| i.G[(1, 1)] = x,
                |i, x| i.G.fill(x),
                |i, x| i.J[(0, 0)] = x,
                |i, x| i.J.fill(x),
                |i, x| i.F_des[2] = x,
                |i, x| i.f_prev[11] = x,
                |i, x| i.tau_min[3] = x,
                |i, x| i.tau_max[3] = x,
                |i, x| i.f_normal_max[1] = x,
            ];
            for spoil in spoil {
                let mut tested = optimizer(&sequence, solver);
                tested.solve(&good.problem()).unwrap();
                let mut instance = good.clone();
                spoil(&mut instance, number);
                let solution = tested.solve(&instance.problem()).unwrap();
                assert_finite(solution);
                assert!(in_cones(&sequence.pyramids, &solution.f), "{number:e}: {solution:?}");
                assert_eq!(tested.solve(&good.problem()).unwrap().status, ForceStatus::Solved);
            }
        }
    }
}

#[test]
fn what_the_active_sets_leave_goes_to_clarabel() {
    let settings = ForceSettings { max_changes: 3, ..ForceSettings::default() };
    let mut exact = 0;
    for (k, family) in instances::FAMILIES.iter().enumerate() {
        let sequence = Sequence::new(&mut Random(13 + k as u64), *family, 4, 8);
        let mut reference = optimizer(&sequence, SolverChoice::ActiveSet);
        let mut f_prev = DVector::zeros(12);
        for k in (0..Sequence::LENGTH).step_by(4) {
            // Each time anew, so that three changes from a cold start are mostly too few.
            let mut tested = ForceOptimizer::new(&sequence.pyramids, 12, settings.clone()).unwrap();
            let instance = sequence.at(k, &f_prev);
            let expected = reference.solve(&instance.problem()).unwrap().f.clone();
            let found = tested.solve(&instance.problem()).unwrap().clone();
            let counts = *tested.counts();
            if found.solver == SolverUsed::ActiveSet {
                assert_eq!(counts.fast_stopped, 0);
            } else {
                assert_eq!((counts.fast_stopped, counts.careful_undecided), (1, 1));
            }
            if found.status == ForceStatus::Solved {
                assert!((&found.f - &expected).norm() <= 1e-5, "{family:?} step {k}: {:?}", found.solver);
                exact += u32::from(found.solver == SolverUsed::ClarabelPolished);
            } else {
                // Three changes do not polish everything; what is not certified is not taken.
                assert_eq!((counts.held, counts.clarabel_uncertified), (1, 1));
            }
            f_prev.copy_from(&expected);
        }
    }
    assert!(exact >= 20, "{exact}");
}

#[test]
fn wrong_shapes_are_refused_by_name() {
    let (sequence, good) = held_by_hand();
    let mut tested = optimizer(&sequence, SolverChoice::ActiveSet);
    let spoil: [Misshape; 6] = [
        ("G", |i| i.G = DMatrix::zeros(6, 9)),
        ("J", |i| i.J = DMatrix::zeros(12, 9)),
        ("f_prev", |i| i.f_prev = DVector::zeros(9)),
        ("tau_min", |i| i.tau_min = DVector::zeros(9)),
        ("tau_max", |i| i.tau_max = DVector::zeros(13)),
        ("f_normal_max", |i| i.f_normal_max.truncate(3)),
    ];
    for (field, spoil) in spoil {
        let mut instance = good.clone();
        spoil(&mut instance);
        let error = tested.solve(&instance.problem()).unwrap_err();
        assert!(matches!(error, Error::Shape { .. }) && error.to_string().starts_with(field), "{error}");
    }
    let pyramid = FrictionPyramid::inscribed(0.5, 4).unwrap();
    for n in [0, 7] {
        assert!(ForceOptimizer::new(&vec![pyramid.clone(); n], 9, ForceSettings::default()).is_err());
    }
    for alpha in [[0.0, 0.0, 1.0], [-1.0, 2.0, 1.0], [1.0, 1.0, f64::NAN]] {
        let settings = ForceSettings { alpha, ..ForceSettings::default() };
        assert!(ForceOptimizer::new(std::slice::from_ref(&pyramid), 3, settings).is_err());
    }
}

#[test]
fn torque_bounds_that_contradict_each_other_hold_the_last_forces() {
    for solver in BOTH {
        let (sequence, good) = held_by_hand();
        let mut tested = optimizer(&sequence, solver);
        let certified = tested.solve(&good.problem()).unwrap().f.clone();
        let mut crossed = good.clone();
        (crossed.tau_min[4], crossed.tau_max[4]) = (0.1, -0.1);
        let held = tested.solve(&crossed.problem()).unwrap();
        assert_eq!((held.status, held.solver), (ForceStatus::Held, SolverUsed::Held));
        assert_finite(held);
        // Bounds 0.2 N m apart the wrong way cannot be missed by less than half of that.
        assert!(held.kkt >= 0.1, "{}", held.kkt);
        assert!(in_cones(&sequence.pyramids, &held.f));
        let again = tested.solve(&good.problem()).unwrap();
        assert_eq!(again.status, ForceStatus::Solved);
        assert!((&again.f - certified).norm() < 1e-9);
    }
}

#[test]
fn a_torque_box_without_feasible_forces_is_certified_and_held() {
    for solver in BOTH {
        let (sequence, good) = held_by_hand();
        let mut tested = optimizer(&sequence, solver);
        tested.solve(&good.problem()).unwrap();
        // Each joint of one finger is asked for more torque, up and down, than friction lets its contact force give.
        let mut asked = good.clone();
        for k in 0..3 {
            let sign = if tested.solve(&good.problem()).unwrap().tau[k] > 0.0 { -1.0 } else { 1.0 };
            (asked.tau_min[k], asked.tau_max[k]) = if sign > 0.0 { (0.3, 0.31) } else { (-0.31, -0.3) };
        }
        let held = tested.solve(&asked.problem()).unwrap();
        assert_eq!(held.status, ForceStatus::Held);
        assert_finite(held);
        assert!(in_cones(&sequence.pyramids, &held.f));
        if solver == SolverChoice::ActiveSet {
            assert_eq!(tested.counts().active_set_infeasible, 1);
            assert_eq!(tested.counts().clarabel_infeasible, 0, "a certificate needs no second opinion");
        }
        assert_eq!(tested.solve(&good.problem()).unwrap().status, ForceStatus::Solved);
    }
}

#[test]
fn held_forces_shrink_into_torques_that_they_exceed() {
    let (sequence, good) = held_by_hand();
    let mut tested = optimizer(&sequence, SolverChoice::ActiveSet);
    let certified = tested.solve(&good.problem()).unwrap().clone();
    // Tight for the finger that works most; contradictory for a joint of another, whose own force is pinned.
    let joint = certified.tau.iamax();
    let mut tight = good.clone();
    tight.tau_min.fill(-0.5 * certified.tau[joint].abs());
    tight.tau_max.fill(0.5 * certified.tau[joint].abs());
    let pinned = (joint / 3 + 1) % 4;
    tight.f_normal_max[pinned] = 0.0;
    tight.tau_min[3 * pinned] = 1e-3;
    let held = tested.solve(&tight.problem()).unwrap();
    assert_eq!(held.status, ForceStatus::Held);
    for i in 0..12 {
        let expected = if i / 3 == pinned { 0.0 } else { 0.5 * certified.f[i] };
        assert!((held.f[i] - expected).abs() < 1e-12);
    }
}

#[test]
fn before_any_solution_zero_forces_are_held() {
    let (sequence, mut instance) = held_by_hand();
    instance.tau_min.fill(0.2);
    instance.tau_max.fill(0.1);
    let mut tested = optimizer(&sequence, SolverChoice::ActiveSet);
    let held = tested.solve(&instance.problem()).unwrap();
    assert_eq!(held.status, ForceStatus::Held);
    assert_eq!(held.f, DVector::zeros(12));
    assert_eq!(held.tau, DVector::zeros(12));
}

#[test]
fn a_released_finger_is_exactly_zero_from_the_first_step() {
    for solver in BOTH {
        let sequence = Sequence::new(&mut Random(12), Family::Nominal, 4, 6);
        let mut tested = optimizer(&sequence, solver);
        let before = tested.solve(&sequence.at(0, &DVector::zeros(12)).problem()).unwrap().f.clone();
        let mut instance = sequence.at(1, &before);
        instance.f_normal_max[2] = 0.0;
        let after = tested.solve(&instance.problem()).unwrap();
        assert_eq!(after.status, ForceStatus::Solved);
        assert_eq!(after.f.rows(6, 3).iter().copied().collect::<Vec<_>>(), [0.0; 3]);
        assert_eq!(after.tau.rows(6, 3).iter().copied().collect::<Vec<_>>(), [0.0; 3]);
        assert!(after.f[2] > 0.1 && after.f[5] > 0.1 && after.f[11] > 0.1, "the others hold on");
        // All fingers off: nothing to decide.
        instance.f_normal_max.fill(-1.0);
        let nothing = tested.solve(&instance.problem()).unwrap();
        assert_eq!((nothing.f.norm(), nothing.status), (0.0, ForceStatus::Solved));
        assert_eq!(nothing.psi, instance.F_des);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever the problem: finite numbers, forces in their cones and under their caps, pinned contacts at zero, torques in
    /// their box where solved.
    #[test]
    fn answers_are_always_commandable(seed in any::<u64>(), size in -6.0..6.0_f64) {
        let mut random = Random(seed);
        let (pyramids, mut instance) = arbitrary(&mut random);
        instance.F_des *= 10_f64.powf(size);
        let n_q = instance.J.ncols();
        let mut tested = ForceOptimizer::new(&pyramids, n_q, ForceSettings::default()).unwrap();
        let solution = tested.solve(&instance.problem()).unwrap();
        assert_finite(solution);
        prop_assert!(in_cones(&pyramids, &solution.f));
        for (i, cap) in instance.f_normal_max.iter().enumerate() {
            if *cap <= 0.0 {
                prop_assert_eq!(solution.f.rows(3 * i, 3).norm(), 0.0);
            } else {
                prop_assert!(solution.f[3 * i + 2] <= cap + 1e-7);
            }
        }
        if solution.status == ForceStatus::Solved {
            for k in 0..n_q {
                let slack = (solution.tau[k] - instance.tau_min[k]).min(instance.tau_max[k] - solution.tau[k]);
                prop_assert!(slack >= -1e-8, "joint {}: {}", k, slack);
            }
        }
    }

    /// Eq. (8) has no scale of its own: problems in other units of force have the same solution in those units.
    #[test]
    fn forces_scale_with_the_problem(seed in any::<u64>(), scale in 0.1..10.0_f64) {
        let mut random = Random(seed);
        let (pyramids, instance) = arbitrary(&mut random);
        let n_q = instance.J.ncols();
        let mut scaled = instance.clone();
        scaled.F_des *= scale;
        scaled.f_prev *= scale;
        scaled.tau_min *= scale;
        scaled.tau_max *= scale;
        scaled.f_normal_max.iter_mut().for_each(|cap| *cap *= scale);
        let mut one = ForceOptimizer::new(&pyramids, n_q, ForceSettings::default()).unwrap();
        let mut two = ForceOptimizer::new(&pyramids, n_q, ForceSettings::default()).unwrap();
        let a = one.solve(&instance.problem()).unwrap();
        let b = two.solve(&scaled.problem()).unwrap();
        prop_assert_eq!(a.status, b.status);
        prop_assert!((&a.f * scale - &b.f).norm() <= 1e-6 * scale.max(1.0));
    }
}
