//! Runs that write their results to disk while they compute, can be resumed, and can be split
//! into shards.
//!
//! A run of `NAME` keeps its [`Journal`] in `out/NAME.running/`.
//! [`assemble`](crate::assemble::assemble) makes the results from it. The journal of a shard
//! stays in `out/NAME.shard-3-of-16/` until [`read_parts`] reads all shards for the merge.

use crate::output::result_file::{ReportError, file_name};
use crate::run::journal::{FILE, Journal, JournalError, RunHeader};
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use stickslip_study::result_block::Block;
use stickslip_study::run::{CheckedStudy, Context};

/// One of several parts of the units of a study: number and total.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    total: usize,
}

impl FromStr for Shard {
    type Err = String;

    /// Parses a shard such as `3/16`.
    fn from_str(text: &str) -> Result<Shard, String> {
        // Maximum number of shards of a study.
        let max_shards: usize = 1_000_000;
        let parts = text.split_once('/').and_then(|(number, total)| Some((number.parse().ok()?, total.parse().ok()?)));
        match parts {
            Some((number, total)) if (1..=total).contains(&number) && total <= max_shards => {
                Ok(Shard { number, total })
            }
            _ => {
                Err(format!("expected a part such as 3/16 (number/total, at most {max_shards} parts), found `{text}`"))
            }
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.total)
    }
}

impl Shard {
    /// Returns the range of units of this shard when the study has `all` units.
    ///
    /// The range can be empty if there are fewer units than shards.
    ///
    /// # Example
    /// ```
    /// use stickslip_report::stream::Shard;
    /// let shard = |text: &str| text.parse::<Shard>().unwrap().units(10);
    /// assert_eq!([shard("1/3"), shard("2/3"), shard("3/3")], [0..3, 3..6, 6..10]);
    /// assert!("0/3".parse::<Shard>().is_err() && "4/3".parse::<Shard>().is_err());
    /// ```
    pub fn units(self, all: usize) -> Range<usize> {
        let end = |number: usize| (number as u128 * all as u128 / self.total as u128) as usize;
        end(self.number - 1)..end(self.number)
    }

    fn folder(self, name: &str) -> String {
        format!("{name}.shard-{}-of-{}", self.number, self.total)
    }
}

/// Unit at which a run starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StartMode {
    /// Starts at the first unit, but does not discard a long unfinished run.
    First,
    /// Starts at the first unit and discards any earlier journal.
    Restart,
    /// Resumes an unfinished run. Starts at the first unit if there is none.
    Resume,
}

/// Reason why a run cannot start, or why it ends.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// The journal cannot be used.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The name of the study cannot be a folder name.
    #[error(transparent)]
    Name(#[from] ReportError),
    /// The journal in the folder belongs to a different run.
    #[error(
        "cannot resume {}: {difference}. Restore the files of that run, or start from the beginning without --resume{}",
        folder.display(),
        if *long { " and with --restart" } else { "" }
    )]
    DifferentRun {
        /// Folder of the journal.
        folder: PathBuf,
        /// Description of the difference.
        difference: String,
        /// `true` if the earlier run took long.
        long: bool,
    },
    /// The folder holds a long unfinished run.
    #[error(
        "{} contains {units} of {total} units of an earlier run ({minutes:.0} minutes of work): continue with \
         --resume, or discard it with --restart",
        folder.display()
    )]
    Unfinished {
        /// Folder of the journal.
        folder: PathBuf,
        /// Number of units in the journal.
        units: usize,
        /// Number of units of the run.
        total: usize,
        /// Computing time of the units in the journal, in minutes.
        minutes: f64,
    },
}

/// Returns the journal folder of a run of the study `name`.
///
/// # Errors
/// [`ReportError::Name`] if the name cannot be a folder name.
pub fn folder(out: &Path, name: &str, shard: Option<Shard>) -> Result<PathBuf, ReportError> {
    let name = file_name(name, "study")?;
    Ok(out.join(shard.map_or_else(|| format!("{name}.running"), |shard| shard.folder(name))))
}

/// Opens the journal of a run, or creates one.
///
/// # Errors
/// [`StreamError`] if the file system fails, if another run is in progress, or if the journal
/// belongs to a different run.
pub fn begin(
    checked: &CheckedStudy,
    out: &Path,
    shard: Option<Shard>,
    start: StartMode,
    threads: usize,
) -> Result<Journal, StreamError> {
    let folder = folder(out, checked.study().name(), shard)?;
    let units = checked.units();
    let head = RunHeader::new(checked, shard.map_or(0..units, |shard| shard.units(units)), threads);
    if start == StartMode::Restart || !folder.join(FILE).exists() {
        return Ok(Journal::create(&folder, head)?);
    }
    let journal = match (Journal::open(&folder), start) {
        (Ok(journal), _) => journal,
        (Err(JournalError::Empty { .. }), _) | (Err(JournalError::Invalid { .. }), StartMode::First) => {
            return Ok(Journal::create(&folder, head)?);
        }
        (Err(error), _) => return Err(error.into()),
    };
    // An unfinished run of at least this many seconds is discarded only on request.
    let long = journal.time() >= 60.0;
    if start == StartMode::First {
        if long {
            let (done, range) = (journal.units(), &journal.head().range);
            let (units, total, minutes) = (done.len(), range.len(), journal.time() / 60.0);
            return Err(StreamError::Unfinished { folder, units, total, minutes });
        }
        drop(journal);
        return Ok(Journal::create(&folder, head)?);
    }
    match head.difference(journal.head()) {
        None => Ok(journal),
        Some(difference) => Err(StreamError::DifferentRun { folder, difference, long }),
    }
}

