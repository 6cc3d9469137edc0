//! The results of a study: tables, figures and the record of the run, independent of file
//! formats.
//!
//! The writers in `stickslip-report` use only these.

pub use crate::compile::mesh::MeshSource;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::sync::Arc;

/// Name of the table with the displacements of all nodes of a structure.
pub const FIELDS: &str = "fields";

/// The result of one study.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
pub struct Dataset {
    /// Name of the study: the stem of its file. Also the name of its results folder.
    pub name: String,
    /// Title, for figures and pages.
    pub title: String,
    /// Origin of the study (a paper, a figure), if stated.
    pub source: Option<String>,
    /// Study kind, for example `response`.
    pub kind: String,
    /// Tables in order of importance; each becomes one file.
    pub tables: Vec<Table>,
    /// The figure of the study.
    pub figure: Figure,
    /// Sentences that a reader of the results must know.
    pub notes: Vec<String>,
    /// The points that did not converge.
    pub failures: Vec<Failure>,
    /// The record of the run.
    pub record: Record,
    /// The mesh of the structure, for the table `fields`. It is not stored with results.
    #[serde(skip)]
    pub mesh: Option<Arc<MeshSource>>,
}

impl Dataset {
    /// Returns the failures with consecutive ones of the same reason joined, such as those of all
    /// frequencies at which a body drifts, and the number of failures in each. Reasons may differ
    /// in their numbers; the text has those of the first failure.
    pub fn failures_by_reason(&self) -> Vec<(Failure, usize)> {
        let joined = |same: &[Failure]| {
            let Failure { location, reason } = same[0].clone();
            let location = match (same.len(), &same[same.len() - 1].location) {
                (1, _) => location,
                (_, last) if last.is_empty() => location,
                (2, last) => format!("{location} and {last}"),
                (count, last) => format!("{location} and {} more, the last at {last}", count - 1),
            };
            (Failure { location, reason }, same.len())
        };
        self.failures.chunk_by(|a, b| differ_in_numbers_only(&a.reason, &b.reason)).map(joined).collect()
    }
}

/// Returns true if two texts differ at most in their numbers.
fn differ_in_numbers_only(one: &str, other: &str) -> bool {
    // whole words are left out, because only one of two numbers may have an exponent
    let words = |text: &str| -> String {
        text.split(' ').filter(|word| !word.starts_with(|c: char| c.is_ascii_digit() || c == '-')).collect()
    };
    words(one) == words(other)
}

/// A table: named columns of equal length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// Stem of the file, for example `curve`.
    pub name: String,
    /// The columns, all of the same length.
    pub columns: Vec<Column>,
}

/// One column of a table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Column {
    /// Header, with the SI unit as its last part, for example `blade1_amplitude_m`.
    pub name: String,
    /// The values.
    pub values: CellValues,
}

/// The values of a column. A missing number (of a failed point) is NaN and is written as an
/// empty cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum CellValues {
    /// Real numbers, written with all their digits.
    Number(Vec<f64>),
    /// Counts.
    Integer(Vec<u64>),
    /// Words.
    Text(Vec<String>),
    /// Flags, written as `true` and `false`; `None` (unknown, of a failed point) as an empty
    /// cell.
    Flag(Vec<Option<bool>>),
}

impl CellValues {
    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        match self {
            CellValues::Number(v) => v.len(),
            CellValues::Integer(v) => v.len(),
            CellValues::Text(v) => v.len(),
            CellValues::Flag(v) => v.len(),
        }
    }
    /// Returns true if there is no row.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns cells of the same type without a value, for columns that a case does not have.
    ///
    /// A missing count is zero.
    pub(crate) fn blank(&self, rows: usize) -> CellValues {
        match self {
            CellValues::Number(_) => CellValues::Number(vec![f64::NAN; rows]),
            CellValues::Integer(_) => CellValues::Integer(vec![0; rows]),
            CellValues::Text(_) => CellValues::Text(vec![String::new(); rows]),
            CellValues::Flag(_) => CellValues::Flag(vec![None; rows]),
        }
    }

    /// Appends cells of the same type.
    pub(crate) fn extend(&mut self, more: CellValues) {
        match (self, more) {
            (CellValues::Number(a), CellValues::Number(b)) => a.extend(b),
            (CellValues::Integer(a), CellValues::Integer(b)) => a.extend(b),
            (CellValues::Text(a), CellValues::Text(b)) => a.extend(b),
            (CellValues::Flag(a), CellValues::Flag(b)) => a.extend(b),
            (a, b) => panic!("a column has two sorts of values: {a:?}, {b:?}"),
        }
    }
}

