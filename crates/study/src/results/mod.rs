//! Results of a study: tables, figures and notes, and their typed values.
//!
//! - `dataset`: tables, figures and the record of a run, independent of file formats;
//! - `typed`: reads results back as typed values;
//! - `columns`: names of columns that several kinds write;
//! - `table_builder`: builds tables row by row;
//! - `torsion_columns`: units of the columns of a model of rotation;
//! - `notes`: notes for the reader;
//! - `drawing`: tools for kinds to draw figures from finished tables;
//! - `fitted_study`: the study file with identified values;
//! - `draw_panels`: panels of many random draws;
//! - `percentiles`: bands of many curves;
//! - `histogram`: histograms, and for maxima the fitted distribution;
//! - `weibull`: the Weibull distribution of maxima;
//! - `decay`: damping from a free decay;
//! - `decimation`: decimation of long tables for their figure.

pub(crate) mod columns;
pub mod dataset;
pub(crate) mod decay;
pub mod decimation;
pub(crate) mod draw_panels;
pub(crate) mod drawing;
mod fitted_study;
pub(crate) mod histogram;
pub(crate) mod notes;
pub(crate) mod percentiles;
pub(crate) mod table_builder;
pub(crate) mod torsion_columns;
mod typed;
pub(crate) mod weibull;

pub use columns::place_and_sector;
pub use fitted_study::fitted_study;
pub(crate) use typed::Results;
pub use typed::{Evidence, Peak, ResultsError, worst_evidence};
