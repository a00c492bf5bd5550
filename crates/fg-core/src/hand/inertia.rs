//! The inertia of a finger at one instant.

use super::{HandModel, HandState};
use nalgebra::{SMatrix, Vector3};

/// Mass matrix of one finger over its independent joints, kg m^2. Joints that the finger lacks have one on the diagonal, so
/// that the matrix can be factored in place.
pub type FingerInertia = SMatrix<f64, { HandModel::MAX_JOINTS }, { HandModel::MAX_JOINTS }>;

impl HandState {
    /// The mass matrix of finger `j` at this posture: links, with those that follow, and motors.
    ///
    /// M = sum over links of m J_c^T J_c + J_w^T I J_w, J_c and J_w the Jacobians of the link's centre of mass and of its
    /// rotation, plus the motors' inertia on the diagonal.
    pub fn inertia(&self, hand: &HandModel, j: usize) -> FingerInertia {
        let joints = self.joints(j);
        let mut M = FingerInertia::identity();
        for (a, at) in joints.clone().enumerate() {
            M[(a, a)] = hand.coordinate(at).armature;
        }
        let chain = &self.chains[j];
        for (depth, &k) in chain.iter().enumerate() {
            let link = &hand.layout.links[k];
            let (mut linear, mut angular) =
                ([Vector3::zeros(); HandModel::MAX_JOINTS], [Vector3::zeros(); HandModel::MAX_JOINTS]);
            for &l in &chain[..=depth] {
                let a = self.leaders[l] - joints.start;
                let axis = self.axes[l] * self.ratios[l];
                linear[a] += axis.cross(&(self.coms[k] - self.anchors[l]));
                angular[a] += axis;
            }
            let R = self.rotations[k].to_rotation_matrix();
            let I_W = R * link.inertia * R.transpose();
            for a in 0..joints.len() {
                let momentum = I_W * angular[a];
                for b in 0..=a {
                    let m = link.mass * linear[a].dot(&linear[b]) + momentum.dot(&angular[b]);
                    M[(a, b)] += m;
                    if a != b {
                        M[(b, a)] += m;
                    }
                }
            }
        }
        M
    }
}
