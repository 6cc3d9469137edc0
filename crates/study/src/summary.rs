//! What a study says of itself before it is run: the linear modes of its model, when its joints first slip, what looks
//! like a mistake, and how much memory and time it will take.
//!
//! Everything here comes from the linear structure and from counting; no orbit is computed.

mod cost;
mod text;
mod warnings;

pub(crate) use cost::default_limit;
pub use cost::{Cost, Costing, MEMORY_LIMIT, Shape, Size, bytes_text};
pub(crate) use warnings::{WARNING, driven, mode_sticks, moved, resonant};

use crate::error::StudyError;
use crate::study::{Case, Study};
use serde_json::{Value as Json, json};
use std::f64::consts::TAU;
use stickslip::model::{Modes, Onset, Survey};

/// What is known of a study before it is run.
#[derive(Debug, Clone)]
pub struct ModelSummary {
    /// The case whose numbers are shown: its varied parameters in words, empty if nothing is varied.
    pub case: String,
    /// Number of cases.
    pub cases: usize,
    /// Degrees of freedom.
    pub dofs: usize,
    /// Whether these are too many for the modes, which are then absent.
    pub too_large: bool,
    /// Modes with all joints free.
    pub free: Modes,
    /// Modes with all joints stuck.
    pub stuck: Modes,
    /// The joints, in the order of the model.
    pub joints: Vec<JointSummary>,
    /// The drive frequencies of the study, lowest and highest, rad/s.
    pub range: Option<(f64, f64)>,
    /// What looks like a mistake: sentences that begin with `warning: `.
    pub warnings: Vec<String>,
    /// What it will hold.
    pub size: Size,
    /// What it will take on one thread, s; rough, and rather too long than too short.
    pub seconds: f64,
}

/// When a joint begins to slip.
#[derive(Debug, Clone)]
pub struct JointSummary {
    /// Name.
    pub name: String,
    /// Slip limit, N.
    pub limit: f64,
    /// Relative displacement at which it gives way, m; `None` if it holds rigidly until then.
    pub displacement: Option<f64>,
    /// What the excitation does to it while all joints stick; `None` where the study has no drive or the model is too
    /// large for a quick answer.
    pub onset: Option<Onset>,
}

/// Cases that are looked at for warnings, evenly spread over all of them: a warning about the model holds for each of
/// these.
const LOOKED_AT: usize = 9;
/// Degrees of freedom beyond which only the first case is looked at, so that a summary takes no longer than a second.
const LARGE: usize = 60;

/// A case and what is known of its model.
#[derive(Debug)]
pub struct Surveyed {
    case: Case,
    survey: Survey,
}

impl ModelSummary {
    /// Summarises a study.
    ///
    /// # Errors
    /// [`StudyError`]: a case cannot be resolved. The cases of a study that was read have been checked.
    ///
    /// # Example
    /// ```
    /// use stickslip_study::{read_study, summary::ModelSummary, templates};
    /// let text = templates::find("blade-couple").unwrap().study;
    /// let summary = ModelSummary::new(&read_study("couple.toml", text, &[]).unwrap()).unwrap();
    /// assert_eq!((summary.dofs, summary.free.elastic.len(), summary.warnings.len()), (3, 3, 0));
    /// assert!(summary.to_string().contains("120.94"));   // a stuck mode, Hz
    /// ```
    pub fn new(study: &Study) -> Result<ModelSummary, StudyError> {
        let surveyed = |index: usize| -> Result<Surveyed, StudyError> {
            let case = study.case(index)?;
            let survey = case.model.survey();
            let survey = survey.map_err(|error| study.error_at("study", 0, error.key, error.to_string(), None))?;
            Ok(Surveyed { case, survey })
        };
        let mut cases = vec![surveyed(0)?];
        let last = study.cases().saturating_sub(1);
        let others = if cases[0].survey.dofs() > LARGE { 0 } else { last.min(LOOKED_AT - 1) };
        for i in 1..=others {
            cases.push(surveyed(last * i / others)?);
        }
        let range = range(&cases[0].case);
        let first = &cases[0].survey;
        let onsets = range.and_then(|(from, to)| first.onset(from, to));
        let joints = first.first_slip().into_iter().enumerate().map(|(index, slip)| JointSummary {
            name: slip.joint,
            limit: slip.limit,
            displacement: slip.displacement,
            onset: onsets.as_ref().map(|onsets| onsets[index].clone()),
        });
        let joints = joints.collect();
        let (size, seconds) = cost::cost(study, &cases[0]);
        Ok(ModelSummary {
            case: cases[0].case.label(),
            cases: study.cases(),
            dofs: first.dofs(),
            too_large: first.is_too_large(),
            free: first.free().clone(),
            stuck: first.stuck().clone(),
            joints,
            range,
            warnings: warnings::all(study, &cases),
            size,
            seconds,
        })
    }

    /// For the record of a run, SI but for the frequencies in Hz.
    pub fn to_json(&self) -> Json {
        let modes = |modes: &Modes| {
            json!({
                "frequencies_Hz": modes.elastic.iter().map(|mode| mode.omega / TAU).collect::<Vec<_>>(),
                "damping_ratios": modes.elastic.iter().map(|mode| mode.damping).collect::<Vec<_>>(),
                "rigid": modes.rigid,
                "lost": modes.lost,
            })
        };
        let joint = |joint: &JointSummary| {
            json!({
                "name": joint.name,
                "limit_N": joint.limit,
                "slip_displacement_m": joint.displacement,
                "slips_at_excitation_times": joint.onset.as_ref().map(|onset| 1.0 / onset.largest).filter(|x| x.is_finite()),
                "most_loaded_at_Hz": joint.onset.as_ref().map(|onset| onset.at / TAU),
                "slips_Hz": joint.onset.as_ref()
                    .map(|onset| onset.slips.iter().map(|(a, b)| [a / TAU, b / TAU]).collect::<Vec<_>>()),
            })
        };
        json!({
            "case": self.case,
            "degrees_of_freedom": self.dofs,
            "joints_free": modes(&self.free),
            "joints_stuck": modes(&self.stuck),
            "joints": self.joints.iter().map(joint).collect::<Vec<_>>(),
            "rows": self.size.rows,
            "result_bytes": self.size.results,
            "memory_bytes": self.size.memory,
            "estimated_time_s": self.seconds,
        })
    }
}

/// Lowest and highest drive frequency of a case, rad/s.
fn range(case: &Case) -> Option<(f64, f64)> {
    if let Some(run_up) = case.values.table("run_up") {
        let (a, b) = (run_up.quantity("from")?, run_up.quantity("to")?);
        return Some((a.min(b), a.max(b)));
    }
    let frequencies = case.frequencies.as_ref()?;
    let ends = frequencies.iter().fold((f64::INFINITY, 0.0f64), |(a, b), w| (a.min(w), b.max(w)));
    (ends.0 <= ends.1).then_some(ends)
}
