//! Text tables: numbers in columns, with any separator, decimal point or comma, and titles.
//!
//! The table is the last block of lines with the same number of fields and numbers in the same
//! columns. The line above it has the titles, unless it has another number of fields; a line of
//! units may stand between both. Lines above the titles are a preamble.

use super::column::split_unit;
use super::{Column, DataFile, DataFormat, decoded};
use crate::error::{Error, ErrorKind, Location};
use crate::text::{Line, Lines, quoted, real};
use std::borrow::Cow;
use std::collections::HashMap;

pub(super) const FORMAT: DataFormat = DataFormat {
    name: "delimited-text",
    summary: "CSV and other text: comma, semicolon, tab, bar or blanks; decimal point or comma; units in the titles",
    sniff: |bytes| !bytes.iter().take(4096).any(|byte| *byte == 0),
    read,
};

/// Separators of fields and of decimals.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Dialect {
    /// `None`: blanks.
    separator: Option<u8>,
    decimal_comma: bool,
}

/// A line of the table.
struct Row<'a> {
    line: Line<'a>,
    fields: Vec<Cow<'a, [u8]>>,
}

fn read(bytes: &[u8]) -> Result<DataFile, Error> {
    let mut notes = Vec::new();
    let mut comments: Vec<Line<'_>> = Vec::new();
    let mut lines: Vec<Line<'_>> = Vec::new();
    for line in Lines::new(bytes) {
        match line.text.trim_ascii().first() {
            None => {}
            Some(b'#' | b'%' | b'!') => comments.push(line),
            Some(_) => lines.push(line),
        }
    }
    let dialect = dialect(&lines);
    let mut rows: Vec<Row<'_>> =
        lines.iter().map(|line| Row { line: *line, fields: fields(line.text, dialect) }).collect();
    drop_end_separators(&mut rows);
    drop_short_end(&mut rows, dialect, &mut notes);
    let Some(last) = rows.last() else { return Err(no_numbers()) };
    let width = last.fields.len();
    // a value may be missing in the last rows
    let end = &rows[rows.len().saturating_sub(SAMPLE)..];
    let filled = |at: usize| {
        end.iter()
            .rev()
            .filter(|row| row.fields.len() == width)
            .map(move |row| &row.fields[at])
            .find(|field| !field.is_empty())
    };
    let numeric: Vec<bool> =
        (0..width).map(|at| filled(at).is_some_and(|field| number(field, dialect).is_some())).collect();
    if !numeric.contains(&true) {
        return Err(no_numbers());
    }
    let fits = |row: &Row<'_>| {
        row.fields.len() == width
            && row.fields.iter().zip(&numeric).all(|(field, numeric)| {
                // a missing value has no text
                !numeric || field.is_empty() || number(field, dialect).is_some()
            })
            && row.fields.iter().zip(&numeric).any(|(field, numeric)| *numeric && !field.is_empty())
    };
    let first = rows.iter().rposition(|row| !fits(row)).map_or(0, |row| row + 1);
    if let Some(fault) = interrupted(&rows[..first], &fits, dialect) {
        return Err(fault);
    }
    let above = |back: usize| first.checked_sub(back).map(|at| &rows[at]).filter(|row| row.fields.len() == width);
    let is_text = |row: &&Row<'_>| {
        row.fields.iter().zip(&numeric).all(|(field, numeric)| !numeric || number(field, dialect).is_none())
    };
    let (mut titles, mut units) = (above(1).filter(is_text), None);
    if let (Some(second), Some(third)) = (titles, above(2).filter(is_text))
        && second.fields.iter().all(|field| looks_like_unit(field))
    {
        (titles, units) = (Some(third), Some(second));
    }
    let commented = comments.iter().rev().find(|line| rows.get(first).is_some_and(|row| line.number < row.line.number));
    let from_comment =
        commented.map(|line| fields(strip_comment(line.text), dialect)).filter(|fields| fields.len() == width);
    let preamble = first - usize::from(titles.is_some()) - usize::from(units.is_some());
    notes.extend(rows[..preamble].iter().take(10).map(|row| decoded(row.line.text)));
    let mut columns = Vec::with_capacity(width);
    let mut names: HashMap<String, usize> = HashMap::new();
    for at in 0..width {
        let title = match (titles, &from_comment) {
            (Some(row), _) => decoded(&row.fields[at]),
            (None, Some(fields)) => decoded(&fields[at]),
            (None, None) => String::new(),
        };
        let (name, unit) = split_unit(&title);
        let unit = units.map_or_else(
            || unit.to_owned(),
            |row| decoded(&row.fields[at]).trim_matches(['[', ']', '(', ')']).to_owned(),
        );
        let name = if name.is_empty() { format!("column_{}", at + 1) } else { name.to_owned() };
        // a title that occurs again has a number at its end
        let times = names.entry(name.clone()).or_default();
        *times += 1;
        let name = if *times == 1 { name } else { format!("{name}_{times}") };
        let below = || rows[first..].iter().map(|row| &row.fields[at]);
        let mut texts = below().filter(|field| !field.is_empty() && number(field, dialect).is_none());
        let first_text = if numeric[at] { None } else { texts.next().map(|field| decoded(field)) };
        let values = if first_text.is_none() {
            below().map(|field| number(field, dialect).unwrap_or(f64::NAN)).collect()
        } else {
            let (values, words) = numbered_words(below().map(|field| decoded(field)));
            notes.push(format!(
                "`{name}` contains texts, which are numbered in the order of their first appearance: {}",
                words.join(", ")
            ));
            values
        };
        columns.push(Column { name, unit, label: title, values, first_text });
    }
    Ok(DataFile { columns, notes, ..DataFile::default() })
}

