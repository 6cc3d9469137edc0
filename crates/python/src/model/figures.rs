//! Tables and figures of the results of a model.

use super::orbit::PyOrbit;
use std::f64::consts::TAU;
use stickslip::curve::modes::{Mode, ModePoint};
use stickslip::model::System;
use stickslip_study::dataset::{Axis, Column, Figure, Panel, Series, Table, column_name};

/// Draws amplitudes over the frequency, or over the first parameter if the frequency is
/// constant.
pub fn curves(table: &Table, system: &System, along: Option<&str>) -> Figure {
    let numbers = |name: &str| table.numbers(&column_name(name)).unwrap_or_default().to_vec();
    let frequencies = numbers("frequency_Hz");
    let fixed = frequencies.windows(2).all(|pair| pair[0] == pair[1]);
    let (x, values) = match along.filter(|_| fixed) {
        Some(name) => (Axis::new(name, "SI"), numbers(&name.replace(['.', '-'], "_"))),
        None => (Axis::new("frequency", "Hz"), frequencies),
    };
    let series =
        system.places().iter().zip(system.place_axes()).enumerate().filter(|(_, (_, along))| !along.is_rotation());
    let series =
        series.map(|(i, (place, _))| Series::line(place, values.clone(), numbers(&format!("{place}_amplitude_m")), i));
    let y = Axis::new("amplitude", "m").log();
    Figure {
        panels: vec![Panel { title: String::new(), x, y, series: series.collect(), ..Panel::default() }],
        ..Figure::default()
    }
}

/// Returns the loops of all joints and their dissipation, with a figure.
///
/// A loop has `points` equidistant times of a period and the switching times.
pub fn loops(found: &PyOrbit, points: usize) -> (Vec<Table>, Figure) {
    let (mut labels, mut times, mut signals) = (Vec::new(), Vec::new(), [Vec::new(), Vec::new(), Vec::new()]);
    let mut figure = Figure::default();
    for (j, joint) in found.system.joints().iter().enumerate() {
        let (instants, values) = found.loop_of(j, points);
        for (a, label) in joint.labels().enumerate() {
            let pick = |signal: &[f64]| signal.iter().skip(a).step_by(joint.axes().len()).copied().collect::<Vec<_>>();
            let picked: Vec<Vec<f64>> = values.iter().map(|signal| pick(signal)).collect();
            labels.extend(std::iter::repeat_n(label.clone(), instants.len()));
            times.extend(&instants);
            signals.iter_mut().zip(&picked).for_each(|(all, one)| all.extend(one));
            figure.panels.push(loop_panel(label, &picked[0], &picked[2]));
        }
    }
    let [displacement, velocity, force] = signals;
    let loops = Table {
        name: "loops".to_owned(),
        columns: vec![
            Column::texts("joint", labels),
            Column::numbers("time_s", times),
            Column::numbers("displacement_m", displacement),
            Column::numbers("velocity_m_per_s", velocity),
            Column::numbers("force_N", force),
        ],
    };
    let joints = &found.orbit.joints;
    let summary = Table {
        name: "loops_summary".to_owned(),
        columns: vec![
            Column::texts("joint", joints.iter().map(|joint| joint.name.clone()).collect()),
            Column::numbers("dissipation_J", joints.iter().map(|joint| joint.dissipation).collect()),
            Column::numbers("slip_fraction", joints.iter().map(|joint| joint.slip_fraction).collect()),
        ],
    };
    (vec![loops, summary], figure)
}

/// Returns frequency and damping of a mode over its amplitude, with a figure.
pub fn mode(found: &Mode, system: &System) -> (Table, Figure) {
    let numbers =
        |name: &str, value: &dyn Fn(&ModePoint) -> f64| Column::numbers(name, found.points.iter().map(value).collect());
    let mut columns = vec![
        numbers("modal_amplitude_m_sqrt_kg", &|point| point.amplitude),
        numbers("frequency_Hz", &|point| point.omega / TAU),
        numbers("damping_ratio", &|point| point.damping),
        numbers("viscous_damping_ratio", &|point| point.viscous),
    ];
    let phases: Vec<Vec<f64>> = found.points.iter().map(ModePoint::phases).collect();
    for (i, (place, along)) in system.places().iter().zip(system.place_axes()).enumerate() {
        let (name, unit) = (column_name(place), along.unit());
        columns.push(numbers(&format!("{name}_amplitude_{unit}"), &|point| point.amplitudes[i]));
        columns.push(numbers(&format!("{name}_first_harmonic_{unit}"), &|point| point.places[i].norm()));
        let phase = phases.iter().map(|all| all[i].to_degrees()).collect();
        columns.push(Column::numbers(&format!("{name}_phase_deg"), phase));
    }
    let table = Table { name: "modes".to_owned(), columns };
    let x = Axis::new("modal amplitude", "m √kg").log();
    let line = |quantity: &str, unit: &str, column: &str| Panel {
        title: String::new(),
        x: x.clone(),
        y: Axis::new(quantity, unit),
        series: vec![Series::line(
            "",
            table.numbers("modal_amplitude_m_sqrt_kg").unwrap_or_default().to_vec(),
            table.numbers(column).unwrap_or_default().to_vec(),
            0,
        )],
        ..Panel::default()
    };
    let panels = vec![line("frequency", "Hz", "frequency_Hz"), line("damping ratio", "", "damping_ratio")];
    (table, Figure { panels, ..Figure::default() })
}

fn loop_panel(joint: String, displacement: &[f64], force: &[f64]) -> Panel {
    // The first point closes the loop.
    let closed = |values: &[f64]| values.iter().chain(values.first()).copied().collect();
    let series = vec![Series::line("", closed(displacement), closed(force), 0)];
    Panel { title: joint, x: Axis::new("displacement", "m"), y: Axis::new("force", "N"), series, ..Panel::default() }
}
