//! The force optimiser, eq. (8): contact forces that realise a wrench within friction, torque and force limits.

use crate::error::Error;
use crate::friction::FrictionPyramid;
use crate::solver::active_set::{self, ActiveSet};
use crate::solver::clarabel::{self, InteriorPoint};
use crate::solver::hold::hold;
use crate::solver::kkt;
use crate::solver::null_space::NullSpaceFactors;
use crate::solver::qp::{ForceQp, Forces, MAX_CONTACTS, WIDTH};
use crate::solver::schur::SchurFactors;
use crate::solver::working_set::Equalities;
use nalgebra::{DVector, Vector6};
use serde::{Deserialize, Serialize};

mod problem;
mod solution;

use problem::validate;
pub use problem::ForceProblem;
pub use solution::{ForceSolution, ForceStatus, SolverCounters, SolverUsed};

/// Which solver is asked first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SolverChoice {
    /// The warm-started active set; clarabel where it does not certify its answer.
    #[default]
    ActiveSet,
    /// Clarabel, polished on its active set.
    Clarabel,
}

/// Parameters of eq. (8) and of its solution.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ForceSettings {
    /// alpha1, alpha2 (1/N^2) and alpha3: weights of small forces, of slow changes, of the wrench.
    pub alpha: [f64; 3],
    /// Solver asked first.
    pub solver: SolverChoice,
    /// An answer whose KKT residual is at most this, relative to its largest force ([`ForceQp::size`]), is certified. See
    /// [`kkt::Residual`].
    pub tolerance: f64,
    /// Where rounding or an interior point allow no better, an answer is still taken up to this relative KKT residual.
    pub raw_tolerance: f64,
    /// Bound on the active set's changes.
    pub max_changes: usize,
    /// Bound on clarabel's iterations.
    pub max_iterations: u32,
}

impl Default for ForceSettings {
    /// The paper's weights.
    fn default() -> Self {
        Self {
            alpha: [0.01, 0.01, 1000.0],
            solver: SolverChoice::ActiveSet,
            tolerance: 1e-8,
            raw_tolerance: 1e-6,
            max_changes: 100,
            max_iterations: 30,
        }
    }
}

/// Solves eq. (8) again and again. All memory is allocated in [`ForceOptimizer::new`]; the active set allocates nothing.
pub struct ForceOptimizer {
    settings: ForceSettings,
    qp: ForceQp,
    fast: ActiveSet<SchurFactors>,
    careful: ActiveSet<NullSpaceFactors>,
    interior_point: InteriorPoint,
    last: Forces,
    solution: ForceSolution,
    counters: SolverCounters,
}