fn no_numbers() -> Error {
    let remedy = "export a table with at least one column of numbers";
    Error::new(ErrorKind::Format, Location::File, "the text has no number in its last line".into(), remedy)
}

/// Number of lines at the end of a file that show its dialect and its numeric columns.
const SAMPLE: usize = 20;

/// Removes the empty last fields of a file whose lines end with a separator.
fn drop_end_separators(rows: &mut [Row<'_>]) {
    // the last line may be short
    let end = &rows[rows.len().saturating_sub(SAMPLE + 1)..rows.len().saturating_sub(1)];
    let is_empty = |row: &Row<'_>| row.fields.len() > 1 && row.fields.last().is_some_and(|field| field.is_empty());
    if !end.is_empty() && end.iter().all(is_empty) {
        rows.iter_mut().filter(|row| is_empty(row)).for_each(|row| {
            row.fields.pop();
        });
    }
}

/// Removes the last line if it has fewer fields than the line before it: the file was truncated.
fn drop_short_end(rows: &mut Vec<Row<'_>>, dialect: Dialect, notes: &mut Vec<String>) {
    let [.., before, last] = &rows[..] else { return };
    let numbers = |row: &Row<'_>| row.fields.iter().filter(|field| number(field, dialect).is_some()).count();
    if numbers(before) > 0 && (last.fields.len() < before.fields.len() || numbers(last) == 0) {
        notes.push(format!(
            "line {} is left out: it has {} of {} fields",
            last.line.number,
            last.fields.len(),
            before.fields.len()
        ));
        rows.pop();
    }
}

/// Returns the error of a table that a wrong line divides: lines that fit stand above it.
fn interrupted(above: &[Row<'_>], fits: &dyn Fn(&Row<'_>) -> bool, dialect: Dialect) -> Option<Error> {
    let wrong = above.last()?;
    let before = above.len().checked_sub(2).map(|at| &above[at])?;
    if !fits(before) {
        return None;
    }
    let line = &wrong.line;
    let field = wrong.fields.iter().find(|field| !field.is_empty() && number(field, dialect).is_none());
    Some(match field {
        Some(field) if wrong.fields.len() == before.fields.len() => line.malformed("a number", &quoted(field)),
        _ => line.malformed(&format!("{} fields", before.fields.len()), &format!("{} fields", wrong.fields.len())),
    })
}

fn strip_comment(text: &[u8]) -> &[u8] {
    let text = text.trim_ascii();
    let start = text.iter().position(|byte| !b"#%!".contains(byte)).unwrap_or(text.len());
    text[start..].trim_ascii()
}

/// Units without brackets that make a line one of units.
const UNITS: [&str; 26] = [
    "s", "ms", "us", "min", "N", "kN", "mN", "m", "mm", "um", "µm", "m/s", "mm/s", "m/s2", "m/s^2", "m/s²", "g", "Hz",
    "rad", "deg", "°", "Pa", "MPa", "V", "%", "-",
];

fn looks_like_unit(field: &[u8]) -> bool {
    let text = decoded(field);
    let bare = text.trim_matches(['[', ']', '(', ')']);
    text.len() > bare.len() || bare.is_empty() || UNITS.contains(&bare)
}

/// Returns the number of every word in the order of its first appearance, and the words.
fn numbered_words(words: impl Iterator<Item = String>) -> (Vec<f64>, Vec<String>) {
    let mut seen: HashMap<String, usize> = HashMap::new();
    let mut list = Vec::new();
    let values = words.map(|word| {
        let next = seen.len() + 1;
        let at = *seen.entry(word.clone()).or_insert(next);
        if at == next && list.len() < 12 {
            list.push(word);
        }
        at as f64
    });
    (values.collect(), list)
}

/// Returns the dialect of the last lines. Titles and preambles say nothing about it.
fn dialect(lines: &[Line<'_>]) -> Dialect {
    let sample = &lines[lines.len().saturating_sub(SAMPLE)..];
    let has = |byte: u8| {
        let with = sample.iter().filter(|line| line.text.contains(&byte)).count();
        // the last line may be short
        with > 0 && with + 1 >= sample.len()
    };
    let separator = [b'\t', b';', b'|'].into_iter().find(|byte| has(*byte));
    match separator {
        Some(separator) => Dialect { separator: Some(separator), decimal_comma: has_decimal_comma(sample, separator) },
        None if has(b',') => {
            // `1,5 2,5` has blanks between numbers with decimal commas
            let blanks = Dialect { separator: None, decimal_comma: true };
            let several = |line: &&Line<'_>| {
                let fields = fields(line.text, blanks);
                fields.len() > 1 && fields.iter().all(|field| number(field, blanks).is_some() && !field.ends_with(b","))
            };
            let comma = Dialect { separator: Some(b','), decimal_comma: false };
            if sample.iter().filter(several).count() + 1 >= sample.len().max(2) { blanks } else { comma }
        }
        None => Dialect { separator: None, decimal_comma: false },
    }
}

fn has_decimal_comma(sample: &[Line<'_>], separator: u8) -> bool {
    let fields = || sample.iter().flat_map(|line| line.text.split(|byte| *byte == separator));
    let comma = |field: &[u8]| field.iter().filter(|byte| **byte == b',').count() == 1 && !field.contains(&b'.');
    fields().any(|field| comma(field) && number(field, Dialect { separator: None, decimal_comma: true }).is_some())
        && !fields().any(|field| {
            field.contains(&b'.') && number(field, Dialect { separator: None, decimal_comma: false }).is_some()
        })
}

/// Divides a line. Quotes protect separators, and are removed.
fn fields(text: &[u8], dialect: Dialect) -> Vec<Cow<'_, [u8]>> {
    let Some(separator) = dialect.separator else {
        let words = text.split(|byte| byte.is_ascii_whitespace()).filter(|word| !word.is_empty());
        return words.map(Cow::Borrowed).collect();
    };
    let mut out = Vec::new();
    let (mut start, mut quoted) = (0, false);
    for (at, byte) in text.iter().enumerate() {
        match byte {
            b'"' => quoted = !quoted,
            byte if *byte == separator && !quoted => {
                out.push(unquoted(&text[start..at]));
                start = at + 1;
            }
            _ => {}
        }
    }
    out.push(unquoted(&text[start..]));
    out
}

fn unquoted(field: &[u8]) -> Cow<'_, [u8]> {
    let field = field.trim_ascii();
    match field.strip_prefix(b"\"").and_then(|field| field.strip_suffix(b"\"")) {
        Some(inside) if inside.contains(&b'"') => Cow::Owned(
            inside
                .iter()
                .scan(false, |skip, byte| {
                    *skip = *byte == b'"' && !*skip;
                    Some((*byte, *skip))
                })
                .filter(|(byte, first)| *byte != b'"' || *first)
                .map(|(byte, _)| byte)
                .collect(),
        ),
        Some(inside) => Cow::Borrowed(inside.trim_ascii()),
        None => Cow::Borrowed(field),
    }
}

