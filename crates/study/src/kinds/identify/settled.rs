//! Settled vibrations: half the peak-to-peak value or the mean of a place, or the loss of a joint
//! per cycle, at excitation frequencies.

use super::orbit_rows::{ForcedOrbit, OrbitRow, OrbitRows};
use super::targets::{Fitted, MeasuredRows, Quantity, RowStates, Target, TargetInput};
use crate::case::study::Case;
use crate::case::values::hertz;
use crate::data::ColumnError;
use stickslip::dimension::Dimension;
use stickslip::orbit::Sample;

/// A measured value of the settled motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SettledValue {
    Amplitude,
    Mean,
    Dissipation,
}

impl SettledValue {
    const ALL: [(SettledValue, &'static str); 3] = [
        (SettledValue::Amplitude, "amplitude"),
        (SettledValue::Mean, "mean"),
        (SettledValue::Dissipation, "dissipation"),
    ];
}

/// Rows of settled vibrations.
#[derive(Debug)]
pub(super) struct Settled {
    /// A place, or a joint for its dissipation.
    at: String,
    quantity: Quantity,
    rows: OrbitRows,
    values: Vec<SettledValue>,
    measured: MeasuredRows,
}

impl Settled {
    pub fn new(input: &TargetInput<'_>) -> Result<Self, ColumnError> {
        let rows = OrbitRows::new(input, false)?;
        let is_joint = input.case.model.joints.iter().any(|joint| joint.name == input.at);
        let fits = |value: SettledValue| (value == SettledValue::Dissipation) == is_joint;
        let (mut values, mut columns) = (Vec::new(), Vec::new());
        for (value, role) in SettledValue::ALL.into_iter().filter(|(value, _)| fits(*value)) {
            let dimension = if is_joint { Dimension::ENERGY } else { input.quantity.dimension() };
            if let Some(column) = input.optional_column(role, dimension)? {
                columns.push((input.deviations(&column, dimension)?, column));
                values.push(value);
            }
        }
        if values.is_empty() {
            let needed = if is_joint { "`dissipation`" } else { "`amplitude` or `mean`" };
            let message = format!("the table `{}` has no column {needed}", input.data.name);
            let help = "name it in [[data]] by `columns`; `at` is a place for amplitudes, a joint for its dissipation";
            return Err(ColumnError { message, help: help.to_owned() });
        }
        let mut measured = Vec::new();
        for (i, row) in rows.rows.iter().enumerate() {
            for (deviations, column) in &columns {
                measured.push(input.measured(i, hertz(row.omega), column[i], deviations[i]));
            }
        }
        Ok(Settled {
            at: input.at.to_owned(),
            quantity: input.quantity,
            rows,
            values,
            measured: input.measured_rows(measured),
        })
    }

    /// Returns smallest and largest value of the quantity over the orbit.
    fn range(&self, forced: &ForcedOrbit<'_>) -> Option<[f64; 2]> {
        let orbit = forced.orbit;
        let place = orbit.places.iter().position(|place| place.name == self.at)?;
        if self.quantity.derivatives == 0 {
            return Some([orbit.places[place].minimum, orbit.places[place].maximum]);
        }
        let axis = forced.system.place_axes()[place].clone();
        let value = |sample: Sample| {
            axis.component(if self.quantity.derivatives == 1 { &sample.velocity } else { &sample.acceleration })
        };
        let times = (0..INSTANTS).map(|i| orbit.period() * i as f64 / INSTANTS as f64);
        let values = times.chain(orbit.transition_times()).map(|time| value(orbit.sample(time)));
        Some(values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]))
    }
}

/// Instants of a period at which velocities and accelerations are evaluated, in addition to the
/// switches. The range of a sine has an error of 2e-6.
const INSTANTS: usize = 1024;

impl Target for Settled {
    fn abscissa(&self) -> &'static str {
        "frequency_Hz"
    }
    fn quantities(&self) -> Vec<String> {
        let name = |value: &SettledValue| match value {
            SettledValue::Amplitude => self.quantity.column.to_owned(),
            SettledValue::Mean => format!("mean_{}", self.quantity.column),
            SettledValue::Dissipation => "dissipation_J".to_owned(),
        };
        self.values.iter().map(name).collect()
    }
    fn measured(&self) -> &MeasuredRows {
        &self.measured
    }

    fn fitted(&self, case: &Case, starts: &RowStates) -> Result<Fitted, String> {
        let read = |_: &OrbitRow, forced: &ForcedOrbit<'_>| {
            let orbit = forced.orbit;
            let missing = || format!("there is no place or joint `{}`", self.at);
            let one = |value: &SettledValue| match value {
                SettledValue::Amplitude => self.range(forced).map(|[low, high]| 0.5 * (high - low)),
                SettledValue::Mean if self.quantity.derivatives > 0 => Some(0.0),
                SettledValue::Mean => orbit.place(&self.at).map(|place| place.mean),
                SettledValue::Dissipation => orbit.joint(&self.at).map(|joint| joint.dissipation),
            };
            self.values.iter().map(|value| one(value).ok_or_else(missing)).collect()
        };
        let (values, states) = self.rows.values(case, starts, &read)?;
        Ok(Fitted { values, states })
    }
}
