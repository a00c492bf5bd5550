//! The control step on recorded measurements with anything put into them.
#![no_main]
#![allow(non_snake_case)]

#[path = "../../tests/chaos/mod.rs"]
mod chaos;
#[path = "../../benches/recording/mod.rs"]
mod recording;

use libfuzzer_sys::fuzz_target;
use recording::{Recording, ROTATE};
use std::cell::RefCell;
use std::thread_local;

thread_local! {
    static RECORDING: Recording = Recording::parse(ROTATE);
    static PLANNER: RefCell<fg_core::dual_stage::DualStagePlanner> =
        RECORDING.with(|recording| RefCell::new(recording.planner()));
}

fuzz_target!(|data: &[u8]| {
    PLANNER.with_borrow_mut(|planner| {
        RECORDING.with(|recording| chaos::drive(planner, &recording.rows, data));
    });
});
