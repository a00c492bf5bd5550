//! The tree of Python exceptions under `FingergaitError`.

use fg_core::error::Error;
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyTuple, PyType};

struct Tree {
    base: Py<PyType>,
    config: Py<PyType>,
    shape: Py<PyType>,
    artifact: Py<PyType>,
}

static TREE: PyOnceLock<Tree> = PyOnceLock::new();

fn tree(py: Python<'_>) -> PyResult<&Tree> {
    TREE.get_or_try_init(py, || {
        let class = |name: &str, bases: Bound<'_, PyTuple>, doc: &str| -> PyResult<Py<PyType>> {
            let namespace = PyDict::new(py);
            namespace.set_item("__module__", "fingergait._core")?;
            namespace.set_item("__doc__", doc)?;
            let class = py.get_type::<PyType>().call1((name, bases, namespace))?;
            Ok(class.cast_into::<PyType>()?.unbind())
        };
        let exception = PyTuple::new(py, [py.get_type::<PyException>()])?;
        let doc = "Base of every error that fingergait raises on purpose: \
                   names the field, what was expected and found.";
        let base = class("FingergaitError", exception, doc)?;
        // Each is a ValueError too, so that generic callers catch it as what it is.
        let leaf = |name, doc| {
            let bases = PyTuple::new(py, [base.bind(py).clone(), py.get_type::<PyValueError>()])?;
            class(name, bases, doc)
        };
        Ok(Tree {
            config: leaf("ConfigError", "A configuration, hand or scenario value is out of range.")?,
            shape: leaf("ShapeError", "An array has the wrong length or shape.")?,
            artifact: leaf("ArtifactError", "A controller artefact is missing, corrupt or inconsistent.")?,
            base,
        })
    })
}

/// Adds the exceptions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let tree = tree(py)?;
    module.add("FingergaitError", &tree.base)?;
    module.add("ConfigError", &tree.config)?;
    module.add("ShapeError", &tree.shape)?;
    module.add("ArtifactError", &tree.artifact)
}

/// The Python exception for an error of the core.
pub fn to_py(error: Error) -> PyErr {
    Python::attach(|py| match tree(py) {
        Ok(tree) => {
            let class = match error {
                Error::Config { .. } => &tree.config,
                Error::Shape { .. } => &tree.shape,
                Error::Artifact { .. } => &tree.artifact,
            };
            PyErr::from_type(class.bind(py).clone(), error.to_string())
        }
        Err(other) => other,
    })
}
