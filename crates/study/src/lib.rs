//! Study files of Stickslip: reads, checks and runs a study stated in TOML.
//!
//! [`read_study`] turns a text into a [`Study`] in three stages. The text becomes a tree
//! ([`toml`]). The tree becomes statements: every expression is compiled and every location is
//! known. Then every case is resolved once, so that all errors are found before anything is
//! written. [`schema`] describes all tables and keys as data.
//!
//! - `syntax`: text, keys, units and expressions;
//! - `compile`: from the text to compiled statements;
//! - `case`: the cases of a study, each with its model and values;
//! - `data`: tables of measured numbers;
//! - `check`: checks and sizes before a run;
//! - [`kinds`]: the study kinds;
//! - [`run`](mod@run): computes the units of a study;
//! - [`results`]: tables, figures, notes and typed values.

mod case;
mod check;
mod compile;
mod data;
pub mod kinds;
pub mod results;
pub mod run;
mod syntax;

pub use case::stress_stiffening::StiffnessExports;
pub use case::study::{Case, MethodChoice, Study, VariedValue};
pub use case::values::{Frequencies, Values, hertz};
pub use check::{memory_limit, size, summary};
pub use compile::read::{
    DataContents, StructureCache, StructureCacheSettings, TemplateParameter, read_bytes, read_document, read_file,
    read_for_results, read_study, read_study_with, read_study_with_data,
};
pub use compile::templates;
pub use results::{dataset, decimation};
pub use run::{result_block, work};
pub use syntax::error::StudyError;
pub use syntax::{book, expression, schema, unit_sets, units};
