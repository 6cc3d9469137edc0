//! A dataset for the terminal: what was computed, the small tables, what failed, where the files are.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use stickslip_study::dataset::{Dataset, Table, Values};

/// How the text is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Terminal {
    /// Whether to use colours (ANSI escape sequences).
    pub colour: bool,
    /// Characters in a line, where sentences are broken between words; `None` leaves that to the terminal.
    pub width: Option<usize>,
}

/// Tables longer than this are left to their files.
const ROWS: usize = 24;
/// Tables wider than this, in characters, too.
const WIDTH: usize = 120;
/// Narrower terminals break lines themselves.
const NARROWEST: usize = 20;
/// Failures named one by one; of more than these only the number is told.
const FAILURES: usize = 5;

impl Terminal {
    /// The text, with a final line feed. `files` are the paths that were written; none if nothing was.
    pub fn text(self, dataset: &Dataset, files: &[PathBuf]) -> String {
        let mut out = String::new();
        let _ = writeln!(out, "{}", self.paint("1", &clean(&dataset.title)));
        if let Some(source) = &dataset.source {
            let _ = writeln!(out, "{}", self.paint("2", &clean(source)));
        }
        if dataset.record.interrupted {
            let _ = writeln!(out, "{}", self.paint("33", "interrupted: these are the points finished until then"));
        }
        for table in dataset.tables.iter().filter(|t| (1..=ROWS).contains(&t.rows())) {
            let text = aligned(table);
            if text.lines().all(|line| line.chars().count() <= WIDTH) {
                let _ = write!(out, "\n{}\n{text}", clean(&table.name));
            }
        }
        out.push('\n');
        let points = dataset.record.points.iter().map(|(status, count)| format!("{count} {}", clean(status)));
        let points = points.collect::<Vec<_>>().join(", ");
        let time = duration(dataset.record.wall_time_s);
        let _ = writeln!(
            out,
            "{}: {} in {time}",
            clean(&dataset.name),
            if points.is_empty() { "no points" } else { &points }
        );
        for note in &dataset.notes {
            let _ = writeln!(out, "{}", self.wrapped("note:", &clean(note)));
        }
        for failure in dataset.failures.iter().take(FAILURES) {
            let text = self.wrapped("failed", &format!("at {}: {}", clean(&failure.at), clean(&failure.reason)));
            let _ = writeln!(out, "{}", text.replacen("failed", &self.paint("31", "failed"), 1));
        }
        if let Some(more @ 1..) = dataset.failures.len().checked_sub(FAILURES) {
            let text = self.wrapped("failed", &format!("at {more} more point{}; all are in record.json", plural(more)));
            let _ = writeln!(out, "{}", text.replacen("failed", &self.paint("31", "failed"), 1));
        }
        out.push_str(&places(files));
        out
    }

    /// A word and a text after it, broken between words where a line is full; further lines are indented.
    fn wrapped(self, word: &str, text: &str) -> String {
        let width = self.width.unwrap_or(usize::MAX).max(NARROWEST);
        let (mut out, mut line) = (word.to_owned(), word.chars().count());
        for word in text.split_whitespace() {
            let length = word.chars().count();
            if line.saturating_add(1 + length) > width {
                out.push_str("\n    ");
                line = 4 + length;
            } else {
                out.push(' ');
                line += 1 + length;
            }
            out.push_str(word);
        }
        out
    }

