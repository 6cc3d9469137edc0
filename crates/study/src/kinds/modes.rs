//! Nonlinear modes: frequency and equivalent damping over amplitude.

use super::{Complaint, Computed, HARMONICS, Kind, SERIES_SAMPLES, check_samples};
use crate::dataset::{Axis, Panel, Series, Style};
use crate::run::{CONVERGED, Context, NOT_REACHED, Outcome, Prepared, Rows, display_unit};
use crate::schema::{Key, Takes, Within, default, required};
use crate::study::Study;
use crate::values::Values;
use rayon::prelude::*;
use std::f64::consts::TAU;
use stickslip::curve::modes::{Mode, ModeRequest, mode};
use stickslip::dimension::Dimension;
use stickslip::method::MethodError;
use stickslip::model::Model;

const LENGTH: Takes = Takes::Quantity(Dimension::LENGTH, Within::Positive);

/// Most points of one mode.
const MOST_POINTS: i64 = 10_000;

const AMPLITUDE: &[Key] = &[
    required("from", LENGTH, "smallest amplitude", "\"1 um\""),
    required("to", LENGTH, "largest amplitude", "\"10 mm\""),
    default("points", Takes::Count(2, MOST_POINTS), "61", "points, evenly spaced in the logarithm", "61"),
];

pub(super) const KIND: Kind = Kind {
    name: "modes",
    summary: "nonlinear modes: frequency and equivalent damping over the amplitude of free vibration",
    keys: &[
        required(
            "amplitude",
            Takes::Table(AMPLITUDE),
            "amplitude of the place that moves most in the mode of the structure without joints",
            "{ from = \"1 um\", to = \"10 mm\" }",
        ),
        default("mode", Takes::Count(1, 1000), "1", "number of the mode, by rising frequency", "2"),
        default("harmonics", Takes::Count(1, 255), "15", "highest harmonic", "15"),
        default("samples", Takes::Count(8, 1 << 16), "1024", "samples per period", "1024"),
    ],
    check,
    // free vibration has no drive frequency: harmonic balance with an unknown frequency and damping is solved
    uses_method: false,
    run,
};

fn check(values: &Values, model: &Model) -> Result<(), Complaint> {
    let range = values.table("amplitude");
    if let Some((from, to)) = range.and_then(|t| t.quantity("from").zip(t.quantity("to")))
        && from >= to
    {
        return Err(Complaint::new("amplitude", "the range is empty", "`from` must be below `to`"));
    }
    check_samples(values)?;
    let (number, masses) = (values.count("mode").unwrap_or(1), model.masses.len() as u64);
    if number > masses {
        let message = format!("there is no mode {number}: the structure has {masses}");
        return Err(Complaint::new("mode", message, "count modes from 1, by rising frequency"));
    }
    Ok(())
}

fn run(_: &Study, cases: &[Prepared], context: &Context<'_>) -> Computed {
    let found: Vec<Result<Option<Mode>, MethodError>> = cases
        .par_iter()
        .map(|prepared| {
            let found = if context.stopped() { Ok(None) } else { follow(prepared).map(Some) };
            (context.finished)();
            found
        })
        .collect();
    let mut outcome = Outcome::default();
    let mut rows = Rows::default();
    let mut modes = Vec::new();
    for (prepared, found) in cases.iter().zip(found) {
        let Some(mode) = found.map_err(|error| (prepared.case.index, error))? else {
            outcome.count(|| prepared.case.label(), NOT_REACHED, None);
            continue;
        };
        let lost =
            mode.lost.map(|a| format!("the mode was lost at the modal amplitude {a:.3e} m √kg; try more harmonics"));
        outcome.count(|| prepared.case.label(), if lost.is_some() { "lost" } else { CONVERGED }, lost);
        for point in &mode.points {
            rows.varied(&prepared.case);
            rows.number("modal_amplitude_m_sqrt_kg", point.amplitude);
            rows.number("frequency_Hz", point.omega / TAU);
            rows.number("damping_ratio", point.damping);
            for (place, amplitude) in prepared.system.places.iter().zip(&point.places) {
                rows.number(&format!("{place}_amplitude_m"), *amplitude);
            }
            rows.end();
        }
        modes.push((prepared, mode));
    }
    outcome.tables = vec![rows.table("modes")];
    outcome.figure = panels(&modes);
    Ok(outcome)
}

fn follow(prepared: &Prepared) -> Result<Mode, MethodError> {
    let values = &prepared.case.values;
    let range = values.table("amplitude");
    let end = |key: &str| range.and_then(|t| t.quantity(key)).unwrap_or(0.0);
    let number = values.count("mode").unwrap_or(1) as usize - 1;
    // modal amplitude of a unit displacement of the place that moves most
    let unit = prepared.system.modal_unit(number);
    mode(
        &prepared.system,
        ModeRequest {
            mode: number,
            range: (end("from") * unit, end("to") * unit),
            points: range.and_then(|t| t.count("points")).unwrap_or(61) as usize,
            harmonics: values.count("harmonics").unwrap_or(HARMONICS) as usize,
            samples: values.count("samples").unwrap_or(SERIES_SAMPLES) as usize,
        },
    )
}

fn panels(modes: &[(&Prepared, Mode)]) -> Vec<Panel> {
    let widest = |mode: &Mode| {
        let last = mode.points.last()?;
        (0..last.places.len()).max_by(|&a, &b| last.places[a].total_cmp(&last.places[b]))
    };
    let largest = modes
        .iter()
        .flat_map(|(_, mode)| mode.points.iter().flat_map(|p| p.places.iter()))
        .fold(0.0f64, |a, x| a.max(*x));
    let (unit, factor) = display_unit(largest, "m");
    let x = Axis::new("log₁₀ amplitude", unit);
    let panel = |quantity: &str, unit: &str, read: fn(&stickslip::curve::modes::ModePoint) -> f64| Panel {
        title: String::new(),
        x: x.clone(),
        y: Axis::new(quantity, unit),
        series: modes
            .iter()
            .enumerate()
            .filter_map(|(colour, (prepared, mode))| {
                let place = widest(mode)?;
                let label = match prepared.case.label() {
                    label if label.is_empty() => prepared.system.places[place].clone(),
                    label => label,
                };
                Some(Series {
                    label,
                    x: mode.points.iter().map(|p| (p.places[place] * factor).log10()).collect(),
                    y: mode.points.iter().map(read).collect(),
                    style: Style::Solid,
                    colour,
                    ..Series::default()
                })
            })
            .collect(),
    };
    vec![
        panel("frequency", "Hz", |point| point.omega / TAU),
        panel("equivalent damping ratio", "%", |point| 100.0 * point.damping),
    ]
}