fn number(field: &[u8], dialect: Dialect) -> Option<f64> {
    if dialect.decimal_comma && field.contains(&b',') {
        let plain: Vec<u8> = field.iter().map(|byte| if *byte == b',' { b'.' } else { *byte }).collect();
        return real(&plain);
    }
    real(field)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> DataFile {
        read(text.as_bytes()).unwrap_or_else(|error| panic!("{text}: {error}"))
    }

    fn values(file: &DataFile) -> Vec<&[f64]> {
        file.columns.iter().map(|column| &column.values[..]).collect()
    }

    #[test]
    fn separators_and_decimal_commas() {
        for text in [
            "1.5,2\n3,4\n",
            "1.5;2\n3;4\n",
            "1,5;2\n3;4\n",
            "1,5\t2\r\n3\t4\r\n",
            "1,5 2\n3,0 4\n",
            " 1.5   2\n 3 4",
            "1.5|2\n3|4\n",
            "1.5,2,\n3,4,\n",
            "\"1.5\",\"2\"\n\"3\",\"4\"\n",
        ] {
            assert_eq!(values(&table(text)), [[1.5, 3.0], [2.0, 4.0]], "{text}");
        }
    }

    #[test]
    fn titles_units_and_preambles() {
        let file = table("Oscilloscope 7\nRate,1000\n\ntime,force,force\n[s],[N],[kN]\n0,1,2\n0.1,3,4\n");
        let stated: Vec<_> = file.columns.iter().map(|column| (column.name.as_str(), column.unit.as_str())).collect();
        assert_eq!(stated, [("time", "s"), ("force", "N"), ("force_2", "kN")]);
        assert_eq!(file.notes, ["Oscilloscope 7", "Rate,1000"]);
        let file = table("# a title\n# time_s force_N\n0 1\n1 2\n");
        assert_eq!(file.columns[1].name, "force_N");
        // Latin-1
        let file = read(b"Verschiebung [\xb5m];Kraft (N)\n0;1\n1;2\n").expect("a table");
        assert_eq!((file.columns[0].unit.as_str(), file.columns[1].unit.as_str()), ("µm", "N"));
        assert_eq!(table("a\n1\n2\n").columns[0].values, [1.0, 2.0]);
    }

    #[test]
    fn missing_values_texts_and_a_short_end() {
        let file = table("a,b\n1,2\n3,\n4,5\n6,\n");
        assert!(file.columns[1].values[1].is_nan() && file.columns[1].values[3].is_nan());
        let file = table("a,b,c\n1,,x\n2,3,y\n4,5,x\n6,7");
        assert!(file.columns[1].values[0].is_nan());
        assert_eq!(file.columns[2].values, [1.0, 2.0, 1.0]);
        assert!(file.notes.iter().any(|note| note.contains("line 5 is left out")), "{:?}", file.notes);
    }

    #[test]
    fn a_wrong_line_within_the_table_is_refused() {
        for (text, line) in [("a,b\n1,2\n3,x\n4,5\n", 3), ("a,b\n1,2\n3\n4,5\n", 3)] {
            let error = read(text.as_bytes()).expect_err("a wrong line");
            assert_eq!(error.location, Location::Line(line), "{error}");
        }
    }
}
