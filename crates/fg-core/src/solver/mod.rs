//! Solvers of the two optimisations in a control step: the force QP, eq. (8), and the gait LP, eq. (4).
//!
//! [`qp`] puts eq. (8) in the one form that everything here reads. [`active_set`] is the fast path, [`clarabel`] the
//! second opinion, [`kkt`] the check that both must pass, [`hold`] what is left where neither does.
//! [`knapsack`] solves the gait LP in closed form.

pub mod active_set;
pub mod clarabel;
pub mod hold;
pub mod kkt;
pub mod knapsack;
pub mod null_space;
pub mod qp;
pub mod schur;
pub mod working_set;
