//! Figures as files: static (SVG, PNG) and interactive (HTML).
//!
//! - `panels`, `axis`, `colour`: what all outputs share: grid, ranges, drawing order and legend;
//!   ticks; palette and colour scales.
//! - `clip`, `font`: curves clipped to their panel; text widths in the embedded font.
//! - `svg`, `png`, `html`: one output each.

mod axis;
mod clip;
pub(crate) mod colour;
mod font;
pub mod html;
mod panels;
pub mod png;
pub mod svg;
