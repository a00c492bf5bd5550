//! Dual active-set method for the force QP, warm-started: the fast path.
//!
//! Two properties make it cheap. The inverse Hessian has six rows' worth of structure, see [`super::hessian`], and nearly
//! every row of the constraints touches the three components of one contact. So the dual Hessian between rows i and j is
//! `a_i . a_j - v_i . v_j`, v = E a: nine products, whatever the number of contacts.
//!
//! The method is Goldfarb and Idnani's: keep multipliers >= 0, solve with the working set as equalities, let rows go whose
//! multiplier would turn negative, add the most violated row, stop when none is. Any multipliers >= 0 start it, so the last
//! solution's working set and multipliers do. Each change of the set increases the dual objective; rounding is bounded by a
//! count of changes.

use super::hessian::InverseHessian;
use super::kkt::gradient;
use super::qp::{ForceQp, Forces, WIDTH};
use super::working_set::{bound, Active, WorkingSet, ROOM};

/// Why the method stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// All rows hold and all multipliers are >= 0.
    Optimal,
    /// A combination of rows proves that no forces below [`ActiveSet::LARGEST_FORCE`] satisfy them all.
    Infeasible,
    /// The bound on changes was reached, or rounding hides what to do.
    Stopped,
}

/// The method's memory: nothing is allocated after [`ActiveSet::new`].
#[derive(Debug, Clone)]
pub struct ActiveSet {
    max_changes: usize,
    inverse: InverseHessian,
    free: Forces,
    f: Forces,
    set: WorkingSet,
    changes: usize,
}

impl ActiveSet {
    /// N: forces beyond this are not looked for.
    pub const LARGEST_FORCE: f64 = 1e6;
    /// N: rows violated by less count as satisfied.
    const FEASIBLE: f64 = 1e-10;
    /// Relative to the sum of all multipliers: as does a violation below f's rounding errors.
    const ROUNDING: f64 = 4e-15;
    /// Weights of a combination above -this count as >= 0.
    const POSITIVE: f64 = 1e-12;

    /// A solver that gives up after `max_changes` changes of the working set.
    pub fn new(max_changes: usize) -> Self {
        Self {
            max_changes,
            inverse: InverseHessian::default(),
            free: [0.0; WIDTH],
            f: [0.0; WIDTH],
            set: WorkingSet::default(),
            changes: 0,
        }
    }

    /// Forces at which the method stopped, N.
    pub fn forces(&self) -> &Forces {
        &self.f
    }

