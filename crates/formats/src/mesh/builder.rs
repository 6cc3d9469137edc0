//! A mesh while it is read: nodes, elements and sets by their numbers in the file.

use super::shape::Shape;
use super::{Element, Members, Mesh, MeshNode, MeshSet, Side};
use crate::error::{Error, ErrorKind, Location};
use crate::text::Line;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Nodes, elements and sets that a reader has read so far.
#[derive(Default)]
pub(super) struct MeshBuilder {
    nodes: Vec<MeshNode>,
    by_number: HashMap<i64, usize>,
    elements: Vec<Element>,
    element_by_number: HashMap<i64, usize>,
    /// Nodes of the elements, by number.
    connectivity: Vec<i64>,
    sets: Vec<NumberedSet>,
    /// Number of elements of each type that was left out.
    left_out: BTreeMap<String, usize>,
    /// Number of elements that lack some middle nodes.
    incomplete: usize,
    /// Coordinate systems along which nodes have their displacements, unless they are x, y and z.
    displacement_systems: BTreeMap<i64, i64>,
    notes: Vec<String>,
}

/// The kind of the members of a set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SetKind {
    Nodes,
    Elements,
    Sides,
}

/// A set with the numbers of its members.
struct NumberedSet {
    name: String,
    kind: SetKind,
    /// Each once: a deck may name sets within sets.
    members: BTreeSet<NumberedMember>,
}

/// A member of a set by its number in the file.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct NumberedMember {
    number: i64,
    /// The side of an element, from zero; zero in other sets.
    side: usize,
}

impl MeshBuilder {
    /// Adds a node. The same node may occur twice, at the same position.
    pub fn node(&mut self, number: i64, position: [f64; 3], line: &Line) -> Result<(), Error> {
        if position.iter().any(|x| !x.is_finite()) {
            return Err(Error::new(
                ErrorKind::NotFinite,
                line.location(),
                format!("a coordinate of node {number} is not finite"),
                "export the mesh again",
            ));
        }
        if let Some(before) = self.by_number.insert(number, self.nodes.len()) {
            if self.nodes[before].position != position {
                let found = format!("node {number} at a second position");
                return Err(line.malformed("every node once", &found));
            }
            self.by_number.insert(number, before);
            return Ok(());
        }
        self.nodes.push(MeshNode { number, position });
        Ok(())
    }

    /// Adds an element with its nodes in the order of the shape.
    pub fn element(&mut self, number: i64, shape: Shape, nodes: &[i64], line: &Line) -> Result<(), Error> {
        if nodes.len() != shape.nodes() {
            return Err(
                line.malformed(&format!("the {} nodes of element {number}", shape.nodes()), &nodes.len().to_string())
            );
        }
        if self.element_by_number.insert(number, self.elements.len()).is_some() {
            return Err(line.malformed("every element once", &format!("element {number} again")));
        }
        self.elements.push(Element { number, shape, first: self.connectivity.len() });
        self.connectivity.extend(nodes);
        Ok(())
    }

    /// Counts an element of a type that is not read.
    pub fn leave_out(&mut self, kind: &str) {
        *self.left_out.entry(kind.to_owned()).or_default() += 1;
    }

    /// Counts an element that lacks some of its middle nodes, and is read with its corners.
    pub fn count_incomplete(&mut self) {
        self.incomplete += 1;
    }

    /// States that the displacements of a node are along the axes of a coordinate system.
    pub fn set_displacement_system(&mut self, node: i64, system: i64) {
        self.displacement_systems.insert(node, system);
    }

    /// Adds members to a set, which is made if it does not exist. Upper and lower case are equal.
    pub fn add(&mut self, name: &str, kind: SetKind, numbers: impl IntoIterator<Item = i64>) {
        self.set_mut(name, kind).members.extend(numbers.into_iter().map(|number| NumberedMember { number, side: 0 }));
    }

    /// Adds the nodes or elements read so far that have certain numbers.
    pub fn add_known(&mut self, name: &str, kind: SetKind, is_member: impl Fn(i64) -> bool) {
        let known: Vec<i64> = match kind {
            SetKind::Nodes => self.nodes.iter().map(|node| node.number).filter(|n| is_member(*n)).collect(),
            _ => self.elements.iter().map(|element| element.number).filter(|n| is_member(*n)).collect(),
        };
        self.add(name, kind, known);
    }

    /// Adds a range of numbers. A range that is longer than the mesh, as a damaged number makes
    /// it, stands for the nodes or elements read so far.
    pub fn add_range(&mut self, name: &str, kind: SetKind, from: i64, to: i64) {
        let longest = (self.nodes.len() + self.elements.len()) as i64;
        if to - from < longest {
            self.add(name, kind, from..=to);
        } else {
            self.add_known(name, kind, |number| (from..=to).contains(&number));
        }
    }

