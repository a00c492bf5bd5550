//! The torques that the motors can give.

use super::HandModel;
use crate::error::Error;

/// Least and largest torque of each independent joint, N m. Zero lies between the two.
#[derive(Debug, Clone, PartialEq)]
pub struct TorqueLimits {
    min: Vec<f64>,
    max: Vec<f64>,
}

impl TorqueLimits {
    /// These limits, finger by finger, neither beyond `cap` where there is one.
    ///
    /// An [`Error::Shape`] unless there are as many of both; an [`Error::Config`] unless `tau_min <= 0 <= tau_max`, finite and
    /// not both zero.
    pub fn new(min: &[f64], max: &[f64], cap: Option<f64>) -> Result<Self, Error> {
        if min.len() != max.len() {
            return Err(Error::shape(
                "tau_max",
                format!("({},) as tau_min", min.len()),
                format!("({},)", max.len()),
            ));
        }
        for (i, (min, max)) in min.iter().zip(max).enumerate() {
            check(&format!("tau_min[{i}]"), &format!("tau_max[{i}]"), *min, *max)?;
        }
        let cap = cap.unwrap_or(f64::INFINITY);
        Ok(Self {
            min: min.iter().map(|tau| tau.max(-cap)).collect(),
            max: max.iter().map(|tau| tau.min(cap)).collect(),
        })
    }

    /// -`limit` to `limit` for `n` joints.
    pub fn uniform(n: usize, limit: f64) -> Result<Self, Error> {
        Self::new(&vec![-limit; n], &vec![limit; n], None)
    }

    /// What the model of `hand` states, neither beyond `cap`; joints of which it states nothing have -`cap` to `cap`.
    ///
    /// An [`Error::Config`] names the first joint of which nothing is known.
    pub fn of(hand: &HandModel, cap: Option<f64>) -> Result<Self, Error> {
        let (mut min, mut max) = (Vec::new(), Vec::new());
        for (at, joint) in hand.coordinates().iter().enumerate() {
            for (field, stated, default, limits) in [
                ("tau_min", joint.tau_min, cap.map(|cap| -cap), &mut min),
                ("tau_max", joint.tau_max, cap, &mut max),
            ] {
                let limit = stated.or(default).ok_or_else(|| {
                    let field = format!("hand: {field} of the joint {}", hand.name(at));
                    Error::config(field, "a torque in N m, or force.tau_max for all joints", "neither")
                })?;
                limits.push(limit);
            }
        }
        Self::new(&min, &max, cap)
    }

    /// Number of joints.
    pub fn n(&self) -> usize {
        self.min.len()
    }

    /// Least torques, N m.
    pub fn min(&self) -> &[f64] {
        &self.min
    }

    /// Largest torques, N m.
    pub fn max(&self) -> &[f64] {
        &self.max
    }
}

/// An error unless 0 is between `min` and `max`, which are finite and differ.
pub(super) fn check(at_min: &str, at_max: &str, min: f64, max: f64) -> Result<(), Error> {
    if !(min.is_finite() && min <= 0.0) {
        return Err(Error::config(at_min, "a finite torque <= 0 N m", min));
    }
    if !(max.is_finite() && max >= 0.0) {
        return Err(Error::config(at_max, "a finite torque >= 0 N m", max));
    }
    if min >= max {
        return Err(Error::config(at_max, "a torque above tau_min", max));
    }
    Ok(())
}
