//! The object's pose between and behind the noise of the pose sensor's samples.
//!
//! Deviation: the paper feeds K with the sensor's pose. A vision system may be slow, late and noisy, beyond what any K with
//! the bandwidth for this task endures. The encoders are neither, and the fingers that stick to the object carry its pose
//! along from sample to sample; so the sensor need only correct what they carry, slowly. Where the encoders are the noisier
//! of the two, the sensor's pose passes unchanged.

use super::config::SafetyConfig;
use super::odometry::{moved, size};
use crate::spatial::pose_error;
use nalgebra::{Isometry3, Vector6};

/// Time constant over which the noise of both sources is learnt, s.
const MEMORY: f64 = 0.5;
/// Samples that come less often than this many periods are slow, however little noise is in them.
const SLOW: f64 = 2.5;

/// See the module.
#[derive(Debug, Clone)]
pub struct Fusion {
    config: SafetyConfig,
    dt: f64,
    out: Option<Isometry3<f64>>,
    /// The last two samples' worth of motion: the last sample, and the increments by sensor and fingers up to it.
    sample: Option<Isometry3<f64>>,
    by_sensor: Vector6<f64>,
    by_fingers: Vector6<f64>,
    /// Motion by the fingers since the last sample, m and rad, and time since then, s.
    since: Vector6<f64>,
    age: f64,
    /// Mean squares of the changes of those increments, m^2: noise, as motion is smooth.
    noise_sensor: f64,
    noise_fingers: f64,
}

impl Fusion {
    /// A fusion at the control period `dt`.
    pub fn new(config: &SafetyConfig, dt: f64) -> Self {
        let zero = Vector6::zeros();
        Self {
            config: config.clone(),
            dt,
            out: None,
            sample: None,
            by_sensor: zero,
            by_fingers: zero,
            since: zero,
            age: 0.0,
            noise_sensor: 0.0,
            noise_fingers: 0.0,
        }
    }

    /// Takes the lengths that fit the grasp.
    pub fn fit(&mut self, config: &SafetyConfig) {
        self.config = config.clone();
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.out = None;
        self.sample = None;
        self.noise_sensor = 0.0;
        self.noise_fingers = 0.0;
    }

    /// The pose to use: `motion` is what the fingers tell since the last step, `X` the sensor's pose, new where `fresh`.
    pub fn update(
        &mut self,
        X: &Isometry3<f64>,
        motion: Option<&Vector6<f64>>,
        fresh: bool,
    ) -> Isometry3<f64> {
        let (Some(motion), Some(out), true) = (motion, self.out, self.config.pose_filter > 0.0) else {
            self.out = Some(*X);
            self.sample = None;
            return *X;
        };
        let mut out = moved(&out, motion);
        self.since += motion;
        self.age += self.dt;
        if fresh {
            self.learn(X);
            let slow = if self.age > SLOW * self.dt { 0.5 } else { 0.0 };
            let share =
                self.noise_sensor / (self.noise_sensor + self.noise_fingers + self.config.pose_quiet.powi(2));
            let time = self.config.pose_filter * share.max(slow);
            let follow = 1.0 - (-self.age / time.max(1e-9)).exp();
            out = if time > 0.2 * self.dt { moved(&out, &(pose_error(X, &out) * follow)) } else { *X };
            self.age = 0.0;
            self.since = Vector6::zeros();
        }
        self.out = Some(out);
        out
    }

    /// Learns the noise of both sources from the new sample `X`.
    fn learn(&mut self, X: &Isometry3<f64>) {
        if let Some(sample) = self.sample {
            let by_sensor = pose_error(X, &sample);
            let follow = 1.0 - (-self.age / MEMORY).exp();
            let square = |change: Vector6<f64>| {
                let [p, r] = size(&change);
                p * p + (self.config.pose_arm * r).powi(2)
            };
            self.noise_sensor += (square(by_sensor - self.by_sensor) - self.noise_sensor) * follow;
            self.noise_fingers += (square(self.since - self.by_fingers) - self.noise_fingers) * follow;
            self.by_sensor = by_sensor;
            self.by_fingers = self.since;
        }
        self.sample = Some(*X);
    }
}