impl ForceOptimizer {
    /// An optimiser for one contact per pyramid (1 to 6) and `n_q` joints.
    pub fn new(pyramids: &[FrictionPyramid], n_q: usize, settings: ForceSettings) -> Result<Self, Error> {
        if !(1..=MAX_CONTACTS).contains(&pyramids.len()) {
            return Err(Error::config("pyramids", format!("1 to {MAX_CONTACTS} contacts"), pyramids.len()));
        }
        let alpha = settings.alpha;
        if !alpha.iter().all(|a| a.is_finite() && *a >= 0.0) || alpha[0] + alpha[1] <= 0.0 {
            return Err(Error::config(
                "alpha",
                "three finite numbers >= 0 with alpha[0] + alpha[1] > 0",
                format!("{alpha:?}"),
            ));
        }
        for (name, value) in [("tolerance", settings.tolerance), ("raw_tolerance", settings.raw_tolerance)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::config(name, "a finite number > 0", value));
            }
        }
        let qp = ForceQp::new(pyramids, n_q, alpha);
        let n = qp.n();
        Ok(Self {
            fast: ActiveSet::new(settings.max_changes),
            careful: ActiveSet::new(settings.max_changes),
            interior_point: InteriorPoint::new(&qp, settings.max_iterations),
            qp,
            settings,
            last: [0.0; WIDTH],
            solution: ForceSolution {
                f: DVector::zeros(n),
                tau: DVector::zeros(n_q),
                psi: Vector6::zeros(),
                status: ForceStatus::Held,
                solver: SolverUsed::Held,
                kkt: 0.0,
                iterations: 0,
            },
            counters: SolverCounters::default(),
        })
    }

    /// Number of contacts.
    pub fn n_contacts(&self) -> usize {
        self.qp.n_contacts()
    }

    /// Answers taken since construction or [`ForceOptimizer::reset_counts`], and reasons.
    pub fn counts(&self) -> &SolverCounters {
        &self.counters
    }

    /// Forgets the last solution: the next solve starts cold, and holds zero forces if it fails.
    pub fn reset(&mut self) {
        self.fast.reset();
        self.last = [0.0; WIDTH];
    }

    /// Counts from zero again.
    pub fn reset_counts(&mut self) {
        self.counters = SolverCounters::default();
    }

    /// Changes the pyramid of `contact`, to one with the same number of edges. Allocates nothing.
    pub fn set_pyramid(&mut self, contact: usize, pyramid: &FrictionPyramid) -> Result<(), Error> {
        let n = self.qp.n_contacts();
        if contact >= n {
            return Err(Error::shape("contact", format!("0 to {}", n - 1), contact));
        }
        let (expected, found) = (self.qp.n_edges(contact), pyramid.facets().len());
        if found != expected {
            return Err(Error::shape("edges", expected, found));
        }
        self.qp.set_pyramid(contact, pyramid);
        Ok(())
    }

    /// The forces for `problem`. Numerical trouble and bounds that cannot be met are a status, not an error; an error (wrong
    /// shape, a number that is not finite or absurdly large) changes nothing.
    pub fn solve(&mut self, problem: &ForceProblem<'_>) -> Result<&ForceSolution, Error> {
        validate(problem, self.qp.n(), self.solution.tau.len())?;
        self.qp.set_objective(
            problem.G.as_slice(),
            problem.F_des.as_slice(),
            problem.f_prev.as_slice(),
            problem.f_normal_max,
        );
        self.qp.set_torques(problem.J.as_slice(), problem.tau_min.as_slice(), problem.tau_max.as_slice());
        if !self.certified() {
            let (f, _) = hold(&self.qp, &self.last);
            let kkt = kkt::without_multipliers(&self.qp, &f, self.settings.tolerance);
            self.take(&f, SolverUsed::Held, kkt, 0);
        }
        problem.J.tr_mul_to(&self.solution.f, &mut self.solution.tau);
        Ok(&self.solution)
    }

    /// Asks the solvers in turn; true when one's answer is certified and taken.
    fn certified(&mut self) -> bool {
        if !self.qp.consistent {
            self.counters.bounds_inconsistent += 1;
            return false;
        }
        if self.settings.solver == SolverChoice::ActiveSet {
            match run(&mut self.fast, &self.qp, &self.settings, Measure::Gradient) {
                Verdict::Certified(kkt) => {
                    let f = *self.fast.forces();
                    self.take(&f, SolverUsed::ActiveSet, kkt, self.fast.changes());
                    return true;
                }
                Verdict::Infeasible => {
                    self.counters.active_set_infeasible += 1;
                    return false;
                }
                Verdict::Stopped => self.counters.fast_stopped += 1,
                Verdict::Uncertified => self.counters.fast_uncertified += 1,
            }
            self.careful.reset();
            match self.by_careful(SolverUsed::ActiveSet, 0) {
                Verdict::Certified(_) => return true,
                Verdict::Infeasible => {
                    self.counters.active_set_infeasible += 1;
                    return false;
                }
                Verdict::Stopped | Verdict::Uncertified => self.counters.careful_undecided += 1,
            }
        }
        self.by_clarabel()
    }

    /// Runs the careful active set from where it stands; its answer starts the fast one next time.
    fn by_careful(&mut self, solver: SolverUsed, iterations: usize) -> Verdict {
        let verdict = run(&mut self.careful, &self.qp, &self.settings, Measure::Distance);
        if let Verdict::Certified(kkt) = verdict {
            let f = *self.careful.forces();
            self.take(&f, solver, kkt, iterations + self.careful.changes());
            self.fast.start_from(self.careful.multipliers());
        }
        verdict
    }

    fn by_clarabel(&mut self) -> bool {
        match self.interior_point.solve(&self.qp) {
            clarabel::Outcome::Candidate if self.polished() => return true,
            clarabel::Outcome::Candidate => self.counters.clarabel_uncertified += 1,
            clarabel::Outcome::Infeasible => self.counters.clarabel_infeasible += 1,
            clarabel::Outcome::Failed => self.counters.clarabel_failed += 1,
        }
        // Where clarabel was asked first, its "infeasible" is only a claim so far.
        self.settings.solver == SolverChoice::Clarabel && {
            self.careful.reset();
            matches!(self.by_careful(SolverUsed::ActiveSet, 0), Verdict::Certified(_))
        }
    }

    /// Makes clarabel's answer exact, or takes it as it is.
    fn polished(&mut self) -> bool {
        let iterations = self.interior_point.iterations();
        // Polish: clarabel's "solved" can be 0.2 N off, as alpha3 |psi|^2 inflates the objective against which its gap is
        // measured. Its active set is nearly right all the same, and a few changes away from exact forces.
        let pushing = self.interior_point.multipliers().iter().filter(|(_, mu, slack)| mu.abs() > *slack);
        self.careful.start_from(pushing.map(|(row, mu, _)| (*row, *mu)));
        if let Verdict::Certified(_) = self.by_careful(SolverUsed::ClarabelPolished, iterations) {
            return true;
        }
        let f = *self.interior_point.forces();
        let multipliers = self.interior_point.multipliers().iter().map(|(row, mu, _)| (*row, *mu));
        let enough = self.settings.raw_tolerance * self.qp.size(&f);
        let kkt = kkt::residual(&self.qp, &f, multipliers, enough).worst();
        if kkt <= enough {
            self.take(&f, SolverUsed::Clarabel, kkt, iterations);
            return true;
        }
        false
    }

    /// Writes the solution out.
    fn take(&mut self, f: &Forces, solver: SolverUsed, kkt: f64, iterations: usize) {
        self.counters.count(solver);
        if solver != SolverUsed::Held {
            self.last = *f;
        }
        for (i, (out, f)) in self.solution.f.iter_mut().zip(f).enumerate() {
            *out = if self.qp.pinned[i / 3] { 0.0 } else { *f };
        }
        self.solution.psi = Vector6::from(self.qp.psi(f));
        self.solution.status =
            if solver == SolverUsed::Held { ForceStatus::Held } else { ForceStatus::Solved };
        self.solution.solver = solver;
        self.solution.kkt = kkt;
        self.solution.iterations = iterations;
    }
}

