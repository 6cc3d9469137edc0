//! Notes for the reader of the results, as sentences. Notes of one kind from several units
//! become one sentence.

use crate::run::basis_check::SlipReductionCheck;
use crate::syntax::expression::quantity_text;
use crate::syntax::format::{format_significant, plural_suffix};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use stickslip::dimension::Dimension;
use stickslip::law::IdealElement;
use stickslip::model::{Joint, Model};
use stickslip::orbit::{Accuracy, JointMotion, Orbit, PlaceMotion};
use stickslip::structure::Reduction;

/// Prefix of a note that is a warning.
pub(crate) const WARNING: &str = "warning: ";

/// Largest number of cases with a permanently stuck joint that are named one by one. The points
/// of all other such cases are counted together.
const MAX_STUCK_CASES: usize = 4;

/// Says which orbit of a continuum is reported.
const REPORTED_ORBIT: &str = "Reported: the orbit reached from static equilibrium under the constant loads; where `found_by` is \
    `growing-vibration`, the excitation was then raised in steps. A permanently stuck rigid joint stays where the \
    solver found it; method `transient` reports the orbit in which its run ended.";

/// A note.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Note {
    /// A sentence about the whole study.
    #[serde(rename = "Said")]
    Sentence(String),
    /// A sentence about one or several cases.
    #[serde(rename = "Of")]
    Cases {
        /// Number of cases.
        cases: usize,
        /// The first cases, at most three.
        named: Vec<String>,
        /// The sentence. It begins with [`WARNING`] if it is a warning.
        text: String,
    },
    /// Number of points whose series is too short, and the largest estimated error.
    Truncated(usize, f64),
    /// Number of points whose amplitudes depend on the history of a stuck joint, and the
    /// largest relative change.
    HistorySpread(usize, f64),
    /// Rotations of rigid bodies that are not small.
    LargeRotation {
        /// Number of points.
        points: usize,
        /// The rotation with the largest value.
        place: String,
        /// This value, rad.
        largest: f64,
    },
    /// Like `Truncated`, on a branch: its harmonics are given, and it has no other method.
    TruncatedOnBranch(usize, f64),
    /// Number of points whose series was not compared with a longer one.
    #[serde(rename = "Unchecked")]
    UnknownError(usize),
    /// Number of points whose orbit is unstable. The second number counts those of them whose
    /// orbit repeats after fewer periods than requested.
    Unstable(usize, usize),
    /// Number of points with a permanently stuck part of a joint in a motion without
    /// half-period symmetry.
    #[serde(rename = "History")]
    StuckOffset(usize),
    /// Like `StuckOffset`, with another joint whose force depends on the positions of the bodies.
    /// The names are those of the first point.
    #[serde(rename = "Several")]
    SeveralOrbits {
        /// Number of points.
        points: usize,
        /// The stuck joint.
        stuck: String,
        /// The joint whose force depends on the positions.
        #[serde(rename = "knows")]
        position_dependent: String,
    },
    /// Points of a curve that has another orbit there when it is followed in the other
    /// direction.
    OtherOrbit {
        /// Number of points.
        points: usize,
        /// Lowest excitation frequency of these points, rad/s.
        from: f64,
        /// Highest excitation frequency of these points, rad/s.
        to: f64,
        /// Smallest and largest ratio of the other orbit's largest amplitude to that of the
        /// orbit in the table.
        ratios: [f64; 2],
    },
    /// Points at which the method chosen by `auto` found no orbit and another method did.
    #[serde(rename = "Instead")]
    OtherMethod {
        /// Number of points.
        points: usize,
        /// The chosen method.
        chosen: String,
        /// The method that found the orbits.
        found: String,
    },
    /// Number of points with unknown stability in a model that may be unstable: friction falls with
    /// velocity, or the stiffness or damping of a spring is negative.
    #[serde(rename = "Unjudged")]
    UnknownStability(usize),
    /// Time histories on a reduced model. Its error is known for harmonic forces up to this
    /// frequency, rad/s.
    #[serde(rename = "InTime")]
    TimeHistory(f64),
    /// Points at which joints slip on a reduced model.
    Slipping(SlipReductionCheck),
    /// Points of one case at which a joint is permanently stuck.
    Stuck {
        /// The varied parameters of the case, in words.
        case: String,
        /// Number of points with a stuck joint.
        points: usize,
        /// Number of all points.
        #[serde(rename = "of")]
        total: usize,
    },
    /// Number of points with a stuck joint in the cases beyond [`MAX_STUCK_CASES`].
    #[serde(rename = "StuckElsewhere")]
    StuckInOtherCases(usize),
}

