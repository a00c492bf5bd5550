//! What the force optimiser is asked.

use crate::error::Error;
use nalgebra::{DMatrix, DVector, Vector6};

/// Eq. (8) at one instant. Contact frames have z along the inward normal.
#[derive(Debug, Clone, Copy)]
pub struct ForceProblem<'a> {
    /// Grasp map, (6, 3n): contact forces to the wrench on the object in W at Oo.
    pub G: &'a DMatrix<f64>,
    /// (3n, n_q) with tau = J' f, m.
    pub J: &'a DMatrix<f64>,
    /// Desired wrench [force; torque], N and N m.
    pub F_des: &'a Vector6<f64>,
    /// Contact forces of the last step, (3n,), N.
    pub f_prev: &'a DVector<f64>,
    /// Lower bounds on tau, (n_q,), N m; -inf for none.
    pub tau_min: &'a DVector<f64>,
    /// Upper bounds on tau, (n_q,), N m; +inf for none.
    pub tau_max: &'a DVector<f64>,
    /// Cap on each contact's normal force, N: infinity for none; <= 0 pins the contact's whole force to zero.
    pub f_normal_max: &'a [f64],
}

/// Numbers beyond this count as not finite: their products would not be.
const ABSURD: f64 = 1e60;

/// An error unless `problem` has the shapes for `n` force components and `n_q` joints, and numbers one can compute with.
pub(super) fn validate(problem: &ForceProblem<'_>, n: usize, n_q: usize) -> Result<(), Error> {
    shape("G", problem.G.shape(), (6, n))?;
    shape("J", problem.J.shape(), (n, n_q))?;
    length("f_prev", problem.f_prev.len(), n)?;
    length("tau_min", problem.tau_min.len(), n_q)?;
    length("tau_max", problem.tau_max.len(), n_q)?;
    length("f_normal_max", problem.f_normal_max.len(), n / 3)?;
    numbers("G", problem.G.as_slice(), "a finite number", |x| x.abs() < ABSURD)?;
    numbers("J", problem.J.as_slice(), "a finite number", |x| x.abs() < ABSURD)?;
    numbers("F_des", problem.F_des.as_slice(), "a finite number", |x| x.abs() < ABSURD)?;
    numbers("f_prev", problem.f_prev.as_slice(), "a finite number", |x| x.abs() < ABSURD)?;
    numbers("tau_min", problem.tau_min.as_slice(), "a finite number or -inf", |x| x < ABSURD)?;
    numbers("tau_max", problem.tau_max.as_slice(), "a finite number or +inf", |x| x > -ABSURD)?;
    numbers("f_normal_max", problem.f_normal_max, "a number or +inf", |x| !x.is_nan())
}

fn shape(field: &str, found: (usize, usize), expected: (usize, usize)) -> Result<(), Error> {
    if found == expected {
        return Ok(());
    }
    Err(Error::shape(field, format!("{expected:?}"), format!("{found:?}")))
}

fn length(field: &str, found: usize, expected: usize) -> Result<(), Error> {
    if found == expected {
        return Ok(());
    }
    Err(Error::shape(field, format!("({expected},)"), format!("({found},)")))
}

fn numbers(field: &str, values: &[f64], expected: &str, accepted: impl Fn(f64) -> bool) -> Result<(), Error> {
    // Without a branch per number: this runs over all of G and J at every step.
    if values.iter().fold(true, |all, x| all & accepted(*x)) {
        return Ok(());
    }
    match values.iter().position(|x| !accepted(*x)) {
        None => Ok(()),
        Some(i) => Err(Error::config(format!("{field}[{i}]"), expected, values[i])),
    }
}
