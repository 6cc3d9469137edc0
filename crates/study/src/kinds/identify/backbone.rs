//! Backbones: frequency, and damping ratio if it was measured, over the amplitude of a place.
//!
//! The nonlinear mode is computed at the amplitude of every row: friction gives it kinks where a
//! joint begins to slip, at which an interpolation errs. A curve of few points only converts the
//! amplitude of the place to that of the mode.

use super::targets::{Fitted, MeasuredRows, Quantity, RowStates, Target, TargetInput};
use crate::case::study::Case;
use crate::case::values::hertz;
use crate::data::ColumnError;
use stickslip::curve::modes::{FollowedMode, ModePoint, ModeRequest, unit_amplitude};
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
            let mut followed = FollowedMode::new(&system, request).map_err(|error| error.to_string())?;
            let mode = followed.mode();
            if let Some(end) = mode.ended {
                return Err(format!("the nonlinear mode ends: {}", end.reason));
            }
            let size = |point: &ModePoint| point.places[place].norm() * point.omega.powi(self.quantity.derivatives);
            let mut curve: Vec<[f64; 2]> =
                mode.points.iter().map(|point| [size(point).ln(), point.amplitude.ln()]).collect();
            curve.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let [first, .., last] = &curve[..] else { break };
            let (least, most) =
                self.amplitudes.iter().fold((f64::INFINITY, 0.0f64), |(a, b), x| (a.min(*x), b.max(*x)));
            if first[0] <= least.ln() && last[0] >= most.ln() {
                let mut values = Vec::with_capacity(2 * self.amplitudes.len());
                for (row, &amplitude) in self.amplitudes.iter().enumerate() {
                    let point = point_of_size(&mut followed, &curve, amplitude, &size);
                    let point = point.ok_or_else(|| format!("row {}: no motion of the mode was found", row + 1))?;
                    values.push(hertz(point.omega));
                    values.extend(self.has_damping.then_some(point.damping));
                }
                return Ok(Fitted { values, states: Vec::new() });
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

/// Returns the motion of a mode in which a place has this amplitude; `curve` has logarithms of the
/// amplitudes of the place and of the mode.
fn point_of_size(
    mode: &mut FollowedMode<'_>,
    curve: &[[f64; 2]],
    amplitude: f64,
    size: &impl Fn(&ModePoint) -> f64,
) -> Option<ModePoint> {
    let target = amplitude.ln();
    let above = curve.partition_point(|point| point[0] < target).clamp(1, curve.len() - 1);
    let [[from, low], [to, high]] = [curve[above - 1], curve[above]];
    let slope = if to > from { (high - low) / (to - from) } else { 1.0 };
    let mut modal = low + slope * (target - from);
    let mut point = mode.point(modal.exp())?;
    // Both amplitudes are nearly proportional: each correction reduces the error about tenfold.
    for _ in 0..8 {
        let error = target - size(&point).ln();
        if error.abs() < 1e-9 {
            break;
        }
        modal += slope * error;
        point = mode.point(modal.exp())?;
    }
    Some(point)
}
