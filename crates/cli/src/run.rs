//! `stickslip run`, `check` and `paper`.

use crate::args::Destination;
use crate::exit_status::{Exit, print};
use crate::progress::{self, ProgressDisplay};
use crate::{browser, messages};
use serde_json::json;
use std::collections::BTreeSet;
use std::io::{IsTerminal, Read, Write};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stickslip::orbit::Accuracy;
use stickslip_numerics::interrupt::{Interrupted, StopFlag};
use stickslip_report::assemble::{Assembled, Parts, assemble};
use stickslip_report::journal::{Journal, JournalError};
use stickslip_report::output::json::write_dataset_json;
use stickslip_report::stream::{self, Shard, StartMode, StreamError};
use stickslip_report::{Outputs, check_writable, contact_picture, terminal::Terminal, write_file};
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
    fn read(&self) -> Result<Vec<CheckedStudy>, Exit> {
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
        if wrong { Err(Exit::WrongInput) } else { Ok(studies) }
    }

    /// Reads as [`Request::read`] does until `stop` is set: a reduction may take minutes.
    fn read_until(&self, stop: &Arc<AtomicBool>) -> Result<Vec<CheckedStudy>, Exit> {
        let stop = stop.clone();
        let flag = StopFlag::with_callback(move || stop.load(Ordering::Relaxed));
        catch_unwind(AssertUnwindSafe(|| flag.watch(|| self.read()))).unwrap_or_else(|reason| {
            if !reason.is::<Interrupted>() {
                resume_unwind(reason);
            }
            Err(Exit::Failed("interrupted while the study was read; nothing was computed".to_owned()))
        })
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
    if messages::is_for_programs() {
        return messages::error(&error.to_string());
    }
    let report = miette::Report::new(error.clone());
    complain!("{report:?}");
}

/// Runs `stickslip check`, and writes a picture of the contacts of the only study if a file is
/// named for it.
pub fn check(request: &Request<'_>, picture: Option<&Path>) -> Exit {
    match request.read() {
        Err(exit) => exit,
        Ok(studies) => {
            let mut text = String::new();
            for (checked, file) in studies.iter().zip(request.files) {
                let (study, summary) = (checked.study(), print_warnings(checked));
                let (cases, points) = (study.cases(), study.points());
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
                let running = Arc::new(AtomicBool::new(false));
                text.extend(checked.expected_time(&running).map(|time| time.summary_line()));
            }
            let drawn = picture.map(|path| draw_contacts(&studies, path));
            if let (Some(Ok(())), Some(path)) = (&drawn, picture) {
                text += &format!("wrote {}\n", path.display());
            }
            match (drawn, print(&text)) {
                (Some(Err(problem)), _) => {
                    complain!("error: {problem}");
                    Exit::WrongInput
                }
                (_, exit) => exit,
            }
        }
    }
}

/// Writes a picture of the contacts of the only study.
fn draw_contacts(studies: &[CheckedStudy], path: &Path) -> Result<(), String> {
    let [checked] = studies else {
        return Err(format!("--picture draws one study, but there are {}; name one file", studies.len()));
    };
    let contacts = &checked.summary().contacts;
    let mesh = checked.study().mesh().filter(|_| !contacts.is_empty());
    let mesh = mesh.ok_or("--picture draws a [[contact]] of a mesh, but the study has none; remove --picture")?;
    let name = checked.study().name();
    let picture = contact_picture(&mesh.mesh, contacts, &format!("contacts of {name}"));
    write_file(path, &picture.map_err(|error| error.to_string())?).map(|_| ()).map_err(|error| error.to_string())
}

/// Options of a run.
pub struct RunOptions<'a> {
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
    pub start: StartMode,
    /// `--shard`.
    pub shard: Option<Shard>,
    /// `--progress`.
    pub progress: crate::args::Progress,
}

/// Returns the summary of a study, and prints its warnings on standard error.
fn print_warnings(checked: &CheckedStudy) -> &ModelSummary {
    checked.summary().warnings.iter().for_each(|warning| complain!("{warning}"));
    checked.summary()
}

/// Returns the outputs of `--only`, or the default ones, together with those of `--also`.
pub(crate) fn outputs(only: &[String], also: &[String]) -> Result<Outputs, Exit> {
    let outputs = if only.is_empty() { Ok(Outputs::defaults()) } else { Outputs::select(only) };
    outputs.and_then(|outputs| Ok(outputs.union(&Outputs::select(also)?))).map_err(|error| {
        complain!("error: {error}");
        Exit::WrongInput
    })
}

