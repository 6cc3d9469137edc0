//! Runs a study.
//!
//! The run first checks every case, so that a refusal by a method is found before anything is
//! computed. It computes the units of work on all threads, joins their parts in order, lets the
//! kind draw the figure, and adds the record.

use crate::case::study::Study;
use crate::check::summary::ModelSummary;
use crate::kinds;
use crate::results::dataset::{Dataset, Figure, Record, Table};
use crate::results::decimation::Decimation;
use crate::results::drawing::FigureInput;
use crate::results::notes::Note;
use crate::results::torsion_columns;
use crate::run::basis_check::is_checked;
use crate::run::point_row::describe_location;
use crate::run::probe::{self, ExpectedTime};
use crate::run::result_block::{Block, Tally};
use crate::run::work::{Share, UNITS_AHEAD, UnitResult, UnitTask, WorkUnits, refusal_at_location};
use crate::syntax::error::StudyError;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};
use stickslip::method::Choice;

pub use crate::run::work::{CONVERGED, Context, NOT_REACHED, PreparedCase};

/// Runs a study.
///
/// # Errors
/// [`StudyError`]: the method refuses the model, or the study needs too much memory; then
/// nothing was computed. Points that do not converge are not an error: the dataset lists them
/// as failures.
///
/// # Example
/// ```
/// use stickslip_study::{read_study, run::{Context, run}};
/// let text = stickslip_study::templates::find("element").unwrap().study;
/// let study = read_study("element.toml", text, &[]).unwrap();
/// let dataset = run(&study, &Context::without_progress(1)).unwrap();
/// let loss = dataset.tables[1].numbers("dissipation_J").unwrap();
/// assert!((loss[1] - 4e-6).abs() < 1e-15);   // 4 Ft (a - Ft/kt), a = 2 mm
/// ```
pub fn run(study: &Study, context: &Context) -> Result<Dataset, StudyError> {
    check(study)?.run(context)
}

/// A study that was checked: it was surveyed, every case was prepared once, and it fits into
/// memory.
#[derive(Debug)]
pub struct CheckedStudy {
    study: Study,
    summary: ModelSummary,
    /// The methods that find the orbits of the cases, in words, each once.
    methods: Vec<String>,
    /// The first case, if it is kept. Many studies, in particular large ones, have only this
    /// case.
    first: Option<Arc<PreparedCase>>,
    /// Duration of the check.
    time: Duration,
}

/// Prepares every case without computing it: checks that the study can be run, and summarizes
/// the model.
///
/// # Errors
/// [`StudyError`]: the method refuses the model of a case, or the study needs more memory than
/// its limit.
///
/// # Example
/// ```
/// use stickslip_study::{read_study, run::{Context, check}};
/// let text = stickslip_study::templates::find("element").unwrap().study;
/// let checked = check(&read_study("element.toml", text, &[]).unwrap()).unwrap();
/// assert_eq!(checked.summary().joints.len(), 1);
/// assert_eq!(checked.run(&Context::without_progress(1)).unwrap().tables.len(), 2);
/// ```
pub fn check(study: &Study) -> Result<CheckedStudy, StudyError> {
    let start = Instant::now();
    let summary = ModelSummary::new(study)?;
    if let Some(error) = summary.size.refusal(study, summary.size.memory) {
        return Err(error);
    }
    let mut choices = BTreeSet::new();
    let mut choose = |prepared: &PreparedCase| {
        if study.kind().uses_method {
            choices.insert(prepared.method.choice(&prepared.system));
        }
    };
    let first = Arc::new(PreparedCase::new(study, 0)?);
    choose(&first);
    for index in 1..study.cases() {
        choose(&PreparedCase::new(study, index)?);
    }
    let methods = choices.iter().map(Choice::to_string).collect();
    Ok(CheckedStudy { study: study.clone(), summary, methods, first: Some(first), time: start.elapsed() })
}

impl CheckedStudy {
    /// Returns the study.
    pub fn study(&self) -> &Study {
        &self.study
    }

    /// Returns the summary of the model, known before the run.
    pub fn summary(&self) -> &ModelSummary {
        &self.summary
    }

