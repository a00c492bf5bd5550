//! Torques that move the fingers themselves along with the desired motion of the object.

use crate::grasp::Scene;
use crate::hand::HandModel;
use crate::spatial::{angular, linear};
use nalgebra::{Matrix3, Vector3};

/// Regularisation of J J^T near singular postures, m^2/rad^2; the fingers' own values are near 2e-3.
const SINGULAR: f64 = 1e-6;

/// Adds to `tau`, of all fingers, the `share` of the torques, N m, that overcome the joint damping of finger `k` when its
/// contact moves with the desired object.
///
/// Deviation: not in the paper, whose fingers are ideal sources of force. The joints' damping, seen from the object, is
/// tens of N s/m and makes K lag behind a moving reference. The contact's desired velocity follows from the desired
/// twist, the joints' from the Jacobian: no velocity is measured, and the loop's stability does not change. A finger that
/// cannot follow in all directions follows as well as it can.
pub fn damping_torque(hand: &HandModel, k: usize, scene: &Scene<'_>, share: f64, tau: &mut [f64]) {
    let contact = scene.grasp.contact(k);
    let arm = contact.p_WC - scene.X_WO.translation.vector;
    let v_W = linear(scene.V_WD) + angular(scene.V_WD).cross(&arm);
    let mut JJ = Matrix3::identity() * SINGULAR;
    for at in hand.joints(k) {
        let column = scene.state.jacobian_column(at, &contact.p_WC);
        JJ += column * column.transpose();
    }
    // qd = J^T (J J^T)^-1 v, the smallest joint velocities that move the contact at v.
    let y = JJ.cholesky().map_or(Vector3::zeros(), |cholesky| cholesky.solve(&v_W));
    for at in hand.joints(k) {
        let qd = scene.state.jacobian_column(at, &contact.p_WC).dot(&y);
        tau[at] += share * (hand.coordinate(at).damping * qd);
    }
}
