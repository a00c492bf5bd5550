//! `DualStagePlanner` with its signals.

use crate::controller::Controller;
use crate::convert::{array1, flat, joint_array, pose, sensed_pose, tuple, vector};
use crate::cpu_clock::ThreadClock;
use crate::errors::to_py;
use crate::hand::HandModel;
use fg_core::config::Config;
use fg_core::diagnostics::Diagnostics as CoreDiagnostics;
use fg_core::dual_stage::DualStagePlanner as Core;
use fg_core::error::Error;
use fg_core::hand::HandModel as CoreHand;
use fg_core::regrasp::phase::Phase as RegraspPhase;
use fg_core::signals::{Measurement as CoreMeasurement, Reference as CoreReference, Tactile};
use nalgebra::{DVector, Vector3, Vector6};
use numpy::{
    AllowTypeChange, PyArray1, PyArrayDyn, PyArrayLike1, PyArrayLike2, PyArrayLikeDyn, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// What the sensors say at one instant. No velocity, mass, friction or mesh: there is no field for them.
///
/// Parameters
/// ----------
/// t
///     Time, s.
/// q, tau
///     Joint angles, rad, and measured joint torques, N m, each (n_fingers, n_joints) where all fingers have as many
///     joints, or (n_q,).
/// pose
///     Pose (7,) of the object O in W: position, m, and quaternion wxyz. NaN says that none was seen.
/// contact_place
///     Where each tip is touched, (n_fingers, 3), m, in its fingertip frame F; anything where it is not.
/// contact_force
///     Force along each tip's normal, (n_fingers,), N; zero without contact.
///
/// Raises
/// ------
/// ShapeError
///     Arrays whose shapes do not fit each other. Numbers that are not finite are no error: the step judges them.
#[pyclass(frozen, module = "fingergait._core")]
pub struct Measurement(CoreMeasurement);

#[pymethods]
impl Measurement {
    #[new]
    fn new(
        t: f64,
        q: PyArrayLikeDyn<'_, f64, AllowTypeChange>,
        tau: PyArrayLikeDyn<'_, f64, AllowTypeChange>,
        pose: PyArrayLike1<'_, f64, AllowTypeChange>,
        contact_place: PyArrayLike2<'_, f64, AllowTypeChange>,
        contact_force: PyArrayLike1<'_, f64, AllowTypeChange>,
    ) -> PyResult<Self> {
        // A flat q does not tell the number of fingers.
        let n = match q.shape() {
            [n, _] => *n,
            [_] => contact_force.shape()[0],
            other => {
                return Err(to_py(Error::shape("q", "(n_fingers, n_joints) or (n_q,)", tuple(other))));
            }
        };
        if tau.shape() != q.shape() {
            return Err(to_py(Error::shape("tau", tuple(q.shape()), tuple(tau.shape()))));
        }
        let place = flat("contact_place", &contact_place, (n, 3))?;
        let force = vector("contact_force", &contact_force, n)?;
        let tactile = place.chunks_exact(3).zip(force);
        Ok(Self(CoreMeasurement {
            t,
            q: DVector::from_iterator(q.len(), q.as_array().iter().copied()),
            tau: DVector::from_iterator(tau.len(), tau.as_array().iter().copied()),
            X_WO: sensed_pose("pose", &pose)?,
            tactile: tactile.map(|(p, f_n)| Tactile { p_FC: Vector3::new(p[0], p[1], p[2]), f_n }).collect(),
        }))
    }
}

/// The desired motion of the object at one instant.
///
/// Parameters
/// ----------
/// pose
///     Desired pose (7,) of the object in W: position, m, and quaternion wxyz.
/// twist
///     Desired twist (6,), [linear; angular] in W, m/s and rad/s; zero where it is absent.
///
/// Raises
/// ------
/// ShapeError
///     If an array has another length.
/// ConfigError
///     If the quaternion is far from a unit one.
#[pyclass(frozen, module = "fingergait._core")]
pub struct Reference(CoreReference);

#[pymethods]
impl Reference {
    #[new]
    #[pyo3(signature = (pose, twist=None))]
    fn new(
        pose: PyArrayLike1<'_, f64, AllowTypeChange>,
        twist: Option<PyArrayLike1<'_, f64, AllowTypeChange>>,
    ) -> PyResult<Self> {
        let V_WD = match twist {
            Some(twist) => Vector6::from_vec(vector("twist", &twist, 6)?),
            None => Vector6::zeros(),
        };
        Ok(Self(CoreReference { X_WD: self::pose("pose", &pose)?, V_WD }))
    }
}

/// The joint torques to track until the next step.
#[pyclass(frozen, module = "fingergait._core")]
pub struct Command {
    tau: DVector<f64>,
    counts: Vec<usize>,
}

#[pymethods]
impl Command {
    /// Desired joint torques, N m: (n_fingers, n_joints) where all fingers have as many joints, else (n_q,). Finite
    /// and within the limits, whatever was measured.
    #[getter]
    fn tau<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        joint_array(py, &self.counts, self.tau.as_slice())
    }
}

