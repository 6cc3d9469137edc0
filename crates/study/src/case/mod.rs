//! A study and its cases: every statement evaluated for the parameters of a case, in SI.
//!
//! - `study`: the study and its cases;
//! - `values`: the values of a table for one case;
//! - `sector`: builds the model from the lists, with or without a disk;
//! - `disk`: `[disk]`, the ring of a sector, tuned or mistuned;
//! - `substructure`: `[structure]` and `[[place]]` as parts of a model;
//! - `stiffened`: stress stiffening of a rotating structure;
//! - `names`: names of places and joints that a key may use;
//! - `sample`: `[sample]`, uncertain parameters drawn at random;
//! - `linear`: the linear reference models, all joints free or stuck;
//! - `start`: the initial state of a transient.

pub(crate) mod disk;
pub(crate) mod linear;
pub(crate) mod names;
pub(crate) mod sample;
pub(crate) mod sector;
pub(crate) mod start;
pub(crate) mod stiffened;
pub(crate) mod study;
pub(crate) mod substructure;
pub(crate) mod values;
