//! What the state machine looks at in a step.

use crate::grasp::Grasp;
use crate::hand::{HandModel, HandState, TorqueLimits};
use crate::signals::Reference;
use nalgebra::{Isometry3, Vector6};

/// What the state machine looks at.
#[derive(Debug, Clone, Copy)]
#[allow(clippy::struct_excessive_bools)] // facts that do not depend on each other
pub struct View<'a> {
    /// The hand.
    pub hand: &'a HandModel,
    /// Its kinematics.
    pub state: &'a HandState,
    /// Contacts.
    pub grasp: &'a Grasp,
    /// Joint angles, rad.
    pub q: &'a [f64],
    /// Pose of the object.
    pub X_WO: &'a Isometry3<f64>,
    /// What is asked of it.
    pub asked: &'a Reference,
    /// The wrench that the last step asked for, its mean of late, and what the force optimiser failed to deliver.
    pub F_des: &'a Vector6<f64>,
    /// See `F_des`.
    pub steady: &'a Vector6<f64>,
    /// See `F_des`.
    pub psi: &'a Vector6<f64>,
    /// The last command and its limits, N m.
    pub tau: &'a [f64],
    /// See `tau`.
    pub limits: &'a TorqueLimits,
    /// The friction coefficient that is assumed.
    pub friction: f64,
    /// The nominal weight, N.
    pub weight: f64,
    /// All fingers have held the object once.
    pub grasped: bool,
    /// Nothing is wrong but, at most, the grasp.
    pub fit: bool,
    /// What is asked stands because something is wrong.
    pub stands: bool,
    /// Some finger's motors give nothing: what is in the air may not stay there.
    pub weak: bool,
    /// The grasp is: a torque at its limit, or the wrench not delivered, for long.
    pub strained: bool,
    /// No finger can be spared although the grasp asks for it.
    pub overdue: bool,
}
