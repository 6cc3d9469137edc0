//! A patch: the outer faces of a set, with area and normal of each of its nodes.
//!
//! A side is outer if no other solid shares its corners. A set of nodes has the outer faces whose
//! nodes all belong to it; a set of sides, or of triangles and quadrilaterals, has these faces.
//! Normals point out of the solid.

use super::face::{ClosestPoint, Face};
use super::vector::{Vector, dot, norm, scaled, sub};
use super::{Members, Mesh, Side};
use crate::error::{Error, ErrorKind, Location};
use std::collections::{BTreeMap, HashMap};

/// The faces of a set.
#[derive(Debug, Clone)]
pub struct Patch {
    faces: Vec<Face>,
    nodes: Vec<PatchNode>,
}

/// A node of a patch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchNode {
    /// Index in the mesh.
    pub node: usize,
    /// Position.
    pub position: [f64; 3],
    /// Its share of the area of all faces of the patch around it.
    pub area: f64,
    /// Unit normal: the mean of the normals of these faces, weighted by their shares.
    pub normal: [f64; 3],
}

/// The point of a patch that is closest to a given one.
#[derive(Debug, Clone, PartialEq)]
pub struct ProjectedPoint {
    /// Its position, normal and distance.
    pub point: ClosestPoint,
    /// The nodes of its face, by their indices in the mesh, with their weights.
    pub nodes: Vec<(usize, f64)>,
}

/// The corners of a side in ascending order; a triangle repeats its last.
type SideKey = [u32; 4];

impl Mesh {
    /// Returns the outer faces of the set with this name.
    ///
    /// # Errors
    /// There is no such set, or it has no outer face.
    pub fn patch(&self, name: &str) -> Result<Patch, Error> {
        let faces = match &self.set(name)?.members {
            Members::Sides(sides) => sides.iter().map(|side| self.outward_face(*side)).collect(),
            Members::Elements(elements) => {
                let faces = elements.iter().copied().filter(|element| !self.elements[*element].shape.is_solid());
                self.faces_of_elements(faces.collect())
            }
            Members::Nodes(nodes) => {
                let mut inside = vec![false; self.nodes.len()];
                nodes.iter().for_each(|node| inside[*node] = true);
                let whole = |side: &&Side| self.side_nodes(**side).iter().all(|node| inside[*node]);
                let outer: Vec<&Side> = self.outer_sides().iter().filter(whole).collect();
                match outer.is_empty() {
                    true => self.faces_of_elements(self.faces_within(&inside)),
                    false => outer.into_iter().map(|side| self.outward_face(*side)).collect(),
                }
            }
        };
        let faces: Vec<Face> = faces.into_iter().filter(|face| face.area() > 0.0).collect();
        if faces.is_empty() {
            let problem =
                format!("the set `{name}` contains no whole outer face of an element, so its area is unknown");
            let remedy = "put all nodes of the contact face into the set, middle nodes included";
            return Err(Error::new(ErrorKind::Selection, Location::File, problem, remedy));
        }
        Ok(Patch::new(self, faces))
    }

    /// Returns all outer faces of solids, in the order of their elements.
    pub fn outer_faces(&self) -> Vec<Face> {
        self.outer_sides().iter().map(|side| self.outward_face(*side)).collect()
    }

    fn outer_sides(&self) -> &[Side] {
        self.outer.get_or_init(|| {
            let mut count: HashMap<SideKey, u32> = HashMap::new();
            for side in self.solid_sides() {
                *count.entry(self.side_key(side)).or_default() += 1;
            }
            self.solid_sides().filter(|side| count[&self.side_key(*side)] == 1).collect()
        })
    }

    fn solid_sides(&self) -> impl Iterator<Item = Side> {
        let solids = self.elements.iter().enumerate().filter(|(_, element)| element.shape.is_solid());
        solids.flat_map(|(index, element)| (0..element.shape.sides()).map(move |side| Side { element: index, side }))
    }

    fn side_key(&self, Side { element, side }: Side) -> SideKey {
        let nodes = self.element_nodes(element);
        let shape = self.elements[element].shape;
        let positions = shape.side(side);
        let corners = if positions.len().is_multiple_of(3) { 3 } else { 4 };
        let mut key = [u32::MAX; 4];
        key.iter_mut().zip(&positions[..corners]).for_each(|(key, position)| *key = nodes[*position]);
        key.sort_unstable();
        key
    }

