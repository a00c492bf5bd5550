//! The rows that the active set holds as equalities, with the factors of their dual Hessian.
#![allow(clippy::needless_range_loop)] // factorisations read as in the books with indices

use super::qp::{ForceQp, Forces, Row, MAX_ACTIVE, WIDTH};

/// Working set with the row that is about to enter it.
pub const ROOM: usize = MAX_ACTIVE + 1;

/// A row held at one of its bounds.
#[derive(Debug, Clone, Copy)]
pub struct Active {
    /// Index of the row in the QP.
    pub row: usize,
    /// +1 at the lower bound, -1 at the upper.
    pub sign: f64,
    /// Multiplier >= 0, N.
    pub mu: f64,
    /// E a, with the sign.
    pub v: [f64; 6],
    /// Violation of the row by the minimiser without constraints, N.
    pub d: f64,
}

impl Active {
    const NONE: Self = Self { row: 0, sign: 1.0, mu: 0.0, v: [0.0; 6], d: 0.0 };

    /// The bound that the row is held at, N.
    pub fn bound(&self, qp: &ForceQp) -> f64 {
        bound(&qp.rows[self.row], self.sign)
    }
}

/// The bound of `row` that `sign` names, N.
pub fn bound(row: &Row, sign: f64) -> f64 {
    if sign > 0.0 {
        row.lower
    } else {
        row.upper
    }
}

/// Rows in the order they entered, `T = A (I - E'E) A'` between them, and `T = L D L'`.
#[derive(Debug, Clone)]
pub struct WorkingSet {
    rows: [Active; ROOM],
    len: usize,
    T: [[f64; ROOM]; ROOM],
    L: [[f64; ROOM]; ROOM],
    D: [f64; ROOM],
}

impl Default for WorkingSet {
    /// The empty set.
    fn default() -> Self {
        Self {
            rows: [Active::NONE; ROOM],
            len: 0,
            T: [[0.0; ROOM]; ROOM],
            L: [[0.0; ROOM]; ROOM],
            D: [1.0; ROOM],
        }
    }
}

impl WorkingSet {
    /// A pivot above this is trusted; below it, independence is looked at in the rows themselves.
    const SAFE_PIVOT: f64 = 1e-5;
    /// A combination of unit rows with a largest weight of 1 that is shorter than this is zero.
    const ZERO: f64 = 1e-9;

    /// The rows held.
    pub fn active(&self) -> &[Active] {
        &self.rows[..self.len]
    }

    /// The rows held, to change their multipliers.
    pub fn active_mut(&mut self) -> &mut [Active] {
        &mut self.rows[..self.len]
    }

    /// Lets all rows go.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Notes a row and its multiplier for the next start, without factoring; no effect when full.
    pub fn note(&mut self, row: usize, mu: f64) {
        if self.len < MAX_ACTIVE {
            self.rows[self.len] = Active { row, sign: mu.signum(), mu: mu.abs(), ..Active::NONE };
            self.len += 1;
        }
    }

    /// Adds a row to the factors if it is independent of the set. If it is not, returns the combination `p` of the set's
    /// rows and it (weight 1, last) that is zero; if rounding hides which, `Err(None)`.
    pub fn add(&mut self, qp: &ForceQp, candidate: Active) -> Result<(), Option<[f64; ROOM]>> {
        let at = self.len;
        let row = &qp.rows[candidate.row];
        for k in 0..at {
            let other = &self.rows[k];
            self.T[at][k] = candidate.sign * other.sign * overlap(qp, row, &qp.rows[other.row])
                - dot6(&candidate.v, &other.v);
        }
        self.T[at][at] = 1.0 - dot6(&candidate.v, &candidate.v);
        self.rows[at] = candidate;
        let pivot = self.factor_row(at);
        let full = at >= qp.n_free();
        if full || pivot.is_nan() || pivot < Self::SAFE_PIVOT {
            let p = self.dependence();
            let largest = p[..=at].iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let rest = self.combination(qp, &p);
            if full || rest.iter().all(|x| x.abs() <= Self::ZERO * largest) {
                return Err(Some(p));
            }
            if pivot.is_nan() || pivot <= f64::EPSILON {
                return Err(None);
            }
        }
        self.len += 1;
        Ok(())
    }

    /// `sum p_k sign_k a_k` over the set and the candidate behind it.
    pub fn combination(&self, qp: &ForceQp, p: &[f64; ROOM]) -> Forces {
        let mut sum = [0.0; WIDTH];
        for (w, p) in self.rows[..=self.len].iter().zip(p) {
            qp.add_row(&qp.rows[w.row], p * w.sign, &mut sum);
        }
        sum
    }

    /// `sum p_k sign_k bound_k` over the set and the candidate behind it, N.
    pub fn combined_bound(&self, qp: &ForceQp, p: &[f64; ROOM]) -> f64 {
        self.rows[..=self.len].iter().zip(p).map(|(w, p)| p * w.sign * w.bound(qp)).sum()
    }

    /// Lets the k-th row go.
    pub fn remove(&mut self, k: usize) {
        for i in k + 1..self.len {
            self.rows[i - 1] = self.rows[i];
            for j in 0..k {
                self.T[i - 1][j] = self.T[i][j];
                self.L[i - 1][j] = self.L[i][j];
            }
            for j in k + 1..=i {
                self.T[i - 1][j - 1] = self.T[i][j];
            }
        }
        self.len -= 1;
        for i in k..self.len {
            self.factor_row(i);
        }
    }

    /// x := T^-1 x.
    pub fn solve(&self, x: &mut [f64; ROOM]) {
        for i in 0..self.len {
            let mut sum = x[i];
            for k in 0..i {
                sum -= self.L[i][k] * x[k];
            }
            x[i] = sum;
        }
        for (x, d) in x[..self.len].iter_mut().zip(&self.D) {
            *x /= d;
        }
        self.back_substitute(x);
    }

    /// p with T p = 0 but for the candidate's pivot, p = 1 at the candidate.
    fn dependence(&self) -> [f64; ROOM] {
        let mut p = [0.0; ROOM];
        for (x, l) in p[..self.len].iter_mut().zip(&self.L[self.len]) {
            *x = -l;
        }
        self.back_substitute(&mut p);
        p[self.len] = 1.0;
        p
    }

    /// x := L'^-1 x.
    fn back_substitute(&self, x: &mut [f64; ROOM]) {
        for i in (1..self.len).rev() {
            let last = x[i];
            for k in 0..i {
                x[k] -= self.L[i][k] * last;
            }
        }
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
