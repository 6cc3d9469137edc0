//! Response curves: amplitude over drive frequency.

mod amplification;
mod tables;

pub use tables::{Curve, MassCurve, curves};

use super::keys::{FREQUENCY, OUTPUT, anything, check_output};
use super::orbits;
use super::peak_of::{PEAK_OF, check_peak_of, named_places, worst};
use super::shares;
use super::wheel::{self, Around, of_sector};
use crate::columns::{AMPLITUDE, AT_RANGE_END, FREQUENCY as DRIVE, amplitude_of, phase_of};
use crate::cost::{Cost, Costing, Shape};
use crate::dataset::{Axis, Column, Figure, Panel, Series, Sharing, Style, Table, column_name};
use crate::drawing::{Drawing, Layout, MOST_CURVES, MOST_PANELS, Stretch, join, largest, numbers, thinned, words};
use crate::histogram;
use crate::info::KindInfo;
use crate::key::{Key, Takes, default};
use crate::kind::Kind;
use crate::linear::Reference;
use crate::note::{Note, WARNING};
use crate::percentiles::percentiles;
use crate::point::{Summary, place_of};
use crate::rows::Rows;
use crate::study::varied_text;
use crate::survey::Surveyed;
use crate::values::{Frequencies, hertz};
use crate::warnings::sampled;
use crate::words::{display_unit, shown_hertz};
use crate::work::{Computed, Grain, NOT_REACHED, Part, Prepared, Work};
use std::collections::HashMap;
use std::ops::Range;
use stickslip::curve::adaptive::Adaptive;
use stickslip::curve::peak::{self, Peak, Point};
use stickslip::dimension::Dimension;
use stickslip::method::{self, MethodError, Options, OrbitError, Solver};
use stickslip::model::System;
use stickslip::orbit::Orbit;

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: tables::NAME,
        summary: "response curves over the drive frequency, with refined peaks",
        keys: &[
            FREQUENCY,
            default(
                "peaks",
                Takes::Flag,
                "true",
                "refines every peak of every mass between the points of the curve; with `peak_of` those of the worst mass",
                "false",
            ),
            Key {
                doc: "the masses of which the worst counts in peaks.csv, or \"all\"; absent: every mass for itself",
                ..PEAK_OF
            },
            amplification::KEY,
            OUTPUT,
        ],
        check: |values, model, _| {
            check_peak_of(values, model)?;
            amplification::check(values, model)?;
            check_output(values)
        },
        axes: [Some(Dimension::FREQUENCY), Some(Dimension::LENGTH)],
        uses_method: true,
        needs: anything,
        adapts: true,
        tables: &[tables::CURVE, tables::PEAKS, tables::REFERENCES, tables::AMPLIFICATION],
    },
    // an amplification is that of a whole curve
    grain: |study| match study.is_adaptive() || study.wants(amplification::KEY.name) {
        true => Grain::Case,
        false => Grain::Frequencies,
    },
    cost,
    warnings: |cases| sampled(cases).into_iter().chain(amplification::none(cases)).chain(many_peaks(cases)).collect(),
    compute,
    draw,
};

/// Peaks of a mass: some have two. Orbits that refine one, and those at the border of a unit that two units compute.
const PEAKS: f64 = 1.3;
const REFINING: f64 = 6.0;

fn cost(costing: &Costing<'_>) -> Cost {
    let (points, values) = (costing.points(), &costing.case.values);
    let sought = values.flag("peaks") != Some(false) && costing.frequencies > 2.0;
    let peaks = match values.names("peak_of") {
        _ if !sought => 0.0,
        Some(_) => costing.cases,
        None => (costing.cases * costing.places * PEAKS).floor(),
    };
    let linear = if costing.study.wants_references() { costing.frequencies * REFERENCE_POINTS as f64 } else { 0.0 };
    // a tuned disk takes a sector's time, and its curve the frequencies of the other
    let tuned = if values.flag(amplification::KEY.name) == Some(true) { costing.cases } else { 0.0 };
    let curves = costing.cases.min(MOST_CURVES as f64) * costing.places.min(MOST_PANELS as f64 + SINGLE as f64);
    Cost {
        tables: vec![
            costing.orbits(points),
            Shape { rows: peaks, numbers: costing.varied + 3.0, words: 1.0 },
            Shape { rows: linear, numbers: 1.0 + 2.0 * costing.places, words: 0.0 },
            Shape { rows: tuned, numbers: costing.varied + 5.0, words: 1.0 },
        ],
        drawn: curves * costing.frequencies,
        unit: costing.orbit_bytes(),
        work: points * costing.extra()
            + (points + REFINING * peaks + 2.0 * linear + tuned * costing.frequencies) * costing.orbit(),
    }
}

/// Says what refining the peaks of thousands of places costs, and how to do without.
fn many_peaks(cases: &[Surveyed]) -> Option<String> {
    let one = cases.first()?;
    let (values, places) = (&one.case.values, one.survey.system().places().len());
    let sought = values.flag("peaks") != Some(false) && values.names("peak_of").is_none();
    (sought && places >= MANY_PEAKS).then(|| {
        format!(
            "the peaks of {places} places are refined one by one, with {REFINING:.0} orbits or so for each: peak_of = \"all\" in [study] refines \
             that of the worst, and peaks = false none"
        )
    })
}

