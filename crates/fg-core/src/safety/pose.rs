//! The object's pose: whether to believe the sensor, and what to use where not.

use super::config::SafetyConfig;
use super::debounce::Debounce;
use super::fusion::Fusion;
use super::odometry::{moved, size};
use super::{Fault, Faults};
use crate::spatial::{is_finite, pose_error};
use nalgebra::{Isometry3, Vector3, Vector6};

/// Good samples before jumps are judged: the first one may be the bad one.
const SETTLE: u32 = 10;
/// Without fingers to compare with, a pose that has jumped is believed after this long, s.
const RELEARN: f64 = 0.1;
/// Longest time for which the object may have moved unseen, s.
const UNSEEN: f64 = 1.0;

/// Follows the pose sensor, and carries its last good value along with the fingers while it fails.
///
/// A legal sensor may be slow and late: 60 Hz and 30 ms, say. So a pose that stands still is stale only when the fingers
/// say that the object moves.
#[derive(Debug, Clone)]
pub struct PoseGuard {
    config: SafetyConfig,
    dt: f64,
    /// The last sample, whatever it was.
    raw: Isometry3<f64>,
    /// Whether that sample was believed.
    believed: bool,
    /// For how long the sample has been the same, s, and how the object has meanwhile moved, m and rad.
    still: f64,
    motion: Vector6<f64>,
    /// The last good sample, moved along with the fingers since.
    carried: Option<Isometry3<f64>>,
    /// For how long there has been no sample to judge, s.
    missing: f64,
    /// For how long samples have been consistent with each other but not with the last good one, s.
    odd: f64,
    samples: u32,
    /// What was handed out last, and what of it is still to pass over into the sensor's pose, m and rad.
    out: Option<Isometry3<f64>>,
    blend: Option<Vector6<f64>>,
    failed: Debounce,
    source: Source,
    fusion: Fusion,
    /// The sensor's pose, or what stands for it.
    sensed: Isometry3<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    Sensor,
    Fingers,
}

impl PoseGuard {
    /// A guard at the control period `dt`.
    pub fn new(config: &SafetyConfig, dt: f64) -> Self {
        Self {
            config: config.clone(),
            dt,
            // Equal to no sample.
            raw: Isometry3::translation(f64::NAN, f64::NAN, f64::NAN),
            believed: false,
            still: 0.0,
            motion: Vector6::zeros(),
            carried: None,
            missing: 0.0,
            odd: 0.0,
            samples: 0,
            out: None,
            blend: None,
            failed: Debounce::default(),
            source: Source::Sensor,
            fusion: Fusion::new(config, dt),
            sensed: Isometry3::identity(),
        }
    }

    /// Takes the thresholds that fit the grasp.
    pub fn fit(&mut self, config: &SafetyConfig) {
        self.config = config.clone();
        self.fusion.fit(config);
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        *self = Self::new(&self.config, self.dt);
    }

    /// True once there has been a good sample.
    pub fn known(&self) -> bool {
        self.carried.is_some()
    }

    /// True where the sensor has failed for long enough.
    pub fn failed(&self) -> bool {
        self.failed.confirmed()
    }

    /// True where this step's pose comes from the sensor.
    pub fn from_sensor(&self) -> bool {
        self.source == Source::Sensor
    }

    /// The sensor's pose of this step, or what stands for it while it fails: with the sensor's noise, without any lag.
    pub fn sensed(&self) -> &Isometry3<f64> {
        &self.sensed
    }

    /// True where `X` is the last sample again, bit for bit.
    pub fn same(&self, X: &Isometry3<f64>) -> bool {
        same(X, &self.raw)
    }

