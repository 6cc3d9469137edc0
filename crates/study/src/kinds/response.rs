//! Response curves: amplitude over excitation frequency.

mod amplification;
mod by_case;
mod by_mass;
mod drawn;
mod figure;
mod peaks;
mod references;
mod tables;

pub use tables::{Curve, MassCurve, curves};

use super::keys::{FREQUENCY, OUTPUT, anything, check_output};
use super::orbits;
use super::peak_of::{PEAK_OF, check_peak_of};
use crate::columns::{AMPLITUDE, AT_RANGE_END, FREQUENCY as DRIVE, WAY_BACK, amplitude_in, phase_of};
use crate::cost::{Cost, Costing, Shape};
use crate::drawing::{MOST_CURVES, MOST_PANELS};
use crate::info::KindInfo;
use crate::key::{Key, Takes, default};
use crate::kind::Kind;
use crate::note::{Note, WARNING};
use crate::point::{Summary, location_of};
use crate::rows::Rows;
use crate::survey::Surveyed;
use crate::values::{Frequencies, hertz};
use crate::warnings::{sampled, undamped};
use crate::work::{Computed, Grain, NOT_REACHED, Part, Prepared, Work};
use drawn::SINGLE;
use peaks::{Found, Sought};
use references::{REFERENCE_POINTS, references};
use stickslip::curve::adaptive::AdaptiveCurve;
use stickslip::curve::bidirectional_sweep::{self, BidirectionalSweep, OtherOrbit};
use stickslip::curve::peak::CurvePoint;
use stickslip::dimension::Dimension;
use stickslip::method::{MethodError, OrbitError, advised};
use stickslip::orbit::Orbit;

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: tables::NAME,
        summary: "response curves over the excitation frequency, with refined peaks",
        keys: &[
            FREQUENCY,
            default(
                "peaks",
                Takes::Flag,
                "true",
                "refines every peak of every mass between the points of the curve; with `peak_of`, the peaks of the \
                 largest amplitude",
                "false",
            ),
            Key {
                doc: "the masses whose largest amplitude has its peaks in peaks.csv, or \"all\"; default: every mass \
                    separately",
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
        tables: &[
            tables::CURVE,
            tables::PEAKS,
            tables::REFERENCES,
            tables::AMPLIFICATION,
            tables::SHAPES,
            tables::WAY_BACK,
        ],
    },
    // an amplification needs the whole curve
    grain: |study| match study.is_adaptive() || study.wants(amplification::KEY.name) {
        true => Grain::Case,
        false => orbits::grain(study),
    },
    cost,
    warnings: |cases| {
        sampled(cases)
            .into_iter()
            .chain(undamped(cases))
            .chain(amplification::none(cases))
            .chain(many_peaks(cases))
            .collect()
    },
    compute,
    draw: figure::draw,
};

/// Peaks per mass, as some have two; and orbits that refine a peak, including those at a unit
/// border that two units compute.
const PEAKS: f64 = 1.3;
const REFINING: f64 = 6.0;
/// Peaks of the largest amplitude of a disk: about three for twelve blades that differ by 2 %.
const LEADING: f64 = 3.0;
/// Share of the points of a curve at which the reverse sweep has another orbit.
const OTHERS: f64 = 0.2;

