//! What a reader of the results must know, in sentences. Notes of one sort from several units become one sentence.

use serde::{Deserialize, Serialize};
use stickslip::orbit::{Accuracy, Orbit};

/// How a note begins that is a warning.
pub(crate) const WARNING: &str = "warning: ";

/// A note.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Note {
    /// A sentence.
    Said(String),
    /// Points whose series is too short, and the largest estimated error.
    Truncated(usize, f64),
    /// Points whose series was not compared with a longer one.
    Unchecked(usize),
    /// Points whose orbit is unstable, and those of them whose motion repeats after fewer periods than were asked for.
    Unstable(usize, usize),
    /// Points at which something sticks all the time in a motion that is not its own mirror image.
    History(usize),
    /// Of one case (its varied parameters in words): points at which a joint sticks for the whole period, of so many.
    Stuck {
        /// The case.
        case: String,
        /// Points that stick.
        points: usize,
        /// All points.
        of: usize,
    },
}

impl Note {
    /// What an orbit asks for: that it is unstable, if that is known (see [`Orbit::is_stable`]), how accurate its series is, and that it is one of
    /// many.
    pub(crate) fn of_orbit(orbit: &Orbit, stable: Option<bool>) -> Vec<Note> {
        let early = || usize::from(orbit.periods > 1 && orbit.repeats() < orbit.periods);
        let unstable = (stable == Some(false)).then(|| Note::Unstable(1, early()));
        let accuracy = match orbit.evidence.accuracy {
            Accuracy::Truncated => Some(Note::Truncated(1, orbit.evidence.truncation.unwrap_or(0.0))),
            Accuracy::Unchecked => Some(Note::Unchecked(1)),
            Accuracy::Converged => None,
        };
        let history = (!orbit.evidence.history.is_empty()).then_some(Note::History(1));
        unstable.into_iter().chain(accuracy).chain(history).collect()
    }

    /// Adds it to `notes`, to one of its sort if there is one.
    pub(crate) fn join(self, notes: &mut Vec<Note>) {
        for known in notes.iter_mut() {
            match (known, &self) {
                (Note::Truncated(points, largest), Note::Truncated(more, other)) => {
                    *points += more;
                    *largest = largest.max(*other);
                    return;
                }
                (Note::Unchecked(points), Note::Unchecked(more)) | (Note::History(points), Note::History(more)) => {
                    *points += more;
                    return;
                }
                (Note::Unstable(points, early), Note::Unstable(more, other)) => {
                    *points += more;
                    *early += other;
                    return;
                }
                (Note::Stuck { case, points, of }, Note::Stuck { case: same, points: more_points, of: more })
                    if case == same =>
                {
                    *points += more_points;
                    *of += more;
                    return;
                }
                _ => {}
            }
        }
        notes.push(self);
    }

    /// The sentence; none if there is nothing to be said.
    pub(crate) fn text(&self) -> Option<String> {
        let points = |count: usize| format!("{count} point{}", if count == 1 { "" } else { "s" });
        match self {
            Note::Said(text) => Some(text.clone()),
            Note::Truncated(count, largest) => Some(format!(
                "At {} the series is too short: its estimated error is beyond the `tolerance` of the method, and up to {largest:.1e}. \
                 Leave `harmonics` out or raise it, raise `tolerance` if that is good enough, or use `event-driven` where the laws \
                 are exact.",
                points(*count)
            )),
            Note::Unchecked(count) => Some(format!(
                "At {} nothing is known of the error of the series: the longer one that tells it has too many unknowns or was not found. \
                 Try fewer `harmonics`.",
                points(*count)
            )),
            Note::Unstable(count, early) => {
                let early = match early {
                    0 => String::new(),
                    early => format!(
                        "; at {} of them it repeats after fewer periods than `period` says, and none that takes as many was found",
                        early
                    ),
                };
                Some(format!(
                    "warning: at {} the orbit is unstable (`stable` is false): no motion stays on it, and the real one is another{early}; \
                     look for it with another `period` in [method], or with kind = \"transient\"",
                    points(*count)
                ))
            }
            Note::History(count) => Some(format!(
                "At {} a joint or a part of one sticks for the whole period, in a motion that is not its own mirror image: where it sticks \
                 depends on how the motion began, and with it the means, and the amplitudes too if a gap or another law knows positions. \
                 Shown is the motion in which a spring that never slips carries no mean force, as in joints that creep, and with method \
                 `transient` the one that its run led to.",
                points(*count)
            )),
            Note::Stuck { points: 0, .. } => None,
            Note::Stuck { case, points: count, of } => {
                let label = if case.is_empty() { String::new() } else { format!("{case}: ") };
                Some(format!(
                    "{label}at {count} of {} a joint sticks for the whole period; its offset is not unique there, and the \
                     symmetric motion is shown.",
                    points(*of)
                ))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_of_one_sort_become_one() {
        let stuck = |case: &str, points| Note::Stuck { case: case.to_owned(), points, of: 10 };
        let mut notes = Vec::new();
        for note in [
            stuck("Ft = 1 N", 0),
            Note::Truncated(1, 1e-2),
            stuck("Ft = 1 N", 3),
            Note::Truncated(2, 5e-2),
            Note::History(1),
            Note::Unstable(1, 0),
            Note::Unstable(1, 1),
            Note::History(1),
            stuck("Ft = 2 N", 0),
            Note::Said("It is so.".to_owned()),
        ] {
            note.join(&mut notes);
        }
        let texts: Vec<String> = notes.iter().filter_map(Note::text).collect();
        assert_eq!(texts.len(), 5, "{texts:?}");
        assert!(texts[0].starts_with("Ft = 1 N: at 3 of 20 points a joint sticks"), "{}", texts[0]);
        assert!(texts[1].starts_with("At 3 points") && texts[1].contains("5.0e-2"), "{}", texts[1]);
        assert!(texts[2].starts_with("At 2 points a joint or a part of one sticks"), "{}", texts[2]);
        assert!(
            texts[3].contains("at 2 points the orbit is unstable") && texts[3].contains("at 1 of them it repeats"),
            "{}",
            texts[3]
        );
        assert_eq!(texts[4], "It is so.");
    }
}
