//! Identification: parameters of the model from measured data, by weighted least squares, with
//! standard errors and what the data do not determine.
//!
//! - `targets`: the trait of all targets, and the targets of a study;
//! - `orbit_rows`: orbits in place of measured rows, with the force of each row;
//! - `response`: frequency responses;
//! - `settled`: amplitudes, means and losses of settled vibrations;
//! - `loops`: loops of a joint under measured displacements, with `law_path`;
//! - `ring_down`: free decays in time;
//! - `backbone`: frequency and damping over amplitude;
//! - `weight`: standard deviations of measured values;
//! - `problem`: residuals and their derivatives over scaled parameters;
//! - `residuals`: the problem for solvers of other programs;
//! - `search`: starts and the minimization;
//! - `profile`: profile likelihood;
//! - `statistics`: covariance, intervals, undetermined directions, structure of the residuals;
//! - `agreement`: measured and fitted values of every group;
//! - `tables`, `figure`: results.

mod agreement;
mod backbone;
mod figure;
mod law_path;
mod loops;
mod orbit_rows;
mod problem;
mod profile;
mod residuals;
mod response;
mod ring_down;
mod search;
mod settled;
mod statistics;
mod tables;
mod targets;
mod weight;

use crate::case::initial_state::{StartKeys, begin_values};
use crate::case::study::Study;
use crate::case::values::Values;
use crate::check::size::{PlannedSize, SizeInputs, TableShape};
use crate::check::survey::SurveyedCase;
use crate::kinds::info::{KeyError, KindInfo};
use crate::kinds::kind::{Kind, Probe};
use crate::results::notes::{Note, WARNING};
use crate::results::table_builder::TableBuilder;
use crate::run::work::{CONVERGED, Computed, NOT_CONVERGED, NOT_REACHED, UnitResult, UnitSize, UnitTask};
use crate::syntax::error::StudyError;
use crate::syntax::expression::quantity_text;
use crate::syntax::key::{Bounds, Key, ValueType, default, optional, required};
use problem::FitProblem;
pub use residuals::Residuals;
use search::{SearchSettings, search};
use stickslip::dimension::Dimension;
use stickslip::model::Model;

/// Name of the kind.
pub(super) const NAME: &str = "identify";

