//! Figures as files: static (SVG, PNG) and interactive (HTML).
//!
//! - `panels`, `axis`, `colour`: what all outputs share: grid, ranges, drawing order and legend;
//!   ticks; palette and colour scales.
//! - `clip`, `font`: curves clipped to their panel; text widths in the embedded font.
//! - `svg`, `png`, `html`: one output each;
//! - `mesh_picture`: a picture of a mesh;
//! - `contact_picture`: a picture of its contacts.

mod axis;
mod clip;
pub(crate) mod colour;
pub mod contact_picture;
mod font;
pub mod html;
pub mod mesh_picture;
mod panels;
pub mod png;
pub mod svg;
