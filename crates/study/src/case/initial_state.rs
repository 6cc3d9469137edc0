//! Initial state of a transient: static equilibrium with some places held, or given
//! displacements with unloaded joints.

use std::collections::BTreeMap;
use stickslip::method::StaticEquilibrium;
use stickslip::model::{Axis, System};

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
pub(crate) fn held_equilibrium(system: &System, start: Option<&BTreeMap<String, f64>>) -> Option<Start> {
    let places = system.places().iter().zip(system.place_axes());
    let held: Vec<(Axis, f64)> =
        places.filter_map(|(place, along)| Some((along.clone(), *start?.get(place)?))).collect();
    let equilibrium = StaticEquilibrium::holding(system, &held)?;
    Some(Start { displacement: equilibrium.displacement().to_vec(), states: equilibrium.joint_states().to_vec() })
}
