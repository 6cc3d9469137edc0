//! Several runs of one kind beside each other: their curves in one figure, and how far their numbers lie apart.
//!
//! Every run is compared with the first. Rows that stand for the same thing (same varied parameters, mass, joint) are told by the
//! columns that say so. Where both runs have the same abscissae, rows are compared one by one; where they have not, the later
//! run is interpolated linearly to the abscissae of the first, which the table says. A relative difference is one relative to the largest size
//! in that column of the first run, so that a zero of a curve is no infinity.

use crate::file::{ReportError, file_name};
use crate::output::{Outputs, write_dataset};
use crate::stored::{COMPARISON, Stored, StoredError};
use crate::terminal;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use stickslip_study::dataset::{Axis, Column, Dataset, Emphasis, Figure, Panel, Record, Series, Style, Table, Values};
use stickslip_study::{Case, VariedValue, units};

/// Why runs cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// One run alone.
    #[error("a comparison needs two runs: name the folders of both")]
    Single,
    /// Runs of different kinds.
    #[error("{} holds results of the kind `{kind}`, {} of the kind `{other_kind}`; only runs of one kind can be compared", folder.display(), other.display())]
    Kinds {
        /// The folder of the first run.
        folder: PathBuf,
        /// Its kind.
        kind: String,
        /// The folder of the other.
        other: PathBuf,
        /// Its kind.
        other_kind: String,
    },
}

/// The runs in one figure, and tables of their differences: `differences`, and the `peaks` or optima one by one.
///
/// # Errors
/// [`CompareError`]: there is only one, or their kinds differ.
pub fn compare(runs: &[Stored]) -> Result<Dataset, CompareError> {
    let [first, others @ ..] = runs else { return Err(CompareError::Single) };
    if others.is_empty() {
        return Err(CompareError::Single);
    }
    if let Some(other) = others.iter().find(|run| run.dataset.kind != first.dataset.kind) {
        return Err(CompareError::Kinds {
            folder: first.folder.clone(),
            kind: first.dataset.kind.clone(),
            other: other.folder.clone(),
            other_kind: other.dataset.kind.clone(),
        });
    }
    let labels = labels(runs);
    let mut notes = vec![format!(
        "Differences are against {}; relative ones are relative to the largest size in that column there.",
        labels[0]
    )];
    for (run, label) in runs.iter().zip(&labels).filter(|(run, _)| run.dataset.record.interrupted) {
        notes.push(format!("{label}: the run in {} was interrupted.", run.folder.display()));
    }
    let mut differences = Differences::default();
    for (run, label) in others.iter().zip(&labels[1..]) {
        differences.add((first, &labels[0]), (run, label));
    }
    notes.append(&mut differences.notes);
    let titles: BTreeSet<&str> = runs.iter().map(|run| run.dataset.title.as_str()).collect();
    let title =
        if titles.len() == 1 { first.dataset.title.clone() } else { format!("Comparison of {} runs", runs.len()) };
    let figures: Vec<(&str, &Figure)> =
        labels.iter().map(String::as_str).zip(runs.iter().map(|run| &run.dataset.figure)).collect();
    let figure = Figure { title: title.clone(), ..overlay(&figures) };
    let about = runs.iter().zip(&labels).map(|(run, label)| {
        serde_json::json!({
            "folder": run.folder.display().to_string(),
            "label": label,
            "version": run.dataset.record.version,
            "methods": run.dataset.record.methods,
            "interrupted": run.dataset.record.interrupted,
        })
    });
    Ok(Dataset {
        name: name(runs),
        title,
        source: None,
        kind: COMPARISON.to_owned(),
        tables: differences.tables(),
        figure,
        notes,
        failures: Vec::new(),
        record: Record {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            study: serde_json::json!({ "runs": about.collect::<Vec<_>>() }),
            methods: Vec::new(),
            seed: None,
            threads: 1,
            wall_time_s: 0.0,
            points: BTreeMap::new(),
            interrupted: false,
        },
    })
}

/// The same comparison with differences in their units and in percent, and without what is the same in all runs.
#[must_use]
pub fn for_people(comparison: &Dataset) -> Dataset {
    let mut people = comparison.clone();
    for table in &mut people.tables {
        let several = column(table, "run").is_some_and(|column| match &column.values {
            Values::Text(runs) => runs.iter().any(|run| *run != runs[0]),
            _ => false,
        });
        table.columns.retain(|column| several || column.name != "run");
        // a narrow terminal cuts what stands last
        table.columns.sort_by_key(|column| column.name.starts_with(FIRST));
        for column in &mut table.columns {
            if let (Values::Number(values), true) = (&column.values, column.name.ends_with("_change")) {
                column.values = Values::Text(values.iter().map(|value| percent(*value, true)).collect());
            }
        }
        if table.name == DIFFERENCES {
            let same = shown_differences(table);
            if !same.is_empty() {
                people.notes.push(format!("The same in all runs: {}.", same.join(", ")));
            }
        }
    }
    people
}

