//! Response curves: amplitude over excitation frequency.
//!
//! - `peaks`: the peaks of a range of a curve;
//! - `references`: the linear references;
//! - `amplification`: amplification of a mistuned disk;
//! - `tables`: names, columns and typed values of the tables;
//! - `figure`: the figure, made of the panels of the next two;
//! - `panels_by_case`, `panels_by_place`: panels per case, and panels per place;
//! - `figure_data`: the data of the figure, read from the tables.

mod amplification;
mod figure;
mod figure_data;
mod panels_by_case;
mod panels_by_place;
mod peaks;
mod references;
mod tables;

pub use tables::{MassCurve, ResponseCurve, curves};

use super::shared::keys::{FREQUENCY, OUTPUT, check_output, no_requirements};
use super::shared::orbit_sweep;
use super::shared::peak_of::{PEAK_OF, check_peak_of};
use crate::case::study::Study;
use crate::case::values::{Frequencies, hertz};
use crate::check::size::{PlannedSize, SizeInputs, TableShape};
use crate::check::survey::SurveyedCase;
use crate::check::warnings::{sampling_warnings, undamped_resonance};
use crate::kinds::info::KindInfo;
use crate::kinds::kind::{Kind, Probe};
use crate::results::columns::{AMPLITUDE, AT_RANGE_END, FREQUENCY as DRIVE, REVERSE_SWEEP, amplitude_in, phase_of};
use crate::results::drawing::{MAX_CURVES, MAX_PANELS};
use crate::results::notes::{Note, WARNING};
use crate::results::table_builder::TableBuilder;
use crate::run::point_row::{PointRow, describe_location};
use crate::run::work::{Computed, NOT_REACHED, PreparedCase, UnitResult, UnitSize, UnitTask};
use crate::syntax::key::{Key, ValueType, default};
use figure_data::MAX_SINGLE_PLACES;
use peaks::{FoundPeak, PeakQuantities};
use references::{REFERENCE_POINTS, references};
use stickslip::curve::adaptive::AdaptiveCurve;
use stickslip::curve::bidirectional_sweep::{self, BidirectionalSweep, OtherOrbit};
use stickslip::curve::peak::{CurvePoint, drop_unused_series};
use stickslip::dimension::Dimension;
use stickslip::method::{MethodError, OrbitError, solver_with_alternatives};
use stickslip::orbit::{Orbit, Seed};

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: tables::NAME,
        summary: "response curves over the excitation frequency, with refined peaks",
        keys: &[
            FREQUENCY,
            default(
                "peaks",
                ValueType::Flag,
                "true",
                "refines every peak of every place between the points of the curve; with `peak_of`, the peaks of the \
                 largest amplitude",
                "false",
            ),
            Key {
                doc: "the places whose largest amplitude has its peaks in peaks.csv, or \"all\"; default: every place \
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
        needs: no_requirements,
        adapts: true,
        tables: &[
            tables::CURVE,
            tables::PEAKS,
            tables::REFERENCES,
            tables::AMPLIFICATION,
            tables::SHAPES,
            tables::REVERSE_SWEEP,
        ],
    },
    // an amplification needs the whole curve
    unit_size: |study| match study.is_adaptive() || study.has_flag(amplification::KEY.name) {
        true => UnitSize::Case,
        false => orbit_sweep::grain(study),
    },
    size,
    warnings: |cases| {
        sampling_warnings(cases)
            .into_iter()
            .chain(undamped_resonance(cases))
            .chain(amplification::tuned_warning(cases))
            .chain(many_peaks_warning(cases))
            .collect()
    },
    probe: Probe::Points { compute, excluded: |study| refines_peaks(study).then_some("the refinement of peaks") },
    compute,
    draw: figure::draw,
};

