//! Runs a study: prepares every case (so that what a method cannot take is found before anything is computed), lets the kind compute,
//! and adds the record.

use crate::dataset::{Column, Dataset, Failure, Figure, Record, Table, Values as Cells};
use crate::error::StudyError;
use crate::study::{Case, Study};
use crate::summary::ModelSummary;
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;
use std::time::Instant;
use stickslip::curve::sweep::Watch;
use stickslip::method::{self, Method, MethodError, OrbitError};
use stickslip::model::System;
use stickslip::orbit::Orbit;

/// How a study is run.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Threads that the run may use, for the record; the caller sets up the pool.
    pub threads: usize,
    /// When true the run ends early with the points that are finished.
    pub stop: &'a AtomicBool,
    /// Called once per finished point, from any thread.
    pub finished: &'a (dyn Fn() + Sync),
}

impl<'a> Context<'a> {
    /// What a sweep needs to know.
    pub(crate) fn watch(&self) -> Watch<'a> {
        Watch { finished: self.finished, stop: self.stop }
    }

    /// Whether the run is to end early.
    pub(crate) fn stopped(&self) -> bool {
        self.stop.load(std::sync::atomic::Ordering::Relaxed)
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

/// What a kind yields.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Tables, the most important first.
    pub tables: Vec<Table>,
    /// Panels of the figure.
    pub figure: Vec<crate::dataset::Panel>,
    /// Sentences for the reader.
    pub notes: Vec<String>,
    /// Points without a result.
    pub failures: Vec<Failure>,
    /// Points by status.
    pub points: BTreeMap<String, u64>,
}

impl Outcome {
    /// Counts a point and keeps its failure.
    pub(crate) fn count(&mut self, at: impl FnOnce() -> String, status: &str, failure: Option<String>) {
        *self.points.entry(status.to_owned()).or_default() += 1;
        if let Some(reason) = failure {
            self.failures.push(Failure { at: at(), reason });
        }
    }
}

/// The status of a point that converged, [`Accuracy::Converged`](stickslip::orbit::Accuracy::Converged).
pub const CONVERGED: &str = "converged";
/// The status of a point that an interrupted run did not reach.
pub const NOT_REACHED: &str = "not-reached";

/// Runs a study.
///
/// # Errors
/// [`StudyError`]: the method cannot take the model, or too much memory would be needed; nothing was computed. Points that do not converge are no error: they are in the
/// dataset, as failures.
///
/// # Example
/// ```
/// use std::sync::atomic::AtomicBool;
/// use stickslip_study::{read_study, run::{Context, run}};
/// let text = stickslip::model::templates::find("element").unwrap().study;
/// let study = read_study("element.toml", text, &[]).unwrap();
/// let context = Context { threads: 1, stop: &AtomicBool::new(false), finished: &|| () };
/// let dataset = run(&study, &context).unwrap();
/// let loss = dataset.tables[1].numbers("dissipation_J").unwrap();
/// assert!((loss[1] - 4e-6).abs() < 1e-15);   // 4 Ft (a - Ft/kt), a = 2 mm
/// ```
pub fn run(study: &Study, context: &Context<'_>) -> Result<Dataset, StudyError> {
    let start = Instant::now();
    let summary = summarised(study)?;
    let mut cases = Vec::with_capacity(study.cases());
    for index in 0..study.cases() {
        cases.push(prepare(study, study.case(index)?)?);
    }
    let mut outcome = (study.kind().run)(study, &cases, context)
        .map_err(|(index, error)| refused(study, &cases[index].case, &error))?;
    outcome.notes.splice(0..0, summary.warnings.iter().cloned());
    let interrupted = outcome.points.contains_key(NOT_REACHED);
    if interrupted {
        outcome.notes.push("The run was interrupted; only the points finished until then are here.".to_owned());
    }
    Ok(Dataset {
        name: study.name().to_owned(),
        title: study.title().to_owned(),
        source: study.source().map(str::to_owned),
        kind: study.kind().name.to_owned(),
        tables: outcome.tables,
        figure: Figure { title: study.title().to_owned(), panels: outcome.figure },
        notes: outcome.notes,
        failures: outcome.failures,
        record: Record {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            study: recorded(study, &summary),
            seed: None,
            threads: context.threads,
            wall_time_s: start.elapsed().as_secs_f64(),
            points: outcome.points,
            interrupted,
        },
    })
}

