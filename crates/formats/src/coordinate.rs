//! Lines `row column value`, counted from one, without a header: CalculiX
//! (`.sti`, `.mas`) and Abaqus (`FORMAT=COORDINATE`).
//!
//! CalculiX writes the upper triangle, Abaqus both. A file with one triangle only, or with a
//! diagonal only, is a symmetric matrix. The size is the largest row or column. A first line
//! with sizes is Matrix Market, see [`FirstLine`].
//! Source: CalculiX CrunchiX manual, `*FREQUENCY, SOLVER=MATRIXSTORAGE`; Abaqus
//! Analysis User's Guide, Generating matrices.

use crate::error::{Error, ErrorKind, Location};
use crate::first_line::{FirstLine, ambiguous, whole};
use crate::format::{Format, Item};
use crate::matrix::{Matrix, Symmetry, TripletBuilder};
use crate::text::{Line, Lines, integer, real, require_final_newline};

pub(crate) const FORMAT: Format = Format {
    name: "coordinate",
    summary: "lines `row column value`: CalculiX (.sti, .mas), Abaqus with FORMAT=COORDINATE (.mtx)",
    sniff,
    open,
};

fn sniff(bytes: &[u8]) -> bool {
    let first = Lines::new(bytes).find(|line| !line.text.trim_ascii().is_empty());
    first.and_then(|line| line.exactly::<3>("").ok()).is_some_and(|[row, column, value]| {
        [row, column].iter().all(|field| integer(field).is_some_and(|index| index > 0)) && real(value).is_some()
    })
}

/// Returns row, column and value of every line.
fn entries(bytes: &[u8]) -> impl Iterator<Item = Result<(usize, usize, f64, Line<'_>), Error>> {
    Lines::new(bytes).filter(|line| !line.text.trim_ascii().is_empty()).map(|line| {
        let [row, column, value] = line.exactly("row, column and value")?;
        Ok((line.index(row)?, line.index(column)?, line.real(value)?, line))
    })
}

fn open(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    match FirstLine::classify(bytes) {
        FirstLine::Entry => {}
        FirstLine::Ambiguous(line) => return Err(ambiguous(&line)),
        FirstLine::Sizes => {
            let problem = "the first line contains sizes, not an entry".into();
            let remedy = "omit the format, or state matrix-market";
            return Err(Error::new(ErrorKind::Malformed, Location::File, problem, remedy));
        }
    }
    if is_full_of_three(bytes) {
        let problem = "three lines of three integers may be entries or the rows of a full symmetric matrix";
        let remedy = "for entries, write the values with a decimal point (`1 1 2.`); for rows, write all numbers with one (`2. 1. 0.`)";
        return Err(Error::new(ErrorKind::Malformed, Location::File, problem.into(), remedy));
    }
    let (mut size, mut count) = (0, 0);
    for entry in entries(bytes) {
        let (row, column, ..) = entry?;
        size = size.max(row + 1).max(column + 1);
        count += 1;
    }
    if count == 0 {
        let problem = "the file has no entry; lines `row column value` are required".into();
        return Err(Error::new(ErrorKind::Truncated, Location::File, problem, "export it again"));
    }
    require_final_newline(bytes)?;
    Ok(vec![Item::new("", size, size, move || read(bytes, size, count))])
}

/// Returns true if the file consists of three lines that are also the rows of a
/// full symmetric matrix of integers.
fn is_full_of_three(bytes: &[u8]) -> bool {
    let lines = Lines::new(bytes).filter(|line| !line.text.trim_ascii().is_empty()).take(4);
    let rows: Option<Vec<[i64; 3]>> = lines.map(|line| whole(&line)).collect();
    matches!(rows.as_deref(), Some(&[[_, a, b], [c, _, d], [e, f, _]]) if (a, b, d) == (c, e, f))
}

fn read(bytes: &[u8], size: usize, count: usize) -> Result<Matrix, Error> {
    let mut triplets = TripletBuilder::new(size, size, count, Location::File)?;
    for entry in entries(bytes) {
        let (row, column, value, line) = entry?;
        triplets.push(row, column, value, line.location())?;
    }
    triplets.finish(Symmetry::Unstated)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read_bytes;

    #[test]
    fn a_triangle_is_symmetric_and_so_are_both_if_they_are_equal() -> Result<(), Error> {
        let upper = read_bytes(b"1 1  2.0e+00\n1 2 -1.0e+00\n2 2  0.0\n3 3 1\n", None, None)?;
        assert!(upper.is_symmetric());
        assert_eq!((upper.rows(), upper.get(1, 0), upper.origin().zeros), (3, -1.0, 1));
        let both = read_bytes(b"1 1 2\n1 2 -1\n2 1 -1\n", None, None)?;
        assert_eq!(both.entries(), &upper.entries()[..2]);
        assert!(!read_bytes(b"1 1 2\n1 2 -1\n2 1 -2\n", None, None)?.is_symmetric());
        Ok(())
    }

    #[test]
    fn errors_state_their_line() {
        let check = |text: &str, kind, location| {
            let error =
                read_bytes(text.as_bytes(), Some("coordinate"), None).map(|_| ()).map_err(|e| (e.kind, e.location));
            assert_eq!(error, Err((kind, location)), "{text}");
        };
        check("", ErrorKind::Truncated, Location::File);
        check("1 1 1\n2 2\n", ErrorKind::Malformed, Location::Line(2));
        check("1 1 1\n2 x 1\n", ErrorKind::Malformed, Location::Line(2));
        check("1 1 1\n2 2 1.2", ErrorKind::Truncated, Location::Line(2));
        check("1 1 inf\n", ErrorKind::NotFinite, Location::Line(1));
        check("1 4000000000 1\n", ErrorKind::TooLarge, Location::File);
        // Three such lines may also be a full symmetric matrix.
        check("2 1 1\n1 2 1\n1 1 2\n", ErrorKind::Malformed, Location::File);
        check("1 1 1\n\n0 1 1\n", ErrorKind::Malformed, Location::Line(3));
    }
}
