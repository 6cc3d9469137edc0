//! What a study says of itself before it is run: the linear modes of its model, when its joints first slip, what looks
//! like a mistake, and how much memory and time it will take.
//!
//! Everything here comes from the linear structure and from counting; no orbit is computed.

mod bodies;
mod structure;
mod text;
mod warnings;

pub use structure::{DIRECTIONS, StructureSummary, mass_along};

use crate::cost::{Cost, Costing, Size};
use crate::error::StudyError;
use crate::kinds;
use crate::study::Study;
use crate::survey::{Surveyed, range};
use crate::work::Units;
use serde_json::{Value as Json, json};
use std::f64::consts::TAU;
use stickslip::model::{Modes, Onset, System};

/// What is known of a study before it is run.
#[derive(Debug, Clone)]
pub struct ModelSummary {
    /// The case whose numbers are shown: its varied parameters in words, empty if nothing is varied.
    pub case: String,
    /// Number of cases.
    pub cases: usize,
    /// Degrees of freedom.
    pub dofs: usize,
    /// The structure by its matrices, if there is one.
    pub structure: Option<StructureSummary>,
    /// The rigid bodies in words, those of the first sector of a disk.
    pub bodies: Vec<String>,
    /// Whether these are too many for the modes, which are then absent.
    pub too_large: bool,
    /// Modes with all joints free.
    pub free: Modes,
    /// Modes with all joints stuck.
    pub stuck: Modes,
    /// The joints, in the order of the model.
    pub joints: Vec<JointSummary>,
    /// Whether there may be several orbits at one frequency, and why; `None` where the study has no drive or no joint, or the structure is too
    /// large for a quick answer.
    pub orbits: Option<Orbits>,
    /// The drive frequencies of the study, lowest and highest, rad/s.
    pub range: Option<(f64, f64)>,
    /// What looks like a mistake: sentences that begin with `warning: `.
    pub warnings: Vec<String>,
    /// What it will hold.
    pub size: Size,
    /// What it will mostly take on one thread, s; rough.
    pub usual_seconds: f64,
    /// What it takes instead where the results do not ask for all of it, s, and where that is, in words.
    pub spared: Option<(f64, &'static str)>,
    /// What it may take where orbits are hard to find, s; rough, and rather too long than too short.
    pub seconds: f64,
}

/// How many orbits there are at one frequency.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Orbits {
    /// One, up to offsets that stuck contacts keep: no two motions under the same drive separate.
    One,
    /// Maybe several, for this reason.
    Several(String),
}

impl Orbits {
    fn new(system: &System) -> Option<Orbits> {
        let separating = system.joints().iter().filter(|joint| !joint.law().is_incrementally_passive());
        let mut of: Vec<String> =
            separating.map(|joint| format!("`{}` of {}", joint.law().name(), joint.name())).collect();
        if of.is_empty() {
            // of a large structure the answer takes three factors
            return match system.structure().is_sparse() {
                true => None,
                false if system.contracts() => Some(Orbits::One),
                false => Some(Orbits::Several("the structure gives energy to some motion".to_owned())),
            };
        }
        if let Some(more @ 1..) = of.len().checked_sub(NAMED) {
            of.truncate(NAMED);
            of.push(format!("{more} more"));
        }
        Some(Orbits::Several(of.join(", ")))
    }
}

/// Joints that are named as the reason for several orbits.
const NAMED: usize = 2;

/// When a joint begins to slip.
#[derive(Debug, Clone)]
pub struct JointSummary {
    /// Name.
    pub name: String,
    /// Slip limit, N.
    pub limit: f64,
    /// Relative displacement at which it gives way, m; `None` if it holds rigidly until then.
    pub displacement: Option<f64>,
    /// Whether it slips little by little before: micro-slip, and macro-slip at the limit.
    pub gradual: bool,
    /// Of the direction along which faces press on each other: the force with which they do where nothing gives way, N, zero if
    /// they are apart. `None` along those that slip.
    pub pressed: Option<f64>,
    /// What is left of it at rest, after the structure has given way, N; `None` where nobody knows.
    pub at_rest: Option<f64>,
    /// What the excitation does to it while all joints stick; `None` where the study has no drive or the model is too
    /// large for a quick answer.
    pub onset: Option<Onset>,
}

/// Cases that are looked at for warnings, evenly spread over all of them: a warning about the model holds for each of
/// these.
const LOOKED_AT: usize = 9;
/// The longest time that a study may take is told if it is longer than what it usually takes by this factor, and not soon over, s.
const WIDE: f64 = 3.0;
const SOON: f64 = 5.0;
/// A run that takes longer says so at its start, s.
const LONG_RUN: f64 = 3600.0;
/// Degrees of freedom beyond which only the first case is looked at, so that a summary takes no longer than a second.
const LARGE: usize = 60;

/// Times the excitation, beyond which the first slip is one by rounding: what symmetry keeps from a joint loads it by the last digits of the others. A
/// share of it below which the load is one by rounding too: that of an undamped resonance has no bound.
const UNLOADED: f64 = 1e6;

