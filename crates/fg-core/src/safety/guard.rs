//! The guard at the entry of the control step: it judges a measurement and hands out one that can be used.

use super::clock::{Clock, Tick};
use super::config::SafetyConfig;
use super::debounce::Debounce;
use super::effort::{EffortGuard, Efforts};
use super::frame::{FrameGuard, Verdict};
use super::joints::{self, JointGuard};
use super::motors::MotorGuard;
use super::odometry::Odometry;
use super::pose::PoseGuard;
use super::reference::ReferenceGuard;
use super::touch::{self, TouchGuard};
use super::{Fault, Faults, SafeMode};
use crate::error::Error;
use crate::hand::{HandModel, HandState};
use crate::signals::{Measurement, Reference};
use nalgebra::{DMatrix, Isometry3};

/// Time constant with which the fingers press harder and let off again, s.
const SQUEEZE_TIME: f64 = 0.02;

/// What the control step makes of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Course {
    /// Go through the whole step.
    Run,
    /// Nothing is new: the last command again.
    Repeat,
    /// Nothing is held, or nothing is known yet: fade to the fingers' own weight.
    Stop,
}

/// What the last step decided, against which this step's measurement is judged.
#[derive(Debug, Clone, Copy)]
pub struct Plan<'a> {
    /// Contact forces in their contact frames, N.
    pub f: &'a [f64],
    /// The last command, N m.
    pub tau: &'a [f64],
    /// Finger that does not hold the object for now.
    pub free: Option<usize>,
    /// Desired joint velocities of the free finger while it slides, rad/s.
    pub qd_des: Option<&'a [f64]>,
    /// The free finger looks for the surface.
    pub pressing: bool,
    /// Desired joint velocities, rad/s, while the object lies and all fingers are off it, or may be.
    pub open: Option<&'a [f64]>,
    /// There has been a first grasp.
    pub grasped: bool,
    /// Torques that the fingers needed for their own weight and motion, N m.
    pub own: &'a [f64],
    /// Hand Jacobian in the contact frames.
    pub J: &'a DMatrix<f64>,
}

impl Plan<'_> {
    /// True where finger `j` is off the object on purpose.
    fn frees(&self, j: usize) -> bool {
        self.open.is_some() || self.free == Some(j)
    }
}

/// How the control step went.
#[derive(Debug, Clone, Copy, Default)]
#[allow(clippy::struct_excessive_bools)] // five facts that do not depend on each other
pub struct Outcome {
    /// The contact forces are certified.
    pub solved: bool,
    /// Some joint's own weight and motion need more torque than there is.
    pub box_empty: bool,
    /// A torque is at its limit, or the wrench is not delivered.
    pub saturated: bool,
    /// The grasp has grown bad, and no finger can be freed.
    pub overdue: bool,
    /// The object was set down for good, or cannot be.
    pub aground: bool,
}

/// Conditions of the whole step that must last before they count.
#[derive(Debug, Clone, Default)]
struct Conditions {
    clock: Debounce,
    reference: Debounce,
    solver: Debounce,
    saturated: Debounce,
    overdue: Debounce,
    aground: Debounce,
    gone: Debounce,
    seeking: Debounce,
}

/// See the module. All memory is allocated in [`Guard::new`].
#[derive(Debug, Clone)]
pub struct Guard {
    config: SafetyConfig,
    dt: f64,
    clock: Clock,
    joints: JointGuard,
    touch: TouchGuard,
    effort: EffortGuard,
    motors: MotorGuard,
    odometry: Odometry,
    pose: PoseGuard,
    frame: FrameGuard,
    reference: ReferenceGuard,
    conditions: Conditions,
    faults: Faults,
    mode: SafeMode,
    /// Gaits may begin and go on.
    allows_gaits: bool,
    /// No feedback in this step.
    blind: bool,
    squeeze: f64,
    /// Fingers to be let go.
    damped: Vec<bool>,
    trusted: Measurement,
}

