//! Eq. (8) has no scale of its own: whatever the unit of force, the lengths and the ratio of the weights, an answer is
//! certified, and one that is not says by how much it misses.
#![allow(non_snake_case)]

mod instances;

use fg_core::friction::FrictionPyramid;
use fg_core::manipulation::force::{ForceOptimizer, ForceSettings, ForceSolution, ForceStatus, SolverChoice};
use instances::{Family, Instance, Random, Sequence, FAMILIES};
use nalgebra::{DVector, Vector6};
use proptest::prelude::*;

const ALPHA: [f64; 3] = [0.01, 0.01, 1000.0];

/// A problem of a hand at work.
fn at_work(random: &mut Random, family: Family) -> (Vec<FrictionPyramid>, Instance) {
    let (n, m) = (2 + random.below(4), 3 + random.below(10));
    let sequence = Sequence::new(random, family, n, m);
    let k = random.below(Sequence::LENGTH);
    (sequence.pyramids.clone(), sequence.at(k, &DVector::from_fn(3 * n, |i, _| f64::from(i % 3 == 2))))
}

/// The same hand with another unit of force and another unit of length.
fn in_units(instance: &Instance, force: f64, length: f64) -> Instance {
    let mut scaled = instance.clone();
    scaled.F_des *= force;
    scaled.f_prev *= force;
    scaled.f_normal_max.iter_mut().for_each(|cap| *cap *= force);
    scaled.tau_min *= force * length;
    scaled.tau_max *= force * length;
    scaled.J *= length;
    scaled.G.rows_mut(3, 3).scale_mut(length);
    scaled.F_des.rows_mut(3, 3).scale_mut(length);
    scaled
}

fn solve(
    pyramids: &[FrictionPyramid],
    instance: &Instance,
    alpha: [f64; 3],
    solver: SolverChoice,
) -> ForceSolution {
    let settings = ForceSettings { alpha, solver, ..ForceSettings::default() };
    let mut optimizer = ForceOptimizer::new(pyramids, instance.J.ncols(), settings).unwrap();
    optimizer.solve(&instance.problem()).unwrap().clone()
}

/// What the wrench costs, and what the forces cost: eq. (8) is a compromise of the two.
fn costs(instance: &Instance, alpha: [f64; 3], f: &DVector<f64>) -> (f64, f64) {
    let psi: Vector6<f64> = instance.F_des - &instance.G * f;
    let forces = alpha[0] * f.norm_squared() + alpha[1] * (f - &instance.f_prev).norm_squared();
    (alpha[2] * psi.norm_squared(), forces)
}

/// Largest violation of a bound, N.
fn violation(pyramids: &[FrictionPyramid], instance: &Instance, f: &DVector<f64>) -> f64 {
    let mut worst = 0.0_f64;
    for (i, pyramid) in pyramids.iter().enumerate() {
        let part = f.fixed_rows::<3>(3 * i).into_owned();
        worst = pyramid.facets().iter().fold(worst, |w, facet| w.max(-facet.dot(&part)));
        worst = worst.max(part.z - instance.f_normal_max[i].max(0.0));
    }
    let tau = instance.J.transpose() * f;
    for (k, tau) in tau.iter().enumerate() {
        let length = instance.J.column(k).norm();
        worst = worst.max((instance.tau_min[k] - tau) / length).max((tau - instance.tau_max[k]) / length);
    }
    worst
}

