//! From the tree of a study file to compiled statements. Nothing is evaluated here.
//!
//! - `read`: the reader of study files;
//! - `statement`: compiled values, tables and laws;
//! - `stated`: the model as stated, and the location of a model error in it;
//! - `templates`: ready models that other studies use;
//! - `repeat`: one list entry that states several elements;
//! - `mixed`: refuses bare numbers next to quantities with a unit;
//! - `cause`: the user's values that make an expression of a template wrong.

pub(crate) mod cause;
pub(crate) mod mixed;
pub(crate) mod read;
pub(crate) mod repeat;
pub(crate) mod stated;
pub(crate) mod statement;
pub mod templates;
