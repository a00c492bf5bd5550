//! One step of one finger along the object's coming motion.
//!
//! The contact sticks to the surface and rolls: `dq = J+ (v dt - J x) + x` with x the pull to the posture of the first grasp,
//! as far as the contact leaves it free. Nothing is measured on the way: the object moves at the desired twist.

use crate::gait::surface::{Spot, Surface};
use crate::hand::{HandModel, HandState, Inverse};

/// Share of a joint's range, next to its limits, in which a march ends.
const NEAR_LIMIT: f64 = 0.03;
/// Share of the way back to the first posture that a step takes, where the contact leaves it free.
const PULL: f64 = 0.1;
/// A joint that turns further than this in a step jumps, rad ...
const JUMP: f64 = 0.15;
/// ... and so does a posture in which the contact follows by less than this share of the step.
const LEFT_BEHIND: f64 = 0.3;

/// What ended a march.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MarchEnd {
    /// Nothing: it went as far as marches go.
    #[default]
    Open = 0,
    /// A joint near its limit.
    Joint = 1,
    /// Joints that would have to jump.
    Jump = 2,
    /// A link of the finger near the object.
    Link = 3,
    /// Another finger.
    Neighbour = 4,
}

/// Where a finger is on its march.
#[derive(Debug, Clone, Copy)]
pub struct March {
    /// The finger.
    pub finger: usize,
    /// Angles of its independent joints, rad.
    pub q: [f64; HandModel::MAX_JOINTS],
    /// Its contact.
    pub spot: Spot,
    /// Steps taken, of `stride` seconds each.
    pub steps: usize,
    /// Seconds of the object's motion in a step.
    pub stride: f64,
}

impl March {
    /// The start of a march of finger `j` from the joint angles `q` of that finger.
    pub fn new(hand: &HandModel, j: usize, q: &[f64], surface: &Surface, stride: f64) -> Self {
        let mut all = [0.0; HandModel::MAX_JOINTS];
        all[..q.len()].copy_from_slice(q);
        Self { finger: j, q: all, spot: surface.spot(j, hand.tip_radius(j)), steps: 0, stride }
    }

    /// Seconds of the object's motion so far.
    pub fn seconds(&self) -> f64 {
        self.steps as f64 * self.stride
    }

    /// Takes a step; `state` is the finger's kinematics at `q`, and `first` the posture of the first grasp. What ends the march
    /// there, if its joints do; clearances are the caller's.
    pub fn step(
        &mut self,
        hand: &HandModel,
        state: &mut HandState,
        surface: &Surface,
        first: &[f64],
    ) -> Option<MarchEnd> {
        let (j, t) = (self.finger, self.seconds());
        let joints = state.joints(j);
        let n = joints.len();
        let moved = surface.velocity(&self.spot.p_W, t) * self.stride;
        let wanted = moved + self.spot.n_W * self.spot.gap;
        let (mut x, mut dq) = ([0.0; HandModel::MAX_JOINTS], [0.0; HandModel::MAX_JOINTS]);
        // Three joints or fewer have nothing to spare.
        if n > 3 {
            for i in 0..n {
                x[i] = PULL * (first[i] - self.q[i]);
            }
        }
        let inverse = Inverse::new(state, j, &self.spot.p_W);
        inverse.near(&wanted, &x, &mut dq);
        // A finger of one or two joints never follows in all directions.
        let left = (inverse.forward(&dq) - wanted).norm() > LEFT_BEHIND * moved.norm();
        if (left && n >= 3) || dq.iter().any(|dq| dq.abs() > JUMP) {
            return Some(MarchEnd::Jump);
        }
        for (i, at) in joints.enumerate() {
            self.q[i] += dq[i];
            let joint = hand.coordinate(at);
            let near = NEAR_LIMIT * (joint.upper - joint.lower);
            let below = self.q[i] < joint.lower + near && dq[i] < 0.0;
            let above = self.q[i] > joint.upper - near && dq[i] > 0.0;
            if below || above {
                return Some(MarchEnd::Joint);
            }
        }
        state.update_finger(hand, j, &self.q[..n]);
        let tip = state.tip(j).translation.vector;
        surface.roll(&mut self.spot, &tip, hand.tip_radius(j), t, self.stride);
        self.steps += 1;
        None
    }
}
