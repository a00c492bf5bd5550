//! From the description of a hand to the form that the kinematics use.

use super::limits;
use super::{Coordinate, Finger, Follows, HandModel, Joint};
use crate::error::Error;
use nalgebra::{Isometry3, Matrix3, Quaternion, SymmetricEigen, Translation3, Unit, UnitQuaternion, Vector3};
use std::ops::Range;

/// Where everything is in the flat arrays.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Layout {
    /// Independent joints of each finger.
    pub joints: Vec<Range<usize>>,
    /// What is known of each independent joint.
    pub coordinates: Vec<Coordinate>,
    /// Link k is that of independent joint k; those of the followers come behind, ordered by their leaders.
    pub links: Vec<Link>,
    /// Links of each independent joint's followers.
    pub followers: Vec<Range<usize>>,
    /// Links of each finger, from the palm to the tip.
    pub chains: Vec<Vec<usize>>,
    /// Some joint has a spring.
    pub springs: bool,
}

/// A joint in the form that the kinematics use.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Link {
    pub X_parent: Isometry3<f64>,
    pub anchor: Vector3<f64>,
    pub axis: Unit<Vector3<f64>>,
    pub com: Vector3<f64>,
    pub mass: f64,
    /// About the centre of mass, in the link's frame, kg m^2.
    pub inertia: Matrix3<f64>,
    pub stiffness: f64,
    pub spring_reference: f64,
    /// The independent joint that turns it, and how: angle = ratio q[at] + offset.
    pub at: usize,
    pub ratio: f64,
    pub offset: f64,
    /// Its place in the description.
    pub finger: usize,
    pub joint: usize,
}

impl Layout {
    pub(super) fn new(fingers: &[Finger]) -> Result<Self, Error> {
        if !(2..=HandModel::MAX_FINGERS).contains(&fingers.len()) {
            let expected = format!("2 to {}", HandModel::MAX_FINGERS);
            return Err(Error::config("hand.fingers", expected, fingers.len()));
        }
        let mut layout = Self::default();
        let mut followers = Vec::new();
        for (j, finger) in fingers.iter().enumerate() {
            layout.add(j, finger, &mut followers)?;
        }
        followers.sort_by_key(|link| (link.at, link.joint));
        for at in 0..layout.coordinates.len() {
            let first = layout.links.len();
            layout.links.extend(followers.iter().filter(|link| link.at == at).cloned());
            layout.followers.push(first..layout.links.len());
        }
        for (j, finger) in fingers.iter().enumerate() {
            let link = |i: usize| layout.links.iter().position(|link| (link.finger, link.joint) == (j, i));
            let chain: Vec<_> = (0..finger.joints.len()).filter_map(link).collect();
            layout.chains.push(chain);
        }
        layout.springs = layout.links.iter().any(|link| link.stiffness > 0.0);
        Ok(layout)
    }

