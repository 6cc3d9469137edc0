//! Nonlinear modes: frequency and equivalent damping over amplitude.

mod figure;

use super::shared::fields::{self, Fields};
use super::shared::keys::{HARMONICS, SERIES_SAMPLES, check_samples};
use super::shared::stress::{self, STRESS, Stresses};
use crate::case::values::{Values, hertz};
use crate::check::size::{PlannedSize, SizeInputs, TableShape};
use crate::check::warnings::mode_warnings;
use crate::kinds::info::{KeyError, KindInfo};
use crate::kinds::kind::{Kind, Probe};
use crate::results::columns::{amplitude_in, first_harmonic_in, phase_of};
use crate::results::dataset::FIELDS;
use crate::results::notes::{Note, WARNING};
use crate::results::table_builder::TableBuilder;
use crate::run::work::{CONVERGED, Computed, PreparedCase, UnitResult, UnitSize, UnitTask};
use crate::syntax::format::{format_with_prefix, plural_suffix};
use crate::syntax::key::{Bounds, Key, ValueType, default, required};
use num_complex::Complex64;
use stickslip::curve::modes::{Mode, ModePoint, ModeRequest, nonlinear_mode, unit_amplitude};
use stickslip::dimension::Dimension;
use stickslip::method::MethodError;
use stickslip::model::Model;

const LENGTH: ValueType = ValueType::Quantity(Dimension::LENGTH, Bounds::Positive);

/// Largest number of points of one mode.
const MAX_POINTS: i64 = 10_000;

const AMPLITUDE: &[Key] = &[
    required("from", LENGTH, "smallest amplitude", "\"1 um\""),
    required("to", LENGTH, "largest amplitude", "\"10 mm\""),
    default("points", ValueType::Count(2, MAX_POINTS), "61", "number of amplitudes, spaced logarithmically", "61"),
];

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: "modes",
        summary: "nonlinear modes: frequency, equivalent damping and shape over the amplitude of free vibration",
        keys: &[
            required(
                "amplitude",
                ValueType::Table(AMPLITUDE),
                "range of amplitudes of the place that moves most in the linear mode without joints; the nonlinear mode has \
                 the same modal mass norm `φᵀ M φ`, and the table contains the amplitudes of the places. Under constant \
                 forces, the mode of small motions about equilibrium is used instead",
                "{ from = \"1 um\", to = \"10 mm\" }",
            ),
            default("mode", ValueType::Count(1, 1000), "1", "number of the mode, by ascending frequency", "2"),
            default("harmonics", ValueType::Count(1, 255), "15", "highest harmonic", "15"),
            default("samples", ValueType::Count(8, 1 << 16), "1024", "samples per period", "1024"),
            fields::KEY,
        ],
        check,
        axes: [Some(Dimension::LENGTH), None],
        // free vibration has no excitation frequency: harmonic balance solves for frequency and
        // damping
        uses_method: false,
        needs: |_, _, system| stickslip::curve::modes::check(system),
        adapts: false,
        tables: &["modes", "modes_summary", FIELDS, STRESS],
    },
    unit_size: |_| UnitSize::Case,
    size,
    warnings: mode_warnings,
    probe: Probe::Unit { name: "mode" },
    compute,
    draw: figure::draw,
};

fn size(inputs: &SizeInputs<'_>) -> PlannedSize {
    let values = &inputs.case.values;
    let points = values.table("amplitude").and_then(|table| table.count("points")).unwrap_or(61) as f64;
    let rows = inputs.cases * points;
    let harmonics = values.count("harmonics").unwrap_or(HARMONICS) as f64;
    // the shapes at both ends of the curve
    let nodes = fields::size(inputs, 2.0 * inputs.cases);
    let sectors = inputs.case.model.ring.map_or(1, |ring| ring.sectors);
    PlannedSize {
        drawn: 2.0 * rows + nodes.rows,
        tables: vec![
            TableShape { rows, numbers: inputs.varied + 4.0 + 3.0 * inputs.places, words: 0.0 },
            TableShape { rows: inputs.cases, numbers: inputs.varied + 5.0, words: 0.0 },
            nodes,
            stress::size(inputs, rows, sectors),
        ],
        unit: points * inputs.series_bytes(harmonics),
    }
}

fn check(values: &Values, model: &Model, _: usize) -> Result<(), KeyError> {
    let range = values.table("amplitude");
    if let Some((from, to)) = range.and_then(|t| t.quantity("from").zip(t.quantity("to")))
        && from >= to
    {
        return Err(KeyError::new("amplitude", "the range is empty", "`from` must be below `to`"));
    }
    check_samples(values)?;
    fields::check(values, model)?;
    let number = values.count("mode").unwrap_or(1);
    let mass_places = model.masses.iter().map(|mass| mass.places().len());
    let masses = mass_places.chain(model.bodies.iter().map(|body| body.directions.len())).sum::<usize>() as u64;
    if number > masses && model.substructure.is_none() {
        let degrees = format!("{masses} degree{} of freedom", plural_suffix(masses as usize));
        let message = format!("there is no mode {number}: the structure has {degrees}");
        return Err(KeyError::new("mode", message, "modes count from 1, by ascending frequency"));
    }
    Ok(())
}

