//! Grasp quality, eq. (1), and its gradient for one finger, eqs. (2) and (3).

use crate::config::{GaitConfig, QualityPlane};
use crate::grasp::{Grasp, Scene};
use crate::hand::HandModel;
use nalgebra::{Isometry3, Matrix3, SymmetricEigen, Unit, Vector2, Vector3};
use std::ops::Range;

/// The qualities of a grasp at one instant.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Quality {
    /// Object grasp quality: twice the area spanned by the contacts on the quality plane, m^2.
    pub Q_o: f64,
    /// Hand manipulability, without unit.
    pub Q_h: f64,
    /// Q = w1 Q_o + w2 Q_h.
    pub Q: f64,
}

/// Contact points projected on the quality plane, in angular order about their mean.
#[derive(Debug, Clone, Copy)]
struct Projection {
    n: usize,
    /// Finger indices in angular order.
    order: [usize; HandModel::MAX_FINGERS],
    /// Projected points by finger.
    points: [Vector2<f64>; HandModel::MAX_FINGERS],
    /// Basis of the plane in W.
    x: Vector3<f64>,
    y: Vector3<f64>,
}

/// Computes eq. (1) and its gradients, with the plane and the height that the first grasp set.
#[derive(Debug, Clone)]
pub struct QualityModel {
    config: GaitConfig,
    /// Of each joint: the posture it should return to, rad, its range, and how far it can turn below and above that posture.
    reference: Vec<f64>,
    range: Vec<f64>,
    reach: Vec<[f64; 2]>,
    joints: Vec<Range<usize>>,
    /// Against gravity, in W.
    up: Vector3<f64>,
    /// Normal of the quality plane and mean contact height along it, in the object's frame, from the first grasp.
    plane: Option<(Unit<Vector3<f64>>, f64)>,
}

impl QualityModel {
    /// The quality of grasps of `hand` under `config`.
    pub fn new(hand: &HandModel, config: &GaitConfig) -> Self {
        let joints = hand.coordinates();
        Self {
            config: config.clone(),
            reference: joints.iter().map(|c| c.reference).collect(),
            range: joints.iter().map(|c| c.upper - c.lower).collect(),
            reach: joints.iter().map(|c| [c.reference - c.lower, c.upper - c.reference]).collect(),
            joints: (0..hand.n_fingers()).map(|j| hand.joints(j)).collect(),
            up: hand.up(),
            plane: None,
        }
    }

    /// Forgets the first grasp.
    pub fn reset(&mut self) {
        self.plane = None;
    }

    /// Takes the present contacts as the first grasp: it fixes the plane's normal and the mean height in the object.
    pub fn set_first_grasp(&mut self, scene: &Scene<'_>) {
        let Scene { grasp, X_WO, .. } = *scene;
        let n_W = best_fit_normal(grasp, &self.up, |_| true);
        let n_O = X_WO.rotation.inverse() * n_W;
        let sum: f64 = (0..grasp.contacts().len()).map(|j| height(grasp, j, X_WO, &n_O)).sum();
        self.plane = Some((n_O, sum / grasp.contacts().len() as f64));
    }

    /// Height of contact `j` over the first grasp's mean, along the first plane's normal in the object, m.
    pub fn height_error(&self, scene: &Scene<'_>, j: usize) -> f64 {
        self.plane.map_or(0.0, |(n_O, h_ref)| height(scene.grasp, j, scene.X_WO, &n_O) - h_ref)
    }

    /// Manipulability of finger `j` at the joint angles `q` of all fingers: its summand of Q_h.
    pub fn manipulability(&self, j: usize, q: &[f64]) -> f64 {
        let joints = self.joints[j].clone();
        -0.5 * joints.map(|at| ((q[at] - self.reference[at]) / self.range[at]).powi(2)).sum::<f64>()
    }

    /// Q of the grasp with all fingers, eq. (1).
    pub fn quality(&self, scene: &Scene<'_>) -> Quality {
        let Q_o = self.project(scene, None).double_area(None);
        let Q_h = (0..scene.grasp.contacts().len()).map(|j| self.manipulability(j, scene.q)).sum();
        Quality { Q_o, Q_h, Q: self.config.w1 * Q_o + self.config.w2 * Q_h }
    }