impl Note {
    /// A sentence about one case or one of its points. `case` is empty if there is only one.
    /// The text begins with [`WARNING`] if it is a warning.
    pub(crate) fn for_case(case: &str, text: impl Into<String>) -> Note {
        if case.is_empty() {
            return Note::Sentence(text.into());
        }
        Note::Cases { cases: 1, named: vec![case.to_owned()], text: text.into() }
    }

    /// Returns the notes of one orbit. They state a method that replaced the chosen one, and
    /// instability if it is known ([`Orbit::is_stable`]). They also state the accuracy of the
    /// series, other possible orbits and the limits of the reduced model.
    pub(crate) fn for_orbit(model: &Model, orbit: &Orbit, stable: Option<bool>) -> Vec<Note> {
        let early = || usize::from(orbit.periods > 1 && orbit.minimal_periods() < orbit.periods);
        let unstable = (stable == Some(false)).then(|| Note::Unstable(1, early()));
        let accuracy = match orbit.evidence.accuracy {
            Accuracy::Truncated => Some(Note::Truncated(1, orbit.evidence.error_estimate.unwrap_or(0.0))),
            Accuracy::Unchecked => Some(Note::UnknownError(1)),
            Accuracy::Converged => None,
        };
        let instead = orbit.evidence.fallback_from.map(|chosen| Note::OtherMethod {
            points: 1,
            chosen: chosen.to_owned(),
            found: orbit.method.to_owned(),
        });
        let falls = |joint: &Joint| joint.law.prox().is_some() && !joint.law.is_incrementally_passive();
        let may_be_unstable = model.joints.iter().any(falls)
            || model.springs.iter().any(|spring| spring.stiffness < 0.0 || spring.damping < 0.0);
        let unjudged = (stable.is_none() && may_be_unstable).then_some(Note::UnknownStability(1));
        let said = instead.into_iter().chain(unstable).chain(unjudged).chain(accuracy);
        // Relative change of the amplitudes with the history above which it is reported: the
        // tolerance of harmonic balance.
        let spread = orbit.evidence.history_spread.filter(|spread| *spread > 1e-3);
        let range = spread.map(|spread| Note::HistorySpread(1, spread));
        said.chain(Note::stuck_offset_note(model, orbit))
            .chain(range)
            .chain(Note::large_rotation(orbit))
            .chain(Note::slipping_note(model, orbit))
            .collect()
    }

    /// Returns a note if a body rotates so far that its displacements are no longer linear in
    /// the rotation.
    fn large_rotation(orbit: &Orbit) -> Option<Note> {
        let rotations = orbit.places.iter().filter(|place| place.rotation_radius.is_some());
        let angle = |place: &PlaceMotion| place.maximum.abs().max(place.minimum.abs());
        let (place, largest) = rotations.map(|place| (place, angle(place))).max_by(|a, b| a.1.total_cmp(&b.1))?;
        // Rotation (rad) from which displacements have an error of 0.5 %, `θ²/2`.
        (largest > 0.1).then(|| Note::LargeRotation { points: 1, place: place.name.clone(), largest })
    }

