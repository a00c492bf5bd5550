//! Time of the force QP, eq. (8), and of the gait LP, eq. (4).
//!
//! The force QP runs through whole sequences of a hand at work, as in the tests: `warm` from the last step's working set,
//! `cold` without, `clarabel` with its polish. Times are per sequence of 100 steps. Criterion's clock is wall time: for
//! percentiles in thread CPU time see `fingergait bench`.
#![allow(missing_docs, non_snake_case)]

#[path = "../tests/instances/mod.rs"]
mod instances;

use criterion::{criterion_group, criterion_main, Criterion, Throughput};
use fg_core::manipulation::force::{ForceOptimizer, ForceSettings, SolverChoice};
use fg_core::solver::knapsack::gait_lp;
use instances::{Family, Instance, Random, Sequence, FAMILIES};
use nalgebra::DVector;
use std::hint::black_box;

/// A sequence's instances, each with the forces of the one before it.
fn recorded(family: Family, n: usize, m: usize) -> (Sequence, Vec<Instance>) {
    let sequence = Sequence::new(&mut Random(31), family, n, m);
    let mut optimizer = optimizer(&sequence, SolverChoice::ActiveSet);
    let mut f_prev = DVector::zeros(3 * n);
    let instances = (0..Sequence::LENGTH)
        .map(|k| {
            let instance = sequence.at(k, &f_prev);
            f_prev.copy_from(&optimizer.solve(&instance.problem()).expect("a well-formed problem").f);
            instance
        })
        .collect();
    (sequence, instances)
}

fn optimizer(sequence: &Sequence, solver: SolverChoice) -> ForceOptimizer {
    let settings = ForceSettings { solver, ..ForceSettings::default() };
    ForceOptimizer::new(&sequence.pyramids, 3 * sequence.n, settings).expect("a well-formed optimiser")
}

fn force(criterion: &mut Criterion) {
    for family in FAMILIES {
        let mut group = criterion.benchmark_group(format!("force_qp/{family:?}"));
        group.throughput(Throughput::Elements(Sequence::LENGTH as u64));
        group.sample_size(20);
        for (n, m) in [(3, 4), (4, 8), (5, 12)] {
            let (sequence, instances) = recorded(family, n, m);
            let mut run = |name: &str, solver, cold: bool| {
                let mut optimizer = optimizer(&sequence, solver);
                group.bench_function(format!("{name}/{n}_fingers_{m}_edges"), |bencher| {
                    bencher.iter(|| {
                        for instance in &instances {
                            if cold {
                                optimizer.reset();
                            }
                            black_box(optimizer.solve(&instance.problem()).is_ok());
                        }
                    });
                });
            };
            run("warm", SolverChoice::ActiveSet, false);
            run("cold", SolverChoice::ActiveSet, true);
            if n == 4 {
                run("clarabel", SolverChoice::Clarabel, false);
            }
        }
    }
}

fn gait(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("gait_lp");
    for n in [3, 4, 8] {
        let mut random = Random(32);
        let mut numbers = |size: f64| (0..n).map(|_| random.uniform(-size, size)).collect::<Vec<_>>();
        let (c, a) = (numbers(1.0), numbers(0.05));
        let (lower, upper) = (vec![-1.0; n], vec![1.0; n]);
        let mut x = vec![0.0; n];
        group.bench_function(format!("{n}_joints"), |bencher| {
            bencher
                .iter(|| gait_lp(black_box(&c), black_box(&a), black_box(&lower), black_box(&upper), &mut x));
        });
    }
}

criterion_group!(benches, force, gait);
criterion_main!(benches);
