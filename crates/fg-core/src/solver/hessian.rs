//! The inverse Hessian of the force QP in factored form.
#![allow(clippy::needless_range_loop)] // factorisations read as in the books with indices

use super::qp::{dot, ForceQp, Forces, Row};

/// `s H^-1 = I - E'E` for `H = s I + alpha3 G'G`, with E of six rows.
///
/// By the matrix inversion lemma `E = sqrt(alpha3) L^-1 G`, `L L' = s I + alpha3 G G'`: a 6 x 6 factorisation whatever the
/// number of contacts, and products with a row of the constraints that cost 18 multiplications.
#[derive(Debug, Clone, Default)]
pub struct InverseHessian {
    E: [Forces; 6],
}

impl InverseHessian {
    /// Factors the Hessian of `qp`; returns the minimiser without constraints, N.
    pub fn factor(&mut self, qp: &ForceQp) -> Forces {
        let root = qp.alpha3.sqrt();
        let mut L = [[0.0; 6]; 6];
        // The minimiser is prior + E' y with y = sqrt(alpha3) L^-1 (F_des - G prior): no cancellation.
        let mut y = qp.psi(&qp.prior);
        for i in 0..6 {
            for j in 0..=i {
                let mut sum = qp.alpha3 * dot(&qp.G[i], &qp.G[j]);
                if i == j {
                    sum += qp.s;
                }
                for k in 0..j {
                    sum -= L[i][k] * L[j][k];
                }
                L[i][j] = if i == j { sum.sqrt() } else { sum * L[j][j] };
            }
            // The diagonal is kept as its reciprocal.
            L[i][i] = 1.0 / L[i][i];
            let mut e = qp.G[i].map(|g| root * g);
            y[i] *= root;
            for k in 0..i {
                for (x, z) in e.iter_mut().zip(&self.E[k]) {
                    *x -= L[i][k] * z;
                }
                y[i] -= L[i][k] * y[k];
            }
            y[i] *= L[i][i];
            self.E[i] = e.map(|x| L[i][i] * x);
        }
        let mut f = qp.prior;
        self.add_transposed(&y, 1.0, &mut f);
        f
    }

    /// E a for a row of the constraints.
    pub fn times_row(&self, qp: &ForceQp, row: &Row) -> [f64; 6] {
        let mut v = [0.0; 6];
        for (x, e) in v.iter_mut().zip(&self.E) {
            *x = qp.along(row, e);
        }
        v
    }

    /// f += weight E' y.
    pub fn add_transposed(&self, y: &[f64; 6], weight: f64, f: &mut Forces) {
        for (e, y) in self.E.iter().zip(y) {
            for (f, z) in f.iter_mut().zip(e) {
                *f += weight * y * z;
            }
        }
    }

    /// x := s H^-1 x.
    pub fn apply(&self, x: &mut Forces) {
        let mut y = [0.0; 6];
        for (y, e) in y.iter_mut().zip(&self.E) {
            *y = dot(e, x);
        }
        self.add_transposed(&y, -1.0, x);
    }
}