fn cost(costing: &Costing<'_>) -> Cost {
    let (points, values) = (costing.points(), &costing.case.values);
    let sought = values.flag("peaks") != Some(false) && costing.frequencies > 2.0;
    let peaks = match values.names("peak_of") {
        _ if !sought => 0.0,
        Some(_) => costing.cases,
        None => (costing.cases * costing.places * PEAKS).floor(),
    };
    // a place whose peak is at an end of the range is not refined; a structure given by
    // matrices has all its resonances in the range refined
    let refined = match (costing.resonances(), &costing.case.model.substructure) {
        (Some(resonances), Some(_)) if costing.case.model.ring.is_none() => peaks / PEAKS * resonances,
        (Some(resonances), _) => peaks / PEAKS * resonances.min(PEAKS),
        (None, _) => peaks,
    };
    // cases that differ only in their limits share the references
    let others = references::others(costing.study);
    let linear = (costing.frequencies * REFERENCE_POINTS as f64 * others).floor();
    // a tuned disk takes the time of one sector, at the frequencies of the mistuned disk
    let tuned = if values.flag(amplification::KEY.name) == Some(true) { costing.cases } else { 0.0 };
    let shapes = match costing.case.model.ring {
        Some(_) if values.names("peak_of").is_none() => peaks.min(LEADING * costing.cases),
        Some(_) => peaks,
        None => 0.0,
    };
    let back = if bidirectional_sweep::is_followed(costing.system()) { points } else { 0.0 };
    let curves = costing.cases.min(MOST_CURVES as f64) * costing.places.min(MOST_PANELS as f64 + SINGLE as f64);
    Cost {
        tables: vec![
            costing.orbits(points),
            Shape { rows: peaks, numbers: costing.varied + 3.0, words: 1.0 },
            Shape { rows: linear, numbers: costing.varied + 1.0 + 2.0 * costing.places, words: 0.0 },
            Shape { rows: tuned, numbers: costing.varied + 5.0, words: 1.0 },
            Shape { rows: shapes, numbers: costing.varied + 1.0 + 2.0 * costing.places, words: 0.0 },
            costing.orbits((OTHERS * back).floor()),
        ],
        drawn: curves * costing.frequencies,
        unit: costing.orbit_bytes(),
        spared: None,
        work: points * costing.extra()
            + (points + OTHERS * back + tuned * costing.frequencies) * costing.orbit()
            + (back + REFINING * refined) * costing.between()
            + 2.0 * linear * costing.reference(),
    }
}

/// Warns of the cost of refining the peaks of thousands of places, and states the alternatives.
fn many_peaks(cases: &[Surveyed]) -> Option<String> {
    let one = cases.first()?;
    let (values, places) = (&one.case.values, one.survey.system().places().len());
    let sought = values.flag("peaks") != Some(false) && values.names("peak_of").is_none();
    (sought && places >= MANY_PEAKS).then(|| {
        format!(
            "the peaks of {places} places are refined one by one, with about {REFINING:.0} orbits each; \
             peak_of = \"all\" in [study] refines only the largest amplitude, and peaks = false refines none"
        )
    })
}

/// Number of places from which the warning is given. A disk of many blades needs all peaks; the
/// nodes of a contact rarely do.
const MANY_PEAKS: usize = 1000;

fn compute(work: &Work<'_>) -> Computed {
    let prepared = work.case();
    let case = &prepared.case;
    let mut stretch = Computing::new(prepared);
    let found = match &case.frequencies {
        Some(Frequencies::Adaptive { from, to, tolerance }) => {
            let adaptive = AdaptiveCurve { range: (*from, *to), tolerance: *tolerance };
            adaptively(work, adaptive, &mut stretch)
        }
        _ => evenly(work, &mut stretch),
    };
    let (points, others) = found.map_err(|error| (case.index, error))?;
    let mut part = stretch.part;
    let of = part.points.values().sum::<u64>() as usize;
    part.notes.push(Note::Stuck { case: case.label(), points: stretch.stuck, of });
    part.tables = vec![stretch.rows];
    let (mut amplified, mut shapes) = (Rows::default(), Rows::default());
    if !points.is_empty() && !work.context.stopped() {
        let mut peaks = Rows::default();
        let all = peaks::all(work, points, &others).map_err(|error| (case.index, error))?;
        for found in &all {
            if let Some(why) = found.peak.unresolved {
                let at = || {
                    format!("peak of {}, {}", prepared.system.places()[found.mass], location_of(case, found.peak.omega))
                };
                part.count(at, "peak-unsettled", Some(why.to_string()));
            }
            peaks.varied(case);
            peaks.text(tables::MASS, &prepared.system.places()[found.mass]);
            peaks.number(DRIVE, hertz(found.peak.omega));
            peaks.number(AMPLITUDE, found.peak.value);
            peaks.flag(AT_RANGE_END, Some(found.peak.at_end));
            if bidirectional_sweep::is_followed(&prepared.system) {
                peaks.flag(WAY_BACK, Some(found.way_back));
            }
            peaks.reduced(prepared.system.reduction_evidence());
            peaks.end();
        }
        part.tables.push(peaks);
        all.iter().filter(|found| found.leads(&prepared.system)).for_each(|found| shape(prepared, found, &mut shapes));
        if work.study.wants(amplification::KEY.name)
            && let Err(why) = amplification::row(work, &all, &mut amplified)
        {
            part.notes.push(Note::of_case(&case.label(), format!("{WARNING}no amplification: {why}.")));
        }
    } else {
        part.tables.push(Rows::default());
    }
    if work.study.wants_references() && !references::are_known(work.study, case) {
        let (rows, absent) = references(work, &stretch.omegas);
        part.tables.push(rows);
        part.notes.extend(absent.into_iter().map(Note::Said));
    } else {
        part.tables.push(Rows::default());
    }
    part.tables.extend([amplified, shapes, stretch.way_back]);
    Ok(part)
}

