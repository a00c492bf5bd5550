//! What goes into a control step and what comes out.

use nalgebra::{DVector, Isometry3, Vector3, Vector6};

/// One fingertip's tactile reading: where on the tip, and how hard along the tip's normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tactile {
    /// Contact point in the fingertip frame F, m. The normal follows from the tip's own shape.
    pub p_FC: Vector3<f64>,
    /// Normal force, N; zero without contact.
    pub f_n: f64,
}

/// What the sensors say at one instant. There is no velocity, mass, friction or mesh in it, on purpose: the paper's
/// sensing claim is enforced by the type.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// Time, s.
    pub t: f64,
    /// Joint angles, finger by finger, rad.
    pub q: DVector<f64>,
    /// Measured joint torques, finger by finger, N m.
    pub tau: DVector<f64>,
    /// Pose of the object O in W.
    pub X_WO: Isometry3<f64>,
    /// One reading per fingertip.
    pub tactile: Vec<Tactile>,
}

impl Measurement {
    /// A measurement of `n_fingers` with `n_q` joints in all, all zero.
    pub fn zeros(n_fingers: usize, n_q: usize) -> Self {
        Self {
            t: 0.0,
            q: DVector::zeros(n_q),
            tau: DVector::zeros(n_q),
            X_WO: Isometry3::identity(),
            tactile: vec![Tactile { p_FC: Vector3::zeros(), f_n: 0.0 }; n_fingers],
        }
    }
}

/// The desired motion of the object at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reference {
    /// Desired pose of the object in W.
    pub X_WD: Isometry3<f64>,
    /// Desired twist [linear; angular] in W, m/s and rad/s; zero for a step.
    pub V_WD: Vector6<f64>,
}

/// The torques to track until the next step.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// Joint torques, finger by finger, N m.
    pub tau: DVector<f64>,
}
