//! Summary of a dataset for the terminal: small tables, points, notes, failures and file names.

mod peak_table;

use crate::run::stored::COMPARISON;
use peak_table::worst_first;
use serde_json::Value as Json;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use stickslip_study::dataset::{CellValues, Column, Dataset, Table};
use stickslip_study::units;

/// Format of the text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Terminal {
    /// `true` to use colours (ANSI escape sequences).
    pub colour: bool,
    /// Line width in characters. `None` neither wraps sentences nor narrows tables below the
    /// default.
    pub width: Option<usize>,
}

/// Longer tables are not shown; a table with main results is cut to this number of rows.
const ROWS: usize = 20;
/// Names of the tables with main results, in addition to all names that end in `_summary`.
const MAIN_TABLES: [&str; 6] = ["summary", "peaks", "optimum", "turns", "orbits", "differences"];
/// Maximum width of a table in characters.
const WIDTH: usize = 120;
/// Minimum line width in characters.
const NARROWEST: usize = 40;
/// Columns that a wide table loses first. `record.json` and the table's file keep these error
/// measures.
const ERROR_COLUMNS: [&str; 4] = ["residual", "energy_gap", "iterations", "truncation"];
/// Headings and texts longer than this lose their middle in a wide table. All names that
/// Stickslip defines are shorter.
const MAX_NAME_LENGTH: usize = 28;
/// Maximum number of printed failures. Only the number of further failures is printed.
const FAILURES: usize = 5;

impl Terminal {
    /// Returns the text with a final line feed. `files` are the paths of the written files.
    pub fn text(self, dataset: &Dataset, files: &[PathBuf]) -> String {
        // Maximum number of printed notes. Only the number of further notes is printed.
        let most_notes = 8;
        let mut out = String::new();
        for line in self.wrapped(&clean(&dataset.title), "") {
            let _ = writeln!(out, "{}", self.paint("1", &line));
        }
        for line in dataset.source.iter().flat_map(|source| self.wrapped(&clean(source), "")) {
            let _ = writeln!(out, "{}", self.paint("2", &line));
        }
        if dataset.record.interrupted {
            let _ = writeln!(
                out,
                "{}",
                self.paint("33", "interrupted: the results contain only the points finished before the interruption")
            );
        }
        let width = self.width.map_or(WIDTH, |width| width.clamp(NARROWEST, WIDTH));
        for table in &dataset.tables {
            let main = MAIN_TABLES.contains(&table.name.as_str()) || table.name.ends_with("_summary");
            if (1..=ROWS).contains(&table.rows()) || main && table.rows() > 0 {
                let sorted = worst_first(table).filter(|_| table.name == "peaks");
                let written = in_study_units(sorted.as_ref().unwrap_or(table), &dataset.record.study["units"]);
                let _ = write!(out, "\n{}\n{}", clean(&table.name), shown(&table.name, &written, width));
            }
        }
        out.push('\n');
        let points = dataset.record.points.iter().map(|(status, count)| format!("{count} {}", clean(status)));
        let points = points.collect::<Vec<_>>().join(", ");
        let time = duration(dataset.record.wall_time_s);
        // A comparison has no points.
        if dataset.kind != COMPARISON {
            let _ = writeln!(
                out,
                "{}: {} in {time}{}",
                clean(&dataset.name),
                if points.is_empty() { "no points" } else { &points },
                match &dataset.record.methods[..] {
                    [] => String::new(),
                    methods => format!(" by {}", clean(&methods.join("; "))),
                }
            );
        }
        // Warnings were already printed on standard error.
        let notes: Vec<&String> = dataset.notes.iter().filter(|note| !note.starts_with("warning")).collect();
        for note in notes.iter().take(most_notes) {
            for line in self.wrapped(&format!("note: {}", clean(note)), "      ") {
                let _ = writeln!(out, "{line}");
            }
        }
        if let Some(more @ 1..) = notes.len().checked_sub(most_notes) {
            let _ = writeln!(out, "note: {more} more note{}; all are in record.json", plural(more));
        }
        let failures = dataset.failures_by_reason();
        for (failure, _) in failures.iter().take(FAILURES) {
            let text = clean(&failure.to_string());
            for (i, line) in self.wrapped(&text, "  ").iter().enumerate() {
                match line.strip_prefix("failed").filter(|_| i == 0) {
                    Some(rest) => writeln!(out, "{}{rest}", self.paint("31", "failed")),
                    None => writeln!(out, "{line}"),
                }
                .unwrap_or(()); // Writing to a string cannot fail.
            }
        }
        let more: usize = failures.iter().skip(FAILURES).map(|(_, count)| count).sum();
        if more > 0 {
            let _ = writeln!(
                out,
                "{} at {more} more point{}; all are in record.json",
                self.paint("31", "failed"),
                plural(more)
            );
        }
        out.push_str(&file_locations(files));
        out
    }

