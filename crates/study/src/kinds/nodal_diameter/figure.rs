//! The figure of frequencies over nodal diameters.

use super::{DIAMETER, JOINTS, MAX_SHAPES, MODE, SHAPES, STATES, TABLE, places};
use crate::kinds::shared::disk_shape::{self, PlaceInSectors};
use crate::results::columns::{FREQUENCY, phase_of, shape_of};
use crate::results::dataset::{Axis, Figure, Panel, Series, Style, Table};
use crate::results::draw_panels;
use crate::results::drawing::{CaseRows, FigureInput, MAX_PANELS, join_title, largest, numbers, words};
use crate::syntax::format::format_significant;

/// Draws a panel per case: a line with marks for every mode, with joints free and joints stuck.
///
/// Shapes follow if the figure has room.
pub(super) fn draw(drawing: &FigureInput<'_>) -> Figure {
    let Some(table) = drawing.table(TABLE) else { return Figure::default() };
    let (y, factor) = drawing.axis(1, "frequency", largest(table, [FREQUENCY.to_owned()]), "Hz");
    let panel = |case_rows: &CaseRows, title: String| Panel {
        title,
        x: Axis::new("nodal diameters", "").with_whole_numbers(),
        y: y.clone(),
        series: lines(table, case_rows, factor),
        ..Panel::default()
    };
    let cases = drawing.case_rows(table);
    let shapes_fit = cases.len() * (1 + MAX_SHAPES) <= MAX_PANELS;
    let case_panels = |case_rows: &CaseRows, title: String| {
        let shapes = if shapes_fit { wheels(drawing, table, case_rows) } else { Vec::new() };
        std::iter::once(panel(case_rows, title)).chain(shapes).collect::<Vec<_>>()
    };
    Figure { panels: draw_panels::panels(drawing, &cases, &case_panels), ..Figure::default() }
}

/// Returns the shapes of a case.
///
/// These are the lowest modes of one nodal diameter, one mode of the lowest nodal diameters, or
/// one mode of one nodal diameter.
fn wheels(drawing: &FigureInput<'_>, table: &Table, case_rows: &CaseRows) -> Vec<Panel> {
    let Ok(case) = drawing.study.case(case_rows.case) else { return Vec::new() };
    let (Some(ring), values) = (case.model.ring, &case.values) else { return Vec::new() };
    let (Some(diameters), Some(modes)) = (table.integers(DIAMETER), table.integers(MODE)) else { return Vec::new() };
    if values.flag(SHAPES) == Some(false) {
        return Vec::new();
    }
    let (diameter, mode) = (values.count(DIAMETER), values.count(MODE));
    let state = values.text(JOINTS).unwrap_or(STATES[0]);
    let wanted = |row: &usize| {
        words(table, JOINTS).get(*row).is_some_and(|joints| joints == state)
            && diameter.is_none_or(|diameter| diameters[*row] == diameter)
            && match mode {
                Some(mode) => modes[*row] == mode,
                None => diameter.is_some() || modes[*row] == 1,
            }
    };
    let frequencies = numbers(table, FREQUENCY, 0..table.rows());
    let places: Vec<(String, String)> = places(&case.model)
        .into_iter()
        .filter(|(name, _)| drawing.shows(name) && !case.model.is_rotation(name))
        .collect();
    let shape_panel = |row: usize| {
        let (mode, diameter) = (modes[row], diameters[row]);
        let at = |column: &str| numbers(table, column, row..row + 1)[0];
        let place_in_sectors = |(_, place): &(String, String)| {
            let (size, phase) = (at(&shape_of(place)), at(&phase_of(place)));
            PlaceInSectors::from_wave(place.clone(), size, phase, diameter as usize, ring.sectors)
        };
        let many = if diameter == 1 { "" } else { "s" };
        let frequency = format!("{} Hz", format_significant(frequencies[row], 5));
        let joints = if state == STATES[0] { String::new() } else { format!("joints {state}") };
        let title =
            [case_rows.label(), format!("mode {mode}"), format!("{diameter} nodal diameter{many}"), frequency, joints];
        disk_shape::panel(
            &places.iter().map(place_in_sectors).collect::<Vec<_>>(),
            ring.sectors,
            join_title(title),
            STATES.len(),
        )
    };
    case_rows.rows.clone().filter(wanted).take(MAX_SHAPES).filter_map(shape_panel).collect()
}

fn lines(table: &Table, case_rows: &CaseRows, factor: f64) -> Vec<Series> {
    let (Some(diameters), Some(modes)) = (table.integers(DIAMETER), table.integers(MODE)) else { return Vec::new() };
    let states = words(table, JOINTS);
    let frequencies = numbers(table, FREQUENCY, 0..table.rows());
    let highest = case_rows.rows.clone().map(|row| modes[row]).max().unwrap_or(0);
    let mut series = Vec::new();
    for (colour, state) in STATES.into_iter().enumerate() {
        for mode in 1..=highest {
            let rows = || case_rows.rows.clone().filter(|row| modes[*row] == mode && states[*row] == state);
            let x: Vec<f64> = rows().map(|row| diameters[row] as f64).collect();
            let y: Vec<f64> = rows().map(|row| frequencies[row] * factor).collect();
            let style = if colour == 0 { Style::Solid } else { Style::Dashed };
            let line = Series::line(format!("joints {state}"), x.clone(), y.clone(), colour);
            series.push(Series { style, ..line });
            series.push(Series::marks("", x, y, colour));
        }
    }
    series
}
