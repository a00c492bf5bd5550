//! `HandModel`.

use crate::convert::{array2, flat, point};
use crate::errors::to_py;
use fg_core::hand::{HandModel as Core, HandState};
use numpy::{AllowTypeChange, PyArray2, PyArrayLike1, PyArrayLike2};
use pyo3::prelude::*;

/// Kinematics and weight of a hand, from its JSON text.
///
/// Any number of fingers with the same number of joints each, fixed in W. The text's format is in ARCHITECTURE.md
/// ("Hand model"); `fingergait.hand_json` makes it from an MJCF.
///
/// Parameters
/// ----------
/// spec
///     JSON text; lengths in m, masses in kg, angles in rad, quaternions wxyz.
///
/// Raises
/// ------
/// ConfigError
///     A field that is missing, unknown, not finite or out of range; names it.
#[pyclass(frozen, module = "fingergait._core")]
pub struct HandModel(pub Core);

impl HandModel {
    fn state(&self, q: &PyArrayLike2<'_, f64, AllowTypeChange>) -> PyResult<HandState> {
        let q = flat("q", q, (self.0.n_fingers(), self.0.n_joints()))?;
        let mut state = HandState::new(&self.0);
        state.update(&self.0, &q);
        Ok(state)
    }
}

#[pymethods]
impl HandModel {
    #[new]
    fn new(spec: &str) -> PyResult<Self> {
        Core::from_json(spec).map(Self).map_err(to_py)
    }

    /// Number of fingers.
    #[getter]
    fn n_fingers(&self) -> usize {
        self.0.n_fingers()
    }

    /// Number of joints of one finger.
    #[getter]
    fn n_joints(&self) -> usize {
        self.0.n_joints()
    }

    /// Centres of the fingertips in W, (n_fingers, 3), m, at joint angles q (n_fingers, n_joints), rad.
    ///
    /// Raises
    /// ------
    /// ShapeError
    ///     If q has another shape.
    fn tip_positions<'py>(
        &self,
        py: Python<'py>,
        q: PyArrayLike2<'py, f64, AllowTypeChange>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let state = self.state(&q)?;
        let n = self.0.n_fingers();
        Ok(array2(py, (n, 3), |j, r| state.tip(j).translation.vector[r]))
    }

    /// Velocity Jacobian in W of a point of a finger's last link, (3, n_joints), m/rad: v = J qd.
    ///
    /// Parameters
    /// ----------
    /// q
    ///     Joint angles (n_fingers, n_joints), rad.
    /// finger
    ///     Index of the finger.
    /// point
    ///     Where the point is now, (3,) in W, m.
    ///
    /// Raises
    /// ------
    /// ConfigError
    ///     If there is no such finger.
    /// ShapeError
    ///     If q or point has another shape.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        q: PyArrayLike2<'py, f64, AllowTypeChange>,
        finger: usize,
        point: PyArrayLike1<'py, f64, AllowTypeChange>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (state, p_W) = (self.state(&q)?, self::point("point", &point)?);
        if finger >= self.0.n_fingers() {
            let expected = format!("0 to {}", self.0.n_fingers() - 1);
            return Err(to_py(fg_core::error::Error::config("finger", expected, finger)));
        }
        let J = state.jacobian(finger, &p_W);
        Ok(array2(py, (3, self.0.n_joints()), |r, c| J[(r, c)]))
    }

    /// Torques, N m, that hold the fingers' own weight at joint angles q, rad; both (n_fingers, n_joints).
    ///
    /// Raises
    /// ------
    /// ShapeError
    ///     If q has another shape.
    fn gravity_torque<'py>(
        &self,
        py: Python<'py>,
        q: PyArrayLike2<'py, f64, AllowTypeChange>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (state, n_joints) = (self.state(&q)?, self.0.n_joints());
        let mut tau = vec![0.0; self.0.n_fingers() * n_joints];
        state.gravity_torque(&self.0, &mut tau);
        Ok(array2(py, (self.0.n_fingers(), n_joints), |j, i| tau[j * n_joints + i]))
    }
}
