//! What a study yields: tables, figures and the record of the run, free of any file format.
//!
//! The writers in `stickslip-report` see nothing else.

use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fmt;

/// The result of one study.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
pub struct Dataset {
    /// Name of the study: the stem of its file. Also the name of its folder of results.
    pub name: String,
    /// Title, for figures and pages.
    pub title: String,
    /// Where the study comes from (a paper, a figure), if said.
    pub source: Option<String>,
    /// Study kind, for example `response`.
    pub kind: String,
    /// Tables in the order of importance; each becomes one file.
    pub tables: Vec<Table>,
    /// The figure of the study.
    pub figure: Figure,
    /// Plain sentences that a reader of the results must know.
    pub notes: Vec<String>,
    /// The points that did not converge.
    pub failures: Vec<Failure>,
    /// How the run was made.
    pub record: Record,
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
    pub values: Values,
}

/// The values of a column. A number that does not exist (a failed point) is NaN and is written as an empty cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Values {
    /// Real numbers, written with all their digits.
    Number(Vec<f64>),
    /// Counts.
    Integer(Vec<u64>),
    /// Words.
    Text(Vec<String>),
    /// Written as `true` and `false`; `None` (unknown: a failed point) as an empty cell.
    Flag(Vec<Option<bool>>),
}

impl Values {
    /// Number of rows.
    pub fn len(&self) -> usize {
        match self {
            Values::Number(v) => v.len(),
            Values::Integer(v) => v.len(),
            Values::Text(v) => v.len(),
            Values::Flag(v) => v.len(),
        }
    }
    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Cells of the same sort, without a value: what a case does not have. A count that there is not is zero.
    pub(crate) fn blank(&self, rows: usize) -> Values {
        match self {
            Values::Number(_) => Values::Number(vec![f64::NAN; rows]),
            Values::Integer(_) => Values::Integer(vec![0; rows]),
            Values::Text(_) => Values::Text(vec![String::new(); rows]),
            Values::Flag(_) => Values::Flag(vec![None; rows]),
        }
    }

    /// More cells of the same sort after these.
    pub(crate) fn extend(&mut self, more: Values) {
        match (self, more) {
            (Values::Number(a), Values::Number(b)) => a.extend(b),
            (Values::Integer(a), Values::Integer(b)) => a.extend(b),
            (Values::Text(a), Values::Text(b)) => a.extend(b),
            (Values::Flag(a), Values::Flag(b)) => a.extend(b),
            (a, b) => panic!("a column has two sorts of values: {a:?}, {b:?}"),
        }
    }
}

/// The header of a column that is named after a place: a direction of a node, `node.direction`, is written with `_`.
pub fn column_name(name: &str) -> Cow<'_, str> {
    if name.contains('.') { Cow::Owned(name.replace('.', "_")) } else { Cow::Borrowed(name) }
}

impl Column {
    /// The unit of its numbers as it is written in study files, which the end of its name says: `N/m` of `kt_N_per_m`. `None` for pure
    /// numbers, and for what is no number.
    ///
    /// # Example
    /// ```
    /// use stickslip_study::dataset::Column;
    /// let unit = |name: &str| Column::numbers(name, Vec::new()).unit();
    /// assert_eq!(unit("blade1_amplitude_m").as_deref(), Some("m"));
    /// assert_eq!(unit("tip_velocity_m_per_s").as_deref(), Some("m/s"));
    /// assert_eq!((unit("slip_fraction"), unit("residual")), (None, None));
    /// assert_eq!(unit("blade_shape_per_sqrt_kg"), None); // study files know no roots
    /// ```
    pub fn unit(&self) -> Option<String> {
        if !matches!(self.values, Values::Number(_)) || self.name.contains("_sqrt_") {
            return None;
        }
        let ends = self.name.match_indices('_').map(|(at, _)| &self.name[at + 1..]);
        ends.filter(|end| !end.starts_with("per_")).find_map(written_unit)
    }

    /// Of numbers.
    pub fn numbers(name: &str, values: Vec<f64>) -> Column {
        Column { name: name.to_owned(), values: Values::Number(values) }
    }

    /// Its values, if they are numbers.
    pub fn as_numbers(&self) -> Option<&[f64]> {
        match &self.values {
            Values::Number(values) => Some(values),
            _ => None,
        }
    }

    /// Of words.
    pub fn texts(name: &str, values: Vec<String>) -> Column {
        Column { name: name.to_owned(), values: Values::Text(values) }
    }
}

/// The unit that the end of a column's name says, see [`table_unit`](crate::values::table_unit).
fn written_unit(end: &str) -> Option<String> {
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
    crate::units::parse(&unit).map(|_| unit)
}

