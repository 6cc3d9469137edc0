//! Initial state of a transient: static equilibrium with some places held, or given
//! displacements with unloaded joints.

use std::collections::BTreeMap;
use stickslip::method::StaticEquilibrium;
use stickslip::model::{Model, Motion, System};

/// The values of the key `begin`.
pub(crate) const EQUILIBRIUM: &str = "equilibrium";
pub(crate) const UNLOADED: &str = "unloaded";

/// Returns the values of the key `begin` with their meaning.
pub(crate) fn begin_values() -> Vec<(&'static str, &'static str)> {
    vec![
        (
            EQUILIBRIUM,
            "the places of `start` are held at these displacements; everything else, with the forces of the joints, \
             is in static equilibrium under the constant forces",
        ),
        (UNLOADED, "displacements as in `start`, zero elsewhere; joints carry no force"),
    ]
}

/// Displacements of all degrees of freedom, m, and internal states of all joints.
pub(crate) struct Start {
    pub displacement: Vec<f64>,
    pub states: Vec<f64>,
}

/// Returns the value of each named place by its row. Skips places that are not a degree of
/// freedom themselves.
fn values_by_row(system: &System, given: Option<&BTreeMap<String, f64>>) -> BTreeMap<usize, f64> {
    let places = system.places().iter().zip(system.place_axes());
    let named = places.filter_map(|(place, along)| Some((along.rows(), *given?.get(place)?)));
    named.filter_map(|(rows, value)| if let [(row, _)] = rows { Some((*row, value)) } else { None }).collect()
}

/// Returns displacements or velocities of all degrees of freedom: as given, zero elsewhere.
pub(crate) fn state_vector(system: &System, given: Option<&BTreeMap<String, f64>>) -> Vec<f64> {
    let mut state = vec![0.0; system.dofs()];
    values_by_row(system, given).into_iter().for_each(|(row, value)| state[row] = value);
    state
}

/// Returns the static equilibrium with the places of `start` held; `None` if it is not found.
pub(crate) fn held_equilibrium(model: &Model, system: &System, start: Option<&BTreeMap<String, f64>>) -> Option<Start> {
    let mut held = model.clone();
    for (place, value) in start.into_iter().flatten() {
        held.motions.push(Motion { on: place.clone(), amplitude: *value, phase: 0.0, harmonic: 0 });
    }
    let held = held.assemble().ok()?;
    let fixed = values_by_row(system, start);
    let equilibrium = StaticEquilibrium::of(&held)?;
    // restores the held rows, which the equilibrium does not contain
    let mut free = equilibrium.displacement().iter();
    let row = |row: usize| fixed.get(&row).copied().or_else(|| free.next().copied());
    let displacement: Vec<f64> = (0..system.dofs()).map(row).collect::<Option<_>>()?;
    let complete = held.dofs() + fixed.len() == system.dofs();
    complete.then(|| Start { displacement, states: equilibrium.joint_states().to_vec() })
}
