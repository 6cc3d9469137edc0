//! Frequency responses: amplitude, or amplitude and phase, of a place over frequency, each row
//! with its own measured force.
//!
//! The first harmonic of the orbit is compared. A measured phase is that of `phase_of` relative
//! to the force, positive where the quantity leads.

use super::targets::{Fitted, Measured, RowStates, Target, TargetInput, method_of};
use crate::case::study::Case;
use crate::case::values::hertz;
use crate::data::ColumnError;
use num_complex::Complex64;
use stickslip::dimension::Dimension;
use stickslip::method::{Budget, Request};
use stickslip::model::System;
use stickslip::orbit::Seed;

/// Rows of a frequency response.
#[derive(Debug)]
pub(super) struct ResponseTarget {
    data: String,
    place: String,
    quantity: super::targets::Quantity,
    per_force: bool,
    predict: bool,
    complex: bool,
    rows: Vec<ResponseRow>,
    measured: Vec<Measured>,
}

#[derive(Debug, Clone, Copy)]
struct ResponseRow {
    omega: f64,
    /// Measured force, N; without it the force of the model counts.
    force: Option<f64>,
    group: f64,
}

impl ResponseTarget {
    pub fn new(input: &TargetInput<'_>) -> Result<Self, ColumnError> {
        let quantity = input.quantity;
        let per_force = input.values.flag("per_force") == Some(true);
        let dimension = if per_force { per_newton(quantity.dimension()) } else { quantity.dimension() };
        let omegas = input.column("frequency", Dimension::FREQUENCY)?;
        let forces = input.optional_column("force", Dimension::FORCE)?;
        let count = input.case.model.forces.iter().filter(|force| force.harmonic == 1).count();
        if (forces.is_some() || per_force) && count != 1 {
            let message = format!("a response needs one [[force]] of the excitation frequency, found {count}");
            let help = "the force of each row replaces the amplitude of that [[force]]; without a column `force`, \
                several forces and motions are possible";
            return Err(ColumnError { message, help: help.to_owned() });
        }
        if let Some(row) = omegas.iter().position(|omega| *omega <= 0.0) {
            let message =
                format!("row {} has a frequency that is not more than zero", input.measured(row, 0.0, 0.0, 1.0).row);
            return Err(ColumnError { message, help: "remove the row".to_owned() });
        }
        let values = complex_values(input, dimension)?;
        let complex = values.is_complex;
        let deviations = input.deviations(&values.magnitudes, dimension)?;
        let mut measured = Vec::new();
        for (i, omega) in omegas.iter().enumerate() {
            let x = hertz(*omega);
            match values.complex.get(i) {
                Some(value) => {
                    measured.push(input.measured(i, x, value.re, deviations[i]));
                    measured.push(input.measured(i, x, value.im, deviations[i]));
                }
                None => measured.push(input.measured(i, x, values.magnitudes[i], deviations[i])),
            }
        }
        let row = |(i, omega): (usize, &f64)| ResponseRow {
            omega: *omega,
            force: forces.as_ref().map(|forces| forces[i]),
            group: input.group(i),
        };
        Ok(ResponseTarget {
            data: input.data.name.clone(),
            place: input.at.to_owned(),
            quantity,
            per_force,
            predict: input.predict,
            complex,
            rows: omegas.iter().enumerate().map(row).collect(),
            measured,
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
    // Q = (jω)^q X and P = (jω)^p X: the phase of Q leads that of P by (q - p) 90°
    let turns = input.quantity.derivatives - input.phase_of.derivatives;
    let lead = Complex64::new(0.0, 1.0).powi(turns);
    let complex =
        magnitudes.iter().zip(&phases).map(|(size, phase)| Complex64::from_polar(*size, *phase) * lead).collect();
    Ok(ResponseValues { magnitudes, complex, is_complex: true })
}

impl Target for ResponseTarget {
    fn data(&self) -> &str {
        &self.data
    }
    fn abscissa(&self) -> &'static str {
        "frequency_Hz"
    }
    fn quantities(&self) -> Vec<String> {
        let name =
            if self.per_force { format!("{}_per_N", self.quantity.column) } else { self.quantity.column.to_owned() };
        if self.complex { vec![name.clone(), name] } else { vec![name] }
    }
    fn measured(&self) -> &[Measured] {
        &self.measured
    }
    fn is_complex(&self) -> bool {
        self.complex
    }
    fn is_predicted(&self) -> bool {
        self.predict
    }

    fn fitted(&self, case: &Case, starts: &RowStates) -> Result<Fitted, String> {
        let method = method_of(case)?;
        let mut fitted = Fitted::default();
        let mut before: Option<Seed> = None;
        for chunk in self.rows.chunk_by(|a, b| a.force == b.force && a.group == b.group) {
            let mut model = case.model.clone();
            if let (Some(force), Some(excitation)) =
                (chunk[0].force, model.forces.iter_mut().find(|force| force.harmonic == 1))
            {
                excitation.amplitude = force;
                model.frequency_forces.clear();
            }
            let excited = model.forces.iter().position(|force| force.harmonic == 1);
            let phase = excited.map_or(0.0, |force| model.forces[force].phase);
            let system: System = model.assemble().map_err(|error| error.to_string())?;
            let mut solver = method.solver(&system).map_err(|error| error.to_string())?;
            for row in chunk {
                let own = starts.get(fitted.states.len()).and_then(Option::as_ref);
                let seed = own.or(before.as_ref());
                let request = Request::at(row.omega).without_estimate();
                let found = solver.solve(&request.near(seed), &mut Budget::default());
                let found = match (found, seed) {
                    // an orbit of other parameters may be no good initial guess
                    (Err(_), Some(_)) => solver.solve(&request, &mut Budget::default()),
                    (found, _) => found,
                };
                let orbit = found.map_err(|error| format!("no orbit at {:.6} Hz: {error}", hertz(row.omega)))?;
                let place = orbit.place(&self.place).ok_or_else(|| format!("there is no place `{}`", self.place))?;
                let mut value = place.first_harmonic
                    * Complex64::from_polar(1.0, -phase)
                    * self.quantity.displacement_factor(row.omega);
                if self.per_force {
                    value /= excited.map_or(1.0, |force| model.force_amplitude(force, row.omega));
                }
                if self.complex {
                    fitted.values.extend([value.re, value.im]);
                } else {
                    fitted.values.push(value.norm());
                }
                before = Some(orbit.seed());
                fitted.states.push(before.clone());
            }
        }
        Ok(fitted)
    }
}
