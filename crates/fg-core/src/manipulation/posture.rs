//! The posture of fingers that have more joints than their contact needs.

use crate::config::RobustConfig;
use crate::grasp::Scene;
use crate::hand::HandModel;
use nalgebra::{SVector, Vector3};

/// Largest share of a joint's torque limits that is spent on posture.
const SHARE: f64 = 0.1;

/// Pulls spare joints to where they were at the first grasp, so that a finger that is carried along by the object does not
/// fold up.
///
/// Deviation: not in the paper, whose fingers have three joints. No velocity is used: the pull is the joint's damping times
/// a rate, so that the joint's own damping makes the return one of first order.
#[derive(Debug, Clone)]
pub struct Posture {
    rate: f64,
    /// Joint angles of the first grasp, rad; those of the hand's model before it.
    home: Vec<f64>,
    model: Vec<f64>,
}

impl Posture {
    /// The reference posture of `hand`.
    pub fn new(hand: &HandModel, config: &RobustConfig) -> Self {
        let model: Vec<_> = hand.coordinates().iter().map(|joint| joint.reference).collect();
        Self { rate: config.posture_rate, home: model.clone(), model }
    }

    /// Forgets the first grasp.
    pub fn reset(&mut self) {
        self.home.copy_from_slice(&self.model);
    }

    /// Takes the joint angles `q` as the posture to return to, rad.
    pub fn set_home(&mut self, q: &[f64]) {
        self.home.copy_from_slice(q);
    }

    /// Adds to `tau`, of all fingers, the torques of finger `k` that pull it home without a force at its contact, N m:
    ///
    /// N tau_0 with tau_0 = D rate (q_home - q) within a tenth of the torque limits `low` and `high`, and
    /// N = 1 - J^T (J J^T)^-1 J, so that J N tau_0 = 0.
    pub fn add_torque(
        &self,
        hand: &HandModel,
        k: usize,
        scene: &Scene<'_>,
        limits: (&[f64], &[f64]),
        tau: &mut [f64],
    ) {
        let joints = hand.joints(k);
        if self.rate <= 0.0 || joints.len() <= 3 {
            return;
        }
        let p_WC = &scene.grasp.contact(k).p_WC;
        let mut pull = SVector::<f64, { HandModel::MAX_JOINTS }>::zeros();
        let mut reached = Vector3::zeros();
        for (i, at) in joints.clone().enumerate() {
            let wanted = hand.coordinate(at).damping * self.rate * (self.home[at] - scene.q[at]);
            pull[i] = wanted.clamp(SHARE * limits.0[at], SHARE * limits.1[at]);
            reached += scene.state.jacobian_column(at, p_WC) * pull[i];
        }
        let y = scene.state.solve_gram(k, p_WC, &reached);
        for (i, at) in joints.enumerate() {
            tau[at] += pull[i] - scene.state.jacobian_column(at, p_WC).dot(&y);
        }
    }
}
