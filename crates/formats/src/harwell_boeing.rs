//! Harwell-Boeing: a header of four or five lines, then pointers, rows and values in fixed
//! Fortran formats. ANSYS writes it by `HBMAT`.
//!
//! ```text
//! title                                                                   key
//!              5             1             1             2             1
//! RSA                        3             3             4             0
//! (8I10)          (8I10)          (4E20.12)           (4E20.12)
//! ```
//! The columns are compressed, and a symmetric matrix (`RSA`) stores its lower triangle. Fields
//! may touch, so the formats determine their widths.
//! Source: Duff, Grimes, Lewis, Users' Guide for the Harwell-Boeing Sparse Matrix Collection,
//! TR/PA/92/86 (1992); ANSYS Mechanical APDL Command Reference, HBMAT.

use crate::error::{Error, ErrorKind, Location};
use crate::format::{COMPLEX, Format, Item};
use crate::fortran::FortranFormat;
use crate::matrix::{Matrix, Symmetry, TripletBuilder, for_each_compressed};
use crate::text::{Lines, quoted};

pub(crate) const FORMAT: Format = Format {
    name: "harwell-boeing",
    summary: "Harwell-Boeing, as text: ANSYS HBMAT (.matrix), `scipy.io.hb_write`",
    sniff,
    open,
};

fn sniff(bytes: &[u8]) -> bool {
    let mut lines = Lines::new(bytes);
    let (Some(_), Some(cards), Some(kind), Some(formats)) = (lines.next(), lines.next(), lines.next(), lines.next())
    else {
        return false;
    };
    cards.words().next().is_some_and(|word| crate::text::integer(word).is_some())
        && kind.words().next().is_some_and(|word| type_of(word).is_some())
        && formats.text.trim_ascii_start().starts_with(b"(")
}

/// Returns the three letters of a type: values, symmetry and assembly.
fn type_of(word: &[u8]) -> Option<[u8; 3]> {
    let [values, symmetry, assembly] = *word.to_ascii_uppercase().first_chunk()?;
    let known = b"RCPI".contains(&values) && b"SUHZR".contains(&symmetry) && b"AE".contains(&assembly);
    (known && word.len() == 3).then_some([values, symmetry, assembly])
}

/// The header, with the lines after it.
struct HbHeader<'a> {
    rows: usize,
    columns: usize,
    entries: usize,
    kind: [u8; 3],
    pointers: FortranFormat,
    indices: FortranFormat,
    values: FortranFormat,
    lines: Lines<'a>,
}

fn header(bytes: &[u8]) -> Result<HbHeader<'_>, Error> {
    let mut lines = Lines::new(bytes);
    lines.expect("a title")?;
    let cards = lines.expect("the numbers of lines")?;
    // The last number, lines of right-hand sides, may be missing.
    let right_sides = cards.words().nth(4).map_or(Ok(0), |word| cards.count(word))?;
    let sizes = lines.expect("type and size")?;
    let words: Vec<_> = sizes.words().collect();
    let [kind, rows, columns, entries, ..] = words[..] else {
        return Err(sizes.malformed("type, rows, columns and number of entries", &quoted(sizes.text)));
    };
    let kind = type_of(kind).ok_or_else(|| sizes.malformed("a type such as RSA", &quoted(kind)))?;
    let (rows, columns, entries) = (sizes.count(rows)?, sizes.count(columns)?, sizes.count(entries)?);
    let line = lines.expect("the formats")?;
    let text = String::from_utf8_lossy(line.text).into_owned();
    let mut depth = 0;
    let closes = |letter: char| {
        depth += i32::from(letter == '(') - i32::from(letter == ')');
        letter == ')' && depth <= 0
    };
    let mut formats = text.split_inclusive(closes).map(str::trim);
    let mut format = |what: &str| {
        let found = formats.next().unwrap_or_default();
        FortranFormat::new(found).ok_or_else(|| {
            let problem = format!("{} is not a supported Fortran format for {what}", quoted(found.as_bytes()));
            let remedy = "use a format of integers or real numbers, such as (8I10), (1X,8I9) or (1P,4E20.12)";
            Error::new(ErrorKind::Malformed, line.location(), problem, remedy)
        })
    };
    let (pointers, indices) = (format("pointers")?, format("rows")?);
    let values = if kind[0] == b'P' { indices.clone() } else { format("values")? };
    if right_sides > 0 {
        lines.expect("the line of right-hand sides")?;
    }
    Ok(HbHeader { rows, columns, entries, kind, pointers, indices, values, lines })
}

fn open(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let header = header(bytes)?;
    Ok(vec![match header.kind {
        [b'C', ..] => Item::not_a_matrix("", COMPLEX),
        [_, _, b'E'] => Item::not_a_matrix("", "a matrix of unassembled elements"),
        _ => Item::new("", header.rows, header.columns, move || read(bytes)),
    }])
}

