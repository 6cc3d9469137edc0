//! `stickslip run`, `check` and `paper`.

use crate::args::Destination;
use crate::ending::{Ending, print};
use crate::progress::{self, Progress};
use crate::{open, speak};
use serde_json::json;
use std::collections::BTreeSet;
use std::io::{IsTerminal, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stickslip::orbit::Accuracy;
use stickslip_report::assemble::{Assembled, Parts, assemble};
use stickslip_report::journal::{Journal, JournalError};
use stickslip_report::stream::{self, Shard, Start, StreamError};
use stickslip_report::{Outputs, check_writable, json::write_dataset_json, terminal::Terminal};
use stickslip_study::dataset::Dataset;
use stickslip_study::decimation::MAX_ROWS;
use stickslip_study::run::{CONVERGED, CheckedStudy, Context, check as check_study};
use stickslip_study::schema::MAX_FILE_BYTES;
use stickslip_study::summary::ModelSummary;
use stickslip_study::{Study, StudyError, read_bytes, read_file};

/// The studies named on the command line.
pub struct Request<'a> {
    /// Study files.
    pub files: &'a [PathBuf],
    /// `--set`.
    pub set: &'a [(String, String)],
    /// `--method`.
    pub method: Option<&'a str>,
    /// `--memory` in bytes.
    pub memory: Option<u64>,
}

impl Request<'_> {
    /// Reads and checks every file before anything runs.
    fn read(&self) -> Result<Vec<CheckedStudy>, Ending> {
        let mut studies = Vec::new();
        let mut wrong = false;
        for file in self.files {
            let study = read(file, self.set)
                .and_then(|study| match self.method {
                    Some(method) => study.with_method(method),
                    None => Ok(study),
                })
                .map(|study| match self.memory {
                    Some(bytes) => study.with_memory_limit(bytes),
                    None => study,
                })
                .and_then(|study| check_study(&study))
                // With several studies, each releases the data that its run can compute again.
                .map(|checked| if self.files.len() > 1 { checked.without_first_case() } else { checked });
            match study {
                Ok(study) => studies.push(study),
                Err(error) => {
                    show(&error);
                    wrong = true;
                }
            }
        }
        if wrong { Err(Ending::WrongInput) } else { Ok(studies) }
    }
}

/// File name that means standard input.
const STDIN: &str = "-";

/// Reads a study from a file or from standard input.
fn read(file: &Path, set: &[(String, String)]) -> Result<Study, StudyError> {
    if file != Path::new(STDIN) {
        return read_file(file, set);
    }
    let mut bytes = Vec::new();
    // A partly read study is not valid.
    match std::io::stdin().lock().take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes) {
        Ok(_) => read_bytes("stdin", &bytes, set),
        Err(_) => read_bytes("stdin", &[], set),
    }
}

/// Prints an error of a study file with its location underlined.
pub(crate) fn show(error: &StudyError) {
    if speak::is_for_programs() {
        return speak::error(&error.to_string());
    }
    let report = miette::Report::new(error.clone());
    complain!("{report:?}");
}

/// Runs `stickslip check`.
pub fn check(request: &Request<'_>) -> Ending {
    match request.read() {
        Err(ending) => ending,
        Ok(studies) => {
            let mut text = String::new();
            for (checked, file) in studies.iter().zip(request.files) {
                let (study, summary) = (checked.study(), warned(checked));
                let (cases, points) = (study.cases(), study.points());
                let plural = |count: usize| if count == 1 { "" } else { "s" };
                let verdict = match summary.warnings.len() {
                    0 => "nothing wrong".to_owned(),
                    warnings => format!("{warnings} warning{}", plural(warnings)),
                };
                text += &format!(
                    "{}: {} study, {cases} case{}, {points} point{}, {verdict}\n",
                    file.display(),
                    study.kind().name,
                    plural(cases),
                    plural(points)
                );
                text.extend(study.notes().iter().map(|note| format!("  note: {note}\n")));
                text += &summary.to_string();
            }
            print(&text)
        }
    }
}

/// Options of a run.
pub struct Wanted<'a> {
    /// `--only`.
    pub only: &'a [String],
    /// `--also`.
    pub also: &'a [String],
    /// `--json`.
    pub json: bool,
    /// `--open`.
    pub open: bool,
    /// `--watch`.
    pub watch: bool,
    /// `--resume`, `--restart`.
    pub start: Start,
    /// `--shard`.
    pub shard: Option<Shard>,
    /// `--progress`.
    pub progress: crate::args::Progress,
}

