//! The journal of a run: what its units yielded, block after block, in a file that survives the end of the program at any instant.
//!
//! ```text
//! STICKJ01                                            eight bytes
//! length u32 | check u32 | payload                    a frame, little endian; the check is CRC-32 of length and payload
//!   payload: 0, JSON of the head                      what the run is of: the first frame
//!   payload: 1, units, time, JSON of the tally, tables   a block, after that of the units before
//!   payload: 2                                        all units are here: the last frame
//! ```
//!
//! A frame counts if it is whole and its check holds. What follows the last such frame was torn by the end of the program and is cut off when
//! the run goes on. A block counts as kept when the file system says that it is on the disk, and the file is still where it was.

mod bytes;
mod frame;

use crate::json::Shape;
use frame::{LONGEST, PREFIX, check, frame};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use stickslip_study::StudyError;
use stickslip_study::block::{Block, Tally};
use stickslip_study::dataset::Dataset;
use stickslip_study::run::Checked;

/// Name of the file in its folder.
pub(crate) const FILE: &str = "journal";
const MAGIC: &[u8; 8] = b"STICKJ01";
/// Cells of a block: a megabyte.
const CELLS: usize = 131_072;
/// After so long a block is written and brought to the disk whatever its size: what is lost to an end without warning.
const EVERY: Duration = Duration::from_secs(1);
/// Tags of payloads.
const HEAD: u8 = 0;
const BLOCK: u8 = 1;
const END: u8 = 2;

/// What a journal is of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Head {
    /// The results as far as they are known before anything is computed.
    pub outline: Dataset,
    /// Units of the whole study.
    pub units: usize,
    /// The units of this run: all, or those of a shard.
    pub range: Range<usize>,
}

impl Head {
    /// Of a run of these units.
    pub fn new(checked: &Checked, range: Range<usize>, threads: usize) -> Head {
        Head { outline: checked.outline(threads), units: checked.units(), range }
    }

    /// What differs between the runs that two journals are of, in words; nothing if both are parts of the same results.
    pub fn difference(&self, other: &Head) -> Option<String> {
        let (ours, theirs) = (&self.outline.record, &other.outline.record);
        let differs = |what: &str, ours: &str, theirs: &str| Some(format!("{what} {theirs}, not {ours}"));
        if ours.version != theirs.version {
            return differs("it is of version", &ours.version, &theirs.version);
        }
        if self.outline.name != other.outline.name {
            return differs("it is of the study", &self.outline.name, &other.outline.name);
        }
        let of = |record: &Value, key: &str| record[key].clone();
        let (text, its_text) = (of(&ours.study, "file"), of(&theirs.study, "file"));
        if text != its_text {
            let (text, its_text) = (text.as_str().unwrap_or_default(), its_text.as_str().unwrap_or_default());
            let line = 1 + text.lines().zip(its_text.lines()).take_while(|(a, b)| a == b).count();
            let at = |text: &str| {
                text.lines().nth(line - 1).map_or("its end".to_owned(), |line| format!("`{}`", line.trim()))
            };
            return Some(format!(
                "it is of another state of the study file: its line {line} is {}, not {}",
                at(its_text),
                at(text)
            ));
        }
        if of(&ours.study, "set") != of(&theirs.study, "set") {
            let words = |record: &Value| {
                let set: Vec<(String, String)> = serde_json::from_value(record["set"].clone()).unwrap_or_default();
                let set: Vec<String> = set.iter().map(|(name, value)| format!("--set {name}={value}")).collect();
                if set.is_empty() { "without --set".to_owned() } else { format!("with {}", set.join(" ")) }
            };
            return differs("it is of a run", &words(&ours.study), &words(&theirs.study));
        }
        let method = |record: &Value| record["cases"][0]["method"]["kind"].as_str().unwrap_or("none").to_owned();
        if method(&ours.study) != method(&theirs.study) {
            return differs("it is of a run with the method", &method(&ours.study), &method(&theirs.study));
        }
        if of(&ours.study, "matrices") != of(&theirs.study, "matrices") {
            return Some("the files of its [structure] and [disk] hold other matrices, nodes or deviations now than when it began".to_owned());
        }
        if of(&ours.study, "cases") != of(&theirs.study, "cases") || self.units != other.units {
            return Some("a file that the study reads has changed since: its cases have other values".to_owned());
        }
        None
    }
}

