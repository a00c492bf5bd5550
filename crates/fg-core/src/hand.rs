//! Kinematics and gravity of a hand with any number of fingers and joints.

use crate::error::Error;
use nalgebra::{DMatrix, Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

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
    /// Joints from the palm to the tip.
    pub joints: Vec<Joint>,
    /// The fingertip.
    pub tip: Tip,
}

/// A hand: fingers with the same number of joints each, fixed in W.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandModel {
    fingers: Vec<Finger>,
    /// Acceleration of gravity in W, m/s^2.
    gravity: [f64; 3],
    #[serde(skip)]
    chains: Vec<Vec<Link>>,
}

/// A joint in the form that the kinematics use.
#[derive(Debug, Clone, PartialEq)]
struct Link {
    X_parent: Isometry3<f64>,
    anchor: Vector3<f64>,
    axis: Unit<Vector3<f64>>,
    com: Vector3<f64>,
}

impl HandModel {
    /// Largest number of fingers and of joints per finger.
    pub const MAX_FINGERS: usize = 5;
    /// Largest number of joints of one finger.
    pub const MAX_JOINTS: usize = 6;

    /// The hand described in `json` (format in ARCHITECTURE.md).
    pub fn from_json(json: &str) -> Result<Self, Error> {
        let hand: Self =
            serde_json::from_str(json).map_err(|e| Error::config("hand", "a hand description", e))?;
        Self::new(hand.fingers, hand.gravity)
    }

    /// The hand made of `fingers` under `gravity`, checked.
    pub fn new(fingers: Vec<Finger>, gravity: [f64; 3]) -> Result<Self, Error> {
        if !(2..=Self::MAX_FINGERS).contains(&fingers.len()) {
            return Err(Error::config("hand.fingers", format!("2 to {}", Self::MAX_FINGERS), fingers.len()));
        }
        finite("hand.gravity", &gravity)?;
        let n_joints = fingers[0].joints.len();
        if !(1..=Self::MAX_JOINTS).contains(&n_joints) {
            return Err(Error::config(
                "hand.fingers[0].joints",
                format!("1 to {}", Self::MAX_JOINTS),
                n_joints,
            ));
        }
        let mut chains = Vec::with_capacity(fingers.len());
        for (j, finger) in fingers.iter().enumerate() {
            let at = format!("hand.fingers[{j}]");
            if finger.joints.len() != n_joints {
                let found = finger.joints.len();
                return Err(Error::config(
                    at + ".joints",
                    format!("{n_joints} as in the first finger"),
                    found,
                ));
            }
            finite(&format!("{at}.tip.position"), &finger.tip.position)?;
            if !(finger.tip.radius.is_finite() && finger.tip.radius > 0.0) {
                return Err(Error::config(at + ".tip.radius", "a radius > 0", finger.tip.radius));
            }
            let links =
                finger.joints.iter().enumerate().map(|(i, joint)| link(&format!("{at}.joints[{i}]"), joint));
            chains.push(links.collect::<Result<Vec<_>, _>>()?);
        }
        Ok(Self { fingers, gravity, chains })
    }

    /// Number of fingers.
    pub fn n_fingers(&self) -> usize {
        self.fingers.len()
    }

    /// Number of joints of one finger.
    pub fn n_joints(&self) -> usize {
        self.fingers[0].joints.len()
    }

    /// Limits (lower, upper) of joint `i` of finger `j`, rad.
    pub fn limits(&self, j: usize, i: usize) -> (f64, f64) {
        let joint = &self.fingers[j].joints[i];
        (joint.lower, joint.upper)
    }

    /// Viscous damping of joint `i` of finger `j`, N m s/rad.
    pub fn damping(&self, j: usize, i: usize) -> f64 {
        self.fingers[j].joints[i].damping
    }

    /// Radius of the tip of finger `j`, m.
    pub fn tip_radius(&self, j: usize) -> f64 {
        self.fingers[j].tip.radius
    }
}

fn finite(field: &str, values: &[f64]) -> Result<(), Error> {
    if values.iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err(Error::config(field, "finite numbers", format!("{values:?}")))
    }
}

