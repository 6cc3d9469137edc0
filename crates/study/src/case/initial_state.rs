//! Initial state of a transient: static equilibrium with some places held, or given
//! displacements with unloaded joints.

use crate::case::names::ModelNames;
use crate::case::values::Values;
use crate::kinds::info::KeyError;
use std::collections::BTreeMap;
use stickslip::method::StaticEquilibrium;
use stickslip::model::{Axis, Model, System};

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

/// The keys that state an initial state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StartKeys<'a> {
    start: Option<&'a BTreeMap<String, f64>>,
    start_velocity: Option<&'a BTreeMap<String, f64>>,
    begin: &'a str,
}

impl<'a> StartKeys<'a> {
    /// Reads `start`, `start_velocity` and `begin` of `[study]`.
    pub fn of(values: &'a Values) -> Self {
        Self::of_record(values, values)
    }

    /// Reads the initial state of one of several records: its own `start` and `start_velocity`,
    /// and otherwise those of `[study]`.
    pub fn of_record(record: &'a Values, study: &'a Values) -> Self {
        let given = |key: &str| record.by_name(key).or_else(|| study.by_name(key));
        let (start, start_velocity) = (given("start"), given("start_velocity"));
        let default = if start.is_some() { EQUILIBRIUM } else { UNLOADED };
        StartKeys { start, start_velocity, begin: study.text("begin").unwrap_or(default) }
    }

    /// Returns whether something is displaced or moves at the beginning.
    pub fn moves(&self) -> bool {
        self.start.is_some() || self.start_velocity.is_some()
    }

    /// Checks the names in `start` and `start_velocity`. A place alone does not determine the
    /// velocity of its structure or body, nor its displacement without the equilibrium of the rest.
    pub fn check_names(&self, model: &Model) -> Result<(), KeyError> {
        let free = ModelNames::free_displacements(model);
        for (key, table) in [("start", self.start), ("start_velocity", self.start_velocity)] {
            for name in table.into_iter().flat_map(BTreeMap::keys) {
                free.single_label(key, "free mass or place", name)?;
                let is_place = model.places.iter().any(|place| place.places().contains(name));
                if is_place && (key != "start" || self.begin == UNLOADED) {
                    let message =
                        format!("the place `{name}` alone does not determine the motion of its structure or body");
                    let help = "hold it with `start` and begin = \"equilibrium\", or push it with a [[force]]";
                    return Err(KeyError::new(key, message, help));
                }
            }
        }
        Ok(())
    }
}

/// The state in which a motion begins.
pub(crate) struct Start {
    /// Displacements of all degrees of freedom, m.
    pub displacement: Vec<f64>,
    /// Their velocities, m/s.
    pub velocity: Vec<f64>,
    /// Internal states of all joints; empty if they are unloaded.
    pub states: Vec<f64>,
    /// True if the motion should begin in an equilibrium that was not found.
    pub lacks_equilibrium: bool,
}

impl Start {
    /// Returns the state that the keys describe.
    pub fn new(system: &System, stated: &StartKeys<'_>) -> Start {
        let wanted = stated.begin == EQUILIBRIUM;
        let held = if wanted { held_equilibrium(system, stated.start) } else { None };
        let (displacement, states) = match &held {
            Some(held) => (held.displacement().to_vec(), held.joint_states().to_vec()),
            None => (state_vector(system, stated.start), Vec::new()),
        };
        let velocity = state_vector(system, stated.start_velocity);
        Start { displacement, velocity, states, lacks_equilibrium: wanted && held.is_none() }
    }
}

/// Returns the value of each named place by its row. Skips places that are not a degree of
/// freedom themselves.
fn values_by_row(system: &System, given: Option<&BTreeMap<String, f64>>) -> BTreeMap<usize, f64> {
    let places = system.places().iter().zip(system.place_axes());
    let named = places.filter_map(|(place, along)| Some((along.rows(), *given?.get(place)?)));
    named.filter_map(|(rows, value)| if let [(row, _)] = rows { Some((*row, value)) } else { None }).collect()
}

/// Returns displacements or velocities of all degrees of freedom: as given, zero elsewhere.
fn state_vector(system: &System, given: Option<&BTreeMap<String, f64>>) -> Vec<f64> {
    let mut state = vec![0.0; system.dofs()];
    values_by_row(system, given).into_iter().for_each(|(row, value)| state[row] = value);
    state
}

/// Returns the static equilibrium with the places of `start` held; `None` if it is not found.
fn held_equilibrium(system: &System, start: Option<&BTreeMap<String, f64>>) -> Option<StaticEquilibrium> {
    let places = system.places().iter().zip(system.place_axes());
    let held: Vec<(Axis, f64)> =
        places.filter_map(|(place, along)| Some((along.clone(), *start?.get(place)?))).collect();
    StaticEquilibrium::holding(system, &held)
}
