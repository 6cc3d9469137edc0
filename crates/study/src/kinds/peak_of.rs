//! The key `peak_of` of the kinds with a resonance peak: the masses whose amplitude counts.
//!
//! With several masses, the largest amplitude counts, at each frequency separately.

use crate::info::Complaint;
use crate::key::{Key, Takes, optional};
use crate::names::Names;
use crate::values::Values;
use crate::work::Prepared;
use stickslip::model::{Model, System};
use stickslip::orbit::Orbit;

/// Means every mass, unless a mass has this name.
const ALL: &str = "all";

/// The key `peak_of`.
pub(super) const PEAK_OF: Key = optional(
    "peak_of",
    Takes::Names,
    "the masses whose peak is used, or \"all\"; of several masses the largest amplitude; default: the first mass \
     with a force",
    "[\"blade1\", \"blade3\"]",
);

/// Checks that the key names masses of the model.
pub(super) fn check_peak_of(values: &Values, model: &Model) -> Result<(), Complaint> {
    let masses = Names::of_displacements(model);
    let mut named = values.names("peak_of").unwrap_or_default().iter().filter(|name| *name != ALL);
    named.try_for_each(|name| masses.all(PEAK_OF.name, "mass", name).map(drop))
}

/// Returns the places that the key names; empty if the key is absent.
pub(super) fn named_places(prepared: &Prepared) -> Vec<usize> {
    let names = prepared.case.values.names("peak_of").unwrap_or_default();
    let places = &prepared.system.places();
    if names.iter().any(|name| name == ALL) && !places.iter().any(|place| place == ALL) {
        return displacements(&prepared.system);
    }
    let masses = Names::of_displacements(&prepared.case.model);
    let meant = names.iter().filter_map(|name| masses.all(PEAK_OF.name, "mass", name).ok()).flatten();
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
pub(super) fn peak_places(prepared: &Prepared) -> Vec<usize> {
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
pub(super) fn displacements(system: &System) -> Vec<usize> {
    let seen = system.place_axes().iter().enumerate();
    seen.filter(|(_, place)| !place.is_rotation()).map(|(place, _)| place).collect()
}

/// Returns the largest amplitude of some places, m.
pub(super) fn worst(orbit: &Orbit, places: &[usize]) -> f64 {
    places.iter().map(|place| orbit.places[*place].amplitude()).fold(0.0, f64::max)
}