/// Makes the differences readable; returns what has none.
fn shown_differences(table: &mut Table) -> Vec<String> {
    let words = |name: &str| match column(table, name).map(|column| &column.values) {
        Some(Values::Text(words)) => words.clone(),
        _ => vec![String::new(); table.rows()],
    };
    let numbers = |name: &str| table.numbers(name).map_or_else(|| vec![f64::NAN; table.rows()], <[f64]>::to_vec);
    let (tables, columns, places, ways) = (words("table"), words("column"), words("at"), words("how"));
    let (differences, relative) = (numbers("largest_difference"), numbers("relative"));
    let runs = column(table, "run").map(|_| words("run"));
    let (differ, same): (Vec<usize>, Vec<usize>) = (0..table.rows()).partition(|row| differences[*row] != 0.0);
    let of = |all: &[String]| differ.iter().map(|row| all[*row].clone()).collect::<Vec<_>>();
    let mut made = vec![text("table", of(&tables)), text("column", of(&columns))];
    made.extend(runs.map(|runs| text("run", of(&runs))));
    let shown = differ.iter().map(|row| terminal::quantity(&columns[*row], differences[*row]));
    made.push(text("largest_difference", shown.collect()));
    made.push(text("relative", differ.iter().map(|row| percent(relative[*row], false)).collect()));
    made.push(text("at", of(&places).iter().map(|place| rounded(place)).collect()));
    made.push(text("how", of(&ways)));
    table.columns = made;
    let mut names: Vec<String> = same.iter().map(|row| format!("{} of {}", columns[*row], tables[*row])).collect();
    names.dedup();
    names
}

/// Digits of a place for people; the table has all.
const PLACE_DIGITS: usize = 7;