impl Table {
    /// The column of this name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        let name = column_name(name);
        self.columns.iter().find(|column| column.name == name)
    }
    /// The numbers of a column.
    pub fn numbers(&self, column: &str) -> Option<&[f64]> {
        self.column(column)?.as_numbers()
    }
    /// Its columns by name, for who asks for thousands of them.
    pub fn index(&self) -> HashMap<&str, &Column> {
        self.columns.iter().rev().map(|column| (column.name.as_str(), column)).collect()
    }
    /// The counts of a column.
    pub fn integers(&self, column: &str) -> Option<&[u64]> {
        match &self.column(column)?.values {
            Values::Integer(values) => Some(values),
            _ => None,
        }
    }
    /// The words of a column.
    pub fn texts(&self, column: &str) -> Option<&[String]> {
        self.column(column).and_then(|c| match &c.values {
            Values::Text(v) => Some(v.as_slice()),
            _ => None,
        })
    }
    /// The flags of a column.
    pub fn flags(&self, column: &str) -> Option<&[Option<bool>]> {
        self.column(column).and_then(|c| match &c.values {
            Values::Flag(v) => Some(v.as_slice()),
            _ => None,
        })
    }
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |c| c.values.len())
    }

    /// The columns without rows.
    pub fn header(&self) -> Table {
        let empty = |column: &Column| Column { name: column.name.clone(), values: column.values.blank(0) };
        Table { name: self.name.clone(), columns: self.columns.iter().map(empty).collect() }
    }

    /// The rows of `more` after these. Cases may have columns that others lack (the `return_defect` of a method that `auto` chooses for some): the table has
    /// those of both, in the order of both, with cells without a value where there was none.
    ///
    /// # Panics
    /// If a column has two sorts of values.
    ///
    /// # Example
    /// ```
    /// use stickslip_study::dataset::{Column, Table, Values};
    /// let column = |name: &str| Column { name: name.to_owned(), values: Values::Number(vec![1.0]) };
    /// let mut table = Table { name: "curve".to_owned(), columns: vec![column("a"), column("c")] };
    /// table.append(Table { name: "curve".to_owned(), columns: vec![column("a"), column("b"), column("c")] });
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

/// A figure of one or several panels, side by side in rows.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Figure {
    /// Title above the panels.
    pub title: String,
    /// The panels, in reading order.
    pub panels: Vec<Panel>,
    /// Whether panels of the same quantity and unit have the same axes.
    #[serde(default)]
    pub sharing: Sharing,
    /// What [`Series::value`] means, for the title and the scale of the colour bar; its range is that of the colours.
    #[serde(default)]
    pub varied: Option<Axis>,
}

/// Whether panels that show the same quantity in the same unit and scale share the range of that axis.
///
/// A panel whose axis differs from that of such a panel says so in the title of the axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Sharing {
    /// Where each panel still fills a good part of its axis.
    #[default]
    WhereLegible,
    /// All of them: the panels are there to be compared.
    Always,
    /// None: every panel fills its own axes.
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
    /// Whether it is a picture of a plane: both axes have one measure, and are not drawn.
    #[serde(default)]
    pub picture: bool,
}

/// An axis: what it shows and in which unit. The values of the series are already in this unit.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Axis {
    /// Quantity, for example `frequency`.
    pub quantity: String,
    /// Unit, for example `Hz`.
    pub unit: String,
    /// How values become lengths.
    #[serde(default)]
    pub scale: Scale,
    /// Its two ends, the smaller first; without them the data decide. Ends that are equal, not finite, or not positive
    /// on a logarithmic axis count as absent.
    #[serde(default)]
    pub range: Option<[f64; 2]>,
    /// What stands at 0, 1, 2 … instead of numbers.
    #[serde(default)]
    pub names: Vec<String>,
    /// Whether the values are whole numbers, as counts and the numbers of sectors are: no tick stands between two of them.
    #[serde(default)]
    pub whole: bool,
}

/// How the values of an axis become lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Scale {
    /// Equal differences are equal lengths.
    #[default]
    Linear,
    /// Equal ratios are equal lengths; values that are not positive interrupt a curve.
    Log,
}

impl Axis {
    /// A linear axis whose range follows from the data.
    pub fn new(quantity: impl Into<String>, unit: impl Into<String>) -> Axis {
        Axis { quantity: quantity.into(), unit: unit.into(), ..Axis::default() }
    }
    /// The same axis, logarithmic.
    pub fn log(self) -> Axis {
        Axis { scale: Scale::Log, ..self }
    }
    /// The same axis, of whole numbers.
    pub fn whole(self) -> Axis {
        Axis { whole: true, ..self }
    }
    /// The same axis between two fixed ends.
    pub fn between(self, from: f64, to: f64) -> Axis {
        Axis { range: Some([from.min(to), from.max(to)]), ..self }
    }
}

/// A curve of a panel. A point with a NaN interrupts it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Series {
    /// Legend; curves with the same label share one legend entry, a curve without label has none.
    pub label: String,
    /// Abscissae in the axis' unit.
    pub x: Vec<f64>,
    /// Ordinates in the axis' unit.
    pub y: Vec<f64>,
    /// How it is drawn.
    pub style: Style,
    /// Index into the palette; curves that belong together share it. Motions count from 0, joints go on where the
    /// motions end, so that a figure of both never gives two of them one colour.
    pub colour: usize,
    /// How much it stands out.
    #[serde(default)]
    pub emphasis: Emphasis,
    /// The varied parameter, in the unit of [`Figure::varied`]. More than seven different values in a figure that says
    /// what they are get a sequential scale of colours and a colour bar instead of legend entries; `colour` does not
    /// count then.
    #[serde(default)]
    pub value: Option<f64>,
    /// Lower edge of a band, foot of a bar, in the axis' unit; empty: zero, or the lower end of the axis.
    #[serde(default)]
    pub base: Vec<f64>,
    /// Of a stripe the value of every point, in the unit of [`Figure::varied`].
    #[serde(default)]
    pub shades: Vec<f64>,
}

