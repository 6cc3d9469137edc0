//! Maps: the resonance peak over two parameters.
//!
//! - `figure`: the heat map with contours;
//! - `contours`: the contour lines of values on a grid.

mod contours;
mod figure;

use super::shared::keys::{FREQUENCY, no_requirements};
use super::shared::orbit_sweep;
use super::shared::peak_of::{PEAK_OF, moving_amplitudes, peak_places};
use super::shared::peak_search;
use crate::check::size::{PlannedSize, SizeInputs, TableShape};
use crate::check::warnings::sampling_warnings;
use crate::kinds::info::KindInfo;
use crate::kinds::kind::{Kind, Probe};
use crate::results::notes::Note;
use crate::results::table_builder::TableBuilder;
use crate::run::work::{Computed, UnitResult, UnitSize, UnitTask};
use crate::syntax::key::{ValueType, required};
use stickslip::curve::performance::{Performance, PerformanceError};
use stickslip::curve::sweep::Watch;
use stickslip::dimension::Dimension;
use stickslip::model::System;

/// Name of the kind and of its table.
const MAP: &str = "map";

pub(super) const KIND: Kind = Kind {
    info: KindInfo {
        name: MAP,
        summary: "the resonance peak over two design parameters, as a heat map with contours",
        keys: &[
            FREQUENCY,
            required(
                "over",
                ValueType::Over,
                "the two parameters and their ranges; the first one is the horizontal axis",
                "{ Ft = { from = \"1 N\", to = \"20 N\", points = 25 }, k = { from = \"1e3 N/m\", to = \"1e5 N/m\", \
                 points = 25, scale = \"log\" } }",
            ),
            PEAK_OF,
        ],
        check: peak_search::check,
        axes: [None, Some(Dimension::LENGTH)],
        uses_method: true,
        needs: no_requirements,
        adapts: false,
        tables: &[MAP],
    },
    unit_size: |_| UnitSize::Case,
    size,
    warnings: sampling_warnings,
    probe: Probe::Points { compute: orbit_sweep::probe, excluded: |_| Some("the refinement of peaks") },
    compute,
    draw: figure::draw,
};

fn size(inputs: &SizeInputs<'_>) -> PlannedSize {
    PlannedSize {
        tables: vec![TableShape { rows: inputs.cases, numbers: inputs.varied + 4.0, words: 1.0 }],
        drawn: inputs.cases,
        unit: inputs.orbit_bytes(),
    }
}

/// Computes the peak of one cell.
fn compute(work: &UnitTask<'_>) -> Computed {
    let (mut part, mut rows) = (UnitResult::default(), TableBuilder::default());
    let prepared = work.case();
    let places = peak_places(prepared);
    let build = |_: f64| Ok::<System, std::convert::Infallible>(prepared.system.clone());
    let search = Performance {
        system: &build,
        method: &*prepared.method,
        range: peak_search::range(work),
        points: work.points.len(),
        quantities: &|orbit| moving_amplitudes(&prepared.system, orbit, &places),
        watch: Watch { finished: &*work.context.finished, stop: &work.context.stop },
    };
    let row = match search.peak(0.0) {
        Ok(row) => row,
        Err(PerformanceError::Method(error)) => return Err((prepared.case.index, error)),
        Err(PerformanceError::System { cause, .. }) => match cause {},
    };
    if work.context.stopped() {
        return Ok(UnitResult::not_reached(work.points.len()));
    }
    peak_search::count(prepared, &row, &mut part);
    peak_search::write(prepared, &row, &mut rows);
    if prepared.case.index == 0 && work.study.value_counts().iter().rev().take(2).any(|(count, _)| *count < 2) {
        let text = "A parameter of `over` has only one value, so there is no heat map.";
        part.notes.push(Note::Sentence(text.to_owned()));
    }
    part.tables = vec![rows];
    Ok(part)
}