/// The text with its numbers rounded.
fn rounded(text: &str) -> String {
    let word = |word: &str| match word.trim_end_matches(',').parse::<f64>() {
        Ok(value) => {
            let short: f64 = format!("{value:.*e}", PLACE_DIGITS - 1).parse().unwrap_or(value);
            let comma = if word.ends_with(',') { "," } else { "" };
            format!("{short}{comma}")
        }
        Err(_) => word.to_owned(),
    };
    text.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// A share in percent with three digits.
fn percent(share: f64, signed: bool) -> String {
    let percent = 100.0 * share;
    let decimals = match percent.abs() {
        size if size == 0.0 || size >= 100.0 => 0,
        // a rounding error of the machine is nothing to read digits of
        size => (2 - size.log10().floor() as i32).clamp(0, 9) as usize,
    };
    match signed && percent > 0.0 {
        _ if !percent.is_finite() => "–".to_owned(),
        true => format!("+{percent:.decimals$} %"),
        false => format!("{percent:.decimals$} %"),
    }
}

/// Writes a comparison into `out/NAME/`, which must be free or hold a comparison.
///
/// # Errors
/// In words: the folder holds a run, or a file cannot be written.
pub fn write(comparison: &Dataset, out: &Path, outputs: &Outputs) -> Result<Vec<PathBuf>, ReportError> {
    let folder = out.join(file_name(&comparison.name, "comparison")?);
    match crate::stored::read(&folder) {
        // what cannot be read may be a run all the same
        Err(StoredError::Nothing { .. } | StoredError::Comparison { .. }) => write_dataset(comparison, out, outputs),
        _ => Err(ReportError::Write { path: folder, cause: std::io::Error::other("the results of a run are there") }),
    }
}

/// Names of runs in the name of their comparison; more are counted.
const MOST_NAMES: usize = 2;

/// The names of the folders, joined.
fn name(runs: &[Stored]) -> String {
    let mut names: Vec<String> = runs.iter().take(MOST_NAMES).map(|run| last(&run.folder)).collect();
    if runs.len() > MOST_NAMES {
        names.push(format!("{} more", runs.len() - MOST_NAMES));
    }
    names.join("+")
}

/// The name of a folder.
fn last(folder: &Path) -> String {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    whole.file_name().map_or_else(|| "run".to_owned(), |name| name.to_string_lossy().trim_matches('.').to_owned())
}

// ---------------------------------------------------------------------------------------------------- labels

/// Parameters in a label; runs that differ in more are called by their folders.
const MOST_PARAMETERS: usize = 3;

/// What tells each run apart: parameters, the method and its options, or else the folder.
fn labels(runs: &[Stored]) -> Vec<String> {
    let case = |run: &'_ Stored| run.dataset.record.study["cases"][0].clone();
    let cases: Vec<Value> = runs.iter().map(case).collect();
    let mut parts: Vec<Vec<String>> = vec![Vec::new(); runs.len()];
    let mut keys: BTreeSet<String> = BTreeSet::new();
    let mut varied: BTreeSet<String> = BTreeSet::new();
    for case in &cases {
        keys.extend(case["parameters"].as_object().into_iter().flat_map(|map| map.keys().cloned()));
        varied.extend(case["varied"].as_object().into_iter().flat_map(|map| map.keys().cloned()));
    }
    let reads = |case: &Value, key: &str| case["parameters"][key]["reads"].as_str().map(str::to_owned);
    let differ = |values: &[Option<String>]| values.iter().any(|value| *value != values[0]);
    let mut differing = 0;
    for key in keys.difference(&varied) {
        let values: Vec<Option<String>> = cases.iter().map(|case| reads(case, key)).collect();
        if differ(&values) {
            differing += 1;
            for (parts, value) in parts.iter_mut().zip(values) {
                parts.extend(value.map(|value| format!("{key} = {value}")));
            }
        }
    }
    if differing > MOST_PARAMETERS {
        parts.iter_mut().for_each(Vec::clear);
    }
    // kinds that find their orbits without a method name none
    let methods: Vec<Option<String>> = runs
        .iter()
        .map(|run| {
            let names = run.dataset.record.methods.iter().map(|choice| choice.split(" (").next().unwrap_or(choice));
            let names: BTreeSet<&str> = names.collect();
            (!names.is_empty()).then(|| names.into_iter().collect::<Vec<_>>().join(" and "))
        })
        .collect();
    if differ(&methods) {
        parts.iter_mut().zip(methods).for_each(|(parts, method)| parts.extend(method));
    }
    let options = |case: &Value| case["method"]["options"].as_object().cloned().unwrap_or_default();
    let known: BTreeSet<String> =
        cases.iter().flat_map(|case| options(case).keys().cloned().collect::<Vec<_>>()).collect();
    for key in known {
        let values: Vec<Option<String>> =
            cases.iter().map(|case| options(case).get(&key).map(Value::to_string)).collect();
        if differ(&values) {
            for (parts, value) in parts.iter_mut().zip(values) {
                parts.extend(value.map(|value| format!("{key} = {value}")));
            }
        }
    }
    let labels: Vec<String> = parts.iter().map(|parts| parts.join(", ")).collect();
    let unique = |labels: &[String]| labels.iter().collect::<BTreeSet<_>>().len() == labels.len();
    if unique(&labels) && labels.iter().all(|label| !label.is_empty()) {
        return labels;
    }
    let with = |name: &dyn Fn(&Stored) -> String| -> Vec<String> {
        runs.iter()
            .zip(&labels)
            .map(|(run, label)| if label.is_empty() { name(run) } else { format!("{}: {label}", name(run)) })
            .collect()
    };
    let named = with(&|run| last(&run.folder));
    if unique(&named) {
        return named;
    }
    let pathed = with(&|run| run.folder.display().to_string());
    if unique(&pathed) {
        return pathed;
    }
    pathed.iter().enumerate().map(|(i, label)| format!("{}: {label}", i + 1)).collect()
}

// ---------------------------------------------------------------------------------------------------- figure

/// Line styles of the runs, in turn: a curve that hides another lets it through.
const STYLES: [Style; 3] = [Style::Solid, Style::Dashed, Style::Dotted];
/// Colours of the palette.
const COLOURS: usize = crate::colour::PALETTE.len();

/// Figures in one: panels of the same title and quantities become one.
fn overlay(figures: &[(&str, &Figure)]) -> Figure {
    let key = |panel: &Panel| (panel.title.clone(), panel.x.quantity.clone(), panel.y.quantity.clone());
    let fits =
        |a: &Panel, b: &Panel| a.x.quantity == b.x.quantity && a.y.quantity == b.y.quantity && factors(b, a).is_some();
    let curve = |series: &&Series| series.style != Style::Marks && series.emphasis != Emphasis::Reference;
    let mut names: Vec<&str> = Vec::new();
    for series in figures.iter().flat_map(|(_, figure)| &figure.panels).flat_map(|p| p.series.iter().filter(curve)) {
        if !names.contains(&series.label.as_str()) {
            names.push(&series.label);
        }
    }
    // values of a parameter have a scale of colours instead of names
    let scaled = figures.iter().any(|(_, figure)| figure.varied.is_some()) && names.len() > COLOURS;
    let mut panels: Vec<Panel> = Vec::new();
    for (run, (label, figure)) in figures.iter().enumerate() {
        let known = panels.len();
        let same = |panel: &Panel| panels[..known].iter().position(|p| key(p) == key(panel) && fits(p, panel));
        let found: Vec<Option<usize>> = figure.panels.iter().map(same).collect();
        // titles that all differ name what the runs differ in: panels then go by their order
        let by_order = found.iter().all(Option::is_none)
            && figure.panels.len() == known
            && figure.panels.iter().zip(&panels).all(|(panel, p)| fits(p, panel));
        for (i, panel) in figure.panels.iter().enumerate() {
            let at = if by_order { Some(i) } else { found[i] };
            let at = at.unwrap_or_else(|| {
                panels.push(Panel { series: Vec::new(), ..panel.clone() });
                panels.len() - 1
            });
            let target = &mut panels[at];
            if by_order && !target.title.is_empty() {
                target.title = format!("{} | {}", target.title, panel.title);
            }
            let Some(factors) = factors(panel, target) else { continue };
            if target.x.range != panel.x.range || target.y.range != panel.y.range {
                (target.x.range, target.y.range) = (None, None);
            }
            for series in &panel.series {
                let series = converted(series, factors);
                let is_curve = curve(&&series);
                if series.emphasis == Emphasis::Reference {
                    // the linear structure is the same one, or one more
                    if !target.series.iter().any(|s| (&s.x, &s.y, s.style) == (&series.x, &series.y, series.style)) {
                        let again = target.series.iter().any(|s| s.label == series.label);
                        let label = if again { format!("{}, {label}", series.label) } else { series.label.clone() };
                        target.series.push(Series { label, ..series });
                    }
                    continue;
                }
                let place = names.iter().position(|name| *name == series.label).unwrap_or(0);
                // marks have the colour of the curve that they stand on
                let owner = if is_curve {
                    place
                } else {
                    let same =
                        |s: &&Series| s.style != Style::Marks && s.colour == series.colour && s.value == series.value;
                    let owner = panel.series.iter().find(same).map(|s| s.label.as_str());
                    owner.and_then(|label| names.iter().position(|name| *name == label)).unwrap_or(0)
                };
                let shift = if names.len().is_multiple_of(COLOURS) { COLOURS / 2 } else { names.len() };
                let line = matches!(series.style, Style::Solid | Style::Dashed | Style::Dotted);
                target.series.push(Series {
                    label: match (is_curve, names.len()) {
                        (false, _) => series.label.clone(),
                        (true, 1) => (*label).to_owned(),
                        (true, _) => format!("{}, {label}", series.label),
                    },
                    colour: owner + run * shift,
                    style: if line { STYLES[run % STYLES.len()] } else { series.style },
                    ..series
                });
            }
        }
    }
    if scaled {
        let words = |style: &Style| match style {
            Style::Dashed => "dashed",
            Style::Dotted => "dotted",
            _ => "solid",
        };
        let key: Vec<String> = figures
            .iter()
            .zip(STYLES.iter().cycle())
            .map(|((label, _), style)| format!("{}: {label}", words(style)))
            .collect();
        for panel in &mut panels {
            let title = [panel.title.clone(), key.join(", ")];
            panel.title = title.into_iter().filter(|t| !t.is_empty()).collect::<Vec<_>>().join("; ");
        }
    }
    Figure { panels, sharing: figures[0].1.sharing, varied: figures[0].1.varied.clone(), ..Figure::default() }
}

/// Factors from the units of one panel to those of another; `None` if these measure something else.
fn factors(from: &Panel, to: &Panel) -> Option<(f64, f64)> {
    let of = |from: &Axis, to: &Axis| units::ratio(&from.unit, &to.unit);
    Some((of(&from.x, &to.x)?, of(&from.y, &to.y)?))
}

fn converted(series: &Series, (x, y): (f64, f64)) -> Series {
    let times = |values: &[f64], factor: f64| -> Vec<f64> {
        if factor == 1.0 { values.to_vec() } else { values.iter().map(|value| value * factor).collect() }
    };
    Series { x: times(&series.x, x), y: times(&series.y, y), base: times(&series.base, y), ..series.clone() }
}

// ---------------------------------------------------------------------------------------------------- differences

/// How columns with the values of the first run begin.
const FIRST: &str = "first_";
/// The table of the largest differences.
const DIFFERENCES: &str = "differences";
/// Columns that say how well a number is known, not what it is.
const EVIDENCE: [&str; 3] = ["residual", "energy_gap", "truncation"];
/// Columns of words and counts that tell rows apart.
const KEYS: [&str; 5] = ["mass", "joint", "loop", "index", "stretch"];
/// Tables whose rows are told apart by the drive frequency.
const BY_FREQUENCY: [&str; 5] = ["orbit", "orbits", "multipliers", "loops", "loops_summary"];
/// Tables whose rows are compared one by one in a table of their own: what a designer looks at first.
const ONE_BY_ONE: [&str; 2] = ["peaks", "optimum"];

/// How the rows of a table are to be read.
struct Reading {
    /// Columns that tell rows apart.
    keys: Vec<String>,
    /// The column along which the other ones are curves.
    abscissa: Option<String>,
}

impl Reading {
    fn new(run: &Stored, table: &Table) -> Reading {
        let has = |name: &str| table.columns.iter().any(|column| column.name == name);
        let case = run.study.case(0).ok();
        let names = |values: &[VariedValue]| values.iter().map(|value| value.column().0).collect::<Vec<_>>();
        let varied = case.as_ref().map(|case| names(&case.varied)).unwrap_or_default();
        let last = varied.last().cloned();
        // a value that another run varies stands in a column too
        let fixed = case.as_ref().map(|case| names(&fixed(case))).unwrap_or_default();
        // a branch along a parameter, an optimum: the last parameter is found, not given
        let along = run.dataset.kind == "branch" && !has("frequency_Hz");
        let abscissa = match table.name.as_str() {
            "curve" | "references" => Some("frequency_Hz".to_owned()),
            "orbit" | "loops" | "motion" => Some("time_s".to_owned()),
            "modes" => Some("modal_amplitude_m_sqrt_kg".to_owned()),
            "branch" if !along => Some("frequency_Hz".to_owned()),
            "branch" | "performance" => last.clone(),
            _ => None,
        };
        let found = along || table.name == "optimum";
        let mut given: Vec<String> =
            varied.into_iter().filter(|name| !(found && Some(name) == last.as_ref())).chain(fixed).collect();
        given.sort();
        let frequency = BY_FREQUENCY.contains(&table.name.as_str()).then_some("frequency_Hz");
        let named = KEYS.into_iter().chain(["drive_frequency_Hz"]).chain(frequency).map(str::to_owned);
        let keys = given.into_iter().chain(named).filter(|name| has(name) && Some(name) != abscissa.as_ref()).collect();
        Reading { keys, abscissa: abscissa.filter(|name| has(name)) }
    }

    /// The rows of each group, in the order of the table.
    fn groups(&self, table: &Table) -> Vec<(String, Vec<usize>)> {
        let columns: Vec<&Column> = self.keys.iter().filter_map(|key| column(table, key)).collect();
        let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
        let mut known: BTreeMap<String, usize> = BTreeMap::new();
        for row in 0..table.rows() {
            let key: Vec<String> = columns
                .iter()
                .map(|column| format!("{} = {}", column.name, crate::csv::cell(&column.values, row)))
                .collect();
            let key = key.join(", ");
            let at = *known.entry(key.clone()).or_insert_with(|| {
                groups.push((key, Vec::new()));
                groups.len() - 1
            });
            groups[at].1.push(row);
        }
        groups
    }

    /// The columns to be compared.
    fn values<'t>(&self, table: &'t Table) -> Vec<&'t str> {
        let wanted = |column: &&Column| {
            matches!(column.values, Values::Number(_))
                && !self.keys.contains(&column.name)
                && self.abscissa.as_ref() != Some(&column.name)
                && !EVIDENCE.contains(&column.name.as_str())
        };
        table.columns.iter().filter(wanted).map(|column| column.name.as_str()).collect()
    }
}

