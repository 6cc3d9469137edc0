//! Dynamics of the linear part: the structure's response to forces along the joints.
//!
//! - `rest`: displacements of all places at any frequency; picks one of the forms below
//! - `receptance`: motions along the axes per unit force, as a matrix or by modes
//! - `modal`: sum over the complex modes of a small structure
//! - `uncoupled`: sum over uncoupled modes, for large structures with modal damping
//! - `waves`: travelling waves of a tuned ring, from one sector
//! - `sparse`: banded factors of large structures with local coupling
//! - `closed`: mean position of bodies that only contacts support

pub(super) mod closed;
pub(super) mod modal;
pub(super) mod receptance;
pub(super) mod rest;
pub(super) mod sparse;
pub(super) mod uncoupled;
pub(super) mod waves;
