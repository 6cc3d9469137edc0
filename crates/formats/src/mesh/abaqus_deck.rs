//! Input decks of Abaqus and CalculiX (`.inp`): nodes, elements, sets and surfaces.
//!
//! ```text
//! *NODE, NSET=ALL
//! 1, 0.0, 0.0, 0.0
//! *ELEMENT, TYPE=C3D8, ELSET=BLADE
//! 1, 1, 2, 3, 4, 5, 6, 7, 8
//! *NSET, NSET=ROOT, GENERATE
//! 1, 9, 4
//! *SURFACE, NAME=PAD
//! BLADE, S2
//! ```
//! Other keywords are skipped, and files named by `*INCLUDE` are read in their place. Names of
//! sets are compared without regard to case. A deck with several parts is refused, because node
//! numbers repeat in them.
//!
//! Source: Abaqus Keywords Reference Guide, `*NODE`, `*ELEMENT`, `*NSET`, `*ELSET`, `*SURFACE`,
//! `*INCLUDE`; CalculiX CrunchiX User's Manual, chapter 7.

use super::builder::{MeshBuilder, SetKind};
use super::include::load_included;
use super::shape::Shape;
use super::{MeshFile, MeshFormat};
use crate::abaqus_element::{fields, keyword, parameter};
use crate::error::{Error, ErrorKind};
use crate::text::{Line, Lines, integer, quoted};
use std::path::Path;

pub(super) const FORMAT: MeshFormat =
    MeshFormat { name: "abaqus-deck", summary: "input decks of Abaqus and CalculiX (.inp)", sniff, read };

fn sniff(bytes: &[u8]) -> bool {
    let named = |line: Line| keyword(&line).and_then(|text| text.split(',').next().map(str::to_owned));
    let mut keywords = Lines::new(bytes).filter_map(named);
    let first = keywords.next();
    // files of matrices begin with these keywords
    let of_matrices = first.as_deref().is_some_and(|name| matches!(name, "*USERELEMENT" | "*MATRIX" | "*MATRIXINPUT"));
    let mut all = first.into_iter().chain(keywords);
    !of_matrices && all.any(|name| matches!(name.as_str(), "*NODE" | "*ELEMENT" | "*INCLUDE"))
}

/// Content of the data lines below a keyword.
enum DataLines {
    Nodes {
        set: Option<String>,
    },
    Elements {
        shape: Shape,
        set: Option<String>,
    },
    /// Elements of a type that is not read.
    OtherElements {
        kind: String,
    },
    Set {
        name: String,
        kind: SetKind,
        generate: bool,
    },
    NodeSurface {
        name: String,
    },
    Surface {
        name: String,
    },
    /// The position of an instance.
    Instance,
    Other,
}

/// The state of the reader, across included files.
struct Deck<'b> {
    builder: &'b mut MeshBuilder,
    data_lines: DataLines,
    /// Name of the part that contains nodes.
    part: Option<String>,
    current_part: String,
    /// Number and nodes of the element that continues on the next line.
    element: Vec<i64>,
}

fn read(file: &MeshFile<'_>, builder: &mut MeshBuilder) -> Result<(), Error> {
    let mut deck =
        Deck { builder, data_lines: DataLines::Other, part: None, current_part: String::new(), element: Vec::new() };
    deck.file(file.bytes, file.folder, 0)
}

/// Returns the value of a parameter of a keyword line, as it is written.
fn stated(line: &Line, name: &str) -> Option<String> {
    let text = String::from_utf8_lossy(line.text).into_owned();
    text.split(',').skip(1).find_map(|part| {
        let (key, value) = part.split_once('=')?;
        key.trim().eq_ignore_ascii_case(name).then(|| value.trim().trim_matches('"').to_owned())
    })
}

