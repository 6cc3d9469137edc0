//! Families of orbits along a parameter: sweeps, peaks, branches, performance curves, nonlinear
//! modes.

pub mod adaptive;
pub mod bidirectional_sweep;
mod branch_following;
pub mod continuation;
pub mod modes;
pub mod peak;
pub mod performance;
mod point_budget;
pub mod sweep;

pub use point_budget::PointBudget;