/// Amplitudes below this share of the largest are rounding.
const ROUNDING: f64 = 1e-10;
/// A mass below this share of the heaviest is drawn dashed, like the paper's contact masses.
const LIGHT: f64 = 0.5;
/// Masses that are drawn one by one; of more the largest amplitude is, with the single ones pale behind it.
const SINGLE: usize = 7;
/// Masses that are drawn behind the largest of them, those with the highest peaks: the curves of thousands would be one grey area in megabytes.
const BEHIND: usize = 100;
/// Places whose peaks are no longer refined one by one without a word: a disk of many blades wants them, the nodes of a contact hardly.
const MANY_PEAKS: usize = 1000;
/// Colours that the curves of many masses take: the single ones and the largest of them.
const MANY: usize = 2;
/// Two points before a peak that differ from it by less than this share are level with it: more than the rounding of an orbit, and less
/// than a resonance falls between two points of any curve that can be drawn.
const LEVEL: f64 = 1e-8;
/// Points of the linear references between two points of the curve: their peaks are sharper than that of any damped curve.
const REFERENCE_POINTS: usize = 4;
/// Masses whose largest amplitudes differ by less than this share are equally bad.
const EQUAL: f64 = 1e-6;

fn compute(work: &Work<'_>) -> Computed {
    let prepared = work.case();
    let case = &prepared.case;
    let mut stretch = Computing::new(prepared);
    let found = match &case.frequencies {
        Some(Frequencies::Adaptive { from, to, tolerance }) => {
            let adaptive = Adaptive { range: (*from, *to), tolerance: *tolerance };
            adaptively(work, adaptive, &mut stretch)
        }
        _ => evenly(work, &mut stretch),
    };
    let points = found.map_err(|error| (case.index, error))?;
    let mut part = stretch.part;
    let of = part.points.values().sum::<u64>() as usize;
    part.notes.push(Note::Stuck { case: case.label(), points: stretch.stuck, of });
    part.tables = vec![stretch.rows];
    let mut amplified = Rows::default();
    if !points.is_empty() && !work.context.stopped() {
        let mut peaks = Rows::default();
        let all = peaks_of(work, points).map_err(|error| (case.index, error))?;
        for found in &all {
            if found.peak.unsettled {
                let at = || {
                    format!("peak of {}, {}", prepared.system.places()[found.mass], place_of(case, found.peak.omega))
                };
                let reason = "orbits beside this peak were not found, and the real one may be higher: much higher with little or \
                              no damping, or where friction cannot bound the motion; look closer with a finer range or another method";
                part.count(at, "peak-unsettled", Some(reason.to_owned()));
            }
            peaks.varied(case);
            peaks.text(tables::MASS, &prepared.system.places()[found.mass]);
            peaks.number(DRIVE, hertz(found.peak.omega));
            peaks.number(AMPLITUDE, found.peak.value);
            peaks.flag(AT_RANGE_END, Some(found.peak.at_end));
            peaks.end();
        }
        part.tables.push(peaks);
        if work.study.wants(amplification::KEY.name)
            && let Err(why) = amplification::row(work, &all, &mut amplified)
        {
            part.notes.push(Note::Said(format!("{WARNING}no amplification, {}: {why}.", case.label())));
        }
    } else {
        part.tables.push(Rows::default());
    }
    if work.study.wants_references() && case.index == 0 {
        let (rows, absent) = references(work, &stretch.omegas);
        part.tables.push(rows);
        part.notes.extend(absent.into_iter().map(Note::Said));
    } else {
        part.tables.push(Rows::default());
    }
    part.tables.push(amplified);
    Ok(part)
}

/// A stretch of a curve under way.
struct Computing<'a> {
    prepared: &'a Prepared,
    part: Part,
    rows: Rows,
    omegas: Vec<f64>,
    stuck: usize,
}

impl<'a> Computing<'a> {
    fn new(prepared: &'a Prepared) -> Self {
        Computing { prepared, part: Part::default(), rows: Rows::default(), omegas: Vec::new(), stuck: 0 }
    }

    /// Takes in a point; `None` if the run was stopped before.
    fn add(&mut self, omega: f64, point: Option<(Summary, Vec<Note>)>) {
        let case = &self.prepared.case;
        let Some((summary, notes)) = point else {
            return self.part.count(|| place_of(case, omega), NOT_REACHED, None);
        };
        self.part.count(|| place_of(case, omega), &summary.status, summary.failure.clone());
        self.stuck += usize::from(summary.stuck);
        notes.into_iter().for_each(|note| note.join(&mut self.part.notes));
        self.omegas.push(omega);
        self.rows.varied(case);
        self.rows.number(DRIVE, hertz(omega));
        summary.write(self.prepared, &mut self.rows);
        self.rows.end();
    }
}

/// What is kept of a point.
fn kept(prepared: &Prepared, outcome: Result<&Orbit, &OrbitError>) -> (Summary, Vec<Note>) {
    let summary = Summary::new(prepared, outcome);
    let notes = outcome.map_or_else(|_| Vec::new(), |orbit| Note::of_orbit(orbit, summary.stable));
    (summary, notes)
}