/// Returns the summary of a study, and prints its warnings on standard error.
fn warned(checked: &CheckedStudy) -> &ModelSummary {
    checked.summary().warnings.iter().for_each(|warning| complain!("{warning}"));
    checked.summary()
}

/// Returns the outputs of `--only`, or the default ones, together with those of `--also`.
pub(crate) fn outputs(only: &[String], also: &[String]) -> Result<Outputs, Ending> {
    let outputs = if only.is_empty() { Ok(Outputs::usual()) } else { Outputs::only(only) };
    outputs.and_then(|outputs| Ok(outputs.and(&Outputs::only(also)?))).map_err(|error| {
        complain!("error: {error}");
        Ending::WrongInput
    })
}

/// Runs `stickslip run`.
pub fn run(request: &Request<'_>, destination: &Destination, wanted: &Wanted<'_>) -> Ending {
    if wanted.progress == crate::args::Progress::Json {
        speak::for_programs();
    }
    let outputs = match outputs(wanted.only, wanted.also) {
        Ok(outputs) => outputs,
        Err(ending) => return ending,
    };
    if wanted.watch && request.files.iter().any(|file| file == Path::new(STDIN)) {
        complain!("error: standard input does not change, --watch needs files");
        return Ending::WrongInput;
    }
    let threads = match pool(destination) {
        Ok(threads) => threads,
        Err(ending) => return ending,
    };
    let stop = progress::stop_flag();
    let mut open = wanted.open;
    loop {
        let before = contents(request.files);
        let ending = once(request, destination, (&outputs, &Wanted { open, ..*wanted }), threads, &stop);
        if !wanted.watch || stop.load(Ordering::Relaxed) {
            return ending;
        }
        // The browser shows the figure after the first run; a reload shows later ones.
        open &= matches!(ending, Ending::WrongInput);
        if let Ending::Failed(message) = &ending {
            speak::error(message);
        }
        complain!("waiting for a change; Ctrl-C ends");
        while contents(request.files) == before {
            std::thread::sleep(LOOK);
            if stop.load(Ordering::Relaxed) {
                return Ending::Done;
            }
        }
        // A file can be empty for a moment while an editor writes it.
        loop {
            let now = contents(request.files);
            std::thread::sleep(WRITTEN);
            if contents(request.files) == now {
                break;
            }
        }
    }
}

/// Interval between two checks of the files for changes.
const LOOK: Duration = Duration::from_millis(300);
/// Changed files are read when they stay unchanged for this time.
const WRITTEN: Duration = Duration::from_millis(50);

/// Returns the contents of the files. Modification times do not reveal every change by an
/// editor.
fn contents(files: &[PathBuf]) -> Vec<Option<Vec<u8>>> {
    files.iter().map(|file| std::fs::read(file).ok()).collect()
}

