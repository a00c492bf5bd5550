//! The velocity-level gait planner: the linear program (4), at each step.

use crate::config::GaitConfig;
use crate::gait::quality::QualityModel;
use crate::grasp::Scene;
use crate::hand::HandModel;
use crate::solver::knapsack::gait_lp;
use crate::spatial::{angular, linear};

/// What the LP found at one step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct GaitRate {
    /// Q-dot at the solution, 1/s.
    pub Q_dot: f64,
    /// False where no velocity meets all constraints; then (4c) is met as well as the box allows.
    pub feasible: bool,
}

/// Solves eq. (4) for the free finger. Allocated once.
#[derive(Debug, Clone)]
pub struct GaitPlanner {
    config: GaitConfig,
    /// Number of joints of each finger, and of the one that `a` is of: the vectors below have room for the largest.
    counts: Vec<usize>,
    n: usize,
    /// Largest change of a joint velocity in one step, rad/s.
    sigma: f64,
    /// Desired joint velocities of the free finger, rad/s: qd_des,k.
    qd_des: Vec<f64>,
    c: Vec<f64>,
    a: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    centre: Vec<f64>,
}

impl GaitPlanner {
    /// A planner for `hand` at the control period `dt`.
    pub fn new(hand: &HandModel, config: &GaitConfig, dt: f64) -> Self {
        let zeros = vec![0.0; hand.most_joints()];
        Self {
            // The paper's sigma belongs to its 2 ms; sigma / T_s is the acceleration limit that is meant.
            sigma: config.sigma * dt / 0.002,
            config: config.clone(),
            counts: hand.counts(),
            n: 0,
            qd_des: zeros.clone(),
            c: zeros.clone(),
            a: zeros.clone(),
            lower: zeros.clone(),
            upper: zeros.clone(),
            centre: zeros,
        }
    }

    /// Takes the lengths that fit the grasp.
    pub fn fit(&mut self, config: &GaitConfig) {
        self.config = config.clone();
    }

    /// Desired joint velocities of the free finger, rad/s; zero behind its last joint, where other fingers have more.
    pub fn qd_des(&self) -> &[f64] {
        &self.qd_des
    }

    /// Stops the finger.
    pub fn reset(&mut self) {
        self.qd_des.fill(0.0);
    }

    /// Moves `qd_des` to the solution of (4) for finger `k`.
    ///
    /// Deviation: (4c) reads n^T J qd = n^T v with v the desired velocity of the surface, which turns and tilts under the
    /// finger, instead of zero; a finger that has lost the surface moves towards it at the approach speed. The tangential
    /// part of qd is what the LP finds; the normal part is the smallest that follows the surface.
    pub fn update(&mut self, k: usize, quality: &QualityModel, scene: &Scene<'_>) -> GaitRate {
        self.constrain_to_surface(k, scene);
        let n = self.n;
        quality.rate_coefficients(k, scene, &self.qd_des[..n], &mut self.c[..n]);
        self.rate_box();
        let outcome =
            gait_lp(&self.c[..n], &self.a[..n], &self.lower[..n], &self.upper[..n], &mut self.qd_des[..n]);
        self.follow_surface(k, scene);
        GaitRate { Q_dot: outcome.value, feasible: outcome.feasible }
    }

    /// Moves `qd_des` to the velocity that follows the surface, or finds it again, and does nothing else.
    pub fn press(&mut self, k: usize, scene: &Scene<'_>) {
        self.constrain_to_surface(k, scene);
        self.qd_des.fill(0.0);
        self.follow_surface(k, scene);
    }

    fn follow_surface(&mut self, k: usize, scene: &Scene<'_>) {
        let contact = scene.grasp.contact(k);
        let arm = contact.p_WC - scene.X_WO.translation.vector;
        let surface = linear(scene.V_WD) + angular(scene.V_WD).cross(&arm);
        let follow = if self.config.follow_surface { contact.n_W.dot(&surface) } else { 0.0 };
        let approach = if contact.touching { 0.0 } else { self.config.approach_speed };
        let aa: f64 = self.a[..self.n].iter().map(|a| a * a).sum();
        let scale = if aa > 1e-12 { (follow + approach) / aa } else { 0.0 };
        let limit = self.config.qd_max;
        for (qd, a) in self.qd_des.iter_mut().zip(&self.a[..self.n]) {
            *qd = (*qd + a * scale).clamp(-limit, limit);
        }
    }

    /// The best Q-dot that finger `k` could reach without the acceleration limit: what freeing it promises, 1/s.
    pub fn potential(&mut self, k: usize, quality: &QualityModel, scene: &Scene<'_>) -> f64 {
        self.constrain_to_surface(k, scene);
        let n = self.n;
        self.centre.fill(0.0);
        quality.rate_coefficients(k, scene, &self.centre[..n], &mut self.c[..n]);
        self.lower.fill(-self.config.qd_max);
        self.upper.fill(self.config.qd_max);
        gait_lp(&self.c[..n], &self.a[..n], &self.lower[..n], &self.upper[..n], &mut self.centre[..n]).value
    }

    /// The row n_pk^T J of (4c).
    fn constrain_to_surface(&mut self, k: usize, scene: &Scene<'_>) {
        let contact = scene.grasp.contact(k);
        self.n = self.counts[k];
        for (at, a) in scene.state.joints(k).zip(&mut self.a) {
            *a = contact.n_W.dot(&scene.state.jacobian_column(at, &contact.p_WC));
        }
    }

    /// The box of (4b) and (4d). The contact moves on the surface, so the tangent plane turns and the box around the
    /// previous velocity may miss it; around that velocity's projection on the plane it never does.
    fn rate_box(&mut self) {
        self.centre.copy_from_slice(&self.qd_des);
        if self.config.project_rate_box {
            let a = &self.a[..self.n];
            let aa: f64 = a.iter().map(|a| a * a).sum();
            let av: f64 = a.iter().zip(&self.qd_des).map(|(a, v)| a * v).sum();
            if aa > 1e-12 {
                for (centre, a) in self.centre.iter_mut().zip(a) {
                    *centre -= a * av / aa;
                }
            }
        }
        let limit = self.config.qd_max;
        for ((lower, upper), centre) in self.lower.iter_mut().zip(&mut self.upper).zip(&self.centre) {
            let centre = centre.clamp(-limit, limit);
            *lower = (centre - self.sigma).max(-limit);
            *upper = (centre + self.sigma).min(limit);
        }
    }
}
