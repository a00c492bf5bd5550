//! `TorquePid`.

use crate::convert::{like, tuple};
use crate::errors::to_py;
use fg_core::config::Config;
use fg_core::error::Error;
use fg_core::hand::TorqueLimits;
use fg_core::torque::TorquePid as Core;
use numpy::{AllowTypeChange, PyArrayDyn, PyArrayLikeDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// Joint torque tracking at the faster torque rate, Section II: PID with feedforward and anti-windup.
///
/// Parameters
/// ----------
/// n_joints_total
///     Joints of the whole hand.
/// dt
///     Period of the torque loop, s.
/// config
///     JSON text of a `Config`, of which `torque` and `force` count; absent: the defaults, and for joints without
///     limits the 0.5 N m of the paper's hand.
/// tau_min, tau_max
///     Torque limits (n_joints_total,) in any shape, N m, neither beyond `force.tau_max` of `config`, which is the
///     limit where they are absent.
///
/// Raises
/// ------
/// ConfigError
///     A field that is unknown or out of range, or a joint without limits.
/// ShapeError
///     If the limits are of another number of joints.
#[pyclass(module = "fingergait._core")]
pub struct TorquePid {
    core: Core,
    motor: Vec<f64>,
}

#[pymethods]
impl TorquePid {
    #[new]
    #[pyo3(signature = (n_joints_total, dt, config=None, tau_min=None, tau_max=None))]
    fn new(
        n_joints_total: usize,
        dt: f64,
        config: Option<&str>,
        tau_min: Option<PyArrayLikeDyn<'_, f64, AllowTypeChange>>,
        tau_max: Option<PyArrayLikeDyn<'_, f64, AllowTypeChange>>,
    ) -> PyResult<Self> {
        let config = match config {
            Some(config) => Config::from_json(config).map_err(to_py)?,
            None => paper(tau_min.is_none() || tau_max.is_none()),
        };
        let cap = config.force.tau_max;
        let min = limits("tau_min", tau_min, n_joints_total, cap.map(|cap| -cap))?;
        let max = limits("tau_max", tau_max, n_joints_total, cap)?;
        let limits = TorqueLimits::new(&min, &max, cap).map_err(to_py)?;
        let core = Core::new(limits, dt, &config.torque).map_err(to_py)?;
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

/// The default configuration, with the torque limit of the paper's hand where no other is given.
fn paper(limited: bool) -> Config {
    let mut config = Config::default();
    config.force.tau_max = limited.then_some(0.5);
    config
}

/// The limits given for `n` joints, in any shape, or `default` for each.
fn limits(
    field: &str,
    given: Option<PyArrayLikeDyn<'_, f64, AllowTypeChange>>,
    n: usize,
    default: Option<f64>,
) -> PyResult<Vec<f64>> {
    let Some(given) = given else {
        let missing =
            || Error::config(field, "a torque for each joint, or force.tau_max in config", "neither");
        return Ok(vec![default.ok_or_else(missing).map_err(to_py)?; n]);
    };
    if given.len() != n {
        let found = tuple(given.shape());
        return Err(to_py(Error::shape(field, format!("{n} torques"), found)));
    }
    Ok(given.as_array().iter().copied().collect())
}