    fn face(&self, nodes: Vec<usize>) -> Face {
        let points = nodes.iter().map(|node| self.nodes[*node].position).collect();
        Face::new(nodes, points)
    }

    /// Returns a side with its normal away from the element's centre.
    fn outward_face(&self, side: Side) -> Face {
        let mut face = self.face(self.side_nodes(side));
        if self.elements[side.element].shape.is_solid() {
            let all = self.element_nodes(side.element);
            let sum = all.iter().fold([0.0; 3], |sum: Vector, node| {
                let position = self.nodes[*node as usize].position;
                [0, 1, 2].map(|axis| sum[axis] + position[axis])
            });
            let outward = sub(&face.center(), &scaled(&sum, 1.0 / all.len() as f64));
            let normal = face
                .shares()
                .iter()
                .fold([0.0; 3], |sum: Vector, share| [0, 1, 2].map(|axis| sum[axis] + share.area * share.normal[axis]));
            if dot(&normal, &outward) < 0.0 {
                face.flip();
            }
        }
        face
    }

    /// Returns the triangles and quadrilaterals whose nodes all lie inside.
    fn faces_within(&self, inside: &[bool]) -> Vec<usize> {
        let whole = |element: &usize| self.element_nodes(*element).iter().all(|node| inside[*node as usize]);
        let face = |element: &usize| !self.elements[*element].shape.is_solid();
        (0..self.elements.len()).filter(face).filter(whole).collect()
    }

    /// Returns the faces of triangles and quadrilaterals, turned out of the solids on which they
    /// lie.
    fn faces_of_elements(&self, elements: Vec<usize>) -> Vec<Face> {
        let sides = || elements.iter().map(|element| Side { element: *element, side: 0 });
        let mut below: HashMap<SideKey, Option<Side>> = sides().map(|side| (self.side_key(side), None)).collect();
        for side in self.solid_sides() {
            if let Some(found) = below.get_mut(&self.side_key(side)) {
                *found = Some(side);
            }
        }
        let face = |side: Side| self.outward_face(below[&self.side_key(side)].unwrap_or(side));
        sides().map(face).collect()
    }
}

impl Patch {
    fn new(mesh: &Mesh, faces: Vec<Face>) -> Patch {
        let mut sums: BTreeMap<usize, (f64, Vector)> = BTreeMap::new();
        for face in &faces {
            for (node, share) in face.nodes.iter().zip(face.shares()) {
                let (area, normal) = sums.entry(*node).or_default();
                *area += share.area;
                (0..3).for_each(|axis| normal[axis] += share.area * share.normal[axis]);
            }
        }
        let node = |(node, (area, normal)): (usize, (f64, Vector))| {
            let length = norm(&normal);
            let normal = if length > 0.0 { scaled(&normal, 1.0 / length) } else { normal };
            PatchNode { node, position: mesh.nodes[node].position, area, normal }
        };
        Patch { nodes: sums.into_iter().map(node).collect(), faces }
    }

    /// Returns the faces.
    pub fn faces(&self) -> &[Face] {
        &self.faces
    }

    /// Returns the nodes of the faces, by ascending index.
    pub fn nodes(&self) -> &[PatchNode] {
        &self.nodes
    }

    /// Returns the area of all faces.
    pub fn area(&self) -> f64 {
        self.faces.iter().map(Face::area).sum()
    }

