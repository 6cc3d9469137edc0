//! Backbones: frequency, and damping ratio if it was measured, over the amplitude of a place.
//!
//! The nonlinear mode is computed at amplitudes with equal ratios, and interpolated at those of
//! the rows by cubic Hermite polynomials over the logarithm of the amplitude.

use super::targets::{Fitted, MeasuredRows, Quantity, RowStates, Target, TargetInput};
use crate::case::study::Case;
use crate::case::values::hertz;
use crate::data::ColumnError;
use stickslip::curve::modes::{ModeRequest, nonlinear_mode, unit_amplitude};
use stickslip::dimension::Dimension;

/// Points of the mode per decade of amplitude, and at least.
const PER_DECADE: f64 = 12.0;
const LEAST_POINTS: usize = 9;

/// Rows of a backbone.
#[derive(Debug)]
pub(super) struct Backbone {
    place: String,
    quantity: Quantity,
    mode: usize,
    /// Amplitudes of the quantity, and frequencies that convert them to displacements.
    amplitudes: Vec<f64>,
    omegas: Vec<f64>,
    has_damping: bool,
    measured: MeasuredRows,
}

impl Backbone {
    pub fn new(input: &TargetInput<'_>) -> Result<Self, ColumnError> {
        let amplitudes = input.column("amplitude", input.quantity.dimension())?;
        let omegas = input.column("frequency", Dimension::FREQUENCY)?;
        let damping = input.optional_column("damping", Dimension::NONE)?;
        if let Some(row) =
            amplitudes.iter().zip(&omegas).position(|(amplitude, omega)| !(*amplitude > 0.0 && *omega > 0.0))
        {
            let message = format!("row {} of `{}`: amplitude and frequency must be positive", row + 1, input.data.name);
            return Err(ColumnError { message, help: "remove the row".to_owned() });
        }
        let frequencies = input.deviations(&omegas, Dimension::FREQUENCY)?;
        let dampings = damping.as_ref().map(|damping| input.deviations(damping, Dimension::NONE)).transpose();
        let dampings = dampings.map_err(|_| ColumnError {
            message: "`weight` must be a fraction for a backbone with damping".to_owned(),
            help: "write `relative 1 %`".to_owned(),
        })?;
        let mut measured = Vec::new();
        for (i, amplitude) in amplitudes.iter().enumerate() {
            let deviation = frequencies[i] / std::f64::consts::TAU;
            measured.push(input.measured(i, *amplitude, hertz(omegas[i]), deviation));
            if let (Some(damping), Some(deviations)) = (&damping, &dampings) {
                measured.push(input.measured(i, *amplitude, damping[i], deviations[i]));
            }
        }
        Ok(Backbone {
            place: input.at.to_owned(),
            quantity: input.quantity,
            mode: input.values.count("mode").unwrap_or(1) as usize - 1,
            amplitudes,
            omegas,
            has_damping: damping.is_some(),
            measured: input.measured_rows(measured),
        })
    }
}