    /// Returns the location of files: each folder once, then the file names.
    pub fn files(self, files: &[PathBuf]) -> String {
        file_locations(files)
    }

    /// Wraps a text between words to the line width. Lines after the first start with `indent`.
    ///
    /// A word longer than a line has a line alone.
    fn wrapped(self, text: &str, indent: &str) -> Vec<String> {
        let Some(width) = self.width.map(|width| width.max(NARROWEST)) else { return vec![text.to_owned()] };
        let mut lines: Vec<String> = Vec::new();
        for word in text.split_whitespace() {
            match lines.last_mut() {
                Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                    line.push(' ');
                    line.push_str(word);
                }
                Some(_) => lines.push(format!("{indent}{word}")),
                None => lines.push(word.to_owned()),
            }
        }
        lines
    }

    fn paint(self, code: &str, text: &str) -> String {
        if self.colour { format!("\x1b[{code}m{text}\x1b[0m") } else { text.to_owned() }
    }
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

/// Returns the location of files: each folder once, then the file names.
fn file_locations(files: &[PathBuf]) -> String {
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

/// Replaces control characters by spaces, so that a title cannot move the cursor.
fn clean(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

fn duration(seconds: f64) -> String {
    if seconds < 1.0 { format!("{:.0} ms", 1e3 * seconds) } else { format!("{seconds:.1} s") }
}

/// Powers of ten and their SI prefixes, for the units that take a prefix.
const PREFIXES: [(i32, &str); 7] = [(9, "G"), (6, "M"), (3, "k"), (0, ""), (-3, "m"), (-6, "µ"), (-9, "n")];

/// Returns the power of ten and the prefix of a unit for numbers up to `largest`.
fn prefix_of(unit: &str, largest: f64) -> (i32, &'static str) {
    let prefixed = matches!(unit, "m" | "s" | "N" | "J" | "W" | "N/m" | "m/N") && largest > 0.0;
    PREFIXES
        .into_iter()
        .find(|(power, _)| prefixed && largest < 1e12 && largest >= 0.999_999 * 10f64.powi(*power))
        .unwrap_or((0, ""))
}

/// Converts columns of a table to the units that the study uses. `written` maps columns to
/// units.
fn in_study_units<'t>(table: &'t Table, written: &'t Json) -> Vec<ConvertedColumn<'t>> {
    let one = |column: &'t Column| {
        let unit = written[&column.name].as_str();
        let converted = unit.and_then(|unit| {
            let own = column.unit()?;
            let factor = units::ratio(&own, unit)?;
            let values = column.as_numbers()?.iter().map(|value| rounded(value * factor)).collect();
            Some((CellValues::Number(values), unit))
        });
        ConvertedColumn { column, converted }
    };
    table.columns.iter().map(one).collect()
}

/// A column, with converted values if the study uses another unit.
struct ConvertedColumn<'t> {
    column: &'t Column,
    converted: Option<(CellValues, &'t str)>,
}

impl ConvertedColumn<'_> {
    fn values(&self) -> &CellValues {
        self.converted.as_ref().map_or(&self.column.values, |(values, _)| values)
    }
}

