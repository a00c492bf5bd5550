//! Which finger is freed, and how fast the desired motion goes on meanwhile.

use super::DualStagePlanner;
use crate::config::GaitEvent;
use crate::grasp::Scene;
use crate::manipulation::force::ForceProblem;
use crate::signals::{Measurement, Reference};
use crate::spatial::{angular, linear};
use nalgebra::Vector6;

/// A finger has come home where it is as near as this share of the contacts' radius.
const HOME: f64 = 0.03;

impl DualStagePlanner {
    /// True where the fingers' reserves start gaits.
    pub(super) fn by_reserve(&self) -> bool {
        self.config.gait.enabled && self.config.gait.event != GaitEvent::Quality
    }

    /// The reference to follow: no faster than the fingers' reserves allow.
    pub(super) fn govern(&mut self, reference: &Reference) -> Reference {
        if !(self.by_reserve() && self.config.gait.govern) {
            return *reference;
        }
        // A finger that is at its end and goes next is no reason to slow down: its unloading takes that long.
        let slack = self.schedule.slack() + self.config.gait.unload_time;
        self.governor.update(slack, self.schedule.waiting());
        self.governor.govern(reference)
    }

    /// Brings the fingers' reserves and the schedule of gaits up to date.
    pub(super) fn look_ahead(&mut self, measurement: &Measurement) {
        if !self.by_reserve() {
            return;
        }
        let scene = scene!(self, measurement);
        let free = self.supervisor.free_finger();
        self.reserve.update(&scene, &self.V_asked, free);
        let (reserve, size) = (&self.reserve, self.reserve.size().max(1e-6));
        let lead = self.config.gait.lead * self.schedule.round_time();
        let gone = |j| {
            let way = reserve.gone(j, &scene) - reserve.goal(j, lead, &scene);
            if reserve.turns() {
                way / size
            } else {
                0.0
            }
        };
        self.schedule.update(|j| reserve.seconds(j), gone, free);
    }

    /// Sends a finger home that touches the object with its link, or that has looked for it in vain.
    ///
    /// A tip that feels nothing while its finger is loaded and does not advance is a dead sensor, or the finger lies on the object
    /// with its link; where its outline says that a link is at the object, it is the latter.
    pub(super) fn retreat(&mut self, measurement: &Measurement) {
        if !(self.by_reserve() && self.reserve.turns()) {
            return;
        }
        let scene = scene!(self, measurement);
        let vain = self.supervisor.vain_finger();
        let silent = |j: &usize| self.guard.silent(*j) && self.reserve.link_near(*j, &scene);
        let free = self.supervisor.free_finger();
        let lying = (0..self.hand.n_fingers()).filter(|_| free.is_none()).find(silent);
        let goes = lying.or(vain).is_some_and(|k| self.supervisor.retreat(k));
        if goes {
            self.beyond = 0.0;
            self.planner.reset();
            self.velocity_force.reset(0.0);
        }
    }

    /// True where the finger that slides home is there.
    pub(super) fn arrived(&self, measurement: &Measurement) -> bool {
        let Some(k) = self.supervisor.homing_finger() else { return false };
        let scene = scene!(self, measurement);
        let (way, n_W) = (self.reserve.way(k, self.beyond, &scene), scene.grasp.contact(k).n_W);
        (way - n_W * n_W.dot(&way)).norm() < HOME * self.reserve.size()
    }

    /// Frees a finger where an event asks for it and the force optimiser finds that the others can hold.
    pub(super) fn choose_finger(&mut self, measurement: &Measurement, F_des: &Vector6<f64>) {
        if self.by_reserve() && self.supervisor.ready() {
            if let Some(k) = self.schedule.asks() {
                let load = self.load_without(k, F_des);
                self.schedule.answer(k, load);
                return;
            }
            if let Some(k) = self.schedule.choice(|j| self.reserve.seconds(j)) {
                let scene = scene!(self, measurement);
                if !self.reserve.way_clear(k, &scene) {
                    self.schedule.answer(k, f64::INFINITY);
                    return;
                }
                let lead = self.config.gait.lead * self.schedule.round_time();
                self.beyond = self.reserve.goal(k, lead, &scene);
                self.schedule.start(k);
                self.supervisor.start(k, &self.grasp, true);
                return;
            }
        }
        if self.config.gait.event != GaitEvent::Reserve {
            self.choose_by_quality(measurement, F_des);
        }
    }

    /// The paper's event and choice.
    fn choose_by_quality(&mut self, measurement: &Measurement, F_des: &Vector6<f64>) {
        let scene = scene!(self, measurement);
        let (delta, quality, planner) = (self.config.gait.delta, &self.quality, &mut self.planner);
        let promises = |k| planner.potential(k, quality, &scene) > delta;
        let now = self.diagnostics.quality;
        let Some(k) = self.supervisor.candidate(&now, quality, &scene, promises) else { return };
        if self.load_without(k, F_des) <= 1.0 {
            self.schedule.start(k);
            self.supervisor.start(k, &self.grasp, false);
        } else {
            self.supervisor.refuse(k);
        }
    }

    /// What the fingers fail to deliver, as a multiple of what a gait allows.
    pub(super) fn overload(&self, psi: &Vector6<f64>) -> f64 {
        let gait = &self.config.gait;
        (linear(psi).norm() / gait.slack_force).max(angular(psi).norm() / gait.slack_torque)
    }

    /// Weights of force and torque in Psi.
    pub(super) fn wrench_scale(&self) -> Vector6<f64> {
        let w = 1.0 / self.config.force.torque_length;
        Vector6::new(1.0, 1.0, 1.0, w, w, w)
    }

    /// What the other fingers fail to deliver without finger `k`, as a multiple of what a gait allows.
    fn load_without(&mut self, k: usize, F_des: &Vector6<f64>) -> f64 {
        self.f_limit.fill(self.config.force.f_n_max);
        self.f_limit[k] = 0.0;
        let scale = self.wrench_scale();
        let F = F_des.component_mul(&scale);
        let psi =
            self.probe.solve(&force_problem!(self, F)).map(|solution| solution.psi.component_div(&scale));
        psi.map_or(f64::INFINITY, |psi| self.overload(&psi))
    }
}
