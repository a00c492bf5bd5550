//! The last word on every torque command.

use crate::config::ForceConfig;
use nalgebra::DVector;

/// Keeps torques finite, within +-tau_max, and within their largest change per step.
#[derive(Debug, Clone)]
pub struct TorqueLimiter {
    limit: f64,
    /// Largest change in one step, N m.
    change: f64,
    previous: DVector<f64>,
}

impl TorqueLimiter {
    /// A limiter for `n_q` joints at the control period `dt`; the first command is limited from zero.
    pub fn new(n_q: usize, config: &ForceConfig, dt: f64) -> Self {
        Self { limit: config.tau_max, change: config.tau_rate_max * dt, previous: DVector::zeros(n_q) }
    }

    /// Forgets the past: the next command is limited from zero.
    pub fn reset(&mut self) {
        self.previous.fill(0.0);
    }

    /// The last command, N m.
    pub fn previous(&self) -> &DVector<f64> {
        &self.previous
    }

    /// Limits `tau` in place; a torque that is not finite stays at its last value. True where one is at its limit.
    pub fn apply(&mut self, tau: &mut DVector<f64>) -> bool {
        let mut saturated = false;
        for (tau, previous) in tau.iter_mut().zip(self.previous.iter_mut()) {
            let wanted = if tau.is_finite() { *tau } else { *previous };
            saturated |= wanted.abs() >= self.limit * (1.0 - 1e-6);
            *tau = wanted.clamp(*previous - self.change, *previous + self.change);
            *tau = tau.clamp(-self.limit, self.limit);
            *previous = *tau;
        }
        saturated
    }
}
