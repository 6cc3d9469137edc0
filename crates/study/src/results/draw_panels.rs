//! Panels of many random draws in place of the panels of one case.
//!
//! Curves over an abscissa become their median and a band, point by point. A band has no
//! meaning in three cases: a curve turns back (a loop, a branch around a fold); draws show
//! different curves (one has an unstable part); or each draw has a different abscissa (a
//! branch with adaptive steps). Then every draw is drawn as a pale curve. Pictures of a plane
//! are left out, and so are marks and bars whose abscissae differ between draws; the tables
//! have them.

use crate::results::dataset::{Emphasis, Panel, Series, Style};
use crate::results::drawing::{CaseRows, FigureInput, MAX_CURVES, MAX_PANELS, evenly_chosen, join_title};
use crate::results::percentiles::percentiles;

/// Returns the panels of all cases, as `of_case` draws them under a title.
///
/// For draws, returns the combined panels of each combination of `vary`.
pub(crate) fn panels(
    drawing: &FigureInput<'_>,
    cases: &[CaseRows],
    of_case: &dyn Fn(&CaseRows, String) -> Vec<Panel>,
) -> Vec<Panel> {
    if drawing.study.draws().is_none() {
        let cases = cases.iter().take(MAX_PANELS);
        return cases.flat_map(|case_rows| of_case(case_rows, case_rows.label())).collect();
    }
    let group_panels = |(words, group): (String, Vec<&CaseRows>)| -> Vec<Panel> {
        let title = join_title([words, drawing.draws(group.len())]);
        let cases: Vec<Vec<Panel>> = group.iter().map(|case_rows| of_case(case_rows, title.clone())).collect();
        let most = cases.iter().map(Vec::len).max().unwrap_or(0);
        let same = |at: usize| cases.iter().filter_map(|case| case.get(at)).collect::<Vec<_>>();
        (0..most).filter_map(|at| combine_draws(&same(at))).collect()
    };
    drawing.group_draws(cases).into_iter().take(MAX_PANELS).flat_map(group_panels).take(MAX_PANELS).collect()
}

/// Combines the panels of all draws into one; returns `None` for pictures.
fn combine_draws(draws: &[&Panel]) -> Option<Panel> {
    let first = draws.first().filter(|panel| !panel.equal_axes)?;
    let lines: Vec<Vec<&Series>> = draws.iter().map(|panel| curves(panel, is_line)).collect();
    let is_same_line = |one: &[&Series]| {
        let same = |(a, b): (&&Series, &&Series)| a.label == b.label && a.style == b.style;
        one.len() == lines[0].len() && one.iter().zip(&lines[0]).all(same)
    };
    let rises = |line: &&Series| line.x.is_sorted();
    let common = |one: &[&Series]| one.iter().zip(&lines[0]).all(|(line, first)| is_as_fine_as(&first.x, &line.x));
    let bands = lines.iter().all(|one| is_same_line(one) && one.iter().all(rises) && common(one));
    let mut series: Vec<Series> =
        first.series.iter().filter(|series| series.emphasis == Emphasis::Reference).cloned().collect();
    let pairs: Vec<Vec<Series>> =
        if bands { (0..lines[0].len()).map(|at| band_and_median(&lines, at)).collect() } else { Vec::new() };
    // draws whose abscissae do not overlap leave an empty band
    if bands && pairs.iter().flatten().all(|series| !series.x.is_empty()) {
        // bands first, so that they do not hide the medians
        series.extend(pairs.iter().flat_map(|pair| pair.first()).cloned());
        series.extend(pairs.iter().flat_map(|pair| pair.get(1)).cloned());
        series.extend(mark_medians(draws));
    } else {
        let shown = evenly_chosen(&lines, MAX_CURVES);
        series.extend(shown.into_iter().flatten().map(|line| (*line).clone().pale()));
    }
    let ends = draws.iter().map(|panel| panel.y.range).reduce(|a, b| {
        let ([a_low, a_high], [b_low, b_high]) = (a?, b?);
        Some([a_low.min(b_low), a_high.max(b_high)])
    });
    let mut panel = Panel { series, ..(*first).clone() };
    panel.y.range = ends.flatten();
    Some(panel)
}

/// Returns true if `grid` is as fine as the points `x`, so that a curve over `grid` loses no
/// detail.
///
/// Adaptive steps fail this test: they put many points where other curves have few.
fn is_as_fine_as(grid: &[f64], x: &[f64]) -> bool {
    let mut cells = x.chunk_by(|a, b| grid.partition_point(|at| at < a) == grid.partition_point(|at| at < b));
    // Largest number of points of a curve between two adjacent abscissae of a common grid. Two
    // evenly spaced grids satisfy this.
    cells.all(|cell| cell.len() <= 2)
}

fn is_line(style: Style) -> bool {
    matches!(style, Style::Solid | Style::Dashed | Style::Dotted)
}

/// Returns the results of a panel with one of these styles.
fn curves(panel: &Panel, of: fn(Style) -> bool) -> Vec<&Series> {
    panel.series.iter().filter(|series| series.emphasis == Emphasis::Normal && of(series.style)).collect()
}