impl Guard {
    /// A guard for `hand` at the control period `dt`; less than `contact_force` newtons is no contact.
    pub fn new(hand: &HandModel, config: &SafetyConfig, contact_force: f64, dt: f64) -> Self {
        Self {
            clock: Clock::new(config, dt),
            joints: JointGuard::new(hand, config, dt),
            touch: TouchGuard::new(hand.n_fingers(), config, contact_force, dt),
            effort: EffortGuard::new(hand.n_fingers(), config, dt),
            motors: MotorGuard::new((0..hand.n_fingers()).map(|j| hand.joints(j)).collect(), config, dt),
            odometry: Odometry::new(hand, dt),
            pose: PoseGuard::new(config, dt),
            frame: FrameGuard::new(hand.n_fingers(), config),
            reference: ReferenceGuard::new(config, dt),
            conditions: Conditions::default(),
            faults: Faults::default(),
            mode: SafeMode::Normal,
            allows_gaits: true,
            blind: false,
            squeeze: 0.0,
            damped: vec![false; hand.n_fingers()],
            trusted: Measurement::zeros(hand.n_fingers(), hand.n_q()),
            config: config.clone(),
            dt,
        }
    }

    /// Takes the thresholds that fit the grasp.
    pub fn fit(&mut self, config: &SafetyConfig) {
        self.config = config.clone();
        self.joints.fit(config);
        self.touch.fit(config);
        self.effort.fit(config);
        self.pose.fit(config);
    }

    /// Forgets the past. Allocates nothing.
    pub fn reset(&mut self) {
        self.clock.reset();
        self.joints.reset();
        self.touch.reset();
        self.effort.reset();
        self.motors.reset();
        self.odometry.reset();
        self.pose.reset();
        self.frame.reset();
        self.reference.reset();
        self.conditions = Conditions::default();
        self.faults = Faults::default();
        self.mode = SafeMode::Normal;
        self.allows_gaits = true;
        self.blind = false;
        self.squeeze = 0.0;
        self.damped.fill(false);
    }

    /// Faults of this step.
    pub fn faults(&self) -> Faults {
        self.faults
    }

    /// The mode of this step.
    pub fn mode(&self) -> SafeMode {
        self.mode
    }

    /// True where gaits may begin and go on: nothing is wrong but, at most, the grasp itself.
    pub fn allows_gaits(&self) -> bool {
        self.allows_gaits
    }

    /// True where neither the sensor nor the fingers tell the object's pose: the last wrench is all there is.
    pub fn blind(&self) -> bool {
        self.blind
    }

    /// The sensor's pose, or what stands for it while it fails: unlike the measurement's, without lag.
    pub fn sensed_pose(&self) -> &Isometry3<f64> {
        self.pose.sensed()
    }

    /// True where time did not advance by one period: velocities over this step mean nothing.
    pub fn discontinuous(&self) -> bool {
        self.faults.any(&[Fault::Clock, Fault::Late])
    }

    /// True once every joint angle has been known.
    pub fn knows_joints(&self) -> bool {
        self.joints.known()
    }

    /// False where the joint angles of finger `j` have failed.
    pub fn trusts(&self, j: usize) -> bool {
        self.joints.trusts(j)
    }

    /// False where finger `j` cannot hold the object: its motors give no torque.
    pub fn drives(&self, j: usize) -> bool {
        self.motors.drives(j)
    }

    /// The torque with which joint `at` of finger `j` is tested for power, N m.
    pub fn motor_test(&self, j: usize, at: usize) -> Option<f64> {
        self.motors.test(j, at)
    }

    /// True where finger `j` is to be let go: its angles have failed, and it feels nothing.
    pub fn damps(&self, j: usize) -> bool {
        self.damped[j]
    }

    /// Normal force to add to each finger's last one, N.
    pub fn squeeze(&self) -> f64 {
        self.squeeze
    }

    /// An error where an array of `measurement` has the wrong length: a caller's mistake, and the only one.
    pub fn check(&self, measurement: &Measurement) -> Result<(), Error> {
        let lengths = [
            ("measurement.q", self.trusted.q.len(), measurement.q.len()),
            ("measurement.tau", self.trusted.tau.len(), measurement.tau.len()),
            ("measurement.tactile", self.trusted.tactile.len(), measurement.tactile.len()),
        ];
        match lengths.into_iter().find(|(_, expected, found)| expected != found) {
            Some((field, expected, found)) => Err(Error::shape(field, expected, found)),
            None => Ok(()),
        }
    }

