//! The force optimiser, eq. (8), and the gait LP, eq. (4), on their own.

use crate::convert::array1;
use crate::cpu_clock::ThreadClock;
use crate::errors::to_py;
use fg_core::error::Error;
use fg_core::friction::FrictionPyramid;
use fg_core::manipulation::force;
use fg_core::solver::knapsack;
use nalgebra::{DMatrix, DVector, Vector3, Vector6};
use numpy::{AllowTypeChange, PyArray1, PyArrayLikeDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// Any number of dimensions, so that a wrong one is a `ShapeError` with the field's name.
type ArrayLike<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

fn shape_error(field: &str, expected: &str, found: &[usize]) -> PyErr {
    let found: Vec<_> = found.iter().map(ToString::to_string).collect();
    let comma = if found.len() == 1 { "," } else { "" };
    to_py(Error::shape(field, expected, format!("({}{comma})", found.join(", "))))
}

fn vector(field: &str, array: &ArrayLike<'_>) -> PyResult<DVector<f64>> {
    match array.shape() {
        [n] => Ok(DVector::from_iterator(*n, array.as_array().iter().copied())),
        other => Err(shape_error(field, "(n,)", other)),
    }
}

fn matrix(field: &str, array: &ArrayLike<'_>) -> PyResult<DMatrix<f64>> {
    match array.shape() {
        [rows, columns] => Ok(DMatrix::from_row_iterator(*rows, *columns, array.as_array().iter().copied())),
        other => Err(shape_error(field, "(rows, columns)", other)),
    }
}

fn numbers<const N: usize>(field: &str, array: &ArrayLike<'_>) -> PyResult<[f64; N]> {
    let mut numbers = [0.0; N];
    if array.shape() != [N] {
        return Err(shape_error(field, &format!("({N},)"), array.shape()));
    }
    for (to, from) in numbers.iter_mut().zip(array.as_array().iter()) {
        *to = *from;
    }
    Ok(numbers)
}

/// The force optimisation QP, eq. (8), with a certificate on each answer.
///
///     min  alpha_1 |f|^2 + alpha_2 |f - f_prev|^2 + alpha_3 |Psi|^2
///     with Psi = F_des - G f, f in the friction pyramids, tau_min <= J^T f <= tau_max
///
/// Parameters
/// ----------
/// edges
///     Pyramid edges (n, 3, m) of each contact in its contact frame, z along the normal into the object; m 3 to 12.
/// alpha
///     The three weights (3,). In Psi, torques count over a length, `force.torque_length` of the configuration.
/// solver
///     "active_set", with clarabel where its answer is not certified, or "clarabel".
///
/// Raises
/// ------
/// ConfigError
///     Edges that span no pyramid, weights out of range, or an unknown solver.
/// ShapeError
///     If an array has another shape.
#[pyclass(module = "fingergait._core")]
pub struct ForceOptimizer {
    pyramids: Vec<FrictionPyramid>,
    settings: force::ForceSettings,
    core: force::ForceOptimizer,
    n_q: usize,
}

#[pymethods]
impl ForceOptimizer {
    #[new]
    #[pyo3(signature = (edges, alpha, solver = "active_set"))]
    fn new(edges: ArrayLike<'_>, alpha: ArrayLike<'_>, solver: &str) -> PyResult<Self> {
        let &[n, 3, m] = edges.shape() else {
            return Err(shape_error("edges", "(n, 3, m)", edges.shape()));
        };
        let view = edges.as_array();
        let mut pyramids = Vec::with_capacity(n);
        for contact in 0..n {
            let columns: Vec<_> =
                (0..m).map(|k| Vector3::from_fn(|i, _| view[[contact, i, k].as_slice()])).collect();
            pyramids.push(FrictionPyramid::from_edges(&columns).map_err(to_py)?);
        }
        let solver = match solver {
            "active_set" => force::SolverChoice::ActiveSet,
            "clarabel" => force::SolverChoice::Clarabel,
            other => {
                return Err(to_py(Error::config("solver", "\"active_set\" or \"clarabel\"", other)));
            }
        };
        let settings =
            force::ForceSettings { alpha: numbers("alpha", &alpha)?, solver, ..Default::default() };
        let n_q = 3 * n;
        let core = force::ForceOptimizer::new(&pyramids, n_q, settings.clone()).map_err(to_py)?;
        Ok(Self { pyramids, settings, core, n_q })
    }

    /// The best contact forces for a wrench; warm-started from the call before.
    ///
    /// Parameters
    /// ----------
    /// G
    ///     Grasp map (6, 3n): the wrench on the object at Oo in W is G f.
    /// J
    ///     Hand Jacobian (3n, n_q), with tau = J^T f.
    /// F_des
    ///     Wrench asked for, (6,), N and N m, in W.
    /// f_prev
    ///     Contact forces of the step before, (3n,), N.
    /// tau_min, tau_max
    ///     Torque limits (n_q,), N m.
    /// f_normal_max
    ///     Largest normal forces (n,), N; zero takes a finger out. Absent: no limit.
    ///
    /// Raises
    /// ------
    /// ShapeError
    ///     If an array has another shape.
    /// ConfigError
    ///     A number that is not finite, or limits that exclude zero torque.
    #[pyo3(signature = (G, J, F_des, f_prev, tau_min, tau_max, f_normal_max = None))]
    #[allow(clippy::too_many_arguments)] // the Python signature
    fn solve(
        &mut self,
        py: Python<'_>,
        G: ArrayLike<'_>,
        J: ArrayLike<'_>,
        F_des: ArrayLike<'_>,
        f_prev: ArrayLike<'_>,
        tau_min: ArrayLike<'_>,
        tau_max: ArrayLike<'_>,
        f_normal_max: Option<ArrayLike<'_>>,
    ) -> PyResult<ForceSolution> {
        let G = matrix("G", &G)?;
        let J = matrix("J", &J)?;
        let F_des = Vector6::from(numbers::<6>("F_des", &F_des)?);
        let f_prev = vector("f_prev", &f_prev)?;
        let tau_min = vector("tau_min", &tau_min)?;
        let tau_max = vector("tau_max", &tau_max)?;
        let f_normal_max = match f_normal_max {
            Some(array) => vector("f_normal_max", &array)?,
            None => DVector::from_element(self.pyramids.len(), f64::INFINITY),
        };
        if J.ncols() != self.n_q {
            // The number of joints is first known here.
            self.core = force::ForceOptimizer::new(&self.pyramids, J.ncols(), self.settings.clone())
                .map_err(to_py)?;
            self.n_q = J.ncols();
        }
        let problem = force::ForceProblem {
            G: &G,
            J: &J,
            F_des: &F_des,
            f_prev: &f_prev,
            tau_min: &tau_min,
            tau_max: &tau_max,
            f_normal_max: f_normal_max.as_slice(),
        };
        let core = &mut self.core;
        let (result, solve_ns, solve_allocations) = py.detach(|| {
            let clock = ThreadClock::start();
            let result = core.solve(&problem);
            let (ns, allocations) = (clock.elapsed_ns(), clock.allocations());
            (result.cloned(), ns, allocations)
        });
        Ok(ForceSolution { core: result.map_err(to_py)?, solve_ns, solve_allocations })
    }
}

/// Contact forces, torques and how good they are: the answer of `ForceOptimizer.solve`.
#[pyclass(module = "fingergait._core", frozen)]
pub struct ForceSolution {
    core: force::ForceSolution,
    solve_ns: u64,
    solve_allocations: u64,
}

#[pymethods]
impl ForceSolution {
    /// Contact forces (3n,), N, each in its contact frame.
    #[getter]
    fn f<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        array1(py, self.core.f.as_slice())
    }
    /// Joint torques J^T f, (n_q,), N m.
    #[getter]
    fn tau<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        array1(py, self.core.tau.as_slice())
    }
    /// Wrench (6,) that is not delivered: Psi = F_des - G f, N and N m, in W.
    #[getter]
    fn psi<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        array1(py, self.core.psi.as_slice())
    }
    /// Whether the forces are certified optimal: "solved", else "held": the last ones, made feasible.
    #[getter]
    fn status(&self) -> &'static str {
        self.core.status.as_str()
    }
    /// Who found them: "active_set", "clarabel_polished", "clarabel" or "held".
    #[getter]
    fn solver(&self) -> &'static str {
        self.core.solver.as_str()
    }
    /// Residual of the optimality (KKT) conditions, N; of held forces too, then never zero: their worst violation
    /// of a bound or their distance from a minimiser, whichever is larger.
    #[getter]
    fn kkt(&self) -> f64 {
        self.core.kkt
    }
    /// Thread CPU time of the solve, ns.
    #[getter]
    fn solve_ns(&self) -> u64 {
        self.solve_ns
    }
    /// Heap allocations of the solve.
    #[getter]
    fn solve_allocations(&self) -> u64 {
        self.solve_allocations
    }
}

