//! The journal of a run: a file of result blocks that survives an abort of the program at any
//! time.
//!
//! ```text
//! STICKJ01                                            eight bytes
//! length u32 | check u32 | payload                    a frame, little endian; the check is the
//!                                                     CRC-32 of length and payload
//!   payload: 0, JSON of the header                    description of the run: the first frame
//!   payload: 1, units, time, JSON of the tally, tables   a block, in the order of the units
//!   payload: 2                                        end of a complete run: the last frame
//! ```
//!
//! A frame is valid if it is complete and its checksum matches. A resumed run cuts off the
//! bytes after the last valid frame, which the abort left incomplete. A block is safe
//! when the file system confirms that it is on disk and the file is still at its path.

mod encoding;
mod frame;

use crate::output::json::TableShape;
use frame::{MAX_LENGTH, PREFIX, check, frame};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use stickslip_study::StudyError;
use stickslip_study::dataset::Dataset;
use stickslip_study::result_block::{Block, Tally};
use stickslip_study::run::CheckedStudy;

/// Name of the file in its folder.
pub(crate) const FILE: &str = "journal";
const MAGIC: &[u8; 8] = b"STICKJ01";
/// Interval after which a block is synchronized to disk regardless of its size. An abort loses
/// at most the results of this interval.
const SYNC_INTERVAL: Duration = Duration::from_secs(1);
/// Tags of payloads.
const HEAD: u8 = 0;
const BLOCK: u8 = 1;
const END: u8 = 2;

/// Description of the run that a journal belongs to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunHeader {
    /// The part of the results that is known before the computation.
    pub outline: Dataset,
    /// Number of units of the whole study.
    pub units: usize,
    /// Units of this run: all units, or those of a shard.
    pub range: Range<usize>,
}

impl RunHeader {
    /// Describes a run of these units.
    pub fn new(checked: &CheckedStudy, range: Range<usize>, threads: usize) -> RunHeader {
        RunHeader { outline: checked.dataset_without_results(threads), units: checked.units(), range }
    }

    /// Returns a description of the difference between the runs of two journals.
    ///
    /// Returns `None` if both belong to the same results.
    pub fn difference(&self, other: &RunHeader) -> Option<String> {
        let (ours, theirs) = (&self.outline.record, &other.outline.record);
        let differs = |what: &str, ours: &str, theirs: &str| Some(format!("{what} {theirs} instead of {ours}"));
        if ours.version != theirs.version {
            return differs("its version is", &ours.version, &theirs.version);
        }
        if self.outline.name != other.outline.name {
            return differs("its study is", &self.outline.name, &other.outline.name);
        }
        let of = |record: &Value, key: &str| record[key].clone();
        let (text, its_text) = (of(&ours.study, "file"), of(&theirs.study, "file"));
        if text != its_text {
            let (text, its_text) = (text.as_str().unwrap_or_default(), its_text.as_str().unwrap_or_default());
            let line = 1 + text.lines().zip(its_text.lines()).take_while(|(a, b)| a == b).count();
            let at = |text: &str| {
                text.lines().nth(line - 1).map_or("the end of the file".to_owned(), |line| format!("`{}`", line.trim()))
            };
            return Some(format!("line {line} of its study file is {} instead of {}", at(its_text), at(text)));
        }
        if of(&ours.study, "set") != of(&theirs.study, "set") {
            let words = |record: &Value| {
                let set: Vec<(String, String)> = serde_json::from_value(record["set"].clone()).unwrap_or_default();
                let set: Vec<String> = set.iter().map(|(name, value)| format!("--set {name}={value}")).collect();
                if set.is_empty() { "without --set".to_owned() } else { format!("with {}", set.join(" ")) }
            };
            return differs("it ran", &words(&ours.study), &words(&theirs.study));
        }
        let method = |record: &Value| record["cases"][0]["method"]["kind"].as_str().unwrap_or("none").to_owned();
        if method(&ours.study) != method(&theirs.study) {
            return differs("its method is", &method(&ours.study), &method(&theirs.study));
        }
        if of(&ours.study, "matrices") != of(&theirs.study, "matrices") {
            return Some(
                "the files of [structure] and [disk] have changed since the start of the run: they \
                         contain other matrices, nodes or deviations"
                    .to_owned(),
            );
        }
        if of(&ours.study, "data") != of(&theirs.study, "data") {
            return Some("a file of [[data]] has changed since the start of the run".to_owned());
        }
        if of(&ours.study, "cases") != of(&theirs.study, "cases") || self.units != other.units {
            return Some(
                "a file that the study reads has changed since the start of the run: its cases have different values"
                    .to_owned(),
            );
        }
        None
    }
}