/// Runs `stickslip run`.
pub fn run(request: &Request<'_>, destination: &Destination, options: &RunOptions<'_>) -> Exit {
    if options.progress == crate::args::Progress::Json {
        messages::for_programs();
    }
    let outputs = match outputs(options.only, options.also) {
        Ok(outputs) => outputs,
        Err(exit) => return exit,
    };
    if options.watch && request.files.iter().any(|file| file == Path::new(STDIN)) {
        complain!("error: --watch needs files, not standard input");
        return Exit::WrongInput;
    }
    let threads = match pool(destination.threads) {
        Ok(threads) => threads,
        Err(exit) => return exit,
    };
    let stop = progress::stop_flag();
    let workers = Workers { threads, stop: &stop };
    let mut open = options.open;
    loop {
        let before = read_all(request.files);
        let exit = once(request, destination, &outputs, &RunOptions { open, ..*options }, workers);
        if !options.watch || stop.load(Ordering::Relaxed) {
            return exit;
        }
        // The browser shows the figure after the first run; a reload shows later ones.
        open &= matches!(exit, Exit::WrongInput);
        if let Exit::Failed(message) = &exit {
            messages::error(message);
        }
        complain!("waiting for a change of the files; Ctrl-C ends");
        while read_all(request.files) == before {
            std::thread::sleep(POLL_INTERVAL);
            if stop.load(Ordering::Relaxed) {
                return Exit::Done;
            }
        }
        // A file can be empty for a moment while an editor writes it.
        loop {
            let now = read_all(request.files);
            std::thread::sleep(SETTLE_TIME);
            if read_all(request.files) == now {
                break;
            }
        }
    }
}

/// Interval between two checks of the files for changes.
const POLL_INTERVAL: Duration = Duration::from_millis(300);
/// Changed files are read when they stay unchanged for this time.
const SETTLE_TIME: Duration = Duration::from_millis(50);

/// Returns the contents of the files. Modification times do not reveal every change by an
/// editor.
fn read_all(files: &[PathBuf]) -> Vec<Option<Vec<u8>>> {
    files.iter().map(|file| std::fs::read(file).ok()).collect()
}

/// Threads of a run, and the flag that stops them.
#[derive(Clone, Copy)]
struct Workers<'a> {
    threads: usize,
    stop: &'a Arc<AtomicBool>,
}

/// Runs all files once.
fn once(
    request: &Request<'_>,
    destination: &Destination,
    outputs: &Outputs,
    options: &RunOptions<'_>,
    workers: Workers<'_>,
) -> Exit {
    let studies = match request.read_until(workers.stop) {
        Ok(studies) => studies,
        Err(exit) => return exit,
    };
    let mut names = BTreeSet::new();
    if let Some(twice) = studies.iter().map(CheckedStudy::study).find(|study| !names.insert(study.name())) {
        complain!(
            "error: two files have the name `{}`, so their results would be in the same folder; rename one file",
            twice.name()
        );
        return Exit::WrongInput;
    }
    if let Some(error) =
        studies.iter().find_map(|checked| check_writable(&destination.out.join(checked.study().name())).err())
    {
        return Exit::Failed(error.to_string());
    }
    let mut failed = false;
    // Each study is dropped after its run, together with its cached case.
    for checked in studies {
        let (study, summary) = (checked.study(), print_warnings(&checked));
        let time = checked.expected_time(workers.stop);
        if std::io::stderr().is_terminal() && options.progress == crate::args::Progress::Bar {
            let line = time.map_or_else(String::new, |time| time.summary_line());
            complain!("{}\n{}", study.title(), format!("{summary}{line}").trim_end());
        } else if let Some(long) = time.and_then(|time| time.announcement()) {
            complain!("{}: {long}", study.name());
        }
        match one(&checked, destination, outputs, options, workers) {
            Exit::Done => {}
            Exit::SomeFailed => failed = true,
            other => return other,
        }
    }
    if failed { Exit::SomeFailed } else { Exit::Done }
}