/// The answer of `gait_lp`.
#[pyclass(module = "fingergait._core", frozen)]
pub struct LpSolution {
    x: Vec<f64>,
    outcome: knapsack::LpOutcome,
}

#[pymethods]
impl LpSolution {
    /// The maximiser (n,); zero where there is none.
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        array1(py, &self.x)
    }
    /// The value c . x reached.
    #[getter]
    fn value(&self) -> f64 {
        self.outcome.value
    }
    /// False where no x in the box has a . x = 0.
    #[getter]
    fn feasible(&self) -> bool {
        self.outcome.feasible
    }
}

/// The gait LP, eq. (4): max c . x subject to a . x = 0 and lower <= x <= upper, solved exactly.
///
/// In the planner x is the free finger's joint velocity, rad/s, c the quality's rate coefficients (3), and a the
/// surface's normal through the Jacobian (4c).
///
/// Parameters
/// ----------
/// c, a, lower, upper
///     Vectors (n,), all of one length.
///
/// Raises
/// ------
/// ShapeError
///     If the lengths differ.
/// ConfigError
///     A number that is not finite, or a lower bound above its upper one.
#[pyfunction]
pub fn gait_lp(
    c: ArrayLike<'_>,
    a: ArrayLike<'_>,
    lower: ArrayLike<'_>,
    upper: ArrayLike<'_>,
) -> PyResult<LpSolution> {
    let c = vector("c", &c)?;
    let a = vector("a", &a)?;
    let lower = vector("lower", &lower)?;
    let upper = vector("upper", &upper)?;
    let (c, a, lower, upper) = (c.as_slice(), a.as_slice(), lower.as_slice(), upper.as_slice());
    knapsack::check(c, a, lower, upper).map_err(to_py)?;
    let mut x = vec![0.0; c.len()];
    let outcome = knapsack::gait_lp(c, a, lower, upper, &mut x);
    Ok(LpSolution { x, outcome })
}
