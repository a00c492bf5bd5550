//! The motors: whether each finger gives the torque that it is asked for.
//!
//! A motor without power gives nothing, and the force optimiser would go on to count on its finger. The measured joint
//! torques tell: a joint that is asked for a torque and gives none is dead, and its finger no longer holds the object. A
//! motor that is weak, and gives less than asked but something, is none of this.
//!
//! Whether power has come back cannot be seen in a joint that is asked for nothing. So a dead joint is asked for a small
//! torque to and fro, too quick to move the finger far, until it follows.

use super::config::SafetyConfig;
use super::debounce::Debounce;
use std::ops::Range;

/// Time over which small torques are averaged, as a multiple of the time that large ones take to be judged ...
const LONGER: f64 = 5.0;
/// ... and share of the limits that then hold: a finger that slides is asked for little.
const SMALLER: f64 = 0.5;
/// Torque of the test, as a multiple of what a dead joint was asked for.
const TEST: f64 = 1.25;
/// Duration of each half of the test, s: a motor follows well within it.
const HALF: f64 = 0.02;
/// Halves in a row that must be followed.
const FOLLOWED: u32 = 3;

/// What the guard remembers of one finger's motors.
#[derive(Debug, Clone, Default)]
struct Finger {
    /// Some joint is asked for a torque and gives none.
    silent: Debounce,
    /// The finger does not hold the object, because its motors cannot.
    released: bool,
    /// Time in the present half of the test, s; its sign; and how many halves in a row were followed.
    time: f64,
    back: bool,
    followed: u32,
}

/// Judges all motors. Allocated once.
#[derive(Debug, Clone)]
pub struct MotorGuard {
    config: SafetyConfig,
    dt: f64,
    fingers: Vec<Finger>,
    /// Joints of each finger.
    ranges: Vec<Range<usize>>,
    joints: Vec<Joint>,
}

/// What the guard remembers of one joint.
#[derive(Debug, Clone, Copy, Default)]
struct Joint {
    /// Mean torques, N m.
    asked: f64,
    given: f64,
    /// The joint is asked for a torque and gives none.
    silent: bool,
    /// It was found so when its finger was released.
    dead: bool,
}

impl MotorGuard {
    /// A guard for fingers with these joints at the control period `dt`.
    pub fn new(ranges: Vec<Range<usize>>, config: &SafetyConfig, dt: f64) -> Self {
        let fingers = vec![Finger::default(); ranges.len()];
        let joints = vec![Joint::default(); ranges.last().map_or(0, |range| range.end)];
        Self { config: config.clone(), dt, fingers, ranges, joints }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.fingers.fill(Finger::default());
        self.joints.fill(Joint::default());
    }

    /// False where finger `j` cannot hold the object for want of power.
    pub fn drives(&self, j: usize) -> bool {
        !self.fingers[j].released
    }

    /// True where some finger's motors give no torque.
    pub fn failed(&self) -> bool {
        self.fingers.iter().any(|finger| finger.released || finger.silent.confirmed())
    }

    /// The torque with which joint `at`, of the released finger `j`, is tested, N m; none where it is not.
    pub fn test(&self, j: usize, at: usize) -> Option<f64> {
        let finger = &self.fingers[j];
        let torque = TEST * self.config.motor_asked;
        (finger.released && self.joints[at].dead).then_some(if finger.back { -torque } else { torque })
    }

    /// Compares the measured torques `given` with the last command `asked`, N m.
    ///
    /// Where more than half of the fingers give nothing, it is their torque sensors or the whole hand that has failed, and
    /// letting go would not help: none of them is released.
    pub fn admit(&mut self, asked: &[f64], given: &[f64]) {
        for j in 0..self.fingers.len() {
            let at = self.ranges[j].clone();
            self.listen(j, &asked[at.clone()], &given[at]);
        }
        let silent =
            self.fingers.iter().filter(|finger| finger.silent.confirmed() || finger.released).count();
        let many = 2 * silent > self.fingers.len();
        for finger in &mut self.fingers {
            finger.released = (finger.released || finger.silent.confirmed()) && !many;
        }
    }

    fn listen(&mut self, j: usize, asked: &[f64], given: &[f64]) {
        let (c, dt) = (&self.config, self.dt);
        let finger = &mut self.fingers[j];
        let joints = &mut self.joints[self.ranges[j].clone()];
        let pairs = asked.iter().copied().zip(given.iter().copied());
        if finger.released {
            // NaN follows nothing, and what was not asked for the test proves nothing.
            let follows = |((a, g), joint): ((f64, f64), &Joint)| {
                !joint.dead || (a.abs() > c.motor_asked && (a - g).abs() < c.motor_given)
            };
            if finger.test(dt, || pairs.zip(joints.iter()).all(follows)) {
                *finger = Finger::default();
                joints.fill(Joint::default());
            }
            return;
        }
        let share = 1.0 - (-dt / (LONGER * c.motor_time).max(1e-9)).exp();
        let mut at_once = false;
        let mut on_average = false;
        for ((a, g), joint) in pairs.zip(joints.iter_mut()) {
            // A torque that is not known is taken for what was asked.
            let g = if g.is_finite() { g } else { a };
            joint.asked += (a - joint.asked) * share;
            joint.given += (g - joint.given) * share;
            let none = |a: f64, g: f64, scale: f64| {
                a.abs() > scale * c.motor_asked && g * a.signum() < scale * c.motor_given
            };
            let (now, mean) = (none(a, g, 1.0), none(joint.asked, joint.given, SMALLER));
            joint.silent = now || mean;
            at_once |= now;
            on_average |= mean;
        }
        let before = finger.silent.confirmed();
        // What holds on average has taken its time already.
        let confirm = if on_average { 0.0 } else { c.motor_time };
        let silent = finger.silent.update(at_once || on_average, dt, confirm, c.recovery_time);
        if silent && !before {
            for joint in joints {
                joint.dead = joint.silent;
            }
        }
    }
}

