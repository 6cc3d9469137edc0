//! Branches of orbits by arc length, along the drive frequency or along a design parameter, around turning points.

use super::orbits::Inaccurate;
use super::peak_of::{check_peak_of, peak_place};
use super::{Complaint, Computed, FREQUENCY, HARMONICS, Kind, SERIES_SAMPLES, check_samples};
use crate::dataset::{Axis, Panel, Series, Style};
use crate::run::{Context, NOT_REACHED, Outcome, Prepared, Rows, Summary, display_unit};
use crate::schema::{Takes, Within, default, optional};
use crate::study::{Study, VariedValue, varied_text};
use crate::values::{Values, hertz};
use rayon::prelude::*;
use std::f64::consts::TAU;
use stickslip::curve::trace::{Branch, End, Trace, TraceError, TracePoint};
use stickslip::dimension::Dimension;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::model::{Model, System};

pub(super) const KIND: Kind = Kind {
    name: "branch",
    summary: "a branch of orbits by continuation, around turning points: along a range of `frequency`, or at one frequency along the last \
              parameter of `vary`, from its first value to its last",
    keys: &[
        FREQUENCY,
        default(
            "steps",
            Takes::Count(2, 100_000),
            "100",
            "steps over the range at least; they shorten where it bends",
            "100",
        ),
        optional(
            "peak_of",
            Takes::Names,
            "the mass whose peaks along the branch are refined; the first one that a force acts on when absent",
            "\"blade1\"",
        ),
        default("harmonics", Takes::Count(1, 255), "15", "highest harmonic", "15"),
        default("samples", Takes::Count(8, 1 << 16), "1024", "samples per period", "1024"),
        default(
            "tolerance",
            Takes::Quantity(Dimension::NONE, Within::Positive),
            "0.001",
            "estimated error relative to the largest amplitude, beyond which a point is `truncated`",
            "0.001",
        ),
    ],
    check,
    // harmonic balance is what branches are made of
    uses_method: false,
    run,
};

fn check(values: &Values, model: &Model) -> Result<(), Complaint> {
    check_peak_of(values, model, "name the mass whose peaks are to be refined")?;
    if values.quantity("tolerance").is_some_and(|tolerance| tolerance >= 1.0) {
        return Err(Complaint::new(
            "tolerance",
            "the tolerance must be below 1",
            "0.001 is a thousandth of the amplitude",
        ));
    }
    check_samples(values)
}

/// A branch that was asked for.
struct Followed<'a> {
    /// The first of its cases.
    prepared: &'a Prepared,
    /// The parameter that it runs along; the drive frequency if absent.
    along: Option<&'a VariedValue>,
    found: Result<Branch, Missing>,
}

/// Why there is no branch.
enum Missing {
    Interrupted,
    NoRange,
    Trace(TraceError),
}

fn run(study: &Study, cases: &[Prepared], context: &Context<'_>) -> Computed {
    let outer = |prepared: &Prepared| -> Vec<u64> {
        // along a parameter the cases of one branch differ in the last one only
        let (outer, _) = split(prepared);
        outer.iter().map(|v| v.si.to_bits()).collect()
    };
    let groups: Vec<&[Prepared]> = cases.chunk_by(|a, b| split(a).1.is_some() && outer(a) == outer(b)).collect();
    let followed: Vec<Followed<'_>> = groups.par_iter().map(|group| follow(study, group, context)).collect();
    let mut outcome = Outcome::default();
    let (mut rows, mut peaks, mut turns) = (Rows::default(), Rows::default(), Rows::default());
    let mut inaccurate = Inaccurate::default();
    let mut branches = Vec::new();
    for Followed { prepared, along, found } in followed {
        let label = || varied_text(split(prepared).0);
        let branch = match found {
            Ok(branch) => branch,
            Err(Missing::Trace(TraceError::Method(error))) => return Err((prepared.case.index, error)),
            Err(Missing::Trace(TraceError::Start(error))) => {
                outcome.count(label, error.status(), Some(error.to_string()));
                continue;
            }
            Err(Missing::Interrupted) => {
                outcome.count(label, NOT_REACHED, None);
                continue;
            }
            Err(Missing::NoRange) => {
                let reason = "a branch needs a range: frequency = { from = …, to = …, points = 2 }, or vary = { Ft = [ … ] } with two values";
                outcome.count(label, "no-range", Some(reason.to_owned()));
                continue;
            }
        };
        let place = peak_place(prepared);
        let (axis_name, factor) = axis(along);
        let begin = |rows: &mut Rows, value: f64| {
            split(prepared).0.iter().map(VariedValue::column).for_each(|(name, value)| rows.number(&name, value));
            let (name, value) = match along {
                None => ("frequency_Hz".to_owned(), hertz(value)),
                Some(parameter) => VariedValue { si: value, ..parameter.clone() }.column(),
            };
            rows.number(&name, value);
        };
        for point in &branch.points {
            outcome.count(String::new, point.orbit.evidence.accuracy.status(), None);
            inaccurate.add(&point.orbit);
            begin(&mut rows, point.value);
            Summary::new(&prepared.system, Ok(&point.orbit)).write(&prepared.system, true, &mut rows);
            rows.end();
        }
        for (value, height) in &branch.peaks {
            begin(&mut peaks, *value);
            peaks.number("amplitude_m", *height);
            peaks.end();
        }
        for point in branch.turns.iter().map(|turn| &branch.points[*turn]) {
            begin(&mut turns, point.value);
            turns.number("amplitude_m", point.orbit.places[place].amplitude());
            turns.end();
        }
        let reason = match branch.end {
            End::Border => None,
            End::Stalled { at } => Some(format!("no shorter step converges beyond {axis_name} = {:.9}", at * factor)),
            End::Points | End::Stopped => Some("the branch does not reach the end of its range".to_owned()),
        };
        if let Some(reason) = reason {
            let kept = format!("{reason}; its {} points so far are kept", branch.points.len());
            outcome.count(label, "stalled", Some(kept));
        }
        branches.push((prepared, along, branch));
    }
    outcome.notes.extend(inaccurate.notes());
    outcome.tables = vec![rows.table("branch"), peaks.table("peaks"), turns.table("turns")];
    outcome.figure = panel(&branches).into_iter().collect();
    Ok(outcome)
}

