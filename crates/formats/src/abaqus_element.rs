//! Matrices of a linear user element: the form in which Abaqus and CalculiX
//! write substructures and element matrices.
//!
//! ```text
//! *USER ELEMENT, NODES=2, LINEAR
//! ** ELEMENT NODES
//! ** 7, 9
//! 1, 2
//! 2, 1
//! *MATRIX, TYPE=STIFFNESS
//! 1.0,
//! 0.5, 2.0,
//! 0.0, 0.0, 3.0
//! ```
//! The first data line contains the degrees of freedom of the first node. A later data line
//! begins with the position of a node from which other degrees of freedom hold: here the second
//! node, with degree of freedom 1. Symmetric matrices are written row by row up to the
//! diagonal, others (`UNSYMM`) column by column. A comment contains the node numbers.
//!
//! Source: Abaqus Keywords Reference Guide, `*USER ELEMENT`, `*MATRIX`,
//! `*SUBSTRUCTURE MATRIX OUTPUT`.

use std::rc::Rc;

use crate::error::{Error, ErrorKind, Location};
use crate::format::{Format, Item};
use crate::matrix::{Matrix, Symmetry, TripletBuilder};
use crate::names::direction;
use crate::text::{Line, Lines, integer, quoted};

pub(crate) const FORMAT: Format = Format {
    name: "abaqus-element",
    summary: "`*USER ELEMENT` with `*MATRIX`: substructures and elements of Abaqus (.mtx), substructures of CalculiX",
    sniff,
    open,
};

/// Maximum number of rows of an element. A larger matrix would take terabytes.
const ROWS: usize = 1 << 20;

fn sniff(bytes: &[u8]) -> bool {
    // Maximum number of comment lines before the first keyword.
    let keyword =
        Lines::new(bytes).take(1000).find(|line| !line.text.starts_with(b"**") && !line.text.trim_ascii().is_empty());
    keyword.is_some_and(|line| is_keyword(&line, "*USERELEMENT"))
}

/// Returns a keyword line in capitals and without spaces, or `None` for other lines.
pub(crate) fn keyword(line: &Line) -> Option<String> {
    let starts = line.text.starts_with(b"*") && !line.text.starts_with(b"**");
    starts.then(|| String::from_utf8_lossy(line.text).to_uppercase().split_whitespace().collect())
}

fn is_keyword(line: &Line, name: &str) -> bool {
    keyword(line).is_some_and(|text| text.split(',').next() == Some(name))
}

/// Returns the value of `NAME=value` on a keyword line.
pub(crate) fn parameter<'t>(text: &'t str, name: &str) -> Option<&'t str> {
    text.split(',').find_map(|part| part.strip_prefix(name)?.strip_prefix('='))
}

/// Returns the nonempty fields between commas of a data line or comment.
pub(crate) fn fields(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|&byte| byte == b',').map(<[u8]>::trim_ascii).filter(|field| !field.is_empty())
}

/// An element whose lines are being read.
#[derive(Default)]
struct UserElement {
    nodes: usize,
    general: bool,
    /// Node numbers, from the comment.
    labels: Vec<i64>,
    /// Degrees of freedom, each with the first position at which they hold.
    dofs: Vec<(usize, Vec<i64>)>,
}

impl UserElement {
    fn new(line: &Line) -> Result<Self, Error> {
        let text = keyword(line).unwrap_or_default();
        let nodes = parameter(&text, "NODES").and_then(|count| count.parse().ok()).filter(|&nodes| nodes <= ROWS);
        let nodes = nodes.ok_or_else(|| line.malformed(&format!("NODES=number up to {ROWS}"), "none"))?;
        Ok(Self { nodes, general: text.split(',').any(|part| part == "UNSYMM"), ..Self::default() })
    }

    /// Reads a data line of degrees of freedom.
    fn add_dofs(&mut self, line: &Line) -> Result<(), Error> {
        let mut numbers = fields(line.text).map(|field| line.integer(field)).collect::<Result<Vec<_>, _>>()?;
        if self.dofs.is_empty() {
            // The first data line starts at the first node and omits its position.
            numbers.insert(0, 1);
        }
        match numbers.split_first().map(|(&position, dofs)| (usize::try_from(position), dofs)) {
            Some((Ok(position @ 1..), dofs @ [_, ..])) => self.dofs.push((position, dofs.to_vec())),
            _ => return Err(line.malformed("the position of a node and its degrees of freedom", &quoted(line.text))),
        }
        Ok(())
    }

