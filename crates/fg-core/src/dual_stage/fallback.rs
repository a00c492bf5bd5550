//! What the control step does where it cannot do as the paper says.

use super::DualStagePlanner;
use crate::diagnostics::Diagnostics;
use crate::grasp::Grasp;
use crate::signals::{Measurement, Reference};
use nalgebra::Vector6;

impl DualStagePlanner {
    /// Returns to the state after construction.
    pub fn reset(&mut self) {
        self.guard.reset();
        self.fit(self.given.clone());
        self.grasp = Grasp::new(&self.hand, self.config.gait.contact_force);
        self.quality.reset();
        self.supervisor.reset();
        self.release();
        self.forces.reset_counts();
        self.slip.reset();
        self.friction.reset();
        self.assume_friction();
        self.planner.reset();
        self.velocity_force.reset(0.0);
        self.robust.forget();
        self.regrasp.reset();
        self.posture.reset();
        self.limiter.reset();
        self.command.tau.fill(0.0);
        self.diagnostics = Diagnostics::new(&self.hand.counts());
        self.diagnostics.friction = self.friction.mu();
    }

    /// Nothing is held: torques fade to the fingers' own weight, and what was known of the grasp is forgotten.
    pub(super) fn stop(&mut self) {
        self.supervisor.abort();
        self.release();
        self.tau_own.fill(0.0);
        if self.guard.knows_joints() {
            self.hold_up();
        }
        for at in 0..self.tau_own.len() {
            self.fade(at);
        }
        self.limiter.apply(&mut self.command.tau);
        let F_des = Vector6::zeros();
        self.diagnostics.psi = F_des;
        self.diagnose(&F_des);
    }

    /// Forgets the forces on the object, and what K has learnt about it.
    fn release(&mut self) {
        self.robust.reset();
        self.steady.reset();
        self.forces.reset();
        self.probe.reset();
        self.f_prev.fill(0.0);
        self.psi_filtered.fill(0.0);
    }

    /// The wrench that K asks for; without a pose, or any number that can be used, the last one, smoothed.
    pub(super) fn wrench(&mut self, measurement: &Measurement, reference: &Reference) -> Vector6<f64> {
        if !self.guard.blind() {
            let F_des = self.robust.wrench(reference, &measurement.X_WO);
            if F_des.iter().all(|F| F.abs() < 1e6) {
                self.steady.take(&F_des);
                return F_des * self.regrasp.share();
            }
            self.robust.reset();
        }
        self.steady.wrench() * self.regrasp.share()
    }

    /// Lets go of fingers of which neither angles nor contact are known.
    pub(super) fn damp_fingers(&mut self) {
        for j in 0..self.hand.n_fingers() {
            if self.guard.damps(j) {
                self.hand.joints(j).for_each(|at| self.fade(at));
            }
        }
    }

    /// Leaves fingers without power to their own weight, and tests their motors while there is something to see it by.
    pub(super) fn test_motors(&mut self) {
        let blind = self.guard.blind();
        for j in 0..self.hand.n_fingers() {
            if !self.guard.drives(j) {
                for at in self.hand.joints(j) {
                    let test = self.guard.motor_test(j, at).filter(|_| !blind);
                    self.command.tau[at] = test.unwrap_or(self.tau_own[at]);
                }
            }
        }
    }

    /// Moves torque `at` towards the finger's own weight and motion.
    fn fade(&mut self, at: usize) {
        let own = self.tau_own[at];
        self.command.tau[at] = own + (self.limiter.previous()[at] - own) * self.fade;
    }
}
