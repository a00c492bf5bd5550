//! Time and forces of the core's fast path beside DAQP's C code, both warm-started and both forming the QP, on the same
//! instances: `make daqp`. Time is thread CPU time, of each instance the median of some repeats.
#![allow(non_snake_case)]

mod daqp;
#[path = "../../tests/instances/mod.rs"]
mod instances;
#[path = "../../examples/thread_clock/mod.rs"]
mod thread_clock;

use daqp::Daqp;
use fg_core::manipulation::force::{ForceOptimizer, ForceSettings, SolverUsed};
use instances::{Instance, Random, Sequence, FAMILIES};
use nalgebra::DVector;
use thread_clock::thread_ns;

const SEQUENCES: usize = 40; // of each family
const REPEATS: usize = 9;

/// What was found, ns and N.
#[derive(Default)]
struct Found {
    core: Vec<f64>,
    daqp: Vec<f64>,
    error: Vec<f64>,
    off_fast_path: usize,
}

fn optimizer(sequence: &Sequence) -> ForceOptimizer {
    ForceOptimizer::new(&sequence.pyramids, 3 * sequence.n, ForceSettings::default())
        .expect("a valid problem")
}

fn main() {
    let mut random = Random(7);
    let mut all = Found::default();
    let clock = clock_ns();
    println!(
        "{:<14} {:>22} {:>22} {:>13} {:>9}",
        "us", "core: med p99.9 max", "daqp: med p99.9 max", "ratio", "error, N"
    );
    for family in FAMILIES {
        let mut found = Found::default();
        for k in 0..SEQUENCES {
            // 2 to 5 fingers, 3 to 12 edges
            compare(&Sequence::new(&mut random, family, 2 + k % 4, 3 + k % 10), &mut found);
        }
        print(&format!("{family:?}"), &mut found, clock);
        all.core.append(&mut found.core);
        all.daqp.append(&mut found.daqp);
        all.error.append(&mut found.error);
        all.off_fast_path += found.off_fast_path;
    }
    print("all", &mut all, clock);
}

fn compare(sequence: &Sequence, found: &mut Found) {
    let mut core = optimizer(sequence);
    let (mut instances, mut forces): (Vec<Instance>, Vec<DVector<f64>>) = (Vec::new(), Vec::new());
    let mut f_prev = DVector::zeros(3 * sequence.n);
    for k in 0..Sequence::LENGTH {
        let instance = sequence.at(k, &f_prev);
        let solution = core.solve(&instance.problem()).expect("a valid problem");
        found.off_fast_path += usize::from(solution.solver != SolverUsed::ActiveSet);
        f_prev.copy_from(&solution.f);
        forces.push(solution.f.clone());
        instances.push(instance);
    }
    let mut times = vec![(Vec::new(), Vec::new()); instances.len()];
    for repeat in 0..REPEATS {
        let (mut core, mut daqp) = (optimizer(sequence), Daqp::new(sequence));
        for (instance, (own, _)) in instances.iter().zip(&mut times) {
            let problem = instance.problem();
            let begin = thread_ns();
            std::hint::black_box(core.solve(&problem).is_ok());
            own.push((thread_ns() - begin) as f64);
        }
        for ((instance, (_, peer)), f) in instances.iter().zip(&mut times).zip(&forces) {
            let begin = thread_ns();
            let solved = daqp.solve(instance);
            peer.push((thread_ns() - begin) as f64);
            if repeat == 0 {
                let error = daqp.x.iter().zip(f.iter()).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
                found.error.push(if solved { error } else { f64::INFINITY });
            }
        }
    }
    for (own, peer) in &mut times {
        found.core.push(share(own, 0.5));
        found.daqp.push(share(peer, 0.5));
    }
}

fn share(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share).round() as usize]
}

/// What a reading of the clock adds to each time, ns.
fn clock_ns() -> f64 {
    let readings: Vec<u64> = (0..10_001).map(|_| thread_ns()).collect();
    share(&mut readings.windows(2).map(|pair| (pair[1] - pair[0]) as f64).collect::<Vec<_>>(), 0.5)
}

fn print(name: &str, found: &mut Found, clock: f64) {
    let figures = |ns: &mut Vec<f64>| [0.5, 0.999, 1.0].map(|at| (share(ns, at) - clock) / 1e3);
    let (core, daqp) = (figures(&mut found.core), figures(&mut found.daqp));
    println!(
        "{name:<14} {:>22} {:>22} {:>13} {:>9.0e}",
        core.map(|us| format!("{us:.2}")).join(" "),
        daqp.map(|us| format!("{us:.2}")).join(" "),
        format!("{:.2} {:.2}", core[0] / daqp[0], core[1] / daqp[1]),
        share(&mut found.error, 1.0)
    );
    if found.off_fast_path > 0 {
        println!("{:<14} {} answers not by the fast path", "", found.off_fast_path);
    }
}