fn size(inputs: &SizeInputs<'_>) -> PlannedSize {
    let (points, values) = (inputs.points(), &inputs.case.values);
    let refines = values.flag("peaks") != Some(false) && inputs.frequencies > 2.0;
    let peaks = match values.names("peak_of") {
        _ if !refines => 0.0,
        Some(_) => inputs.cases,
        // Peaks per mass, as some have two.
        None => (inputs.cases * inputs.places * 1.3).floor(),
    };
    // cases that differ only in their limits share the references
    let others = references::distinct_cases(inputs.study);
    let linear = (inputs.frequencies * REFERENCE_POINTS as f64 * others).floor();
    let tuned = if values.flag(amplification::KEY.name) == Some(true) { inputs.cases } else { 0.0 };
    let shapes = match inputs.case.model.ring {
        // Peaks of the largest amplitude of a disk: about three for twelve blades that differ by
        // 2 %.
        Some(_) if values.names("peak_of").is_none() => peaks.min(3.0 * inputs.cases),
        Some(_) => peaks,
        None => 0.0,
    };
    let reverse_points = if bidirectional_sweep::is_followed(inputs.system()) { points } else { 0.0 };
    let curves = inputs.cases.min(MAX_CURVES as f64) * inputs.places.min(MAX_PANELS as f64 + MAX_SINGLE_PLACES as f64);
    PlannedSize {
        tables: vec![
            inputs.orbits(points),
            TableShape { rows: peaks, numbers: inputs.varied + 3.0, words: 1.0 },
            TableShape { rows: linear, numbers: inputs.varied + 1.0 + 2.0 * inputs.places, words: 0.0 },
            TableShape { rows: tuned, numbers: inputs.varied + 5.0, words: 1.0 },
            TableShape { rows: shapes, numbers: inputs.varied + 1.0 + 2.0 * inputs.places, words: 0.0 },
            // Share of the points of a curve at which the reverse sweep has another orbit.
            inputs.orbits((0.2 * reverse_points).floor()),
        ],
        drawn: curves * inputs.frequencies,
        unit: inputs.orbit_bytes(),
    }
}

/// Returns whether the study requests peaks.
fn refines_peaks(study: &Study) -> bool {
    study.case(0).is_ok_and(|case| case.values.flag("peaks") != Some(false))
}

/// Warns of the cost of refining the peaks of thousands of places, and states the alternatives.
fn many_peaks_warning(cases: &[SurveyedCase]) -> Option<String> {
    let one = cases.first()?;
    let (values, places) = (&one.case.values, one.survey.system().places().len());
    let refines = values.flag("peaks") != Some(false) && values.names("peak_of").is_none();
    // Number of places from which the warning is given. A disk of many blades needs all peaks;
    // the nodes of a contact rarely do.
    (refines && places >= 1000).then(|| {
        format!(
            "the peaks of {places} places are refined one by one, with about six orbits each; \
             peak_of = \"all\" in [study] refines only the largest amplitude, and peaks = false refines none"
        )
    })
}

fn compute(work: &UnitTask<'_>) -> Computed {
    let prepared = work.case();
    let case = &prepared.case;
    let mut builder = ResponseBuilder::new(prepared);
    let found = match &case.frequencies {
        Some(Frequencies::Adaptive { from, to, tolerance }) => {
            let adaptive = AdaptiveCurve { range: (*from, *to), tolerance: *tolerance };
            sweep_adaptive(work, adaptive, &mut builder)
        }
        _ => sweep_given(work, &mut builder),
    };
    let (points, others) = found.map_err(|error| (case.index, error))?;
    let mut part = builder.part;
    let total = part.points.values().sum::<u64>() as usize;
    part.notes.push(Note::Stuck { case: case.label(), points: builder.stuck, total });
    part.tables = vec![builder.rows];
    let (mut amplified, mut shapes) = (TableBuilder::default(), TableBuilder::default());
    if !points.is_empty() && !work.context.stopped() {
        let mut peaks = TableBuilder::default();
        let all = peaks::all(work, points, &others).map_err(|error| (case.index, error))?;
        for found in &all {
            if let Some(why) = found.peak.unresolved {
                let location = || {
                    format!(
                        "peak of {}, {}",
                        prepared.system.places()[found.mass],
                        describe_location(case, found.peak.omega)
                    )
                };
                part.count(location, "peak-unsettled", Some(why.to_string()));
            }
            peaks.varied(case);
            peaks.text(tables::MASS, &prepared.system.places()[found.mass]);
            peaks.number(DRIVE, hertz(found.peak.omega));
            peaks.number(AMPLITUDE, found.peak.value);
            peaks.flag(AT_RANGE_END, Some(found.peak.at_end));
            if bidirectional_sweep::is_followed(&prepared.system) {
                peaks.flag(REVERSE_SWEEP, Some(found.reverse_sweep));
            }
            peaks.reduction_error(prepared.system.reduction_evidence());
            peaks.end_row();
        }
        part.tables.push(peaks);
        all.iter()
            .filter(|found| found.is_largest(&prepared.system))
            .for_each(|found| shape(prepared, found, &mut shapes));
        if work.study.has_flag(amplification::KEY.name)
            && let Err(why) = amplification::row(work, &all, &mut amplified)
        {
            part.notes.push(Note::for_case(&case.label(), format!("{WARNING}no amplification: {why}.")));
        }
    } else {
        part.tables.push(TableBuilder::default());
    }
    if work.study.wants_references() && !references::equal_previous(work.study, case) {
        let (rows, absent) = references(work, &builder.omegas);
        part.tables.push(rows);
        part.notes.extend(absent.into_iter().map(Note::Sentence));
    } else {
        part.tables.push(TableBuilder::default());
    }
    part.tables.extend([amplified, shapes, builder.reverse_sweep]);
    Ok(part)
}

