//! Nastran bulk data (`.bdf`, `.dat`, `.nas`): grid points, elements and sets, in free fields or in
//! fields of 8 or 16 characters.
//!
//! ```text
//! GRID, 1,, 0.0, 0.0, 0.0
//! CHEXA   11      3       1       2       3       4       5       6
//!         7       8
//! SET1    5       1       THRU    4
//! ```
//! The elements of a property become the set `property_3`, the grid points of `SET1`, `SET3` and of
//! `SET 5 = …` in the case control the set `set_5`. Files named by `INCLUDE` are read in their
//! place. Coordinates may be in any system (`nastran_coordinates`).
//!
//! Source: MSC Nastran Quick Reference Guide, bulk data entries `GRID`, `GRDSET`, `CTETRA`,
//! `CPYRAM`, `CPENTA`, `CHEXA`, `CQUAD4`, `CQUAD8`, `CTRIA3`, `CTRIA6`, `SET1`, `SET3`; case
//! control `SET`.

use super::builder::{MeshBuilder, SetKind};
use super::include::load_included;
use super::nastran_coordinates::{CoordinateSystems, Coordinates, SystemKind, SystemPoints};
use super::shape::Shape;
use super::{MeshFile, MeshFormat};
use crate::error::{Error, ErrorKind};
use crate::nastran_dmig::{fields, is_continuation};
use crate::text::{Line, Lines, integer};
use std::borrow::Cow;
use std::collections::BTreeSet;

pub(super) const FORMAT: MeshFormat =
    MeshFormat { name: "nastran-bulk", summary: "Nastran bulk data (.bdf, .dat, .nas)", sniff, read };

fn sniff(bytes: &[u8]) -> bool {
    let telling = ["GRID", "BEGIN", "INCLUDE", "DMIG"];
    let names = Lines::new(bytes).map(|line| name(&line)).filter(|name| telling.contains(&name.as_str()));
    let names: BTreeSet<String> = names.collect();
    let has = |name: &str| names.contains(name);
    // the grid points may be in an included file
    !has("DMIG") && (has("GRID") || (has("BEGIN") && has("INCLUDE")))
}

/// Returns the name of the card that begins in a line; empty for other lines.
fn name(line: &Line) -> String {
    let end = line.text.iter().take(8).position(|byte| b",* \t".contains(byte)).unwrap_or(line.text.len().min(8));
    let is_card = line.text.first().is_some_and(u8::is_ascii_alphabetic);
    if is_card { String::from_utf8_lossy(&line.text[..end]).to_uppercase() } else { String::new() }
}

/// A card with the fields of all its lines.
struct BulkCard<'a> {
    name: String,
    fields: Vec<&'a [u8]>,
    line: Line<'a>,
}

impl BulkCard<'_> {
    fn field(&self, at: usize) -> &[u8] {
        self.fields.get(at).copied().unwrap_or_default()
    }

    fn integer(&self, at: usize) -> Result<i64, Error> {
        self.line.integer(self.field(at))
    }

    /// Returns the number in a field, or `default` if it is empty.
    fn integer_or(&self, at: usize, default: i64) -> Result<i64, Error> {
        if self.field(at).is_empty() { Ok(default) } else { self.integer(at) }
    }

    /// Returns three coordinates; empty fields are zero.
    fn coordinates(&self, at: usize) -> Result<[f64; 3], Error> {
        let mut values = [0.0; 3];
        for (axis, x) in values.iter_mut().enumerate() {
            *x = if self.field(at + axis).is_empty() { 0.0 } else { self.line.real(self.field(at + axis))? };
        }
        Ok(values)
    }
}

/// Sets, coordinate systems and defaults of a deck, for all of its cards.
#[derive(Default)]
struct BulkDeck {
    sets: Vec<StatedSet>,
    systems: CoordinateSystems,
    /// Systems of coordinates and of displacements of grid points that state none.
    default_systems: [i64; 2],
}