fn column<'t>(table: &'t Table, name: &str) -> Option<&'t Column> {
    table.columns.iter().find(|column| column.name == name)
}

/// The parameters of a case that are not varied, each with its column.
fn fixed(case: &Case) -> Vec<VariedValue> {
    let fixed = case.parameters.iter().filter(|(name, _)| case.varied.iter().all(|varied| varied.name != **name));
    fixed
        .map(|(name, (si, dimension))| VariedValue {
            name: name.clone(),
            si: *si,
            dimension: *dimension,
            text: String::new(),
        })
        .collect()
}

/// The table with a column for every parameter that the other run varies and this one does not.
fn completed(run: &Stored, table: &Table, (other, with): (&Stored, &Table)) -> Table {
    let mut table = table.clone();
    let (Ok(case), Ok(varied)) = (run.study.case(0), other.study.case(0).map(|case| case.varied)) else { return table };
    for value in fixed(&case).iter().filter(|value| varied.iter().any(|varied| varied.name == value.name)) {
        let (name, value) = value.column();
        if column(with, &name).is_some() && column(&table, &name).is_none() {
            table.columns.insert(0, number(&name, vec![value; table.rows()]));
        }
    }
    table
}

/// A row of the first run and what it is compared with: two rows of the other run and the share of the second.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Pair {
    first: usize,
    other: (usize, usize, f64),
}

