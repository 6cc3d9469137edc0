//! The figure of an identification: measured rows as marks, the fitted model as a line with its
//! 95 % band, one panel per target and quantity.

use super::tables::FIT;
use crate::results::dataset::{Axis, Figure, Panel, Series, Table};
use crate::results::drawing::{CaseRows, FigureInput, MAX_PANELS, join_title, numbers, words};
use crate::syntax::format::prefixed_unit;
use std::ops::Range;

pub(super) fn draw(drawing: &FigureInput<'_>) -> Figure {
    let Some(table) = drawing.table(FIT) else { return Figure::default() };
    let cases = drawing.case_rows(table);
    let panels = cases.iter().flat_map(|case_rows| case_panels(table, case_rows)).take(MAX_PANELS);
    Figure { panels: panels.collect(), ..Figure::default() }
}

/// Returns the panels of one case: one for every target and quantity.
fn case_panels(table: &Table, case_rows: &CaseRows) -> Vec<Panel> {
    let (targets, quantities) = (words(table, "target"), words(table, "quantity"));
    if targets.is_empty() || quantities.is_empty() {
        return Vec::new();
    }
    let mut keys: Vec<(&str, &str)> = Vec::new();
    for row in case_rows.rows.clone() {
        let key = (targets[row].as_str(), quantities[row].as_str());
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    let several_targets = keys.iter().any(|key| key.0 != keys[0].0);
    let mut groups: Vec<f64> = Vec::new();
    for group in numbers(table, "group", case_rows.rows.clone()) {
        if !groups.contains(&group) {
            groups.push(group);
        }
    }
    let own = |key: &(&str, &str)| {
        let rows = case_rows.rows.clone().filter(|row| (targets[*row].as_str(), quantities[*row].as_str()) == *key);
        // the number of the target, and the name of its data
        let target = match key.0.split_once(' ') {
            Some((number, data)) if several_targets => format!("target {number}: {data}"),
            Some((_, data)) => data.to_owned(),
            None => key.0.to_owned(),
        };
        let title = join_title([case_rows.label(), target]);
        panel(table, &rows.collect::<Vec<_>>(), &groups, title)
    };
    keys.iter().filter_map(own).collect()
}

/// A quantity of a column name, and its unit.
fn axis_of(name: &str) -> (String, String) {
    let column = crate::results::dataset::Column::numbers(name, Vec::new());
    let unit = column.unit().unwrap_or_default();
    let written = unit.replace('/', "_per_").replace('^', "").replace(' ', "_");
    let quantity = name.strip_suffix(&written).unwrap_or(name).trim_end_matches('_');
    (quantity.replace('_', " "), unit)
}

/// Returns the panel of some rows. `all_groups` are the groups of the case; each has its colour.
fn panel(table: &Table, rows: &[usize], all_groups: &[f64], title: String) -> Option<Panel> {
    let first = *rows.first()?;
    let column = |name: &str| -> Vec<f64> {
        let all = numbers(table, name, Range { start: 0, end: table.rows() });
        rows.iter().map(|row| all[*row]).collect()
    };
    let (x, groups) = (column("x"), column("group"));
    let axis = |name: &str, values: &[f64]| {
        let (quantity, si) = axis_of(name);
        let largest =
            values.iter().filter(|value| value.is_finite()).fold(0.0f64, |largest, value| largest.max(value.abs()));
        // prefixes only for simple units
        let (unit, factor) =
            if ["m", "N", "s"].contains(&si.as_str()) { prefixed_unit(largest, &si) } else { (si, 1.0) };
        (Axis::new(quantity, unit), factor)
    };
    let (x_axis, x_factor) = axis(words(table, "x_name").get(first)?, &x);
    let measured = column("measured");
    let (y_axis, y_factor) = axis(words(table, "quantity").get(first)?, &measured);
    let is_predicted = words(table, "use").get(first).is_some_and(|word| word == "prediction");
    let scaled = |name: &str| -> Vec<f64> { column(name).iter().map(|value| value * y_factor).collect() };
    let (fitted, low, high) = (scaled("fitted"), scaled("fitted_low_95"), scaled("fitted_high_95"));
    let x: Vec<f64> = x.iter().map(|x| x * x_factor).collect();
    let measured: Vec<f64> = measured.iter().map(|value| value * y_factor).collect();
    let mut series = Vec::new();
    for (colour, group) in all_groups.iter().enumerate().filter(|(_, group)| groups.contains(group)) {
        let own: Vec<usize> = (0..rows.len()).filter(|i| groups[*i] == *group).collect();
        let of = |values: &[f64]| -> Vec<f64> { own.iter().map(|i| values[*i]).collect() };
        let name = |what: &str| if all_groups.len() > 1 { format!("{what}, {group}") } else { what.to_owned() };
        let model = if is_predicted { "predicted" } else { "fitted" };
        // a band over an abscissa that turns back would cross itself
        if of(&x).is_sorted() {
            series.push(Series::band("", of(&x), of(&low), of(&high), colour));
        }
        series.push(Series::line(name(model), of(&x), of(&fitted), colour));
        series.push(Series::marks(name("measured"), of(&x), of(&measured), colour));
    }
    Some(Panel { title, x: x_axis, y: y_axis, series, ..Panel::default() })
}
