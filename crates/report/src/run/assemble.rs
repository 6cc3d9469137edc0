//! Assembles results from journals: the tables block by block, the figure and the record.
//!
//! The files do not depend on the division into blocks and journals. Memory holds one block,
//! and as many rows as the figure shows.

use crate::output::folder::{self, Staging};
use crate::output::json::TableShape;
use crate::output::result_file::{File, Output, ReportError, TableWriter, file_name};
use crate::output::{FIGURES, Outputs, with_record};
use crate::run::journal::{Journal, JournalError};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Duration;
use stickslip_study::Study;
use stickslip_study::dataset::Dataset;
use stickslip_study::decimation::Decimation;
use stickslip_study::result_block::{Block, Tally};
use stickslip_study::run::draw;

/// Reason why results cannot be assembled from journals.
#[derive(Debug, thiserror::Error)]
pub enum AssembleError {
    /// A file cannot be written.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// A journal cannot be read.
    #[error(transparent)]
    Journal(#[from] JournalError),
}

/// All results of one run: consecutive journals, then the blocks that follow in an interrupted
/// run.
#[derive(Debug)]
pub struct Parts<'a> {
    /// The part of the results that was known before the run.
    pub outline: &'a Dataset,
    /// Journals in the order of their units.
    pub journals: &'a [Journal],
    /// Blocks that are in no journal.
    pub unjournaled: &'a [Block],
}

/// Results that have been written.
#[derive(Debug)]
pub struct Assembled {
    /// The results. Long tables contain only the rows that the figure needs.
    pub dataset: Dataset,
    /// `true` if the dataset contains all rows.
    pub is_whole: bool,
    /// Paths of the written files.
    pub files: Vec<PathBuf>,
}

/// Writes the chosen outputs of `study` into `out/NAME/`.
///
/// The result is the same as that of [`write_dataset`](crate::write_dataset). Tables are first
/// written incrementally to the folder `staging`.
///
/// # Errors
/// [`AssembleError`] if a file cannot be written or read. The earlier content of the folder and
/// the journals then stay.
pub fn assemble(
    parts: &Parts<'_>,
    study: &Study,
    outputs: &Outputs,
    out: &Path,
    staging: &Path,
) -> Result<Assembled, AssembleError> {
    let mut staging = Staging::new(staging.to_owned());
    let done = written(parts, study, outputs, out, &mut staging);
    match done {
        Ok((dataset, is_whole, files)) => {
            let folder = folder::run_folder(out, file_name(&dataset.name, "study")?, dataset.record.interrupted);
            if ended_before_first_row(&dataset) && folder::holds_interrupted_run(&folder) {
                // the earlier interruption also kept points of unfinished units
                staging.remove();
                return Ok(Assembled { files: Vec::new(), dataset, is_whole });
            }
            Ok(Assembled { files: staging.replace(&folder, &files)?, dataset, is_whole })
        }
        Err(error) => {
            staging.remove();
            Err(error)
        }
    }
}

fn written(
    parts: &Parts<'_>,
    study: &Study,
    outputs: &Outputs,
    out: &Path,
    staging: &mut Staging,
) -> Result<(Dataset, bool, Vec<File>), AssembleError> {
    let (mut tally, mut shapes, mut time) = (Tally::default(), Vec::new(), 0.0);
    for journal in parts.journals {
        tally.append(journal.tally.clone());
        join(&mut shapes, journal.shapes.clone());
        time += journal.time();
    }
    for block in parts.unjournaled {
        tally.append(block.tally.clone());
        join(&mut shapes, block.tables.iter().map(TableShape::of).collect());
    }
    shapes.retain(|shape| !shape.header.columns.is_empty());

    let mut thinning = Decimation::new(
        study,
        &shapes.iter().map(|shape| (shape.header.name.as_str(), shape.rows)).collect::<Vec<_>>(),
    );
    let is_whole = thinning.keeps_all();
    let (mut begun, mut names): (Vec<String>, Vec<String>) = Default::default();
    let mut sinks: Vec<(&str, Box<dyn TableWriter>)> = Vec::new();
    // The sinks are in the order of the outputs.
    let wanted: Vec<_> = outputs.iter().filter_map(|output| output.sink).collect();
    let blocks = || {
        let kept = parts.journals.iter().flat_map(Journal::blocks);
        kept.chain(parts.unjournaled.iter().cloned().map(Ok))
    };
    for block in blocks() {
        for table in block?.tables.into_iter().filter(|table| !table.columns.is_empty()) {
            let Some(shape) = shapes.iter().find(|shape| shape.header.name == table.name) else { continue };
            let table = shape.filled(table);
            if !begun.contains(&table.name) {
                begun.push(table.name.clone());
                for sink in &wanted {
                    let name = sink.file_name(&table.name)?;
                    let file = BufWriter::with_capacity(1 << 20, staging.file(&name)?);
                    sinks.push((&shape.header.name, (sink.begin)(&table, Box::new(file))?));
                    names.push(name);
                }
            }
            for (_, rows) in sinks.iter_mut().filter(|(name, _)| *name == table.name) {
                rows.rows(&table)?;
            }
            thinning.add(table);
        }
    }
    for (_, rows) in sinks {
        rows.end()?;
    }
    let tables = thinning.tables();
    let figure = draw(study, &tables);
    let dataset = parts.outline.clone().with_results(tables, figure, tally, Duration::from_secs_f64(time));
    let mut files = Vec::new();
    // Without a row there is nothing to draw.
    let empty = ended_before_first_row(&dataset);
    let makes = |output: &&Output| output.sink.is_none() && !(empty && FIGURES.contains(&output.name));
    for output in outputs.iter().filter(makes) {
        files.extend((output.make)(&dataset)?);
    }
    names.sort_by_key(|name| {
        // The order is the same as in memory: by output, then by table.
        let output = wanted.iter().position(|sink| name.ends_with(&format!(".{}", sink.extension)));
        let table = shapes
            .iter()
            .position(|shape| wanted.iter().any(|sink| *name == format!("{}.{}", shape.header.name, sink.extension)));
        (output, table)
    });
    let files = with_record(&dataset, &shapes, out, &names, files)?;
    Ok((dataset, is_whole, files))
}

/// Returns true for a run that was stopped before its first result.
fn ended_before_first_row(dataset: &Dataset) -> bool {
    dataset.record.interrupted && dataset.tables.iter().all(|table| table.rows() == 0)
}

fn join(shapes: &mut Vec<TableShape>, more: Vec<TableShape>) {
    if shapes.is_empty() {
        *shapes = more;
    } else {
        shapes.iter_mut().zip(more).for_each(|(all, more)| all.add(more));
    }
}
