//! Table row of one orbit, or of a failed point.

use crate::case::study::Case;
use crate::results::columns;
use crate::results::table_builder::TableBuilder;
use crate::run::output_columns;
use crate::run::work::PreparedCase;
use stickslip::method::OrbitError;
use stickslip::orbit::{Orbit, Symmetry};

/// Describes a point in words: the varied parameters and the frequency.
pub(crate) fn describe_location(case: &Case, omega: f64) -> String {
    let frequency = format!("frequency = {:.6} Hz", omega / std::f64::consts::TAU);
    if case.varied.is_empty() { frequency } else { format!("{}, {frequency}", case.label()) }
}

/// Numbers that a table keeps of one orbit, with its evidence.
#[derive(Debug, Clone)]
pub(crate) struct PointRow {
    /// Amplitude, mean and phase (degrees) of every place.
    pub places: Vec<[f64; 3]>,
    /// Dissipation and slip fraction of every joint.
    pub joints: Vec<[f64; 2]>,
    pub stable: Option<bool>,
    pub residual: f64,
    pub energy_gap: f64,
    pub truncation: f64,
    pub return_defect: f64,
    pub iterations: u64,
    /// The algorithm that found the orbit; empty without an orbit.
    pub found_by: &'static str,
    pub status: String,
    pub failure: Option<String>,
    pub stuck: bool,
    /// The columns that `output` requests.
    pub extra: Vec<f64>,
}

impl PointRow {
    pub fn new(prepared: &PreparedCase, outcome: Result<&Orbit, &OrbitError>) -> Self {
        match outcome {
            Ok(orbit) => PointRow::with_stability(prepared, orbit, orbit.is_stable()),
            Err(error) => {
                let mut row = PointRow::without_result(prepared, error.status());
                row.failure = Some(error.to_string());
                row
            }
        }
    }

    /// The row of an orbit whose stability is known already.
    pub fn with_stability(prepared: &PreparedCase, orbit: &Orbit, stable: Option<bool>) -> Self {
        PointRow {
            places: orbit.places.iter().map(|p| [p.amplitude(), p.mean, p.phase_deg()]).collect(),
            joints: orbit.joints.iter().map(|j| [j.dissipation, j.slip_fraction]).collect(),
            stable,
            residual: orbit.evidence.residual,
            energy_gap: orbit.evidence.energy_gap,
            truncation: orbit.evidence.error_estimate.unwrap_or(f64::NAN),
            return_defect: orbit.evidence.return_defect.unwrap_or(f64::NAN),
            iterations: orbit.evidence.iterations as u64,
            found_by: orbit.evidence.found_by,
            status: orbit.evidence.accuracy.status().to_owned(),
            failure: None,
            stuck: orbit.is_in_continuum() && orbit.symmetry == Symmetry::HalfPeriod,
            extra: output_columns::values(prepared, orbit),
        }
    }

    /// The row of a point without a result.
    pub fn without_result(prepared: &PreparedCase, status: &str) -> Self {
        let system = &prepared.system;
        PointRow {
            places: vec![[f64::NAN; 3]; system.places().len()],
            joints: vec![[f64::NAN; 2]; system.joints().len()],
            stable: None,
            residual: f64::NAN,
            energy_gap: f64::NAN,
            truncation: f64::NAN,
            return_defect: f64::NAN,
            iterations: 0,
            found_by: "",
            status: status.to_owned(),
            failure: None,
            stuck: false,
            extra: vec![f64::NAN; output_columns::columns(&prepared.case, &prepared.system).len()],
        }
    }

    /// Writes the cells of the row that follow the varied parameters and the frequency.
    pub fn write(&self, prepared: &PreparedCase, rows: &mut TableBuilder) {
        let system = &prepared.system;
        for ((place, along), [amplitude, mean, phase]) in
            system.places().iter().zip(system.place_axes()).zip(&self.places)
        {
            rows.number(&columns::amplitude_in(place, along.unit()), *amplitude);
            rows.number(&format!("{place}_mean_{}", along.unit()), *mean);
            rows.number(&columns::phase_of(place), *phase);
        }
        for (joint, [dissipation, slip]) in system.joints().iter().zip(&self.joints) {
            rows.number(&format!("{}_dissipation_J", joint.name()), *dissipation);
            rows.number(&columns::slip_fraction(joint.name()), *slip);
        }
        output_columns::columns(&prepared.case, &prepared.system)
            .iter()
            .zip(&self.extra)
            .for_each(|(column, value)| rows.number(column, *value));
        rows.flag("stable", self.stable);
        rows.number(columns::RESIDUAL, self.residual);
        rows.number(columns::ENERGY_GAP, self.energy_gap);
        rows.number("truncation", self.truncation);
        if !prepared.method.closes_motions(&prepared.system) {
            rows.number("return_defect", self.return_defect);
        }
        rows.reduction_error(system.reduction_evidence());
        rows.integer("iterations", self.iterations);
        rows.text("found_by", self.found_by);
        rows.text("status", &self.status);
    }
}
