//! The force optimiser, eq. (8): contact forces that realise a wrench within friction, torque and force limits.

use crate::error::Error;
use crate::friction::FrictionPyramid;
use crate::solver::active_set::{self, ActiveSet};
use crate::solver::clarabel::{self, InteriorPoint};
use crate::solver::hold::hold;
use crate::solver::kkt;
use crate::solver::polish::polish;
use crate::solver::qp::{ForceQp, Forces, MAX_CONTACTS, WIDTH};
use nalgebra::{DMatrix, DVector, Vector6};
use serde::{Deserialize, Serialize};

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
    /// N: an answer with a KKT residual up to this is certified. See [`kkt::Residual`].
    pub tolerance: f64,
    /// N: an answer of clarabel that no polish improves is still taken up to this KKT residual.
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
            tolerance: 1e-7,
            raw_tolerance: 1e-5,
            max_changes: 100,
            max_iterations: 30,
        }
    }
}

/// Eq. (8) at one instant. Contact frames have z along the inward normal.
#[derive(Debug, Clone, Copy)]
pub struct ForceProblem<'a> {
    /// Grasp map, (6, 3n): contact forces to the wrench on the object in W at Oo.
    pub G: &'a DMatrix<f64>,
    /// (3n, n_q) with tau = J' f, m.
    pub J: &'a DMatrix<f64>,
    /// Desired wrench [force; torque], N and N m.
    pub F_des: &'a Vector6<f64>,
    /// Contact forces of the last step, (3n,), N.
    pub f_prev: &'a DVector<f64>,
    /// Lower bounds on tau, (n_q,), N m; -inf for none.
    pub tau_min: &'a DVector<f64>,
    /// Upper bounds on tau, (n_q,), N m; +inf for none.
    pub tau_max: &'a DVector<f64>,
    /// Cap on each contact's normal force, N: infinity for none; <= 0 pins the contact's whole force to zero.
    pub f_normal_max: &'a [f64],
}

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
    /// KKT residual, N, see [`kkt::Residual`]; for held forces their worst violation of a bound, N.
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
    /// Active set to clarabel: bound on changes reached or numbers broken.
    pub active_set_stopped: u64,
    /// Active set to clarabel: no forces within the bounds, it says.
    pub active_set_infeasible: u64,
    /// Active set to clarabel: KKT residual above tolerance.
    pub active_set_uncertified: u64,
    /// Held: bounds that contradict each other on their face.
    pub bounds_inconsistent: u64,
    /// Held: clarabel finds no forces within the bounds.
    pub clarabel_infeasible: u64,
    /// Held: clarabel gave no answer.
    pub clarabel_failed: u64,
    /// Held: KKT residual of clarabel's answer above tolerance, polished or not.
    pub clarabel_uncertified: u64,
}

/// Solves eq. (8) again and again. All memory is allocated in [`ForceOptimizer::new`]; the active set allocates nothing.
pub struct ForceOptimizer {
    settings: ForceSettings,
    qp: ForceQp,
    active_set: ActiveSet,
    interior_point: InteriorPoint,
    last: Forces,
    solution: ForceSolution,
    counters: SolverCounters,
}

impl ForceOptimizer {
    /// An optimiser for one contact per pyramid (1 to 5) and `n_q` joints.
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
            active_set: ActiveSet::new(settings.max_changes),
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

    /// Answers taken so far, and reasons.
    pub fn counts(&self) -> &SolverCounters {
        &self.counters
    }

    /// Forgets the last solution: the next solve starts cold, and holds zero forces if it fails.
    pub fn reset(&mut self) {
        self.active_set.reset();
        self.last = [0.0; WIDTH];
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
        if !self.by_active_set() && !self.by_clarabel() {
            let (f, violation) = hold(&self.qp, &self.last);
            let iterations = self.solution.iterations;
            self.take(&f, SolverUsed::Held, violation, iterations);
        }
        problem.J.tr_mul_to(&self.solution.f, &mut self.solution.tau);
        Ok(&self.solution)
    }

    fn by_active_set(&mut self) -> bool {
        if self.settings.solver != SolverChoice::ActiveSet || !self.qp.consistent {
            return false;
        }
        match self.active_set.solve(&self.qp) {
            active_set::Outcome::Optimal => {
                for refinements in 0.. {
                    let f = *self.active_set.forces();
                    let worst = kkt::residual(&self.qp, &f, self.active_set.multipliers()).worst();
                    if worst <= self.settings.tolerance {
                        self.certify(&f, SolverUsed::ActiveSet, worst, self.active_set.iterations());
                        return true;
                    }
                    if refinements == REFINEMENTS {
                        break;
                    }
                    self.active_set.refine(&self.qp);
                }
                self.counters.active_set_uncertified += 1;
                self.active_set.reset();
            }
            active_set::Outcome::Infeasible => self.counters.active_set_infeasible += 1,
            active_set::Outcome::Stopped => self.counters.active_set_stopped += 1,
        }
        false
    }

