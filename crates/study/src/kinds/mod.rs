//! Study kinds: what can be asked for. One file each, one line in [`TABLE`].
//!
//! A kind states its keys of `[study]`; the reader checks them and hands over their [`Values`] for every case.

mod branch;
pub mod hysteresis;
mod modes;
mod orbit;
mod orbits;
mod peak_of;
pub mod performance;
pub mod response;
mod transient;

use crate::dataset::Figure;
use crate::drawing::Drawing;
use crate::schema::{Key, Takes, default, optional, required};
use crate::study::Study;
use crate::summary::{Cost, Costing, Surveyed};
use crate::values::Values;
use crate::work::{Computed, Grain, Work};
use stickslip::dimension::Dimension;
use stickslip::method::MethodError;
use stickslip::model::{Model, System};

/// A row of the table of study kinds.
#[derive(Debug, Clone, Copy)]
pub struct Kind {
    /// Name in study files.
    pub name: &'static str,
    /// One line of what it computes.
    pub summary: &'static str,
    /// Its keys of `[study]`, beside those of [`crate::schema::STUDY`].
    pub keys: &'static [Key],
    /// What one key alone cannot tell: conditions between keys, and names that must exist in the model.
    pub check: fn(&Values, &Model) -> Result<(), Complaint>,
    /// Dimensions of the two axes of its figure, if they are the same in every panel.
    pub axes: [Option<Dimension>; 2],
    /// Whether it finds its orbits with the method of `[method]`, which must then be able to take the model.
    pub uses_method: bool,
    /// What it needs of a system, beside what its method needs.
    pub needs: fn(&Values, &System) -> Result<(), MethodError>,
    /// Whether it can place its frequencies where the curve bends.
    pub adapts: bool,
    /// Its tables, the most important first.
    pub tables: &'static [&'static str],
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

/// Every study kind there is, in the order in which lists show them.
pub const TABLE: &[Kind] =
    &[hysteresis::KIND, orbit::KIND, response::KIND, transient::KIND, performance::KIND, modes::KIND, branch::KIND];

/// The kind with this name.
pub fn find(name: &str) -> Option<&'static Kind> {
    TABLE.iter().find(|kind| kind.name == name)
}

/// What a kind finds wrong in the values of its keys.
#[derive(Debug, Clone, PartialEq)]
pub struct Complaint {
    /// The key; the error stands at its value, or at `[study]` if it is absent.
    pub key: &'static str,
    /// The name inside the key's value that is wrong, if it is one.
    pub name: Option<String>,
    /// What is wrong and what was expected.
    pub message: String,
    /// What to do.
    pub help: Option<String>,
}

impl Complaint {
    pub(crate) fn new(key: &'static str, message: impl Into<String>, help: impl Into<String>) -> Self {
        Complaint { key, name: None, message: message.into(), help: Some(help.into()) }
    }

    /// A name in the value of `key` that is none of `candidates`.
    pub(crate) fn unknown(key: &'static str, what: &str, name: &str, candidates: &[&str]) -> Self {
        let help = match crate::near::nearest(name, candidates.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None if candidates.is_empty() => format!("the model has no {what}"),
            None => format!("choose {}", crate::near::one_of(candidates.iter().take(12).copied())),
        };
        let message = format!("there is no {what} `{}`", crate::near::shown(name));
        Complaint { key, name: Some(name.to_owned()), message, help: Some(help) }
    }
}

/// Whether there is a mass whose peak could count.
fn check_masses(model: &Model) -> Result<(), Complaint> {
    if model.masses.is_empty() {
        let help = "add a [[mass]], or ask for kind = \"hysteresis\"";
        return Err(Complaint::new("kind", "the model has no mass, so no amplitude has a peak", help));
    }
    Ok(())
}

/// Of a kind that needs nothing of a system beside what its method needs.
fn anything(_: &Values, _: &System) -> Result<(), MethodError> {
    Ok(())
}

/// Most samples per period.
const MOST_SAMPLES: i64 = 100_000;

/// Harmonics and samples of the kinds that solve series of their own, when none are given.
const HARMONICS: u64 = 15;
const SERIES_SAMPLES: u64 = 1024;

/// Whether such a kind has enough samples for its harmonics.
fn check_samples(values: &Values) -> Result<(), Complaint> {
    let harmonics = values.count("harmonics").unwrap_or(HARMONICS);
    let samples = values.count("samples").unwrap_or(SERIES_SAMPLES);
    if samples >= 4 * (harmonics + 1) && samples.is_multiple_of(2) {
        return Ok(());
    }
    let message = format!("{samples} samples are too few or odd for {harmonics} harmonics");
    Err(Complaint::new("samples", message, "write an even number, at least 4 (harmonics + 1)"))
}

/// The key `frequency` of the kinds that need a drive.
const FREQUENCY: Key = required(
    "frequency",
    Takes::Frequencies,
    "drive frequency: one, a list, or a range with both ends",
    "{ from = \"119 Hz\", to = \"123 Hz\", points = 241 }",
);

/// What `output` can ask for: name, and one line of what it is.
pub fn outputs() -> Vec<(&'static str, &'static str)> {
    crate::extra::TABLE.iter().map(|extra| (extra.name, extra.doc)).collect()
}

/// The key `output` of the kinds that have one row per orbit.
const OUTPUT: Key = optional(
    "output",
    Takes::Names,
    "further columns: joint_force, joint_motion, velocity, acceleration, harmonics, receptance",
    "[\"joint_force\", \"harmonics\"]",
);

/// Whether it names what there is.
fn check_output(values: &Values) -> Result<(), Complaint> {
    let known: Vec<&str> = crate::extra::TABLE.iter().map(|extra| extra.name).collect();
    match values.names("output").unwrap_or_default().iter().find(|name| !known.contains(&name.as_str())) {
        Some(name) => Err(Complaint::unknown("output", "output", name, &known)),
        None => Ok(()),
    }
}

/// The key `samples` of the kinds that show a motion over one period.
const SAMPLES: Key = default("samples", Takes::Count(8, MOST_SAMPLES), "720", "points per period", "720");
