//! The wrench that goes on while there is no feedback.

use nalgebra::Vector6;

/// Low-pass of the wrench, for the time when there is no feedback.
#[derive(Debug, Clone)]
pub struct SteadyWrench {
    share: f64,
    F: Vector6<f64>,
}

impl SteadyWrench {
    /// Time constant of the filter, s.
    const TIME: f64 = 0.2;

    /// A filter at the control period `dt`.
    pub fn new(dt: f64) -> Self {
        Self { share: 1.0 - (-dt / Self::TIME).exp(), F: Vector6::zeros() }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.F = Vector6::zeros();
    }

    /// Takes this step's wrench.
    pub fn take(&mut self, F: &Vector6<f64>) {
        self.F += (F - self.F) * self.share;
    }

    /// The steady wrench, N and N m.
    pub fn wrench(&self) -> &Vector6<f64> {
        &self.F
    }
}