fn read(file: &MeshFile<'_>, builder: &mut MeshBuilder) -> Result<(), Error> {
    // grid points may precede their system
    let mut deck = BulkDeck::default();
    read_deck(file, 0, &mut deck, &mut |deck, card| add_system(deck, card))?;
    let defining: BTreeSet<i64> = deck.systems.defining_points().collect();
    if !defining.is_empty() {
        read_deck(file, 0, &mut deck, &mut |deck, card| add_defining_point(deck, card, &defining))?;
    }
    deck.sets.clear();
    read_deck(file, 0, &mut deck, &mut |deck, card| add(deck, card, builder))?;
    // a set may precede its grid points
    deck.sets.iter().for_each(|set| set.add(builder));
    Ok(())
}

/// Calls `each` for every card of a deck, or of a file that it includes, at this depth of nesting.
/// Sets of the case control are added to the deck.
fn read_deck(
    file: &MeshFile<'_>,
    depth: usize,
    deck: &mut BulkDeck,
    each: &mut dyn FnMut(&mut BulkDeck, &BulkCard) -> Result<(), Error>,
) -> Result<(), Error> {
    let mut card: Option<BulkCard> = None;
    let bytes = without_tabs(file.bytes);
    let mut lines = Lines::new(&bytes);
    while let Some(line) = lines.next() {
        if line.text.starts_with(b"$") {
            continue;
        }
        if let Some(card) = card.as_mut().filter(|_| is_continuation(&line)) {
            card.fields.extend(fields(&line));
            continue;
        }
        if let Some(card) = card.take() {
            each(deck, &card)?;
        }
        match name(&line).as_str() {
            "SET" => deck.sets.extend(case_set(&line, &mut lines)),
            "INCLUDE" => {
                let name = included_name(&line, &mut lines);
                let (path, bytes) = load_included(&line, &name, file.folder, depth)?;
                let included = MeshFile { bytes: &bytes, folder: file.folder };
                read_deck(&included, depth + 1, deck, each).map_err(|error| error.with_path(&path))?;
            }
            "" => {}
            name => card = Some(BulkCard { name: name.to_owned(), fields: fields(&line), line }),
        }
    }
    card.map_or(Ok(()), |card| each(deck, &card))
}

/// Replaces tabs by spaces up to the next field of eight characters.
fn without_tabs(bytes: &[u8]) -> Cow<'_, [u8]> {
    if !bytes.contains(&b'\t') {
        return Cow::Borrowed(bytes);
    }
    let (mut text, mut begin) = (Vec::with_capacity(2 * bytes.len()), 0);
    for &byte in bytes {
        match byte {
            b'\t' => text.resize(begin + ((text.len() - begin) / 8 + 1) * 8, b' '),
            byte => text.push(byte),
        }
        if byte == b'\n' {
            begin = text.len();
        }
    }
    Cow::Owned(text)
}

/// Returns the name in `INCLUDE 'file'`. A name in quotes may continue on the next lines.
fn included_name(line: &Line, lines: &mut Lines) -> String {
    let quotes = ['\'', '"'];
    let mut text = String::from_utf8_lossy(line.text).trim().to_owned();
    while text.matches(quotes).count() == 1 {
        let Some(more) = lines.next() else { break };
        text += String::from_utf8_lossy(more.text).trim();
    }
    text.split_off("INCLUDE".len()).trim().trim_matches(quotes).to_owned()
}

/// Adds the coordinate systems that a card states.
fn add_system(deck: &mut BulkDeck, card: &BulkCard) -> Result<(), Error> {
    if card.name == "GRDSET" {
        deck.default_systems = [card.integer_or(1, 0)?, card.integer_or(5, 0)?];
        return Ok(());
    }
    let Some(kind) = SystemKind::of_card(&card.name) else { return Ok(()) };
    if card.name.starts_with("CORD2") {
        let system = card.integer_or(1, 0)?;
        let point = |at: usize| card.coordinates(at).map(|values| Coordinates { system, values });
        let points = [point(2)?, point(5)?, point(8)?];
        deck.systems.add(card.integer(0)?, kind, SystemPoints::Positions(points));
        return Ok(());
    }
    // a card may state two systems
    for at in [0, 4].into_iter().filter(|at| !card.field(*at).is_empty()) {
        let points = [card.integer(at + 1)?, card.integer(at + 2)?, card.integer(at + 3)?];
        deck.systems.add(card.integer(at)?, kind, SystemPoints::GridPoints(points));
    }
    Ok(())
}

