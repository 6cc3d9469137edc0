//! Summary of a study before its run: linear modes, first slip of the joints, likely mistakes
//! and memory.
//!
//! All results come from the linear structure and from counting; no orbit is computed.
//!
//! - `text`: the summary in words;
//! - `structure`: the summary of a structure given by matrices;
//! - `bodies`: the rigid bodies in words;
//! - `mesh_fit`: warns of a mesh that does not belong to the matrices;
//! - `warnings`: likely mistakes, as sentences.

mod bodies;
mod mesh_fit;
mod structure;
mod text;
mod warnings;

pub use crate::compile::mesh::contact::{ContactPair, ContactSummary};
pub(crate) use structure::node_and_axis;
pub use structure::{StructureSummary, mass_along};
pub(crate) use text::line;

use crate::case::study::Study;
use crate::check::size::{SizeInputs, StudySize};
use crate::check::survey::{SurveyedCase, frequency_range};
use crate::kinds;
use crate::results::torsion_columns::of_rotation;
use crate::run::work::WorkUnits;
use crate::syntax::error::StudyError;
use serde_json::{Value as Json, json};
use std::f64::consts::TAU;
use stickslip::curve::bidirectional_sweep;
use stickslip::model::{FrictionDirection, LinearModes, SlipOnset, System};

/// Summary of a study before it is run.
#[derive(Debug, Clone)]
pub struct ModelSummary {
    /// The case that the summary shows: its varied parameters in words, empty if nothing is
    /// varied.
    pub case: String,
    /// Number of cases.
    pub cases: usize,
    /// Degrees of freedom.
    pub dofs: usize,
    /// The structure given by matrices, if there is one.
    pub structure: Option<StructureSummary>,
    /// The contacts between faces of its mesh.
    pub contacts: Vec<ContactSummary>,
    /// The rigid bodies in words; on a disk, those of the first sector.
    pub bodies: Vec<String>,
    /// Directions in which friction alone holds a body; on a disk, those of the first sector.
    pub held_by_friction: Vec<FrictionDirection>,
    /// True if the model has too many degrees of freedom for the modes, which are then absent.
    pub too_large: bool,
    /// True for a disk of equal sectors.
    pub is_tuned_disk: bool,
    /// Modes with all joints free.
    pub free: LinearModes,
    /// Modes with all joints stuck.
    pub stuck: LinearModes,
    /// The joints, in the order of the model.
    pub joints: Vec<JointSummary>,
    /// Number of orbits at one frequency, with the reason if there may be several. `None` if
    /// the study has no excitation or no joint, or if the structure is too large for a quick
    /// answer.
    pub orbits: Option<OrbitCount>,
    /// True for a model of rotation: limits are in N m, displacements in rad.
    pub is_torsional: bool,
    /// Lowest and highest excitation frequency of the study, rad/s.
    pub range: Option<(f64, f64)>,
    /// Likely mistakes: sentences that begin with `warning: `.
    pub warnings: Vec<String>,
    /// Size of the results and the memory.
    pub size: StudySize,
}

/// Number of orbits at one frequency.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum OrbitCount {
    /// One orbit, except for the offsets of stuck contacts: no two motions under the same
    /// excitation separate.
    One,
    /// Possibly several.
    Several {
        /// The reasons in words.
        reasons: String,
        /// True if `response` also sweeps downward in frequency.
        reverse_sweep: bool,
    },
}

impl OrbitCount {
    fn new(system: &System) -> Option<OrbitCount> {
        // Number of joints that are named as the reason for several orbits.
        let max_named_joints = 2;
        let several = |reasons: String| {
            Some(OrbitCount::Several { reasons, reverse_sweep: bidirectional_sweep::is_followed(system) })
        };
        let separating = system.joints().iter().filter(|joint| !joint.law().is_incrementally_passive());
        let mut reasons: Vec<String> =
            separating.map(|joint| format!("`{}` of {}", joint.law().name(), joint.name())).collect();
        if reasons.is_empty() {
            // on a large structure the answer takes three factorizations
            return match system.structure().is_sparse() {
                true => None,
                false if system.is_incrementally_stable() => Some(OrbitCount::One),
                false => several("the structure feeds energy into some motion".to_owned()),
            };
        }
        if let Some(more @ 1..) = reasons.len().checked_sub(max_named_joints) {
            reasons.truncate(max_named_joints);
            reasons.push(format!("{more} more"));
        }
        several(reasons.join(", "))
    }
}

/// State of a joint at rest, and its first slip.
#[derive(Debug, Clone)]
pub struct JointSummary {
    /// Name of the joint.
    pub name: String,
    /// Slip limit, N.
    pub limit: f64,
    /// Relative displacement at which it begins to slip, m; `None` if it is rigid until then.
    pub displacement: Option<f64>,
    /// True if it slips gradually before: micro-slip first, macro-slip at the limit.
    pub micro_slip: bool,
    /// For the normal direction of a contact: its force if nothing deforms, N, zero if it is
    /// open. `None` for directions that slip.
    pub normal_force: Option<f64>,
    /// The normal force at rest, after the structure has deformed, N; `None` if it is unknown.
    pub normal_force_at_rest: Option<f64>,
    /// Load by the excitation while all joints stick. `None` if the study has no excitation or
    /// the model is too large for a quick answer.
    pub onset: Option<SlipOnset>,
}

/// Factor on the excitation above which the first slip is due to rounding. Symmetry keeps the
/// load from some joints, but rounding errors of the other loads remain. A load above this
/// multiple of the slip limit comes from an undamped resonance, which has no bound.
const ROUNDING_SLIP_FACTOR: f64 = 1e6;