/// Prepares every case and computes nothing: whether [`run()`] would begin.
///
/// # Errors
/// [`StudyError`]: the method cannot take the model of a case, or the study needs more memory than it may take.
pub fn check(study: &Study) -> Result<(), StudyError> {
    summarised(study)?;
    (0..study.cases()).try_for_each(|index| prepare(study, study.case(index)?).map(drop))
}

/// What is known of the study before it is run; a study that needs too much memory is refused.
fn summarised(study: &Study) -> Result<ModelSummary, StudyError> {
    let summary = ModelSummary::new(study)?;
    match summary.size.refusal(study) {
        Some(error) => Err(error),
        None => Ok(summary),
    }
}

/// The study as it was understood, and its summary.
fn recorded(study: &Study, summary: &ModelSummary) -> serde_json::Value {
    let mut record = study.resolved();
    record["summary"] = summary.to_json();
    record
}

fn prepare(study: &Study, case: Case) -> Result<Prepared, StudyError> {
    let row = method::find(&case.method.name).ok_or_else(|| {
        study.error_at("method", 0, "kind", format!("there is no method `{}`", case.method.name), None)
    })?;
    let method = (row.build)(&case.method.options).map_err(|error| refused(study, &case, &error))?;
    let system =
        case.model.assemble().map_err(|error| study.error_at("study", 0, error.key, error.to_string(), None))?;
    if study.kind().uses_method {
        method.solver(&system).map_err(|error| refused(study, &case, &error))?;
    }
    Ok(Prepared { case, system, method })
}

/// A method's refusal, at the place in the file that it is about.
fn refused(study: &Study, case: &Case, error: &MethodError) -> StudyError {
    let model = &case.model;
    match error {
        MethodError::Law { joint, instead, .. } => {
            let index = model.joints.iter().position(|j| j.name == *joint).unwrap_or(0);
            study.error_at("joint", index, "law", error.to_string(), Some(format!("use {instead}")))
        }
        MethodError::NeedsMass { place, .. } => {
            let index = model.masses.iter().position(|m| m.name == *place).unwrap_or(0);
            study.error_at("mass", index, "mass", error.to_string(), None)
        }
        // a kind that needs no method has the method's options among its own keys
        MethodError::Option { key, .. } => {
            let table = if study.kind().uses_method { "method" } else { "study" };
            study.error_at(table, 0, key, error.to_string(), None)
        }
        _ => study.error_at("method", 0, "kind", error.to_string(), None),
    }
}

/// Columns that grow row by row, in a fixed order.
#[derive(Debug, Default)]
pub(crate) struct Rows {
    columns: Vec<Column>,
    next: usize,
}

impl Rows {
    fn cells(&mut self, name: &str, empty: Cells) -> &mut Cells {
        if self.next == self.columns.len() {
            self.columns.push(Column { name: name.to_owned(), values: empty });
        }
        let column = &mut self.columns[self.next];
        assert_eq!(column.name, name, "rows of one table have the same columns");
        self.next += 1;
        &mut column.values
    }

    pub fn number(&mut self, name: &str, value: f64) {
        if let Cells::Number(v) = self.cells(name, Cells::Number(Vec::new())) {
            v.push(value);
        }
    }

    pub fn integer(&mut self, name: &str, value: u64) {
        if let Cells::Integer(v) = self.cells(name, Cells::Integer(Vec::new())) {
            v.push(value);
        }
    }

    pub fn text(&mut self, name: &str, value: &str) {
        if let Cells::Text(v) = self.cells(name, Cells::Text(Vec::new())) {
            v.push(value.to_owned());
        }
    }

    pub fn flag(&mut self, name: &str, value: Option<bool>) {
        if let Cells::Flag(v) = self.cells(name, Cells::Flag(Vec::new())) {
            v.push(value);
        }
    }

