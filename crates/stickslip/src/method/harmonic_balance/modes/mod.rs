//! Nonlinear modes, and branches of orbits with a parameter.
//!
//! - `mode`: equations of a nonlinear mode, its linear start and its results
//! - `arc`: arc-length continuation of a mode
//! - `branch`: equations of an orbit with a parameter, for continuation

pub(super) mod arc;
pub(super) mod branch;
pub(super) mod mode;