impl Target for Backbone {
    fn abscissa(&self) -> &'static str {
        match self.quantity.derivatives {
            0 => "amplitude_m",
            1 => "amplitude_m_per_s",
            _ => "amplitude_m_per_s2",
        }
    }
    fn quantities(&self) -> Vec<String> {
        let frequency = "frequency_Hz".to_owned();
        if self.has_damping { vec![frequency, "damping_ratio".to_owned()] } else { vec![frequency] }
    }
    fn measured(&self) -> &MeasuredRows {
        &self.measured
    }

    fn fitted(&self, case: &Case, _: &RowStates) -> Result<Fitted, String> {
        let system = case.model.assemble().map_err(|error| error.to_string())?;
        let place = system.places().iter().position(|place| *place == self.place);
        let place = place.ok_or_else(|| format!("there is no place `{}`", self.place))?;
        let unit = unit_amplitude(&system, self.mode).map_err(|error| error.to_string())?;
        let unit = unit.ok_or_else(|| "the structure has no such mode".to_owned())?;
        // displacements of the rows, with a margin for a place that moves less than the largest
        let displacement = |i: usize| self.amplitudes[i] / self.omegas[i].powi(self.quantity.derivatives);
        let all = (0..self.amplitudes.len()).map(displacement);
        let (low, high) = all.fold((f64::INFINITY, 0.0f64), |(low, high), x| (low.min(x), high.max(x)));
        let mut range = (0.7 * low * unit, 1.4 * high * unit);
        for _ in 0..2 {
            let decades = (range.1 / range.0).log10();
            let points = LEAST_POINTS.max((PER_DECADE * decades).ceil() as usize);
            let request = ModeRequest { mode: self.mode, range, points, harmonics: HARMONICS, samples: SAMPLES };
            let mode = nonlinear_mode(&system, request).map_err(|error| error.to_string())?;
            if let Some(end) = mode.ended {
                return Err(format!("the nonlinear mode ends: {}", end.reason));
            }
            let mut curve: Vec<[f64; 3]> = mode
                .points
                .iter()
                .map(|point| {
                    let size = point.places[place].norm() * point.omega.powi(self.quantity.derivatives);
                    [size.ln(), hertz(point.omega), point.damping]
                })
                .collect();
            curve.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let (Some(first), Some(last)) = (curve.first(), curve.last()) else { break };
            let (least, most) =
                self.amplitudes.iter().fold((f64::INFINITY, 0.0f64), |(a, b), x| (a.min(*x), b.max(*x)));
            if first[0] <= least.ln() && last[0] >= most.ln() {
                let of = |amplitude: f64, which: usize| hermite(&curve, amplitude.ln(), which);
                let values = self.amplitudes.iter().flat_map(|amplitude| {
                    let damping = self.has_damping.then(|| of(*amplitude, 2));
                    std::iter::once(of(*amplitude, 1)).chain(damping)
                });
                return Ok(Fitted { values: values.collect(), states: Vec::new() });
            }
            // the place moves less than the largest one: widen the range by their ratio
            let reach = |ratio: f64| if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 };
            range.0 *= 0.7 * reach(least / first[0].exp()).min(1.0);
            range.1 *= 1.4 * reach(most / last[0].exp()).max(1.0);
        }
        Err("the nonlinear mode does not reach the measured amplitudes: check their unit and `mode`, or remove the rows with \
             extreme amplitudes"
            .to_owned())
    }
}

/// Harmonics and samples of the mode, as in kind = "modes".
const HARMONICS: usize = 9;
const SAMPLES: usize = 512;

/// Interpolates a curve over its first coordinate.
fn hermite(curve: &[[f64; 3]], x: f64, which: usize) -> f64 {
    let above = curve.partition_point(|point| point[0] < x).clamp(1, curve.len() - 1);
    let (a, b) = (&curve[above - 1], &curve[above]);
    let h = b[0] - a[0];
    if h <= 0.0 {
        return a[which];
    }
    let slope = |at: usize| {
        let (from, to) = (&curve[at.saturating_sub(1)], &curve[(at + 1).min(curve.len() - 1)]);
        let run = to[0] - from[0];
        if run > 0.0 { (to[which] - from[which]) / run } else { 0.0 }
    };
    let t = (x - a[0]) / h;
    let (from, to) = (h * slope(above - 1), h * slope(above));
    let rise = b[which] - a[which];
    a[which] + t * (from + t * (3.0 * rise - 2.0 * from - to + t * (from + to - 2.0 * rise)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_interpolated_exactly_between_inner_points() {
        let curve: Vec<[f64; 3]> = (0..6).map(f64::from).map(|x| [x, x * x, 1.0 - x]).collect();
        assert!((hermite(&curve, 2.3, 1) - 2.3 * 2.3).abs() < 1e-12);
        assert!((hermite(&curve, 2.3, 2) + 1.3).abs() < 1e-12);
    }
}