fn read(bytes: &[u8]) -> Result<Matrix, Error> {
    let HbHeader { rows, columns, entries, kind, pointers, indices, values, mut lines } = header(bytes)?;
    let count = columns.saturating_add(1);
    let pointers =
        pointers.read(&mut lines, count, "a pointer for every column", |field| field.line.index(field.text))?;
    let indices = indices.read(&mut lines, entries, "a row for every entry", |field| field.line.index(field.text))?;
    let values = match kind[0] {
        b'P' => vec![1.0; indices.len()],
        _ => values.read(&mut lines, entries, "a value for every entry", |field| field.real())?,
    };
    let symmetry = match kind[1] {
        // A real Hermitian matrix is symmetric.
        b'S' | b'H' => Symmetry::Symmetric,
        b'Z' => Symmetry::Skew,
        _ => Symmetry::General,
    };
    let mut triplets = TripletBuilder::new(rows, columns, indices.len(), Location::File)?;
    for_each_compressed(&pointers, &indices, &values, columns, |column, row, value| {
        triplets.push(row, column, value, Location::File)
    })?;
    triplets.finish(symmetry)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read_bytes;

    fn file(kind: &str, formats: &str, body: &str) -> String {
        let rest = "             5             1             1             2             1";
        format!(
            "{:72}{:8}\n{rest}\n{kind}             3             3             4             0\n{formats}\n{body}",
            "blade", "K"
        )
    }

    const FORMATS: &str = "(8I3)           (8I3)           (1P,2D19.12)        (4E20.12)";
    const BODY: &str = "F              1             0\n  1  3  4  5\n  1  3  2  3\n\
        -1.000000000000D+03-5.000000000000D+02\n 2.000000000000D+00 3.000000000000-101\n";

    #[test]
    fn touching_fields_of_a_symmetric_matrix() -> Result<(), Error> {
        let matrix = read_bytes(file("RSA", FORMATS, BODY).as_bytes(), None, None)?;
        assert!(matrix.is_symmetric());
        assert_eq!((matrix.get(0, 0), matrix.get(0, 2), matrix.get(1, 1), matrix.get(2, 2)), (-1e3, -5e2, 2.0, 3e-101));
        let general = read_bytes(file("RUA", FORMATS, BODY).as_bytes(), None, None)?;
        assert_eq!((general.get(2, 0), general.get(0, 2)), (-5e2, 0.0));
        Ok(())
    }

    #[test]
    fn a_symmetric_matrix_with_both_triangles() -> Result<(), Error> {
        // ANSYS 9 wrote full matrices of superelements as RSA.
        let body = "F\n  1  3  5  5\n  1  2  1  2\n 1.0D0               2.0D0\n 2.0D0               3.0D0\n";
        let matrix = read_bytes(file("RSA", FORMATS, body).as_bytes(), None, None)?;
        assert_eq!((matrix.is_symmetric(), matrix.get(0, 1), matrix.entries().len()), (true, 2.0, 3));
        Ok(())
    }

    #[test]
    fn skipped_columns_and_repeated_groups() -> Result<(), Error> {
        let body = "F\n   1  3  4  5\n   1  3  2  3\n -1.0000000000000000E+03 -5.0000000000000000E+02\n\
            \x20 2.0000000000000000E+00  3.0000000000000000E+00\n";
        let formats = "(1X,8I3)        (1X,8I3)        (2(1P,E24.16))      (4E20.12)";
        let matrix = read_bytes(file("RSA", formats, body).as_bytes(), None, None)?;
        assert_eq!((matrix.get(0, 0), matrix.get(0, 2), matrix.get(1, 1), matrix.get(2, 2)), (-1e3, -5e2, 2.0, 3.0));
        Ok(())
    }

    #[test]
    fn errors_state_their_line() {
        let check = |kind: &str, formats: &str, body: &str, fault, location| {
            let text = file(kind, formats, body);
            let found = read_bytes(text.as_bytes(), Some("harwell-boeing"), None).map(|_| ());
            assert_eq!(found.map_err(|e| (e.kind, e.location)), Err((fault, location)), "{text}");
        };
        check("RSA", FORMATS, "F\n  1  3  4  5\n  1  3  2  3\n", ErrorKind::Truncated, Location::Line(8));
        check("RSA", FORMATS, "F\n  1  3  4\n", ErrorKind::Malformed, Location::Line(6));
        check("RSA", FORMATS, &BODY.replace("1  3  2  3", "1  3  2  9"), ErrorKind::Count, Location::File);
        check("RSA", FORMATS, &BODY.replace("1  3  4  5", "1  3  2  5"), ErrorKind::Count, Location::File);
        check("RSA", FORMATS, &BODY.replace("1  3  4  5", "0  3  4  5"), ErrorKind::Malformed, Location::Line(6));
        check("RSA", "(8I3)           (8I3)           (2A20.12)", BODY, ErrorKind::Malformed, Location::Line(4));
        check("CSA", FORMATS, BODY, ErrorKind::Complex, Location::File);
        check("RSE", FORMATS, BODY, ErrorKind::Unsupported, Location::File);
        check("XYZ", FORMATS, BODY, ErrorKind::Malformed, Location::Line(3));
    }
}