    /// Returns the names of the rows and their number. Without known node
    /// numbers there are no names.
    fn rows(&self, line: &Line) -> Result<(Vec<String>, usize), Error> {
        let mut changes = self.dofs.clone();
        changes.sort_by_key(|(from, _)| *from);
        let labels = Some(&self.labels).filter(|labels| labels.len() == self.nodes);
        let (mut names, mut count) = (Vec::new(), 0);
        for (at, (from, dofs)) in changes.iter().enumerate() {
            let end = changes.get(at + 1).map_or(self.nodes + 1, |(next, _)| *next).min(self.nodes + 1);
            let positions = (*from).min(end)..end;
            count += positions.len() * dofs.len();
            if count > ROWS {
                return Err(line.malformed(&format!("at most {ROWS} rows"), "more"));
            }
            let labels = labels.map_or(&[][..], |labels| &labels[positions.start - 1..positions.end - 1]);
            names.extend(
                labels.iter().flat_map(|label| dofs.iter().map(move |dof| format!("{label}.{}", direction(*dof)))),
            );
        }
        Ok((names, count))
    }
}

/// The numbers of a matrix: first line and layout.
struct MatrixBlock<'a> {
    lines: Lines<'a>,
    rows: usize,
    general: bool,
    names: Rc<Vec<String>>,
}

fn open(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let mut lines = Lines::new(bytes);
    let mut element: Option<UserElement> = None;
    let mut rows: Option<(Rc<Vec<String>>, usize)> = None;
    let mut items: Vec<Item> = Vec::new();
    let mut in_matrix = false;
    while let Some(line) = lines.next() {
        if line.text.starts_with(b"**") {
            // Titles in the comment are not numbers, and a comment after the
            // matrix is not a list of nodes.
            if let Some(element) = element.as_mut().filter(|element| element.dofs.is_empty()) {
                element.labels.extend(fields(&line.text[2..]).filter_map(integer));
            }
        } else if is_keyword(&line, "*USERELEMENT") {
            (element, rows, in_matrix) = (Some(UserElement::new(&line)?), None, false);
        } else if let Some(element) = element.as_ref().filter(|_| is_keyword(&line, "*MATRIX")) {
            let (names, count) = match &rows {
                Some(rows) => rows.clone(),
                None => {
                    let (names, count) = element.rows(&line)?;
                    rows.insert((Rc::new(names), count)).clone()
                }
            };
            let block = MatrixBlock { lines: lines.clone(), rows: count, general: element.general, names };
            let name = unused_name(&line, &items);
            items.push(Item::new(name, count, count, move || read(&block)));
            in_matrix = true;
        } else if keyword(&line).is_some() {
            (element, in_matrix) = (None, false);
        } else if let Some(element) = element.as_mut().filter(|_| !in_matrix && !line.text.trim_ascii().is_empty()) {
            element.add_dofs(&line)?;
        }
    }
    Ok(items)
}

/// Returns `stiffness`, or `stiffness 2` for the second stiffness of a file.
fn unused_name(line: &Line, items: &[Item]) -> String {
    let text = keyword(line).unwrap_or_default();
    let kind = parameter(&text, "TYPE").unwrap_or("matrix").to_lowercase();
    let taken = |name: &str| items.iter().filter(|item| item.variable.name.split(' ').next() == Some(name)).count();
    match taken(&kind) {
        0 => kind,
        before => format!("{kind} {}", before + 1),
    }
}

fn read(block: &MatrixBlock) -> Result<Matrix, Error> {
    let MatrixBlock { rows, general, .. } = *block;
    let expected = if general { rows * rows } else { rows * (rows + 1) / 2 };
    let mut triplets = TripletBuilder::new(rows, rows, 0, Location::File)?;
    let (mut row, mut column, mut count) = (0, 0, 0);
    let mut lines = block.lines.clone();
    for line in lines.by_ref() {
        if line.text.starts_with(b"**") {
            continue;
        }
        if line.text.starts_with(b"*") {
            break;
        }
        for field in fields(line.text) {
            count += 1;
            if count > expected {
                return Err(wrong_count(line.location(), expected, "more"));
            }
            triplets.push(row, column, line.real(field)?, line.location())?;
            if general {
                row += 1;
                (row, column) = if row == rows { (0, column + 1) } else { (row, column) };
            } else {
                column += 1;
                (row, column) = if column > row { (row + 1, 0) } else { (row, column) };
            }
        }
    }
    if count < expected {
        return Err(wrong_count(lines.location(), expected, &count.to_string()));
    }
    let matrix = triplets.finish(if general { Symmetry::General } else { Symmetry::Symmetric })?;
    if block.names.len() == rows { matrix.with_names(block.names.to_vec()) } else { Ok(matrix) }
}

