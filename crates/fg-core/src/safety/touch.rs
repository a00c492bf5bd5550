//! The tactile readings: which to believe, and what to use in place of the others.

use super::config::SafetyConfig;
use super::debounce::Debounce;
use super::{Fault, Faults};
use crate::hand::{HandModel, HandState};
use crate::signals::Tactile;
use nalgebra::{Isometry3, Point3, Vector3};

/// Time constant of the filter on a finger's advance, s: the noise of the pose is in it.
const FILTER: f64 = 0.01;
/// A finger that presses, feels nothing and does not advance for this long has lost its sensor, s.
const PRESSES: f64 = 0.4;

/// What the last step knew about one finger.
#[derive(Debug, Clone, Copy)]
#[allow(clippy::struct_excessive_bools)] // facts that do not depend on each other
pub struct Use {
    /// False where the finger's motors give no torque: it lies where it lies.
    pub drives: bool,
    /// True where all fingers are off the object on purpose, or about to be: none of them need feel anything.
    pub open: bool,
    /// True where the force optimiser gives the finger its force.
    pub holding: bool,
    /// True where the finger looks for the surface.
    pub pressing: bool,
    /// Normal force that it is given, N.
    pub f_n: f64,
}

/// What the guard remembers of one fingertip.
#[derive(Debug, Clone)]
struct Tip {
    /// The last reading, whatever it was, and for how long its force has been the same number, s.
    raw: Tactile,
    still: f64,
    /// The last good reading with contact.
    good: Option<Tactile>,
    /// Filtered good normal force, N.
    load: f64,
    /// Since when readings are replaced.
    replaced: Option<Advance>,
    /// The finger was given up: it has advanced without feeling anything.
    gone: bool,
    /// Since when the finger has pressed without advancing, s.
    pressing: Option<(f64, Advance)>,
    failed: Debounce,
}

/// How far a fingertip has advanced towards the object, in the object's frame.
#[derive(Debug, Clone, Copy)]
struct Advance {
    p_OF: Point3<f64>,
    n_O: Vector3<f64>,
    /// Filtered, m.
    by: f64,
    /// s.
    time: f64,
}

/// Judges all tactile readings. Allocated once.
#[derive(Debug, Clone)]
pub struct TouchGuard {
    config: SafetyConfig,
    dt: f64,
    /// Normal force below which a reading counts as no contact, N.
    contact_force: f64,
    tips: Vec<Tip>,
}

/// Where the fingertips are.
#[derive(Debug, Clone, Copy)]
pub struct Where<'a> {
    /// The hand.
    pub hand: &'a HandModel,
    /// Its kinematics now.
    pub state: &'a HandState,
    /// The object's pose.
    pub X_WO: &'a Isometry3<f64>,
}

impl TouchGuard {
    /// A guard for `n` fingertips at the control period `dt`; less than `contact_force` newtons is no contact.
    pub fn new(n: usize, config: &SafetyConfig, contact_force: f64, dt: f64) -> Self {
        let tip = Tip {
            raw: Tactile { p_FC: Vector3::zeros(), f_n: f64::NAN },
            still: 0.0,
            good: None,
            load: 0.0,
            replaced: None,
            gone: false,
            pressing: None,
            failed: Debounce::default(),
        };
        Self { config: config.clone(), dt, contact_force, tips: vec![tip; n] }
    }

    /// Takes the thresholds that fit the grasp.
    pub fn fit(&mut self, config: &SafetyConfig) {
        self.config = config.clone();
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        for tip in &mut self.tips {
            tip.raw.f_n = f64::NAN;
            tip.still = 0.0;
            tip.good = None;
            tip.load = 0.0;
            tip.replaced = None;
            tip.gone = false;
            tip.pressing = None;
            tip.failed.reset();
        }
    }

    /// True where some sensor has failed for long enough.
    pub fn failed(&self) -> bool {
        self.tips.iter().any(|tip| tip.failed.confirmed())
    }

    /// True where `tactile` are the last readings again, bit for bit.
    pub fn same(&self, tactile: &[Tactile]) -> bool {
        let same = |(tip, now): (&Tip, &Tactile)| tip.raw.f_n.to_bits() == now.f_n.to_bits();
        self.tips.iter().zip(tactile).all(same)
    }

