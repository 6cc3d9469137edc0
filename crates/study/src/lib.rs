//! Study files of Stickslip: what a TOML file asks for, read, checked and run.
//!
//! [`read_study`] turns a text into a [`Study`]: tree ([`toml`]), statements (every expression compiled, every place known), then every
//! case once, so that whatever is wrong is found before anything is written. [`schema`] describes all tables and keys as data.

mod columns;
pub mod dataset;
mod decay;
mod document;
mod drawing;
mod error;
pub mod expression;
mod extra;
mod immovable;
pub mod kinds;
mod near;
mod note;
mod point;
mod read;
mod repeat;
pub mod results;
mod rows;
pub mod run;
pub mod schema;
mod statement;
mod study;
pub mod summary;
pub mod units;
mod values;
pub mod work;

pub use error::StudyError;
pub use read::{read_bytes, read_file, read_study};
pub use study::{Case, MethodChoice, Study, VariedValue};
pub use values::{Frequencies, Values, hertz};
