//! Datasets 151 (title) and 164 (units).

use super::fields::{Widths, append_numbers, integer_at};
use super::{TextSet, words};
use crate::data::DataFile;
use crate::data::decoded;
use crate::error::Error;

/// Reads dataset 151: lines of text.
pub(super) fn read_title(set: &TextSet<'_>, file: &mut DataFile) -> Result<(), Error> {
    let texts = set.lines.iter().map(words).filter(|text| !text.is_empty() && text != "NONE");
    file.notes.extend(texts.take(10));
    Ok(())
}

/// Reads dataset 164: `I10, 20A1, I10`, and factors that convert SI to the units of the file.
pub(super) fn read_units(set: &TextSet<'_>, file: &mut DataFile) -> Result<(), Error> {
    let line = set.line(0, "its units")?;
    let mut factors = Vec::new();
    for line in set.lines.iter().skip(1) {
        append_numbers(line, Widths(&[25]), &mut factors)?;
    }
    let code = integer_at(&line, 0, 10);
    let name = decoded(line.columns(10, 30));
    let factors = match factors[..] {
        [length, force, ..] => format!("; 1 m is {length} and 1 N is {force} in them"),
        _ => String::new(),
    };
    file.notes.push(format!("units: {code} {name}{factors}"));
    Ok(())
}