/// Adds a grid point that defines a coordinate system.
fn add_defining_point(deck: &mut BulkDeck, card: &BulkCard, defining: &BTreeSet<i64>) -> Result<(), Error> {
    if card.name == "GRID" && defining.contains(&card.integer(0)?) {
        let at = Coordinates { system: card.integer_or(1, deck.default_systems[0])?, values: card.coordinates(2)? };
        deck.systems.add_point(card.integer(0)?, at);
    }
    Ok(())
}

/// Adds what a card states.
fn add(deck: &mut BulkDeck, card: &BulkCard, builder: &mut MeshBuilder) -> Result<(), Error> {
    let solids = ["CTETRA", "CPYRAM", "CPENTA", "CHEXA"];
    let faces = ["CTRIA3", "CTRIA6", "CTRIAR", "CQUAD4", "CQUAD8", "CQUADR"];
    match card.name.as_str() {
        "GRID" => grid(deck, card, builder)?,
        name if solids.contains(&name) || faces.contains(&name) => element(card, builder)?,
        // SET1, ID, members; SET3, ID, kind, members
        "SET1" => deck.sets.extend(StatedSet::of_card(card, 1)),
        "SET3" if card.field(1).eq_ignore_ascii_case(b"GRID") => deck.sets.extend(StatedSet::of_card(card, 2)),
        name => {
            let is_other =
                name.starts_with('C') && integer(card.field(0)).is_some() && integer(card.field(1)).is_some();
            let counted = ["CBAR", "CBEAM", "CROD", "CBUSH", "CELAS1", "CELAS2", "CQUAD", "CTRIAX6"];
            if is_other && counted.contains(&name) {
                builder.leave_out(name);
            }
        }
    }
    Ok(())
}

fn grid(deck: &mut BulkDeck, card: &BulkCard, builder: &mut MeshBuilder) -> Result<(), Error> {
    let number = card.integer(0)?;
    let [system, along] = [(1, 0), (5, 1)].map(|(at, which)| card.integer_or(at, deck.default_systems[which]));
    let unknown = |what: &str, reason: String| {
        let problem = format!("grid point {number} has no {what}: {reason}");
        Error::new(ErrorKind::Malformed, card.line.location(), problem, "export the deck with its coordinate systems")
    };
    let at = Coordinates { system: system?, values: card.coordinates(2)? };
    let position = deck.systems.position(at).map_err(|reason| unknown("position", reason))?;
    builder.node(number, position, &card.line)?;
    let along = along?;
    // a fluid point has a pressure instead
    let is_fluid = along == -1;
    if !is_fluid && !deck.systems.is_parallel(along).map_err(|reason| unknown("axes", reason))? {
        builder.set_displacement_system(number, along);
    }
    Ok(())
}

fn element(card: &BulkCard, builder: &mut MeshBuilder) -> Result<(), Error> {
    let (number, property) = (card.integer(0)?, card.field(1));
    // corners and most nodes; thickness and offsets follow the nodes of linear plates
    let (linear, quadratic) = match card.name.as_str() {
        "CTRIA3" | "CTRIAR" => (3, 3),
        "CTRIA6" => (3, 6),
        "CQUAD4" | "CQUADR" => (4, 4),
        "CQUAD8" => (4, 8),
        "CTETRA" => (4, 10),
        "CPYRAM" => (5, 13),
        "CPENTA" => (6, 15),
        _ => (8, 20),
    };
    let is_face = card.name.starts_with("CTRI") || card.name.starts_with("CQUAD");
    let stated = (0..quadratic).map(|i| card.field(2 + i)).collect::<Vec<_>>();
    let middle = stated[linear..].iter().filter(|field| !field.is_empty()).count();
    let count = if linear + middle == quadratic { quadratic } else { linear };
    let nodes = stated[..count].iter().map(|field| card.line.integer(field)).collect::<Result<Vec<_>, _>>()?;
    let shape = if is_face { Shape::face(count) } else { Shape::solid(count) };
    let Some(shape) = shape else {
        return Err(card.line.malformed("the nodes of an element", &(linear + middle).to_string()));
    };
    if middle > 0 && count == linear {
        builder.count_incomplete();
    }
    // Nastran numbers the edges between both ends before those of the second end
    let order: &[usize] = match count {
        20 => &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 16, 17, 18, 19, 12, 13, 14, 15],
        15 => &[0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13, 14, 9, 10, 11],
        _ => &[],
    };
    let ordered: Vec<i64> = order.iter().map(|position| nodes[*position]).collect();
    builder.element(number, shape, if order.is_empty() { &nodes } else { &ordered }, &card.line)?;
    if let Some(property) = integer(property) {
        builder.add(&format!("property_{property}"), SetKind::Elements, [number]);
    }
    Ok(())
}

