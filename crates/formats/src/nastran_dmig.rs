//! Nastran DMIG cards: matrices at grid points in fields of 8 or 16 characters,
//! in punch files (`.pch`) or bulk data.
//!
//! ```text
//! DMIG    KAAX           0       6       2       0                       6
//! DMIG*   KAAX                           7               1
//! *                      7               1 1.000000000D+03
//! *                      9               1-5.000000000D+02
//! ```
//! The first card of a name states the form and the type. The forms are 6
//! (symmetric, one triangle), 1 (square), 2 and 9 (rectangular). The types are
//! 1 and 2 (real), 3 and 4 (complex). Every other card is a column: its grid
//! point and component, then grid point, component and value of each entry.
//!
//! Rows are sorted by grid point and component; component 0 is a scalar point.
//! The numbers have ten digits, which moves rigid-body modes by up to 1 Hz.
//! Source: MSC Nastran Quick Reference Guide, DMIG; input formats of bulk data.

use std::collections::{BTreeMap, BTreeSet};

use crate::error::{Error, ErrorKind, Location};
use crate::format::{COMPLEX, Format, Item};
use crate::matrix::{Matrix, Symmetry, TripletBuilder};
use crate::names::direction;
use crate::text::{Line, Lines};

pub(crate) const FORMAT: Format = Format {
    name: "nastran-dmig",
    summary: "Nastran DMIG (.pch, .bdf): EXTSEOUT(DMIGPCH), PARAM EXTOUT; small, large and free fields",
    sniff: |bytes| Lines::new(bytes).any(|line| is_dmig(&line)),
    open,
};

fn is_dmig(line: &Line) -> bool {
    let named = line.text.get(..4).is_some_and(|name| name.eq_ignore_ascii_case(b"DMIG"));
    named && matches!(line.text.get(4), None | Some(b' ' | b'*' | b',' | b'\t'))
}

/// Returns the fields of a line of bulk data after the first: 4 of 16
/// characters, 8 of 8, or those between commas.
pub(crate) fn fields<'a>(line: &Line<'a>) -> Vec<&'a [u8]> {
    if line.text.contains(&b',') {
        let mut fields: Vec<_> = line.text.split(|&byte| byte == b',').map(<[u8]>::trim_ascii).skip(1).collect();
        // The ninth field marks a continuation.
        fields.truncate(if is_large(line) { 4 } else { 8 });
        fields.resize(if is_large(line) { 4 } else { 8 }, &[]);
        return fields;
    }
    let width = if is_large(line) { 16 } else { 8 };
    (0..64 / width).map(|at| line.columns(8 + at * width, 8 + (at + 1) * width)).collect()
}

fn is_large(line: &Line) -> bool {
    let first = line.text.iter().take(8).take_while(|&&byte| byte != b',');
    first.into_iter().any(|&byte| byte == b'*')
}

pub(crate) fn is_continuation(line: &Line) -> bool {
    matches!(line.text.first(), Some(b' ' | b'*' | b'+' | b',')) && !line.text.trim_ascii().is_empty()
}

/// Grid point and component.
type GridDof = (i64, i64);

/// The properties of the matrix of one name.
#[derive(Default)]
struct DmigMatrix {
    form: i64,
    complex: bool,
    /// Number of columns of a rectangular matrix by its first card, or zero if
    /// the card does not state it.
    columns: usize,
    rows: BTreeSet<GridDof>,
    /// Columns of a rectangular matrix, which are not rows.
    column_points: BTreeSet<GridDof>,
    entries: usize,
}

impl DmigMatrix {
    fn rectangular(&self) -> bool {
        matches!(self.form, 2 | 9)
    }

    fn size(&self) -> (usize, usize) {
        match self.rectangular() {
            true => {
                let last = self.column_points.last().map_or(0, |(column, _)| usize::try_from(*column).unwrap_or(0));
                (self.rows.len(), self.columns.max(last))
            }
            false => (self.rows.len(), self.rows.len()),
        }
    }
}

/// A header or an entry from the cards.
enum Card<'a> {
    Header { name: String, form: i64, complex: bool, columns: usize },
    Entry { name: &'a str, column: GridDof, row: GridDof, value: f64, imaginary: bool },
}

