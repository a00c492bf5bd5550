//! Thresholds of the guard.

use crate::error::Error;
use serde::{Deserialize, Serialize};

/// When a measurement is not believed, and what then happens. `docs/safety.md` says which field belongs to which fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SafetyConfig {
    /// A fault that lasts up to this long has no effect but replaced values, s.
    pub ride_through: f64,
    /// A fault must be gone for this long before the mode returns to normal, s.
    pub recovery_time: f64,
    /// A step is late when time has advanced by more than this many periods.
    pub late: f64,
    /// Time that advances by more than this has jumped, s.
    pub clock_gap: f64,
    /// Time may stand still this long, the command being repeated, s.
    pub clock_timeout: f64,
    /// Joint angles may pass their limits by this, rad.
    pub joint_margin: f64,
    /// A joint angle jumps when it changes by more than this ...
    pub joint_jump: f64,
    /// ... plus this speed times the time since its last good value, rad/s.
    pub joint_speed: f64,
    /// An encoder or tactile sensor whose reading is the same number for this long may be stuck, s ...
    pub stuck_time: f64,
    /// ... and an encoder is, when its finger has meanwhile moved by this against the object, m ...
    pub stuck_distance: f64,
    /// ... or was asked to turn the joint by this, rad.
    pub stuck_angle: f64,
    /// Object and reference are no farther than this from the fingertips' mean, m.
    pub reach: f64,
    /// The first pose lies within this many times the contacts' radius, their largest distance from their mean, of that mean.
    pub pose_spread: f64,
    /// The pose jumps when it departs from the motion that the fingers tell by more than this, m and rad ...
    pub pose_jump: [f64; 2],
    /// ... plus these speeds times the time since its last good value, m/s and rad/s.
    pub pose_speed: [f64; 2],
    /// A pose that is the same number for this long may be stale, s ...
    pub pose_timeout: f64,
    /// ... and is, when the fingers say that the object has meanwhile moved by this, m and rad.
    pub stale_motion: [f64; 2],
    /// Time constant with which a replaced pose passes over into a good one, s.
    pub pose_blend: f64,
    /// Time constant with which the pose that the fingers carry along follows a noisy or slow sensor, s; zero: the
    /// sensor's pose is used as it is.
    pub pose_filter: f64,
    /// A tactile reading of this or more is full scale, N; never less than 1.2 times `force.f_n_max`.
    pub tactile_max: f64,
    /// A finger that feels and should press more than this is loaded, N.
    pub loaded_force: f64,
    /// A loaded finger that feels nothing has lost the object when it advances by this, m ...
    pub lost_distance: f64,
    /// ... and its sensor when it has not after this time, s.
    pub lost_time: f64,
    /// A finger that looks for the surface is on its way while it advances by this in 0.4 s, m.
    pub pressing_distance: f64,
    /// Joint angles that were refused are right when they explain the finger's contact to within this, m: fingers roll and
    /// creep a little.
    pub relearn_distance: f64,
    /// Length that weighs turns against displacements in the pose's noise, m.
    pub pose_arm: f64,
    /// Noise of the pose that no controller minds, m: a sensor with less is used as it is.
    pub pose_quiet: f64,
    /// Most tactile sensors are wrong when they differ from what the joint torques tell by more than this, N ...
    pub effort_margin: f64,
    /// ... and this share of the larger of the two.
    pub effort_ratio: f64,
    /// A motor is dead when its joint, asked for more torque than this, N m ...
    pub motor_asked: f64,
    /// ... gives less than this, N m ...
    pub motor_given: f64,
    /// ... for this long, s.
    pub motor_time: f64,
    /// What each finger presses more, about, while the pose is not trusted, N.
    pub squeeze_force: f64,
    /// A finger looks for the object for this long before the object is held where it is, s.
    pub seek_time: f64,
    /// No finger feels the object for this long: it is gone, s.
    pub contacts_timeout: f64,
    /// Saturation that lasts this long is a fault, s.
    pub saturation_time: f64,
    /// Time constant with which torques fade when nothing is held, s.
    pub stop_time: f64,
    /// Speeds at which a reference that stood still catches up, m/s and rad/s.
    pub catch_up: [f64; 2],
}

