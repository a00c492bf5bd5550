//! The tactile sensors as a whole, against the joint torques.
//!
//! A finger that stands presses with what its motors give beyond its own weight and motion: the force f at its contact
//! fulfils J J^T f = J (tau - tau_own), and its part along the normal is what the tactile sensor should feel. A sensor that
//! gives another unit, or swapped axes, tells something else, and so do all of its kind. One finger alone may be pushed, or
//! have a weak sensor, which other checks see; most of them together are wired or scaled wrongly.
//! That does not change on the way: once they have agreed under load for a while, nothing is compared any more.

use super::config::SafetyConfig;
use super::debounce::Debounce;
use crate::signals::Tactile;
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Time constant of the filter on both forces, s.
const FILTER: f64 = 0.1;
/// A contradiction must last for so long, s, which an impact or a push does not.
const LASTS: f64 = 0.3;
/// Both must agree for so long, s, under so many times the margin ...
const AGREED: f64 = 0.3;
/// ... which is enough to tell a tenth of a force from all of it.
const LOADED: f64 = 4.0;
/// Added to J J^T, m^2: a finger near a singularity tells little about the force.
const LEVEL: f64 = 1e-7;

/// See the module. Allocated once.
#[derive(Debug, Clone)]
pub struct EffortGuard {
    margin: f64,
    ratio: f64,
    share: f64,
    dt: f64,
    /// Filtered normal force that is felt, and that the torques tell, N.
    felt: Vec<f64>,
    told: Vec<f64>,
    /// Fingers in which both have been compared for a while.
    seen: Vec<f64>,
    wrong: Debounce,
    /// For how long both have agreed under load, s.
    agreed: f64,
    clear: f64,
}

/// What the last step knew about the fingers' forces.
#[derive(Debug, Clone, Copy)]
pub struct Efforts<'a> {
    /// Measured joint torques, and those that the fingers need for their own weight and motion, N m.
    pub tau: &'a [f64],
    /// See above.
    pub own: &'a [f64],
    /// Hand Jacobian in the contact frames, z along the normal into the object.
    pub J: &'a DMatrix<f64>,
}

impl EffortGuard {
    /// A guard for `n` fingertips at the control period `dt`.
    pub fn new(n: usize, config: &SafetyConfig, dt: f64) -> Self {
        Self {
            margin: config.effort_margin,
            ratio: config.effort_ratio,
            share: 1.0 - (-dt / FILTER).exp(),
            dt,
            felt: vec![0.0; n],
            told: vec![0.0; n],
            seen: vec![0.0; n],
            wrong: Debounce::default(),
            agreed: 0.0,
            clear: config.recovery_time,
        }
    }

    /// Takes the thresholds that fit the grasp.
    pub fn fit(&mut self, config: &SafetyConfig) {
        self.margin = config.effort_margin;
        self.ratio = config.effort_ratio;
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.felt.fill(0.0);
        self.told.fill(0.0);
        self.seen.fill(0.0);
        self.wrong.reset();
        self.agreed = 0.0;
    }

    /// True where most of the fingers feel something else than they press with, for long.
    pub fn failed(&self) -> bool {
        self.wrong.confirmed()
    }

    /// Compares the readings of the fingers for which `holds(j)`; `joints(j)` are those of finger `j`.
    pub fn admit(
        &mut self,
        tactile: &[Tactile],
        efforts: &Efforts<'_>,
        joints: impl Fn(usize) -> std::ops::Range<usize>,
        holds: impl Fn(usize) -> bool,
    ) {
        if self.agreed > AGREED {
            return;
        }
        let (mut compared, mut odd, mut loaded) = (0, 0, 0);
        for (j, reading) in tactile.iter().enumerate() {
            let at = joints(j);
            // Torque sensors that a hand does not have read zero.
            let senses = efforts.tau[at.clone()].iter().any(|tau| *tau != 0.0);
            if !(holds(j) && senses && reading.f_n.is_finite()) {
                self.seen[j] = 0.0;
                continue;
            }
            let Some(told) = normal_force(j, at, efforts) else { continue };
            let start = self.seen[j] == 0.0;
            let share = if start { 1.0 } else { self.share };
            self.seen[j] += self.dt;
            self.felt[j] += (reading.f_n.clamp(0.0, 1e4) - self.felt[j]) * share;
            self.told[j] += (told - self.told[j]) * share;
            compared += 1;
            let (felt, told) = (self.felt[j], self.told[j]);
            loaded += usize::from(told > LOADED * self.margin);
            odd += usize::from((felt - told).abs() > self.margin + self.ratio * felt.max(told));
        }
        let wrong = compared >= 2 && 2 * odd > compared;
        if wrong {
            self.agreed = 0.0;
        } else if compared >= 2 && 2 * loaded > compared {
            self.agreed += self.dt;
        }
        self.wrong.update(wrong, self.dt, LASTS, self.clear);
        if self.agreed > AGREED {
            self.wrong.reset();
        }
    }
}

/// Normal force, N, with which the torques beyond its own press finger `j` on the object.
fn normal_force(j: usize, at: std::ops::Range<usize>, efforts: &Efforts<'_>) -> Option<f64> {
    let (mut JJ, mut Jt) = (Matrix3::identity() * LEVEL, Vector3::zeros());
    for i in at {
        let tau = efforts.tau[i] - efforts.own[i];
        if !tau.is_finite() {
            return None;
        }
        let column = efforts.J.fixed_view::<3, 1>(3 * j, i).into_owned();
        JJ += column * column.transpose();
        Jt += column * tau;
    }
    // The third row of the inverse is all that is asked for: Cramer's rule.
    let (a, b, c) = (JJ.column(0), JJ.column(1), JJ.column(2));
    let normal = a.cross(&b);
    let determinant = normal.dot(&c);
    (determinant > 0.0).then(|| normal.dot(&Jt) / determinant)
}