/// Runs all files once.
fn once(
    request: &Request<'_>,
    destination: &Destination,
    (outputs, wanted): (&Outputs, &Wanted<'_>),
    threads: usize,
    stop: &Arc<AtomicBool>,
) -> Ending {
    let studies = match request.read() {
        Ok(studies) => studies,
        Err(ending) => return ending,
    };
    let mut names = BTreeSet::new();
    if let Some(twice) = studies.iter().map(CheckedStudy::study).find(|study| !names.insert(study.name())) {
        complain!("error: two files are called `{}`, their results would be in one folder; rename one", twice.name());
        return Ending::WrongInput;
    }
    if let Some(error) =
        studies.iter().find_map(|checked| check_writable(&destination.out.join(checked.study().name())).err())
    {
        return Ending::Failed(error.to_string());
    }
    let mut failed = false;
    // Each study is dropped after its run, together with its cached case.
    for checked in studies {
        let (study, summary) = (checked.study(), warned(&checked));
        if std::io::stderr().is_terminal() && wanted.progress == crate::args::Progress::Bar {
            complain!("{}\n{}", study.title(), summary.to_string().trim_end());
        } else if let Some(long) = summary.long_run() {
            complain!("{}: {long}", study.name());
        }
        match one(&checked, destination, outputs, wanted, (threads, stop)) {
            Ending::Done => {}
            Ending::SomeFailed => failed = true,
            other => return other,
        }
    }
    if failed { Ending::SomeFailed } else { Ending::Done }
}

/// Runs one study once.
fn one(
    checked: &CheckedStudy,
    destination: &Destination,
    outputs: &Outputs,
    wanted: &Wanted<'_>,
    (threads, stop): (usize, &Arc<AtomicBool>),
) -> Ending {
    let study = checked.study();
    let mut journal = match stream::begin(checked, &destination.out, wanted.shard, wanted.start, threads) {
        Ok(journal) => journal,
        Err(error @ (StreamError::Other { .. } | StreamError::Unfinished { .. } | StreamError::Name(_))) => {
            speak::error(&error.to_string());
            return Ending::WrongInput;
        }
        Err(error) => return Ending::Failed(error.to_string()),
    };
    let done: u64 = journal.tally().points().values().sum();
    let range = journal.head().range.clone();
    // The number of points of adaptive frequencies and of a shard is unknown in advance.
    let points = Some(study.points() as u64).filter(|_| !study.is_adaptive() && wanted.shard.is_none());
    speak::event(
        "begin",
        json!({ "study": study.name(), "kind": study.kind().name, "points": points, "units": journal.head().units,
                "from": range.start, "to": range.end, "kept": journal.units().len() }),
    );
    if !journal.units().is_empty() {
        complain!("{}: {} of {} units are kept from before", study.name(), journal.units().len(), range.len());
    }
    let progress = Progress::new(wanted.progress, points, done, study.name());
    let counter = progress.clone();
    let context = Context { threads, stop: stop.clone(), finished: Arc::new(move || counter.point()) };
    let computed =
        stream::compute(checked, &mut journal, &context, &|journal| progress.kept(journal.kept() - range.start));
    progress.end();
    let rest = match computed {
        Ok(rest) => rest,
        Err(StreamError::Journal(JournalError::Study(error))) => {
            show(&error);
            return Ending::WrongInput;
        }
        Err(error) => return Ending::Failed(error.to_string()),
    };
    if let Some(shard) = wanted.shard {
        return part(study, shard, &mut journal, rest.is_empty());
    }
    let folder = journal.folder().to_owned();
    let mut outline = journal.head().outline.clone();
    outline.record.threads = threads;
    let parts = Parts { outline: &outline, journals: std::slice::from_ref(&journal), rest: &rest };
    let assembled = match assemble(&parts, study, outputs, &destination.out, &folder) {
        Ok(assembled) => assembled,
        Err(error) => {
            return Ending::Failed(format!(
                "{error}; what was computed stays in {}: --resume makes the results of it",
                folder.join("").display()
            ));
        }
    };
    let interrupted = assembled.dataset.record.interrupted;
    if !interrupted {
        drop(journal);
        // The results exist; a folder that cannot be removed is not an error.
        let _ = std::fs::remove_dir_all(&folder);
    }
    let ending = told(&assembled, &outline.notes, (wanted.json, wanted.open));
    match ending {
        Ending::Done | Ending::SomeFailed if stop.load(Ordering::Relaxed) => {
            let results = assembled.files.first().and_then(|file| file.parent()).unwrap_or(&destination.out);
            let whole = destination.out.join(study.name());
            let beside = if results == whole || !interrupted {
                String::new()
            } else {
                format!("; the whole run in {} stays", whole.join("").display())
            };
            let on = if interrupted { "; --resume goes on from there" } else { "" };
            let what = match assembled.dataset.tables.iter().all(|table| table.rows() == 0) {
                true => {
                    "interrupted before any part was finished, which is a stretch of points or a curve that is followed as a whole; the record is in"
                }
                false => "interrupted; the finished points are in",
            };
            Ending::Failed(format!("{what} {}{beside}{on}", results.join("").display()))
        }
        ending => ending,
    }
}

/// Ends a run of a shard, whose journal stays.
fn part(study: &Study, shard: Shard, journal: &mut Journal, whole: bool) -> Ending {
    let folder = journal.folder().join("").display().to_string();
    if !whole {
        return Ending::Failed(format!("interrupted; the finished units are in {folder}; --resume goes on from there"));
    }
    if let Err(error) = journal.seal() {
        return Ending::Failed(error.to_string());
    }
    let failed = journal.tally().points().keys().any(|status| status != CONVERGED);
    speak::event(
        "end",
        json!({ "study": study.name(), "status": if failed { "some-failed" } else { "done" }, "points": journal.tally().points() }),
    );
    if !speak::is_for_programs() {
        complain!(
            "{}: part {shard} is in {folder}; `stickslip merge` joins the parts when all are there",
            study.name()
        );
    }
    if failed { Ending::SomeFailed } else { Ending::Done }
}

/// Prints the messages about written results, except the notes in `known`.
pub(crate) fn told(assembled: &Assembled, known: &[String], (json, open): (bool, bool)) -> Ending {
    let Assembled { dataset, is_whole, files } = assembled;
    let late = dataset.notes.iter().filter(|note| note.starts_with("warning") && !known.contains(note));
    late.for_each(|warning| complain!("{warning}"));
    let failed = dataset.record.points.keys().any(|status| status != CONVERGED);
    let status = match (dataset.record.interrupted, failed) {
        (true, _) => "interrupted",
        (false, true) => "some-failed",
        (false, false) => "done",
    };
    speak::event("written", json!({ "study": dataset.name, "files": files }));
    // The summary on a terminal contains these messages.
    let summary = !json && std::io::stdout().is_terminal();
    if !(summary && std::io::stderr().is_terminal()) {
        complain(dataset);
    }
    let ending = if json && !is_whole {
        Ending::Failed(format!(
            "--json prints tables of up to {MAX_ROWS} rows; the results are in {}",
            files.first().map_or(String::new(), |file| file.with_file_name("").display().to_string())
        ))
    } else if json {
        print_json(dataset)
    } else if summary {
        let width = terminal_size::terminal_size().map(|(width, _)| usize::from(width.0));
        print(&Terminal { colour: true, width }.text(dataset, files))
    } else {
        Ending::Done
    };
    speak::event("end", json!({ "study": dataset.name, "status": status, "points": dataset.record.points }));
    if open {
        show_figure(files);
    }
    match ending {
        Ending::Done if failed => Ending::SomeFailed,
        ending => ending,
    }
}

/// Number of failed points named on standard error; the record names all.
const NAMED_FAILURES: usize = 10;

/// Prints one line of JSON on standard output. A closed pipe (`| head`) is not an error.
fn print_json(dataset: &Dataset) -> Ending {
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    match write_dataset_json(dataset, &mut out).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Ending::Failed(error.to_string()),
        _ => Ending::Done,
    }
}

