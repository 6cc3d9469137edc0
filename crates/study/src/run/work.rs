//! Units of work of a study, and the results of one unit.
//!
//! A study is divided into units that are independent of each other: a block of frequencies of
//! one case, a case, or the cases of one curve. Units are computed in any order and on any
//! thread. Their parts are joined in the order of the units, so the tables are bitwise the same
//! for every division of the work.

use crate::case::study::{Case, Study};
use crate::results::notes::Note;
use crate::results::table_builder::TableBuilder;
use crate::syntax::error::StudyError;
use crate::syntax::expression::quantity_text;
use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use stickslip::curve::sweep::BLOCK;
use stickslip::dimension::Dimension;
use stickslip::method::{self, Alternatives, Method, MethodError, Options, Refusal, WIDTH};
use stickslip::model::System;

/// Units per thread that may be in progress or wait to be joined. The number keeps all threads
/// busy behind a slow unit and bounds the memory.
pub(crate) const UNITS_AHEAD: usize = 8;

/// Settings of one run.
#[derive(Clone)]
pub struct Context {
    /// Number of threads of the run, for the record. The caller sets up the pool.
    pub threads: usize,
    /// Set to true to end the run early with the finished points.
    pub stop: Arc<AtomicBool>,
    /// Called once per finished point, from any thread.
    pub finished: Arc<dyn Fn() + Send + Sync>,
}

impl Context {
    /// Settings of a run without progress reports.
    pub fn without_progress(threads: usize) -> Self {
        Context { threads, stop: Arc::new(AtomicBool::new(false)), finished: Arc::new(|| ()) }
    }

    /// Returns whether the run must end early.
    pub fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

impl fmt::Debug for Context {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Context").field("threads", &self.threads).field("stop", &self.stop).finish_non_exhaustive()
    }
}

/// A case that is ready to be computed.
#[derive(Debug)]
pub struct PreparedCase {
    /// The case of the study.
    pub case: Case,
    /// The assembled model.
    pub system: System,
    /// The method with its options.
    pub method: Box<dyn Method>,
}

impl PreparedCase {
    /// Prepares case `index` of a study.
    ///
    /// # Errors
    /// [`StudyError`]: the method refuses the model of the case.
    pub fn new(study: &Study, index: usize) -> Result<Self, StudyError> {
        let case = study.case(index)?;
        let row = method::find(&case.method.name).ok_or_else(|| {
            study.error_at("method", 0, "kind", format!("there is no method `{}`", case.method.name), None)
        })?;
        let method = (row.build)(&case.method.options).map_err(|error| refusal_at_location(study, &case, &error))?;
        let system = study
            .assembled
            .system(&case.model)
            .map_err(|error| study.error_at("study", 0, error.key, error.to_string(), None))?;
        let refuse = |error: MethodError| {
            refusal_at_location(study, &case, &error.with_alternatives(method::alternatives(&system)))
        };
        if study.kind().uses_method {
            method.solver(&system).map_err(refuse)?;
        }
        (study.kind().needs)(&case.values, &case.method.options, &system).map_err(refuse)?;
        Ok(PreparedCase { case, system, method })
    }
}

/// Converts the refusal of a method to an error at its location in the file.
pub(crate) fn refusal_at_location(study: &Study, case: &Case, error: &MethodError) -> StudyError {
    let model = &case.model;
    // the first case is prepared first, so a later refusal depends on the case and names it
    let refusal = error.clone().without_alternatives();
    let message = match case.index {
        0 => refusal.to_string(),
        index => format!("{refusal} ({})", study.case_words(index)),
    };
    let help = error.alternatives().map(|ways| refusal_advice(study, case, ways));
    match &error.refusal {
        Refusal::Law { joint, .. } => {
            let index = model.joints.iter().position(|j| j.name == *joint).unwrap_or(0);
            study.error_at("joint", index, "law", message, help)
        }
        Refusal::NeedsMass { place, .. }
        | Refusal::OnlyJoints { place, .. }
        | Refusal::NegligibleMass { place, .. } => {
            let mass = model.masses.iter().position(|mass| mass.places().contains(place)).map(|at| ("mass", at));
            let body = || model.bodies.iter().position(|body| body.places().contains(place)).map(|at| ("body", at));
            match mass.or_else(body) {
                Some((list, index)) => study.error_at(list, index, "mass", message, help),
                None => study.error_at("structure", 0, "mass", message, help),
            }
        }
        // a kind without a method has the method's options among its own keys
        Refusal::Option { key, .. } => {
            let table = if study.kind().uses_method { "method" } else { "study" };
            study.error_at(table, 0, key, message, None)
        }
        Refusal::NotPositive { .. } | Refusal::TooLarge { .. } => study.error_at("method", 0, "kind", message, help),
    }
}

