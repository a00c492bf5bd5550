//! The joint angles: which to believe, and which fingers' kinematics can be trusted.

use super::config::SafetyConfig;
use super::debounce::Debounce;
use super::odometry::Odometry;
use super::relearn::Refused;
use super::{Fault, Faults};
use crate::hand::{Coordinate, HandModel, HandState};
use std::ops::Range;

/// Good samples before jumps are judged: the first one may be the bad one.
const SETTLE: u32 = 10;
/// Longest time for which a joint may have moved unseen, s.
const UNSEEN: f64 = 1.0;
/// Cosine between a joint's own motion and the motion left out, above which the joint may be the one that is stuck.
const ALONG: f64 = 0.7;
/// A finger off the object whose angle has jumped and then stays consistent for this long has been moved, s.
const RELEARN: f64 = 0.5;

/// What the guard remembers of one joint.
#[derive(Debug, Clone, Copy)]
struct Joint {
    lower: f64,
    upper: f64,
    /// The last sample, whatever it was, and the last good one, rad.
    raw: f64,
    good: f64,
    /// For how long the sample has been the same number, s.
    still: f64,
    /// For how long there has been no sample to judge, s.
    missing: f64,
    /// For how long samples have been consistent with each other but not with the last good one, s.
    odd: f64,
    /// How far the joint was asked to turn since the sample last changed, rad.
    asked: f64,
    /// The encoder is stuck, until it reads another number.
    stuck: bool,
    known: bool,
}

/// Judges all joint angles. Allocated once.
#[derive(Debug, Clone)]
pub struct JointGuard {
    config: SafetyConfig,
    fingers: Vec<Range<usize>>,
    joints: Vec<Joint>,
    /// For each finger, whether its kinematics have failed for long enough.
    failed: Vec<Debounce>,
    refused: Vec<Refused>,
    samples: u32,
    /// For how long nothing has been read, s.
    unread: f64,
    dt: f64,
}

/// What the last step knew about one finger.
#[derive(Debug, Clone, Copy)]
pub struct Use<'a> {
    /// True where the finger feels the object.
    pub touching: bool,
    /// True where it should stick to the object.
    pub holding: bool,
    /// Desired joint velocities, for the finger that slides, rad/s.
    pub qd_des: Option<&'a [f64]>,
}

impl JointGuard {
    /// A guard for `hand` at the control period `dt`.
    pub fn new(hand: &HandModel, config: &SafetyConfig, dt: f64) -> Self {
        let margin = config.joint_margin;
        let joint = |c: &Coordinate| Joint::new(c.lower - margin, c.upper + margin);
        Self {
            config: config.clone(),
            fingers: (0..hand.n_fingers()).map(|j| hand.joints(j)).collect(),
            joints: hand.coordinates().iter().map(joint).collect(),
            failed: vec![Debounce::default(); hand.n_fingers()],
            refused: vec![Refused::default(); hand.n_fingers()],
            samples: 0,
            unread: 0.0,
            dt,
        }
    }

    /// Takes the thresholds that fit the grasp.
    pub fn fit(&mut self, config: &SafetyConfig) {
        self.config = config.clone();
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        for joint in &mut self.joints {
            *joint = Joint::new(joint.lower, joint.upper);
        }
        self.failed.iter_mut().for_each(Debounce::reset);
        self.refused.iter_mut().for_each(Refused::reset);
        self.samples = 0;
        self.unread = 0.0;
    }

    /// True once every joint has had a good sample.
    pub fn known(&self) -> bool {
        self.joints.iter().all(|joint| joint.known)
    }

    /// False where the kinematics of finger `j` have failed.
    pub fn trusts(&self, j: usize) -> bool {
        !self.failed[j].confirmed()
    }

    /// True where `q` is the last sample again, bit for bit.
    pub fn same(&self, q: &[f64]) -> bool {
        self.joints.iter().zip(q).all(|(joint, q)| joint.raw.to_bits() == q.to_bits())
    }