    /// The working set as (row, signed multiplier in N).
    pub fn multipliers(&self) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        self.set.active().iter().map(|w| (w.row, w.sign * w.mu))
    }

    /// Changes of the working set in the last solve.
    pub fn changes(&self) -> usize {
        self.changes
    }

    /// Forgets the working set: the next solve starts cold.
    pub fn reset(&mut self) {
        self.set.clear();
    }

    /// Takes the multipliers (row, mu) as the next start.
    pub fn start_from(&mut self, multipliers: impl Iterator<Item = (usize, f64)>) {
        self.set.clear();
        for (row, mu) in multipliers {
            self.set.note(row, mu);
        }
    }

    /// Minimises `qp` from the last working set.
    pub fn solve(&mut self, qp: &ForceQp) -> Outcome {
        self.changes = 0;
        self.free = self.inverse.factor(qp);
        self.warm_start(qp);
        loop {
            if !self.satisfy_dual() {
                return self.stop();
            }
            self.update_forces(qp);
            let Some((row, sign)) = self.most_violated(qp) else { return Outcome::Optimal };
            match self.add(qp, row, sign) {
                Ok(()) => {}
                Err(Outcome::Stopped) => return self.stop(),
                Err(end) => return end,
            }
        }
    }

    /// One Newton step on the KKT system of the optimal working set, against the rounding of `I - E'E`.
    pub fn refine(&mut self, qp: &ForceQp) {
        let mut step = gradient(qp, &self.f, self.multipliers());
        self.inverse.apply(&mut step);
        for (f, r) in self.f.iter_mut().zip(&step) {
            *f -= r;
        }
        let mut change = [0.0; ROOM];
        for (c, w) in change.iter_mut().zip(self.set.active()) {
            *c = w.sign * (w.bound(qp) - qp.along(&qp.rows[w.row], &self.f));
        }
        self.set.solve(&mut change);
        let mut push = [0.0; WIDTH];
        for (w, c) in self.set.active_mut().iter_mut().zip(&change) {
            w.mu += c;
            qp.add_row(&qp.rows[w.row], w.sign * c, &mut push);
        }
        self.inverse.apply(&mut push);
        for (f, p) in self.f.iter_mut().zip(&push) {
            *f += p;
        }
    }

    fn stop(&mut self) -> Outcome {
        self.set.clear();
        Outcome::Stopped
    }

    /// Counts a change of the working set; false when there were too many.
    fn count(&mut self) -> bool {
        self.changes += 1;
        self.changes <= self.max_changes
    }

    /// A row at one of its bounds, with its products for this problem.
    fn candidate(&self, qp: &ForceQp, row: usize, sign: f64, mu: f64) -> Active {
        let r = &qp.rows[row];
        let mut v = self.inverse.times_row(qp, r);
        for x in &mut v {
            *x *= sign;
        }
        Active { row, sign, mu, v, d: sign * (bound(r, sign) - qp.along(r, &self.free)) }
    }

    /// Puts the last working set back, without rows that have lost their bound or become dependent.
    fn warm_start(&mut self, qp: &ForceQp) {
        let mut last = [None; ROOM];
        for (l, w) in last.iter_mut().zip(self.set.active()) {
            *l = Some((w.row, w.sign, w.mu));
        }
        self.set.clear();
        for (row, sign, mu) in last.into_iter().flatten() {
            if qp.rows.get(row).is_some_and(|r| bound(r, sign).is_finite()) {
                let candidate = self.candidate(qp, row, sign, mu);
                // A dependent row is left out: dropping a multiplier keeps the others >= 0.
                let _ = self.set.add(qp, candidate);
            }
        }
    }

    /// Moves the multipliers towards those of the working set as equalities, letting rows go whose multiplier reaches zero
    /// on the way; false when the changes are used up.
    fn satisfy_dual(&mut self) -> bool {
        loop {
            let mut target = [0.0; ROOM];
            for (t, w) in target.iter_mut().zip(self.set.active()) {
                *t = w.d;
            }
            self.set.solve(&mut target);
            let mut first: Option<(usize, f64)> = None;
            for (k, (w, t)) in self.set.active().iter().zip(&target).enumerate() {
                if *t < 0.0 {
                    let step = w.mu / (w.mu - t);
                    if first.is_none_or(|(_, best)| step < best) {
                        first = Some((k, step));
                    }
                }
            }
            let Some((blocking, step)) = first else {
                for (w, t) in self.set.active_mut().iter_mut().zip(&target) {
                    w.mu = *t;
                }
                return true;
            };
            for (w, t) in self.set.active_mut().iter_mut().zip(&target) {
                w.mu = (w.mu + step * (t - w.mu)).max(0.0);
            }
            self.set.remove(blocking);
            if !self.count() {
                return false;
            }
        }
    }

    /// f = free + (I - E'E) sum mu a.
    fn update_forces(&mut self, qp: &ForceQp) {
        self.f = self.free;
        let mut y = [0.0; 6];
        for w in self.set.active() {
            qp.add_row(&qp.rows[w.row], w.sign * w.mu, &mut self.f);
            for (a, b) in y.iter_mut().zip(&w.v) {
                *a += w.mu * b;
            }
        }
        self.inverse.add_transposed(&y, -1.0, &mut self.f);
    }

    fn most_violated(&self, qp: &ForceQp) -> Option<(usize, f64)> {
        let total: f64 = self.set.active().iter().map(|w| w.mu).sum();
        let mut worst = Self::FEASIBLE.max(Self::ROUNDING * total);
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

    /// Adds a violated row. While it depends on the working set, its multiplier grows along the dependence until another
    /// row's reaches zero, and that row goes; if none does, the dependence proves infeasibility.
    fn add(&mut self, qp: &ForceQp, row: usize, sign: f64) -> Result<(), Outcome> {
        let mut candidate = self.candidate(qp, row, sign, 0.0);
        loop {
            if !self.count() {
                return Err(Outcome::Stopped);
            }
            let mut p = match self.set.add(qp, candidate) {
                Ok(()) => return Ok(()),
                Err(Some(p)) => p,
                Err(None) => return Err(Outcome::Stopped),
            };
            let mut first: Option<(usize, f64)> = None;
            for (k, (w, x)) in self.set.active().iter().zip(&p).enumerate() {
                if *x < -Self::POSITIVE && first.is_none_or(|(_, best)| w.mu < -best * x) {
                    first = Some((k, -w.mu / x));
                }
            }
            let Some((blocking, step)) = first else { return Err(self.certified_infeasible(qp, &mut p)) };
            for (w, x) in self.set.active_mut().iter_mut().zip(&p) {
                w.mu = (w.mu + step * x).max(0.0);
            }
            candidate.mu += step;
            self.set.remove(blocking);
        }
    }

    /// Infeasible if weights p >= 0 combine `a_k . f >= bound_k` to `v . f >= b` which no |f| below the largest force can
    /// satisfy (Farkas).
    fn certified_infeasible(&self, qp: &ForceQp, p: &mut [f64; ROOM]) -> Outcome {
        for x in p.iter_mut() {
            *x = x.max(0.0);
        }
        let reach: f64 = self.set.combination(qp, p).iter().map(|v| v.abs() * Self::LARGEST_FORCE).sum();
        if self.set.combined_bound(qp, p) > reach {
            Outcome::Infeasible
        } else {
            Outcome::Stopped
        }
    }
}
