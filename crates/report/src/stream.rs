//! Runs that write their results to disk while they compute, can be resumed, and can be split
//! into shards.
//!
//! A run of `NAME` keeps its [`Journal`] in `out/NAME.running/`.
//! [`assemble`](crate::assemble::assemble) makes the results from it. The journal of a shard
//! stays in `out/NAME.shard-3-of-16/` until all shards are [`merged`].

use crate::file::{ReportError, file_name};
use crate::journal::{FILE, Head, Journal, JournalError};
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
    of: usize,
}

/// Maximum number of shards of a study.
const MOST_SHARDS: usize = 1_000_000;

impl FromStr for Shard {
    type Err = String;

    /// Parses a shard such as `3/16`.
    fn from_str(text: &str) -> Result<Shard, String> {
        let parts = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((number, of)) if (1..=of).contains(&number) && of <= MOST_SHARDS => Ok(Shard { number, of }),
            _ => {
                Err(format!("expected a part as in 3/16, from 1/16 to 16/16, of {MOST_SHARDS} at most, found `{text}`"))
            }
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
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
        let end = |number: usize| (number as u128 * all as u128 / self.of as u128) as usize;
        end(self.number - 1)..end(self.number)
    }

    fn folder(self, name: &str) -> String {
        format!("{name}.shard-{}-of-{}", self.number, self.of)
    }
}

/// Unit at which a run starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Starts at the first unit, but does not discard a long unfinished run.
    First,
    /// Starts at the first unit and discards any earlier journal.
    Anew,
    /// Resumes an unfinished run. Starts at the first unit if there is none.
    Resume,
}

/// An unfinished run of at least this many seconds is discarded only on request.
const WORTH: f64 = 60.0;

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
        "{} cannot be gone on with: {difference}. Run that again, or begin anew without --resume{}",
        folder.display(),
        if *long { " and with --restart" } else { "" }
    )]
    Other {
        /// Folder of the journal.
        folder: PathBuf,
        /// Description of the difference.
        difference: String,
        /// `true` if the earlier run took long.
        long: bool,
    },
    /// The folder holds a long unfinished run.
    #[error(
        "{} holds {units} of {of} units of an earlier run, {minutes:.0} minutes of work: go on with --resume, or throw it away with --restart",
        folder.display()
    )]
    Unfinished {
        /// Folder of the journal.
        folder: PathBuf,
        /// Number of units in the journal.
        units: usize,
        /// Number of units of the run.
        of: usize,
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
    start: Start,
    threads: usize,
) -> Result<Journal, StreamError> {
    let folder = folder(out, checked.study().name(), shard)?;
    let units = checked.units();
    let head = Head::new(checked, shard.map_or(0..units, |shard| shard.units(units)), threads);
    if start == Start::Anew || !folder.join(FILE).exists() {
        return Ok(Journal::create(&folder, head)?);
    }
    let journal = match (Journal::open(&folder), start) {
        (Ok(journal), _) => journal,
        (Err(JournalError::Nothing { .. }), _) | (Err(JournalError::Not { .. }), Start::First) => {
            return Ok(Journal::create(&folder, head)?);
        }
        (Err(error), _) => return Err(error.into()),
    };
    let long = journal.time() >= WORTH;
    if start == Start::First {
        if long {
            let (kept, range) = (journal.units(), &journal.head().range);
            let (units, of, minutes) = (kept.len(), range.len(), journal.time() / 60.0);
            return Err(StreamError::Unfinished { folder, units, of, minutes });
        }
        drop(journal);
        return Ok(Journal::create(&folder, head)?);
    }
    match head.difference(journal.head()) {
        None => Ok(journal),
        Some(difference) => Err(StreamError::Other { folder, difference, long }),
    }
}

/// Computes the missing units of a journal.
///
/// If the run is stopped, the result holds the blocks from the first unfinished unit on. The
/// function calls `kept` whenever further units are safely on disk.
///
/// # Errors
/// [`StreamError`] if the study cannot be computed or the file system fails. Earlier units
/// stay.
pub fn compute(
    checked: &CheckedStudy,
    journal: &mut Journal,
    context: &Context,
    kept: &dyn Fn(&Journal),
) -> Result<Vec<Block>, StreamError> {
    let mut rest: Option<Block> = None;
    let missing = journal.units().end..journal.head().range.end;
    let computed = checked.for_each_block(missing, context, &mut |block| {
        match &mut rest {
            Some(rest) => rest.append(block),
            None if !block.tally.is_whole() => rest = Some(block),
            None if journal.add(block)? => kept(journal),
            None => {}
        }
        Ok::<(), JournalError>(())
    });
    match computed {
        Err(JournalError::Study(error)) => {
            journal.keep()?;
            return Err(JournalError::Study(error).into());
        }
        other => other?,
    }
    journal.keep()?;
    kept(journal);
    Ok(rest.into_iter().collect())
}

/// Reason why shards cannot be merged.
#[derive(Debug, thiserror::Error)]
pub enum MergeError {
    /// A journal cannot be read.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The folder contains no shard.
    #[error("there is no part of a study in {}: name the folders that `stickslip run --shard` has written", .0.display())]
    Nothing(PathBuf),
    /// A shard belongs to a different run.
    #[error("{} does not belong to {}: {difference}", folder.display(), first.display())]
    Other {
        /// Folder of the shard.
        folder: PathBuf,
        /// Folder of the shard it is compared with.
        first: PathBuf,
        /// Description of the difference.
        difference: String,
    },
    /// A shard is unfinished.
    #[error("{} is unfinished, {units} of its {of} units are there: run it again with --resume", folder.display())]
    Unfinished {
        /// Folder of the shard.
        folder: PathBuf,
        /// Number of units in the journal.
        units: usize,
        /// Number of units of the shard.
        of: usize,
    },
    /// Two shards contain the same unit.
    #[error("{} and {} both have unit {unit}: name each part once", a.display(), b.display())]
    Overlap {
        /// Folder of the first shard.
        a: PathBuf,
        /// Folder of the second shard.
        b: PathBuf,
        /// First common unit, from 1.
        unit: usize,
    },
    /// Some units are in no shard.
    #[error("units {} to {to} of {units} are in none of the parts{after}: run the shard that has them, or name its folder", from + 1)]
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
pub fn merged(folders: &[PathBuf]) -> Result<Vec<Journal>, MergeError> {
    let mut parts = Vec::new();
    for folder in folders {
        let inside = inside(folder);
        if inside.is_empty() {
            return Err(MergeError::Nothing(folder.clone()));
        }
        for folder in inside {
            parts.push(Journal::read(&folder)?);
        }
    }
    let Some(first) = parts.first() else { return Err(MergeError::Nothing(PathBuf::new())) };
    let named = |journal: &Journal| journal.folder().to_owned();
    for part in &parts {
        if let Some(difference) = first.head().difference(part.head()) {
            return Err(MergeError::Other { folder: named(part), first: named(first), difference });
        }
        if !part.is_complete() {
            let (units, of) = (part.units().len(), part.head().range.len());
            return Err(MergeError::Unfinished { folder: named(part), units, of });
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