impl Finger {
    /// Goes on with the test of a released finger; true once it has followed for long enough.
    fn test(&mut self, dt: f64, follows: impl FnOnce() -> bool) -> bool {
        self.time += dt;
        if self.time > HALF {
            self.followed = if follows() { self.followed + 1 } else { 0 };
            self.back = !self.back;
            self.time = 0.0;
        }
        self.followed >= FOLLOWED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.002;

    /// Four fingers with three joints each.
    fn fingers() -> Vec<Range<usize>> {
        (0..4).map(|j| 3 * j..3 * j + 3).collect()
    }

    /// Motors that follow at once, but for those of `dead`; gives what was asked for last.
    fn drive(guard: &mut MotorGuard, steps: usize, hold: f64, dead: &[usize]) -> Vec<f64> {
        let mut asked = vec![hold; 12];
        for _ in 0..steps {
            let given: Vec<f64> =
                (0..12).map(|at| if dead.contains(&at) { 0.0 } else { asked[at] }).collect();
            guard.admit(&asked, &given);
            asked = (0..12)
                .map(|at| guard.test(at / 3, at).unwrap_or(if guard.drives(at / 3) { hold } else { 0.02 }))
                .collect();
        }
        asked
    }

    #[test]
    fn a_finger_without_power_is_released_and_comes_back() {
        let mut guard = MotorGuard::new(fingers(), &SafetyConfig::default(), DT);
        drive(&mut guard, 100, 0.2, &[]);
        assert!(!guard.failed());
        drive(&mut guard, 5, 0.2, &[3, 4, 5]);
        assert!(guard.drives(1), "a glitch");
        drive(&mut guard, 100, 0.2, &[]);
        drive(&mut guard, 7, 0.2, &[3, 4, 5]);
        assert!(!guard.drives(1) && guard.drives(0) && guard.failed());
        drive(&mut guard, 5000, 0.2, &[3, 4, 5]);
        assert!(!guard.drives(1));
        drive(&mut guard, 60, 0.2, &[]);
        assert!(guard.drives(1) && !guard.failed());
    }

    #[test]
    fn a_torque_that_was_not_asked_for_proves_nothing() {
        let mut guard = MotorGuard::new(fingers(), &SafetyConfig::default(), DT);
        drive(&mut guard, 20, 0.2, &[3, 4, 5]);
        for _ in 0..200 {
            guard.admit(&[0.01; 12], &[0.0; 12]);
            assert!(!guard.drives(1));
        }
    }

    #[test]
    fn a_finger_that_slides_is_asked_for_little_and_judged_on_average() {
        let mut guard = MotorGuard::new(fingers(), &SafetyConfig::default(), DT);
        drive(&mut guard, 1000, 0.06, &[]);
        drive(&mut guard, 25, 0.06, &[0, 1, 2]);
        assert!(guard.drives(0));
        drive(&mut guard, 75, 0.06, &[0, 1, 2]);
        assert!(!guard.drives(0) && guard.drives(1));
    }

    #[test]
    fn only_the_dead_joint_is_tested_and_to_and_fro() {
        let mut guard = MotorGuard::new(fingers(), &SafetyConfig::default(), DT);
        drive(&mut guard, 20, 0.2, &[7]);
        let (mut least, mut most) = (0.0_f64, 0.0_f64);
        for _ in 0..100 {
            let asked = drive(&mut guard, 1, 0.2, &[7]);
            assert!(guard.test(2, 6).is_none() && guard.test(2, 8).is_none());
            least = least.min(asked[7]);
            most = most.max(asked[7]);
        }
        assert!((least + 0.1).abs() < 1e-12 && (most - 0.1).abs() < 1e-12, "{least} {most}");
    }

    #[test]
    fn weak_motors_unknown_torques_and_idle_joints_are_no_fault() {
        let mut guard = MotorGuard::new(fingers(), &SafetyConfig::default(), DT);
        for _ in 0..1000 {
            guard.admit(&[0.3; 12], &[0.05; 12]);
            guard.admit(&[-0.3; 12], &[f64::NAN; 12]);
            assert!(!guard.failed());
        }
        for _ in 0..1000 {
            guard.admit(&[0.035; 12], &[0.0; 12]);
            assert!(!guard.failed());
        }
    }

    #[test]
    fn where_most_fingers_give_nothing_none_is_released() {
        let mut guard = MotorGuard::new(fingers(), &SafetyConfig::default(), DT);
        for _ in 0..100 {
            guard.admit(&[0.2; 12], &[0.0; 12]);
            assert!((0..4).all(|j| guard.drives(j)));
        }
        assert!(guard.failed());
        for _ in 0..100 {
            guard.admit(&[0.2; 12], &[0.2; 12]);
        }
        assert!(!guard.failed());
    }
}