/// Reason why a journal cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// The file system returned an error while writing.
    #[error("cannot write {}: {cause}; {}", path.display(), storage_status(*units))]
    Write {
        /// Path of the journal.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        cause: std::io::Error,
        /// Number of units on disk.
        units: usize,
    },
    /// Another program removed or replaced the file.
    #[error("{} was removed or replaced during the run: its results are lost, and the run stops. Run the study \
             again", path.display())]
    Removed {
        /// Path of the journal.
        path: PathBuf,
    },
    /// The file cannot be read.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// Path of the journal.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        cause: std::io::Error,
    },
    /// The file is not a valid journal.
    #[error("{}: {reason}", path.display())]
    Invalid {
        /// Path of the file.
        path: PathBuf,
        /// Description of the error.
        reason: String,
    },
    /// The program was aborted before the journal contained any data.
    #[error("{}: the journal is empty; start the run again without --resume", path.display())]
    Empty {
        /// Path of the journal.
        path: PathBuf,
    },
    /// Another run writes to this folder.
    #[error("another run is writing into {}: wait until it ends, or choose another --out", folder.display())]
    Busy {
        /// The folder.
        folder: PathBuf,
    },
    /// The study could not be computed.
    #[error(transparent)]
    Study(#[from] StudyError),
}

fn storage_status(units: usize) -> String {
    match units {
        0 => "no results are stored yet".to_owned(),
        _ => "the earlier results are stored: resume the run with --resume".to_owned(),
    }
}

/// The journal of a run.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    head: RunHeader,
    /// Units whose blocks are in the file.
    units: Range<usize>,
    /// Offset and payload length of each block.
    frames: Vec<(u64, u32)>,
    /// Offset of the end of the last frame.
    end: u64,
    pub(crate) tally: Tally,
    pub(crate) shapes: Vec<TableShape>,
    /// Wall time up to the last block in s.
    time: f64,
    /// Wall time of earlier runs in s, and start of this run.
    earlier_time: f64,
    begun: Instant,
    pending: Option<Block>,
    /// First unit that is not confirmed on disk.
    synced_end: usize,
    synced: Instant,
    sealed: bool,
}

