//! Work: what a study consists of, and what one piece of it yields.
//!
//! A study is cut into units that know nothing of each other: a stretch of frequencies of one case, a case, or the cases that make one
//! curve. Units are computed in any order and on any thread, and their parts are joined in the order of the units, so that the tables
//! are the same bit for bit however the work was divided.

use crate::error::StudyError;
use crate::expression::displayed;
use crate::note::Note;
use crate::rows::Rows;
use crate::study::{Case, Study};
use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use stickslip::curve::sweep::BLOCK;
use stickslip::dimension::Dimension;
use stickslip::method::{self, Method, MethodError, Options, Refusal, WIDTH, Ways};
use stickslip::model::System;

/// Units that may be under way or waiting for their turn, per thread: enough that none waits for a long one, few enough to keep little.
pub(crate) const AHEAD: usize = 8;

/// How a study is run.
#[derive(Clone)]
pub struct Context {
    /// Threads that the run may use, for the record; the caller sets up the pool.
    pub threads: usize,
    /// When true the run ends early with the points that are finished.
    pub stop: Arc<AtomicBool>,
    /// Called once per finished point, from any thread.
    pub finished: Arc<dyn Fn() + Send + Sync>,
}

impl Context {
    /// A run that nobody watches.
    pub fn unwatched(threads: usize) -> Self {
        Context { threads, stop: Arc::new(AtomicBool::new(false)), finished: Arc::new(|| ()) }
    }

    /// Whether the run is to end early.
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
pub struct Prepared {
    /// What the file says.
    pub case: Case,
    /// The assembled model.
    pub system: System,
    /// The method with its options.
    pub method: Box<dyn Method>,
}

impl Prepared {
    /// Case `index` of a study.
    ///
    /// # Errors
    /// [`StudyError`]: the method cannot take the model of the case.
    pub fn new(study: &Study, index: usize) -> Result<Self, StudyError> {
        let case = study.case(index)?;
        let row = method::find(&case.method.name).ok_or_else(|| {
            study.error_at("method", 0, "kind", format!("there is no method `{}`", case.method.name), None)
        })?;
        let method = (row.build)(&case.method.options).map_err(|error| refused(study, &case, &error))?;
        let system =
            case.model.assemble().map_err(|error| study.error_at("study", 0, error.key, error.to_string(), None))?;
        let told = |error: MethodError| refused(study, &case, &error.with(method::ways(&system)));
        if study.kind().uses_method {
            method.solver(&system).map_err(told)?;
        }
        (study.kind().needs)(&case.values, &case.method.options, &system).map_err(told)?;
        Ok(Prepared { case, system, method })
    }
}

/// A method's refusal, at the place in the file that it is about.
pub(crate) fn refused(study: &Study, case: &Case, error: &MethodError) -> StudyError {
    let model = &case.model;
    // a method looks at the first case first: what it refuses later is a matter of that case
    let refusal = error.clone().alone();
    let message = match case.index {
        0 => refusal.to_string(),
        index => format!("{refusal} ({})", study.case_words(index)),
    };
    let help = error.ways().map(|ways| advice(study, case, ways));
    match &error.refusal {
        Refusal::Law { joint, .. } => {
            let index = model.joints.iter().position(|j| j.name == *joint).unwrap_or(0);
            study.error_at("joint", index, "law", message, help)
        }
        Refusal::NeedsMass { place, .. } | Refusal::Empty { place, .. } | Refusal::Light { place, .. } => {
            let mass = model.masses.iter().position(|mass| mass.places().contains(place)).map(|at| ("mass", at));
            let body = || model.bodies.iter().position(|body| body.places().contains(place)).map(|at| ("body", at));
            match mass.or_else(body) {
                Some((list, index)) => study.error_at(list, index, "mass", message, help),
                None => study.error_at("structure", 0, "mass", message, help),
            }
        }
        // a kind that needs no method has the method's options among its own keys
        Refusal::Option { key, .. } => {
            let table = if study.kind().uses_method { "method" } else { "study" };
            study.error_at(table, 0, key, message, None)
        }
        Refusal::NotPositive { .. } | Refusal::TooLarge { .. } => study.error_at("method", 0, "kind", message, help),
    }
}

/// A velocity, m/s, over which laws are smoothed to see whether that would help.
const ANY_WIDTH: f64 = 1e-3;

/// What to do about a refused model: a kind that uses no method knows no way but its own.
fn advice(study: &Study, case: &Case, ways: &Ways) -> String {
    let kind = study.kind();
    if kind.uses_method || !ways.any() {
        return ways.to_string();
    }
    let smoothed = Options::from([(WIDTH.to_owned(), ANY_WIDTH)]);
    let helps = case.model.assemble().is_ok_and(|system| (kind.needs)(&case.values, &smoothed, &system).is_ok());
    let smoothing = method::TABLE.iter().find(|row| row.options.iter().any(|option| option.key == WIDTH));
    match smoothing.filter(|_| helps) {
        Some(row) => format!(
            "give a velocity over which friction changes its sign: [method] with kind = \"{}\" and {WIDTH} = \"{}\"",
            row.name,
            displayed(ANY_WIDTH, Some(Dimension::VELOCITY))
        ),
        None => format!(
            "a study of the kind `{}` goes by a method of its own, which does not take this; in kinds that choose one, {ways}",
            kind.name
        ),
    }
}

/// How a kind cuts its studies into units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grain {
    /// Stretches of at most [`BLOCK`] frequencies of one case.
    Frequencies,
    /// One case with all its frequencies.
    Case,
    /// The cases that differ in the last parameter of `vary` only.
    Curve,
}