/// The points of the unit's frequencies; those among which peaks are sought, if they are.
fn evenly(work: &Work<'_>, stretch: &mut Computing<'_>) -> Result<Vec<Point>, MethodError> {
    let prepared = work.case();
    let wanted = wants_peaks(work);
    let places = named_places(prepared);
    let mut points = Vec::new();
    orbits::sweep(work, &mut |omega, outcome| {
        stretch.add(omega, outcome.map(|outcome| kept(prepared, outcome)));
        if let Some(outcome) = outcome.filter(|_| wanted) {
            points.push(outcome.map_or_else(|_| Point::failed(omega), |orbit| point(orbit, &places)));
        }
    })?;
    if !wanted || points.is_empty() {
        return Ok(Vec::new());
    }
    // its first and last points are looked at together with the neighbours that other units compute for themselves
    let count = prepared.case.frequencies.as_ref().map_or(0, |f| f.len());
    let mut solver = prepared.method.solver(&prepared.system)?;
    let mut near = |index: usize, start: Option<&[f64]>| match solver.orbit(work.omega(index), start) {
        Ok(orbit) => point(&orbit, &places),
        Err(_) => Point::failed(work.omega(index)),
    };
    if work.points.start > 0 {
        let before = near(work.points.start - 1, points[0].start.as_deref());
        points.insert(0, before);
    }
    if work.points.end < count {
        let after = near(work.points.end, points[points.len() - 1].start.as_deref());
        points.push(after);
    }
    Ok(points)
}

/// The points that the curve needs.
fn adaptively(work: &Work<'_>, adaptive: Adaptive, stretch: &mut Computing<'_>) -> Result<Vec<Point>, MethodError> {
    let prepared = work.case();
    let places = named_places(prepared);
    let quantities = |orbit: &Orbit| amplitudes(orbit, &places);
    let keep = |outcome: Result<&Orbit, &OrbitError>| {
        (work.context.finished)();
        kept(prepared, outcome)
    };
    let stop = || work.context.stopped();
    let curve = adaptive.curve(&*prepared.method, &prepared.system, &quantities, &keep, &stop)?;
    if work.context.stopped() {
        stretch.add(adaptive.range.1, None);
    }
    let mut points = Vec::with_capacity(curve.len());
    for (point, kept) in curve {
        stretch.add(point.omega, Some(kept));
        points.push(point);
    }
    Ok(if prepared.case.values.flag("peaks").unwrap_or(true) { points } else { Vec::new() })
}

/// The amplitudes whose peaks are sought: of every mass, or the largest of the named ones and then each of these.
fn amplitudes(orbit: &Orbit, named: &[usize]) -> Vec<f64> {
    if named.is_empty() {
        return orbit.places.iter().map(|place| place.amplitude()).collect();
    }
    std::iter::once(worst(orbit, named)).chain(named.iter().map(|place| orbit.places[*place].amplitude())).collect()
}

fn point(orbit: &Orbit, named: &[usize]) -> Point {
    Point::new(orbit, &|orbit| amplitudes(orbit, named))
}

/// Whether peaks are asked for, on a curve that can have any.
fn wants_peaks(work: &Work<'_>) -> bool {
    let case = &work.case().case;
    let rising = |f: &Frequencies| f.len() > 2 && f.iter().is_sorted();
    case.values.flag("peaks").unwrap_or(true) && case.frequencies.as_ref().is_some_and(rising)
}

/// A peak and the mass that has it.
struct Found {
    mass: usize,
    peak: Peak,
}

/// The peaks of a stretch of a curve, by frequency. The ends of the whole curve count as peaks at the end of the range if it falls away
/// from them.
fn peaks_of(work: &Work<'_>, points: Vec<Point>) -> Result<Vec<Found>, MethodError> {
    let prepared = work.case();
    let named = named_places(prepared);
    let omegas = prepared
        .case
        .frequencies
        .as_ref()
        .map_or((0.0, 0.0), |f| (f.get(0).unwrap_or(0.0), f.get(f.len() - 1).unwrap_or(0.0)));
    let wanted = if named.is_empty() { prepared.system.places().len() } else { 1 };
    let found = |quantity: usize, peak: Peak, values: &[f64]| {
        let worst = (1..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(1);
        Found { mass: if named.is_empty() { quantity } else { named[worst - 1] }, peak }
    };
    let at_end = |end: &Point, neighbour: &Point| -> Vec<Found> {
        let falls = |q: &usize| neighbour.values.get(*q).is_some_and(|value| end.values[*q] > *value);
        (0..wanted.min(end.values.len()))
            .filter(falls)
            .map(|q| {
                found(q, Peak { omega: end.omega, value: end.values[q], at_end: true, unsettled: false }, &end.values)
            })
            .collect()
    };
    let (mut first, mut last) = (Vec::new(), Vec::new());
    if let [end, neighbour, ..] = &points[..]
        && end.omega == omegas.0
    {
        first = at_end(end, neighbour);
    }
    if let [.., neighbour, end] = &points[..]
        && end.omega == omegas.1
    {
        last = at_end(end, neighbour);
    }
    let quantities = |orbit: &Orbit| amplitudes(orbit, &named);
    // a place that friction holds moves by rounding only
    let largest = points.iter().flat_map(|point| &point.values).fold(0.0f64, |a, b| a.max(*b));
    let mut inner = peak::all(&*prepared.method, &prepared.system, &points, wanted, &quantities)?;
    inner.retain(|peak| peak.peak.value > ROUNDING * largest && !ends_a_level(&points, peak.quantity, &peak.peak));
    let inner = inner.into_iter().map(|peak| found(peak.quantity, peak.peak, &peak.values));
    Ok(first.into_iter().chain(inner).chain(last).collect())
}

/// Whether a peak is only where a level stretch ends: a mass that rides along with what moves it until a joint breaks loose.
fn ends_a_level(points: &[Point], quantity: usize, peak: &Peak) -> bool {
    let at = points.partition_point(|point| point.omega < peak.omega);
    let as_high = |point: &Point| {
        point.values.get(quantity).is_some_and(|value| (value - peak.value).abs() <= LEVEL * peak.value)
    };
    at >= 2 && points[at - 2..at].iter().all(as_high)
}

/// A solver of a linear reference: its joints have other laws than those for which the method was chosen, so that any may do.
fn solver<'a>(prepared: &Prepared, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
    prepared.method.solver(system).or_else(|error| {
        let others = error.ways().into_iter().flat_map(|ways| &ways.methods).filter_map(|name| method::find(name));
        let mut takes = others.filter_map(|row| (row.build)(&Options::new()).ok()?.solver(system).ok());
        takes.next().ok_or(error)
    })
}

