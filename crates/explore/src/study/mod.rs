//! Studies as the page sees them.
//!
//! - `catalog`: the templates and the study files of a folder;
//! - `quantities`: the quantities of a study file that can be changed;
//! - `change`: changes of a study file that keep its comments;
//! - `view`: what is computed: the study itself, an orbit, a performance curve or a map;
//! - `description`: a study for the page: its quantities, its cases and its model;
//! - `answer`: the results of a run for the page;
//! - `solid`: the motion of a structure with a mesh, as a surface in three dimensions;
//! - `fit`: fits to measured data;
//! - `measured`: measured curves of `[[data]]`, drawn with the computed ones;
//! - `response_quantity`: curves of velocities, accelerations, receptances and joint quantities.

pub mod answer;
pub mod catalog;
pub mod change;
pub(crate) mod description;
pub mod fit;
pub(crate) mod measured;
pub mod quantities;
pub mod response_quantity;
pub(crate) mod solid;
pub mod view;
