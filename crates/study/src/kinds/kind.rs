//! A study kind: its description, and how its studies are divided, computed and drawn.

use crate::case::study::Study;
use crate::check::cost::{Cost, CostInputs};
use crate::check::survey::SurveyedCase;
use crate::kinds::info::KindInfo;
use crate::results::dataset::Figure;
use crate::results::drawing::FigureInput;
use crate::run::work::{Computed, UnitSize, UnitTask};

/// A row of the table of study kinds.
#[derive(Debug, Clone, Copy)]
pub struct Kind {
    /// Description of the kind.
    pub info: KindInfo,
    /// Divides its studies into units of work.
    pub unit_size: fn(&Study) -> UnitSize,
    /// Estimate of the size and the time of its studies; errs on the high side.
    pub cost: fn(&CostInputs<'_>) -> Cost,
    /// Likely mistakes in a study of this kind, as sentences. The argument is a sample of
    /// cases, spread over the study.
    pub warnings: fn(&[SurveyedCase]) -> Vec<String>,
    /// Computes one unit: the rows of its tables.
    pub compute: fn(&UnitTask<'_>) -> Computed,
    /// Draws the figure of finished tables. The caller sets the title.
    pub draw: fn(&FigureInput<'_>) -> Figure,
}