impl Journal {
    /// Creates a journal in `folder` and replaces an existing one. Creates the folder if
    /// necessary.
    ///
    /// # Errors
    /// [`JournalError`] if the file system fails or another run writes there.
    pub fn create(folder: &Path, head: RunHeader) -> Result<Journal, JournalError> {
        let path = folder.join(FILE);
        let failed = |cause| JournalError::Write { path: path.clone(), cause, units: 0 };
        std::fs::create_dir_all(folder).map_err(failed)?;
        let file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path).map_err(failed)?;
        lock(&file, folder)?;
        file.set_len(0).map_err(failed)?;
        let mut journal = Journal::empty(path, file, head);
        let head = serde_json::to_vec(&journal.head).map_err(|cause| JournalError::Write {
            path: journal.path.clone(),
            cause: cause.into(),
            units: 0,
        })?;
        journal.write(MAGIC)?;
        journal.frame(&[&[HEAD], head.as_slice()].concat())?;
        Ok(journal)
    }

    fn empty(path: PathBuf, file: File, head: RunHeader) -> Journal {
        let from = head.range.start;
        Journal {
            path,
            file,
            head,
            units: from..from,
            frames: Vec::new(),
            end: 0,
            tally: Tally::default(),
            shapes: Vec::new(),
            time: 0.0,
            earlier_time: 0.0,
            begun: Instant::now(),
            pending: None,
            synced_end: from,
            synced: Instant::now(),
            sealed: false,
        }
    }

    /// Opens a journal to resume its run, and cuts off the bytes after its last valid frame.
    ///
    /// # Errors
    /// [`JournalError`] if there is no journal or another run writes there.
    pub fn open(folder: &Path) -> Result<Journal, JournalError> {
        let path = folder.join(FILE);
        let failed = |cause| JournalError::Write { path: path.clone(), cause, units: 0 };
        let file = OpenOptions::new().read(true).write(true).open(&path).map_err(failed)?;
        lock(&file, folder)?;
        let mut journal = Journal::scan(path.clone(), file)?;
        journal.file.set_len(journal.end).map_err(failed)?;
        journal.file.seek(SeekFrom::Start(journal.end)).map_err(failed)?;
        Ok(journal)
    }

    /// Reads a journal without changing it.
    ///
    /// # Errors
    /// [`JournalError`] if there is no journal.
    pub fn read(folder: &Path) -> Result<Journal, JournalError> {
        let path = folder.join(FILE);
        let file = File::open(&path).map_err(|cause| JournalError::Read { path: path.clone(), cause })?;
        Journal::scan(path, file)
    }

    fn scan(path: PathBuf, file: File) -> Result<Journal, JournalError> {
        let reading = |cause| JournalError::Read { path: path.clone(), cause };
        let not = |reason: &str| JournalError::Invalid { path: path.clone(), reason: reason.to_owned() };
        let mut reader = BufReader::with_capacity(1 << 20, file.try_clone().map_err(reading)?);
        let all = file.metadata().map_err(reading)?.len();
        let mut magic = [0; MAGIC.len()];
        match reader.read_exact(&mut magic) {
            Ok(()) if magic == *MAGIC => {}
            Err(cause) if cause.kind() == ErrorKind::UnexpectedEof => return Err(JournalError::Empty { path }),
            Err(cause) => return Err(reading(cause)),
            _ => return Err(not("this file is not a journal of a run by this version")),
        }
        let mut at = MAGIC.len() as u64;
        let mut next = |at: &mut u64| -> Result<Option<Vec<u8>>, JournalError> {
            let payload = frame(&mut reader, all - *at).map_err(reading)?;
            *at += payload.as_ref().map_or(0, |payload| PREFIX + payload.len() as u64);
            Ok(payload)
        };
        let Some(head) = next(&mut at)?.filter(|payload| payload.first() == Some(&HEAD)) else {
            return Err(JournalError::Empty { path });
        };
        let head = serde_json::from_slice(&head[1..]);
        let head =
            head.map_err(|error| not(&format!("this file is not a journal of a run by this version: {error}")))?;
        let mut journal = Journal::empty(path.clone(), file, head);
        journal.end = at;
        while !journal.sealed
            && let Some(payload) = next(&mut at)?
        {
            match payload.first() {
                Some(&BLOCK) => {
                    let Some((block, time)) = encoding::read(&payload[1..]) else { break };
                    if block.units.start != journal.units.end {
                        break;
                    }
                    journal.frames.push((journal.end, payload.len() as u32));
                    journal.append_summary(block);
                    (journal.time, journal.earlier_time) = (time, time);
                }
                Some(&END) => journal.sealed = true,
                _ => break,
            }
            journal.end = at;
        }
        journal.synced_end = journal.units.end;
        Ok(journal)
    }

    /// Returns the description of the run.
    pub fn head(&self) -> &RunHeader {
        &self.head
    }

    /// Returns the units in the journal.
    pub fn units(&self) -> Range<usize> {
        self.units.clone()
    }

    /// Returns the first unit that is not confirmed on disk.
    pub fn synced_end(&self) -> usize {
        self.synced_end
    }

    /// Returns the numbers of points by status, and the notes and failures, of the units in the
    /// journal.
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// Returns `true` if the journal contains all units of its run.
    pub fn is_complete(&self) -> bool {
        self.units.end == self.head.range.end
    }

    /// Returns the wall time of all its runs in s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Returns the folder of the journal.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new("."))
    }

    /// Adds the next unit. Returns `true` if the results were synchronized to disk.
    ///
    /// Blocks are written when they are large, and synchronized at fixed intervals.
    ///
    /// # Errors
    /// [`JournalError`] if the file system fails or the file was removed.
    pub fn add(&mut self, block: Block) -> Result<bool, JournalError> {
        match &mut self.pending {
            Some(pending) => pending.append(block),
            None => self.pending = Some(block),
        }
        let late = self.synced.elapsed() >= SYNC_INTERVAL;
        // Maximum number of cells in a block: one megabyte.
        let large = self.pending.as_ref().is_some_and(|pending| pending.cells() >= 131_072);
        if late {
            self.sync()?;
        } else if large {
            self.write_block()?;
        }
        Ok(late)
    }

    /// Writes the pending block.
    fn write_block(&mut self) -> Result<(), JournalError> {
        let Some(block) = self.pending.take() else { return Ok(()) };
        self.time = self.earlier_time + self.begun.elapsed().as_secs_f64();
        let mut payload = vec![BLOCK];
        encoding::write(&block, self.time, &mut payload);
        let at = self.end;
        self.frame(&payload)?;
        self.frames.push((at, payload.len() as u32));
        self.append_summary(block);
        Ok(())
    }

    fn append_summary(&mut self, block: Block) {
        self.units.end = block.units.end;
        self.tally.append(block.tally);
        let shapes = block.tables.iter().map(TableShape::of);
        if self.shapes.is_empty() {
            self.shapes = shapes.collect();
        } else {
            self.shapes.iter_mut().zip(shapes).for_each(|(all, more)| all.add(more));
        }
    }

    /// Writes the pending block and synchronizes the file to disk.
    ///
    /// # Errors
    /// [`JournalError`] if the file system fails or the file was removed.
    pub fn sync(&mut self) -> Result<(), JournalError> {
        self.write_block()?;
        self.file.sync_data().map_err(|cause| self.failed(cause))?;
        self.is_there()?;
        self.synced_end = self.units.end;
        self.synced = Instant::now();
        Ok(())
    }

    /// Synchronizes the file to disk after a final frame, which marks the journal as complete.
    ///
    /// # Errors
    /// [`JournalError`] if the file system fails or the file was removed.
    pub fn seal(&mut self) -> Result<(), JournalError> {
        self.write_block()?;
        if !self.sealed {
            self.frame(&[END])?;
            self.sealed = true;
        }
        self.sync()
    }

    /// Returns an error if the file at the path is no longer this one: a removed file accepts
    /// writes.
    fn is_there(&self) -> Result<(), JournalError> {
        let same = || -> std::io::Result<bool> {
            let (here, there) = (self.file.metadata()?, std::fs::metadata(&self.path)?);
            Ok(is_same(&here, &there) && there.len() == self.end)
        };
        if same().unwrap_or(false) { Ok(()) } else { Err(JournalError::Removed { path: self.path.clone() }) }
    }

    fn failed(&self, cause: std::io::Error) -> JournalError {
        JournalError::Write { path: self.path.clone(), cause, units: self.synced_end - self.head.range.start }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), JournalError> {
        if let Err(cause) = self.file.write_all(bytes) {
            // The earlier blocks are complete, and a resumed run finds them.
            if self.file.sync_data().is_ok() {
                self.synced_end = self.units.end;
            }
            return Err(self.failed(cause));
        }
        self.end += bytes.len() as u64;
        Ok(())
    }

    fn frame(&mut self, payload: &[u8]) -> Result<(), JournalError> {
        let length = u32::try_from(payload.len()).ok().filter(|length| *length < MAX_LENGTH);
        let length = length.ok_or_else(|| self.failed(ErrorKind::FileTooLarge.into()))?;
        let mut bytes = Vec::with_capacity(PREFIX as usize + payload.len());
        bytes.extend(length.to_le_bytes());
        bytes.extend(check(length, payload).to_le_bytes());
        bytes.extend(payload);
        self.write(&bytes)
    }

    /// Reads the blocks from the file in order. No block may be pending.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = Result<Block, JournalError>> + '_ {
        self.frames.iter().map(|(at, length)| {
            let reading = |cause| JournalError::Read { path: self.path.clone(), cause };
            let not = || JournalError::Invalid {
                path: self.path.clone(),
                reason: "the file was changed while it was read; run the command again".to_owned(),
            };
            // A separate handle, because the handle in `self` stays at the end for writing.
            let mut file = File::open(&self.path).map_err(reading)?;
            file.seek(SeekFrom::Start(*at)).map_err(reading)?;
            let payload = frame(&mut file, PREFIX + u64::from(*length)).map_err(reading)?.ok_or_else(not)?;
            Ok(encoding::read(payload.get(1..).unwrap_or_default()).ok_or_else(not)?.0)
        })
    }
}

