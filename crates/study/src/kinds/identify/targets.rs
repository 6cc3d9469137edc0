//! Targets: measured rows, and the values that the model has in their place.

use super::backbone::Backbone;
use super::loops::LoopTarget;
use super::response::ResponseTarget;
use super::ring_down::RingDown;
use super::settled::Settled;
use super::weight::Weight;
use crate::case::initial_state::StartKeys;
use crate::case::names::ModelNames;
use crate::case::study::{Case, Study};
use crate::case::values::Values;
use crate::compile::torsion::of_rotation;
use crate::data::{ColumnError, DataTable};
use crate::kinds::info::KeyError;
use crate::syntax::suggest::alternatives;
use num_complex::Complex64;
use std::fmt::Debug;
use stickslip::dimension::Dimension;
use stickslip::method::{self, Method};
use stickslip::model::Model;
use stickslip::orbit::Seed;

/// Warm starts of the rows of a target: the seeds of their orbits.
pub(super) type RowStates = Vec<Option<Seed>>;

/// Numbers of the model in place of the measured ones.
#[derive(Debug, Clone, Default)]
pub(super) struct Fitted {
    /// One number for each of [`Target::measured`].
    pub values: Vec<f64>,
    /// Warm starts for the same rows at similar parameters.
    pub states: RowStates,
}

/// A measured number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured {
    /// Number of the row of the data, from 1.
    pub row: usize,
    /// Value of the column `group`.
    pub group: f64,
    /// Value of [`Target::abscissa`], in its unit.
    pub x: f64,
    pub value: f64,
    /// Standard deviation.
    pub deviation: f64,
}

/// The measured rows of a target.
#[derive(Debug)]
pub(super) struct MeasuredRows {
    /// Name of the data.
    pub data: String,
    /// True if the rows are predicted only, not fitted.
    pub is_predicted: bool,
    /// The measured numbers, all numbers of a row one after the other.
    pub values: Vec<Measured>,
}

/// Measured rows, and the model in their place.
pub(super) trait Target: Debug + Send + Sync {
    /// Returns the column name of the abscissa, with its unit at the end.
    fn abscissa(&self) -> &'static str;
    /// Returns the column name of the measured quantity, with its unit at the end. If several
    /// numbers belong to a row, there is one name for each of them.
    fn quantities(&self) -> Vec<String>;
    /// Returns the measured rows.
    fn measured(&self) -> &MeasuredRows;
    /// Returns whether the numbers of a row are real and imaginary part.
    fn is_complex(&self) -> bool {
        false
    }
    /// Returns the number of measured rows of the first two cycles, if the rows are one motion over
    /// time. A search that begins with few cycles cannot end with a cycle too many or too few.
    fn first_cycles(&self) -> Option<usize> {
        None
    }
    /// Computes the numbers of the model.
    ///
    /// # Errors
    /// The reason why the model has no such numbers.
    fn fitted(&self, case: &Case, starts: &RowStates) -> Result<Fitted, String>;
}

/// The values of the key `is`.
pub(super) fn kinds() -> Vec<(&'static str, &'static str)> {
    vec![
        (
            "response",
            "frequency response: the columns `frequency`, `response` (amplitude) and `phase`, or `response_real` and \
             `response_imaginary`, and the measured `force` of each row",
        ),
        ("loop", "loops of a joint: the columns `displacement` and `force`, for laws with velocity also `time`"),
        (
            "settled",
            "steady-state vibration: the columns `frequency`, `force`, and `amplitude` (half of peak to peak) or `mean` of a \
             place, or `dissipation` of a joint per cycle",
        ),
        ("ring-down", "free decay: the columns `time` and `response`"),
        ("backbone", "frequency over amplitude: the columns `amplitude`, `frequency` and `damping`"),
    ]
}

/// The values of the keys `quantity` and `phase_of`.
pub(super) fn quantities() -> Vec<(&'static str, &'static str)> {
    QUANTITIES.iter().map(|quantity| (quantity.name, quantity.summary)).collect()
}

/// A quantity of a place: a time derivative of its displacement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Quantity {
    pub name: &'static str,
    summary: &'static str,
    /// Number of time derivatives.
    pub derivatives: i32,
    /// Column name with the unit.
    pub column: &'static str,
}

const QUANTITIES: [Quantity; 3] = [
    Quantity { name: "displacement", summary: "displacement", derivatives: 0, column: "displacement_m" },
    Quantity { name: "velocity", summary: "velocity", derivatives: 1, column: "velocity_m_per_s" },
    Quantity { name: "acceleration", summary: "acceleration", derivatives: 2, column: "acceleration_m_per_s2" },
];

impl Quantity {
    fn of(values: &Values, key: &str) -> Option<Quantity> {
        let name = values.text(key)?;
        QUANTITIES.into_iter().find(|quantity| quantity.name == name)
    }

    pub fn dimension(self) -> Dimension {
        Dimension { kg: 0, m: 1, s: -self.derivatives as i8, rad: 0 }
    }

