//! Reads the mesh of `[structure]`, and replaces entries on its sets by places and joints of single
//! nodes.

use super::reader::Reader;
use crate::case::disk::coordinate_axis;
use crate::case::values::ResolvedValue;
use crate::compile::compiled::{CompiledTable, CompiledValue};
use crate::compile::mesh::contact::{ContactInputs, SectorRotation};
use crate::compile::mesh::{MeshSource, MeshUse, NamedMembers, contact, mentioned_nodes, sets};
use crate::compile::source_model::{MatrixSource, ModelLists};
use crate::syntax::document::{TomlTable, TomlValue};
use crate::syntax::error::Problem;
use crate::syntax::schema::MAX_ELEMENTS;
use crate::syntax::unit_sets;
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::structure::{Component, CoordinateAxis};
use stickslip_formats::mesh::{self, Mesh};

/// The axis of `[disk]`, and its number of sectors if it is a plain number.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct DiskRotation {
    axis: Option<CoordinateAxis>,
    sectors: Option<f64>,
}

impl DiskRotation {
    pub fn new(root: &TomlTable) -> DiskRotation {
        let value = |table: &TomlTable, key: &str| table.get(key).map(|entry| entry.node.value.clone());
        let Some(TomlValue::Table(disk)) = value(root, "disk") else { return DiskRotation::default() };
        let axis = match value(&disk, "axis") {
            Some(TomlValue::Text { text, .. }) => coordinate_axis(&text),
            _ => None,
        };
        let sectors = match value(&disk, "sectors") {
            Some(TomlValue::Number { value, .. }) if value > 0.0 => Some(value),
            _ => None,
        };
        DiskRotation { axis, sectors }
    }

    fn of_sectors(self) -> Option<SectorRotation> {
        Some(SectorRotation { axis: self.axis?, angle: TAU / self.sectors? })
    }
}

impl Reader {
    /// Replaces all places and contacts on sets of the mesh of `structure`. Returns the
    /// mesh and the contacts; `None` if a problem was found.
    pub(super) fn expand_sets(
        &mut self,
        lists: &mut ModelLists,
        structure: Option<&MatrixSource>,
        rotation: DiskRotation,
    ) -> Option<MeshUse> {
        let before = self.problems.len();
        let mesh =
            if self.study_file_only { None } else { structure.and_then(|source| self.mesh(source, rotation.axis)) };
        let (places, contacts) = (std::mem::take(&mut lists.place), std::mem::take(&mut lists.contact));
        let (mut summaries, mut areas, mut sets) = (Vec::new(), HashMap::new(), Vec::new());
        for place in places {
            let name = place.name().filter(|_| place.entry("set").is_some()).map(str::to_owned);
            match self.places_on_sets(place, mesh.as_ref()) {
                Ok(places) => {
                    let members = places.iter().filter_map(|place| place.name()).map(str::to_owned).collect();
                    sets.extend(name.map(|name| NamedMembers { name, members, areas: Vec::new() }));
                    lists.place.extend(places);
                }
                Err(problem) => self.problems.push(problem),
            }
        }
        for contact in &contacts {
            let expanded = match &mesh {
                Some(source) => {
                    let (rotation, data) = (rotation.of_sectors(), self.data.as_deref());
                    contact::expand(contact, ContactInputs { source, rotation, data, bodies: &lists.body })
                }
                None if self.study_file_only => contact::placeholders(contact, &self.mentioned(contact)),
                None => Err(no_mesh(contact, "between")),
            };
            match expanded {
                Ok(expanded) => {
                    lists.place.extend(expanded.places);
                    lists.joint.extend(expanded.joints);
                    lists.force.extend(expanded.forces);
                    sets.push(NamedMembers {
                        name: contact.name().unwrap_or_default().to_owned(),
                        members: expanded.areas.iter().map(|(joint, _)| joint.clone()).collect(),
                        areas: expanded.areas.iter().map(|(_, area)| *area).collect(),
                    });
                    areas.extend(expanded.areas);
                    summaries.push(expanded.summary);
                }
                // a mesh that cannot be read was reported already
                Err(problem) if self.problems.len() == before || mesh.is_some() => self.problems.push(problem),
                Err(_) => {}
            }
        }
        if let Some(contact) = contacts.first().filter(|_| lists.joint.len() > MAX_ELEMENTS) {
            let message =
                format!("{} joints with those of the contacts; the limit is {MAX_ELEMENTS}", lists.joint.len());
            self.problems
                .push(Problem::new(&contact.location, "contact", message).help("use a coarser mesh of the faces"));
        }
        (self.problems.len() == before).then(|| MeshUse {
            source: mesh.map(Arc::new),
            contacts: summaries,
            areas,
            sets: Arc::new(sets),
        })
    }

    /// Reads the mesh of a structure; `None` without a mesh, or if it cannot be read.
    fn mesh(&mut self, structure: &MatrixSource, axis: Option<CoordinateAxis>) -> Option<MeshSource> {
        let MatrixSource { table: structure, component, .. } = structure;
        let entry = structure.entry("mesh")?;
        let CompiledValue::Fixed(ResolvedValue::Text(name)) = &entry.value else { return None };
        let units = match &structure.entry("units")?.value {
            CompiledValue::Fixed(ResolvedValue::Text(units)) => unit_sets::find(units)?,
            _ => return None,
        };
        match mesh::read(self.path_of(name)) {
            Ok(mesh) => {
                let rows = component.as_ref().map_or(&[][..], Component::rows);
                if let Some((node, system)) = rotated_node(&mesh, rows) {
                    let message = format!(
                        "the displacements of node {node} are along coordinate system {system} of the mesh, not along x, y and z"
                    );
                    let help = "export matrices and mesh with displacements along the basic system (field CD of GRID)";
                    self.problems.push(Problem::new(&entry.location, "mesh", message).help(help));
                    return None;
                }
                Some(MeshSource { mesh, length: units.length, axis })
            }
            Err(mut error) => {
                let help = std::mem::take(&mut error.remedy);
                let message = error.to_string().trim_end_matches("; ").to_owned();
                self.problems.push(Problem::new(&entry.location, "mesh", message).help(help));
                None
            }
        }
    }

    fn places_on_sets(&self, place: CompiledTable, mesh: Option<&MeshSource>) -> Result<Vec<CompiledTable>, Problem> {
        match mesh {
            Some(mesh) => sets::expand(place, mesh),
            None if place.entry("set").is_none() => Ok(vec![place]),
            None if self.study_file_only => Ok(sets::places_of_nodes(&place, &self.mentioned(&place))),
            None => Err(no_mesh(&place, "set")),
        }
    }

    /// Returns the nodes of a set or contact that the study file mentions.
    fn mentioned(&self, table: &CompiledTable) -> Vec<i64> {
        let text = self.sources.first().map_or("", |source| source.text.as_str());
        table.name().map_or_else(Vec::new, |name| mentioned_nodes(text, name))
    }
}

/// Returns the first node with rows in the matrices that are not along x, y and z, and its
/// coordinate system.
fn rotated_node(mesh: &Mesh, rows: &[String]) -> Option<(i64, i64)> {
    let systems = mesh.displacement_systems();
    let of_row = |row: &String| {
        let node: i64 = row.rsplit_once('.')?.0.parse().ok()?;
        Some((node, *systems.get(&node)?))
    };
    rows.iter().find_map(of_row)
}

fn no_mesh(table: &CompiledTable, key: &str) -> Problem {
    Problem::new(table.location_of(key, None), key, "a set needs a mesh, but the study has none")
        .help("add to [structure] mesh = \"blade.inp\", the mesh of its matrices")
}
