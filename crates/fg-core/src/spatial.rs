//! Rigid-body quantities shared by the modules: poses, pose errors, cross products.

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3, Vector6};

/// Pose error [p_D - p_O; log(R_WD R_WO^T)] of the object O against the desired object D, in W: m, rad.
pub fn pose_error(X_WD: &Isometry3<f64>, X_WO: &Isometry3<f64>) -> Vector6<f64> {
    let p = X_WD.translation.vector - X_WO.translation.vector;
    let r = (X_WD.rotation * X_WO.rotation.inverse()).scaled_axis();
    Vector6::new(p.x, p.y, p.z, r.x, r.y, r.z)
}

/// The pose reached from `X` after `dt` seconds at the twist V = [linear; angular] in W.
pub fn integrate(X: &Isometry3<f64>, V: &Vector6<f64>, dt: f64) -> Isometry3<f64> {
    let translation = X.translation.vector + linear(V) * dt;
    let rotation = UnitQuaternion::from_scaled_axis(angular(V) * dt) * X.rotation;
    // Renormalised at every step: products of unit quaternions drift.
    Isometry3::from_parts(
        Translation3::from(translation),
        UnitQuaternion::new_normalize(rotation.into_inner()),
    )
}

/// The first three components: force, linear velocity or translation.
pub fn linear(x: &Vector6<f64>) -> Vector3<f64> {
    Vector3::new(x[0], x[1], x[2])
}

/// The last three components: torque, angular velocity or rotation vector.
pub fn angular(x: &Vector6<f64>) -> Vector3<f64> {
    Vector3::new(x[3], x[4], x[5])
}

/// The rotation R_WC whose z axis is the unit vector `n` and whose x axis is as close to world z as it can be.
///
/// Where `n` is within about 8 degrees of world z, world x takes its place, so that the frame is always defined.
pub fn contact_frame(n: &Vector3<f64>) -> Matrix3<f64> {
    let up = if n.z.abs() < 0.99 { Vector3::z() } else { Vector3::x() };
    let x = (up - n * n.dot(&up)).normalize();
    let y = n.cross(&x);
    Matrix3::from_columns(&[x, y, *n])
}

/// True where every component of the pose is finite.
pub fn is_finite(X: &Isometry3<f64>) -> bool {
    X.translation.vector.iter().chain(X.rotation.coords.iter()).all(|x| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrating_the_error_reaches_the_goal() {
        let X_WO = Isometry3::new(Vector3::new(0.1, -0.2, 0.3), Vector3::new(0.4, 0.1, -0.3));
        let X_WD = Isometry3::new(Vector3::new(0.0, 0.5, 0.2), Vector3::new(-0.2, 1.0, 0.6));
        let reached = integrate(&X_WO, &pose_error(&X_WD, &X_WO), 1.0);
        assert!(pose_error(&X_WD, &reached).norm() < 1e-12);
    }

    #[test]
    fn contact_frame_is_a_rotation_about_the_normal() {
        for n in [Vector3::z(), -Vector3::z(), Vector3::x(), Vector3::new(0.3, -0.5, 0.8).normalize()] {
            let R = contact_frame(&n);
            assert!((R.transpose() * R - Matrix3::identity()).norm() < 1e-12);
            assert!((R.determinant() - 1.0).abs() < 1e-12);
            assert!((R.column(2) - n).norm() < 1e-12);
        }
    }
}