    /// Writes into `trusted` the readings to use for `tactile`; `elapsed` seconds have passed since the last ones.
    pub fn admit(
        &mut self,
        tactile: &[Tactile],
        elapsed: f64,
        at: Where<'_>,
        using: impl Fn(usize) -> Use,
        trusted: &mut [Tactile],
        faults: &mut Faults,
    ) {
        let (config, dt, threshold) = (&self.config, self.dt, self.contact_force);
        for (j, (tip, reading)) in self.tips.iter_mut().zip(tactile).enumerate() {
            let using = using(j);
            tip.note(reading, elapsed);
            let fault = tip.judge(reading, &using, at.hand.tip_radius(j), threshold, config);
            let lost = fault.is_none() && tip.is_silent(reading, &using, j, at, threshold, config, elapsed);
            trusted[j] = if fault.is_none() && !lost {
                tip.believe(reading, threshold, dt)
            } else {
                let here = tip.replaced.unwrap_or_else(|| tip.mark(j, at));
                let advance = here.moved(j, at, elapsed);
                tip.replaced = Some(advance);
                tip.gone |= advance.by > config.lost_distance;
                tip.replacement(&using, threshold)
            };
            let long = tip.replaced.is_some_and(|advance| advance.time > config.lost_time);
            let reported = fault.or((lost && long && !tip.gone).then_some(Fault::TactileLost));
            if let Some(fault) = reported {
                faults.insert(fault);
            }
            tip.failed.update(reported.is_some(), dt, config.ride_through, config.recovery_time);
        }
    }
}

impl Tip {
    fn note(&mut self, reading: &Tactile, elapsed: f64) {
        let same = reading.f_n.to_bits() == self.raw.f_n.to_bits();
        self.still = if same { self.still + elapsed } else { 0.0 };
        self.raw = *reading;
    }

    /// What is wrong with the reading by itself.
    fn judge(
        &self,
        reading: &Tactile,
        using: &Use,
        radius: f64,
        threshold: f64,
        c: &SafetyConfig,
    ) -> Option<Fault> {
        let Tactile { p_FC, f_n } = reading;
        let off_tip = *f_n > threshold && (p_FC.norm() - radius).abs() > 0.5 * radius;
        // NaN fails every comparison.
        if !(*f_n >= -1.0 && *f_n < f64::INFINITY && p_FC.iter().all(|x| x.is_finite())) || off_tip {
            return Some(Fault::Tactile);
        }
        let unexplained = (f_n - using.f_n).abs() > 2.0_f64.max(0.5 * f_n);
        let stuck = self.still > c.stuck_time && *f_n > 1.0 && unexplained;
        (*f_n >= c.tactile_max || stuck).then_some(Fault::TactileStuck)
    }

    /// Whether the finger feels nothing although it should.
    #[allow(clippy::too_many_arguments, reason = "one call, all of it needed")]
    fn is_silent(
        &mut self,
        reading: &Tactile,
        using: &Use,
        j: usize,
        at: Where<'_>,
        threshold: f64,
        c: &SafetyConfig,
        elapsed: f64,
    ) -> bool {
        if reading.f_n > threshold || !using.drives || using.open {
            self.gone = false;
            self.pressing = None;
            return false;
        }
        // A finger that has never felt anything, and is told to press, is on its way or has no sensor.
        let first = self.good.is_none() && using.holding && using.f_n > threshold;
        if (using.pressing || first) && self.replaced.is_none() && (self.good.is_some() || first) {
            let (time, here) = self.pressing.unwrap_or_else(|| (0.0, self.mark(j, at)));
            let here = here.moved(j, at, elapsed);
            self.pressing = (here.by.abs() < c.pressing_distance).then_some((time + elapsed, here));
            return time > PRESSES;
        }
        self.pressing = None;
        let loaded = using.holding && self.load.min(using.f_n) > c.loaded_force;
        !self.gone && (self.replaced.is_some() || loaded)
    }

    fn believe(&mut self, reading: &Tactile, threshold: f64, dt: f64) -> Tactile {
        self.replaced = None;
        if reading.f_n > threshold {
            self.good = Some(*reading);
            self.pressing = None;
        }
        self.load += (reading.f_n - self.load) * (1.0 - (-dt / FILTER).exp());
        *reading
    }

    /// The reading to use: where the finger last felt the object, with the force that it is given.
    fn replacement(&self, using: &Use, threshold: f64) -> Tactile {
        match self.good {
            Some(good) if !self.gone => Tactile { p_FC: good.p_FC, f_n: using.f_n.max(2.0 * threshold) },
            _ => Tactile { p_FC: Vector3::zeros(), f_n: 0.0 },
        }
    }

    fn mark(&self, j: usize, at: Where<'_>) -> Advance {
        let X_WF = at.state.tip(j);
        let n_F = self.good.map_or(Vector3::zeros(), |good| good.p_FC.normalize());
        Advance {
            p_OF: at.X_WO.inverse_transform_point(&Point3::from(X_WF.translation.vector)),
            n_O: at.X_WO.rotation.inverse() * (X_WF.rotation * n_F),
            by: 0.0,
            time: 0.0,
        }
    }
}

impl Advance {
    fn moved(self, j: usize, at: Where<'_>, elapsed: f64) -> Self {
        let p_OF = at.X_WO.inverse_transform_point(&Point3::from(at.state.tip(j).translation.vector));
        let way = p_OF - self.p_OF;
        // Where the surface faces is not known before the first contact: any way will do.
        let now = if self.n_O == Vector3::zeros() { way.norm() } else { self.n_O.dot(&way) };
        let by = self.by + (now - self.by) * (1.0 - (-elapsed / FILTER).exp());
        Self { by, time: self.time + elapsed, ..self }
    }
}