/// The responses of the same structure with all joints free and with all joints stuck, and why one of them is absent.
fn references(work: &Work<'_>, omegas: &[f64]) -> (Rows, Vec<String>) {
    let prepared = work.case();
    let between = omegas.windows(2).flat_map(|pair| {
        (0..REFERENCE_POINTS).map(|i| pair[0] + (pair[1] - pair[0]) * i as f64 / REFERENCE_POINTS as f64)
    });
    let omegas: Vec<f64> = between.chain(omegas.last().copied()).collect();
    let mut absent = Vec::new();
    let mut follow = |reference: Reference| -> Option<Vec<Option<Orbit>>> {
        // what the laws have no reference for was said when the study was checked
        let model = reference.model(&prepared.case.model).ok()?;
        let found = model.assemble().map_err(|error| error.to_string()).and_then(|system| {
            let mut solver = solver(prepared, &system).map_err(|error| error.to_string())?;
            Ok(omegas.iter().map(|omega| solver.orbit(*omega, None).ok()).collect())
        });
        found.map_err(|why| absent.push(format!("{WARNING}{}", reference.missing(&why)))).ok()
    };
    let curves = Reference::ALL.map(|reference| (reference.name(), follow(reference)));
    let mut rows = Rows::default();
    for (i, omega) in omegas.iter().enumerate() {
        rows.number(DRIVE, hertz(*omega));
        for (what, curve) in &curves {
            for (place, name) in prepared.system.places().iter().enumerate() {
                let orbit = curve.as_ref().and_then(|curve| curve[i].as_ref());
                let amplitude = orbit.map_or(f64::NAN, |orbit| orbit.places[place].amplitude());
                rows.number(&amplitude_of(&format!("{name}_{what}")), amplitude);
            }
        }
        rows.end();
    }
    (rows, absent)
}

/// What is drawn.
struct Drawn<'a> {
    drawing: &'a Drawing<'a>,
    curve: &'a Table,
    /// Its columns by name.
    index: HashMap<&'a str, &'a Column>,
    /// Names of the masses that are shown, and their numbers.
    shown: Vec<(String, usize)>,
    /// Case, and mass, frequency (Hz), amplitude (m) of the peaks inside the range.
    peaks: Vec<(usize, (String, f64, f64))>,
    /// Names of the joints whose forces are shown.
    joints: Vec<String>,
    /// Names of the joints whose shares of stick and slip are shown.
    faces: Vec<String>,
    /// The first case's; the others differ in numbers only.
    system: &'a System,
    axes: (Axis, Axis),
    force_axis: Axis,
    /// From the values of tables to those on the axes.
    factor: (f64, f64),
    force_factor: f64,
    /// How many of the cases are shown, if not all.
    left_out: Option<String>,
}

/// x and y of one draw.
type CurveOf<'a> = &'a dyn Fn(&Stretch) -> (Vec<f64>, Vec<f64>);

