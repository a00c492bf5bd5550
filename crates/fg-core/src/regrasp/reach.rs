//! The fingers between two grasps: they leave the object, go round it, come in until they feel it, and wait for the others.

use super::arms::Arms;
use super::config::RegraspConfig;
use super::path::{unwrapped, Axis, Place, Way};
use super::view::View;
use super::{Scale, G};
use crate::hand::HandModel;
use nalgebra::Vector3;

/// A finger that waits and feels nothing for this long comes in again, s.
const LOST_AFTER: f64 = 0.03;
/// A finger that comes in leads its tip by at most this, r: it cannot push hard on what it does not feel.
const LEAD: f64 = 0.06;

/// One finger.
#[derive(Debug, Clone, Copy, Default)]
struct Finger {
    /// Where its tip was at the first grasp.
    home: Place,
    way: Way,
    /// It feels the object, and presses with the force that it waits with.
    waits: bool,
    /// For how long it has not felt the object, s.
    off: f64,
}

/// See the module. All memory is allocated in [`Reach::new`].
#[derive(Debug, Clone)]
pub struct Reach {
    config: RegraspConfig,
    dt: f64,
    arms: Arms,
    fingers: Vec<Finger>,
    radius: f64,
    /// The axis about which they go: where the object lay when they left it, so that its noise does not shake them.
    axis: Axis,
    /// Largest distance of a tip's centre from the axis in any grasp, m.
    farthest: f64,
    /// Duration of the way, s.
    time: f64,
    /// For how long all fingers have felt the object, s.
    waits: f64,
    /// Force with which fingers wait, N.
    force: f64,
}

impl Reach {
    /// The fingers of `hand` at the control period `dt`.
    pub fn new(hand: &HandModel, config: &RegraspConfig, dt: f64) -> Self {
        Self {
            config: config.clone(),
            dt,
            arms: Arms::new(hand, config, dt),
            fingers: vec![Finger::default(); hand.n_fingers()],
            radius: 0.0,
            axis: Axis::new(&Vector3::zeros(), &hand.up()),
            farthest: 0.0,
            time: 0.0,
            waits: 0.0,
            force: 0.0,
        }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.arms.reset();
        self.fingers.fill(Finger::default());
        self.farthest = 0.0;
    }

    /// Takes the joint angles of this step, rad.
    pub fn observe(&mut self, q: &[f64]) {
        self.arms.observe(q);
    }

    /// Filtered velocity of joint `at`, rad/s.
    pub fn velocity(&self, at: usize) -> f64 {
        self.arms.velocity(at)
    }

    /// Desired velocities of all joints, rad/s, while the fingers are off the object.
    pub fn qd_des(&self) -> &[f64] {
        self.arms.qd_des()
    }

    /// For how long all fingers have felt the object, s.
    pub fn waits(&self) -> f64 {
        self.waits
    }

    /// Takes the measure of the first grasp; None where it has none, the contacts being on the axis.
    pub fn measure(&mut self, view: &View<'_>, up: &Vector3<f64>) -> Option<Scale> {
        let axis = Axis::new(&view.X_WO.translation.vector, up);
        let n = self.fingers.len() as f64;
        let radius = view.grasp.contacts().iter().map(|c| axis.place(&c.p_WC).radius).sum::<f64>() / n;
        for (j, finger) in self.fingers.iter_mut().enumerate() {
            finger.home = axis.place(&view.state.tip(j).translation.vector);
        }
        self.radius = radius;
        self.remember(view, up);
        (radius > 1e-4).then_some(Scale { radius, weight: view.weight })
    }

    /// Remembers how far out the tips of this grasp are.
    pub fn remember(&mut self, view: &View<'_>, up: &Vector3<f64>) {
        let axis = Axis::new(&view.X_WO.translation.vector, up);
        for j in 0..self.fingers.len() {
            self.farthest = self.farthest.max(axis.place(&view.state.tip(j).translation.vector).radius);
        }
    }

