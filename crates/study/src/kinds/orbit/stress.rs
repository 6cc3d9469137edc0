//! The table `stress`: the largest stresses of the period, by the matrix of stresses of the
//! structure. A disk has them for every sector, along the axes of the sector.

use crate::case::study::Study;
use crate::case::values::hertz;
use crate::check::size::{SizeInputs, TableShape};
use crate::compile::source_model::StressMatrix;
use crate::kinds::shared::fields::{displacement_field, imposed};
use crate::results::table_builder::TableBuilder;
use crate::run::work::{PreparedCase, UnitResult};
use std::sync::Arc;
use stickslip::model::DisplacementField;
use stickslip::orbit::Orbit;

/// Name of the table.
pub(super) const STRESS: &str = "stress";
/// Instants of the period: the largest value of a sine has an error of 8e-5.
const INSTANTS: usize = 256;

/// Returns the shape of the table for this number of orbits.
pub(super) fn size(inputs: &SizeInputs<'_>, points: f64) -> TableShape {
    let count = of_study(inputs.study).map_or(0, |stress| stress.names.len());
    let sectors = inputs.case.model.ring.map_or(1, |ring| ring.sectors);
    TableShape { rows: points * (count * sectors) as f64, numbers: inputs.varied + 6.0, words: 1.0 }
}

fn of_study(study: &Study) -> Option<&Arc<StressMatrix>> {
    study.structure.matrices.as_ref()?.stress.as_ref()
}

/// The stresses of a case.
pub(super) struct Stresses {
    field: DisplacementField,
    matrix: Arc<StressMatrix>,
}

/// Smallest, largest and summed value of a stress, Pa, and the time of the largest magnitude.
#[derive(Clone, Copy)]
struct StressRange {
    low: f64,
    high: f64,
    sum: f64,
    largest: f64,
    time: f64,
}

impl Stresses {
    /// Prepares the stresses; `None` if the study has no matrix of stresses.
    pub fn new(study: &Study, prepared: &PreparedCase, part: &mut UnitResult) -> Option<Stresses> {
        let matrix = of_study(study)?.clone();
        Some(Stresses { field: displacement_field(prepared, part)?, matrix })
    }

    /// Writes a row for every stress of an orbit.
    pub fn write(&self, prepared: &PreparedCase, orbit: &Orbit, rows: &mut TableBuilder) {
        let none = StressRange { low: f64::INFINITY, high: f64::NEG_INFINITY, sum: 0.0, largest: 0.0, time: 0.0 };
        let mut ranges = vec![none; self.field.sectors() * self.matrix.rows.len()];
        for instant in 0..INSTANTS {
            let time = orbit.period() * instant as f64 / INSTANTS as f64;
            let sample = orbit.sample(time);
            let [imposed, _] = imposed(&prepared.system, orbit.omega, time);
            for sector in 0..self.field.sectors() {
                let displacement = self.field.rows(sector, &sample.displacement, &imposed);
                for (stress, weights) in self.matrix.rows.iter().enumerate() {
                    let value: f64 = weights.iter().map(|(row, weight)| weight * displacement[*row]).sum();
                    let range = &mut ranges[sector * self.matrix.rows.len() + stress];
                    range.low = range.low.min(value);
                    range.high = range.high.max(value);
                    range.sum += value;
                    if value.abs() > range.largest.abs() {
                        (range.largest, range.time) = (value, time);
                    }
                }
            }
        }
        for (index, range) in ranges.iter().enumerate() {
            let (sector, stress) = (index / self.matrix.rows.len(), index % self.matrix.rows.len());
            rows.varied(&prepared.case);
            rows.number("frequency_Hz", hertz(orbit.omega));
            if prepared.case.model.ring.is_some() {
                rows.integer("sector", sector as u64);
            }
            rows.text("stress", &self.matrix.names[stress]);
            rows.number("largest_Pa", range.largest);
            rows.number("time_of_largest_s", range.time);
            rows.number("amplitude_Pa", 0.5 * (range.high - range.low));
            rows.number("mean_Pa", range.sum / INSTANTS as f64);
            rows.end_row();
        }
    }
}