    fn paint(self, code: &str, text: &str) -> String {
        if self.colour { format!("\x1b[{code}m{text}\x1b[0m") } else { text.to_owned() }
    }
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

/// Where the files are: the folder once, then the names.
fn places(files: &[PathBuf]) -> String {
    let mut folders: Vec<(&Path, Vec<String>)> = Vec::new();
    for file in files {
        let folder = file.parent().unwrap_or(Path::new(""));
        let name = file.file_name().map_or(String::new(), |n| n.to_string_lossy().into_owned());
        match folders.iter_mut().find(|(known, _)| *known == folder) {
            Some((_, names)) => names.push(name),
            None => folders.push((folder, vec![name])),
        }
    }
    folders.iter().map(|(folder, names)| format!("{}: {}\n", folder.join("").display(), names.join(", "))).collect()
}

/// Text without control characters: a title cannot move the cursor.
fn clean(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

fn duration(seconds: f64) -> String {
    if seconds < 1.0 { format!("{:.0} ms", 1e3 * seconds) } else { format!("{seconds:.1} s") }
}

/// Units at the end of a column's name, with the prefix chosen for the size of its values.
const UNITS: [(&str, &str); 14] = [
    ("_N_per_m", "N/m"),
    ("_kg_per_s", "kg/s"),
    ("_rad_per_s", "rad/s"),
    ("_m_per_s", "m/s"),
    ("_s_per_m", "s/m"),
    ("_Hz_per_s", "Hz/s"),
    ("_Hz", "Hz"),
    ("_deg", "°"),
    ("_kg", "kg"),
    ("_m", "m"),
    ("_s", "s"),
    ("_N", "N"),
    ("_J", "J"),
    ("_W", "W"),
];

/// Prefixes for the units that take one here.
const PREFIXES: [(i32, &str); 7] = [(9, "G"), (6, "M"), (3, "k"), (0, ""), (-3, "m"), (-6, "µ"), (-9, "n")];

/// Heading and cells of a column for people.
fn column(name: &str, values: &Values) -> (String, Vec<String>) {
    let (quantity, unit) = UNITS
        .iter()
        .find_map(|(end, unit)| Some((name.strip_suffix(end).filter(|rest| !rest.is_empty())?, *unit)))
        .unwrap_or((name, ""));
    let Values::Number(numbers) = values else {
        return (name.replace('_', " "), (0..values.len()).map(|row| clean(&crate::csv::cell(values, row))).collect());
    };
    let largest = numbers.iter().filter(|v| v.is_finite()).fold(0.0, |m: f64, v| m.max(v.abs()));
    let prefixed = matches!(unit, "m" | "s" | "N" | "J" | "W" | "N/m") && largest > 0.0;
    let (power, prefix) = PREFIXES
        .into_iter()
        .find(|(power, _)| prefixed && largest < 1e12 && largest >= 0.999_999 * 10f64.powi(*power))
        .unwrap_or((0, ""));
    let scaled: Vec<f64> = numbers.iter().map(|v| v / 10f64.powi(power)).collect();
    let significant = if unit == "Hz" { 7 } else { 5 };
    let heading = match unit {
        "" => quantity.replace('_', " "),
        unit => format!("{} ({prefix}{unit})", quantity.replace('_', " ")),
    };
    (heading, engineering(&scaled, significant))
}

/// Numbers of one column with the same decimals; the largest has at most `significant` digits, and no zeros stand at the
/// end of all of them. A column that spans too much is written with exponents.
fn engineering(values: &[f64], significant: i32) -> Vec<String> {
    let finite = || values.iter().map(|v| v.abs()).filter(|v| v.is_finite() && *v > 0.0);
    let (largest, smallest) = (finite().fold(0.0, f64::max), finite().fold(f64::INFINITY, f64::min));
    let write = |form: &dyn Fn(f64) -> String| -> Vec<String> {
        values.iter().map(|v| if v.is_nan() { "–".to_owned() } else { form(*v + 0.0) }).collect()
    };
    if largest == 0.0 {
        return write(&|v| format!("{v:.0}"));
    }
    if !(1e-3..1e7).contains(&largest) || smallest < 1e-7 * largest {
        return write(&|v| format!("{v:.3e}"));
    }
    let decimals = (significant - 1 - largest.log10().floor() as i32).max(0) as usize;
    let fewest = (0..decimals).find(|d| {
        values.iter().all(|v| !v.is_finite() || format!("{v:.d$}").parse() == format!("{v:.decimals$}").parse::<f64>())
    });
    let decimals = fewest.unwrap_or(decimals);
    write(&|v| format!("{v:.decimals$}"))
}

/// A table with aligned columns: numbers at the right, words at the left.
fn aligned(table: &Table) -> String {
    let columns: Vec<(String, Vec<String>, bool)> = table
        .columns
        .iter()
        .map(|c| {
            let (heading, cells) = column(&c.name, &c.values);
            (clean(&heading), cells, matches!(c.values, Values::Number(_) | Values::Integer(_)))
        })
        .collect();
    let mut out = String::new();
    for row in 0..=table.rows() {
        let mut line = String::from(" ");
        for (heading, cells, right) in &columns {
            let width = cells.iter().map(|c| c.chars().count()).max().unwrap_or(0).max(heading.chars().count());
            let empty = String::new();
            let cell = if row == 0 { heading } else { cells.get(row - 1).unwrap_or(&empty) };
            let _ = if *right { write!(line, " {cell:>width$} ") } else { write!(line, " {cell:<width$} ") };
        }
        let _ = writeln!(out, "{}", line.trim_end());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn tables_have_engineering_units_and_sensible_digits() {
        let files = [PathBuf::from("results/fig02/loops_summary.csv"), PathBuf::from("results/fig02/figure.svg")];
        let text = Terminal::default().text(&samples::hysteresis(), &files);
        let expected = "\
Hysteresis loops of elastic dry friction
Pust, Pesek, Radolfova (2015), Fig. 2

loops_summary
  kt  amplitude (mm)  dissipation (µJ)  equivalent stiffness (N/m)  equivalent damping (kg/s)
   2             1.0               0.0                           0                    0.00000
   2             1.5               4.0                           5                    0.01320
   2             2.5              12.0                          15                    0.03960
  10             1.0               6.4                           8                    0.02112
  10             1.5              10.4                          13                    0.03432
  10             2.5              18.4                          23                    0.06072

fig02: 6 converged in 125 ms
results/fig02/: loops_summary.csv, figure.svg
";
        assert_eq!(text, expected);
    }

    #[test]
    fn failures_are_named_then_counted() {
        let text = Terminal::default().text(&samples::hostile(), &[]);
        assert_eq!(text.matches("failed at Ft").count(), FAILURES);
        assert!(text.contains("failed at 4 more points") && text.contains("240 converged, 9 not converged"), "{text}");
        assert!(!text.contains('\x1b'));
        assert!(
            Terminal { colour: true, width: None }.text(&samples::hostile(), &[]).contains("\x1b[31mfailed\x1b[0m")
        );
    }

    #[test]
    fn sentences_are_broken_between_words() {
        let mut dataset = samples::hostile();
        dataset.notes = vec!["Many words that do not fit into one line of a narrow terminal.".into()];
        for width in [30, 40, 80] {
            let text = Terminal { colour: false, width: Some(width) }.text(&dataset, &[]);
            let from = text.find("note:").unwrap();
            let sentences = &text[from..];
            assert!(sentences.lines().all(|line| line.chars().count() <= width), "{sentences}");
            let words: Vec<&str> = sentences.split_whitespace().collect();
            assert!(words.join(" ").starts_with(&format!("note: {}", dataset.notes[0])), "{sentences}");
            assert!(words.join(" ").contains(&dataset.failures[0].reason), "{sentences}");
        }
    }

    #[test]
    fn long_tables_stay_in_their_files() {
        let text = Terminal::default().text(&samples::response(), &[]);
        assert!(!text.contains("iterations") && text.contains("peaks\n"), "{text}");
    }

    #[test]
    fn every_unit_of_a_parameter_is_read() {
        for (name, heading) in
            [("alpha_s_per_m", "alpha (s/m)"), ("v_m_per_s", "v (m/s)"), ("rate_Hz_per_s", "rate (Hz/s)"), ("n", "n")]
        {
            assert_eq!(column(name, &Values::Number(vec![2.0])).0, heading);
        }
    }

    #[test]
    fn digits_follow_the_size() {
        assert_eq!(engineering(&[120.95, 121.25, f64::NAN], 7), ["120.95", "121.25", "–"]);
        assert_eq!(engineering(&[4.98213456, 0.1], 5), ["4.9821", "0.1000"]);
        assert_eq!(engineering(&[1e300, 1.0], 5), ["1.000e300", "1.000e0"]);
        assert_eq!(engineering(&[0.0, -0.0], 5), ["0", "0"]);
    }
}