    /// Returns the factor `(jω)^n` from the displacement.
    pub fn displacement_factor(self, omega: f64) -> Complex64 {
        Complex64::new(0.0, omega).powi(self.derivatives)
    }
}

/// A target that cannot be used.
#[derive(Debug)]
pub(super) struct TargetError {
    /// Number of the target, from 1.
    pub number: usize,
    pub message: String,
    pub help: String,
}

/// Common input of all kinds of targets, with the data in SI.
#[derive(Debug)]
pub(super) struct TargetInput<'a> {
    /// Index in `targets`, from 0.
    pub index: usize,
    pub data: &'a DataTable,
    pub values: &'a Values,
    pub case: &'a Case,
    pub at: &'a str,
    pub quantity: Quantity,
    pub phase_of: Quantity,
    pub predict: bool,
    /// Numbers of the rows in `groups`, from 0, and their groups.
    rows: Vec<usize>,
    groups: Vec<f64>,
}

impl TargetInput<'_> {
    /// Returns the numbers of a column in the rows of the target.
    pub fn column(&self, role: &str, dimension: Dimension) -> Result<Vec<f64>, ColumnError> {
        let dimension = if self.case.is_torsional { of_rotation(dimension) } else { dimension };
        let all = self.data.values(role, dimension).map_err(|error| self.with_quantity(role, dimension, error))?;
        let missing = self.rows.iter().find(|row| !all.get(**row).is_some_and(|value| value.is_finite()));
        if let Some(row) = missing {
            let message = format!("row {} of `{}` has no number in the column `{role}`", row + 1, self.data.name);
            let help = "remove the row (of a ring-down, whose steps are equal: interpolate it), or state `groups` \
                        without it";
            return Err(ColumnError { message, help: help.to_owned() });
        }
        Ok(self.rows.iter().map(|row| all[*row]).collect())
    }

    /// Gives an error of a unit the advice to state the `quantity`, if the column has the unit of
    /// another one.
    fn with_quantity(&self, role: &str, dimension: Dimension, error: ColumnError) -> ColumnError {
        let of = |quantity: &Quantity| match self.case.is_torsional {
            true => of_rotation(quantity.dimension()),
            false => quantity.dimension(),
        };
        let has_unit = |other: &&Quantity| self.data.has_unit(role) && self.data.values(role, of(other)).is_ok();
        match QUANTITIES.iter().find(has_unit) {
            Some(other) if dimension == of(&self.quantity) => {
                let help = format!("add quantity = \"{}\" to the target, or name another column", other.name);
                ColumnError { message: error.message, help }
            }
            _ => error,
        }
    }

    /// Returns a column if the data have it.
    pub fn optional_column(&self, role: &str, dimension: Dimension) -> Result<Option<Vec<f64>>, ColumnError> {
        if self.data.has(role) { self.column(role, dimension).map(Some) } else { Ok(None) }
    }

    /// Returns the standard deviations of values with these magnitudes, group by group.
    pub fn deviations(&self, magnitudes: &[f64], dimension: Dimension) -> Result<Vec<f64>, ColumnError> {
        let text = self.values.text("weight").unwrap_or("1 % of largest");
        let dimension = if self.case.is_torsional { of_rotation(dimension) } else { dimension };
        let weight = Weight::read(text, dimension).map_err(|message| ColumnError {
            message,
            help: "write `relative 2 %`, `1 % of largest`, or a quantity with its unit".to_owned(),
        })?;
        let mut all = vec![0.0; magnitudes.len()];
        for group in self.distinct_groups() {
            let own: Vec<usize> = (0..magnitudes.len()).filter(|i| self.groups[*i] == group).collect();
            let values: Vec<f64> = own.iter().map(|i| magnitudes[*i]).collect();
            own.iter().zip(weight.deviations(&values)).for_each(|(i, deviation)| all[*i] = deviation);
        }
        Ok(all)
    }

    fn distinct_groups(&self) -> Vec<f64> {
        let mut groups: Vec<f64> = self.groups.clone();
        groups.sort_by(f64::total_cmp);
        groups.dedup();
        groups
    }

    /// Returns a measured number of row `i` of the target.
    pub fn measured(&self, i: usize, x: f64, value: f64, deviation: f64) -> Measured {
        Measured { row: self.rows[i] + 1, group: self.groups[i], x, value, deviation }
    }

    /// Returns the measured rows of the target from their numbers.
    pub fn measured_rows(&self, values: Vec<Measured>) -> MeasuredRows {
        MeasuredRows { data: self.data.name.clone(), is_predicted: self.predict, values }
    }

    pub fn group(&self, i: usize) -> f64 {
        self.groups[i]
    }
}

/// Returns the number of measured rows of a study, for its size.
pub(super) fn rows(study: &Study, values: &Values) -> usize {
    let data = |target: &Values| {
        let name = target.text("data")?;
        study.data.iter().find(|data| data.name == name).map(DataTable::rows)
    };
    values.tables("targets").unwrap_or_default().iter().filter_map(data).sum()
}

