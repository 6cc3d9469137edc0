//! A study and its cases: every statement evaluated for the parameters of a case, in SI.
//!
//! - `study`: the study and its cases;
//! - `values`: the values of a table for one case;
//! - `model_builder`: builds the model from the lists, with or without a disk;
//! - `assembled`: the system of the model that was assembled last;
//! - `disk`: `[disk]`, the ring of a sector, tuned or mistuned;
//! - `substructure`: `[structure]` and `[[place]]` as parts of a model;
//! - `reduction_folder`: the folder that keeps reductions between runs;
//! - `stress_stiffening`: stress stiffening of a rotating structure;
//! - `names`: names of places and joints that a key may use;
//! - `sample`: `[sample]`, uncertain parameters drawn at random;
//! - `linear_reference`: the linear reference models, all joints free or stuck;
//! - `initial_state`: the initial state of a transient.

pub(crate) mod assembled;
pub(crate) mod disk;
pub(crate) mod initial_state;
pub(crate) mod linear_reference;
pub(crate) mod model_builder;
pub(crate) mod names;
pub(crate) mod reduction_folder;
pub(crate) mod sample;
pub(crate) mod stress_stiffening;
pub(crate) mod study;
pub(crate) mod substructure;
pub(crate) mod values;
