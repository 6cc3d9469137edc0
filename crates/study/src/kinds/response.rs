//! Response curves: amplitude over drive frequency.

use super::{FREQUENCY, Kind, orbits};
use crate::dataset::{Axis, Figure, Panel, Series, Style};
use crate::drawing::{Drawing, Stretch, display_unit, largest, numbers, words};
use crate::note::Note;
use crate::point::{Summary, place_of};
use crate::rows::Rows;
use crate::schema::{Takes, default};
use crate::values::hertz;
use crate::work::{Computed, Grain, NOT_REACHED, Part, Work};
use stickslip::curve::peak::{self, Peak, Point};
use stickslip::method::MethodError;
use stickslip::orbit::Orbit;

pub(super) const KIND: Kind = Kind {
    name: "response",
    summary: "response curves over the drive frequency, with refined peaks",
    keys: &[
        FREQUENCY,
        default(
            "peaks",
            Takes::Flag,
            "true",
            "refines every peak of every mass between the points of the curve",
            "false",
        ),
    ],
    check: |_, _| Ok(()),
    uses_method: true,
    tables: &["curve", "peaks"],
    grain: |_| Grain::Frequencies,
    compute,
    draw,
};

/// Up to this many cases each has a panel with all masses; beyond, each mass has a panel with all cases.
const PANELS: usize = 6;
/// A mass below this share of the heaviest is drawn dashed, like the paper's contact masses.
const LIGHT: f64 = 0.5;

fn compute(work: &Work<'_>) -> Computed {
    let prepared = work.case();
    let (case, system) = (&prepared.case, &prepared.system);
    let of_case = |error: MethodError| (case.index, error);
    let wanted = wants_peaks(work);
    let mut part = Part::default();
    let mut rows = Rows::default();
    let mut stuck = 0;
    let mut points = Vec::new();
    orbits::sweep(work, &mut |omega, outcome| {
        let Some(outcome) = outcome else { return part.count(|| place_of(case, omega), NOT_REACHED, None) };
        let summary = Summary::new(system, outcome);
        part.count(|| place_of(case, omega), &summary.status, summary.failure.clone());
        stuck += usize::from(summary.stuck);
        if let Some(note) = outcome.ok().and_then(Note::of_accuracy) {
            note.join(&mut part.notes);
        }
        rows.varied(case);
        rows.number("frequency_Hz", hertz(omega));
        summary.write(system, &mut rows);
        rows.end();
        if wanted {
            points.push(outcome.map_or_else(|_| Point::failed(omega), |orbit| Point::new(orbit, &amplitudes)));
        }
    })
    .map_err(of_case)?;
    part.notes.push(Note::Stuck { case: case.label(), points: stuck, of: work.points.len() });
    part.tables = vec![rows];
    if wanted && !work.context.stopped() {
        let found = peaks(work, points).map_err(of_case)?;
        let mut peaks = Rows::default();
        for (place, peak) in found {
            peaks.varied(case);
            peaks.text("mass", &system.places[place]);
            peaks.number("frequency_Hz", hertz(peak.omega));
            peaks.number("amplitude_m", peak.value);
            peaks.flag("at_range_end", Some(peak.at_end));
            peaks.end();
        }
        part.tables.push(peaks);
    }
    Ok(part)
}

fn amplitudes(orbit: &Orbit) -> Vec<f64> {
    orbit.places.iter().map(|place| place.amplitude()).collect()
}

/// Whether peaks are asked for, on a curve that can have any.
fn wants_peaks(work: &Work<'_>) -> bool {
    let case = &work.case().case;
    let rising = |f: &crate::values::Frequencies| f.len() > 2 && f.iter().is_sorted();
    case.values.flag("peaks").unwrap_or(true) && case.frequencies.as_ref().is_some_and(rising)
}