/// Returns band and median of one line of all draws.
fn band_and_median(lines: &[Vec<&Series>], at: usize) -> Vec<Series> {
    let line = lines[0][at];
    let all: Vec<(Vec<f64>, Vec<f64>)> = lines.iter().map(|one| (one[at].x.clone(), one[at].y.clone())).collect();
    let mut pair = percentiles(&all, &line.label, line.colour);
    pair.iter_mut().filter(|series| series.style != Style::Band).for_each(|median| median.style = line.style);
    pair
}

/// Returns the medians of marks and bars that have the same abscissae in all draws.
fn mark_medians(draws: &[&Panel]) -> Vec<Series> {
    let points: Vec<Vec<&Series>> =
        draws.iter().map(|panel| curves(panel, |style| matches!(style, Style::Marks | Style::Bars))).collect();
    let at = |at: usize| {
        let own = *points[0].get(at)?;
        let all: Option<Vec<(Vec<f64>, Vec<f64>)>> = points
            .iter()
            .map(|one| one.get(at).filter(|one| one.x == own.x).map(|one| (one.x.clone(), one.y.clone())))
            .collect();
        let median = percentiles(&all?, &own.label, own.colour).pop()?;
        Some(Series { x: median.x, y: median.y, ..own.clone() })
    };
    (0..points[0].len()).filter_map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::dataset::Axis;

    fn panel(series: Vec<Series>) -> Panel {
        Panel {
            x: Axis::new("speed", "rpm"),
            y: Axis::new("frequency", "Hz").with_range(0.0, 2.0),
            series,
            ..Panel::default()
        }
    }

    /// Three draws: the median is the middle draw, and the band is interpolated at 5 % and 95
    /// %.
    ///
    /// NumPy 2: `np.percentile([1, 2, 4], [5, 95])` is 1.1, 3.8. Marks at common abscissae are
    /// drawn at the median; others are left out.
    #[test]
    fn lines_become_bands() {
        let x = vec![0.0, 1.0];
        let draws: Vec<Panel> = [1.0, 4.0, 2.0]
            .iter()
            .map(|y| {
                let line = Series::line("joints stuck", x.clone(), vec![*y, 2.0 * y], 1);
                let line = Series { style: Style::Dashed, ..line };
                let same = Series::marks("", x.clone(), vec![*y, 2.0 * y], 1);
                let elsewhere = Series::marks("crossings", vec![*y], vec![1.0], 1);
                let order = Series::line("engine order 1", x.clone(), x.clone(), 0).reference();
                let mut panel = panel(vec![line, order, same, elsewhere]);
                panel.y = panel.y.with_range(0.0, *y);
                panel
            })
            .collect();
        let made = combine_draws(&draws.iter().collect::<Vec<_>>()).unwrap();
        assert_eq!(made.y.range, Some([0.0, 4.0]));
        let [order, band, median, marks] = &made.series[..] else { panic!("{:?}", made.series) };
        assert_eq!(order.emphasis, Emphasis::Reference);
        assert_eq!((band.style, band.label.as_str(), band.colour), (Style::Band, "joints stuck, 5 % to 95 %", 1));
        let near = |found: &[f64], expected: [f64; 2]| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-14), "{found:?} {expected:?}");
        };
        near(&band.base, [1.1, 2.2]);
        near(&band.y, [3.8, 7.6]);
        near(&median.y, [2.0, 4.0]);
        near(&marks.y, [2.0, 4.0]);
        assert_eq!((median.style, marks.style), (Style::Dashed, Style::Marks));
    }

    /// Every draw has its curve in each of these cases: the curve turns back, labels differ,
    /// the steps are adaptive, or the abscissae do not overlap.
    #[test]
    fn curves_without_a_band_are_drawn_one_by_one() {
        let around = |y: f64| panel(vec![Series::line("joint", vec![0.0, 1.0, 0.5], vec![y, 1.0, 2.0], 0)]);
        let straight = |label: &str| panel(vec![Series::line(label, vec![0.0, 1.0], vec![1.0, 2.0], 0)]);
        // several points between two abscissae of the other curve
        let bent = panel(vec![Series::line("stable", vec![0.0, 0.4, 0.5, 0.6, 1.0], vec![1.0; 5], 0)]);
        // no common abscissa
        let beyond = panel(vec![Series::line("stable", vec![2.0, 3.0], vec![1.0, 2.0], 0)]);
        for draws in [
            [around(1.0), around(2.0)],
            [straight("stable"), straight("unstable")],
            [straight("stable"), bent],
            [straight("stable"), beyond],
        ] {
            let made = combine_draws(&[&draws[0], &draws[1]]).unwrap();
            assert_eq!(made.series.len(), 2);
            assert!(made.series.iter().all(|line| line.emphasis == Emphasis::Pale && line.style == Style::Solid));
        }
        let wheel = Panel { equal_axes: true, ..straight("shape") };
        assert!(combine_draws(&[&wheel, &wheel]).is_none());
    }
}