/// Number of joints of all fingers, or of each.
#[derive(FromPyObject)]
enum Counts {
    All(usize),
    Each(Vec<usize>),
}

/// What a control step decided, and why.
///
/// `row` and `columns` have all figures; the properties are those that programs ask for most.
#[pyclass(frozen, module = "fingergait._core")]
pub struct Diagnostics {
    core: CoreDiagnostics,
    step_ns: u64,
    step_allocations: u64,
}

#[pymethods]
impl Diagnostics {
    /// "gait" while a finger is on its way, else "hold".
    #[getter]
    fn mode(&self) -> &'static str {
        if self.core.free_finger.is_some() {
            "gait"
        } else {
            "hold"
        }
    }

    /// Phase of the gait: "hold", "unload", "slide", "press" or "load".
    #[getter]
    fn phase(&self) -> &'static str {
        self.core.phase.as_str()
    }

    /// Phase of regrasping: "idle" until it begins, then "turn", "brake", "lower", and so on.
    #[getter]
    fn regrasp(&self) -> &'static str {
        self.core.regrasp.as_str()
    }

    /// Names of the phases of regrasping: that of number k is k in the column `regrasp` of a log.
    #[staticmethod]
    fn regrasp_phase_names() -> Vec<&'static str> {
        RegraspPhase::ALL.iter().map(|phase| phase.as_str()).collect()
    }

    /// Pose (7,) in W that the object is to have now: what is asked, less what was missed while it lay.
    #[getter]
    fn governed<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let (p, q) = (self.core.governed.X_WD.translation.vector, self.core.governed.X_WD.rotation.coords);
        array1(py, &[p.x, p.y, p.z, q.w, q.x, q.y, q.z])
    }

    /// Index of the finger whose gait is under way; None while all hold.
    #[getter]
    fn free_finger(&self) -> Option<usize> {
        self.core.free_finger
    }

    /// Whether the contact forces, eq. (8), are certified optimal: "solved", else "held".
    #[getter]
    fn status(&self) -> &'static str {
        self.core.status.as_str()
    }

    /// Who found the contact forces: "active_set", "clarabel_polished", "clarabel" or "held".
    #[getter]
    fn solver(&self) -> &'static str {
        self.core.solver.as_str()
    }

    /// Answers of each solver since the start, and how often and why one passed the QP on to the next.
    #[getter]
    fn solver_counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counts = PyDict::new(py);
        for (name, count) in self.core.solver_counts.by_name() {
            counts.set_item(name, count)?;
        }
        Ok(counts)
    }

    /// How the hand was driven: "normal", "hold", "squeeze", "damp" or "stop", see docs/safety.md.
    #[getter]
    fn safe_mode(&self) -> &'static str {
        self.core.safe_mode.as_str()
    }

    /// What was wrong with this step, by name; empty when all was well.
    #[getter]
    fn faults(&self) -> Vec<&'static str> {
        self.core.faults.iter().map(fg_core::safety::Fault::as_str).collect()
    }

    /// Names of all faults: that of number k is bit k of the column `faults` of a log.
    #[staticmethod]
    fn fault_names() -> Vec<&'static str> {
        fg_core::safety::Fault::ALL.iter().map(|fault| fault.as_str()).collect()
    }

    /// Names of all modes, from the mildest on: that of number k is k in the column `safe_mode` of a log.
    #[staticmethod]
    fn safe_mode_names() -> Vec<&'static str> {
        fg_core::safety::SafeMode::ALL.iter().map(|mode| mode.as_str()).collect()
    }

    /// Grasp quality Q, eq. (1), dimensionless.
    #[getter]
    fn quality(&self) -> f64 {
        self.core.quality.Q
    }

    /// Thread CPU time of this control step inside the compiled core, ns.
    #[getter]
    fn step_ns(&self) -> u64 {
        self.step_ns
    }

    /// Heap allocations of this control step inside the compiled core.
    #[getter]
    fn step_allocations(&self) -> u64 {
        self.step_allocations
    }

    /// Names of the numbers that `row` gives, in order. `n_joints` is that of each finger, or one number for all.
    #[staticmethod]
    fn columns(n_fingers: usize, n_joints: Counts) -> PyResult<Vec<String>> {
        let counts = match n_joints {
            Counts::All(n_joints) => vec![n_joints; n_fingers.min(CoreHand::MAX_FINGERS)],
            Counts::Each(counts) => counts,
        };
        let (most, each) = (CoreHand::MAX_FINGERS, CoreHand::MAX_JOINTS);
        if counts.len() != n_fingers || counts.is_empty() {
            let expected = format!("a number for each of the fingers, 1 to {most}");
            return Err(to_py(Error::config("n_joints", expected, format!("{}", counts.len()))));
        }
        if counts.len() > most || counts.iter().any(|count| *count > each) {
            let expected = format!("up to {each} joints of up to {most} fingers");
            return Err(to_py(Error::config("n_joints", expected, format!("{counts:?}"))));
        }
        Ok(CoreDiagnostics::columns(&counts))
    }

    /// Every figure of this step as one row, for a log: SI units. Deterministic, holds no time measurement.
    fn row<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let mut row = Vec::with_capacity(128);
        self.core.row(&mut row);
        array1(py, &row)
    }
}

