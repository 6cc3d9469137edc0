//! Checks and sizes before a run; no orbit is computed.
//!
//! - `survey`: a case with the survey of its linear structure;
//! - `summary`: linear modes, first slip, likely mistakes and memory of a study;
//! - `warnings`: likely mistakes, selected by the study kinds;
//! - `size`: rows, bytes and memory;
//! - `memory_limit`: the memory limit of a run;
//! - `figure`: checks of `[figure]`;
//! - `overstiff`: refuses a stiffness that makes the inertia of a mass vanish.

pub(crate) mod figure;
pub mod memory_limit;
pub(crate) mod overstiff;
pub mod size;
pub mod summary;
pub(crate) mod survey;
pub(crate) mod warnings;
