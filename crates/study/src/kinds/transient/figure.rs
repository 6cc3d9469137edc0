//! The figure of a transient.

use super::TIME;
use crate::results::dataset::{Axis, Figure, Panel, Series, Table};
use crate::results::draw_panels;
use crate::results::drawing::{
    CaseRows, FigureInput, MAX_CURVES, MAX_PANELS, evenly_chosen, join_title, largest, numbers, words,
};
use crate::syntax::format::{format_hertz, prefixed_unit};
use std::ops::Range;

/// Draws damping over amplitude, cycle by cycle, of the place that moves most, with a curve for
/// every case.
fn damping(drawing: &FigureInput<'_>, table: &Table, places: &[String]) -> Panel {
    let (unit, factor) = prefixed_unit(largest(table, ["amplitude_m".to_owned()]), drawing.unit("m"));
    let cases = drawing.case_rows(table);
    let line = |(colour, case_rows): (usize, &&CaseRows)| {
        let x = numbers(table, "amplitude_m", case_rows.rows.clone()).iter().map(|x| x * factor).collect();
        let y = numbers(table, "damping_ratio", case_rows.rows.clone()).iter().map(|y| 100.0 * y).collect();
        let place = words(table, "mass").get(case_rows.rows.start).cloned().unwrap_or_default();
        // a single case has the colour of its place in the other panels
        if case_rows.varied.is_empty() {
            let colour = places.iter().position(|name| *name == place).unwrap_or(colour);
            return Series::line(place, x, y, colour);
        }
        Series::line(case_rows.label(), x, y, colour)
    };
    Panel {
        title: "damping of each cycle".to_owned(),
        x: Axis::new("amplitude", unit).log(),
        y: Axis::new("equivalent damping ratio", "%"),
        series: evenly_chosen(&cases, MAX_CURVES).iter().enumerate().map(line).collect(),
        ..Panel::default()
    }
}

/// Draws a panel for every case and frequency, with a line for every place.
pub(super) fn draw(drawing: &FigureInput<'_>) -> Figure {
    let (Some(motion), Some(system)) = (drawing.table("motion"), drawing.system()) else { return Figure::default() };
    let drives = motion.numbers("drive_frequency_Hz");
    let column = |place: &String| format!("{place}_displacement_m");
    let panel = |title: String, rows: Range<usize>| {
        // draws in one panel share one unit
        let scope = if drawing.study.draws().is_some() { 0..motion.rows() } else { rows.clone() };
        let shown = drawing.displacements(&system);
        let places = system.places().iter().zip(system.place_axes()).filter(|(_, along)| !along.is_rotation());
        let all = places.flat_map(|(place, _)| numbers(motion, &column(place), scope.clone()));
        let highest = all.map(f64::abs).filter(|x| x.is_finite()).fold(0.0, f64::max);
        let (y, factor) = drawing.axis(1, "displacement", highest, "m");
        let last = numbers(motion, TIME, scope.clone()).into_iter().fold(0.0, f64::max);
        let (x, x_factor) = drawing.axis(0, "time", last, "s");
        let times: Vec<f64> = numbers(motion, TIME, rows.clone()).iter().map(|time| time * x_factor).collect();
        let line = |(place, i): &(String, usize)| {
            let displacement = numbers(motion, &column(place), rows.clone());
            Series::line(place, times.clone(), displacement.iter().map(|y| y * factor).collect(), *i)
        };
        Panel { title, x, y, series: shown.iter().map(line).collect(), ..Panel::default() }
    };
    let case_panels = |case_rows: &CaseRows, title: String| -> Vec<Panel> {
        let Some(drives) = drives else { return vec![panel(title, case_rows.rows.clone())] };
        let mut from = case_rows.rows.start;
        let drive_panels = |run: &[f64]| {
            let rows = from..from + run.len();
            from = rows.end;
            panel(join_title([title.clone(), format!("frequency = {}", format_hertz(run[0]))]), rows)
        };
        let runs = drives[case_rows.rows.clone()].chunk_by(|a, b| a == b);
        runs.take(MAX_PANELS).map(drive_panels).collect()
    };
    let mut panels = draw_panels::panels(drawing, &drawing.case_rows(motion), &case_panels);
    panels.truncate(MAX_PANELS);
    if let Some(decay) = drawing.table("decay").filter(|_| drawing.study.draws().is_none() && panels.len() < MAX_PANELS)
    {
        panels.push(damping(drawing, decay, system.places()));
    }
    Figure { panels, ..Figure::default() }
}
