//! Nonlinear modes: frequency and equivalent damping over amplitude.

use super::{Complaint, HARMONICS, Kind, SERIES_SAMPLES, check_samples};
use crate::dataset::{Axis, Figure, Panel, Series};
use crate::drawing::{Drawing, largest, numbers};
use crate::rows::Rows;
use crate::schema::{Key, Takes, Within, default, required};
use crate::values::Values;
use crate::work::{CONVERGED, Computed, Grain, Part, Prepared, Work};
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
    axes: [Some(Dimension::LENGTH), None],
    // free vibration has no drive frequency: harmonic balance with an unknown frequency and damping is solved
    uses_method: false,
    adapts: false,
    tables: &["modes"],
    grain: |_| Grain::Case,
    compute,
    draw,
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

fn compute(work: &Work<'_>) -> Computed {
    let prepared = work.case();
    let mode = follow(prepared).map_err(|error| (prepared.case.index, error))?;
    (work.context.finished)();
    let mut part = Part::default();
    let lost = mode.lost.map(|a| format!("the mode was lost at the modal amplitude {a:.3e} m √kg; try more harmonics"));
    part.count(|| prepared.case.label(), if lost.is_some() { "lost" } else { CONVERGED }, lost);
    let mut rows = Rows::default();
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
    part.tables = vec![rows];
    Ok(part)
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

/// Of every case the place that moves most at the largest amplitude.
fn draw(drawing: &Drawing<'_>) -> Figure {
    let (Some(table), Some(system)) = (drawing.table("modes"), drawing.system(0)) else { return Figure::default() };
    let column = |place: &String| format!("{place}_amplitude_m");
    let (x_axis, factor) = drawing.axis(0, "amplitude", largest(table, system.places.iter().map(column)), "m");
    let stretches = drawing.stretches(table);
    let panel = |quantity: &str, unit_of: &str, read: &str, scale: f64| Panel {
        title: String::new(),
        x: x_axis.clone().log(),
        y: Axis::new(quantity, unit_of),
        series: stretches
            .iter()
            .enumerate()
            .filter_map(|(colour, stretch)| {
                let at_last = |place: &&String| numbers(table, &column(place), stretch.rows.clone()).last().copied();
                let widest = system
                    .places
                    .iter()
                    .max_by(|a, b| at_last(a).unwrap_or(0.0).total_cmp(&at_last(b).unwrap_or(0.0)))?;
                let label = if stretch.varied.is_empty() { widest.clone() } else { stretch.label() };
                let x = numbers(table, &column(widest), stretch.rows.clone()).iter().map(|x| x * factor).collect();
                let y = numbers(table, read, stretch.rows.clone()).iter().map(|y| y * scale).collect();
                Some(Series::line(label, x, y, colour))
            })
            .collect(),
    };
    let panels = vec![
        panel("frequency", "Hz", "frequency_Hz", 1.0),
        panel("equivalent damping ratio", "%", "damping_ratio", 100.0),
    ];
    Figure { panels, ..Figure::default() }
}
