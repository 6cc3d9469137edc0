//! Families of orbits along a parameter: sweeps, peaks, branches, performance curves, nonlinear
//! modes.

pub mod adaptive;
pub mod both_ways;
pub mod modes;
mod onward;
pub mod peak;
pub mod performance;
pub mod sweep;
pub mod trace;
