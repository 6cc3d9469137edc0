//! Nastran OUTPUT4 (`.op4`), as text or binary: matrices by columns, dense or
//! as strings of consecutive numbers.
//!
//! The header contains columns, rows (negative: BIGMAT), form, type (1 and 2 real, 3 and 4
//! complex) and name. A column begins with its number, its first row and its number of words. A
//! first row of zero means strings. In front of each string is `IS = row + 65536 (words + 1)`,
//! or with BIGMAT the two numbers `words + 1` and `row`. A number of double precision has two
//! words. A column beyond the last one ends the matrix.
//!
//! Source: MSC Nastran DMAP Programmer's Guide, module OUTPUT4, and Utility Guide.

use crate::bytes::{ByteCursor, ByteOrder};
use crate::error::{Error, ErrorKind, Location};
use crate::format::{COMPLEX, Format, Item};
use crate::matrix::{Matrix, Symmetry, TripletBuilder};
use crate::text::{Line, Lines, integer, quoted};

pub(crate) const FORMAT: Format = Format {
    name: "nastran-op4",
    summary: "Nastran OUTPUT4 (.op4), as text or binary, dense, sparse or BIGMAT",
    sniff: |bytes| {
        binary(bytes).is_some() || Lines::new(bytes).next().is_some_and(|line| TextHeader::new(&line).is_ok())
    },
    open: |bytes| if binary(bytes).is_some() { open_binary(bytes) } else { open_text(bytes) },
};

/// The header of a matrix, common to text and binary files.
#[derive(Clone)]
struct Op4Header {
    name: String,
    rows: usize,
    columns: usize,
    kind: i64,
    /// BIGMAT: the row of a string is a separate number.
    big: bool,
}

impl Op4Header {
    fn new(numbers: [i64; 4], name: &[u8]) -> Option<Self> {
        let [columns, rows, form, kind] = numbers;
        let name = String::from_utf8_lossy(name).trim().to_uppercase();
        let known = (0..=100).contains(&form) && (1..=4).contains(&kind);
        let named = name.bytes().all(|b| b.is_ascii_graphic());
        let size = |size: i64| u32::try_from(size).ok().map(|size| size as usize);
        if !known || !named {
            return None;
        }
        Some(Self { name, rows: size(rows.checked_abs()?)?, columns: size(columns)?, kind, big: rows < 0 })
    }

    fn is_complex(&self) -> bool {
        self.kind > 2
    }

    /// Returns the matrix as an item that `read` reads.
    fn item<'a>(self, read: impl Fn(&Self) -> Result<Matrix, Error> + 'a) -> Item<'a> {
        if self.is_complex() {
            return Item::not_a_matrix(self.name, COMPLEX);
        }
        Item::new(self.name.clone(), self.rows, self.columns, move || read(&self))
    }
}

/// A matrix as text: its header and the width of its numbers.
struct TextHeader {
    header: Op4Header,
    /// Number of characters of a number.
    width: usize,
}

impl TextHeader {
    fn new(line: &Line) -> Result<Self, Error> {
        let wrong =
            || line.malformed("the header of a matrix: columns, rows, form, type, name, format", &quoted(line.text));
        // Sizes beyond seven digits have 16 characters, which the end of the line indicates.
        let text = line.text.trim_ascii_end();
        let wide = text.ends_with(b"|I16");
        let widths = if wide { [0, 16, 32, 40, 48, 56] } else { [0, 8, 16, 24, 32, 40] };
        let field = |at: usize| line.columns(widths[at], widths[at + 1]);
        let mut numbers = [0; 4];
        for (at, number) in numbers.iter_mut().enumerate() {
            *number = integer(field(at)).ok_or_else(wrong)?;
        }
        let header = Op4Header::new(numbers, field(4)).ok_or_else(wrong)?;
        let format = String::from_utf8_lossy(line.columns(widths[5], text.len())).to_uppercase().replace("|I16", "");
        // A row of integers has neither a name nor a format.
        if format.is_empty() && !header.name.starts_with(|c: char| c.is_ascii_alphabetic()) {
            return Err(wrong());
        }
        // `1P,3E23.16` or `5E16.9`. The latter holds if no format is given.
        let width = match format.rsplit_once(['E', 'D']) {
            None if format.is_empty() => 16,
            Some((_, rest)) => rest.split('.').next().and_then(|width| width.parse().ok()).ok_or_else(wrong)?,
            None => return Err(wrong()),
        };
        if (1..=100).contains(&width) { Ok(Self { header, width }) } else { Err(wrong()) }
    }
}

/// Returns true if a line contains numbers with a decimal point: values of a matrix, not counts.
fn has_values(line: &Line) -> bool {
    line.text.contains(&b'.')
}

