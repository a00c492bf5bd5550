//! The parsers of configuration, hand and controller artefact: any text is accepted or refused, and what is accepted works.
#![no_main]

use fg_core::config::Config;
use fg_core::hand::{HandModel, HandState};
use fg_core::manipulation::robust::Controller;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let text = String::from_utf8_lossy(data);
    if let Ok(config) = Config::from_json(&text) {
        let again = serde_json::to_string(&config).expect("a configuration");
        assert_eq!(Config::from_json(&again).expect("a valid configuration"), config);
    }
    if let Ok(hand) = HandModel::from_json(&text) {
        let mut state = HandState::new(&hand);
        state.update(&hand, &vec![0.1; hand.n_q()]);
    }
    if let Ok(mut controller) = Controller::from_json(&text) {
        let e = nalgebra::Vector6::repeat(1e-3);
        controller.advance(&e, &e);
        let _ = controller.output(&e);
    }
});
