//! Runs a study: checks every case (so that what a method cannot take is found before anything is computed), computes its units on all
//! threads, joins their parts in order, lets the kind draw its figure, and adds the record.

use crate::block::{Block, Tally};
use crate::dataset::{Dataset, Figure, Record, Table};
use crate::drawing::Drawing;
use crate::error::StudyError;
use crate::farther::has_turn;
use crate::kinds;
use crate::note::Note;
use crate::point::location_of;
use crate::study::Study;
use crate::summary::ModelSummary;
use crate::thinning::Thinning;
use crate::work::{AHEAD, Part, Units, Work, refused};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
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
    if let Some(error) = summary.size.refusal(study, summary.size.memory) {
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

    /// Number of its units of work, which know nothing of each other.
    pub fn units(&self) -> usize {
        units(&self.study)
    }

    /// Computes it, with all of its tables in memory.
    ///
    /// # Errors
    /// [`StudyError`]: the tables need more memory than a run may take, or a search between the cases met a model that the method cannot
    /// take. Points that do not converge are no error: they are in the dataset, as failures.
    pub fn run(&self, context: &Context) -> Result<Dataset, StudyError> {
        let start = Instant::now();
        if let Some(error) = self.summary.size.refusal(&self.study, self.summary.size.whole) {
            return Err(error);
        }
        let Block { tables, tally, .. } = self.block(0..self.units(), context)?;
        let figure = redrawn(&self.study, &tables);
        Ok(self.outline(context.threads).completed(tables, figure, tally, start.elapsed()))
    }

    /// Computes the units of a range, with what they yield in memory.
    ///
    /// # Errors
    /// [`StudyError`]: there are no such units, or a search between the cases met a model that the method cannot take.
    ///
    /// # Example
    /// ```
    /// use stickslip_study::{read_study, run::{Context, check}};
    /// let text = stickslip_study::templates::find("blade-couple").unwrap().study;
    /// let checked = check(&read_study("couple.toml", text, &[]).unwrap()).unwrap();
    /// let context = Context::unwatched(1);
    /// let mut block = checked.block(0..3, &context).unwrap();
    /// block.append(checked.block(3..checked.units(), &context).unwrap());
    /// let whole = checked.block(0..checked.units(), &context).unwrap();
    /// assert_eq!(format!("{:?}", block.tables), format!("{:?}", whole.tables)); // what was not computed is no number
    /// ```
    pub fn block(&self, range: Range<usize>, context: &Context) -> Result<Block, StudyError> {
        let mut whole = Block::empty(self.study.kind(), range.start);
        self.each(range, context, &mut |block| {
            whole.append(block);
            Ok::<(), StudyError>(())
        })?;
        Ok(whole)
    }

    /// Computes the units of a range on all threads, and hands what each yields to `take`, one after the other in their order. Of a run
    /// that is stopped the units that were not finished come too, with their points as [`NOT_REACHED`].
    ///
    /// # Errors
    /// A [`StudyError`]: there are no such units, or a search between the cases met a model that the method cannot take; or what `take`
    /// returns, after which nothing more is computed.
    pub fn each<E: From<StudyError>>(
        &self,
        range: Range<usize>,
        context: &Context,
        take: &mut dyn FnMut(Block) -> Result<(), E>,
    ) -> Result<(), E> {
        let all = self.units();
        if range.start > range.end || range.end > all {
            let message = format!("there are no units {} to {}, the study has {all}", range.start, range.end);
            return Err(self.study.error_at("study", 0, "kind", message, None).into());
        }
        let first = match &self.first {
            Some(first) => first.clone(),
            None => Arc::new(Prepared::new(&self.study, 0)?),
        };
        let kind = self.study.kind();
        parts(&self.study, &first, range, context, &mut |unit, part| take(Block::of(kind, unit, part)))
    }

    /// What is known of the results before anything is computed; see [`Dataset::completed`].
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
                seed: study.seed(),
                threads,
                wall_time_s: self.time.as_secs_f64(),
                points: BTreeMap::new(),
                interrupted: false,
            },
        }
    }
}

impl Dataset {
    /// An outline with its results: the tables, their figure, and what is to be said.
    #[must_use]
    pub fn completed(mut self, tables: Vec<Table>, figure: Figure, tally: Tally, time: Duration) -> Dataset {
        // a table that nothing was ever written to has no columns either
        self.tables = tables.into_iter().filter(|table| !table.columns.is_empty()).collect();
        self.figure = figure;
        self.notes.extend(tally.notes());
        self.failures = tally.failures().to_vec();
        self.record.interrupted = !tally.is_whole();
        self.record.points = tally.points().clone();
        self.record.wall_time_s += time.as_secs_f64();
        self
    }
}

