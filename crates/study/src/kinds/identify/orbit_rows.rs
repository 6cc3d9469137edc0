//! Orbits in place of measured rows: each row has an excitation frequency, and its own force if it
//! was measured.
//!
//! The groups of the data are computed in parallel, each from its first row on.

use super::targets::{RowStates, TargetInput, method_of};
use crate::case::study::Case;
use crate::case::values::hertz;
use crate::data::ColumnError;
use num_complex::Complex64;
use rayon::prelude::*;
use stickslip::dimension::Dimension;
use stickslip::method::{Budget, Request};
use stickslip::model::{ExcitationSum, System};
use stickslip::orbit::{Orbit, Seed};

/// Frequency, force and group of a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct OrbitRow {
    /// Excitation frequency, rad/s.
    pub omega: f64,
    /// Measured force, N; without it the force of the model counts.
    pub force: Option<f64>,
    pub group: f64,
}

/// An orbit with the force that excites it.
pub(super) struct ForcedOrbit<'a> {
    pub orbit: &'a Orbit,
    pub system: &'a System,
    /// Amplitude of the force of the excitation frequency, N; 1 without such a force.
    pub force: f64,
    /// Its phase, rad.
    pub phase: f64,
}

/// Takes the values of a row from its orbit.
pub(super) type ReadOrbit<'r> = dyn Fn(&OrbitRow, &ForcedOrbit<'_>) -> Result<Vec<f64>, String> + Sync + 'r;

/// The rows of a target.
#[derive(Debug)]
pub(super) struct OrbitRows {
    pub rows: Vec<OrbitRow>,
}

impl OrbitRows {
    /// Collects the rows; `divides` is true if the measured values were divided by the force.
    pub fn new(input: &TargetInput<'_>, divides: bool) -> Result<Self, ColumnError> {
        let omegas = input.column("frequency", Dimension::FREQUENCY)?;
        let forces = input.optional_column("force", Dimension::FORCE)?;
        let count = input.case.model.forces.iter().filter(|force| force.harmonic == 1).count();
        if (forces.is_some() || divides) && count != 1 {
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
        let row = |(i, omega): (usize, &f64)| OrbitRow {
            omega: *omega,
            force: forces.as_ref().map(|forces| forces[i]),
            group: input.group(i),
        };
        Ok(OrbitRows { rows: omegas.iter().enumerate().map(row).collect() })
    }

    /// Computes the orbits of all rows from warm starts, and returns the values that `read` takes
    /// from them, with the warm starts for similar parameters.
    ///
    /// # Errors
    /// A row has no orbit, or `read` finds no value.
    pub fn values(
        &self,
        case: &Case,
        starts: &RowStates,
        read: &ReadOrbit<'_>,
    ) -> Result<(Vec<f64>, RowStates), String> {
        let method = method_of(case)?;
        let mut model = case.model.clone();
        let excited = model.forces.iter().position(|force| force.harmonic == 1);
        if let (Some(force), true) = (excited, self.rows.iter().any(|row| row.force.is_some())) {
            model.forces[force].amplitude = 1.0;
            model.frequency_forces.clear();
        }
        let system = model.assemble().map_err(|error| error.to_string())?;
        let phase = excited.map_or(0.0, |force| model.forces[force].phase);
        let mut first = 0;
        let groups: Vec<(usize, &[OrbitRow])> = self
            .rows
            .chunk_by(|a, b| a.group == b.group)
            .map(|rows| {
                first += rows.len();
                (first - rows.len(), rows)
            })
            .collect();
        let group = |(first, rows): &(usize, &[OrbitRow])| -> Result<(Vec<f64>, RowStates), String> {
            let (mut values, mut states) = (Vec::new(), RowStates::new());
            let mut before: Option<Seed> = None;
            for rows in rows.chunk_by(|a, b| a.force == b.force) {
                let forced = rows[0].force.map(|force| under_force(&system, force));
                let forced = forced.as_ref().unwrap_or(&system);
                let mut solver = method.solver(forced).map_err(|error| error.to_string())?;
                for row in rows {
                    let own = starts.get(first + states.len()).and_then(Option::as_ref);
                    let seed = own.or(before.as_ref());
                    let request = Request::at(row.omega).without_estimate();
                    let found = solver.solve(&request.near(seed), &mut Budget::default());
                    // an orbit of other parameters may be no good initial guess; only a search
                    // with an error estimate takes the second method of `auto`
                    let found = match (found, seed) {
                        (Err(_), Some(_)) => solver.solve(&request, &mut Budget::default()),
                        (found, _) => found,
                    };
                    let found = found.or_else(|_| solver.solve(&Request::at(row.omega), &mut Budget::default()));
                    let orbit = found.map_err(|error| format!("no orbit at {:.6} Hz: {error}", hertz(row.omega)))?;
                    let force = excited.map_or(1.0, |force| model.force_amplitude(force, row.omega));
                    let force = row.force.unwrap_or(force);
                    let forced = ForcedOrbit { orbit: &orbit, system: forced, force, phase };
                    values.extend(read(row, &forced)?);
                    before = Some(orbit.seed());
                    states.push(before.clone());
                }
            }
            Ok((values, states))
        };
        let found: Vec<(Vec<f64>, RowStates)> = groups.par_iter().map(group).collect::<Result<_, String>>()?;
        let (values, states): (Vec<Vec<f64>>, Vec<RowStates>) = found.into_iter().unzip();
        Ok((values.concat(), states.concat()))
    }
}

/// Returns the system with its first harmonic multiplied by `force`.
fn under_force(system: &System, force: f64) -> System {
    let harmonics = system.excitation_harmonics().iter().map(|load| load.harmonic);
    let sums: Vec<ExcitationSum> = harmonics
        .map(|harmonic| {
            let factor = if harmonic == 1 { force } else { 1.0 };
            ExcitationSum { harmonic, of: vec![(harmonic, Complex64::new(factor, 0.0))] }
        })
        .collect();
    system.with_excitation_sums(&sums)
}
