//! The desired motion: judged, made to stand still, and let go again without a leap.

use super::config::SafetyConfig;
use super::odometry::{moved, size};
use super::{Fault, Faults};
use crate::signals::Reference;
use crate::spatial::{angular, is_finite, linear, pose_error};
use nalgebra::{Isometry3, Vector6};

/// Follows the reference while all is well; holds it where it was while not; then catches up at a limited speed.
#[derive(Debug, Clone)]
pub struct ReferenceGuard {
    config: SafetyConfig,
    dt: f64,
    /// The last good reference.
    good: Option<Reference>,
    /// What was handed out last.
    out: Option<Reference>,
    /// What is still to be caught up with, from the reference to what is handed out, m and rad.
    lag: Option<Vector6<f64>>,
}

impl ReferenceGuard {
    /// A guard at the control period `dt`.
    pub fn new(config: &SafetyConfig, dt: f64) -> Self {
        Self { config: config.clone(), dt, good: None, out: None, lag: None }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        *self = Self::new(&self.config, self.dt);
    }

    /// Takes the reference of this step, and says whether it is one: finite, and in reach of the object at `X_WO`.
    pub fn take(&mut self, reference: &Reference, X_WO: &Isometry3<f64>, faults: &mut Faults) -> bool {
        let X = &reference.X_WD;
        let V = &reference.V_WD;
        let near = (X.translation.vector - X_WO.translation.vector).norm() <= self.config.reach;
        let calm = linear(V).norm() <= 10.0 && angular(V).norm() <= 100.0;
        let good = is_finite(X) && near && calm && (X.rotation.coords.norm() - 1.0).abs() < 1e-3;
        if good {
            self.good = Some(*reference);
        } else {
            faults.insert(Fault::Reference);
        }
        good
    }

    /// The reference to use: the last good one, or, with `stand`, what was used last without its motion.
    pub fn use_now(&mut self, stand: bool, X_WO: &Isometry3<f64>) -> Reference {
        let here = Reference { X_WD: *X_WO, V_WD: Vector6::zeros() };
        let good = self.good.unwrap_or(here);
        let out = if stand {
            let out = Reference { V_WD: Vector6::zeros(), ..self.out.unwrap_or(here) };
            self.lag = Some(pose_error(&out.X_WD, &good.X_WD));
            out
        } else if let Some(lag) = self.lag {
            let left = self.catch_up(&lag);
            let V_WD = good.V_WD + (left - lag) / self.dt;
            let [p, r] = size(&left);
            self.lag = (p > 1e-7 || r > 1e-6).then_some(left);
            Reference { X_WD: moved(&good.X_WD, &left), V_WD }
        } else {
            good
        };
        self.out = Some(out);
        out
    }

    /// Lets the reference start again from the pose `X_WO`, at rest.
    pub fn restart(&mut self, X_WO: &Isometry3<f64>) {
        self.out = Some(Reference { X_WD: *X_WO, V_WD: Vector6::zeros() });
    }

    /// What is left of `lag` after one step.
    fn catch_up(&self, lag: &Vector6<f64>) -> Vector6<f64> {
        let [p, r] = size(lag);
        let share = |length: f64, speed: f64| (1.0 - speed * self.dt / length.max(1e-12)).max(0.0);
        let (a, b) = (share(p, self.config.catch_up[0]), share(r, self.config.catch_up[1]));
        lag.component_mul(&Vector6::new(a, a, a, b, b, b))
    }
}
