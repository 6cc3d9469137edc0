//! Archives of Ansys (`.cdb`), written by `CDWRITE`: nodes, elements and components.
//!
//! ```text
//! ET,1,186
//! NBLOCK,6,SOLID,      20,      20
//! (3i9,6e21.13e3)
//!         1        0        0 0.0000000000000E+000 …
//! EBLOCK,19,SOLID,       1,       1
//! (19i9)
//! CMBLOCK,PADS    ,NODE,       2
//! (8i10)
//!          1        -8
//! ```
//! Current versions write the types of elements as a block, `ETBLOCK`, instead of `ET`.
//!
//! A line of an element has eleven numbers (the second its type, the ninth its number of nodes, the
//! eleventh its own), then its nodes. Wedges, pyramids and tetrahedra may be bricks that repeat
//! nodes. A negative number in a component ends a range.
//!
//! Source: Ansys Mechanical APDL Programmer's Reference, "Archive files", `ETBLOCK`, `NBLOCK`,
//! `EBLOCK`, `CMBLOCK`; Element Reference, `SOLID186`, "Degenerated shape elements".

use super::builder::{MeshBuilder, SetKind};
use super::shape::{Family, Shape};
use super::{MeshFile, MeshFormat};
use crate::error::{Error, ErrorKind};
use crate::text::{Line, Lines, quoted};
use std::collections::HashMap;

pub(super) const FORMAT: MeshFormat =
    MeshFormat { name: "ansys-archive", summary: "archives of Ansys (.cdb), by CDWRITE", sniff, read };

fn sniff(bytes: &[u8]) -> bool {
    Lines::new(bytes).any(|line| line.text.get(..7).is_some_and(|word| word.eq_ignore_ascii_case(b"NBLOCK,")))
}

/// Solids and faces by the numbers of their types; other elements are left out.
const SOLIDS: [i64; 12] = [5, 45, 70, 87, 90, 92, 95, 185, 186, 187, 190, 285];
const FACES: [i64; 12] = [28, 41, 55, 63, 77, 93, 131, 132, 181, 182, 183, 281];

fn read(file: &MeshFile<'_>, builder: &mut MeshBuilder) -> Result<(), Error> {
    let mut types: HashMap<i64, i64> = HashMap::new();
    let mut lines = Lines::new(file.bytes);
    while let Some(line) = lines.next() {
        let text = String::from_utf8_lossy(line.text).to_uppercase();
        let fields: Vec<&str> = text.split(',').map(str::trim).collect();
        match fields[..] {
            ["ET", number, kind, ..] => {
                let digits = kind.trim_start_matches(|c: char| !c.is_ascii_digit());
                if let (Ok(number), Ok(kind)) = (number.parse(), digits.parse()) {
                    types.insert(number, kind);
                }
            }
            ["ETBLOCK", ..] => element_types(&mut lines, &mut types)?,
            ["NBLOCK", _, ..] => nodes(&mut lines, builder)?,
            ["EBLOCK", _, "SOLID", ..] => elements(&mut lines, &types, builder)?,
            ["EBLOCK", ..] => {
                let problem = "this block of elements has no SOLID key".to_owned();
                let remedy = "write the archive with CDWRITE,DB of a current version";
                return Err(Error::new(ErrorKind::Unsupported, line.location(), problem, remedy));
            }
            ["CMBLOCK", _, kind, ..] => component(&line, &mut lines, kind, builder)?,
            _ => {}
        }
    }
    Ok(())
}

/// The fields of a block, from its format, such as `(3i9,6e21.13e3)` or `(1i7,2i9,6e21.13)`.
struct Fields {
    /// The columns behind each integer.
    integer_ends: Vec<usize>,
    real_width: usize,
}

