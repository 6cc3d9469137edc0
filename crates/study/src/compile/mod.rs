//! From the tree of a study file to compiled statements. Nothing is evaluated here.
//!
//! - `read`: the reader of study files;
//! - `compiled`: compiled values, tables and laws;
//! - `mesh`: places and joints on the sets of a mesh;
//! - `source_model`: the model as stated, and the location of a model error in it;
//! - `templates`: ready models that other studies use;
//! - `torsion`: models of rotation, whose masses are moments of inertia;
//! - `frequency_amplitude`: amplitudes over the excitation frequency;
//! - `repeat`: one list entry that states several elements;
//! - `bare_numbers`: refuses bare numbers next to quantities with a unit;
//! - `template_errors`: the user's values that make an expression of a template wrong.

pub(crate) mod bare_numbers;
pub(crate) mod compiled;
pub(crate) mod frequency_amplitude;
pub(crate) mod mesh;
pub(crate) mod read;
pub(crate) mod repeat;
pub(crate) mod source_model;
pub(crate) mod template_errors;
pub mod templates;
pub(crate) mod torsion;
