//! A study kind: what it says of itself, and how its studies are cut, computed and drawn.

use crate::cost::{Cost, Costing};
use crate::dataset::Figure;
use crate::drawing::Drawing;
use crate::info::KindInfo;
use crate::study::Study;
use crate::survey::Surveyed;
use crate::work::{Computed, Grain, Work};

/// A row of the table of study kinds.
#[derive(Debug, Clone, Copy)]
pub struct Kind {
    /// What it says of itself.
    pub info: KindInfo,
    /// How its studies are cut into units of work.
    pub grain: fn(&Study) -> Grain,
    /// How much its studies hold, and what they take; too much rather than too little.
    pub cost: fn(&Costing<'_>) -> Cost,
    /// What looks like a mistake in a study of this kind, as sentences; cases that are spread over all of it.
    pub warnings: fn(&[Surveyed]) -> Vec<String>,
    /// Computes one unit: rows of its tables.
    pub compute: fn(&Work<'_>) -> Computed,
    /// Draws the figure of finished tables; the title is the study's.
    pub draw: fn(&Drawing<'_>) -> Figure,
}