impl Fields {
    fn new(line: &Line) -> Result<Fields, Error> {
        let text = String::from_utf8_lossy(line.text).to_lowercase();
        let wrong = || line.malformed("a format such as (3i9,6e21.13e3)", &quoted(line.text));
        let inside = text.trim().strip_prefix('(').and_then(|text| text.strip_suffix(')')).ok_or_else(wrong)?;
        let mut fields = Fields { integer_ends: Vec::new(), real_width: 0 };
        for part in inside.split(',') {
            let (count, rest) = part.split_once(['i', 'e']).ok_or_else(wrong)?;
            let width = rest.split('.').next().and_then(|width| width.parse().ok());
            let width: usize = width.filter(|width| (1..=40).contains(width)).ok_or_else(wrong)?;
            if part.contains('i') {
                let count: usize = count.parse().ok().filter(|count| *count <= 40).ok_or_else(wrong)?;
                let begin = fields.begin_of_reals();
                fields.integer_ends.extend((1..=count).map(|field| begin + field * width));
            } else {
                fields.real_width = width;
            }
        }
        if fields.integer_ends.is_empty() || fields.integer_ends.len() > 40 { Err(wrong()) } else { Ok(fields) }
    }

    /// Returns the number of columns of all integers.
    fn begin_of_reals(&self) -> usize {
        self.integer_ends.last().copied().unwrap_or(0)
    }

    /// Returns the integers of a line, up to its end.
    fn integers(&self, line: &Line) -> Result<Vec<i64>, Error> {
        let begins = std::iter::once(0).chain(self.integer_ends.iter().copied());
        let fields = begins.zip(&self.integer_ends).map(|(begin, end)| line.columns(begin, *end));
        fields.take_while(|field| !field.is_empty()).map(|field| line.integer(field)).collect()
    }
}

/// Returns whether a line ends a block: `-1`, or a command such as `N,R5.3,LOC,-1,`.
fn ends(line: &Line) -> bool {
    let text = line.text.trim_ascii();
    text == b"-1" || text.first().is_some_and(u8::is_ascii_alphabetic)
}

/// Reads a block of element types: their numbers and names.
fn element_types(lines: &mut Lines, types: &mut HashMap<i64, i64>) -> Result<(), Error> {
    lines.expect("the format of the element types")?;
    for line in lines.by_ref() {
        if ends(&line) {
            return Ok(());
        }
        let mut fields = line.text.split(u8::is_ascii_whitespace).filter(|field| !field.is_empty());
        let (Some(number), Some(kind)) = (fields.next(), fields.next()) else {
            return Err(line.malformed("the number of an element type and its name", &quoted(line.text)));
        };
        types.insert(line.integer(number)?, line.integer(kind)?);
    }
    Ok(())
}

fn nodes(lines: &mut Lines, builder: &mut MeshBuilder) -> Result<(), Error> {
    let head = lines.expect("the format of the nodes")?;
    let fields = Fields::new(&head)?;
    for line in lines.by_ref() {
        if ends(&line) {
            return Ok(());
        }
        let begin = fields.begin_of_reals();
        let mut position = [0.0; 3];
        for (axis, x) in position.iter_mut().enumerate() {
            // zeros at the end of a line are left out
            let field = line.columns(begin + axis * fields.real_width, begin + (axis + 1) * fields.real_width);
            *x = if field.is_empty() { 0.0 } else { line.real(field)? };
        }
        builder.node(line.integer(line.columns(0, fields.integer_ends[0]))?, position, &line)?;
    }
    Ok(())
}

