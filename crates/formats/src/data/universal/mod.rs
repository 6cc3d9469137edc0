//! Universal File Format (UFF): a sequence of numbered datasets between lines with -1.
//!
//! - `function`: dataset 58, functions, as text and binary;
//! - `nodes`: datasets 15, 2411, 2412, nodes and elements;
//! - `nodal_data`: dataset 55, data at nodes;
//! - `description`: datasets 151 and 164, title and units;
//! - `fields`: numbers in columns of fixed width.
//!
//! Other datasets are skipped and listed.
//! Source: SDRC, Universal File Datasets Summary (University of Cincinnati, SDRL).

mod description;
mod fields;
mod function;
mod nodal_data;
mod nodes;

use super::{DataFile, DataFormat, decoded};
use crate::error::{Error, ErrorKind, Location};
use crate::text::{Line, Lines};

pub(super) const FORMAT: DataFormat = DataFormat {
    name: "universal",
    summary: "Universal File Format (.uff, .unv): functions 58 (text, binary), data 55, geometry 15, 2411, 2412",
    sniff,
    read,
};

/// A dataset in lines, without the lines of its delimiters and its number.
pub(super) struct TextSet<'a> {
    /// Position in the file, from 1; columns are named after it.
    pub position: usize,
    pub lines: Vec<Line<'a>>,
}

impl<'a> TextSet<'a> {
    /// Returns a line of the dataset; `what` describes its content in the error.
    pub fn line(&self, index: usize, what: &str) -> Result<Line<'a>, Error> {
        self.lines.get(index).copied().ok_or_else(|| {
            let location = self.lines.last().map_or(Location::File, Line::location);
            Error::new(
                ErrorKind::Truncated,
                location,
                format!("the dataset ends before {what}"),
                "the file is not complete; export or copy it again",
            )
        })
    }
}

/// A reader of one kind of dataset, which adds its columns and notes to the file.
type SetReader = fn(&TextSet<'_>, &mut DataFile) -> Result<(), Error>;

/// The datasets of lines that are read.
const SETS: [(u32, SetReader); 7] = [
    (15, nodes::read_single),
    (2411, nodes::read_double),
    (2412, nodes::read_elements),
    (55, nodal_data::read),
    (151, description::read_title),
    (164, description::read_units),
    (58, function::read_text),
];

fn is_delimiter(line: &Line<'_>) -> bool {
    line.text.trim_ascii() == b"-1"
}

/// Returns the number of a dataset and the rest of the line, from the line after its delimiter.
fn set_number<'a>(line: &Line<'a>) -> Option<(u32, &'a [u8])> {
    let text = line.text.trim_ascii_start();
    let digits = text.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let number = std::str::from_utf8(&text[..digits]).ok()?.parse().ok()?;
    let rest = &text[digits..];
    rest.first()
        .is_none_or(|byte| byte.is_ascii_whitespace() || byte.eq_ignore_ascii_case(&b'b'))
        .then_some((number, rest))
}

fn sniff(bytes: &[u8]) -> bool {
    let mut lines = Lines::new(&bytes[..bytes.len().min(1000)]).filter(|line| !line.text.trim_ascii().is_empty());
    lines.next().is_some_and(|line| is_delimiter(&line)) && lines.next().is_some_and(|line| set_number(&line).is_some())
}

fn read(bytes: &[u8]) -> Result<DataFile, Error> {
    let mut file = DataFile::default();
    let mut lines = Lines::new(bytes);
    let mut position = 0;
    // anything between datasets is ignored, as programs write blank lines there
    while let Some(line) = lines.next() {
        if !is_delimiter(&line) {
            continue;
        }
        let Some(head) = lines.next() else { break };
        // two delimiters follow each other after a repaired file
        let Some((number, rest)) = set_number(&head) else { continue };
        position += 1;
        if number == 58 && rest.first().is_some_and(|byte| byte.eq_ignore_ascii_case(&b'b')) {
            function::read_binary(position, &head, &mut lines, &mut file)?;
            continue;
        }
        let mut set = TextSet { position, lines: Vec::new() };
        let mut closed = false;
        for line in lines.by_ref() {
            if is_delimiter(&line) {
                closed = true;
                break;
            }
            set.lines.push(line);
        }
        if !closed {
            file.notes.push(format!("dataset {number} at line {} has no delimiter at its end", head.number));
        }
        match SETS.iter().find(|(known, _)| *known == number) {
            Some((_, read)) => read(&set, &mut file)?,
            None => file.skipped.push(format!("dataset {number} at line {}", head.number)),
        }
    }
    Ok(file)
}

/// Returns text of a line without blanks at its ends: UTF-8, or Latin-1 if it is not UTF-8.
fn words(line: &Line<'_>) -> String {
    decoded(line.text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_datasets_are_skipped_and_listed() {
        let text = b"    -1\n   151\nmodel\n    -1\n    -1\n   999\n1 2 3\n    -1\n    -1\n  2411\n 1 1 1 11\n 1.0D+00 2.0D+00 3.0D+00\n    -1\n";
        let file = read(text).expect("a file");
        assert_eq!(file.skipped, ["dataset 999 at line 6"]);
        assert_eq!(file.column("3.y").expect("a column").values, [2.0]);
        assert!(sniff(text) && !sniff(b"-1 2\n3 4\n") && !sniff(b""));
    }
}