/// Why a journal cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// The file system refused.
    #[error("cannot write {}: {cause}; {}", path.display(), kept(*units))]
    Write {
        /// The file.
        path: PathBuf,
        /// The reason of the operating system.
        #[source]
        cause: std::io::Error,
        /// Units that are kept.
        units: usize,
    },
    /// Somebody took the file away.
    #[error("{} was removed or replaced while the run went on: what it held is gone, and nothing more is written", path.display())]
    Vanished {
        /// The file.
        path: PathBuf,
    },
    /// It cannot be read.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The reason of the operating system.
        #[source]
        cause: std::io::Error,
    },
    /// It is none.
    #[error("{}: {reason}", path.display())]
    Not {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The program ended before anything was kept in it.
    #[error("{}: nothing is kept in it, begin anew", path.display())]
    Nothing {
        /// The file.
        path: PathBuf,
    },
    /// Another run writes there.
    #[error("another run is writing into {}: wait for its end, or give this one another --out", folder.display())]
    Busy {
        /// The folder.
        folder: PathBuf,
    },
    /// The study could not be computed.
    #[error(transparent)]
    Study(#[from] StudyError),
}

fn kept(units: usize) -> String {
    match units {
        0 => "nothing is kept yet".to_owned(),
        _ => "what was kept before stays: --resume goes on from there".to_owned(),
    }
}

/// The journal of a run.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    head: Head,
    /// Units whose blocks are in the file.
    units: Range<usize>,
    /// Where the blocks stand.
    frames: Vec<(u64, u32)>,
    /// The end of the last frame.
    end: u64,
    pub(crate) tally: Tally,
    pub(crate) shapes: Vec<Shape>,
    /// Wall time up to the last block, s.
    time: f64,
    /// Wall time of earlier runs, s, and when this one began.
    before: f64,
    begun: Instant,
    waiting: Option<Block>,
    /// Units that are on the disk for sure.
    kept: usize,
    synced: Instant,
    sealed: bool,
}

impl Journal {
    /// A new journal in `folder`, which is made; in place of one that is there.
    ///
    /// # Errors
    /// [`JournalError`]: the file system refuses, or another run writes there.
    pub fn create(folder: &Path, head: Head) -> Result<Journal, JournalError> {
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

    fn empty(path: PathBuf, file: File, head: Head) -> Journal {
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
            before: 0.0,
            begun: Instant::now(),
            waiting: None,
            kept: from,
            synced: Instant::now(),
            sealed: false,
        }
    }

    /// Opens a journal to go on with it; what follows its last whole frame is cut off.
    ///
    /// # Errors
    /// [`JournalError`]: there is none, or another run writes there.
    pub fn open(folder: &Path) -> Result<Journal, JournalError> {
        let path = folder.join(FILE);
        let failed = |cause| JournalError::Write { path: path.clone(), cause, units: 0 };
        let file = OpenOptions::new().read(true).write(true).open(&path).map_err(failed)?;
        lock(&file, folder)?;
        let mut journal = Journal::scanned(path.clone(), file)?;
        journal.file.set_len(journal.end).map_err(failed)?;
        journal.file.seek(SeekFrom::Start(journal.end)).map_err(failed)?;
        Ok(journal)
    }

    /// Reads a journal and leaves it as it is.
    ///
    /// # Errors
    /// [`JournalError`]: there is none.
    pub fn read(folder: &Path) -> Result<Journal, JournalError> {
        let path = folder.join(FILE);
        let file = File::open(&path).map_err(|cause| JournalError::Read { path: path.clone(), cause })?;
        Journal::scanned(path, file)
    }

