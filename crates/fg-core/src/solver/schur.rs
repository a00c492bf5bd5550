//! Equalities through the Schur complement of the Hessian: the cheap way.
#![allow(clippy::needless_range_loop)] // factorisations read as in the books with indices

use super::kkt::gradient;
use super::qp::{dot, ForceQp, Forces, Row, WIDTH};
use super::working_set::{Active, Entry, Equalities, Weights, WorkingSet, ROOM};

/// `T = A (I - E'E) A'` between the rows held, `T = L D L'`, with `s H^-1 = I - E'E`.
///
/// For `H = s I + alpha3 G'G` the matrix inversion lemma gives `E = sqrt(alpha3) M^-1 G`, `M M' = s I + alpha3 G G'`: a 6 x 6
/// factorisation whatever the number of contacts. Nearly every row touches the three components of one contact, so that
/// `v = E a` costs 18 multiplications and `T_ij = a_i . a_j - v_i . v_j` nine. The price is cancellation: digits are lost
/// in proportion to alpha3 / s, five of sixteen with the paper's weights.
#[derive(Debug, Clone, Default)]
pub struct SchurFactors {
    set: WorkingSet,
    E: [Forces; 6],
    /// Minimiser without constraints, N.
    free: Forces,
    /// sign E a of each row.
    v: [[f64; 6]; ROOM],
    /// Violation of each row by `free`, N.
    d: Weights,
    T: [Weights; ROOM],
    L: [Weights; ROOM],
    D: Weights,
}

impl SchurFactors {
    /// A pivot above this is trusted; below it, independence is looked for in the rows themselves.
    const SAFE_PIVOT: f64 = 1e-5;
    /// A combination of unit rows with a largest weight of 1 that is shorter than this is zero.
    const ZERO: f64 = 1e-9;
    /// Relative to the sum of all multipliers, which the forces are a difference of.
    const ROUNDING: f64 = 4e-15;

    /// f += weight E' y.
    fn add_transposed(&self, y: &[f64; 6], weight: f64, f: &mut Forces) {
        for (e, y) in self.E.iter().zip(y) {
            for (f, z) in f.iter_mut().zip(e) {
                *f += weight * y * z;
            }
        }
    }

    /// x := (I - E'E) x.
    fn apply_inverse(&self, x: &mut Forces) {
        let mut y = [0.0; 6];
        for (y, e) in y.iter_mut().zip(&self.E) {
            *y = dot(e, x);
        }
        self.add_transposed(&y, -1.0, x);
    }

    /// x := T^-1 x.
    fn solve(&self, x: &mut Weights) {
        let len = self.set.len();
        for i in 0..len {
            let mut sum = x[i];
            for k in 0..i {
                sum -= self.L[i][k] * x[k];
            }
            x[i] = sum;
        }
        for (x, d) in x[..len].iter_mut().zip(&self.D) {
            *x /= d;
        }
        self.back_substitute(x);
    }

    /// x := L'^-1 x.
    fn back_substitute(&self, x: &mut Weights) {
        for i in (1..self.set.len()).rev() {
            let last = x[i];
            for k in 0..i {
                x[k] -= self.L[i][k] * last;
            }
        }
    }

    /// p with T p = 0 but for the candidate's pivot, p = 1 at the candidate.
    fn dependence(&self) -> Weights {
        let len = self.set.len();
        let mut p = [0.0; ROOM];
        for (x, l) in p[..len].iter_mut().zip(&self.L[len]) {
            *x = -l;
        }
        self.back_substitute(&mut p);
        p[len] = 1.0;
        p
    }

    /// Row `at` of L and D from T; returns the pivot.
    fn factor_row(&mut self, at: usize) -> f64 {
        let mut pivot = self.T[at][at];
        let mut scaled = self.T[at];
        for j in 0..at {
            let mut sum = scaled[j];
            for k in 0..j {
                sum -= scaled[k] * self.L[j][k];
            }
            scaled[j] = sum;
        }
        for j in 0..at {
            let l = scaled[j] / self.D[j];
            pivot -= l * scaled[j];
            self.L[at][j] = l;
        }
        self.D[at] = pivot;
        pivot
    }
}

impl Equalities for SchurFactors {
    fn set(&self) -> &WorkingSet {
        &self.set
    }

    fn set_mut(&mut self) -> &mut WorkingSet {
        &mut self.set
    }