    /// Judges `measurement`, which has passed [`Guard::check`], and moves `state` to the joint angles to use.
    pub fn admit(
        &mut self,
        hand: &HandModel,
        state: &mut HandState,
        measurement: &Measurement,
        reference: &Reference,
        plan: &Plan<'_>,
    ) -> Course {
        self.faults = Faults::default();
        let (joints, pose, touch) = (&self.joints, &self.pose, &self.touch);
        let changed = || {
            !(joints.same(measurement.q.as_slice())
                && pose.same(&measurement.X_WO)
                && touch.same(&measurement.tactile))
        };
        let tick = self.clock.tick(measurement.t, changed, &mut self.faults);
        let elapsed = match tick {
            Tick::Repeat => return Course::Repeat,
            Tick::Blind => self.dt,
            Tick::Step(elapsed) => elapsed,
        };
        if tick != Tick::Blind {
            self.motors.admit(plan.tau, measurement.tau.as_slice());
        }
        self.faults.insert_if(self.motors.failed(), Fault::Motor);
        self.admit_joints(measurement, elapsed, plan, state);
        state.update(hand, self.trusted.q.as_slice());
        self.admit_touch(measurement, elapsed, plan, hand, state);
        self.admit_pose(measurement, elapsed, plan, hand, state);
        let good = self.reference.take(reference, &self.trusted.X_WO, &mut self.faults);
        let (c, dt) = (&self.config, self.dt);
        self.conditions.reference.update(!good, dt, c.ride_through, c.recovery_time);
        self.blind |= tick == Tick::Blind;
        self.decide(plan);
        if self.mode == SafeMode::Stop {
            self.reference.restart(&self.trusted.X_WO);
            return Course::Stop;
        }
        Course::Run
    }

    /// The measurement to use, lent until [`Guard::put_back`], and the reference.
    pub fn take(&mut self) -> (Measurement, Reference) {
        let reference = self.reference.use_now(self.mode != SafeMode::Normal, &self.trusted.X_WO);
        // An empty measurement owns no memory: nothing is allocated.
        (std::mem::replace(&mut self.trusted, Measurement::zeros(0, 0)), reference)
    }

    /// Returns what [`Guard::take`] has lent.
    pub fn put_back(&mut self, measurement: Measurement) {
        self.trusted = measurement;
    }

    /// Takes note of how the step went.
    pub fn note(&mut self, outcome: Outcome) {
        let (c, dt) = (&self.config, self.dt);
        self.faults.insert_if(outcome.box_empty, Fault::TorqueBox);
        self.faults.insert_if(!outcome.solved, Fault::Solver);
        let failed = outcome.box_empty || !outcome.solved;
        self.conditions.solver.update(failed, dt, c.ride_through, c.recovery_time);
        let saturated =
            self.conditions.saturated.update(outcome.saturated, dt, c.saturation_time, c.recovery_time);
        self.faults.insert_if(saturated, Fault::Saturated);
        let overdue = self.conditions.overdue.update(outcome.overdue, dt, 0.0, c.recovery_time);
        self.faults.insert_if(overdue, Fault::Overdue);
        let aground = self.conditions.aground.update(outcome.aground, dt, 0.0, c.recovery_time);
        self.faults.insert_if(aground, Fault::Aground);
    }

    fn admit_joints(&mut self, measurement: &Measurement, elapsed: f64, plan: &Plan<'_>, state: &HandState) {
        let (tactile, motors) = (&self.trusted.tactile, &self.motors);
        let using = |j: usize| {
            let free = plan.frees(j);
            let touching = tactile[j].f_n > 0.0;
            let swinging = plan.open.map(|qd_des| &qd_des[state.joints(j)]);
            let qd_des = swinging.or(plan.qd_des.filter(|_| free));
            joints::Use { touching, holding: !free && motors.drives(j), qd_des }
        };
        let (q, odometry) = (measurement.q.as_slice(), &self.odometry);
        let trusted = self.trusted.q.as_mut_slice();
        self.joints.admit(q, elapsed, odometry, state, using, trusted, &mut self.faults);
        self.trusted.t = measurement.t;
        for (trusted, tau) in self.trusted.tau.iter_mut().zip(measurement.tau.iter()) {
            if tau.is_finite() {
                *trusted = *tau;
            } else {
                self.faults.insert(Fault::TorqueSensor);
            }
        }
    }

    fn admit_touch(
        &mut self,
        measurement: &Measurement,
        elapsed: f64,
        plan: &Plan<'_>,
        hand: &HandModel,
        state: &HandState,
    ) {
        let motors = &self.motors;
        let using = |j: usize| {
            let free = plan.frees(j);
            let drives = motors.drives(j);
            touch::Use {
                drives,
                open: plan.open.is_some(),
                holding: !free,
                pressing: free && plan.pressing,
                f_n: plan.f[3 * j + 2],
            }
        };
        let at = touch::Where { hand, state, X_WO: &self.trusted.X_WO };
        let (tactile, trusted) = (&measurement.tactile, &mut self.trusted.tactile);
        self.touch.admit(tactile, elapsed, at, using, trusted, &mut self.faults);
        let efforts = Efforts { tau: measurement.tau.as_slice(), own: plan.own, J: plan.J };
        let holds = |j: usize| !plan.frees(j) && motors.drives(j) && self.joints.trusts(j);
        self.effort.admit(tactile, &efforts, |j| hand.joints(j), holds);
        self.faults.insert_if(self.effort.failed(), Fault::TactileScale);
    }

