//! Kinematics of a hand, and the torques that hold it up, at one instant.

use super::HandModel;
use nalgebra::{DMatrix, Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use std::ops::Range;

/// Regularisation of J J^T near singular postures, m^2/rad^2; a finger's own values are near 2e-3.
const SINGULAR: f64 = 1e-6;

/// Where the hand's parts are at one instant. Allocated once, overwritten by [`HandState::update`].
#[derive(Debug, Clone)]
pub struct HandState {
    /// Independent joints of each finger.
    joints: Vec<Range<usize>>,
    /// Links of each independent joint's followers.
    followers: Vec<Range<usize>>,
    /// Turns of each link for one of the independent joint that moves it, and that joint.
    pub(super) ratios: Vec<f64>,
    pub(super) leaders: Vec<usize>,
    /// Links of each finger, from the palm to the tip.
    pub(super) chains: Vec<Vec<usize>>,
    /// True where some joint follows another.
    coupled: bool,
    /// By link: angle, a point of the axis, the axis, the centre of mass, orientation in W.
    angles: Vec<f64>,
    pub(super) anchors: Vec<Vector3<f64>>,
    pub(super) axes: Vec<Vector3<f64>>,
    pub(super) coms: Vec<Vector3<f64>>,
    pub(super) rotations: Vec<UnitQuaternion<f64>>,
    tips: Vec<Isometry3<f64>>,
}

impl HandState {
    /// A state for `hand`, not yet valid.
    pub fn new(hand: &HandModel) -> Self {
        let layout = &hand.layout;
        let n = layout.links.len();
        Self {
            joints: layout.joints.clone(),
            followers: layout.followers.clone(),
            ratios: layout.links.iter().map(|link| link.ratio).collect(),
            leaders: layout.links.iter().map(|link| link.at).collect(),
            chains: layout.chains.clone(),
            coupled: n > hand.n_q(),
            angles: vec![0.0; n],
            anchors: vec![Vector3::zeros(); n],
            axes: vec![Vector3::zeros(); n],
            coms: vec![Vector3::zeros(); n],
            rotations: vec![UnitQuaternion::identity(); n],
            tips: vec![Isometry3::identity(); hand.n_fingers()],
        }
    }

    /// Moves the state to the independent joints' angles `q`, finger by finger, rad.
    pub fn update(&mut self, hand: &HandModel, q: &[f64]) {
        for (j, chain) in hand.layout.chains.iter().enumerate() {
            let mut X = Isometry3::identity();
            for &k in chain {
                let link = &hand.layout.links[k];
                let angle = link.ratio * q[link.at] + link.offset;
                X *= link.X_parent;
                let rotation = UnitQuaternion::from_axis_angle(&link.axis, angle);
                self.angles[k] = angle;
                self.anchors[k] = (X * nalgebra::Point3::from(link.anchor)).coords;
                self.axes[k] = X.rotation * link.axis.into_inner();
                let offset = link.anchor - rotation * link.anchor;
                X *= Isometry3::from_parts(Translation3::from(offset), rotation);
                self.coms[k] = (X * nalgebra::Point3::from(link.com)).coords;
                self.rotations[k] = X.rotation;
            }
            let tip = Translation3::from(Vector3::from(hand.fingers[j].tip.position));
            self.tips[j] = X * tip;
        }
    }

    /// Where the independent joints of finger `j` are in q and tau.
    pub fn joints(&self, j: usize) -> Range<usize> {
        self.joints[j].clone()
    }

    /// Pose X_WF of the fingertip frame of finger `j`: origin at the tip's centre, orientation of the last link.
    pub fn tip(&self, j: usize) -> &Isometry3<f64> {
        &self.tips[j]
    }

    /// Column `at` of the velocity Jacobian in W of the point `p_W` of the last link of that joint's finger:
    /// a x (p - o), and the same of the joints that follow it, times their ratio.
    #[inline]
    pub fn jacobian_column(&self, at: usize, p_W: &Vector3<f64>) -> Vector3<f64> {
        let own = self.axes[at].cross(&(p_W - self.anchors[at]));
        if !self.coupled {
            return own;
        }
        let followers = self.followers[at].clone();
        followers.fold(own, |sum, k| sum + self.axes[k].cross(&(p_W - self.anchors[k])) * self.ratios[k])
    }

    /// Where the point `p_W` of the last link of finger `j` goes when its independent joints turn by `turns(i)` rad, i
    /// counted from the finger's first; None where one of these is.
    pub fn turned(
        &self,
        j: usize,
        turns: impl Fn(usize) -> Option<f64>,
        p_W: &Vector3<f64>,
    ) -> Option<Vector3<f64>> {
        let first = self.joints[j].start;
        // From the tip inwards: the joints further in are still where the state has them.
        self.chains[j].iter().rev().try_fold(*p_W, |p, &k| {
            let turn = self.axes[k] * (self.ratios[k] * turns(self.leaders[k] - first)?);
            Some(UnitQuaternion::from_scaled_axis(turn) * (p - self.anchors[k]) + self.anchors[k])
        })
    }

    /// (J J^T)^-1 v in W, J the velocity Jacobian of the point `p_W` of the last link of finger `j`: J^T times it are the
    /// smallest joint velocities that move the point at `v_W`, as well as the finger can.
    pub fn solve_gram(&self, j: usize, p_W: &Vector3<f64>, v_W: &Vector3<f64>) -> Vector3<f64> {
        let mut JJ = Matrix3::identity() * SINGULAR;
        for at in self.joints(j) {
            let column = self.jacobian_column(at, p_W);
            JJ += column * column.transpose();
        }
        JJ.cholesky().map_or(Vector3::zeros(), |cholesky| cholesky.solve(v_W))
    }

    /// The velocity Jacobian (3, joints) in W of the point `p_W` of the last link of finger `j`.
    pub fn jacobian(&self, j: usize, p_W: &Vector3<f64>) -> DMatrix<f64> {
        let columns: Vec<_> = self.joints(j).map(|at| self.jacobian_column(at, p_W)).collect();
        DMatrix::from_fn(3, columns.len(), |r, c| columns[c][r])
    }

    /// Writes the joint torques that hold the fingers' own weight, N m, finger by finger.
    pub fn gravity_torque(&self, hand: &HandModel, tau: &mut [f64]) {
        let g = hand.gravity();
        tau.fill(0.0);
        for chain in &self.chains {
            // From the tip inwards: the weight beyond a joint, and its moment about the world's origin.
            let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
            for &k in chain.iter().rev() {
                let link = &hand.layout.links[k];
                let weight = g * link.mass;
                force += weight;
                moment += self.coms[k].cross(&weight);
                tau[link.at] -= link.ratio * self.axes[k].dot(&(moment - self.anchors[k].cross(&force)));
            }
        }
    }

    /// Adds the joint torques that hold the joints' springs to `tau`, N m, finger by finger.
    pub fn add_spring_torque(&self, hand: &HandModel, tau: &mut [f64]) {
        if !hand.layout.springs {
            return;
        }
        for (link, angle) in hand.layout.links.iter().zip(&self.angles) {
            tau[link.at] += link.ratio * link.stiffness * (angle - link.spring_reference);
        }
    }
}
