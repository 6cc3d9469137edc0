//! The figure of a Campbell diagram.

use super::{CROSSINGS, DIAMETER, JOINTS, MODE, SPEED, TABLE, excited_diameter};
use crate::kinds::nodal_diameter::STATES;
use crate::results::columns::FREQUENCY;
use crate::results::dataset::{Figure, Panel, Series, Style, Table};
use crate::results::draw_panels;
use crate::results::drawing::{CaseRows, FigureInput, largest, numbers, words};

/// Draws a panel per case: frequencies, engine order lines and crossings. For a tuned disk it
/// shows the frequencies that an engine order excites.
pub(super) fn draw(drawing: &FigureInput<'_>) -> Figure {
    let Some(table) = drawing.table(TABLE) else { return Figure::default() };
    let (x, x_factor) = drawing.axis(0, "speed of rotation", largest(table, [SPEED.to_owned()]), "Hz");
    let (y, y_factor) = drawing.axis(1, "frequency", largest(table, [FREQUENCY.to_owned()]), "Hz");
    let crossings = drawing.table(CROSSINGS);
    let marks = crossings.map(|table| drawing.case_rows(table)).unwrap_or_default();
    let panel = |case_rows: &CaseRows, title: String| {
        let case = drawing.study.case(case_rows.case).ok();
        let orders = case.as_ref().and_then(|case| case.values.count("engine_orders")).unwrap_or(6) as usize;
        let ring = case.and_then(|case| case.model.ring).filter(|ring| ring.equal);
        let shown = |diameter: Option<u64>| match (diameter, ring) {
            (Some(diameter), Some(ring)) => (1..=orders).any(|o| excited_diameter(o, ring.sectors) as u64 == diameter),
            _ => true,
        };
        let mut series = frequencies(table, case_rows, x_factor, y_factor, &shown);
        let speeds = numbers(table, SPEED, case_rows.rows.clone());
        let (low, high) = speeds.iter().fold((f64::INFINITY, 0.0f64), |(low, high), v| (low.min(*v), high.max(*v)));
        let highest = series.iter().flat_map(|line| &line.y).copied().fold(0.0, f64::max);
        // Top of the panel as a multiple of the highest frequency.
        let top = 1.1 * highest;
        for order in 1..=orders {
            // the line ends at the highest speed or at the top of the panel
            let end = (high * x_factor).min(top * x_factor / (order as f64 * y_factor));
            let line = |speed: f64| order as f64 * speed / x_factor * y_factor;
            let ends = vec![low * x_factor, end.max(low * x_factor)];
            let y = ends.iter().map(|x| line(*x)).collect();
            series.push(Series::line(format!("engine orders 1 to {orders}"), ends, y, 0).reference());
        }
        if let Some((table, case_rows)) = crossings.zip(marks.iter().find(|marks| marks.case == case_rows.case)) {
            for (colour, state) in STATES.into_iter().enumerate() {
                let states = words(table, JOINTS);
                let rows: Vec<usize> = case_rows.rows.clone().filter(|row| states[*row] == state).collect();
                let column = |name: &str, factor: f64| -> Vec<f64> {
                    let all = numbers(table, name, 0..table.rows());
                    rows.iter().map(|row| all[*row] * factor).collect()
                };
                series.push(Series::marks("crossings", column(SPEED, x_factor), column(FREQUENCY, y_factor), colour));
            }
        }
        vec![Panel { title, x: x.clone(), y: y.clone().with_range(0.0, top), series, ..Panel::default() }]
    };
    Figure { panels: draw_panels::panels(drawing, &drawing.case_rows(table), &panel), ..Figure::default() }
}

fn frequencies(
    table: &Table,
    case_rows: &CaseRows,
    x_factor: f64,
    y_factor: f64,
    shown: &dyn Fn(Option<u64>) -> bool,
) -> Vec<Series> {
    let Some(modes) = table.integers(MODE) else { return Vec::new() };
    let (states, diameters) = (words(table, JOINTS), table.integers(DIAMETER));
    let diameter_and_mode = |row: usize| (diameters.map(|all| all[row]), modes[row]);
    let mut kinds: Vec<(Option<u64>, u64)> =
        case_rows.rows.clone().map(diameter_and_mode).filter(|(d, _)| shown(*d)).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let (x, y) = (numbers(table, SPEED, 0..table.rows()), numbers(table, FREQUENCY, 0..table.rows()));
    let mut series = Vec::new();
    for (colour, state) in STATES.into_iter().enumerate() {
        for kind in &kinds {
            let rows =
                || case_rows.rows.clone().filter(|row| diameter_and_mode(*row) == *kind && states[*row] == state);
            let line = Series::line(
                format!("joints {state}"),
                rows().map(|row| x[row] * x_factor).collect(),
                rows().map(|row| y[row] * y_factor).collect(),
                colour,
            );
            series.push(Series { style: if colour == 0 { Style::Solid } else { Style::Dashed }, ..line });
        }
    }
    series
}