/// Writes the row of an orbit.
fn orbit_row(prepared: &PreparedCase, omega: f64, summary: &PointRow, rows: &mut TableBuilder) {
    rows.varied(&prepared.case);
    rows.number(DRIVE, hertz(omega));
    summary.write(prepared, rows);
    rows.end_row();
}

/// Writes the row of a peak of a disk, with every place.
fn shape(prepared: &PreparedCase, found: &FoundPeak, rows: &mut TableBuilder) {
    rows.varied(&prepared.case);
    rows.number(DRIVE, hertz(found.peak.omega));
    let places = prepared.system.places().iter().zip(prepared.system.place_axes());
    for ((place, along), of) in places.zip(found.shape.chunks_exact(2)) {
        rows.number(&amplitude_in(place, along.unit()), of[0]);
        rows.number(&phase_of(place), of[1]);
    }
    rows.reduction_error(prepared.system.reduction_evidence());
    rows.end_row();
}

/// The state of a range of points during its computation.
struct ResponseBuilder<'a> {
    prepared: &'a PreparedCase,
    part: UnitResult,
    rows: TableBuilder,
    /// Rows of the reverse sweep.
    reverse_sweep: TableBuilder,
    omegas: Vec<f64>,
    stuck: usize,
}

impl<'a> ResponseBuilder<'a> {
    fn new(prepared: &'a PreparedCase) -> Self {
        ResponseBuilder {
            prepared,
            part: UnitResult::default(),
            rows: TableBuilder::default(),
            reverse_sweep: TableBuilder::default(),
            omegas: Vec::new(),
            stuck: 0,
        }
    }

    /// Adds a point; `None` if the run was stopped before.
    fn add(&mut self, omega: f64, point: Option<(PointRow, Vec<Note>)>) {
        let case = &self.prepared.case;
        let Some((summary, notes)) = point else {
            return self.part.count(|| describe_location(case, omega), NOT_REACHED, None);
        };
        self.part.count(|| describe_location(case, omega), &summary.status, summary.failure.clone());
        self.stuck += usize::from(summary.stuck);
        notes.into_iter().for_each(|note| note.merge_into(&mut self.part.notes));
        self.omegas.push(omega);
        orbit_row(self.prepared, omega, &summary, &mut self.rows);
    }

    /// Adds the other orbits that the reverse sweep finds, and returns them as points for the
    /// peak search.
    fn compare(
        &mut self,
        work: &UnitTask<'_>,
        ways: Option<BidirectionalSweep>,
    ) -> Result<Vec<CurvePoint>, MethodError> {
        let Some(ways) = ways else { return Ok(Vec::new()) };
        let (prepared, sought) = (self.prepared, PeakQuantities::new(self.prepared));
        let others = ways.reverse_sweep(&*prepared.method, &prepared.system, &work.context.stop)?;
        let points = others.iter().map(|OtherOrbit { orbit, ratio }| {
            let note = Note::OtherOrbit { points: 1, from: orbit.omega, to: orbit.omega, ratios: [*ratio; 2] };
            note.merge_into(&mut self.part.notes);
            orbit_row(prepared, orbit.omega, &PointRow::new(prepared, Ok(orbit)), &mut self.reverse_sweep);
            CurvePoint::new(orbit, &|orbit| sought.quantities(orbit))
        });
        Ok(points.collect())
    }
}

/// Returns the row and the notes of a point.
fn summary_and_notes(prepared: &PreparedCase, outcome: Result<&Orbit, &OrbitError>) -> (PointRow, Vec<Note>) {
    let summary = PointRow::new(prepared, outcome);
    let notes =
        outcome.map_or_else(|_| Vec::new(), |orbit| Note::for_orbit(&prepared.case.model, orbit, summary.stable));
    (summary, notes)
}