impl Drawn<'_> {
    /// Amplitudes of one mass in some rows; NaN where there are none.
    fn amplitudes(&self, name: &str, rows: Range<usize>) -> Vec<f64> {
        let column = self.index.get(&*column_name(&amplitude_of(name))).and_then(|column| column.as_numbers());
        column.map_or_else(|| vec![f64::NAN; rows.len()], |values| values[rows.clone()].to_vec())
    }

    /// The curve of one mass in one case, with its peaks among its points.
    fn line(&self, stretch: &Stretch, name: &str) -> (Vec<f64>, Vec<f64>) {
        let x = numbers(self.curve, DRIVE, stretch.rows.clone());
        let y = self.amplitudes(name, stretch.rows.clone());
        self.with_peaks(stretch, x.into_iter().zip(y).collect(), &|mass, _| mass == name)
    }

    /// The largest amplitude over the shown masses, and which mass has the largest of all in words.
    fn envelope(&self, stretch: &Stretch) -> (Vec<f64>, Vec<f64>, String) {
        let x = numbers(self.curve, DRIVE, stretch.rows.clone());
        let all: Vec<Vec<f64>> =
            self.shown.iter().map(|(name, _)| self.amplitudes(name, stretch.rows.clone())).collect();
        let highest = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let most = all.iter().map(|values| highest(values)).fold(f64::NEG_INFINITY, f64::max);
        // which of equal ones is larger by a rounding says nothing
        let bad = |values: &Vec<f64>| highest(values) >= (1.0 - EQUAL) * most;
        let worst = if all.iter().all(bad) { None } else { all.iter().position(bad) };
        let y: Vec<f64> = (0..x.len()).map(|i| all.iter().map(|values| values[i]).fold(f64::NAN, f64::max)).collect();
        let below = |omega: f64| {
            let at = x.partition_point(|x| *x < omega).clamp(1, x.len().max(2) - 1);
            let share = (omega - x[at - 1]) / (x[at] - x[at - 1]);
            y[at - 1] + share * (y[at] - y[at - 1])
        };
        let points: Vec<(f64, f64)> = x.iter().copied().zip(y.iter().copied()).collect();
        // a peak of one mass below another one is none of the envelope
        let (x, y) = self.with_peaks(stretch, points, &|_, peak| x.len() > 1 && peak.1 > below(peak.0));
        (x, y, worst.map_or_else(|| "all are alike".to_owned(), |worst| format!("worst is {}", self.shown[worst].0)))
    }

    fn with_peaks(
        &self,
        stretch: &Stretch,
        mut points: Vec<(f64, f64)>,
        counts: &dyn Fn(&str, (f64, f64)) -> bool,
    ) -> (Vec<f64>, Vec<f64>) {
        let of_case = self.peaks.iter().filter(|peak| peak.0 == stretch.case).map(|peak| &peak.1);
        points.extend(of_case.filter(|(mass, x, y)| counts(mass, (*x, *y))).map(|(_, x, y)| (*x, *y)));
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.into_iter().map(|(x, y)| (x * self.factor.0, y * self.factor.1)).unzip()
    }

    /// Marks at the peaks of one mass.
    fn marks(&self, stretch: &Stretch, name: &str, colour: usize) -> impl Iterator<Item = Series> {
        let of_case = self.peaks.iter().filter(move |peak| peak.0 == stretch.case).map(|peak| &peak.1);
        of_case
            .filter(move |(mass, _, _)| mass == name)
            .map(move |(_, x, y)| Series::marks("peak", vec![x * self.factor.0], vec![y * self.factor.1], colour))
    }

    /// Grey curves of the linear structures: of one mass, or the largest over the shown ones.
    fn references(&self, names: &[&str]) -> Vec<Series> {
        let Some(table) = self.drawing.table(tables::REFERENCES) else { return Vec::new() };
        let x: Vec<f64> = numbers(table, DRIVE, 0..table.rows()).iter().map(|x| x * self.factor.0).collect();
        [("free", Style::Solid), ("stuck", Style::Dotted)]
            .into_iter()
            .map(|(what, style)| {
                let all: Vec<Vec<f64>> = names
                    .iter()
                    .map(|name| numbers(table, &amplitude_of(&format!("{name}_{what}")), 0..table.rows()))
                    .collect();
                let y = (0..x.len()).map(|i| all.iter().map(|y| y[i]).fold(f64::NAN, f64::max) * self.factor.1);
                let y: Vec<f64> = y.collect();
                let of = if names.len() > 1 { ", largest" } else { "" };
                let line = Series::line(format!("all joints {what}{of}"), x.clone(), y, 0);
                Series { style, ..line.reference() }
            })
            // why one is absent stands in the notes
            .filter(|line| line.y.iter().any(|y| y.is_finite()))
            .collect()
    }
}

fn draw(drawing: &Drawing<'_>) -> Figure {
    let (Some(curve), Some(system)) = (drawing.table(tables::CURVE), drawing.system()) else {
        return Figure::default();
    };
    let places = system.places().iter().cloned().zip(0..);
    let shown: Vec<(String, usize)> = places.filter(|(name, _)| drawing.shows(name)).collect();
    // with `output = "joint_force"` only
    let names = system.joints().iter().flat_map(|joint| joint.labels());
    let joints: Vec<String> =
        names.filter(|name| drawing.shows(name) && curve.numbers(&force(name)).is_some()).collect();
    // with `output = "contact"` only
    let names = system.joints().iter().map(|joint| joint.name().to_owned());
    let faces: Vec<String> = names.filter(|name| drawing.shows(name) && shares::has(curve, name)).collect();
    if shown.is_empty() && joints.is_empty() && faces.is_empty() {
        return Figure::default();
    }
    let columns = || shown.iter().map(|(name, _)| amplitude_of(name));
    let (x, x_factor) = drawing.axis(0, "frequency", largest(curve, [DRIVE.to_owned()]), "Hz");
    let (y, y_factor) = drawing.axis(1, "amplitude", largest(curve, columns()), "m");
    let (unit, force_factor) = display_unit(largest(curve, joints.iter().map(|joint| force(joint))), "N");
    let stretches = drawing.stretches(curve);
    let layout = drawing.layout(shown.len(), stretches.len());
    let drawn = Drawn {
        drawing,
        curve,
        index: curve.index(),
        peaks: peaks_by_case(drawing),
        factor: (x_factor, y_factor),
        force_factor,
        axes: (x, y),
        // a force between nothing and its limit needs no decades
        force_axis: Axis::new("joint force", unit),
        system: &system,
        shown,
        joints,
        faces,
        left_out: drawing.left_out(stretches.len()),
    };
    let mut figure = match layout {
        Layout::Cases => {
            // colours are those of maps: the curves of one panel have names
            let varied = (!drawn.faces.is_empty()).then(|| shares::axis("share of the period"));
            Figure { panels: drawn.by_case(&stretches), varied, ..Figure::default() }
        }
        Layout::Masses => Figure {
            panels: drawn.by_mass(&stretches),
            sharing: Sharing::Always,
            varied: drawing.varied_axis(&stretches, drawing.study.varied().len().saturating_sub(1)),
            ..Figure::default()
        },
    };
    let amplified = amplification::panels(drawing);
    figure.panels.extend(if amplified.is_empty() { drawn.heights() } else { amplified });
    figure.panels.truncate(MOST_PANELS);
    figure
}

/// The column of a joint's force.
fn force(joint: &str) -> String {
    format!("{joint}_force_amplitude_N")
}

