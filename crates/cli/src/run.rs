//! `stickslip run`, `check` and `paper`.

use crate::args::Place;
use crate::{Ending, open, print, progress};
use std::collections::BTreeSet;
use std::io::{IsTerminal, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stickslip::orbit::Accuracy;
use stickslip_report::{Outputs, check_writable, json::write_dataset_json, terminal::Terminal, write_dataset};
use stickslip_study::dataset::Dataset;
use stickslip_study::run::{CONVERGED, Checked, Context, check as check_study};
use stickslip_study::schema::MOST_BYTES;
use stickslip_study::summary::ModelSummary;
use stickslip_study::{Study, StudyError, read_bytes, read_file};

/// The studies that a command line names.
pub struct Request<'a> {
    /// Study files.
    pub files: &'a [PathBuf],
    /// `--set`.
    pub set: &'a [(String, String)],
    /// `--method`.
    pub method: Option<&'a str>,
    /// `--memory`, bytes.
    pub memory: Option<u64>,
}

impl Request<'_> {
    /// Reads and checks every file before anything runs.
    fn read(&self) -> Result<Vec<Checked>, Ending> {
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
                // of many studies, large ones perhaps, none keeps what its run makes again
                .map(|checked| if self.files.len() > 1 { checked.lean() } else { checked });
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

/// What stands for standard input among files.
const STDIN: &str = "-";

/// Reads a study from a file, or from standard input.
fn read(file: &Path, set: &[(String, String)]) -> Result<Study, StudyError> {
    if file != Path::new(STDIN) {
        return read_file(file, set);
    }
    let mut bytes = Vec::new();
    // what was read before an error is no whole study either
    match std::io::stdin().lock().take(MOST_BYTES + 1).read_to_end(&mut bytes) {
        Ok(_) => read_bytes("stdin", &bytes, set),
        Err(_) => read_bytes("stdin", &[], set),
    }
}

/// Prints an error of a study file with its place underlined.
pub(crate) fn show(error: &StudyError) {
    let report = miette::Report::new(error.clone());
    complain!("{report:?}");
}

/// `stickslip check`.
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

/// What a run is to yield.
pub struct Wanted<'a> {
    /// `--only`.
    pub only: &'a [String],
    /// `--json`.
    pub json: bool,
    /// `--open`.
    pub open: bool,
    /// `--watch`.
    pub watch: bool,
}

/// What is known of a study before it is run, with its warnings on standard error.
fn warned(checked: &Checked) -> &ModelSummary {
    checked.summary().warnings.iter().for_each(|warning| complain!("{warning}"));
    checked.summary()
}

/// The outputs that `--only` names; all without it.
pub(crate) fn outputs(only: &[String]) -> Result<Outputs, Ending> {
    let outputs = if only.is_empty() { Ok(Outputs::all()) } else { Outputs::only(only) };
    outputs.map_err(|error| {
        complain!("error: {error}");
        Ending::WrongInput
    })
}

/// `stickslip run`.
pub fn run(request: &Request<'_>, place: &Place, wanted: &Wanted<'_>) -> Ending {
    let outputs = match outputs(wanted.only) {
        Ok(outputs) => outputs,
        Err(ending) => return ending,
    };
    if wanted.watch && request.files.iter().any(|file| file == Path::new(STDIN)) {
        complain!("error: standard input does not change, --watch needs files");
        return Ending::WrongInput;
    }
    let threads = match pool(place) {
        Ok(threads) => threads,
        Err(ending) => return ending,
    };
    let stop = progress::stop_flag();
    let mut open = wanted.open;
    loop {
        let before = contents(request.files);
        let ending = once(request, place, (&outputs, wanted.json, open), threads, &stop);
        if !wanted.watch || stop.load(Ordering::Relaxed) {
            return ending;
        }
        // the browser shows it; a reload shows what follows
        open &= matches!(ending, Ending::WrongInput);
        if let Ending::Failed(message) = &ending {
            complain!("error: {message}");
        }
        complain!("waiting for a change; Ctrl-C ends");
        while contents(request.files) == before {
            std::thread::sleep(LOOK);
            if stop.load(Ordering::Relaxed) {
                return Ending::Done;
            }
        }
    }
}

/// How often files are looked at.
const LOOK: Duration = Duration::from_millis(300);

/// What stands in the files; editors write them in ways that no date tells.
fn contents(files: &[PathBuf]) -> Vec<Option<Vec<u8>>> {
    files.iter().map(|file| std::fs::read(file).ok()).collect()
}