/// Returns the advice for a refused model. A kind that uses no method cannot take another one.
fn refusal_advice(study: &Study, case: &Case, ways: &Alternatives) -> String {
    // Velocity, m/s, over which laws are smoothed to test whether smoothing would help.
    let trial_width = 1e-3;
    let kind = study.kind();
    if kind.uses_method || !ways.any() {
        return ways.to_string();
    }
    let smoothed = Options::from([(WIDTH.to_owned(), trial_width)]);
    let helps = case.model.assemble().is_ok_and(|system| (kind.needs)(&case.values, &smoothed, &system).is_ok());
    let smoothing = method::TABLE.iter().find(|row| row.options.iter().any(|option| option.key == WIDTH));
    match smoothing.filter(|_| helps) {
        Some(row) => format!(
            "give a velocity over which friction changes its sign: [method] with kind = \"{}\" and {WIDTH} = \"{}\"",
            row.name,
            quantity_text(trial_width, Some(Dimension::VELOCITY))
        ),
        None => format!(
            "a study of kind `{}` uses its own method, which does not accept this model; for kinds with a choice of \
             method: {ways}",
            kind.name
        ),
    }
}

/// Size of the units of a study kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnitSize {
    /// Blocks of at most [`BLOCK`] frequencies of one case.
    Frequencies,
    /// One case with all its frequencies.
    Case,
    /// The cases that differ only in the last parameter of `vary`.
    Curve,
}

/// A unit of work: some cases, and some of their frequencies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WorkUnit {
    /// The cases.
    pub cases: Range<usize>,
    /// The frequencies by number; `0..1` in a study without frequencies.
    pub points: Range<usize>,
}

impl WorkUnit {
    /// Returns the number of points of the study in this unit.
    pub fn len(&self) -> usize {
        self.cases.len() * self.points.len()
    }

    /// Returns whether the unit has no points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The units of a study, in order. They are made on demand, so their number costs no memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WorkUnits {
    grain: UnitSize,
    cases: usize,
    /// Number of frequencies of every case.
    points: usize,
    /// Number of cases of a curve.
    cases_per_curve: usize,
}

impl WorkUnits {
    /// Divides `study` into units of this size.
    pub fn new(study: &Study, grain: UnitSize) -> Self {
        let cases = study.cases();
        let points = (study.points() / cases.max(1)).max(1);
        WorkUnits { grain, cases, points, cases_per_curve: study.values_per_curve().max(1) }
    }

    /// Returns the number of blocks of frequencies of one case.
    fn blocks_per_case(&self) -> usize {
        self.points.div_ceil(BLOCK)
    }

    /// Returns the number of units.
    pub fn len(&self) -> usize {
        match self.grain {
            UnitSize::Frequencies => self.cases * self.blocks_per_case(),
            UnitSize::Case => self.cases,
            UnitSize::Curve => self.cases / self.cases_per_curve,
        }
    }

    /// Returns whether there are no units.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the unit with this number, below [`WorkUnits::len`].
    pub fn get(&self, index: usize) -> WorkUnit {
        match self.grain {
            UnitSize::Frequencies => {
                let (case, block) = (index / self.blocks_per_case(), index % self.blocks_per_case());
                WorkUnit { cases: case..case + 1, points: block * BLOCK..((block + 1) * BLOCK).min(self.points) }
            }
            UnitSize::Case => WorkUnit { cases: index..index + 1, points: 0..self.points },
            UnitSize::Curve => WorkUnit {
                cases: index * self.cases_per_curve..(index + 1) * self.cases_per_curve,
                points: 0..self.points,
            },
        }
    }
}

