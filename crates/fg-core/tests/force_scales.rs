//! Eq. (8) has no scale of its own: whatever the unit of force, the lengths and the ratio of the weights, an answer is
//! certified, and one that is not says by how much it misses.
#![allow(non_snake_case)]

mod instances;

use fg_core::friction::FrictionPyramid;
use fg_core::manipulation::force::{ForceOptimizer, ForceSettings, ForceSolution, ForceStatus, SolverChoice};
use instances::oracle::{distance_in_energy, judge};
use instances::{Family, Instance, Random, Sequence, FAMILIES};
use nalgebra::DVector;
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

fn ratio_of(alpha: [f64; 3]) -> f64 {
    alpha[2] / (alpha[0] + alpha[1])
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
            prop_assert!((&a.f * force - &b.f).amax() <= 2e-6 * b.f.amax().max(force), "{} {}", a.f, b.f / force);
            prop_assert!(b.kkt <= 1e-5 * b.f.amax().max(force.min(1.0)));
        }
    }

    /// Wrenches and weights of any size, judged by code that shares nothing with the solvers.
    #[test]
    fn any_ratio_of_weights_and_any_wrench_is_solved(
        seed in any::<u64>(), family in family(), ratio in -3.0..12.0_f64, wrench in -6.0..6.0_f64
    ) {
        let (pyramids, mut instance) = at_work(&mut Random(seed), family);
        let alpha = [1e-2, 1e-2, 1e-2 * 10_f64.powf(ratio)];
        let wrench = 10_f64.powf(wrench);
        instance.F_des *= wrench;
        for solver in [SolverChoice::ActiveSet, SolverChoice::Clarabel] {
            let s = solve(&pyramids, &instance, alpha, solver);
            if s.status == ForceStatus::Held {
                // Multipliers beyond 1e12 times the forces leave no digits for these: held, and the residual says so.
                prop_assert!(ratio + wrench.log10() > 12.0, "{solver:?}: kkt {}", s.kkt);
                prop_assert!(s.kkt > 1e-6 * s.f.amax());
                continue;
            }
            let size = s.f.amax().max(wrench.min(1.0));
            let violation = judge(&instance, &pyramids, alpha, &s.f).violation;
            prop_assert!(violation <= 1e-7 * size, "{solver:?}: {violation} of {size}");
            if ratio + wrench.log10() > 12.0 {
                continue; // the judge's own multipliers have no digits left
            }
            let distance = distance_in_energy(&instance, &pyramids, alpha, &s.f, 1e-8 * size);
            // The last digits of the wrench move the forces too, through alpha3.
            let pull = ratio_of(alpha) * instance.G.norm() * instance.F_des.norm();
            let allowed = 1e-6 * size + (64.0 * f64::EPSILON * pull).min(1e-4 * size.max(30.0 * wrench));
            prop_assert!(distance <= allowed, "{solver:?}: {distance} of {allowed}, kkt {}", s.kkt);
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
