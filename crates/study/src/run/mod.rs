//! Runs a study.
//!
//! - `runner`: checks a study, computes its units on all threads, and records the run;
//! - `work`: units of work, and the results of one unit;
//! - `block`: the results of consecutive units;
//! - `point`: the table row of one orbit;
//! - `extra`: additional columns that `output` selects;
//! - `farther`: the check of the reduction basis.

pub mod block;
pub(crate) mod extra;
pub(crate) mod farther;
pub(crate) mod point;
mod runner;
pub mod work;

pub use runner::{CONVERGED, Checked, Context, NOT_REACHED, Prepared, check, drawn, redrawn, run, units};