impl Deck<'_> {
    fn file(&mut self, bytes: &[u8], folder: Option<&Path>, depth: usize) -> Result<(), Error> {
        let mut lines = Lines::new(crate::without_bom(bytes));
        let mut last = Line { text: b"", number: 0 };
        while let Some(line) = lines.next() {
            // CalculiX itself writes keywords behind a space
            let line = Line { text: line.text.trim_ascii_start(), ..line };
            last = line;
            if line.text.starts_with(b"**") || line.text.trim_ascii().is_empty() {
                continue;
            }
            let Some(text) = keyword(&line) else {
                self.data(&line)?;
                continue;
            };
            self.end_element(&line)?;
            if text.split(',').next() == Some("*INCLUDE") {
                self.include(&line, folder, depth)?;
            } else {
                // a keyword line that ends with a comma continues on the next line
                let mut whole = line.text.to_vec();
                while whole.trim_ascii_end().ends_with(b",") {
                    let Some(more) = lines.next() else { break };
                    whole.extend(more.text);
                }
                self.keyword(&Line { text: &whole, number: line.number })?;
            }
        }
        self.end_element(&last)
    }

    fn include(&mut self, line: &Line, folder: Option<&Path>, depth: usize) -> Result<(), Error> {
        let Some(name) = stated(line, "INPUT") else { return Err(line.malformed("*INCLUDE, INPUT=file", "no file")) };
        let (path, bytes) = load_included(line, &name, folder, depth)?;
        self.file(&bytes, folder, depth + 1).map_err(|error| error.with_path(&path))
    }

    fn keyword(&mut self, line: &Line) -> Result<(), Error> {
        let text = keyword(line).unwrap_or_default();
        let name = text.split(',').next().unwrap_or_default();
        let required = |key: &str| stated(line, key).ok_or_else(|| line.malformed(&format!("{key}=name"), "none"));
        self.data_lines = match name {
            "*NODE" => {
                if parameter(&text, "SYSTEM").is_some_and(|system| system != "R") {
                    let problem = "the coordinates are cylindrical or spherical".to_owned();
                    let remedy = "write the deck with Cartesian coordinates";
                    return Err(Error::new(ErrorKind::Unsupported, line.location(), problem, remedy));
                }
                self.enter_part(line)?;
                DataLines::Nodes { set: stated(line, "NSET") }
            }
            "*ELEMENT" => {
                let kind = parameter(&text, "TYPE").unwrap_or_default().to_owned();
                match shape(&kind) {
                    Some(shape) => DataLines::Elements { shape, set: stated(line, "ELSET") },
                    None => DataLines::OtherElements { kind },
                }
            }
            "*NSET" | "*ELSET" => {
                let kind = if name == "*NSET" { SetKind::Nodes } else { SetKind::Elements };
                let set = required(if kind == SetKind::Nodes { "NSET" } else { "ELSET" })?;
                let generate = text.split(',').any(|part| part == "GENERATE");
                self.builder.add(&set, kind, []);
                if let Some(of) = stated(line, "ELSET").filter(|_| kind == SetKind::Nodes) {
                    let elements = self.builder.members(&of, SetKind::Elements);
                    let nodes = elements.iter().filter_map(|element| self.builder.nodes_of_element(*element));
                    let nodes: Vec<i64> = nodes.flatten().copied().collect();
                    self.builder.add(&set, kind, nodes);
                }
                DataLines::Set { name: set, kind, generate }
            }
            "*SURFACE" => match parameter(&text, "TYPE") {
                Some("NODE") => DataLines::NodeSurface { name: required("NAME")? },
                None | Some("ELEMENT") => DataLines::Surface { name: required("NAME")? },
                Some(_) => DataLines::Other,
            },
            "*PART" => {
                self.current_part = stated(line, "NAME").unwrap_or_default();
                DataLines::Other
            }
            "*INSTANCE" => DataLines::Instance,
            _ => DataLines::Other,
        };
        Ok(())
    }

    /// Refuses nodes of a second part.
    fn enter_part(&mut self, line: &Line) -> Result<(), Error> {
        let part = self.part.get_or_insert_with(|| self.current_part.clone());
        if *part == self.current_part {
            return Ok(());
        }
        let problem = format!("the deck has nodes in the parts {part} and {}", self.current_part);
        let remedy = "write a flat deck, without parts and instances, as *PREPRINT or the option of your program does";
        Err(Error::new(ErrorKind::Unsupported, line.location(), problem, remedy))
    }

    fn data(&mut self, line: &Line) -> Result<(), Error> {
        match &self.data_lines {
            DataLines::Nodes { set } => {
                let mut parts = line.text.split(|&byte| byte == b',').map(<[u8]>::trim_ascii);
                let number = line.integer(parts.next().unwrap_or_default())?;
                let mut position = [0.0; 3];
                for (x, field) in position.iter_mut().zip(parts) {
                    *x = if field.is_empty() { 0.0 } else { line.real(field)? };
                }
                self.builder.node(number, position, line)?;
                if let Some(set) = set {
                    self.builder.add(set, SetKind::Nodes, [number]);
                }
            }
            DataLines::Elements { shape, .. } => {
                let nodes = shape.nodes();
                for field in fields(line.text) {
                    self.element.push(line.integer(field)?);
                }
                if self.element.len() > nodes {
                    self.end_element(line)?;
                }
            }
            DataLines::OtherElements { kind } => {
                // a line with a comma at its end continues
                if !line.text.trim_ascii_end().ends_with(b",") {
                    self.builder.leave_out(kind);
                }
            }
            DataLines::Set { name, kind, generate: true } => {
                let numbers = fields(line.text).map(|field| line.integer(field)).collect::<Result<Vec<_>, _>>()?;
                let (from, to, step) = match numbers[..] {
                    [from, to] => (from, to, 1),
                    [from, to, step] if step > 0 => (from, to, step),
                    _ => return Err(line.malformed("first, last, step", &quoted(line.text))),
                };
                self.builder
                    .add_known(name, *kind, |number| (from..=to).contains(&number) && (number - from) % step == 0);
            }
            DataLines::Set { name, kind, .. } => {
                for field in fields(line.text) {
                    let members = self.members(field, *kind);
                    self.builder.add(name, *kind, members);
                }
            }
            DataLines::NodeSurface { name } => {
                if let Some(field) = fields(line.text).next() {
                    let members = self.members(field, SetKind::Nodes);
                    self.builder.add(name, SetKind::Nodes, members);
                }
            }
            DataLines::Surface { name } => {
                let mut parts = fields(line.text);
                let elements = self.members(parts.next().unwrap_or_default(), SetKind::Elements);
                let side = parts.next().map(|side| String::from_utf8_lossy(side).to_uppercase());
                let side = match side.as_deref() {
                    Some("SPOS" | "SNEG") => 0,
                    Some(side) => match side.strip_prefix('S').and_then(|number| number.parse::<usize>().ok()) {
                        Some(number @ 1..=6) => number - 1,
                        _ => return Err(line.malformed("a side S1 to S6", &quoted(line.text))),
                    },
                    None => return Err(line.malformed("a set of elements and its side", &quoted(line.text))),
                };
                self.builder.add_sides(name, side, elements);
            }
            DataLines::Instance => {
                let problem = "the instance is moved relative to its part".to_owned();
                let remedy = "write a flat deck, without parts and instances";
                return Err(Error::new(ErrorKind::Unsupported, line.location(), problem, remedy));
            }
            DataLines::Other => {}
        }
        Ok(())
    }

    /// Returns the members that a field states: a number, or the name of a set.
    fn members(&self, field: &[u8], kind: SetKind) -> Vec<i64> {
        match integer(field) {
            Some(number) => vec![number],
            None => {
                let name = String::from_utf8_lossy(field);
                self.builder.members(name.trim_matches('"'), kind)
            }
        }
    }

    /// Adds the element whose lines were read.
    fn end_element(&mut self, line: &Line) -> Result<(), Error> {
        let numbers = std::mem::take(&mut self.element);
        let (Some((number, nodes)), DataLines::Elements { shape, set }) = (numbers.split_first(), &self.data_lines)
        else {
            return Ok(());
        };
        self.builder.element(*number, *shape, nodes, line)?;
        if let Some(set) = set {
            self.builder.add(set, SetKind::Elements, [*number]);
        }
        Ok(())
    }
}