    fn scanned(path: PathBuf, file: File) -> Result<Journal, JournalError> {
        let reading = |cause| JournalError::Read { path: path.clone(), cause };
        let not = |reason: &str| JournalError::Not { path: path.clone(), reason: reason.to_owned() };
        let mut reader = BufReader::with_capacity(1 << 20, file.try_clone().map_err(reading)?);
        let all = file.metadata().map_err(reading)?.len();
        let mut magic = [0; MAGIC.len()];
        match reader.read_exact(&mut magic) {
            Ok(()) if magic == *MAGIC => {}
            Err(cause) if cause.kind() == ErrorKind::UnexpectedEof => return Err(JournalError::Nothing { path }),
            Err(cause) => return Err(reading(cause)),
            _ => return Err(not("this is no journal of a run of this version")),
        }
        let mut at = MAGIC.len() as u64;
        let mut next = |at: &mut u64| -> Result<Option<Vec<u8>>, JournalError> {
            let payload = frame(&mut reader, all - *at).map_err(reading)?;
            *at += payload.as_ref().map_or(0, |payload| PREFIX + payload.len() as u64);
            Ok(payload)
        };
        let Some(head) = next(&mut at)?.filter(|payload| payload.first() == Some(&HEAD)) else {
            return Err(JournalError::Nothing { path });
        };
        let head = serde_json::from_slice(&head[1..]);
        let head = head.map_err(|error| not(&format!("this is no journal of a run of this version: {error}")))?;
        let mut journal = Journal::empty(path.clone(), file, head);
        journal.end = at;
        while !journal.sealed
            && let Some(payload) = next(&mut at)?
        {
            match payload.first() {
                Some(&BLOCK) => {
                    let Some((block, time)) = bytes::read(&payload[1..]) else { break };
                    if block.units.start != journal.units.end {
                        break;
                    }
                    journal.frames.push((journal.end, payload.len() as u32));
                    journal.joined(block);
                    (journal.time, journal.before) = (time, time);
                }
                Some(&END) => journal.sealed = true,
                _ => break,
            }
            journal.end = at;
        }
        journal.kept = journal.units.end;
        Ok(journal)
    }

    /// What it is of.
    pub fn head(&self) -> &Head {
        &self.head
    }

    /// The units that are in it.
    pub fn units(&self) -> Range<usize> {
        self.units.clone()
    }

    /// The first unit that is not on the disk for sure.
    pub fn kept(&self) -> usize {
        self.kept
    }

    /// Points by status of the units that are in it, and what else is to be said of them.
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// Whether all units of its run are in it.
    pub fn is_complete(&self) -> bool {
        self.units.end == self.head.range.end
    }

