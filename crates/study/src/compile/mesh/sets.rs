//! Places on sets of a mesh: `set = "PADS"` is a place for every node, `nodes = ["PADS"]` the mean
//! over them.

use super::{MeshSource, entry, node_entry, set_problem, table_of_node};
use crate::case::values::ResolvedValue;
use crate::compile::compiled::{CompiledTable, CompiledValue};
use crate::syntax::error::Problem;

/// Returns the places that an entry of `[[place]]` states.
pub(crate) fn expand(place: CompiledTable, source: &MeshSource) -> Result<Vec<CompiledTable>, Problem> {
    let Some(set) = place.text("set") else { return Ok(vec![with_nodes_of_sets(place, source)?]) };
    let location = place.location_of("set", None);
    if let Some(other) = ["of", "dof", "dofs", "nodes", "sum"].into_iter().find_map(|key| place.entry(key)) {
        let message = format!("`set` and `{}` exclude each other", other.key);
        return Err(Problem::new(&other.location, other.key, message).help("remove one of them"));
    }
    let nodes = source.mesh.nodes_of(set).map_err(|error| set_problem(error, "set", location))?;
    let numbers = nodes.iter().map(|node| source.number(*node)).collect::<Vec<_>>();
    Ok(places_of_nodes(&place, &numbers))
}

/// Returns a place for each of these nodes.
pub(crate) fn places_of_nodes(place: &CompiledTable, numbers: &[i64]) -> Vec<CompiledTable> {
    let (name, location) = (place.name().unwrap_or_default(), place.location_of("set", None));
    let one = |number: &i64| {
        let own = format!("{name}_{number}");
        let mut entries = vec![
            entry("name", ResolvedValue::Text(own.clone()), place.location_of("name", None)),
            node_entry(*number, location),
        ];
        entries.extend(place.entries.iter().filter(|entry| !matches!(entry.key, "name" | "set")).cloned());
        table_of_node(place, &own, entries)
    };
    numbers.iter().map(one).collect()
}

/// Replaces the names of sets in `nodes` by their nodes.
fn with_nodes_of_sets(mut place: CompiledTable, source: &MeshSource) -> Result<CompiledTable, Problem> {
    for entry in place.entries.iter_mut().filter(|entry| entry.key == "nodes") {
        if let CompiledValue::Names(names) = &mut entry.value {
            let mut nodes = Vec::with_capacity(names.len());
            for (name, location) in std::mem::take(names) {
                match source.mesh.nodes_of(&name) {
                    Ok(members) => {
                        let number = |node| (source.number(node).to_string(), location.clone());
                        nodes.extend(members.into_iter().map(number));
                    }
                    // the structure reports unknown numbers of nodes
                    Err(_) if name.parse::<i64>().is_ok() => nodes.push((name, location)),
                    Err(error) => return Err(set_problem(error, "nodes", &location)),
                }
            }
            *names = nodes;
        }
    }
    Ok(place)
}
