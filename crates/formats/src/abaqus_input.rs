//! Abaqus `FORMAT=MATRIX INPUT` and `LABELS`: lines
//! `node, dof, node, dof, value`. CalculiX writes substructures like this too.
//!
//! The file contains one triangle or both. Rows are sorted by node, then
//! direction, and named `node.direction`. A constrained row has 1e36 on its
//! diagonal. Negative node numbers are internal variables of Abaqus.
//! Source: Abaqus Keywords Reference Guide, `*MATRIX INPUT`, `*MATRIX OUTPUT`;
//! CalculiX manual, `*SUBSTRUCTURE MATRIX OUTPUT`.

use std::collections::HashMap;

use crate::error::{Error, ErrorKind, Location};
use crate::format::{Format, Item};
use crate::matrix::{Matrix, Symmetry, TripletBuilder};
use crate::names::direction;
use crate::text::{Line, Lines, integer, quoted, real, require_final_newline};

pub(crate) const FORMAT: Format = Format {
    name: "abaqus-matrix-input",
    summary: "lines `node, dof, node, dof, value`: Abaqus with FORMAT=MATRIX INPUT (.mtx), CalculiX substructures",
    sniff,
    open,
};

/// A node, by number or by label.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Node<'a> {
    Number(i64),
    Label(&'a [u8]),
}

/// A row or column: a node and its degree of freedom.
type NodeDof<'a> = (Node<'a>, i64);

fn fields<'a>(line: &Line<'a>) -> Option<[&'a [u8]; 5]> {
    let mut fields = [&[][..]; 5];
    let mut parts = line.text.split(|&byte| byte == b',');
    for field in &mut fields {
        *field = parts.next()?.trim_ascii();
    }
    // A trailing comma is common.
    parts.all(|rest| rest.trim_ascii().is_empty()).then_some(fields)
}

fn lines(bytes: &[u8]) -> impl Iterator<Item = Line<'_>> {
    Lines::new(bytes).filter(|line| !line.text.starts_with(b"*") && !line.text.trim_ascii().is_empty())
}

fn sniff(bytes: &[u8]) -> bool {
    let first = lines(bytes).next().as_ref().and_then(fields);
    first.is_some_and(|[_, row, _, column, value]| {
        integer(row).is_some() && integer(column).is_some() && real(value).is_some()
    })
}

