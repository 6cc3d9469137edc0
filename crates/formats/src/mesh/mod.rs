//! Meshes of finite-element programs: nodes, elements, and named sets of them.
//!
//! ```
//! use stickslip_formats::mesh;
//!
//! let deck = b"*NODE\n1,0,0,0\n2,2,0,0\n3,0,3,0\n4,0,0,1\n\
//!     *ELEMENT,TYPE=C3D4\n1,1,2,3,4\n*NSET,NSET=FOOT\n1,2,3\n";
//! let mesh = mesh::read_bytes(deck)?;
//! assert_eq!((mesh.nodes().len(), mesh.elements().len()), (4, 1));
//! // The outer faces whose nodes all belong to the set, with the area of each node.
//! let foot = mesh.patch("FOOT")?;
//! assert_eq!(foot.faces().len(), 1);
//! assert!((foot.area() - 3.0).abs() < 1e-12 && foot.nodes()[0].normal == [0.0, 0.0, -1.0]);
//! # Ok::<(), stickslip_formats::Error>(())
//! ```
//!
//! - `shape`: corners, edges and sides of elements;
//! - `face`: area, normals and closest point of a face;
//! - `patch`: the outer faces of a set, and the area and normal of its nodes;
//! - `builder`: what a reader has read so far;
//! - `include`: the files that a deck includes;
//! - one file for every format in [`TABLE`].

mod abaqus_deck;
mod ansys_archive;
mod builder;
mod face;
mod gmsh;
mod include;
mod nastran_bulk;
mod nastran_coordinates;
mod patch;
mod report;
mod shape;
mod vector;
mod vtk_unstructured;

pub use face::{ClosestPoint, Face, NodeShare};
pub use patch::{Patch, PatchNode, ProjectedPoint};
pub use report::MeshReport;
pub use shape::{Family, Shape};
pub use vtk_unstructured::vtk_cell_type;

use crate::error::{Error, ErrorKind, Location};
use crate::file::load;
use builder::MeshBuilder;
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::path::Path;
use std::sync::OnceLock;

/// A mesh. Nodes and elements have the numbers of their file, and indices from zero.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    format: &'static str,
    nodes: Vec<MeshNode>,
    by_number: HashMap<i64, usize>,
    elements: Vec<Element>,
    connectivity: Vec<u32>,
    sets: Vec<MeshSet>,
    displacement_systems: BTreeMap<i64, i64>,
    notes: Vec<String>,
    /// The sides that no two solids share, once they are known.
    outer: OnceLock<Vec<Side>>,
}

/// A node of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshNode {
    /// Number in the file.
    pub number: i64,
    /// Coordinates, in the unit of length of the file.
    pub position: [f64; 3],
}

/// An element of a mesh; [`Mesh::element_nodes`] returns its nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Element {
    /// Number in the file.
    pub number: i64,
    /// Corners and middle nodes.
    pub shape: Shape,
    /// Index of its first node in the connectivity.
    first: usize,
}

/// A named set of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshSet {
    /// Name in the file.
    pub name: String,
    /// Its members.
    pub members: Members,
}

/// The members of a set, by their indices in the mesh.
#[derive(Debug, Clone, PartialEq)]
pub enum Members {
    /// Nodes.
    Nodes(Vec<usize>),
    /// Elements.
    Elements(Vec<usize>),
    /// Sides of elements.
    Sides(Vec<Side>),
}

/// A side of an element, by their indices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Side {
    /// Index of the element.
    pub element: usize,
    /// Number of the side, from zero.
    pub side: usize,
}

/// A file format for meshes.
pub struct MeshFormat {
    /// Name of the format.
    pub name: &'static str,
    /// Short description, with the programs that write the format.
    pub summary: &'static str,
    /// Returns true if the content looks like this format.
    sniff: fn(&[u8]) -> bool,
    read: fn(&MeshFile<'_>, &mut MeshBuilder) -> Result<(), Error>,
}

/// A file to read: its content, and the folder of the files that it includes.
struct MeshFile<'a> {
    bytes: &'a [u8],
    folder: Option<&'a Path>,
}

/// All formats. The first format that recognizes the content reads the file.
pub const TABLE: &[MeshFormat] = &[
    abaqus_deck::FORMAT,
    gmsh::FORMAT,
    vtk_unstructured::FORMAT,
    ansys_archive::FORMAT,
    // The cards may be anywhere in a file.
    nastran_bulk::FORMAT,
];

/// Reads a mesh. The content determines the format.
///
/// # Errors
/// [`Error`] with file, location, problem and remedy.
pub fn read(path: impl AsRef<Path>) -> Result<Mesh, Error> {
    let path = path.as_ref();
    read_loaded(path, &load(path)?)
}

/// Reads a file whose content looks like a mesh. Returns `None` for other files and for those that
/// cannot be opened.
pub fn read_if_mesh(path: impl AsRef<Path>) -> Option<Result<Mesh, Error>> {
    let path = path.as_ref();
    let bytes = load(path).ok()?;
    find_format(&bytes).is_some().then(|| read_loaded(path, &bytes))
}

