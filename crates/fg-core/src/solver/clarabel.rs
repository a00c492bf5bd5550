//! The interior-point solver clarabel on the force QP: the second opinion, and the whole solver where it is chosen.
//!
//! Variables are (f, psi), which keeps the problem sparse and its conditioning out of the Hessian. The sparsity pattern is
//! fixed at construction with explicit zeros, and only values are updated. Equilibration is computed once from typical
//! numbers, never from a problem, so that an answer does not depend on which problem came first.

use super::qp::{ForceQp, Forces, WIDTH};
use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT::{NonnegativeConeT, ZeroConeT};
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus};

/// What clarabel said. It is a candidate only: [`super::kkt`] judges it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// An answer, perhaps of reduced accuracy.
    Candidate,
    /// No forces satisfy the bounds.
    Infeasible,
    /// No answer.
    Failed,
}

/// Memory and solver object for one [`ForceQp`] layout.
pub struct InteriorPoint {
    max_iterations: u32,
    pattern: Pattern,
    values: Vec<f64>,
    q: Vec<f64>,
    b: Vec<f64>,
    solver: Option<DefaultSolver<f64>>,
    /// N: what clarabel's numbers are in.
    unit: f64,
    forces: Forces,
    multipliers: Vec<(usize, f64, f64)>,
    iterations: usize,
}

/// Column by column, which entry of the QP each stored value is.
struct Pattern {
    colptr: Vec<usize>,
    rowval: Vec<usize>,
    source: Vec<Source>,
    n: usize,
    /// (row of the QP, +1 lower / -1 upper) of each inequality of clarabel, in order.
    bounds: Vec<(usize, f64)>,
}

#[derive(Clone, Copy)]
enum Source {
    Grasp { row: usize, column: usize },
    Slack,
    Bound { bound: usize, column: usize },
}

impl Pattern {
    fn new(qp: &ForceQp) -> Self {
        let n = qp.n();
        let torque_at = qp.torque_at();
        let cap_at = torque_at - qp.n_contacts();
        let mut bounds: Vec<_> = (0..cap_at).map(|i| (i, 1.0)).collect();
        bounds.extend((cap_at..qp.rows.len()).map(|i| (i, -1.0)));
        bounds.extend((torque_at..qp.rows.len()).map(|i| (i, 1.0)));
        let mut pattern = Self { colptr: vec![0], rowval: vec![], source: vec![], n, bounds };
        for column in 0..n {
            for row in 0..6 {
                pattern.rowval.push(row);
                pattern.source.push(Source::Grasp { row, column });
            }
            for (bound, (row, _)) in pattern.bounds.iter().enumerate() {
                if *row >= torque_at || qp.rows[*row].contact == column / 3 {
                    pattern.rowval.push(6 + bound);
                    pattern.source.push(Source::Bound { bound, column });
                }
            }
            pattern.colptr.push(pattern.rowval.len());
        }
        for row in 0..6 {
            pattern.rowval.push(row);
            pattern.source.push(Source::Slack);
            pattern.colptr.push(pattern.rowval.len());
        }
        pattern
    }
}

impl InteriorPoint {
    /// Room for problems laid out as `qp`.
    pub fn new(qp: &ForceQp, max_iterations: u32) -> Self {
        let pattern = Pattern::new(qp);
        let mut this = Self {
            max_iterations,
            values: vec![0.0; pattern.rowval.len()],
            q: vec![0.0; pattern.n + 6],
            b: vec![0.0; 6 + pattern.bounds.len()],
            solver: None,
            unit: 1.0,
            forces: [0.0; WIDTH],
            multipliers: Vec::with_capacity(pattern.bounds.len()),
            iterations: 0,
            pattern,
        };
        this.solver = this.build(qp);
        this
    }

    /// Solves `qp`. A solver object that failed is replaced: after bad numbers it gives bad numbers for good.
    pub fn solve(&mut self, qp: &ForceQp) -> Outcome {
        self.fill(qp);
        if self.solver.is_none() {
            self.solver = self.build(qp);
        }
        let outcome = self.run();
        if outcome == Outcome::Failed {
            self.solver = self.build(qp);
        }
        outcome
    }

    /// Candidate forces, N.
    pub fn forces(&self) -> &Forces {
        &self.forces
    }

    /// Candidate (row, multiplier in N, slack in N) of every bound with a positive multiplier; the sign names the bound.
    pub fn multipliers(&self) -> &[(usize, f64, f64)] {
        &self.multipliers
    }

