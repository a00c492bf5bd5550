//! `HandModel`.

use crate::convert::{array1, array2, joint_array, joint_values, point};
use crate::errors::to_py;
use fg_core::error::Error;
use fg_core::hand::{Coordinate, HandModel as Core, HandState};
use numpy::{AllowTypeChange, PyArray1, PyArray2, PyArrayDyn, PyArrayLike1, PyArrayLikeDyn};
use pyo3::prelude::*;
use pyo3::types::PySlice;

/// Kinematics and weight of a hand, from its JSON text.
///
/// Two to six fingers of one to seven independent joints each, fixed in W. The text's format is in ARCHITECTURE.md
/// ("Hand model"); `fingergait.hand_json` makes it from an MJCF or URDF.
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
    fn state(&self, q: &PyArrayLikeDyn<'_, f64, AllowTypeChange>) -> PyResult<HandState> {
        let q = joint_values("q", q, &self.0.counts())?;
        let mut state = HandState::new(&self.0);
        state.update(&self.0, &q);
        Ok(state)
    }

    /// A figure of every independent joint.
    fn each<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&Coordinate) -> f64,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let values: Vec<_> = self.0.coordinates().iter().map(of).collect();
        joint_array(py, &self.0.counts(), &values)
    }

    fn check(&self, finger: usize) -> PyResult<()> {
        let n = self.0.n_fingers();
        if finger < n {
            return Ok(());
        }
        Err(to_py(Error::config("finger", format!("0 to {}", n - 1), finger)))
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

    /// Independent joints of all fingers: those that follow no other.
    #[getter]
    fn n_q(&self) -> usize {
        self.0.n_q()
    }

    /// Independent joints of one finger: an int where all fingers have as many, else a list of one for each.
    #[getter]
    fn n_joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let counts = self.0.counts();
        if counts.iter().all(|count| *count == counts[0]) {
            return Ok(counts[0].into_pyobject(py)?.into_any());
        }
        Ok(counts.into_pyobject(py)?.into_any())
    }

    /// Where the independent joints of `finger` are in a flat array (n_q,).
    ///
    /// Raises
    /// ------
    /// ConfigError
    ///     If there is no such finger.
    fn joints<'py>(&self, py: Python<'py>, finger: usize) -> PyResult<Bound<'py, PySlice>> {
        self.check(finger)?;
        let range = self.0.joints(finger);
        let end = |at: usize| isize::try_from(at).unwrap_or(isize::MAX);
        Ok(PySlice::new(py, end(range.start), end(range.end), 1))
    }

    /// Lower and upper limits, rad, narrowed so that joints that follow stay in theirs; shapes as of `tau_min`.
    #[getter]
    #[allow(clippy::type_complexity, reason = "two arrays")]
    fn limits<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyArrayDyn<f64>>, Bound<'py, PyArrayDyn<f64>>)> {
        Ok((self.each(py, |joint| joint.lower)?, self.each(py, |joint| joint.upper)?))
    }

    /// Least torques that the model states, N m, NaN where it states none: (n_fingers, n_joints) where all fingers
    /// have as many joints, else (n_q,). So are all arrays over the joints; (n_q,) is always taken.
    #[getter]
    fn tau_min<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        self.each(py, |joint| joint.tau_min.unwrap_or(f64::NAN))
    }

    /// Largest torques that the model states, N m, NaN where it states none; shape as of `tau_min`.
    #[getter]
    fn tau_max<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        self.each(py, |joint| joint.tau_max.unwrap_or(f64::NAN))
    }

    /// The posture that the joints should return to, rad; shape as of `tau_min`.
    #[getter]
    fn reference<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        self.each(py, |joint| joint.reference)
    }

    /// Acceleration of gravity in W, (3,), m/s^2.
    #[getter]
    fn gravity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        array1(py, self.0.gravity().as_slice())
    }

    /// Centres of the fingertips in W, (n_fingers, 3), m, at joint angles q, rad, shaped as `tau_min`.
    ///
    /// Raises
    /// ------
    /// ShapeError
    ///     If q has another number of joints.
    fn tip_positions<'py>(
        &self,
        py: Python<'py>,
        q: PyArrayLikeDyn<'py, f64, AllowTypeChange>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let state = self.state(&q)?;
        let n = self.0.n_fingers();
        Ok(array2(py, (n, 3), |j, r| state.tip(j).translation.vector[r]))
    }

    /// Velocity Jacobian in W of a point of a finger's last link, (3, joints of the finger), m/rad: v = J qd.
    ///
    /// Parameters
    /// ----------
    /// q
    ///     Joint angles, rad, shaped as `tau_min`.
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
        q: PyArrayLikeDyn<'py, f64, AllowTypeChange>,
        finger: usize,
        point: PyArrayLike1<'py, f64, AllowTypeChange>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (state, p_W) = (self.state(&q)?, self::point("point", &point)?);
        self.check(finger)?;
        let J = state.jacobian(finger, &p_W);
        Ok(array2(py, J.shape(), |r, c| J[(r, c)]))
    }

    /// Torques, N m, that hold the fingers' own weight at joint angles q, rad; both shaped as `tau_min`.
    ///
    /// Raises
    /// ------
    /// ShapeError
    ///     If q has another number of joints.
    fn gravity_torque<'py>(
        &self,
        py: Python<'py>,
        q: PyArrayLikeDyn<'py, f64, AllowTypeChange>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let state = self.state(&q)?;
        let mut tau = vec![0.0; self.0.n_q()];
        state.gravity_torque(&self.0, &mut tau);
        joint_array(py, &self.0.counts(), &tau)
    }

    /// Torques that hold the joints' springs, N m.
    fn spring_torque<'py>(
        &self,
        py: Python<'py>,
        q: PyArrayLikeDyn<'py, f64, AllowTypeChange>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let state = self.state(&q)?;
        let mut tau = vec![0.0; self.0.n_q()];
        state.add_spring_torque(&self.0, &mut tau);
        joint_array(py, &self.0.counts(), &tau)
    }
}
