//! Search for one orbit and evidence for it, shared by the methods.
//!
//! - `describing_guess`: initial guess by describing functions
//! - `return_map`: Newton's method on the return map
//! - `vibration_share`: the vibration's fraction of the size of a state
//! - `residual_traction`: choice of one orbit from a continuum
//! - `cold_restart`: second search without a warm start
//! - `settling`: classification of a motion that does not settle
//! - `evidence`: return defect and stability from an independent time integration

pub(super) mod cold_restart;
pub(super) mod describing_guess;
pub(super) mod evidence;
pub(super) mod residual_traction;
pub(super) mod return_map;
pub(super) mod settling;
pub(super) mod vibration_share;
