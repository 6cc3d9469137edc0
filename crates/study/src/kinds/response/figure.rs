//! The figure of a response.

use super::figure_data::{CasePeak, FigureData, force};
use super::{amplification, tables};
use crate::kinds::shared::contact_states;
use crate::kinds::shared::points_to_doubt::PointsToDoubt;
use crate::results::columns::{AMPLITUDE, AT_RANGE_END, FREQUENCY as DRIVE, REVERSE_SWEEP, amplitude_of};
use crate::results::dataset::{Axis, Figure, Panel, Sharing, Table};
use crate::results::drawing::{CaseRows, FigureInput, MAX_PANELS, PanelLayout, join_title, largest, numbers, words};
use crate::results::histogram;
use crate::syntax::format::prefixed_unit;

pub(super) fn draw(drawing: &FigureInput<'_>) -> Figure {
    let (Some(curve), Some(system)) = (drawing.table(tables::CURVE), drawing.system()) else {
        return Figure::default();
    };
    let shown = drawing.displacements(&system);
    // with `output = "joint_force"` only
    let names = system.joints().iter().flat_map(|joint| joint.labels());
    let joints: Vec<String> =
        names.filter(|name| drawing.shows(name) && curve.numbers(&force(name)).is_some()).collect();
    // with `output = "contact"` only
    let names = system.joints().iter().map(|joint| joint.name().to_owned());
    let faces: Vec<String> = names.filter(|name| drawing.shows(name) && contact_states::has(curve, name)).collect();
    if shown.is_empty() && joints.is_empty() && faces.is_empty() {
        return Figure::default();
    }
    let columns = || shown.iter().map(|(name, _)| amplitude_of(name));
    let (x, x_factor) = drawing.axis(0, "frequency", largest(curve, [DRIVE.to_owned()]), "Hz");
    let tables = [Some(curve), drawing.table(tables::REVERSE_SWEEP)];
    let highest = tables.into_iter().flatten().map(|table| largest(table, columns())).fold(0.0, f64::max);
    let (y, y_factor) = drawing.axis(1, "amplitude", highest, "m");
    let (unit, force_factor) =
        prefixed_unit(largest(curve, joints.iter().map(|joint| force(joint))), drawing.unit("N"));
    let cases = drawing.case_rows(curve);
    let mut drawn = FigureData {
        drawing,
        curve,
        index: curve.index(),
        reverse_sweep: drawing.table(tables::REVERSE_SWEEP).map(|table| (table, drawing.case_rows(table))),
        references: drawing.table(tables::REFERENCES).map(|table| (table, reference_rows(drawing, table))),
        peaks: peaks_by_case(drawing),
        shapes: drawing.table(tables::SHAPES).map(|table| (table, drawing.case_rows(table))),
        factor: (x_factor, y_factor),
        force_factor,
        axes: (x, y),
        // a force between zero and its limit needs no logarithmic axis
        force_axis: Axis::new("joint force", unit),
        system: &system,
        shown,
        joints,
        contact_joints: faces,
        failed: 0,
        to_doubt: PointsToDoubt::of(curve),
        case_count_text: drawing.shown_cases_text(cases.len()),
    };
    drawn.failed = cases.iter().map(|case_rows| drawn.without_orbit(case_rows).len()).sum();
    let mut figure = match drawing.layout(drawn.shown.len(), cases.len(), drawn.panels_of_a_case()) {
        PanelLayout::Cases => {
            // the colour scale belongs to maps; the curves of one panel have names
            let varied = (!drawn.contact_joints.is_empty()).then(|| contact_states::axis("share of the period"));
            Figure { panels: drawn.panels_by_case(&cases), varied, ..Figure::default() }
        }
        PanelLayout::Masses => Figure {
            panels: drawn.panels_by_place(&cases),
            sharing: Sharing::Always,
            varied: drawing.varied_axis(&cases, drawing.study.varied().len().saturating_sub(1)),
            ..Figure::default()
        },
    };
    let amplified = amplification::panels(drawing);
    figure.panels.extend(if amplified.is_empty() { heights(&drawn) } else { amplified });
    figure.panels.truncate(MAX_PANELS);
    figure
}

/// Draws histograms of the largest peak of many draws.
fn heights(drawn: &FigureData<'_>) -> Vec<Panel> {
    let (Some(table), Some(_)) = (drawn.drawing.table(tables::PEAKS), drawn.drawing.study.draws()) else {
        return Vec::new();
    };
    let cases = drawn.drawing.case_rows(table);
    let x = Axis { quantity: "largest peak".to_owned(), ..Axis::new("", &drawn.axes.1.unit) };
    let group_panel = |(words, group): (String, Vec<&CaseRows>)| {
        let highest = |case_rows: &&CaseRows| {
            let heights = numbers(table, AMPLITUDE, case_rows.rows.clone());
            heights.into_iter().fold(f64::NAN, f64::max) * drawn.factor.1
        };
        let heights: Vec<f64> = group.iter().map(highest).collect();
        histogram::panel(&heights, &x, &join_title([words, "largest peak".to_owned()]), "draws")
    };
    drawn.drawing.group_draws(&cases).into_iter().filter_map(group_panel).collect()
}

/// Returns the rows of the linear references case by case.
///
/// Results of earlier versions have only those of the first case, without varied parameters.
fn reference_rows(drawing: &FigureInput<'_>, table: &Table) -> Vec<CaseRows> {
    let varied = drawing.study.varied_values(0).unwrap_or_default();
    if table.columns.first().is_some_and(|column| column.name == DRIVE) {
        return vec![CaseRows { case: 0, varied, rows: 0..table.rows() }];
    }
    drawing.case_rows(table)
}

/// Returns the peaks inside the frequency range.
fn peaks_by_case(drawing: &FigureInput<'_>) -> Vec<CasePeak> {
    let Some(table) = drawing.table(tables::PEAKS) else { return Vec::new() };
    let at_end = table.flags(AT_RANGE_END).unwrap_or_default();
    let reverse_sweep = table.flags(REVERSE_SWEEP).unwrap_or_default();
    let masses = words(table, tables::MASS);
    // a table from another source may lack columns
    if masses.len() != table.rows() {
        return Vec::new();
    }
    let mut peaks = Vec::new();
    for case_rows in drawing.case_rows(table) {
        let (x, y) = (numbers(table, DRIVE, case_rows.rows.clone()), numbers(table, AMPLITUDE, case_rows.rows.clone()));
        for (i, row) in case_rows.rows.clone().enumerate() {
            if at_end.get(row) == Some(&Some(false)) {
                let is_reverse = reverse_sweep.get(row).copied().flatten() == Some(true);
                peaks.push(CasePeak {
                    case: case_rows.case,
                    mass: masses[row].clone(),
                    at: (x[i], y[i]),
                    reverse_sweep: is_reverse,
                });
            }
        }
    }
    peaks
}