    /// Adds the same side of several elements to a surface.
    pub fn add_sides(&mut self, name: &str, side: usize, elements: impl IntoIterator<Item = i64>) {
        let sides = elements.into_iter().map(|number| NumberedMember { number, side });
        self.set_mut(name, SetKind::Sides).members.extend(sides);
    }

    fn set_mut(&mut self, name: &str, kind: SetKind) -> &mut NumberedSet {
        let known = self.sets.iter().position(|set| set.kind == kind && set.name.eq_ignore_ascii_case(name));
        let index = known.unwrap_or_else(|| {
            self.sets.push(NumberedSet { name: name.to_owned(), kind, members: BTreeSet::new() });
            self.sets.len() - 1
        });
        &mut self.sets[index]
    }

    /// Returns the members of a set that was read before; none of an unknown set.
    pub fn members(&self, name: &str, kind: SetKind) -> Vec<i64> {
        let found = self.sets.iter().filter(|set| set.kind == kind && set.name.eq_ignore_ascii_case(name));
        found.flat_map(|set| &set.members).map(|member| member.number).collect()
    }

    /// Returns the numbers of an element's nodes.
    pub fn nodes_of_element(&self, number: i64) -> Option<&[i64]> {
        let Element { shape, first, .. } = self.elements[*self.element_by_number.get(&number)?];
        Some(&self.connectivity[first..first + shape.nodes()])
    }

    /// Resolves all numbers.
    pub fn finish(mut self) -> Result<Mesh, Error> {
        if self.nodes.is_empty() {
            let problem = "the file contains no node".to_owned();
            return Err(Error::new(ErrorKind::Truncated, Location::File, problem, "export the mesh with its nodes"));
        }
        let unknown = |owner: String, what: &str| {
            let problem = format!("{owner} names {what}, which the file does not contain");
            Error::new(ErrorKind::Malformed, Location::File, problem, "export the whole mesh to one file")
        };
        let mut connectivity = Vec::with_capacity(self.connectivity.len());
        for element in &self.elements {
            for number in &self.connectivity[element.first..element.first + element.shape.nodes()] {
                let node = self.by_number.get(number);
                let node =
                    node.ok_or_else(|| unknown(format!("element {}", element.number), &format!("node {number}")))?;
                connectivity.push(u32::try_from(*node).map_err(|_| {
                    let problem = "the mesh has more than 2³² nodes".to_owned();
                    Error::new(ErrorKind::TooLarge, Location::File, problem, "export a smaller mesh")
                })?);
            }
        }
        let mut sets = Vec::with_capacity(self.sets.len());
        for NumberedSet { name, kind, members: stated } in std::mem::take(&mut self.sets) {
            let index = |member: &NumberedMember| match kind {
                SetKind::Nodes => self.by_number.get(&member.number).copied(),
                _ => self.element_by_number.get(&member.number).copied(),
            };
            let known = stated.iter().filter_map(|member| Some(Side { element: index(member)?, side: member.side }));
            let known: Vec<Side> = known.collect();
            let missing = stated.len() - known.len();
            if missing > 0 {
                let what = if kind == SetKind::Nodes { "nodes" } else { "elements" };
                let of = stated.len();
                self.notes.push(format!("set {name}: {missing} of {of} {what} are not in the file or not read"));
            }
            let mut indices: Vec<usize> = known.iter().map(|known| known.element).collect();
            indices.sort_unstable();
            let members = match kind {
                SetKind::Nodes => Members::Nodes(indices),
                SetKind::Elements => Members::Elements(indices),
                SetKind::Sides => {
                    let exists = |side: &Side| side.side < self.elements[side.element].shape.sides();
                    Members::Sides(known.into_iter().filter(exists).collect())
                }
            };
            sets.push(MeshSet { name, members });
        }
        for (kind, count) in self.left_out {
            self.notes.push(format!("elements of type {kind} are left out: {count}"));
        }
        if self.incomplete > 0 {
            let count = self.incomplete;
            self.notes
                .push(format!("elements that lack some of their middle nodes are read with their corners: {count}"));
        }
        if let Some((node, system)) = self.displacement_systems.first_key_value() {
            let count = self.displacement_systems.len();
            let first = format!("node {node}: coordinate system {system}");
            self.notes.push(format!("nodes with displacements along other axes than x, y and z: {count} ({first})"));
        }
        let MeshBuilder { nodes, by_number, elements, displacement_systems, notes, .. } = self;
        Ok(Mesh { nodes, by_number, elements, connectivity, sets, displacement_systems, notes, ..Mesh::default() })
    }
}
