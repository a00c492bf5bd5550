//! Copies between NumPy arrays and the core's types. The only place that knows wxyz quaternions.

use crate::errors::to_py;
use fg_core::error::Error;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use numpy::ndarray::Array2;
use numpy::{
    AllowTypeChange, IntoPyArray, PyArray1, PyArray2, PyArrayDyn, PyArrayLike1, PyArrayLike2, PyArrayLikeDyn,
    PyArrayMethods, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

/// The numbers of a two-dimensional array of the given shape, row by row.
pub fn flat(
    field: &str,
    array: &PyArrayLike2<'_, f64, AllowTypeChange>,
    shape: (usize, usize),
) -> PyResult<Vec<f64>> {
    let found = (array.shape()[0], array.shape()[1]);
    if found != shape {
        return Err(to_py(Error::shape(field, format!("{shape:?}"), format!("{found:?}"))));
    }
    Ok(array.as_array().iter().copied().collect())
}

/// The numbers of a two-dimensional array with `columns` columns, row by row.
pub fn flat_rows(
    field: &str,
    array: &PyArrayLike2<'_, f64, AllowTypeChange>,
    columns: usize,
) -> PyResult<Vec<f64>> {
    flat(field, array, (array.shape()[0], columns))
}

/// The numbers of a one-dimensional array of length `n`.
pub fn vector(field: &str, array: &PyArrayLike1<'_, f64, AllowTypeChange>, n: usize) -> PyResult<Vec<f64>> {
    let found = array.shape()[0];
    if found != n {
        return Err(to_py(Error::shape(field, format!("({n},)"), format!("({found},)"))));
    }
    Ok(array.as_array().iter().copied().collect())
}

/// A point or vector of three components.
pub fn point(field: &str, array: &PyArrayLike1<'_, f64, AllowTypeChange>) -> PyResult<Vector3<f64>> {
    vector(field, array, 3).map(Vector3::from_vec)
}

/// The pose in an array (7,): position, then a unit quaternion wxyz.
///
/// Components that are not finite pass through, for the core to judge.
pub fn pose(field: &str, array: &PyArrayLike1<'_, f64, AllowTypeChange>) -> PyResult<Isometry3<f64>> {
    let v = vector(field, array, 7)?;
    let quaternion = Quaternion::new(v[3], v[4], v[5], v[6]);
    let norm = quaternion.norm();
    if norm.is_finite() && (norm - 1.0).abs() > 1e-3 {
        let error =
            Error::config(format!("{field}[3:7]"), "a unit quaternion wxyz", format!("{:?}", &v[3..]));
        return Err(to_py(error));
    }
    let rotation = UnitQuaternion::new_normalize(quaternion);
    Ok(Isometry3::from_parts(Translation3::new(v[0], v[1], v[2]), rotation))
}

/// The pose in an array (7,) as a sensor gave it: what is not a unit quaternion passes through, for the core to judge.
pub fn sensed_pose(field: &str, array: &PyArrayLike1<'_, f64, AllowTypeChange>) -> PyResult<Isometry3<f64>> {
    let v = vector(field, array, 7)?;
    let quaternion = Quaternion::new(v[3], v[4], v[5], v[6]);
    let unit = (quaternion.norm() - 1.0).abs() <= 1e-3;
    let rotation = if unit {
        UnitQuaternion::new_normalize(quaternion)
    } else {
        UnitQuaternion::new_unchecked(quaternion)
    };
    Ok(Isometry3::from_parts(Translation3::new(v[0], v[1], v[2]), rotation))
}

/// A new one-dimensional array.
pub fn array1<'py>(py: Python<'py>, values: &[f64]) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_slice(py, values)
}

/// A new two-dimensional array with the elements `at(row, column)`.
pub fn array2(
    py: Python<'_>,
    shape: (usize, usize),
    at: impl Fn(usize, usize) -> f64,
) -> Bound<'_, PyArray2<f64>> {
    Array2::from_shape_fn(shape, |(r, c)| at(r, c)).into_pyarray(py)
}

/// The numbers of an array over the joints of fingers with `counts` joints: (n_q,), or (n_fingers, n_joints) where all
/// fingers have as many.
pub fn joint_values(
    field: &str,
    array: &PyArrayLikeDyn<'_, f64, AllowTypeChange>,
    counts: &[usize],
) -> PyResult<Vec<f64>> {
    let shape = joint_shape(counts);
    let flat = [counts.iter().sum::<usize>()];
    if array.shape() != shape && array.shape() != flat {
        let found = tuple(array.shape());
        return Err(to_py(Error::shape(field, tuple(&shape), found)));
    }
    Ok(array.as_array().iter().copied().collect())
}

/// A new array over the joints of fingers with `counts` joints: (n_fingers, n_joints) where all have as many, else (n_q,).
pub fn joint_array<'py>(
    py: Python<'py>,
    counts: &[usize],
    values: &[f64],
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    array1(py, values).reshape(joint_shape(counts))
}

/// (n_fingers, n_joints) where all fingers have as many joints, else (n_q,).
fn joint_shape(counts: &[usize]) -> Vec<usize> {
    if counts.iter().all(|count| *count == counts[0]) {
        vec![counts.len(), counts[0]]
    } else {
        vec![counts.iter().sum()]
    }
}

/// A shape as Python writes it.
pub fn tuple(shape: &[usize]) -> String {
    match shape {
        [n] => format!("({n},)"),
        _ => format!("({})", shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// A new array of the shape of `pattern`.
pub fn like<'py>(
    py: Python<'py>,
    pattern: &PyArrayLikeDyn<'py, f64, AllowTypeChange>,
    values: &[f64],
) -> Bound<'py, PyArrayDyn<f64>> {
    let array = PyArrayDyn::zeros(py, pattern.shape(), false);
    for (to, from) in array.readwrite().as_array_mut().iter_mut().zip(values) {
        *to = *from;
    }
    array
}
