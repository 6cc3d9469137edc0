//! Matrix Market: a banner, comments and a line of sizes, then one line per
//! entry, or all numbers by columns.
//!
//! ```text
//! %%MatrixMarket matrix coordinate real symmetric
//! 3 3 2
//! 1 1 2.5
//! 3 1 -1.0
//! ```
//! Symmetric and skew-symmetric matrices store their lower triangle. Coordinates without a
//! banner are read too, see [`FirstLine`]; a single triangle is then a symmetric matrix.
//!
//! Source: Boisvert, Pozo, Remington, The Matrix Market Exchange Formats:
//! Initial Design, NISTIR 5935 (1996).

use crate::error::{Error, ErrorKind, Location};
use crate::first_line::{FirstLine, ambiguous, is_comment};
use crate::format::{Format, Item};
use crate::matrix::{Matrix, Symmetry, TripletBuilder};
use crate::text::{Line, Lines, quoted, truncated};

pub(crate) const FORMAT: Format = Format {
    name: "matrix-market",
    summary: "Matrix Market (.mtx): coordinate or array; SciPy `mmwrite`, MATLAB, Julia, most sparse libraries",
    sniff: |bytes| banner(bytes).is_some() || !matches!(FirstLine::classify(bytes), FirstLine::Entry),
    open,
};

/// The contents of the banner.
struct Layout {
    coordinate: bool,
    pattern: bool,
    symmetry: Symmetry,
}

/// The banner and the line of sizes.
struct MatrixMarketHeader {
    layout: Layout,
    rows: usize,
    columns: usize,
    /// Number of entries in the file.
    entries: usize,
}

/// Returns the banner, one of the comments at the beginning of a file.
fn banner(bytes: &[u8]) -> Option<Line<'_>> {
    let filled = Lines::new(bytes).filter(|line| !line.text.trim_ascii().is_empty());
    filled.take_while(is_comment).find(|line| words(line).first().is_some_and(|word| word == "matrixmarket"))
}

/// Returns the words of a comment in lower case, without its `%`.
fn words(line: &Line) -> Vec<String> {
    let text = String::from_utf8_lossy(line.text).to_lowercase();
    text.trim_start_matches(|c: char| c == '%' || c.is_whitespace()).split_whitespace().map(str::to_string).collect()
}

fn open(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let mut lines = Lines::new(bytes);
    let header = header(&mut lines)?;
    let (rows, columns) = (header.rows, header.columns);
    Ok(vec![Item::new("", rows, columns, move || read(bytes))])
}

fn header(lines: &mut Lines) -> Result<MatrixMarketHeader, Error> {
    let mut layout = match banner(lines.rest()) {
        Some(line) => layout(&line)?,
        None => match FirstLine::classify(lines.rest()) {
            FirstLine::Sizes => Layout { coordinate: true, pattern: false, symmetry: Symmetry::Unstated },
            FirstLine::Ambiguous(line) => return Err(ambiguous(&line)),
            FirstLine::Entry => {
                let line = lines.expect_filled("the banner `%%MatrixMarket matrix …`")?;
                return Err(line.malformed("the banner `%%MatrixMarket matrix …`", &quoted(line.text)));
            }
        },
    };
    let sizes = loop {
        let line = lines.expect_filled("the line of sizes")?;
        if !is_comment(&line) {
            break line;
        }
    };
    let (rows, columns, entries) = if layout.coordinate {
        let [rows, columns, entries] = sizes.exactly("rows, columns and number of entries")?;
        (sizes.count(rows)?, sizes.count(columns)?, Some(sizes.count(entries)?))
    } else {
        let [rows, columns] = sizes.exactly("rows and columns")?;
        (sizes.count(rows)?, sizes.count(columns)?, None)
    };
    if rows != columns && layout.symmetry == Symmetry::Unstated {
        layout.symmetry = Symmetry::General;
    }
    if layout.symmetry != Symmetry::General && rows != columns {
        return Err(sizes.malformed("a square symmetric matrix", &format!("{rows} x {columns}")));
    }
    let entries = entries.map_or_else(|| stored(rows, columns, layout.symmetry, &sizes), Ok)?;
    Ok(MatrixMarketHeader { layout, rows, columns, entries })
}