impl Pair {
    fn rows(first: usize, other: usize) -> Pair {
        Pair { first, other: (other, other, 0.0) }
    }

    fn value(&self, column: &str, values: &[f64]) -> f64 {
        let (a, b, share) = self.other;
        if share == 0.0 { values[a] } else { values[a] + share * difference(column, values[a], values[b]) }
    }
}

/// Rows along a curve, cut where its abscissa turns.
fn pieces(x: &[f64], rows: &[usize]) -> Vec<Vec<usize>> {
    let mut pieces: Vec<Vec<usize>> = Vec::new();
    for &row in rows.iter().filter(|row| x[**row].is_finite()) {
        let goes_on = match pieces.last().map(Vec::as_slice) {
            Some([.., a, b]) => (x[*b] - x[*a]) * (x[row] - x[*b]) > 0.0,
            Some([b]) => x[row] != x[*b],
            _ => false,
        };
        match pieces.last_mut().filter(|_| goes_on) {
            Some(piece) => piece.push(row),
            None => pieces.push(vec![row]),
        }
    }
    pieces
}

/// The other run at the abscissae of the first, where both have any.
fn interpolated(x: (&[f64], &[f64]), first: &[usize], other: &[usize]) -> Vec<Pair> {
    let mut sorted = other.to_vec();
    sorted.sort_by(|a, b| x.1[*a].total_cmp(&x.1[*b]));
    let pair = |row: &usize| {
        let at = x.0[*row];
        let next = sorted.partition_point(|row| x.1[*row] < at);
        let right = *sorted.get(next)?;
        if x.1[right] == at {
            return Some(Pair::rows(*row, right));
        }
        let left = sorted[next.checked_sub(1)?];
        Some(Pair { first: *row, other: (left, right, (at - x.1[left]) / (x.1[right] - x.1[left])) })
    };
    first.iter().filter_map(pair).collect()
}

