//! Frequency responses: amplitude, or amplitude and phase, of a place over frequency, each row
//! with its own measured force.
//!
//! The first harmonic of the orbit is compared. A measured phase is that of `phase_of` relative
//! to the force, positive where the quantity leads.

use super::orbit_rows::{ForcedOrbit, OrbitRow, OrbitRows};
use super::targets::{Fitted, MeasuredRows, RowStates, Target, TargetInput};
use crate::case::study::Case;
use crate::case::values::hertz;
use crate::data::ColumnError;
use num_complex::Complex64;
use std::f64::consts::TAU;
use stickslip::dimension::Dimension;

/// Rows of a frequency response.
#[derive(Debug)]
pub(super) struct ResponseTarget {
    place: String,
    quantity: super::targets::Quantity,
    per_force: bool,
    complex: bool,
    rows: OrbitRows,
    measured: MeasuredRows,
}

impl ResponseTarget {
    pub fn new(input: &TargetInput<'_>) -> Result<Self, ColumnError> {
        let quantity = input.quantity;
        let per_force = input.values.flag("per_force") == Some(true);
        let dimension = if per_force { per_newton(quantity.dimension()) } else { quantity.dimension() };
        let rows = OrbitRows::new(input, per_force)?;
        let values = complex_values(input, dimension)?;
        let complex = values.is_complex;
        let deviations = input.deviations(&values.magnitudes, dimension)?;
        let mut measured = Vec::new();
        for (i, row) in rows.rows.iter().enumerate() {
            let x = hertz(row.omega);
            match values.complex.get(i) {
                Some(value) => {
                    measured.push(input.measured(i, x, value.re, deviations[i]));
                    measured.push(input.measured(i, x, value.im, deviations[i]));
                }
                None => measured.push(input.measured(i, x, values.magnitudes[i], deviations[i])),
            }
        }
        Ok(ResponseTarget {
            place: input.at.to_owned(),
            quantity,
            per_force,
            complex,
            rows,
            measured: input.measured_rows(measured),
        })
    }
}

fn per_newton(dimension: Dimension) -> Dimension {
    Dimension { kg: -1, m: dimension.m - 1, s: dimension.s + 2, rad: 0 }
}

/// Measured values of the quantity relative to the force.
struct ResponseValues {
    magnitudes: Vec<f64>,
    /// Empty if only amplitudes were measured.
    complex: Vec<Complex64>,
    is_complex: bool,
}

fn complex_values(input: &TargetInput<'_>, dimension: Dimension) -> Result<ResponseValues, ColumnError> {
    if let Some(real) = input.optional_column("response_real", dimension)? {
        let imaginary = input.column("response_imaginary", dimension)?;
        let complex: Vec<Complex64> = real.iter().zip(&imaginary).map(|(re, im)| Complex64::new(*re, *im)).collect();
        let magnitudes = complex.iter().map(|value| value.norm()).collect();
        return Ok(ResponseValues { magnitudes, complex, is_complex: true });
    }
    let magnitudes = input.column("response", dimension)?;
    let Some(phases) = input.optional_column("phase", Dimension::ANGLE)? else {
        return Ok(ResponseValues { magnitudes, complex: Vec::new(), is_complex: false });
    };
    // Four turns: phases in rad over many resonances stay below, those in degrees do not.
    let most_turns = 4.0;
    let largest = phases.iter().fold(0.0f64, |most, phase| most.max(phase.abs()));
    if !input.data.has_unit("phase") && largest > most_turns * TAU {
        let message = format!(
            "the column of `phase` of `{}` reaches {largest:.0} without a unit, so it is in degrees rather than rad",
            input.data.name
        );
        let help = "state its unit: the title `phase_deg`, or columns = { phase = \"NAME [deg]\" }".to_owned();
        return Err(ColumnError { message, help });
    }
    // Q = (jω)^q X and P = (jω)^p X: the phase of Q leads that of P by (q - p) 90°
    let turns = input.quantity.derivatives - input.phase_of.derivatives;
    let lead = Complex64::new(0.0, 1.0).powi(turns);
    let complex =
        magnitudes.iter().zip(&phases).map(|(size, phase)| Complex64::from_polar(*size, *phase) * lead).collect();
    Ok(ResponseValues { magnitudes, complex, is_complex: true })
}

impl Target for ResponseTarget {
    fn abscissa(&self) -> &'static str {
        "frequency_Hz"
    }
    fn quantities(&self) -> Vec<String> {
        let name =
            if self.per_force { format!("{}_per_N", self.quantity.column) } else { self.quantity.column.to_owned() };
        if self.complex { vec![name.clone(), name] } else { vec![name] }
    }
    fn measured(&self) -> &MeasuredRows {
        &self.measured
    }
    fn is_complex(&self) -> bool {
        self.complex
    }

    fn fitted(&self, case: &Case, starts: &RowStates) -> Result<Fitted, String> {
        let read = |row: &OrbitRow, forced: &ForcedOrbit<'_>| {
            let place = forced.orbit.place(&self.place).ok_or_else(|| format!("there is no place `{}`", self.place))?;
            let mut value = place.first_harmonic
                * Complex64::from_polar(1.0, -forced.phase)
                * self.quantity.displacement_factor(row.omega);
            if self.per_force {
                value /= forced.force;
            }
            Ok(if self.complex { vec![value.re, value.im] } else { vec![value.norm()] })
        };
        let (values, states) = self.rows.values(case, starts, &read)?;
        Ok(Fitted { values, states })
    }
}
