//! How long each control step of the recorded runs takes, and what of its worst case is the machine's.
//!
//! ```text
//! cargo run --release --example latency -- [--repeats N]
//! ```
//!
//! A run is replayed N times. The planner is deterministic, so that a step does the same work in every replay: what an
//! interrupt or another process adds to it differs from replay to replay, and is not in the least of its N times. What is
//! left in the spread of these least times depends on the data: gaits, changes of the working set, sensors. Both are printed,
//! and as many times of a loop that always does the same and takes as long as a step: its tail is the machine's alone.
#![allow(missing_docs, non_snake_case)]

#[path = "../benches/recording/mod.rs"]
mod recording;
mod thread_clock;

use recording::{Recording, NOISY, ROTATE};
use std::collections::BTreeMap;
use thread_clock::thread_ns;

/// Times of a kind of step, ns: of every replay, and the least of each step.
#[derive(Default)]
struct Times {
    raw: Vec<u64>,
    least: Vec<u64>,
}

/// One step: phase, changes of the working set, least time in ns.
type Step = (&'static str, usize, u64);

fn main() {
    let mut arguments = std::env::args().skip_while(|argument| argument != "--repeats");
    let repeats = arguments.nth(1).and_then(|n| n.parse().ok()).unwrap_or(100);
    let mut clock: Vec<u64> = (0..1000).map(|_| thread_ns()).collect();
    clock = clock.windows(2).map(|pair| pair[1] - pair[0]).collect();
    println!("the clock itself: {:.2} us a reading, in every time below", percentile(&mut clock, 0.5));
    println!(
        "{:<22} {:>7} {:>7} {:>7} {:>7} {:>7} {:>9}",
        "us", "steps", "median", "p99", "p99.9", "max", "p99.9/med"
    );
    for (name, bytes) in [("rotate", ROTATE), ("noisy", NOISY)] {
        let (steps, mut kinds) = replay(&Recording::parse(bytes), repeats);
        for (kind, times) in &mut kinds {
            print(&format!("{name} {kind}"), times.least.len(), &mut times.raw);
            print("    least of replays", times.least.len(), &mut times.least);
        }
        let median = kinds.get_mut("all").map_or(0.0, |times| percentile(&mut times.raw, 0.5));
        print("    always the same work", 1, &mut same_work(median, steps.len() * repeats));
        let mut order: Vec<usize> = (0..steps.len()).collect();
        order.sort_by_key(|k| std::cmp::Reverse(steps[*k].2));
        print!("    longest:");
        for k in &order[..6] {
            let (phase, changes, ns) = steps[*k];
            print!(" step {k} {phase} {changes} changes {:.1};", ns as f64 / 1e3);
        }
        println!();
    }
}

fn replay(recording: &Recording, repeats: usize) -> (Vec<Step>, BTreeMap<&'static str, Times>) {
    let mut steps: Vec<Step> = vec![("", 0, u64::MAX); recording.rows.len()];
    let mut kinds: BTreeMap<&'static str, Times> = BTreeMap::new();
    let mut planner = recording.planner();
    for _ in 0..repeats {
        planner.reset();
        for (step, (measurement, reference)) in steps.iter_mut().zip(&recording.rows) {
            let begin = thread_ns();
            let done = planner.step(measurement, reference).is_ok();
            let ns = thread_ns() - begin;
            assert!(done);
            let d = planner.diagnostics();
            *step = (d.phase.as_str(), d.iterations, step.2.min(ns));
            kinds.entry(step.0).or_default().raw.push(ns);
        }
    }
    let mut all = Times::default();
    for (phase, _, ns) in &steps {
        kinds.entry(*phase).or_default().least.push(*ns);
        all.least.push(*ns);
    }
    all.raw = kinds.values().flat_map(|times| times.raw.iter().copied()).collect();
    kinds.insert("all", all);
    (steps, kinds)
}

/// `count` times of a loop that takes about `us`, ns.
fn same_work(us: f64, count: usize) -> Vec<u64> {
    let time = |turns: u32| {
        let begin = thread_ns();
        let mut x = std::hint::black_box(1.0_f64);
        for _ in 0..turns {
            x = std::hint::black_box(x * 0.999 + 0.001);
        }
        thread_ns() - begin
    };
    let least = |turns| (0..100).map(|_| time(turns)).min().unwrap_or(0) as f64 / 1e3;
    let (short, long) = (least(0), least(1000));
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some thousands")]
    let turns = ((us - short) / (long - short).max(1e-3) * 1000.0).max(0.0) as u32;
    (0..count).map(|_| time(turns)).collect()
}

fn percentile(ns: &mut [u64], share: f64) -> f64 {
    ns.sort_unstable();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
    let at = ((ns.len() - 1) as f64 * share).round() as usize;
    ns[at] as f64 / 1e3
}

fn print(name: &str, steps: usize, ns: &mut [u64]) {
    let [median, p99, p999, max] = [0.5, 0.99, 0.999, 1.0].map(|share| percentile(ns, share));
    println!("{name:<22} {steps:>7} {median:>7.2} {p99:>7.2} {p999:>7.2} {max:>7.2} {:>9.2}", p999 / median);
}