/// Rounds to 13 digits, which removes the rounding error of a unit conversion.
fn rounded(value: f64) -> f64 {
    format!("{value:.12e}").parse().unwrap_or(value)
}

/// Formats one value of a column with its unit, rounded.
pub(crate) fn quantity(column: &Column, value: f64) -> String {
    let unit = column.unit().unwrap_or_default();
    let (power, prefix) = prefix_of(&unit, value.abs());
    // Digits of a difference.
    let number = engineering(&[value / 10f64.powi(power)], 3).remove(0);
    format!("{number} {prefix}{}", shown_unit(&unit)).trim_end().to_owned()
}

/// Returns the sign of a unit in texts.
fn shown_unit(unit: &str) -> &str {
    if unit == "deg" { "°" } else { unit }
}

/// Returns heading and formatted cells of a column, whose values may be in another unit.
fn formatted(column: &Column, values: &CellValues, written: Option<&str>) -> (String, Vec<String>) {
    let (quantity, unit) = column.quantity_and_unit();
    let quantity = quantity.replace('_', " ");
    let CellValues::Number(numbers) = values else {
        let cells = (0..values.len()).map(|row| clean(&crate::output::csv::cell(values, row)));
        return (quantity, cells.collect());
    };
    if let Some(unit) = written {
        // Digits of a quantity in the study's unit, as frequencies require.
        return (format!("{quantity} ({unit})"), engineering(numbers, 7));
    }
    let Some(unit) = unit else { return (quantity, engineering(numbers, 5)) };
    let largest = numbers.iter().filter(|v| v.is_finite()).fold(0.0, |m: f64, v| m.max(v.abs()));
    let (power, prefix) = prefix_of(&unit, largest);
    let scaled: Vec<f64> = numbers.iter().map(|v| v / 10f64.powi(power)).collect();
    let significant = if unit == "Hz" { 7 } else { 5 };
    (format!("{quantity} ({prefix}{})", shown_unit(&unit)), engineering(&scaled, significant))
}

/// Formats the numbers of one column with a common number of decimals.
///
/// The largest number has at most `significant` digits, and trailing zeros common to all are
/// dropped. A column with a very large range of values uses exponents.
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

/// A formatted column: heading and cells with a common width.
struct FormattedColumn<'a> {
    name: &'a str,
    heading: String,
    cells: Vec<String>,
    /// `true` aligns right (numbers), `false` aligns left (text).
    right: bool,
    width: usize,
}