fn layout(banner: &Line) -> Result<Layout, Error> {
    let words = words(banner);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let [_, "matrix", layout, field, symmetry] = words[..] else {
        return Err(banner.malformed("`%%MatrixMarket matrix LAYOUT FIELD SYMMETRY`", &quoted(banner.text)));
    };
    let coordinate = match layout {
        "coordinate" => true,
        "array" => false,
        other => return Err(banner.malformed("coordinate or array", &format!("`{other}`"))),
    };
    let pattern = match field {
        "real" | "double" | "integer" | "unsigned-integer" => false,
        "pattern" if coordinate => true,
        "complex" => {
            return Err(Error::new(
                ErrorKind::Complex,
                banner.location(),
                "the matrix is complex, but it must be real".into(),
                "write its real part; structural damping is not supported as a complex matrix",
            ));
        }
        other => return Err(banner.malformed("real, integer or pattern", &format!("`{other}`"))),
    };
    let symmetry = match symmetry {
        "general" => Symmetry::General,
        // A real Hermitian matrix is symmetric.
        "symmetric" | "hermitian" => Symmetry::Symmetric,
        "skew-symmetric" => Symmetry::Skew,
        other => return Err(banner.malformed("general, symmetric or skew-symmetric", &format!("`{other}`"))),
    };
    Ok(Layout { coordinate, pattern, symmetry })
}

/// Returns the number of values that an array of this size stores.
fn stored(rows: usize, columns: usize, symmetry: Symmetry, line: &Line) -> Result<usize, Error> {
    let all = rows.checked_mul(columns).ok_or_else(|| line.malformed("a size that fits in a file", "a larger one"))?;
    Ok(match symmetry {
        Symmetry::General | Symmetry::Unstated => all,
        Symmetry::Symmetric => (all - rows) / 2 + rows,
        Symmetry::Skew => (all - rows) / 2,
    })
}

fn read(bytes: &[u8]) -> Result<Matrix, Error> {
    let mut lines = Lines::new(bytes);
    let header = header(&mut lines)?;
    // The shortest line of an entry is `1 1` with a line end, that of a number `0` with a line end.
    let shortest = if header.layout.coordinate { 4 } else { 2 };
    let room = header.entries.min(lines.remaining() / shortest + 1);
    let mut triplets = TripletBuilder::new(header.rows, header.columns, room, lines.location())?;
    if header.layout.coordinate {
        coordinates(&mut lines, &header, &mut triplets)?;
    } else {
        array(&mut lines, &header, &mut triplets)?;
    }
    triplets.finish(header.layout.symmetry)
}

fn coordinates(lines: &mut Lines, header: &MatrixMarketHeader, triplets: &mut TripletBuilder) -> Result<(), Error> {
    let mut count = 0;
    for line in lines.by_ref() {
        if line.text.trim_ascii().is_empty() || is_comment(&line) {
            continue;
        }
        count += 1;
        if count > header.entries {
            return Err(too_many(line.location(), header.entries));
        }
        let (row, column, value) = if header.layout.pattern {
            let [row, column] = line.exactly("row and column")?;
            (row, column, 1.0)
        } else {
            let [row, column, value] = line.exactly("row, column and value")?;
            (row, column, line.real(value)?)
        };
        triplets.push(line.index(row)?, line.index(column)?, value, line.location())?;
    }
    if count == header.entries { Ok(()) } else { Err(too_few(lines.location(), count, header.entries)) }
}

fn array(lines: &mut Lines, header: &MatrixMarketHeader, triplets: &mut TripletBuilder) -> Result<(), Error> {
    let first = |column: usize| match header.layout.symmetry {
        Symmetry::General | Symmetry::Unstated => 0,
        Symmetry::Symmetric => column,
        Symmetry::Skew => column + 1,
    };
    let (mut row, mut column, mut count) = (first(0), 0, 0);
    for line in lines.by_ref().filter(|line| !is_comment(line)) {
        for word in line.words() {
            count += 1;
            if count > header.entries {
                return Err(too_many(line.location(), header.entries));
            }
            // The last column of a skew-symmetric matrix has no entries below its diagonal.
            while row >= header.rows {
                column += 1;
                row = first(column);
            }
            triplets.push(row, column, line.real(word)?, line.location())?;
            row += 1;
        }
    }
    if count == header.entries { Ok(()) } else { Err(too_few(lines.location(), count, header.entries)) }
}

fn too_many(location: Location, expected: usize) -> Error {
    Error::new(
        ErrorKind::Count,
        location,
        format!("the file has more entries than the {expected} that the header states"),
        "correct the line of sizes, or export the file again",
    )
}

fn too_few(location: Location, found: usize, expected: usize) -> Error {
    let error = truncated(location, &format!("entry {} of {expected}", found + 1));
    Error { kind: ErrorKind::Truncated, ..error }
}