/// Returns the column header for a place: a `.` as in `node.direction` becomes `_`.
pub fn column_name(name: &str) -> Cow<'_, str> {
    if name.contains('.') { Cow::Owned(name.replace('.', "_")) } else { Cow::Borrowed(name) }
}

impl Column {
    /// Returns the unit of the numbers as study files write it, read from the end of the column
    /// name.
    ///
    /// The name `kt_N_per_m` gives `N/m`. `None` for pure numbers and for columns without
    /// numbers.
    ///
    /// # Example
    /// ```
    /// use stickslip_study::dataset::Column;
    /// let unit = |name: &str| Column::numbers(name, Vec::new()).unit();
    /// assert_eq!(unit("blade1_amplitude_m").as_deref(), Some("m"));
    /// assert_eq!(unit("tip_velocity_m_per_s").as_deref(), Some("m/s"));
    /// assert_eq!((unit("slip_fraction"), unit("residual")), (None, None));
    /// assert_eq!(unit("blade_shape_per_sqrt_kg"), None); // study files have no root units
    /// ```
    pub fn unit(&self) -> Option<String> {
        self.quantity_and_unit().1
    }

    /// Returns the name without its unit, and the unit.
    pub fn quantity_and_unit(&self) -> (&str, Option<String>) {
        let name = self.name.as_str();
        if !matches!(self.values, CellValues::Number(_)) || name.contains("_sqrt_") {
            return (name, None);
        }
        let ends = name.match_indices('_').filter(|(at, _)| *at > 0).map(|(at, _)| (&name[..at], &name[at + 1..]));
        let mut units = ends.filter(|(_, end)| !end.starts_with("per_"));
        let found = units.find_map(|(quantity, end)| Some((quantity, Some(parse_unit_suffix(end)?))));
        found.unwrap_or((name, None))
    }

    /// Builds a column of numbers.
    pub fn numbers(name: &str, values: Vec<f64>) -> Column {
        Column { name: name.to_owned(), values: CellValues::Number(values) }
    }

    /// Returns the values if they are numbers.
    pub fn as_numbers(&self) -> Option<&[f64]> {
        match &self.values {
            CellValues::Number(values) => Some(values),
            _ => None,
        }
    }

    /// Builds a column of words.
    pub fn texts(name: &str, values: Vec<String>) -> Column {
        Column { name: name.to_owned(), values: CellValues::Text(values) }
    }
}

/// Parses the unit at the end of a column name; the inverse of
/// [`table_unit`](crate::case::values::table_unit).
fn parse_unit_suffix(end: &str) -> Option<String> {
    let mut unit = String::new();
    for (i, part) in end.replace("_to_minus_", "^-").split("_per_").enumerate() {
        unit += if i > 0 { "/" } else { "" };
        for (j, factor) in part.split('_').enumerate() {
            let letters = factor.trim_end_matches(|c: char| c.is_ascii_digit());
            let power = &factor[letters.len()..];
            let raised = if power.is_empty() || letters.ends_with('-') { "" } else { "^" };
            unit += &format!("{}{letters}{raised}{power}", if j > 0 { " " } else { "" });
        }
    }
    crate::syntax::units::parse(&unit).map(|_| unit)
}