    /// Computes a few points of the study and extrapolates the time of a run on one thread.
    ///
    /// This takes at most about a second, and less if `stop` is set. It has no influence on a
    /// later run. Returns `None` if a probe failed, or after a stop.
    ///
    /// # Example
    /// ```
    /// use std::sync::{Arc, atomic::AtomicBool};
    /// use stickslip_study::{read_study, run::check};
    /// let text = stickslip_study::templates::find("element").unwrap().study;
    /// let checked = check(&read_study("element.toml", text, &[]).unwrap()).unwrap();
    /// let time = checked.expected_time(&Arc::new(AtomicBool::new(false))).unwrap();
    /// assert!(time.to_string().contains("on one thread"));
    /// ```
    pub fn expected_time(&self, stop: &Arc<AtomicBool>) -> Option<ExpectedTime> {
        probe::expected_time(&self.study, self.first.clone(), stop)
    }

    /// Returns the checked study without its prepared first case, for callers that hold many
    /// studies. A first case of 2000 masses takes 0.1 GB. A run prepares it again.
    #[must_use]
    pub fn without_first_case(self) -> CheckedStudy {
        CheckedStudy { first: None, ..self }
    }

    /// Returns the number of its units of work, which are independent of each other.
    pub fn units(&self) -> usize {
        units(&self.study)
    }

    /// Computes the study with all tables in memory.
    ///
    /// # Errors
    /// [`StudyError`]: the tables need more memory than the limit, or a search between the
    /// cases met a model that the method refuses. Points that do not converge are not an error:
    /// the dataset lists them as failures.
    pub fn run(&self, context: &Context) -> Result<Dataset, StudyError> {
        self.run_in_parts(context, &mut |_| ())
    }

    /// Computes the study as [`CheckedStudy::run`] does, and passes all results so far to `seen`
    /// after every unit, so that they can be shown before the end of the run.
    ///
    /// # Errors
    /// Those of [`CheckedStudy::run`].
    ///
    /// # Example
    /// ```
    /// use stickslip_study::{read_study, run::{Context, check}};
    /// let text = stickslip_study::templates::find("blade-couple").unwrap().study;
    /// let checked = check(&read_study("couple.toml", text, &[]).unwrap()).unwrap();
    /// let mut rows = Vec::new();
    /// let context = Context::without_progress(1);
    /// checked.run_in_parts(&context, &mut |block| rows.push(block.tables[0].rows())).unwrap();
    /// assert!(rows.is_sorted() && rows.last() == Some(&964));
    /// ```
    pub fn run_in_parts(&self, context: &Context, seen: &mut dyn FnMut(&Block)) -> Result<Dataset, StudyError> {
        let start = Instant::now();
        if let Some(error) = self.summary.size.refusal(&self.study, self.summary.size.memory_all_tables) {
            return Err(error);
        }
        let mut whole = Block::empty(self.study.kind(), 0);
        self.for_each_block(0..self.units(), context, &mut |block| {
            whole.append(block);
            seen(&whole);
            Ok::<(), StudyError>(())
        })?;
        let Block { tables, tally, .. } = whole;
        let figure = figure_of_tables(&self.study, &tables);
        Ok(self.dataset_without_results(context.threads).with_results(tables, figure, tally, start.elapsed()))
    }

    /// Computes the units of a range and keeps their results in memory.
    ///
    /// # Errors
    /// [`StudyError`]: the range has no such units, or a search between the cases met a model
    /// that the method refuses.
    ///
    /// # Example
    /// ```
    /// use stickslip_study::{read_study, run::{Context, check}};
    /// let text = stickslip_study::templates::find("blade-couple").unwrap().study;
    /// let checked = check(&read_study("couple.toml", text, &[]).unwrap()).unwrap();
    /// let context = Context::without_progress(1);
    /// let mut block = checked.block(0..3, &context).unwrap();
    /// block.append(checked.block(3..checked.units(), &context).unwrap());
    /// let whole = checked.block(0..checked.units(), &context).unwrap();
    /// // compared as text, because missing values are NaN
    /// assert_eq!(format!("{:?}", block.tables), format!("{:?}", whole.tables));
    /// ```
    pub fn block(&self, range: Range<usize>, context: &Context) -> Result<Block, StudyError> {
        let mut whole = Block::empty(self.study.kind(), range.start);
        self.for_each_block(range, context, &mut |block| {
            whole.append(block);
            Ok::<(), StudyError>(())
        })?;
        Ok(whole)
    }

