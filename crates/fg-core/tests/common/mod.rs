//! A hand and grasps for the tests, built without any code of the crate's own kinematics.
#![allow(dead_code, reason = "each test crate uses its own part")]

use fg_core::hand::{Finger, HandModel, Joint, Tip};
use fg_core::signals::{Measurement, Tactile};
use nalgebra::{Isometry3, Matrix4, Point3, Rotation3, Unit, Vector3};
use std::f64::consts::PI;

pub const LINKS: [f64; 2] = [0.052, 0.045];
pub const LINK_MASS: f64 = 0.02;
pub const LINK_COM: [f64; 3] = [0.01, 0.002, 0.003];
pub const TIP_RADIUS: f64 = 0.014;
pub const BASE_RADIUS: f64 = 0.0751;

fn joint(name: &str, position: [f64; 3], quaternion: [f64; 4], axis: [f64; 3], limits: [f64; 2]) -> Joint {
    Joint {
        name: name.into(),
        position,
        quaternion,
        anchor: [0.0; 3],
        axis,
        lower: limits[0].to_radians(),
        upper: limits[1].to_radians(),
        damping: 0.05,
        mass: LINK_MASS,
        com: LINK_COM,
        ..Joint::default()
    }
}

/// `n` fingers on a circle, three joints each: J1 tangential, J2 across the link at the same point, J3 parallel to J1.
/// Links lie along x, outwards from the palm's middle at angle zero; J1 lifts them.
pub fn hand(n: usize) -> HandModel {
    let fingers = (0..n).map(|j| {
        let angle = 2.0 * PI * j as f64 / n as f64;
        let base = [BASE_RADIUS * angle.cos(), BASE_RADIUS * angle.sin(), 0.0];
        let yaw = [(angle / 2.0).cos(), 0.0, 0.0, (angle / 2.0).sin()];
        let straight = [1.0, 0.0, 0.0, 0.0];
        Finger {
            name: format!("f{j}"),
            joints: vec![
                joint("j1", base, yaw, [0.0, -1.0, 0.0], [-10.0, 135.0]),
                joint("j2", [0.0; 3], straight, [0.0, 0.0, 1.0], [-45.0, 45.0]),
                joint("j3", [LINKS[0], 0.0, 0.0], straight, [0.0, -1.0, 0.0], [-10.0, 170.0]),
            ],
            tip: Tip { position: [LINKS[1], 0.0, 0.0], radius: TIP_RADIUS },
            outline: Vec::new(),
        }
    });
    HandModel::new(fingers.collect(), [0.0, 0.0, -9.81]).unwrap()
}

/// Joint angles (J1, J2, J3) per finger that put the tips against a cylinder of about 25 mm radius.
pub fn grasp_angles(n: usize) -> Vec<f64> {
    (0..n).flat_map(|_| [1.2, 0.0, 1.45]).collect()
}

/// Link frames of finger `j` of `hand(n)` in W by homogeneous matrices, independently of the crate.
fn links_by_matrices(n: usize, j: usize, q: &[f64]) -> [Matrix4<f64>; 3] {
    let angle = 2.0 * PI * j as f64 / n as f64;
    let rotation = |axis: Vector3<f64>, angle: f64| {
        Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle).to_homogeneous()
    };
    let shift = |x: f64| Matrix4::new_translation(&Vector3::new(x, 0.0, 0.0));
    let first = rotation(Vector3::z(), angle) * shift(BASE_RADIUS) * rotation(-Vector3::y(), q[3 * j]);
    let second = first * rotation(Vector3::z(), q[3 * j + 1]);
    let third = second * shift(LINKS[0]) * rotation(-Vector3::y(), q[3 * j + 2]);
    [first, second, third]
}

/// Centre of the tip of finger `j` of `hand(n)`.
pub fn tip_by_matrices(n: usize, j: usize, q: &[f64]) -> Vector3<f64> {
    let [_, _, last] = links_by_matrices(n, j, q);
    last.transform_point(&Point3::new(LINKS[1], 0.0, 0.0)).coords
}

/// Heights of the links' centres of mass of finger `j` of `hand(n)`, m.
pub fn com_heights(n: usize, j: usize, q: &[f64]) -> [f64; 3] {
    links_by_matrices(n, j, q).map(|X| X.transform_point(&Point3::from(Vector3::from(LINK_COM))).z)
}

/// A measurement of the fingers at `q` that touch, with `f_n` newtons, an upright object at the middle.
pub fn measurement(hand: &HandModel, q: &[f64], f_n: f64) -> Measurement {
    let n = hand.n_fingers();
    let mut measurement = Measurement::zeros(n, hand.n_q());
    measurement.q.copy_from_slice(q);
    measurement.X_WO = Isometry3::translation(0.0, 0.0, 0.06);
    for j in 0..n {
        // The direction inwards, seen from the last link: turned back by the joints in the vertical plane.
        let pitch = q[3 * j] + q[3 * j + 2];
        let p_FC = Vector3::new(-(pitch.cos()), 0.0, pitch.sin()) * TIP_RADIUS;
        measurement.tactile[j] = Tactile { p_FC, f_n };
    }
    measurement
}
