//! `stickslip inspect` for files of measured data: columns, units, sampling, ranges, and a plot.

use std::fmt::Write;
use std::path::Path;
use stickslip_formats::Error;
use stickslip_formats::data::{self, Column, DataFile};

/// Most columns, notes and skipped parts that are listed.
const LISTED: usize = 60;

/// Most columns that are drawn.
const DRAWN: usize = 3;

/// Size of a plot, characters.
const WIDTH: usize = 64;
const HEIGHT: usize = 6;

/// Tells whether a file that may contain matrices contains data: in text, matrices are recognised
/// first.
pub fn is_no_text(found: &DataFile) -> bool {
    found.format != "delimited-text"
}

/// Describes the columns of a file in `text`. Returns false, and writes nothing, if the file is
/// empty or not accepted.
///
/// # Errors
/// The file has no format of data, or is damaged.
pub fn inspect_data(file: &Path, text: &mut String, accepts: fn(&DataFile) -> bool) -> Result<bool, Error> {
    let found = data::read(file)?;
    if (found.columns.is_empty() && found.skipped.is_empty()) || !accepts(&found) {
        return Ok(false);
    }
    let _ = writeln!(text, "{}\n  {}, {} columns", file.display(), found.format, found.columns.len());
    let width = found.columns.iter().take(LISTED).map(|column| column.name.chars().count()).max().unwrap_or(0);
    for column in found.columns.iter().take(LISTED) {
        let _ = writeln!(text, "  {}", line(column, width));
    }
    more(text, found.columns.len(), "columns");
    for (title, many, list) in
        [("note", "notes", &found.notes), ("not read", "parts that were not read", &found.skipped)]
    {
        for entry in list.iter().take(LISTED) {
            let _ = writeln!(text, "  {title}: {entry}");
        }
        more(text, list.len(), many);
    }
    for column in drawn(&found) {
        let _ = writeln!(text, "\n  {}{}", column.name, unit(column));
        for line in plot(&column.values) {
            let _ = writeln!(text, "  {line}");
        }
    }
    text.push('\n');
    Ok(true)
}

fn more(text: &mut String, count: usize, what: &str) {
    if count > LISTED {
        let _ = writeln!(text, "  … and {} more {what}", count - LISTED);
    }
}

fn unit(column: &Column) -> String {
    if column.unit.is_empty() { String::new() } else { format!(" [{}]", column.unit) }
}

fn line(column: &Column, width: usize) -> String {
    let missing = column.values.iter().filter(|value| !value.is_finite()).count();
    let range = column.range().map_or("no finite value".to_owned(), |(low, high)| format!("{low:.6e} to {high:.6e}"));
    let mut line = format!("{:width$}{}  {} values, {range}", column.name, unit(column), column.values.len());
    if missing > 0 {
        let _ = write!(line, ", {missing} missing");
    }
    if let Some(sampling) = column.sampling() {
        let _ = write!(line, ", steps of {:.6e}", sampling.step);
    }
    if !column.label.is_empty() && column.label != column.name {
        let _ = write!(line, "  ({})", column.label);
    }
    line
}

/// Returns the columns that a plot shows best: those that neither rise nor fall throughout.
fn drawn(file: &DataFile) -> Vec<&Column> {
    let monotonic = |column: &Column| {
        let rising = column.values.windows(2).all(|pair| pair[0] <= pair[1]);
        rising || column.values.windows(2).all(|pair| pair[0] >= pair[1])
    };
    file.columns.iter().filter(|column| column.values.len() > 1 && !monotonic(column)).take(DRAWN).collect()
}

/// Draws values over their number, in characters of 2 x 4 dots. Every column of dots covers
/// the range of its values, so that no peak is missing.
fn plot(values: &[f64]) -> Vec<String> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let (low, high) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
    if low >= high || !(high - low).is_finite() {
        return Vec::new();
    }
    let (across, down) = (2 * WIDTH, 4 * HEIGHT);
    let mut dots = vec![[false; 2 * WIDTH]; down];
    let row = |value: f64| ((high - value) / (high - low) * (down - 1) as f64).round() as usize;
    let mut before: Option<f64> = None;
    for column in 0..across {
        // short records repeat their values
        let from = column * values.len() / across;
        let to = ((column + 1) * values.len() / across).max(from + 1).min(values.len());
        let own = values[from..to].iter().copied().filter(|value| value.is_finite());
        let Some((mut least, mut most)) = own.clone().fold(None, |range: Option<(f64, f64)>, value| {
            Some(range.map_or((value, value), |(low, high)| (low.min(value), high.max(value))))
        }) else {
            before = None;
            continue;
        };
        // the line from the last value
        if let Some(before) = before {
            (least, most) = (least.min(before), most.max(before));
        }
        before = own.clone().next_back();
        dots[row(most)..=row(least)].iter_mut().for_each(|line| line[column] = true);
    }
    // Unicode block "Braille Patterns": bits of the eight dots, column by column
    let bits = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];
    let character = |line: usize, at: usize| {
        let code: u32 = (0..4)
            .flat_map(|r| (0..2).map(move |c| (r, c)))
            .filter(|(r, c)| dots[4 * line + r][2 * at + c])
            .map(|(r, c)| bits[r][c])
            .sum();
        char::from_u32(0x2800 + code).unwrap_or(' ')
    };
    (0..HEIGHT)
        .map(|line| {
            let label = match line {
                0 => format!(" {high:.4e}"),
                _ if line + 1 == HEIGHT => format!(" {low:.4e}"),
                _ => String::new(),
            };
            let dots: String = (0..WIDTH).map(|at| character(line, at)).collect();
            format!("{dots}{label}")
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_shows_every_peak() {
        let mut values = vec![0.0; 10_000];
        values[7777] = 1.0;
        let lines = plot(&values);
        let at = lines[0].chars().position(|dots| dots != '\u{2800}').expect("the peak");
        assert_eq!(at, 7777 * WIDTH / 10_000);
        assert!(lines[0].ends_with(" 1.0000e0") && lines[HEIGHT - 1].ends_with(" 0.0000e0"));
        assert!(plot(&[1.0, 1.0]).is_empty() && plot(&[]).is_empty() && plot(&[f64::NAN; 3]).is_empty());
    }
}
