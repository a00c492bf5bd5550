//! fingergait core.
#![forbid(unsafe_code)]
// The paper's letters (G, J, Q, K, X_WO) are the names of the things they stand for.
#![allow(non_snake_case)]

pub mod error;
pub mod friction;
pub mod manipulation;
pub mod solver;
