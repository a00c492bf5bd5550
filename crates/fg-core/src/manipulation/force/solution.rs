//! What the force optimiser answers.

use nalgebra::{DVector, Vector6};

/// Where the forces come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForceStatus {
    /// The minimiser of eq. (8), certified.
    Solved,
    /// The last certified forces, made feasible.
    Held,
}

impl ForceStatus {
    /// The name used in logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Solved => "solved",
            Self::Held => "held",
        }
    }
}

/// The solver whose answer was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SolverUsed {
    /// The active set.
    ActiveSet,
    /// Clarabel, polished.
    ClarabelPolished,
    /// Clarabel's own answer, within `raw_tolerance`.
    Clarabel,
    /// None: forces are held.
    Held,
}

impl SolverUsed {
    /// The name used in logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::ActiveSet => "active_set",
            Self::ClarabelPolished => "clarabel_polished",
            Self::Clarabel => "clarabel",
            Self::Held => "held",
        }
    }
}

/// Contact forces and how good they are.
#[derive(Debug, Clone, PartialEq)]
pub struct ForceSolution {
    /// f, (3n,), N in the contact frames.
    pub f: DVector<f64>,
    /// tau = J' f, (n_q,), N m.
    pub tau: DVector<f64>,
    /// Psi = F_des - G f: the part of the wrench that is not delivered.
    pub psi: Vector6<f64>,
    /// Solved or held.
    pub status: ForceStatus,
    /// The solver whose answer this is.
    pub solver: SolverUsed,
    /// KKT residual, N, see [`crate::solver::kkt::Residual`]. Of held forces too, for the best multipliers found: their worst
    /// violation of a bound or their distance from a minimiser, whichever is larger; finite and never zero.
    pub kkt: f64,
    /// Changes of the working set, or clarabel's iterations.
    pub iterations: usize,
}

/// How often each answer was taken, and why the next solver was asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SolverCounters {
    /// Answers of the active set.
    pub active_set: u64,
    /// Answers of clarabel, polished.
    pub clarabel_polished: u64,
    /// Answers of clarabel as they came.
    pub clarabel: u64,
    /// Forces held.
    pub held: u64,
    /// Fast active set to careful one: bound on changes reached, or rounding hides what to do.
    pub fast_stopped: u64,
    /// Fast active set to careful one: KKT residual above tolerance.
    pub fast_uncertified: u64,
    /// Careful active set to clarabel: neither certified forces nor certified that there are none.
    pub careful_undecided: u64,
    /// Held: the active set proves that no forces are within the bounds.
    pub active_set_infeasible: u64,
    /// Held: bounds that contradict each other on their face.
    pub bounds_inconsistent: u64,
    /// Held: clarabel finds no forces within the bounds.
    pub clarabel_infeasible: u64,
    /// Held: clarabel gave no answer.
    pub clarabel_failed: u64,
    /// Held: KKT residual of clarabel's answer above tolerance, polished or not.
    pub clarabel_uncertified: u64,
}

impl SolverCounters {
    /// The counts by name.
    pub fn by_name(&self) -> [(&'static str, u64); 12] {
        [
            ("active_set", self.active_set),
            ("clarabel_polished", self.clarabel_polished),
            ("clarabel", self.clarabel),
            ("held", self.held),
            ("fast_stopped", self.fast_stopped),
            ("fast_uncertified", self.fast_uncertified),
            ("careful_undecided", self.careful_undecided),
            ("active_set_infeasible", self.active_set_infeasible),
            ("bounds_inconsistent", self.bounds_inconsistent),
            ("clarabel_infeasible", self.clarabel_infeasible),
            ("clarabel_failed", self.clarabel_failed),
            ("clarabel_uncertified", self.clarabel_uncertified),
        ]
    }

    pub(super) fn count(&mut self, solver: SolverUsed) {
        *match solver {
            SolverUsed::ActiveSet => &mut self.active_set,
            SolverUsed::ClarabelPolished => &mut self.clarabel_polished,
            SolverUsed::Clarabel => &mut self.clarabel,
            SolverUsed::Held => &mut self.held,
        } += 1;
    }
}