/// The keys of a target.
const TARGET: &[Key] = &[
    required("data", ValueType::Text, "name of the [[data]] with the measured rows", "\"sweep\""),
    required("is", ValueType::Choice(targets::kinds), "what the rows are", "\"response\""),
    required(
        "at",
        ValueType::Text,
        "the measured place; for a loop and for a steady-state dissipation the joint",
        "\"blade1\"",
    ),
    default(
        "quantity",
        ValueType::Choice(targets::quantities),
        "displacement",
        "the measured quantity of the place",
        "\"acceleration\"",
    ),
    optional(
        "phase_of",
        ValueType::Choice(targets::quantities),
        "the quantity of the column `phase`, which is relative to the force; default: `quantity`",
        "\"displacement\"",
    ),
    default(
        "per_force",
        ValueType::Flag,
        "false",
        "true for a response that was divided by the amplitude of the force, such as a receptance",
        "true",
    ),
    optional(
        "groups",
        ValueType::Quantities(Dimension::NONE, Bounds::Finite),
        "only the rows with these values in the column `group`",
        "[1, 2, 3]",
    ),
    default(
        "weight",
        ValueType::Text,
        "1 % of largest",
        "standard deviation of the measured values, which weights the residuals: `relative 2 %`, `1 % of largest` \
         value in the group, or a quantity such as `0.1 m/s^2`; `relative` makes values near zero count most, which \
         biases a fit to a loop",
        "\"relative 2 %\"",
    ),
    default("mode", ValueType::Count(1, 600), "1", "for a backbone: number of the mode", "1"),
    default(
        "cycle",
        ValueType::Flag,
        "false",
        "for a loop: true if the rows are one closed cycle, which is computed twice so that its beginning does not matter",
        "true",
    ),
    optional(
        "start",
        ValueType::ByName(Dimension::LENGTH),
        "for a ring-down: initial displacements of this record, if they differ from those of other records",
        "{ blade1 = \"2 mm\" }",
    ),
    optional(
        "start_velocity",
        ValueType::ByName(Dimension::VELOCITY),
        "for a ring-down: initial velocities of this record, if they differ from those of other records",
        "{ blade1 = \"0.2 m/s\" }",
    ),
    default(
        "predict",
        ValueType::Flag,
        "false",
        "true: the rows are not fitted, but compared with the prediction of the fitted model",
        "true",
    ),
];

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: NAME,
        summary: "parameters of the model from measured data, by least squares, with standard errors",
        keys: &[
            required(
                "fit",
                ValueType::Fit,
                "the fitted parameters and the ranges of their values; the search begins at their values in \
                 [parameters]",
                "{ Ft = { from = \"0.1 N\", to = \"20 N\", scale = \"log\" } }",
            ),
            required(
                "targets",
                ValueType::Tables(TARGET),
                "the measured rows that the model must explain",
                "[{ data = \"sweep\", is = \"response\", at = \"blade1\" }]",
            ),
            default(
                "starts",
                ValueType::Count(0, 1000),
                "64",
                "further starts of the search, spread over the ranges by a Sobol sequence; the best of them are \
                 followed",
                "128",
            ),
            default(
                "loss",
                ValueType::Choice(search::losses),
                "squares",
                "loss function, which sets the weight of large residuals; for data with outliers, use another value than `squares`",
                "\"huber\"",
            ),
            default(
                "profile",
                ValueType::Flag,
                "false",
                "true: profile likelihood: the smallest weighted sum of squares at fixed values of each parameter, with the others fitted again",
                "true",
            ),
            optional(
                "start",
                ValueType::ByName(Dimension::LENGTH),
                "for a ring-down: initial displacements, as in kind = \"transient\"",
                "{ blade1 = \"1 mm\" }",
            ),
            optional(
                "begin",
                ValueType::Choice(begin_values),
                "for a ring-down: initial state of the other masses and joints",
                "\"unloaded\"",
            ),
            optional(
                "start_velocity",
                ValueType::ByName(Dimension::VELOCITY),
                "for a ring-down: initial velocities",
                "{ blade1 = \"0.1 m/s\" }",
            ),
        ],
        check,
        axes: [None, None],
        // each target uses its own computation, and is checked together with its data
        uses_method: false,
        needs: |_, _, _| Ok(()),
        adapts: false,
        tables: &[
            tables::PARAMETERS,
            tables::FIT,
            tables::TARGETS,
            tables::SUMMARY,
            tables::CORRELATIONS,
            tables::PROFILE,
        ],
    },
    unit_size: |_| UnitSize::Case,
    size,
    warnings: starts_outside,
    probe: Probe::Unit { name: "case" },
    compute,
    draw: figure::draw,
};

fn size(inputs: &SizeInputs<'_>) -> PlannedSize {
    let values = &inputs.case.values;
    let parameters = values.fit("fit").map_or(0, <[_]>::len) as f64;
    // a row of data has at most one row of the table
    let rows = targets::rows(inputs.study, values) as f64;
    let is_profiled = values.flag("profile") == Some(true);
    let shape = |rows: f64, numbers: f64, words: f64| TableShape { rows: inputs.cases * rows, numbers, words };
    PlannedSize {
        tables: vec![
            shape(parameters, inputs.varied + 6.0, 3.0),
            shape(rows, inputs.varied + 11.0, 4.0),
            // at most one group for each row
            shape(rows, inputs.varied + 8.0, 4.0),
            shape(1.0, inputs.varied + 10.0, 1.0),
            shape(parameters * parameters, inputs.varied + 1.0, 2.0),
            // the estimate and eight points on each side of it
            shape(if is_profiled { 17.0 * parameters } else { 0.0 }, inputs.varied + 3.0, 2.0),
        ],
        drawn: 4.0 * rows,
        unit: 8.0 * 2.0 * rows * (parameters + 4.0),
    }
}

fn check(values: &Values, model: &Model, _: usize) -> Result<(), KeyError> {
    for target in values.tables("targets").unwrap_or_default() {
        targets::check(target, values, model)?;
    }
    StartKeys::of(values).check_names(model)
}

