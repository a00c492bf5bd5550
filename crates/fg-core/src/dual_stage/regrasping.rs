//! How the control step sets the object down and takes it again.

use super::DualStagePlanner;
use crate::regrasp::phase::Phase;
use crate::regrasp::view::View;
use crate::safety::SafeMode;
use crate::signals::{Measurement, Reference};

impl DualStagePlanner {
    /// Goes on with regrasping; the reference of this step for what is `asked`.
    pub(super) fn regrasp(&mut self, measurement: &Measurement, asked: &Reference) -> Reference {
        let strained = self.guard.mode() == SafeMode::Hold && self.guard.allows_gaits();
        let overdue = self.supervisor.overdue();
        let view = View {
            hand: &self.hand,
            state: &self.state,
            grasp: &self.grasp,
            q: measurement.q.as_slice(),
            X_WO: &measurement.X_WO,
            asked,
            F_des: &self.diagnostics.F_des,
            steady: self.steady.wrench(),
            psi: &self.psi_filtered,
            tau: self.command.tau.as_slice(),
            limits: self.limiter.limits(),
            friction: self.friction.mu(),
            weight: self.robust.weight(),
            grasped: self.supervisor.threshold().is_some(),
            fit: self.guard.allows_gaits(),
            stands: self.guard.mode() != SafeMode::Normal,
            weak: (0..self.hand.n_fingers()).any(|j| !self.guard.drives(j)),
            strained,
            overdue,
        };
        let orders = self.regrasp.step(&view);
        if orders.learn {
            self.robust.learn(self.steady.wrench());
        }
        if orders.seize {
            for (f, contact) in self.f_prev.as_mut_slice().chunks_exact_mut(3).zip(self.grasp.contacts()) {
                f.copy_from_slice(&[0.0, 0.0, contact.f_n]);
            }
        }
        if orders.restart {
            self.robust.reset();
            self.psi_filtered.fill(0.0);
        }
        if self.regrasp.phase().is_open() {
            self.supervisor.pause();
        }
        *self.regrasp.reference()
    }

    /// Finds out whether any finger can be spared, one finger a step, where that decides how contacts are changed.
    pub(super) fn judge_spares(&mut self) {
        let Some(k) = self.regrasp.spares().doubt() else { return };
        let F = *self.steady.wrench();
        let psi = self.slack_without(k, &F);
        let spared = psi.is_some_and(|psi| self.overload(&psi) <= 1.0 && self.regrasp.delivers(&psi));
        self.regrasp.spares().answer(spared);
    }

    /// True where gaits may begin and go on.
    pub(super) fn allows_gaits(&self) -> bool {
        self.guard.allows_gaits() && !self.regrasp.excludes_gaits()
    }

    /// True where K moves the object: where it lies, K stands still.
    pub(super) fn controls(&self) -> bool {
        let phase = self.regrasp.phase();
        !phase.lies() || phase == Phase::Check
    }

    /// True where slip tells of friction: not where nothing holds, not where the object comes to stand on its support, and
    /// not where a torque is at its limit, which a lower friction would only ask more of.
    pub(super) fn slip_tells(&self) -> bool {
        let phase = self.regrasp.phase();
        !phase.lies() && phase != Phase::Lower && (phase == Phase::Idle || !self.at_limit)
    }

    /// Drives the fingers that are off the object to their next grasp.
    pub(super) fn drive_arms(&mut self) {
        if !self.regrasp.phase().is_open() {
            return;
        }
        let of = (&self.hand, &self.state, &self.grasp);
        for j in 0..self.hand.n_fingers() {
            for at in self.hand.joints(j) {
                self.command.tau[at] = self.tau_own[at];
            }
            self.regrasp.reach().add_torque(of, j, self.command.tau.as_mut_slice());
        }
    }
}
