//! The figure of branches.

use super::{abscissa_column, split_varied};
use crate::case::study::varied_text;
use crate::kinds::shared::peak_of::{displacements, peak_places};
use crate::results::dataset::{Axis, Figure, Panel, Series, Style, Table};
use crate::results::draw_panels;
use crate::results::drawing::{CaseRows, FigureInput, largest, numbers};
use crate::run::work::PreparedCase;

/// Draws the branches; with several branches, only the place whose peak counts.
pub(super) fn draw(drawing: &FigureInput<'_>) -> Figure {
    let (Some(table), Ok(prepared)) = (drawing.table("branch"), PreparedCase::new(drawing.study, 0)) else {
        return Figure::default();
    };
    let (system, places) = (&prepared.system, peak_places(&prepared));
    let (outer, along) = split_varied(drawing.study, &prepared.case.varied);
    let column = |place: usize| format!("{}_amplitude_m", system.places()[place]);
    let all = displacements(system);
    let (y, factor) = drawing.axis(1, "amplitude", largest(table, all.iter().copied().map(column)), "m");
    let (name, _) = abscissa_column(along);
    let along_unit = along.map_or("Hz".to_owned(), |parameter| parameter.in_axis_unit().1);
    let cases = drawing.case_rows_by(table, outer.len());
    let one = cases.len() == 1;
    let names: Vec<&str> = places.iter().map(|place| system.places()[*place].as_str()).collect();
    let y = if one { y } else { Axis { quantity: format!("amplitude of {}", names.join(", ")), ..y } };
    // with several branches, the curve is the largest amplitude of the places whose peak counts
    let shown: Vec<Vec<usize>> = match one {
        true => drawing.displacements(system).into_iter().map(|(_, place)| vec![place]).collect(),
        false => vec![places],
    };
    let unstable = unstable_rows(table);
    let line_of = |case_rows: &CaseRows, places: &[usize], label: &str, colour: usize| -> Vec<Series> {
        let mut from = case_rows.rows.start;
        // between two equal values at an end of the range, the branch runs outside the range
        let abscissae = numbers(table, &name_of_axis(table, outer.len()), case_rows.rows.clone());
        let leaves = |row: usize| row > 0 && abscissae[row - 1] == abscissae[row];
        let rows: Vec<usize> = (0..case_rows.rows.len()).collect();
        let unstable = &unstable[case_rows.rows.clone()];
        // unstable runs are dashed; each run begins at the last point of the previous one
        let runs = rows.chunk_by(|a, b| unstable[*a] == unstable[*b] && !leaves(*b)).map(|rows| {
            let run = &unstable[rows[0]..];
            let joined = usize::from(rows[0] > 0 && !leaves(rows[0]));
            let shown = from - joined..from + rows.len();
            from += rows.len();
            let all: Vec<Vec<f64>> = places.iter().map(|p| numbers(table, &column(*p), shown.clone())).collect();
            let largest = |i: usize| all.iter().map(|y| y[i]).fold(f64::NAN, f64::max);
            let y = (0..shown.len()).map(|i| largest(i) * factor).collect();
            let label = if run[0] { format!("{label}, unstable") } else { label.to_owned() };
            let line = Series::line(label, numbers(table, &name_of_axis(table, outer.len()), shown), y, colour);
            if run[0] { Series { style: Style::Dashed, ..line } } else { line }
        });
        runs.collect()
    };
    let quantity = if along.is_some() { name } else { "frequency".to_owned() };
    let x = Axis::new(quantity, along_unit);
    let panel = |title: String, series| Panel { title, x: x.clone(), y: y.clone(), series, ..Panel::default() };
    if drawing.study.draws().is_some() {
        let name = |places: &[usize]| {
            places.iter().map(|place| system.places()[*place].as_str()).collect::<Vec<_>>().join(", ")
        };
        let case_panels = |case_rows: &CaseRows, title: String| {
            let lines =
                shown.iter().enumerate().flat_map(|(colour, places)| line_of(case_rows, places, &name(places), colour));
            vec![panel(title, lines.collect())]
        };
        // the parameter along the branch does not distinguish draws
        let separate_cases: Vec<CaseRows> = cases
            .iter()
            .map(|case_rows| CaseRows { varied: case_rows.varied[..outer.len()].to_vec(), ..case_rows.clone() })
            .collect();
        return Figure { panels: draw_panels::panels(drawing, &separate_cases, &case_panels), ..Figure::default() };
    }
    let several = cases.iter().flat_map(|case_rows| shown.iter().map(move |places| (case_rows, places)));
    let line = |(colour, (case_rows, places)): (usize, (&CaseRows, &Vec<usize>))| {
        let varied = || varied_text(&case_rows.varied[..outer.len()]);
        let label = if one { system.places()[places[0]].clone() } else { varied() };
        line_of(case_rows, places, &label, colour)
    };
    let series = several.enumerate().flat_map(line).collect();
    Figure { panels: vec![panel(String::new(), series)], ..Figure::default() }
}

/// Returns the name of the column along the branch, which follows the outer varied parameters.
fn name_of_axis(table: &Table, outer: usize) -> String {
    table.columns.get(outer).map_or_else(String::new, |column| column.name.clone())
}

/// Returns for every row whether it is known to be unstable.
fn unstable_rows(table: &Table) -> Vec<bool> {
    match table.flags("stable") {
        Some(flags) => flags.iter().map(|stable| *stable == Some(false)).collect(),
        None => vec![false; table.rows()],
    }
}
