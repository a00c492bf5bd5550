//! A discrete linear time-invariant system with an anti-windup input.

use crate::error::Error;
use nalgebra::{DMatrix, DVector};
use serde::Deserialize;

/// A state space as the artefact writes it: rows of numbers.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StateSpaceSpec {
    A: Vec<Vec<f64>>,
    B: Vec<Vec<f64>>,
    C: Vec<Vec<f64>>,
    D: Vec<Vec<f64>>,
    #[serde(default)]
    L: Option<Vec<Vec<f64>>>,
}

/// `u = C x + D e`, `x+ = A x + B e + L (u_realised - u)`. Allocated once.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    A: DMatrix<f64>,
    B: DMatrix<f64>,
    C: DMatrix<f64>,
    D: DMatrix<f64>,
    L: DMatrix<f64>,
    x: DVector<f64>,
    next: DVector<f64>,
}

impl StateSpace {
    /// The system in `spec`, at rest; `at` is its place in the artefact, for errors.
    pub fn new(at: &str, spec: &StateSpaceSpec, n_inputs: usize, n_outputs: usize) -> Result<Self, Error> {
        let order = spec.A.len();
        let L = match &spec.L {
            Some(L) => matrix(&format!("{at}.L"), L, order, n_outputs)?,
            None => DMatrix::zeros(order, n_outputs),
        };
        Ok(Self {
            A: matrix(&format!("{at}.A"), &spec.A, order, order)?,
            B: matrix(&format!("{at}.B"), &spec.B, order, n_inputs)?,
            C: matrix(&format!("{at}.C"), &spec.C, n_outputs, order)?,
            D: matrix(&format!("{at}.D"), &spec.D, n_outputs, n_inputs)?,
            L,
            x: DVector::zeros(order),
            next: DVector::zeros(order),
        })
    }

    /// Returns to rest.
    pub fn reset(&mut self) {
        self.x.fill(0.0);
    }

    /// Number of states.
    pub fn order(&self) -> usize {
        self.x.len()
    }

    /// Writes u = C x + D e.
    pub fn output(&self, e: &[f64], u: &mut [f64]) {
        for (r, u) in u.iter_mut().enumerate() {
            let state: f64 = self.x.iter().enumerate().map(|(c, x)| self.C[(r, c)] * x).sum();
            let direct: f64 = e.iter().enumerate().map(|(c, e)| self.D[(r, c)] * e).sum();
            *u = state + direct;
        }
    }

    /// Advances the state by one sample; `deficit` is u_realised - u.
    pub fn advance(&mut self, e: &[f64], deficit: &[f64]) {
        for r in 0..self.x.len() {
            let state: f64 = self.x.iter().enumerate().map(|(c, x)| self.A[(r, c)] * x).sum();
            let input: f64 = e.iter().enumerate().map(|(c, e)| self.B[(r, c)] * e).sum();
            let windup: f64 = deficit.iter().enumerate().map(|(c, d)| self.L[(r, c)] * d).sum();
            self.next[r] = state + input + windup;
        }
        std::mem::swap(&mut self.x, &mut self.next);
    }
}

fn matrix(field: &str, rows: &[Vec<f64>], n_rows: usize, n_columns: usize) -> Result<DMatrix<f64>, Error> {
    let expected = format!("({n_rows}, {n_columns}) finite numbers");
    if rows.len() != n_rows {
        return Err(Error::artifact(field, expected, format!("{} rows", rows.len())));
    }
    for row in rows {
        if row.len() != n_columns {
            return Err(Error::artifact(field, expected, format!("a row of {}", row.len())));
        }
        if !row.iter().all(|x| x.is_finite()) {
            return Err(Error::artifact(field, expected, "NaN or infinity"));
        }
    }
    Ok(DMatrix::from_fn(n_rows, n_columns, |r, c| rows[r][c]))
}
