//! `TorquePid`.

use crate::convert::like;
use crate::errors::to_py;
use fg_core::config::Config;
use fg_core::torque::TorquePid as Core;
use numpy::{AllowTypeChange, PyArrayDyn, PyArrayLikeDyn};
use pyo3::prelude::*;

/// Joint torque tracking at the faster torque rate, Section II: PI with feedforward, rate limit and anti-windup.
///
/// Parameters
/// ----------
/// n_joints_total
///     Joints of the whole hand.
/// dt
///     Period of the torque loop, s.
/// config
///     JSON text of a `Config`, of which `torque` and `force` count; absent: the defaults.
///
/// Raises
/// ------
/// ConfigError
///     A field that is unknown or out of range.
#[pyclass(module = "fingergait._core")]
pub struct TorquePid {
    core: Core,
    motor: Vec<f64>,
}

#[pymethods]
impl TorquePid {
    #[new]
    #[pyo3(signature = (n_joints_total, dt, config=None))]
    fn new(n_joints_total: usize, dt: f64, config: Option<&str>) -> PyResult<Self> {
        let config = config.map_or_else(|| Ok(Config::default()), Config::from_json).map_err(to_py)?;
        let core = Core::new(n_joints_total, dt, &config.torque, &config.force).map_err(to_py)?;
        Ok(Self { core, motor: vec![0.0; n_joints_total] })
    }

    /// Motor torques, N m, that drive the measured torques `tau` to `tau_des`; all three of the same shape.
    ///
    /// Raises
    /// ------
    /// ShapeError
    ///     If an array has another number of joints.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        tau_des: PyArrayLikeDyn<'py, f64, AllowTypeChange>,
        tau: PyArrayLikeDyn<'py, f64, AllowTypeChange>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let wanted: Vec<f64> = tau_des.as_array().iter().copied().collect();
        let measured: Vec<f64> = tau.as_array().iter().copied().collect();
        self.core.step(&wanted, &measured, &mut self.motor).map_err(to_py)?;
        Ok(like(py, &tau_des, &self.motor))
    }

    /// Forgets the past.
    fn reset(&mut self) {
        self.core.reset();
    }
}
