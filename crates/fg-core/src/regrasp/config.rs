//! When contacts are changed by setting the object down, and how.

use crate::error::Error;
use serde::{Deserialize, Serialize};

/// How the hand changes its contacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// By gaits while a finger can be spared; by setting down and regrasping where none can and a support is below.
    Auto,
    /// By gaits only.
    #[default]
    Gait,
    /// By setting down and regrasping only.
    Regrasp,
}

/// How an object is set down and taken again.
///
/// Nothing here knows the size or the weight of an object. Lengths are shares of the contact radius r, the mean distance
/// of the contacts from the axis of the turn at the first grasp; forces are shares of the nominal weight W;
/// accelerations are shares of g; angles are rad and times s.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegraspConfig {
    /// Largest turn of the object in one grasp, half of it to either side of the first grasp, rad.
    pub stroke: f64,
    /// The first grasp must have lifted the object by this share of r before it can be set down again.
    pub lift_min: f64,
    /// Acceleration of the object's surface, /g: turning, and at the end of a lift, where more throws a light object.
    pub acceleration: f64,
    /// Acceleration of fingers on their way to a new grasp, /g.
    pub swing_acceleration: f64,
    /// Shortest time of that way, s.
    pub swing_time: f64,
    /// Distance from the object that fingers keep on that way, /r: a box of which only the faces were felt has its corners
    /// 0.41 r farther out.
    pub clearance: f64,
    /// Distance from the object at which the slow approach begins, /r.
    pub near: f64,
    /// Speed of setting down, r/s.
    pub lower_speed: f64,
    /// Speed of the approach, r/s.
    pub approach_speed: f64,
    /// A finger that approaches has arrived when it feels this, /W ...
    pub touch_force: f64,
    /// ... and waits with this for the others, /W.
    pub wait_force: f64,
    /// Normal force of each finger before the object is lifted, /W. All three are lowered where the assumed friction could
    /// not keep the object from sliding on its support.
    pub preload: f64,
    /// The object has been set down when the desired vertical force has fallen to this share of what it was in the air ...
    pub down_share: f64,
    /// ... and its reference is lower than it by this, /r. Either alone is fooled by noise.
    pub down_lag: f64,
    /// No support is found within this below where it was felt last, /r.
    pub down_search: f64,
    /// Largest part of the wrench that a new grasp may fail to deliver, /W and /(W r).
    pub slack: f64,
    /// A lift with a larger error than this is taken back, /r.
    pub lift_error: f64,
    /// Time in which the fingers let go, s.
    pub release_time: f64,
    /// Time in which they press, s.
    pub preload_time: f64,
    /// Time in which they take the weight, and then again for the check, s.
    pub check_time: f64,
    /// Time in which all fingers must feel the object before they press, s.
    pub touch_time: f64,
    /// Time after which a finger that feels nothing gives up, s.
    pub approach_time: f64,
    /// The next attempt is made this far from the last, rad, to one side and to the other.
    pub retry_turn: f64,
    /// Grasps that may fail in a row before the object is left where it lies.
    pub attempts: u32,
    /// A grasp ends where a joint is this close to its limit, rad ...
    pub joint_margin: f64,
    /// ... or a torque, filtered, over this share of its limit.
    pub torque_share: f64,
    /// Bandwidth of the servo of fingers that are off the object, rad/s.
    pub bandwidth: f64,
    /// Time constant of its filter on the differences of the encoders, s.
    pub velocity_filter: f64,
}

impl Default for RegraspConfig {
    fn default() -> Self {
        Self {
            stroke: 2.36,
            lift_min: 0.1,
            acceleration: 0.03,
            swing_acceleration: 0.5,
            swing_time: 0.3,
            clearance: 0.5,
            near: 0.1,
            lower_speed: 1.2,
            approach_speed: 1.5,
            touch_force: 0.16,
            wait_force: 0.27,
            preload: 0.54,
            down_share: 0.5,
            down_lag: 0.018,
            down_search: 0.25,
            slack: 0.16,
            lift_error: 0.12,
            release_time: 0.09,
            preload_time: 0.09,
            check_time: 0.05,
            touch_time: 0.02,
            approach_time: 1.0,
            retry_turn: 0.1,
            attempts: 6,
            joint_margin: 0.06,
            torque_share: 0.9,
            bandwidth: 25.0,
            velocity_filter: 0.01,
        }
    }
}

impl RegraspConfig {
    /// An error that names the first field out of its range.
    pub fn validate(&self) -> Result<(), Error> {
        let positive = f64::MIN_POSITIVE;
        let ranges = [
            ("stroke", self.stroke, 0.01, 6.2),
            ("lift_min", self.lift_min, positive, 100.0),
            ("acceleration", self.acceleration, 1e-4, 1.0),
            ("swing_acceleration", self.swing_acceleration, 1e-3, 100.0),
            ("swing_time", self.swing_time, 1e-2, 60.0),
            ("clearance", self.clearance, 0.0, 10.0),
            ("near", self.near, 0.0, 10.0),
            ("lower_speed", self.lower_speed, 1e-3, 100.0),
            ("approach_speed", self.approach_speed, 1e-3, 100.0),
            ("touch_force", self.touch_force, positive, 100.0),
            ("wait_force", self.wait_force, self.touch_force, 100.0),
            ("preload", self.preload, self.wait_force, 100.0),
            ("down_share", self.down_share, 0.0, 1.0),
            ("down_lag", self.down_lag, positive, 1.0),
            ("down_search", self.down_search, self.down_lag, 100.0),
            ("slack", self.slack, positive, 10.0),
            ("lift_error", self.lift_error, positive, 10.0),
            ("release_time", self.release_time, 0.0, 10.0),
            ("preload_time", self.preload_time, 0.0, 10.0),
            ("check_time", self.check_time, 1e-3, 10.0),
            ("touch_time", self.touch_time, 0.0, 10.0),
            ("approach_time", self.approach_time, 1e-2, 60.0),
            ("retry_turn", self.retry_turn, 0.0, 1.0),
            ("joint_margin", self.joint_margin, 0.0, 1.0),
            ("torque_share", self.torque_share, 0.1, 1.0),
            ("bandwidth", self.bandwidth, 1.0, 1e3),
            ("velocity_filter", self.velocity_filter, 0.0, 1.0),
        ];
        for (field, value, low, high) in ranges {
            if !(value >= low && value <= high) {
                let expected = format!("a number from {low:e} to {high:e}");
                return Err(Error::config(format!("regrasp.{field}"), expected, value));
            }
        }
        Ok(())
    }
}