fn compute(work: &UnitTask<'_>) -> Computed {
    let prepared = work.case();
    let mut part = UnitResult::default();
    let unit = unit_amplitude(&prepared.system, number(prepared)).map_err(|error| (prepared.case.index, error))?;
    let Some(unit) = unit else {
        (work.context.finished)();
        part.count(|| location_of(prepared), "failed", Some(NO_SUCH_MODE.to_owned()));
        part.tables = (0..4).map(|_| TableBuilder::default()).collect();
        return Ok(part);
    };
    let mode = follow(prepared, unit).map_err(|error| (prepared.case.index, error))?;
    (work.context.finished)();
    let (status, reason) = mode_status(unit, &mode);
    part.count(|| location_of(prepared), status, reason);
    let place = location_of(prepared);
    part.notes.extend(remarks(unit, &mode).into_iter().map(|text| Note::for_case(&place, text)));
    let (mut rows, mut summary) = (TableBuilder::default(), TableBuilder::default());
    let (mut stretch, mut before) = (1, f64::INFINITY);
    let reduction = prepared.system.reduction_evidence();
    for point in &mode.points {
        // the values jump at a turning point of the curve
        stretch +=
            u64::from(mode.turns.iter().any(|turn| before < turn.amplitude && turn.amplitude <= point.amplitude));
        before = point.amplitude;
        rows.varied(&prepared.case);
        rows.number("modal_amplitude_m_sqrt_kg", point.amplitude);
        rows.number("frequency_Hz", hertz(point.omega));
        rows.number("damping_ratio", point.damping);
        let motions = point.places.iter().zip(&point.amplitudes).zip(point.phases());
        let places = prepared.system.places().iter().zip(prepared.system.place_axes());
        for ((place, along), ((x, amplitude), phase)) in places.zip(motions) {
            rows.number(&amplitude_in(place, along.unit()), *amplitude);
            rows.number(&first_harmonic_in(place, along.unit()), x.norm());
            rows.number(&phase_of(place), phase.to_degrees());
        }
        rows.integer("stretch", stretch);
        rows.reduction_error(reduction);
        rows.end_row();
    }
    summary.varied(&prepared.case);
    let end = |point: Option<&ModePoint>| point.map_or(f64::NAN, |point| hertz(point.omega));
    summary.number("small_end_frequency_Hz", end(mode.points.first().filter(|_| mode.ended.is_none())));
    summary.number("large_end_frequency_Hz", end(mode.points.last()));
    let largest = mode.largest.as_ref();
    summary.number("largest_damping_ratio", largest.map_or(f64::NAN, |point| point.damping));
    summary.number("amplitude_there_m", largest.map_or(f64::NAN, |point| point.amplitude / unit));
    summary.number("frequency_there_Hz", end(largest));
    summary.reduction_error(reduction);
    summary.end_row();
    let mut of_nodes = TableBuilder::default();
    if let Some(nodes) = Fields::new(work.study, prepared, &mut part) {
        let ends = [mode.points.first(), mode.points.last().filter(|_| mode.points.len() > 1)];
        for point in ends.into_iter().flatten() {
            let head = |rows: &mut TableBuilder| rows.number("modal_amplitude_m_sqrt_kg", point.amplitude);
            nodes.write_harmonic(prepared, point.omega, &point.shape, &head, &mut of_nodes);
        }
    }
    let mut of_stresses = TableBuilder::default();
    if let Some(stresses) = Stresses::new(work.study, prepared, &mut part) {
        write_stresses(prepared, &mode, &stresses, &mut of_stresses);
    }
    part.tables = vec![rows, summary, of_nodes, of_stresses];
    Ok(part)
}

/// Writes the first harmonics of the stresses at all points of the mode. Phases are relative to
/// the place with the largest motion, as in the other table.
fn write_stresses(prepared: &PreparedCase, mode: &Mode, stresses: &Stresses, rows: &mut TableBuilder) {
    let ring = prepared.case.model.ring;
    for point in &mode.points {
        let leading = point.leading_place();
        let turn = if leading.norm() > 0.0 { leading.conj() / leading.norm() } else { Complex64::ONE };
        let motion: Vec<Complex64> = point.shape.iter().map(|x| x * turn).collect();
        for sector in 0..ring.map_or(1, |ring| ring.sectors) {
            let head = |rows: &mut TableBuilder| {
                rows.number("modal_amplitude_m_sqrt_kg", point.amplitude);
                rows.number("frequency_Hz", hertz(point.omega));
                if ring.is_some() {
                    rows.integer("sector", sector as u64);
                }
            };
            stresses.write_harmonic(prepared, (sector, &motion), "first_harmonic_Pa", &head, rows);
        }
    }
}