impl Default for SafetyConfig {
    fn default() -> Self {
        Self {
            ride_through: 0.01,
            recovery_time: 0.1,
            late: 1.5,
            clock_gap: 0.1,
            clock_timeout: 0.02,
            joint_margin: 0.15,
            joint_jump: 0.05,
            joint_speed: 20.0,
            stuck_time: 0.1,
            stuck_distance: 3e-3,
            stuck_angle: 0.15,
            reach: 1.0,
            pose_spread: 2.0,
            pose_jump: [5e-3, 0.1],
            pose_speed: [0.5, 5.0],
            pose_timeout: 0.1,
            stale_motion: [2e-3, 0.03],
            pose_blend: 0.05,
            pose_filter: 0.1,
            tactile_max: 30.0,
            loaded_force: 0.3,
            lost_distance: 2e-3,
            lost_time: 0.05,
            pressing_distance: 1e-3,
            relearn_distance: 4e-3,
            pose_arm: 0.03,
            pose_quiet: 3e-5,
            effort_margin: 0.3,
            effort_ratio: 0.6,
            motor_asked: 0.08,
            motor_given: 0.03,
            motor_time: 0.01,
            squeeze_force: 1.0,
            seek_time: 0.5,
            contacts_timeout: 0.05,
            saturation_time: 1.0,
            stop_time: 0.1,
            catch_up: [0.02, 0.1],
        }
    }
}

impl SafetyConfig {
    /// An error that names the first field out of its range.
    pub fn validate(&self) -> Result<(), Error> {
        let positive = f64::MIN_POSITIVE;
        let ranges = [
            ("ride_through", self.ride_through, 0.0, 1.0),
            ("recovery_time", self.recovery_time, 0.0, 60.0),
            ("late", self.late, 1.0, 1e3),
            ("clock_gap", self.clock_gap, positive, 10.0),
            ("clock_timeout", self.clock_timeout, 0.0, 1.0),
            ("joint_margin", self.joint_margin, 0.0, 10.0),
            ("joint_jump", self.joint_jump, positive, 10.0),
            ("joint_speed", self.joint_speed, positive, 1e4),
            ("stuck_time", self.stuck_time, positive, 60.0),
            ("stuck_distance", self.stuck_distance, positive, 1.0),
            ("stuck_angle", self.stuck_angle, positive, 10.0),
            ("reach", self.reach, positive, 100.0),
            ("pose_spread", self.pose_spread, 1.0, 1e6),
            ("pose_jump[0]", self.pose_jump[0], positive, 1.0),
            ("pose_jump[1]", self.pose_jump[1], positive, 3.2),
            ("pose_speed[0]", self.pose_speed[0], positive, 100.0),
            ("pose_speed[1]", self.pose_speed[1], positive, 1e3),
            ("pose_timeout", self.pose_timeout, positive, 60.0),
            ("stale_motion[0]", self.stale_motion[0], positive, 1.0),
            ("stale_motion[1]", self.stale_motion[1], positive, 3.2),
            ("pose_blend", self.pose_blend, positive, 10.0),
            ("pose_filter", self.pose_filter, 0.0, 10.0),
            ("tactile_max", self.tactile_max, positive, 1e6),
            ("loaded_force", self.loaded_force, 0.0, 1e3),
            ("lost_distance", self.lost_distance, positive, 1.0),
            ("lost_time", self.lost_time, 0.0, 60.0),
            ("pressing_distance", self.pressing_distance, positive, 1.0),
            ("relearn_distance", self.relearn_distance, positive, 1.0),
            ("pose_arm", self.pose_arm, positive, 10.0),
            ("pose_quiet", self.pose_quiet, positive, 1.0),
            ("effort_margin", self.effort_margin, 0.0, 1e6),
            ("effort_ratio", self.effort_ratio, 0.0, 1e3),
            ("motor_asked", self.motor_asked, self.motor_given, 1e6),
            ("motor_given", self.motor_given, positive, 1e6),
            ("motor_time", self.motor_time, 0.0, 60.0),
            ("squeeze_force", self.squeeze_force, 0.0, 100.0),
            ("seek_time", self.seek_time, 0.0, 1e3),
            ("contacts_timeout", self.contacts_timeout, 0.0, 60.0),
            ("saturation_time", self.saturation_time, 0.0, 1e3),
            ("stop_time", self.stop_time, positive, 10.0),
            ("catch_up[0]", self.catch_up[0], positive, 10.0),
            ("catch_up[1]", self.catch_up[1], positive, 100.0),
        ];
        for (field, value, low, high) in ranges {
            if !(value >= low && value <= high) {
                let expected = format!("a number from {low:e} to {high:e}");
                return Err(Error::config(format!("safety.{field}"), expected, value));
            }
        }
        Ok(())
    }
}