impl Series {
    /// A continuous line.
    pub fn line(label: impl Into<String>, x: Vec<f64>, y: Vec<f64>, colour: usize) -> Series {
        Series { label: label.into(), x, y, colour, ..Series::default() }
    }
    /// Marks without a line.
    pub fn marks(label: impl Into<String>, x: Vec<f64>, y: Vec<f64>, colour: usize) -> Series {
        Series { style: Style::Marks, ..Series::line(label, x, y, colour) }
    }
    /// Crosses at abscissae without a value, in a row above the lower edge, from 1.
    pub fn missing(label: impl Into<String>, x: Vec<f64>, row: usize, colour: usize) -> Series {
        let y = vec![row as f64; x.len()];
        Series { style: Style::Missing, ..Series::line(label, x, y, colour) }
    }
    /// A filled band between two curves over the same abscissae, for example percentiles.
    pub fn band(label: impl Into<String>, x: Vec<f64>, lower: Vec<f64>, upper: Vec<f64>, colour: usize) -> Series {
        Series { style: Style::Band, base: lower, ..Series::line(label, x, upper, colour) }
    }
    /// Bars from zero, for example harmonics.
    pub fn bars(label: impl Into<String>, x: Vec<f64>, y: Vec<f64>, colour: usize) -> Series {
        Series { style: Style::Bars, ..Series::line(label, x, y, colour) }
    }
    /// A stripe at the height `y`, coloured along `x`, which rises, by the scale of [`Figure::varied`].
    pub fn stripe(x: Vec<f64>, y: f64, shades: Vec<f64>) -> Series {
        let y = vec![y; x.len()];
        Series { style: Style::Stripe, shades, ..Series::line("", x, y, 0) }
    }
    /// The same curve, pale: one of many behind the one that matters.
    pub fn pale(self) -> Series {
        Series { emphasis: Emphasis::Pale, ..self }
    }
    /// The same curve as a reference: dashed, grey, behind all others.
    pub fn reference(self) -> Series {
        Series { emphasis: Emphasis::Reference, ..self }
    }
    /// The same curve as a reference of one case among others, in its colour.
    pub fn reference_of_its_own(self) -> Series {
        Series { emphasis: Emphasis::OwnReference, ..self }
    }
    /// The same curve, of this value of the varied parameter.
    pub fn of(self, value: f64) -> Series {
        Series { value: Some(value), ..self }
    }
}

/// How much a curve stands out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Emphasis {
    /// A result.
    #[default]
    Normal,
    /// One of many behind the one that matters: thin and pale.
    Pale,
    /// What a result is compared with (all joints free, all joints stuck): grey and dashed, behind all others.
    Reference,
    /// What one result among several is compared with: in its colour, thin, behind all others.
    OwnReference,
}

impl Emphasis {
    /// Whether the curve is what results are compared with.
    pub fn is_reference(self) -> bool {
        matches!(self, Emphasis::Reference | Emphasis::OwnReference)
    }
}

/// How a curve is drawn.
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
    /// Crosses at the lower edge of the panel, at abscissae that have no value (failed points); `y` is the row of crosses, from 1.
    Missing,
    /// Filled between [`Series::base`] and `y`.
    Band,
    /// A bar at every abscissa, from [`Series::base`] to `y`; several series of bars stand side by side.
    Bars,
    /// A stripe of height one whose colours are [`Series::shades`]; several make a map.
    Stripe,
}

/// A point that did not converge: where, and why.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// The place in words, for example `Ft = 2 N, frequency = 121.25 Hz`; empty in a study that has but one.
    pub at: String,
    /// The reason and what to try.
    pub reason: String,
}

impl fmt::Display for Failure {
    /// `failed at PLACE: REASON`; of a study that has but one place, without it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.at.as_str() {
            "" => write!(f, "failed: {}", self.reason),
            at => write!(f, "failed at {at}: {}", self.reason),
        }
    }
}

/// How a run was made, so that it can be repeated.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Version of Stickslip.
    pub version: String,
    /// The study as it was understood: all values resolved to SI.
    pub study: serde_json::Value,
    /// The methods that found the orbits, with the reason where one was chosen; none for kinds that need no method.
    pub methods: Vec<String>,
    /// Seed of the random numbers, if any were used.
    pub seed: Option<u64>,
    /// Threads used.
    pub threads: usize,
    /// Wall time, s.
    pub wall_time_s: f64,
    /// Number of points by status.
    pub points: BTreeMap<String, u64>,
    /// True if the run was interrupted and holds only the points finished until then.
    pub interrupted: bool,
}
