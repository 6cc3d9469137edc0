//! The key `peak_of` of the kinds that look for a resonance: which mass counts.

use super::Complaint;
use crate::values::Values;
use crate::work::Prepared;
use stickslip::model::Model;

/// Whether it names one mass of the model; `help` says what for.
pub(super) fn check_peak_of(values: &Values, model: &Model, help: &str) -> Result<(), Complaint> {
    let masses: Vec<&str> = model.masses.iter().map(|mass| mass.name.as_str()).collect();
    for name in values.names("peak_of").unwrap_or_default() {
        if !masses.contains(&name.as_str()) {
            return Err(Complaint::unknown("peak_of", "mass", name, &masses));
        }
    }
    if values.names("peak_of").is_some_and(|names| names.len() != 1) {
        return Err(Complaint::new("peak_of", "one mass is needed", help));
    }
    Ok(())
}

/// The place whose peak counts: the named one, or the first that a force acts on.
pub(super) fn peak_place(prepared: &Prepared) -> usize {
    let named = prepared.case.values.names("peak_of").and_then(|names| names.first().cloned());
    let driven = prepared.case.model.forces.first().map(|force| force.on.clone());
    let name = named.or(driven);
    name.and_then(|name| prepared.system.places.iter().position(|place| *place == name)).unwrap_or(0)
}