    fn admit_pose(
        &mut self,
        measurement: &Measurement,
        elapsed: f64,
        plan: &Plan<'_>,
        hand: &HandModel,
        state: &HandState,
    ) {
        let (joints, motors) = (&self.joints, &self.motors);
        let sticks = |j: usize| !plan.frees(j) && joints.trusts(j) && motors.drives(j);
        let motion = self.odometry.motion(hand, state, &self.trusted.tactile, sticks);
        let centre = self.odometry.centre(state);
        let X_WO = &measurement.X_WO;
        let X_WO = self.pose.admit(X_WO, motion.as_ref(), &centre, elapsed, &mut self.faults);
        self.trusted.X_WO = X_WO;
        self.odometry.settle(self.pose.sensed(), self.pose.from_sensor());
        if !plan.grasped && self.joints.known() {
            self.frame.admit(hand, state, &self.trusted.tactile, self.pose.sensed());
            let verdict = self.frame.verdict();
            self.faults.insert_if(verdict == Verdict::PoseElsewhere, Fault::PoseFrame);
            self.faults.insert_if(verdict == Verdict::NormalsOutwards, Fault::TactileAxes);
            if verdict != Verdict::Fits {
                // The next pose is the first one again: there is nothing that it could have jumped from.
                self.pose.reset();
                self.odometry.reset();
            }
        }
        self.blind = self.pose.failed() && motion.is_none();
    }

    fn decide(&mut self, plan: &Plan<'_>) {
        let (c, dt) = (&self.config, self.dt);
        let conditions = &mut self.conditions;
        let late = self.faults.any(&[Fault::Clock, Fault::Late]);
        let late = conditions.clock.update(late, dt, c.ride_through, c.recovery_time);
        let fingers = self.trusted.tactile.len();
        let touching = self.trusted.tactile.iter().filter(|reading| reading.f_n > 0.0).count();
        let enough = if conditions.gone.confirmed() { 2 } else { 1 };
        let gone = plan.grasped && plan.open.is_none() && touching < enough;
        let gone = conditions.gone.update(gone, dt, c.contacts_timeout, c.recovery_time);
        self.faults.insert_if(gone, Fault::ContactsLost);
        let seeks = |j: usize| plan.pressing && self.trusted.tactile[j].f_n <= 0.0 && self.motors.drives(j);
        let seeking = plan.free.is_some_and(seeks);
        let seeking = conditions.seeking.update(seeking, dt, c.seek_time, c.recovery_time);
        self.faults.insert_if(seeking, Fault::FingerLost);
        let slow = conditions.reference.confirmed()
            || seeking
            || conditions.solver.confirmed()
            || self.touch.failed()
            || self.effort.failed()
            || self.motors.failed()
            || late
            || (0..fingers).any(|j| !self.joints.trusts(j));
        let strained = conditions.saturated.confirmed() || conditions.overdue.confirmed();
        let mut mode = if slow || strained || conditions.aground.confirmed() {
            SafeMode::Hold
        } else {
            SafeMode::Normal
        };
        if self.blind || self.pose.failed() {
            mode = SafeMode::Squeeze;
        }
        let target = if mode == SafeMode::Squeeze { c.squeeze_force } else { 0.0 };
        self.squeeze += (target - self.squeeze) * (1.0 - (-dt / SQUEEZE_TIME).exp());
        if self.squeeze < 1e-6 {
            self.squeeze = 0.0;
        }
        for (j, damped) in self.damped.iter_mut().enumerate() {
            *damped = !self.joints.trusts(j) && self.trusted.tactile[j].f_n <= 0.0;
        }
        if self.damped.contains(&true) {
            mode = SafeMode::Damp;
        }
        if gone || self.frame.verdict() != Verdict::Fits || !(self.joints.known() && self.pose.known()) {
            mode = SafeMode::Stop;
        }
        self.allows_gaits = !slow && mode <= SafeMode::Hold;
        self.mode = mode;
    }
}