    /// Adds finger `j`: its independent joints to the links, the others to `followers`.
    fn add(&mut self, j: usize, finger: &Finger, followers: &mut Vec<Link>) -> Result<(), Error> {
        let at = format!("hand.fingers[{j}]");
        finite(&format!("{at}.tip.position"), &finger.tip.position)?;
        if !(finger.tip.radius.is_finite() && finger.tip.radius > 0.0) {
            return Err(Error::config(at + ".tip.radius", "a radius > 0", finger.tip.radius));
        }
        let (n, first) = (finger.joints.len(), self.coordinates.len());
        let independent = finger.joints.iter().filter(|joint| joint.follows.is_none()).count();
        if n > HandModel::MAX_LINKS || !(1..=HandModel::MAX_JOINTS).contains(&independent) {
            let (joints, links) = (HandModel::MAX_JOINTS, HandModel::MAX_LINKS);
            let expected = format!("1 to {joints} that follow no other, {links} in all at most");
            return Err(Error::config(at + ".joints", expected, format!("{independent}, {n} in all")));
        }
        // Place in q of each joint that follows no other.
        let mut place = vec![usize::MAX; n];
        for (i, joint) in finger.joints.iter().enumerate() {
            check(&format!("{at}.joints[{i}]"), joint)?;
            if joint.follows.is_none() {
                place[i] = self.coordinates.len();
                self.coordinates.push(coordinate(joint));
                self.links.push(link(&format!("{at}.joints[{i}]"), joint, place[i], 1.0, 0.0, (j, i))?);
            }
        }
        for (i, joint) in finger.joints.iter().enumerate().filter(|(_, joint)| joint.follows.is_some()) {
            let at = format!("{at}.joints[{i}]");
            let (leader, ratio, offset) = leader(&at, &finger.joints, i)?;
            self.couple(&at, place[leader], joint, ratio, offset)?;
            followers.push(link(&at, joint, place[leader], ratio, offset, (j, i))?);
        }
        for (i, joint) in finger.joints.iter().enumerate().filter(|(_, joint)| joint.follows.is_none()) {
            let c = &mut self.coordinates[place[i]];
            c.reference = joint.reference.unwrap_or(0.5 * (c.lower + c.upper));
            if !(c.reference >= c.lower && c.reference <= c.upper) {
                let expected = format!("an angle from {} to {} rad", c.lower, c.upper);
                return Err(Error::config(format!("{at}.joints[{i}].reference"), expected, c.reference));
            }
        }
        self.joints.push(first..self.coordinates.len());
        Ok(())
    }

    /// Reflects the follower `joint`, at `ratio q + offset`, onto its leader, independent joint `leader`.
    fn couple(
        &mut self,
        at: &str,
        leader: usize,
        joint: &Joint,
        ratio: f64,
        offset: f64,
    ) -> Result<(), Error> {
        let c = &mut self.coordinates[leader];
        let (a, b) = ((joint.lower - offset) / ratio, (joint.upper - offset) / ratio);
        c.lower = c.lower.max(a.min(b));
        c.upper = c.upper.min(a.max(b));
        if c.lower >= c.upper {
            let expected = "a ratio and an offset that leave the leader some of its range";
            let found = format!("[{}, {}] rad", c.lower, c.upper);
            return Err(Error::config(format!("{at}.follows"), expected, found));
        }
        c.damping += ratio * ratio * joint.damping;
        c.armature += ratio * ratio * joint.armature;
        c.frictionloss += ratio.abs() * joint.frictionloss;
        Ok(())
    }
}

/// The joint without a leader that joint `i` follows in the end, and its angle by that one's: (joint, ratio, offset).
fn leader(at: &str, joints: &[Joint], i: usize) -> Result<(usize, f64, f64), Error> {
    let (mut now, mut ratio, mut offset) = (i, 1.0, 0.0);
    // A chain that is longer than the finger goes round in circles.
    for _ in 0..joints.len() {
        let Some(Follows { joint, ratio: r, offset: o }) = joints[now].follows else {
            return Ok((now, ratio, offset));
        };
        if joint >= joints.len() {
            let expected = format!("0 to {}", joints.len() - 1);
            return Err(Error::config(format!("{at}.follows.joint"), expected, joint));
        }
        offset += ratio * o;
        ratio *= r;
        if !(ratio.is_normal() && offset.is_finite()) {
            let found = format!("{r}, {o}");
            return Err(Error::config(format!("{at}.follows"), "a finite ratio, not 0, and offset", found));
        }
        now = joint;
    }
    let found = "joints that follow each other";
    Err(Error::config(format!("{at}.follows.joint"), "a joint that follows no other in the end", found))
}

/// `joint` by itself; the reference is to come.
fn coordinate(joint: &Joint) -> Coordinate {
    Coordinate {
        lower: joint.lower,
        upper: joint.upper,
        tau_min: joint.tau_min,
        tau_max: joint.tau_max,
        damping: joint.damping,
        armature: joint.armature,
        frictionloss: joint.frictionloss,
        reference: f64::NAN,
    }
}