/// The points for the peak search, if requested, and the other points of the reverse sweep.
type SweepPoints = (Vec<CurvePoint>, Vec<CurvePoint>);

/// Computes the points at the frequencies of the unit.
fn sweep_given(work: &UnitTask<'_>, builder: &mut ResponseBuilder<'_>) -> Result<SweepPoints, MethodError> {
    let prepared = work.case();
    let wanted = wants_peaks(work);
    let sought = PeakQuantities::new(prepared);
    let point = |orbit: &Orbit| CurvePoint::new(orbit, &|orbit| sought.quantities(orbit));
    let mut points = Vec::new();
    let mut ways = BidirectionalSweep::for_system(&prepared.system);
    orbit_sweep::sweep(work, &mut |omega, outcome| {
        builder.add(omega, outcome.map(|outcome| summary_and_notes(prepared, outcome)));
        ways.iter_mut().zip(outcome).for_each(|(ways, outcome)| ways.add(omega, outcome));
        if let Some(outcome) = outcome.filter(|_| wanted) {
            points.push(outcome.map_or_else(|_| CurvePoint::failed(omega), point));
            drop_unused_series(&mut points);
        }
    })?;
    let others = builder.compare(work, ways)?;
    if !wanted || points.is_empty() || work.context.stopped() {
        return Ok((Vec::new(), others));
    }
    // the peak search needs the points of the adjacent units on both sides; each unit computes
    // them again
    let count = prepared.case.frequencies.as_ref().map_or(0, |f| f.len());
    let mut solver = solver_with_alternatives(&*prepared.method, &prepared.system)?;
    let mut near = |index: usize, seed: Option<&Seed>| match solver.orbit_near(work.omega(index), seed) {
        Ok(orbit) => point(&orbit),
        Err(_) => CurvePoint::failed(work.omega(index)),
    };
    if work.points.start > 0 {
        let before = near(work.points.start - 1, points[0].seed.as_ref());
        points.insert(0, before);
    }
    if work.points.end < count {
        let after = near(work.points.end, points[points.len() - 1].seed.as_ref());
        points.push(after);
    }
    Ok((points, others))
}

/// Computes the points of a curve with adaptive frequencies.
fn sweep_adaptive(
    work: &UnitTask<'_>,
    adaptive: AdaptiveCurve,
    builder: &mut ResponseBuilder<'_>,
) -> Result<SweepPoints, MethodError> {
    let prepared = work.case();
    let sought = PeakQuantities::new(prepared);
    // the shape does not influence the frequencies
    let quantities = |orbit: &Orbit| sought.amplitudes(orbit);
    let keep = |outcome: Result<&Orbit, &OrbitError>| {
        (work.context.finished)();
        (summary_and_notes(prepared, outcome), outcome.map_or_else(|_| Vec::new(), |orbit| sought.shape(orbit)))
    };
    let stop = || work.context.stopped();
    let curve = adaptive.curve(&*prepared.method, &prepared.system, &quantities, &keep, &stop)?;
    if work.context.stopped() {
        builder.add(adaptive.range.1, None);
    }
    let mut points = Vec::with_capacity(curve.len());
    let mut ways = BidirectionalSweep::for_system(&prepared.system);
    for (mut point, (kept, shape)) in curve {
        if let Some(ways) = &mut ways {
            let places = kept.0.places.iter().zip(prepared.system.place_axes());
            let amplitudes = places.map(|([amplitude, ..], along)| amplitude * along.length_scale());
            ways.add_point(CurvePoint { values: amplitudes.filter(|a| a.is_finite()).collect(), ..point.clone() });
        }
        builder.add(point.omega, Some(kept));
        point.values.extend(shape);
        points.push(point);
    }
    let others = builder.compare(work, ways)?;
    Ok((if prepared.case.values.flag("peaks").unwrap_or(true) { points } else { Vec::new() }, others))
}

/// Returns true if peaks are requested and the frequencies can have an inner peak.
fn wants_peaks(work: &UnitTask<'_>) -> bool {
    let case = &work.case().case;
    let rising = |f: &Frequencies| f.len() > 2 && f.is_rising();
    case.values.flag("peaks").unwrap_or(true) && case.frequencies.as_ref().is_some_and(rising)
}