/// The figure of finished tables, computed just now or read from a disk. Tables that are none of this study have an empty figure.
pub fn redrawn(study: &Study, tables: &[Table]) -> Figure {
    let rows: Vec<(&str, usize)> = tables.iter().map(|table| (table.name.as_str(), table.rows())).collect();
    let mut thinning = Thinning::new(study, &rows);
    if thinning.keeps_all() {
        return drawn(study, tables);
    }
    tables.iter().for_each(|table| thinning.add(table.clone()));
    drawn(study, &thinning.tables())
}

/// The figure of the rows that a [`Thinning`] has kept.
pub fn drawn(study: &Study, tables: &[Table]) -> Figure {
    Figure { title: study.title().to_owned(), ..(kinds::of(study).draw)(&Drawing { study, tables }) }
}

/// The study as it was understood, and its summary.
fn recorded(study: &Study, summary: &ModelSummary) -> serde_json::Value {
    let mut record = study.resolved();
    record["summary"] = summary.to_json();
    record
}

/// Number of the units of work of a study, checked or not.
pub fn units(study: &Study) -> usize {
    cut(study).len()
}

/// The units of a study.
fn cut(study: &Study) -> Units {
    Units::of(study, (kinds::of(study).grain)(study))
}

/// How often a run looks whether it is to stop.
const LOOK: Duration = Duration::from_millis(20);
/// How long an interrupted run waits for what is under way, which ends with the orbit that it is at: less than the second that a user
/// waits gladly.
const GRACE: Duration = Duration::from_millis(500);

/// Computes the units of a range and hands on their parts in order.
///
/// Units run as tasks of the pool that own what they need, so that an interrupted run can leave behind one that does not end.
fn parts<E: From<StudyError>>(
    study: &Study,
    first: &Arc<Prepared>,
    range: Range<usize>,
    context: &Context,
    take: &mut dyn FnMut(usize, Part) -> Result<(), E>,
) -> Result<(), E> {
    let units = cut(study);
    let shared = Arc::new(study.clone());
    let (send, receive) = mpsc::channel();
    let mut waiting: BTreeMap<usize, Part> = BTreeMap::new();
    let (mut begun, mut joined) = (range.start, range.start);
    let mut deadline: Option<Instant> = None;
    while joined < range.end {
        if deadline.is_none() && context.stopped() {
            deadline = Some(Instant::now() + GRACE);
        }
        while begun < range.end && begun < joined + AHEAD * context.threads.max(1) && deadline.is_none() {
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
            take(joined, part)?;
            joined += 1;
        }
        // what has not begun does not begin any more
        if deadline.is_some() && joined == begun {
            break;
        }
    }
    for index in joined..range.end {
        take(index, waiting.remove(&index).unwrap_or_else(|| Part::not_reached(units.get(index).len())))?;
    }
    Ok(())
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

fn compute(study: &Study, first: &Arc<Prepared>, index: usize, context: &Context) -> Result<Part, StudyError> {
    let unit = cut(study).get(index);
    if context.stopped() {
        return Ok(Part::not_reached(unit.len()));
    }
    let prepared = |index: usize| match index {
        0 => Ok(first.clone()),
        _ => Prepared::new(study, index).map(Arc::new),
    };
    let cases = unit.cases.clone().map(prepared).collect::<Result<Vec<_>, _>>()?;
    let work = Work { study, cases, points: unit.points, context };
    let mut part = (kinds::of(study).compute)(&work);
    if let Ok(part) = &mut part
        && !context.stopped()
    {
        solve_again(&work, index, part);
    }
    // kinds look in many places whether they are to stop
    part.map(|part| Part { cut: context.stopped(), ..part }).map_err(|(index, error)| {
        match work.cases.iter().find(|prepared| prepared.case.index == index) {
            Some(prepared) => refused(study, &prepared.case, &error),
            None => study.error_at("study", 0, "kind", error.to_string(), None),
        }
    })
}

/// Where joints slip on a structure in few coordinates: what these leave out of the harmonics that they make.
fn solve_again(work: &Work<'_>, index: usize, part: &mut Part) {
    let (study, prepared) = (work.study, work.case());
    let points = part.points.values().sum::<u64>() as usize;
    let slipping = part.notes.iter_mut().find_map(|note| match note {
        Note::Slipping(slipping) => Some(slipping),
        _ => None,
    });
    let Some(slipping) = slipping else { return };
    let Prepared { case, system, method } = prepared;
    let turn = study.kind().uses_method && has_turn(index, points);
    let at = |omega: f64| location_of(case, omega);
    if let Some(error) = slipping.solve_again(turn, (&case.model, system, &**method), &at) {
        part.tables.iter_mut().for_each(|rows| rows.err(error));
    }
}
