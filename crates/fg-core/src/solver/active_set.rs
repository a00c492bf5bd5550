//! Dual active-set method for the force QP, warm-started.
//!
//! Goldfarb and Idnani's method: keep multipliers >= 0, solve with the working set as equalities, let rows go whose
//! multiplier would turn negative, add the most violated row, stop when none is. Any multipliers >= 0 start it, so the last
//! solution's working set and multipliers do. Each change of the set increases the dual objective; where rounding spoils
//! that, a count of changes ends it.
//!
//! How the equalities are solved is a parameter: [`SchurFactors`](super::schur::SchurFactors) for speed,
//! [`NullSpaceFactors`](super::null_space::NullSpaceFactors) for accuracy.

use super::qp::{ForceQp, Forces, WIDTH};
use super::working_set::{bound, Active, Entry, Equalities, Weights};

/// Why the method stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// All rows hold and all multipliers are >= 0.
    Optimal,
    /// A combination of rows proves that no forces below [`LARGEST_FORCE`] times the problem's scale satisfy them all.
    Infeasible,
    /// The bound on changes was reached, or rounding hides what to do.
    Stopped,
}

/// Relative to the problem's scale, [`ForceQp::scale`]: forces beyond this are not looked for.
pub const LARGEST_FORCE: f64 = 1e6;
/// Relative to [`ForceQp::size`]: rows violated by less count as satisfied.
const FEASIBLE: f64 = 1e-10;
/// Weights of a combination above -this count as >= 0.
const POSITIVE: f64 = 1e-12;

/// The method's memory: nothing is allocated after [`ActiveSet::new`].
#[derive(Debug, Clone)]
pub struct ActiveSet<E> {
    max_changes: usize,
    equalities: E,
    f: Forces,
    changes: usize,
}

impl<E: Equalities> ActiveSet<E> {
    /// A solver that gives up after `max_changes` changes of the working set.
    pub fn new(max_changes: usize) -> Self {
        Self { max_changes, equalities: E::default(), f: [0.0; WIDTH], changes: 0 }
    }

    /// Forces at which the method stopped, N.
    pub fn forces(&self) -> &Forces {
        &self.f
    }

    /// The working set as (row, signed multiplier in N).
    pub fn multipliers(&self) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        self.active().iter().map(|w| (w.row, w.sign * w.mu))
    }

    /// Changes of the working set in the last solve.
    pub fn changes(&self) -> usize {
        self.changes
    }

    /// Forgets the working set: the next solve starts cold.
    pub fn reset(&mut self) {
        self.equalities.set_mut().clear();
    }

    /// Takes the multipliers (row, mu) as the next start.
    pub fn start_from(&mut self, multipliers: impl Iterator<Item = (usize, f64)>) {
        let set = self.equalities.set_mut();
        set.clear();
        for (row, mu) in multipliers {
            set.propose(Active { row, sign: mu.signum(), mu: mu.abs() });
            set.accept();
        }
    }

    /// Minimises `qp` from the last working set.
    pub fn solve(&mut self, qp: &ForceQp) -> Outcome {
        self.changes = 0;
        self.warm_start(qp);
        let outcome = loop {
            if !self.satisfy_dual(qp) {
                break Outcome::Stopped;
            }
            self.f = self.equalities.forces(qp);
            let Some((row, sign)) = self.most_violated(qp) else { return Outcome::Optimal };
            if let Err(outcome) = self.add(qp, Active { row, sign, mu: 0.0 }) {
                break outcome;
            }
        };
        if outcome == Outcome::Stopped {
            self.reset();
        }
        outcome
    }

    /// One Newton step on the KKT system of the optimal working set.
    pub fn refine(&mut self, qp: &ForceQp) {
        self.equalities.refine(qp, &mut self.f);
    }

    fn active(&self) -> &[Active] {
        self.equalities.set().active()
    }

    fn active_mut(&mut self) -> &mut [Active] {
        self.equalities.set_mut().active_mut()
    }

    /// Counts a change of the working set; false when there were too many.
    fn count(&mut self) -> bool {
        self.changes += 1;
        self.changes <= self.max_changes
    }

    /// Puts the last working set back, without rows that have lost their bound or become dependent.
    fn warm_start(&mut self, qp: &ForceQp) {
        let last = self.equalities.set().clone();
        self.equalities.prepare(qp);
        for w in last.active() {
            if qp.rows.get(w.row).is_some_and(|row| bound(row, w.sign).is_finite()) {
                // A dependent row is left out: dropping a multiplier keeps the others >= 0.
                self.equalities.add(qp, *w);
            }
        }
    }

    /// Moves the multipliers towards those of the working set as equalities, letting rows go whose multiplier reaches zero
    /// on the way; false when the changes are used up.
    fn satisfy_dual(&mut self, qp: &ForceQp) -> bool {
        loop {
            let target = self.equalities.multipliers(qp);
            let mut first: Option<(usize, f64)> = None;
            for (k, (w, t)) in self.active().iter().zip(&target).enumerate() {
                if *t < 0.0 {
                    let step = w.mu / (w.mu - t);
                    if first.is_none_or(|(_, best)| step < best) {
                        first = Some((k, step));
                    }
                }
            }
            let Some((blocking, step)) = first else {
                for (w, t) in self.active_mut().iter_mut().zip(&target) {
                    w.mu = *t;
                }
                return true;
            };
            for (w, t) in self.active_mut().iter_mut().zip(&target) {
                w.mu = (w.mu + step * (t - w.mu)).max(0.0);
            }
            self.equalities.remove(qp, blocking);
            if !self.count() {
                return false;
            }
        }
    }

    fn most_violated(&self, qp: &ForceQp) -> Option<(usize, f64)> {
        let mut worst = (FEASIBLE * qp.size(&self.f)).max(self.equalities.rounding());
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
    fn add(&mut self, qp: &ForceQp, mut candidate: Active) -> Result<(), Outcome> {
        loop {
            if !self.count() {
                return Err(Outcome::Stopped);
            }
            let p = match self.equalities.add(qp, candidate) {
                Entry::Accepted => return Ok(()),
                Entry::Dependent(p) => p,
                Entry::Unclear => return Err(Outcome::Stopped),
            };
            let mut first: Option<(usize, f64)> = None;
            for (k, (w, x)) in self.active().iter().zip(&p).enumerate() {
                if *x < -POSITIVE && first.is_none_or(|(_, best)| w.mu < -best * x) {
                    first = Some((k, -w.mu / x));
                }
            }
            let Some((blocking, step)) = first else { return Err(self.infeasible(qp, p)) };
            for (w, x) in self.active_mut().iter_mut().zip(&p) {
                w.mu = (w.mu + step * x).max(0.0);
            }
            candidate.mu += step;
            self.equalities.remove(qp, blocking);
        }
    }

    /// Infeasible if weights p >= 0 combine `sign_k a_k . f >= sign_k bound_k` to `v . f >= b` which no f below the largest
    /// force can satisfy (Farkas).
    fn infeasible(&self, qp: &ForceQp, p: Weights) -> Outcome {
        let p = p.map(|x| x.max(0.0));
        let set = self.equalities.set();
        let length: f64 = set.combination(qp, &p).iter().map(|v| v.abs()).sum();
        if set.combined_bound(qp, &p) > length * LARGEST_FORCE * qp.scale {
            Outcome::Infeasible
        } else {
            Outcome::Stopped
        }
    }
}