/// A set of grid points: numbers, and ranges `1 THRU 4`.
struct StatedSet {
    name: String,
    words: Vec<Vec<u8>>,
}

impl StatedSet {
    /// Reads the set of a card with its members from a field on; `None` without a number.
    fn of_card(card: &BulkCard, first: usize) -> Option<StatedSet> {
        let number = integer(card.field(0))?;
        let words = card.fields.iter().skip(first).filter(|field| !field.is_empty());
        Some(StatedSet { name: format!("set_{number}"), words: words.map(|word| word.to_vec()).collect() })
    }

    fn add(&self, builder: &mut MeshBuilder) {
        let StatedSet { name, words } = self;
        let mut at = 0;
        while let Some(word) = words.get(at) {
            let is_range = words.get(at + 1).is_some_and(|word| word.eq_ignore_ascii_case(b"THRU"));
            match (integer(word), words.get(at + 2).filter(|_| is_range).and_then(|last| integer(last))) {
                (Some(from), Some(to)) => {
                    builder.add_range(name, SetKind::Nodes, from, to);
                    at += 3;
                }
                (Some(number), None) => {
                    builder.add(name, SetKind::Nodes, [number]);
                    at += 1;
                }
                _ => at += 1,
            }
        }
    }
}

/// Reads `SET 5 = 1, 2, 7 THRU 9` of the case control, which continues after a comma; `None` for
/// a set without a number.
fn case_set(line: &Line, lines: &mut Lines) -> Option<StatedSet> {
    let mut text = line.text.to_vec();
    while text.trim_ascii_end().ends_with(b",") {
        let Some(more) = lines.next() else { break };
        text.extend(more.text);
    }
    let text = String::from_utf8_lossy(&text).into_owned();
    let (head, list) = text.split_once('=')?;
    let number = integer(head.split_whitespace().nth(1)?.as_bytes())?;
    let words = list.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
    Some(StatedSet { name: format!("set_{number}"), words: words.map(|word| word.as_bytes().to_vec()).collect() })
}

#[cfg(test)]
mod tests {
    use crate::error::Location;
    use crate::mesh::{Mesh, read, read_bytes};

    /// A brick in small fields, its upper face as a plate in free fields, and a point in large
    /// fields.
    const DECK: &str = "SOL 103\nCEND\nSET 8 = 1 THRU 3,\n 7\nSUBCASE 1\nBEGIN BULK\n$ comment\n\
        GRID           1              0.      0.      0.\n\
        GRID           2              1.      0.      0.\n\
        GRID           3              1.      1.      0.\n\
        GRID           4              0.     1.0      0.\n\
        GRID,5,,0.,0.,1.0\nGRID,6,0,1.,0.,1.0,0\nGRID,7,,1.,1.,1.0\n\
        GRID*                  8                             0.0             1.0\n*                    1.0\n\
        CHEXA         11       3       1       2       3       4       5       6+\n\
        +              7       8\n\
        CQUAD4,12,4,5,6,7,8,0.5\nCBAR,13,5,1,2,0.,0.,1.\n\
        SET1    5       5       THRU    8\nSET3,6,GRID,1,2\nENDDATA\n";