/// Calls `visit` for every header and entry of all DMIG cards.
fn scan(bytes: &[u8], mut visit: impl FnMut(Card, &Line) -> Result<(), Error>) -> Result<(), Error> {
    let mut column: Option<(String, GridDof)> = None;
    for line in Lines::new(bytes).filter(|line| !line.text.starts_with(b"$")) {
        if is_dmig(&line) {
            let fields = fields(&line);
            let name = String::from_utf8_lossy(fields[0]).to_uppercase();
            let number = |at: usize| match fields.get(at).copied().unwrap_or_default() {
                [] => Ok(0),
                field => line.integer(field),
            };
            // Only the first card of a name has a zero in place of a grid point.
            if number(1)? == 0 {
                let kind = number(3)?;
                let columns = usize::try_from(number(7)?).unwrap_or(0);
                visit(Card::Header { name, form: number(2)?, complex: matches!(kind, 3 | 4), columns }, &line)?;
                column = None;
                continue;
            }
            let at = (number(1)?, number(2)?);
            entries(&fields[4.min(fields.len())..], &name, at, &line, &mut visit)?;
            column = Some((name, at));
        } else if let Some((name, at)) = column.as_ref().filter(|_| is_continuation(&line)) {
            entries(&fields(&line), name, *at, &line, &mut visit)?;
        } else {
            column = None;
        }
    }
    Ok(())
}

/// Reads the entries of one line: grid point, component, real part, imaginary part.
fn entries(
    fields: &[&[u8]],
    name: &str,
    column: GridDof,
    line: &Line,
    visit: &mut impl FnMut(Card, &Line) -> Result<(), Error>,
) -> Result<(), Error> {
    for entry in fields.chunks(4) {
        let [grid, component, value, rest @ ..] = entry else { continue };
        if grid.is_empty() {
            continue;
        }
        let imaginary = rest.first().is_some_and(|field| !field.is_empty() && line.real(field).is_ok_and(|x| x != 0.0));
        let component = if component.is_empty() { 0 } else { line.integer(component)? };
        let row = (line.integer(grid)?, component);
        visit(Card::Entry { name, column, row, value: line.real(value)?, imaginary }, line)?;
    }
    Ok(())
}

fn complex(name: &str, location: Location) -> Error {
    let problem = format!("the matrix {name} is complex, but it must be real");
    Error::new(
        ErrorKind::Complex,
        location,
        problem,
        "export the real stiffness; structural damping is a separate matrix, K4AAX",
    )
}

fn unknown(name: &str, line: &Line) -> Error {
    line.malformed("the first card of a matrix, `DMIG NAME 0 form type`", &format!("a column of {name}"))
}

fn open(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let mut found: BTreeMap<String, DmigMatrix> = BTreeMap::new();
    let mut order = Vec::new();
    scan(bytes, |card, line| {
        match card {
            Card::Header { name, form, complex, columns } => {
                if !matches!(form, 1 | 2 | 6 | 9) {
                    return Err(line.malformed("form 1, 2, 6 or 9", &form.to_string()));
                }
                if found.insert(name.clone(), DmigMatrix { form, complex, columns, ..DmigMatrix::default() }).is_some()
                {
                    return Err(
                        line.malformed("exactly one first card for every name", &format!("a second one of {name}"))
                    );
                }
                order.push(name);
            }
            Card::Entry { name, column, row, .. } => {
                let matrix = found.get_mut(name).ok_or_else(|| unknown(name, line))?;
                matrix.rows.insert(row);
                if matrix.rectangular() {
                    matrix.column_points.insert(column)
                } else {
                    matrix.rows.insert(column)
                };
                matrix.entries += 1;
            }
        }
        Ok(())
    })?;
    let items = order.into_iter().filter_map(|name| {
        let matrix = found.remove(&name)?;
        if matrix.complex {
            return Some(Item::not_a_matrix(name, COMPLEX));
        }
        let (rows, columns) = matrix.size();
        Some(Item::new(name.clone(), rows, columns, move || read(bytes, &name, &matrix)))
    });
    Ok(items.collect())
}

