//! Blocks: the results of consecutive units of a study, joined in order.
//!
//! Blocks may be written, read and joined again, on one machine or on several. The joined
//! result is the same bit for bit for every division into blocks.

use crate::kinds::info::KindInfo;
use crate::results::dataset::{Failure, Table};
use crate::results::notes::Note;
use crate::run::work::{NOT_REACHED, UnitResult};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;

/// Number of failures stored with their reasons; further failures are only counted.
///
/// The tables hold the status of every point.
pub const MAX_FAILURES: usize = 10_000;

/// The results of a range of units.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Range of unit numbers.
    pub units: Range<usize>,
    /// All tables of the kind, in its order; a table without rows has no columns.
    pub tables: Vec<Table>,
    /// Notes, failures and counts of the points.
    pub tally: Tally,
}

/// Notes, failures and counts of the points of a block.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    notes: Vec<Note>,
    /// Points without a result, at most [`MAX_FAILURES`].
    failures: Vec<Failure>,
    /// Number of further points without a result.
    more_failures: u64,
    /// Number of points by status.
    points: BTreeMap<String, u64>,
    /// True if a unit was stopped before it finished.
    #[serde(default)]
    #[serde(rename = "cut")]
    interrupted: bool,
}

impl Block {
    /// Returns an empty block that begins at unit `from` of a study of this kind.
    pub fn empty(kind: &KindInfo, from: usize) -> Block {
        let tables = kind.tables.iter().map(|name| Table { name: (*name).to_owned(), columns: Vec::new() });
        Block { units: from..from, tables: tables.collect(), tally: Tally::default() }
    }

    /// Builds the block of one unit.
    pub(crate) fn from_unit(kind: &KindInfo, unit: usize, part: UnitResult) -> Block {
        let UnitResult { tables: rows, notes, failures, points, interrupted: cut } = part;
        let mut block = Block { units: unit..unit + 1, ..Block::empty(kind, unit) };
        // the part of a unit that was not reached has no tables
        block.tables.iter_mut().zip(rows).for_each(|(table, rows)| table.columns = rows.finish(&table.name).columns);
        block.tally.append(Tally { notes, failures, more_failures: 0, points, interrupted: cut });
        block
    }

    /// Appends the next units: rows, notes, failures and counts.
    pub fn append(&mut self, next: Block) {
        self.units.end = next.units.end;
        self.tables.iter_mut().zip(next.tables).for_each(|(table, more)| table.append(more));
        self.tally.append(next.tally);
    }

    /// Returns the number of cells of all tables.
    pub fn cells(&self) -> usize {
        self.tables.iter().map(|table| table.rows() * table.columns.len()).sum()
    }
}

impl Tally {
    /// Appends the notes, failures and counts of the next units.
    pub fn append(&mut self, next: Tally) {
        next.notes.into_iter().for_each(|note| note.merge_into(&mut self.notes));
        self.interrupted |= next.interrupted;
        let free_failures = MAX_FAILURES - self.failures.len();
        self.more_failures += next.more_failures + next.failures.len().saturating_sub(free_failures) as u64;
        self.failures.extend(next.failures.into_iter().take(free_failures));
        for (status, count) in next.points {
            *self.points.entry(status).or_default() += count;
        }
    }

    /// Returns the number of points by status.
    pub fn points(&self) -> &BTreeMap<String, u64> {
        &self.points
    }

    /// Returns the points without a result: where and why, at most [`MAX_FAILURES`].
    pub fn failures(&self) -> &[Failure] {
        &self.failures
    }

    /// Returns true if the run reached every point, converged or not, and finished every unit.
    pub fn is_whole(&self) -> bool {
        !self.interrupted && !self.points.contains_key(NOT_REACHED)
    }

    /// Returns the sentences that a reader of the results must know.
    pub fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = self.notes.iter().filter_map(Note::text).collect();
        if self.more_failures > 0 {
            let known = self.failures.len();
            notes.push(format!(
                "The first {known} failed points are listed with their reasons; {} more are not listed. The tables \
                 have the status of every point.",
                self.more_failures
            ));
        }
        if !self.is_whole() {
            notes.push("The run was interrupted; the results contain only the points finished until then.".to_owned());
        }
        notes
    }
}
