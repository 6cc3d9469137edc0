//! Figures from finished tables: what the kinds need to draw, whether the tables were computed just now or read from a disk.

use crate::dataset::{Table, Values as Cells};
use crate::study::{Study, VariedValue};
use std::ops::Range;
use stickslip::model::System;

/// A study and its finished tables.
#[derive(Debug, Clone, Copy)]
pub struct Drawing<'a> {
    /// The study.
    pub study: &'a Study,
    /// Its tables.
    pub tables: &'a [Table],
}

/// Rows of a table that belong to one case.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stretch {
    /// The case by number.
    pub case: usize,
    /// Its varied parameters.
    pub varied: Vec<VariedValue>,
    /// The rows.
    pub rows: Range<usize>,
}

impl Stretch {
    /// The varied parameters in words.
    pub fn label(&self) -> String {
        crate::study::varied_text(&self.varied)
    }
}

impl<'a> Drawing<'a> {
    /// A table by name; one that nothing was written to is absent.
    pub(crate) fn table(&self, name: &str) -> Option<&'a Table> {
        self.tables.iter().find(|table| table.name == name && table.rows() > 0)
    }

    /// The system of a case; cases differ in numbers only.
    pub(crate) fn system(&self, case: usize) -> Option<System> {
        self.study.case(case).ok()?.model.assemble().ok()
    }

    /// The rows of `table` case by case. The first columns of a table are the varied parameters, all of them or all but the last.
    pub(crate) fn stretches(&self, table: &Table) -> Vec<Stretch> {
        self.stretches_of(table, self.study.varied().len())
    }

    /// The same by the first `keys` varied parameters only; `case` is the first one of each stretch.
    pub(crate) fn stretches_of(&self, table: &Table, keys: usize) -> Vec<Stretch> {
        let columns: Vec<&[f64]> = table
            .columns
            .iter()
            .take(keys)
            .filter_map(|column| match &column.values {
                Cells::Number(values) => Some(values.as_slice()),
                _ => None,
            })
            .collect();
        let same = |a: usize, b: usize| columns.iter().all(|column| column[a].to_bits() == column[b].to_bits());
        let mut stretches: Vec<Stretch> = Vec::new();
        let mut from = 0;
        let mut case = 0;
        while from < table.rows() {
            let mut to = from + 1;
            while to < table.rows() && same(from, to) {
                to += 1;
            }
            // rows stand in the order of the cases; a case may have none
            while case < self.study.cases() {
                let varied = self.study.varied_values(case).unwrap_or_default();
                if varied
                    .iter()
                    .zip(&columns)
                    .all(|(value, column)| value.column().1.to_bits() == column[from].to_bits())
                {
                    stretches.push(Stretch { case, varied, rows: from..to });
                    break;
                }
                case += 1;
            }
            case += usize::from(keys == self.study.varied().len());
            from = to;
        }
        stretches
    }
}

/// The numbers of a column in some rows; NaN where there are none.
pub(crate) fn numbers(table: &Table, column: &str, rows: Range<usize>) -> Vec<f64> {
    match table.numbers(column) {
        Some(values) => values[rows].to_vec(),
        None => vec![f64::NAN; rows.len()],
    }
}

/// The words of a column.
pub(crate) fn words<'t>(table: &'t Table, column: &str) -> &'t [String] {
    let found = table.columns.iter().find(|c| c.name == column);
    match found.map(|column| &column.values) {
        Some(Cells::Text(words)) => words,
        _ => &[],
    }
}

/// Largest finite size among the columns of these names.
pub(crate) fn largest(table: &Table, columns: impl IntoIterator<Item = String>) -> f64 {
    let columns = columns.into_iter().filter_map(|column| table.numbers(&column));
    columns.flatten().map(|value| value.abs()).filter(|value| value.is_finite()).fold(0.0, f64::max)
}

/// The unit in which `largest` (SI) lies between 0.5 and 500: its name and the factor from SI.
pub(crate) fn display_unit(largest: f64, si: &str) -> (String, f64) {
    for (prefix, factor) in [("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9)] {
        if largest * factor >= 0.5 {
            return (format!("{prefix}{si}"), factor);
        }
    }
    (si.to_owned(), 1.0)
}
