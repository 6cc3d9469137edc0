//! Forces and motions from records and signals: `data` and `signal` in their entries.
//!
//! A record is linear between its rows and zero outside of them. The motion is computed from row
//! to row. Within an interval of length `h`, the linear part is
//! `t = (3/2 sin ωt - 3/10 sin 2ωt + 1/30 sin 3ωt)/ω` with `ωh = 0.05`. The next term of the
//! series is `(ωt)⁶/140`, so the relative error is 1e-10, and every integration takes it as an
//! excitation of three harmonics.
//!
//! An acceleration of the ground acts as `-m a` on every mass, and displacements are those
//! relative to the ground.

use super::signal::SignalRows;
use crate::case::study::{Case, Study};
use crate::case::values::{ResolvedValue, Values};
use crate::compile::compiled::{CompiledTable, CompiledValue, Environment};
use crate::compile::torsion::of_rotation;
use crate::data::{ColumnError, DataTable};
use crate::syntax::expression::ExpressionValue;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip::dimension::Dimension;
use stickslip::method::time_history::DrivenInterval;
use stickslip::model::{ExcitationSum, Force, GROUND, Model, Motion, System};

/// Factors of `sin kωt` in the series of `ωt`.
const SERIES: [f64; 3] = [1.5, -0.3, 1.0 / 30.0];

/// Phase of the slow harmonics at the end of an interval, rad.
const PHASE: f64 = 0.05;

/// A column over time.
#[derive(Debug, Clone)]
struct Channel {
    /// Harmonic of its unit excitation in [`Records::unit`].
    harmonic: u32,
    times: Vec<f64>,
    values: Vec<f64>,
}

impl Channel {
    /// Returns the value at `begin` and the slope in the interval that begins there. `inside` is a
    /// time shortly after the beginning, which rounding may shift before a row.
    fn at(&self, begin: f64, inside: f64) -> (f64, f64) {
        let above = self.times.partition_point(|row| *row <= inside);
        if above == 0 || above == self.times.len() {
            return (0.0, 0.0);
        }
        let (t0, t1) = (self.times[above - 1], self.times[above]);
        let slope = (self.values[above] - self.values[above - 1]) / (t1 - t0);
        (self.values[above - 1] + slope * (begin - t0), slope)
    }
}

/// The records of a case.
#[derive(Debug)]
pub(super) struct Records {
    /// The system under the constant forces. Every channel is a unit excitation with a separate
    /// harmonic.
    unit: System,
    channels: Vec<Channel>,
    /// Times of all rows, rising.
    knots: Vec<f64>,
    /// Channels with the acceleration of the ground, and the displacements of all degrees of
    /// freedom if the ground moves by 1 m.
    ground: Vec<(usize, Vec<f64>)>,
}

/// A problem of a record: the list, the number of its entry, and the key.
pub(in crate::kinds) struct RecordError {
    pub list: &'static str,
    pub index: usize,
    pub key: &'static str,
    pub error: ColumnError,
}

/// Returns the text of a key.
fn text<'t>(table: &'t CompiledTable, key: &str) -> Option<&'t str> {
    match &table.entry(key)?.value {
        CompiledValue::Fixed(ResolvedValue::Text(text)) => Some(text),
        _ => None,
    }
}

