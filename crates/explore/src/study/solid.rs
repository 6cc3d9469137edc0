//! The structure as a surface in three dimensions, with the displacements of its nodes over one
//! period: for a study with a mesh.
//!
//! Numbers are sent as their bytes in base 64, which takes a third of the bytes of decimal text.

use serde_json::{Value, json};
use std::collections::HashMap;
use stickslip_report::base64;
use stickslip_study::Study;
use stickslip_study::dataset::{Dataset, FIELDS, MeshSource};

/// Limits of the motion of a surface.
#[derive(Debug, Clone, Copy)]
struct SolidSettings {
    /// Largest number of instants per period. Default 24: between them the page interpolates.
    instants: usize,
    /// Smallest number of instants. Default 8: the page draws a smooth first harmonic.
    least: usize,
    /// Largest number of instants times nodes. Default 2e6: 200 MB in the table of a run.
    rows: usize,
}

impl Default for SolidSettings {
    fn default() -> Self {
        SolidSettings { instants: 24, least: 8, rows: 2_000_000 }
    }
}

/// Returns the number of instants at which an orbit of a study can have the displacements of all
/// nodes; `None` without a mesh, for a disk, or if the mesh is too large for a page.
pub(crate) fn instants(study: &Study) -> Option<usize> {
    let settings = SolidSettings::default();
    let nodes = study.mesh()?.mesh.nodes().len();
    let model = study.case(0).ok()?.model;
    let affordable = (settings.rows / nodes.max(1)).min(settings.instants);
    (model.ring.is_none() && affordable >= settings.least).then_some(affordable)
}

/// Returns the surface and its motion; `None` if the results have no displacements of all nodes.
pub(crate) fn solid(dataset: &Dataset) -> Option<Value> {
    let source = dataset.mesh.as_ref()?;
    let table = dataset.tables.iter().find(|table| table.name == FIELDS)?;
    let (time, node) = (table.numbers("time_s")?, table.integers("node")?);
    let [x, y, z] = ["x_m", "y_m", "z_m"].map(|name| table.numbers(name));
    let (along, contact) = ([x?, y?, z?], table.texts("contact")?);
    let surface = Surface::new(source);
    let instants = time.chunk_by(|a, b| a == b).count();
    let count = surface.nodes.len();
    let (mut displacement, mut states) = (vec![[0.0f32; 3]; instants * count], vec![0u8; instants * count]);
    let mut instant = 0;
    for row in 0..time.len() {
        instant += usize::from(row > 0 && time[row] != time[row - 1]);
        let index = i64::try_from(node[row]).ok().and_then(|number| source.mesh.node(number));
        let Some(place) = index.and_then(|index| surface.index.get(&index)) else { continue };
        displacement[instant * count + place] = along.map(|column| column[row] as f32);
        states[instant * count + place] = state(&contact[row]);
    }
    let positions = surface.nodes.iter().flat_map(|node| source.mesh.nodes()[*node].position);
    Some(json!({
        "instants": instants,
        "positions": numbers(positions.map(|x| (x * source.length) as f32)),
        "triangles": base64(&surface.triangles.iter().flat_map(|node| node.to_le_bytes()).collect::<Vec<u8>>()),
        "displacements": numbers(displacement.into_iter().flatten()),
        "contact": base64(&states),
    }))
}

fn numbers(values: impl Iterator<Item = f32>) -> String {
    base64(&values.flat_map(f32::to_le_bytes).collect::<Vec<u8>>())
}

/// Returns the number of a contact state, as in the files for ParaView.
fn state(word: &str) -> u8 {
    match word {
        "" => 0,
        "open" => 1,
        "touch" => 2,
        "stick" => 3,
        _ => 4,
    }
}

/// The outer faces of solids and all faces of shells, as triangles. A mesh without elements has its
/// nodes alone.
struct Surface {
    /// Indices of its nodes in the mesh.
    nodes: Vec<usize>,
    /// Index in `nodes` by index in the mesh.
    index: HashMap<usize, usize>,
    /// Three indices in `nodes` for each triangle.
    triangles: Vec<u32>,
}

impl Surface {
    fn new(source: &MeshSource) -> Surface {
        let mesh = &source.mesh;
        let mut surface = Surface { nodes: Vec::new(), index: HashMap::new(), triangles: Vec::new() };
        mesh.outer_faces().iter().for_each(|face| surface.add(&face.nodes));
        for (element, _) in mesh.elements().iter().enumerate().filter(|(_, element)| !element.shape.is_solid()) {
            let nodes: Vec<usize> = mesh.element_nodes(element).iter().map(|node| *node as usize).collect();
            surface.add(&nodes);
        }
        if surface.triangles.is_empty() {
            (0..mesh.nodes().len()).for_each(|node| _ = surface.place(node));
        }
        surface
    }

    fn place(&mut self, node: usize) -> u32 {
        let next = self.nodes.len();
        let place = *self.index.entry(node).or_insert(next);
        if place == next {
            self.nodes.push(node);
        }
        place as u32
    }

    /// Adds a face: its corners around it, then its middle nodes.
    fn add(&mut self, face: &[usize]) {
        let triangles: &[[usize; 3]] = match face.len() {
            3 => &[[0, 1, 2]],
            4 => &[[0, 1, 2], [0, 2, 3]],
            6 => &[[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
            8 => &[[0, 4, 7], [4, 1, 5], [5, 2, 6], [6, 3, 7], [4, 5, 6], [4, 6, 7]],
            _ => &[],
        };
        for position in triangles.iter().flatten() {
            let place = self.place(face[*position]);
            self.triangles.push(place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadratic_faces_become_triangles_with_their_middle_nodes() {
        for (nodes, count) in [(3, 1), (4, 2), (6, 4), (8, 6)] {
            let mut surface = Surface { nodes: Vec::new(), index: HashMap::new(), triangles: Vec::new() };
            surface.add(&(0..nodes).collect::<Vec<_>>());
            assert_eq!((surface.triangles.len(), surface.nodes.len()), (3 * count, nodes));
            // every edge inside has two triangles of opposite directions
            let edges: Vec<[u32; 2]> =
                surface.triangles.chunks(3).flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]).collect();
            let shared = edges.iter().filter(|edge| edges.contains(&[edge[1], edge[0]])).count();
            assert_eq!((edges.len() - shared, edges.len()), (nodes, 3 * count));
        }
    }

    #[test]
    fn a_model_of_masses_has_no_surface() {
        let text = stickslip_study::templates::find("blade-couple").unwrap().study;
        assert_eq!(instants(&stickslip_study::read_study("couple.toml", text, &[]).unwrap()), None);
    }
}
