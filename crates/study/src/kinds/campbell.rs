//! Campbell diagrams: natural frequencies over the speed of a rotor, engine order lines and
//! their crossings.
//!
//! The model states how its stiffness depends on the speed: the speed is a parameter, and a
//! spring `k0 + k1*speed^2` stiffens. On a tuned disk an engine order `e` excites the modes of
//! one nodal diameter: the distance from `e` to the nearest multiple of the sector count.

use super::keys::anything;
use super::nodal_diameter::{STATES, waves};
use crate::columns::FREQUENCY;
use crate::cost::{Cost, Costing, Shape};
use crate::dataset::{Figure, Panel, Series, Style, Table};
use crate::drawing::{Drawing, Stretch, largest, numbers, words};
use crate::draws;
use crate::info::{Complaint, KindInfo};
use crate::key::SPEEDS;
use crate::key::{Takes, default, required};
use crate::kind::Kind;
use crate::note::Note;
use crate::rows::Rows;
use crate::values::{Values, hertz};
use crate::work::{CONVERGED, Computed, Grain, NOT_REACHED, Part, Prepared, Work};
use std::f64::consts::TAU;
use stickslip::dimension::Dimension;
use stickslip::model::{Model, ReductionAccuracy};

const TABLE: &str = "campbell";
const CROSSINGS: &str = "crossings";
const SPEED: &str = "speed_Hz";
const JOINTS: &str = "joints";
const DIAMETER: &str = "nodal_diameter";
const MODE: &str = "mode";
const ORDER: &str = "engine_order";

/// Default name of the parameter.
const PARAMETER: &str = "speed";

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: "campbell",
        summary: "natural frequencies over the speed of a rotor, with engine order lines and their crossings",
        keys: &[
            required(
                "speed",
                Takes::Frequencies(SPEEDS),
                "speeds of rotation as frequencies; zero is allowed",
                "{ from = \"10 Hz\", to = \"120 Hz\", points = 56 }",
            ),
            default(
                "parameter",
                Takes::Name,
                PARAMETER,
                "the parameter that holds the speed, if stiffnesses depend on it; its stated value is then ignored",
                "\"speed\"",
            ),
            default("engine_orders", Takes::Count(1, 200), "6", "highest engine order", "6"),
            default(
                "modes",
                Takes::Count(1, 100),
                "3",
                "number of lowest modes; for a tuned disk, the number for every nodal diameter",
                "3",
            ),
        ],
        check,
        axes: [Some(Dimension::FREQUENCY), Some(Dimension::FREQUENCY)],
        uses_method: false,
        needs: anything,
        adapts: false,
        tables: &[TABLE, CROSSINGS],
    },
    grain: |_| Grain::Case,
    cost,
    warnings: |_| Vec::new(),
    compute,
    draw,
};

fn check(values: &Values, _: &Model, _: usize) -> Result<(), Complaint> {
    let speeds = values.frequencies("speed").map_or(0, crate::values::Frequencies::len);
    if speeds >= 2 {
        return Ok(());
    }
    let message = "a Campbell diagram needs at least two speeds";
    Err(Complaint::new("speed", message, "write { from = \"10 Hz\", to = \"120 Hz\", points = 56 }"))
}

/// Time of an eigenvalue problem per cube of its size, s.
const EIGEN: f64 = 1e-8;

fn cost(costing: &Costing<'_>) -> Cost {
    let values = &costing.case.values;
    let speeds = values.frequencies("speed").map_or(2, crate::values::Frequencies::len) as f64;
    let count = |key: &str, or: u64| values.count(key).unwrap_or(or) as f64;
    let sectors = costing.case.model.ring.filter(|ring| ring.equal).map(|ring| ring.sectors as f64);
    let waves = sectors.map_or(1.0, |sectors| sectors / 2.0 + 1.0);
    let lines = 2.0 * waves * count("modes", 3);
    // an engine order excites the modes of one nodal diameter
    let crossings = lines / waves * count("engine_orders", 6);
    let depends = costing.case.parameters.contains_key(costing.case.values.text("parameter").unwrap_or(PARAMETER));
    let found = if depends { speeds + REFINED * crossings } else { 1.0 };
    // free and stuck joints for every wave; the complex problem of a wave has twice the size
    let size = sectors.map_or(costing.masses, |sectors| 2.0 * costing.masses / sectors);
    Cost {
        tables: vec![
            Shape { rows: costing.cases * speeds * lines, numbers: costing.varied + 4.0, words: 1.0 },
            Shape { rows: costing.cases * crossings, numbers: costing.varied + 5.0, words: 1.0 },
        ],
        drawn: costing.cases * (speeds * lines + crossings),
        unit: speeds * lines * 8.0,
        spared: None,
        work: costing.cases * found * 2.0 * waves * size.powi(3) * EIGEN,
    }
}

