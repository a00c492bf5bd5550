//! Robust finger-gait control of a multi-fingered hand: *Real-Time Robust Finger Gaits Planning under Object Shape and
//! Dynamics Uncertainties* (Fan, Tang, Lin, Zhao, Tomizuka), as one control step without simulator or Python.
//!
//! # Frames
//! Monogram notation: `p_WF` is the point F from W, `R_WO` and `X_WO` the orientation and pose of O in W, `n_W` a vector
//! expressed in W. Adjacent letters cancel: `X_WC = X_WO * X_OC`. W is the world, F a fingertip (origin at the tip's
//! centre, orientation of the last link), C a contact (z along the normal into the object), O the object, D the desired
//! object. Wrenches are [force; torque] and pose errors [translation; rotation vector], both in W at Oo. SI units and
//! radians throughout.
//!
//! # The paper's symbols
//!
//! | paper | here | where |
//! |---|---|---|
//! | Q, Q_o, Q_h | [`gait::quality::Quality`] | eq. (1) |
//! | delta_Q | [`gait::supervisor::Supervisor::threshold`] | Section III-A |
//! | Q-dot, c_k^i | [`gait::quality::QualityModel::rate_coefficients`] | eqs. (2), (3) |
//! | w_1, w_2, q_thres, qd_max, sigma, delta | [`config::GaitConfig`] | eqs. (3), (4) |
//! | qd_des,k | [`gait::planner::GaitPlanner::qd_des`] | eq. (4) |
//! | K_v, K_f, f_des^n | [`gait::velocity_force::VelocityForceController`] | eq. (5) |
//! | K | [`manipulation::robust::Controller`] | eqs. (6), (7) |
//! | alpha(x) + beta(x) u | [`manipulation::robust::RobustController::wrench`] | Section IV-A |
//! | f, Psi, alpha_1..3 | [`manipulation::force::ForceOptimizer`] | eq. (8) |
//! | B | [`friction::FrictionPyramid`] | (8c), (8d) |
//! | G, J_h | [`grasp::Grasp`] | (8b), (8e) |
//! | tau_des | [`dual_stage::DualStagePlanner::step`] | Section II |
#![forbid(unsafe_code)]
// The paper's letters (G, J, Q, K, X_WO) are the names of the things they stand for.
#![allow(non_snake_case)]

pub mod config;
pub mod diagnostics;
pub mod dual_stage;
pub mod error;
pub mod friction;
pub mod gait;
pub mod grasp;
pub mod hand;
pub mod manipulation;
pub mod regrasp;
pub mod rules;
pub mod safety;
pub mod signals;
pub mod solver;
pub mod spatial;
pub mod torque;