fn open_text(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let mut lines = Lines::new(bytes);
    let mut items = Vec::new();
    while let Some(line) = lines.next() {
        if line.text.trim_ascii().is_empty() {
            continue;
        }
        let TextHeader { header, width } = TextHeader::new(&line)?;
        let start = lines.clone();
        skip_text(&mut lines, header.columns)?;
        items.push(header.item(move |header| read_text(start.clone(), header, width)));
    }
    Ok(items)
}

/// Returns column, first row and words of the line before a column, or `None`
/// for a line before a string.
fn column_of(line: &Line) -> Result<Option<[usize; 3]>, Error> {
    let words: Vec<_> = line.words().collect();
    match words[..] {
        [column, row, count] => Ok(Some([line.count(column)?, line.count(row)?, line.count(count)?])),
        [_] | [_, _] => Ok(None),
        _ => Err(line.malformed("column, first row and words", &quoted(line.text))),
    }
}

/// Moves to the line after a matrix: after the one number of the extra column.
fn skip_text(lines: &mut Lines, columns: usize) -> Result<(), Error> {
    loop {
        let line = lines.expect("a column of the matrix")?;
        if has_values(&line) {
            continue;
        }
        if column_of(&line)?.is_some_and(|[column, ..]| column > columns) {
            lines.next();
            return Ok(());
        }
    }
}

fn read_text(mut lines: Lines, header: &Op4Header, width: usize) -> Result<Matrix, Error> {
    let words = if header.kind == 2 { 2 } else { 1 };
    let mut triplets = TripletBuilder::new(header.rows, header.columns, 0, Location::File)?;
    let mut line = lines.expect("a column of the matrix")?;
    loop {
        let Some([column, first, count]) = column_of(&line)? else {
            return Err(line.malformed("column, first row and words", &quoted(line.text)));
        };
        if column > header.columns {
            break;
        }
        let column = column.checked_sub(1).ok_or_else(|| line.malformed("a column from 1", "0"))?;
        let head = line;
        line = lines.expect("the numbers of a column")?;
        if first > 0 {
            // Some programs count numbers here, others words.
            let found = values(&mut lines, &mut line, width, first - 1, column, &mut triplets)?;
            if found != count && found * words != count {
                return Err(wrong_count(&head, count, found));
            }
            continue;
        }
        while column_of(&line)?.is_none() {
            let (row, count) = string(&line)?;
            let head = line;
            line = lines.expect("the numbers of a string")?;
            let found = values(&mut lines, &mut line, width, row, column, &mut triplets)?;
            if found * words != count {
                return Err(wrong_count(&head, count, found));
            }
        }
    }
    triplets.finish(Symmetry::General)
}

fn wrong_count(line: &Line, words: usize, found: usize) -> Error {
    let problem = format!("the file states {words} words, but {found} numbers follow");
    Error::new(ErrorKind::Count, line.location(), problem, "the file is damaged; export it again")
}

/// Returns the first row, counted from zero, and the number of words of a string.
fn string(line: &Line) -> Result<(usize, usize), Error> {
    let words: Vec<_> = line.words().collect();
    let (row, count) = match words[..] {
        [both] => split(line.integer(both)?),
        [count, row] => (line.integer(row)? - 1, line.integer(count)? - 1),
        _ => (-1, -1),
    };
    match (usize::try_from(row), usize::try_from(count)) {
        (Ok(row), Ok(count)) => Ok((row, count)),
        _ => Err(line.malformed("first row and words of a string", &quoted(line.text))),
    }
}

/// Returns the first row, counted from zero, and the number of words from the
/// single number of a string without BIGMAT.
fn split(both: i64) -> (i64, i64) {
    let count = (both >> 16) - 1;
    (both - ((count + 1) << 16) - 1, count)
}

/// Reads the numbers of a column from `line` on. Stops at a line without numbers, which stays
/// in `line`. Returns the number of values read.
fn values<'a>(
    lines: &mut Lines<'a>,
    line: &mut Line<'a>,
    width: usize,
    first: usize,
    column: usize,
    triplets: &mut TripletBuilder,
) -> Result<usize, Error> {
    let mut found = 0;
    while has_values(line) {
        let text = line.text.trim_ascii_end();
        for at in 0..text.len().div_ceil(width) {
            let value = line.real(line.columns(at * width, (at + 1) * width))?;
            triplets.push(first.saturating_add(found), column, value, line.location())?;
            found += 1;
        }
        *line = lines.expect("the next column of the matrix")?;
    }
    Ok(found)
}

/// Returns the byte order and the size of an integer, if the file begins with
/// the header of a binary matrix.
fn binary(bytes: &[u8]) -> Option<(ByteOrder, usize)> {
    let orders = [ByteOrder::Little, ByteOrder::Big];
    orders.into_iter().find_map(|order| {
        let whole = match ByteCursor::new(bytes, order).u32().ok()? {
            24 => 4,
            48 => 8,
            _ => return None,
        };
        let header = record(&mut ByteCursor::new(bytes, order)).ok()?;
        header_of(header, order, whole).map(|_| (order, whole))
    })
}

