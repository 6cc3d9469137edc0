//! Search for one orbit and evidence for it, shared by the methods.
//!
//! - `guess`: initial guess by describing functions
//! - `periodic`: Newton's method on the return map
//! - `vibration`: the vibration's fraction of the size of a state
//! - `residual_traction`: choice of one orbit from a continuum
//! - `repeated`: second search without a warm start
//! - `course`: classification of a motion that does not settle
//! - `evidence`: return defect and stability from an independent time integration

pub(super) mod course;
pub(super) mod evidence;
pub(super) mod guess;
pub(super) mod periodic;
pub(super) mod repeated;
pub(super) mod residual_traction;
pub(super) mod vibration;
