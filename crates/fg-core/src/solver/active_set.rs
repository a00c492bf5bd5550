//! Dual active-set method for the force QP, warm-started: the fast path.
//!
//! Two properties make it cheap. The Hessian is s I + alpha3 G'G with a G of six rows, so H^-1 = (I - E'E)/s where
//! E = sqrt(alpha3) L^-1 G is 6 x n and L L' = s I + alpha3 G G' is 6 x 6. And nearly every row of the constraints touches
//! the three components of one contact. So the dual Hessian between rows i and j is `a_i . a_j - v_i . v_j`, v = E a:
//! nine products, whatever the number of contacts.
//!
//! The method is Goldfarb and Idnani's: keep multipliers >= 0, solve with the working set as equalities, leave out rows
//! whose multiplier would turn negative, add the most violated row, stop when none is. Any multipliers >= 0 start it, so
//! the last solution's working set and multipliers do.

// Factorisations read as in the books with indices.
#![allow(clippy::needless_range_loop)]

use super::kkt::gradient;
use super::qp::{dot, ForceQp, Forces, Row, MAX_ACTIVE, WIDTH};

/// Why the method stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// All rows hold and all multipliers are >= 0.
    Optimal,
    /// A combination of rows proves that no f satisfies them all.
    Infeasible,
    /// The bound on iterations was reached, or the numbers broke down.
    Stopped,
}

#[derive(Debug, Clone, Copy)]
struct Active {
    row: usize,
    /// +1 at the lower bound, -1 at the upper.
    sign: f64,
    mu: f64,
    /// E a, with the sign.
    v: [f64; 6],
    /// Violation of the row at the unconstrained minimiser, N.
    d: f64,
}

impl Active {
    const NONE: Self = Self { row: 0, sign: 1.0, mu: 0.0, v: [0.0; 6], d: 0.0 };
}

/// The method's memory: nothing is allocated after [`ActiveSet::new`].
#[derive(Debug, Clone)]
pub struct ActiveSet {
    max_iterations: usize,
    E: [Forces; 6],
    free: Forces,
    f: Forces,
    working: [Active; MAX_ACTIVE],
    len: usize,
    /// Dual Hessian of the working set, and its L D L' factors.
    T: [[f64; MAX_ACTIVE]; MAX_ACTIVE],
    L: [[f64; MAX_ACTIVE]; MAX_ACTIVE],
    D: [f64; MAX_ACTIVE],
    iterations: usize,
}

impl ActiveSet {
    /// Rows violated by less than this, N, count as satisfied.
    const FEASIBLE: f64 = 1e-10;
    /// A row whose pivot in the dual Hessian is below this depends on the working set.
    const DEPENDENT: f64 = 1e-12;

    /// A solver that gives up after `max_iterations` changes of the working set.
    pub fn new(max_iterations: usize) -> Self {
        Self {
            max_iterations,
            E: [[0.0; WIDTH]; 6],
            free: [0.0; WIDTH],
            f: [0.0; WIDTH],
            working: [Active::NONE; MAX_ACTIVE],
            len: 0,
            T: [[0.0; MAX_ACTIVE]; MAX_ACTIVE],
            L: [[0.0; MAX_ACTIVE]; MAX_ACTIVE],
            D: [0.0; MAX_ACTIVE],
            iterations: 0,
        }
    }

    /// Forces at which the method stopped, N.
    pub fn forces(&self) -> &Forces {
        &self.f
    }

