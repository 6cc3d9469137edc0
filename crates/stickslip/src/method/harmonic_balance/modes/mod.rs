//! Nonlinear modes, and branches of orbits with a parameter.
//!
//! - `nonlinear_mode`: equations of a nonlinear mode, its linear start and its results
//! - `mode_newton`: Newton's method for a mode, at a given amplitude or across its curve
//! - `mode_continuation`: arc-length continuation of a mode
//! - `branch_equations`: equations of an orbit with a parameter, for continuation

pub(super) mod branch_equations;
pub(super) mod mode_continuation;
mod mode_newton;
pub(super) mod nonlinear_mode;
