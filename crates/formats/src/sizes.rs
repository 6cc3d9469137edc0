//! The first line of a list of entries: is it an entry, or does it state sizes, as in Matrix Market without its banner?
//!
//! ```text
//! 3 3 2
//! 1 1 2.5
//! 3 1 -1.0
//! ```
//! Sizes are whole numbers that no later index exceeds, followed by as many lines as they say. Taken for an entry, such a line would change
//! the matrix without a word.

use crate::error::{Error, Kind};
use crate::text::{Line, Lines, integer, shown};

/// What the first line is.
pub(crate) enum FirstLine<'a> {
    /// An entry, or nothing that has three fields.
    Entry,
    /// Rows, columns and number of entries.
    Sizes,
    /// Sizes with another number of lines behind them, or an entry.
    Unclear(Line<'a>),
}

impl<'a> FirstLine<'a> {
    /// Of a file of lines with three fields, with comments behind `%`.
    pub fn of(bytes: &'a [u8]) -> Self {
        let mut lines = Lines::new(bytes).filter(|line| !line.text.trim_ascii().is_empty() && !is_comment(line));
        let Some((first, [rows, columns, entries])) = lines.next().and_then(|line| Some((line, whole(&line)?))) else {
            return FirstLine::Entry;
        };
        let mut count = 0;
        for line in lines {
            let inside = |field, most| integer(field).is_none_or(|index| (1..=most).contains(&index));
            match line.exactly::<3>("") {
                Ok([row, column, _]) if inside(row, rows) && inside(column, columns) => count += 1,
                _ => return FirstLine::Entry,
            }
        }
        match count {
            _ if count == entries => FirstLine::Sizes,
            // one line alone is an entry
            0 => FirstLine::Entry,
            _ => FirstLine::Unclear(first),
        }
    }
}

/// Three whole numbers, none of them negative.
pub(crate) fn whole(line: &Line) -> Option<[i64; 3]> {
    let [rows, columns, entries] = line.exactly::<3>("").ok()?.map(|field| integer(field).filter(|value| *value >= 0));
    Some([rows?, columns?, entries?])
}

/// Whether a line is a comment of Matrix Market, indented or not.
pub(crate) fn is_comment(line: &Line) -> bool {
    line.text.trim_ascii_start().starts_with(b"%")
}

/// Of a first line that may be sizes or an entry.
pub(crate) fn unclear(line: &Line) -> Error {
    Error::new(
        Kind::Malformed,
        line.location(),
        format!(
            "{} is either an entry or the sizes of a Matrix Market file, whose number of entries is another one",
            shown(line.text)
        ),
        "if it is sizes, correct them and write `%%MatrixMarket matrix coordinate real general` above; \
         if it is an entry, give its value a decimal point",
    )
}
