//! What the fuzzers have found worth keeping (`fuzz/corpus`), on a stable toolchain.
#![allow(non_snake_case)] // the paper's letters, as in fg-core

mod chaos;
#[path = "../benches/recording/mod.rs"]
mod recording;

use fg_core::config::Config;
use fg_core::dual_stage::DualStagePlanner;
use fg_core::hand::HandModel;
use fg_core::manipulation::robust::Controller;
use recording::{Recording, ROTATE};
use std::path::Path;

fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let files = std::fs::read_dir(folder).expect("a corpus").map(|entry| entry.expect("a file").path());
    let contents: Vec<_> = files.map(|path| std::fs::read(path).expect("readable")).collect();
    assert!(!contents.is_empty());
    contents
}

#[test]
fn commands_are_limited_on_every_input() {
    let recording = Recording::parse(ROTATE);
    let mut planner = recording.planner();
    for data in corpus("step") {
        chaos::drive(&mut planner, &recording.rows, &data);
    }
}

#[test]
fn commands_are_limited_under_every_configuration_that_is_accepted() {
    let recording = Recording::parse(ROTATE);
    let mut accepted = 0;
    for data in corpus("step_any_config") {
        let mut parts = data.splitn(2, |byte| *byte == 0);
        let (text, rest) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
        let Ok(config) = Config::from_json(&String::from_utf8_lossy(text)) else { continue };
        let planner = DualStagePlanner::new(recording.hand.clone(), recording.controller.clone(), config);
        if let Ok(mut planner) = planner {
            accepted += 1;
            chaos::drive(&mut planner, &recording.rows, rest);
        }
    }
    assert!(accepted > 0);
}

#[test]
fn parsers_accept_or_refuse_every_text() {
    let mut accepted = 0;
    for data in corpus("parsers") {
        let text = String::from_utf8_lossy(&data);
        accepted += usize::from(Config::from_json(&text).is_ok());
        accepted += usize::from(HandModel::from_json(&text).is_ok());
        accepted += usize::from(Controller::from_json(&text).is_ok());
    }
    assert!(accepted >= 3);
}
