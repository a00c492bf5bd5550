//! Section III: when a finger changes its contact, which one, and how it moves.

pub mod planner;
pub mod quality;
pub mod supervisor;
pub mod velocity_force;