    /// Writes into `trusted` the angles to use for the sample `q`; `elapsed` seconds have passed since the last one, whose
    /// kinematics are `state`.
    #[allow(clippy::too_many_arguments, reason = "one call, all of it needed")]
    pub fn admit<'a>(
        &mut self,
        q: &[f64],
        elapsed: f64,
        odometry: &Odometry,
        state: &HandState,
        using: impl Fn(usize) -> Use<'a>,
        trusted: &mut [f64],
        faults: &mut Faults,
    ) {
        if is_unread(q) {
            self.skip(q, elapsed, faults);
            return;
        }
        self.unread = 0.0;
        let settled = self.samples >= SETTLE;
        self.samples = self.samples.saturating_add(1);
        for j in 0..self.failed.len() {
            let at = self.fingers[j].clone();
            let using = using(j);
            let mut bad = false;
            for (i, joint) in self.joints[at.clone()].iter_mut().enumerate() {
                let speed = using.qd_des.map_or(0.0, |qd| qd[i]);
                joint.asked += speed * elapsed;
                bad |= !joint.take(q[at.start + i], elapsed, settled, using.touching, &self.config);
            }
            let held = using.holding && using.touching;
            if bad {
                let joints = &self.joints[at.clone()];
                let turns = |i: usize| joints[i].turn();
                let refused = &mut self.refused[j];
                if refused.explains(j, turns, held, elapsed, state, odometry, self.config.relearn_distance) {
                    self.joints[at.clone()].iter_mut().for_each(Joint::believe);
                    bad = false;
                }
            }
            if !bad {
                self.refused[j].none(j, held, elapsed, state, odometry);
            }
            let stuck = self.stuck(j, &using, odometry, state);
            faults.insert_if(bad, Fault::Encoder);
            faults.insert_if(stuck, Fault::EncoderStuck);
            // Getting stuck has taken its time already.
            let confirm = if stuck { 0.0 } else { self.config.ride_through };
            self.failed[j].update(bad || stuck, self.dt, confirm, self.config.recovery_time);
            for (trusted, joint) in trusted[at.clone()].iter_mut().zip(&self.joints[at]) {
                *trusted = joint.good;
            }
        }
    }

    /// Whether more than half of the hand's encoders have read the same numbers for long: then the fingers' motion says nothing.
    fn stands_still(&self) -> bool {
        2 * self.joints.iter().filter(|joint| joint.still > self.config.stuck_time).count()
            > self.joints.len()
    }

    /// Takes a sample that was not read: the last good angles go on, and the fingers are trusted for a short while.
    fn skip(&mut self, q: &[f64], elapsed: f64, faults: &mut Faults) {
        faults.insert(Fault::Encoder);
        for (joint, q) in self.joints.iter_mut().zip(q) {
            joint.raw = *q;
            joint.missing = (joint.missing + elapsed).min(UNSEEN);
        }
        self.unread += elapsed;
        // A read that fails now and then is no failure, however often: the next one tells all.
        if self.unread > self.config.ride_through {
            for failed in &mut self.failed {
                failed.update(true, self.dt, 0.0, self.config.recovery_time);
            }
        }
    }

    /// Whether a joint of finger `j` reads the same number although the finger moves.
    ///
    /// A finger that slips moves against the object too. What tells the two apart is the direction: a stuck joint leaves out
    /// its own part of the motion. Where all joints of a finger stand still, nothing does, and it counts as stuck.
    fn stuck(&mut self, j: usize, using: &Use<'_>, odometry: &Odometry, state: &HandState) -> bool {
        let c = &self.config;
        let drift = odometry.drift(j);
        let length = drift.norm();
        let whole = self.stands_still();
        let alone = whole || length > 3.0 * odometry.drift_of_others(j);
        let drifts = using.holding && length > c.stuck_distance && alone;
        let first = self.fingers[j].start;
        let joints = &mut self.joints[self.fingers[j].clone()];
        let all = joints.iter().all(|joint| joint.still > c.stuck_time);
        let mut stuck = false;
        for (i, joint) in joints.iter_mut().enumerate() {
            if joint.still > c.stuck_time {
                let column = || state.jacobian_column(first + i, odometry.contact(j));
                let own = || column().dot(&drift).abs() > ALONG * column().norm() * length;
                joint.stuck |= (drifts && (all || own())) || joint.asked.abs() > c.stuck_angle;
            }
            if joint.stuck {
                // The true angle may be anywhere that it can have reached meanwhile.
                joint.missing = joint.still.min(UNSEEN);
                stuck = true;
            }
        }
        stuck
    }
}

/// Whether nobody has read the encoders: at least half of the hand's angles, and two of them, are zero to the last bit.
///
/// So is a buffer that was never filled. A joint that happens to stand at zero behind a coarse encoder is one of few.
fn is_unread(q: &[f64]) -> bool {
    let zeros = q.iter().filter(|q| **q == 0.0).count();
    zeros >= 2 && 2 * zeros >= q.len()
}

impl Joint {
    fn new(lower: f64, upper: f64) -> Self {
        Self {
            lower,
            upper,
            raw: f64::NAN,
            good: 0.5 * (lower + upper),
            still: 0.0,
            missing: 0.0,
            odd: 0.0,
            asked: 0.0,
            stuck: false,
            known: false,
        }
    }

    /// Takes the sample `x`; true where it is good.
    fn take(&mut self, x: f64, elapsed: f64, settled: bool, touching: bool, c: &SafetyConfig) -> bool {
        let consistent = (x - self.raw).abs() <= c.joint_jump;
        if x.to_bits() == self.raw.to_bits() {
            self.still += elapsed;
        } else {
            self.still = 0.0;
            self.asked = 0.0;
            self.stuck = false;
        }
        self.raw = x;
        // NaN fails every comparison.
        if !(x >= self.lower && x <= self.upper) {
            self.missing = (self.missing + elapsed).min(UNSEEN);
            return false;
        }
        let window = c.joint_jump + c.joint_speed * (elapsed + self.missing);
        let inside = (x - self.good).abs() <= window;
        self.odd = if inside || !consistent || touching { 0.0 } else { self.odd + elapsed };
        let good = inside || !settled || !self.known || self.odd > RELEARN;
        if good {
            self.believe();
        }
        good
    }

    /// Takes the sample for the true angle.
    fn believe(&mut self) {
        self.good = self.raw;
        self.missing = 0.0;
        self.odd = 0.0;
        self.known = true;
    }

    /// What the sample has over the last good angle, rad; None where it cannot be an angle.
    fn turn(&self) -> Option<f64> {
        (self.raw >= self.lower && self.raw <= self.upper).then_some(self.raw - self.good)
    }
}