/// Returns the index of the mode, from 0.
fn number(prepared: &PreparedCase) -> usize {
    prepared.case.values.count("mode").unwrap_or(1) as usize - 1
}

/// Error text for a mode without a displacement at any place.
pub const NO_SUCH_MODE: &str = "the structure has no such mode, or no place moves in it; choose another mode, or add a \
    [[place]] that moves in this mode";

/// Computes the mode.
///
/// `unit` is the modal amplitude per unit displacement of the place that moves most, m √kg per
/// m.
fn follow(prepared: &PreparedCase, unit: f64) -> Result<Mode, MethodError> {
    let values = &prepared.case.values;
    let range = values.table("amplitude");
    let end = |key: &str| range.and_then(|t| t.quantity(key)).unwrap_or(0.0) * unit;
    nonlinear_mode(
        &prepared.system,
        ModeRequest {
            mode: number(prepared),
            range: (end("from"), end("to")),
            points: range.and_then(|t| t.count("points")).unwrap_or(61) as usize,
            harmonics: values.count("harmonics").unwrap_or(HARMONICS) as usize,
            samples: values.count("samples").unwrap_or(SERIES_SAMPLES) as usize,
        },
    )
}

/// Returns the mode and its parameters in words.
fn location_of(prepared: &PreparedCase) -> String {
    let (mode, label) = (format!("mode {}", number(prepared) + 1), prepared.case.label());
    if label.is_empty() { mode } else { format!("{label}, {mode}") }
}

/// Returns a modal amplitude in words as the study file states it: the amplitude of the place
/// that moves most.
fn amplitude(unit: f64, modal: f64) -> String {
    format_with_prefix(modal / unit, "m")
}

/// Returns the status of a mode, and the reason if it is incomplete or uncertain. `unit` is its
/// modal amplitude (m √kg) per unit displacement of the place that moves most.
pub fn mode_status(unit: f64, mode: &Mode) -> (&'static str, Option<String>) {
    let words = |modal: f64| amplitude(unit, modal);
    if let Some(lost) = mode.ended {
        let from = if lost.at.is_finite() { format!("stopped at {}: ", words(lost.at)) } else { String::new() };
        return ("lost", Some(format!("{from}{}", lost.reason)));
    }
    if let Some(at) = mode.not_found.first() {
        let more = mode.not_found.len() - 1;
        let others = if more == 0 { String::new() } else { format!(" and {more} more amplitudes") };
        return ("incomplete", Some(format!("no solution found at {}{others}; use more harmonics", words(*at))));
    }
    if let Some(at) = mode.coalescences.first() {
        let reason = format!(
            "at {} the mode nearly merges with another mode; below this amplitude, small changes (such as the number \
             of harmonics) decide which of the two is followed; compare another number of harmonics, and the other \
             mode",
            words(*at)
        );
        return ("merging", Some(reason));
    }
    (CONVERGED, None)
}

/// Returns the notes about a computed mode, with the `unit` of [`mode_status`].
pub fn remarks(unit: f64, mode: &Mode) -> Vec<String> {
    let mut remarks: Vec<String> = mode
        .turns
        .iter()
        .map(|turn| {
            format!(
                "the curve turns at {} and again at {}. Between these amplitudes the mode has several solutions; \
                 below the first amplitude the values jump.",
                amplitude(unit, turn.amplitude),
                amplitude(unit, turn.return_amplitude)
            )
        })
        .collect();
    if mode.is_travelling_wave {
        let text = "two modes have this frequency, and any combination of them is a mode while the joints stick. The \
            travelling wave is computed: in a ring of equal sectors, equal places have equal amplitudes with a phase \
            shift. The other mode is the wave in the opposite direction. Standing waves slip differently.";
        remarks.push(text.to_owned());
    }
    if let Some(point) = mode.points.iter().rfind(|point| point.damping > 1.0) {
        remarks.push(format!(
            "{WARNING}from {} downwards the damping ratio exceeds 1, and no decay or resonance shows such a mode; if a \
             rigid joint slides there, give it a stiffness (law `jenkins`), or choose larger amplitudes",
            amplitude(unit, point.amplitude)
        ));
    }
    let joints = mode.points.iter().chain(&mode.largest).map(|point| (point.damping - point.viscous).abs());
    // Damping ratio of the joints, absolute, below which no joint slips. Solutions are accurate
    // to 1e-11.
    if !mode.points.is_empty() && joints.fold(0.0, f64::max) < 1e-9 {
        remarks.push("no joint slips in this amplitude range, so the joints add no damping.".to_owned());
    }
    remarks
}
