//! `Controller`.

use crate::convert::{array1, array2, flat_rows};
use crate::errors::to_py;
use fg_core::manipulation::robust::Controller as Core;
use nalgebra::Vector6;
use numpy::{AllowTypeChange, PyArray1, PyArray2, PyArrayLike2};
use pyo3::prelude::*;

/// A robust controller read from a controller artefact (JSON text).
#[pyclass(frozen, module = "fingergait._core")]
pub struct Controller(pub Core);

#[pymethods]
impl Controller {
    #[new]
    fn new(artefact: &str) -> PyResult<Self> {
        Core::from_json(artefact).map(Self).map_err(to_py)
    }

    #[getter]
    fn kind(&self) -> &str {
        &self.0.kind
    }

    #[getter]
    fn description(&self) -> &str {
        &self.0.description
    }

    #[getter]
    fn sample_time(&self) -> f64 {
        self.0.sample_time
    }

    #[getter]
    fn mass(&self) -> f64 {
        self.0.nominal.mass
    }

    #[getter]
    fn inertia<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        array1(py, &self.0.nominal.inertia)
    }

    /// Open-loop response u (T, 6) of K from rest to the error sequence e (T, 6), without saturation.
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