/// The rows of two groups that stand for the same thing, and whether values are interpolated.
fn pairs(
    tables: (&Table, &Table),
    abscissa: Option<&str>,
    first: &[usize],
    other: &[usize],
) -> Option<(Vec<Pair>, bool)> {
    let both = |name: &str| Some((tables.0.numbers(name)?, tables.1.numbers(name)?));
    let one_by_one = || first.iter().zip(other).map(|(a, b)| Pair::rows(*a, *b)).collect::<Vec<_>>();
    let Some(x) = abscissa.and_then(both) else {
        if first.len() == other.len() {
            return Some((one_by_one(), false));
        }
        // the peak that stands nearest, each once
        let x = both("frequency_Hz")?;
        let mut left = other.to_vec();
        let mut found = Vec::new();
        for row in first {
            let distance = |other: usize| (x.0[*row] - x.1[other]).abs();
            let nearest = (0..left.len()).min_by(|a, b| distance(left[*a]).total_cmp(&distance(left[*b])));
            found.extend(nearest.map(|at| Pair::rows(*row, left.remove(at))));
        }
        return Some((found, false));
    };
    let same =
        first.len() == other.len() && first.iter().zip(other).all(|(a, b)| x.0[*a].to_bits() == x.1[*b].to_bits());
    if same {
        return Some((one_by_one(), false));
    }
    let (a, b) = (pieces(x.0, first), pieces(x.1, other));
    (a.len() == b.len()).then(|| (a.iter().zip(&b).flat_map(|(a, b)| interpolated(x, a, b)).collect(), true))
}

/// The largest difference in a column.
#[derive(Debug, Default)]
struct Largest {
    difference: f64,
    /// Largest size in the first run.
    size: f64,
    at: String,
    values: (f64, f64),
    points: u64,
}

/// The tables of differences, which grow run by run.
#[derive(Debug, Default)]
struct Differences {
    rows: Vec<Row>,
    found: Vec<Table>,
    notes: Vec<String>,
}

#[derive(Debug)]
struct Row {
    table: String,
    column: String,
    run: String,
    how: &'static str,
    largest: Largest,
}

impl Differences {
    fn add(&mut self, (first, label): (&Stored, &str), (other, run): (&Stored, &str)) {
        for table in &first.dataset.tables {
            let Some(with) = other.dataset.tables.iter().find(|t| t.name == table.name) else {
                self.notes.push(format!("{}: {run} has no such table.", table.name));
                continue;
            };
            let completed = (completed(first, table, (other, with)), completed(other, with, (first, table)));
            let (table, with) = (&completed.0, &completed.1);
            let (reading, reading_with) = (Reading::new(first, table), Reading::new(other, with));
            if reading.keys != reading_with.keys || reading.abscissa != reading_with.abscissa {
                let words = |reading: &Reading| {
                    let keys: Vec<&str> = reading.keys.iter().chain(&reading.abscissa).map(String::as_str).collect();
                    if keys.is_empty() { "nothing".to_owned() } else { keys.join(", ") }
                };
                self.notes.push(format!(
                    "{}: not compared, its rows are told apart by {} in {label}, by {} in {run}.",
                    table.name,
                    words(&reading),
                    words(&reading_with)
                ));
                continue;
            }
            self.table((table, with), &reading, run, label);
        }
    }

    fn table(&mut self, tables: (&Table, &Table), reading: &Reading, run: &str, label: &str) {
        let (table, with) = tables;
        let groups = reading.groups(table);
        let others: BTreeMap<String, Vec<usize>> = reading.groups(with).into_iter().collect();
        let columns: Vec<&str> =
            reading.values(table).into_iter().filter(|name| with.numbers(name).is_some()).collect();
        let mut largest: Vec<Largest> = columns.iter().map(|_| Largest::default()).collect();
        let (mut interpolates, mut exact, mut common) = (false, false, 0);
        let mut one_by_one: Vec<Pair> = Vec::new();
        for (key, rows) in &groups {
            let Some(rows_with) = others.get(key) else { continue };
            common += 1;
            let (rows, rows_with) = (inside(table, rows), inside(with, rows_with));
            if reading.abscissa.is_none() && rows.len() != rows_with.len() {
                let place = if key.is_empty() { String::new() } else { format!(" at {key}") };
                self.notes.push(format!(
                    "{}: {} rows{place} in {label}, {} in {run}.",
                    table.name,
                    rows.len(),
                    rows_with.len()
                ));
            }
            let Some((pairs, interpolated)) = pairs(tables, reading.abscissa.as_deref(), &rows, &rows_with) else {
                let place = if key.is_empty() { String::new() } else { format!(" at {key}") };
                self.notes.push(format!("{}: not compared{place}, the curves turn differently often.", table.name));
                continue;
            };
            interpolates |= interpolated && !pairs.is_empty();
            exact |= !interpolated && !pairs.is_empty();
            for (name, largest) in columns.iter().zip(&mut largest) {
                let (Some(a), Some(b)) = (table.numbers(name), with.numbers(name)) else { continue };
                for pair in &pairs {
                    largest.look(name, (a[pair.first], pair.value(name, b)), &|| {
                        let x = reading.abscissa.as_deref().and_then(|name| column(table, name));
                        let x = x.map(|x| format!("{} = {}", x.name, crate::csv::cell(&x.values, pair.first)));
                        [Some(key.clone()), x]
                            .into_iter()
                            .flatten()
                            .filter(|t| !t.is_empty())
                            .collect::<Vec<_>>()
                            .join(", ")
                    });
                }
            }
            one_by_one.extend(pairs);
        }
        if common < groups.len().max(others.len()) {
            self.notes.push(format!(
                "{}: {common} of {} cases and places in {label} and {} in {run} are the same, only these are compared.",
                table.name,
                groups.len(),
                others.len()
            ));
        }
        let how = match (interpolates, exact) {
            (true, true) => "partly interpolated",
            (true, false) => "interpolated",
            (false, _) => "row by row",
        };
        if interpolates {
            let x = reading.abscissa.as_deref().unwrap_or_default();
            self.notes.push(format!("{}: {run} is interpolated linearly to {x} of {label}.", table.name));
        }
        if ONE_BY_ONE.contains(&table.name.as_str()) && !one_by_one.is_empty() {
            self.found(tables, reading, &columns, &one_by_one, run);
        }
        for (name, largest) in columns.into_iter().zip(largest).filter(|(_, largest)| largest.points > 0) {
            self.rows.push(Row {
                table: table.name.clone(),
                column: name.to_owned(),
                run: run.to_owned(),
                how,
                largest,
            });
        }
    }

