//! The velocity-force controller of the free finger, eq. (5).

use crate::config::GaitConfig;
use crate::grasp::Scene;

/// Turns the desired joint velocity and normal force of the free finger into joint torques.
#[derive(Debug, Clone)]
pub struct VelocityForceController {
    config: GaitConfig,
    /// Share of the past in one step of the force filter.
    memory: f64,
    /// Filtered normal force, N.
    f_act: f64,
}

impl VelocityForceController {
    /// A controller at the control period `dt`.
    pub fn new(config: &GaitConfig, dt: f64) -> Self {
        let memory = if config.force_filter > 0.0 { (-dt / config.force_filter).exp() } else { 0.0 };
        Self { config: config.clone(), memory, f_act: 0.0 }
    }

    /// Starts from the normal force `f_n`, N.
    pub fn reset(&mut self, f_n: f64) {
        self.f_act = f_n;
    }

    /// Filtered normal force, N.
    pub fn f_act(&self) -> f64 {
        self.f_act
    }

    /// Writes tau_des,k = K_v qd_des + K_f J^T (f_des - f_act) n for the joints of finger `k`, N m.
    ///
    /// The force term pushes along the inward normal. Its static force is f_des K_f / (1 + K_f), as in the paper.
    pub fn update(&mut self, k: usize, scene: &Scene<'_>, qd_des: &[f64], f_des: f64, tau: &mut [f64]) {
        let contact = scene.grasp.contact(k);
        self.f_act = self.memory * self.f_act + (1.0 - self.memory) * contact.f_n;
        let push = self.config.K_f * (f_des - self.f_act);
        for ((at, tau), qd_des) in scene.state.joints(k).zip(tau).zip(qd_des) {
            let column = scene.state.jacobian_column(at, &contact.p_WC);
            *tau = self.config.K_v * qd_des + push * contact.n_W.dot(&column);
        }
    }
}