/// Formats the first rows of a table with aligned columns, at most `limit` characters wide.
///
/// A last line counts the omitted rows and columns.
fn shown(name: &str, table: &[ConvertedColumn<'_>], limit: usize) -> String {
    let all_rows = table.first().map_or(0, |one| one.values().len());
    let rows = all_rows.min(ROWS);
    let mut columns: Vec<FormattedColumn<'_>> = table
        .iter()
        .map(|one| {
            let (c, unit) = (one.column, one.converted.as_ref().map(|(_, unit)| *unit));
            let (heading, cells) = formatted(c, &head(one.values(), rows), unit);
            let heading = clean(&heading);
            let width = cells.iter().chain([&heading]).map(|text| text.chars().count()).max().unwrap_or(0);
            let right = matches!(c.values, CellValues::Number(_) | CellValues::Integer(_));
            FormattedColumn { name: &c.name, heading, cells, right, width }
        })
        .collect();
    let all = columns.len();
    // A line starts with two spaces, and two spaces separate columns.
    let too_wide = |columns: &[FormattedColumn<'_>]| columns.iter().map(|c| c.width + 2).sum::<usize>() > limit;
    if too_wide(&columns) {
        shorten(&mut columns);
    }
    while columns.len() > 1 && too_wide(&columns) {
        let evidence = ERROR_COLUMNS.iter().find_map(|name| columns.iter().position(|c| c.name == *name));
        columns.remove(evidence.unwrap_or(columns.len() - 1));
    }
    let mut out = String::new();
    for row in 0..=rows {
        let mut line = String::from(" ");
        for FormattedColumn { heading, cells, right, width, .. } in &columns {
            let empty = String::new();
            let cell = if row == 0 { heading } else { cells.get(row - 1).unwrap_or(&empty) };
            let _ = if *right { write!(line, " {cell:>width$} ") } else { write!(line, " {cell:<width$} ") };
        }
        let _ = writeln!(out, "{}", line.trim_end());
    }
    let more = [(all_rows - rows, "row"), (all - columns.len(), "column")];
    let more: Vec<String> =
        more.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} more {what}{}", plural(*n))).collect();
    if !more.is_empty() {
        let _ = writeln!(out, "  … and {} in {}.csv", more.join(", "), clean(name));
    }
    out
}

/// Shortens long headings and cells, unless they would become equal.
fn shorten(columns: &mut [FormattedColumn<'_>]) {
    let headings = abbreviated(columns.iter().map(|column| column.heading.as_str()).collect());
    for (column, heading) in columns.iter_mut().zip(headings) {
        column.heading = heading;
        if !column.right {
            column.cells = abbreviated(column.cells.iter().map(String::as_str).collect());
        }
        let texts = column.cells.iter().chain([&column.heading]);
        column.width = texts.map(|text| text.chars().count()).max().unwrap_or(0);
    }
}

/// Removes the middle of texts longer than [`MAX_NAME_LENGTH`].
///
/// Names differ at their ends, and units are there. All texts stay unchanged if two would
/// become equal.
fn abbreviated(texts: Vec<&str>) -> Vec<String> {
    let short = |text: &str| {
        let all: Vec<char> = text.chars().collect();
        let (Some(over), half) = (all.len().checked_sub(MAX_NAME_LENGTH + 1), MAX_NAME_LENGTH / 2) else {
            return text.to_owned();
        };
        all[..half - 1].iter().chain(&['…']).chain(&all[half + over + 1..]).collect()
    };
    let all: Vec<String> = texts.iter().map(|text| short(text)).collect();
    let distinct = |texts: &mut dyn Iterator<Item = &str>| texts.collect::<BTreeSet<_>>().len();
    let same = distinct(&mut all.iter().map(String::as_str)) == distinct(&mut texts.iter().copied());
    if same { all } else { texts.into_iter().map(str::to_owned).collect() }
}

/// Returns the first `rows` values of a column.
fn head(values: &CellValues, rows: usize) -> CellValues {
    match values {
        CellValues::Number(v) => CellValues::Number(v.iter().take(rows).copied().collect()),
        CellValues::Integer(v) => CellValues::Integer(v.iter().take(rows).copied().collect()),
        CellValues::Text(v) => CellValues::Text(v.iter().take(rows).cloned().collect()),
        CellValues::Flag(v) => CellValues::Flag(v.iter().take(rows).copied().collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn tables_have_engineering_units_and_sensible_digits() {
        let files = [PathBuf::from("results/fig02/loops_summary.csv"), PathBuf::from("results/fig02/figure.svg")];
        let text = Terminal::default().text(&samples::hysteresis(), &files);
        insta::assert_snapshot!(text);
    }

    #[test]
    fn long_names_leave_room_for_the_other_columns() {
        let name = |end: &str| format!("{}_{end}", "the_third_stage_of_the_low_pressure_turbine".repeat(2));
        let mut dataset = samples::response();
        let numbers = |name: String| Column { name, values: CellValues::Number(vec![1.25e-3, 2.5e-3]) };
        let mass = Column { name: "mass".to_owned(), values: CellValues::Text(vec![name("left"), name("right")]) };
        dataset.tables = vec![Table {
            name: "peaks".to_owned(),
            columns: vec![
                mass,
                numbers("frequency_Hz".to_owned()),
                numbers(name("amplitude_m")),
                numbers(name("mean_m")),
            ],
        }];
        for width in [80, 120] {
            let text = Terminal { width: Some(width), ..Terminal::default() }.text(&dataset, &[]);
            let lines: Vec<&str> = text.lines().skip_while(|line| *line != "peaks").skip(1).take(3).collect();
            assert!(lines.iter().all(|line| line.chars().count() <= width), "{text}");
            assert!(lines[0].contains("frequency (Hz)") && lines[0].contains("…amplitude (mm)"), "{text}");
            assert!(lines[1].contains("_left ") && lines[2].contains("_right "), "{text}");
        }
        // Texts that would become equal stay unchanged.
        let texts = [format!("{0}1{0}", "x".repeat(20)), format!("{0}2{0}", "x".repeat(20))];
        assert_eq!(abbreviated(texts.iter().map(String::as_str).collect()), texts);
        let long = "abcdefghijklmnopqrstuvwxyz0123456789 (N/m)";
        let [short] = &abbreviated(vec![long])[..] else { panic!() };
        assert_eq!((short.chars().count(), short.ends_with("456789 (N/m)")), (MAX_NAME_LENGTH, true), "{short}");
        assert_eq!(abbreviated(vec![&long[..MAX_NAME_LENGTH]]), [&long[..MAX_NAME_LENGTH]]);
    }

    #[test]
    fn failures_are_named_then_counted() {
        let same_reason = Terminal::default().text(&samples::hostile(), &[]);
        assert!(
            same_reason.contains(" and 8 more, the last at ") && !same_reason.contains("more points"),
            "{same_reason}"
        );
        let mut dataset = samples::hostile();
        dataset.failures.iter_mut().enumerate().for_each(|(i, failure)| failure.reason += &format!(" ({i})"));
        let text = Terminal::default().text(&dataset, &[]);
        assert_eq!(text.matches("failed at Ft").count(), FAILURES);
        assert!(text.contains("failed at 4 more points") && text.contains("240 converged, 9 not converged"), "{text}");
        assert!(!text.contains('\x1b'));
        assert!(
            Terminal { colour: true, ..Terminal::default() }
                .text(&samples::hostile(), &[])
                .contains("\x1b[31mfailed\x1b[0m")
        );
    }

    #[test]
    fn long_tables_stay_in_their_files() {
        let text = Terminal::default().text(&samples::response(), &[]);
        assert!(!text.contains("iterations") && text.contains("peaks\n"), "{text}");
    }

    fn long(name: &str, rows: usize) -> Dataset {
        let column = |name: &str, unit: f64| Column {
            name: name.into(),
            values: CellValues::Number((0..rows).map(|i| unit * (1.0 + i as f64)).collect()),
        };
        let mut columns = vec![column("frequency_Hz", 1.0), column("amplitude_m", 1e-3)];
        columns.extend(ERROR_COLUMNS.map(|name| column(name, 1e-9)));
        columns.extend((0..6).map(|i| column(&format!("a_rather_long_name_{i}_N"), 1.0)));
        let table = Table { name: name.into(), columns };
        Dataset { tables: vec![table], ..samples::response() }
    }

    #[test]
    fn the_main_table_is_cut_and_says_where_the_rest_is() {
        let text = Terminal::default().text(&long("peaks", 30), &[]);
        let table: Vec<&str> =
            text.lines().skip_while(|l| *l != "peaks").skip(1).take_while(|l| !l.is_empty()).collect();
        assert_eq!(table.len(), 1 + ROWS + 1, "{text}");
        // Error measures are dropped first, then the last columns: 16 + 16 for the first two
        // leave room for three of 26.
        assert!(table[0].contains("amplitude (mm)") && table[0].contains("name 2") && !table[0].contains("name 3"));
        assert!(!table[0].contains("residual") && !table[0].contains("iterations"), "{}", table[0]);
        assert_eq!(*table.last().unwrap(), "  … and 10 more rows, 7 more columns in peaks.csv");
        assert!(table.iter().all(|l| l.chars().count() <= WIDTH));
        assert!(table[20].contains("20"), "{}", table[20]);
        let narrow = Terminal { width: Some(60), ..Terminal::default() }.text(&long("loops_summary", 2), &[]);
        assert!(narrow.contains("in loops_summary.csv") && narrow.lines().all(|l| l.chars().count() <= 60), "{narrow}");
        // Other long tables are not shown.
        assert!(!Terminal::default().text(&long("curve", 30), &[]).contains("amplitude (mm)"));
    }

    /// Speeds and stiffnesses have the units of the study; other columns have a unit that fits
    /// their size.
    #[test]
    fn columns_have_the_units_of_the_study() {
        let one = |name: &str, value: f64| Column::numbers(name, vec![value]);
        let columns =
            vec![one("n_Hz", 50.0), one("kt_N_per_m", 8e3), one("frequency_Hz", 54.0), one("amplitude_m", 2e-3)];
        let tables = vec![Table { name: "peaks".to_owned(), columns }];
        let mut dataset = Dataset { tables, ..samples::response() };
        let units = serde_json::json!({ "n_Hz": "rpm", "kt_N_per_m": "N/mm", "frequency_Hz": "rpm" });
        dataset.record.study = serde_json::json!({ "units": units });
        let lines = |dataset: &Dataset| -> Vec<String> {
            let text = Terminal::default().text(dataset, &[]);
            let table = text.lines().skip_while(|line| *line != "peaks").skip(1).take(2);
            table.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
        };
        assert_eq!(lines(&dataset), ["n (rpm) kt (N/mm) frequency (rpm) amplitude (mm)", "3000 8 3240 2"]);
        // A record without units leaves SI units.
        dataset.record.study = Json::Null;
        assert_eq!(lines(&dataset), ["n (Hz) kt (kN/m) frequency (Hz) amplitude (mm)", "50 8 54 2"]);
    }

    #[test]
    fn many_notes_are_counted() {
        let notes = |count: usize| {
            let notes = (0..count).map(|i| format!("Case {i} sticks.")).collect();
            Terminal::default().text(&Dataset { notes, ..samples::hysteresis() }, &[])
        };
        assert!(notes(8).contains("Case 7") && !notes(8).contains("more note"));
        let text = notes(24);
        assert!(text.contains("Case 7") && !text.contains("Case 8"), "{text}");
        assert!(text.contains("note: 16 more notes; all are in record.json\n"), "{text}");
    }

    #[test]
    fn sentences_break_between_words() {
        let note =
            "The series of 41 of 964 points is shorter than asked for; more harmonics would change them by up to 3 %.";
        let dataset = Dataset { notes: vec![note.into()], tables: vec![], ..samples::hostile() };
        let text = Terminal { width: Some(50), ..Terminal::default() }.text(&dataset, &[]);
        let lines: Vec<&str> = text.lines().collect();
        let at = lines.iter().position(|l| l.starts_with("note: ")).unwrap();
        assert_eq!(lines[at], "note: The series of 41 of 964 points is shorter");
        assert_eq!(lines[at + 1], "      than asked for; more harmonics would change");
        assert_eq!(lines[at + 2], "      them by up to 3 %.");
        assert!(lines.iter().all(|l| l.chars().count() <= 50), "{text}");
        assert!(Terminal::default().text(&dataset, &[]).contains(&format!("note: {note}\n")));
    }

    #[test]
    fn every_unit_of_a_parameter_is_read() {
        for (name, heading) in [
            ("alpha_s_per_m", "alpha (s/m)"),
            ("v_m_per_s", "v (m/s)"),
            ("rate_Hz_per_s", "rate (Hz/s)"),
            ("receptance_m_per_N", "receptance (m/N)"),
            ("phase_deg", "phase (°)"),
            ("n", "n"),
        ] {
            let column = Column::numbers(name, vec![2.0]);
            assert_eq!(formatted(&column, &column.values, None).0, heading);
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