/// What came of an active set.
#[derive(Debug, Clone, Copy)]
enum Verdict {
    /// Optimal, with this KKT residual in N.
    Certified(f64),
    Infeasible,
    Stopped,
    Uncertified,
}

/// How an answer's stationarity is measured, see [`kkt::Residual`].
#[derive(Debug, Clone, Copy)]
enum Measure {
    /// The gradient itself: the fast answer is taken only where nothing is in doubt.
    Gradient,
    /// How far the gradient can move the minimiser, beyond what the last digits of the problem's numbers do.
    Distance,
}

/// Relative to `raw_tolerance`: what the last digits of the problem's numbers may do to an answer that nothing can better.
const LAST_DIGITS: f64 = 100.0;

/// Newton steps spent on an answer that is not accurate enough.
const REFINEMENTS: usize = 2;

/// Runs an active set from where it stands, and checks its answer.
fn run<E: Equalities>(
    active_set: &mut ActiveSet<E>,
    qp: &ForceQp,
    settings: &ForceSettings,
    measure: Measure,
) -> Verdict {
    match active_set.solve(qp) {
        active_set::Outcome::Infeasible => return Verdict::Infeasible,
        active_set::Outcome::Stopped => return Verdict::Stopped,
        active_set::Outcome::Optimal => {}
    }
    for refinements in 0..=REFINEMENTS {
        if refinements > 0 {
            active_set.refine(qp);
        }
        let f = active_set.forces();
        let size = qp.size(f);
        let tolerance = settings.tolerance * size;
        let (enough, loose) = match measure {
            Measure::Gradient => (f64::INFINITY, settings.raw_tolerance * size),
            Measure::Distance => (tolerance, LAST_DIGITS * settings.raw_tolerance * size.max(qp.scale)),
        };
        let residual = kkt::residual(qp, f, active_set.multipliers(), enough);
        let rounding = || kkt::rounding(qp, f, active_set.multipliers());
        if residual.certifies(tolerance, loose, rounding) {
            return Verdict::Certified(residual.worst());
        }
    }
    active_set.reset();
    Verdict::Uncertified
}