impl Table {
    /// Returns the column with this name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        let name = column_name(name);
        self.columns.iter().find(|column| column.name == name)
    }
    /// Returns the numbers of a column.
    pub fn numbers(&self, column: &str) -> Option<&[f64]> {
        self.column(column)?.as_numbers()
    }
    /// Returns all columns by name, for callers that look up thousands of them.
    pub fn index(&self) -> HashMap<&str, &Column> {
        self.columns.iter().rev().map(|column| (column.name.as_str(), column)).collect()
    }
    /// Returns the counts of a column.
    pub fn integers(&self, column: &str) -> Option<&[u64]> {
        match &self.column(column)?.values {
            CellValues::Integer(values) => Some(values),
            _ => None,
        }
    }
    /// Returns the words of a column.
    pub fn texts(&self, column: &str) -> Option<&[String]> {
        self.column(column).and_then(|c| match &c.values {
            CellValues::Text(v) => Some(v.as_slice()),
            _ => None,
        })
    }
    /// Returns the flags of a column.
    pub fn flags(&self, column: &str) -> Option<&[Option<bool>]> {
        self.column(column).and_then(|c| match &c.values {
            CellValues::Flag(v) => Some(v.as_slice()),
            _ => None,
        })
    }
    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |c| c.values.len())
    }

    /// Returns the columns without rows.
    pub fn header(&self) -> Table {
        let empty = |column: &Column| Column { name: column.name.clone(), values: column.values.blank(0) };
        Table { name: self.name.clone(), columns: self.columns.iter().map(empty).collect() }
    }

    /// Appends the rows of `more`.
    ///
    /// One case may have columns that another case lacks, for example the `return_defect` of a
    /// method that `auto` chooses for some cases. The result has the columns of both tables in
    /// the order of both, and empty cells for the missing values.
    ///
    /// # Panics
    /// If a column has values of two types.
    ///
    /// # Example
    /// ```
    /// use stickslip_study::dataset::{CellValues, Column, Table};
    /// let values = || CellValues::Number(vec![1.0]);
    /// let column = |name: &str| Column { name: name.to_owned(), values: values() };
    /// let mut table = Table { name: "curve".to_owned(), columns: vec![column("a"), column("c")] };
    /// table.append(Table {
    ///     name: "curve".to_owned(),
    ///     columns: vec![column("a"), column("b"), column("c")],
    /// });
    /// let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
    /// assert_eq!((names, table.rows()), (vec!["a", "b", "c"], 2));
    /// assert!(table.numbers("b").unwrap()[0].is_nan());
    /// ```
    pub fn append(&mut self, more: Table) {
        if self.columns.is_empty() {
            self.columns = more.columns;
            return;
        }
        let (rows, new) = (self.rows(), more.rows());
        let mut next = 0;
        for other in more.columns {
            let Some(at) = self.columns[next..].iter().position(|column| column.name == other.name) else {
                let mut values = other.values.blank(rows);
                values.extend(other.values);
                self.columns.insert(next, Column { name: other.name, values });
                next += 1;
                continue;
            };
            self.columns[next + at].values.extend(other.values);
            next += at + 1;
        }
        for column in self.columns.iter_mut().filter(|column| column.values.len() == rows) {
            column.values.extend(column.values.blank(new));
        }
    }
}

/// A figure of one or several panels, in rows.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Figure {
    /// Title above the panels.
    pub title: String,
    /// The panels, in reading order.
    pub panels: Vec<Panel>,
    /// Selects which panels share the range of an axis.
    #[serde(default)]
    pub sharing: Sharing,
    /// The quantity of [`Series::value`]: title and scale of the colour bar, and range of the
    /// colours.
    #[serde(default)]
    pub varied: Option<Axis>,
}

/// Selects whether panels with the same quantity, unit and scale share the range of that axis.
///
/// A panel whose axis differs from the others states this in the title of the axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Sharing {
    /// Panels share the range if each panel still fills a good part of its axis.
    #[default]
    WhereLegible,
    /// All such panels share the range, because they are meant to be compared.
    Always,
    /// No panels share the range; every panel fills its axes.
    Never,
}

/// One pair of axes with its curves.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Panel {
    /// Title of the panel, for example `Ft = 2 N`.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// The curves.
    pub series: Vec<Series>,
    /// True for a picture of a plane: both axes have the same scale and are not drawn.
    #[serde(default)]
    #[serde(rename = "picture")]
    pub equal_axes: bool,
}

/// An axis: its quantity and unit. The values of the series are already in this unit.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Axis {
    /// Quantity, for example `frequency`.
    pub quantity: String,
    /// Unit, for example `Hz`.
    pub unit: String,
    /// Maps values to lengths.
    #[serde(default)]
    pub scale: Scale,
    /// The two ends, the smaller first; without them the data decide. Ends count as absent if
    /// they are equal, not finite, or not positive on a logarithmic axis.
    #[serde(default)]
    pub range: Option<[f64; 2]>,
    /// Labels at 0, 1, 2 … that replace the numbers.
    #[serde(default)]
    pub names: Vec<String>,
    /// True if the values are whole numbers, such as counts or sector numbers: ticks are at
    /// integers only.
    #[serde(default)]
    pub whole: bool,
}

/// The map from values to lengths on an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Scale {
    /// Equal differences have equal lengths.
    #[default]
    Linear,
    /// Equal ratios have equal lengths; values that are not positive interrupt a curve.
    Log,
}

impl Axis {
    /// Returns a linear axis whose range follows from the data.
    pub fn new(quantity: impl Into<String>, unit: impl Into<String>) -> Axis {
        Axis { quantity: quantity.into(), unit: unit.into(), ..Axis::default() }
    }
    /// Makes the axis logarithmic.
    pub fn log(self) -> Axis {
        Axis { scale: Scale::Log, ..self }
    }
    /// Makes the axis one of whole numbers.
    pub fn with_whole_numbers(self) -> Axis {
        Axis { whole: true, ..self }
    }
    /// Fixes the two ends of the axis.
    pub fn with_range(self, from: f64, to: f64) -> Axis {
        Axis { range: Some([from.min(to), from.max(to)]), ..self }
    }
}