/// One run of all files.
fn once(
    request: &Request<'_>,
    place: &Place,
    (outputs, json, open): (&Outputs, bool, bool),
    threads: usize,
    stop: &Arc<AtomicBool>,
) -> Ending {
    let studies = match request.read() {
        Ok(studies) => studies,
        Err(ending) => return ending,
    };
    let mut names = BTreeSet::new();
    if let Some(twice) = studies.iter().map(Checked::study).find(|study| !names.insert(study.name())) {
        complain!("error: two files are called `{}`, their results would be in one folder; rename one", twice.name());
        return Ending::WrongInput;
    }
    if let Some(error) =
        studies.iter().find_map(|checked| check_writable(&place.out.join(checked.study().name())).err())
    {
        return Ending::Failed(error.to_string());
    }
    let mut failed = false;
    // each is let go once it was run, with the case that it keeps
    for checked in studies {
        let (study, summary) = (checked.study(), warned(&checked));
        if std::io::stderr().is_terminal() {
            complain_on!("{}\n{summary}", study.title());
        } else if let Some(long) = summary.long_run() {
            complain!("{}: {long}", study.name());
        }
        // of adaptive frequencies nobody knows the number before
        let points = Some(study.points() as u64).filter(|_| !study.is_adaptive());
        let bar = progress::bar(points, study.name());
        let counter = bar.clone();
        let context = Context { threads, stop: stop.clone(), finished: Arc::new(move || counter.inc(1)) };
        let result = checked.run(&context);
        bar.finish_and_clear();
        let dataset = match result {
            Ok(dataset) => dataset,
            Err(error) => {
                show(&error);
                return Ending::WrongInput;
            }
        };
        // those of the summary stand there already
        let known = |note: &&String| summary.warnings.contains(note);
        let late = dataset.notes.iter().filter(|note| note.starts_with("warning") && !known(note));
        late.for_each(|warning| complain!("{warning}"));
        failed |= dataset.record.points.keys().any(|status| status != CONVERGED);
        let files = match write(&dataset, &place.out, outputs, json) {
            Ok(files) => files,
            Err(ending) => return ending,
        };
        if open {
            show_figure(&files);
        }
        let folder = files.first().and_then(|file| file.parent()).unwrap_or(&place.out);
        if stop.load(Ordering::Relaxed) {
            let whole = place.out.join(study.name());
            let beside = if folder == whole || !dataset.record.interrupted {
                String::new()
            } else {
                format!("; the whole run in {} stays", whole.join("").display())
            };
            return Ending::Failed(format!(
                "interrupted; the finished points are in {}{beside}",
                folder.join("").display()
            ));
        }
    }
    if failed { Ending::SomeFailed } else { Ending::Done }
}

/// Failed points that are named on standard error; the record has all.
const NAMED_FAILURES: usize = 10;

/// One line of JSON on standard output; a reader that has gone away (`| head`) is no error.
fn print_json(dataset: &Dataset) -> Ending {
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    match write_dataset_json(dataset, &mut out).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Ending::Failed(error.to_string()),
        _ => Ending::Done,
    }
}

/// Points that failed or are not what was asked for, on standard error.
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

/// Shows the figure among these files in the browser.
pub(crate) fn show_figure(files: &[PathBuf]) {
    match open::figure(files).map(open::show) {
        Some(Ok(())) => {}
        // the results are there all the same
        Some(Err(message)) => complain!("{message}"),
        None => complain!("there is no figure to show: it is not among the outputs of --only"),
    }
}

/// Writes the results and says what there is to say; returns the files.
fn write(dataset: &Dataset, out: &Path, outputs: &Outputs, json: bool) -> Result<Vec<PathBuf>, Ending> {
    let files = write_dataset(dataset, out, outputs).map_err(|error| Ending::Failed(error.to_string()))?;
    // the summary on a terminal says it too
    let summary = !json && std::io::stdout().is_terminal();
    if !(summary && std::io::stderr().is_terminal()) {
        complain(dataset);
    }
    let ending = if json {
        print_json(dataset)
    } else if summary {
        let width = terminal_size::terminal_size().map(|(width, _)| usize::from(width.0));
        print(&Terminal { colour: true, width }.text(dataset, &files))
    } else {
        Ending::Done
    };
    if let Ending::Failed(_) = ending { Err(ending) } else { Ok(files) }
}

/// `stickslip paper`.
pub fn paper(place: &Place, open: bool) -> Ending {
    if let Err(error) = check_writable(&place.out) {
        return Ending::Failed(error.to_string());
    }
    let threads = match pool(place) {
        Ok(threads) => threads,
        Err(ending) => return ending,
    };
    let context = Context { stop: progress::stop_flag(), ..Context::unwatched(threads) };
    let say = |line: &str| {
        if std::io::stderr().is_terminal() {
            complain!("{line}");
        }
    };
    match stickslip_paper::paper(&place.out, &context, &say) {
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

/// Sets up the threads; returns their number.
fn pool(place: &Place) -> Result<usize, Ending> {
    let mut builder = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = place.threads {
        builder = builder.num_threads(usize::from(threads));
    }
    builder.build_global().map_err(|error| Ending::Failed(format!("no threads: {error}")))?;
    Ok(rayon::current_num_threads())
}
