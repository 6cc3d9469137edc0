//! The language of study files: text, keys, units and expressions. Nothing here knows a model.
//!
//! - `document`: a TOML text as a tree with locations;
//! - `error`: errors with their location in the text;
//! - `expression`: quantities and expressions;
//! - `units`: units of quantities;
//! - `unit_sets`: consistent sets of units of finite-element programs;
//! - `key`: a key of a table and the values that it takes;
//! - `schema`: all tables and keys, as data;
//! - `book`: the reference of study files in the book, generated from the schema;
//! - `near`: suggestions for misspelled words;
//! - `mistaken`: advice for a quantity of the wrong dimension;
//! - `words`: formats numbers and times.

pub mod book;
pub(crate) mod document;
pub(crate) mod error;
pub mod expression;
pub(crate) mod key;
pub(crate) mod mistaken;
pub(crate) mod near;
pub mod schema;
pub mod unit_sets;
pub mod units;
pub(crate) mod words;
