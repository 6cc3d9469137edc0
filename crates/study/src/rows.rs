//! Tables that grow row by row. If a row lacks a column of other rows, its cell there has no
//! value.

use crate::columns::REDUCTION_ERROR;
use crate::dataset::{Column, Table, Values as Cells, column_name};
use crate::study::Case;
use stickslip::model::ReductionAccuracy;

/// Columns that grow row by row. All rows write their columns in the same order.
#[derive(Debug, Default)]
pub struct Rows {
    columns: Vec<Column>,
    next: usize,
    /// Number of finished rows.
    ended: usize,
    /// True if the motions are linear, so that joints produce no harmonics.
    linear: bool,
}

impl Rows {
    /// Rows of motions in which no joint slips.
    pub fn linear() -> Self {
        Rows { linear: true, ..Rows::default() }
    }

    fn cells(&mut self, name: &str, empty: Cells) -> &mut Cells {
        let name = column_name(name);
        let at = self.columns[self.next..].iter().position(|column| column.name == name);
        self.next += at.unwrap_or(0);
        if at.is_none() {
            self.columns.insert(self.next, Column { name: name.to_string(), values: empty.blank(self.ended) });
        }
        self.next += 1;
        &mut self.columns[self.next - 1].values
    }

    /// Adds a real number.
    pub fn number(&mut self, name: &str, value: f64) {
        if let Cells::Number(v) = self.cells(name, Cells::Number(Vec::new())) {
            v.push(value);
        }
    }

    /// Adds a count.
    pub fn integer(&mut self, name: &str, value: u64) {
        if let Cells::Integer(v) = self.cells(name, Cells::Integer(Vec::new())) {
            v.push(value);
        }
    }

    /// Adds a word.
    pub fn text(&mut self, name: &str, value: &str) {
        if let Cells::Text(v) = self.cells(name, Cells::Text(Vec::new())) {
            v.push(value.to_owned());
        }
    }

    /// Adds true, false or unknown.
    pub fn flag(&mut self, name: &str, value: Option<bool>) {
        if let Cells::Flag(v) = self.cells(name, Cells::Flag(Vec::new())) {
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
    pub fn reduced(&mut self, reduction: Option<ReductionAccuracy>) {
        if let Some(ReductionAccuracy { error, .. }) = reduction {
            self.number(REDUCTION_ERROR, error);
        }
    }

    /// Raises the reduction error of all rows to at least `error`, unless the motions are
    /// linear.
    pub fn err(&mut self, error: f64) {
        let known = self.columns.iter_mut().filter(|column| column.name == REDUCTION_ERROR && !self.linear);
        for column in known {
            if let Cells::Number(errors) = &mut column.values {
                errors.iter_mut().for_each(|known| *known = known.max(error));
            }
        }
    }

    /// Ends a row: columns that the row did not write get an empty cell.
    pub fn end(&mut self) {
        self.next = 0;
        for column in self.columns.iter_mut().filter(|column| column.values.len() == self.ended) {
            column.values.extend(column.values.blank(1));
        }
        self.ended += 1;
    }

    /// Returns the finished table.
    pub fn table(self, name: &str) -> Table {
        Table { name: name.to_owned(), columns: self.columns }
    }
}
