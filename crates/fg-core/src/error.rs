//! The one error type of the crate: a caller's mistake, named by field, expected and found.

use std::fmt::Display;
use thiserror::Error;

/// A caller's mistake. Numerical trouble is not an error: it is reported in [`crate::diagnostics::Diagnostics`].
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Error {
    /// A configuration or hand value out of its range.
    #[error("{field}: expected {expected}, found {found}")]
    Config {
        /// Dotted path of the field.
        field: String,
        /// What would be accepted.
        expected: String,
        /// What was given.
        found: String,
    },
    /// An array of the wrong length.
    #[error("{field}: expected shape {expected}, found {found}")]
    Shape {
        /// Name of the argument.
        field: String,
        /// The shape wanted.
        expected: String,
        /// The shape given.
        found: String,
    },
    /// A controller artefact that cannot be used.
    #[error("controller artefact: {field}: expected {expected}, found {found}")]
    Artifact {
        /// Dotted path inside the artefact.
        field: String,
        /// What would be accepted.
        expected: String,
        /// What was given.
        found: String,
    },
}

#[allow(clippy::needless_pass_by_value, reason = "callers pass temporaries")]
impl Error {
    /// A [`Error::Config`] from displayable parts.
    pub fn config(field: impl Into<String>, expected: impl Into<String>, found: impl Display) -> Self {
        Self::Config { field: field.into(), expected: expected.into(), found: found.to_string() }
    }
    /// A [`Error::Shape`] from displayable parts.
    pub fn shape(field: impl Into<String>, expected: impl Display, found: impl Display) -> Self {
        Self::Shape { field: field.into(), expected: expected.to_string(), found: found.to_string() }
    }
    /// A [`Error::Artifact`] from displayable parts.
    pub fn artifact(field: impl Into<String>, expected: impl Into<String>, found: impl Display) -> Self {
        Self::Artifact { field: field.into(), expected: expected.into(), found: found.to_string() }
    }
}