/// The whole control step, Section II: grasp quality, gait planner, robust controller, force optimiser.
///
/// Parameters
/// ----------
/// hand
///     The hand.
/// controller
///     K, for the configured control rate.
/// config
///     JSON text of a `Config`; fields that are absent keep their defaults, see `default_config`.
///
/// Raises
/// ------
/// ConfigError
///     A field that is unknown or out of range; names it, what was expected and what was found.
/// ArtifactError
///     A controller for another control rate.
#[pyclass(module = "fingergait._core")]
pub struct DualStagePlanner(Core);

#[pymethods]
impl DualStagePlanner {
    #[new]
    #[pyo3(signature = (hand, controller, config=None))]
    fn new(hand: &HandModel, controller: &Controller, config: Option<&str>) -> PyResult<Self> {
        let config = config.map_or_else(|| Ok(Config::default()), Config::from_json).map_err(to_py)?;
        Core::new(hand.0.clone(), controller.0.clone(), config).map(Self).map_err(to_py)
    }

    /// The configuration in use, with every default filled in.
    #[getter]
    fn config<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        config_dict(py, self.0.config())
    }

    /// The torques to track until the next step, and what was decided.
    ///
    /// Call it once a control period. It allocates nothing on its fast path and releases the GIL. Faults of sensors,
    /// clock and solvers are no errors: they are in the diagnostics, and the command is safe.
    ///
    /// Raises
    /// ------
    /// ShapeError
    ///     If the measurement is of another hand; nothing has changed then.
    fn step(
        &mut self,
        py: Python<'_>,
        measurement: &Measurement,
        reference: &Reference,
    ) -> PyResult<(Command, Diagnostics)> {
        let planner = &mut self.0;
        let (outcome, step_ns, step_allocations) = py.detach(|| {
            let clock = ThreadClock::start();
            let outcome = planner.step(&measurement.0, &reference.0);
            let (ns, allocations) = (clock.elapsed_ns(), clock.allocations());
            (outcome.cloned(), ns, allocations)
        });
        let command = outcome.map_err(to_py)?;
        let counts = self.0.hand().counts();
        let diagnostics = Diagnostics { core: self.0.diagnostics().clone(), step_ns, step_allocations };
        Ok((Command { tau: command.tau, counts }, diagnostics))
    }

    /// Returns to the state after construction.
    fn reset(&mut self) {
        self.0.reset();
    }
}

/// The default `Config`: the paper's parameters, Section V-B; each departure is documented in `fg_core::config`.
///
/// A dictionary of plain values; changed and passed through `json.dumps`, it is the `config` of a `DualStagePlanner`.
#[pyfunction]
pub fn default_config(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    config_dict(py, &Config::default())
}

fn config_dict<'py>(py: Python<'py>, config: &Config) -> PyResult<Bound<'py, PyDict>> {
    let json =
        serde_json::to_string(config).map_err(|e| to_py(Error::config("config", "a configuration", e)))?;
    Ok(py.import("json")?.call_method1("loads", (json,))?.cast_into::<PyDict>()?)
}