/// A natural frequency, rad/s, with state of the joints (index in [`STATES`]), nodal diameter
/// of a tuned disk, and mode number from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Natural {
    state: usize,
    diameter: Option<usize>,
    mode: usize,
    omega: f64,
    /// Reduction error of the structure at that speed.
    reduction: Option<ReductionAccuracy>,
}

impl Natural {
    fn is_like(&self, other: &Natural) -> bool {
        (self.state, self.diameter, self.mode) == (other.state, other.diameter, other.mode)
    }
}

/// Returns the natural frequencies of a model.
fn naturals(model: &Model, most: usize) -> Result<Vec<Natural>, String> {
    let mut found = Vec::new();
    let mut add = |state: usize, diameter: Option<usize>, modes: &stickslip::model::LinearModes, reduction| {
        let all = modes.elastic.iter().take(most).enumerate();
        found.extend(all.map(|(mode, one)| Natural { state, diameter, mode, omega: one.omega, reduction }));
    };
    if model.ring.is_some_and(|ring| ring.equal) {
        let reduction = model.assemble().map_err(|error| error.to_string())?.reduction_evidence();
        for wave in waves(model, most)? {
            add(0, Some(wave.diameter), &wave.free, reduction);
            add(1, Some(wave.diameter), &wave.stuck, reduction);
        }
    } else {
        let survey = model.survey().map_err(|error| error.to_string())?;
        if survey.is_too_large() {
            return Err("the model is too large to compute all its modes".to_owned());
        }
        let reduction = survey.system().reduction_evidence();
        add(0, None, survey.free(), reduction);
        add(1, None, survey.stuck(), reduction);
    }
    Ok(found)
}

/// Returns the nodal diameter that an engine order excites.
fn excited(order: usize, sectors: usize) -> usize {
    let turns = order % sectors;
    turns.min(sectors - turns)
}

/// Pairs every engine order with the modes that it can excite; on a tuned disk, those of its
/// nodal diameter.
fn met(found: &[Natural], orders: usize, sectors: Option<usize>) -> impl Iterator<Item = (f64, &Natural)> {
    let meets = move |natural: &Natural, order: usize| match (natural.diameter, sectors) {
        (Some(diameter), Some(sectors)) => diameter == excited(order, sectors),
        _ => true,
    };
    (1..=orders).flat_map(move |order| {
        found.iter().filter(move |natural| meets(natural, order)).map(move |natural| (order as f64, natural))
    })
}

/// Typical number of evaluations per crossing.
const REFINED: f64 = 4.0;
/// Largest number of evaluations per crossing.
const MOST_REFINED: usize = 60;
/// Relative change of the speed at which the search for a crossing stops: a hundred times the
/// observed rounding of the frequencies.
const FOUND: f64 = 1e-11;

/// The evaluation of one case over its speeds.
struct Diagram<'a> {
    work: &'a Work<'a>,
    prepared: &'a Prepared,
    most: usize,
    /// The frequencies, if they do not depend on the speed.
    same: Option<Result<Vec<Natural>, String>>,
}

