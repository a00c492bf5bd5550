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
use fg_core::signals::{Measurement as CoreMeasurement, Reference as CoreReference, Tactile};
use nalgebra::{DVector, Vector3, Vector6};
use numpy::{
    AllowTypeChange, PyArray1, PyArrayDyn, PyArrayLike1, PyArrayLike2, PyArrayLikeDyn, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// What the sensors say at one instant: no velocity, no mass, no mesh.
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

/// Desired object pose (7,) in W, with the desired twist (6,) [linear; angular] in W, zero by default.
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
    /// Desired joint torques, N m: (n_fingers, n_joints) where all fingers have as many joints, else (n_q,).
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

/// What the step decided and why.
#[pyclass(frozen, module = "fingergait._core")]
pub struct Diagnostics {
    core: CoreDiagnostics,
    step_ns: u64,
    step_allocations: u64,
}

#[pymethods]
impl Diagnostics {
    /// "hold" or "gait".
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

    /// Index of the finger whose gait is under way.
    #[getter]
    fn free_finger(&self) -> Option<usize> {
        self.core.free_finger
    }

    /// Whether the force optimum is certified: "solved" or "held".
    #[getter]
    fn status(&self) -> &'static str {
        self.core.status.as_str()
    }

    /// Who solved the force QP.
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

    /// How the hand was driven: "normal", "hold", "squeeze", "damp" or "stop".
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

    /// Grasp quality Q, eq. (1).
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

    /// Every figure of this step as one row, for a log. Deterministic: holds no time measurement.
    fn row<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let mut row = Vec::with_capacity(128);
        self.core.row(&mut row);
        array1(py, &row)
    }
}

/// The whole control step: grasp quality, gait planner, robust controller, force optimiser.
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

    /// The configuration in use.
    #[getter]
    fn config<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        config_dict(py, self.0.config())
    }

    /// The torques to track until the next step, and what was decided.
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

/// The default `Config`: the paper's parameter list.
#[pyfunction]
pub fn default_config(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    config_dict(py, &Config::default())
}

fn config_dict<'py>(py: Python<'py>, config: &Config) -> PyResult<Bound<'py, PyDict>> {
    let json =
        serde_json::to_string(config).map_err(|e| to_py(Error::config("config", "a configuration", e)))?;
    Ok(py.import("json")?.call_method1("loads", (json,))?.cast_into::<PyDict>()?)
}
