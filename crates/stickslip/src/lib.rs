//! How structures with dry-friction joints vibrate.
//!
//! Data flows one way: a [`model`] is stated and assembled to a system, whose joints carry a friction [`law`]; a method turns system
//! and drive into an orbit; a curve is a family of orbits.

pub mod curve;
pub mod dimension;
pub mod law;
pub mod method;
pub mod model;
pub mod orbit;
pub mod structure;