    /// Returns a note if friction produces harmonics above the frequency range of the reduced
    /// model.
    fn slipping_note(model: &Model, orbit: &Orbit) -> Option<Note> {
        let up_to = match model.substructure.as_ref()?.reduction {
            Reduction::UpTo { up_to, .. } | Reduction::Modes { up_to, .. } => up_to,
            Reduction::None { .. } => return None,
        };
        SlipReductionCheck::from_orbit(orbit, up_to).map(Note::Slipping)
    }

    /// Returns a note if the orbit is one of several. Their amplitudes differ if the stiffness
    /// of another joint depends on the positions of the bodies.
    fn stuck_offset_note(model: &Model, orbit: &Orbit) -> Option<Note> {
        let stuck = orbit.evidence.history_dependent.first()?.clone();
        let joint_of = |name: &str| model.joints.iter().find(|joint| joint.name == name);
        let is_rigid =
            |piece: &IdealElement| matches!(piece, IdealElement::Slider(slider) if slider.stiffness.is_none());
        let holds = |joint: &Joint| joint.law.ideal_elements().unwrap_or_default().iter().any(is_rigid);
        let rigid = orbit.evidence.stuck.iter().any(|name| joint_of(name).is_some_and(holds));
        // An elastic stuck joint relaxes near the mean of the motion. A contact that stays
        // closed has a constant stiffness there.
        let knows = orbit.joints.iter().find(|motion| {
            joint_of(&motion.name).is_some_and(|joint| match joint.law.normal() {
                Some(_) => rigid || motion.open_fraction > 0.0,
                None => is_curved(joint, motion),
            })
        });
        let Some(knows) = knows.map(|motion| motion.name.clone()) else { return Some(Note::StuckOffset(1)) };
        Some(Note::SeveralOrbits { points: 1, stuck, position_dependent: knows })
    }

    /// Changes the note to its form for an orbit of a branch.
    pub(crate) fn for_branch(self) -> Note {
        match self {
            Note::Truncated(points, largest) => Note::TruncatedOnBranch(points, largest),
            other => other,
        }
    }

    /// Adds the note to `notes`, to one of its kind if there is one. The result does not depend
    /// on the order of grouping.
    pub(crate) fn merge_into(self, notes: &mut Vec<Note>) {
        let Some(note) = self.merge_stuck(notes) else { return };
        note.merge(notes);
    }

    /// Joins a note of stuck points. Cases follow each other, so only the last stuck note of
    /// the list can continue. A last note without stuck points is removed when another case
    /// begins. The first note of the list stays, because it may continue the last note of
    /// another list.
    fn merge_stuck(self, notes: &mut Vec<Note>) -> Option<Note> {
        let Note::Stuck { case, points, total: of } = self else { return Some(self) };
        let is_stuck = |note: &Note| matches!(note, Note::Stuck { .. });
        let (first, last) = (notes.iter().position(is_stuck), notes.iter().rposition(is_stuck));
        if let Some(Note::Stuck { case: known, points: before, total: all }) = last.and_then(|at| notes.get_mut(at)) {
            if *known == case {
                *before += points;
                *all += of;
                return None;
            }
            if let (0, Some(at)) = (*before, last.filter(|_| last != first)) {
                notes.remove(at);
            }
        }
        let named = notes.iter().filter(|note| matches!(note, Note::Stuck { points: 1.., .. })).count();
        match (named < MAX_STUCK_CASES, points) {
            (true, _) => Some(Note::Stuck { case, points, total: of }),
            (false, 0) => None,
            (false, _) => Some(Note::StuckInOtherCases(points)),
        }
    }

