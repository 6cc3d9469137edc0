//! Runs a study: checks every case (so that what a method cannot take is found before anything is computed), computes its units on all
//! threads, joins their parts in order, lets the kind draw its figure, and adds the record.

use crate::dataset::{Dataset, Figure, Record, Table};
use crate::drawing::Drawing;
use crate::error::StudyError;
use crate::kinds;
use crate::note::Note;
use crate::study::Study;
use crate::summary::ModelSummary;
use crate::work::{Part, Units, Work, refused};
use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};
use stickslip::method::Choice;

pub use crate::work::{CONVERGED, Context, NOT_REACHED, Prepared};

/// Runs a study.
///
/// # Errors
/// [`StudyError`]: the method cannot take the model, or too much memory would be needed; nothing was computed. Points that do not converge are no error: they are in the
/// dataset, as failures.
///
/// # Example
/// ```
/// use stickslip_study::{read_study, run::{Context, run}};
/// let text = stickslip_study::templates::find("element").unwrap().study;
/// let study = read_study("element.toml", text, &[]).unwrap();
/// let dataset = run(&study, &Context::unwatched(1)).unwrap();
/// let loss = dataset.tables[1].numbers("dissipation_J").unwrap();
/// assert!((loss[1] - 4e-6).abs() < 1e-15);   // 4 Ft (a - Ft/kt), a = 2 mm
/// ```
pub fn run(study: &Study, context: &Context) -> Result<Dataset, StudyError> {
    check(study)?.run(context)
}

/// A study that can be run: it was surveyed, every case was prepared once, and it fits into memory.
#[derive(Debug)]
pub struct Checked {
    study: Study,
    summary: ModelSummary,
    /// What finds the orbits of the cases, in words, each once.
    methods: Vec<String>,
    /// The first case, if it is kept: in many studies, large ones above all, it is the only one.
    first: Option<Arc<Prepared>>,
    /// What the check took.
    time: Duration,
}

/// Prepares every case and computes nothing: whether the study can be run, and what is known of it before.
///
/// # Errors
/// [`StudyError`]: the method cannot take the model of a case, or the study needs more memory than it may take.
///
/// # Example
/// ```
/// use stickslip_study::{read_study, run::{Context, check}};
/// let text = stickslip_study::templates::find("element").unwrap().study;
/// let checked = check(&read_study("element.toml", text, &[]).unwrap()).unwrap();
/// assert_eq!(checked.summary().joints.len(), 1);
/// assert_eq!(checked.run(&Context::unwatched(1)).unwrap().tables.len(), 2);
/// ```
pub fn check(study: &Study) -> Result<Checked, StudyError> {
    let start = Instant::now();
    let summary = ModelSummary::new(study)?;
    if let Some(error) = summary.size.refusal(study) {
        return Err(error);
    }
    let mut choices = BTreeSet::new();
    let mut choose = |prepared: &Prepared| {
        if study.kind().uses_method {
            choices.insert(prepared.method.choice(&prepared.system));
        }
    };
    let first = Arc::new(Prepared::new(study, 0)?);
    choose(&first);
    for index in 1..study.cases() {
        choose(&Prepared::new(study, index)?);
    }
    let methods = choices.iter().map(Choice::to_string).collect();
    Ok(Checked { study: study.clone(), summary, methods, first: Some(first), time: start.elapsed() })
}

impl Checked {
    /// The study.
    pub fn study(&self) -> &Study {
        &self.study
    }

    /// What is known of it before it is run.
    pub fn summary(&self) -> &ModelSummary {
        &self.summary
    }

    /// The same without its first case, for who holds many studies: of 2000 masses it has 0.1 GB, and a run prepares it again.
    #[must_use]
    pub fn lean(self) -> Checked {
        Checked { first: None, ..self }
    }

    /// Computes it.
    ///
    /// # Errors
    /// [`StudyError`]: a search between the cases met a model that the method cannot take. Points that do not converge are no error: they
    /// are in the dataset, as failures.
    pub fn run(&self, context: &Context) -> Result<Dataset, StudyError> {
        let start = Instant::now();
        let study = &self.study;
        let first = match &self.first {
            Some(first) => first.clone(),
            None => Arc::new(Prepared::new(study, 0)?),
        };
        let part = parts(study, &first, context)?;
        let interrupted = part.points.contains_key(NOT_REACHED);
        let mut dataset = self.outline(context.threads);
        dataset.notes.extend(part.notes.iter().filter_map(Note::text));
        if interrupted {
            dataset.notes.push("The run was interrupted; only the points finished until then are here.".to_owned());
        }
        let tables = study.kind().tables.iter().zip(part.tables).map(|(name, rows)| rows.table(name));
        // a table that nothing was ever written to has no columns either
        dataset.tables = tables.filter(|table| !table.columns.is_empty()).collect();
        dataset.figure = redrawn(study, &dataset.tables);
        dataset.failures = part.failures;
        dataset.record.wall_time_s += start.elapsed().as_secs_f64();
        dataset.record.points = part.points;
        dataset.record.interrupted = interrupted;
        Ok(dataset)
    }

