//! Tables of orbits with the columns of studies.

use stickslip::method::{Method, OrbitError};
use stickslip::model::System;
use stickslip::orbit::Orbit;
use stickslip_study::dataset::{CellValues, Column, Table, column_name};
use stickslip_study::hertz;

/// Table row of one orbit, or of a failed point.
pub struct Row {
    omega: f64,
    places: Vec<[f64; 3]>,
    joints: Vec<[f64; 2]>,
    stable: Option<bool>,
    /// Residual, energy gap, truncation error, return defect.
    evidence: [f64; 4],
    iterations: u64,
    found_by: &'static str,
    pub status: &'static str,
    pub failure: Option<String>,
}

impl Row {
    /// Creates the row of an outcome at a frequency in rad/s.
    pub fn new(system: &System, omega: f64, outcome: Result<&Orbit, &OrbitError>) -> Row {
        match outcome {
            Ok(orbit) => {
                let found = &orbit.evidence;
                let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
                Row {
                    omega,
                    places: orbit
                        .places
                        .iter()
                        .map(|place| [place.amplitude(), place.mean, place.phase_deg()])
                        .collect(),
                    joints: orbit.joints.iter().map(|joint| [joint.dissipation, joint.slip_fraction]).collect(),
                    stable: orbit.is_stable(),
                    evidence: [
                        found.residual,
                        found.energy_gap,
                        number(found.error_estimate),
                        number(found.return_defect),
                    ],
                    iterations: found.iterations as u64,
                    found_by: found.found_by,
                    status: found.accuracy.status(),
                    failure: None,
                }
            }
            Err(error) => {
                Row { failure: Some(error.to_string()), status: error.status(), ..Row::missing(system, omega) }
            }
        }
    }

    fn missing(system: &System, omega: f64) -> Row {
        Row {
            omega,
            places: vec![[f64::NAN; 3]; system.places().len()],
            joints: vec![[f64::NAN; 2]; system.joints().len()],
            stable: None,
            evidence: [f64::NAN; 4],
            iterations: 0,
            found_by: "",
            status: "failed",
            failure: None,
        }
    }
}

/// Returns the table of these rows, with `first` as its first columns.
pub fn table(name: &str, first: Vec<Column>, system: &System, method: &dyn Method, rows: &[Row]) -> Table {
    let numbers =
        |name: &str, value: &dyn Fn(&Row) -> f64| Column::numbers(&column_name(name), rows.iter().map(value).collect());
    let mut columns = first;
    columns.push(numbers("frequency_Hz", &|row| hertz(row.omega)));
    for (i, (place, along)) in system.places().iter().zip(system.place_axes()).enumerate() {
        let unit = along.unit();
        let names = [format!("amplitude_{unit}"), format!("mean_{unit}"), "phase_deg".to_owned()];
        for (k, what) in names.iter().enumerate() {
            columns.push(numbers(&format!("{place}_{what}"), &|row| row.places[i][k]));
        }
    }
    for (j, joint) in system.joints().iter().enumerate() {
        for (k, what) in ["dissipation_J", "slip_fraction"].into_iter().enumerate() {
            columns.push(numbers(&format!("{}_{what}", joint.name()), &|row| row.joints[j][k]));
        }
    }
    let stable = CellValues::Flag(rows.iter().map(|row| row.stable).collect());
    columns.push(Column { name: "stable".to_owned(), values: stable });
    for (k, what) in ["residual", "energy_gap", "truncation", "return_defect"].into_iter().enumerate() {
        // If the method closes the motion, the residual is the return defect.
        if k < 3 || !method.closes_motions(system) {
            columns.push(numbers(what, &|row| row.evidence[k]));
        }
    }
    let iterations = CellValues::Integer(rows.iter().map(|row| row.iterations).collect());
    columns.push(Column { name: "iterations".to_owned(), values: iterations });
    columns.push(Column::texts("found_by", rows.iter().map(|row| row.found_by.to_owned()).collect()));
    columns.push(Column::texts("status", rows.iter().map(|row| row.status.to_owned()).collect()));
    Table { name: name.to_owned(), columns }
}