    /// Wall time of its runs, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The folder in which it stands.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new("."))
    }

    /// Takes in the next unit; every now and then what has come together is written. Returns whether it was.
    ///
    /// # Errors
    /// [`JournalError`]: the file system refuses, or the file has been taken away.
    pub fn add(&mut self, block: Block) -> Result<bool, JournalError> {
        match &mut self.waiting {
            Some(waiting) => waiting.append(block),
            None => self.waiting = Some(block),
        }
        let late = self.synced.elapsed() >= EVERY;
        let large = self.waiting.as_ref().is_some_and(|waiting| waiting.cells() >= CELLS);
        if late {
            self.keep()?;
        } else if large {
            self.put()?;
        }
        Ok(late)
    }

    /// Writes what waits.
    fn put(&mut self) -> Result<(), JournalError> {
        let Some(block) = self.waiting.take() else { return Ok(()) };
        self.time = self.before + self.begun.elapsed().as_secs_f64();
        let mut payload = vec![BLOCK];
        bytes::write(&block, self.time, &mut payload);
        let at = self.end;
        self.frame(&payload)?;
        self.frames.push((at, payload.len() as u32));
        self.joined(block);
        Ok(())
    }

    fn joined(&mut self, block: Block) {
        self.units.end = block.units.end;
        self.tally.append(block.tally);
        let shapes = block.tables.iter().map(Shape::of);
        if self.shapes.is_empty() {
            self.shapes = shapes.collect();
        } else {
            self.shapes.iter_mut().zip(shapes).for_each(|(all, more)| all.add(more));
        }
    }

    /// Brings everything to the disk.
    ///
    /// # Errors
    /// [`JournalError`]: the file system refuses, or the file has been taken away.
    pub fn keep(&mut self) -> Result<(), JournalError> {
        self.put()?;
        self.file.sync_data().map_err(|cause| self.failed(cause))?;
        self.is_there()?;
        self.kept = self.units.end;
        self.synced = Instant::now();
        Ok(())
    }

    /// The same, and that nothing follows.
    ///
    /// # Errors
    /// [`JournalError`]: the file system refuses, or the file has been taken away.
    pub fn seal(&mut self) -> Result<(), JournalError> {
        self.put()?;
        if !self.sealed {
            self.frame(&[END])?;
            self.sealed = true;
        }
        self.keep()
    }

    /// A file that was removed takes everything and keeps nothing.
    fn is_there(&self) -> Result<(), JournalError> {
        let same = || -> std::io::Result<bool> {
            let (here, there) = (self.file.metadata()?, std::fs::metadata(&self.path)?);
            Ok(is_same(&here, &there) && there.len() == self.end)
        };
        if same().unwrap_or(false) { Ok(()) } else { Err(JournalError::Vanished { path: self.path.clone() }) }
    }

    fn failed(&self, cause: std::io::Error) -> JournalError {
        JournalError::Write { path: self.path.clone(), cause, units: self.kept - self.head.range.start }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), JournalError> {
        if let Err(cause) = self.file.write_all(bytes) {
            // the blocks before this one are whole, and a run that goes on finds them
            if self.file.sync_data().is_ok() {
                self.kept = self.units.end;
            }
            return Err(self.failed(cause));
        }
        self.end += bytes.len() as u64;
        Ok(())
    }

    fn frame(&mut self, payload: &[u8]) -> Result<(), JournalError> {
        let length = u32::try_from(payload.len()).ok().filter(|length| *length < LONGEST);
        let length = length.ok_or_else(|| self.failed(ErrorKind::FileTooLarge.into()))?;
        let mut bytes = Vec::with_capacity(PREFIX as usize + payload.len());
        bytes.extend(length.to_le_bytes());
        bytes.extend(check(length, payload).to_le_bytes());
        bytes.extend(payload);
        self.write(&bytes)
    }

    /// The blocks in their order, from the file. Nothing may wait.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = Result<Block, JournalError>> + '_ {
        self.frames.iter().map(|(at, length)| {
            let reading = |cause| JournalError::Read { path: self.path.clone(), cause };
            let not =
                || JournalError::Not { path: self.path.clone(), reason: "it has changed while it was read".to_owned() };
            // a handle of its own: the other one stands where the run goes on
            let mut file = File::open(&self.path).map_err(reading)?;
            file.seek(SeekFrom::Start(*at)).map_err(reading)?;
            let payload = frame(&mut file, PREFIX + u64::from(*length)).map_err(reading)?.ok_or_else(not)?;
            Ok(bytes::read(payload.get(1..).unwrap_or_default()).ok_or_else(not)?.0)
        })
    }
}