impl Diagram<'_> {
    /// Returns the natural frequencies at a speed, rad/s.
    fn at(&self, speed: f64) -> Result<Vec<Natural>, String> {
        if let Some(same) = &self.same {
            return same.clone();
        }
        let name = self.prepared.case.values.text("parameter").unwrap_or(PARAMETER);
        let case =
            self.work.study.case_with(self.prepared.case.index, name, speed).map_err(|error| error.to_string())?;
        naturals(&case.model, self.most)
    }

    /// Returns the speed at which `order` times the speed equals the frequency of a mode.
    ///
    /// The crossing lies between two speeds, each given with the mode at that speed. Squares of
    /// frequencies are nearly linear in the square of the speed, because softening and
    /// stiffening are proportional to it. So false position in these squares is nearly Newton's
    /// method. If two steps in a row do not halve the interval, the next step bisects it.
    fn crossing(
        &self,
        order: f64,
        (mut a, one): (f64, &Natural),
        (mut b, other): (f64, &Natural),
    ) -> Result<f64, String> {
        let excess = |speed: f64, mode: &Natural| (mode.omega - order * speed) * (mode.omega + order * speed);
        let (mut at_a, mut at_b) = (excess(a, one), excess(b, other));
        let (mut last, mut slow) = (f64::NAN, 0);
        for _ in 0..MOST_REFINED {
            if at_a == 0.0 {
                return Ok(a);
            }
            let secant = (a * a - at_a * (b * b - a * a) / (at_b - at_a)).sqrt();
            let next = if slow < 2 { secant.clamp(a.min(b), a.max(b)) } else { 0.5 * (a + b) };
            // at an end of the interval only rounding remains
            let near = [a, b, last].into_iter().any(|known| (next - known).abs() <= FOUND * next.abs());
            if near || (b - a).abs() <= FOUND * b.abs() {
                return Ok(next);
            }
            last = next;
            let all = self.at(next)?;
            let found =
                all.iter().find(|mode| mode.is_like(one)).ok_or("a mode was not found again between two speeds")?;
            let there = excess(next, found);
            let before = (b - a).abs();
            if (there > 0.0) == (at_a > 0.0) {
                (a, at_a) = (next, there)
            } else {
                (b, at_b) = (next, there)
            }
            slow = if (b - a).abs() > 0.5 * before && slow < 2 { slow + 1 } else { 0 };
        }
        Ok(0.5 * (a + b))
    }
}

fn compute(work: &Work<'_>) -> Computed {
    let prepared = work.case();
    let values = &prepared.case.values;
    let name = values.text("parameter").unwrap_or(PARAMETER);
    let most = values.count("modes").unwrap_or(3) as usize;
    let depends = prepared.case.parameters.contains_key(name);
    let same = (!depends).then(|| naturals(&prepared.case.model, most));
    let diagram = Diagram { work, prepared, most, same };
    let mut part = Part::default();
    if !depends {
        let message = format!("The study has no parameter `{name}`, so the frequencies do not depend on the speed.");
        part.notes.push(Note::Said(message));
    }
    let (mut rows, mut crossings) = (Rows::default(), Rows::default());
    let orders = values.count("engine_orders").unwrap_or(6) as usize;
    let sectors = prepared.case.model.ring.filter(|ring| ring.equal).map(|ring| ring.sectors);
    let mut before: Option<(f64, Vec<Natural>)> = None;
    for speed in values.frequencies("speed").into_iter().flat_map(|speeds| speeds.iter()) {
        let place = || format!("{}speed = {} Hz", label(prepared), hertz(speed));
        if work.context.stopped() {
            part.count(place, NOT_REACHED, None);
            continue;
        }
        let found = match diagram.at(speed) {
            Ok(found) => found,
            Err(reason) => {
                part.count(place, "failed", Some(reason));
                before = None;
                continue;
            }
        };
        part.count(place, CONVERGED, None);
        for natural in &found {
            write(prepared, speed, natural, &mut rows);
            rows.end();
        }
        if let Some((last, all)) = &before {
            for (order, natural) in met(&found, orders, sectors) {
                let Some(was) = all.iter().find(|was| was.is_like(natural)) else { continue };
                if work.context.stopped() || (was.omega - order * last > 0.0) == (natural.omega - order * speed > 0.0) {
                    continue; // an interrupted unit is computed again
                }
                match diagram.crossing(order, (*last, was), (speed, natural)) {
                    Ok(at) => {
                        write(prepared, at, &Natural { omega: order * at, ..*natural }, &mut crossings);
                        crossings.integer(ORDER, order as u64);
                        crossings.end();
                    }
                    Err(reason) => part.count(place, "failed", Some(reason)),
                }
            }
        }
        before = Some((speed, found));
        (work.context.finished)();
    }
    part.tables = vec![rows, crossings];
    Ok(part)
}

fn label(prepared: &Prepared) -> String {
    let label = prepared.case.label();
    if label.is_empty() { label } else { format!("{label}, ") }
}

fn write(prepared: &Prepared, speed: f64, natural: &Natural, rows: &mut Rows) {
    rows.varied(&prepared.case);
    rows.text(JOINTS, STATES[natural.state]);
    if let Some(diameter) = natural.diameter {
        rows.integer(DIAMETER, diameter as u64);
    }
    rows.integer(MODE, natural.mode as u64 + 1);
    rows.number(SPEED, speed / TAU);
    rows.number(FREQUENCY, hertz(natural.omega));
    rows.reduced(natural.reduction);
}

