//! A study kind: its description, and how its studies are divided, computed and drawn.

use crate::case::study::Study;
use crate::check::size::{PlannedSize, SizeInputs};
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
    /// Counts the rows and the memory of its studies; errs on the high side.
    pub size: fn(&SizeInputs<'_>) -> PlannedSize,
    /// Likely mistakes in a study of this kind, as sentences. The argument is a sample of
    /// cases, spread over the study.
    pub warnings: fn(&[SurveyedCase]) -> Vec<String>,
    /// Measurement of the time of its studies in advance.
    pub probe: Probe,
    /// Computes one unit: the rows of its tables.
    pub compute: fn(&UnitTask<'_>) -> Computed,
    /// Draws the figure of finished tables. The caller sets the title.
    pub draw: fn(&FigureInput<'_>) -> Figure,
}

/// Computations that are measured to expect the time of a run.
#[derive(Debug, Clone, Copy)]
pub enum Probe {
    /// Two consecutive frequencies of a case.
    Points {
        /// Computes the points of a unit, without what belongs to the whole curve.
        compute: fn(&UnitTask<'_>) -> Computed,
        /// Computations that are not measured although they may take most of the time.
        excluded: fn(&Study) -> Option<&'static str>,
    },
    /// The beginning of a unit. The kind reports the computed part to [`UnitTask::share`].
    Unit {
        /// Kind of unit.
        name: &'static str,
    },
}
