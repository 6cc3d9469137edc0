//! Gmsh meshes (`.msh`) as text, versions 2.2 and 4.1.
//!
//! ```text
//! $MeshFormat
//! 4.1 0 8
//! $EndMeshFormat
//! $PhysicalNames
//! 1
//! 2 7 "PAD"
//! $EndPhysicalNames
//! $Entities
//! …
//! ```
//! A physical group becomes two sets of its name: its nodes, and its triangles, quadrilaterals and
//! solids. In version 4.1 the groups belong to the entities, in 2.2 to the elements. Complete
//! elements of second order, with nodes in the middle of their faces, are left out; Gmsh writes
//! those without by `Mesh.SecondOrderIncomplete = 1`.
//!
//! Source: Gmsh Reference Manual, "MSH file format", "Node ordering".

use super::builder::{MeshBuilder, SetKind};
use super::shape::Shape;
use super::{MeshFile, MeshFormat};
use crate::error::{Error, ErrorKind};
use crate::text::{Line, Lines, quoted};
use std::collections::HashMap;

pub(super) const FORMAT: MeshFormat =
    MeshFormat { name: "gmsh", summary: "Gmsh (.msh), text of version 2.2 or 4.1", sniff, read };

fn sniff(bytes: &[u8]) -> bool {
    Lines::new(bytes).take(1000).any(|line| line.text.trim_ascii() == b"$MeshFormat")
}

/// An element type of Gmsh.
struct GmshElement {
    code: i64,
    /// The shape; `None` for points and lines, which only carry nodes into groups.
    shape: Option<Shape>,
    /// For each node of the shape, its position in the file; empty if they agree.
    order: &'static [usize],
}

fn element_type(code: i64) -> Option<GmshElement> {
    let (shape, order): (Option<Shape>, &[usize]) = match code {
        1 | 8 | 15 => (None, &[]),
        2 => (Shape::face(3), &[]),
        3 => (Shape::face(4), &[]),
        9 => (Shape::face(6), &[]),
        16 => (Shape::face(8), &[]),
        4 => (Shape::solid(4), &[]),
        5 => (Shape::solid(8), &[]),
        6 => (Shape::solid(6), &[]),
        7 => (Shape::solid(5), &[]),
        11 => (Shape::solid(10), &[0, 1, 2, 3, 4, 5, 6, 7, 9, 8]),
        17 => (Shape::solid(20), &[0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15]),
        18 => (Shape::solid(15), &[0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11]),
        19 => (Shape::solid(13), &[0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12]),
        _ => return None,
    };
    Some(GmshElement { code, shape, order })
}

/// A group or an entity: dimension and number.
type EntityKey = (i64, i64);

/// The state of the reader.
struct Gmsh<'a, 'b> {
    lines: Lines<'a>,
    builder: &'b mut MeshBuilder,
    names: HashMap<EntityKey, String>,
    /// The physical groups of each entity.
    groups: HashMap<EntityKey, Vec<i64>>,
}

fn read(file: &MeshFile<'_>, builder: &mut MeshBuilder) -> Result<(), Error> {
    let mut gmsh = Gmsh { lines: Lines::new(file.bytes), builder, names: HashMap::new(), groups: HashMap::new() };
    let mut is_version_4 = false;
    while let Some(line) = gmsh.lines.next() {
        match line.text.trim_ascii() {
            b"$MeshFormat" => is_version_4 = gmsh.version()?,
            b"$PhysicalNames" => gmsh.names()?,
            b"$Entities" if is_version_4 => gmsh.entities()?,
            b"$Nodes" if is_version_4 => gmsh.node_blocks()?,
            b"$Nodes" => gmsh.nodes()?,
            b"$Elements" if is_version_4 => gmsh.element_blocks()?,
            b"$Elements" => gmsh.elements()?,
            _ => {}
        }
    }
    Ok(())
}

fn integers(line: &Line) -> Result<Vec<i64>, Error> {
    line.words().map(|word| line.integer(word)).collect()
}

impl Gmsh<'_, '_> {
    /// Reads the header. Returns true for version 4.1.
    fn version(&mut self) -> Result<bool, Error> {
        let line = self.lines.expect("the version")?;
        let [version, binary, _] = line.exactly("version, file type and size of numbers")?;
        let refuse = |problem: &str| {
            let remedy = "save the mesh as text of version 4.1: gmsh -save -format msh41, without Mesh.Binary";
            Err(Error::new(ErrorKind::Unsupported, line.location(), problem.to_owned(), remedy))
        };
        if line.integer(binary)? != 0 {
            return refuse("the mesh is binary, which is not supported");
        }
        match version {
            b"4.1" => Ok(true),
            b"2.2" | b"2.1" | b"2" | b"2.0" => Ok(false),
            _ => refuse(&format!("the mesh has version {} of the format", quoted(version))),
        }
    }