/// Writes the row of an orbit.
fn orbit_row(prepared: &Prepared, omega: f64, summary: &Summary, rows: &mut Rows) {
    rows.varied(&prepared.case);
    rows.number(DRIVE, hertz(omega));
    summary.write(prepared, rows);
    rows.end();
}

/// Writes the row of a peak of a disk, with every place.
fn shape(prepared: &Prepared, found: &Found, rows: &mut Rows) {
    rows.varied(&prepared.case);
    rows.number(DRIVE, hertz(found.peak.omega));
    let places = prepared.system.places().iter().zip(prepared.system.place_axes());
    for ((place, along), of) in places.zip(found.shape.chunks_exact(2)) {
        rows.number(&amplitude_in(place, along.unit()), of[0]);
        rows.number(&phase_of(place), of[1]);
    }
    rows.reduced(prepared.system.reduction_evidence());
    rows.end();
}

/// The state of a range of points during its computation.
struct Computing<'a> {
    prepared: &'a Prepared,
    part: Part,
    rows: Rows,
    /// Rows of the reverse sweep.
    way_back: Rows,
    omegas: Vec<f64>,
    stuck: usize,
}

impl<'a> Computing<'a> {
    fn new(prepared: &'a Prepared) -> Self {
        Computing {
            prepared,
            part: Part::default(),
            rows: Rows::default(),
            way_back: Rows::default(),
            omegas: Vec::new(),
            stuck: 0,
        }
    }

    /// Adds a point; `None` if the run was stopped before.
    fn add(&mut self, omega: f64, point: Option<(Summary, Vec<Note>)>) {
        let case = &self.prepared.case;
        let Some((summary, notes)) = point else {
            return self.part.count(|| location_of(case, omega), NOT_REACHED, None);
        };
        self.part.count(|| location_of(case, omega), &summary.status, summary.failure.clone());
        self.stuck += usize::from(summary.stuck);
        notes.into_iter().for_each(|note| note.join(&mut self.part.notes));
        self.omegas.push(omega);
        orbit_row(self.prepared, omega, &summary, &mut self.rows);
    }

    /// Adds the other orbits that the reverse sweep finds, and returns them as points for the
    /// peak search.
    fn compare(&mut self, work: &Work<'_>, ways: Option<BidirectionalSweep>) -> Result<Vec<CurvePoint>, MethodError> {
        let Some(ways) = ways else { return Ok(Vec::new()) };
        let (prepared, sought) = (self.prepared, Sought::new(self.prepared));
        let others = ways.reverse_sweep(&*prepared.method, &prepared.system, &work.context.stop)?;
        let points = others.iter().map(|OtherOrbit { orbit, ratio }| {
            let note = Note::OtherOrbit { points: 1, from: orbit.omega, to: orbit.omega, ratios: [*ratio; 2] };
            note.join(&mut self.part.notes);
            orbit_row(prepared, orbit.omega, &Summary::new(prepared, Ok(orbit)), &mut self.way_back);
            CurvePoint::new(orbit, &|orbit| sought.quantities(orbit))
        });
        Ok(points.collect())
    }
}

/// Returns the row and the notes of a point.
fn kept(prepared: &Prepared, outcome: Result<&Orbit, &OrbitError>) -> (Summary, Vec<Note>) {
    let summary = Summary::new(prepared, outcome);
    let notes =
        outcome.map_or_else(|_| Vec::new(), |orbit| Note::of_orbit(&prepared.case.model, orbit, summary.stable));
    (summary, notes)
}

