//! `stickslip run`, `check` and `paper`.

use crate::args::Place;
use crate::{Ending, paper, print, progress};
use std::collections::BTreeSet;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use stickslip::orbit::Accuracy;
use stickslip_report::{Outputs, terminal::Terminal, write_dataset};
use stickslip_study::dataset::Dataset;
use stickslip_study::run::{CONVERGED, Context, check as check_study, run as run_study};
use stickslip_study::summary::ModelSummary;
use stickslip_study::{Study, StudyError, read_file};

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
    fn read(&self) -> Result<Vec<Study>, Ending> {
        let mut studies = Vec::new();
        let mut wrong = false;
        for file in self.files {
            let study = read_file(file, self.set)
                .and_then(|study| match self.method {
                    Some(method) => study.with_method(method),
                    None => Ok(study),
                })
                .map(|study| match self.memory {
                    Some(bytes) => study.with_memory_limit(bytes),
                    None => study,
                })
                .and_then(|study| check_study(&study).map(|()| study));
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

/// Prints an error of a study file with its place underlined.
fn show(error: &StudyError) {
    let report = miette::Report::new(error.clone());
    eprintln!("{report:?}");
}

/// `stickslip check`.
pub fn check(request: &Request<'_>) -> Ending {
    match request.read() {
        Err(ending) => ending,
        Ok(studies) => {
            let mut text = String::new();
            for (study, file) in studies.iter().zip(request.files) {
                let (cases, points) = (study.cases(), study.points());
                let plural = |count: usize| if count == 1 { "" } else { "s" };
                let summary = summary(study);
                let verdict = match summary.as_ref().map_or(0, |summary| summary.warnings.len()) {
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
                text += &summary.map(|summary| summary.to_string()).unwrap_or_default();
            }
            print(&text)
        }
    }
}

/// What is known of a study before it is run, with its warnings on standard error.
fn summary(study: &Study) -> Option<ModelSummary> {
    // the study was checked, and its summary with it
    let summary = ModelSummary::new(study).ok()?;
    summary.warnings.iter().for_each(|warning| eprintln!("{warning}"));
    Some(summary)
}

/// `stickslip run`.
pub fn run(request: &Request<'_>, place: &Place, only: &[String], json: bool) -> Ending {
    let outputs = match if only.is_empty() { Ok(Outputs::all()) } else { Outputs::only(only) } {
        Ok(outputs) => outputs,
        Err(error) => {
            eprintln!("error: {error}");
            return Ending::WrongInput;
        }
    };
    let studies = match request.read() {
        Ok(studies) => studies,
        Err(ending) => return ending,
    };
    let mut names = BTreeSet::new();
    if let Some(twice) = studies.iter().find(|study| !names.insert(study.name())) {
        eprintln!("error: two files are called `{}`, their results would be in one folder; rename one", twice.name());
        return Ending::WrongInput;
    }
    let threads = match pool(place) {
        Ok(threads) => threads,
        Err(ending) => return ending,
    };
    let stop = progress::stop_flag();
    let mut failed = false;
    for study in &studies {
        let summary = summary(study);
        if let Some(summary) = summary.as_ref().filter(|_| std::io::stderr().is_terminal()) {
            eprint!("{}\n{summary}", study.title());
        }
        let bar = progress::bar(study.points() as u64, study.name());
        let finished = || bar.inc(1);
        let result = run_study(study, &Context { threads, stop, finished: &finished });
        bar.finish_and_clear();
        let dataset = match result {
            Ok(dataset) => dataset,
            Err(error) => {
                show(&error);
                return Ending::WrongInput;
            }
        };
        // those of the summary stand there already
        let known = |note: &&String| summary.as_ref().is_some_and(|summary| summary.warnings.contains(note));
        let late = dataset.notes.iter().filter(|note| note.starts_with("warning") && !known(note));
        late.for_each(|warning| eprintln!("{warning}"));
        failed |= dataset.record.points.keys().any(|status| status != CONVERGED);
        if let Err(ending) = write(&dataset, &place.out, &outputs, json) {
            return ending;
        }
        if stop.load(Ordering::Relaxed) {
            return Ending::Failed("interrupted; the finished points are written".to_owned());
        }
    }
    if failed { Ending::SomeFailed } else { Ending::Done }
}

/// Failed points that are named on standard error; the record has all.
const NAMED_FAILURES: usize = 10;

fn write(dataset: &Dataset, out: &Path, outputs: &Outputs, json: bool) -> Result<(), Ending> {
    let files = write_dataset(dataset, out, outputs).map_err(|error| Ending::Failed(error.to_string()))?;
    for failure in dataset.failures.iter().take(NAMED_FAILURES) {
        eprintln!("{}: failed at {}: {}", dataset.name, failure.at, failure.reason);
    }
    for status in [Accuracy::Truncated, Accuracy::Unchecked].map(Accuracy::status) {
        if let Some(points) = dataset.record.points.get(status) {
            eprintln!(
                "{}: {points} {status}, less accurate than was asked; the notes in record.json say how far",
                dataset.name
            );
        }
    }
    if dataset.failures.len() > NAMED_FAILURES {
        eprintln!(
            "{}: and {} more failed points, see record.json",
            dataset.name,
            dataset.failures.len() - NAMED_FAILURES
        );
    }
    let ending = if json {
        match serde_json::to_string(dataset) {
            Ok(text) => print(&(text + "\n")),
            Err(error) => Ending::Failed(error.to_string()),
        }
    } else if std::io::stdout().is_terminal() {
        print(&Terminal { colour: true }.text(dataset, &files))
    } else {
        Ending::Done
    };
    if let Ending::Failed(_) = ending { Err(ending) } else { Ok(()) }
}

/// `stickslip paper`.
pub fn paper(place: &Place) -> Ending {
    let threads = match pool(place) {
        Ok(threads) => threads,
        Err(ending) => return ending,
    };
    let context = Context { threads, stop: progress::stop_flag(), finished: &|| () };
    let say = |line: &str| {
        if std::io::stderr().is_terminal() {
            eprintln!("{line}");
        }
    };
    match paper::paper(&place.out, &context, &say) {
        Err(error) => Ending::Failed(error.to_string()),
        Ok(outcome) => {
            if let ending @ Ending::Failed(_) = print(&outcome.summary) {
                return ending;
            }
            if context.stop.load(Ordering::Relaxed) {
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
