//! The key `peak_of` of the kinds with a resonance peak: the masses whose amplitude counts.
//!
//! With several masses, the largest amplitude counts, at each frequency separately.

use crate::case::names::ModelNames;
use crate::case::values::Values;
use crate::kinds::info::KeyError;
use crate::run::work::PreparedCase;
use crate::syntax::key::{Key, ValueType, optional};
use stickslip::curve::peak::held_amplitude;
use stickslip::model::{Model, System};
use stickslip::orbit::Orbit;

/// Means every mass, unless a mass has this name.
const ALL: &str = "all";

/// The key `peak_of`.
pub(in crate::kinds) const PEAK_OF: Key = optional(
    "peak_of",
    ValueType::Names,
    "the places whose peak is used, or \"all\"; of several places the largest amplitude; default: the first place \
     with a force",
    "[\"blade1\", \"blade3\"]",
);

/// Checks that the key names masses of the model.
pub(in crate::kinds) fn check_peak_of(values: &Values, model: &Model) -> Result<(), KeyError> {
    let masses = ModelNames::displacements(model);
    let mut named = values.names("peak_of").unwrap_or_default().iter().filter(|name| *name != ALL);
    named.try_for_each(|name| masses.labels(PEAK_OF.name, "place", name).map(drop))
}

/// Returns the places that the key names; empty if the key is absent.
pub(in crate::kinds) fn named_places(prepared: &PreparedCase) -> Vec<usize> {
    let names = prepared.case.values.names("peak_of").unwrap_or_default();
    let places = &prepared.system.places();
    if names.iter().any(|name| name == ALL) && !places.iter().any(|place| place == ALL) {
        return displacements(&prepared.system);
    }
    let masses = ModelNames::displacements(&prepared.case.model);
    let meant = names.iter().filter_map(|name| masses.labels(PEAK_OF.name, "place", name).ok()).flatten();
    let mut found: Vec<usize> = Vec::new();
    for place in meant.filter_map(|name| places.iter().position(|place| place == name)) {
        // the list may contain a place and its node
        if !found.contains(&place) {
            found.push(place);
        }
    }
    found
}

/// Returns the places whose peak counts: the named places, or the first place with a force.
pub(in crate::kinds) fn peak_places(prepared: &PreparedCase) -> Vec<usize> {
    let named = named_places(prepared);
    if !named.is_empty() {
        return named;
    }
    let model = &prepared.case.model;
    let driven = model.forces.iter().map(|force| &force.on).find(|on| !model.is_rotation(on));
    let driven = driven.and_then(|name| prepared.system.places().iter().position(|place| place == name));
    vec![driven.or_else(|| displacements(&prepared.system).first().copied()).unwrap_or(0)]
}

/// Returns the places that are not rotations.
pub(in crate::kinds) fn displacements(system: &System) -> Vec<usize> {
    let seen = system.place_axes().iter().enumerate();
    seen.filter(|(_, place)| !place.is_rotation()).map(|(place, _)| place).collect()
}

/// Returns the amplitudes of the places whose highest peak is refined, m.
///
/// An amplitude that is only the rounding error of a place at rest is zero.
pub(in crate::kinds) fn moving_amplitudes(system: &System, orbit: &Orbit, places: &[usize]) -> Vec<f64> {
    let held = held_amplitude(system, orbit.omega);
    let amplitudes = places.iter().map(|place| orbit.places[*place].amplitude());
    amplitudes.map(|amplitude| if amplitude > held { amplitude } else { 0.0 }).collect()
}

/// Returns the largest amplitude of some places, m.
pub(in crate::kinds) fn largest_amplitude(orbit: &Orbit, places: &[usize]) -> f64 {
    places.iter().map(|place| orbit.places[*place].amplitude()).fold(0.0, f64::max)
}