/// Returns the bytes of a Fortran record, whose length stands before and after it.
fn record<'a>(file: &mut ByteCursor<'a>) -> Result<&'a [u8], Error> {
    let length = file.u32()? as usize;
    let data = file.take(length)?;
    let behind = file.u32()? as usize;
    if behind == length {
        Ok(data)
    } else {
        Err(file.malformed(&format!("the length {length} after a record"), behind))
    }
}

/// Reads an integer of 4 or 8 bytes.
fn whole_number(bytes: &mut ByteCursor, size: usize) -> Result<i64, Error> {
    if size == 8 { bytes.i64() } else { bytes.i32().map(i64::from) }
}

fn header_of(record: &[u8], order: ByteOrder, whole: usize) -> Option<Op4Header> {
    let mut bytes = ByteCursor::new(record, order);
    let mut numbers = [0; 4];
    for number in &mut numbers {
        *number = whole_number(&mut bytes, whole).ok()?;
    }
    Op4Header::new(numbers, bytes.take(2 * whole).ok()?)
}

fn open_binary(bytes: &[u8]) -> Result<Vec<Item<'_>>, Error> {
    let (order, whole) = binary(bytes).unwrap_or((ByteOrder::Little, 4));
    let mut file = ByteCursor::new(bytes, order);
    let mut items = Vec::new();
    while file.remaining() > 0 {
        let location = file.clone();
        let header = header_of(record(&mut file)?, order, whole)
            .ok_or_else(|| location.malformed("the header of a matrix", "something else"))?;
        let start = file.clone();
        loop {
            let mut column = ByteCursor::new(record(&mut file)?, order);
            if whole_number(&mut column, whole)? > header.columns as i64 {
                break;
            }
        }
        items.push(header.item(move |header| read_binary(start.clone(), header, whole)));
    }
    Ok(items)
}

