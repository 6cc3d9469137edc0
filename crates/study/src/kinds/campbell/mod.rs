//! Campbell diagrams: natural frequencies over the speed of a rotor, engine order lines and
//! their crossings.
//!
//! The model states how its stiffness depends on the speed: the speed is a parameter, and a
//! spring `k0 + k1*speed^2` stiffens. On a tuned disk an engine order `e` excites the modes of
//! one nodal diameter: the distance from `e` to the nearest multiple of the sector count.

mod figure;

use super::nodal_diameter::{STATES, waves};
use super::shared::keys::no_requirements;
use crate::case::values::{Values, hertz};
use crate::check::size::{PlannedSize, SizeInputs, TableShape};
use crate::kinds::info::{KeyError, KindInfo};
use crate::kinds::kind::{Kind, Probe};
use crate::results::columns::FREQUENCY;
use crate::results::notes::Note;
use crate::results::table_builder::TableBuilder;
use crate::run::work::{CONVERGED, Computed, NOT_REACHED, PreparedCase, UnitResult, UnitSize, UnitTask};
use crate::syntax::key::{SPEED_RANGE, ValueType, default, required};
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
                ValueType::Frequencies(SPEED_RANGE),
                "speeds of rotation as frequencies; zero is allowed",
                "{ from = \"10 Hz\", to = \"120 Hz\", points = 56 }",
            ),
            default(
                "parameter",
                ValueType::Name,
                PARAMETER,
                "the parameter that holds the speed, if stiffnesses depend on it; its stated value is then ignored",
                "\"speed\"",
            ),
            default("engine_orders", ValueType::Count(1, 200), "6", "highest engine order", "6"),
            default(
                "modes",
                ValueType::Count(1, 100),
                "3",
                "number of lowest modes; for a tuned disk, the number for every nodal diameter",
                "3",
            ),
        ],
        check,
        axes: [Some(Dimension::FREQUENCY), Some(Dimension::FREQUENCY)],
        uses_method: false,
        needs: no_requirements,
        adapts: false,
        tables: &[TABLE, CROSSINGS],
    },
    unit_size: |_| UnitSize::Case,
    size,
    warnings: |_| Vec::new(),
    probe: Probe::Unit { name: "diagram" },
    compute,
    draw: figure::draw,
};

fn check(values: &Values, _: &Model, _: usize) -> Result<(), KeyError> {
    let speeds = values.frequencies("speed").map_or(0, crate::case::values::Frequencies::len);
    if speeds >= 2 {
        return Ok(());
    }
    let message = "a Campbell diagram needs at least two speeds";
    Err(KeyError::new("speed", message, "write { from = \"10 Hz\", to = \"120 Hz\", points = 56 }"))
}

fn size(inputs: &SizeInputs<'_>) -> PlannedSize {
    let values = &inputs.case.values;
    let speeds = values.frequencies("speed").map_or(2, crate::case::values::Frequencies::len) as f64;
    let count = |key: &str, or: u64| values.count(key).unwrap_or(or) as f64;
    let sectors = inputs.case.model.ring.filter(|ring| ring.equal).map(|ring| ring.sectors as f64);
    let waves = sectors.map_or(1.0, |sectors| sectors / 2.0 + 1.0);
    let lines = 2.0 * waves * count("modes", 3);
    // an engine order excites the modes of one nodal diameter
    let crossings = lines / waves * count("engine_orders", 6);
    PlannedSize {
        tables: vec![
            TableShape { rows: inputs.cases * speeds * lines, numbers: inputs.varied + 4.0, words: 1.0 },
            TableShape { rows: inputs.cases * crossings, numbers: inputs.varied + 5.0, words: 1.0 },
        ],
        drawn: inputs.cases * (speeds * lines + crossings),
        unit: speeds * lines * 8.0,
    }
}