    /// The fingers leave the object at `axis` for places `azimuth` rad round from the first grasp; with `clear`, they stay
    /// clear of it where they are.
    pub fn leave(&mut self, view: &View<'_>, axis: Axis, azimuth: f64, clear: bool) {
        self.axis = axis;
        let r = self.radius;
        let far = self.farthest + self.config.clearance * r;
        let near = self.farthest + self.config.near * r;
        self.time = self.config.swing_time;
        self.waits = 0.0;
        for (j, finger) in self.fingers.iter_mut().enumerate() {
            self.arms.start(view.hand, j);
            let mut from = axis.place(&view.state.tip(j).translation.vector);
            from.angle = unwrapped(from.angle, finger.home.angle);
            let to = if clear {
                Place { radius: far, ..from }
            } else {
                Place { radius: near, angle: finger.home.angle + azimuth, height: finger.home.height }
            };
            *finger = Finger { way: Way { from, to, clear: far }, waits: false, off: 0.0, ..*finger };
            self.time = self.time.max(finger.way.time(self.config.swing_acceleration * G));
        }
    }

    /// Moves the fingers along their ways, `elapsed` seconds from their beginning; true at the end.
    pub fn go(&mut self, view: &View<'_>, elapsed: f64) -> bool {
        let axis = self.axis;
        self.arms.settle(view.hand);
        let ds = self.dt / self.time;
        let s = elapsed / self.time;
        for (j, finger) in self.fingers.iter().enumerate() {
            let (now, next) = (axis.point(&finger.way.at(s)), axis.point(&finger.way.at(s + ds)));
            self.arms.follow(view.hand, j, &now, &((next - now) / self.dt));
        }
        s >= 1.0
    }

    /// The fingers come in at `speed`, m/s, until they feel `touch` N, and wait with `wait` N.
    pub fn approach(&mut self, view: &View<'_>, speed: f64, touch: f64, wait: f64) {
        let axis = self.axis;
        self.arms.settle(view.hand);
        self.force = wait;
        let mut all = true;
        for (j, finger) in self.fingers.iter_mut().enumerate() {
            let contact = view.grasp.contact(j);
            finger.off = if contact.touching { 0.0 } else { finger.off + self.dt };
            if !finger.waits && contact.f_n > touch {
                finger.waits = true;
                self.arms.halt(view.hand, j);
            } else if finger.waits && finger.off > LOST_AFTER {
                finger.waits = false;
                self.arms.start(view.hand, j);
            }
            all &= finger.waits;
            if finger.waits {
                continue;
            }
            let (tip, desired) = (view.state.tip(j).translation.vector, self.arms.tip(j));
            let at = axis.place(&desired);
            let inward = -axis.outward(at.angle);
            let ahead = (desired - tip).dot(&inward) > LEAD * self.radius;
            let v = if ahead { Vector3::zeros() } else { inward * speed };
            // Angle and height stay on the way's.
            let goal = axis.point(&Place { radius: at.radius, ..finger.way.to });
            self.arms.follow(view.hand, j, &goal, &v);
        }
        self.waits = if all { self.waits + self.dt } else { 0.0 };
    }

    /// The fingers stand still.
    pub fn halt(&mut self, view: &View<'_>) {
        for j in 0..self.fingers.len() {
            self.arms.halt(view.hand, j);
        }
    }

    /// Adds to `tau`, of all joints, what drives finger `j`, N m.
    pub fn add_torque(
        &self,
        view_of: (&HandModel, &crate::hand::HandState, &crate::grasp::Grasp),
        j: usize,
        tau: &mut [f64],
    ) {
        let (hand, state, grasp) = view_of;
        if !self.fingers[j].waits {
            self.arms.add_servo(hand, state, j, tau);
            return;
        }
        self.arms.add_brake(hand, state, j, tau);
        let contact = grasp.contact(j);
        for at in hand.joints(j) {
            tau[at] += self.force * contact.n_W.dot(&state.jacobian_column(at, &contact.p_WC));
        }
    }
}
