//! The rate at which the desired motion goes on: no faster than the fingers' reserves allow.
//!
//! With T_(k) the sorted reserves and g the time of a gait, the k-th finger can be on its way in time where the motion goes on
//! at the share T_(k) / (k g) of its rate. The share never falls below a floor while there is a gait to come, and where
//! none can begin for some time the motion goes back: fingers return towards home with the object, until one can be spared. So
//! nothing stands for good. What the motion falls behind is caught up slowly, and only while reserves are ample.

use crate::signals::Reference;
use crate::spatial::{angular, linear};
use nalgebra::{Isometry3, UnitQuaternion, Vector3, Vector6};

/// The motion slows down where the slack of the schedule is below zero, to the floor at minus this, s.
const BAND: f64 = 1.0;
/// Least share of the rate.
const FLOOR: f64 = 0.1;
/// Share of the rate by which the motion catches up, where the slack is above `AMPLE` s.
const CATCH_UP: f64 = 0.2;
const AMPLE: f64 = 1.0;
/// A round that has waited for a finger for this long makes the motion go back, s, at this share of its rate ...
const PATIENCE: f64 = 1.0;
const RETREAT: f64 = 0.5;
/// ... until it has gone back for this long, and then on for as long before it goes back again, s.
const SPELL: f64 = 2.0;
/// Time constant with which the share changes, s.
const SMOOTH: f64 = 0.15;

/// See the module.
#[derive(Debug, Clone)]
pub struct Governor {
    dt: f64,
    /// Share of the rate at which the motion goes on.
    share: f64,
    /// What it has fallen behind, as a translation and a rotation vector in W: m and rad; not wrapped.
    lag: Vector6<f64>,
    /// Time since the motion began to go back, s.
    retreating: Option<f64>,
}

impl Governor {
    /// A governor at the control period `dt`.
    pub fn new(dt: f64) -> Self {
        Self { dt, share: 1.0, lag: Vector6::zeros(), retreating: None }
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        *self = Self::new(self.dt);
    }

    /// Share of its rate at which the desired motion goes on.
    pub fn share(&self) -> f64 {
        self.share
    }

    /// What the motion has fallen behind [m; rad] in W.
    pub fn lag(&self) -> &Vector6<f64> {
        &self.lag
    }

    /// True while the motion goes back.
    pub fn retreats(&self) -> bool {
        self.retreating.is_some_and(|time| time < SPELL)
    }

    /// Takes note of the schedule's slack and of how long a round has waited, s.
    pub fn update(&mut self, slack: f64, waiting: f64) {
        self.retreating = match self.retreating {
            Some(time) if waiting > 0.0 && time < 2.0 * SPELL => Some(time + self.dt),
            None if waiting > PATIENCE => Some(0.0),
            _ => None,
        };
        let wanted = if self.retreats() {
            -RETREAT
        } else if slack > AMPLE && self.lag.norm_squared() > 0.0 {
            1.0 + CATCH_UP
        } else {
            (1.0 + (1.0 - FLOOR) * slack / BAND).clamp(FLOOR, 1.0)
        };
        self.share += (wanted - self.share) * (self.dt / SMOOTH).min(1.0);
    }

    /// The reference to use instead of `reference`: behind it by the lag, at the share of its rate.
    pub fn govern(&mut self, reference: &Reference) -> Reference {
        if self.lag == Vector6::zeros() && (self.share - 1.0).abs() < 1e-3 {
            return *reference;
        }
        let (v, w) = (linear(&reference.V_WD), angular(&reference.V_WD));
        let (lag_t, lag_r) = (linear(&self.lag), angular(&self.lag));
        let (rate_t, rate_r) = (self.rate(&v, &lag_t), self.rate(&w, &lag_r));
        let behind = UnitQuaternion::from_scaled_axis(-lag_r);
        let (v, w) = (v - rate_t, behind * w - rate_r);
        let X = &reference.X_WD;
        let rotation = UnitQuaternion::new_normalize((behind * X.rotation).into_inner());
        let translation = X.translation.vector - lag_t;
        self.lag += Vector6::new(rate_t.x, rate_t.y, rate_t.z, rate_r.x, rate_r.y, rate_r.z) * self.dt;
        if self.lag.norm() < 1e-9 {
            self.lag = Vector6::zeros();
        }
        Reference {
            X_WD: Isometry3::from_parts(translation.into(), rotation),
            V_WD: Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z),
        }
    }

    /// How fast the part `lag` grows where the motion's part is `V`: what is left out of the motion, or what is caught up.
    fn rate(&self, V: &Vector3<f64>, lag: &Vector3<f64>) -> Vector3<f64> {
        if self.share <= 1.0 {
            return V * (1.0 - self.share);
        }
        let length = lag.norm().max(1e-12);
        -lag * (V.norm() * (self.share - 1.0) / length).min(1.0 / self.dt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A steady turn of 0.2 rad/s about z, at time t.
    fn turn(t: f64) -> Reference {
        Reference {
            X_WD: Isometry3::new(Vector3::new(0.0, 0.0, 0.1), Vector3::new(0.0, 0.0, 0.2 * t)),
            V_WD: Vector6::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.2),
        }
    }

    /// Turns for `seconds` from `t`, checks that pose and twist agree, and returns the angle gained.
    fn run(
        governor: &mut Governor,
        t: &mut f64,
        seconds: f64,
        slack: f64,
        waiting: impl Fn(f64) -> f64,
    ) -> f64 {
        let (begin, mut gained) = (*t, 0.0);
        let mut last: Option<Reference> = None;
        while *t < begin + seconds {
            governor.update(slack, waiting(*t - begin));
            let out = governor.govern(&turn(*t));
            if let Some(last) = last {
                let moved = (out.X_WD.rotation * last.X_WD.rotation.inverse()).scaled_axis();
                assert!((moved / 0.002 - angular(&last.V_WD)).norm() < 1e-3);
                gained += moved.z;
            }
            last = Some(out);
            *t += 0.002;
        }
        gained
    }

    #[test]
    fn ample_reserves_leave_the_reference_as_it_is() {
        let mut governor = Governor::new(0.002);
        governor.update(5.0, 0.0);
        assert_eq!(governor.govern(&turn(1.0)), turn(1.0));
    }

    #[test]
    fn a_lag_of_more_than_a_turn_is_not_wrapped_and_is_caught_up_slowly() {
        let (mut governor, mut t) = (Governor::new(0.002), 0.0);
        let slow = run(&mut governor, &mut t, 40.0, -10.0, |_| 0.0);
        assert!((slow - 0.2 * 40.0 * FLOOR).abs() < 0.1, "{slow}");
        assert!(governor.lag()[5] > 7.0, "{}", governor.lag());
        let fast = run(&mut governor, &mut t, 300.0, 5.0, |_| 0.0);
        assert!((slow + fast - 0.2 * 340.0).abs() < 0.02, "{}", slow + fast);
        assert!(governor.lag()[5].abs() < 1e-9);
    }

    #[test]
    fn a_round_that_waits_makes_the_motion_go_back_and_on_again() {
        let (mut governor, mut t) = (Governor::new(0.002), 0.0);
        let patient = run(&mut governor, &mut t, PATIENCE, -10.0, |t| t);
        assert!(patient > 0.0);
        let back = run(&mut governor, &mut t, SPELL, -10.0, |t| t + PATIENCE);
        assert!(back < -0.2 * RETREAT * SPELL * 0.7, "{back}");
        let on = run(&mut governor, &mut t, SPELL, -10.0, |t| t + PATIENCE + SPELL);
        assert!(on > 0.0, "{on}");
    }
}
