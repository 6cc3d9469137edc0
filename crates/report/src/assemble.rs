//! Results from journals: the tables block by block, the figure, and the record, as files of one run.
//!
//! Whatever the blocks are and whichever journals they stand in, the files are the same. Memory is that of one block, and of as many rows as the
//! figure shows.

use crate::file::{File, Output, ReportError, Rows, file_name};
use crate::folder::{self, Aside};
use crate::journal::{Journal, JournalError};
use crate::json::Shape;
use crate::output::{FIGURES, Outputs, with_record};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Duration;
use stickslip_study::Study;
use stickslip_study::block::{Block, Tally};
use stickslip_study::dataset::Dataset;
use stickslip_study::run::drawn;
use stickslip_study::thinning::Thinning;

/// Why results cannot be made of journals.
#[derive(Debug, thiserror::Error)]
pub enum AssembleError {
    /// A file cannot be written.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// A journal cannot be read.
    #[error(transparent)]
    Journal(#[from] JournalError),
}

/// Everything that one run has yielded: journals whose units follow each other, and what came after them in a run that was interrupted.
#[derive(Debug)]
pub struct Parts<'a> {
    /// The results as far as they were known before.
    pub outline: &'a Dataset,
    /// The journals, in the order of their units.
    pub journals: &'a [Journal],
    /// Blocks that no journal keeps.
    pub rest: &'a [Block],
}

/// Results that are written.
#[derive(Debug)]
pub struct Assembled {
    /// The results; of long tables only as many rows as the figure needs.
    pub dataset: Dataset,
    /// Whether it has all rows.
    pub is_whole: bool,
    /// The files.
    pub files: Vec<PathBuf>,
}

/// Writes the chosen outputs of `study` into `out/NAME/`, as [`write_dataset`](crate::write_dataset) does. What is written bit by bit grows in
/// the folder `aside` before.
///
/// # Errors
/// [`AssembleError`]: a file cannot be written or read; what was in the folder before stays, and the journals do.
pub fn assemble(
    parts: &Parts<'_>,
    study: &Study,
    outputs: &Outputs,
    out: &Path,
    aside: &Path,
) -> Result<Assembled, AssembleError> {
    let mut aside = Aside::new(aside.to_owned());
    let done = written(parts, study, outputs, out, &mut aside);
    match done {
        Ok((dataset, is_whole, files)) => {
            let folder = folder::of_run(out, file_name(&dataset.name, "study")?, dataset.record.interrupted);
            Ok(Assembled { files: aside.replace(&folder, &files)?, dataset, is_whole })
        }
        Err(error) => {
            aside.remove();
            Err(error)
        }
    }
}

fn written(
    parts: &Parts<'_>,
    study: &Study,
    outputs: &Outputs,
    out: &Path,
    aside: &mut Aside,
) -> Result<(Dataset, bool, Vec<File>), AssembleError> {
    let (mut tally, mut shapes, mut time) = (Tally::default(), Vec::new(), 0.0);
    for journal in parts.journals {
        tally.append(journal.tally.clone());
        join(&mut shapes, journal.shapes.clone());
        time += journal.time();
    }
    for block in parts.rest {
        tally.append(block.tally.clone());
        join(&mut shapes, block.tables.iter().map(Shape::of).collect());
    }
    shapes.retain(|shape| !shape.header.columns.is_empty());

    let mut thinning =
        Thinning::new(study, &shapes.iter().map(|shape| (shape.header.name.as_str(), shape.rows)).collect::<Vec<_>>());
    let is_whole = thinning.keeps_all();
    let (mut begun, mut names): (Vec<String>, Vec<String>) = Default::default();
    let mut sinks: Vec<(&str, Box<dyn Rows>)> = Vec::new();
    // in the order of the outputs, as they are listed
    let wanted: Vec<_> = outputs.iter().filter_map(|output| output.sink).collect();
    let blocks = || {
        let kept = parts.journals.iter().flat_map(Journal::blocks);
        kept.chain(parts.rest.iter().cloned().map(Ok))
    };
    for block in blocks() {
        for table in block?.tables.into_iter().filter(|table| !table.columns.is_empty()) {
            let Some(shape) = shapes.iter().find(|shape| shape.header.name == table.name) else { continue };
            let table = shape.filled(table);
            if !begun.contains(&table.name) {
                begun.push(table.name.clone());
                for sink in &wanted {
                    let name = sink.file_name(&table.name)?;
                    let file = BufWriter::with_capacity(1 << 20, aside.file(&name)?);
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
    let figure = drawn(study, &tables);
    let dataset = parts.outline.clone().completed(tables, figure, tally, Duration::from_secs_f64(time));
    let mut files = Vec::new();
    // a run that was stopped before anything was finished has nothing to draw
    let empty = dataset.record.interrupted && shapes.iter().all(|shape| shape.rows == 0);
    let makes = |output: &&Output| output.sink.is_none() && !(empty && FIGURES.contains(&output.name));
    for output in outputs.iter().filter(makes) {
        files.extend((output.make)(&dataset)?);
    }
    names.sort_by_key(|name| {
        // as in memory: output by output, and in each table by table
        let output = wanted.iter().position(|sink| name.ends_with(&format!(".{}", sink.extension)));
        let table = shapes
            .iter()
            .position(|shape| wanted.iter().any(|sink| *name == format!("{}.{}", shape.header.name, sink.extension)));
        (output, table)
    });
    let files = with_record(&dataset, &shapes, out, &names, files)?;
    Ok((dataset, is_whole, files))
}

fn join(shapes: &mut Vec<Shape>, more: Vec<Shape>) {
    if shapes.is_empty() {
        *shapes = more;
    } else {
        shapes.iter_mut().zip(more).for_each(|(all, more)| all.add(more));
    }
}