    /// Every peak or optimum beside the one of the first run.
    fn found(
        &mut self,
        (table, with): (&Table, &Table),
        reading: &Reading,
        columns: &[&str],
        pairs: &[Pair],
        run: &str,
    ) {
        let mut made: Vec<Column> = vec![text("run", pairs.iter().map(|_| run.to_owned()).collect())];
        for key in reading.keys.iter().filter_map(|key| column(table, key)) {
            made.push(match &key.values {
                Values::Number(values) => number(&key.name, pairs.iter().map(|p| values[p.first]).collect()),
                values => text(&key.name, pairs.iter().map(|p| crate::csv::cell(values, p.first)).collect()),
            });
        }
        for name in columns {
            let (Some(a), Some(b)) = (table.numbers(name), with.numbers(name)) else { continue };
            let (a, b): (Vec<f64>, Vec<f64>) = pairs.iter().map(|p| (a[p.first], p.value(name, b))).unzip();
            let relative = a.iter().zip(&b).map(|(a, b)| if a == b { 0.0 } else { (b - a) / a.abs() }).collect();
            made.push(number(&format!("{FIRST}{name}"), a));
            made.push(number(name, b));
            made.push(number(&format!("{}_change", stem(name)), relative));
        }
        match self.found.iter_mut().find(|t| t.name == table.name) {
            None => self.found.push(Table { name: table.name.clone(), columns: made }),
            // a run may lack a column that others have
            Some(t) if t.columns.iter().map(|c| &c.name).ne(made.iter().map(|c| &c.name)) => {}
            Some(t) => {
                for (column, more) in t.columns.iter_mut().zip(made) {
                    match (&mut column.values, more.values) {
                        (Values::Number(a), Values::Number(b)) => a.extend(b),
                        (Values::Text(a), Values::Text(b)) => a.extend(b),
                        _ => {}
                    }
                }
            }
        }
    }

    fn tables(self) -> Vec<Table> {
        let rows = &self.rows;
        let words = |name: &str, of: &dyn Fn(&Row) -> String| text(name, rows.iter().map(of).collect());
        let numbers = |name: &str, of: &dyn Fn(&Row) -> f64| number(name, rows.iter().map(of).collect());
        let columns = vec![
            words("table", &|row| row.table.clone()),
            words("column", &|row| row.column.clone()),
            words("run", &|row| row.run.clone()),
            numbers("largest_difference", &|row| row.largest.difference),
            numbers("relative", &|row| row.largest.relative()),
            words("at", &|row| row.largest.at.clone()),
            words("how", &|row| row.how.to_owned()),
            Column {
                name: "points".into(),
                values: Values::Integer(rows.iter().map(|row| row.largest.points).collect()),
            },
            numbers("first_value", &|row| row.largest.values.0),
            numbers("value", &|row| row.largest.values.1),
        ];
        let differences = Table { name: DIFFERENCES.into(), columns };
        self.found.into_iter().chain([differences]).collect()
    }
}

/// How far `b` lies beyond `a` in this column: angles go the short way around the circle.
fn difference(column: &str, a: f64, b: f64) -> f64 {
    let difference = b - a;
    if column.ends_with("_deg") { difference - 360.0 * (difference / 360.0).round() } else { difference }
}

/// The rows of peaks inside the range; all rows of other tables.
fn inside(table: &Table, rows: &[usize]) -> Vec<usize> {
    match column(table, "at_range_end").map(|column| &column.values) {
        Some(Values::Flag(ends)) if table.name == "peaks" => {
            rows.iter().copied().filter(|row| ends[*row] != Some(true)).collect()
        }
        _ => rows.to_vec(),
    }
}

/// The name of a column without its unit.
fn stem(name: &str) -> &str {
    ["_Hz", "_m", "_N"].iter().find_map(|unit| name.strip_suffix(unit)).unwrap_or(name)
}

impl Largest {
    fn look(&mut self, name: &str, (a, b): (f64, f64), at: &dyn Fn() -> String) {
        let difference = difference(name, a, b);
        if !difference.is_finite() {
            return;
        }
        if difference.abs() > self.difference || self.points == 0 {
            (self.difference, self.at, self.values) = (difference.abs(), at(), (a, b));
        }
        self.points += 1;
        self.size = self.size.max(a.abs());
    }

    fn relative(&self) -> f64 {
        if self.difference == 0.0 { 0.0 } else { self.difference / self.size }
    }
}

fn number(name: &str, values: Vec<f64>) -> Column {
    Column { name: name.to_owned(), values: Values::Number(values) }
}

