//! Full matrices as text, one line per row: `numpy.savetxt`, CSV, MATLAB's `writematrix`.
//!
//! ```text
//! # stiffness
//! 2000.0, -1000.0
//! -1000.0, 1000.0
//! ```
//! Spaces, commas or semicolons separate the numbers; comments begin with `#`
//! or `%`. The matrix must be square. A line of sizes or column numbers, or a
//! column of row numbers, would make it rectangular and is refused.

use crate::error::{Error, ErrorKind, Location};
use crate::format::{Format, Item};
use crate::matrix::{Matrix, Symmetry, TripletBuilder};
use crate::text::{Line, Lines, integer, real, require_final_newline};

pub(crate) const FORMAT: Format = Format {
    name: "dense-text",
    summary: "a line of numbers for every row: `numpy.savetxt`, CSV, MATLAB `writematrix`",
    // A single column of numbers is a list of row names.
    sniff: |bytes| {
        rows(bytes)
            .next()
            .is_some_and(|line| fields(&line).nth(1).is_some() && fields(&line).all(|field| real(field).is_some()))
    },
    open,
};

/// Returns the lines without the comments.
fn rows(bytes: &[u8]) -> impl Iterator<Item = Line<'_>> {
    let is_comment = |line: &Line| matches!(line.text.trim_ascii_start().first(), None | Some(b'#' | b'%'));
    Lines::new(bytes).filter(move |line| !is_comment(line))
}

/// Returns the fields of a line, separated by semicolons if there are any, else
/// by commas, else by spaces.
fn fields<'a>(line: &Line<'a>) -> Box<dyn Iterator<Item = &'a [u8]> + 'a> {
    match [b';', b','].into_iter().find(|mark| line.text.contains(mark)) {
        Some(mark) => Box::new(line.text.split(move |byte| *byte == mark).map(<[u8]>::trim_ascii)),
        None => Box::new(line.words()),
    }
}

fn open(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let (mut size, mut columns) = (0, 0);
    for line in rows(bytes) {
        let here = fields(&line).count();
        if size > 0 && here != columns {
            let remedy = "write all numbers of every row; put sizes and titles in comments";
            let problem = format!("this row has {here} numbers, but the rows before have {columns}");
            return Err(Error::new(ErrorKind::Malformed, line.location(), problem, remedy));
        }
        (size, columns) = (size + 1, here);
    }
    let fault = |kind, problem: String, remedy: &str| Err(Error::new(kind, Location::File, problem, remedy));
    if size == 0 {
        return fault(ErrorKind::Truncated, "the file has no row of numbers".into(), "export it again");
    }
    if size != columns {
        let problem = format!("the file has {size} rows of {columns} numbers, but the matrix must be square");
        let remedy = "export a square matrix, without a line of sizes or column numbers and without row numbers";
        return fault(ErrorKind::NotSquare, problem, remedy);
    }
    if columns == 3 && rows(bytes).all(|line| has_indices(&line)) {
        let problem = "the three lines may be full rows or entries `row column value`".into();
        let remedy = "for full rows, write all numbers with a decimal point; for entries, remove comments and commas";
        return fault(ErrorKind::Malformed, problem, remedy);
    }
    require_final_newline(bytes)?;
    Ok(vec![Item::new("", size, size, move || read(bytes, size))])
}

/// Returns true if a line begins with two numbers that may be a row and a column.
fn has_indices(line: &Line) -> bool {
    fields(line).take(2).all(|field| integer(field).is_some_and(|index| index > 0))
}

fn read(bytes: &[u8], size: usize) -> Result<Matrix, Error> {
    let mut triplets = TripletBuilder::new(size, size, 0, Location::File)?;
    for (row, line) in rows(bytes).enumerate() {
        for (column, field) in fields(&line).enumerate() {
            triplets.push(row, column, line.real(field)?, line.location())?;
        }
    }
    triplets.finish(Symmetry::General)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read_bytes;

    /// A chain of three masses in the notations of several programs.
    #[test]
    fn rows_of_numbers_in_every_dialect() -> Result<(), Error> {
        let files = [
            // numpy.savetxt with its default format, with a header.
            "# stiffness\n2.000000000000000000e+03 -1.000000000000000000e+03 0.000000000000000000e+00\n\
             -1.000000000000000000e+03 2.000000000000000000e+03 -1.000000000000000000e+03\n\
             0.000000000000000000e+00 -1.000000000000000000e+03 1.000000000000000000e+03\n",
            "2000,-1000,0\r\n-1000,2000,-1000\r\n0,-1000,1000\r\n",
            "% MATLAB\n 2000\t-1000\t0\n\n-1000\t2000\t-1000\n0\t-1000\t1000\n",
            "2000; -1000; 0\n-1000; 2000; -1000\n0; -1000; 1000\n",
        ];
        for file in files {
            let matrix = read_bytes(file.as_bytes(), None, None)?;
            assert!(matrix.is_symmetric(), "{file}");
            let values: Vec<f64> = matrix.entries().iter().map(|e| e.value).collect();
            assert_eq!((matrix.rows(), &values[..]), (3, &[2e3, -1e3, 2e3, -1e3, 1e3][..]), "{file}");
        }
        let skew = read_bytes(b"0.0 300.0\n-300.0 0.0\n", None, None)?;
        assert_eq!((skew.get(0, 1), skew.get(1, 0)), (300.0, -300.0));
        // A single column could be a list of names. It is read only if the format is stated.
        assert!(read_bytes(b"5\n", None, None).is_err());
        assert_eq!(read_bytes(b"5\n", Some("dense-text"), None)?.get(0, 0), 5.0);
        Ok(())
    }

    #[test]
    fn errors_state_their_line() {
        let check = |text: &str, kind, location| {
            let found = read_bytes(text.as_bytes(), Some("dense-text"), None).map(|_| ());
            assert_eq!(found.map_err(|e| (e.kind, e.location)), Err((kind, location)), "{text}");
        };
        check("# nothing\n", ErrorKind::Truncated, Location::File);
        check("2 1\n1 2\n3 4\n", ErrorKind::NotSquare, Location::File);
        // With sizes, column numbers or row numbers.
        check("2 2\n2.5 1\n1 2\n", ErrorKind::NotSquare, Location::File);
        check("3\n1 2 3\n2 4 5\n3 5 6\n", ErrorKind::Malformed, Location::Line(2));
        check("0,1\n2,1\n1,2\n", ErrorKind::NotSquare, Location::File);
        check("0,2,1\n1,1,2\n", ErrorKind::NotSquare, Location::File);
        check(",0,1\n0,2,1\n1,1,2\n", ErrorKind::Malformed, Location::Line(1));
        check("1 2\n3 x\n", ErrorKind::Malformed, Location::Line(2));
        check("1,5;2,5\n2,5;1,5\n", ErrorKind::Malformed, Location::Line(1));
        check("1 2\n3 nan\n", ErrorKind::NotFinite, Location::Line(2));
        check("1 2\n3 4.2", ErrorKind::Truncated, Location::Line(2));
        // Entries of Octave's sparse text, or rows.
        check("# type: sparse matrix\n1 1 2\n2 2 3\n3 3 4\n", ErrorKind::Malformed, Location::File);
        check("1,1,2\n2,2,3\n3,3,4\n", ErrorKind::Malformed, Location::File);
    }
}
