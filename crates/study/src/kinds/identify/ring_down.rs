//! Free decays in time, from the initial state that `start` and `start_velocity` of the target or
//! of the study state.
//!
//! The first row is the initial instant. The rows have equal distances.

use super::targets::{Fitted, MeasuredRows, Quantity, RowStates, Target, TargetInput};
use crate::case::initial_state::{Start, StartKeys};
use crate::case::study::Case;
use crate::data::ColumnError;
use crate::syntax::format::format_with_prefix;
use stickslip::dimension::Dimension;
use stickslip::method::WIDTH;
use stickslip::method::time_history::{Excitation, TimeHistory};
use stickslip_formats::data::Column;
use stickslip_numerics::tie_break::first_largest;

/// Rows of a free decay.
#[derive(Debug)]
pub(super) struct RingDown {
    /// Index of the target, from 0.
    index: usize,
    place: String,
    quantity: Quantity,
    step: f64,
    measured: MeasuredRows,
}

impl RingDown {
    pub fn new(input: &TargetInput<'_>) -> Result<Self, ColumnError> {
        let quantity = input.quantity;
        let time = input.column("time", Dimension::TIME)?;
        let response = input.column("response", quantity.dimension())?;
        let sampling = Column { values: time.clone(), ..Column::default() }.sampling().ok_or_else(|| ColumnError {
            message: format!("the times of `{}` do not increase in equal steps{}", input.data.name, uneven(&time)),
            help: "resample a record with a gap; several records need a column `group` and a target each, with \
                   `groups = 1` and `groups = 2`"
                .to_owned(),
        })?;
        if response.iter().all(|value| *value == response[0]) {
            let message = format!("the response in `{}` does not change", input.data.name);
            return Err(ColumnError {
                message,
                help: "check the column that `columns` names as `response`".to_owned(),
            });
        }
        let deviations = input.deviations(&response, quantity.dimension())?;
        let measured =
            (0..time.len()).map(|i| input.measured(i, time[i] - time[0], response[i], deviations[i])).collect();
        Ok(RingDown {
            index: input.index,
            place: input.at.to_owned(),
            quantity,
            step: sampling.step,
            measured: input.measured_rows(measured),
        })
    }
}

/// Returns the most unequal step in words; nothing if there are not two steps.
fn uneven(times: &[f64]) -> String {
    let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let Some(usual) = sorted.get(sorted.len() / 2).filter(|_| steps.len() > 1) else { return String::new() };
    let Some(row) = first_largest(steps.iter().map(|step| (step - usual).abs())) else { return String::new() };
    let words = |step: f64| format_with_prefix(step, "s");
    format!(": {} from row {} to row {}, usually {}", words(steps[row]), row + 1, row + 2, words(*usual))
}

impl Target for RingDown {
    fn abscissa(&self) -> &'static str {
        "time_s"
    }
    fn quantities(&self) -> Vec<String> {
        vec![self.quantity.column.to_owned()]
    }
    fn measured(&self) -> &MeasuredRows {
        &self.measured
    }

    fn first_cycles(&self) -> Option<usize> {
        let mean = self.measured.values.iter().map(|row| row.value).sum::<f64>() / self.measured.values.len() as f64;
        let above: Vec<bool> = self.measured.values.iter().map(|row| row.value > mean).collect();
        // two cycles cross the mean four times
        let mut crossings = (1..above.len()).filter(|row| above[*row] != above[row - 1]);
        Some(crossings.nth(3).unwrap_or(above.len()))
    }

    fn fitted(&self, case: &Case, _: &RowStates) -> Result<Fitted, String> {
        let system = case.model.assemble().map_err(|error| error.to_string())?;
        let place = system.places().iter().position(|place| *place == self.place);
        let along = place.map(|place| system.place_axes()[place].clone());
        let along = along.ok_or_else(|| format!("there is no place `{}`", self.place))?;
        let targets = case.values.tables("targets").unwrap_or_default();
        let own = targets.get(self.index).unwrap_or(&case.values);
        let start = Start::new(&system, &StartKeys::of_record(own, &case.values));
        let history = TimeHistory {
            displacement: start.displacement,
            velocity: start.velocity,
            states: start.states,
            excitation: Excitation::Free,
            // half a step more, so that the last row is not lost by rounding
            duration: self.step * (self.measured.values.len() as f64 - 0.5),
            step: self.step,
            width: case.method.options.get(WIDTH).copied(),
            tolerance: case.method.time_history_tolerance(),
        };
        let mut fitted = Vec::with_capacity(self.measured.values.len());
        let run = history.run(&system, &mut |_, _, sample| {
            let of = match self.quantity.derivatives {
                0 => &sample.displacement,
                1 => &sample.velocity,
                _ => &sample.acceleration,
            };
            fitted.push(along.component(of));
            fitted.len() < self.measured.values.len()
        });
        run.map_err(|error| error.to_string())?;
        if fitted.len() < self.measured.values.len() {
            return Err(format!("the decay ends after {} of {} rows", fitted.len(), self.measured.values.len()));
        }
        Ok(Fitted { values: fitted, states: Vec::new() })
    }
}
