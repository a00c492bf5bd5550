//! Section III: when a finger changes its contact, which one, and how it moves.

pub mod governor;
pub mod march;
pub mod planner;
pub mod quality;
pub mod reserve;
pub mod schedule;
pub mod supervisor;
pub mod surface;
pub mod velocity_force;