/// Computes the missing units of a journal.
///
/// If the run is stopped, the result holds the blocks from the first unfinished unit on. The
/// function calls `on_sync` whenever further units are safely on disk.
///
/// # Errors
/// [`StreamError`] if the study cannot be computed or the file system fails. Earlier units
/// stay.
pub fn compute(
    checked: &CheckedStudy,
    journal: &mut Journal,
    context: &Context,
    on_sync: &dyn Fn(&Journal),
) -> Result<Vec<Block>, StreamError> {
    let mut rest: Option<Block> = None;
    let missing = journal.units().end..journal.head().range.end;
    let computed = checked.for_each_block(missing, context, &mut |block| {
        match &mut rest {
            Some(rest) => rest.append(block),
            None if !block.tally.is_whole() => rest = Some(block),
            None if journal.add(block)? => on_sync(journal),
            None => {}
        }
        Ok::<(), JournalError>(())
    });
    match computed {
        Err(JournalError::Study(error)) => {
            journal.sync()?;
            return Err(JournalError::Study(error).into());
        }
        other => other?,
    }
    journal.sync()?;
    on_sync(journal);
    Ok(rest.into_iter().collect())
}

/// Reason why shards cannot be merged.
#[derive(Debug, thiserror::Error)]
pub enum MergeError {
    /// A journal cannot be read.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The folder contains no shard.
    #[error("no part of a study in {}: give the folders that `stickslip run --shard` wrote", .0.display())]
    NoParts(PathBuf),
    /// A shard belongs to a different run.
    #[error("{} does not belong to {}: {difference}", folder.display(), first.display())]
    DifferentRun {
        /// Folder of the shard.
        folder: PathBuf,
        /// Folder of the shard it is compared with.
        first: PathBuf,
        /// Description of the difference.
        difference: String,
    },
    /// A shard is unfinished.
    #[error("{} is unfinished ({units} of its {total} units): run it again with --resume", folder.display())]
    Unfinished {
        /// Folder of the shard.
        folder: PathBuf,
        /// Number of units in the journal.
        units: usize,
        /// Number of units of the shard.
        total: usize,
    },
    /// Two shards contain the same unit.
    #[error("{} and {} both contain unit of work {unit}: give each shard once", a.display(), b.display())]
    Overlap {
        /// Folder of the first shard.
        a: PathBuf,
        /// Folder of the second shard.
        b: PathBuf,
        /// First common unit, from 1.
        unit: usize,
    },
    /// Some units are in no shard.
    #[error("units of work {} to {to} of {units} are missing in the given shards{after}: run the shard that contains \
             them, or add its folder", from + 1)]
    Missing {
        /// First missing unit, from 0.
        from: usize,
        /// End of the missing units (exclusive).
        to: usize,
        /// Number of units of the study.
        units: usize,
        /// Text that names the preceding shard; may be empty.
        after: String,
    },
}

/// Returns the shards of one study in order. Together they contain each unit exactly once.
///
/// For a folder without a journal, the function reads the shards inside it.
///
/// # Errors
/// [`MergeError`] if the shards are not the complete parts of one run.
pub fn read_parts(folders: &[PathBuf]) -> Result<Vec<Journal>, MergeError> {
    let mut parts = Vec::new();
    for folder in folders {
        let inside = inside(folder);
        if inside.is_empty() {
            return Err(MergeError::NoParts(folder.clone()));
        }
        for folder in inside {
            parts.push(Journal::read(&folder)?);
        }
    }
    let Some(first) = parts.first() else { return Err(MergeError::NoParts(PathBuf::new())) };
    let named = |journal: &Journal| journal.folder().to_owned();
    for part in &parts {
        if let Some(difference) = first.head().difference(part.head()) {
            return Err(MergeError::DifferentRun { folder: named(part), first: named(first), difference });
        }
        if !part.is_complete() {
            let (units, total) = (part.units().len(), part.head().range.len());
            return Err(MergeError::Unfinished { folder: named(part), units, total });
        }
    }
    let units = first.head().units;
    parts.sort_by_key(|part| (part.units().start, part.units().end));
    let (mut reached, mut last): (usize, Option<PathBuf>) = (0, None);
    let after =
        |last: &Option<PathBuf>| last.as_ref().map_or(String::new(), |last| format!(", after {}", last.display()));
    // A shard without units fits anywhere.
    for part in parts.iter().filter(|part| !part.units().is_empty()) {
        let range = part.units();
        match &last {
            Some(before) if range.start < reached => {
                return Err(MergeError::Overlap { a: before.clone(), b: named(part), unit: range.start + 1 });
            }
            _ if range.start > reached => {
                return Err(MergeError::Missing { from: reached, to: range.start, units, after: after(&last) });
            }
            _ => {}
        }
        (reached, last) = (range.end, Some(named(part)));
    }
    if reached < units {
        return Err(MergeError::Missing { from: reached, to: units, units, after: after(&last) });
    }
    Ok(parts)
}

/// Returns the folder if it has a journal, otherwise the folders inside it that have one.
fn inside(folder: &Path) -> Vec<PathBuf> {
    if folder.join(FILE).is_file() {
        return vec![folder.to_owned()];
    }
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut inside: Vec<PathBuf> = entries.filter(|path| path.join(FILE).is_file()).collect();
    inside.sort();
    inside
}
