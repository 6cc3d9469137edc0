//! Nonlinear modes: frequency and equivalent damping over amplitude.

use super::keys::{HARMONICS, SERIES_SAMPLES, check_samples};
use super::wheel::{self, Around};
use crate::columns::{amplitude_in, amplitude_of, first_harmonic_in, first_harmonic_of, phase_of};
use crate::cost::{Cost, Costing, Shape};
use crate::dataset::{Axis, Figure, Panel, Series, Table, Values as Cells};
use crate::drawing::{Drawing, MOST_PANELS, Stretch, join, largest, numbers};
use crate::draws;
use crate::info::Complaint;
use crate::info::KindInfo;
use crate::key::{Key, Takes, Within, default, required};
use crate::kind::Kind;
use crate::note::Note;
use crate::rows::Rows;
use crate::values::{Values, hertz};
use crate::warnings::of_mode;
use crate::words::{display_unit, significant};
use crate::work::{CONVERGED, Computed, Grain, Part, Prepared, Work};
use stickslip::curve::modes::{Mode, ModePoint, ModeRequest, nonlinear_mode, unit_amplitude};
use stickslip::dimension::Dimension;
use stickslip::method::MethodError;
use stickslip::model::Model;

const LENGTH: Takes = Takes::Quantity(Dimension::LENGTH, Within::Positive);

/// Largest number of points of one mode.
const MOST_POINTS: i64 = 10_000;

const AMPLITUDE: &[Key] = &[
    required("from", LENGTH, "smallest amplitude", "\"1 um\""),
    required("to", LENGTH, "largest amplitude", "\"10 mm\""),
    default("points", Takes::Count(2, MOST_POINTS), "61", "points, evenly spaced in the logarithm", "61"),
];

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: "modes",
        summary: "nonlinear modes: frequency, equivalent damping and shape over the amplitude of free vibration",
        keys: &[
            required(
                "amplitude",
                Takes::Table(AMPLITUDE),
                "amplitude of the place that moves most in the mode of the structure without joints",
                "{ from = \"1 um\", to = \"10 mm\" }",
            ),
            default("mode", Takes::Count(1, 1000), "1", "number of the mode, by ascending frequency", "2"),
            default("harmonics", Takes::Count(1, 255), "15", "highest harmonic", "15"),
            default("samples", Takes::Count(8, 1 << 16), "1024", "samples per period", "1024"),
        ],
        check,
        axes: [Some(Dimension::LENGTH), None],
        // free vibration has no excitation frequency: harmonic balance solves for frequency and
        // damping
        uses_method: false,
        needs: |_, _, system| stickslip::curve::modes::check(system),
        adapts: false,
        tables: &["modes", "modes_summary"],
    },
    grain: |_| Grain::Case,
    cost,
    warnings: of_mode,
    compute,
    draw,
};

/// Solutions of the full equations per point. Measured: 0.3 s per point for a disk of 24
/// sectors.
const FOLLOWED: f64 = 8.0;
/// Steps of the curve from its large end, independent of the request: typical, and with close
/// modes.
const STEPS: (f64, f64) = (100.0, 200.0);

fn cost(costing: &Costing<'_>) -> Cost {
    let values = &costing.case.values;
    let points = values.table("amplitude").and_then(|table| table.count("points")).unwrap_or(61) as f64;
    let rows = costing.cases * points;
    let harmonics = values.count("harmonics").unwrap_or(HARMONICS) as f64;
    // odd harmonics, two parts each, of every degree of freedom
    let elimination = costing.eliminated((harmonics + 1.0) * costing.masses);
    Cost {
        tables: vec![
            Shape { rows, numbers: costing.varied + 4.0 + 3.0 * costing.places, words: 0.0 },
            Shape { rows: costing.cases, numbers: costing.varied + 5.0, words: 0.0 },
        ],
        drawn: 2.0 * rows,
        unit: points * costing.series_bytes(harmonics),
        spared: None,
        work: (rows * FOLLOWED + costing.cases * costing.steps(STEPS))
            * (costing.series(Some(harmonics)) + elimination),
    }
}

fn check(values: &Values, model: &Model, _: usize) -> Result<(), Complaint> {
    let range = values.table("amplitude");
    if let Some((from, to)) = range.and_then(|t| t.quantity("from").zip(t.quantity("to")))
        && from >= to
    {
        return Err(Complaint::new("amplitude", "the range is empty", "`from` must be below `to`"));
    }
    check_samples(values)?;
    let number = values.count("mode").unwrap_or(1);
    let of_masses = model.masses.iter().map(|mass| mass.places().len());
    let masses = of_masses.chain(model.bodies.iter().map(|body| body.directions.len())).sum::<usize>() as u64;
    if number > masses && model.substructure.is_none() {
        let message = format!("there is no mode {number}: the structure has {masses} degrees of freedom");
        return Err(Complaint::new("mode", message, "modes count from 1, by ascending frequency"));
    }
    Ok(())
}