/// The peaks of a stretch of a curve, by frequency. Its first and last points are looked at together with the neighbours that other
/// units compute for themselves; those of the whole curve count as peaks at the end of the range if the curve falls away from them.
fn peaks(work: &Work<'_>, mut points: Vec<Point>) -> Result<Vec<(usize, Peak)>, MethodError> {
    let prepared = work.case();
    let count = prepared.case.frequencies.as_ref().map_or(0, |f| f.len());
    let mut solver = prepared.method.solver(&prepared.system)?;
    let mut near = |index: usize, start: Option<&[f64]>| match solver.orbit(work.omega(index), start) {
        Ok(orbit) => Point::new(&orbit, &amplitudes),
        Err(_) => Point::failed(work.omega(index)),
    };
    let at_end = |end: &Point, neighbour: &Point| -> Vec<(usize, Peak)> {
        let falls = |place: &usize| neighbour.values.get(*place).is_some_and(|value| end.values[*place] > *value);
        (0..end.values.len())
            .filter(falls)
            .map(|place| (place, Peak { omega: end.omega, value: end.values[place], at_end: true }))
            .collect()
    };
    let (mut first, mut last) = (Vec::new(), Vec::new());
    if work.points.start > 0 {
        let start = points.first().and_then(|point| point.start.as_deref());
        let before = near(work.points.start - 1, start);
        points.insert(0, before);
    } else if let [end, neighbour, ..] = &points[..] {
        first = at_end(end, neighbour);
    }
    if work.points.end < count {
        let start = points.last().and_then(|point| point.start.as_deref());
        let after = near(work.points.end, start);
        points.push(after);
    } else if let [.., neighbour, end] = &points[..] {
        last = at_end(end, neighbour);
    }
    let inner = peak::all(&*prepared.method, &prepared.system, &points, &amplitudes)?;
    Ok(first.into_iter().chain(inner).chain(last).collect())
}

fn draw(drawing: &Drawing<'_>) -> Figure {
    let (Some(curve), Some(system)) = (drawing.table("curve"), drawing.system(0)) else { return Figure::default() };
    let stretches = drawing.stretches(curve);
    let peaks = peaks_by_case(drawing);
    let column = |place: &String| format!("{place}_amplitude_m");
    let (unit, factor) = display_unit(largest(curve, system.places.iter().map(column)), "m");
    let panel = |title: String| Panel {
        title,
        x: Axis::new("frequency", "Hz"),
        y: Axis::new("amplitude", unit.clone()),
        series: Vec::new(),
    };
    let line = |stretch: &Stretch, place: usize, label: String, colour: usize| {
        let x = numbers(curve, "frequency_Hz", stretch.rows.clone());
        let y = numbers(curve, &column(&system.places[place]), stretch.rows.clone());
        Series::line(label, x, y.iter().map(|y| y * factor).collect(), colour)
    };
    let heaviest = system.mass.diagonal().max();
    let style =
        |place: usize| if system.mass[(place, place)] < LIGHT * heaviest { Style::Dashed } else { Style::Solid };
    let mut panels = Vec::new();
    if stretches.len() <= PANELS {
        for stretch in &stretches {
            let mut panel = panel(stretch.label());
            for (place, name) in system.places.iter().enumerate() {
                panel.series.push(Series { style: style(place), ..line(stretch, place, name.clone(), place) });
            }
            for (name, x, y) in peaks.iter().filter(|peak| peak.0 == stretch.case).map(|peak| &peak.1) {
                let colour = system.places.iter().position(|place| place == name).unwrap_or(0);
                panel.series.push(Series::marks("peak", vec![*x], vec![y * factor], colour));
            }
            panels.push(panel);
        }
    } else {
        for (place, name) in system.places.iter().enumerate() {
            let mut panel = panel(name.clone());
            for (number, stretch) in stretches.iter().enumerate() {
                panel.series.push(line(stretch, place, stretch.label(), number));
            }
            panels.push(panel);
        }
    }
    Figure { panels, ..Figure::default() }
}

/// The peaks inside the range: case, and mass, frequency (Hz), amplitude (m).
fn peaks_by_case(drawing: &Drawing<'_>) -> Vec<(usize, (String, f64, f64))> {
    let Some(table) = drawing.table("peaks") else { return Vec::new() };
    let at_end = match table.columns.iter().find(|column| column.name == "at_range_end").map(|column| &column.values) {
        Some(crate::dataset::Values::Flag(flags)) => flags.as_slice(),
        _ => &[],
    };
    let masses = words(table, "mass");
    let mut peaks = Vec::new();
    for stretch in drawing.stretches(table) {
        let (x, y) =
            (numbers(table, "frequency_Hz", stretch.rows.clone()), numbers(table, "amplitude_m", stretch.rows.clone()));
        for (i, row) in stretch.rows.clone().enumerate() {
            if at_end.get(row) == Some(&Some(false)) {
                peaks.push((stretch.case, (masses[row].clone(), x[i], y[i])));
            }
        }
    }
    peaks
}
