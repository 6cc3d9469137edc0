//! The figure of maps: a heat map with contours for each combination of `vary`.

use super::MAP;
use super::contours::{Grid, levels};
use crate::case::study::VariedValue;
use crate::compile::compiled::RangeScale;
use crate::kinds::shared::points_to_doubt::PointsToDoubt;
use crate::results::columns::{AMPLITUDE, AT_RANGE_END};
use crate::results::dataset::{Axis, Emphasis, Figure, Panel, Scale, Series, Table};
use crate::results::drawing::{CaseRows, FigureInput, MAX_PANELS, evenly_chosen, join_title, largest, numbers};
use crate::syntax::format::plural_suffix;

pub(super) fn draw(drawing: &FigureInput<'_>) -> Figure {
    let counts = drawing.study.value_counts();
    let (Some(table), Some(outer)) = (drawing.table(MAP), counts.len().checked_sub(2)) else {
        return Figure::default();
    };
    let axes = &counts[outer..];
    if axes.iter().any(|(count, _)| *count < 2) {
        return Figure::default();
    }
    let (peak, factor) = drawing.axis(1, "resonance peak", largest(table, [AMPLITUDE.to_owned()]), "m");
    let maps = drawing.case_rows_by(table, outer);
    let to_doubt = PointsToDoubt::of(table);
    let panels = evenly_chosen(&maps, MAX_PANELS).into_iter().filter_map(|rows| {
        let map = Map { table, rows, columns: axes[1].0, factor };
        let grid = map.grid()?;
        let label = crate::case::study::varied_text(&rows.varied[..outer]);
        let axis = |which: usize, points: &[f64]| {
            let value = &rows.varied[outer + which];
            let axis = Axis::new(&value.name, value.in_file_unit().1);
            let axis = axis.with_range(points[0], points[points.len() - 1]);
            if axes[which].1 == Some(RangeScale::Log) { axis.log() } else { axis }
        };
        Some(panel(&grid, map.marks(&grid, &to_doubt), [axis(0, &grid.x), axis(1, &grid.y)], label, &peak.unit))
    });
    let mut panels: Vec<Panel> = panels.collect();
    if maps.len() > panels.len()
        && let Some(first) = panels.first_mut()
    {
        first.title = join_title([first.title.clone(), format!("{MAX_PANELS} of {} maps", maps.len())]);
    }
    Figure { panels, varied: Some(peak), ..Figure::default() }
}

/// The rows of one map. The first parameter changes slowest.
struct Map<'a> {
    table: &'a Table,
    rows: &'a CaseRows,
    /// Number of values of the second parameter.
    columns: usize,
    /// Factor from the peaks of the table to the axis.
    factor: f64,
}