/// Prints the failed points and those of lower accuracy than requested on standard error.
fn complain(dataset: &Dataset) {
    for failure in dataset.failures.iter().take(NAMED_FAILURES) {
        complain!("{}: {failure}", dataset.name);
    }
    for status in [Accuracy::Truncated, Accuracy::Unchecked].map(Accuracy::status) {
        if let Some(points) = dataset.record.points.get(status) {
            complain!(
                "{}: {points} {status}, less accurate than was asked; the notes in record.json say how far",
                dataset.name
            );
        }
    }
    if dataset.failures.len() > NAMED_FAILURES {
        complain!(
            "{}: and {} more failed points, see record.json",
            dataset.name,
            dataset.failures.len() - NAMED_FAILURES
        );
    }
}

/// Opens the figure among these files in the browser.
pub(crate) fn show_figure(files: &[PathBuf]) {
    match open::figure(files).map(open::show) {
        Some(Ok(())) => {}
        // The results exist even if they cannot be shown.
        Some(Err(message)) => complain!("{message}"),
        None => complain!("there is no figure to show: it is not among the outputs of --only"),
    }
}

/// Runs `stickslip paper`.
pub fn paper(destination: &Destination, open: bool) -> Ending {
    if let Err(error) = check_writable(&destination.out) {
        return Ending::Failed(error.to_string());
    }
    let threads = match pool(destination) {
        Ok(threads) => threads,
        Err(ending) => return ending,
    };
    let context = Context { stop: progress::stop_flag(), ..Context::without_progress(threads) };
    let say = |line: &str| {
        if std::io::stderr().is_terminal() {
            complain!("{line}");
        }
    };
    match stickslip_paper::paper(&destination.out, &context, &say) {
        Err(error) => Ending::Failed(error.to_string()),
        Ok(outcome) => {
            if let ending @ Ending::Failed(_) = print(&outcome.summary) {
                return ending;
            }
            if open && let Err(message) = open::show(&outcome.report) {
                complain!("{message}");
            }
            if context.stopped() {
                Ending::Failed("interrupted; the finished figures are written".to_owned())
            } else if outcome.failed > 0 {
                Ending::SomeFailed
            } else {
                Ending::Done
            }
        }
    }
}

/// Creates the thread pool and returns its number of threads.
fn pool(destination: &Destination) -> Result<usize, Ending> {
    let mut builder = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = destination.threads {
        builder = builder.num_threads(usize::from(threads));
    }
    builder.build_global().map_err(|error| Ending::Failed(format!("no threads: {error}")))?;
    Ok(rayon::current_num_threads())
}