    fn count(&mut self) -> Result<usize, Error> {
        let line = self.lines.expect_filled("a count")?;
        line.count(line.words().next().unwrap_or_default())
    }

    fn names(&mut self) -> Result<(), Error> {
        for _ in 0..self.count()? {
            let line = self.lines.expect("a physical name")?;
            let mut words = line.words();
            let mut number = || line.integer(words.next().unwrap_or_default());
            let tag = (number()?, number()?);
            let text = String::from_utf8_lossy(line.text);
            let name = text.split('"').nth(1).ok_or_else(|| line.malformed("a name in quotes", &quoted(line.text)))?;
            self.names.insert(tag, name.to_owned());
        }
        Ok(())
    }

    /// Reads the physical groups of points, curves, surfaces and volumes.
    fn entities(&mut self) -> Result<(), Error> {
        let line = self.lines.expect("numbers of entities")?;
        for (dimension, count) in integers(&line)?.into_iter().enumerate().take(4) {
            // a point has three coordinates, the others six bounds
            let groups_at = if dimension == 0 { 4 } else { 7 };
            for _ in 0..count {
                let line = self.lines.expect("an entity")?;
                let words: Vec<_> = line.words().collect();
                let word = |at: usize| words.get(at).copied().unwrap_or_default();
                let groups = line.count(word(groups_at))?;
                let all = words.iter().skip(groups_at + 1).take(groups).map(|word| line.integer(word));
                let tag = (dimension as i64, line.integer(word(0))?);
                self.groups.insert(tag, all.collect::<Result<_, _>>()?);
            }
        }
        Ok(())
    }

    fn nodes(&mut self) -> Result<(), Error> {
        for _ in 0..self.count()? {
            let line = self.lines.expect("a node")?;
            let [number, x, y, z] = line.exactly("a node and its coordinates")?;
            let position = [line.real(x)?, line.real(y)?, line.real(z)?];
            self.builder.node(line.integer(number)?, position, &line)?;
        }
        Ok(())
    }

    fn node_blocks(&mut self) -> Result<(), Error> {
        for _ in 0..self.count()? {
            let line = self.lines.expect("a block of nodes")?;
            let [_, _, _, count] = line.exactly("dimension, entity, parameters and number of nodes")?;
            let mut numbers = Vec::new();
            for _ in 0..line.count(count)? {
                let line = self.lines.expect("the number of a node")?;
                let [number] = line.exactly("the number of a node")?;
                numbers.push(line.integer(number)?);
            }
            for number in numbers {
                let line = self.lines.expect("the coordinates of a node")?;
                let mut words = line.words();
                let mut next = || line.real(words.next().unwrap_or_default());
                let position = [next()?, next()?, next()?];
                self.builder.node(number, position, &line)?;
            }
        }
        Ok(())
    }

    fn elements(&mut self) -> Result<(), Error> {
        for _ in 0..self.count()? {
            let line = self.lines.expect("an element")?;
            let numbers = integers(&line)?;
            let [number, code, tags, rest @ ..] = &numbers[..] else {
                return Err(line.malformed("an element with its type and tags", &quoted(line.text)));
            };
            let tags = usize::try_from(*tags).unwrap_or(usize::MAX);
            let Some((tags, nodes)) = rest.split_at_checked(tags) else {
                return Err(line.malformed("the tags of the element", &quoted(line.text)));
            };
            // the first tag is the physical group, zero for none
            let groups: Vec<i64> = tags.first().copied().filter(|group| *group != 0).into_iter().collect();
            self.element(*number, *code, nodes, &groups, &line)?;
        }
        Ok(())
    }

    fn element_blocks(&mut self) -> Result<(), Error> {
        for _ in 0..self.count()? {
            let line = self.lines.expect("a block of elements")?;
            let [dimension, entity, code, count] = line.exactly("dimension, entity, type and number of elements")?;
            let tag = (line.integer(dimension)?, line.integer(entity)?);
            let (code, groups) = (line.integer(code)?, self.groups.get(&tag).cloned().unwrap_or_default());
            for _ in 0..line.count(count)? {
                let line = self.lines.expect("an element")?;
                let numbers = integers(&line)?;
                let Some((number, nodes)) = numbers.split_first() else {
                    return Err(line.malformed("an element and its nodes", &quoted(line.text)));
                };
                self.element(*number, code, nodes, &groups, &line)?;
            }
        }
        Ok(())
    }

