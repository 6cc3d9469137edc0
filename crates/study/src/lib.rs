//! Study files of Stickslip: reads, checks and runs a study stated in TOML.
//!
//! [`read_study`] turns a text into a [`Study`] in three stages. The text becomes a tree
//! ([`toml`]). The tree becomes statements: every expression is compiled and every location is
//! known. Then every case is resolved once, so that all errors are found before anything is
//! written. [`schema`] describes all tables and keys as data.

pub mod block;
pub mod book;
mod cause;
mod columns;
pub mod cost;
pub mod dataset;
mod decay;
mod disk;
mod document;
mod drawing;
mod draws;
mod error;
pub mod expression;
mod extra;
mod farther;
mod figure;
mod histogram;
mod immovable;
mod info;
mod key;
mod kind;
pub mod kinds;
mod linear;
pub mod memory;
mod mistaken;
mod mixed;
mod names;
mod near;
mod note;
mod percentiles;
mod point;
mod read;
mod repeat;
pub mod results;
mod rows;
pub mod run;
mod sample;
pub mod schema;
mod sector;
mod start;
mod stated;
mod statement;
mod stiffened;
mod study;
mod substructure;
pub mod summary;
mod survey;
pub mod templates;
pub mod thinning;
pub mod unit_sets;
pub mod units;
mod values;
mod warnings;
mod weibull;
mod words;
pub mod work;

pub use error::StudyError;
pub use read::{TemplateParameter, read_bytes, read_document, read_file, read_stored, read_study};
pub use stiffened::Exports;
pub use study::{Case, MethodChoice, Study, VariedValue};
pub use values::{Frequencies, Values, hertz};
