//! The time of the measurements: whether it goes on as it should.

use super::config::SafetyConfig;
use super::{Fault, Faults};

/// What the time of a measurement says about the step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tick {
    /// Go on; so many seconds have passed since the last step.
    Step(f64),
    /// The measurement is the last one again: repeat the command.
    Repeat,
    /// Time and measurement have stood still for long: nothing is known but the last command.
    Blind,
}

/// Follows the time of the measurements. While time cannot be trusted, each step counts as one period.
#[derive(Debug, Clone)]
pub struct Clock {
    dt: f64,
    config: SafetyConfig,
    last: Option<f64>,
    /// For how long time has stood still, in periods of the control step, s.
    stalled: f64,
}

impl Clock {
    /// A clock at the control period `dt`.
    pub fn new(config: &SafetyConfig, dt: f64) -> Self {
        Self { dt, config: config.clone(), last: None, stalled: 0.0 }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.last = None;
        self.stalled = 0.0;
    }

    /// Takes the time `t` of a measurement; `changed` says whether anything else in it is new.
    pub fn tick(&mut self, t: f64, changed: impl FnOnce() -> bool, faults: &mut Faults) -> Tick {
        if !t.is_finite() {
            faults.insert(Fault::Clock);
            self.last = self.last.map(|last| last + self.dt);
            return Tick::Step(self.dt);
        }
        let elapsed = self.last.replace(t).map_or(self.dt, |last| t - last);
        if elapsed.abs() < 0.01 * self.dt {
            faults.insert(Fault::Clock);
            self.stalled = (self.stalled + self.dt).min(1.0);
            return match (self.stalled > self.config.clock_timeout + 0.5 * self.dt, changed()) {
                (false, _) => Tick::Repeat,
                (true, true) => Tick::Step(self.dt),
                (true, false) => Tick::Blind,
            };
        }
        self.stalled = 0.0;
        if elapsed < 0.0 || elapsed > self.config.clock_gap {
            faults.insert(Fault::Clock);
            return Tick::Step(self.dt);
        }
        faults.insert_if(elapsed > self.config.late * self.dt, Fault::Late);
        Tick::Step(elapsed)
    }
}
