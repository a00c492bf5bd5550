//! The object's motion as the fingers tell it: the material points of the tips that stick to it move with it.

use crate::hand::{HandModel, HandState};
use crate::signals::Tactile;
use crate::spatial::{angular, integrate, linear};
use nalgebra::{Isometry3, Matrix3, Point3, Vector3, Vector6};

/// Time constant with which the motion of a finger against the object is forgotten, s: creep is not a fault.
const FORGET: f64 = 5.0;
/// Added to the contacts' moments of inertia, m^2: two contacts tell nothing about turns about the line between them.
const LEVEL: f64 = 1e-6;

/// One finger's part of [`Odometry`].
#[derive(Debug, Clone)]
struct Tip {
    /// Pose of the fingertip in the last step.
    X_WF: Isometry3<f64>,
    /// True where the finger stuck to the object in the last step, and does in this one.
    sticks: bool,
    /// Where the point of the tip that touches now was one step ago, and where it is, in W, m.
    before: Vector3<f64>,
    now: Vector3<f64>,
    /// Motion of the object against the tip, at the contact, since the finger has stuck, m.
    drift: Vector3<f64>,
}

/// See the module. Allocated once.
#[derive(Debug, Clone)]
pub struct Odometry {
    dt: f64,
    tips: Vec<Tip>,
    /// Pose of the object in the last step.
    X_WO: Option<Isometry3<f64>>,
}

impl Odometry {
    /// Odometry for `hand` at the control period `dt`.
    pub fn new(hand: &HandModel, dt: f64) -> Self {
        let (X_WF, zero) = (Isometry3::identity(), Vector3::zeros());
        let tip = Tip { X_WF, sticks: false, before: zero, now: zero, drift: zero };
        Self { dt, tips: vec![tip; hand.n_fingers()], X_WO: None }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.X_WO = None;
        for tip in &mut self.tips {
            tip.sticks = false;
            tip.drift = Vector3::zeros();
        }
    }

    /// Motion of the object at its origin since the last step [m; rad], from the fingers that stick to it by `sticks(j)`.
    /// None where fewer than two do.
    pub fn motion(
        &mut self,
        hand: &HandModel,
        state: &HandState,
        tactile: &[Tactile],
        sticks: impl Fn(usize) -> bool,
    ) -> Option<Vector6<f64>> {
        let (mut n, mut before, mut moved) = (0.0, Vector3::zeros(), Vector3::zeros());
        for (j, tip) in self.tips.iter_mut().enumerate() {
            let X_WF = state.tip(j);
            let arm = tactile[j].p_FC;
            let length = arm.norm();
            let touches = sticks(j) && tactile[j].f_n > 0.0 && length > 1e-6;
            if !touches {
                tip.sticks = false;
                tip.drift = Vector3::zeros();
            } else if self.X_WO.is_some() {
                let p_FC = Point3::from(arm * (hand.tip_radius(j) / length));
                tip.sticks = true;
                tip.now = (X_WF * p_FC).coords;
                tip.before = (tip.X_WF * p_FC).coords;
                n += 1.0;
                before += tip.before;
                moved += tip.now - tip.before;
            }
            tip.X_WF = *X_WF;
        }
        let X_WO = self.X_WO?;
        if n < 2.0 {
            return None;
        }
        // Least squares of moved_j = d + r x (before_j - mean): d is the mean, r solves a 3 x 3 system.
        let (mean, d) = (before / n, moved / n);
        let (mut inertia, mut moment) = (Matrix3::identity() * LEVEL, Vector3::zeros());
        for tip in self.tips.iter().filter(|tip| tip.sticks) {
            let arm = tip.before - mean;
            inertia += Matrix3::identity() * arm.norm_squared() - arm * arm.transpose();
            moment += arm.cross(&(tip.now - tip.before - d));
        }
        let r = inertia.try_inverse()? * moment;
        let p = d + r.cross(&(X_WO.translation.vector - mean));
        Some(Vector6::new(p.x, p.y, p.z, r.x, r.y, r.z))
    }

    /// Takes the pose that this step believes, and how each finger has moved against it. `steady`: pose and fingers come
    /// from sensors that work, so that what remains is slip or a stuck encoder.
    pub fn settle(&mut self, X_WO: &Isometry3<f64>, steady: bool) {
        let keep = 1.0 - self.dt / FORGET;
        if let (Some(previous), true) = (self.X_WO, steady) {
            let back = previous * X_WO.inverse();
            for tip in self.tips.iter_mut().filter(|tip| tip.sticks) {
                let object = tip.now - (back * Point3::from(tip.now)).coords;
                tip.drift = tip.drift * keep + object - (tip.now - tip.before);
            }
        }
        self.X_WO = Some(*X_WO);
    }

    /// How far the object has moved against finger `j` while both should stick, in W, m.
    pub fn drift(&self, j: usize) -> Vector3<f64> {
        self.tips[j].drift
    }

    /// The pose of the object in the last step.
    pub fn pose(&self) -> Option<&Isometry3<f64>> {
        self.X_WO.as_ref()
    }

    /// True where finger `j` stuck to the object in the last step.
    pub fn sticks(&self, j: usize) -> bool {
        self.tips[j].sticks
    }

    /// The contact of finger `j` in W while it sticks, m.
    pub fn contact(&self, j: usize) -> &Vector3<f64> {
        &self.tips[j].now
    }

    /// Mean length of [`Odometry::drift`] over the other fingers that stick, m.
    pub fn drift_of_others(&self, j: usize) -> f64 {
        let others = || self.tips.iter().enumerate().filter(|(k, tip)| *k != j && tip.sticks);
        others().map(|(_, tip)| tip.drift.norm()).sum::<f64>() / others().count().max(1) as f64
    }

    /// Mean of the fingertips' centres in W, m.
    pub fn centre(&self, state: &HandState) -> Vector3<f64> {
        let sum: Vector3<f64> = (0..self.tips.len()).map(|j| state.tip(j).translation.vector).sum();
        sum / self.tips.len() as f64
    }
}

/// The pose `X` moved by `motion` [m; rad] at its origin.
pub fn moved(X: &Isometry3<f64>, motion: &Vector6<f64>) -> Isometry3<f64> {
    integrate(X, motion, 1.0)
}

/// Lengths of the two halves of a motion, m and rad.
pub fn size(motion: &Vector6<f64>) -> [f64; 2] {
    [linear(motion).norm(), angular(motion).norm()]
}
