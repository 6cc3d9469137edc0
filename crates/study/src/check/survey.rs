//! A case with the survey of its linear structure, known before anything is computed.

use crate::case::study::{Case, Study};
use crate::syntax::error::StudyError;
use std::cell::Cell;
use stickslip::method::StaticEquilibrium;
use stickslip::model::{Survey, System};

/// A case with the survey of its model.
#[derive(Debug)]
pub struct SurveyedCase {
    pub(crate) case: Case,
    pub(crate) survey: Survey,
    /// Constant loads act on a structure that can move freely, and no static equilibrium was
    /// found.
    pub(crate) lacks_equilibrium: bool,
}

impl SurveyedCase {
    /// Surveys case `index` of a study.
    pub(crate) fn new(study: &Study, index: usize) -> Result<Self, StudyError> {
        let case = study.case(index)?;
        // contacts that a constant load closes count as closed
        let is_missing = Cell::new(false);
        let forces = |system: &System| {
            let is_loaded = StaticEquilibrium::has_load(system);
            let found = if is_loaded { StaticEquilibrium::of(system) } else { None };
            is_missing.set(is_loaded && found.is_none());
            Some(found?.forces())
        };
        let system = study.assembled.system(&case.model);
        let system = system.map_err(|error| study.error_at("study", 0, error.key, error.to_string(), None))?;
        let survey = case.model.survey_of(&system, &forces);
        let lacks_equilibrium = is_missing.get() && survey.free().rigid > 0;
        Ok(SurveyedCase { case, survey, lacks_equilibrium })
    }
}

/// Returns the lowest and the highest excitation frequency of a case, rad/s.
pub(crate) fn frequency_range(case: &Case) -> Option<(f64, f64)> {
    if let Some(run_up) = case.values.table("run_up") {
        let (a, b) = (run_up.quantity("from")?, run_up.quantity("to")?);
        return Some((a.min(b), a.max(b)));
    }
    let frequencies = case.frequencies.as_ref()?;
    Some((frequencies.lowest()?, frequencies.highest()?))
}
