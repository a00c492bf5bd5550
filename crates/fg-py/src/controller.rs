//! `Controller`.

use crate::convert::{array1, array2, flat_rows};
use crate::errors::to_py;
use fg_core::manipulation::robust::Controller as Core;
use nalgebra::Vector6;
use numpy::{AllowTypeChange, PyArray1, PyArray2, PyArrayLike2};
use pyo3::prelude::*;

/// A robust controller K, eqs. (6) and (7), from the JSON text of a controller artefact.
///
/// K maps the pose error e = [p_D - p_O; log(R_D R_O^T)] in W, m and rad, to an acceleration u, m/s^2 and rad/s^2. The
/// format is in ARCHITECTURE.md ("Controller artefact"); `fingergait synthesize` writes such files.
///
/// Parameters
/// ----------
/// artefact
///     JSON text.
///
/// Raises
/// ------
/// ArtifactError
///     A field that is missing, unknown, of the wrong size or not finite; names it.
#[pyclass(frozen, module = "fingergait._core")]
pub struct Controller(pub Core);

#[pymethods]
impl Controller {
    #[new]
    fn new(artefact: &str) -> PyResult<Self> {
        Core::from_json(artefact).map(Self).map_err(to_py)
    }

    /// "mu-synthesis" or "hand-tuned".
    #[getter]
    fn kind(&self) -> &str {
        &self.0.kind
    }

    /// The artefact's line for people.
    #[getter]
    fn description(&self) -> &str {
        &self.0.description
    }

    /// Sample time that K was discretised for, s; the control rate has to fit.
    #[getter]
    fn sample_time(&self) -> f64 {
        self.0.sample_time
    }

    /// Nominal mass of the object, kg, that K was designed with.
    #[getter]
    fn mass(&self) -> f64 {
        self.0.nominal.mass
    }

    /// Nominal principal moments of inertia (3,), kg m^2, that K was designed with.
    #[getter]
    fn inertia<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        array1(py, &self.0.nominal.inertia)
    }

    /// Open-loop response u (T, 6), m/s^2 and rad/s^2, of K from rest to errors e (T, 6), m and rad, unsaturated.
    ///
    /// Raises
    /// ------
    /// ShapeError
    ///     If e has another shape.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        e: PyArrayLike2<'py, f64, AllowTypeChange>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows = flat_rows("e", &e, 6)?;
        let mut K = self.0.clone();
        K.reset();
        let mut u = Vec::with_capacity(rows.len());
        for e in rows.chunks_exact(6) {
            let e = Vector6::from_column_slice(e);
            u.push(K.output(&e));
            K.advance(&e, &Vector6::zeros());
        }
        Ok(array2(py, (u.len(), 6), |t, axis| u[t][axis]))
    }
}
