//! The control step under any configuration that is accepted: the text up to the first zero byte is the configuration, the
//! rest is put into the measurements.
#![no_main]
#![allow(non_snake_case)]

#[path = "../../tests/chaos/mod.rs"]
mod chaos;
#[path = "../../benches/recording/mod.rs"]
mod recording;

use fg_core::config::Config;
use fg_core::dual_stage::DualStagePlanner;
use libfuzzer_sys::fuzz_target;
use recording::{Recording, ROTATE};
use std::thread_local;

thread_local! {
    static RECORDING: Recording = Recording::parse(ROTATE);
}

fuzz_target!(|data: &[u8]| {
    let mut parts = data.splitn(2, |byte| *byte == 0);
    let (text, rest) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    let Ok(config) = Config::from_json(&String::from_utf8_lossy(text)) else { return };
    RECORDING.with(|recording| {
        let (hand, controller) = (recording.hand.clone(), recording.controller.clone());
        if let Ok(mut planner) = DualStagePlanner::new(hand, controller, config) {
            chaos::drive(&mut planner, &recording.rows, &rest[..rest.len().min(64)]);
        }
    });
});