    fn prepare(&mut self, qp: &ForceQp) {
        self.set.clear();
        let root = qp.alpha3.sqrt();
        let mut M = [[0.0; 6]; 6];
        // The minimiser is prior + E' y with y = sqrt(alpha3) M^-1 (F_des - G prior): no cancellation.
        let mut y = qp.psi(&qp.prior);
        for i in 0..6 {
            for j in 0..=i {
                let mut sum = qp.alpha3 * dot(&qp.G[i], &qp.G[j]);
                if i == j {
                    sum += qp.s;
                }
                for k in 0..j {
                    sum -= M[i][k] * M[j][k];
                }
                // The diagonal is kept as its reciprocal.
                M[i][j] = if i == j { 1.0 / sum.sqrt() } else { sum * M[j][j] };
            }
            let mut e = qp.G[i].map(|g| root * g);
            y[i] *= root;
            for k in 0..i {
                for (x, z) in e.iter_mut().zip(&self.E[k]) {
                    *x -= M[i][k] * z;
                }
                y[i] -= M[i][k] * y[k];
            }
            y[i] *= M[i][i];
            self.E[i] = e.map(|x| M[i][i] * x);
        }
        let mut free = qp.prior;
        self.add_transposed(&y, 1.0, &mut free);
        self.free = free;
    }

    fn add(&mut self, qp: &ForceQp, candidate: Active) -> Entry {
        let at = self.set.len();
        let row = &qp.rows[candidate.row];
        let mut v = [0.0; 6];
        for (x, e) in v.iter_mut().zip(&self.E) {
            *x = candidate.sign * qp.along(row, e);
        }
        for (k, other) in self.set.active().iter().enumerate() {
            let along = overlap(qp, row, &qp.rows[other.row]);
            self.T[at][k] = candidate.sign * other.sign * along - dot6(&v, &self.v[k]);
        }
        self.T[at][at] = 1.0 - dot6(&v, &v);
        self.v[at] = v;
        self.d[at] = candidate.violation(qp, &self.free);
        self.set.propose(candidate);
        let pivot = self.factor_row(at);
        let full = at >= qp.n_free();
        if full || pivot.is_nan() || pivot < Self::SAFE_PIVOT {
            let p = self.dependence();
            let largest = p.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let rest = self.set.combination(qp, &p);
            if full || rest.iter().all(|x| x.abs() <= Self::ZERO * largest) {
                return Entry::Dependent(p);
            }
            if pivot.is_nan() || pivot <= f64::EPSILON {
                return Entry::Unclear;
            }
        }
        self.set.accept();
        Entry::Accepted
    }

    fn remove(&mut self, _qp: &ForceQp, k: usize) {
        let len = self.set.len();
        for i in k + 1..len {
            self.v[i - 1] = self.v[i];
            self.d[i - 1] = self.d[i];
            for j in 0..k {
                self.T[i - 1][j] = self.T[i][j];
                self.L[i - 1][j] = self.L[i][j];
            }
            for j in k + 1..=i {
                self.T[i - 1][j - 1] = self.T[i][j];
            }
        }
        self.set.remove(k);
        for i in k..len - 1 {
            self.factor_row(i);
        }
    }

    fn multipliers(&mut self, _qp: &ForceQp) -> Weights {
        let mut mu = self.d;
        self.solve(&mut mu);
        mu
    }

    /// f = free + (I - E'E) sum mu a.
    fn forces(&self, qp: &ForceQp) -> Forces {
        let mut f = self.free;
        let mut y = [0.0; 6];
        for (w, v) in self.set.active().iter().zip(&self.v) {
            qp.add_row(&qp.rows[w.row], w.sign * w.mu, &mut f);
            for (a, b) in y.iter_mut().zip(v) {
                *a += w.mu * b;
            }
        }
        self.add_transposed(&y, -1.0, &mut f);
        f
    }

    fn rounding(&self) -> f64 {
        Self::ROUNDING * self.set.active().iter().map(|w| w.mu).sum::<f64>()
    }

    fn refine(&mut self, qp: &ForceQp, f: &mut Forces) {
        let mut step = gradient(qp, f, self.set.active().iter().map(|w| (w.row, w.sign * w.mu)));
        self.apply_inverse(&mut step);
        for (f, r) in f.iter_mut().zip(&step) {
            *f -= r;
        }
        let mut change = [0.0; ROOM];
        for (c, w) in change.iter_mut().zip(self.set.active()) {
            *c = w.violation(qp, f);
        }
        self.solve(&mut change);
        let mut push = [0.0; WIDTH];
        for (w, c) in self.set.active_mut().iter_mut().zip(&change) {
            w.mu += c;
            qp.add_row(&qp.rows[w.row], w.sign * c, &mut push);
        }
        self.apply_inverse(&mut push);
        for (f, p) in f.iter_mut().zip(&push) {
            *f += p;
        }
    }
}

/// a . b of two rows.
fn overlap(qp: &ForceQp, a: &Row, b: &Row) -> f64 {
    match (a.wide, b.wide) {
        (None, None) if a.contact != b.contact => 0.0,
        (None, None) => a.normal.iter().zip(&b.normal).map(|(x, y)| x * y).sum(),
        (None, Some(k)) => qp.along(a, &qp.wide[k]),
        (Some(k), _) => qp.along(b, &qp.wide[k]),
    }
}

fn dot6(x: &[f64; 6], y: &[f64; 6]) -> f64 {
    x.iter().zip(y).map(|(a, b)| a * b).sum()
}