pub(super) fn finite(field: &str, values: &[f64]) -> Result<(), Error> {
    if values.iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err(Error::config(field, "finite numbers", format!("{values:?}")))
    }
}

fn check(at: &str, joint: &Joint) -> Result<(), Error> {
    for (name, values) in [
        ("position", &joint.position[..]),
        ("quaternion", &joint.quaternion),
        ("anchor", &joint.anchor),
        ("axis", &joint.axis),
        ("com", &joint.com),
        ("inertia", &joint.inertia),
        ("spring_reference", &[joint.spring_reference]),
        ("limits", &[joint.lower, joint.upper]),
    ] {
        finite(&format!("{at}.{name}"), values)?;
    }
    if joint.lower >= joint.upper {
        let found = format!("[{}, {}]", joint.lower, joint.upper);
        return Err(Error::config(format!("{at}.limits"), "lower < upper", found));
    }
    for (name, value) in [
        ("mass", joint.mass),
        ("damping", joint.damping),
        ("armature", joint.armature),
        ("frictionloss", joint.frictionloss),
        ("stiffness", joint.stiffness),
    ] {
        if !(value.is_finite() && value >= 0.0) {
            return Err(Error::config(format!("{at}.{name}"), "a finite number >= 0", value));
        }
    }
    let [xx, yy, zz, xy, xz, yz] = joint.inertia;
    let moments = SymmetricEigen::try_new(Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz), f64::EPSILON, 64);
    let floor = -1e-9 * (xx + yy + zz).abs();
    if !moments.is_some_and(|moments| moments.eigenvalues.iter().all(|moment| *moment >= floor)) {
        let found = format!("{:?}", joint.inertia);
        return Err(Error::config(format!("{at}.inertia"), "principal moments >= 0", found));
    }
    if joint.follows.is_some() {
        for (name, value) in
            [("tau_min", joint.tau_min), ("tau_max", joint.tau_max), ("reference", joint.reference)]
        {
            if let Some(value) = value {
                let expected = "none: the joint follows another, which states it";
                return Err(Error::config(format!("{at}.{name}"), expected, value));
            }
        }
    } else {
        let (low, high) = (joint.tau_min.unwrap_or(-1.0), joint.tau_max.unwrap_or(1.0));
        limits::check(&format!("{at}.tau_min"), &format!("{at}.tau_max"), low, high)?;
    }
    Ok(())
}

fn link(
    at: &str,
    joint: &Joint,
    leader: usize,
    ratio: f64,
    offset: f64,
    (finger, index): (usize, usize),
) -> Result<Link, Error> {
    let [w, x, y, z] = joint.quaternion;
    let quaternion = Quaternion::new(w, x, y, z);
    if (quaternion.norm() - 1.0).abs() > 1e-3 {
        let found = format!("{:?}", joint.quaternion);
        return Err(Error::config(format!("{at}.quaternion"), "a unit quaternion (wxyz)", found));
    }
    let axis = Unit::try_new(Vector3::from(joint.axis), 1e-9).ok_or_else(|| {
        Error::config(format!("{at}.axis"), "a vector that is not zero", format!("{:?}", joint.axis))
    })?;
    let [xx, yy, zz, xy, xz, yz] = joint.inertia;
    Ok(Link {
        X_parent: Isometry3::from_parts(
            Translation3::from(Vector3::from(joint.position)),
            UnitQuaternion::from_quaternion(quaternion),
        ),
        anchor: Vector3::from(joint.anchor),
        axis,
        com: Vector3::from(joint.com),
        mass: joint.mass,
        inertia: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
        stiffness: joint.stiffness,
        spring_reference: joint.spring_reference,
        at: leader,
        ratio,
        offset,
        finger,
        joint: index,
    })
}