    fn merge(self, notes: &mut Vec<Note>) {
        for known in notes.iter_mut() {
            match (known, &self) {
                (Note::Sentence(known), Note::Sentence(more)) if known == more => return,
                (Note::Cases { cases, named, text }, Note::Cases { cases: more, named: others, text: same })
                    if text == same =>
                {
                    *cases += more;
                    // Largest number of cases that a note names. If it applies to more cases, it
                    // gives their number.
                    let free_names = 3usize.saturating_sub(named.len());
                    named.extend(others.iter().take(free_names).cloned());
                    return;
                }
                (
                    Note::OtherOrbit { points, from, to, ratios: [least, most] },
                    Note::OtherOrbit { points: more, from: low, to: high, ratios: other },
                ) => {
                    *points += more;
                    (*from, *to) = (from.min(*low), to.max(*high));
                    (*least, *most) = (least.min(other[0]), most.max(other[1]));
                    return;
                }
                (Note::Truncated(points, largest), Note::Truncated(more, other))
                | (Note::HistorySpread(points, largest), Note::HistorySpread(more, other))
                | (Note::TruncatedOnBranch(points, largest), Note::TruncatedOnBranch(more, other)) => {
                    *points += more;
                    *largest = largest.max(*other);
                    return;
                }
                (
                    Note::LargeRotation { points, place, largest },
                    Note::LargeRotation { points: more, place: other, largest: value },
                ) => {
                    *points += more;
                    // the result does not depend on the order of the points
                    if *value > *largest || (value == largest && other < place) {
                        (*place, *largest) = (other.clone(), *value);
                    }
                    return;
                }
                (Note::UnknownError(points), Note::UnknownError(more))
                | (Note::StuckOffset(points), Note::StuckOffset(more))
                | (Note::UnknownStability(points), Note::UnknownStability(more))
                | (Note::StuckInOtherCases(points), Note::StuckInOtherCases(more)) => {
                    *points += more;
                    return;
                }
                (Note::SeveralOrbits { points, .. }, Note::SeveralOrbits { points: more, .. }) => {
                    *points += more;
                    return;
                }
                (
                    Note::OtherMethod { points, chosen, found },
                    Note::OtherMethod { points: more, chosen: first, found: second },
                ) if (&*chosen, &*found) == (first, second) => {
                    *points += more;
                    return;
                }
                (Note::TimeHistory(up_to), Note::TimeHistory(more)) => {
                    *up_to = up_to.min(*more);
                    return;
                }
                (Note::Slipping(slipping), Note::Slipping(more)) => {
                    slipping.join(more);
                    return;
                }
                (Note::Unstable(points, early), Note::Unstable(more, other)) => {
                    *points += more;
                    *early += other;
                    return;
                }
                _ => {}
            }
        }
        notes.push(self);
    }

