//! The figure of nonlinear modes.

use crate::kinds::shared::disk_shape::{self, PlaceInSectors};
use crate::results::columns::{amplitude_of, first_harmonic_of, phase_of};
use crate::results::dataset::{Axis, CellValues, Figure, Panel, Series, Table};
use crate::results::draw_panels;
use crate::results::drawing::{CaseRows, FigureInput, MAX_PANELS, join_title, largest, numbers};
use crate::syntax::format::{format_significant, prefixed_unit};

/// Draws the place that moves most at the largest amplitude of every case. For a disk it adds
/// the shapes at the smallest and largest amplitude.
pub(super) fn draw(drawing: &FigureInput<'_>) -> Figure {
    let (Some(table), Some(system)) = (drawing.table("modes"), drawing.system()) else { return Figure::default() };
    // results of earlier versions have only the first harmonic in this column
    let column = |place: &String| amplitude_of(place);
    let displacements: Vec<String> = system
        .places()
        .iter()
        .zip(system.place_axes())
        .filter(|(_, a)| !a.is_rotation())
        .map(|(name, _)| name.clone())
        .collect();
    let (x_axis, factor) = drawing.axis(0, "amplitude", largest(table, displacements.iter().map(column)), "m");
    let cases = drawing.case_rows(table);
    let parts = match table.columns.iter().find(|column| column.name == "stretch").map(|column| &column.values) {
        Some(CellValues::Integer(parts)) => parts.clone(),
        _ => vec![1; table.rows()],
    };
    let widest_of = |case_rows: &CaseRows| {
        let at_last = |place: &&String| numbers(table, &column(place), case_rows.rows.clone()).last().copied();
        let moves = |place: &&String| at_last(place).unwrap_or(0.0);
        displacements.iter().max_by(|a, b| moves(a).total_cmp(&moves(b)))
    };
    // draws in one band show one place: that of the first draw
    let common = cases.first().filter(|_| drawing.study.draws().is_some()).and_then(widest_of);
    let panel = |cases: &[CaseRows], title: &str, (quantity, unit_of): (&str, &str), read: &str, scale: f64| Panel {
        title: title.to_owned(),
        x: x_axis.clone().log(),
        y: Axis::new(quantity, unit_of),
        series: cases
            .iter()
            .enumerate()
            .flat_map(|(colour, case_rows)| {
                let Some(widest) = common.or_else(|| widest_of(case_rows)) else { return Vec::new() };
                // the curves of many draws form one band
                let alone = case_rows.varied.is_empty() || drawing.study.draws().is_some();
                let label = if alone { widest.clone() } else { case_rows.label() };
                let mut from = case_rows.rows.start;
                // the line is interrupted at turning points of the curve
                let lines = parts[case_rows.rows.clone()].chunk_by(|a, b| a == b).map(|part| {
                    let rows = from..from + part.len();
                    from = rows.end;
                    let x = numbers(table, &column(widest), rows.clone()).iter().map(|x| x * factor).collect();
                    let y = numbers(table, read, rows).iter().map(|y| y * scale).collect();
                    Series::line(label.clone(), x, y, colour)
                });
                lines.collect()
            })
            .collect(),
        ..Panel::default()
    };
    let both = |cases: &[CaseRows], title: &str| {
        let frequency = panel(cases, title, ("frequency", "Hz"), "frequency_Hz", 1.0);
        vec![frequency, panel(cases, title, ("equivalent damping ratio", "%"), "damping_ratio", 100.0)]
    };
    if drawing.study.draws().is_some() {
        let case_panels = |case_rows: &CaseRows, title: String| both(std::slice::from_ref(case_rows), &title);
        return Figure { panels: draw_panels::panels(drawing, &cases, &case_panels), ..Figure::default() };
    }
    let mut panels = both(&cases, "");
    if panels.len() + 2 * cases.len() <= MAX_PANELS {
        panels.extend(
            cases.iter().flat_map(|case_rows| disk_shapes(drawing, table, &displacements, case_rows, cases.len())),
        );
    }
    Figure { panels, ..Figure::default() }
}

/// Draws the shapes of a disk at the smallest amplitude, where joints stick, and at the
/// largest.
///
/// The colours begin after those of the `cases` curves.
fn disk_shapes(
    drawing: &FigureInput<'_>,
    table: &Table,
    places: &[String],
    case_rows: &CaseRows,
    cases: usize,
) -> Vec<Panel> {
    let Ok(case) = drawing.study.case(case_rows.case) else { return Vec::new() };
    let Some(ring) = case.model.ring else { return Vec::new() };
    let shown: Vec<&String> = places.iter().filter(|name| drawing.shows(name)).collect();
    let mode = format!("mode {}", case.values.count("mode").unwrap_or(1));
    let mut ends = vec![case_rows.rows.start, case_rows.rows.end - 1];
    ends.dedup();
    let shape_panel = |row: usize| {
        let at = |column: &str| numbers(table, column, row..row + 1)[0];
        let most = places.iter().map(|name| at(&amplitude_of(name))).fold(0.0, f64::max);
        let (unit, factor) = prefixed_unit(most, drawing.unit("m"));
        let words = format!("{mode} at {} {unit}", format_significant(most * factor, 3));
        let frequency = format!("{} Hz", format_significant(at("frequency_Hz"), 5));
        let size = |name: &str| match table.column(&first_harmonic_of(name)) {
            Some(_) => at(&first_harmonic_of(name)),
            None => at(&amplitude_of(name)),
        };
        let moves = shown.iter().map(|name| (name.as_str(), size(name), at(&phase_of(name))));
        disk_shape::panel(
            &PlaceInSectors::from_ring(moves)?,
            ring.sectors,
            join_title([case_rows.label(), words, frequency]),
            cases,
        )
    };
    ends.into_iter().filter_map(shape_panel).collect()
}
