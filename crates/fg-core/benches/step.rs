//! Time of the control step and of its parts, on measurements recorded in the closed loop.
//!
//! Criterion's clock is wall time: for percentiles in thread CPU time see `fingergait bench`.
#![allow(missing_docs, non_snake_case)]

mod recording;

use criterion::{criterion_group, criterion_main, Criterion, Throughput};
use fg_core::config::Config;
use fg_core::grasp::Grasp;
use fg_core::hand::{HandState, TorqueLimits};
use fg_core::signals::{Measurement, Reference};
use fg_core::torque::TorquePid;
use recording::{Recording, NOISY, ROTATE};
use std::hint::black_box;

/// Rows of the recording that a bench walks through, from a state in which all before has been seen.
const PART: usize = 200;

fn parts(criterion: &mut Criterion) {
    let Recording { hand, rows, .. } = Recording::parse(ROTATE);
    let mut state = HandState::new(&hand);
    let mut grasp = Grasp::new(&hand, 0.01);
    let mut weight = vec![0.0; hand.n_q()];
    let mut next = {
        let mut k = 0;
        move || {
            k = (k + 1) % 3000;
            k
        }
    };
    criterion.bench_function("kinematics", |bencher| {
        bencher.iter(|| {
            state.update(&hand, rows[next()].0.q.as_slice());
            state.gravity_torque(&hand, &mut weight);
            black_box(&weight);
        });
    });
    criterion.bench_function("grasp", |bencher| {
        bencher.iter(|| {
            grasp.update(&hand, &state, &rows[next()].0);
            black_box(&grasp);
        });
    });
    let config = Config::default();
    let n = hand.n_q();
    let pid = TorqueLimits::uniform(n, 0.5).and_then(|limits| TorquePid::new(limits, 1e-3, &config.torque));
    let Ok(mut pid) = pid else { return };
    let mut motor = vec![0.0; n];
    criterion.bench_function("torque_pid", |bencher| {
        bencher.iter(|| {
            let tau = rows[next()].0.tau.as_slice();
            black_box(pid.step(tau, tau, &mut motor).is_ok());
        });
    });
}

/// The whole step, from the `from`-th row on.
fn step_from(criterion: &mut Criterion, name: &str, recording: &Recording, from: usize) {
    let mut group = criterion.benchmark_group("step");
    group.throughput(Throughput::Elements(PART as u64)).sample_size(20);
    let rows = &recording.rows;
    group.bench_function(name, |bencher| {
        let before = || {
            let mut planner = recording.planner();
            for (measurement, reference) in &rows[..from] {
                black_box(planner.step(measurement, reference).is_ok());
            }
            planner
        };
        bencher.iter_batched_ref(
            before,
            |planner| {
                for (measurement, reference) in &rows[from..(from + PART).min(rows.len())] {
                    black_box(planner.step(measurement, reference).is_ok());
                }
            },
            criterion::BatchSize::LargeInput,
        );
    });
}

/// The first row at which a planner that sees `recording` is in the phase called `phase`.
fn first(recording: &Recording, phase: &str) -> usize {
    let mut planner = recording.planner();
    let in_phase = |(measurement, reference): &(Measurement, Reference)| {
        black_box(planner.step(measurement, reference).is_ok());
        planner.diagnostics().phase.as_str() == phase
    };
    recording.rows.iter().position(in_phase).unwrap_or(0)
}

fn step(criterion: &mut Criterion) {
    let rotate = Recording::parse(ROTATE);
    step_from(criterion, "hold", &rotate, 1500);
    step_from(criterion, "gait", &rotate, first(&rotate, "slide"));
    let mut failing = Recording::parse(ROTATE);
    for (measurement, _) in &mut failing.rows[1400..] {
        measurement.X_WO.translation.x = f64::NAN;
    }
    step_from(criterion, "squeeze", &failing, 1500);
    let noisy = Recording::parse(NOISY);
    step_from(criterion, "noisy_hold", &noisy, 1500);
    step_from(criterion, "noisy_gait", &noisy, first(&noisy, "slide"));
}

criterion_group!(benches, parts, step);
criterion_main!(benches);
