//! The figure of orbits.

use crate::results::dataset::{Axis, Figure, Panel, Series};
use crate::results::draw_panels;
use crate::results::drawing::{CaseRows, FigureInput, MAX_PANELS, join_title, largest, numbers};
use crate::syntax::format::{format_hertz, prefixed_unit};
use std::collections::BTreeSet;
use std::ops::Range;

/// Largest number of curves in a panel: more have no colours and line styles of their own.
pub(super) const MAX_CURVES: usize = 12;

/// Returns the indices of the curves with the largest range, ascending.
fn largest_ranges(curves: &[Vec<f64>]) -> Vec<usize> {
    let largest = |curve: &[f64], sign: f64| curve.iter().map(|y| sign * y).fold(f64::NEG_INFINITY, f64::max);
    let range = |index: usize| largest(&curves[index], 1.0) + largest(&curves[index], -1.0);
    let mut shown: Vec<usize> = (0..curves.len()).collect();
    shown.sort_by(|&a, &b| range(b).total_cmp(&range(a)));
    shown.truncate(MAX_CURVES);
    shown.sort_unstable();
    shown
}

/// Returns true for a direction of a node of a contact between faces, such as `pad_71_a.n` of the
/// joint `pad_71`.
fn is_contact_node(direction: &str, joints: &BTreeSet<&str>) -> bool {
    let place = direction.split('.').next().unwrap_or_default();
    let joint = place.strip_suffix("_a").or_else(|| place.strip_suffix("_b"));
    joint.is_some_and(|name| joints.contains(name))
}

/// Draws displacements of the places and forces of the joints over time: two panels per orbit.
/// Nodes of contacts between faces are left out if other places are observed.
pub(super) fn draw(drawing: &FigureInput<'_>) -> Figure {
    let (Some(motion), Some(system)) = (drawing.table("orbit"), drawing.system()) else { return Figure::default() };
    // a table from another source may lack columns
    let Some(frequencies) = motion.numbers("frequency_Hz") else { return Figure::default() };
    let times_of = |rows: Range<usize>| numbers(motion, "time_s", rows);
    let longest = times_of(0..motion.rows()).into_iter().fold(0.0, f64::max);
    let joint_names: BTreeSet<&str> = system.joints().iter().map(|joint| joint.name()).collect();
    let orbit_panels = |title: &str, rows: Range<usize>| {
        let times = times_of(rows.clone());
        // draws in one panel share one unit
        let last = if drawing.study.draws().is_some() { longest } else { times.last().copied().unwrap_or(0.0) };
        let (time_unit, time_factor) = prefixed_unit(last, "s");
        let x: Vec<f64> = times.iter().map(|time| time * time_factor).collect();
        let panel = |what: &str, si: &str, names: Vec<&str>, column: &str, colour: usize| {
            let columns: Vec<String> = names.iter().map(|name| format!("{name}_{column}")).collect();
            let (unit, factor) = prefixed_unit(largest(motion, columns.clone()), si);
            let curves: Vec<Vec<f64>> = columns.iter().map(|column| numbers(motion, column, rows.clone())).collect();
            let shown = largest_ranges(&curves);
            let line = |(i, &column): (usize, &usize)| {
                let y = curves[column].iter().map(|value| value * factor).collect();
                Series::line(names[column], x.clone(), y, colour + i)
            };
            let selection = match curves.len() {
                all if all > shown.len() => format!("{} of {all} with the largest range, ", shown.len()),
                _ => String::new(),
            };
            Panel {
                title: format!("{what}, {selection}{title}"),
                x: Axis::new("time", time_unit.clone()),
                y: Axis::new(what, unit),
                series: shown.iter().enumerate().map(line).collect(),
                ..Panel::default()
            }
        };
        let mut panels = Vec::new();
        if !system.places().is_empty() {
            let shown = drawing.displacements(&system);
            let all = || shown.iter().map(|(name, _)| name.as_str());
            let own: Vec<&str> = all().filter(|name| !is_contact_node(name, &joint_names)).collect();
            let names = if own.is_empty() { all().collect() } else { own };
            panels.push(panel("displacement", drawing.unit("m"), names, "displacement_m", 0));
        }
        if !system.joints().is_empty() {
            let labels: Vec<String> = system.joints().iter().flat_map(|joint| joint.labels()).collect();
            let names = labels.iter().map(String::as_str).filter(|name| drawing.shows(name)).collect();
            panels.push(panel("joint force", drawing.unit("N"), names, "force_N", system.places().len()));
        }
        panels.retain(|panel| !panel.series.is_empty());
        panels
    };
    let case_panels = |case_rows: &CaseRows, title: String| -> Vec<Panel> {
        let mut from = case_rows.rows.start;
        let runs = frequencies[case_rows.rows.clone()].chunk_by(|a, b| a == b).take(MAX_PANELS);
        let run_panels = |run: &[f64]| {
            let rows = from..from + run.len();
            from = rows.end;
            orbit_panels(&join_title([title.clone(), format_hertz(run[0])]), rows)
        };
        runs.flat_map(run_panels).collect()
    };
    let mut panels = draw_panels::panels(drawing, &drawing.case_rows(motion), &case_panels);
    panels.truncate(MAX_PANELS);
    Figure { panels, ..Figure::default() }
}
