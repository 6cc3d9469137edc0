//! Results of a study: tables, figures and notes, and their typed values.
//!
//! - `dataset`: tables, figures and the record of a run, independent of file formats;
//! - `typed`: reads results back as typed values;
//! - `columns`: names of columns that several kinds write;
//! - `rows`: builds tables row by row;
//! - `note`: notes for the reader;
//! - `drawing`: tools for kinds to draw figures from finished tables;
//! - `draws`: panels of many random draws;
//! - `percentiles`: bands of many curves;
//! - `histogram`: histograms, and for maxima the fitted distribution;
//! - `weibull`: the Weibull distribution of maxima;
//! - `decay`: damping from a free decay;
//! - `thinning`: decimation of long tables for their figure.

pub(crate) mod columns;
pub mod dataset;
pub(crate) mod decay;
pub(crate) mod drawing;
pub(crate) mod draws;
pub(crate) mod histogram;
pub(crate) mod note;
pub(crate) mod percentiles;
pub(crate) mod rows;
pub mod thinning;
mod typed;
pub(crate) mod weibull;

pub(crate) use typed::Results;
pub use typed::{Evidence, Peak, ResultsError, worst_evidence};
