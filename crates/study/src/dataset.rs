//! What a study yields: tables, figures and the record of the run, free of any file format.
//!
//! The writers in `stickslip-report` see nothing else.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The result of one study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
}

impl Table {
    /// The numbers of a column.
    pub fn numbers(&self, column: &str) -> Option<&[f64]> {
        self.columns.iter().find(|c| c.name == column).and_then(|c| match &c.values {
            Values::Number(v) => Some(v.as_slice()),
            _ => None,
        })
    }
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |c| c.values.len())
    }
}

/// A figure of one or several panels, side by side in rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// Title above the panels.
    pub title: String,
    /// The panels, in reading order.
    pub panels: Vec<Panel>,
}

/// One pair of axes with its curves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Panel {
    /// Title of the panel, for example `Ft = 2 N`.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// The curves.
    pub series: Vec<Series>,
}

/// An axis: what it shows and in which unit. The values of the series are already in this unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// Quantity, for example `frequency`.
    pub quantity: String,
    /// Unit, for example `Hz`.
    pub unit: String,
}

/// A curve of a panel. A point with a NaN interrupts it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// Legend; curves with the same label share one legend entry.
    pub label: String,
    /// Abscissae in the axis' unit.
    pub x: Vec<f64>,
    /// Ordinates in the axis' unit.
    pub y: Vec<f64>,
    /// How it is drawn.
    pub style: Style,
    /// Index into the palette; curves that belong together share it.
    pub colour: usize,
}

/// How a curve is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Style {
    /// Continuous line.
    Solid,
    /// Dashes.
    Dashed,
    /// Dots.
    Dotted,
    /// Marks without a line (peaks, failed points).
    Marks,
}

/// A point that did not converge: where, and why.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// The place in words, for example `Ft = 2 N, frequency = 121.25 Hz`.
    pub at: String,
    /// The reason and what to try.
    pub reason: String,
}

/// How a run was made, so that it can be repeated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Version of Stickslip.
    pub version: String,
    /// The study as it was understood: all values resolved to SI.
    pub study: serde_json::Value,
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