/// Returns the shape of an element type: `C3D20R` has 20 nodes in space, `S8R` eight in a face.
fn shape(kind: &str) -> Option<Shape> {
    let solids = ["C3D", "AC3D", "DC3D", "COH3D", "CSS", "SC"];
    let faces = ["SFM3D", "STRI", "M3D", "R3D", "CPS", "CPE", "CAX", "DS", "S"];
    let nodes = |prefixes: &[&str]| {
        let rest = prefixes.iter().find_map(|prefix| kind.strip_prefix(prefix))?;
        let digits = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        // STRI65 has six nodes and five freedoms
        match rest[..digits].parse::<usize>().ok()? {
            65 => Some(6),
            nodes => Some(nodes),
        }
    };
    match nodes(&solids) {
        Some(nodes) => Shape::solid(nodes),
        None => Shape::face(nodes(&faces)?),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Location;
    use crate::mesh::{Members, Side, read, read_bytes};

    const DECK: &str = "*HEADING\nA brick, a wedge\n** comment\n*Node, nset=Every\n1,0,0,0\n2,1.,0\n3,1,1,\n4,0,1.0D0,0.\n\
        5,0,0,1\n6,1,0,1\n7,1,1,1\n8,0,1,1\n9,2,0,0\n10,2,0,1\n\
        *ELEMENT, TYPE=C3D8R, ELSET=Brick\n 11, 1, 2, 3, 4,\n 5, 6, 7, 8\n\
        *ELEMENT, TYPE=C3D6,\nELSET=\"Side part\"\n12, 2, 9, 3, 6, 10, 7\n\
        *ELEMENT, TYPE=B31\n21, 1, 2\n22, 2, 3\n\
        *NSET, NSET=Foot, GENERATE\n1, 4\n9, 99999999999999, 1\n*NSET, NSET=PAIR\nfoot, 10\n77,\n*NSET,NSET=OFWEDGE,ELSET=SIDE PART\n\
        *ELSET, ELSET=BOTH\nBRICK, Side part\n\
        *SURFACE, NAME=TOP, TYPE=ELEMENT\nBRICK, S2\n12, S2\n*SURFACE, TYPE=NODE, NAME=LINE\nPAIR, 1.5\n1\n\
        *STEP\n*STATIC\n0.1, 1.\n*END STEP\n";

    fn numbers(mesh: &crate::mesh::Mesh, name: &str) -> Vec<i64> {
        mesh.nodes_of(name).unwrap().iter().map(|node| mesh.nodes()[*node].number).collect()
    }

    #[test]
    fn nodes_elements_sets_and_surfaces() {
        let mesh = read_bytes(DECK.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!((mesh.nodes().len(), mesh.elements().len(), mesh.format()), (10, 2, "abaqus-deck"));
        assert_eq!(mesh.nodes()[mesh.node(4).unwrap()].position, [0.0, 1.0, 0.0]);
        assert_eq!(mesh.element_nodes(1), [1, 8, 2, 5, 9, 6]);
        assert_eq!(numbers(&mesh, "FOOT"), [1, 2, 3, 4, 9, 10]);
        assert_eq!(numbers(&mesh, "pair"), [1, 2, 3, 4, 9, 10]);
        assert_eq!(numbers(&mesh, "ofwedge"), [2, 3, 6, 7, 9, 10]);
        assert_eq!(numbers(&mesh, "LINE"), [1, 2, 3, 4, 9, 10]);
        assert_eq!(
            mesh.notes(),
            [
                "set PAIR: 1 of 7 nodes are not in the file or not read",
                "set LINE: 1 of 7 nodes are not in the file or not read",
                "elements of type B31 are left out: 2"
            ]
        );
        let top = mesh.sets().iter().find(|set| set.name == "TOP").unwrap();
        assert_eq!(top.members, Members::Sides(vec![Side { element: 0, side: 1 }, Side { element: 1, side: 1 }]));
        let patch = mesh.patch("top").unwrap();
        assert!((patch.area() - 1.5).abs() < 1e-14 && patch.nodes().iter().all(|node| node.normal == [0.0, 0.0, 1.0]));
        // the brick and the wedge share a side
        assert_eq!(mesh.outer_faces().len(), 6 + 5 - 2);
    }

    /// Sets that name each other do not grow without bound, and a side counts once.
    #[test]
    fn repeated_members_count_once() {
        let sets = "*NSET,NSET=A\n1,2\nA,A,A\n*NSET,NSET=B\nA,3\n*NSET,NSET=A\nB,B\n".repeat(60);
        let text = format!("{DECK}{sets}*SURFACE,NAME=TOP\n11,S2\nBRICK,S2\n");
        let mesh = read_bytes(text.as_bytes()).unwrap();
        assert_eq!((numbers(&mesh, "A"), numbers(&mesh, "B")), (vec![1, 2, 3], vec![1, 2, 3]));
        assert!((mesh.patch("TOP").unwrap().area() - 1.5).abs() < 1e-14);
    }

    #[test]
    fn types_have_the_nodes_of_their_names() {
        for (kind, nodes, solid) in [
            ("C3D10M", 10, true),
            ("C3D20RH", 20, true),
            ("C3D8I", 8, true),
            ("SC8R", 8, true),
            ("COH3D6", 6, true),
            ("S4R", 4, false),
            ("S8R5", 8, false),
            ("STRI65", 6, false),
            ("CPS6", 6, false),
            ("SFM3D4R", 4, false),
        ] {
            let shape = shape(kind).unwrap_or_else(|| panic!("{kind}"));
            assert_eq!((shape.nodes(), shape.is_solid()), (nodes, solid), "{kind}");
        }
        assert!(["B31", "SPRINGA", "SAX1", "MASS", "C3D27", "CONN3D2", ""].iter().all(|kind| shape(kind).is_none()));
    }

    #[test]
    fn included_files_are_read_in_their_place() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("main.inp", "*INCLUDE, INPUT=Nodes.inp\n ** comment\n *ELEMENT, TYPE=C3D4\n1,1,2,3,4\n");
        write("Nodes.inp", "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n");
        assert_eq!(read(folder.path().join("main.inp")).unwrap().elements().len(), 1);
        write("Nodes.inp", "*NODE\n1,0,0,x\n");
        let error = read(folder.path().join("main.inp")).unwrap_err().to_string();
        assert!(error.contains("Nodes.inp, line 2") && error.contains("`x`"), "{error}");
        write("Nodes.inp", "*INCLUDE, INPUT=Nodes.inp\n");
        assert!(read(folder.path().join("main.inp")).unwrap_err().to_string().contains("include each other"));
        assert!(read_bytes(b"*INCLUDE, INPUT=a.inp\n").unwrap_err().to_string().contains("from its folder"));
    }

    #[test]
    fn wrong_decks_are_refused_with_their_line() {
        let four = "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n";
        for (text, location, words) in [
            ("*NODE\n1,0,0,0\n1,1,0,0\n".to_owned(), Location::Line(3), "second position"),
            ("*NODE, SYSTEM=C\n1,0,0,0\n".to_owned(), Location::Line(1), "cylindrical"),
            ("*NODE\n1,0,1e999\n".to_owned(), Location::Line(2), "not finite"),
            (format!("{four}*ELEMENT,TYPE=C3D4\n1,1,2,3\n*STEP\n"), Location::Line(8), "4 nodes of element 1"),
            (format!("{four}*ELEMENT,TYPE=C3D4\n1,1,2,3,4,4\n"), Location::Line(7), "found 5"),
            (format!("{four}*ELEMENT,TYPE=C3D4\n1,1,2,3,4\n1,1,2,3,4\n"), Location::Line(8), "element 1 again"),
            (format!("{four}*ELEMENT,TYPE=C3D4\n1,1,2,3,5\n"), Location::File, "element 1 names node 5"),
            (format!("{four}*SURFACE,NAME=A\n1\n"), Location::Line(7), "its side"),
            (format!("*PART,NAME=A\n{four}*PART,NAME=B\n{four}"), Location::Line(8), "parts A and B"),
            (format!("*PART,NAME=A\n{four}*INSTANCE,NAME=A-1,PART=A\n1,0,0\n"), Location::Line(8), "moved"),
            ("*ELEMENT,TYPE=C3D4\n".to_owned(), Location::File, "no node"),
        ] {
            let error = read_bytes(text.as_bytes()).map(|_| ()).expect_err(&text);
            assert!(error.location == location && error.to_string().contains(words), "{text}: {error}");
        }
    }
}