    /// Iterations of the last solve.
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    fn run(&mut self) -> Outcome {
        let Some(solver) = self.solver.as_mut() else { return Outcome::Failed };
        let updated = solver.update_q(&self.q).is_ok()
            && solver.update_A(&self.values).is_ok()
            && solver.update_b(&self.b).is_ok();
        if !updated {
            return Outcome::Failed;
        }
        solver.solve();
        let solution = &solver.solution;
        self.iterations = solution.iterations as usize;
        let finite = solution.x.iter().chain(&solution.z).all(|x| x.is_finite());
        match solution.status {
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
                return Outcome::Infeasible
            }
            SolverStatus::NumericalError | SolverStatus::Unsolved => return Outcome::Failed,
            _ if !finite => return Outcome::Failed,
            _ => {}
        }
        for (f, x) in self.forces.iter_mut().zip(&solution.x[..self.pattern.n]) {
            *f = self.unit * x;
        }
        self.multipliers.clear();
        for (k, (row, sign)) in self.pattern.bounds.iter().enumerate() {
            let (z, slack) = (self.unit * solution.z[6 + k], self.unit * solution.s[6 + k]);
            if z > 0.0 {
                self.multipliers.push((*row, sign * z, slack));
            }
        }
        Outcome::Candidate
    }

    /// Values of A, q and b for `qp`, with forces in units of the problem's scale, as clarabel's tolerances are absolute,
    /// and the objective divided by s so that multipliers are forces.
    fn fill(&mut self, qp: &ForceQp) {
        self.unit = if qp.scale > 0.0 { qp.scale } else { 1.0 };
        for (q, prior) in self.q.iter_mut().zip(&qp.prior[..self.pattern.n]) {
            *q = -prior / self.unit;
        }
        for (b, F) in self.b.iter_mut().zip(&qp.F_des) {
            *b = F / self.unit;
        }
        for (b, (index, sign)) in self.b[6..].iter_mut().zip(&self.pattern.bounds) {
            let row = &qp.rows[*index];
            let bound = if *sign > 0.0 { row.lower } else { row.upper };
            // A row without a bound becomes 0 <= 1.
            *b = if bound.is_finite() { -sign * bound / self.unit } else { 1.0 };
        }
        for (value, source) in self.values.iter_mut().zip(&self.pattern.source) {
            *value = match *source {
                Source::Grasp { row, column } => qp.G[row][column],
                Source::Slack => 1.0,
                Source::Bound { bound, column } => {
                    let (index, sign) = self.pattern.bounds[bound];
                    let row = &qp.rows[index];
                    let finite = if sign > 0.0 { row.lower } else { row.upper }.is_finite();
                    if finite {
                        -sign * qp.coefficient(row, column)
                    } else {
                        0.0
                    }
                }
            };
        }
    }

    /// A solver object with typical numbers: unit rows, a grasp map with the object's size in its lower half.
    fn build(&self, qp: &ForceQp) -> Option<DefaultSolver<f64>> {
        let n = self.pattern.n;
        let typical: Vec<_> = self
            .pattern
            .source
            .iter()
            .map(|source| match source {
                Source::Grasp { row, .. } if *row < 3 => 0.5,
                Source::Grasp { .. } => 0.02,
                Source::Slack => 1.0,
                Source::Bound { .. } => 0.5,
            })
            .collect();
        let mut p = vec![1.0; n];
        p.extend([qp.alpha3 / qp.s; 6]);
        let P = CscMatrix::new(n + 6, n + 6, (0..=n + 6).collect(), (0..n + 6).collect(), p);
        let A = CscMatrix::new(
            self.b.len(),
            n + 6,
            self.pattern.colptr.clone(),
            self.pattern.rowval.clone(),
            typical,
        );
        let cones = [ZeroConeT(6), NonnegativeConeT(self.pattern.bounds.len())];
        let settings = DefaultSettings {
            verbose: false,
            max_iter: self.max_iterations,
            presolve_enable: false,
            input_sparse_dropzeros: false,
            max_threads: 1,
            direct_solve_method: "qdldl".into(),
            ..DefaultSettings::default()
        };
        DefaultSolver::new(&P, &vec![0.0; n + 6], &A, &vec![1.0; self.b.len()], &cones, settings).ok()
    }
}