/// Runs one study once.
fn one(
    checked: &CheckedStudy,
    destination: &Destination,
    outputs: &Outputs,
    options: &RunOptions<'_>,
    workers: Workers<'_>,
) -> Exit {
    let Workers { threads, stop } = workers;
    let study = checked.study();
    let mut journal = match stream::begin(checked, &destination.out, options.shard, options.start, threads) {
        Ok(journal) => journal,
        Err(error @ (StreamError::DifferentRun { .. } | StreamError::Unfinished { .. } | StreamError::Name(_))) => {
            messages::error(&error.to_string());
            return Exit::WrongInput;
        }
        Err(error) => return Exit::Failed(error.to_string()),
    };
    let done: u64 = journal.tally().points().values().sum();
    let range = journal.head().range.clone();
    // The number of points of adaptive frequencies and of a shard is unknown in advance.
    let points = Some(study.points() as u64).filter(|_| !study.is_adaptive() && options.shard.is_none());
    messages::event(
        "begin",
        json!({ "study": study.name(), "kind": study.kind().name, "points": points, "units": journal.head().units,
                "from": range.start, "to": range.end, "kept": journal.units().len() }),
    );
    if !journal.units().is_empty() {
        complain!(
            "{}: {} of {} units of work come from an earlier run",
            study.name(),
            journal.units().len(),
            range.len()
        );
    }
    let progress = ProgressDisplay::new(options.progress, points, done, study.name());
    let counter = progress.clone();
    let context = Context { threads, stop: stop.clone(), finished: Arc::new(move || counter.point()) };
    let computed =
        stream::compute(checked, &mut journal, &context, &|journal| progress.kept(journal.synced_end() - range.start));
    progress.end();
    let rest = match computed {
        Ok(rest) => rest,
        Err(StreamError::Journal(JournalError::Study(error))) => {
            show(&error);
            return Exit::WrongInput;
        }
        Err(error) => return Exit::Failed(error.to_string()),
    };
    if let Some(shard) = options.shard {
        return finish_shard(study, shard, &mut journal, rest.is_empty());
    }
    let folder = journal.folder().to_owned();
    let mut outline = journal.head().outline.clone();
    outline.record.threads = threads;
    let parts = Parts { outline: &outline, journals: std::slice::from_ref(&journal), unjournaled: &rest };
    let assembled = match assemble(&parts, study, outputs, &destination.out, &folder) {
        Ok(assembled) => assembled,
        Err(error) => {
            return Exit::Failed(format!(
                "{error}; the computed units are in {}: --resume writes the results from them",
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
    let exit = report(&assembled, &outline.notes, Display { json: options.json, open: options.open });
    match exit {
        Exit::Done | Exit::SomeFailed if stop.load(Ordering::Relaxed) => {
            let whole = destination.out.join(study.name());
            let results = assembled.files.first().and_then(|file| file.parent()).unwrap_or(&whole);
            let earlier = if results == whole || !interrupted {
                String::new()
            } else {
                format!("; the complete run in {} is unchanged", whole.join("").display())
            };
            let resume = if interrupted { "; continue with --resume" } else { "" };
            let what = match assembled.dataset.tables.iter().all(|table| table.rows() == 0) {
                _ if assembled.files.is_empty() => {
                    "interrupted before a further point was finished; the earlier results stay in"
                }
                true => {
                    "interrupted before any unit of work was finished (a block of points, or a whole branch); \
                     the record is in"
                }
                false => "interrupted; the finished points are in",
            };
            Exit::Failed(format!("{what} {}{earlier}{resume}", results.join("").display()))
        }
        exit => exit,
    }
}

/// Ends a run of a shard, whose journal stays.
fn finish_shard(study: &Study, shard: Shard, journal: &mut Journal, whole: bool) -> Exit {
    let folder = journal.folder().join("").display().to_string();
    if !whole {
        return Exit::Failed(format!("interrupted; the finished units are in {folder}; continue with --resume"));
    }
    if let Err(error) = journal.seal() {
        return Exit::Failed(error.to_string());
    }
    let failed = journal.tally().points().keys().any(|status| status != CONVERGED);
    messages::event(
        "end",
        json!({ "study": study.name(), "status": if failed { "some-failed" } else { "done" }, "points": journal.tally().points() }),
    );
    if !messages::is_for_programs() {
        complain!(
            "{}: part {shard} is in {folder}; when all parts are computed, merge them with `stickslip merge`",
            study.name()
        );
    }
    if failed { Exit::SomeFailed } else { Exit::Done }
}

/// Optional outputs of a command besides the files that it writes.
#[derive(Clone, Copy)]
pub(crate) struct Display {
    /// `true` prints the results as JSON.
    pub json: bool,
    /// `true` opens the figure in the browser.
    pub open: bool,
}

/// Prints the messages about written results, except the notes in `known`.
pub(crate) fn report(assembled: &Assembled, known: &[String], display: Display) -> Exit {
    let Display { json, open } = display;
    let Assembled { dataset, is_whole, files } = assembled;
    let late = dataset.notes.iter().filter(|note| note.starts_with("warning") && !known.contains(note));
    late.for_each(|warning| complain!("{warning}"));
    let failed = dataset.record.points.keys().any(|status| status != CONVERGED);
    let status = match (dataset.record.interrupted, failed) {
        (true, _) => "interrupted",
        (false, true) => "some-failed",
        (false, false) => "done",
    };
    messages::event("written", json!({ "study": dataset.name, "files": files }));
    // The summary on a terminal contains these messages.
    let summary = !json && std::io::stdout().is_terminal();
    if !(summary && std::io::stderr().is_terminal()) {
        complain(dataset);
    }
    let exit = if json && !is_whole {
        Exit::Failed(format!(
            "--json cannot print tables with more than {MAX_ROWS} rows; the results are in {}",
            files.first().map_or(String::new(), |file| file.with_file_name("").display().to_string())
        ))
    } else if json {
        print_json(dataset)
    } else if summary {
        let width = terminal_size::terminal_size().map(|(width, _)| usize::from(width.0));
        print(&Terminal { colour: true, width }.text(dataset, files))
    } else {
        Exit::Done
    };
    messages::event("end", json!({ "study": dataset.name, "status": status, "points": dataset.record.points }));
    if open {
        show_figure(files);
    }
    match exit {
        Exit::Done if failed => Exit::SomeFailed,
        exit => exit,
    }
}

/// Prints one line of JSON on standard output. A closed pipe (`| head`) is not an error.
fn print_json(dataset: &Dataset) -> Exit {
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    match write_dataset_json(dataset, &mut out).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Exit::Failed(error.to_string()),
        _ => Exit::Done,
    }
}

/// Returns the ending of a noun with this count.
fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

/// Prints the failed points and those of lower accuracy than requested on standard error.
fn complain(dataset: &Dataset) {
    // Number of failed points named on standard error; the record names all.
    let named_failures = 10;
    let failures = dataset.failures_by_reason();
    for (failure, _) in failures.iter().take(named_failures) {
        complain!("{}: {failure}", dataset.name);
    }
    for status in [Accuracy::Truncated, Accuracy::Unchecked].map(Accuracy::status) {
        if let Some(points) = dataset.record.points.get(status) {
            let error = match status == Accuracy::Unchecked.status() {
                true => "the error was not estimated",
                false => "the estimated error exceeds the tolerance",
            };
            let plural = plural(*points as usize);
            complain!("{}: {points} point{plural} {status}: {error}, see the notes in record.json", dataset.name);
        }
    }
    let more: usize = failures.iter().skip(named_failures).map(|(_, count)| count).sum();
    if more > 0 {
        complain!("{}: and {more} more failed point{}, see record.json", dataset.name, plural(more));
    }
}

/// Opens the figure among these files in the browser.
pub(crate) fn show_figure(files: &[PathBuf]) {
    match browser::figure(files).map(browser::show) {
        Some(Ok(())) => {}
        // The results exist even if they cannot be shown.
        Some(Err(message)) => complain!("{message}"),
        None => complain!("no figure to open: --only does not include svg, png or html"),
    }
}

/// Runs `stickslip paper`.
pub fn paper(destination: &Destination, open: bool) -> Exit {
    if let Err(error) = check_writable(&destination.out) {
        return Exit::Failed(error.to_string());
    }
    let threads = match pool(destination.threads) {
        Ok(threads) => threads,
        Err(exit) => return exit,
    };
    let context = Context { stop: progress::stop_flag(), ..Context::without_progress(threads) };
    let say = |line: &str| {
        if std::io::stderr().is_terminal() {
            complain!("{line}");
        }
    };
    match stickslip_paper::paper(&destination.out, &context, &say) {
        Err(error) => Exit::Failed(error.to_string()),
        Ok(outcome) => {
            if let exit @ Exit::Failed(_) = print(&outcome.summary) {
                return exit;
            }
            if open && let Err(message) = browser::show(&outcome.report) {
                complain!("{message}");
            }
            if context.stopped() {
                Exit::Failed("interrupted; the finished figures were written".to_owned())
            } else if outcome.failed > 0 {
                Exit::SomeFailed
            } else {
                Exit::Done
            }
        }
    }
}

/// Creates the thread pool and returns its number of threads.
pub(crate) fn pool(threads: Option<u16>) -> Result<usize, Exit> {
    let mut builder = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = threads {
        builder = builder.num_threads(usize::from(threads));
    }
    builder.build_global().map_err(|error| Exit::Failed(format!("cannot create threads: {error}")))?;
    Ok(rayon::current_num_threads())
}