fn elements(lines: &mut Lines, types: &HashMap<i64, i64>, builder: &mut MeshBuilder) -> Result<(), Error> {
    let head = lines.expect("the format of the elements")?;
    let fields = Fields::new(&head)?;
    while let Some(line) = lines.next() {
        if ends(&line) {
            return Ok(());
        }
        let numbers = fields.integers(&line)?;
        let (Some(kind), Some(count), Some(number)) = (numbers.get(1), numbers.get(8), numbers.get(10)) else {
            return Err(line.malformed("eleven numbers and the nodes of an element", &numbers.len().to_string()));
        };
        // no element has more nodes
        let count = usize::try_from(*count).ok().filter(|count| *count <= 40);
        let count = count.ok_or_else(|| line.malformed("a number of nodes", &quoted(line.text)))?;
        let mut nodes = numbers[11..].to_vec();
        while nodes.len() < count {
            let more = lines.expect("the nodes of an element")?;
            let more = fields.integers(&more)?;
            if more.is_empty() {
                break;
            }
            nodes.extend(more);
        }
        nodes.truncate(count);
        let name = types.get(kind).copied().unwrap_or_default();
        let families: &[Family] = match name {
            _ if SOLIDS.contains(&name) => &[Family::Tetrahedron, Family::Pyramid, Family::Wedge, Family::Hexahedron],
            _ if FACES.contains(&name) => &[Family::Triangle, Family::Quadrilateral],
            _ => &[],
        };
        match undegenerate(families, &nodes) {
            Some((shape, nodes)) if nodes[shape.family.corners()..].contains(&0) => {
                builder.count_incomplete();
                let shape = Shape { quadratic: false, ..shape };
                builder.element(*number, shape, &nodes[..shape.nodes()], &line)?;
            }
            Some((shape, nodes)) => builder.element(*number, shape, &nodes, &line)?,
            None => builder.leave_out(&format!("{name} with {count} nodes")),
        }
    }
    Ok(())
}

/// Returns shape and nodes of a brick or quadrilateral that may repeat nodes.
fn undegenerate(families: &[Family], nodes: &[i64]) -> Option<(Shape, Vec<i64>)> {
    let of = |count: usize| match families.len() {
        2 => Shape::face(count),
        4 => Shape::solid(count),
        _ => None,
    };
    let stated = of(nodes.len())?;
    let (corners, middles) = nodes.split_at(stated.family.corners());
    // middle nodes that are all absent
    if stated.quadratic && middles.iter().all(|node| *node == 0) {
        return undegenerate(families, corners);
    }
    // the corners of the brick that each family keeps
    let kept: &[usize] = match (stated.family, corners) {
        (Family::Hexahedron, [_, _, k, l, m, n, o, p]) => match (k == l, m == n && n == o && o == p, o == p) {
            (true, true, _) => &[0, 1, 2, 4],
            (false, true, _) => &[0, 1, 2, 3, 4],
            (true, false, true) => &[0, 1, 2, 4, 5, 6],
            _ => &[0, 1, 2, 3, 4, 5, 6, 7],
        },
        (Family::Quadrilateral, [_, _, k, l]) if k == l => &[0, 1, 2],
        _ => return Some((stated, nodes.to_vec())),
    };
    let family = *families.iter().find(|family| family.corners() == kept.len())?;
    let mut found: Vec<i64> = kept.iter().map(|corner| corners[*corner]).collect();
    if stated.quadratic {
        for [a, b] in family.edges() {
            let ends = [found[*a], found[*b]];
            let edges = stated.family.edges().iter().map(|[a, b]| [corners[*a], corners[*b]]);
            let edge = edges.zip(middles).find(|(edge, _)| *edge == ends || *edge == [ends[1], ends[0]]);
            found.push(*edge?.1);
        }
    }
    Some((Shape { family, quadratic: stated.quadratic }, found))
}

