//! Batches: units of a study computed apart from the others, on another machine perhaps, and joined to a whole.
//!
//! Joined in the order of the units they are what a run yields, bit for bit, however the units were cut into batches.

use crate::block::{Block, Tally};
use crate::dataset::{Dataset, Table};
use crate::error::StudyError;
use crate::kinds;
use crate::run::{Checked, Context, Prepared, compute, redrawn};
use crate::study::Study;
use crate::work::Units;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

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
/// let [mut whole, rest] = [0..3, 3..all].map(|range| batch::batch(&checked, range, &context).unwrap());
/// whole.append(rest);
/// let whole = batch::joined(&checked, whole.tables, whole.tally, 1, 0.0);
/// assert_eq!(whole.tables[1], checked.run(&context).unwrap().tables[1]);
/// ```
pub fn batch(checked: &Checked, range: Range<usize>, context: &Context) -> Result<Block, StudyError> {
    let study = checked.study();
    let all = units(study);
    if range.start > range.end || range.end > all {
        let message = format!("there are no units {} to {}, the study has {all}", range.start, range.end);
        return Err(study.error_at("study", 0, "kind", message, None));
    }
    let first = Arc::new(Prepared::new(study, 0)?);
    let mut whole = Block::empty(study.kind(), range.start);
    for unit in range {
        whole.append(Block::of(study.kind(), unit, compute(study, &first, unit, context)?));
    }
    Ok(whole)
}

/// The whole of the tables of all units, with the figure of the study; `threads` and `seconds` are for the record.
pub fn joined(checked: &Checked, tables: Vec<Table>, tally: Tally, threads: usize, seconds: f64) -> Dataset {
    let figure = redrawn(checked.study(), &tables);
    let mut dataset = checked.outline(threads).completed(tables, figure, tally, Duration::ZERO);
    dataset.record.wall_time_s = seconds;
    dataset
}
