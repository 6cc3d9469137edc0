//! Histograms, and for maxima the fitted Weibull distribution with its high percentiles.

use crate::results::dataset::{Axis, Panel, Series, Style};
use crate::results::weibull::WeibullMaxima;

/// Smallest and largest number of bars.
const BAR_LIMITS: (f64, f64) = (6.0, 60.0);
/// Percentiles used in design.
const DESIGN_PERCENTILES: [(f64, &str); 2] = [(0.99, "99 %"), (0.999, "99.9 %")];
/// Number of points of the fitted curve, and the probabilities between which it is drawn. The
/// curve begins at the first bar at the latest.
const CURVE: (usize, [f64; 2]) = (120, [0.0005, 0.9995]);

/// Returns the histogram of `values`, which are in the unit of `x`; `each` names what is
/// counted.
pub(crate) fn panel(values: &[f64], x: &Axis, title: &str, each: &str) -> Option<Panel> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let [low, .., high] = sorted[..] else { return None };
    // Fewer values do not show a distribution.
    if sorted.len() < 20 {
        return None;
    }
    let width = freedman_diaconis_width(&sorted);
    let bars = ((high - low) / width).floor() as usize + 1;
    let mut counts = vec![0.0; bars];
    sorted.iter().for_each(|value| counts[(((value - low) / width) as usize).min(bars - 1)] += 1.0);
    let middles = (0..bars).map(|bar| low + width * (bar as f64 + 0.5)).collect();
    Some(Panel {
        title: title.to_owned(),
        x: x.clone(),
        y: Axis::new(format!("{each} per bar"), "").with_whole_numbers(),
        series: vec![Series::bars(format!("{} {each}", sorted.len()), middles, counts, 0)],
        ..Panel::default()
    })
}

/// Returns the bar width by Freedman and Diaconis (1981), `2 IQR n^(-1/3)`, within the limits
/// [`BAR_LIMITS`].
fn freedman_diaconis_width(sorted: &[f64]) -> f64 {
    let last = sorted.len() - 1;
    let range = sorted[last] - sorted[0];
    if range <= 0.0 {
        // equal values form one bar, a tenth of their magnitude wide
        return 0.1 * sorted[0].abs().max(f64::MIN_POSITIVE);
    }
    let quarters = sorted[3 * last / 4] - sorted[last / 4];
    let width = 2.0 * quarters / libm::cbrt(sorted.len() as f64);
    range / (range / width).clamp(BAR_LIMITS.0, BAR_LIMITS.1).ceil()
}

/// Returns the histogram of maxima with their Weibull distribution.
///
/// The title states the high percentiles if the distribution fits.
pub(crate) fn panel_of_maxima(values: &[f64], x: &Axis, title: &str, each: &str) -> Option<Panel> {
    let mut panel = panel(values, x, title, each)?;
    // Number of first values used for the fit; more values give the percentiles without a fit.
    let finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).take(20_000).collect();
    let Some(fit) = WeibullMaxima::fit(&finite) else { return Some(panel) };
    let bars = &panel.series[0];
    let top = bars.y.iter().copied().fold(0.0, f64::max);
    let width = bars.x.get(1).map_or(0.0, |second| second - bars.x[0]);
    let all: f64 = bars.y.iter().sum();
    let (from, to) = (fit.quantile(CURVE.1[0]).min(bars.x[0] - 0.5 * width), fit.quantile(CURVE.1[1]));
    let abscissae: Vec<f64> = (0..=CURVE.0).map(|i| from + (to - from) * i as f64 / CURVE.0 as f64).collect();
    let ordinates = abscissae.iter().map(|x| fit.density(*x) * all * width).collect();
    panel.series.push(Series::line("Weibull distribution", abscissae, ordinates, 1));
    if !fit.fits(&finite) {
        panel.title += "; no Weibull distribution fits (peaks of several resonances?)";
        return Some(panel);
    }
    for ((share, words), style) in DESIGN_PERCENTILES.into_iter().zip([Style::Dashed, Style::Dotted]) {
        let (at, (from, to)) = (fit.quantile(share), fit.confidence_interval(share));
        let line = Series::line(words, vec![at; 2], vec![0.0, top], 1);
        panel.series.push(Series { style, ..line });
        panel.title += &format!("; {words} below {at:.3} ({from:.3} to {to:.3})");
    }
    Some(panel)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// NumPy 2: `np.histogram_bin_edges([1..=100], bins="fd")` has 5 bars; the minimum here is
    /// six.
    #[test]
    fn every_value_stands_in_one_bar() {
        let values: Vec<f64> = (1..=100).map(f64::from).collect();
        let found = panel(&values, &Axis::new("x", ""), "", "draws").unwrap();
        assert_eq!(found.series[0].x.len(), 7);
        assert_eq!(found.series[0].y.iter().sum::<f64>(), 100.0);
        assert_eq!(found.series[0].label, "100 draws");
        assert!(panel(&values[..19], &Axis::new("x", ""), "", "draws").is_none());
        let same = panel(&[2.0; 50], &Axis::new("x", ""), "", "draws").unwrap();
        assert_eq!(same.series[0].y, [50.0]);
        // NaN is not counted
        let failed = panel(&[&values[..], &[f64::NAN]].concat(), &Axis::new("x", ""), "", "draws").unwrap();
        assert_eq!(failed.series[0].y.iter().sum::<f64>(), 100.0);
    }

    /// The area under the curve equals that of the bars, except for the tails beyond them.
    #[test]
    fn the_curve_has_the_area_of_the_bars() {
        let draw = |i: u64| 2.0 - 0.6 * (-stickslip_numerics::random::Stream::new(1).uniform(i).ln()).powf(1.0 / 3.0);
        let found =
            panel_of_maxima(&(0..400).map(draw).collect::<Vec<_>>(), &Axis::new("x", ""), "t", "disks").unwrap();
        let (bars, curve) = (&found.series[0], &found.series[1]);
        let width = bars.x[1] - bars.x[0];
        let area: f64 =
            curve.x.windows(2).zip(curve.y.windows(2)).map(|(x, y)| 0.5 * (x[1] - x[0]) * (y[0] + y[1])).sum();
        assert!((area / (400.0 * width) - 1.0).abs() < 0.02, "{area} {width}");
        assert!(found.title.starts_with("t; 99 % below 1.8"), "{}", found.title);
    }
}
