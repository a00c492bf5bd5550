//! A recorded run under the planner, with faults put into its measurements and every command checked.
#![allow(dead_code, reason = "each user needs its own part")]

use super::recording::{Recording, ROTATE};
use fg_core::config::Config;
use fg_core::dual_stage::DualStagePlanner;
use fg_core::safety::{Fault, SafeMode};
use fg_core::signals::{Measurement, Reference};
use nalgebra::DVector;
use std::ops::Range;

/// Step at which a fault begins: the object has been lifted and turns, all fingers hold it.
pub const BEGIN: usize = 1500;
/// The safe mode's recovery time, in steps, with some to spare.
pub const RECOVERY: usize = 60;

/// Replays a run and checks every command.
pub struct Replay {
    pub recording: Recording,
    pub planner: DualStagePlanner,
    pub tau: DVector<f64>,
}

impl Replay {
    pub fn new(change: impl FnOnce(&mut Config)) -> Self {
        let recording = Recording::parse(ROTATE);
        let planner = recording.planner_with(change);
        let tau = DVector::zeros(12);
        Self { recording, planner, tau }
    }

    /// A replay in which all was well until [`BEGIN`].
    pub fn under_way() -> Self {
        Self::under_way_with(|_| ())
    }

    pub fn under_way_with(change: impl FnOnce(&mut Config)) -> Self {
        let mut replay = Self::new(change);
        replay.run(0..BEGIN, |_, _, _| ());
        assert_eq!(replay.mode(), SafeMode::Normal);
        replay
    }

    pub fn mode(&self) -> SafeMode {
        self.planner.diagnostics().safe_mode
    }

    pub fn has(&self, fault: Fault) -> bool {
        self.planner.diagnostics().faults.contains(fault)
    }

    /// Steps through part of the run with the fault `spoil(k, ..)`. The motors give the torques that were commanded.
    pub fn run(
        &mut self,
        steps: Range<usize>,
        mut spoil: impl FnMut(usize, &mut Measurement, &mut Reference),
    ) -> &mut Self {
        for k in steps {
            let (mut measurement, mut reference) = self.recording.rows[k].clone();
            // Motors that do as they are told: with a fault the command is not the recorded one.
            measurement.tau.copy_from(&self.tau);
            spoil(k, &mut measurement, &mut reference);
            let tau = self.planner.step(&measurement, &reference).unwrap().tau.clone();
            let config = self.planner.config();
            let change = config.force.tau_rate_max / config.rate_hz;
            assert!(tau.amax() <= config.force.tau_max.unwrap(), "step {k}: {tau}");
            assert!((&tau - &self.tau).amax() <= change * (1.0 + 1e-12), "step {k}: {tau}");
            self.tau = tau;
        }
        self
    }

    /// Puts the fault `spoil` into the 200 steps from [`BEGIN`]: `fault` must be reported within `delay` steps and to the
    /// end, the mode become `mode`, and both be gone after the recovery time.
    pub fn suffers(
        &mut self,
        fault: Fault,
        mode: SafeMode,
        delay: usize,
        mut spoil: impl FnMut(usize, &mut Measurement, &mut Reference),
    ) {
        let end = BEGIN + 200;
        self.run(BEGIN..BEGIN + delay, &mut spoil);
        for k in BEGIN + delay..end {
            self.run(k..k + 1, &mut spoil);
            assert!(self.has(fault), "step {k}: {:?}", self.planner.diagnostics().faults);
        }
        assert_eq!(self.mode(), mode);
        self.run(end..end + RECOVERY, |_, _, _| ());
        assert!(self.planner.diagnostics().faults.is_empty());
        assert_eq!(self.mode(), SafeMode::Normal);
    }

    /// Puts the fault into a few steps: it must be reported, and change neither the mode nor, by more than `change` N m, any
    /// torque.
    pub fn rides_through(
        &mut self,
        fault: Fault,
        length: usize,
        change: f64,
        mut spoil: impl FnMut(usize, &mut Measurement, &mut Reference),
    ) {
        let mut well = Self::under_way();
        for k in BEGIN..BEGIN + 100 {
            well.run(k..k + 1, |_, _, _| ());
            if k < BEGIN + length {
                self.run(k..k + 1, &mut spoil);
                assert!(self.has(fault), "step {k}: {:?}", self.planner.diagnostics().faults);
            } else {
                self.run(k..k + 1, |_, _, _| ());
            }
            assert_eq!(self.mode(), SafeMode::Normal);
            let difference = (&self.tau - &well.tau).amax();
            assert!(difference <= change, "step {k}: {difference}");
        }
    }
}
