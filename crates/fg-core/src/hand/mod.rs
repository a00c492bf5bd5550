//! A hand: fingers with any number of joints each, and what the control step must know of them.
//!
//! Joint angles, torques and limits are flat arrays over the *independent* joints, finger by finger, and a finger is a range
//! in them ([`HandModel::joints`]). A coupled joint follows an independent one by a fixed ratio; it has a place in the
//! kinematics, and none in the arrays.

mod inertia;
mod layout;
mod limits;
mod state;

use crate::error::Error;
pub use inertia::FingerInertia;
use layout::Layout;
pub use limits::TorqueLimits;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
pub use state::HandState;
use std::ops::Range;

/// One revolute joint and the link that it turns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Name in the hand's own description.
    pub name: String,
    /// Origin of the link's frame in its parent's frame (W for the first joint) at angle zero, m.
    pub position: [f64; 3],
    /// Orientation of the link's frame in its parent's frame at angle zero, wxyz.
    pub quaternion: [f64; 4],
    /// A point of the joint axis in the link's frame, m.
    pub anchor: [f64; 3],
    /// The joint axis in the link's frame.
    pub axis: [f64; 3],
    /// Lower joint limit, rad.
    pub lower: f64,
    /// Upper joint limit, rad.
    pub upper: f64,
    /// Viscous damping of the joint, N m s/rad.
    pub damping: f64,
    /// Mass of the link, kg.
    pub mass: f64,
    /// Centre of mass of the link in its frame, m.
    pub com: [f64; 3],
    /// Moments [Ixx, Iyy, Izz, Ixy, Ixz, Iyz] of the link about its centre of mass, in its frame, kg m^2.
    #[serde(default)]
    pub inertia: [f64; 6],
    /// Inertia of the motor, seen from the joint, kg m^2.
    #[serde(default)]
    pub armature: f64,
    /// Torque of the joint's dry friction, N m.
    #[serde(default)]
    pub frictionloss: f64,
    /// Stiffness of the joint's spring, N m/rad: its torque is `-stiffness (angle - spring_reference)`.
    #[serde(default)]
    pub stiffness: f64,
    /// Angle at which the spring is at rest, rad.
    #[serde(default)]
    pub spring_reference: f64,
    /// Least torque of the motor, N m, at most zero; None: `-force.tau_max` of the configuration.
    #[serde(default)]
    pub tau_min: Option<f64>,
    /// Largest torque of the motor, N m, at least zero; None: `force.tau_max` of the configuration.
    #[serde(default)]
    pub tau_max: Option<f64>,
    /// The posture that the joint should return to, rad; None: the middle of its range.
    #[serde(default)]
    pub reference: Option<f64>,
    /// The joint that this one follows; None: the joint has a motor of its own.
    #[serde(default)]
    pub follows: Option<Follows>,
}

impl Default for Joint {
    /// A joint about z at its parent's origin, half a turn each way, with a link that weighs nothing.
    fn default() -> Self {
        Self {
            name: String::new(),
            position: [0.0; 3],
            quaternion: [1.0, 0.0, 0.0, 0.0],
            anchor: [0.0; 3],
            axis: [0.0, 0.0, 1.0],
            lower: -std::f64::consts::PI,
            upper: std::f64::consts::PI,
            damping: 0.0,
            mass: 0.0,
            com: [0.0; 3],
            inertia: [0.0; 6],
            armature: 0.0,
            frictionloss: 0.0,
            stiffness: 0.0,
            spring_reference: 0.0,
            tau_min: None,
            tau_max: None,
            reference: None,
            follows: None,
        }
    }
}

/// How a coupled joint follows another: its angle is `ratio` times the leader's, plus `offset`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Follows {
    /// Index of the leader in the finger's list of joints, before or behind the follower.
    pub joint: usize,
    /// Turns of the follower for one of the leader.
    pub ratio: f64,
    /// Angle of the follower where the leader is at zero, rad.
    #[serde(default)]
    pub offset: f64,
}

/// A spherical fingertip.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tip {
    /// Centre in the last link's frame, m.
    pub position: [f64; 3],
    /// Radius, m.
    pub radius: f64,
}

/// A chain of joints that ends in a fingertip.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Finger {
    /// Name in the hand's own description.
    pub name: String,
    /// Joints from the palm to the tip, coupled ones among them.
    pub joints: Vec<Joint>,
    /// The fingertip.
    pub tip: Tip,
}

