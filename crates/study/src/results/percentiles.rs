//! Percentiles of the curves of many draws: a band with its median.

use crate::results::dataset::{Series, Style};

/// Returns the median and the band of curves `(x, y)`, over the abscissae of the first curve
/// with the most points.
///
/// A curve may lack a point, because it failed or lies outside. Where too many curves lack a
/// point, the band has a gap, and at the ends it stops.
pub(crate) fn percentiles(curves: &[(Vec<f64>, Vec<f64>)], label: &str, colour: usize) -> Vec<Series> {
    let Some(grid) = curves.iter().map(|(x, _)| x).reduce(|a, b| if b.len() > a.len() { b } else { a }) else {
        return Vec::new();
    };
    let all: Vec<Vec<f64>> = curves.iter().map(|(x, y)| resample(grid, x, y)).collect();
    let known = curves.iter().filter(|(_, y)| y.iter().any(|value| !value.is_nan())).count();
    let sorted = |at: usize| {
        let mut values: Vec<f64> = all.iter().map(|y| y[at]).filter(|value| !value.is_nan()).collect();
        values.sort_by(f64::total_cmp);
        // Minimum fraction of the curves that must have a value at an abscissa; below it the
        // band has a gap. Curves without any value do not count. If curves end at different
        // abscissae, the remaining ones are not a sample of all. With this fraction their median
        // is that of all to 2.5 percentage points.
        Some(values).filter(|values| !values.is_empty() && values.len() as f64 >= 0.95 * known as f64)
    };
    let values: Vec<Option<Vec<f64>>> = (0..grid.len()).map(sorted).collect();
    let first = values.iter().position(Option::is_some).unwrap_or(0);
    let end = values.iter().rposition(Option::is_some).map_or(first, |last| last + 1);
    let x = &grid[first..end];
    let at_quantile = |share: f64| -> Vec<f64> {
        values[first..end]
            .iter()
            .map(|values| values.as_ref().map_or(f64::NAN, |values| quantile(values, share)))
            .collect()
    };
    // Ends of the band and the line in it, as fractions.
    let [low, middle, high] = [0.05, 0.5, 0.95].map(at_quantile);
    let named = |what: &str| if label.is_empty() { what.to_owned() } else { format!("{label}, {what}") };
    vec![
        Series::band(named("5 % to 95 %"), x.to_vec(), low, high, colour),
        Series { style: Style::Solid, ..Series::line(named("median"), x.to_vec(), middle, colour) },
    ]
}

/// Returns a quantile of rising values by linear interpolation (definition 7 of Hyndman and
/// Fan, 1996).
fn quantile(values: &[f64], share: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return f64::NAN };
    let at = share * last as f64;
    let (below, above) = (values[at.floor() as usize], values[at.ceil() as usize]);
    below + (above - below) * at.fract()
}

/// Returns whether two abscissae differ by rounding only.
fn is_same_abscissa(one: f64, other: f64) -> bool {
    // Relative distance of abscissae that differ by rounding only, such as computed amplitudes
    // at which a curve begins.
    (one - other).abs() <= 1e-9 * one.abs().max(other.abs())
}

/// Returns a curve at other abscissae by linear interpolation; NaN outside its range.
fn resample(grid: &[f64], x: &[f64], y: &[f64]) -> Vec<f64> {
    if grid == x {
        return y.to_vec();
    }
    grid.iter()
        .map(|at| match x.partition_point(|x| x < at) {
            above if x.get(above).is_some_and(|x| is_same_abscissa(*x, *at)) => y[above],
            above if above > 0 && is_same_abscissa(x[above - 1], *at) => y[above - 1],
            above @ 1.. if above < x.len() => {
                let share = (at - x[above - 1]) / (x[above] - x[above - 1]);
                y[above - 1] + share * (y[above] - y[above - 1])
            }
            _ => f64::NAN,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: NumPy 2, `np.percentile([1, 2, 4, 8, 16], [5, 50, 95])` is 1.2, 4, 14.4.
    #[test]
    fn bands_are_percentiles_at_every_abscissa() {
        let x = vec![1.0, 2.0, 3.0];
        let mut curves: Vec<(Vec<f64>, Vec<f64>)> =
            [8.0, 1.0, 16.0, 2.0, 4.0].iter().map(|y| (x.clone(), vec![*y, 2.0 * y, 7.0])).collect();
        let series = percentiles(&curves, "blade1", 2);
        let near = |found: &[f64], expected: [f64; 3]| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-14), "{found:?} {expected:?}");
        };
        near(&series[0].base, [1.2, 2.4, 7.0]);
        near(&series[0].y, [14.4, 28.8, 7.0]);
        near(&series[1].y, [4.0, 8.0, 7.0]);
        assert_eq!((series[0].style, series[1].label.as_str()), (Style::Band, "blade1, median"));
        // four of five curves are too few: a gap inside, and no band at the end
        curves[4].1[1] = f64::NAN;
        assert!(percentiles(&curves, "", 0)[1].y[1].is_nan());
        curves[0].1[2] = f64::NAN;
        assert_eq!(percentiles(&curves, "", 0)[0].x, [1.0]);
        // 19 of 20 are enough; a curve without any value does not count
        let lacks = |i: usize| [[1.0, f64::NAN, 1.0], [f64::NAN; 3]].get(i).copied().unwrap_or([1.0; 3]).to_vec();
        let most: Vec<(Vec<f64>, Vec<f64>)> = (0..21).map(|i| (x.clone(), lacks(i))).collect();
        assert_eq!(percentiles(&most, "", 0)[1].y, [1.0; 3]);
        // a curve whose first abscissa differs by rounding keeps its first point
        let later = (vec![1.0 + 1e-15, 2.0], vec![3.0, 5.0]);
        let series = percentiles(&[(vec![1.0, 2.0], vec![1.0, 5.0]), later], "", 0);
        assert_eq!(series[1].y, [2.0, 5.0]);
        // a curve with other abscissae counts between its points, not outside
        let other = (vec![1.0, 3.0], vec![10.0, 30.0]);
        let series = percentiles(&[(vec![0.0, 2.0], vec![5.0, 20.0]), other], "", 0);
        assert_eq!((&series[1].x[..], &series[1].y[..]), (&[2.0][..], &[20.0][..]));
    }
}