    /// Quality of the grasp that remains when finger `k` is freed: twice the area of the other contacts, m^2.
    pub fn remaining_quality(&self, scene: &Scene<'_>, k: usize) -> f64 {
        self.project(scene, Some(k)).double_area(Some(k))
    }

    /// Writes the coefficients c of `Q-dot = c . qd_k` for the free finger `k`, eq. (3), with the joint-limit weights
    /// c_k^i and the height term. `qd` is the finger's present desired velocity, for the height's look-ahead.
    pub fn rate_coefficients(&self, k: usize, scene: &Scene<'_>, qd: &[f64], c: &mut [f64]) {
        let Scene { grasp, state, X_WO, q, .. } = *scene;
        let p_WC = grasp.contact(k).p_WC;
        let area_gradient = self.project(scene, Some(k)).gradient(k);
        for (at, c) in self.joints[k].clone().zip(c.iter_mut()) {
            let column = state.jacobian_column(at, &p_WC);
            let (d, range) = (q[at] - self.reference[at], self.range[at]);
            let reach = self.reach[at][usize::from(d > 0.0)];
            let posture = -limit_weight(d, reach, range, self.config.q_thres) * d / (range * range);
            *c = self.config.w1 * area_gradient.dot(&column) + self.config.w2 * posture;
        }
        let Some((n_O, _)) = self.plane else { return };
        let n_W = X_WO.rotation * n_O.into_inner();
        let climb = |at: usize| n_W.dot(&state.jacobian_column(at, &p_WC));
        let h_dot: f64 = self.joints[k].clone().zip(qd).map(|(at, qd)| climb(at) * qd).sum();
        let h = self.height_error(scene, k) + self.config.height_horizon * h_dot;
        for (at, c) in self.joints[k].clone().zip(c.iter_mut()) {
            *c -= self.config.w_z * h * climb(at);
        }
    }

    fn project(&self, scene: &Scene<'_>, free: Option<usize>) -> Projection {
        let Scene { grasp, X_WO, .. } = *scene;
        let normal = match (self.config.plane, self.plane) {
            (QualityPlane::Object, Some((n_O, _))) => X_WO.rotation * n_O,
            _ => best_fit_normal(grasp, &self.up, |j| Some(j) != free),
        };
        Projection::new(grasp, &normal)
    }
}

/// Height of contact `j` along `n_O` from the object's origin, m.
fn height(grasp: &Grasp, j: usize, X_WO: &Isometry3<f64>, n_O: &Unit<Vector3<f64>>) -> f64 {
    (X_WO.rotation * n_O.into_inner()).dot(&(grasp.contact(j).p_WC - X_WO.translation.vector))
}

/// The weighting function c_k^i of eq. (3) at distance `d` from the joint's reference, from where the limit on that side is
/// `reach` away; `range` = q_max - q_min.
///
/// Deviation: the paper's reference is the middle of the range, with the same reach on both sides. Within 1e-3 of the range
/// of a limit the logarithm is held, so that it stays finite at and past the limit.
fn limit_weight(d: f64, reach: f64, range: f64, threshold_fraction: f64) -> f64 {
    let threshold = threshold_fraction * reach;
    if d.abs() <= threshold {
        return 1.0;
    }
    let least = 1e-3 * range;
    let to_limit = (reach - d.abs()).max(least);
    ((reach - threshold).max(least) / to_limit).ln() + 1.0
}

/// Unit normal of the plane that fits the chosen contacts best, on the side of `up`; `up` itself where they fix no plane.
///
/// Where the plane holds `up`, the side is that of the computed normal: Q_o and its gradient are the same for both.
fn best_fit_normal(grasp: &Grasp, up: &Vector3<f64>, chosen: impl Fn(usize) -> bool) -> Unit<Vector3<f64>> {
    let points = || grasp.contacts().iter().enumerate().filter(|(j, _)| chosen(*j)).map(|(_, c)| c.p_WC);
    let count = points().count();
    let mean = points().sum::<Vector3<f64>>() / count.max(1) as f64;
    let normal = if count == 3 {
        let mut p = points();
        match (p.next(), p.next(), p.next()) {
            (Some(a), Some(b), Some(c)) => (b - a).cross(&(c - a)),
            _ => *up,
        }
    } else {
        let scatter: Matrix3<f64> = points().map(|p| (p - mean) * (p - mean).transpose()).sum();
        // Bounded: a control step never iterates until it converges.
        SymmetricEigen::try_new(scatter, f64::EPSILON, 64)
            .map_or(*up, |eigen| eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned())
    };
    let normal = Unit::try_new(normal, 1e-12).unwrap_or(Unit::new_unchecked(*up));
    if normal.dot(up) < 0.0 {
        -normal
    } else {
        normal
    }
}