/// Returns a matrix as a file of coordinates.
pub(crate) fn write(matrix: &Matrix) -> Vec<u8> {
    let symmetry = if matrix.is_symmetric() { "symmetric" } else { "general" };
    let (rows, columns, count) = (matrix.rows(), matrix.columns(), matrix.entries().len());
    let mut text = format!("%%MatrixMarket matrix coordinate real {symmetry}\n{rows} {columns} {count}\n");
    for e in matrix.entries() {
        // `{:e}` writes the digits that the last bit needs.
        text.push_str(&format!("{} {} {:e}\n", e.row + 1, e.column + 1, e.value));
    }
    text.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read_bytes;

    fn read(text: &str) -> Result<Matrix, Error> {
        read_bytes(text.as_bytes(), None, None)
    }

    fn check(text: &str, expected: &[(usize, usize, f64)]) -> Result<Matrix, Error> {
        let matrix = read(text)?;
        let expected = Matrix::new(matrix.rows(), matrix.columns(), Symmetry::General, expected.iter().copied())?;
        assert_eq!(matrix.both_triangles().count(), expected.both_triangles().count(), "{text}");
        for e in expected.entries() {
            assert_eq!(matrix.get(e.row as usize, e.column as usize), e.value, "{text}");
        }
        Ok(matrix)
    }

    #[test]
    fn coordinates_of_every_field_and_symmetry() -> Result<(), Error> {
        let full = [(0, 0, 2.0), (1, 0, -1.0), (0, 1, -1.0)];
        // Trailing spaces in the banner, upper case, comments and blank lines:
        // all occur in real files.
        let text =
            "%%MatrixMarket MATRIX coordinate Real symmetric  \r\n% a comment\n\n2 2 3\n1 1 2\n\n2 1 -1.0e0\n2 2 0\n";
        let matrix = check(text, &full)?;
        assert!(matrix.is_symmetric());
        assert_eq!(matrix.origin().zeros, 1);
        check("%%MatrixMarket matrix coordinate integer symmetric\n2 2 2\n1 1 2\n2 1 -1\n", &full)?;
        check("%%MatrixMarket matrix coordinate real general\n2 2 3\n1 1 2\n2 1 -1\n1 2 -1\n", &full)?;
        let pattern = "%%MatrixMarket matrix coordinate pattern general\n2 3 2\n1 1\n2 3\n";
        check(pattern, &[(0, 0, 1.0), (1, 2, 1.0)])?;
        let skew = "%%MatrixMarket matrix coordinate real skew-symmetric\n2 2 1\n2 1 3\n";
        check(skew, &[(1, 0, 3.0), (0, 1, -3.0)])?;
        Ok(())
    }

    #[test]
    fn arrays_go_down_the_columns() -> Result<(), Error> {
        let general = "%%MatrixMarket matrix array real general\n2 3\n1\n2\n3\n4\n5\n6\n";
        let expected = [(0, 0, 1.0), (1, 0, 2.0), (0, 1, 3.0), (1, 1, 4.0), (0, 2, 5.0), (1, 2, 6.0)];
        check(general, &expected)?;
        let lower = "%%MatrixMarket matrix array real symmetric\n2 2\n1\n2\n3\n";
        check(lower, &[(0, 0, 1.0), (1, 0, 2.0), (0, 1, 2.0), (1, 1, 3.0)])?;
        let skew = "%%MatrixMarket matrix array real skew-symmetric\n3 3\n1\n2\n3\n";
        let expected = [(1, 0, 1.0), (2, 0, 2.0), (2, 1, 3.0), (0, 1, -1.0), (0, 2, -2.0), (1, 2, -3.0)];
        check(skew, &expected)?;
        check("%%MatrixMarket matrix array real general\n0 0\n", &[])?;
        Ok(())
    }

    /// A chain of three masses, `[2 -1 0; -1 2 -1; 0 -1 1]` kN/m.
    const CHAIN: &str = "1 1 2000\n2 1 -1000\n2 2 2000\n3 2 -1000\n3 3 1000\n";

    #[test]
    fn blanks_before_banner_and_comments_do_no_harm() -> Result<(), Error> {
        let entries = [(0, 0, 2e3), (1, 0, -1e3), (0, 1, -1e3), (1, 1, 2e3), (2, 1, -1e3), (1, 2, -1e3), (2, 2, 1e3)];
        let banner = "%%MatrixMarket matrix coordinate real symmetric\n";
        check(&format!("  {banner}3 3 5\n{CHAIN}"), &entries)?;
        check(&format!("\n% by a program\n{banner}   % a chain\n3 3 5\n\t% of three\n{CHAIN}"), &entries)?;
        check(&format!("{}3 3 5\n{CHAIN}", banner.replace("%%", "% %")), &entries)?;
        check(
            "%%MatrixMarket matrix array real symmetric\n  % a comment\n 2 2\n1\n % another\n2\n3\n",
            &[(0, 0, 1.0), (1, 0, 2.0), (0, 1, 2.0), (1, 1, 3.0)],
        )?;
        Ok(())
    }

    #[test]
    fn sizes_without_a_banner_are_no_entry() -> Result<(), Error> {
        let entries = [(0, 0, 2e3), (1, 0, -1e3), (0, 1, -1e3), (1, 1, 2e3), (2, 1, -1e3), (1, 2, -1e3), (2, 2, 1e3)];
        for text in [format!("3 3 5\n{CHAIN}"), format!("% a chain\n\n 3 3 5\r\n{CHAIN}\n")] {
            let matrix = check(&text, &entries)?;
            assert_eq!((matrix.rows(), matrix.origin().format), (3, "matrix-market"));
        }
        check("3 3 3\n1 1 1\n2 2 1\n3 3 1\n", &[(0, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0)])?;
        check("1 1 1\n1 1 5\n", &[(0, 0, 5.0)])?;
        let wide = check("2 3 2\n1 1 4\n2 1 5\n", &[(0, 0, 4.0), (1, 0, 5.0)])?;
        assert_eq!((wide.rows(), wide.columns(), wide.get(0, 1)), (2, 3, 0.0));
        // A single entry, and first lines that are not sizes.
        for (text, value) in [("3 3 50\n", 50.0), ("3 3 50.\n1 1 1\n", 50.0), ("3 3 -5\n1 1 1\n", -5.0)] {
            let matrix = read(text)?;
            assert_eq!((matrix.origin().format, matrix.get(2, 2)), ("coordinate", value), "{text}");
        }
        Ok(())
    }

    #[test]
    fn a_first_line_that_may_be_sizes_or_an_entry_is_refused() {
        for text in [format!("3 3 6\n{CHAIN}"), format!("3 3 4\n{CHAIN}"), "2 2 1000\n2 1 -1000\n1 1 2000\n".into()] {
            for format in [None, Some("coordinate"), Some("matrix-market")] {
                let error = read_bytes(text.as_bytes(), format, None).map(|_| ()).map_err(|e| (e.kind, e.location));
                assert_eq!(error, Err((ErrorKind::Malformed, Location::Line(1))), "{text}");
            }
        }
        let stated = read_bytes(format!("3 3 5\n{CHAIN}").as_bytes(), Some("coordinate"), None).map(|_| ());
        assert!(stated.is_err_and(|error| error.to_string().contains("sizes")));
    }

    #[test]
    fn errors_state_their_line() {
        let check = |text: &str, kind, location| {
            let error = read(text).map(|_| ()).map_err(|e| (e.kind, e.location));
            assert_eq!(error, Err((kind, location)), "{text}");
        };
        let real = "%%MatrixMarket matrix coordinate real general\n";
        check(&format!("{real}2 2 2\n1 1 1\n"), ErrorKind::Truncated, Location::Line(3));
        check(&format!("{real}2 2 1\n1 1 1\n2 2 1\n"), ErrorKind::Count, Location::Line(4));
        check(&format!("{real}2 2 1\n3 1 1\n"), ErrorKind::Count, Location::Line(3));
        check(&format!("{real}2 2 1\n0 1 1\n"), ErrorKind::Malformed, Location::Line(3));
        check(&format!("{real}2 2 1\n1 1 nan\n"), ErrorKind::NotFinite, Location::Line(3));
        check(&format!("{real}2 2 1\n1 1 1 0\n"), ErrorKind::Malformed, Location::Line(3));
        check(&format!("{real}2 2\n1 1 1\n"), ErrorKind::Malformed, Location::Line(2));
        check(real, ErrorKind::Truncated, Location::Line(2));
        check(&format!("{real}99999999999 1 0\n"), ErrorKind::TooLarge, Location::File);
        check(
            "%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 1 0\n",
            ErrorKind::Complex,
            Location::Line(1),
        );
        check("%%MatrixMarket vector coordinate real general\n1 1 1\n", ErrorKind::Malformed, Location::Line(1));
        check("%%MatrixMarket matrix coordinate real symmetric\n1 2 1\n", ErrorKind::Malformed, Location::Line(2));
        // A header that claims more memory than there is.
        check(&format!("{real}1000000 1000000 999999999999\n1 1 1\n"), ErrorKind::Truncated, Location::Line(3));
        let array = "%%MatrixMarket matrix array real general\n";
        check(&format!("{array}4000000000 4000000000\n1\n"), ErrorKind::TooLarge, Location::File);
        check(&format!("{array}4000000000000 4000000000000\n1\n"), ErrorKind::Malformed, Location::Line(2));
    }

    #[test]
    fn written_files_read_back_exactly() -> Result<(), Error> {
        let values = [1.0 / 3.0, f64::MIN_POSITIVE / 3.0, -f64::MAX, 1e22 + 2e6];
        let entries = values.iter().enumerate().map(|(row, &value)| (row, row / 2, value));
        for symmetry in [Symmetry::General, Symmetry::Symmetric] {
            let matrix = Matrix::new(4, 4, symmetry, entries.clone())?;
            let back = read_bytes(&write(&matrix), None, None)?;
            assert_eq!(back.entries(), matrix.entries());
            assert_eq!(back.is_symmetric(), matrix.is_symmetric());
        }
        Ok(())
    }
}
