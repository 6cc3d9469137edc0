//! A structure with a mesh as a surface in three dimensions, with the displacements of its nodes
//! over one period, for a page that draws it. A disk has all sectors.
//!
//! Numbers are written as their bytes in base 64, which takes a third of the bytes of decimal text.

use crate::base64::base64;
use crate::fields::{Fields, contact_state, positions};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::ops::Range;
use stickslip_study::dataset::{Dataset, MeshSource};

/// The surface of a mesh without its motion.
pub(crate) struct MovingSurface<'a> {
    fields: &'a Fields<'a>,
    source: &'a MeshSource,
    surface: Surface,
}

/// Returns the surface and its first motion; `None` if the results have no displacements of all
/// nodes.
///
/// The object has the number of `instants`; `positions` (m) as `f32`, and `triangles` of three
/// `u32`; `displacements` (m) as `f32` and the states of `contact` as `u8`, instant by instant.
pub fn moving_surface(dataset: &Dataset) -> Option<Value> {
    let (fields, source) = Fields::of(dataset)?;
    let surface = MovingSurface::new(&fields, source);
    let mut object = surface.still();
    let motion = surface.motion(fields.orbits().first()?);
    object.as_object_mut()?.extend(motion.as_object()?.clone());
    Some(object)
}

impl<'a> MovingSurface<'a> {
    pub fn new(fields: &'a Fields<'a>, source: &'a MeshSource) -> Self {
        MovingSurface { fields, source, surface: Surface::new(source) }
    }

    /// Returns the number of nodes of the surface, in all sectors.
    pub fn nodes(&self) -> usize {
        self.fields.sectors() * self.surface.nodes.len()
    }

    /// Returns positions and triangles.
    pub fn still(&self) -> Value {
        let (sectors, count) = (self.fields.sectors(), self.surface.nodes.len());
        let of_sector = |sector: usize| {
            let all: Vec<[f64; 3]> = positions(self.source, sector, sectors).collect();
            self.surface.nodes.iter().flat_map(|node| all[*node]).map(|x| x as f32).collect::<Vec<_>>()
        };
        let triangles = (0..sectors)
            .flat_map(|sector| self.surface.triangles.iter().map(move |node| (sector * count) as u32 + node));
        json!({
            "positions": numbers((0..sectors).flat_map(of_sector)),
            "triangles": base64(&triangles.flat_map(u32::to_le_bytes).collect::<Vec<u8>>()),
        })
    }

    /// Returns the displacements and the contact states of an orbit.
    pub fn motion(&self, orbit: &Range<usize>) -> Value {
        let (fields, each, count) = (self.fields, self.surface.nodes.len(), self.nodes());
        let instants = fields.instants(orbit);
        let mut displacement = vec![[0.0f32; 3]; instants.len() * count];
        let mut states = vec![0u8; instants.len() * count];
        for (instant, rows) in instants.iter().enumerate() {
            for row in rows.clone() {
                let index = i64::try_from(fields.node[row]).ok().and_then(|number| self.source.mesh.node(number));
                let Some(place) = index.and_then(|index| self.surface.index.get(&index)) else { continue };
                let sector = fields.sector.map_or(0, |sector| sector[row] as usize);
                let at = instant * count + sector * each + place;
                displacement[at] = fields.displacement.map(|column| column[row] as f32);
                states[at] = fields.contact.map_or(0, |contact| contact_state(&contact[row]));
            }
        }
        json!({
            "instants": instants.len(),
            "displacements": numbers(displacement.into_iter().flatten()),
            "contact": base64(&states),
        })
    }
}

fn numbers(values: impl Iterator<Item = f32>) -> String {
    base64(&values.flat_map(f32::to_le_bytes).collect::<Vec<u8>>())
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
    use stickslip_study::dataset::{CellValues, Column, Table};

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

    /// The third of four sectors stands on the other side of the axis, and moves there.
    #[test]
    fn a_disk_has_all_sectors() {
        let deck = "*NODE\n1,1,0,0\n2,2,0,0\n3,1,1,0\n4,1,0,1\n*ELEMENT,TYPE=C3D4\n1,1,2,3,4\n";
        let mesh = stickslip_formats::mesh::read_bytes(deck.as_bytes()).unwrap();
        let axis = Some(stickslip::structure::CoordinateAxis::Z);
        let integers =
            |name: &str, values: Vec<u64>| Column { name: name.to_owned(), values: CellValues::Integer(values) };
        let table = Table {
            name: "fields".to_owned(),
            columns: vec![
                Column::numbers("time_s", vec![0.0; 16]),
                integers("sector", (0..16).map(|row| row / 4).collect()),
                integers("node", (0..16).map(|row| row % 4 + 1).collect()),
                Column::numbers("x_m", (0..16).map(f64::from).collect()),
                Column::numbers("y_m", vec![0.0; 16]),
                Column::numbers("z_m", vec![0.0; 16]),
            ],
        };
        let source = std::sync::Arc::new(MeshSource { mesh, length: 1e-3, axis });
        let dataset = Dataset { tables: vec![table], mesh: Some(source), ..Dataset::default() };
        let (fields, source) = Fields::of(&dataset).unwrap();
        let surface = MovingSurface::new(&fields, source);
        let third = 2 * 4 + surface.surface.index[&1];
        let [x, y, z] = positions(source, 2, 4).nth(1).unwrap();
        assert!((x + 2e-3).abs() < 1e-12 && y.abs() < 1e-12 && z == 0.0);
        let object = moving_surface(&dataset).unwrap();
        let shown = |name: &str| object[name].as_str().unwrap().to_owned();
        let all = (0..4).flat_map(|sector| {
            let all: Vec<[f64; 3]> = positions(source, sector, 4).collect();
            surface.surface.nodes.iter().flat_map(move |node| all[*node]).collect::<Vec<_>>()
        });
        assert_eq!(shown("positions"), numbers(all.map(|x| x as f32)));
        // node 2 of the third sector is in row 9
        let moved = (0..16).map(|at| {
            let (sector, place) = (at / 4, at % 4);
            [(4 * sector + surface.surface.nodes[place]) as f32, 0.0, 0.0]
        });
        assert_eq!(shown("displacements"), numbers(moved.flatten()));
        assert_eq!(surface.surface.nodes[third - 8], 1);
        // four faces in each sector
        assert_eq!(object["triangles"].as_str().unwrap().len(), 4 * 4 * 3 * 4 * 4 / 3);
    }
}
