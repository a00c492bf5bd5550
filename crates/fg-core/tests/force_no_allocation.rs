//! The force optimiser's fast path and the gait LP allocate nothing.
#![allow(non_snake_case)]

mod counting;
mod instances;

use counting::allocations;
use fg_core::friction::FrictionPyramid;
use fg_core::manipulation::force::{ForceOptimizer, ForceSettings, SolverUsed};
use fg_core::solver::knapsack::gait_lp;
use instances::{Random, Sequence, FAMILIES};
use nalgebra::DVector;

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| vec![1_u8; 10]).1, 1);
}

#[test]
fn the_fast_path_allocates_nothing() {
    let mut random = Random(21);
    for family in FAMILIES {
        for (n, m) in [(3, 4), (5, 12)] {
            let sequence = Sequence::new(&mut random, family, n, m);
            let mut optimizer =
                ForceOptimizer::new(&sequence.pyramids, 3 * n, ForceSettings::default()).unwrap();
            let slippery = FrictionPyramid::inscribed(0.3, m).unwrap();
            let mut f_prev = DVector::zeros(3 * n);
            for k in 0..Sequence::LENGTH {
                let instance = sequence.at(k, &f_prev);
                let ((), count) = allocations(|| {
                    if k == 50 {
                        optimizer.set_pyramid(0, &slippery).unwrap();
                    }
                    let solution = optimizer.solve(&instance.problem()).unwrap();
                    assert_eq!(solution.solver, SolverUsed::ActiveSet);
                    f_prev.copy_from(&solution.f);
                });
                assert_eq!(count, 0, "{family:?} step {k}");
            }
        }
    }
}

#[test]
fn holding_allocates_nothing() {
    let sequence = Sequence::new(&mut Random(22), FAMILIES[0], 4, 8);
    let mut optimizer = ForceOptimizer::new(&sequence.pyramids, 12, ForceSettings::default()).unwrap();
    let mut instance = sequence.at(0, &DVector::zeros(12));
    optimizer.solve(&instance.problem()).unwrap();
    instance.tau_min.fill(1.0);
    instance.tau_max.fill(1.5);
    let (_, count) = allocations(|| optimizer.solve(&instance.problem()).unwrap().iterations);
    assert_eq!(optimizer.counts().held, 1);
    assert_eq!(count, 0);
}

#[test]
fn the_gait_lp_allocates_nothing() {
    let mut x = [0.0; 8];
    let (outcome, count) = allocations(|| {
        gait_lp(
            &[0.3, -0.2, 0.5, 0.1, -0.4, 0.2, 0.7, -0.1],
            &[0.05, 0.02, -0.03, 0.0, 0.01, -0.06, 0.02, 0.04],
            &[-1.0; 8],
            &[1.0; 8],
            &mut x,
        )
    });
    assert!(outcome.feasible);
    assert_eq!(count, 0);
}
