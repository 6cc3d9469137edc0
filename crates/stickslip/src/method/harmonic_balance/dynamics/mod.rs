//! Dynamics of the linear part: the structure's response to forces along the joints.
//!
//! - `linear_dynamics`: displacements of all places at any frequency; picks one of the forms below
//! - `receptance`: motions along the axes per unit force, as a matrix or by modes
//! - `modal_sum`: sum over the complex modes of a small structure
//! - `uncoupled_modes`: sum over uncoupled modes, for large structures with modal damping
//! - `travelling_wave`: travelling waves of a tuned ring, from one sector
//! - `banded`: banded factors of large structures with local coupling
//! - `closed_contacts`: mean position of bodies that only contacts support

pub(super) mod banded;
pub(super) mod closed_contacts;
pub(super) mod linear_dynamics;
pub(super) mod modal_sum;
pub(super) mod receptance;
pub(super) mod travelling_wave;
pub(super) mod uncoupled_modes;
