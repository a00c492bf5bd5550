//! Fingers off the object: each follows a path of its tip with a servo on its joints.
//!
//! The desired angles are integrated from the tip's desired motion, so that they are smooth and need no inverse kinematics
//! in closed form. The servo knows the finger's inertia and damping, and takes the velocity from differences of the encoders.

use crate::hand::{HandModel, HandState};
use crate::regrasp::config::RegraspConfig;
use nalgebra::Vector3;

/// Rate at which the desired tip returns to its path, 1/s.
const PATH_RATE: f64 = 30.0;
/// Least distance of a desired angle to its limit, rad.
const LIMIT_MARGIN: f64 = 0.01;
/// Largest desired speed of a joint, rad/s.
const SPEED_MAX: f64 = 15.0;

/// See the module. All memory is allocated in [`Arms::new`].
#[derive(Debug, Clone)]
pub struct Arms {
    dt: f64,
    bandwidth: f64,
    /// Share of the past in one step of the velocity filter.
    memory: f64,
    /// Kinematics at the desired angles.
    ghost: HandState,
    q_des: Vec<f64>,
    qd_des: Vec<f64>,
    qdd_des: Vec<f64>,
    /// Measured angles of the last step, and filtered velocities.
    q: Vec<f64>,
    qd: Vec<f64>,
    known: bool,
}

impl Arms {
    /// Servos for `hand` at the control period `dt`.
    pub fn new(hand: &HandModel, config: &RegraspConfig, dt: f64) -> Self {
        let zeros = vec![0.0; hand.n_q()];
        Self {
            dt,
            bandwidth: config.bandwidth,
            memory: if config.velocity_filter > 0.0 { (-dt / config.velocity_filter).exp() } else { 0.0 },
            ghost: HandState::new(hand),
            q_des: zeros.clone(),
            qd_des: zeros.clone(),
            qdd_des: zeros.clone(),
            q: zeros.clone(),
            qd: zeros,
            known: false,
        }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.known = false;
        self.qd.fill(0.0);
        self.qd_des.fill(0.0);
        self.qdd_des.fill(0.0);
    }

    /// Takes the measured angles of this step, rad.
    pub fn observe(&mut self, q: &[f64]) {
        for ((qd, last), q) in self.qd.iter_mut().zip(&mut self.q).zip(q) {
            let now = if self.known { (q - *last) / self.dt } else { 0.0 };
            *qd = self.memory * *qd + (1.0 - self.memory) * now;
            *last = *q;
        }
        self.known = true;
    }

    /// Filtered velocity of joint `at`, rad/s.
    pub fn velocity(&self, at: usize) -> f64 {
        self.qd[at]
    }

    /// Desired velocities of all joints, rad/s.
    pub fn qd_des(&self) -> &[f64] {
        &self.qd_des
    }

    /// Desired place of the tip of finger `j`, m in W; valid after [`Arms::settle`].
    pub fn tip(&self, j: usize) -> Vector3<f64> {
        self.ghost.tip(j).translation.vector
    }

    /// Lets the desired angles of finger `j` start from the measured ones, at rest.
    pub fn start(&mut self, hand: &HandModel, j: usize) {
        for at in hand.joints(j) {
            self.q_des[at] = self.q[at];
            self.qd_des[at] = 0.0;
            self.qdd_des[at] = 0.0;
        }
    }

    /// Recomputes the desired tips from the desired angles; once a step, before any [`Arms::follow`].
    pub fn settle(&mut self, hand: &HandModel) {
        self.ghost.update(hand, &self.q_des);
    }

    /// Moves the desired angles of finger `j` by one step so that the tip comes to `p_W` and moves on at `v_W`.
    pub fn follow(&mut self, hand: &HandModel, j: usize, p_W: &Vector3<f64>, v_W: &Vector3<f64>) {
        let tip = self.tip(j);
        let v = v_W + (p_W - tip) * PATH_RATE;
        let y = self.ghost.solve_gram(j, &tip, &v);
        for at in hand.joints(j) {
            let c = hand.coordinate(at);
            let qd = self.ghost.jacobian_column(at, &tip).dot(&y).clamp(-SPEED_MAX, SPEED_MAX);
            let margin = LIMIT_MARGIN.min(0.25 * (c.upper - c.lower));
            let q = (self.q_des[at] + qd * self.dt).clamp(c.lower + margin, c.upper - margin);
            let qd = (q - self.q_des[at]) / self.dt;
            self.qdd_des[at] = (qd - self.qd_des[at]) / self.dt;
            self.qd_des[at] = qd;
            self.q_des[at] = q;
        }
    }

    /// Lets the desired angles of finger `j` stand.
    pub fn halt(&mut self, hand: &HandModel, j: usize) {
        for at in hand.joints(j) {
            self.qd_des[at] = 0.0;
            self.qdd_des[at] = 0.0;
        }
    }

    /// Adds to `tau`, of all joints, what makes finger `j` follow: M (qdd_des + 2 w (qd_des - qd) + w^2 (q_des - q)) and the
    /// joints' own drag, N m.
    pub fn add_servo(&self, hand: &HandModel, state: &HandState, j: usize, tau: &mut [f64]) {
        let w = self.bandwidth;
        add_inertial(hand, state, j, tau, |at| {
            self.qdd_des[at]
                + 2.0 * w * (self.qd_des[at] - self.qd[at])
                + w * w * (self.q_des[at] - self.q[at])
        });
        for at in hand.joints(j) {
            tau[at] += hand.coordinate(at).drag(self.qd_des[at], DRAG_SPEED);
        }
    }

    /// Adds to `tau` what brakes finger `j`: -2 w M qd, N m.
    pub fn add_brake(&self, hand: &HandModel, state: &HandState, j: usize, tau: &mut [f64]) {
        add_inertial(hand, state, j, tau, |at| -2.0 * self.bandwidth * self.qd[at]);
    }
}

/// Desired joint speed from which dry friction is overcome in full, rad/s.
const DRAG_SPEED: f64 = 0.05;

/// Adds M a to `tau`, M the inertia of finger `j`, `a` the acceleration of each joint.
fn add_inertial(hand: &HandModel, state: &HandState, j: usize, tau: &mut [f64], a: impl Fn(usize) -> f64) {
    let M = state.inertia(hand, j);
    let joints = hand.joints(j);
    for (row, at) in joints.clone().enumerate() {
        tau[at] += joints.clone().enumerate().map(|(column, k)| M[(row, column)] * a(k)).sum::<f64>();
    }
}