/// A curve of a panel. A NaN interrupts it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Series {
    /// Legend entry. Curves with the same label share one entry; a curve without label has no
    /// entry.
    pub label: String,
    /// Abscissae in the unit of the axis.
    pub x: Vec<f64>,
    /// Ordinates in the unit of the axis.
    pub y: Vec<f64>,
    /// The line or mark style.
    pub style: Style,
    /// Index into the palette, shared by curves that belong together. Places count from 0, and
    /// joints continue after the places, so that a figure of both never gives one colour to two
    /// of them.
    pub colour: usize,
    /// The visual weight of the curve.
    #[serde(default)]
    pub emphasis: Emphasis,
    /// The varied parameter, in the unit of [`Figure::varied`].
    ///
    /// A figure with [`Figure::varied`] and more than seven different values gets a sequential
    /// colour scale and a colour bar in place of legend entries; `colour` is then ignored.
    #[serde(default)]
    pub value: Option<f64>,
    /// Lower edge of a band, foot of a bar or lower edge of tiles, in the unit of the axis. If
    /// empty: zero, or the lower end of the axis; a stripe then has the height one.
    #[serde(default)]
    pub base: Vec<f64>,
    /// For a stripe: the value at every point, in the unit of [`Figure::varied`].
    #[serde(default)]
    pub shades: Vec<f64>,
}

impl Series {
    /// Returns a continuous line.
    pub fn line(label: impl Into<String>, x: Vec<f64>, y: Vec<f64>, colour: usize) -> Series {
        Series { label: label.into(), x, y, colour, ..Series::default() }
    }
    /// Returns marks without a line.
    pub fn marks(label: impl Into<String>, x: Vec<f64>, y: Vec<f64>, colour: usize) -> Series {
        Series { style: Style::Marks, ..Series::line(label, x, y, colour) }
    }
    /// Returns triangles at points to doubt.
    pub fn warning(label: impl Into<String>, x: Vec<f64>, y: Vec<f64>, colour: usize) -> Series {
        Series { style: Style::Warning, ..Series::line(label, x, y, colour) }
    }
    /// Returns crosses at abscissae without a value, in row `row` (from 1) above the lower
    /// edge.
    pub fn missing(label: impl Into<String>, x: Vec<f64>, row: usize, colour: usize) -> Series {
        let y = vec![row as f64; x.len()];
        Series { style: Style::Missing, ..Series::line(label, x, y, colour) }
    }
    /// Returns a filled band between two curves over the same abscissae, for example
    /// percentiles.
    pub fn band(label: impl Into<String>, x: Vec<f64>, lower: Vec<f64>, upper: Vec<f64>, colour: usize) -> Series {
        Series { style: Style::Band, base: lower, ..Series::line(label, x, upper, colour) }
    }
    /// Returns bars from zero, for example harmonics.
    pub fn bars(label: impl Into<String>, x: Vec<f64>, y: Vec<f64>, colour: usize) -> Series {
        Series { style: Style::Bars, ..Series::line(label, x, y, colour) }
    }
    /// Returns a stripe at height `y`, coloured along ascending `x` by the scale of
    /// [`Figure::varied`].
    pub fn stripe(x: Vec<f64>, y: f64, shades: Vec<f64>) -> Series {
        let y = vec![y; x.len()];
        Series { style: Style::Stripe, shades, ..Series::line("", x, y, 0) }
    }
    /// Returns tiles between two heights, coloured along ascending `x` by the scale of
    /// [`Figure::varied`]: a row of a heat map.
    pub fn tiles(x: Vec<f64>, [low, high]: [f64; 2], shades: Vec<f64>) -> Series {
        let base = vec![low; x.len()];
        Series { base, ..Series::stripe(x, high, shades) }
    }
    /// Makes the curve pale: one of many in the background of a main curve.
    pub fn pale(self) -> Series {
        Series { emphasis: Emphasis::Pale, ..self }
    }
    /// Makes the curve a reference: dashed, grey, behind all others.
    pub fn reference(self) -> Series {
        Series { emphasis: Emphasis::Reference, ..self }
    }
    /// Makes the curve the reference of one case among several, in the colour of the case.
    pub fn case_reference(self) -> Series {
        Series { emphasis: Emphasis::OwnReference, ..self }
    }
    /// Sets the value of the varied parameter.
    pub fn with_value(self, value: f64) -> Series {
        Series { value: Some(value), ..self }
    }
}