    /// Returns the sentence, or `None` if there is nothing to report.
    pub(crate) fn text(&self) -> Option<String> {
        let points = |count: usize| format!("{count} point{}", plural_suffix(count));
        match self {
            Note::Sentence(text) => Some(text.clone()),
            Note::Cases { cases, named, text } => {
                let (warning, said) = text.strip_prefix(WARNING).map_or(("", text.as_str()), |said| (WARNING, said));
                let first = named.join("; ");
                Some(match cases - named.len() {
                    0 => format!("{warning}{first}: {said}"),
                    more => format!("{warning}{cases} cases ({first} and {more} more): {said}"),
                })
            }
            Note::HistorySpread(count, largest) => Some(format!(
                "{WARNING}at {} the amplitudes depend on the history of a stuck joint: they change by up to {} % if the \
                 joint starts with zero or reversed friction force instead of that of static equilibrium.",
                points(*count),
                format_significant(100.0 * largest, 2)
            )),
            Note::Truncated(count, largest) => Some(format!(
                "At {} the series is too short: its estimated error is up to {largest:.1e} and exceeds the \
                 `tolerance` of the method. Remove or raise `harmonics` if it is stated, raise `tolerance` if this \
                 error is acceptable, or use `event-driven` if it accepts all laws.",
                points(*count)
            )),
            Note::LargeRotation { points: count, place, largest } => Some(format!(
                "{WARNING}at {} `{place}` reaches {} deg: the model takes rotations of bodies as small, and its \
                 displacements have an error of about {} % at this angle.",
                points(*count),
                format_significant(largest.to_degrees(), 2),
                format_significant(50.0 * largest * largest, 1)
            )),
            Note::TruncatedOnBranch(count, largest) => Some(format!(
                "At {} of the branch the series is too short: its estimated error is up to {largest:.1e} and exceeds \
                 `tolerance`. Raise `harmonics` in [study], or `tolerance` if this error is acceptable. To compare \
                 with other methods, use kind = \"response\".",
                points(*count)
            )),
            Note::UnknownError(count) => Some(format!(
                "At {} the error of the series is unknown: the longer series for the comparison has too many \
                 unknowns or was not found. Use fewer `harmonics`.",
                points(*count)
            )),
            Note::Unstable(count, early) => {
                let early = match early {
                    0 => String::new(),
                    early => format!(
                        "; at {} of them it repeats after fewer periods than `period` requests, and no orbit with \
                         that many periods was found",
                        early
                    ),
                };
                Some(format!(
                    "warning: at {} the orbit is unstable (`stable` is false): the real motion leaves it{early}. \
                     Find the real motion with kind = \"transient\", or with the option `period` of a method if it \
                     may repeat after several periods.",
                    points(*count)
                ))
            }
            Note::StuckOffset(count) => Some(format!(
                "At {} a joint, or a part of it, sticks permanently in a motion without half-period symmetry: its \
                 position and the mean values depend on the history. {REPORTED_ORBIT}",
                points(*count)
            )),
            Note::SeveralOrbits { points: count, stuck, position_dependent: knows } => Some(format!(
                "warning: at {} several orbits are possible: `{stuck}`, or a part of it, sticks permanently. Its \
                 position depends on the history, and so do the force of `{knows}` and the amplitudes. {REPORTED_ORBIT} \
                 kind = \"transient\" follows the motion from a given start.",
                points(*count)
            )),
            Note::OtherOrbit { points: count, from, to, ratios: [least, most] } => {
                let hertz = |omega: f64| format_significant(omega / TAU, 6);
                let higher = (*most >= 1.0).then(|| format!("up to {} times as high", format_significant(*most, 3)));
                let lower = (*least < 1.0).then(|| format!("down to {} of the height", format_significant(*least, 3)));
                let size: Vec<String> = higher.into_iter().chain(lower).collect();
                Some(format!(
                    "warning: at {} {} the reverse sweep finds another orbit, {}: the history of the motion decides \
                     between them. `reverse_sweep.csv` contains the orbits of the reverse sweep; peaks that only they \
                     have are marked `reverse_sweep` in `peaks.csv`. Kind `branch` follows the whole curve, with its \
                     folds.",
                    points(*count),
                    if hertz(*from) == hertz(*to) {
                        format!("at {} Hz", hertz(*from))
                    } else {
                        format!("between {} and {} Hz", hertz(*from), hertz(*to))
                    },
                    size.join(" and ")
                ))
            }
            Note::OtherMethod { points: count, chosen, found } => Some(format!(
                "At {} `{chosen}`, the choice of `auto`, found no orbit; `{found}` found one.",
                points(*count)
            )),
            Note::UnknownStability(count) => Some(format!(
                "{WARNING}at {} the stability of the orbit is unknown, and friction that falls with velocity, or a negative \
                 stiffness or damping, may make it unstable: the real motion then has other amplitudes. Compare \
                 with kind = \"transient\" (rigid friction needs a `width` (m/s) over which it changes its sign).",
                points(*count)
            )),
            Note::TimeHistory(up_to) => {
                let hertz = |omega: f64| quantity_text(omega, Some(Dimension::FREQUENCY));
                Some(format!(
                    "`reduction_error` is that of harmonic forces up to {}. It does not include higher frequencies, \
                     which the initial state and slipping joints excite. Compare with reduce = {{ up_to = \"{}\" }} \
                     or reduce = false.",
                    hertz(*up_to),
                    hertz(4.0 * up_to)
                ))
            }
            Note::Slipping(slipping) => Some(slipping.text(WARNING)),
            Note::StuckInOtherCases(count) => Some(format!(
                "At {} of the other cases a joint sticks permanently; its offset is not unique there either.",
                points(*count)
            )),
            Note::Stuck { points: 0, .. } => None,
            Note::Stuck { case, points: count, total: of } => {
                let label = if case.is_empty() { String::new() } else { format!("{case}: ") };
                Some(format!(
                    "{label}at {count} of {} a joint sticks permanently; its offset is not unique there, and the \
                     symmetric orbit is reported.",
                    points(*of)
                ))
            }
        }
    }
}

