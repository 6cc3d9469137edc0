//! Decides whether the first line of a list of entries is an entry, or states
//! sizes as in Matrix Market without a banner.
//!
//! ```text
//! 3 3 2
//! 1 1 2.5
//! 3 1 -1.0
//! ```
//! Sizes are integers that no later index exceeds, and the stated number of lines follows them.
//! Reading sizes as an entry would silently change the matrix.

use crate::error::{Error, ErrorKind};
use crate::text::{Line, Lines, integer, quoted};

/// The meaning of the first line.
pub(crate) enum FirstLine<'a> {
    /// An entry, or a line without three integers.
    Entry,
    /// Rows, columns and number of entries.
    Sizes,
    /// An entry, or sizes followed by another number of lines.
    Ambiguous(Line<'a>),
}

impl<'a> FirstLine<'a> {
    /// Classifies the first line of a file of lines with three fields. Comments begin with `%`.
    pub fn classify(bytes: &'a [u8]) -> Self {
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
            // A single line is an entry.
            0 => FirstLine::Entry,
            _ => FirstLine::Ambiguous(first),
        }
    }
}

/// Returns three nonnegative integers, if the line contains exactly these.
pub(crate) fn whole(line: &Line) -> Option<[i64; 3]> {
    let [rows, columns, entries] = line.exactly::<3>("").ok()?.map(|field| integer(field).filter(|value| *value >= 0));
    Some([rows?, columns?, entries?])
}

/// Returns true if a line is a Matrix Market comment, indented or not.
pub(crate) fn is_comment(line: &Line) -> bool {
    line.text.trim_ascii_start().starts_with(b"%")
}

/// Creates the error for a first line that may be sizes or an entry.
pub(crate) fn ambiguous(line: &Line) -> Error {
    Error::new(
        ErrorKind::Malformed,
        line.location(),
        format!(
            "{} is either an entry, or the sizes of a Matrix Market file with a wrong number of entries",
            quoted(line.text)
        ),
        "for sizes, correct the number of entries and add the line `%%MatrixMarket matrix coordinate real general` \
         above; for an entry, write its value with a decimal point",
    )
}