fn family() -> impl Strategy<Value = Family> {
    (0..FAMILIES.len()).prop_map(|k| FAMILIES[k])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    /// The same hand in micronewtons and in meganewtons, in millimetres and in kilometres: the same forces, certified alike.
    /// A length is a weight of the torques, which makes it another problem; the unit of force makes none.
    #[test]
    fn any_unit_of_force_gives_the_same_forces(
        seed in any::<u64>(), family in family(), force in -6.0..6.0_f64, length in -3.0..3.0_f64
    ) {
        let (pyramids, instance) = at_work(&mut Random(seed), family);
        let instance = in_units(&instance, 1.0, 10_f64.powf(length));
        let force = 10_f64.powf(force);
        for solver in [SolverChoice::ActiveSet, SolverChoice::Clarabel] {
            let a = solve(&pyramids, &instance, ALPHA, solver);
            let b = solve(&pyramids, &in_units(&instance, force, 1.0), ALPHA, solver);
            prop_assert_eq!((a.status, b.status), (ForceStatus::Solved, ForceStatus::Solved));
            prop_assert!((&a.f * force - &b.f).amax() <= 2e-7 * b.f.amax(), "{} {}", a.f, b.f / force);
            prop_assert!(b.kkt <= 1e-5 * b.f.amax().max(force.min(1.0)));
        }
    }

    /// Wrenches and weights of any size. Feasible; and against clarabel asked alone, whose way is another, no costlier.
    #[test]
    fn any_ratio_of_weights_and_any_wrench_is_solved(
        seed in any::<u64>(), family in family(), ratio in -3.0..12.0_f64, wrench in -6.0..6.0_f64
    ) {
        let (pyramids, mut instance) = at_work(&mut Random(seed), family);
        let alpha = [1e-2, 1e-2, 1e-2 * 10_f64.powf(ratio)];
        instance.F_des *= 10_f64.powf(wrench);
        let a = solve(&pyramids, &instance, alpha, SolverChoice::ActiveSet);
        prop_assert_eq!(a.status, ForceStatus::Solved, "kkt {}", a.kkt);
        let size = a.f.amax().max(1e-6);
        prop_assert!(violation(&pyramids, &instance, &a.f) <= 1e-7 * size.max(1e-6));
        let b = solve(&pyramids, &instance, alpha, SolverChoice::Clarabel);
        if b.status == ForceStatus::Solved {
            let (mine, other) = (costs(&instance, alpha, &a.f), costs(&instance, alpha, &b.f));
            let (mine, other) = (mine.0 + mine.1, other.0 + other.1);
            prop_assert!((mine - other).abs() <= 1e-9 * mine.max(other), "{mine} {other}");
        }
    }

    /// Whatever was held, it does not pretend to be solved.
    #[test]
    fn held_forces_tell_their_residual(seed in any::<u64>(), wrench in -6.0..6.0_f64, ratio in -3.0..16.0_f64) {
        let mut random = Random(seed);
        let (pyramids, mut instance) = instances::arbitrary(&mut random);
        instance.F_des *= 10_f64.powf(wrench);
        if random.below(2) == 0 {
            instance.f_prev.fill(0.0);
        }
        let alpha = [1e-2, 1e-2, 1e-2 * 10_f64.powf(ratio)];
        let s = solve(&pyramids, &instance, alpha, SolverChoice::ActiveSet);
        prop_assert!(s.kkt.is_finite());
        if s.status == ForceStatus::Held {
            prop_assert!(s.kkt > 0.0);
        }
    }
}

#[test]
fn a_torque_that_no_force_makes_is_a_residual_though_nothing_else_is_asked() {
    let (pyramids, mut instance) = at_work(&mut Random(3), Family::Nominal);
    instance.F_des.fill(0.0);
    instance.f_prev.fill(0.0);
    instance.J.column_mut(0).fill(0.0);
    instance.tau_min[0] = 1e-3;
    let held = solve(&pyramids, &instance, ALPHA, SolverChoice::ActiveSet);
    assert_eq!(held.status, ForceStatus::Held);
    assert!(held.kkt > 1.0 && held.kkt.is_finite(), "{}", held.kkt);
}

#[test]
fn the_residual_of_held_forces_is_that_of_a_minimiser_where_they_are_one() {
    // Solved, then contradicted by a joint that no force turns: the forces held are still the minimiser of the rest.
    let (pyramids, mut instance) = at_work(&mut Random(4), Family::TorqueLimited);
    instance.tau_min[0] = -1.0;
    let solved = solve(&pyramids, &instance, ALPHA, SolverChoice::ActiveSet);
    assert_eq!(solved.status, ForceStatus::Solved);
    // One change is too few: held from nothing, at a distance from the minimiser that the residual does not understate.
    let settings = ForceSettings { max_changes: 0, max_iterations: 0, ..ForceSettings::default() };
    let mut hasty = ForceOptimizer::new(&pyramids, instance.J.ncols(), settings).unwrap();
    let held = hasty.solve(&instance.problem()).unwrap();
    assert_eq!(held.status, ForceStatus::Held);
    assert!(held.kkt >= (&held.f - &solved.f).norm(), "{} {}", held.kkt, (&held.f - &solved.f).norm());
}
