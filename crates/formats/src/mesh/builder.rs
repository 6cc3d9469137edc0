//! A mesh while it is read: nodes, elements and sets by their numbers in the file.

use super::shape::Shape;
use super::{Element, Members, Mesh, MeshNode, MeshSet, Side};
use crate::error::{Error, ErrorKind, Location};
use crate::text::Line;
use std::collections::{BTreeMap, HashMap};

/// What a reader has read so far.
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
    numbers: Vec<i64>,
    /// The sides of the elements, from zero; empty for other sets.
    sides: Vec<usize>,
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

    /// Adds members to a set, which is made if it does not exist. Upper and lower case are equal.
    pub fn add(&mut self, name: &str, kind: SetKind, numbers: impl IntoIterator<Item = i64>) {
        let set = self.set_mut(name, kind);
        set.numbers.extend(numbers);
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
        let set = self.set_mut(name, SetKind::Sides);
        set.numbers.extend(elements);
        set.sides.resize(set.numbers.len(), side);
    }

    fn set_mut(&mut self, name: &str, kind: SetKind) -> &mut NumberedSet {
        let known = self.sets.iter().position(|set| set.kind == kind && set.name.eq_ignore_ascii_case(name));
        let index = known.unwrap_or_else(|| {
            self.sets.push(NumberedSet { name: name.to_owned(), kind, numbers: Vec::new(), sides: Vec::new() });
            self.sets.len() - 1
        });
        &mut self.sets[index]
    }

    /// Returns the members of a set that was read before.
    pub fn members(&self, name: &str, kind: SetKind) -> Option<&[i64]> {
        let found = self.sets.iter().find(|set| set.kind == kind && set.name.eq_ignore_ascii_case(name));
        found.map(|set| set.numbers.as_slice())
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
        for NumberedSet { name, kind, numbers, sides } in std::mem::take(&mut self.sets) {
            let find = |number: &i64| match kind {
                SetKind::Nodes => self.by_number.get(number).copied(),
                _ => self.element_by_number.get(number).copied(),
            };
            let mut members: Vec<usize> = numbers.iter().filter_map(find).collect();
            let missing = numbers.len() - members.len();
            if missing > 0 {
                let what = if kind == SetKind::Nodes { "nodes" } else { "elements" };
                self.notes
                    .push(format!("set {name}: {missing} of {} {what} are not in the file or not read", numbers.len()));
            }
            let members = match kind {
                SetKind::Sides => {
                    let pairs = numbers.iter().zip(sides).filter_map(|(number, side)| Some((find(number)?, side)));
                    let inside = |(element, side): &(usize, usize)| *side < self.elements[*element].shape.sides();
                    let sides = pairs.filter(inside).map(|(element, side)| Side { element, side });
                    Members::Sides(sides.collect())
                }
                _ => {
                    members.sort_unstable();
                    members.dedup();
                    if kind == SetKind::Nodes { Members::Nodes(members) } else { Members::Elements(members) }
                }
            };
            sets.push(MeshSet { name, members });
        }
        for (kind, count) in self.left_out {
            self.notes.push(format!("{count} elements of type {kind} are left out"));
        }
        let MeshBuilder { nodes, by_number, elements, notes, .. } = self;
        Ok(Mesh { nodes, by_number, elements, connectivity, sets, notes, ..Mesh::default() })
    }
}