/// Warns of parameters whose value in `[parameters]` is outside of their range.
fn starts_outside(cases: &[SurveyedCase]) -> Vec<String> {
    let case = &cases[0].case;
    let ranges = case.values.fit("fit").unwrap_or_default();
    let outside = ranges.iter().filter_map(|range| {
        let (value, _) = case.parameters.get(&range.name)?;
        let text = |value: f64| quantity_text(value, range.dimension);
        (!(range.from..=range.to).contains(value)).then(|| {
            format!(
                "`{}` = {} is outside of its range, {} to {}: the search begins inside, near the closer end",
                range.name,
                text(*value),
                text(range.from),
                text(range.to)
            )
        })
    });
    outside.collect()
}

/// Checks the targets of a study together with their data.
pub(super) fn check_data(study: &Study) -> Result<(), StudyError> {
    let case = study.case(0)?;
    let at = |key: &str, message: String, help: Option<String>| study.error_at("study", 0, key, message, help);
    for range in case.values.fit("fit").unwrap_or_default() {
        if study.varied().contains(&range.name.as_str()) {
            let message = format!("`{}` is also varied or drawn: a fitted parameter has no other values", range.name);
            return Err(at("fit", message, Some("remove it from `vary` and [sample]".to_owned())));
        }
    }
    match targets::build(study, &case) {
        Ok(_) => Ok(()),
        Err(error) => {
            let message = format!("target {}: {}", error.number, error.message);
            Err(at("targets", message, Some(error.help)))
        }
    }
}

/// The identification of a case.
struct Identification {
    found: search::Found,
    statistics: statistics::Statistics,
    fitted: Vec<targets::Fitted>,
    profiles: Vec<profile::Profile>,
    problem: FitProblem,
}

fn compute(work: &UnitTask<'_>) -> Computed {
    let prepared = work.case();
    let case = &prepared.case;
    let mut part = UnitResult {
        tables: (0..KIND.info.tables.len()).map(|_| TableBuilder::default()).collect(),
        ..UnitResult::default()
    };
    let found = targets::build(work.study, case).map_err(|error| error.message).and_then(|targets| {
        let problem = FitProblem::new(work.study, case, targets, &work.context.stop);
        let settings = SearchSettings::of(&case.values);
        let found = search(&problem, &settings)?;
        let mut statistics = statistics::Statistics::new(&problem, &found, settings.loss);
        if let Some(reason) = statistics.failure(&problem) {
            let differences = problem.fitted(&found.x).map(|fitted| problem.scale_differences(&fitted));
            let reasons: Vec<String> = std::iter::once(reason).chain(differences.unwrap_or_default()).collect();
            return Err(reasons.join("; "));
        }
        statistics.check_intervals(&problem, &settings, &found);
        let is_profiled = case.values.flag("profile") == Some(true);
        let profiles =
            if is_profiled { profile::profiles(&problem, &settings, &found, &statistics) } else { Vec::new() };
        let fitted = problem.fitted(&found.x)?;
        Ok(Identification { found, statistics, fitted, profiles, problem })
    });
    (work.context.finished)();
    match found {
        _ if work.context.stopped() => part.count(|| case.label(), NOT_REACHED, None),
        Ok(Identification { found, statistics, fitted, profiles, problem }) => {
            let mut warnings = problem.scale_differences(&fitted);
            warnings.extend(statistics.warnings(&problem));
            part.notes
                .extend(warnings.into_iter().map(|text| Note::for_case(&case.label(), format!("{WARNING}{text}"))));
            let agreements = agreement::agreements(&problem, &fitted);
            let predictions = agreement::predictions(&problem, &agreements);
            part.notes.extend(predictions.into_iter().map(|text| Note::for_case(&case.label(), text)));
            part.tables = tables::write(
                work,
                &problem,
                &tables::FitOutcome {
                    found: &found,
                    statistics: &statistics,
                    fitted: &fitted,
                    agreements: &agreements,
                    profiles: &profiles,
                },
            );
            part.count(|| case.label(), CONVERGED, None);
        }
        Err(reason) => part.count(|| case.label(), NOT_CONVERGED, Some(reason)),
    }
    Ok(part)
}