    fn mesh(text: &str) -> Mesh {
        read_bytes(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn fields_of_every_width() {
        let mesh = mesh(DECK);
        assert_eq!((mesh.nodes().len(), mesh.elements().len(), mesh.format()), (8, 2, "nastran-bulk"));
        assert_eq!(mesh.nodes()[7].position, [0.0, 1.0, 1.0]);
        assert_eq!(mesh.element_nodes(0), [0, 1, 2, 3, 4, 5, 6, 7]);
        let numbers = |name: &str| -> Vec<i64> {
            mesh.nodes_of(name).unwrap().iter().map(|node| mesh.nodes()[*node].number).collect()
        };
        assert_eq!(
            (numbers("set_5"), numbers("set_6"), numbers("set_8")),
            (vec![5, 6, 7, 8], vec![1, 2], vec![1, 2, 3, 7])
        );
        // the plate lies on the brick, so its normal points out of it
        for name in ["property_4", "set_5"] {
            let patch = mesh.patch(name).unwrap();
            assert!(
                (patch.area() - 1.0).abs() < 1e-14 && patch.nodes().iter().all(|node| node.normal == [0.0, 0.0, 1.0])
            );
        }
        assert_eq!(mesh.notes(), ["elements of type CBAR are left out: 1"]);
    }

    /// The middle nodes of a brick lie in the middle of their edges.
    #[test]
    fn middle_nodes_are_in_the_order_of_the_shape() {
        let corners = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [0, 0, 2], [2, 0, 2], [2, 2, 2], [0, 2, 2]];
        // G9 to G20 of CHEXA: edges of the lower face, between both faces, of the upper face
        let edges = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7), (7, 4)];
        let middle = |(a, b): (usize, usize)| [0, 1, 2].map(|axis| (corners[a][axis] + corners[b][axis]) / 2);
        let points: Vec<[i32; 3]> = corners.into_iter().chain(edges.map(middle)).collect();
        let mut text = String::new();
        for (i, [x, y, z]) in points.iter().enumerate() {
            text += &format!("GRID,{},,{x}.,{y}.,{z}.\n", i + 1);
        }
        text += "CHEXA,1,1,1,2,3,4,5,6\n,7,8,9,10,11,12,13,14\n,15,16,17,18,19,20\n";
        let mesh = mesh(&text);
        let faces = mesh.outer_faces();
        assert!(faces.len() == 6 && faces.iter().all(|face| (face.area() - 4.0).abs() < 1e-12));
    }

    /// Tabs end fields of eight characters, a brick with one middle node is read with its corners.
    #[test]
    fn tabs_and_missing_middle_nodes() {
        let tabs = DECK.replace("GRID           2              1.      0.      0.", "GRID\t2\t\t1.\t0.\t0.");
        assert!(mesh(&tabs).nodes() == mesh(DECK).nodes() && tabs != DECK);
        let mesh = mesh(&DECK.replace("+              7       8\n", "+              7       8       5\n"));
        assert_eq!(mesh.element_nodes(0), [0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(
            mesh.notes().last().unwrap(),
            "elements that lack some of their middle nodes are read with their corners: 1"
        );
    }

    #[test]
    fn included_files_are_read_in_their_place() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        let (head, points) = DECK.split_once("GRID           2").unwrap();
        write("main.bdf", &format!("{head}include 'points\n  .bdf'\nENDDATA\n"));
        write("points.bdf", &format!("GRID           2{points}"));
        let main = || read(folder.path().join("main.bdf"));
        assert_eq!(main().unwrap().nodes(), mesh(DECK).nodes());
        write("points.bdf", "GRID,2,,x\n");
        let error = main().unwrap_err().to_string();
        assert!(error.contains("points.bdf, line 1") && error.contains("`x`"), "{error}");
        write("points.bdf", "INCLUDE points.bdf\n");
        assert!(main().unwrap_err().to_string().contains("include each other"));
    }

    #[test]
    fn coordinate_systems_and_incomplete_elements_are_refused() {
        for (text, location, words) in [
            (DECK.replace("GRID,5,,", "GRID,5,2,"), Location::Line(12), "coordinate system 2"),
            (
                DECK.replace("GRID,6,0,1.,0.,1.0,0", "GRID,6,0,1.,0.,1.0,9"),
                Location::Line(13),
                "no axes: coordinate system 9",
            ),
            (DECK.replace("+              7       8\n", "+              7\n"), Location::Line(17), "a whole number"),
            (DECK.replace("GRID,7,,1.,", "GRID,7,,a,"), Location::Line(14), "`a`"),
            (DECK.replace("ENDDATA", "INCLUDE 'rest.bdf'"), Location::Line(23), "includes"),
        ] {
            let error = read_bytes(text.as_bytes()).map(|_| ()).expect_err(&text);
            assert!(error.location == location && error.to_string().contains(words), "{error}");
        }
    }
}