fn read_binary(mut file: ByteCursor, header: &Op4Header, whole: usize) -> Result<Matrix, Error> {
    let order = file.order;
    // If integers have 8 bytes, words do too, and each number is one word.
    let double = header.kind == 2 || whole == 8;
    let words = if header.kind == 2 && whole == 4 { 2 } else { 1 };
    let mut triplets = TripletBuilder::new(header.rows, header.columns, 0, Location::File)?;
    loop {
        let location = file.clone();
        let wrong = |what: &str| location.malformed(what, "something else");
        let mut record = ByteCursor::new(record(&mut file)?, order);
        let column = whole_number(&mut record, whole)?;
        if column > header.columns as i64 {
            return triplets.finish(Symmetry::General);
        }
        let column = usize::try_from(column - 1).map_err(|_| wrong("a column from 1"))?;
        let first = whole_number(&mut record, whole)?;
        let count = whole_number(&mut record, whole)?;
        let mut put = |row: i64, count: i64, record: &mut ByteCursor| -> Result<(), Error> {
            let row = usize::try_from(row).map_err(|_| wrong("a first row from 1"))?;
            let count = usize::try_from(count).map_err(|_| wrong("a number of words"))? / words;
            for at in 0..count {
                let value = if double { record.f64() } else { record.f32().map(f64::from) };
                // The cursor counts within its record.
                let value = value.map_err(|error| Error { location: location.location(), ..error })?;
                triplets.push(row.saturating_add(at), column, value, location.location())?;
            }
            Ok(())
        };
        if first > 0 {
            put(first - 1, count, &mut record)?;
            continue;
        }
        while record.remaining() >= whole {
            let both = whole_number(&mut record, whole)?;
            let (row, count) = match header.big {
                true => (whole_number(&mut record, whole)?.wrapping_sub(1), both.wrapping_sub(1)),
                false => split(both),
            };
            put(row, count, &mut record)?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{list_bytes, read_bytes};

    const DENSE: &str = "       2       3       2       2K       1P,2E23.16\n       1       2       4\n \
        1.5000000000000000E+00-2.0000000000000000-101\n       3       1       1\n 1.0000000000000000E+00\n";
    const SPARSE: &str = "       2       3       2       2M       1P,3E23.16\n       1       0       8\n     327681\n \
        1.5000000000000000E+00 2.5000000000000000E+00\n     196611\n 3.5000000000000000E+00\n       2       0       4\n       3       2\n \
        4.5000000000000000E+00\n       3       1       1\n 1.0000000000000000E+00\n";

    #[test]
    fn text_dense_and_in_strings() -> Result<(), Error> {
        let both = format!("{DENSE}{SPARSE}");
        let listed: Vec<_> = list_bytes(both.as_bytes(), None)?.iter().map(ToString::to_string).collect();
        assert_eq!(listed, ["K (3 x 2)", "M (3 x 2)"]);
        let k = read_bytes(both.as_bytes(), None, Some("K"))?;
        assert_eq!((k.get(1, 0), k.get(2, 0), k.entries().len()), (1.5, -2e-101, 2));
        // 327681 = 1 + 65536 (4 + 1): from row 1, 4 words; 196611 = 3 + 65536 (2 + 1).
        let m = read_bytes(both.as_bytes(), None, Some("M"))?;
        assert_eq!((m.get(0, 0), m.get(1, 0), m.get(2, 0), m.get(1, 1)), (1.5, 2.5, 3.5, 4.5));
        Ok(())
    }

    #[test]
    fn single_precision_and_a_matrix_without_entries() -> Result<(), Error> {
        // In the form of MSC Nastran: a number of single precision has one word, and a null
        // matrix has only the column that ends it.
        let text = "       3      -3       6       2NULL    1P,3E22.15\n       4       1       1\n 1.000000000000000E+00\n       \
            2      -9       2       1STRINGS 1P,3E22.15\n       1       0      10\n       4       3\n \
            1.000000000000000E+00 2.000000000000000E+00 3.000000000000000E+00\n       4       7\n \
            4.000000000000000E+00 5.000000000000000E+00 6.000000000000000E+00\n       3       1       1\n 1.000000000000000E+00\n";
        let null = read_bytes(text.as_bytes(), None, Some("NULL"))?;
        assert_eq!((null.rows(), null.entries().len()), (3, 0));
        let strings = read_bytes(text.as_bytes(), None, Some("STRINGS"))?;
        assert_eq!((strings.get(2, 0), strings.get(8, 0), strings.entries().len()), (1.0, 6.0, 6));
        Ok(())
    }

    #[test]
    fn names_may_begin_with_a_digit_or_be_blank() -> Result<(), Error> {
        let digit = DENSE.replace("2K       1P", "21MAT    1P");
        assert_eq!(read_bytes(digit.as_bytes(), None, Some("1MAT"))?.get(1, 0), 1.5);
        let blank = DENSE.replace("2K       1P", "2        1P");
        let read = read_bytes(blank.as_bytes(), None, None)?;
        assert_eq!((read.get(1, 0), read.origin().variable.as_str()), (1.5, ""));
        let two = format!("{blank}{DENSE}");
        let listed: Vec<_> = list_bytes(two.as_bytes(), None)?.iter().map(ToString::to_string).collect();
        assert_eq!(listed, ["3 x 2", "K (3 x 2)"]);
        assert_eq!(read_bytes(two.as_bytes(), None, Some("K"))?.get(1, 0), 1.5);
        let error = read_bytes(two.as_bytes(), None, None).map(|_| ()).map_err(|e| (e.kind, e.remedy));
        assert!(error.is_err_and(|(kind, remedy)| kind == ErrorKind::Selection && remedy.contains("export")));
        // A row of a full matrix.
        let rows: String = ["2 1 1 2", "1 2 1 1", "1 1 2 1", "2 1 1 2"]
            .map(|row| row.split(' ').map(|word| format!("{word:>8}")).collect::<String>() + "\n")
            .concat();
        assert_eq!(read_bytes(rows.as_bytes(), None, None)?.origin().format, "dense-text");
        Ok(())
    }

    #[test]
    fn errors_state_their_line() {
        let check = |text: String, kind, location| {
            let found =
                read_bytes(text.as_bytes(), Some("nastran-op4"), None).map(|_| ()).map_err(|e| (e.kind, e.location));
            assert_eq!(found, Err((kind, location)), "{text}");
        };
        check(
            DENSE.replace("       1       2       4", "       1       2       5"),
            ErrorKind::Count,
            Location::Line(2),
        );
        check(
            DENSE.replace("       1       2       4", "       1       3       4"),
            ErrorKind::Count,
            Location::Line(3),
        );
        check(
            DENSE.replace("       1       2       4", "       0       2       4"),
            ErrorKind::Malformed,
            Location::Line(2),
        );
        check(DENSE.lines().take(3).map(|line| format!("{line}\n")).collect(), ErrorKind::Truncated, Location::Line(4));
        check(
            DENSE.replace("       2       2K", "       2       4K"),
            ErrorKind::Complex,
            Location::Variable("K".into()),
        );
        check(DENSE.replace("2E23.16", "2X23.16"), ErrorKind::Malformed, Location::Line(1));
        check(SPARSE.replace("     327681", "     262145"), ErrorKind::Count, Location::Line(3));
        check(SPARSE.replace("     327681", "          1"), ErrorKind::Malformed, Location::Line(3));
    }
}
