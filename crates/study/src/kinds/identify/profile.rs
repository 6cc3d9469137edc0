//! Profile likelihood: the rise of the loss over one parameter, while the others are fitted anew.
//!
//! With the loss `S/2` and the variance `s²` of the residuals, `(S(θ) - S_min)/s²` is the square of
//! a distance in standard errors. The 95 % interval ends where it reaches the square of Student's
//! quantile. Unlike the standard error, the profile is valid for nonlinear models, and it shows a
//! parameter that is bounded on one side only.
//! Source: G. A. F. Seber, C. J. Wild, Nonlinear Regression (1989), section 5.2.

use super::problem::{FitProblem, UsedRows};
use super::search::{Fixed, Found, SearchSettings, minimize};
use super::statistics::Statistics;

/// Settings of the profiles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ProfileSettings {
    /// Points on each side of the estimate. Default 8.
    pub points: usize,
    /// Distance between two points, in standard errors. Default 0.5: eight points reach four
    /// standard errors, beyond the 95 % interval of a model that is not linear.
    pub step: f64,
    /// Distance between two points of a parameter without a standard error, as a fraction of its
    /// range. Default 0.05.
    pub undetermined_step: f64,
}

impl Default for ProfileSettings {
    fn default() -> Self {
        ProfileSettings { points: 8, step: 0.5, undetermined_step: 0.05 }
    }
}

/// A point of a profile.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ProfilePoint {
    /// The fixed parameter, on its scale from 0 to 1.
    pub x: f64,
    /// Rise of the loss in squared standard errors.
    pub rise: f64,
}

/// The profile of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Profile {
    /// Points by ascending parameter; the estimate is one of them.
    pub points: Vec<ProfilePoint>,
    /// Ends of the 95 % interval on the scale from 0 to 1; NaN if the rise stays below the quantile
    /// up to the end of the range or of the profile.
    pub low: f64,
    pub high: f64,
}

/// Computes the profiles of all parameters.
pub(super) fn profiles(
    problem: &FitProblem,
    search: &SearchSettings,
    found: &Found,
    statistics: &Statistics,
) -> Vec<Profile> {
    let settings = ProfileSettings::default();
    let one = |k: usize| {
        let error = statistics.scaled_error(k);
        let step = if error.is_finite() && error > 0.0 { settings.step * error } else { settings.undetermined_step };
        let step = step.min(settings.undetermined_step * 4.0);
        let mut points = vec![ProfilePoint { x: found.x[k], rise: 0.0 }];
        for direction in [-1.0, 1.0] {
            // the others begin where the last point ended
            let mut others = found.x.clone();
            problem.forget();
            for number in 1..=settings.points {
                let x = (found.x[k] + direction * step * number as f64).clamp(0.0, 1.0);
                if points.iter().any(|point| point.x == x) || problem.is_stopped() {
                    break;
                }
                others[k] = x;
                let Some((cost, best)) = minimize(problem, search, others.clone(), Some(Fixed(k)), UsedRows::All)
                else {
                    break;
                };
                let rise = 2.0 * (cost - found.cost) / statistics.variance;
                points.push(ProfilePoint { x, rise });
                others = best;
                if rise > 2.0 * statistics.quantile.powi(2) {
                    break;
                }
            }
        }
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        let ends = interval(&points, statistics.quantile);
        Profile { points, low: ends[0], high: ends[1] }
    };
    (0..found.x.len()).map(one).collect()
}

/// Returns where the root of the rise crosses the quantile on both sides of the smallest rise.
fn interval(points: &[ProfilePoint], quantile: f64) -> [f64; 2] {
    let best = points.iter().enumerate().min_by(|a, b| a.1.rise.total_cmp(&b.1.rise)).map_or(0, |(i, _)| i);
    let root = |point: &ProfilePoint| point.rise.max(0.0).sqrt();
    let crossing = |inner: &ProfilePoint, outer: &ProfilePoint| {
        let (a, b) = (root(inner), root(outer));
        (a < quantile && b >= quantile).then(|| inner.x + (quantile - a) / (b - a) * (outer.x - inner.x))
    };
    let low = points[..=best].windows(2).rev().find_map(|pair| crossing(&pair[1], &pair[0]));
    let high = points[best..].windows(2).find_map(|pair| crossing(&pair[0], &pair[1]));
    [low.unwrap_or(f64::NAN), high.unwrap_or(f64::NAN)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_ends_where_the_root_of_the_rise_is_the_quantile() {
        let parabola = |x: f64| ProfilePoint { x, rise: ((x - 0.4) / 0.05).powi(2) };
        let points: Vec<ProfilePoint> = (0..9).map(|i| parabola(0.2 + 0.05 * f64::from(i))).collect();
        let [low, high] = interval(&points, 2.0);
        assert!((low - 0.3).abs() < 1e-12 && (high - 0.5).abs() < 1e-12, "{low} {high}");
        // bounded on one side
        let [low, high] = interval(&points[..6], 2.0);
        assert!((low - 0.3).abs() < 1e-12 && high.is_nan(), "{low} {high}");
    }
}