fn read_loaded(path: &Path, bytes: &[u8]) -> Result<Mesh, Error> {
    let folder = Some(path.parent().unwrap_or(Path::new("")));
    parse(&MeshFile { bytes, folder }).map_err(|error| error.with_path(path))
}

/// Reads a mesh from a file in memory, which cannot include other files.
///
/// # Errors
/// Like [`read`], without the path.
pub fn read_bytes(bytes: &[u8]) -> Result<Mesh, Error> {
    parse(&MeshFile { bytes, folder: None })
}

fn find_format(bytes: &[u8]) -> Option<&'static MeshFormat> {
    let bytes = crate::without_bom(bytes);
    TABLE.iter().find(|format| (format.sniff)(bytes))
}

fn parse(file: &MeshFile<'_>) -> Result<Mesh, Error> {
    let bytes = crate::without_bom(file.bytes);
    let format = find_format(bytes).ok_or_else(|| {
        let known = TABLE.iter().map(|format| format.summary).collect::<Vec<_>>().join("; ");
        let problem = "no known format of a mesh matches the content of the file".to_owned();
        Error::new(ErrorKind::Format, Location::File, problem, format!("use one of these formats: {known}"))
    })?;
    let mut builder = MeshBuilder::default();
    (format.read)(&MeshFile { bytes, folder: file.folder }, &mut builder)?;
    let mesh = builder.finish()?;
    Ok(Mesh { format: format.name, ..mesh })
}

impl Mesh {
    /// Returns the name of its format, a row of [`TABLE`].
    pub fn format(&self) -> &'static str {
        self.format
    }

    /// Returns the nodes, in file order.
    pub fn nodes(&self) -> &[MeshNode] {
        &self.nodes
    }

    /// Returns the index of the node with this number.
    pub fn node(&self, number: i64) -> Option<usize> {
        self.by_number.get(&number).copied()
    }

    /// Returns the elements, in file order.
    pub fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// Returns the nodes of an element, by their indices, in the order of its shape.
    pub fn element_nodes(&self, element: usize) -> &[u32] {
        let Element { shape, first, .. } = self.elements[element];
        &self.connectivity[first..first + shape.nodes()]
    }

    /// Returns the sets, in file order.
    pub fn sets(&self) -> &[MeshSet] {
        &self.sets
    }

    /// Returns the numbers of nodes whose displacements in the matrices are not along x, y and z,
    /// with the number of the coordinate system that they are along.
    pub fn displacement_systems(&self) -> &BTreeMap<i64, i64> {
        &self.displacement_systems
    }

    /// Returns what the reader left out.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Returns the nodes of a set, by their indices, each once: of elements and sides, all their
    /// nodes. Upper and lower case are equal.
    ///
    /// # Errors
    /// There is no set with this name.
    pub fn nodes_of(&self, name: &str) -> Result<Vec<usize>, Error> {
        let mut taken = vec![false; self.nodes.len()];
        let all: Vec<usize> = match &self.set(name)?.members {
            Members::Nodes(nodes) => nodes.clone(),
            Members::Elements(elements) => {
                elements.iter().flat_map(|element| self.element_nodes(*element)).map(|node| *node as usize).collect()
            }
            Members::Sides(sides) => sides.iter().flat_map(|side| self.side_nodes(*side)).collect(),
        };
        Ok(all.into_iter().filter(|node| !std::mem::replace(&mut taken[*node], true)).collect())
    }

    /// Returns the set with this name: sides, otherwise nodes, otherwise elements.
    fn set(&self, name: &str) -> Result<&MeshSet, Error> {
        let rank = |set: &&MeshSet| match set.members {
            Members::Sides(_) => 0,
            Members::Nodes(_) => 1,
            Members::Elements(_) => 2,
        };
        self.sets.iter().filter(|set| set.name.eq_ignore_ascii_case(name)).min_by_key(rank).ok_or_else(|| {
            // Most names that a message lists.
            let mut names: Vec<&str> = self.sets.iter().map(|set| set.name.as_str()).take(20).collect();
            names.dedup();
            let remedy = match names.is_empty() {
                true => "the mesh has no named set; name the nodes in the mesh generator".to_owned(),
                false => format!("the sets are {}", names.join(", ")),
            };
            Error::new(ErrorKind::Selection, Location::File, format!("the mesh has no set `{name}`"), remedy)
        })
    }

    /// Returns the nodes of a side, by their indices.
    fn side_nodes(&self, Side { element, side }: Side) -> Vec<usize> {
        let nodes = self.element_nodes(element);
        self.elements[element].shape.side(side).into_iter().map(|position| nodes[position] as usize).collect()
    }

    /// Returns the range of the coordinates along each axis; `None` without nodes.
    pub fn extent(&self) -> Option<[Range<f64>; 3]> {
        let first = self.nodes.first()?.position;
        let range = |axis: usize| {
            let along = self.nodes.iter().map(|node| node.position[axis]);
            along.fold(first[axis]..first[axis], |range, x| range.start.min(x)..range.end.max(x))
        };
        Some([range(0), range(1), range(2)])
    }
}