    /// Computes the units of a range on all threads and passes the block of each one to `take`,
    /// in order.
    ///
    /// If the run is stopped, `take` also gets the unfinished units, with their points marked
    /// [`NOT_REACHED`].
    ///
    /// # Errors
    /// A [`StudyError`]: the range has no such units, or a search between the cases met a model
    /// that the method refuses. An error that `take` returns ends the computation and is
    /// returned.
    pub fn for_each_block<E: From<StudyError>>(
        &self,
        range: Range<usize>,
        context: &Context,
        take: &mut dyn FnMut(Block) -> Result<(), E>,
    ) -> Result<(), E> {
        let all = self.units();
        if range.start > range.end || range.end > all {
            let message = format!("there are no units of work {} to {}; the study has {all}", range.start, range.end);
            return Err(self.study.error_at("study", 0, "kind", message, None).into());
        }
        let first = match &self.first {
            Some(first) => first.clone(),
            None => Arc::new(PreparedCase::new(&self.study, 0)?),
        };
        let kind = self.study.kind();
        let varied = self.study.varied().len();
        compute_parts(&self.study, &first, range, context, &mut |unit, part| {
            let mut block = Block::from_unit(kind, unit, part);
            if self.study.is_torsional() {
                block
                    .tables
                    .iter_mut()
                    .for_each(|table| torsion_columns::rename(table, varied, torsion_columns::of_rotation));
            }
            take(block)
        })
    }

    /// Returns the dataset without its results, as known before the computation; see
    /// [`Dataset::with_results`].
    pub fn dataset_without_results(&self, threads: usize) -> Dataset {
        let CheckedStudy { study, summary, methods, .. } = self;
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
                study: study_record(study, summary),
                methods: methods.clone(),
                seed: study.seed(),
                threads,
                wall_time_s: self.time.as_secs_f64(),
                points: BTreeMap::new(),
                interrupted: false,
            },
            mesh: study.structure.mesh.source.clone(),
        }
    }
}