    fn element(&mut self, number: i64, code: i64, nodes: &[i64], groups: &[i64], line: &Line) -> Result<(), Error> {
        let kind = element_type(code);
        match &kind {
            None => self.builder.leave_out(&format!("{code} of Gmsh")),
            Some(GmshElement { shape: Some(shape), order, .. }) => {
                if !order.is_empty() && nodes.len() == order.len() {
                    let ordered: Vec<i64> = order.iter().map(|position| nodes[*position]).collect();
                    self.builder.element(number, *shape, &ordered, line)?;
                } else {
                    self.builder.element(number, *shape, nodes, line)?;
                }
            }
            Some(_) => {}
        }
        let dimension = match kind {
            Some(GmshElement { shape: Some(shape), .. }) => 2 + i64::from(shape.is_solid()),
            Some(GmshElement { code, .. }) => i64::from(code != 15),
            // a type that is not read has nodes in its group, whose name is not known
            None => return Ok(()),
        };
        for group in groups {
            let name = self.names.get(&(dimension, *group)).cloned().unwrap_or_else(|| format!("physical_{group}"));
            self.builder.add(&name, SetKind::Nodes, nodes.iter().copied());
            if dimension >= 2 {
                self.builder.add(&name, SetKind::Elements, [number]);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::error::Location;
    use crate::mesh::{Mesh, read_bytes};

    const NEW: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 7 \"PAD one\"\n3 9 \"BODY\"\n$EndPhysicalNames\n\
        $Entities\n1 0 1 1\n5 0 0 0 1 3\n2 0 0 0 1 1 0 1 7 1 4\n1 0 0 0 1 1 1 1 9 1 2\n$EndEntities\n\
        $Nodes\n2 5 1 9\n2 2 0 3\n1\n2\n3\n0 0 0\n2 0 0\n0 3 0\n3 1 1 2\n4\n9\n0 0 1 0.5 0.5 0.5\n0 0 -1 0 0 0\n$EndNodes\n\
        $Elements\n4 5 1 4\n0 5 15 1\n1 9\n2 2 2 1\n2 1 2 3\n3 1 4 1\n3 1 2 3 4\n3 1 92 1\n4 1 2 3 4\n$EndElements\n";

    const OLD: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 7 \"PAD one\"\n3 9 \"BODY\"\n$EndPhysicalNames\n\
        $Nodes\n5\n1 0 0 0\n2 2 0 0\n3 0 3 0\n4 0 0 1\n9 0 0 -1\n$EndNodes\n\
        $Elements\n4\n1 15 2 3 5 9\n2 2 2 7 2 1 2 3\n3 4 2 9 1 1 2 3 4\n4 92 2 9 1 1 2 3 4\n$EndElements\n";

    fn mesh(text: &str) -> Mesh {
        read_bytes(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn both_versions_give_the_same_mesh() {
        for text in [NEW, OLD] {
            let mesh = mesh(text);
            assert_eq!((mesh.nodes().len(), mesh.elements().len(), mesh.format()), (5, 2, "gmsh"));
            let numbers = |name: &str| -> Vec<i64> {
                mesh.nodes_of(name).unwrap().iter().map(|node| mesh.nodes()[*node].number).collect()
            };
            assert_eq!(
                (numbers("PAD one"), numbers("body"), numbers("physical_3")),
                (vec![1, 2, 3], vec![1, 2, 3, 4], vec![9])
            );
            let patch = mesh.patch("PAD one").unwrap();
            assert!((patch.area() - 3.0).abs() < 1e-14 && patch.nodes()[0].normal == [0.0, 0.0, -1.0]);
            assert_eq!(mesh.notes(), ["elements of type 92 of Gmsh are left out: 1"]);
        }
    }

    #[test]
    fn binary_and_other_versions_are_refused() {
        for (text, location, words) in [
            (OLD.replace("2.2 0 8", "2.2 1 8"), Location::Line(2), "binary"),
            (NEW.replace("4.1 0 8", "4.0 0 8"), Location::Line(2), "version `4.0`"),
            (NEW.replace("2 1 2 3\n3 1 4 1", "2 1 2\n3 1 4 1"), Location::Line(35), "the 3 nodes of element 2"),
            (OLD.replace("2 2 2 7 2 1 2 3", "2 2 9 7 2 1 2 3"), Location::Line(20), "tags"),
            (OLD[..OLD.len() - 32].to_owned(), Location::Line(22), "ends before"),
        ] {
            let error = read_bytes(text.as_bytes()).map(|_| ()).expect_err(&text);
            assert!(error.location == location && error.to_string().contains(words), "{error}");
        }
    }
}