impl Projection {
    fn new(grasp: &Grasp, normal: &Unit<Vector3<f64>>) -> Self {
        let seed = if normal.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
        let x = (seed - normal.into_inner() * normal.dot(&seed)).normalize();
        let y = normal.cross(&x);
        let n = grasp.contacts().len();
        let mut points = [Vector2::zeros(); HandModel::MAX_FINGERS];
        for (point, contact) in points.iter_mut().zip(grasp.contacts()) {
            *point = Vector2::new(x.dot(&contact.p_WC), y.dot(&contact.p_WC));
        }
        let mean = points[..n].iter().sum::<Vector2<f64>>() / n as f64;
        let mut order = std::array::from_fn(|j| j);
        let angle = |j: usize| (points[j].y - mean.y).atan2(points[j].x - mean.x);
        // Insertion sort: n <= 6, and ties keep the fingers' own order.
        for i in 1..n {
            let mut at = i;
            while at > 0 && angle(order[at - 1]) > angle(order[at]) {
                order.swap(at - 1, at);
                at -= 1;
            }
        }
        Self { n, order, points, x, y }
    }

    /// Twice the area of the polygon of the contacts, without finger `free`.
    fn double_area(&self, free: Option<usize>) -> f64 {
        let mut sum = 0.0;
        let mut first = None;
        let mut previous: Option<Vector2<f64>> = None;
        for &j in self.order[..self.n].iter().filter(|j| Some(**j) != free) {
            let p = self.points[j];
            if let Some(last) = previous {
                sum += last.perp(&p);
            }
            first.get_or_insert(p);
            previous = Some(p);
        }
        if let (Some(first), Some(last)) = (first, previous) {
            sum += last.perp(&first);
        }
        sum.abs()
    }

    /// The gradient |p_j2 - p_j3| n_j1 of Q_o with respect to p_k in W, m, eq. (2): j2 and j3 are the neighbours of k,
    /// n_j1 is perpendicular to the segment between them and points to k's side, away from the opposite finger.
    fn gradient(&self, k: usize) -> Vector3<f64> {
        let n = self.n;
        let at = self.order[..n].iter().position(|j| *j == k).unwrap_or(0);
        let before = self.points[self.order[(at + n - 1) % n]];
        let after = self.points[self.order[(at + 1) % n]];
        // The order is anticlockwise, so k lies to the right of the segment from its predecessor to its successor.
        let segment = after - before;
        self.x * segment.y - self.y * segment.x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limit_weight_is_one_in_the_middle_and_continuous() {
        for d in [-0.2, 0.0, 0.2] {
            assert!((limit_weight(d, 0.5, 1.0, 0.5) - 1.0).abs() < 1e-15);
        }
        for d in [0.25 + 1e-12, -0.25 - 1e-12] {
            assert!((limit_weight(d, 0.5, 1.0, 0.5) - 1.0).abs() < 1e-9);
        }
        // The paper's formula: ln((q_max - q_bar - q_thres) / (q_max - q)) + 1.
        assert!((limit_weight(0.4, 0.5, 1.0, 0.5) - ((0.25_f64 / 0.1).ln() + 1.0)).abs() < 1e-12);
        assert!(limit_weight(0.6, 0.5, 1.0, 0.5).is_finite());
        // A reference at a limit: nothing to turn on that side.
        for d in [0.0, 1e-6, 0.2] {
            assert!((limit_weight(d, 0.0, 1.0, 0.5) - 1.0).abs() < 1e-15);
        }
    }
}