/// What there is to know of an independent joint, with those that follow it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coordinate {
    /// Lower limit, rad: the joint's own, narrowed so that its followers stay in theirs.
    pub lower: f64,
    /// Upper limit, rad.
    pub upper: f64,
    /// Least torque, N m, where the model states one.
    pub tau_min: Option<f64>,
    /// Largest torque, N m, where the model states one.
    pub tau_max: Option<f64>,
    /// Viscous damping, N m s/rad: the joint's own, and its followers' times the square of their ratio.
    pub damping: f64,
    /// Inertia of the motors, kg m^2, likewise.
    pub armature: f64,
    /// Torque of dry friction, N m: the joint's own, and its followers' times the size of their ratio.
    pub frictionloss: f64,
    /// The posture that the joint should return to, rad.
    pub reference: f64,
}

impl Coordinate {
    /// The torque, N m, that overcomes damping and dry friction while the joint turns at `qd` rad/s.
    ///
    /// `qd` is a desired velocity, so that nothing chatters; below `friction_speed`, rad/s, dry friction counts in part.
    pub fn drag(&self, qd: f64, friction_speed: f64) -> f64 {
        self.damping * qd + self.frictionloss * (qd / friction_speed).clamp(-1.0, 1.0)
    }
}

/// A hand, fixed in W.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandModel {
    fingers: Vec<Finger>,
    /// Acceleration of gravity in W, m/s^2.
    gravity: [f64; 3],
    #[serde(skip)]
    layout: Layout,
}

impl HandModel {
    /// Largest number of fingers.
    pub const MAX_FINGERS: usize = 6;
    /// Largest number of independent joints of one finger.
    pub const MAX_JOINTS: usize = 7;
    /// Largest number of joints of one finger, coupled ones among them.
    pub const MAX_LINKS: usize = 2 * Self::MAX_JOINTS;

    /// The hand described in `json` (format in ARCHITECTURE.md).
    pub fn from_json(json: &str) -> Result<Self, Error> {
        let hand: Self =
            serde_json::from_str(json).map_err(|e| Error::config("hand", "a hand description", e))?;
        Self::new(hand.fingers, hand.gravity)
    }

    /// The hand made of `fingers` under `gravity`, checked.
    ///
    /// An [`Error::Config`] names the first field that cannot be used.
    pub fn new(fingers: Vec<Finger>, gravity: [f64; 3]) -> Result<Self, Error> {
        layout::finite("hand.gravity", &gravity)?;
        let layout = Layout::new(&fingers)?;
        Ok(Self { fingers, gravity, layout })
    }

    /// The fingers as they were described.
    pub fn fingers(&self) -> &[Finger] {
        &self.fingers
    }

    /// Number of fingers.
    pub fn n_fingers(&self) -> usize {
        self.fingers.len()
    }

    /// Number of independent joints of all fingers: the length of q and tau.
    pub fn n_q(&self) -> usize {
        self.layout.coordinates.len()
    }

    /// Where the independent joints of finger `j` are in q and tau.
    pub fn joints(&self, j: usize) -> Range<usize> {
        self.layout.joints[j].clone()
    }

    /// Number of independent joints of each finger.
    pub fn counts(&self) -> Vec<usize> {
        self.layout.joints.iter().map(ExactSizeIterator::len).collect()
    }

    /// Largest number of independent joints of one finger.
    pub fn most_joints(&self) -> usize {
        self.layout.joints.iter().map(ExactSizeIterator::len).max().unwrap_or(0)
    }

    /// Name of independent joint `at`, as it was described.
    pub fn name(&self, at: usize) -> &str {
        let link = &self.layout.links[at];
        &self.fingers[link.finger].joints[link.joint].name
    }

    /// What there is to know of independent joint `at`.
    pub fn coordinate(&self, at: usize) -> &Coordinate {
        &self.layout.coordinates[at]
    }

    /// Every independent joint, finger by finger.
    pub fn coordinates(&self) -> &[Coordinate] {
        &self.layout.coordinates
    }

    /// Acceleration of gravity in W, m/s^2.
    pub fn gravity(&self) -> Vector3<f64> {
        Vector3::from(self.gravity)
    }

    /// The unit vector in W against gravity; world z where there is none (below 1e-6 m/s^2).
    pub fn up(&self) -> Vector3<f64> {
        (-self.gravity()).try_normalize(1e-6).unwrap_or_else(Vector3::z)
    }

    /// Radius of the tip of finger `j`, m.
    pub fn tip_radius(&self, j: usize) -> f64 {
        self.fingers[j].tip.radius
    }
}