/// The points for the peak search, if requested, and the other points of the reverse sweep.
type Followed = (Vec<CurvePoint>, Vec<CurvePoint>);

/// Computes the points at the frequencies of the unit.
fn evenly(work: &Work<'_>, stretch: &mut Computing<'_>) -> Result<Followed, MethodError> {
    let prepared = work.case();
    let wanted = wants_peaks(work);
    let sought = Sought::new(prepared);
    let point = |orbit: &Orbit| CurvePoint::new(orbit, &|orbit| sought.quantities(orbit));
    let mut points = Vec::new();
    let mut ways = BidirectionalSweep::for_system(&prepared.system);
    orbits::sweep(work, &mut |omega, outcome| {
        stretch.add(omega, outcome.map(|outcome| kept(prepared, outcome)));
        ways.iter_mut().zip(outcome).for_each(|(ways, outcome)| ways.add(omega, outcome));
        if let Some(outcome) = outcome.filter(|_| wanted) {
            points.push(outcome.map_or_else(|_| CurvePoint::failed(omega), point));
        }
    })?;
    let others = stretch.compare(work, ways)?;
    if !wanted || points.is_empty() {
        return Ok((Vec::new(), others));
    }
    // the peak search needs the points of the adjacent units on both sides; each unit computes
    // them again
    let count = prepared.case.frequencies.as_ref().map_or(0, |f| f.len());
    let mut solver = advised(&*prepared.method, &prepared.system)?;
    let mut near = |index: usize, start: Option<&[f64]>| match solver.orbit(work.omega(index), start) {
        Ok(orbit) => point(&orbit),
        Err(_) => CurvePoint::failed(work.omega(index)),
    };
    if work.points.start > 0 {
        let before = near(work.points.start - 1, points[0].start.as_deref());
        points.insert(0, before);
    }
    if work.points.end < count {
        let after = near(work.points.end, points[points.len() - 1].start.as_deref());
        points.push(after);
    }
    Ok((points, others))
}

/// Computes the points of a curve with adaptive frequencies.
fn adaptively(work: &Work<'_>, adaptive: AdaptiveCurve, stretch: &mut Computing<'_>) -> Result<Followed, MethodError> {
    let prepared = work.case();
    let sought = Sought::new(prepared);
    // the shape does not influence the frequencies
    let quantities = |orbit: &Orbit| sought.amplitudes(orbit);
    let keep = |outcome: Result<&Orbit, &OrbitError>| {
        (work.context.finished)();
        (kept(prepared, outcome), outcome.map_or_else(|_| Vec::new(), |orbit| sought.shape(orbit)))
    };
    let stop = || work.context.stopped();
    let curve = adaptive.curve(&*prepared.method, &prepared.system, &quantities, &keep, &stop)?;
    if work.context.stopped() {
        stretch.add(adaptive.range.1, None);
    }
    let mut points = Vec::with_capacity(curve.len());
    let mut ways = BidirectionalSweep::for_system(&prepared.system);
    for (mut point, (kept, shape)) in curve {
        if let Some(ways) = &mut ways {
            let places = kept.0.places.iter().zip(prepared.system.place_axes());
            let amplitudes = places.map(|([amplitude, ..], along)| amplitude * along.length_scale());
            ways.add_point(CurvePoint { values: amplitudes.filter(|a| a.is_finite()).collect(), ..point.clone() });
        }
        stretch.add(point.omega, Some(kept));
        point.values.extend(shape);
        points.push(point);
    }
    let others = stretch.compare(work, ways)?;
    Ok((if prepared.case.values.flag("peaks").unwrap_or(true) { points } else { Vec::new() }, others))
}

/// Returns true if peaks are requested and the frequencies can have an inner peak.
fn wants_peaks(work: &Work<'_>) -> bool {
    let case = &work.case().case;
    let rising = |f: &Frequencies| f.len() > 2 && f.is_rising();
    case.values.flag("peaks").unwrap_or(true) && case.frequencies.as_ref().is_some_and(rising)
}