    /// What is known of the results before anything is computed.
    pub fn outline(&self, threads: usize) -> Dataset {
        let Checked { study, summary, methods, .. } = self;
        let mut notes = summary.warnings.clone();
        notes.extend(study.notes());
        Dataset {
            name: study.name().to_owned(),
            title: study.title().to_owned(),
            source: study.source().map(str::to_owned),
            kind: study.kind().name.to_owned(),
            tables: Vec::new(),
            figure: Figure::default(),
            notes,
            failures: Vec::new(),
            record: Record {
                version: env!("CARGO_PKG_VERSION").to_owned(),
                study: recorded(study, summary),
                methods: methods.clone(),
                seed: None,
                threads,
                wall_time_s: self.time.as_secs_f64(),
                points: BTreeMap::new(),
                interrupted: false,
            },
        }
    }
}

/// The figure of finished tables, computed just now or read from a disk. Tables that are none of this study have an empty figure.
pub fn redrawn(study: &Study, tables: &[Table]) -> Figure {
    Figure { title: study.title().to_owned(), ..(kinds::of(study).draw)(&Drawing { study, tables }) }
}

/// The study as it was understood, and its summary.
fn recorded(study: &Study, summary: &ModelSummary) -> serde_json::Value {
    let mut record = study.resolved();
    record["summary"] = summary.to_json();
    record
}

/// The units of a study.
fn units(study: &Study) -> Units {
    Units::of(study, (kinds::of(study).grain)(study))
}

/// Units that may be under way or waiting for their turn, per thread: enough that none waits for a long one, few enough to keep little.
const AHEAD: usize = 8;
/// How often a run looks whether it is to stop.
const LOOK: Duration = Duration::from_millis(20);
/// How long an interrupted run waits for what is under way, which ends with the orbit that it is at: less than the second that a user
/// waits gladly.
const GRACE: Duration = Duration::from_millis(500);

/// Computes all units and joins their parts in order.
///
/// Units run as tasks of the pool that own what they need, so that an interrupted run can leave behind one that does not end.
fn parts(study: &Study, first: &Arc<Prepared>, context: &Context) -> Result<Part, StudyError> {
    let units = units(study);
    let shared = Arc::new(study.clone());
    let (send, receive) = mpsc::channel();
    let mut whole = Part::default();
    let mut waiting: BTreeMap<usize, Part> = BTreeMap::new();
    let (mut begun, mut joined) = (0, 0);
    let mut deadline: Option<Instant> = None;
    while joined < units.len() {
        if deadline.is_none() && context.stopped() {
            deadline = Some(Instant::now() + GRACE);
        }
        while begun < units.len() && begun < joined + AHEAD * context.threads.max(1) && deadline.is_none() {
            let (study, first, context) = (shared.clone(), first.clone(), context.clone());
            let (send, index) = (send.clone(), begun);
            rayon::spawn_fifo(move || {
                // nobody listens any more if the run was left
                let part = catch_unwind(AssertUnwindSafe(|| compute(&study, &first, index, &context)));
                let _ = send.send((index, part));
            });
            begun += 1;
        }
        match next(&receive) {
            Some((index, part)) => {
                // a bug in a unit is one of the run
                waiting.insert(index, part.unwrap_or_else(|panic| resume_unwind(panic))?);
            }
            None if deadline.is_some_and(|deadline| Instant::now() >= deadline) => break,
            None => {}
        }
        while let Some(part) = waiting.remove(&joined) {
            whole.append(part);
            joined += 1;
        }
        // what has not begun does not begin any more
        if deadline.is_some() && joined == begun {
            break;
        }
    }
    for index in joined..units.len() {
        whole.append(waiting.remove(&index).unwrap_or_else(|| Part::not_reached(units.get(index).len())));
    }
    Ok(whole)
}

type Finished = (usize, std::thread::Result<Result<Part, StudyError>>);

/// The next finished unit, or `None` after a while. A thread of the pool works meanwhile instead of waiting for itself.
fn next(receive: &mpsc::Receiver<Finished>) -> Option<Finished> {
    if rayon::current_thread_index().is_none() {
        return receive.recv_timeout(LOOK).ok();
    }
    if let Ok(finished) = receive.try_recv() {
        return Some(finished);
    }
    if rayon::yield_now() != Some(rayon::Yield::Executed) {
        std::thread::sleep(LOOK / 20);
    }
    None
}

pub(crate) fn compute(
    study: &Study,
    first: &Arc<Prepared>,
    index: usize,
    context: &Context,
) -> Result<Part, StudyError> {
    let unit = units(study).get(index);
    if context.stopped() {
        return Ok(Part::not_reached(unit.len()));
    }
    let prepared = |index: usize| match index {
        0 => Ok(first.clone()),
        _ => Prepared::new(study, index).map(Arc::new),
    };
    let cases = unit.cases.clone().map(prepared).collect::<Result<Vec<_>, _>>()?;
    let work = Work { study, cases, points: unit.points, context };
    let part = (kinds::of(study).compute)(&work);
    part.map_err(|(index, error)| match work.cases.iter().find(|prepared| prepared.case.index == index) {
        Some(prepared) => refused(study, &prepared.case, &error),
        None => study.error_at("study", 0, "kind", error.to_string(), None),
    })
}