impl Map<'_> {
    /// Returns the peaks on the grid of both parameters, in the units of the file. Rows that an
    /// interrupted run did not reach are NaN. `None` without two values of each parameter.
    fn grid(&self) -> Option<Grid> {
        let [first, second] = &self.rows.varied[self.rows.varied.len() - 2..] else { return None };
        let values = |parameter: &VariedValue| {
            let all = numbers(self.table, &parameter.column().0, self.rows.rows.clone());
            let factor = parameter.file_unit_factor();
            all.into_iter().map(|value| rounded(value * factor)).collect::<Vec<f64>>()
        };
        let peaks = numbers(self.table, AMPLITUDE, self.rows.rows.clone());
        let x: Vec<f64> = values(first).into_iter().step_by(self.columns).collect();
        let y: Vec<f64> = values(second).into_iter().take(self.columns).collect();
        let peak =
            |row: usize, column: usize| peaks.get(column * self.columns + row).map_or(f64::NAN, |p| p * self.factor);
        let values = (0..y.len()).map(|row| (0..x.len()).map(|column| peak(row, column)).collect()).collect();
        (x.len() > 1 && y.len() > 1).then_some(Grid { x, y, values })
    }

    /// Returns triangles at peaks to doubt, and a mark at the lowest peak.
    fn marks(&self, grid: &Grid, to_doubt: &PointsToDoubt) -> Vec<Series> {
        let rows = to_doubt.rows.range(self.rows.rows.clone()).map(|row| row - self.rows.rows.start);
        let cells = rows.map(|row| (row / self.columns, row % self.columns));
        let (x, y): (Vec<f64>, Vec<f64>) = cells
            .filter(|(column, row)| grid.values[*row][*column].is_finite())
            .map(|(column, row)| (grid.x[column], grid.y[row]))
            .unzip();
        let doubtful = (!x.is_empty()).then(|| Series::warning(to_doubt.label.clone(), x, y, 1));
        let lowest = self.lowest(grid).map(|[x, y]| {
            let ends = |values: &[f64]| [values.first().copied(), values.last().copied()];
            let at_edge = ends(&grid.x).contains(&Some(x)) || ends(&grid.y).contains(&Some(y));
            let place = if at_edge { " (at its edge: extend the range)" } else { "" };
            Series::marks(format!("lowest peak of the grid{place}"), vec![x], vec![y], 1)
        });
        doubtful.into_iter().chain(lowest).collect()
    }

    /// Returns the values of both parameters at the lowest peak. Largest amplitudes at an end of
    /// the frequency range may not be peaks and do not count.
    fn lowest(&self, grid: &Grid) -> Option<[f64; 2]> {
        let at_end = self.table.flags(AT_RANGE_END).unwrap_or_default();
        let is_peak = |(column, row): &(usize, usize)| {
            let at = self.rows.rows.start + column * self.columns + row;
            at_end.get(at) == Some(&Some(false)) && grid.values[*row][*column].is_finite()
        };
        let cells = (0..grid.x.len()).flat_map(|column| (0..grid.y.len()).map(move |row| (column, row)));
        let height = |(column, row): &(usize, usize)| grid.values[*row][*column];
        let lowest = cells.filter(is_peak).min_by(|a, b| height(a).total_cmp(&height(b)));
        lowest.map(|(column, row)| [grid.x[column], grid.y[row]])
    }
}

/// Removes the rounding error of a change of units.
fn rounded(value: f64) -> f64 {
    format!("{value:.12e}").parse().unwrap_or(value)
}

fn panel(grid: &Grid, marks: Vec<Series>, [x, y]: [Axis; 2], label: String, unit: &str) -> Panel {
    let edges = edges(&grid.y, y.scale);
    let mut series: Vec<Series> = grid
        .values
        .iter()
        .zip(edges.windows(2))
        .map(|(values, edge)| Series::tiles(grid.x.clone(), [edge[0], edge[1]], values.clone()))
        .collect();
    let mut title = label;
    if let Some(levels) = levels(grid.values.iter().flatten().copied()) {
        for level in levels.values {
            let [x, y] = grid.contour(level);
            series.push(Series { emphasis: Emphasis::Contour, ..Series::line("", x, y, 0) });
        }
        title = join_title([title, format!("contours every {} {unit}", levels.step)]);
    }
    let failed = grid.values.iter().flatten().filter(|peak| peak.is_nan()).count();
    if failed > 0 {
        title = join_title([title, format!("{failed} empty tile{} without a peak", plural_suffix(failed))]);
    }
    series.extend(marks);
    Panel { title, x, y, series, ..Panel::default() }
}

/// Returns the borders of the cells of ascending points. The first and the last border are at
/// the first and the last point.
fn edges(points: &[f64], scale: Scale) -> Vec<f64> {
    let middle = |pair: &[f64]| match scale {
        Scale::Linear => 0.5 * (pair[0] + pair[1]),
        Scale::Log => (pair[0] * pair[1]).sqrt(),
    };
    let ends = [points.first(), points.last()].map(|end| end.copied().unwrap_or_default());
    std::iter::once(ends[0]).chain(points.windows(2).map(middle)).chain([ends[1]]).collect()
}
