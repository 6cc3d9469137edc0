//! Response curves: amplitude over drive frequency.

use super::orbits::Inaccurate;
use super::{Computed, FREQUENCY, Kind};
use crate::dataset::{Axis, Panel, Series, Style};
use crate::run::{Context, NOT_REACHED, Outcome, Prepared, Rows, Summary, display_unit, place_of};
use crate::schema::{Takes, default};
use crate::study::Study;
use crate::values::{Frequencies, hertz};
use rayon::prelude::*;
use std::f64::consts::TAU;
use stickslip::curve::peak::{Peak, highest};
use stickslip::curve::sweep::sweep;

pub(super) const KIND: Kind = Kind {
    name: "response",
    summary: "response curves over the drive frequency, with refined peaks",
    keys: &[
        FREQUENCY,
        default(
            "peaks",
            Takes::Flag,
            "true",
            "refines the peak of every mass between the points of the curve",
            "false",
        ),
    ],
    check: |_, _| Ok(()),
    uses_method: true,
    run,
};

/// Up to this many cases each has a panel with all masses; beyond, each mass has a panel with all cases.
const PANELS: usize = 6;
/// A mass below this share of the heaviest is drawn dashed, like the paper's contact masses.
const LIGHT: f64 = 0.5;

struct Curve {
    omegas: Vec<f64>,
    rows: Vec<Summary>,
    peaks: Vec<Option<Peak>>,
}

fn run(_: &Study, cases: &[Prepared], context: &Context<'_>) -> Computed {
    let curves: Vec<Curve> = cases.par_iter().map(|prepared| curve(prepared, context)).collect();
    let mut outcome = Outcome::default();
    let (mut rows, mut peaks) = (Rows::default(), Rows::default());
    let truncated = curves.iter().any(|curve| curve.rows.iter().any(|row| !row.truncation.is_nan()));
    let mut inaccurate = Inaccurate::default();
    for (prepared, curve) in cases.iter().zip(&curves) {
        let mut stuck = 0;
        for (omega, row) in curve.omegas.iter().zip(&curve.rows) {
            outcome.count(|| place_of(&prepared.case, *omega), &row.status, row.failure.clone());
            if row.status == NOT_REACHED {
                continue;
            }
            stuck += usize::from(row.stuck);
            inaccurate.count(&row.status, row.truncation);
            rows.varied(&prepared.case);
            rows.number("frequency_Hz", hertz(*omega));
            row.write(&prepared.system, truncated, &mut rows);
            rows.end();
        }
        if stuck > 0 {
            let label =
                if prepared.case.varied.is_empty() { String::new() } else { format!("{}: ", prepared.case.label()) };
            outcome.notes.push(format!(
                "{label}at {stuck} of {} points a joint sticks for the whole period; its offset is not unique there, and the \
                 symmetric motion is shown.",
                curve.omegas.len()
            ));
        }
        for (place, peak) in prepared.system.places.iter().zip(&curve.peaks) {
            peaks.varied(&prepared.case);
            peaks.text("mass", place);
            peaks.number("frequency_Hz", peak.map_or(f64::NAN, |peak| peak.omega / TAU));
            peaks.number("amplitude_m", peak.map_or(f64::NAN, |peak| peak.value));
            peaks.flag("at_range_end", peak.map(|peak| peak.at_end));
            peaks.end();
        }
    }
    outcome.notes.extend(inaccurate.notes());
    outcome.tables.push(rows.table("curve"));
    if curves.iter().any(|curve| !curve.peaks.is_empty()) {
        outcome.tables.push(peaks.table("peaks"));
    }
    outcome.figure = panels(cases, &curves);
    Ok(outcome)
}

fn curve(prepared: &Prepared, context: &Context<'_>) -> Curve {
    let Prepared { case, system, method } = prepared;
    let none = Frequencies::List(Vec::new());
    let frequencies = case.frequencies.as_ref().unwrap_or(&none);
    let omega = |i: usize| frequencies.get(i).unwrap_or(f64::NAN);
    let points = sweep(&**method, system, frequencies.len(), &omega, context.watch(), &|_, outcome| {
        Summary::new(system, outcome)
    });
    // the method took this system when the case was prepared
    let rows: Vec<Summary> = points
        .unwrap_or_default()
        .into_iter()
        .map(|row| row.unwrap_or_else(|| Summary::missing(system, NOT_REACHED)))
        .collect();
    let omegas: Vec<f64> = frequencies.iter().collect();
    let wanted =
        case.values.flag("peaks").unwrap_or(true) && omegas.len() > 2 && omegas.is_sorted() && !context.stopped();
    let places = if wanted { system.dofs() } else { 0 };
    let peaks = (0..places)
        .into_par_iter()
        .map(|place| {
            let values: Vec<f64> = rows.iter().map(|row| row.places[place][0]).collect();
            let mut solver = method.solver(system).ok()?;
            highest(&mut *solver, &omegas, &values, &|orbit| orbit.places[place].amplitude())
        })
        .collect();
    Curve { omegas, rows, peaks }
}

fn panels(cases: &[Prepared], curves: &[Curve]) -> Vec<Panel> {
    let largest = curves
        .iter()
        .flat_map(|curve| curve.rows.iter().flat_map(|row| row.places.iter().map(|p| p[0])))
        .filter(|a| a.is_finite())
        .fold(0.0, f64::max);
    let (unit, factor) = display_unit(largest, "m");
    let panel = |title: String| Panel {
        title,
        x: Axis { quantity: "frequency".to_owned(), unit: "Hz".to_owned() },
        y: Axis { quantity: "amplitude".to_owned(), unit: unit.clone() },
        series: Vec::new(),
    };
    let line = |case: usize, place: usize, label: String, colour: usize, style: Style| Series {
        label,
        x: curves[case].omegas.iter().map(|w| w / TAU).collect(),
        y: curves[case].rows.iter().map(|row| row.places[place][0] * factor).collect(),
        style,
        colour,
    };
    let mark = |case: usize, place: usize, colour: usize| {
        let peak = (*curves[case].peaks.get(place)?)?;
        let point = (peak.omega / TAU, peak.value * factor);
        (!peak.at_end).then(|| Series {
            label: "peak".to_owned(),
            x: vec![point.0],
            y: vec![point.1],
            style: Style::Marks,
            colour,
        })
    };
    let style = |case: usize, place: usize| {
        let mass = &cases[case].system.mass;
        if mass[(place, place)] < LIGHT * mass.diagonal().max() { Style::Dashed } else { Style::Solid }
    };
    if cases.len() <= PANELS {
        (0..cases.len())
            .map(|case| {
                let mut panel = panel(cases[case].case.label());
                for (place, name) in cases[case].system.places.iter().enumerate() {
                    panel.series.push(line(case, place, name.clone(), place, style(case, place)));
                }
                panel.series.extend((0..cases[case].system.dofs()).filter_map(|place| mark(case, place, place)));
                panel
            })
            .collect()
    } else {
        let places = cases.first().map_or(&[][..], |prepared| &prepared.system.places);
        places
            .iter()
            .enumerate()
            .map(|(place, name)| {
                let mut panel = panel(name.clone());
                for case in 0..cases.len() {
                    panel.series.push(line(case, place, cases[case].case.label(), case, Style::Solid));
                }
                panel
            })
            .collect()
    }
}
