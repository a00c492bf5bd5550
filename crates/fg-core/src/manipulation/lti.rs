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
        u.fill(0.0);
        add_product(&self.C, self.x.as_slice(), u);
        add_product(&self.D, e, u);
    }

    /// Advances the state by one sample; `deficit` is u_realised - u.
    pub fn advance(&mut self, e: &[f64], deficit: &[f64]) {
        let next = self.next.as_mut_slice();
        next.fill(0.0);
        add_product(&self.A, self.x.as_slice(), next);
        add_product(&self.B, e, next);
        add_product(&self.L, deficit, next);
        std::mem::swap(&mut self.x, &mut self.next);
    }
}

/// Adds M x to `sum`, column by column, as the numbers lie in memory: a step spends a twentieth of its time here.
fn add_product(M: &DMatrix<f64>, x: &[f64], sum: &mut [f64]) {
    let n = sum.len().max(1); // a gain has no states, and M no numbers
    for (column, x) in M.as_slice().chunks_exact(n).zip(x) {
        for (sum, m) in sum.iter_mut().zip(column) {
            *sum += m * x;
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Any numbers of the right shapes, written as an artefact writes them.
    fn spec(order: usize, inputs: usize, outputs: usize) -> (StateSpaceSpec, [DMatrix<f64>; 5]) {
        let M = |rows: usize, columns: usize, phase: f64| {
            DMatrix::from_fn(rows, columns, |r, c| (phase + (7 * r + 3 * c) as f64).sin())
        };
        let rows = |M: &DMatrix<f64>| M.row_iter().map(|row| row.iter().copied().collect()).collect();
        let (A, B, L) = (M(order, order, 0.1) * 0.3, M(order, inputs, 0.2), M(order, outputs, 0.3));
        let (C, D) = (M(outputs, order, 0.4), M(outputs, inputs, 0.5));
        let spec = StateSpaceSpec { A: rows(&A), B: rows(&B), C: rows(&C), D: rows(&D), L: Some(rows(&L)) };
        (spec, [A, B, C, D, L])
    }

    #[test]
    fn the_state_follows_the_matrix_products() {
        for (order, inputs, outputs) in [(6, 1, 1), (5, 6, 6), (1, 2, 3), (0, 6, 6)] {
            let (spec, [A, B, C, D, L]) = spec(order, inputs, outputs);
            let mut system = StateSpace::new("K", &spec, inputs, outputs).unwrap();
            let mut x = DVector::zeros(order);
            for k in 0..20 {
                let e = DVector::from_fn(inputs, |i, _| f64::from(k) * 0.1 - i as f64);
                let deficit = DVector::from_fn(outputs, |i, _| (f64::from(k) + i as f64).cos());
                let mut u = vec![9.0; outputs];
                system.output(e.as_slice(), &mut u);
                let expected = &C * &x + &D * &e;
                assert!((DVector::from_vec(u) - expected).amax() < 1e-12);
                system.advance(e.as_slice(), deficit.as_slice());
                x = &A * &x + &B * &e + &L * &deficit;
            }
            system.reset();
            assert_eq!(system.order(), order);
        }
    }
}
