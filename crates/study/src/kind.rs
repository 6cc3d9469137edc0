//! A study kind: its description, and how its studies are divided, computed and drawn.

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
    /// The description of the kind.
    pub info: KindInfo,
    /// Divides a study into units of work.
    pub grain: fn(&Study) -> Grain,
    /// Estimates size and time of a study, from above rather than from below.
    pub cost: fn(&Costing<'_>) -> Cost,
    /// Warns of probable mistakes in a study of this kind, in sentences. The argument is a
    /// selection of cases that covers the study.
    pub warnings: fn(&[Surveyed]) -> Vec<String>,
    /// Computes one unit: rows of the tables.
    pub compute: fn(&Work<'_>) -> Computed,
    /// Draws the figure of finished tables; the study supplies the title.
    pub draw: fn(&Drawing<'_>) -> Figure,
}
