//! Section IV: from the pose error to contact forces.

pub mod feedforward;
pub mod force;
pub mod lti;
pub mod posture;
pub mod robust;
pub mod slip;
