//! Hands that nobody has built: two to six fingers, each with its own number of joints, some of which follow others, under
//! any gravity. The kinematics are also written down as matrices, without any code of the crate's own.
#![allow(dead_code, reason = "each user needs its own part")]

use super::instances::Random;
use fg_core::hand::{Block, Finger, Follows, HandModel, HandState, Joint, Tip};
use fg_core::signals::{Measurement, Reference, Tactile};
use nalgebra::{Isometry3, Matrix4, Point3, Quaternion, Rotation3, Unit, UnitQuaternion, Vector3, Vector6};

/// Any hand, and its gravity.
pub fn any(random: &mut Random) -> (Vec<Finger>, [f64; 3]) {
    let n = 2 + random.below(5);
    let stated = random.below(2) == 0;
    let fingers = (0..n).map(|j| finger(random, j, n, stated)).collect();
    let gravity = match random.below(4) {
        0 => Vector3::zeros(),
        1 => Vector3::new(0.0, 0.0, -9.81),
        _ => random.vector(1.0).normalize() * 9.81,
    };
    (fingers, gravity.into())
}

fn finger(random: &mut Random, j: usize, n: usize, stated: bool) -> Finger {
    let independent = 1 + random.below(HandModel::MAX_JOINTS);
    let followers = random.below(4);
    // Which of the joints have a motor.
    let mut motors: Vec<bool> = (0..independent + followers).map(|i| i < independent).collect();
    for i in (1..motors.len()).rev() {
        motors.swap(i, random.below(i + 1));
    }
    let mut joints: Vec<_> = motors.iter().map(|motor| joint(random, *motor && stated)).collect();
    let angle = std::f64::consts::TAU * j as f64 / n as f64;
    joints[0].position = [0.1 * angle.cos(), 0.1 * angle.sin(), random.uniform(-0.02, 0.02)];
    for i in 0..joints.len() {
        if motors[i] {
            continue;
        }
        // A leader, or another follower that was given its own before: no circles.
        let known: Vec<usize> = (0..joints.len()).filter(|k| motors[*k] || *k < i).collect();
        let leader = known[random.below(known.len())];
        let sign = if random.below(2) == 0 { 1.0 } else { -1.0 };
        let (ratio, offset) = (sign * random.uniform(0.3, 1.5), random.uniform(-0.2, 0.2));
        joints[i].follows = Some(Follows { joint: leader, ratio, offset });
    }
    let tip = Tip { position: random.vector(0.03).into(), radius: random.uniform(0.005, 0.02) };
    let blocks = random.below(4);
    let outline = (0..blocks).map(|_| block(random, joints.len())).collect();
    Finger { name: format!("f{j}"), joints, tip, outline }
}

fn block(random: &mut Random, joints: usize) -> Block {
    let turn = UnitQuaternion::from_scaled_axis(random.vector(1.5));
    let Quaternion { coords } = turn.into_inner();
    Block {
        joint: random.below(joints),
        position: random.vector(0.02).into(),
        quaternion: [coords.w, coords.x, coords.y, coords.z],
        half: random.vector(0.01).abs().into(),
        radius: random.uniform(0.0, 0.01),
    }
}

fn joint(random: &mut Random, limited: bool) -> Joint {
    let turn = UnitQuaternion::from_scaled_axis(random.vector(1.5));
    let Quaternion { coords } = turn.into_inner();
    let i = random.uniform(1e-6, 1e-4);
    Joint {
        name: "joint".into(),
        position: random.vector(0.04).into(),
        quaternion: [coords.w, coords.x, coords.y, coords.z],
        anchor: random.vector(0.01).into(),
        axis: (random.vector(1.0) + Vector3::new(0.0, 0.0, 1.5)).into(),
        lower: random.uniform(-2.0, -1.0),
        upper: random.uniform(1.0, 2.0),
        damping: random.uniform(0.0, 0.1),
        mass: random.uniform(0.0, 0.1),
        com: random.vector(0.03).into(),
        inertia: [i, i, i, 0.0, 0.0, 0.0],
        armature: random.uniform(0.0, 1e-3),
        frictionloss: random.uniform(0.0, 0.02),
        stiffness: random.uniform(0.0, 0.2),
        spring_reference: random.uniform(-0.5, 0.5),
        tau_min: limited.then(|| -random.uniform(0.0, 1.0)),
        tau_max: limited.then(|| random.uniform(0.1, 1.0)),
        ..Joint::default()
    }
}