/// Draws a panel per case: frequencies, engine order lines and crossings. For a tuned disk it
/// shows the frequencies that an engine order excites.
fn draw(drawing: &Drawing<'_>) -> Figure {
    let Some(table) = drawing.table(TABLE) else { return Figure::default() };
    let (x, x_factor) = drawing.axis(0, "speed of rotation", largest(table, [SPEED.to_owned()]), "Hz");
    let (y, y_factor) = drawing.axis(1, "frequency", largest(table, [FREQUENCY.to_owned()]), "Hz");
    let crossings = drawing.table(CROSSINGS);
    let marks = crossings.map(|table| drawing.stretches(table)).unwrap_or_default();
    let panel = |stretch: &Stretch, title: String| {
        let case = drawing.study.case(stretch.case).ok();
        let orders = case.as_ref().and_then(|case| case.values.count("engine_orders")).unwrap_or(6) as usize;
        let ring = case.and_then(|case| case.model.ring).filter(|ring| ring.equal);
        let shown = |diameter: Option<u64>| match (diameter, ring) {
            (Some(diameter), Some(ring)) => (1..=orders).any(|o| excited(o, ring.sectors) as u64 == diameter),
            _ => true,
        };
        let mut series = frequencies(table, stretch, (x_factor, y_factor), &shown);
        let speeds = numbers(table, SPEED, stretch.rows.clone());
        let (low, high) = speeds.iter().fold((f64::INFINITY, 0.0f64), |(low, high), v| (low.min(*v), high.max(*v)));
        let highest = series.iter().flat_map(|line| &line.y).copied().fold(0.0, f64::max);
        let top = ROOM * highest;
        for order in 1..=orders {
            // the line ends at the highest speed or at the top of the panel
            let end = (high * x_factor).min(top * x_factor / (order as f64 * y_factor));
            let line = |speed: f64| order as f64 * speed / x_factor * y_factor;
            let ends = vec![low * x_factor, end.max(low * x_factor)];
            let y = ends.iter().map(|x| line(*x)).collect();
            series.push(Series::line(format!("engine orders 1 to {orders}"), ends, y, 0).reference());
        }
        if let Some((table, stretch)) = crossings.zip(marks.iter().find(|marks| marks.case == stretch.case)) {
            for (colour, state) in STATES.into_iter().enumerate() {
                let states = words(table, JOINTS);
                let rows: Vec<usize> = stretch.rows.clone().filter(|row| states[*row] == state).collect();
                let column = |name: &str, factor: f64| -> Vec<f64> {
                    let all = numbers(table, name, 0..table.rows());
                    rows.iter().map(|row| all[*row] * factor).collect()
                };
                series.push(Series::marks("crossings", column(SPEED, x_factor), column(FREQUENCY, y_factor), colour));
            }
        }
        vec![Panel { title, x: x.clone(), y: y.clone().between(0.0, top), series, ..Panel::default() }]
    };
    Figure { panels: draws::panels(drawing, &drawing.stretches(table), &panel), ..Figure::default() }
}

/// Top of the panel as a multiple of the highest frequency.
const ROOM: f64 = 1.1;

fn frequencies(
    table: &Table,
    stretch: &Stretch,
    (x_factor, y_factor): (f64, f64),
    shown: &dyn Fn(Option<u64>) -> bool,
) -> Vec<Series> {
    let Some(modes) = table.integers(MODE) else { return Vec::new() };
    let (states, diameters) = (words(table, JOINTS), table.integers(DIAMETER));
    let of = |row: usize| (diameters.map(|all| all[row]), modes[row]);
    let mut kinds: Vec<(Option<u64>, u64)> = stretch.rows.clone().map(of).filter(|(d, _)| shown(*d)).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let (x, y) = (numbers(table, SPEED, 0..table.rows()), numbers(table, FREQUENCY, 0..table.rows()));
    let mut series = Vec::new();
    for (colour, state) in STATES.into_iter().enumerate() {
        for kind in &kinds {
            let rows = || stretch.rows.clone().filter(|row| of(*row) == *kind && states[*row] == state);
            let line = Series::line(
                format!("joints {state}"),
                rows().map(|row| x[row] * x_factor).collect(),
                rows().map(|row| y[row] * y_factor).collect(),
                colour,
            );
            series.push(Series { style: if colour == 0 { Style::Solid } else { Style::Dashed }, ..line });
        }
    }
    series
}