impl Drawn<'_> {
    fn panel(&self, title: String) -> Panel {
        Panel { title, x: self.axes.0.clone(), y: self.axes.1.clone(), ..Panel::default() }
    }

    fn force_panel(&self, title: String) -> Panel {
        Panel { y: self.force_axis.clone(), ..self.panel(title) }
    }

    /// Of many draws how high their largest peak is.
    fn heights(&self) -> Vec<Panel> {
        let (Some(table), Some(_)) = (self.drawing.table(tables::PEAKS), self.drawing.study.draws()) else {
            return Vec::new();
        };
        let stretches = self.drawing.stretches(table);
        let x = Axis { quantity: "largest peak".to_owned(), ..Axis::new("", &self.axes.1.unit) };
        let of_group = |(words, group): (String, Vec<&Stretch>)| {
            let highest = |stretch: &&Stretch| {
                let heights = numbers(table, AMPLITUDE, stretch.rows.clone());
                heights.into_iter().fold(f64::NAN, f64::max) * self.factor.1
            };
            let heights: Vec<f64> = group.iter().map(highest).collect();
            histogram::panel(&heights, &x, &join([words, "largest peak".to_owned()]), "draws")
        };
        self.drawing.by_listed(&stretches).into_iter().filter_map(of_group).collect()
    }

    fn slip_panel(&self, title: String) -> Panel {
        Panel { y: shares::axis("share of the period with slip"), ..self.panel(title) }
    }

    /// The share in which joints slip.
    fn slip_line(&self, stretch: &Stretch, joints: &[String]) -> (Vec<f64>, Vec<f64>) {
        let x = numbers(self.curve, DRIVE, stretch.rows.clone()).iter().map(|x| x * self.factor.0).collect();
        (x, shares::slipping(self.curve, joints, &stretch.rows))
    }

    /// The force of a joint, or the largest of several.
    fn force_line(&self, stretch: &Stretch, joints: &[String]) -> (Vec<f64>, Vec<f64>) {
        let of = |column: &str, factor: f64| -> Vec<f64> {
            numbers(self.curve, column, stretch.rows.clone()).iter().map(|value| value * factor).collect()
        };
        let all: Vec<Vec<f64>> = joints.iter().map(|joint| of(&force(joint), self.force_factor)).collect();
        let largest = |i: usize| all.iter().map(|forces| forces[i]).fold(f64::NAN, f64::max);
        (of(DRIVE, self.factor.0), (0..stretch.rows.len()).map(largest).collect())
    }

    /// The joints whose forces are drawn as one line, with its name: each for itself, of many those that are one joint in a sector.
    fn pulling(&self) -> Vec<(String, Vec<String>)> {
        if self.joints.len() <= SINGLE {
            return self.joints.iter().map(|joint| (joint.clone(), vec![joint.clone()])).collect();
        }
        let mut groups: Vec<(String, Vec<String>)> = Vec::new();
        for joint in &self.joints {
            let place = of_sector(joint).map_or_else(|| "joint".to_owned(), |(place, _)| place);
            match groups.iter_mut().find(|(name, _)| *name == place) {
                Some((_, group)) => group.push(joint.clone()),
                None => groups.push((place, vec![joint.clone()])),
            }
        }
        let named = |(place, group): (String, Vec<String>)| (format!("{place}, largest of {}", group.len()), group);
        groups.into_iter().map(named).collect()
    }

    /// Whether the masses are drawn one by one.
    fn single(&self) -> bool {
        self.shown.len() <= SINGLE
    }

    fn names(&self) -> Vec<&str> {
        self.shown.iter().map(|(name, _)| name.as_str()).collect()
    }

    /// A panel for every case, with a curve for every mass, and one with the forces.
    fn by_case(&self, stretches: &[Stretch]) -> Vec<Panel> {
        let mut panels = Vec::new();
        for stretch in stretches.iter().take(MOST_PANELS) {
            if !self.shown.is_empty() {
                panels.push(self.masses_of(stretch));
            }
            panels.extend(self.sectors_of(stretch).into_iter().flatten().flatten());
            if !self.joints.is_empty() {
                let mut panel = self.force_panel(stretch.label());
                // beside the colours of the masses
                let beside = if self.single() { self.shown.len() } else { MANY };
                for (i, (name, joints)) in self.pulling().into_iter().enumerate() {
                    let (x, y) = self.force_line(stretch, &joints);
                    panel.series.push(Series::line(name, x, y, beside + i));
                }
                panels.push(panel);
            }
            let x: Vec<f64> =
                numbers(self.curve, DRIVE, stretch.rows.clone()).iter().map(|x| x * self.factor.0).collect();
            let over = (&x[..], &self.axes.0);
            panels.extend(shares::panels(self.curve, &self.faces, &stretch.rows, over, &stretch.label()));
        }
        panels
    }

    /// The masses of one case: each, or the largest of them before all others.
    fn masses_of(&self, stretch: &Stretch) -> Panel {
        let (mut panel, names) = (self.panel(stretch.label()), self.names());
        panel.series.extend(self.references(&names));
        if self.single() {
            // of a place that is no mass nobody knows how heavy it is
            let mass = |place: usize| match self.system.seen()[place].rows() {
                [(row, _)] => self.system.structure().own_mass(*row),
                _ => f64::INFINITY,
            };
            let places = 0..self.system.places().len();
            let heaviest = places.map(mass).filter(|mass| mass.is_finite()).fold(0.0, f64::max);
            for (name, place) in &self.shown {
                let (x, y) = self.line(stretch, name);
                let light = mass(*place) < LIGHT * heaviest;
                let style = if light { Style::Dashed } else { Style::Solid };
                panel.series.push(Series { style, ..Series::line(name, x, y, *place) });
            }
            for (name, place) in &self.shown {
                panel.series.extend(self.marks(stretch, name, *place));
            }
            return panel;
        }
        let behind = self.highest(stretch, BEHIND);
        let label = match behind.len() < names.len() {
            true => format!("the {} highest of {} masses", behind.len(), names.len()),
            false => format!("each of {} masses", names.len()),
        };
        for name in behind {
            let (x, y) = self.line(stretch, name);
            panel.series.push(Series::line(label.clone(), x, y, 1).pale());
        }
        let (x, y, worst) = self.envelope(stretch);
        panel.title = join([panel.title, worst]);
        panel.series.push(Series::line(format!("largest of {} masses", names.len()), x, y, 0));
        panel
    }

    /// So many of the shown masses at most, those with the largest amplitudes, in their own order.
    fn highest(&self, stretch: &Stretch, most: usize) -> Vec<&str> {
        let names = self.names();
        let height = |name: &str| self.amplitudes(name, stretch.rows.clone()).into_iter().fold(0.0, f64::max);
        let mut by_height: Vec<(usize, f64)> = names.iter().map(|name| height(name)).enumerate().collect();
        by_height.sort_by(|a, b| b.1.total_cmp(&a.1));
        by_height.truncate(most);
        by_height.sort_by_key(|(index, _)| *index);
        by_height.into_iter().map(|(index, _)| names[index]).collect()
    }

    /// Of a disk a bar for every sector, at the frequency where the largest amplitude is, and its shape there.
    fn sectors_of(&self, stretch: &Stretch) -> Option<[Option<Panel>; 2]> {
        let ring = self.drawing.study.case(0).ok()?.model.ring?;
        let columns: Vec<(&str, Vec<f64>)> =
            self.shown.iter().map(|(name, _)| (name.as_str(), self.amplitudes(name, stretch.rows.clone()))).collect();
        let highest = |row: usize| columns.iter().map(|(_, values)| values[row]).fold(f64::NEG_INFINITY, f64::max);
        let row = (0..stretch.rows.len()).max_by(|a, b| highest(*a).total_cmp(&highest(*b)))?;
        // what is one place in a sector has one colour
        let at = stretch.rows.start + row;
        let phase = |name: &str| numbers(self.curve, &phase_of(name), at..at + 1)[0];
        let shape = columns.iter().map(|(name, values)| (*name, values[row], phase(name)));
        let shape = Around::of_ring(shape)?;
        let bars = |(colour, around): (usize, &Around)| {
            let (x, y) = around.of.iter().map(|(sector, size, _)| (*sector as f64, size * self.factor.1)).unzip();
            Series::bars(&around.place, x, y, colour)
        };
        let series: Vec<Series> = shape.iter().enumerate().map(bars).collect();
        if series.iter().all(|bars| bars.x.len() < 2) {
            return None;
        }
        let frequency = shown_hertz(numbers(self.curve, DRIVE, stretch.rows.clone())[row]);
        let title = join([stretch.label(), format!("at {frequency}")]);
        let (x, y) = (Axis::new("sector", "").whole(), Axis::new(&self.axes.1.quantity, &self.axes.1.unit));
        let wheel = wheel::panel(&shape, ring.sectors, join(["shape".to_owned(), title.clone()]), 0);
        Some([Some(Panel { title, x, y, series, ..Panel::default() }), wheel])
    }

    /// A panel for every mass (or for the largest of them), with a curve for every case, and then for every joint the same. The last varied
    /// parameter tells the curves of one panel apart, the others the panels.
    fn by_mass(&self, stretches: &[Stretch]) -> Vec<Panel> {
        if self.drawing.study.draws().is_some() {
            return self.by_percentiles(stretches);
        }
        let outer = |stretch: &Stretch| varied_text(&stretch.varied[..stretch.varied.len().saturating_sub(1)]);
        let groups: Vec<(&[Stretch], String)> =
            stretches.chunk_by(|a, b| outer(a) == outer(b)).map(|group| (group, outer(&group[0]))).collect();
        let masses: Vec<Option<&str>> =
            if self.single() { self.names().into_iter().map(Some).collect() } else { vec![None] };
        let of_masses = groups.iter().flat_map(|(group, outer)| {
            masses.iter().map(|mass| self.cases_of_mass(*mass, group, outer, masses.len())).collect::<Vec<_>>()
        });
        let of_joints = groups.iter().flat_map(|(group, outer)| {
            self.pulling().into_iter().map(move |joint| self.cases_of_joint(&joint, group, outer))
        });
        let of_faces = groups.iter().flat_map(|(group, outer)| {
            shares::groups(&self.faces).into_iter().map(move |joints| self.slipping_in_cases(joints, group, outer))
        });
        of_masses.chain(of_joints).chain(of_faces).take(MOST_PANELS).collect()
    }

    /// Of many draws a panel for every mass (or for the largest of them) and for every joint, with their percentiles for each combination of
    /// `vary`.
    fn by_percentiles(&self, stretches: &[Stretch]) -> Vec<Panel> {
        let groups = self.drawing.by_listed(stretches);
        let draws = self.drawing.draws(groups.iter().map(|(_, group)| group.len()).max().unwrap_or(0));
        let some = (groups.len() > SINGLE).then(|| format!("the first {SINGLE} of {} cases", groups.len()));
        let panel = |mut panel: Panel, name: &str, curve: CurveOf<'_>| {
            panel.title = join([name.to_owned(), draws.clone()].into_iter().chain(some.clone()));
            for (colour, (words, group)) in groups.iter().take(SINGLE).enumerate() {
                let curves: Vec<_> = group.iter().map(|stretch| curve(stretch)).collect();
                panel.series.extend(percentiles(&curves, words, colour));
            }
            panel
        };
        let of = |stretch: &Stretch, column: &str| {
            let of = |column: &str, factor: f64| -> Vec<f64> {
                numbers(self.curve, column, stretch.rows.clone()).iter().map(|value| value * factor).collect()
            };
            (of(DRIVE, self.factor.0), of(column, self.factor.1))
        };
        let mut panels = Vec::new();
        if self.single() {
            for (name, _) in &self.shown {
                panels.push(panel(self.panel(String::new()), name, &|stretch| of(stretch, &amplitude_of(name))));
            }
        } else {
            let name = format!("largest of {} masses", self.shown.len());
            panels.push(panel(self.panel(String::new()), &name, &|stretch| {
                let (x, y, _) = self.envelope(stretch);
                (x, y)
            }));
        }
        for (name, joints) in self.pulling() {
            panels.push(panel(self.force_panel(String::new()), &name, &|stretch| self.force_line(stretch, &joints)));
        }
        for (name, joints) in shares::groups(&self.faces) {
            panels.push(panel(self.slip_panel(String::new()), &name, &|stretch| self.slip_line(stretch, &joints)));
        }
        panels.truncate(MOST_PANELS);
        panels
    }

    /// The cases of a group, for one mass of so many panels, or for the largest amplitude of all.
    fn cases_of_mass(&self, mass: Option<&str>, group: &[Stretch], outer: &str, panels: usize) -> Panel {
        let named = mass.filter(|_| panels > 1).map(str::to_owned);
        let thinned_out = match group.len() > MOST_CURVES {
            true => Some(format!("{MOST_CURVES} of {} cases", group.len())),
            false => self.left_out.clone(),
        };
        let mut panel = self.panel(join(named.into_iter().chain([outer.to_owned()]).chain(thinned_out)));
        if mass.is_none() {
            panel.y.quantity = format!("largest amplitude of {} masses", self.shown.len());
        } else if panels == 1 && self.system.places().len() > 1 {
            panel.y.quantity = format!("amplitude of {}", self.shown[0].0);
        }
        panel.series.extend(self.references(&mass.map_or_else(|| self.names(), |mass| vec![mass])));
        for (colour, stretch) in thinned(group, MOST_CURVES).into_iter().enumerate() {
            let (x, y) = match mass {
                Some(name) => self.line(stretch, name),
                None => {
                    let (x, y, _) = self.envelope(stretch);
                    (x, y)
                }
            };
            let line = of_case(stretch, mass.unwrap_or("largest"), x, y, colour);
            let value = line.value;
            panel.series.push(line);
            if let (Some(name), true) = (mass, group.len() <= SINGLE) {
                panel.series.extend(self.marks(stretch, name, colour).map(|marks| Series { value, ..marks }));
            }
        }
        panel
    }

    /// The cases of a group, for the force of one joint, or the largest of several.
    fn cases_of_joint(&self, (joint, all): &(String, Vec<String>), group: &[Stretch], outer: &str) -> Panel {
        let named = Some(joint.clone()).filter(|_| self.joints.len() > 1 || self.system.joints().len() > 1);
        let mut panel = self.force_panel(join(named.into_iter().chain([outer.to_owned()])));
        for (colour, stretch) in thinned(group, MOST_CURVES).into_iter().enumerate() {
            let (x, y) = self.force_line(stretch, all);
            // one curve has a colour of its own, beside those of the masses
            let colour = if stretch.varied.is_empty() { self.system.places().len() } else { colour };
            panel.series.push(of_case(stretch, joint, x, y, colour));
        }
        panel
    }

    /// The cases of a group, for the slip of a joint, or of all.
    fn slipping_in_cases(&self, (name, joints): (String, Vec<String>), group: &[Stretch], outer: &str) -> Panel {
        let mut panel = self.slip_panel(join([name.clone(), outer.to_owned()]));
        for (colour, stretch) in thinned(group, MOST_CURVES).into_iter().enumerate() {
            let (x, y) = self.slip_line(stretch, &joints);
            panel.series.push(of_case(stretch, &name, x, y, colour));
        }
        panel
    }
}