impl Dataset {
    /// Adds the results to an outline: the tables, their figure, the notes and the failures.
    #[must_use]
    pub fn with_results(mut self, tables: Vec<Table>, figure: Figure, tally: Tally, time: Duration) -> Dataset {
        // a table without any rows has no columns
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

/// Draws the figure of finished tables, just computed or read from a disk. Tables of another
/// study give an empty figure.
pub fn figure_of_tables(study: &Study, tables: &[Table]) -> Figure {
    let rows: Vec<(&str, usize)> = tables.iter().map(|table| (table.name.as_str(), table.rows())).collect();
    let mut decimation = Decimation::new(study, &rows);
    if decimation.keeps_all() {
        return draw(study, tables);
    }
    tables.iter().for_each(|table| decimation.add(table.clone()));
    draw(study, &decimation.tables())
}

/// Draws the figure of the rows that a [`Decimation`] has kept.
pub fn draw(study: &Study, tables: &[Table]) -> Figure {
    let mut tables = Cow::Borrowed(tables);
    if study.is_torsional() {
        let varied = study.varied().len();
        let rename = |table| torsion_columns::rename(table, varied, torsion_columns::of_displacement);
        tables.to_mut().iter_mut().for_each(rename);
    }
    let tables = &*tables;
    Figure { title: study.title().to_owned(), ..(kinds::kind_of(study).draw)(&FigureInput { study, tables }) }
}

/// Returns the study as it was understood, with its summary.
fn study_record(study: &Study, summary: &ModelSummary) -> serde_json::Value {
    let mut record = study.to_record();
    record["summary"] = summary.to_json();
    record
}

/// Returns the number of units of work of a study, checked or not.
pub fn units(study: &Study) -> usize {
    divide(study).len()
}

/// Divides a study into its units.
fn divide(study: &Study) -> WorkUnits {
    WorkUnits::new(study, (kinds::kind_of(study).unit_size)(study))
}

/// Interval at which a run checks for a stop request.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Time that an interrupted run waits for the units in progress. Each of them ends after its
/// current orbit. Users accept a wait of less than a second.
const STOP_TIMEOUT: Duration = Duration::from_millis(500);

/// Computes the units of a range and passes their parts on in order.
///
/// Units run as tasks of the pool that own their data. An interrupted run can therefore return
/// before a slow unit ends.
fn compute_parts<E: From<StudyError>>(
    study: &Study,
    first: &Arc<PreparedCase>,
    range: Range<usize>,
    context: &Context,
    take: &mut dyn FnMut(usize, UnitResult) -> Result<(), E>,
) -> Result<(), E> {
    let units = divide(study);
    let shared = Arc::new(study.clone());
    let (send, receive) = mpsc::channel();
    let mut waiting: BTreeMap<usize, UnitResult> = BTreeMap::new();
    let (mut begun, mut joined) = (range.start, range.start);
    let mut deadline: Option<Instant> = None;
    while joined < range.end {
        if deadline.is_none() && context.stopped() {
            deadline = Some(Instant::now() + STOP_TIMEOUT);
        }
        while begun < range.end && begun < joined + UNITS_AHEAD * context.threads.max(1) && deadline.is_none() {
            let (study, first, context) = (shared.clone(), first.clone(), context.clone());
            let (send, index) = (send.clone(), begun);
            rayon::spawn_fifo(move || {
                // the receiver is gone if the run has ended early
                let part = catch_unwind(AssertUnwindSafe(|| compute(&study, &first, index, &context)));
                let _ = send.send((index, part));
            });
            begun += 1;
        }
        match next_finished(&receive) {
            Some((index, part)) => {
                // a panic in a unit becomes a panic of the run
                waiting.insert(index, part.unwrap_or_else(|panic| resume_unwind(panic))?);
            }
            None if deadline.is_some_and(|deadline| Instant::now() >= deadline) => break,
            None => {}
        }
        while let Some(part) = waiting.remove(&joined) {
            take(joined, part)?;
            joined += 1;
        }
        // after a stop no unit begins, so the run ends when all begun units are joined
        if deadline.is_some() && joined == begun {
            break;
        }
    }
    for index in joined..range.end {
        take(index, waiting.remove(&index).unwrap_or_else(|| UnitResult::not_reached(units.get(index).len())))?;
    }
    Ok(())
}

type Finished = (usize, std::thread::Result<Result<UnitResult, StudyError>>);

/// Returns the next finished unit, or `None` after a while. A thread of the pool executes other
/// tasks meanwhile, because it must not wait for itself.
fn next_finished(receive: &mpsc::Receiver<Finished>) -> Option<Finished> {
    if rayon::current_thread_index().is_none() {
        return receive.recv_timeout(POLL_INTERVAL).ok();
    }
    if let Ok(finished) = receive.try_recv() {
        return Some(finished);
    }
    if rayon::yield_now() != Some(rayon::Yield::Executed) {
        std::thread::sleep(POLL_INTERVAL / 20);
    }
    None
}

fn compute(
    study: &Study,
    first: &Arc<PreparedCase>,
    index: usize,
    context: &Context,
) -> Result<UnitResult, StudyError> {
    let unit = divide(study).get(index);
    if context.stopped() {
        return Ok(UnitResult::not_reached(unit.len()));
    }
    let prepared = |index: usize| match index {
        0 => Ok(first.clone()),
        _ => PreparedCase::new(study, index).map(Arc::new),
    };
    let cases = unit.cases.clone().map(prepared).collect::<Result<Vec<_>, _>>()?;
    let work = UnitTask { study, cases, points: unit.points, context, share: &Share::default() };
    let mut part = (kinds::kind_of(study).compute)(&work);
    if let Ok(part) = &mut part
        && !context.stopped()
    {
        check_reduction(&work, index, part);
    }
    // kinds check for a stop in many places
    part.map(|part| UnitResult { interrupted: context.stopped(), ..part }).map_err(|(index, error)| {
        match work.cases.iter().find(|prepared| prepared.case.index == index) {
            Some(prepared) => refusal_at_location(study, &prepared.case, &error),
            None => study.error_at("study", 0, "kind", error.to_string(), None),
        }
    })
}

/// If joints slip on a reduced model, solves some points again with more modes and records the
/// difference.
fn check_reduction(work: &UnitTask<'_>, index: usize, part: &mut UnitResult) {
    let (study, prepared) = (work.study, work.case());
    let points = part.points.values().sum::<u64>() as usize;
    let slipping = part.notes.iter_mut().find_map(|note| match note {
        Note::Slipping(slipping) => Some(slipping),
        _ => None,
    });
    let Some(slipping) = slipping else { return };
    let PreparedCase { case, system, method } = prepared;
    if !study.kind().uses_method || !is_checked(index, points, case.model.ring.is_some()) {
        slipping.discard_points();
        return;
    }
    let describe = |omega: f64| describe_location(case, omega);
    if let Some(error) = slipping.solve_again(&case.model, system, &**method, &describe) {
        part.tables.iter_mut().for_each(|rows| rows.raise_reduction_error(error));
    }
}