    /// The working set as (row, signed multiplier in N).
    pub fn multipliers(&self) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        self.working[..self.len].iter().map(|w| (w.row, w.sign * w.mu))
    }

    /// Changes of the working set in the last solve.
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    /// Forgets the working set: the next solve starts cold.
    pub fn reset(&mut self) {
        self.len = 0;
    }

    /// Takes the multipliers (row, mu) as the next start.
    pub fn start_from(&mut self, multipliers: impl Iterator<Item = (usize, f64)>) {
        self.len = 0;
        for (row, mu) in multipliers.take(MAX_ACTIVE) {
            self.working[self.len] = Active { row, sign: mu.signum(), mu: mu.abs(), ..Active::NONE };
            self.len += 1;
        }
    }

    /// Minimises `qp` from the last working set.
    pub fn solve(&mut self, qp: &ForceQp) -> Outcome {
        self.iterations = 0;
        self.factor(qp);
        self.warm_start(qp);
        let mut target = [0.0; MAX_ACTIVE];
        loop {
            // Leave rows out until the working set's own multipliers are >= 0.
            loop {
                self.equality_multipliers(&mut target);
                let Some((blocking, step)) = self.blocking(&target) else { break };
                for (w, t) in self.working[..self.len].iter_mut().zip(&target) {
                    w.mu = (w.mu + step * (t - w.mu)).max(0.0);
                }
                self.remove(blocking);
                self.iterations += 1;
                if self.iterations > self.max_iterations {
                    return self.stop();
                }
            }
            for (w, t) in self.working[..self.len].iter_mut().zip(&target) {
                w.mu = *t;
            }
            self.update_forces(qp);
            let Some((row, sign)) = self.most_violated(qp) else { return Outcome::Optimal };
            if let Some(end) = self.add(qp, row, sign) {
                return end;
            }
        }
    }

    /// One Newton step on the KKT system of the optimal working set, against the rounding of `I - E'E`.
    pub fn refine(&mut self, qp: &ForceQp) {
        let mut residual = gradient(qp, &self.f, self.multipliers());
        self.project(&mut residual);
        for (f, r) in self.f.iter_mut().zip(&residual) {
            *f -= r;
        }
        let mut change = [0.0; MAX_ACTIVE];
        for (c, w) in change.iter_mut().zip(&self.working[..self.len]) {
            let row = &qp.rows[w.row];
            let bound = if w.sign > 0.0 { row.lower } else { row.upper };
            *c = w.sign * (bound - qp.along(row, &self.f));
        }
        self.dual_solve(&mut change);
        let mut push = [0.0; WIDTH];
        for (w, c) in self.working[..self.len].iter_mut().zip(&change) {
            w.mu += c;
            qp.add_row(&qp.rows[w.row], w.sign * c, &mut push);
        }
        self.project(&mut push);
        for (f, p) in self.f.iter_mut().zip(&push) {
            *f += p;
        }
    }

    /// x := (I - E'E) x.
    fn project(&self, x: &mut Forces) {
        let y = self.E.map(|e| dot(&e, x));
        for (e, y) in self.E.iter().zip(&y) {
            for (x, e) in x.iter_mut().zip(e) {
                *x -= y * e;
            }
        }
    }

    fn stop(&mut self) -> Outcome {
        self.len = 0;
        Outcome::Stopped
    }

    /// E and the unconstrained minimiser.
    fn factor(&mut self, qp: &ForceQp) {
        let root = qp.alpha3.sqrt();
        let mut L = [[0.0; 6]; 6];
        // Residual of the prior in the same whitened coordinates: E' y is then the step from the prior.
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
                L[i][j] = if i == j { sum.sqrt() } else { sum / L[j][j] };
            }
            let inverse = 1.0 / L[i][i];
            let mut e = qp.G[i];
            for x in &mut e {
                *x *= root;
            }
            y[i] *= root;
            for k in 0..i {
                for (x, z) in e.iter_mut().zip(&self.E[k]) {
                    *x -= L[i][k] * z;
                }
                y[i] -= L[i][k] * y[k];
            }
            for x in &mut e {
                *x *= inverse;
            }
            y[i] *= inverse;
            self.E[i] = e;
        }
        self.free = qp.prior;
        for (e, y) in self.E.iter().zip(&y) {
            for (x, z) in self.free.iter_mut().zip(e) {
                *x += y * z;
            }
        }
    }

    /// Puts the last working set back, without rows that have lost their bound or become dependent.
    fn warm_start(&mut self, qp: &ForceQp) {
        let last = self.working;
        let len = self.len;
        self.len = 0;
        for w in &last[..len] {
            let Some(row) = qp.rows.get(w.row) else { continue };
            let bound = if w.sign > 0.0 { row.lower } else { row.upper };
            if bound.is_finite() && self.push(qp, w.row, w.sign) > Self::DEPENDENT {
                self.working[self.len].mu = w.mu;
                self.len += 1;
            }
        }
    }

    /// Writes a row behind the working set, without counting it in; returns its pivot in the dual Hessian.
    fn push(&mut self, qp: &ForceQp, index: usize, sign: f64) -> f64 {
        let row = &qp.rows[index];
        let at = self.len;
        let mut v = [0.0; 6];
        for (x, e) in v.iter_mut().zip(&self.E) {
            *x = sign * qp.along(row, e);
        }
        let bound = if sign > 0.0 { row.lower } else { row.upper };
        let d = sign * (bound - qp.along(row, &self.free));
        self.working[at] = Active { row: index, sign, mu: 0.0, v, d };
        for k in 0..at {
            let other = &self.working[k];
            self.T[at][k] = sign * other.sign * overlap(qp, row, &qp.rows[other.row]) - dot6(&v, &other.v);
        }
        self.T[at][at] = 1.0 - dot6(&v, &v);
        self.factor_row(at)
    }

    /// Computes row `at` of L and D from T; returns the pivot.
    fn factor_row(&mut self, at: usize) -> f64 {
        let mut pivot = self.T[at][at];
        let mut scaled = [0.0; MAX_ACTIVE];
        for j in 0..at {
            let mut sum = self.T[at][j];
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

    /// Multipliers of the working set as equalities: T target = d.
    fn equality_multipliers(&self, target: &mut [f64; MAX_ACTIVE]) {
        for (t, w) in target.iter_mut().zip(&self.working[..self.len]) {
            *t = w.d;
        }
        self.dual_solve(target);
    }

    /// x := T^-1 x over the working set.
    fn dual_solve(&self, x: &mut [f64; MAX_ACTIVE]) {
        for i in 0..self.len {
            for k in 0..i {
                x[i] -= self.L[i][k] * x[k];
            }
        }
        for (x, d) in x[..self.len].iter_mut().zip(&self.D) {
            *x /= d;
        }
        self.back_substitute(x, self.len);
    }

    /// L' x = x over the first `len` rows.
    fn back_substitute(&self, x: &mut [f64; MAX_ACTIVE], len: usize) {
        for i in (0..len).rev() {
            for k in i + 1..len {
                x[i] -= self.L[k][i] * x[k];
            }
        }
    }

    /// The first row whose multiplier reaches zero on the way to `target`, with the step's length in 0..1.
    fn blocking(&self, target: &[f64; MAX_ACTIVE]) -> Option<(usize, f64)> {
        let mut found: Option<(usize, f64)> = None;
        for (k, (w, t)) in self.working[..self.len].iter().zip(target).enumerate() {
            if *t < 0.0 {
                let step = w.mu / (w.mu - t);
                if found.is_none_or(|(_, best)| step < best) {
                    found = Some((k, step));
                }
            }
        }
        found
    }

    /// Leaves the k-th row of the working set out.
    fn remove(&mut self, k: usize) {
        for i in k + 1..self.len {
            self.working[i - 1] = self.working[i];
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

    /// f = free + (I - E'E) sum mu a.
    fn update_forces(&mut self, qp: &ForceQp) {
        let mut push = [0.0; WIDTH];
        let mut y = [0.0; 6];
        for w in &self.working[..self.len] {
            qp.add_row(&qp.rows[w.row], w.sign * w.mu, &mut push);
            for (a, b) in y.iter_mut().zip(&w.v) {
                *a += w.mu * b;
            }
        }
        for ((f, a), b) in self.f.iter_mut().zip(&self.free).zip(&push) {
            *f = a + b;
        }
        for (e, y) in self.E.iter().zip(&y) {
            for (f, z) in self.f.iter_mut().zip(e) {
                *f -= y * z;
            }
        }
    }

    fn most_violated(&self, qp: &ForceQp) -> Option<(usize, f64)> {
        let mut worst = Self::FEASIBLE;
        let mut found = None;
        for (index, row) in qp.rows.iter().enumerate() {
            let along = qp.along(row, &self.f);
            if row.lower - along > worst {
                worst = row.lower - along;
                found = Some((index, 1.0));
            } else if along - row.upper > worst {
                worst = along - row.upper;
                found = Some((index, -1.0));
            }
        }
        found
    }

    /// Adds a violated row; where it depends on the working set, first swaps it for the row that blocks.
    fn add(&mut self, qp: &ForceQp, index: usize, sign: f64) -> Option<Outcome> {
        let mut mu = 0.0;
        loop {
            self.iterations += 1;
            if self.iterations > self.max_iterations {
                return Some(self.stop());
            }
            if self.len < MAX_ACTIVE {
                let pivot = self.push(qp, index, sign);
                if pivot > Self::DEPENDENT {
                    self.working[self.len].mu = mu;
                    self.len += 1;
                    return None;
                }
                if !pivot.is_finite() {
                    return Some(self.stop());
                }
                // T p = 0 with p = 1 at the new row: along p the dual objective grows without curvature.
                let mut p = [0.0; MAX_ACTIVE];
                for (x, l) in p[..self.len].iter_mut().zip(&self.L[self.len]) {
                    *x = -l;
                }
                self.back_substitute(&mut p, self.len);
                let mut found: Option<(usize, f64)> = None;
                for (k, (w, x)) in self.working[..self.len].iter().zip(&p).enumerate() {
                    if *x < -1e-12 && found.is_none_or(|(_, best)| w.mu < -best * x) {
                        found = Some((k, -w.mu / x));
                    }
                }
                let Some((blocking, step)) = found else { return Some(Outcome::Infeasible) };
                for (w, x) in self.working[..self.len].iter_mut().zip(&p) {
                    w.mu = (w.mu + step * x).max(0.0);
                }
                mu += step;
                self.remove(blocking);
            } else {
                return Some(self.stop());
            }
        }
    }
}

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