/// A natural frequency, rad/s, with state of the joints (index in [`STATES`]), nodal diameter
/// of a tuned disk, and mode number from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
struct NaturalFrequency {
    state: usize,
    diameter: Option<usize>,
    mode: usize,
    omega: f64,
    /// Reduction error of the structure at that speed.
    reduction: Option<ReductionAccuracy>,
}

impl NaturalFrequency {
    fn is_similar(&self, other: &NaturalFrequency) -> bool {
        (self.state, self.diameter, self.mode) == (other.state, other.diameter, other.mode)
    }
}

/// Returns the natural frequencies of a model.
fn natural_frequencies(model: &Model, most: usize) -> Result<Vec<NaturalFrequency>, String> {
    let mut found = Vec::new();
    let mut add = |state: usize, diameter: Option<usize>, modes: &stickslip::model::LinearModes, reduction| {
        let all = modes.elastic.iter().take(most).enumerate();
        found.extend(all.map(|(mode, one)| NaturalFrequency { state, diameter, mode, omega: one.omega, reduction }));
    };
    if model.ring.is_some_and(|ring| ring.equal) {
        let system = model.assemble().map_err(|error| error.to_string())?;
        let reduction = system.reduction_evidence();
        for wave in waves(model, &system, most)? {
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
fn excited_diameter(order: usize, sectors: usize) -> usize {
    let turns = order % sectors;
    turns.min(sectors - turns)
}

/// Pairs every engine order with the modes that it can excite; on a tuned disk, those of its
/// nodal diameter.
fn excited_modes(
    found: &[NaturalFrequency],
    orders: usize,
    sectors: Option<usize>,
) -> impl Iterator<Item = (f64, &NaturalFrequency)> {
    let is_excited = move |natural: &NaturalFrequency, order: usize| match (natural.diameter, sectors) {
        (Some(diameter), Some(sectors)) => diameter == excited_diameter(order, sectors),
        _ => true,
    };
    (1..=orders).flat_map(move |order| {
        found.iter().filter(move |natural| is_excited(natural, order)).map(move |natural| (order as f64, natural))
    })
}

/// A mode at a speed of rotation, rad/s.
#[derive(Clone, Copy)]
struct ModeAtSpeed<'a> {
    speed: f64,
    mode: &'a NaturalFrequency,
}

/// The evaluation of one case over its speeds.
struct CampbellDiagram<'a> {
    work: &'a UnitTask<'a>,
    prepared: &'a PreparedCase,
    mode_count: usize,
    /// The frequencies, if they do not depend on the speed.
    constant_frequencies: Option<Result<Vec<NaturalFrequency>, String>>,
}

impl CampbellDiagram<'_> {
    /// Returns the natural frequencies at a speed, rad/s.
    fn at(&self, speed: f64) -> Result<Vec<NaturalFrequency>, String> {
        if let Some(same) = &self.constant_frequencies {
            return same.clone();
        }
        let name = self.prepared.case.values.text("parameter").unwrap_or(PARAMETER);
        let case = self
            .work
            .study
            .case_with_parameter(self.prepared.case.index, name, speed)
            .map_err(|error| error.to_string())?;
        natural_frequencies(&case.model, self.mode_count)
    }

    /// Returns the speed at which `order` times the speed equals the frequency of a mode.
    ///
    /// The crossing lies between two speeds, each given with the mode at that speed. Squares of
    /// frequencies are nearly linear in the square of the speed, because softening and
    /// stiffening are proportional to it. So false position in these squares is nearly Newton's
    /// method. If two steps in a row do not halve the interval, the next step bisects it.
    fn crossing(&self, order: f64, from: ModeAtSpeed<'_>, to: ModeAtSpeed<'_>) -> Result<f64, String> {
        // Relative change of the speed at which the search for a crossing stops: a hundred times
        // the observed rounding of the frequencies.
        let crossing_tolerance = 1e-11;
        let (mut a, mut b) = (from.speed, to.speed);
        let excess = |speed: f64, mode: &NaturalFrequency| (mode.omega - order * speed) * (mode.omega + order * speed);
        let (mut at_a, mut at_b) = (excess(a, from.mode), excess(b, to.mode));
        let (mut last, mut slow) = (f64::NAN, 0);
        // Largest number of evaluations per crossing.
        for _ in 0..60 {
            if at_a == 0.0 {
                return Ok(a);
            }
            let secant = (a * a - at_a * (b * b - a * a) / (at_b - at_a)).sqrt();
            let next = if slow < 2 { secant.clamp(a.min(b), a.max(b)) } else { 0.5 * (a + b) };
            // at an end of the interval only rounding remains
            let near = [a, b, last].into_iter().any(|known| (next - known).abs() <= crossing_tolerance * next.abs());
            if near || (b - a).abs() <= crossing_tolerance * b.abs() {
                return Ok(next);
            }
            last = next;
            let all = self.at(next)?;
            let found = all
                .iter()
                .find(|mode| mode.is_similar(from.mode))
                .ok_or("a mode was not found again between two speeds")?;
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

fn compute(work: &UnitTask<'_>) -> Computed {
    let prepared = work.case();
    let values = &prepared.case.values;
    let name = values.text("parameter").unwrap_or(PARAMETER);
    let most = values.count("modes").unwrap_or(3) as usize;
    let depends = prepared.case.parameters.contains_key(name);
    let same = (!depends).then(|| natural_frequencies(&prepared.case.model, most));
    let diagram = CampbellDiagram { work, prepared, mode_count: most, constant_frequencies: same };
    let mut part = UnitResult::default();
    if !depends {
        let message = format!("The study has no parameter `{name}`, so the frequencies do not depend on the speed.");
        part.notes.push(Note::Sentence(message));
    }
    let (mut rows, mut crossings) = (TableBuilder::default(), TableBuilder::default());
    let orders = values.count("engine_orders").unwrap_or(6) as usize;
    let sectors = prepared.case.model.ring.filter(|ring| ring.equal).map(|ring| ring.sectors);
    let mut before: Option<(f64, Vec<NaturalFrequency>)> = None;
    let speeds: Vec<f64> = values.frequencies("speed").into_iter().flat_map(|speeds| speeds.iter()).collect();
    for (index, &speed) in speeds.iter().enumerate() {
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
            rows.end_row();
        }
        if let Some((last, all)) = &before {
            for (order, natural) in excited_modes(&found, orders, sectors) {
                let Some(was) = all.iter().find(|was| was.is_similar(natural)) else { continue };
                if work.context.stopped() || (was.omega - order * last > 0.0) == (natural.omega - order * speed > 0.0) {
                    continue; // an interrupted unit is computed again
                }
                let (from, to) = (ModeAtSpeed { speed: *last, mode: was }, ModeAtSpeed { speed, mode: natural });
                match diagram.crossing(order, from, to) {
                    Ok(at) => {
                        write(prepared, at, &NaturalFrequency { omega: order * at, ..*natural }, &mut crossings);
                        crossings.integer(ORDER, order as u64);
                        crossings.end_row();
                    }
                    Err(reason) => part.count(place, "failed", Some(reason)),
                }
            }
        }
        before = Some((speed, found));
        work.share.reach((index + 1) as f64 / speeds.len() as f64);
        (work.context.finished)();
    }
    part.tables = vec![rows, crossings];
    Ok(part)
}

fn label(prepared: &PreparedCase) -> String {
    let label = prepared.case.label();
    if label.is_empty() { label } else { format!("{label}, ") }
}

fn write(prepared: &PreparedCase, speed: f64, natural: &NaturalFrequency, rows: &mut TableBuilder) {
    rows.varied(&prepared.case);
    rows.text(JOINTS, STATES[natural.state]);
    if let Some(diameter) = natural.diameter {
        rows.integer(DIAMETER, diameter as u64);
    }
    rows.integer(MODE, natural.mode as u64 + 1);
    rows.number(SPEED, speed / TAU);
    rows.number(FREQUENCY, hertz(natural.omega));
    rows.reduction_error(natural.reduction);
}
