//! The mesh of a structure: names on its sets become places and joints of single nodes before
//! anything else reads the lists of the model.
//!
//! - `sets`: places of the nodes of a set, and the mean over a set;
//! - `contact`: joints between two faces;
//! - `preload`: the preloads of their nodes from a static step.

pub(crate) mod contact;
pub(crate) mod preload;
pub(crate) mod sets;

use super::compiled::{CompiledEntry, CompiledTable, CompiledValue, Environment, Expected};
use crate::case::values::ResolvedValue;
use crate::syntax::error::{Location, Problem};
use contact::ContactSummary;
use std::collections::HashMap;
use std::sync::Arc;
use stickslip::structure::CoordinateAxis;
use stickslip_formats::Error;
use stickslip_formats::mesh::Mesh;

/// A mesh, and its unit of length in metres.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshSource {
    /// The mesh as in its file.
    pub mesh: Mesh,
    /// Unit of length of its coordinates, m.
    pub length: f64,
    /// The axis of a disk whose sector it is.
    pub axis: Option<CoordinateAxis>,
}

/// The mesh of a study, and what became of it.
#[derive(Debug, Clone, Default)]
pub(crate) struct MeshUse {
    pub source: Option<Arc<MeshSource>>,
    /// The contacts between its faces; their joints are in the lists.
    pub contacts: Vec<ContactSummary>,
    /// Area of each of these joints, by name, m².
    pub areas: HashMap<String, f64>,
    /// The places and joints of each set.
    pub sets: Arc<Vec<NamedMembers>>,
}

/// The places or joints that one entry of a study file makes from a set of the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedMembers {
    /// Name of the entry.
    pub name: String,
    /// Names of the places or joints, in a disk those of one sector.
    pub members: Vec<String>,
    /// Area of each joint, m²; empty for places.
    pub areas: Vec<f64>,
}

impl MeshSource {
    /// Returns the number of a node in the file, as the names of rows state it.
    fn number(&self, node: usize) -> i64 {
        self.mesh.nodes()[node].number
    }
}

/// Returns a problem for a set that the mesh does not have.
fn set_problem(error: Error, key: &str, location: &Location) -> Problem {
    Problem::new(location, key, error.problem).help(error.remedy)
}

/// The environment of values that no parameter may change.
const NO_PARAMETERS: Environment<'static> = Environment { names: &[], parameters: &[], values: Vec::new() };

/// Returns a stated number in SI that no parameter may change, for the reason `why`.
fn fixed_number(table: &CompiledTable, key: &str, why: &str) -> Result<Option<f64>, Problem> {
    let Some(CompiledValue::Quantity { quantity, dimension, within, example }) =
        table.entry(key).map(|entry| &entry.value)
    else {
        return Ok(None);
    };
    if quantity.expression.parameters().next().is_some() {
        return Err(quantity.problem(key, why).help("write a number with its unit"));
    }
    let expected = Expected { dimension: *dimension, within: *within };
    quantity.number(key, expected, example, &NO_PARAMETERS).map(Some)
}

/// Returns an entry with a value that is already known.
fn entry(key: &'static str, value: ResolvedValue, location: &Location) -> CompiledEntry {
    CompiledEntry { key, location: location.clone(), value: CompiledValue::Fixed(value) }
}

/// Returns an entry of one node.
fn node_entry(number: i64, location: &Location) -> CompiledEntry {
    let value = CompiledValue::Names(vec![(number.to_string(), location.clone())]);
    CompiledEntry { key: "nodes", location: location.clone(), value }
}

/// Returns a table of a list for one node of a set.
fn table_of_node(stated: &CompiledTable, node: &str, entries: Vec<CompiledEntry>) -> CompiledTable {
    let repetition =
        if stated.repetition.is_empty() { node.to_owned() } else { format!("{}, {node}", stated.repetition) };
    CompiledTable { location: stated.location.clone(), repetition, entries }
}

/// Returns the numbers of nodes that a text mentions in names `NAME_17`, in ascending order. They
/// stand for the nodes of a set whose mesh is not read.
pub(crate) fn mentioned_nodes(text: &str, name: &str) -> Vec<i64> {
    let prefix = format!("{name}_");
    let mut numbers: Vec<i64> = text
        .match_indices(&prefix)
        .filter(|(at, _)| !text[..*at].ends_with(|c: char| c.is_ascii_alphanumeric() || c == '_'))
        .filter_map(|(at, _)| {
            let rest = &text[at + prefix.len()..];
            rest[..rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len())].parse().ok()
        })
        .collect();
    numbers.sort_unstable();
    numbers.dedup();
    numbers
}
