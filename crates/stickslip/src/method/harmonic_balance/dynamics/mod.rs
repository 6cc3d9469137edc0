//! Dynamics of the linear part: the structure's response to forces along the joints.
//!
//! - `linear_dynamics`: displacements of all places at any frequency, by one of the forms below
//! - `harmonic_dynamics`: the trait of these forms
//! - `receptance`: motions along the axes per unit force, as a matrix or by modes
//! - `modal_sum`: sum over the complex modes of a small structure
//! - `uncoupled_modes`: sum over uncoupled modes, for large structures with modal damping
//! - `factored`: factors of the dynamic stiffness
//! - `travelling_wave`: travelling waves of a tuned ring, from one sector
//! - `banded`: banded factors of large structures with local coupling
//! - `closed_contacts`: mean position of bodies that only contacts support

pub(super) mod banded;
pub(super) mod closed_contacts;
mod factored;
mod harmonic_dynamics;
pub(super) mod linear_dynamics;
mod modal_sum;
pub(super) mod receptance;
mod travelling_wave;
pub(super) mod uncoupled_modes;
