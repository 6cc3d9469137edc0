//! The table `stress`, by the matrix of stresses of the structure: the largest stresses of the
//! period of an orbit, or the amplitudes of the stresses of a mode.
//!
//! A disk has them for every sector, along the axes of the sector.

use super::fields::{displacement_field, imposed};
use crate::case::study::Study;
use crate::case::values::hertz;
use crate::check::size::{SizeInputs, TableShape};
use crate::compile::source_model::StressMatrix;
use crate::results::table_builder::TableBuilder;
use crate::run::work::{PreparedCase, UnitResult};
use num_complex::Complex64;
use std::sync::Arc;
use stickslip::model::DisplacementField;
use stickslip::orbit::Orbit;

/// Name of the table.
pub(in crate::kinds) const STRESS: &str = "stress";
/// Instants of the period: the largest value of a sine has an error of 8e-5.
const INSTANTS: usize = 256;

/// Returns the shape of the table for this number of orbits or modes, each with the stresses of
/// this number of sectors.
pub(in crate::kinds) fn size(inputs: &SizeInputs<'_>, motions: f64, sectors: usize) -> TableShape {
    let count = of_study(inputs.study).map_or(0, |stress| stress.names.len());
    TableShape { rows: motions * (count * sectors) as f64, numbers: inputs.varied + 6.0, words: 2.0 }
}

fn of_study(study: &Study) -> Option<&Arc<StressMatrix>> {
    study.structure.matrices.as_ref()?.stress.as_ref()
}

/// The stresses of a case.
pub(in crate::kinds) struct Stresses {
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
    pub fn write_orbit(&self, prepared: &PreparedCase, orbit: &Orbit, rows: &mut TableBuilder) {
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

    /// Writes a row for every stress of a harmonic motion of all degrees of freedom: its amplitude
    /// in the column `amplitude`, and its phase. `head` writes the columns that name the motion
    /// and the sector.
    pub fn write_harmonic(
        &self,
        prepared: &PreparedCase,
        (sector, motion): (usize, &[Complex64]),
        amplitude: &str,
        head: &dyn Fn(&mut TableBuilder),
        rows: &mut TableBuilder,
    ) {
        let at_rest = vec![0.0; prepared.system.moved_places().len()];
        let part = |of: fn(&Complex64) -> f64| {
            let values: Vec<f64> = motion.iter().map(of).collect();
            self.field.rows(sector, &values, &at_rest)
        };
        let (real, imaginary) = (part(|x| x.re), part(|x| x.im));
        for (name, weights) in self.matrix.names.iter().zip(&self.matrix.rows) {
            let stress: Complex64 =
                weights.iter().map(|(row, weight)| Complex64::new(real[*row], imaginary[*row]) * *weight).sum();
            rows.varied(&prepared.case);
            head(rows);
            rows.text("stress", name);
            rows.number(amplitude, stress.norm());
            rows.number("phase_deg", stress.arg().to_degrees());
            rows.end_row();
        }
    }
}