/// A unit that is ready to be computed.
#[derive(Debug)]
pub struct UnitTask<'a> {
    /// The study.
    pub study: &'a Study,
    /// Its cases.
    pub cases: Vec<Arc<PreparedCase>>,
    /// Its frequencies by number.
    pub points: Range<usize>,
    /// Settings of the run.
    pub context: &'a Context,
    /// The computed part of the unit, for kinds whose points depend on each other.
    pub share: &'a Share,
}

/// The computed part of a unit, from 0 to 1, as its kind reports it.
#[derive(Debug, Default)]
pub struct Share(AtomicU64);

impl Share {
    /// Sets the computed part; a smaller value than before has no effect.
    pub(crate) fn reach(&self, share: f64) {
        if share > self.get() {
            self.0.store(share.min(1.0).to_bits(), Ordering::Relaxed);
        }
    }

    /// Returns the computed part.
    pub(crate) fn get(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Relaxed))
    }
}

impl UnitTask<'_> {
    /// Returns the first of the cases.
    pub fn case(&self) -> &PreparedCase {
        &self.cases[0]
    }

    /// Returns frequency number `index` of the first case, rad/s.
    pub fn omega(&self, index: usize) -> f64 {
        self.case().case.frequencies.as_ref().and_then(|f| f.get(index)).unwrap_or(f64::NAN)
    }

    /// Returns whether the study has several frequencies, so that tables need a column for
    /// them.
    pub fn several_frequencies(&self) -> bool {
        self.case().case.frequencies.as_ref().is_some_and(|f| f.len() > 1)
    }
}

/// Results of a unit, or the index of a case and the reason why its model is refused.
pub type Computed = Result<UnitResult, (usize, MethodError)>;

/// Results of a unit.
#[derive(Debug, Default)]
pub struct UnitResult {
    /// Rows of the tables of the kind, in its order.
    pub tables: Vec<TableBuilder>,
    /// Notes for the reader of the results.
    pub notes: Vec<Note>,
    /// Points without a result: where, and why.
    pub failures: Vec<crate::results::dataset::Failure>,
    /// Number of points by status.
    pub points: BTreeMap<String, u64>,
    /// True if the run was stopped before the unit was finished. Results after the points, such
    /// as peaks, may then be missing even if all points are present.
    pub interrupted: bool,
}

/// Status of a point that converged,
/// [`Accuracy::Converged`](stickslip::orbit::Accuracy::Converged).
pub const CONVERGED: &str = "converged";
/// Status of a point without a result.
pub const NOT_CONVERGED: &str = "not-converged";
/// Status of a point that an interrupted run did not reach.
pub const NOT_REACHED: &str = "not-reached";

impl UnitResult {
    /// Counts a point, and records its failure if there is one.
    pub(crate) fn count(&mut self, at: impl FnOnce() -> String, status: &str, failure: Option<String>) {
        *self.points.entry(status.to_owned()).or_default() += 1;
        if let Some(reason) = failure {
            self.failures.push(crate::results::dataset::Failure { location: at(), reason });
        }
    }

    /// The part of a unit that an interrupted run did not reach.
    pub(crate) fn not_reached(points: usize) -> Self {
        UnitResult { points: BTreeMap::from([(NOT_REACHED.to_owned(), points as u64)]), ..UnitResult::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units(grain: UnitSize) -> Vec<WorkUnit> {
        let units = WorkUnits { grain, cases: 6, points: 150, cases_per_curve: 3 };
        (0..units.len()).map(|index| units.get(index)).collect()
    }

    #[test]
    fn units_cover_every_point_once_and_in_order() {
        for grain in [UnitSize::Frequencies, UnitSize::Case, UnitSize::Curve] {
            let all: Vec<(usize, usize)> = units(grain)
                .into_iter()
                .flat_map(|unit| unit.cases.flat_map(move |case| unit.points.clone().map(move |point| (case, point))))
                .collect();
            let expected: Vec<(usize, usize)> =
                (0..6).flat_map(|case| (0..150).map(move |point| (case, point))).collect();
            assert_eq!(all, expected, "{grain:?}");
        }
        assert_eq!(units(UnitSize::Frequencies)[1], WorkUnit { cases: 0..1, points: 61..122 });
        assert_eq!(units(UnitSize::Curve).len(), 2);
    }
}
