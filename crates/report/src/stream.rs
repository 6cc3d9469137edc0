//! A run whose results go to the disk while it goes on, which a later run can take up, and of which a part may be computed elsewhere.
//!
//! While the run of `NAME` goes on, its [`Journal`] stands in `out/NAME.running/`; [`assemble`](crate::assemble::assemble) makes the results of it.
//! The journal of a shard stays, in `out/NAME.shard-3-of-16/`, until all are [`merged`].

use crate::file::{ReportError, file_name};
use crate::journal::{FILE, Head, Journal, JournalError};
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use stickslip_study::block::Block;
use stickslip_study::run::{Checked, Context};

/// Part `number` of `of` of the units of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    of: usize,
}

/// Most shards of a study.
const MOST_SHARDS: usize = 1_000_000;

impl FromStr for Shard {
    type Err = String;

    /// From `3/16`.
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
    /// Its units, of so many; none if there are fewer units than shards.
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

/// Where a run begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// At the first unit; an unfinished run that took long is not thrown away.
    First,
    /// At the first unit, whatever is there.
    Anew,
    /// Where an unfinished run has stopped; at the first unit if there is none.
    Resume,
}

/// An unfinished run of so many seconds is not thrown away without a word.
const WORTH: f64 = 60.0;

/// Why a run cannot begin, or ends.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// The journal.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The name of the study names no folder.
    #[error(transparent)]
    Name(#[from] ReportError),
    /// What is there is of another run.
    #[error(
        "{} cannot be gone on with: {difference}. Run that again, or begin anew without --resume{}",
        folder.display(),
        if *long { " and with --restart" } else { "" }
    )]
    Other {
        /// The folder.
        folder: PathBuf,
        /// What differs.
        difference: String,
        /// Whether it took long.
        long: bool,
    },
    /// What is there took long.
    #[error(
        "{} holds {units} of {of} units of an earlier run, {minutes:.0} minutes of work: go on with --resume, or throw it away with --restart",
        folder.display()
    )]
    Unfinished {
        /// The folder.
        folder: PathBuf,
        /// Units that are kept.
        units: usize,
        /// Of so many.
        of: usize,
        /// What they took.
        minutes: f64,
    },
}

/// The folder of the journal of a run of the study `name`.
///
/// # Errors
/// [`ReportError::Name`]: it names no folder.
pub fn folder(out: &Path, name: &str, shard: Option<Shard>) -> Result<PathBuf, ReportError> {
    let name = file_name(name, "study")?;
    Ok(out.join(shard.map_or_else(|| format!("{name}.running"), |shard| shard.folder(name))))
}

/// Opens the journal of a run, or begins one.
///
/// # Errors
/// [`StreamError`]: the file system refuses, another run is under way, or what is there is of another run.
pub fn begin(
    checked: &Checked,
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

/// Computes what is missing in a journal. Returns what a run that was stopped has yielded beyond the first unit that it did not finish;
/// `kept` is told whenever more is on the disk for sure.
///
/// # Errors
/// [`StreamError`]: the study cannot be computed, or the file system refuses; what was kept before stays.
pub fn compute(
    checked: &Checked,
    journal: &mut Journal,
    context: &Context,
    kept: &dyn Fn(&Journal),
) -> Result<Vec<Block>, StreamError> {
    let mut rest: Option<Block> = None;
    let missing = journal.units().end..journal.head().range.end;
    let computed = checked.each(missing, context, &mut |block| {
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

/// Why parts cannot be joined.
#[derive(Debug, thiserror::Error)]
pub enum MergeError {
    /// A journal cannot be read.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// There is none.
    #[error("there is no part of a study in {}: name the folders that `stickslip run --shard` has written", .0.display())]
    Nothing(PathBuf),
    /// A part is of another run.
    #[error("{} does not belong to {}: {difference}", folder.display(), first.display())]
    Other {
        /// The folder.
        folder: PathBuf,
        /// What it is compared with.
        first: PathBuf,
        /// What differs.
        difference: String,
    },
    /// A part did not end.
    #[error("{} is unfinished, {units} of its {of} units are there: run it again with --resume", folder.display())]
    Unfinished {
        /// The folder.
        folder: PathBuf,
        /// Units that are kept.
        units: usize,
        /// Of so many.
        of: usize,
    },
    /// Two parts have the same units.
    #[error("{} and {} both have unit {unit}: name each part once", a.display(), b.display())]
    Overlap {
        /// A folder.
        a: PathBuf,
        /// Another one.
        b: PathBuf,
        /// The first unit that both have, from 1.
        unit: usize,
    },
    /// A part is missing.
    #[error("units {} to {to} of {units} are in none of the parts{after}: run the shard that has them, or name its folder", from + 1)]
    Missing {
        /// First unit that is missing, from 0.
        from: usize,
        /// Where the missing ones end.
        to: usize,
        /// Units of the study.
        units: usize,
        /// After which part, in words.
        after: String,
    },
}

/// The parts of one study, in their order: complete, each once, none missing. Of a folder that is no part the parts inside it are taken.
///
/// # Errors
/// [`MergeError`]: they are not the parts of one run.
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
    // a part without units belongs anywhere
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

/// The folder itself if it has a journal, else those inside that have.
fn inside(folder: &Path) -> Vec<PathBuf> {
    if folder.join(FILE).is_file() {
        return vec![folder.to_owned()];
    }
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut inside: Vec<PathBuf> = entries.filter(|path| path.join(FILE).is_file()).collect();
    inside.sort();
    inside
}
