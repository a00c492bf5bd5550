//! The rows that the active set holds as equalities, and what it must be able to do with them.

use super::qp::{ForceQp, Forces, Row, MAX_ACTIVE, WIDTH};

/// A full working set with the row that is about to enter it.
pub const ROOM: usize = MAX_ACTIVE + 1;

/// One number per row of the working set, and one for the candidate behind them.
pub type Weights = [f64; ROOM];

/// A row held at one of its bounds.
#[derive(Debug, Clone, Copy)]
pub struct Active {
    /// Index of the row in the QP.
    pub row: usize,
    /// +1 at the lower bound, -1 at the upper: the row pushes along `sign a`.
    pub sign: f64,
    /// Multiplier >= 0, N.
    pub mu: f64,
}

impl Active {
    const NONE: Self = Self { row: 0, sign: 1.0, mu: 0.0 };

    /// The bound that the row is held at, N.
    pub fn bound(&self, qp: &ForceQp) -> f64 {
        bound(&qp.rows[self.row], self.sign)
    }

    /// The bound's part of `sign a . f >= sign bound` that `f` misses, N.
    pub fn violation(&self, qp: &ForceQp, f: &Forces) -> f64 {
        self.sign * (self.bound(qp) - qp.along(&qp.rows[self.row], f))
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

/// Rows in the order in which they entered.
#[derive(Debug, Clone)]
pub struct WorkingSet {
    rows: [Active; ROOM],
    len: usize,
}

impl Default for WorkingSet {
    /// The empty set.
    fn default() -> Self {
        Self { rows: [Active::NONE; ROOM], len: 0 }
    }
}

impl WorkingSet {
    /// Number of rows held.
    pub fn len(&self) -> usize {
        self.len
    }

    /// True where no row is held.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

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

    /// Writes a candidate behind the rows held.
    pub fn propose(&mut self, candidate: Active) {
        self.rows[self.len] = candidate;
    }

    /// Takes the candidate in, unless the set is full.
    pub fn accept(&mut self) {
        self.len = (self.len + 1).min(MAX_ACTIVE);
    }

    /// Lets the k-th row go; those behind it move up.
    pub fn remove(&mut self, k: usize) {
        self.rows.copy_within(k + 1..self.len, k);
        self.len -= 1;
    }

    /// `sum p_k sign_k a_k` over the rows held and the candidate.
    pub fn combination(&self, qp: &ForceQp, p: &Weights) -> Forces {
        let mut sum = [0.0; WIDTH];
        for (w, p) in self.rows[..=self.len].iter().zip(p) {
            qp.add_row(&qp.rows[w.row], p * w.sign, &mut sum);
        }
        sum
    }

    /// `sum p_k sign_k bound_k` over the rows held and the candidate, N.
    pub fn combined_bound(&self, qp: &ForceQp, p: &Weights) -> f64 {
        self.rows[..=self.len].iter().zip(p).map(|(w, p)| p * w.sign * w.bound(qp)).sum()
    }
}

/// What became of a row that should enter the working set.
#[derive(Debug, Clone, Copy)]
pub enum Entry {
    /// It is in.
    Accepted,
    /// It depends on the set: with these weights (1 at the row) the rows' combination is zero.
    Dependent(Weights),
    /// Rounding hides whether it does.
    Unclear,
}

/// Solves the force QP with the rows of a working set as equalities.
pub trait Equalities: Default {
    /// The rows held.
    fn set(&self) -> &WorkingSet;

    /// The rows held, to change multipliers or to clear.
    fn set_mut(&mut self) -> &mut WorkingSet;

    /// Takes a new QP; the working set becomes empty.
    fn prepare(&mut self, qp: &ForceQp);

    /// Adds a row if it is independent of the rows held.
    fn add(&mut self, qp: &ForceQp, candidate: Active) -> Entry;

    /// Lets the k-th row go.
    fn remove(&mut self, qp: &ForceQp, k: usize);

    /// Multipliers of the rows as equalities, N; negative where a row would rather be let go.
    fn multipliers(&mut self, qp: &ForceQp) -> Weights;

    /// Forces with the rows as equalities, N. The rows' multipliers are those of [`Equalities::multipliers`].
    fn forces(&self, qp: &ForceQp) -> Forces;

    /// N: rounding errors of [`Equalities::forces`]; a violation below them says nothing.
    fn rounding(&self) -> f64;

    /// One Newton step on the KKT system, against rounding in `f` and the multipliers.
    fn refine(&mut self, qp: &ForceQp, f: &mut Forces);
}
