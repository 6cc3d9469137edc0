//! The language of study files: text, keys, units and expressions. Nothing here knows a model.
//!
//! - `document`: a TOML text as a tree with locations;
//! - `error`: errors with their location in the text;
//! - `expression`: quantities and expressions;
//! - `units`: units of quantities;
//! - `unit_sets`: consistent sets of units of finite-element programs;
//! - `key`: a key of a table and the values that it takes;
//! - `schema`: all tables and keys, as data;
//! - `signal_keys`: the keys of `signal`;
//! - `book`: the reference of study files in the book, generated from the schema;
//! - `suggest`: suggestions for misspelled words;
//! - `dimension_advice`: advice for a quantity of the wrong dimension;
//! - `format`: formats numbers and times.

pub mod book;
pub(crate) mod dimension_advice;
pub(crate) mod document;
pub(crate) mod error;
pub mod expression;
pub(crate) mod format;
pub(crate) mod key;
pub mod schema;
pub(crate) mod signal_keys;
pub(crate) mod suggest;
pub mod unit_sets;
pub mod units;