/// A unit of work: some cases, and some of their frequencies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unit {
    /// The cases.
    pub cases: Range<usize>,
    /// The frequencies by number; `0..1` in a study without frequencies.
    pub points: Range<usize>,
}

impl Unit {
    /// Points of the study in this unit.
    pub fn len(&self) -> usize {
        self.cases.len() * self.points.len()
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The units of a study, in order; made on demand, so that their number costs no memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Units {
    grain: Grain,
    cases: usize,
    /// Frequencies of every case.
    points: usize,
    /// Cases of a curve.
    curve: usize,
}

impl Units {
    /// The units of `study`, cut in this way.
    pub fn of(study: &Study, grain: Grain) -> Self {
        let cases = study.cases();
        let points = (study.points() / cases.max(1)).max(1);
        Units { grain, cases, points, curve: study.last_varied().max(1) }
    }

    /// Stretches of frequencies of one case.
    fn stretches(&self) -> usize {
        self.points.div_ceil(BLOCK)
    }

    /// How many.
    pub fn len(&self) -> usize {
        match self.grain {
            Grain::Frequencies => self.cases * self.stretches(),
            Grain::Case => self.cases,
            Grain::Curve => self.cases / self.curve,
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The unit with this number, below [`Units::len`].
    pub fn get(&self, index: usize) -> Unit {
        match self.grain {
            Grain::Frequencies => {
                let (case, stretch) = (index / self.stretches(), index % self.stretches());
                Unit { cases: case..case + 1, points: stretch * BLOCK..((stretch + 1) * BLOCK).min(self.points) }
            }
            Grain::Case => Unit { cases: index..index + 1, points: 0..self.points },
            Grain::Curve => Unit { cases: index * self.curve..(index + 1) * self.curve, points: 0..self.points },
        }
    }
}

/// A unit that is ready to be computed.
#[derive(Debug)]
pub struct Work<'a> {
    /// The study.
    pub study: &'a Study,
    /// Its cases.
    pub cases: Vec<Arc<Prepared>>,
    /// Its frequencies by number.
    pub points: Range<usize>,
    /// How the study is run.
    pub context: &'a Context,
}

impl Work<'_> {
    /// The first of the cases.
    pub fn case(&self) -> &Prepared {
        &self.cases[0]
    }

    /// Frequency number `index` of the first case, rad/s.
    pub fn omega(&self, index: usize) -> f64 {
        self.case().case.frequencies.as_ref().and_then(|f| f.get(index)).unwrap_or(f64::NAN)
    }

    /// Whether the study has several frequencies, so that tables must tell them apart.
    pub fn several_frequencies(&self) -> bool {
        self.case().case.frequencies.as_ref().is_some_and(|f| f.len() > 1)
    }
}

/// What a unit yields, or the index of a case and why its model cannot be taken.
pub type Computed = Result<Part, (usize, MethodError)>;

/// What a unit yields.
#[derive(Debug, Default)]
pub struct Part {
    /// Rows of the tables of the kind, in its order.
    pub tables: Vec<Rows>,
    /// What a reader of the results must know.
    pub notes: Vec<Note>,
    /// Points without a result: where, and why.
    pub failures: Vec<crate::dataset::Failure>,
    /// Points by status.
    pub points: BTreeMap<String, u64>,
    /// Whether the run was stopped before it was finished: what follows its points, such as peaks, may be missing though all of them are there.
    pub cut: bool,
}

/// The status of a point that converged, [`Accuracy::Converged`](stickslip::orbit::Accuracy::Converged).
pub const CONVERGED: &str = "converged";
/// The status of a point that an interrupted run did not reach.
pub const NOT_REACHED: &str = "not-reached";

impl Part {
    /// Counts a point and keeps its failure.
    pub(crate) fn count(&mut self, at: impl FnOnce() -> String, status: &str, failure: Option<String>) {
        *self.points.entry(status.to_owned()).or_default() += 1;
        if let Some(reason) = failure {
            self.failures.push(crate::dataset::Failure { at: at(), reason });
        }
    }

    /// A unit that an interrupted run did not reach.
    pub(crate) fn not_reached(points: usize) -> Self {
        Part { points: BTreeMap::from([(NOT_REACHED.to_owned(), points as u64)]), ..Part::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units(grain: Grain) -> Vec<Unit> {
        let units = Units { grain, cases: 6, points: 150, curve: 3 };
        (0..units.len()).map(|index| units.get(index)).collect()
    }

    #[test]
    fn units_cover_every_point_once_and_in_order() {
        for grain in [Grain::Frequencies, Grain::Case, Grain::Curve] {
            let all: Vec<(usize, usize)> = units(grain)
                .into_iter()
                .flat_map(|unit| unit.cases.flat_map(move |case| unit.points.clone().map(move |point| (case, point))))
                .collect();
            let expected: Vec<(usize, usize)> =
                (0..6).flat_map(|case| (0..150).map(move |point| (case, point))).collect();
            assert_eq!(all, expected, "{grain:?}");
        }
        assert_eq!(units(Grain::Frequencies)[1], Unit { cases: 0..1, points: 61..122 });
        assert_eq!(units(Grain::Curve).len(), 2);
    }
}
