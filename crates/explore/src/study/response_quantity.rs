//! Curves of quantities other than the amplitude, from the table of a response: velocities,
//! accelerations, receptances, joint forces, and the energy that joints dissipate per cycle.

use serde::Deserialize;
use stickslip_study::Study;
use stickslip_study::dataset::{Axis, Dataset, Figure, Panel, Series, Table};

/// A quantity of a response.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ResponseQuantity {
    /// Velocity amplitude of the places.
    Velocity,
    /// Acceleration amplitude of the places.
    Acceleration,
    /// Amplitude per unit of the largest force.
    Receptance,
    /// Force amplitude of the joints.
    Force,
    /// Energy that the joints dissipate per cycle.
    Dissipation,
}

impl ResponseQuantity {
    /// Returns the name of the quantity, and the entry of `output` that computes it.
    pub(crate) fn output(self) -> Option<&'static str> {
        match self {
            ResponseQuantity::Velocity => Some("velocity"),
            ResponseQuantity::Acceleration => Some("acceleration"),
            ResponseQuantity::Receptance => Some("receptance"),
            ResponseQuantity::Force => Some("joint_force"),
            ResponseQuantity::Dissipation => None,
        }
    }

    fn words(self) -> &'static str {
        match self {
            ResponseQuantity::Velocity => "velocity",
            ResponseQuantity::Acceleration => "acceleration",
            ResponseQuantity::Receptance => "receptance",
            ResponseQuantity::Force => "joint force",
            ResponseQuantity::Dissipation => "dissipation per cycle",
        }
    }

    /// Returns the part of a column name that follows the place or joint.
    fn marker(self) -> &'static str {
        match self {
            ResponseQuantity::Velocity => "_velocity_amplitude_",
            ResponseQuantity::Acceleration => "_acceleration_amplitude_",
            ResponseQuantity::Receptance => "_receptance_",
            ResponseQuantity::Force => "_force_amplitude_N",
            ResponseQuantity::Dissipation => "_dissipation_J",
        }
    }

    /// Draws the quantity over frequency: one panel for each place or joint, one curve for each
    /// case. `None` if the dataset is not a response.
    pub(crate) fn figure(self, study: &Study, dataset: &Dataset) -> Option<Figure> {
        let table = dataset.tables.iter().find(|table| table.name == "curve")?;
        let frequency = table.numbers("frequency_Hz")?;
        let rows = case_rows(table, study.varied().len(), frequency.len());
        let panels: Vec<Panel> = table
            .columns
            .iter()
            .filter_map(|column| {
                let (name, _) = column.name.split_once(self.marker())?;
                let values = table.numbers(&column.name)?;
                let unit = column.unit().unwrap_or_default();
                let series = rows.iter().enumerate().map(|(case, rows)| {
                    let label = study.case(case).map_or_else(|_| String::new(), |case| case.label());
                    let label = if label.is_empty() { name.to_owned() } else { label };
                    Series::line(label, frequency[rows.clone()].to_vec(), values[rows.clone()].to_vec(), case)
                });
                Some(Panel {
                    title: name.to_owned(),
                    x: Axis::new("frequency", "Hz"),
                    y: Axis::new(self.words(), unit),
                    series: series.collect(),
                    ..Panel::default()
                })
            })
            .collect();
        (!panels.is_empty()).then(|| Figure { title: study.title().to_owned(), panels, ..Figure::default() })
    }
}

/// Returns the rows of every case: rows with equal values in the first columns.
fn case_rows(table: &Table, keys: usize, rows: usize) -> Vec<std::ops::Range<usize>> {
    let columns: Vec<&[f64]> =
        table.columns.iter().take(keys).filter_map(|column| table.numbers(&column.name)).collect();
    let mut cases = Vec::new();
    let mut from = 0;
    for row in 1..=rows {
        let same = row < rows && columns.iter().all(|column| column[row].to_bits() == column[from].to_bits());
        if !same {
            cases.push(from..row);
            from = row;
        }
    }
    cases
}
