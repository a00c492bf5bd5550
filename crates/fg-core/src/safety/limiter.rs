//! The last word on every torque command.

use crate::hand::TorqueLimits;
use nalgebra::DVector;

/// Keeps torques finite, within the joints' limits, and within their largest change per step.
#[derive(Debug, Clone)]
pub struct TorqueLimiter {
    limits: TorqueLimits,
    /// Largest change in one step, N m.
    change: f64,
    previous: DVector<f64>,
}

impl TorqueLimiter {
    /// A limiter to `limits` and to `rate` N m/s at the control period `dt`; the first command is limited from zero.
    pub fn new(limits: TorqueLimits, rate: f64, dt: f64) -> Self {
        Self { change: rate * dt, previous: DVector::zeros(limits.n()), limits }
    }

    /// Forgets the past: the next command is limited from zero.
    pub fn reset(&mut self) {
        self.previous.fill(0.0);
    }

    /// The last command, N m.
    pub fn previous(&self) -> &DVector<f64> {
        &self.previous
    }

    /// The joints' limits.
    pub fn limits(&self) -> &TorqueLimits {
        &self.limits
    }

    /// Limits `tau` in place; a torque that is not finite stays at its last value. True where one is at its limit; zero does
    /// not count as one, for a motor that only pulls.
    pub fn apply(&mut self, tau: &mut DVector<f64>) -> bool {
        let mut saturated = false;
        let limits = self.limits.min().iter().zip(self.limits.max());
        for ((tau, previous), (min, max)) in tau.iter_mut().zip(self.previous.iter_mut()).zip(limits) {
            let wanted = if tau.is_finite() { *tau } else { *previous };
            let limit = if wanted < 0.0 { -min } else { *max };
            saturated |= limit > 0.0 && wanted.abs() >= limit * (1.0 - 1e-6);
            *tau = wanted.clamp(*previous - self.change, *previous + self.change);
            *tau = tau.clamp(*min, *max);
            *previous = *tau;
        }
        saturated
    }
}