fn read(bytes: &[u8], wanted: &str, matrix: &DmigMatrix) -> Result<Matrix, Error> {
    let places: BTreeMap<GridDof, usize> = matrix.rows.iter().enumerate().map(|(at, row)| (*row, at)).collect();
    let (rows, columns) = matrix.size();
    let mut triplets = TripletBuilder::new(rows, columns, matrix.entries, Location::File)?;
    scan(bytes, |card, line| {
        let Card::Entry { name, column, row, value, imaginary } = card else { return Ok(()) };
        if name != wanted {
            return Ok(());
        }
        if imaginary {
            return Err(complex(name, line.location()));
        }
        // The columns of a rectangular matrix are numbers from one. The size check refuses others.
        let column = match matrix.rectangular() {
            true => {
                usize::try_from(column.0 - 1).map_err(|_| line.malformed("a column from 1", &column.0.to_string()))?
            }
            false => places[&column],
        };
        triplets.push(places[&row], column, value, line.location())
    })?;
    let symmetry = if matrix.form == 6 { Symmetry::Symmetric } else { Symmetry::General };
    let name = |(grid, component): &GridDof| match component {
        0 => grid.to_string(),
        component => format!("{grid}.{}", direction(*component)),
    };
    triplets.finish(symmetry)?.with_names(matrix.rows.iter().map(name).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{list_bytes, read_bytes};

    const PUNCH: &str = "$TITLE   =\n\
        DMIG    KAAX           0       6       2       0                       2\n\
        DMIG*   KAAX                           7               1                        *KAA   1\n\
        *KAA   1               7               1 1.000000000D+03\n\
        *                      9               0-5.000000000-101\n\
        GRID           9               0.0\n\
        DMIG*   KAAX                           9               0\n\
        *                      9               0 1.0+3\n";

    #[test]
    fn large_fields_of_a_punch_file() -> Result<(), Error> {
        let matrix = read_bytes(PUNCH.as_bytes(), None, None)?;
        assert!(matrix.is_symmetric());
        assert_eq!(matrix.names(), Some(&["7.x", "9"].map(String::from)[..]));
        assert_eq!((matrix.get(0, 0), matrix.get(0, 1), matrix.get(1, 1)), (1e3, -5e-101, 1e3));
        Ok(())
    }

    #[test]
    fn small_and_free_fields_hold_two_entries_a_line() -> Result<(), Error> {
        let small = "DMIG    M       0       1       1\n\
            DMIG    M       1       1               1       1       2.0\n\
            +       2       3       1.5             3       1       1.0-5\n";
        let free = "DMIG,M,0,1,1\nDMIG,M,1,1,,1,1,2.0\n,2,3,1.5,,3,1,1.-5\n";
        for text in [small, free] {
            let matrix = read_bytes(text.as_bytes(), None, Some("M"))?;
            assert_eq!(matrix.names(), Some(&["1.x", "2.z", "3.x"].map(String::from)[..]));
            assert_eq!((matrix.get(0, 0), matrix.get(1, 0), matrix.get(2, 0)), (2.0, 1.5, 1e-5));
            assert!(!matrix.is_symmetric());
        }
        Ok(())
    }

    #[test]
    fn rectangular_columns_are_numbers() -> Result<(), Error> {
        let text = "DMIG,P,0,9,1,0,,,4\nDMIG,P,2,0,,5,1,3.0\nDMIG,P,3,,,5,1,4.0\n";
        let matrix = read_bytes(text.as_bytes(), None, None)?;
        assert_eq!((matrix.rows(), matrix.columns(), matrix.get(0, 1), matrix.get(0, 2)), (1, 4, 3.0, 4.0));
        Ok(())
    }

    #[test]
    fn real_matrices_beside_complex_ones_are_read_and_wrong_ones_refused() -> Result<(), Error> {
        let two = format!("{PUNCH}DMIG    C       0       6       4\n");
        let listed: Vec<_> = list_bytes(two.as_bytes(), None)?.iter().map(ToString::to_string).collect();
        assert_eq!(listed, ["KAAX (2 x 2)", "C (complex)"]);
        let check = |text: &str, kind, location| {
            let found = read_bytes(text.as_bytes(), None, None).map(|_| ()).map_err(|e| (e.kind, e.location));
            assert_eq!(found, Err((kind, location)), "{text}");
        };
        let mixed = format!(
            "{two}DMIG*   C                              7               1\n\
            *                      7               1 2.000000000D+03 1.000000000D+01\n"
        );
        let listed: Vec<_> = list_bytes(mixed.as_bytes(), None)?.iter().map(ToString::to_string).collect();
        assert_eq!(listed, ["KAAX (2 x 2)", "C (complex)"]);
        assert_eq!(read_bytes(mixed.as_bytes(), None, Some("KAAX"))?.get(0, 0), 1e3);
        let named = read_bytes(mixed.as_bytes(), None, Some("C")).map(|_| ()).map_err(|e| (e.kind, e.location));
        assert_eq!(named, Err((ErrorKind::Complex, Location::Variable("C".into()))));
        check("DMIG,C,0,6,4\n", ErrorKind::Complex, Location::Variable("C".into()));
        check("DMIG,M,0,6,2\nDMIG,M,1,1,,1,1,2.0,3.0\n", ErrorKind::Complex, Location::Line(2));
        check("DMIG,M,1,1,,1,1,2.0\n", ErrorKind::Malformed, Location::Line(1));
        check("DMIG,M,0,6,2\nDMIG,M,1,1,,1,1,x\n", ErrorKind::Malformed, Location::Line(2));
        check("DMIG,M,0,7,2\n", ErrorKind::Malformed, Location::Line(1));
        check("DMIG,M,0,9,2\nDMIG,M,-1,,,1,1,1.0\n", ErrorKind::Malformed, Location::Line(2));
        check(
            "DMIG,M,0,6,2\nDMIG,M,1,1,,2,1,1.0\nDMIG,M,2,1,,1,1,2.0\n",
            ErrorKind::NotSymmetric,
            Location::Variable("M".into()),
        );
        Ok(())
    }
}