    /// The pose to use for the sample `X`. `motion` is the object's since the last step, by the fingers; `centre` the
    /// fingertips' mean; `elapsed` seconds have passed since the last sample.
    pub fn admit(
        &mut self,
        X: &Isometry3<f64>,
        motion: Option<&Vector6<f64>>,
        centre: &Vector3<f64>,
        elapsed: f64,
        faults: &mut Faults,
    ) -> Isometry3<f64> {
        if let Some(motion) = motion {
            self.carried = self.carried.map(|X| moved(&X, motion));
            self.out = self.out.map(|X| moved(&X, motion));
        }
        let fault = self.judge(X, motion, centre, elapsed);
        if let Some(fault) = fault {
            faults.insert(fault);
        }
        let c = &self.config;
        self.failed.update(fault.is_some(), self.dt, c.ride_through, c.recovery_time);
        let (source, target) = match (fault, self.carried) {
            (None, _) => (Source::Sensor, *X),
            (Some(_), Some(carried)) => (Source::Fingers, carried),
            (Some(_), None) => (Source::Fingers, Isometry3::translation(centre.x, centre.y, centre.z)),
        };
        self.sensed = self.pass_over(source, &target);
        let fresh = fault.is_none() && self.still == 0.0;
        self.fusion.update(&self.sensed, motion, fresh || self.blend.is_some())
    }

    /// What is wrong with the sample; where nothing is, `carried` becomes the sample.
    fn judge(
        &mut self,
        X: &Isometry3<f64>,
        motion: Option<&Vector6<f64>>,
        centre: &Vector3<f64>,
        elapsed: f64,
    ) -> Option<Fault> {
        let fresh = !self.same(X);
        let since = self.still + elapsed;
        if fresh {
            self.still = 0.0;
            self.motion = Vector6::zeros();
        } else {
            self.still += elapsed;
            self.motion += motion.copied().unwrap_or_default();
        }
        let before = std::mem::replace(&mut self.raw, *X);
        let near = (X.translation.vector - centre).norm() <= self.config.reach;
        if !(is_finite(X) && near && (X.rotation.coords.norm() - 1.0).abs() < 1e-3) {
            self.believed = false;
            self.missing = (self.missing + elapsed).min(UNSEEN);
            return Some(Fault::Pose);
        }
        if fresh {
            self.believed = self.fits(X, &before, motion, elapsed, since);
        }
        if !self.believed {
            return Some(Fault::PoseJump);
        }
        let [p, r] = size(&self.motion);
        let c = &self.config;
        if self.still > c.pose_timeout && (p > c.stale_motion[0] || r > c.stale_motion[1]) {
            self.missing = self.still.min(UNSEEN);
            return Some(Fault::PoseStale);
        }
        if fresh {
            self.carried = Some(*X);
            self.missing = 0.0;
        }
        None
    }

    /// Whether the new sample `X` departs little enough from where the fingers have carried the last good one.
    fn fits(
        &mut self,
        X: &Isometry3<f64>,
        before: &Isometry3<f64>,
        motion: Option<&Vector6<f64>>,
        elapsed: f64,
        since: f64,
    ) -> bool {
        let settled = self.samples >= SETTLE;
        self.samples = self.samples.saturating_add(1);
        let Some(carried) = self.carried else { return true };
        let c = &self.config;
        let unseen = since.min(UNSEEN) + self.missing;
        let within = |a: &Isometry3<f64>, b: &Isometry3<f64>, time: f64| {
            let [p, r] = size(&pose_error(a, b));
            p <= c.pose_jump[0] + c.pose_speed[0] * time && r <= c.pose_jump[1] + c.pose_speed[1] * time
        };
        if within(X, &carried, unseen) {
            self.odd = 0.0;
            return true;
        }
        let consistent = is_finite(before) && within(X, before, elapsed);
        self.odd = if motion.is_none() && consistent { self.odd + since } else { 0.0 };
        !settled || self.odd > RELEARN
    }

    /// Hands out `target`, without a step where the source of the pose changes.
    fn pass_over(&mut self, source: Source, target: &Isometry3<f64>) -> Isometry3<f64> {
        if source != self.source {
            self.source = source;
            self.blend = self.out.map(|out| pose_error(&out, target));
        }
        let out = match self.blend {
            None => *target,
            Some(blend) => {
                let blend = blend * (-self.dt / self.config.pose_blend).exp();
                let [p, r] = size(&blend);
                self.blend = (p > 1e-7 || r > 1e-6).then_some(blend);
                moved(target, &blend)
            }
        };
        self.out = Some(out);
        out
    }
}

fn same(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    let numbers = |X: &Isometry3<f64>| {
        let (p, r) = (X.translation.vector, X.rotation.coords);
        [p.x, p.y, p.z, r.x, r.y, r.z, r.w].map(f64::to_bits)
    };
    numbers(a) == numbers(b)
}