fn wrong_count(location: Location, expected: usize, found: &str) -> Error {
    let problem = format!("the matrix of this element must have {expected} numbers, but it has {found}");
    Error::new(ErrorKind::Count, location, problem, "export the file again")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{list_bytes, read_bytes};

    const TWO: &str = "**\n*User Element, NODES = 2, LINEAR\n** ELEMENT NODES\n** 7,\n** 9\n1, 2\n2, 1\n\
        *MATRIX,TYPE=STIFFNESS\n1.0,\n0.5, 2.0,\n0.0,\n 0.25, 3.0\n*MATRIX,TYPE=MASS\n1.,0.,1.,0.,0.,1.\n";

    #[test]
    fn stiffness_and_mass_with_the_names_of_rows() -> Result<(), Error> {
        let listed: Vec<_> = list_bytes(TWO.as_bytes(), None)?.iter().map(ToString::to_string).collect();
        assert_eq!(listed, ["stiffness (3 x 3)", "mass (3 x 3)"]);
        let stiffness = read_bytes(TWO.as_bytes(), None, Some("stiffness"))?;
        assert_eq!(stiffness.names(), Some(&["7.x", "7.y", "9.x"].map(String::from)[..]));
        assert_eq!((stiffness.get(0, 1), stiffness.get(2, 1), stiffness.get(2, 0)), (0.5, 0.25, 0.0));
        assert!(stiffness.is_symmetric());
        assert_eq!(read_bytes(TWO.as_bytes(), None, Some("mass"))?.get(2, 2), 1.0);
        Ok(())
    }

    #[test]
    fn what_is_not_symmetric_goes_down_the_columns() -> Result<(), Error> {
        let text = "*USER ELEMENT,NODES=2,LINEAR,UNSYMM\n1\n*MATRIX,TYPE=STIFFNESS\n1,2,3,4\n";
        let matrix = read_bytes(text.as_bytes(), None, None)?;
        assert_eq!((matrix.get(1, 0), matrix.get(0, 1)), (2.0, 3.0));
        assert_eq!(matrix.names(), None);
        Ok(())
    }

    #[test]
    fn errors_state_their_line() {
        let check = |text: &str, kind, location| {
            let found = read_bytes(text.as_bytes(), None, None).map(|_| ()).map_err(|e| (e.kind, e.location));
            assert_eq!(found, Err((kind, location)), "{text}");
        };
        let one = "*USER ELEMENT,NODES=1\n1,2\n*MATRIX,TYPE=MASS\n";
        check(&format!("{one}1,2\n"), ErrorKind::Count, Location::Line(4));
        check(&format!("{one}1,2,3,4\n"), ErrorKind::Count, Location::Line(4));
        check(&format!("{one}1,x,3\n"), ErrorKind::Malformed, Location::Line(4));
        check("*USER ELEMENT\n1\n", ErrorKind::Malformed, Location::Line(1));
        check("*USER ELEMENT,NODES=999999999999\n1\n*MATRIX\n1\n", ErrorKind::Malformed, Location::Line(1));
        check("*USER ELEMENT,NODES=1000000\n1,2\n*MATRIX\n1\n", ErrorKind::Malformed, Location::Line(3));
        check("*USER ELEMENT,NODES=1\n1\n0,1\n", ErrorKind::Malformed, Location::Line(3));
        check("*USER ELEMENT,NODES=1\n1\n , ,\n", ErrorKind::Malformed, Location::Line(3));
        check("*USER ELEMENT,NODES=1\n,\n", ErrorKind::Malformed, Location::Line(2));
        check("*USER ELEMENT,NODES=1\n1\n", ErrorKind::Selection, Location::File);
    }
}