/// Allows one run at a time. On a file system without locks, the user is responsible.
fn lock(file: &File, folder: &Path) -> Result<(), JournalError> {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(JournalError::Busy { folder: folder.to_owned() }),
        _ => Ok(()),
    }
}

#[cfg(unix)]
fn is_same(a: &std::fs::Metadata, b: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

#[cfg(not(unix))]
fn is_same(a: &std::fs::Metadata, b: &std::fs::Metadata) -> bool {
    a.len() == b.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use stickslip_study::read_study;
    use stickslip_study::run::{Context, check};

    fn couple() -> CheckedStudy {
        let text = stickslip_study::templates::find("blade-couple").unwrap().study;
        check(&read_study("couple.toml", text, &[]).unwrap()).unwrap()
    }

    fn units(checked: &CheckedStudy) -> Vec<Block> {
        let context = Context::without_progress(1);
        (0..checked.units()).map(|unit| checked.block(unit..unit + 1, &context).unwrap()).collect()
    }

    fn joined(blocks: impl IntoIterator<Item = Block>) -> Block {
        blocks
            .into_iter()
            .reduce(|mut whole, next| {
                whole.append(next);
                whole
            })
            .unwrap()
    }

    /// Compares bit for bit, including NaN.
    fn same(journal: &Journal, expected: &[Block], what: usize) {
        let found = joined(journal.blocks().map(Result::unwrap));
        assert!(format!("{found:?}") == format!("{:?}", joined(expected.to_vec())), "{what}");
    }

    /// For every truncated length, the blocks before the incomplete frame are read and the
    /// others are computed again, with equal results.
    #[test]
    fn a_torn_journal_gives_its_whole_blocks() {
        let (out, checked) = (tempfile::tempdir().unwrap(), couple());
        let all = units(&checked);
        let mut journal = Journal::create(out.path(), RunHeader::new(&checked, 0..all.len(), 1)).unwrap();
        let mut ends = vec![journal.end];
        for block in &all {
            journal.add(block.clone()).unwrap();
            journal.sync().unwrap();
            ends.push(journal.end);
        }
        assert!(journal.is_complete() && journal.synced_end() == all.len());
        drop(journal);
        let bytes = std::fs::read(out.path().join(FILE)).unwrap();
        let cuts = (0..bytes.len()).step_by(997).chain(ends.iter().flat_map(|end| [*end as usize - 1, *end as usize]));
        for cut in cuts {
            let folder = tempfile::tempdir().unwrap();
            std::fs::write(folder.path().join(FILE), &bytes[..cut]).unwrap();
            let whole = ends.iter().filter(|end| **end as usize <= cut).count();
            if whole == 0 {
                assert!(matches!(Journal::open(folder.path()), Err(JournalError::Empty { .. })), "{cut}");
                continue;
            }
            let mut journal = Journal::open(folder.path()).unwrap();
            assert_eq!(journal.units(), 0..whole - 1, "{cut}");
            for block in &all[whole - 1..] {
                journal.add(block.clone()).unwrap();
            }
            journal.sync().unwrap();
            same(&journal, &all, cut);
            assert_eq!(journal.tally, joined(all.clone()).tally, "{cut}");
        }
    }

    /// A changed byte is detected at every position.
    #[test]
    fn a_changed_byte_ends_the_journal_there() {
        let (out, checked) = (tempfile::tempdir().unwrap(), couple());
        let all = units(&checked);
        let mut journal = Journal::create(out.path(), RunHeader::new(&checked, 0..all.len(), 1)).unwrap();
        let head = journal.end as usize;
        for block in &all {
            journal.add(block.clone()).unwrap();
            journal.write_block().unwrap();
        }
        journal.sync().unwrap();
        drop(journal);
        let bytes = std::fs::read(out.path().join(FILE)).unwrap();
        for at in (head..bytes.len()).step_by(503) {
            let mut changed = bytes.clone();
            changed[at] ^= 0x10;
            std::fs::write(out.path().join(FILE), changed).unwrap();
            let journal = Journal::read(out.path()).unwrap();
            assert!(!journal.is_complete(), "{at}");
            let kept = journal.units().end;
            if kept > 0 {
                same(&journal, &all[..kept], at);
            }
        }
    }

    #[test]
    fn a_journal_has_one_writer_and_notices_when_it_is_taken_away() {
        let (out, checked) = (tempfile::tempdir().unwrap(), couple());
        let head = RunHeader::new(&checked, 0..checked.units(), 1);
        let folder = out.path().join("run");
        let mut journal = Journal::create(&folder, head.clone()).unwrap();
        assert!(matches!(Journal::open(&folder), Err(JournalError::Busy { .. })));
        assert!(matches!(Journal::create(&folder, head.clone()), Err(JournalError::Busy { .. })));
        let all = units(&checked);
        journal.add(all[0].clone()).unwrap();
        journal.sync().unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        journal.add(all[1].clone()).unwrap();
        assert!(matches!(journal.sync(), Err(JournalError::Removed { .. })));
        // The journal of another run in its place is not mistaken for this one.
        let other = Journal::create(&folder, head).unwrap();
        drop(other);
        assert!(matches!(journal.sync(), Err(JournalError::Removed { .. })));
    }

    #[test]
    fn a_journal_of_another_run_is_refused_by_name() {
        let text = stickslip_study::templates::find("blade-couple").unwrap().study;
        let head = |name: &str, text: &str, set: &[(&str, &str)], method: &str| {
            let set: Vec<(String, String)> = set.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect();
            let study = read_study(name, text, &set).unwrap().with_method(method).unwrap();
            RunHeader::new(&check(&study).unwrap(), 0..1, 1)
        };
        let own = head("couple.toml", text, &[], "auto");
        assert_eq!(own.difference(&own.clone()), None);
        let mut old = own.clone();
        old.outline.record.version = "0.0.9".to_owned();
        let mut changed = own.clone();
        changed.outline.record.study["cases"][1] = Value::Null;
        for (other, words) in [
            (head("pair.toml", text, &[], "auto"), "its study is pair instead of couple"),
            (
                head("couple.toml", &text.replace("= 241", "= 242"), &[], "auto"),
                "points = 242 }` instead of `frequency",
            ),
            (
                head("couple.toml", text, &[("kt", "9 N/mm")], "auto"),
                "it ran with --set kt=9 N/mm instead of without --set",
            ),
            (head("couple.toml", text, &[], "harmonic-balance"), "its method is harmonic-balance instead of auto"),
            (old, "its version is 0.0.9 instead of"),
            (changed, "a file that the study reads has changed"),
        ] {
            let difference = own.difference(&other).unwrap();
            assert!(difference.contains(words), "{difference}");
        }
    }

    #[test]
    fn a_journal_of_other_matrices_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| folder.path().join(name);
        let matrix = |value: f64| format!("%%MatrixMarket matrix coordinate real symmetric\n1 1 1\n1 1 {value}\n");
        let text = "schema = 1\n[structure]\nstiffness = \"k.mtx\"\nmass = \"m.mtx\"\nunits = \"m-kg-s\"\nmodal_damping = 0.01\n\
            [[place]]\nname = \"tip\"\ndof = \"1\"\n[[force]]\non = \"tip\"\namplitude = \"1 N\"\n\
            [study]\nkind = \"response\"\nfrequency = [\"1 Hz\"]\n";
        std::fs::write(file("blade.toml"), text).unwrap();
        std::fs::write(file("m.mtx"), matrix(2.0)).unwrap();
        let head = |stiffness: f64| {
            std::fs::write(file("k.mtx"), matrix(stiffness)).unwrap();
            let study = stickslip_study::read_file(&file("blade.toml"), &[]).unwrap();
            RunHeader::new(&check(&study).unwrap(), 0..1, 1)
        };
        let own = head(8e4);
        assert_eq!(own.difference(&head(8e4)), None);
        // A difference in the last digit is detected.
        let difference = own.difference(&head(8e4f64.next_up())).unwrap();
        assert!(difference.contains("other matrices"), "{difference}");
    }

    #[test]
    fn a_journal_of_other_data_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let text = "schema = 1\n[[data]]\nname = \"rig\"\nfile = \"rig.csv\"\n[parameters]\nk = \"1 N/mm\"\n[[mass]]\n\
            name = \"m\"\nmass = \"1 kg\"\n[[joint]]\nname = \"pad\"\nbetween = [\"m\", \"ground\"]\n\
            law = { kind = \"jenkins\", stiffness = \"k\", limit = \"1 N\" }\n[study]\nkind = \"identify\"\n\
            fit.k = { from = \"0.1 N/mm\", to = \"9 N/mm\" }\ntargets = [{ data = \"rig\", is = \"loop\", at = \"pad\" }]\n";
        std::fs::write(folder.path().join("rig.toml"), text).unwrap();
        let head = |force: &str| {
            std::fs::write(folder.path().join("rig.csv"), format!("displacement_m,force_N\n0,0\n1e-3,{force}\n"))
                .unwrap();
            let study = stickslip_study::read_file(&folder.path().join("rig.toml"), &[]).unwrap();
            RunHeader::new(&check(&study).unwrap(), 0..1, 1)
        };
        let own = head("0.5");
        assert_eq!(own.difference(&head("0.50")), None);
        let difference = own.difference(&head("0.5000000000000001")).unwrap();
        assert!(difference.contains("file of [[data]] has changed"), "{difference}");
    }
}