    fn by_clarabel(&mut self) -> bool {
        if !self.qp.consistent {
            self.counters.bounds_inconsistent += 1;
            return false;
        }
        match self.interior_point.solve(&self.qp) {
            clarabel::Outcome::Infeasible => {
                self.counters.clarabel_infeasible += 1;
                return false;
            }
            clarabel::Outcome::Failed => {
                self.counters.clarabel_failed += 1;
                return false;
            }
            clarabel::Outcome::Candidate => {}
        }
        let iterations = self.interior_point.iterations();
        let candidate = self.interior_point.multipliers();
        if let Some(polished) = polish(&self.qp, candidate, self.settings.tolerance) {
            let worst = polished.residual.worst();
            if worst <= self.settings.tolerance {
                self.active_set.start_from(polished.multipliers.iter().copied());
                self.certify(&polished.f, SolverUsed::ClarabelPolished, worst, iterations);
                return true;
            }
        }
        let f = *self.interior_point.forces();
        let worst = kkt::residual(&self.qp, &f, candidate.iter().map(|(row, mu, _)| (*row, *mu))).worst();
        if worst <= self.settings.raw_tolerance {
            self.certify(&f, SolverUsed::Clarabel, worst, iterations);
            return true;
        }
        self.counters.clarabel_uncertified += 1;
        false
    }

    fn certify(&mut self, f: &Forces, solver: SolverUsed, kkt: f64, iterations: usize) {
        self.last = *f;
        self.take(f, solver, kkt, iterations);
    }

    fn take(&mut self, f: &Forces, solver: SolverUsed, kkt: f64, iterations: usize) {
        let count = match solver {
            SolverUsed::ActiveSet => &mut self.counters.active_set,
            SolverUsed::ClarabelPolished => &mut self.counters.clarabel_polished,
            SolverUsed::Clarabel => &mut self.counters.clarabel,
            SolverUsed::Held => &mut self.counters.held,
        };
        *count += 1;
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

/// Newton steps spent on an answer of the active set that is not accurate enough.
const REFINEMENTS: usize = 2;
/// Numbers beyond this count as not finite: their products would not be.
const ABSURD: f64 = 1e60;

fn validate(problem: &ForceProblem<'_>, n: usize, n_q: usize) -> Result<(), Error> {
    shape("G", problem.G.shape(), (6, n))?;
    shape("J", problem.J.shape(), (n, n_q))?;
    length("f_prev", problem.f_prev.len(), n)?;
    length("tau_min", problem.tau_min.len(), n_q)?;
    length("tau_max", problem.tau_max.len(), n_q)?;
    length("f_normal_max", problem.f_normal_max.len(), n / 3)?;
    numbers("G", problem.G.as_slice(), "a finite number", |x| x.abs() < ABSURD)?;
    numbers("J", problem.J.as_slice(), "a finite number", |x| x.abs() < ABSURD)?;
    numbers("F_des", problem.F_des.as_slice(), "a finite number", |x| x.abs() < ABSURD)?;
    numbers("f_prev", problem.f_prev.as_slice(), "a finite number", |x| x.abs() < ABSURD)?;
    numbers("tau_min", problem.tau_min.as_slice(), "a finite number or -inf", |x| x < ABSURD)?;
    numbers("tau_max", problem.tau_max.as_slice(), "a finite number or +inf", |x| x > -ABSURD)?;
    numbers("f_normal_max", problem.f_normal_max, "a number or +inf", |x| !x.is_nan())
}

fn shape(field: &str, found: (usize, usize), expected: (usize, usize)) -> Result<(), Error> {
    if found == expected {
        return Ok(());
    }
    Err(Error::shape(field, format!("{expected:?}"), format!("{found:?}")))
}

fn length(field: &str, found: usize, expected: usize) -> Result<(), Error> {
    if found == expected {
        return Ok(());
    }
    Err(Error::shape(field, format!("({expected},)"), format!("({found},)")))
}

fn numbers(field: &str, values: &[f64], expected: &str, accepted: impl Fn(f64) -> bool) -> Result<(), Error> {
    match values.iter().position(|x| !accepted(*x)) {
        None => Ok(()),
        Some(i) => Err(Error::config(format!("{field}[{i}]"), expected, values[i])),
    }
}