/// Returns whether a law without memory has another stiffness at a larger amplitude.
fn is_curved(joint: &Joint, motion: &JointMotion) -> bool {
    let is_elastic = joint.law.rate().is_some_and(|rate| rate.states() == 0) && joint.law.force_scale().is_infinite();
    let (low, high) = motion.displacement.first().copied().unwrap_or_default();
    let stiffness = |amplitude: f64| joint.law.describing_function(amplitude, 1.0).re;
    is_elastic && high > low && stiffness(high - low) != stiffness(0.5 * (high - low))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A note of the only case has no name, and is stated once.
    #[test]
    fn equal_notes_of_the_only_case_are_one_sentence() {
        let mut notes = Vec::new();
        (0..2).for_each(|_| Note::for_case("", format!("{WARNING}it is so.")).merge_into(&mut notes));
        let texts: Vec<String> = notes.iter().filter_map(Note::text).collect();
        assert_eq!(texts, ["warning: it is so."]);
    }

    #[test]
    fn notes_of_one_kind_are_merged() {
        let stuck = |case: &str, points| Note::Stuck { case: case.to_owned(), points, total: 10 };
        let instead = |chosen: &str| Note::OtherMethod {
            points: 1,
            chosen: chosen.to_owned(),
            found: "harmonic-balance".to_owned(),
        };
        let mut notes = Vec::new();
        for note in [
            stuck("Ft = 1 N", 0),
            Note::Truncated(1, 1e-2),
            stuck("Ft = 1 N", 3),
            Note::Truncated(2, 5e-2),
            Note::StuckOffset(1),
            Note::Unstable(1, 0),
            Note::UnknownStability(1),
            Note::Unstable(1, 1),
            Note::UnknownStability(2),
            Note::StuckOffset(1),
            stuck("Ft = 2 N", 0),
            Note::Sentence("It is so.".to_owned()),
            instead("shooting"),
            instead("event-driven"),
            instead("shooting"),
            Note::OtherOrbit { points: 2, from: 3.0 * TAU, to: 4.0 * TAU, ratios: [2.0, 2.0] },
            Note::OtherOrbit { points: 1, from: 2.0 * TAU, to: 2.0 * TAU, ratios: [0.25, 0.25] },
        ] {
            note.merge_into(&mut notes);
        }
        let texts: Vec<String> = notes.iter().filter_map(Note::text).collect();
        assert_eq!(texts.len(), 9, "{texts:?}");
        assert!(texts[0].starts_with("Ft = 1 N: at 3 of 20 points a joint sticks"), "{}", texts[0]);
        assert!(texts[1].starts_with("At 3 points") && texts[1].contains("5.0e-2"), "{}", texts[1]);
        assert!(texts[2].starts_with("At 2 points a joint, or a part of it, sticks"), "{}", texts[2]);
        assert!(
            texts[3].contains("at 2 points the orbit is unstable") && texts[3].contains("at 1 of them it repeats"),
            "{}",
            texts[3]
        );
        assert!(texts[4].contains("at 3 points the stability of the orbit is unknown"), "{}", texts[4]);
        assert_eq!(texts[5], "It is so.");
        assert!(texts[6].starts_with("At 2 points `shooting`") && texts[6].contains("`harmonic-balance` found one"));
        assert!(texts[7].starts_with("At 1 point `event-driven`"), "{}", texts[7]);
        assert!(
            texts[8].contains("at 3 points between 2 and 4 Hz")
                && texts[8].contains("up to 2 times as high and down to 0.25 of"),
            "{}",
            texts[8]
        );
    }

    /// A note that is true of many cases is one line: a warning of 16 draws once appeared 16
    /// times.
    #[test]
    fn a_note_of_many_cases_is_one_line() {
        let texts = |cases: usize| {
            let mut notes = Vec::new();
            for case in 1..=cases {
                Note::for_case(&format!("k = {case} N/m"), "warning: it moves too fast").merge_into(&mut notes);
                Note::for_case(&format!("k = {case} N/m"), "No joint slips.").merge_into(&mut notes);
                Note::Sentence("There is no speed.".to_owned()).merge_into(&mut notes);
            }
            notes.iter().filter_map(Note::text).collect::<Vec<_>>()
        };
        let general = "There is no speed.";
        assert_eq!(texts(1), ["warning: k = 1 N/m: it moves too fast", "k = 1 N/m: No joint slips.", general]);
        assert_eq!(texts(2)[0], "warning: k = 1 N/m; k = 2 N/m: it moves too fast");
        let many = texts(16);
        assert_eq!(many[0], "warning: 16 cases (k = 1 N/m; k = 2 N/m; k = 3 N/m and 13 more): it moves too fast");
        assert_eq!((many.len(), many[2].as_str()), (3, general));
        // the only case of a study has no name
        assert_eq!(Note::for_case("", "warning: it moves too fast").text().unwrap(), "warning: it moves too fast");
    }

    /// A branch takes no other method, so its note names only its own keys.
    #[test]
    fn branch_notes_name_branch_keys() {
        let mut notes = Vec::new();
        for note in [Note::Truncated(1, 1e-2), Note::Truncated(2, 3e-2), Note::StuckOffset(1)] {
            note.for_branch().merge_into(&mut notes);
        }
        let texts: Vec<String> = notes.iter().filter_map(Note::text).collect();
        assert_eq!(texts.len(), 2, "{texts:?}");
        assert!(texts[0].starts_with("At 3 points of the branch") && texts[0].contains("3.0e-2"), "{}", texts[0]);
        assert!(
            texts[0].contains("Raise `harmonics` in [study]") && !texts[0].contains("event-driven"),
            "{}",
            texts[0]
        );
    }

    #[test]
    fn merging_notes_is_independent_of_grouping() {
        // blocks of three units per case; a joint sticks in most cases, in some of them not at
        // first
        let all: Vec<Note> = (0..3 * MAX_STUCK_CASES)
            .flat_map(|unit| {
                let (case, points) = (format!("case {}", unit / 3), if unit % 7 < 2 { 0 } else { unit % 5 });
                let of_case = Note::for_case(&case, format!("It is so in {} ways.", unit % 3));
                [
                    Note::Stuck { case, points, total: 10 },
                    Note::Truncated(unit % 2, unit as f64),
                    Note::StuckOffset(1),
                    of_case,
                ]
            })
            .chain((0..700).map(|unit| Note::Stuck { case: format!("late {}", unit / 3), points: unit % 4, total: 10 }))
            .collect();
        let joined = |size: usize| {
            let mut whole = Vec::new();
            for notes in all.chunks(size) {
                let mut part = Vec::new();
                notes.iter().for_each(|note| note.clone().merge_into(&mut part));
                part.into_iter().for_each(|note| note.merge_into(&mut whole));
            }
            whole.iter().filter_map(Note::text).collect::<Vec<_>>()
        };
        let one_by_one = joined(1);
        assert!(one_by_one.len() <= MAX_STUCK_CASES + 7, "{}", one_by_one.len());
        assert!(one_by_one.iter().any(|text| text.contains("of the other cases")), "{one_by_one:?}");
        for size in [2, 3, 7, 50, 1000, all.len()] {
            assert_eq!(joined(size), one_by_one, "{size}");
        }
    }
}