/// The curve of a case among others, called by its last varied parameter, or `alone` where nothing is varied.
fn of_case(stretch: &Stretch, alone: &str, x: Vec<f64>, y: Vec<f64>, colour: usize) -> Series {
    let last = stretch.varied.last();
    let label = last.map_or_else(|| alone.to_owned(), |varied| varied.text.clone());
    Series { value: last.map(|varied| varied.on_axis().0), ..Series::line(label, x, y, colour) }
}

/// The peaks inside the range: case, and mass, frequency (Hz), amplitude (m).
fn peaks_by_case(drawing: &Drawing<'_>) -> Vec<(usize, (String, f64, f64))> {
    let Some(table) = drawing.table(tables::PEAKS) else { return Vec::new() };
    let at_end = table.flags(AT_RANGE_END).unwrap_or_default();
    let masses = words(table, tables::MASS);
    // a table from elsewhere may lack columns
    if masses.len() != table.rows() {
        return Vec::new();
    }
    let mut peaks = Vec::new();
    for stretch in drawing.stretches(table) {
        let (x, y) = (numbers(table, DRIVE, stretch.rows.clone()), numbers(table, AMPLITUDE, stretch.rows.clone()));
        for (i, row) in stretch.rows.clone().enumerate() {
            if at_end.get(row) == Some(&Some(false)) {
                peaks.push((stretch.case, (masses[row].clone(), x[i], y[i])));
            }
        }
    }
    peaks
}