/// The varied parameters that tell branches apart, and the one that a branch runs along: the last one, if there is one frequency.
fn split(prepared: &Prepared) -> (&[VariedValue], Option<&VariedValue>) {
    let varied = &prepared.case.varied[..];
    let one = prepared.case.frequencies.as_ref().is_some_and(|f| f.len() == 1);
    match varied.split_last() {
        Some((last, outer)) if one => (outer, Some(last)),
        _ => (varied, None),
    }
}

/// Name of the column of what a branch runs along, and its factor from SI.
fn axis(along: Option<&VariedValue>) -> (String, f64) {
    along.map_or_else(|| ("frequency_Hz".to_owned(), 1.0 / TAU), |parameter| (parameter.name.clone(), 1.0))
}

fn follow<'a>(study: &Study, group: &'a [Prepared], context: &Context<'_>) -> Followed<'a> {
    let (prepared, last) = (&group[0], &group[group.len() - 1]);
    let along = split(prepared).1;
    let frequencies: Vec<f64> = prepared.case.frequencies.iter().flat_map(|f| f.iter()).collect();
    let range = match (along, split(last).1) {
        (Some(first), Some(last)) => (first.si, last.si),
        _ => (frequencies.first().copied().unwrap_or(0.0), frequencies.last().copied().unwrap_or(0.0)),
    };
    let found = if context.stopped() {
        Err(Missing::Interrupted)
    } else if range.0 == range.1 {
        Err(Missing::NoRange)
    } else {
        let values = &prepared.case.values;
        let count = |key: &str, default: u64| values.count(key).unwrap_or(default) as usize;
        let omega = frequencies[0];
        let system = |value: f64| -> Option<System> {
            let case = study.case_with(prepared.case.index, &along?.name, value).ok()?;
            case.model.assemble().ok()
        };
        // a value that the model cannot have has no drive, and the branch ends before it
        let at = |value: f64| match along {
            None => (prepared.system.clone(), value),
            Some(_) => system(value).map_or((prepared.system.clone(), 0.0), |system| (system, omega)),
        };
        let place = peak_place(prepared);
        let trace = Trace {
            at: &at,
            method: HarmonicBalance {
                harmonics: Some(count("harmonics", HARMONICS)),
                samples: Some(count("samples", SERIES_SAMPLES)),
                tolerance: values.quantity("tolerance"),
            },
            range,
            step: (range.1 - range.0).abs() / count("steps", 100) as f64,
            quantity: &|orbit| orbit.places[place].amplitude(),
        };
        trace.branch().map_err(Missing::Trace)
    };
    (0..group.len() * frequencies.len()).for_each(|_| (context.finished)());
    Followed { prepared, along, found }
}

fn panel(branches: &[(&Prepared, Option<&VariedValue>, Branch)]) -> Option<Panel> {
    let (_, along, _) = branches.first()?;
    let points = branches.iter().flat_map(|(_, _, branch)| &branch.points);
    let largest = points.flat_map(|point| point.orbit.places.iter().map(|p| p.amplitude())).fold(0.0, f64::max);
    let (unit, factor) = display_unit(largest, "m");
    let (name, along_factor) = axis(*along);
    let si = along.map_or("Hz", |v| v.dimension.and_then(|d| d.name_and_unit()).map_or("", |(_, unit)| unit));
    let quantity = if along.is_some() { name } else { "frequency".to_owned() };
    // of several branches only the place whose peaks count is shown
    let place = &branches[0].0.system.places[peak_place(branches[0].0)];
    let height = if branches.len() == 1 { "amplitude".to_owned() } else { format!("amplitude of {place}") };
    let mut series = Vec::new();
    let mut colour = 0;
    for (prepared, _, branch) in branches {
        let outer = varied_text(split(prepared).0);
        let places = if branches.len() == 1 {
            0..prepared.system.dofs()
        } else {
            peak_place(prepared)..peak_place(prepared) + 1
        };
        for place in places {
            let label = if branches.len() == 1 { prepared.system.places[place].clone() } else { outer.clone() };
            let mut from = 0;
            // unstable stretches are dashed; each begins at the last point of the one before
            for run in branch.points.chunk_by(|a, b| unstable(a) == unstable(b)) {
                let shown = &branch.points[from.max(1) - 1..from + run.len()];
                from += run.len();
                let dashed = unstable(&run[0]);
                series.push(Series {
                    label: if dashed { format!("{label}, unstable") } else { label.clone() },
                    x: shown.iter().map(|point| point.value * along_factor).collect(),
                    y: shown.iter().map(|point| point.orbit.places[place].amplitude() * factor).collect(),
                    style: if dashed { Style::Dashed } else { Style::Solid },
                    colour,
                });
            }
            colour += 1;
        }
    }
    Some(Panel {
        title: String::new(),
        x: Axis { quantity, unit: si.to_owned() },
        y: Axis { quantity: height, unit },
        series,
    })
}

fn unstable(point: &TracePoint) -> bool {
    point.orbit.is_stable() == Some(false)
}
