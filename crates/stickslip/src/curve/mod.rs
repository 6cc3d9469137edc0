//! Families of orbits along a parameter.

pub mod peak;
pub mod sweep;