/// The visual weight of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Emphasis {
    /// A result.
    #[default]
    Normal,
    /// One of many curves in the background of a main curve: thin and pale.
    Pale,
    /// A reference for all results (all joints free, all joints stuck): grey and dashed, behind
    /// all others.
    Reference,
    /// A reference for one result among several: in the colour of that result, thin, behind all
    /// others.
    OwnReference,
    /// A contour line of a heat map: thin, in the colour of the background.
    Contour,
}

impl Emphasis {
    /// Returns true if the curve is a reference for results.
    pub fn is_reference(self) -> bool {
        matches!(self, Emphasis::Reference | Emphasis::OwnReference)
    }
}

/// The line or mark style of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Style {
    /// Continuous line.
    #[default]
    Solid,
    /// Dashes.
    Dashed,
    /// Dots.
    Dotted,
    /// Marks without a line (peaks).
    Marks,
    /// Triangles without a line, at points to doubt: unstable, or less exact than requested.
    Warning,
    /// Crosses at the lower edge of the panel, at abscissae without a value (failed points);
    /// `y` is the row of crosses, from 1.
    Missing,
    /// Filled between [`Series::base`] and `y`.
    Band,
    /// A bar at every abscissa, from [`Series::base`] to `y`; several series of bars are drawn
    /// side by side.
    Bars,
    /// A stripe with the colours of [`Series::shades`], around `y` with height one, or from
    /// [`Series::base`] to `y`; several stripes form a map.
    Stripe,
}

impl Style {
    /// Returns true for marks without a line, in any order along x.
    pub fn is_marks(self) -> bool {
        matches!(self, Style::Marks | Style::Warning | Style::Missing)
    }
}

/// A point that did not converge: its position and the reason.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// The point in words, for example `Ft = 2 N, frequency = 121.25 Hz`; empty if the study
    /// has only one point.
    #[serde(rename = "at")]
    pub location: String,
    /// The reason and a suggestion.
    pub reason: String,
}

impl fmt::Display for Failure {
    /// Writes `failed at PLACE: REASON`, or `failed: REASON` if the study has only one point.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.location.as_str() {
            "" => write!(f, "failed: {}", self.reason),
            at => write!(f, "failed at {at}: {}", self.reason),
        }
    }
}

/// The record of a run, which allows repeating it.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Version of Stickslip.
    pub version: String,
    /// The study as understood: all values in SI.
    pub study: serde_json::Value,
    /// The methods that found the orbits, with the reason for an automatic choice; empty for
    /// kinds that use no method.
    pub methods: Vec<String>,
    /// Seed of the random numbers, if any were used.
    pub seed: Option<u64>,
    /// Number of threads.
    pub threads: usize,
    /// Wall time, s.
    pub wall_time_s: f64,
    /// Number of points by status.
    pub points: BTreeMap<String, u64>,
    /// True if the run was interrupted and holds only the points finished until then.
    pub interrupted: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn failure(location: &str, reason: &str) -> Failure {
        Failure { location: location.into(), reason: reason.into() }
    }

    /// Other words, and other failures in between, separate groups.
    #[test]
    fn failures_that_differ_in_numbers_are_joined() {
        let failures = vec![
            failure("1 Hz", "no motion at 1 Hz, residual 1e-3"),
            failure("2 Hz", "no motion at 2.5 Hz, residual 0.1"),
            failure("3 Hz", "no motion at 3 Hz, residual -2.1e+0"),
            failure("4 Hz", "a body drifts at 4 Hz"),
            failure("5 Hz", "no motion at 5 Hz, residual 1"),
        ];
        let without_place = vec![failure("", "no motion at 1 Hz"); 2];
        let joined = &Dataset { failures: without_place, ..Dataset::default() }.failures_by_reason()[0];
        assert_eq!((joined.0.to_string().as_str(), joined.1), ("failed: no motion at 1 Hz", 2));
        let groups = Dataset { failures, ..Dataset::default() }.failures_by_reason();
        let texts: Vec<String> = groups.iter().map(|(group, count)| format!("{count} {group}")).collect();
        assert_eq!(
            texts,
            [
                "3 failed at 1 Hz and 2 more, the last at 3 Hz: no motion at 1 Hz, residual 1e-3",
                "1 failed at 4 Hz: a body drifts at 4 Hz",
                "1 failed at 5 Hz: no motion at 5 Hz, residual 1",
            ]
        );
    }
}
