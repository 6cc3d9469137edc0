//! Batches: units of a study computed apart from the others, on another machine perhaps, and joined to a whole.
//!
//! Joined in the order of the units they are what a run yields, bit for bit, however the units were cut into batches.

use crate::dataset::{Column, Dataset, Failure, Table, Values};
use crate::error::StudyError;
use crate::kinds;
use crate::note::Note;
use crate::run::{Checked, Context, Prepared, compute, redrawn};
use crate::study::Study;
use crate::work::{Part, Units};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// What neighbouring units yield.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Batch {
    /// The tables of the kind, in its order; one to which nothing was written has no columns.
    pub tables: Vec<Table>,
    /// What is to be said beside them.
    pub told: Told,
}

/// What is to be said of units beside the rows of their tables.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Told {
    notes: Vec<Note>,
    /// Points without a result: where and why.
    pub failures: Vec<Failure>,
    /// Points by status.
    pub points: BTreeMap<String, u64>,
}

impl Told {
    /// Takes in what is to be said of the next units.
    pub fn append(&mut self, next: Told) {
        next.notes.into_iter().for_each(|note| note.join(&mut self.notes));
        self.failures.extend(next.failures);
        for (status, count) in next.points {
            *self.points.entry(status).or_default() += count;
        }
    }
}

/// Number of the units of work of a study, which know nothing of each other.
pub fn units(study: &Study) -> usize {
    Units::of(study, (kinds::of(study).grain)(study)).len()
}

/// Computes the units of a range one after the other, on the calling thread.
///
/// # Errors
/// [`StudyError`]: there are no such units, or a search between the cases met a model that the method cannot take.
///
/// # Example
/// ```
/// use stickslip_study::{batch, read_study, run::{Context, check}};
/// let text = stickslip_study::templates::find("blade-couple").unwrap().study;
/// let checked = check(&read_study("couple.toml", text, &[]).unwrap()).unwrap();
/// let context = Context::unwatched(1);
/// let all = batch::units(checked.study());
/// let [first, rest] = [0..3, 3..all].map(|range| batch::batch(&checked, range, &context).unwrap());
/// let whole = batch::joined(&checked, vec![first, rest], 1, 0.0);
/// assert_eq!(whole.tables, checked.run(&context).unwrap().tables);
/// ```
pub fn batch(checked: &Checked, range: Range<usize>, context: &Context) -> Result<Batch, StudyError> {
    let study = checked.study();
    let all = units(study);
    if range.start > range.end || range.end > all {
        let message = format!("there are no units {} to {}, the study has {all}", range.start, range.end);
        return Err(study.error_at("study", 0, "kind", message, None));
    }
    let first = Arc::new(Prepared::new(study, 0)?);
    let mut whole = Batch::default();
    for unit in range {
        let Part { tables, notes, failures, points } = compute(study, &first, unit, context)?;
        let names = study.kind().tables.iter();
        let tables = names.zip(tables).map(|(name, rows)| rows.table(name)).collect();
        whole.append(Batch { tables, told: Told { notes, failures, points } });
    }
    Ok(whole)
}

impl Batch {
    /// Takes in the next units.
    fn append(&mut self, next: Batch) {
        self.told.append(next.told);
        if self.tables.is_empty() {
            self.tables = next.tables;
            return;
        }
        self.tables.iter_mut().zip(next.tables).for_each(|(table, more)| extend(table, more.columns));
    }
}

/// Rows after those of a table; one that nothing was written to yet takes the columns over.
fn extend(table: &mut Table, more: Vec<Column>) {
    if table.columns.is_empty() {
        table.columns = more;
        return;
    }
    for (column, next) in table.columns.iter_mut().zip(more) {
        match (&mut column.values, next.values) {
            (Values::Number(a), Values::Number(b)) => a.extend(b),
            (Values::Integer(a), Values::Integer(b)) => a.extend(b),
            (Values::Text(a), Values::Text(b)) => a.extend(b),
            (Values::Flag(a), Values::Flag(b)) => a.extend(b),
            (a, b) => panic!("column {} has two sorts of values: {a:?}, {b:?}", column.name),
        }
    }
}

/// The whole of batches in the order of their units, with the figure of the study; `threads` and `seconds` are for the record.
pub fn joined(checked: &Checked, batches: Vec<Batch>, threads: usize, seconds: f64) -> Dataset {
    let mut whole = Batch::default();
    batches.into_iter().for_each(|batch| whole.append(batch));
    let study = checked.study();
    let tables: Vec<Table> = whole.tables.into_iter().filter(|table| !table.columns.is_empty()).collect();
    let mut dataset = checked.outline(threads);
    dataset.notes.extend(whole.told.notes.iter().filter_map(Note::text));
    dataset.figure = redrawn(study, &tables);
    dataset.tables = tables;
    dataset.failures = whole.told.failures;
    dataset.record.points = whole.told.points;
    dataset.record.wall_time_s = seconds;
    dataset
}