impl Records {
    /// Collects the records of a study; `None` if it has none, or if its data were not read.
    pub fn new(study: &Study, case: &Case) -> Result<Option<Records>, RecordError> {
        let lists = [("force", &study.structure.lists.force), ("motion", &study.structure.lists.motion)];
        let mut model = case.model.clone();
        let (mut channels, mut on_the_ground): (Vec<Channel>, _) = (Vec::new(), Vec::new());
        for (list, tables) in lists {
            for (index, table) in tables.iter().enumerate() {
                if !table.has_time_history() {
                    continue;
                }
                let history = if table.entry("signal").is_some() { "signal" } else { "data" };
                let fail = |key: &'static str, error: ColumnError| RecordError { list, index, key, error };
                let error =
                    |key, message: String, help: &str| fail(key, ColumnError { message, help: help.to_owned() });
                // the records use the harmonics themselves
                let forced = case.model.forces.iter().any(|force| force.harmonic > 0 && force.amplitude != 0.0)
                    || !case.model.frequency_forces.is_empty();
                let moved = case.model.motions.iter().any(|motion| motion.harmonic > 0 && motion.amplitude != 0.0);
                if forced || moved {
                    let help =
                        "write all forces as records; only constant forces (harmonic = 0) may act at the same time";
                    return Err(error(history, "a record and a harmonic force exclude each other".to_owned(), help));
                }
                let on = text(table, "on").unwrap_or_default().to_owned();
                let harmonic = channels.len() as u32 + 1;
                let on_ground = list == "motion" && on == GROUND;
                let (displacement, role) = match (list, on_ground, model.is_rotation(&on)) {
                    ("force", _, false) => (Dimension::FORCE, "force"),
                    ("force", _, true) => (Dimension::ENERGY, "force"),
                    (_, true, _) => (Dimension::ACCELERATION, "acceleration"),
                    (_, _, false) => (Dimension::LENGTH, "displacement"),
                    (_, _, true) => (Dimension::ANGLE, "displacement"),
                };
                let dimension = if case.is_torsional { of_rotation(displacement) } else { displacement };
                let rows = if history == "signal" {
                    if list == "motion" && !on_ground {
                        let help = "state the motion of this place by a record, or name `ground`";
                        return Err(error("signal", "a signal is an acceleration of the ground".to_owned(), help));
                    }
                    let mut problems = Vec::new();
                    let stated = table.values(&environment(study, case), &mut problems);
                    // problems were found when the case was resolved
                    SignalRows::new(stated.table("signal").unwrap_or(&Values::default()))
                        .map_err(|cause| fail("signal", cause))?
                } else {
                    let column = text(table, "column").unwrap_or(role);
                    let name = text(table, "data").unwrap_or_default();
                    let data = DataTable::find_in(&study.data, name)
                        .map_err(|missing| error("data", missing.message, "add [[data]] with this name and `file`"))?;
                    if !data.is_read() {
                        return Ok(None);
                    }
                    record_rows(data, column, dimension).map_err(|(key, cause)| fail(key, cause))?
                };
                let SignalRows { times, values } = rows;
                if on_ground {
                    let moved = push_inertia(&mut model, text(table, "along"), harmonic);
                    on_the_ground.push((channels.len(), moved.map_err(|cause| fail("on", cause))?));
                } else if list == "force" {
                    model.forces.push(Force { on, amplitude: 1.0, phase: 0.0, harmonic });
                } else {
                    model.motions.push(Motion { on, amplitude: 1.0, phase: 0.0, harmonic });
                }
                channels.push(Channel { harmonic, times, values });
            }
        }
        if channels.is_empty() {
            return Ok(None);
        }
        let unit = model.assemble().map_err(|cause| RecordError {
            list: "force",
            index: 0,
            key: "data",
            error: ColumnError { message: cause.to_string(), help: "check the places of the records".to_owned() },
        })?;
        let mut knots: Vec<f64> = channels.iter().flat_map(|channel| channel.times.iter().copied()).collect();
        knots.push(0.0);
        knots.retain(|time| *time >= 0.0);
        knots.sort_by(f64::total_cmp);
        knots.dedup();
        let carried = |moved: Vec<String>| {
            let mut displacement = vec![0.0; unit.dofs()];
            let places = unit.places().iter().zip(unit.place_axes()).filter(|(place, _)| moved.contains(place));
            places.flat_map(|(_, axis)| axis.rows()).for_each(|(row, weight)| displacement[*row] = *weight);
            displacement
        };
        let ground = on_the_ground.into_iter().map(|(channel, moved)| (channel, carried(moved))).collect();
        Ok(Some(Records { unit, channels, knots, ground }))
    }

    /// Tells whether the ground moves, so that displacements are relative to it.
    pub fn ground_moves(&self) -> bool {
        !self.ground.is_empty()
    }

    /// Returns the accelerations of the degrees of freedom that move with the ground, m/s².
    pub fn ground_acceleration(&self, time: f64) -> Vec<f64> {
        let mut acceleration = vec![0.0; self.unit.dofs()];
        for (channel, carried) in &self.ground {
            let (value, _) = self.channels[*channel].at(time, time);
            acceleration.iter_mut().zip(carried).for_each(|(sum, moved)| *sum += value * moved);
        }
        acceleration
    }

    /// Returns the time of the last row, s.
    pub fn end(&self) -> f64 {
        self.knots.last().copied().unwrap_or(0.0)
    }