/// Returns row, column and value of every line.
fn entries(bytes: &[u8]) -> impl Iterator<Item = Result<(NodeDof<'_>, NodeDof<'_>, f64, Line<'_>), Error>> {
    let row = |line: &Line, [node, dof]: [&'_ [u8]; 2]| line.integer(dof).map(|dof| (integer(node), dof));
    lines(bytes).map(move |line| {
        let found = fields(&line).ok_or_else(|| line.malformed("`node, dof, node, dof, value`", &quoted(line.text)))?;
        let [row_node, row_dof, column_node, column_dof, value] = found;
        let node = |text, number: Option<i64>| number.map_or(Node::Label(text), Node::Number);
        let (row_number, row_dof) = row(&line, [row_node, row_dof])?;
        let (column_number, column_dof) = row(&line, [column_node, column_dof])?;
        let row = (node(row_node, row_number), row_dof);
        Ok((row, (node(column_node, column_number), column_dof), line.real(value)?, line))
    })
}

fn open(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let mut places: HashMap<NodeDof, usize> = HashMap::new();
    let mut count = 0;
    for entry in entries(bytes) {
        let (row, column, ..) = entry?;
        places.insert(row, 0);
        places.insert(column, 0);
        count += 1;
    }
    if count == 0 {
        let problem = "the file has no entry; lines `node, dof, node, dof, value` are required".into();
        return Err(Error::new(ErrorKind::Truncated, Location::File, problem, "export it again"));
    }
    require_final_newline(bytes)?;
    require_single_matrix(bytes)?;
    let mut rows: Vec<NodeDof> = places.keys().copied().collect();
    rows.sort_unstable();
    for (at, row) in rows.iter().enumerate() {
        places.insert(*row, at);
    }
    let size = rows.len();
    Ok(vec![Item::new("", size, size, move || read(bytes, &rows, &places, count))])
}

/// Refuses a second `*MATRIX INPUT`, because its entries would be added to those of the first.
fn require_single_matrix(bytes: &[u8]) -> Result<(), Error> {
    let begins = |line: &Line| {
        let keyword: Vec<u8> = line.text.iter().filter(|byte| !byte.is_ascii_whitespace()).take(12).copied().collect();
        keyword.eq_ignore_ascii_case(b"*MATRIXINPUT")
    };
    Lines::new(bytes).filter(begins).nth(1).map_or(Ok(()), |line| {
        let problem = "the file contains a second matrix, which begins here".into();
        Err(Error::new(ErrorKind::Unsupported, line.location(), problem, "write every matrix to a separate file"))
    })
}

fn read(bytes: &[u8], rows: &[NodeDof], places: &HashMap<NodeDof, usize>, count: usize) -> Result<Matrix, Error> {
    let mut triplets = TripletBuilder::new(rows.len(), rows.len(), count, Location::File)?;
    for entry in entries(bytes) {
        let (row, column, value, line) = entry?;
        triplets.push(places[&row], places[&column], value, line.location())?;
    }
    let name = |(node, dof): &NodeDof| match node {
        Node::Number(number) => format!("{number}.{}", direction(*dof)),
        Node::Label(label) => format!("{}.{}", String::from_utf8_lossy(label), direction(*dof)),
    };
    triplets.finish(Symmetry::Unstated)?.with_names(rows.iter().map(name).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read_bytes;

    fn read(text: &str) -> Result<Matrix, Error> {
        read_bytes(text.as_bytes(), Some("abaqus-matrix-input"), None)
    }

    #[test]
    fn rows_are_sorted_by_node_and_named() -> Result<(), Error> {
        let matrix = read("** a comment\n10,1, 9,2, -1.5\n9,2, 9,2, 3.e0,\n10,1, 10,1, 1.000000000000000e+36\n")?;
        assert_eq!(matrix.names(), Some(&["9.y".to_string(), "10.x".into()][..]));
        assert!(matrix.is_symmetric());
        assert_eq!((matrix.get(0, 0), matrix.get(0, 1), matrix.get(1, 1)), (3.0, -1.5, 1e36));
        let labels = read("Part-1.7, 3, Part-1.7, 3, 2.0\n-1, 6, -1, 6, 1.0\n")?;
        assert_eq!(labels.names(), Some(&["-1.rz".to_string(), "Part-1.7.z".into()][..]));
        Ok(())
    }

    #[test]
    fn both_triangles_stay_as_they_are() -> Result<(), Error> {
        let matrix = read("1,1,2,1,5\n2,1,1,1,6\n")?;
        assert!(!matrix.is_symmetric());
        assert_eq!((matrix.get(0, 1), matrix.get(1, 0)), (5.0, 6.0));
        Ok(())
    }

    #[test]
    fn errors_state_their_line() {
        let check = |text, kind, location| {
            assert_eq!(read(text).map(|_| ()).map_err(|e| (e.kind, e.location)), Err((kind, location)), "{text}");
        };
        check("", ErrorKind::Truncated, Location::File);
        check("1,1,1,1,1\n1,1,1,1\n", ErrorKind::Malformed, Location::Line(2));
        check("1,1,1,1,1\n1,1,1,1,1,1\n", ErrorKind::Malformed, Location::Line(2));
        check("1,x,1,1,1\n", ErrorKind::Malformed, Location::Line(1));
        let two = "*MATRIX INPUT, NAME=K\n1,1,1,1,5\n*Matrix Input, NAME=M\n1,1,1,1,3\n";
        check(two, ErrorKind::Unsupported, Location::Line(3));
        check("1,1,1,1,1e999\n", ErrorKind::NotFinite, Location::Line(1));
    }
}