/// Angle of joint `i` of `finger`, whose independent joints are at `q`, rad.
pub fn angle(finger: &Finger, q: &[f64], i: usize) -> f64 {
    match finger.joints[i].follows {
        Some(follows) => follows.ratio * angle(finger, q, follows.joint) + follows.offset,
        None => q[finger.joints[..i].iter().filter(|joint| joint.follows.is_none()).count()],
    }
}

/// Link frames of `finger` in W by homogeneous matrices.
pub fn frames(finger: &Finger, q: &[f64]) -> Vec<Matrix4<f64>> {
    let mut X = Matrix4::identity();
    let frame = |(i, joint): (usize, &Joint)| {
        let [w, x, y, z] = joint.quaternion;
        let turned = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_homogeneous();
        let axis = Unit::new_normalize(Vector3::from(joint.axis));
        let turn = Rotation3::from_axis_angle(&axis, angle(finger, q, i)).to_homogeneous();
        let anchor = Vector3::from(joint.anchor);
        let about = Matrix4::new_translation(&anchor) * turn * Matrix4::new_translation(&-anchor);
        X *= Matrix4::new_translation(&Vector3::from(joint.position)) * turned * about;
        X
    };
    finger.joints.iter().enumerate().map(frame).collect()
}

/// The point `p_F` of the fingertip frame of `finger` in W, m.
pub fn tip(finger: &Finger, q: &[f64], p_F: &Vector3<f64>) -> Vector3<f64> {
    let p = Vector3::from(finger.tip.position) + p_F;
    frames(finger, q)[finger.joints.len() - 1].transform_point(&Point3::from(p)).coords
}

/// Potential energy of the links of `finger` under `gravity`, J.
pub fn weight_energy(finger: &Finger, gravity: &[f64; 3], q: &[f64]) -> f64 {
    let energy = |(X, joint): (&Matrix4<f64>, &Joint)| {
        let com = X.transform_point(&Point3::from(Vector3::from(joint.com))).coords;
        -joint.mass * Vector3::from(*gravity).dot(&com)
    };
    frames(finger, q).iter().zip(&finger.joints).map(energy).sum()
}

/// Energy of the springs of `finger`, J.
pub fn spring_energy(finger: &Finger, q: &[f64]) -> f64 {
    let energy = |(i, joint): (usize, &Joint)| {
        0.5 * joint.stiffness * (angle(finger, q, i) - joint.spring_reference).powi(2)
    };
    finger.joints.iter().enumerate().map(energy).sum()
}

/// Angles anywhere within the limits of `hand`, rad.
pub fn posture(random: &mut Random, hand: &HandModel) -> Vec<f64> {
    hand.coordinates().iter().map(|joint| random.uniform(joint.lower, joint.upper)).collect()
}

/// `n` measurements, 2 ms apart, of fingers that touch an object amid them and move a little, with a reference that turns.
pub fn rows(random: &mut Random, hand: &HandModel, n: usize) -> Vec<(Measurement, Reference)> {
    let mut state = HandState::new(hand);
    let middle: Vec<f64> = hand.coordinates().iter().map(|joint| 0.5 * (joint.lower + joint.upper)).collect();
    let swing: Vec<f64> = hand
        .coordinates()
        .iter()
        .map(|joint| 0.1 * random.uniform(-1.0, 1.0) * (joint.upper - joint.lower))
        .collect();
    let row = |k: usize| {
        let t = 0.002 * k as f64;
        let mut m = Measurement::zeros(hand.n_fingers(), hand.n_q());
        m.t = t;
        for (at, q) in m.q.iter_mut().enumerate() {
            *q = middle[at] + swing[at] * (1.5 * t).sin();
        }
        state.update(hand, m.q.as_slice());
        let tips: Vec<_> = (0..hand.n_fingers()).map(|j| state.tip(j)).collect();
        let centre = tips.iter().map(|X| X.translation.vector).sum::<Vector3<f64>>() / tips.len() as f64;
        m.X_WO = Isometry3::new(centre, Vector3::zeros());
        for (j, X_WF) in tips.iter().enumerate() {
            let n_F = X_WF.rotation.inverse() * (centre - X_WF.translation.vector).normalize();
            m.tactile[j] = Tactile { p_FC: n_F * hand.tip_radius(j), f_n: 1.0 };
        }
        let X_WD = Isometry3::new(centre, Vector3::new(0.0, 0.0, 0.2 * t));
        (m, Reference { X_WD, V_WD: Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.2) })
    };
    (0..n).map(row).collect()
}