    /// Returns the excitation in the interval that begins at `begin`; `rest` is the length of the
    /// interval after the last row.
    pub fn interval(&self, begin: f64, rest: f64) -> DrivenInterval {
        // the beginning of an interval is a row, to rounding
        let tolerance = 1e-9 * self.end();
        let next = self.knots.partition_point(|knot| *knot <= begin + tolerance);
        let length = self.knots.get(next).map_or(rest, |knot| knot - begin);
        let omega = PHASE / length;
        let mut constant = vec![(0, Complex64::new(1.0, 0.0))];
        let mut slow = vec![Vec::new(); SERIES.len()];
        for channel in &self.channels {
            let (value, slope) = channel.at(begin, begin + tolerance);
            constant.push((channel.harmonic, Complex64::new(value, 0.0)));
            // a sin ωt is the real part of -j a e^(jωt)
            for (sum, factor) in slow.iter_mut().zip(SERIES) {
                sum.push((channel.harmonic, Complex64::new(0.0, -factor * slope / omega)));
            }
        }
        let mut sums = vec![ExcitationSum { harmonic: 0, of: constant }];
        let slow = slow.into_iter().zip(1..).map(|(of, harmonic)| ExcitationSum { harmonic, of });
        sums.extend(slow.filter(|_| next < self.knots.len()));
        let system = Arc::new(self.unit.with_excitation_sums(&sums));
        let omega = if next < self.knots.len() { omega } else { 0.0 };
        DrivenInterval { system, omega, reported: 0.0, length }
    }
}

/// Returns the values of the parameters of a case.
fn environment<'a>(study: &'a Study, case: &Case) -> Environment<'a> {
    let value = |name: &String| match case.parameters.get(name) {
        Some((si, Some(dimension))) => ExpressionValue::new(*si, *dimension),
        Some((si, None)) => ExpressionValue::bare(*si),
        None => ExpressionValue::bare(f64::NAN),
    };
    Environment { names: &study.names, parameters: &study.parameters, values: study.names.iter().map(value).collect() }
}

/// Reads a column over time. An error has the key to which it belongs.
fn record_rows(
    data: &DataTable,
    column: &str,
    dimension: Dimension,
) -> Result<SignalRows, (&'static str, ColumnError)> {
    let times = data.values("time", Dimension::TIME).map_err(|cause| ("data", cause))?;
    let values = data.values(column, dimension).map_err(|cause| ("column", cause))?;
    let finite = times.len() == values.len() && times.iter().chain(&values).all(|value| value.is_finite());
    if !finite || times.len() < 2 || times.windows(2).any(|pair| pair[0] >= pair[1]) {
        let message = format!("the record `{}` needs two rows or more with rising times and without gaps", data.name);
        let help = "remove incomplete rows and sort the others by time".to_owned();
        return Err(("data", ColumnError { message, help }));
    }
    Ok(SignalRows { times, values })
}

/// Checks the records of a case.
pub(in crate::kinds) fn check(study: &Study, case: &Case) -> Result<(), RecordError> {
    Records::new(study, case).map(drop)
}

/// Adds the inertia forces `-m a` of a unit acceleration of the ground. Returns the places on which
/// they act.
fn push_inertia(model: &mut Model, along: Option<&str>, harmonic: u32) -> Result<Vec<String>, ColumnError> {
    let error = |message: &str, help: &str| ColumnError { message: message.to_owned(), help: help.to_owned() };
    if model.substructure.is_some() || model.ring.is_some() {
        let help = "state a model of masses and bodies, or a motion of the places that the ground moves";
        return Err(error("an acceleration of the ground needs a model of masses or bodies", help));
    }
    let nodes = model
        .masses
        .iter()
        .map(|mass| (&mass.name, mass.mass, &mass.directions))
        .chain(model.bodies.iter().map(|body| (&body.name, body.mass, &body.directions)));
    let mut forces = Vec::new();
    for (name, mass, directions) in nodes {
        let on = match (along, directions.as_slice()) {
            (None, []) => name.clone(),
            (Some(along), directions) if directions.iter().any(|own| own == along) => format!("{name}.{along}"),
            (Some(_), []) | (None, _) => {
                let help = "add `along` with a direction of the masses, or remove it if the masses have no directions";
                return Err(error("the direction of the acceleration does not fit the masses", help));
            }
            // the mass cannot move in this direction
            (Some(_), _) => continue,
        };
        forces.push(Force { on, amplitude: -mass, phase: 0.0, harmonic });
    }
    if forces.is_empty() {
        return Err(error("no mass can move in this direction", "choose another direction in `along`"));
    }
    let moved = forces.iter().map(|force| force.on.clone()).collect();
    model.forces.extend(forces);
    Ok(moved)
}
