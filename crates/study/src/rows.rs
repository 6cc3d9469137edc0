//! Tables that grow row by row. A row may lack what others have: its cell has no value.

use crate::columns::REDUCTION_ERROR;
use crate::dataset::{Column, Table, Values as Cells, column_name};
use crate::study::Case;
use stickslip::model::ReductionEvidence;

/// Columns that grow row by row, in an order that all rows keep.
#[derive(Debug, Default)]
pub struct Rows {
    columns: Vec<Column>,
    next: usize,
    /// Rows that have ended.
    ended: usize,
    /// Whether they are of linear motions, which have no harmonics of joints.
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

    /// A real number.
    pub fn number(&mut self, name: &str, value: f64) {
        if let Cells::Number(v) = self.cells(name, Cells::Number(Vec::new())) {
            v.push(value);
        }
    }

    /// A count.
    pub fn integer(&mut self, name: &str, value: u64) {
        if let Cells::Integer(v) = self.cells(name, Cells::Integer(Vec::new())) {
            v.push(value);
        }
    }

    /// A word.
    pub fn text(&mut self, name: &str, value: &str) {
        if let Cells::Text(v) = self.cells(name, Cells::Text(Vec::new())) {
            v.push(value.to_owned());
        }
    }

    /// True, false, or unknown.
    pub fn flag(&mut self, name: &str, value: Option<bool>) {
        if let Cells::Flag(v) = self.cells(name, Cells::Flag(Vec::new())) {
            v.push(value);
        }
    }

    /// The varied parameters of a case.
    pub fn varied(&mut self, case: &Case) {
        for varied in &case.varied {
            let (name, value) = varied.column();
            self.number(&name, value);
        }
    }

    /// How far what the places see is from the whole structure, in a row that has an orbit or a frequency; nothing where no structure was reduced.
    pub fn reduced(&mut self, reduction: Option<ReductionEvidence>) {
        if let Some(ReductionEvidence { error, .. }) = reduction {
            self.number(REDUCTION_ERROR, error);
        }
    }

    /// Their reduction errs by no less than this, unless they are linear.
    pub fn err(&mut self, error: f64) {
        let known = self.columns.iter_mut().filter(|column| column.name == REDUCTION_ERROR && !self.linear);
        for column in known {
            if let Cells::Number(errors) = &mut column.values {
                errors.iter_mut().for_each(|known| *known = known.max(error));
            }
        }
    }

    /// Ends a row.
    pub fn end(&mut self) {
        self.next = 0;
        for column in self.columns.iter_mut().filter(|column| column.values.len() == self.ended) {
            column.values.extend(column.values.blank(1));
        }
        self.ended += 1;
    }

    /// The table.
    pub fn table(self, name: &str) -> Table {
        Table { name: name.to_owned(), columns: self.columns }
    }
}