    /// Returns the point of the patch that is closest to a node of another patch, among the faces
    /// whose normals oppose that of the node; `None` if no face does.
    pub fn closest(&self, node: &PatchNode) -> Option<ProjectedPoint> {
        let mut best: Option<ProjectedPoint> = None;
        for face in &self.faces {
            let radius = face.nodes.len() as f64 * face.area().sqrt();
            let nearest = norm(&sub(&face.center(), &node.position)) - radius;
            if best.as_ref().is_some_and(|best| best.point.distance <= nearest) {
                continue;
            }
            let point = face.closest(&node.position);
            let nearer = best.as_ref().is_none_or(|best| point.distance < best.point.distance);
            if nearer && dot(&point.normal, &node.normal) < 0.0 {
                let nodes = face.nodes.iter().copied().zip(point.weights.iter().copied()).collect();
                best = Some(ProjectedPoint { point, nodes });
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::read_bytes;

    /// Two hexahedra of 1 x 2 x 3 side by side along x, by C3D20 with straight edges, or C3D8.
    fn two_bricks(quadratic: bool) -> Mesh {
        let mut nodes: Vec<Vector> = Vec::new();
        let mut deck = String::from("*NODE\n");
        let mut elements = String::new();
        for x in [0.0, 1.0] {
            let corner = |i: usize| {
                let [a, b] = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]][i % 4];
                [x + a, b, if i < 4 { 0.0 } else { 3.0 }]
            };
            let mut points: Vec<Vector> = (0..8).map(corner).collect();
            if quadratic {
                let edges = crate::mesh::Family::Hexahedron.edges().iter();
                points.extend(edges.map(|[a, b]| [0, 1, 2].map(|i| 0.5 * (corner(*a)[i] + corner(*b)[i]))));
            }
            let mut numbers = vec![(x as i64 + 1).to_string()];
            for point in points {
                let known = nodes.iter().position(|node| *node == point).unwrap_or_else(|| {
                    nodes.push(point);
                    nodes.len() - 1
                });
                numbers.push((known + 1).to_string());
            }
            elements += &format!("{}\n", numbers.join(","));
        }
        for (i, [x, y, z]) in nodes.iter().enumerate() {
            deck += &format!("{},{x},{y},{z}\n", i + 1);
        }
        deck += &format!("*ELEMENT,TYPE=C3D{}\n{elements}*NSET,NSET=TOP\n", if quadratic { 20 } else { 8 });
        for (i, _) in nodes.iter().enumerate().filter(|(_, node)| node[2] == 3.0) {
            deck += &format!("{},\n", i + 1);
        }
        read_bytes(deck.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{deck}"))
    }

    #[test]
    fn outer_faces_enclose_the_solid() {
        for quadratic in [false, true] {
            let mesh = two_bricks(quadratic);
            let faces = mesh.outer_faces();
            let area: f64 = faces.iter().map(Face::area).sum();
            assert_eq!(faces.len(), 10);
            assert!((area - 2.0 * (4.0 + 6.0 + 12.0 / 2.0)).abs() < 1e-12, "{area}");
            // the divergence theorem: ∮ x · n dA is three times the volume
            let share =
                |face: &Face| -> f64 { face.shares().iter().map(|s| s.area * dot(&face.center(), &s.normal)).sum() };
            let volume: f64 = faces.iter().map(share).sum::<f64>() / 3.0;
            assert!((volume - 12.0).abs() < 1e-12, "{volume}");
        }
    }

    #[test]
    fn nodes_share_the_area_of_their_set() {
        for (quadratic, corner, middle) in [(false, 0.5, 1.0), (true, 2.0 * 3.0 / 76.0, 2.0 * 6.0 / 76.0)] {
            let patch = two_bricks(quadratic).patch("top").unwrap();
            assert_eq!(patch.faces().len(), 2);
            assert!(patch.nodes().iter().all(|node| node.area > 0.0 && (node.normal[2] - 1.0).abs() < 1e-15));
            assert!((patch.nodes().iter().map(|node| node.area).sum::<f64>() - 4.0).abs() < 1e-14);
            let at = |x: f64| patch.nodes().iter().find(|node| node.position == [x, 0.0, 3.0]).unwrap().area;
            assert!((at(0.0) - corner).abs() < 1e-14 && (at(1.0) - middle).abs() < 1e-14);
        }
    }

    #[test]
    fn the_closest_point_opposes_the_normal() {
        let mesh = two_bricks(true);
        let top = mesh.patch("TOP").unwrap();
        let above = PatchNode { node: 0, position: [1.25, 0.5, 3.5], area: 1.0, normal: [0.0, 0.0, -1.0] };
        let found = top.closest(&above).unwrap();
        assert!(
            (found.point.distance - 0.5).abs() < 1e-12
                && (found.nodes.iter().map(|n| n.1).sum::<f64>() - 1.0).abs() < 1e-12
        );
        // the weights interpolate the position
        let x: f64 = found.nodes.iter().map(|(node, weight)| weight * mesh.nodes()[*node].position[0]).sum();
        assert!((x - 1.25).abs() < 1e-12);
        assert!(top.closest(&PatchNode { normal: [0.0, 0.0, 1.0], ..above }).is_none());
    }

    #[test]
    fn sets_without_a_whole_face_are_refused() {
        let text = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4\n1,1,2,3,4\n*NSET,NSET=EDGE\n1,2\n";
        let mesh = read_bytes(text.as_bytes()).unwrap();
        assert!(mesh.patch("EDGE").unwrap_err().to_string().contains("no whole outer face"));
        assert!(mesh.patch("EDGES").unwrap_err().to_string().contains("the sets are EDGE"));
    }
}
