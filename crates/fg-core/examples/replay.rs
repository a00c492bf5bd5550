//! Steps through the first N rows of the recorded run, for tools that count instructions: `replay [N]`.
#![allow(missing_docs, non_snake_case)]

#[path = "../benches/recording/mod.rs"]
mod recording;

use recording::{Recording, ROTATE};

fn main() {
    let n = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(usize::MAX);
    let recording = Recording::parse(ROTATE);
    let mut planner = recording.planner();
    let mut sum = 0.0;
    for (measurement, reference) in recording.rows.iter().take(n) {
        if let Ok(command) = planner.step(measurement, reference) {
            sum += command.tau.amax();
        }
    }
    println!("{sum}");
}