/// Checks the names in a target.
pub(super) fn check(target: &Values, values: &Values, model: &Model) -> Result<(), KeyError> {
    let at = target.text("at").unwrap_or_default();
    match target.text("is") {
        Some("loop") => {
            let joints: Vec<&str> = model.joints.iter().map(|joint| joint.name.as_str()).collect();
            if !joints.contains(&at) {
                return Err(KeyError::unknown_name("targets", "joint", at, &joints));
            }
        }
        Some("settled") if model.joints.iter().any(|joint| joint.name == at) => {}
        Some(kind) => {
            ModelNames::places(model).single_label("targets", "place", at)?;
            if kind == "ring-down" {
                check_start(at, target, values, model)?;
            }
        }
        None => {}
    }
    Ok(())
}

/// Checks the initial state of a ring-down.
fn check_start(at: &str, target: &Values, values: &Values, model: &Model) -> Result<(), KeyError> {
    let initial = StartKeys::of_record(target, values);
    // an error of the target's own keys is in the list of targets
    let in_target = |error: KeyError| match target.by_name(error.key) {
        Some(_) => KeyError { key: "targets", ..error },
        None => error,
    };
    initial.check_names(model).map_err(in_target)?;
    if initial.moves() {
        return Ok(());
    }
    let help = format!(
        "add start = {{ \"{at}\" = \"1 mm\" }}; if the displacement was not measured, write a fitted parameter there"
    );
    Err(KeyError::new("targets", format!("the ring-down of `{at}` needs an initial displacement or velocity"), help))
}

/// Builds the targets of a case. Stored results have no data and so no targets.
pub(super) fn build(study: &Study, case: &Case) -> Result<Vec<Box<dyn Target>>, TargetError> {
    let stated = case.values.tables("targets").unwrap_or_default();
    if study.data.iter().any(|data| !data.is_read()) {
        return Ok(Vec::new());
    }
    let mut targets = Vec::new();
    for (i, values) in stated.iter().enumerate() {
        let error = |ColumnError { message, help }| TargetError { number: i + 1, message, help };
        targets.push(build_one(study, case, i, values).map_err(error)?);
    }
    if targets.iter().all(|target| target.measured().is_predicted) {
        let message = "no rows are fitted: every target has predict = true".to_owned();
        return Err(TargetError { number: 1, message, help: "remove `predict` from one target".to_owned() });
    }
    Ok(targets)
}

/// Largest number of groups that an error lists.
const MAX_GROUPS: usize = 8;

fn build_one(study: &Study, case: &Case, index: usize, values: &Values) -> Result<Box<dyn Target>, ColumnError> {
    let name = values.text("data").unwrap_or_default();
    let data = DataTable::find_in(&study.data, name)?;
    let all = if data.has("group") { data.plain_values("group")? } else { vec![0.0; data.rows()] };
    let wanted = values.quantities("groups");
    let rows: Vec<usize> =
        (0..all.len()).filter(|row| wanted.is_none_or(|wanted| wanted.contains(&all[*row]))).collect();
    if let Some(absent) = wanted.and_then(|wanted| wanted.iter().find(|group| !all.contains(group))) {
        let message = format!("no row of `{name}` is in group {absent} of `groups`");
        let mut known = all;
        known.sort_by(f64::total_cmp);
        known.dedup();
        let help = match data.has("group") {
            true if known.len() > MAX_GROUPS => {
                format!("the column `group` contains values from {} to {}", known[0], known[known.len() - 1])
            }
            true => {
                let known: Vec<String> = known.iter().map(f64::to_string).collect();
                format!("the column `group` contains {}", alternatives(known.iter().map(String::as_str)))
            }
            false => "without a column `group`, all rows are in group 0".to_owned(),
        };
        return Err(ColumnError { message, help });
    }
    let quantity = Quantity::of(values, "quantity").unwrap_or(QUANTITIES[0]);
    let input = TargetInput {
        index,
        data,
        values,
        case,
        at: values.text("at").unwrap_or_default(),
        quantity,
        phase_of: Quantity::of(values, "phase_of").unwrap_or(quantity),
        predict: values.flag("predict") == Some(true),
        groups: rows.iter().map(|row| all[*row]).collect(),
        rows,
    };
    Ok(match values.text("is").unwrap_or_default() {
        "loop" => Box::new(LoopTarget::new(&input)?),
        "ring-down" => Box::new(RingDown::new(&input)?),
        "backbone" => Box::new(Backbone::new(&input)?),
        "settled" => Box::new(Settled::new(&input)?),
        _ => Box::new(ResponseTarget::new(&input)?),
    })
}

/// Returns the method of a case.
pub(super) fn method_of(case: &Case) -> Result<Box<dyn Method>, String> {
    let row = method::find(&case.method.name).ok_or_else(|| format!("there is no method `{}`", case.method.name))?;
    (row.build)(&case.method.options).map_err(|error| error.to_string())
}
