//! Tables that grow row by row. If a row lacks a column of other rows, its cell there has no
//! value.

use crate::case::study::Case;
use crate::results::columns::REDUCTION_ERROR;
use crate::results::dataset::{CellValues, Column, Table, column_name};
use stickslip::model::ReductionAccuracy;

/// Columns that grow row by row. All rows write their columns in the same order.
#[derive(Debug, Default)]
pub struct TableBuilder {
    columns: Vec<Column>,
    next_column: usize,
    /// Number of finished rows.
    finished_rows: usize,
    /// True if the motions are linear, so that joints produce no harmonics.
    is_linear: bool,
}

impl TableBuilder {
    /// Rows of motions in which no joint slips.
    pub fn for_linear_motions() -> Self {
        TableBuilder { is_linear: true, ..TableBuilder::default() }
    }

    fn cells(&mut self, name: &str, empty: CellValues) -> &mut CellValues {
        let name = column_name(name);
        let at = self.columns[self.next_column..].iter().position(|column| column.name == name);
        self.next_column += at.unwrap_or(0);
        if at.is_none() {
            self.columns
                .insert(self.next_column, Column { name: name.to_string(), values: empty.blank(self.finished_rows) });
        }
        self.next_column += 1;
        &mut self.columns[self.next_column - 1].values
    }

    /// Adds a real number.
    pub fn number(&mut self, name: &str, value: f64) {
        if let CellValues::Number(v) = self.cells(name, CellValues::Number(Vec::new())) {
            v.push(value);
        }
    }

    /// Adds a count.
    pub fn integer(&mut self, name: &str, value: u64) {
        if let CellValues::Integer(v) = self.cells(name, CellValues::Integer(Vec::new())) {
            v.push(value);
        }
    }

    /// Adds a word.
    pub fn text(&mut self, name: &str, value: &str) {
        if let CellValues::Text(v) = self.cells(name, CellValues::Text(Vec::new())) {
            v.push(value.to_owned());
        }
    }

    /// Adds true, false or unknown.
    pub fn flag(&mut self, name: &str, value: Option<bool>) {
        if let CellValues::Flag(v) = self.cells(name, CellValues::Flag(Vec::new())) {
            v.push(value);
        }
    }

    /// Adds the varied parameters of a case.
    pub fn varied(&mut self, case: &Case) {
        for varied in &case.varied {
            let (name, value) = varied.column();
            self.number(&name, value);
        }
    }

    /// Adds the error of the reduced model at the places, for a row with an orbit or a
    /// frequency. Without a reduction it adds nothing.
    pub fn reduction_error(&mut self, reduction: Option<ReductionAccuracy>) {
        if let Some(ReductionAccuracy { error, .. }) = reduction {
            self.number(REDUCTION_ERROR, error);
        }
    }

    /// Raises the reduction error of all rows to at least `error`, unless the motions are
    /// linear.
    pub fn raise_reduction_error(&mut self, error: f64) {
        let known = self.columns.iter_mut().filter(|column| column.name == REDUCTION_ERROR && !self.is_linear);
        for column in known {
            if let CellValues::Number(errors) = &mut column.values {
                errors.iter_mut().for_each(|known| *known = known.max(error));
            }
        }
    }

    /// Ends a row: columns that the row did not write get an empty cell.
    pub fn end_row(&mut self) {
        self.next_column = 0;
        for column in self.columns.iter_mut().filter(|column| column.values.len() == self.finished_rows) {
            column.values.extend(column.values.blank(1));
        }
        self.finished_rows += 1;
    }

    /// Returns the finished table.
    pub fn finish(self, name: &str) -> Table {
        Table { name: name.to_owned(), columns: self.columns }
    }
}
