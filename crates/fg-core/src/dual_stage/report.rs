//! What the control step says of itself.

use super::DualStagePlanner;
use crate::manipulation::force::ForceStatus;
use crate::regrasp::phase::Phase;
use crate::safety::guard::Outcome;
use nalgebra::Vector6;

impl DualStagePlanner {
    /// Writes this step's figures into the diagnostics.
    pub(super) fn diagnose(&mut self, F_des: &Vector6<f64>) {
        let d = &mut self.diagnostics;
        d.phase = self.supervisor.phase();
        d.free_finger = self.supervisor.free_finger();
        d.regrasp = self.regrasp.phase();
        d.set_downs = self.regrasp.count();
        d.governed = *self.regrasp.reference();
        d.gaits = self.supervisor.gaits();
        d.last_end = self.supervisor.last_end();
        d.threshold = self.supervisor.threshold().unwrap_or(f64::NAN);
        d.e = *self.robust.error();
        d.F_des = *F_des;
        d.f.copy_from(&self.f_prev);
        for (f_n, contact) in d.f_n.iter_mut().zip(self.grasp.contacts()) {
            *f_n = contact.f_n;
        }
        for j in 0..self.hand.n_fingers() {
            d.slip[j] = self.slip.speed(j);
        }
        d.friction = self.friction.mu();
        d.slips = self.friction.slips();
        d.qd_des.copy_from_slice(self.planner.qd_des());
        d.tau.copy_from(&self.command.tau);
    }

    /// Tells the guard how the step went.
    pub(super) fn report(&mut self) {
        let mut bounds = self.tau_min.iter().zip(self.tau_max.iter());
        self.guard.note(Outcome {
            solved: self.diagnostics.status == ForceStatus::Solved,
            box_empty: bounds.any(|(low, high)| *low > 0.0 || *high < 0.0),
            saturated: self.at_limit || self.overload(&self.psi_filtered) > self.config.gait.abort_factor,
            overdue: self.supervisor.overdue() && self.regrasp.phase() == Phase::Idle,
            aground: matches!(self.regrasp.phase(), Phase::Stand | Phase::Rest),
        });
    }
}