/// What the excitation does to a joint as a share of its limit, zero where that is rounding.
fn load(onset: &Onset) -> f64 {
    if onset.largest * UNLOADED < 1.0 { 0.0 } else { onset.largest }
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
        let mut cases = vec![Surveyed::new(study, 0)?];
        let last = study.cases().saturating_sub(1);
        let others = if cases[0].survey.dofs() > LARGE { 0 } else { last.min(LOOKED_AT - 1) };
        for i in 1..=others {
            cases.push(Surveyed::new(study, last * i / others)?);
        }
        // a joint whose limit is zero tells nothing: the first case in which most of them hold
        let holds = |one: &Surveyed| one.survey.first_slip().iter().filter(|slip| slip.limit > 0.0).count();
        let most = cases.iter().map(holds).max().unwrap_or(0);
        let shown = cases.iter().find(|one| holds(one) == most).unwrap_or(&cases[0]);
        let range = range(&shown.case);
        let first = &shown.survey;
        let onsets = range.and_then(|(from, to)| first.onset(from, to));
        let joints = first.first_slip().into_iter().enumerate().map(|(index, slip)| JointSummary {
            name: slip.joint,
            limit: slip.limit,
            displacement: slip.displacement,
            gradual: slip.gradual,
            pressed: slip.pressed,
            at_rest: slip.at_rest,
            onset: onsets.as_ref().map(|onsets| onsets[index].clone()),
        });
        let joints = joints.collect();
        let kind = kinds::of(study);
        let costings: Vec<Costing<'_>> = cases.iter().map(|one| Costing::new(study, one)).collect();
        // each as if all cases were like it
        let time = |costing: &Costing<'_>| costing.seconds(&(kind.cost)(costing));
        let mean =
            |times: &dyn Fn(&Costing<'_>) -> f64| costings.iter().map(times).sum::<f64>() / costings.len() as f64;
        let (usual_seconds, seconds) = (mean(&|one| time(&one.usual())), mean(&time));
        let (slow, usual) = (&costings[0], costings[0].usual());
        let (cost, usual_cost) = ((kind.cost)(slow), (kind.cost)(&usual));
        let whole = usual.seconds(&usual_cost);
        let spared = usual_cost.spared.map(|(work, place)| {
            let rest = Cost { work: usual_cost.work - work, ..usual_cost };
            (usual_seconds * usual.seconds(&rest) / whole, place)
        });
        Ok(ModelSummary {
            case: shown.case.label(),
            cases: study.cases(),
            dofs: first.dofs(),
            structure: StructureSummary::new(study, &cases[0]),
            bodies: bodies::described(&cases[0].case.model),
            too_large: first.is_too_large(),
            free: first.free().clone(),
            stuck: first.stuck().clone(),
            joints,
            orbits: range.filter(|_| !first.system().joints().is_empty()).and_then(|_| Orbits::new(first.system())),
            range,
            warnings: warnings::all(study, (kind.warnings)(&cases), &cases),
            size: slow.size(&cost, Units::of(study, (kind.grain)(study)).len()),
            usual_seconds,
            spared,
            seconds: seconds.max(usual_seconds),
        })
    }

    /// That a run takes so long that it should be known before; `None` of short ones. The estimate is rough, and of one thread.
    pub fn long_run(&self) -> Option<String> {
        (self.seconds >= LONG_RUN).then(|| {
            let time = self.time();
            format!("this takes {time}; `check` says it before, and Ctrl-C ends the run and keeps the finished points")
        })
    }

    /// How long it will take, in words.
    pub(crate) fn time(&self) -> String {
        let mut usual = format!("{} on one thread", crate::words::about(self.usual_seconds));
        if let Some((seconds, place)) = self.spared
            && self.usual_seconds >= (WIDE * seconds).max(SOON)
        {
            usual += &format!(", {} {place}", crate::words::about(seconds));
        }
        if self.seconds < WIDE * self.usual_seconds || self.seconds < SOON {
            return usual;
        }
        format!("{usual}, up to {} where orbits are hard to find", crate::words::duration(self.seconds))
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
                "limit_N": Some(joint.limit).filter(|limit| limit.is_finite()),
                "slips_gradually": joint.gradual,
                "pressed_N": joint.pressed,
                "pressed_at_rest_N": joint.at_rest,
                "slip_displacement_m": joint.displacement.filter(|displacement| displacement.is_finite()),
                "slips_at_excitation_times": joint.onset.as_ref().map(|onset| 1.0 / load(onset)).filter(|x| x.is_finite()),
                "most_loaded_at_Hz": joint.onset.as_ref().filter(|onset| load(onset) > 0.0).map(|onset| onset.at / TAU),
                "slips_Hz": joint.onset.as_ref()
                    .map(|onset| onset.slips.iter().map(|(a, b)| [a / TAU, b / TAU]).collect::<Vec<_>>()),
            })
        };
        json!({
            "case": self.case,
            "degrees_of_freedom": self.dofs,
            "bodies": self.bodies,
            "structure": self.structure.as_ref().map(StructureSummary::to_json),
            "joints_free": modes(&self.free),
            "joints_stuck": modes(&self.stuck),
            "joints": self.joints.iter().map(joint).collect::<Vec<_>>(),
            "one_orbit_at_a_frequency": self.orbits.as_ref().map(|orbits| *orbits == Orbits::One),
            "rows": self.size.rows,
            "result_bytes": self.size.results,
            "memory_bytes": self.size.memory,
            "usual_time_s": self.usual_seconds,
            "estimated_time_s": self.seconds,
        })
    }
}