fn link(at: &str, joint: &Joint) -> Result<Link, Error> {
    for (name, values) in [
        ("position", &joint.position[..]),
        ("quaternion", &joint.quaternion),
        ("anchor", &joint.anchor),
        ("axis", &joint.axis),
        ("com", &joint.com),
        ("mass", &[joint.mass]),
        ("damping", &[joint.damping]),
        ("limits", &[joint.lower, joint.upper]),
    ] {
        finite(&format!("{at}.{name}"), values)?;
    }
    if joint.lower >= joint.upper {
        let found = format!("[{}, {}]", joint.lower, joint.upper);
        return Err(Error::config(format!("{at}.limits"), "lower < upper", found));
    }
    for (name, value) in [("mass", joint.mass), ("damping", joint.damping)] {
        if value < 0.0 {
            return Err(Error::config(format!("{at}.{name}"), "a number >= 0", value));
        }
    }
    let [w, x, y, z] = joint.quaternion;
    let quaternion = Quaternion::new(w, x, y, z);
    if (quaternion.norm() - 1.0).abs() > 1e-3 {
        let found = format!("{:?}", joint.quaternion);
        return Err(Error::config(format!("{at}.quaternion"), "a unit quaternion (wxyz)", found));
    }
    let axis = Unit::try_new(Vector3::from(joint.axis), 1e-9).ok_or_else(|| {
        Error::config(format!("{at}.axis"), "a vector that is not zero", format!("{:?}", joint.axis))
    })?;
    Ok(Link {
        X_parent: Isometry3::from_parts(
            Translation3::from(Vector3::from(joint.position)),
            UnitQuaternion::from_quaternion(quaternion),
        ),
        anchor: Vector3::from(joint.anchor),
        axis,
        com: Vector3::from(joint.com),
    })
}

/// Where the hand's parts are at one instant. Allocated once, overwritten by [`HandState::update`].
#[derive(Debug, Clone)]
pub struct HandState {
    n_joints: usize,
    anchors: Vec<Vector3<f64>>,
    axes: Vec<Vector3<f64>>,
    coms: Vec<Vector3<f64>>,
    tips: Vec<Isometry3<f64>>,
}

impl HandState {
    /// A state for `hand`, not yet valid.
    pub fn new(hand: &HandModel) -> Self {
        let n_q = hand.n_fingers() * hand.n_joints();
        Self {
            n_joints: hand.n_joints(),
            anchors: vec![Vector3::zeros(); n_q],
            axes: vec![Vector3::zeros(); n_q],
            coms: vec![Vector3::zeros(); n_q],
            tips: vec![Isometry3::identity(); hand.n_fingers()],
        }
    }

    /// Moves the state to the joint angles `q`, finger by finger, rad.
    pub fn update(&mut self, hand: &HandModel, q: &[f64]) {
        for (j, chain) in hand.chains.iter().enumerate() {
            let mut X = Isometry3::identity();
            for (i, link) in chain.iter().enumerate() {
                let at = j * self.n_joints + i;
                X *= link.X_parent;
                let rotation = UnitQuaternion::from_axis_angle(&link.axis, q[at]);
                self.anchors[at] = (X * nalgebra::Point3::from(link.anchor)).coords;
                self.axes[at] = X.rotation * link.axis.into_inner();
                let offset = link.anchor - rotation * link.anchor;
                X *= Isometry3::from_parts(Translation3::from(offset), rotation);
                self.coms[at] = (X * nalgebra::Point3::from(link.com)).coords;
            }
            let tip = Translation3::from(Vector3::from(hand.fingers[j].tip.position));
            self.tips[j] = X * tip;
        }
    }

    /// Pose X_WF of the fingertip frame of finger `j`: origin at the tip's centre, orientation of the last link.
    pub fn tip(&self, j: usize) -> &Isometry3<f64> {
        &self.tips[j]
    }

    /// Column `i` of the velocity Jacobian in W of the point `p_W` of the last link of finger `j`: a_i x (p - o_i).
    pub fn jacobian_column(&self, j: usize, i: usize, p_W: &Vector3<f64>) -> Vector3<f64> {
        let at = j * self.n_joints + i;
        self.axes[at].cross(&(p_W - self.anchors[at]))
    }

    /// Where the point `p_W` of the last link of finger `j` goes when joint `i` turns by `angle` rad: R(a_i) (p - o_i) + o_i.
    pub fn turned(&self, j: usize, i: usize, angle: f64, p_W: &Vector3<f64>) -> Vector3<f64> {
        let at = j * self.n_joints + i;
        let turn = UnitQuaternion::from_scaled_axis(self.axes[at] * angle);
        turn * (p_W - self.anchors[at]) + self.anchors[at]
    }

    /// The velocity Jacobian (3, n_joints) in W of the point `p_W` of the last link of finger `j`.
    pub fn jacobian(&self, j: usize, p_W: &Vector3<f64>) -> DMatrix<f64> {
        let columns: Vec<_> = (0..self.n_joints).map(|i| self.jacobian_column(j, i, p_W)).collect();
        DMatrix::from_fn(3, self.n_joints, |r, c| columns[c][r])
    }

    /// Writes the joint torques that hold the fingers' own weight, N m, finger by finger.
    pub fn gravity_torque(&self, hand: &HandModel, tau: &mut [f64]) {
        let g = Vector3::from(hand.gravity);
        for (j, finger) in hand.fingers.iter().enumerate() {
            // From the tip inwards: the weight beyond a joint, and its moment about the world's origin.
            let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
            for (i, joint) in finger.joints.iter().enumerate().rev() {
                let at = j * self.n_joints + i;
                let weight = g * joint.mass;
                force += weight;
                moment += self.coms[at].cross(&weight);
                tau[at] = -self.axes[at].dot(&(moment - self.anchors[at].cross(&force)));
            }
        }
    }
}