fn compute(work: &Work<'_>) -> Computed {
    let prepared = work.case();
    let mut part = Part::default();
    let unit = unit_amplitude(&prepared.system, number(prepared)).map_err(|error| (prepared.case.index, error))?;
    let Some(unit) = unit else {
        (work.context.finished)();
        part.count(|| location_of(prepared), "failed", Some(UNSEEN.to_owned()));
        part.tables = vec![Rows::default(), Rows::default()];
        return Ok(part);
    };
    let mode = follow(prepared, unit).map_err(|error| (prepared.case.index, error))?;
    (work.context.finished)();
    let (status, reason) = judged(unit, &mode);
    part.count(|| location_of(prepared), status, reason);
    let place = location_of(prepared);
    part.notes.extend(remarks(unit, &mode).into_iter().map(|text| Note::of_case(&place, text)));
    let (mut rows, mut summary) = (Rows::default(), Rows::default());
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
        rows.reduced(reduction);
        rows.end();
    }
    summary.varied(&prepared.case);
    let end = |point: Option<&ModePoint>| point.map_or(f64::NAN, |point| hertz(point.omega));
    summary.number("small_end_frequency_Hz", end(mode.points.first().filter(|_| mode.ended.is_none())));
    summary.number("large_end_frequency_Hz", end(mode.points.last()));
    let largest = mode.largest.as_ref();
    summary.number("largest_damping_ratio", largest.map_or(f64::NAN, |point| point.damping));
    summary.number("amplitude_there_m", largest.map_or(f64::NAN, |point| point.amplitude / unit));
    summary.number("frequency_there_Hz", end(largest));
    summary.reduced(reduction);
    summary.end();
    part.tables = vec![rows, summary];
    Ok(part)
}

/// Returns the index of the mode, from 0.
fn number(prepared: &Prepared) -> usize {
    prepared.case.values.count("mode").unwrap_or(1) as usize - 1
}

/// Error text for a mode without a displacement at any place.
const UNSEEN: &str = "the structure has no such mode, or no place moves in it; choose another mode, or add a \
    [[place]] that moves in this mode";