    /// The varied parameters of a case, SI.
    pub fn varied(&mut self, case: &Case) {
        for varied in &case.varied {
            self.number(&varied.name, varied.si);
        }
    }

    /// Ends a row.
    pub fn end(&mut self) {
        self.next = 0;
    }

    pub fn table(self, name: &str) -> Table {
        Table { name: name.to_owned(), columns: self.columns }
    }
}

/// The place of a point in words: the varied parameters and the frequency.
pub(crate) fn place_of(case: &Case, omega: f64) -> String {
    let frequency = format!("frequency = {:.6} Hz", omega / std::f64::consts::TAU);
    if case.varied.is_empty() { frequency } else { format!("{}, {frequency}", case.label()) }
}

/// What a table keeps of one orbit, or of its failure: one number per place and joint, and the evidence.
#[derive(Debug, Clone)]
pub(crate) struct Summary {
    /// Amplitude, mean, phase per mass.
    pub places: Vec<[f64; 3]>,
    /// Dissipation, slip fraction per joint.
    pub joints: Vec<[f64; 2]>,
    pub stable: Option<bool>,
    pub residual: f64,
    pub energy_gap: f64,
    pub truncation: f64,
    pub iterations: u64,
    pub status: String,
    pub failure: Option<String>,
    pub stuck: bool,
}

impl Summary {
    pub fn new(system: &System, outcome: Result<&Orbit, &OrbitError>) -> Self {
        match outcome {
            Ok(orbit) => Summary {
                places: orbit.places.iter().map(|p| [p.amplitude(), p.mean, p.phase_deg()]).collect(),
                joints: orbit.joints.iter().map(|j| [j.dissipation, j.slip_fraction]).collect(),
                stable: orbit.is_stable(),
                residual: orbit.evidence.residual,
                energy_gap: orbit.evidence.energy_gap,
                truncation: orbit.evidence.truncation.unwrap_or(f64::NAN),
                iterations: orbit.evidence.iterations as u64,
                status: orbit.evidence.accuracy.status().to_owned(),
                failure: None,
                stuck: orbit.is_one_of_many(),
            },
            Err(error) => {
                let mut row = Summary::missing(system, error.status());
                row.failure = Some(error.to_string());
                row
            }
        }
    }

    /// A point without a result.
    pub fn missing(system: &System, status: &str) -> Self {
        Summary {
            places: vec![[f64::NAN; 3]; system.dofs()],
            joints: vec![[f64::NAN; 2]; system.joints.len()],
            stable: None,
            residual: f64::NAN,
            energy_gap: f64::NAN,
            truncation: f64::NAN,
            iterations: 0,
            status: status.to_owned(),
            failure: None,
            stuck: false,
        }
    }

    /// The cells of the row, after the varied parameters and the frequency; `truncated` says whether any row of the table has an
    /// estimate of its truncation.
    pub fn write(&self, system: &System, truncated: bool, rows: &mut Rows) {
        for (place, [amplitude, mean, phase]) in system.places.iter().zip(&self.places) {
            rows.number(&format!("{place}_amplitude_m"), *amplitude);
            rows.number(&format!("{place}_mean_m"), *mean);
            rows.number(&format!("{place}_phase_deg"), *phase);
        }
        for (joint, [dissipation, slip]) in system.joints.iter().zip(&self.joints) {
            rows.number(&format!("{}_dissipation_J", joint.name), *dissipation);
            rows.number(&format!("{}_slip_fraction", joint.name), *slip);
        }
        rows.flag("stable", self.stable);
        rows.number("residual", self.residual);
        rows.number("energy_gap", self.energy_gap);
        if truncated {
            rows.number("truncation", self.truncation);
        }
        rows.integer("iterations", self.iterations);
        rows.text("status", &self.status);
    }
}

/// The unit in which `largest` (SI) lies between 0.5 and 500: its name and the factor from SI.
pub(crate) fn display_unit(largest: f64, si: &str) -> (String, f64) {
    for (prefix, factor) in [("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9)] {
        if largest * factor >= 0.5 {
            return (format!("{prefix}{si}"), factor);
        }
    }
    (si.to_owned(), 1.0)
}
