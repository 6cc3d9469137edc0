//! The figure of performance curves.

use super::tables;
use crate::case::study::varied_text;
use crate::compile::compiled::RangeScale;
use crate::kinds::shared::points_to_doubt::PointsToDoubt;
use crate::results::columns::AMPLITUDE;
use crate::results::dataset::{Axis, Figure, Panel, Series};
use crate::results::drawing::{CaseRows, FigureInput, largest, numbers};
use crate::results::percentiles::percentiles;
use crate::syntax::format::plural_suffix;

pub(super) fn draw(drawing: &FigureInput<'_>) -> Figure {
    let (Some(table), outer) = (drawing.table(tables::PERFORMANCE), drawing.study.varied().len().saturating_sub(1))
    else {
        return Figure::default();
    };
    let cases = drawing.case_rows_by(table, outer);
    let Some(inner) = cases.first().and_then(|case_rows| case_rows.varied.last()) else { return Figure::default() };
    let (y_axis, factor) = drawing.axis(1, "resonance peak", largest(table, [AMPLITUDE.to_owned()]), "m");
    let column = inner.column().0;
    let unit = inner.file_unit_factor();
    let parameter = |table: &crate::results::dataset::Table, rows| {
        numbers(table, &column, rows).into_iter().map(|value| value * unit).collect::<Vec<f64>>()
    };
    let height = |table, rows| numbers(table, AMPLITUDE, rows).iter().map(|y| y * factor).collect::<Vec<f64>>();
    // several outer parameters have no common colour scale
    let varied = if outer == 1 { drawing.varied_axis(&cases, 0) } else { None };
    let value = |curve: usize| {
        let parameter = varied.as_ref().and(cases.get(curve))?.varied.first();
        parameter.map(|parameter| parameter.in_file_unit().0)
    };
    let spacing = drawing.study.value_counts().last().and_then(|(_, scale)| *scale);
    let x = Axis::new(&inner.name, inner.in_file_unit().1);
    let x = if spacing == Some(RangeScale::Log) { x.log() } else { x };
    let panel = |title: String, series| Panel { title, x: x.clone(), y: y_axis.clone(), series, ..Panel::default() };
    if drawing.study.draws().is_some() {
        // each entry holds all parameters but the last; its first case represents it
        let groups = drawing.group_draws(&cases);
        let draws = drawing.draws(groups.iter().map(|(_, group)| group.len()).max().unwrap_or(0));
        // Largest number of bands in the panel; more bands hide each other.
        let bands = groups.iter().take(7).enumerate().flat_map(|(colour, (_, group))| {
            let curve = |case_rows: &&CaseRows| {
                (parameter(table, case_rows.rows.clone()), height(table, case_rows.rows.clone()))
            };
            let outer = group.first().map_or(&[][..], |case_rows| {
                &case_rows.varied[drawing.study.drawn_parameter_count().min(outer)..outer]
            });
            percentiles(&group.iter().map(curve).collect::<Vec<_>>(), &varied_text(outer), colour)
        });
        return Figure { panels: vec![panel(draws, bands.collect())], ..Figure::default() };
    }
    let mut series = Vec::new();
    let failed =
        cases.iter().flat_map(|case_rows| height(table, case_rows.rows.clone())).filter(|y| y.is_nan()).count();
    let to_doubt = PointsToDoubt::of(table);
    for (colour, case_rows) in cases.iter().enumerate() {
        let doubtful: Vec<usize> = case_rows.rows.clone().filter(|row| to_doubt.rows.contains(row)).collect();
        let label = varied_text(&case_rows.varied[..outer]);
        let label = if label.is_empty() { "peak".to_owned() } else { label };
        let (x, y) = (parameter(table, case_rows.rows.clone()), height(table, case_rows.rows.clone()));
        let mut points: Vec<(f64, f64)> = x.into_iter().zip(y).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        if let Some(optima) = drawing.table(tables::OPTIMUM).filter(|optima| colour < optima.rows()) {
            // one row per curve; the refined optimum is a point of the line
            let best = (parameter(optima, colour..colour + 1)[0], height(optima, colour..colour + 1)[0]);
            if best.0.is_finite() {
                let index = points.partition_point(|point| point.0 < best.0);
                points.insert(index, best);
            }
        }
        let at = |of: &dyn Fn(usize) -> Vec<f64>| doubtful.iter().flat_map(|row| of(*row)).collect::<Vec<f64>>();
        let (doubtful_x, doubtful_y) =
            (at(&|row| parameter(table, row..row + 1)), at(&|row| height(table, row..row + 1)));
        let without: Vec<f64> = points.iter().filter(|point| point.1.is_nan()).map(|point| point.0).collect();
        let (x, y) = points.into_iter().unzip();
        series.push(Series { value: value(colour), ..Series::line(label, x, y, colour) });
        if doubtful_y.iter().any(|y| y.is_finite()) {
            series.push(Series::warning(to_doubt.label.clone(), doubtful_x, doubtful_y, colour));
        }
        if !without.is_empty() {
            let label = format!("{failed} point{} without a peak", plural_suffix(failed));
            series.push(Series::missing(label, without, colour + 1, colour));
        }
    }
    if let Some(optima) = drawing.table(tables::OPTIMUM) {
        // one row per curve
        for row in 0..optima.rows() {
            let (x, y) = (parameter(optima, row..row + 1), height(optima, row..row + 1));
            if x[0].is_finite() {
                series.push(Series { value: value(row), ..Series::marks("optimum", x, y, row) });
            }
        }
    }
    Figure { panels: vec![panel(String::new(), series)], varied, ..Figure::default() }
}
