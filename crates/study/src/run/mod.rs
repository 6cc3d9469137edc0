//! Runs a study.
//!
//! - `probe`: the expected time, from a few points that are computed in advance;
//! - `thread_time`: the processor time of a thread;
//! - `runner`: checks a study, computes its units on all threads, and records the run;
//! - `work`: units of work, and the results of one unit;
//! - `result_block`: the results of consecutive units;
//! - `point_row`: the table row of one orbit;
//! - `output_columns`: additional columns that `output` selects;
//! - `set_columns`: those of whole sets of the mesh;
//! - `basis_check`: the check of the reduction basis.

pub(crate) mod basis_check;
pub(crate) mod output_columns;
mod period_samples;
pub(crate) mod point_row;
mod probe;
pub mod result_block;
mod runner;
mod set_columns;
mod thread_time;
pub mod work;

pub use probe::ExpectedTime;
pub use runner::{
    CONVERGED, CheckedStudy, Context, NOT_REACHED, PreparedCase, check, draw, figure_of_tables, run, units,
};
