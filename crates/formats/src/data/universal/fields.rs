//! Numbers of a line: between blanks, or in columns of fixed width if blanks are missing.

use crate::error::Error;
use crate::text::{Line, quoted, real};

/// Widths of the fields of a line, repeated to its end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Widths(pub &'static [usize]);

/// Appends the numbers of a line.
///
/// Programs leave out the blanks between numbers that fill their columns. Such a line is divided
/// by the widths of its fields, or before signs if that gives no numbers.
pub(super) fn append_numbers(line: &Line<'_>, widths: Widths, out: &mut Vec<f64>) -> Result<(), Error> {
    let before = out.len();
    let mut append = |fields: &mut dyn Iterator<Item = &[u8]>| {
        for field in fields {
            match real(field) {
                Some(value) => out.push(value),
                None => {
                    out.truncate(before);
                    return false;
                }
            }
        }
        true
    };
    if append(&mut line.words()) || append(&mut columns(line, widths)) || append(&mut before_signs(line)) {
        return Ok(());
    }
    let wrong = line.words().find(|word| real(word).is_none()).unwrap_or(line.text);
    Err(line.malformed("a number", &quoted(wrong)))
}

/// Returns the fields of fixed width that are not blank.
fn columns<'a>(line: &Line<'a>, widths: Widths) -> impl Iterator<Item = &'a [u8]> {
    let ends = widths.0.iter().cycle().scan(0, |end, width| {
        *end += width;
        Some((*end - width, *end))
    });
    let (line, length) = (*line, line.text.len());
    ends.take_while(move |(from, _)| *from < length)
        .map(move |(from, to)| line.columns(from, to))
        .filter(|field| !field.is_empty())
}

/// Returns the fields between blanks, divided before every sign that is not the one of an
/// exponent.
fn before_signs<'a>(line: &Line<'a>) -> impl Iterator<Item = &'a [u8]> {
    line.words().flat_map(|word| {
        let sign = |at: &usize| *at > 0 && b"+-".contains(&word[*at]) && !word[at - 1].is_ascii_alphabetic();
        let starts = std::iter::once(0).chain((0..word.len()).filter(sign));
        let ends = (0..word.len()).filter(sign).chain(std::iter::once(word.len()));
        starts.zip(ends).map(|(from, to)| &word[from..to]).collect::<Vec<_>>()
    })
}

/// Returns the number of an integer field in fixed columns, or the field between blanks at
/// `word`. A missing or blank field is zero, as in Fortran.
pub(super) fn integer_at(line: &Line<'_>, from: usize, to: usize) -> i64 {
    std::str::from_utf8(line.columns(from, to)).ok().and_then(|text| text.parse().ok()).unwrap_or(0)
}

/// Returns the whole numbers of a line, between blanks or in columns of ten.
pub(super) fn integers(line: &Line<'_>) -> Result<Vec<i64>, Error> {
    let mut values = Vec::new();
    append_numbers(line, Widths(&[10]), &mut values)?;
    let whole = |value: &f64| {
        let whole = (value.fract() == 0.0 && value.abs() < 9e15).then_some(*value as i64);
        whole.ok_or_else(|| line.malformed("whole numbers", &quoted(line.text)))
    };
    values.iter().map(whole).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(text: &str, widths: &'static [usize]) -> Vec<f64> {
        let mut out = Vec::new();
        append_numbers(&Line { text: text.as_bytes(), number: 1 }, Widths(widths), &mut out).expect("numbers");
        out
    }

    #[test]
    fn numbers_without_blanks_between_them() {
        assert_eq!(numbers("  1.00000e+00 -2.50000e+00", &[13]), [1.0, -2.5]);
        assert_eq!(numbers(" -1.00000E+00-2.50000E+00 3.00000D-01", &[13]), [-1.0, -2.5, 0.3]);
        assert_eq!(numbers("1.234567E+001.234567E+00", &[12]), [1.234567, 1.234567]);
        // double precision over an uneven abscissa
        assert_eq!(
            numbers(" -1.00000e+00-2.123456789012e+00-3.00000e+00 4.123456789012e+00", &[13, 19]),
            [-1.0, -2.123456789012, -3.0, 4.123456789012]
        );
        assert_eq!(integers(&Line { text: b"         1        10", number: 1 }).expect("integers"), [1, 10]);
        assert_eq!(integers(&Line { text: b"12345678901234567890", number: 1 }).map_err(|_| ()), Err(()));
    }
}