fn component(line: &Line, lines: &mut Lines, kind: &str, builder: &mut MeshBuilder) -> Result<(), Error> {
    let text = String::from_utf8_lossy(line.text);
    let mut fields = text.split(',').skip(1).map(str::trim);
    let (name, count) = (fields.next().unwrap_or_default().to_owned(), fields.nth(1).unwrap_or_default());
    let count = count.split('!').next().unwrap_or_default().trim();
    let count = line.count(count.as_bytes())?;
    let head = lines.expect("the format of a component")?;
    let fields = Fields::new(&head)?;
    let kind = match kind.get(..4) {
        Some("NODE") => SetKind::Nodes,
        _ => SetKind::Elements,
    };
    builder.add(&name, kind, []);
    let (mut read, mut before) = (0, None);
    while read < count {
        let line = lines.expect("the members of a component")?;
        let numbers = fields.integers(&line)?;
        if numbers.is_empty() {
            return Err(line.malformed("the members of a component", &quoted(line.text)));
        }
        for number in numbers.into_iter().take(count - read) {
            read += 1;
            match before {
                Some(from) if number < 0 => builder.add_range(&name, kind, from + 1, -number),
                _ => builder.add(&name, kind, [number]),
            }
            before = Some(number);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Location;
    use crate::mesh::{Mesh, read_bytes};

    /// A line of an element of this type and number.
    fn element(kind: i64, number: i64, nodes: &[i64]) -> String {
        let head = [1, kind, 1, 1, 0, 0, 0, 0, nodes.len() as i64, 0, number];
        let all: Vec<String> = head.iter().chain(nodes).map(|number| format!("{number:9}")).collect();
        let (first, rest) = all.split_at(all.len().min(19));
        let mut text = first.concat() + "\n";
        if !rest.is_empty() {
            text += &(rest.concat() + "\n");
        }
        text
    }

    /// A brick of eight nodes and a wedge above, written as a brick that repeats nodes.
    fn archive() -> String {
        let mut text = String::from(
            "/PREP7\nET,1,185\nET,        2,SOLID185\nET,3,188\nNBLOCK,6,SOLID,       10,       10\n(3i9,6e21.13e3)\n",
        );
        let points = [
            [0, 0, 0],
            [1, 0, 0],
            [1, 1, 0],
            [0, 1, 0],
            [0, 0, 1],
            [1, 0, 1],
            [1, 1, 1],
            [0, 1, 1],
            [0, 0, 2],
            [1, 0, 2],
        ];
        for (i, [x, y, z]) in points.iter().enumerate() {
            text += &format!("{:9}{:9}{:9}", i + 1, 0, 0);
            let last = [x, y, z].iter().rposition(|x| **x != 0).map_or(0, |last| last + 1);
            for x in [x, y, z].iter().take(last) {
                text += &format!("{:>21}", format!("{:.13E}", f64::from(**x)).replace("E0", "E+000"));
            }
            text += "\n";
        }
        text += "N,R5.3,LOC,       -1,\nEBLOCK,19,SOLID,        3,        3\n(19i9)\n";
        text += &element(1, 11, &[1, 2, 3, 4, 5, 6, 7, 8]);
        text += &element(2, 12, &[5, 8, 9, 9, 6, 7, 10, 10]);
        text += &element(3, 13, &[1, 2, 3]);
        text + "       -1\nCMBLOCK,PADS    ,NODE,       3  ! users node component definition\n(8i10)\n         5        -8        10\n\
            CMBLOCK,UPPER,ELEMENT,1\n(8i10)\n        12\n"
    }

    fn mesh(text: &str) -> Mesh {
        read_bytes(text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}"))
    }

    #[test]
    fn nodes_elements_and_components() {
        let mesh = mesh(&archive());
        assert_eq!((mesh.nodes().len(), mesh.elements().len(), mesh.format()), (10, 2, "ansys-archive"));
        assert_eq!(mesh.nodes()[9].position, [1.0, 0.0, 2.0]);
        assert_eq!(mesh.elements()[1].shape.to_string(), "wedges of 6 nodes");
        let numbers = |name: &str| -> Vec<i64> {
            mesh.nodes_of(name).unwrap().iter().map(|node| mesh.nodes()[*node].number).collect()
        };
        assert_eq!((numbers("PADS"), numbers("UPPER")), (vec![5, 6, 7, 8, 10], vec![5, 8, 9, 6, 7, 10]));
        assert_eq!(mesh.notes(), ["elements of type 188 with 3 nodes are left out: 1"]);
        // the wedge and the brick share a side
        assert_eq!(mesh.outer_faces().len(), 6 + 5 - 2);
    }

    /// Degenerate shapes of SOLID186 by the figure of its documentation: bricks I J K L M N O P,
    /// middle nodes Q to X of both faces, Y Z A B between them; here numbered 1 to 20.
    #[test]
    fn bricks_that_repeat_nodes_are_other_shapes() {
        let solids = [Family::Tetrahedron, Family::Pyramid, Family::Wedge, Family::Hexahedron];
        let of = |nodes: [i64; 20]| undegenerate(&solids, &nodes).map(|(shape, nodes)| (shape.nodes(), nodes)).unwrap();
        let tetrahedron = of([1, 2, 3, 3, 5, 5, 5, 5, 9, 10, 3, 12, 5, 5, 5, 5, 17, 18, 19, 19]);
        assert_eq!(tetrahedron, (10, vec![1, 2, 3, 5, 9, 10, 12, 17, 18, 19]));
        let wedge = of([1, 2, 3, 3, 5, 6, 7, 7, 9, 10, 3, 12, 13, 14, 7, 16, 17, 18, 19, 19]);
        assert_eq!(wedge, (15, vec![1, 2, 3, 5, 6, 7, 9, 10, 12, 13, 14, 16, 17, 18, 19]));
        let pyramid = of([1, 2, 3, 4, 5, 5, 5, 5, 9, 10, 11, 12, 5, 5, 5, 5, 17, 18, 19, 20]);
        assert_eq!(pyramid, (13, vec![1, 2, 3, 4, 5, 9, 10, 11, 12, 17, 18, 19, 20]));
        let without = of([1, 2, 3, 4, 5, 6, 7, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(without.0, 8);
    }

    /// Types of elements in a block, fields of different widths, and two elements of ten nodes, of
    /// which the second lacks a middle node.
    #[test]
    fn other_forms_of_blocks_are_read() {
        let mut text = String::from("ETBLOCK,1,1\n(2i9,19a9)\n        4      187        0\n       -1\n");
        text += "NBLOCK,6,SOLID,14,14\n(1i7,2i9,6e21.13)\n";
        for number in 1..=14 {
            text += &format!("{number:7}{:9}{:9}{:21}\n", 0, 0, f64::from(number) / 8.0);
        }
        text += "N,UNBL,LOC,-1,\nEBLOCK,19,SOLID,2,2\n(19i9)\n";
        let element = |number: i64, nodes: [i64; 10]| element(4, number, &nodes);
        text += &element(7, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]);
        text += &element(8, [1, 2, 3, 11, 5, 6, 7, 12, 0, 14]);
        let mesh = mesh(&(text + "-1\n"));
        assert_eq!((mesh.nodes()[13].number, mesh.nodes()[13].position), (14, [1.75, 0.0, 0.0]));
        let shapes: Vec<String> = mesh.elements().iter().map(|element| element.shape.to_string()).collect();
        assert_eq!(shapes, ["tetrahedra of 10 nodes", "tetrahedra of 4 nodes"]);
        assert_eq!(mesh.notes(), ["elements that lack some of their middle nodes are read with their corners: 1"]);
    }

    #[test]
    fn damaged_blocks_are_refused_with_their_line() {
        let good = archive();
        for (text, location, words) in [
            (good.replace("(3i9,6e21.13e3)", "(3i9"), Location::Line(6), "a format"),
            (good.replace("EBLOCK,19,SOLID,", "EBLOCK,10,,"), Location::Line(18), "SOLID"),
            (good.replace("(8i10)\n         5", "(8i10)\n         x"), Location::Line(26), "`x`"),
            (good[..good.find("CMBLOCK,UPPER").unwrap() - 31].to_owned(), Location::Line(26), "ends before"),
        ] {
            let error = read_bytes(text.as_bytes()).map(|_| ()).expect_err(&text);
            assert!(error.location == location && error.to_string().contains(words), "{error}");
        }
    }
}