/// One run at a time; where the file system knows no locks, the user sees to it.
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

    fn couple() -> Checked {
        let text = stickslip_study::templates::find("blade-couple").unwrap().study;
        check(&read_study("couple.toml", text, &[]).unwrap()).unwrap()
    }

    fn units(checked: &Checked) -> Vec<Block> {
        let context = Context::unwatched(1);
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

    /// Bit for bit, with numbers that do not exist.
    fn same(journal: &Journal, expected: &[Block], what: usize) {
        let found = joined(journal.blocks().map(Result::unwrap));
        assert!(format!("{found:?}") == format!("{:?}", joined(expected.to_vec())), "{what}");
    }

    /// Wherever the file ends, what stands before the torn frame is read, and the rest is computed again: nothing else comes of it.
    #[test]
    fn a_torn_journal_gives_its_whole_blocks() {
        let (out, checked) = (tempfile::tempdir().unwrap(), couple());
        let all = units(&checked);
        let mut journal = Journal::create(out.path(), Head::new(&checked, 0..all.len(), 1)).unwrap();
        let mut ends = vec![journal.end];
        for block in &all {
            journal.add(block.clone()).unwrap();
            journal.keep().unwrap();
            ends.push(journal.end);
        }
        assert!(journal.is_complete() && journal.kept() == all.len());
        drop(journal);
        let bytes = std::fs::read(out.path().join(FILE)).unwrap();
        let cuts = (0..bytes.len()).step_by(997).chain(ends.iter().flat_map(|end| [*end as usize - 1, *end as usize]));
        for cut in cuts {
            let folder = tempfile::tempdir().unwrap();
            std::fs::write(folder.path().join(FILE), &bytes[..cut]).unwrap();
            let whole = ends.iter().filter(|end| **end as usize <= cut).count();
            if whole == 0 {
                assert!(matches!(Journal::open(folder.path()), Err(JournalError::Nothing { .. })), "{cut}");
                continue;
            }
            let mut journal = Journal::open(folder.path()).unwrap();
            assert_eq!(journal.units(), 0..whole - 1, "{cut}");
            for block in &all[whole - 1..] {
                journal.add(block.clone()).unwrap();
            }
            journal.keep().unwrap();
            same(&journal, &all, cut);
            assert_eq!(journal.tally, joined(all.clone()).tally, "{cut}");
        }
    }

    /// A changed byte is found, wherever it is.
    #[test]
    fn a_changed_byte_ends_the_journal_there() {
        let (out, checked) = (tempfile::tempdir().unwrap(), couple());
        let all = units(&checked);
        let mut journal = Journal::create(out.path(), Head::new(&checked, 0..all.len(), 1)).unwrap();
        let head = journal.end as usize;
        for block in &all {
            journal.add(block.clone()).unwrap();
            journal.put().unwrap();
        }
        journal.keep().unwrap();
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
        let head = Head::new(&checked, 0..checked.units(), 1);
        let folder = out.path().join("run");
        let mut journal = Journal::create(&folder, head.clone()).unwrap();
        assert!(matches!(Journal::open(&folder), Err(JournalError::Busy { .. })));
        assert!(matches!(Journal::create(&folder, head.clone()), Err(JournalError::Busy { .. })));
        let all = units(&checked);
        journal.add(all[0].clone()).unwrap();
        journal.keep().unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        journal.add(all[1].clone()).unwrap();
        assert!(matches!(journal.keep(), Err(JournalError::Vanished { .. })));
        // somebody else's journal in its place is not taken for ours
        let other = Journal::create(&folder, head).unwrap();
        drop(other);
        assert!(matches!(journal.keep(), Err(JournalError::Vanished { .. })));
    }

    #[test]
    fn a_journal_of_another_run_is_refused_by_name() {
        let text = stickslip_study::templates::find("blade-couple").unwrap().study;
        let head = |name: &str, text: &str, set: &[(&str, &str)], method: &str| {
            let set: Vec<(String, String)> = set.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect();
            let study = read_study(name, text, &set).unwrap().with_method(method).unwrap();
            Head::new(&check(&study).unwrap(), 0..1, 1)
        };
        let own = head("couple.toml", text, &[], "auto");
        assert_eq!(own.difference(&own.clone()), None);
        let mut old = own.clone();
        old.outline.record.version = "0.0.9".to_owned();
        let mut changed = own.clone();
        changed.outline.record.study["cases"][1] = Value::Null;
        for (other, words) in [
            (head("pair.toml", text, &[], "auto"), "of the study pair, not couple"),
            (head("couple.toml", &text.replace("= 241", "= 242"), &[], "auto"), "points = 242 }`, not `frequency"),
            (head("couple.toml", text, &[("kt", "9 N/mm")], "auto"), "with --set kt=9 N/mm, not without --set"),
            (head("couple.toml", text, &[], "harmonic-balance"), "with the method harmonic-balance, not auto"),
            (old, "of version 0.0.9, not"),
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
            Head::new(&check(&study).unwrap(), 0..1, 1)
        };
        let own = head(8e4);
        assert_eq!(own.difference(&head(8e4)), None);
        // the last digit counts
        let difference = own.difference(&head(8e4f64.next_up())).unwrap();
        assert!(difference.contains("other matrices"), "{difference}");
    }
}