fn text(name: &str, values: Vec<String>) -> Column {
    Column { name: name.to_owned(), values: Values::Text(values) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_cut_where_they_turn() {
        let x = [1.0, 2.0, 3.0, 2.5, 2.0, f64::NAN, 2.5, 2.5];
        let rows: Vec<usize> = (0..x.len()).collect();
        assert_eq!(pieces(&x, &rows), [vec![0, 1, 2], vec![3, 4], vec![6], vec![7]]);
        assert_eq!(pieces(&x, &[]), Vec::<Vec<usize>>::new());
    }

    #[test]
    fn a_straight_line_is_interpolated_exactly_and_never_beyond_its_ends() {
        let (a, b) = ([0.0, 0.25, 1.5, 3.0], [2.0, 1.0, 0.0]);
        let y: Vec<f64> = b.iter().map(|x| 4.0 * x - 1.0).collect();
        let pairs = interpolated((&a, &b), &[0, 1, 2, 3], &[0, 1, 2]);
        let values: Vec<(usize, f64)> = pairs.iter().map(|pair| (pair.first, pair.value("y_m", &y))).collect();
        assert_eq!(values, [(0, -1.0), (1, 0.0), (2, 5.0)]);
    }

    #[test]
    fn angles_go_the_short_way_around() {
        let mut largest = Largest::default();
        largest.look("blade_phase_deg", (179.0, -179.0), &String::new);
        assert_eq!((largest.difference, largest.points), (2.0, 1));
        largest.look("blade_phase_deg", (f64::NAN, 1.0), &String::new);
        assert_eq!(largest.points, 1);
        // between two points of a curve, too
        let half = Pair { first: 0, other: (0, 1, 0.5) };
        assert_eq!(half.value("blade_phase_deg", &[179.0, -179.0]), 180.0);
        assert_eq!(half.value("blade_amplitude_m", &[179.0, -179.0]), 0.0);
    }

    fn figure(title: &str, unit: &str, y: f64) -> Figure {
        let series = vec![
            Series::line("blade", vec![1.0, 2.0], vec![y, y], 0),
            Series::marks("peak", vec![2.0], vec![y], 0),
            Series::line("all joints free", vec![1.0, 2.0], vec![7.0, 7.0], 0).reference(),
        ];
        let panel =
            Panel { title: title.into(), x: Axis::new("frequency", "Hz"), y: Axis::new("amplitude", unit), series };
        Figure { panels: vec![panel], ..Figure::default() }
    }

    #[test]
    fn panels_join_in_the_units_of_the_first() {
        let whole = overlay(&[("exact", &figure("", "mm", 2.0)), ("series", &figure("", "µm", 2500.0))]);
        assert_eq!(whole.panels.len(), 1);
        let series = &whole.panels[0].series;
        let lines: Vec<(&str, f64, Style)> = series.iter().map(|s| (s.label.as_str(), s.y[0], s.style)).collect();
        assert_eq!(lines[0], ("exact", 2.0, Style::Solid));
        assert_eq!(lines[3].0, "series");
        assert!((lines[3].1 - 2.5).abs() < 1e-15 && lines[3].2 == Style::Dashed, "{lines:?}");
        // marks have the colour of their curve, which is not that of the other run
        assert_eq!((series[1].colour, series[4].colour), (series[0].colour, series[3].colour));
        assert_ne!(series[0].colour, series[3].colour);
        // titles that name what differs: by order; other quantities: panels of their own
        assert_eq!(
            overlay(&[("a", &figure("1 N", "mm", 2.0)), ("b", &figure("2 N", "mm", 2.0))]).panels[0].title,
            "1 N | 2 N"
        );
        assert_eq!(overlay(&[("a", &figure("", "mm", 2.0)), ("b", &figure("", "N", 2.0))]).panels.len(), 2);
    }

    #[test]
    fn shares_read_as_percent() {
        assert_eq!(percent(0.0012345, true), "+0.123 %");
        assert_eq!(percent(-0.25, true), "-25.0 %");
        assert_eq!(percent(0.0, true), "0 %");
        assert_eq!(percent(3.4e-6, false), "0.000340 %");
        assert_eq!([percent(12.5, false), percent(f64::NAN, false)], ["1250 %".to_owned(), "–".to_owned()]);
        assert_eq!(terminal::quantity("blade1_amplitude_m", 4.987_65e-5), "49.9 µm");
        assert_eq!(terminal::quantity("slip_fraction", 0.038_24), "0.0382");
        assert_eq!(rounded("Ft_N = 6.0, time_s = 0.030387205387205383"), "Ft_N = 6, time_s = 0.03038721");
    }

    #[test]
    fn peaks_of_different_number_go_to_the_nearest() {
        let table = |frequencies: &[f64]| Table {
            name: "peaks".into(),
            columns: vec![
                number("frequency_Hz", frequencies.to_vec()),
                number("amplitude_m", vec![1.0; frequencies.len()]),
            ],
        };
        let (a, b) = (table(&[1.0, 5.0]), table(&[4.9]));
        let (found, interpolated) = pairs((&b, &a), None, &[0], &[0, 1]).unwrap();
        assert_eq!((found, interpolated), (vec![Pair::rows(0, 1)], false));
    }
}