/// Returns the load of a joint by the excitation, relative to its limit; zero if it is due to
/// rounding.
fn relative_load(onset: &SlipOnset) -> f64 {
    if onset.largest * ROUNDING_SLIP_FACTOR < 1.0 { 0.0 } else { onset.largest }
}

impl ModelSummary {
    /// Summarizes a study.
    ///
    /// # Errors
    /// [`StudyError`]: a case cannot be resolved. The cases of a study that was read have been
    /// checked.
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
        let mut cases = vec![SurveyedCase::new(study, 0)?];
        let last = study.cases().saturating_sub(1);
        // Nine cases are checked for warnings, evenly spread over all cases. A warning about the
        // model is true for all of them.
        // Degrees of freedom above which only the first case is checked, so that a summary takes
        // at most a second.
        let others = if cases[0].survey.dofs() > 60 { 0 } else { last.min(8) };
        for i in 1..=others {
            cases.push(SurveyedCase::new(study, last * i / others)?);
        }
        // the first case in which the most joints have a positive limit: zero limits tell
        // nothing
        let holds = |one: &SurveyedCase| one.survey.first_slip().iter().filter(|slip| slip.limit > 0.0).count();
        let most = cases.iter().map(holds).max().unwrap_or(0);
        let shown = cases.iter().find(|one| holds(one) == most).unwrap_or(&cases[0]);
        let range = frequency_range(&shown.case);
        let first = &shown.survey;
        let onsets = range.and_then(|(from, to)| first.onset(from, to));
        let joints = first.first_slip().into_iter().enumerate().map(|(index, slip)| JointSummary {
            name: slip.joint,
            limit: slip.limit,
            displacement: slip.displacement,
            micro_slip: slip.gradual,
            normal_force: slip.preload,
            normal_force_at_rest: slip.equilibrium_force,
            onset: onsets.as_ref().map(|onsets| onsets[index].clone()),
        });
        let joints = joints.collect();
        let kind = kinds::kind_of(study);
        let counts = SizeInputs::new(study, &cases[0]);
        let mut held_by_friction = first.system().directions_held_by_friction();
        let sectors = shown.case.model.ring.map_or(1, |ring| ring.sectors.max(1));
        held_by_friction.truncate(held_by_friction.len().div_ceil(sectors));
        Ok(ModelSummary {
            case: shown.case.label(),
            cases: study.cases(),
            dofs: first.dofs(),
            structure: StructureSummary::new(study, &cases[0]),
            contacts: study.structure.mesh.contacts.clone(),
            bodies: bodies::described(&cases[0].case.model),
            held_by_friction,
            too_large: first.is_too_large(),
            is_tuned_disk: shown.case.model.ring.is_some_and(|ring| ring.equal),
            free: first.free().clone(),
            stuck: first.stuck().clone(),
            joints,
            orbits: range.filter(|_| !first.system().joints().is_empty()).and_then(|_| OrbitCount::new(first.system())),
            is_torsional: study.is_torsional(),
            range,
            warnings: warnings::all(study, (kind.warnings)(&cases), &cases),
            size: counts.size(&(kind.size)(&counts), WorkUnits::new(study, (kind.unit_size)(study)).len()),
        })
    }

    /// Returns the summary for the record of a run, in SI except frequencies in Hz.
    pub fn to_json(&self) -> Json {
        let modes = |modes: &LinearModes| {
            json!({
                "frequencies_Hz": modes.elastic.iter().map(|mode| mode.omega / TAU).collect::<Vec<_>>(),
                "damping_ratios": modes.elastic.iter().map(|mode| mode.damping).collect::<Vec<_>>(),
                "rigid": modes.rigid,
                "lost": modes.unresolved,
            })
        };
        let column = |name: &'static str| if self.is_torsional { of_rotation(name) } else { name.into() };
        let joint = |joint: &JointSummary| {
            json!({
                "name": joint.name,
                column("limit_N"): Some(joint.limit).filter(|limit| limit.is_finite()),
                "slips_gradually": joint.micro_slip,
                "pressed_N": joint.normal_force,
                "pressed_at_rest_N": joint.normal_force_at_rest,
                column("slip_displacement_m"): joint.displacement.filter(|displacement| displacement.is_finite()),
                "slips_at_excitation_times": joint.onset.as_ref().map(|onset| 1.0 / relative_load(onset)).filter(|x| x.is_finite()),
                "most_loaded_at_Hz": joint.onset.as_ref().filter(|onset| relative_load(onset) > 0.0).map(|onset| onset.omega / TAU),
                "slips_Hz": joint.onset.as_ref()
                    .map(|onset| onset.slip_ranges.iter().map(|(a, b)| [a / TAU, b / TAU]).collect::<Vec<_>>()),
            })
        };
        json!({
            "case": self.case,
            "degrees_of_freedom": self.dofs,
            "bodies": self.bodies,
            "held_by_friction": self.held_by_friction.iter().map(|one| one.place.as_str()).collect::<Vec<_>>(),
            "structure": self.structure.as_ref().map(StructureSummary::to_json),
            "contacts": self.contacts.iter().map(ContactSummary::to_json).collect::<Vec<_>>(),
            "joints_free": modes(&self.free),
            "joints_stuck": modes(&self.stuck),
            "joints": self.joints.iter().map(joint).collect::<Vec<_>>(),
            "one_orbit_at_a_frequency": self.orbits.as_ref().map(|orbits| *orbits == OrbitCount::One),
            "rows": self.size.rows,
            "result_bytes": self.size.results,
            "memory_bytes": self.size.memory,
        })
    }
}
