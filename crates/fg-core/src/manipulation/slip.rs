//! Slip, felt without friction sensors, and the friction coefficient that follows from it.
//!
//! Not in the paper, which only relocates a finger that slips. The force optimum lies on the edge of its cone, so an
//! object a little more slippery than assumed is lost whatever the planner does.

use crate::config::ForceConfig;
use crate::grasp::Grasp;
use crate::hand::{HandModel, HandState};
use nalgebra::{Isometry3, Point3, Vector3};

/// Time constant of each of the two filters on the slip velocity, s: pose noise of 0.1 mm stays under the threshold.
const FILTER: f64 = 0.015;

/// Time constant over which the noise of the slip speed is learnt, s.
const NOISE_MEMORY: f64 = 1.0;
/// A slip stands out of the noise by this multiple of its root mean square; chance alone does so once in 1e5 readings.
const STANDS_OUT: f64 = 3.5;

/// Tangential velocity of each tip's material point against the object's, from joint angles and object pose alone.
#[derive(Debug, Clone)]
pub struct SlipDetector {
    dt: f64,
    previous: Option<Isometry3<f64>>,
    tips: Vec<Isometry3<f64>>,
    first: Vec<Vector3<f64>>,
    second: Vec<Vector3<f64>>,
    /// Mean square of the slip speeds of fingers that hold, (m/s)^2.
    noise: f64,
}

impl SlipDetector {
    /// A detector for `hand` at the control period `dt`.
    pub fn new(hand: &HandModel, dt: f64) -> Self {
        let n = hand.n_fingers();
        let zeros = vec![Vector3::zeros(); n];
        let tips = vec![Isometry3::identity(); n];
        Self { dt, previous: None, tips, first: zeros.clone(), second: zeros, noise: 0.0 }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.previous = None;
        self.first.fill(Vector3::zeros());
        self.second.fill(Vector3::zeros());
        self.noise = 0.0;
    }

    /// Takes no velocity over the coming step: its duration is not one period.
    pub fn skip(&mut self) {
        self.previous = None;
    }

    /// Takes this step's kinematics. `holding(j)` says whether finger `j` should stick to the object.
    pub fn update(
        &mut self,
        grasp: &Grasp,
        state: &HandState,
        X_WO: &Isometry3<f64>,
        holding: impl Fn(usize) -> bool,
    ) {
        let share = 1.0 - (-self.dt / FILTER).exp();
        for (j, contact) in grasp.contacts().iter().enumerate() {
            let X_WF = state.tip(j);
            let slip = match self.previous {
                Some(previous) if holding(j) && contact.touching => {
                    // Where the material points that touch now were one step ago, on the tip and on the object.
                    let p = Point3::from(contact.p_WC);
                    let on_tip = self.tips[j] * X_WF.inverse_transform_point(&p);
                    let on_object = previous * X_WO.inverse_transform_point(&p);
                    let motion = (on_object - on_tip) / self.dt;
                    motion - contact.n_W * contact.n_W.dot(&motion)
                }
                _ => {
                    self.first[j] = Vector3::zeros();
                    self.second[j] = Vector3::zeros();
                    Vector3::zeros()
                }
            };
            self.tips[j] = *X_WF;
            let (first, second) = (&mut self.first[j], &mut self.second[j]);
            *first += (slip - *first) * share;
            *second += (*first - *second) * share;
        }
        self.previous = Some(*X_WO);
    }

    /// The fastest slip of this step, m/s; zero where none is above `slip_speed` and stands out of the sensors' noise.
    pub fn fastest(&mut self, slip_speed: f64) -> f64 {
        let n = self.second.len();
        let fastest = (0..n).map(|j| self.speed(j)).fold(0.0, f64::max);
        let threshold = slip_speed.max(STANDS_OUT * self.noise.sqrt());
        if fastest > threshold {
            return fastest;
        }
        let mean_square = self.second.iter().map(Vector3::norm_squared).sum::<f64>() / n as f64;
        self.noise += (mean_square - self.noise) * self.dt / NOISE_MEMORY;
        0.0
    }

    /// Filtered slip speed of finger `j`, m/s.
    pub fn speed(&self, j: usize) -> f64 {
        self.second[j].norm()
    }
}

/// The friction coefficient that the force optimiser assumes: lowered at once when a finger slips, recovered slowly.
///
/// All fingers share it. Lowering it for the slipping finger alone shifts the load to others at their own limit.
#[derive(Debug, Clone)]
pub struct AdaptiveFriction {
    config: ForceConfig,
    dt: f64,
    mu: f64,
    /// Time since the last reduction, s.
    calm: f64,
    slips: u64,
}

impl AdaptiveFriction {
    /// Starts at the configured coefficient.
    pub fn new(config: &ForceConfig, dt: f64) -> Self {
        Self { mu: config.friction, calm: f64::MAX, slips: 0, dt, config: config.clone() }
    }

    /// Returns to the configured coefficient.
    pub fn reset(&mut self) {
        self.mu = self.config.friction;
        self.calm = f64::MAX;
        self.slips = 0;
    }

    /// The coefficient to assume now.
    pub fn mu(&self) -> f64 {
        self.mu
    }

    /// Reductions since the start.
    pub fn slips(&self) -> u64 {
        self.slips
    }

    /// Takes the fastest slip of this step, m/s, zero where nothing slips; true where the coefficient has changed.
    pub fn update(&mut self, fastest: f64) -> bool {
        let before = self.mu;
        let c = &self.config;
        self.calm += self.dt;
        if !c.adapt_friction {
            return false;
        }
        if fastest > 0.0 && self.calm > c.slip_hold {
            self.mu = (self.mu * c.slip_factor).max(c.friction_floor.min(c.friction));
            self.calm = 0.0;
            self.slips += 1;
        } else if self.calm > c.slip_hold {
            self.mu += (c.friction - self.mu) * self.dt / c.friction_recovery;
        }
        (self.mu - before).abs() > 0.0
    }
}