/// Computes the mode.
///
/// `unit` is the modal amplitude per unit displacement of the place that moves most, m √kg per
/// m.
fn follow(prepared: &Prepared, unit: f64) -> Result<Mode, MethodError> {
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
fn location_of(prepared: &Prepared) -> String {
    let (mode, label) = (format!("mode {}", number(prepared) + 1), prepared.case.label());
    if label.is_empty() { mode } else { format!("{label}, {mode}") }
}

/// Returns a modal amplitude in words as the study file states it: the amplitude of the place
/// that moves most.
fn amplitude(unit: f64, modal: f64) -> String {
    let si = modal / unit;
    let (name, factor) = display_unit(si, "m");
    format!("{:.3} {name}", si * factor)
}

/// Returns the status of a mode, and the reason if it is incomplete or uncertain.
fn judged(unit: f64, mode: &Mode) -> (&'static str, Option<String>) {
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

/// Damping ratio of the joints, absolute, below which no joint slips. Solutions are accurate to
/// 1e-11.
const SLIPS: f64 = 1e-9;

/// Returns the notes about a computed mode.
fn remarks(unit: f64, mode: &Mode) -> Vec<String> {
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
            travelling wave is computed: equal places of all sectors have equal amplitudes with a phase shift. The \
            other mode is the wave in the opposite direction. Standing waves slip differently.";
        remarks.push(text.to_owned());
    }
    let joints = mode.points.iter().chain(&mode.largest).map(|point| (point.damping - point.viscous).abs());
    if !mode.points.is_empty() && joints.fold(0.0, f64::max) < SLIPS {
        remarks.push("no joint slips in this amplitude range, so the joints add no damping.".to_owned());
    }
    remarks
}

/// Draws the place that moves most at the largest amplitude of every case. For a disk it adds
/// the shapes at the smallest and largest amplitude.
fn draw(drawing: &Drawing<'_>) -> Figure {
    let (Some(table), Some(system)) = (drawing.table("modes"), drawing.system()) else { return Figure::default() };
    // results of earlier versions have only the first harmonic in this column
    let column = |place: &String| amplitude_of(place);
    let displacements: Vec<String> = system
        .places()
        .iter()
        .zip(system.place_axes())
        .filter(|(_, a)| !a.is_rotation())
        .map(|(name, _)| name.clone())
        .collect();
    let (x_axis, factor) = drawing.axis(0, "amplitude", largest(table, displacements.iter().map(column)), "m");
    let stretches = drawing.stretches(table);
    let parts = match table.columns.iter().find(|column| column.name == "stretch").map(|column| &column.values) {
        Some(Cells::Integer(parts)) => parts.clone(),
        _ => vec![1; table.rows()],
    };
    let widest_of = |stretch: &Stretch| {
        let at_last = |place: &&String| numbers(table, &column(place), stretch.rows.clone()).last().copied();
        let moves = |place: &&String| at_last(place).unwrap_or(0.0);
        displacements.iter().max_by(|a, b| moves(a).total_cmp(&moves(b)))
    };
    // draws in one band show one place: that of the first draw
    let common = stretches.first().filter(|_| drawing.study.draws().is_some()).and_then(widest_of);
    let panel = |stretches: &[Stretch], title: &str, (quantity, unit_of): (&str, &str), read: &str, scale: f64| Panel {
        title: title.to_owned(),
        x: x_axis.clone().log(),
        y: Axis::new(quantity, unit_of),
        series: stretches
            .iter()
            .enumerate()
            .flat_map(|(colour, stretch)| {
                let Some(widest) = common.or_else(|| widest_of(stretch)) else { return Vec::new() };
                // the curves of many draws form one band
                let alone = stretch.varied.is_empty() || drawing.study.draws().is_some();
                let label = if alone { widest.clone() } else { stretch.label() };
                let mut from = stretch.rows.start;
                // the line is interrupted at turning points of the curve
                let lines = parts[stretch.rows.clone()].chunk_by(|a, b| a == b).map(|part| {
                    let rows = from..from + part.len();
                    from = rows.end;
                    let x = numbers(table, &column(widest), rows.clone()).iter().map(|x| x * factor).collect();
                    let y = numbers(table, read, rows).iter().map(|y| y * scale).collect();
                    Series::line(label.clone(), x, y, colour)
                });
                lines.collect()
            })
            .collect(),
        ..Panel::default()
    };
    let both = |stretches: &[Stretch], title: &str| {
        let frequency = panel(stretches, title, ("frequency", "Hz"), "frequency_Hz", 1.0);
        vec![frequency, panel(stretches, title, ("equivalent damping ratio", "%"), "damping_ratio", 100.0)]
    };
    if drawing.study.draws().is_some() {
        let of_draw = |stretch: &Stretch, title: String| both(std::slice::from_ref(stretch), &title);
        return Figure { panels: draws::panels(drawing, &stretches, &of_draw), ..Figure::default() };
    }
    let mut panels = both(&stretches, "");
    if panels.len() + 2 * stretches.len() <= MOST_PANELS {
        panels.extend(
            stretches.iter().flat_map(|stretch| wheels(drawing, table, &displacements, (stretch, stretches.len()))),
        );
    }
    Figure { panels, ..Figure::default() }
}

/// Draws the shapes of a disk at the smallest amplitude, where joints stick, and at the
/// largest.
///
/// The colours begin after those of the `cases` curves.
fn wheels(drawing: &Drawing<'_>, table: &Table, places: &[String], (stretch, cases): (&Stretch, usize)) -> Vec<Panel> {
    let Ok(case) = drawing.study.case(stretch.case) else { return Vec::new() };
    let Some(ring) = case.model.ring else { return Vec::new() };
    let shown: Vec<&String> = places.iter().filter(|name| drawing.shows(name)).collect();
    let mode = format!("mode {}", case.values.count("mode").unwrap_or(1));
    let mut ends = vec![stretch.rows.start, stretch.rows.end - 1];
    ends.dedup();
    let wheel = |row: usize| {
        let at = |column: &str| numbers(table, column, row..row + 1)[0];
        let most = places.iter().map(|name| at(&amplitude_of(name))).fold(0.0, f64::max);
        let (unit, factor) = display_unit(most, "m");
        let words = format!("{mode} at {} {unit}", significant(most * factor, 3));
        let frequency = format!("{} Hz", significant(at("frequency_Hz"), 5));
        let size = |name: &str| match table.column(&first_harmonic_of(name)) {
            Some(_) => at(&first_harmonic_of(name)),
            None => at(&amplitude_of(name)),
        };
        let moves = shown.iter().map(|name| (name.as_str(), size(name), at(&phase_of(name))));
        wheel::panel(&Around::of_ring(moves)?, ring.sectors, join([stretch.label(), words, frequency]), cases)
    };
    ends.into_iter().filter_map(wheel).collect()
}
