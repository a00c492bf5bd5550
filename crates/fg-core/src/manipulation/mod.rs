//! Section IV: the manipulation controller.

pub mod force;
