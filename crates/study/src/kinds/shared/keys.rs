//! Keys of `[study]` that several kinds have, and checks of their values.

use crate::case::values::Values;
use crate::kinds::info::KeyError;
use crate::run::output_columns;
use crate::syntax::key::{FREQUENCY_RANGE, Key, ValueType, default, optional, required};
use std::collections::BTreeSet;
use stickslip::method::{MethodError, Options};
use stickslip::model::{Mass, Model, System};

/// Checks that the model has a place whose amplitude can have a peak.
pub(in crate::kinds) fn check_masses(model: &Model) -> Result<(), KeyError> {
    if model.masses.is_empty() && model.bodies.is_empty() && model.places.is_empty() {
        let help = "add a [[mass]], or use kind = \"hysteresis\"";
        return Err(KeyError::new("kind", "the model has no mass, so it has no resonance peak", help));
    }
    let moved: BTreeSet<&str> = model.motions.iter().map(|motion| motion.on.as_str()).collect();
    let mut places = model.masses.iter().flat_map(Mass::places);
    if model.places.is_empty() && places.all(|place| moved.contains(place.as_str())) {
        let help = "remove a [[motion]], or use kind = \"hysteresis\"";
        return Err(KeyError::new(
            "kind",
            "the motion of every mass is imposed, so the model has no resonance peak",
            help,
        ));
    }
    Ok(())
}

/// Accepts every system, for kinds without requirements beyond those of the method.
pub(in crate::kinds) fn no_requirements(_: &Values, _: &Options, _: &System) -> Result<(), MethodError> {
    Ok(())
}

/// Largest number of samples per period.
pub(in crate::kinds) const MAX_SAMPLES: i64 = 100_000;

/// Default harmonics and samples of the kinds that always use harmonic balance.
pub(in crate::kinds) const HARMONICS: u64 = 15;
pub(in crate::kinds) const SERIES_SAMPLES: u64 = 1024;

/// Checks that such a kind has enough samples for its harmonics.
pub(in crate::kinds) fn check_samples(values: &Values) -> Result<(), KeyError> {
    let harmonics = values.count("harmonics").unwrap_or(HARMONICS);
    let samples = values.count("samples").unwrap_or(SERIES_SAMPLES);
    if samples >= 4 * (harmonics + 1) && samples.is_multiple_of(2) {
        return Ok(());
    }
    let message = format!("{samples} samples are too few or odd for {harmonics} harmonics");
    Err(KeyError::new("samples", message, "write an even number, at least 4 (harmonics + 1)"))
}

/// The key `frequency` of the kinds that need an excitation frequency.
pub(in crate::kinds) const FREQUENCY: Key = required(
    "frequency",
    ValueType::Frequencies(FREQUENCY_RANGE),
    "excitation frequency: one value, a list, or a range that includes both ends",
    "{ from = \"119 Hz\", to = \"123 Hz\", points = 241 }",
);

/// The key `output` of the kinds with one row per orbit.
pub(in crate::kinds) const OUTPUT: Key = optional(
    "output",
    ValueType::Names,
    "additional columns: joint_force, joint_mean, joint_motion, contact, velocity, acceleration, harmonics, receptance, \
     sets",
    "[\"joint_force\", \"harmonics\"]",
);

/// Checks that `output` contains known names only.
pub(in crate::kinds) fn check_output(values: &Values) -> Result<(), KeyError> {
    let known: Vec<&str> = output_columns::TABLE.iter().map(|extra| extra.name).collect();
    match values.names("output").unwrap_or_default().iter().find(|name| !known.contains(&name.as_str())) {
        Some(name) => Err(KeyError::unknown_name("output", "output", name, &known)),
        None => Ok(()),
    }
}

/// The key `samples` of the kinds that show the motion over one period.
pub(in crate::kinds) const SAMPLES: Key =
    default("samples", ValueType::Count(8, MAX_SAMPLES), "720", "points per period", "720");
