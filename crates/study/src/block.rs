//! Blocks: what neighbouring units of a study yielded, joined in their order.
//!
//! Blocks may be written, read and joined again, on one machine or on many: the whole is the same bit for bit however it was cut.

use crate::dataset::{Failure, Table};
use crate::info::KindInfo;
use crate::note::Note;
use crate::work::{NOT_REACHED, Part};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;

/// Failures that are kept with their reasons; of more only the number is. The tables have the status of every point.
pub const MOST_FAILURES: usize = 10_000;

/// What the units of a range yielded.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// The units by number.
    pub units: Range<usize>,
    /// The tables of the kind, all of them, in its order; one to which nothing was written has no columns.
    pub tables: Vec<Table>,
    /// What is to be said of them.
    pub tally: Tally,
}

/// What is to be said of the points of a block beside the rows of its tables.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    notes: Vec<Note>,
    /// Points without a result, the first [`MOST_FAILURES`].
    failures: Vec<Failure>,
    /// Points without a result beyond those.
    more_failures: u64,
    /// Points by status.
    points: BTreeMap<String, u64>,
    /// Whether a unit was stopped before it was finished.
    #[serde(default)]
    cut: bool,
}

impl Block {
    /// Nothing yet, before unit `from` of a study of this kind.
    pub fn empty(kind: &KindInfo, from: usize) -> Block {
        let tables = kind.tables.iter().map(|name| Table { name: (*name).to_owned(), columns: Vec::new() });
        Block { units: from..from, tables: tables.collect(), tally: Tally::default() }
    }

    /// The part of unit `unit`.
    pub(crate) fn of(kind: &KindInfo, unit: usize, part: Part) -> Block {
        let Part { tables: rows, notes, failures, points, cut } = part;
        let mut block = Block { units: unit..unit + 1, ..Block::empty(kind, unit) };
        // a unit that was not reached has no tables
        block.tables.iter_mut().zip(rows).for_each(|(table, rows)| table.columns = rows.table(&table.name).columns);
        block.tally.append(Tally { notes, failures, more_failures: 0, points, cut });
        block
    }

    /// The rows and what is said of the next units, after these.
    pub fn append(&mut self, next: Block) {
        self.units.end = next.units.end;
        self.tables.iter_mut().zip(next.tables).for_each(|(table, more)| table.append(more));
        self.tally.append(next.tally);
    }

    /// Cells of all its tables.
    pub fn cells(&self) -> usize {
        self.tables.iter().map(|table| table.rows() * table.columns.len()).sum()
    }
}

impl Tally {
    /// Takes in what is said of the next units.
    pub fn append(&mut self, next: Tally) {
        next.notes.into_iter().for_each(|note| note.join(&mut self.notes));
        self.cut |= next.cut;
        let room = MOST_FAILURES - self.failures.len();
        self.more_failures += next.more_failures + next.failures.len().saturating_sub(room) as u64;
        self.failures.extend(next.failures.into_iter().take(room));
        for (status, count) in next.points {
            *self.points.entry(status).or_default() += count;
        }
    }

    /// Points by status.
    pub fn points(&self) -> &BTreeMap<String, u64> {
        &self.points
    }

    /// Points without a result: where and why, the first [`MOST_FAILURES`].
    pub fn failures(&self) -> &[Failure] {
        &self.failures
    }

    /// Whether every point was reached, found or not, and what belongs to them.
    pub fn is_whole(&self) -> bool {
        !self.cut && !self.points.contains_key(NOT_REACHED)
    }

    /// What a reader of the results must know, in sentences.
    pub fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = self.notes.iter().filter_map(Note::text).collect();
        if self.more_failures > 0 {
            let known = self.failures.len();
            notes.push(format!(
                "Of the points that failed the first {known} are listed with their reasons, {} more are not; all have their status in the \
                 tables.",
                self.more_failures
            ));
        }
        if !self.is_whole() {
            notes.push("The run was interrupted; only the points finished until then are here.".to_owned());
        }
        notes
    }
}
