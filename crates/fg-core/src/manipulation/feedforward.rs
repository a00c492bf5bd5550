//! Torques that move the fingers themselves along with the desired motion of the object.

use crate::config::RobustConfig;
use crate::grasp::Scene;
use crate::hand::HandModel;
use crate::spatial::{angular, linear};

/// Adds to `tau`, of all fingers, the share `robust.feedforward` of the torques, N m, that overcome the damping and the dry
/// friction of the joints of finger `k` when its contact moves with the desired object.
///
/// Deviation: not in the paper, whose fingers are ideal sources of force. The joints' damping, seen from the object, is
/// tens of N s/m and makes K lag behind a moving reference. The contact's desired velocity follows from the desired
/// twist, the joints' from the Jacobian: no velocity is measured, and the loop's stability does not change. A finger that
/// cannot follow in all directions follows as well as it can.
pub fn drag_torque(hand: &HandModel, k: usize, scene: &Scene<'_>, config: &RobustConfig, tau: &mut [f64]) {
    if config.feedforward <= 0.0 {
        return;
    }
    let contact = scene.grasp.contact(k);
    let arm = contact.p_WC - scene.X_WO.translation.vector;
    let v_W = linear(scene.V_WD) + angular(scene.V_WD).cross(&arm);
    // qd = J^T (J J^T)^-1 v, the smallest joint velocities that move the contact at v.
    let y = scene.state.solve_gram(k, &contact.p_WC, &v_W);
    for at in hand.joints(k) {
        let qd = scene.state.jacobian_column(at, &contact.p_WC).dot(&y);
        tau[at] += config.feedforward * hand.coordinate(at).drag(qd, config.friction_speed);
    }
}
