//! Weibull distribution of maxima, fitted to the largest amplification of mistuned disks.
//!
//! `F(x) = exp(-((λ - x)/δ)^β)` below the bound λ, with the scale δ and the shape β.
//!
//! Bounded quantities, such as the amplification of a disk, have maxima of this distribution
//! (the third type of Fisher and Tippett). A few hundred disks are therefore enough for the
//! 99.9th percentile. The fit maximizes the likelihood. For every λ, the other two parameters
//! follow from one equation; a search finds the best λ.
//!
//! Sources:
//! - Castanier, Pierre, Using intentional mistuning in the design of turbomachinery rotors, AIAA
//!   J. 40 (2002) 2077-2086;
//! - Smith, Maximum likelihood estimation in a class of nonregular cases, Biometrika 72 (1985)
//!   67-90.

use std::convert::Infallible;
use stickslip_numerics::golden_section::golden_section;

/// The distribution of maxima with the largest likelihood for some values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct WeibullMaxima {
    /// λ, the upper bound of all values.
    pub upper_bound: f64,
    /// δ.
    pub scale: f64,
    /// β.
    pub shape: f64,
    /// Covariance of shape, scale and bound.
    covariance: [[f64; 3]; 3],
}

/// Half width, in standard deviations, of the interval that contains 95 % of a normal
/// distribution.
const NORMAL_QUANTILE_975: f64 = 1.959_963_984_540_054;

/// Scale, shape and log-likelihood of the best distribution with a given bound.
struct ProfileLikelihood {
    scale: f64,
    shape: f64,
    likelihood: f64,
}

impl WeibullMaxima {
    /// Fits the distribution by maximum likelihood.
    ///
    /// Returns `None` for fewer than 20 values, for equal values, and if the likelihood has no
    /// maximum because the values crowd at their upper end.
    pub fn fit(values: &[f64]) -> Option<WeibullMaxima> {
        // Number of steps of the search for the bound, in equal ratios.
        let search_steps: usize = 48;
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        let range = high - low;
        // Minimum number of values for a fit of three parameters.
        if values.len() < 20 || !(range > 0.0 && range.is_finite()) {
            return None;
        }
        let bound = |s: f64| high + range * libm::exp(s);
        // Below this shape the density has a peak or a step at the bound, and the likeliest
        // bound is the largest value itself.
        let profile = |s: f64| ProfileLikelihood::fit(values, bound(s)).filter(|profile| profile.shape > 1.0);
        let height = |s: f64| profile(s).map_or(f64::NEG_INFINITY, |profile| profile.likelihood);
        // Lower end of the search for the bound: its distance above the largest value, relative
        // to the range of the values.
        // Upper end of the search for the bound. From here on the distribution equals that of
        // Gumbel, which has no bound, to a thousandth of its shape.
        let (from, to) = (libm::log(1e-4), libm::log(1e3));
        let step = (to - from) / search_steps as f64;
        let at = |i: usize| from + step * i as f64;
        let heights: Vec<f64> = (0..=search_steps).map(|i| height(at(i))).collect();
        let best = (0..=search_steps).max_by(|a, b| heights[*a].total_cmp(&heights[*b]))?;
        let ends = (at(best.saturating_sub(1)), at((best + 1).min(search_steps)));
        // Relative tolerance of the bound's distance.
        let Ok((s, _)) = golden_section(ends, |a, b| b - a < 1e-10, |s| Ok::<_, Infallible>(height(s)));
        let ProfileLikelihood { scale, shape, .. } = profile(s)?;
        let found = WeibullMaxima { upper_bound: bound(s), scale, shape, covariance: [[0.0; 3]; 3] };
        // the bound counts as known at the far end, and if the likelihood is not regular in it
        // Above this shape the likelihood is regular in the bound, too (Smith 1985).
        let known = best == search_steps || shape <= 2.0;
        Some(WeibullMaxima { covariance: found.covariance(values, known)?, ..found })
    }

    /// Returns the probability that a value is not exceeded.
    fn cumulative_probability(&self, value: f64) -> f64 {
        libm::exp(-libm::pow(((self.upper_bound - value) / self.scale).max(0.0), self.shape))
    }

    /// Returns whether the values follow the distribution, rather than a mixture of two
    /// distributions. The test uses the largest difference of the cumulative distributions
    /// (Kolmogorov and Smirnov).
    pub fn fits(&self, values: &[f64]) -> bool {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let count = sorted.len() as f64;
        let apart = sorted.iter().enumerate().map(|(below, value)| {
            let share = self.cumulative_probability(*value);
            (share - below as f64 / count).max((below + 1) as f64 / count - share)
        });
        // Kolmogorov-Smirnov distance times the square root of the number of values above which
        // the fit is rejected. One in a hundred samples exceeds it if the parameters are known,
        // fewer if they are fitted (Kolmogorov 1933).
        apart.fold(0.0, f64::max) * count.sqrt() <= 1.63
    }

    /// Returns the value that is not exceeded with the probability `share`.
    pub fn quantile(&self, share: f64) -> f64 {
        self.upper_bound - self.scale * libm::pow(-libm::log(share), 1.0 / self.shape)
    }

    /// Returns the ends of the 95 % confidence interval of this quantile, from the curvature of
    /// the likelihood.
    pub fn confidence_interval(&self, share: f64) -> (f64, f64) {
        let depth = -libm::log(share);
        let power = libm::pow(depth, 1.0 / self.shape);
        let slopes = [self.scale * power * libm::log(depth) / (self.shape * self.shape), -power, 1.0];
        let variance: f64 =
            (0..3).map(|a| (0..3).map(|b| slopes[a] * self.covariance[a][b] * slopes[b]).sum::<f64>()).sum();
        let (middle, reach) = (self.quantile(share), NORMAL_QUANTILE_975 * variance.max(0.0).sqrt());
        (middle - reach, middle + reach)
    }

    /// Returns the probability density at a value.
    pub fn density(&self, value: f64) -> f64 {
        let depth = (self.upper_bound - value) / self.scale;
        if depth <= 0.0 {
            return 0.0;
        }
        let power = libm::pow(depth, self.shape);
        self.shape / self.scale * power / depth * libm::exp(-power)
    }

    /// Returns the inverse of the observed information, without the bound if that is `known`.
    /// Returns `None` if the likelihood has no maximum here.
    fn covariance(&self, values: &[f64], known: bool) -> Option<[[f64; 3]; 3]> {
        let (shape, scale) = (self.shape, self.scale);
        let mut information = [[0.0; 3]; 3];
        for value in values {
            let y = self.upper_bound - value;
            let log = libm::log(y / scale);
            let w = libm::exp(shape * log);
            // minus the second derivatives of ln β - β ln δ + (β - 1) ln y - (y/δ)^β by β, δ, λ
            let rows = [
                [
                    1.0 / (shape * shape) + w * log * log,
                    -((w - 1.0) + shape * w * log) / scale,
                    -(1.0 - w - shape * w * log) / y,
                ],
                [0.0, (shape * (shape + 1.0) * w - shape) / (scale * scale), -shape * shape * w / (scale * y)],
                [0.0, 0.0, (shape - 1.0) * (1.0 + shape * w) / (y * y)],
            ];
            for a in 0..3 {
                for b in a..3 {
                    information[a][b] += rows[a][b];
                }
            }
        }
        let size = if known { 2 } else { 3 };
        inverse(&information, size)
    }
}

/// Returns the inverse of the leading `size` rows of a symmetric positive definite matrix by
/// Cholesky factorization. Reads the upper triangle; the other entries of the result are zero.
fn inverse(matrix: &[[f64; 3]; 3], size: usize) -> Option<[[f64; 3]; 3]> {
    let mut lower = [[0.0; 3]; 3];
    for column in 0..size {
        for row in column..size {
            let sum: f64 = (0..column).map(|k| lower[row][k] * lower[column][k]).sum();
            let rest = matrix[column][row] - sum;
            if row == column && !(rest > 0.0 && rest.is_finite()) {
                return None;
            }
            lower[row][column] = if row == column { rest.sqrt() } else { rest / lower[column][column] };
        }
    }
    let mut inverse = [[0.0; 3]; 3];
    for unit in 0..size {
        let mut x = [0.0; 3];
        for row in 0..size {
            let sum: f64 = (0..row).map(|k| lower[row][k] * x[k]).sum();
            x[row] = (f64::from(u8::from(row == unit)) - sum) / lower[row][row];
        }
        for row in (0..size).rev() {
            let sum: f64 = (row + 1..size).map(|k| lower[k][row] * x[k]).sum();
            x[row] = (x[row] - sum) / lower[row][row];
        }
        (0..size).for_each(|row| inverse[row][unit] = x[row]);
    }
    Some(inverse)
}

impl ProfileLikelihood {
    /// Solves `1/β = Σ y^β ln y / Σ y^β - mean ln y` and `δ^β = mean y^β`, with `y = λ - x`.
    fn fit(values: &[f64], bound: f64) -> Option<ProfileLikelihood> {
        let count = values.len() as f64;
        let logs: Vec<f64> = values.iter().map(|value| libm::log(bound - value)).collect();
        let highest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mean = logs.iter().map(|log| log - highest).sum::<f64>() / count;
        // sums of y^β, and of y^β times ln y and (ln y)², with y relative to the largest one
        let sums = |shape: f64| {
            logs.iter().fold([0.0; 3], |[a, b, c], log| {
                let log = log - highest;
                let power = libm::exp(shape * log);
                [a + power, b + power * log, c + power * log * log]
            })
        };
        let spread = (logs.iter().map(|log| (log - highest - mean).powi(2)).sum::<f64>() / count).sqrt();
        if !(spread > 0.0 && spread.is_finite()) {
            return None;
        }
        // 1.28 is the standard deviation of ln y times the shape, π/√6
        let mut shape = 1.28 / spread;
        let (mut below, mut above) = (0.0, f64::INFINITY);
        // Maximum number of iterations for the shape. Newton's method takes about six; bisection
        // keeps it within its bounds.
        for _ in 0..80 {
            let [sum, first, second] = sums(shape);
            let (slope, weighted) = (second / sum - (first / sum).powi(2), first / sum);
            let value = weighted - 1.0 / shape - mean;
            if value > 0.0 {
                above = shape
            } else {
                below = shape
            }
            let newton = shape - value / (slope + 1.0 / (shape * shape));
            let halved = if above.is_finite() { 0.5 * (below + above) } else { 2.0 * shape };
            let next = if newton > below && newton < above { newton } else { halved };
            let change = (next - shape).abs();
            shape = next;
            // Relative change of the shape at which the iteration ends.
            if change <= 1e-13 * shape {
                break;
            }
        }
        let log_scale = highest + libm::log(sums(shape)[0] / count) / shape;
        let likelihood = count * (libm::log(shape) - shape * log_scale + (shape - 1.0) * (highest + mean) - 1.0);
        let profile = ProfileLikelihood { scale: libm::exp(log_scale), shape, likelihood };
        (shape.is_finite() && likelihood.is_finite()).then_some(profile)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sixty values near quantiles of λ = 1.9, δ = 0.5, β = 2.6.
    fn values() -> Vec<f64> {
        [
            9868, 15326, 13377, 16656, 14564, 11967, 15588, 13675, 17252, 14954, 12886, 16242, 14281, 10750, 15285,
            13286, 16606, 14580, 12235, 15855, 13959, 17576, 15012, 12865, 16143, 14211, 11179, 15473, 13578, 16920,
            14744, 12351, 15777, 13850, 17715, 15094, 13117, 16446, 14460, 11560, 15470, 13492, 16872, 14722, 12543,
            16024, 14137, 18282, 15194, 13115, 16361, 14364, 11749, 15622, 13762, 17225, 14922, 12673, 15977, 14024,
        ]
        .map(|v| f64::from(v) * 1e-4)
        .to_vec()
    }

    /// Reference: SciPy 1.17, `weibull_min` of `-x`. Its likelihood is maximized by
    /// `minimize(…, method="Nelder-Mead")` to 1e-14. The deviations of the quantiles come from
    /// differences of that likelihood.
    #[test]
    fn fit_agrees_with_scipy() {
        let fit = WeibullMaxima::fit(&values()).unwrap();
        let near = |what: &str, found: f64, expected: f64, within: f64| {
            assert!((found / expected - 1.0).abs() < within, "{what}: {found} {expected}");
        };
        near("shape", fit.shape, 2.5492621, 1e-6);
        near("bound", fit.upper_bound, 1.8892929, 1e-6);
        near("scale", fit.scale, 0.48775526, 1e-6);
        near("99 %", fit.quantile(0.99), 1.8090296797848229, 1e-7);
        near("99.9 %", fit.quantile(0.999), 1.856823367544346, 1e-7);
        for (share, deviation) in [(0.99, 0.03267047916133568), (0.999, 0.046330211794089214)] {
            let (low, high) = fit.confidence_interval(share);
            near("interval", (high - low) / (2.0 * NORMAL_QUANTILE_975), deviation, 1e-4);
        }
        // the density is the derivative of the distribution
        near(
            "density",
            fit.density(1.4),
            (fit.cumulative_probability(1.4 + 1e-5) - fit.cumulative_probability(1.4 - 1e-5)) / 2e-5,
            1e-8,
        );
        near("share", fit.cumulative_probability(fit.quantile(0.3)), 0.3, 1e-12);
        assert_eq!(fit.density(fit.upper_bound + 0.1), 0.0);
    }

    /// A mixture of two families of peaks is rejected; draws from one distribution are accepted
    /// in nearly all sets.
    #[test]
    fn mixtures_are_rejected() {
        let draw =
            |set: u64, i: u64| 1.5 - 0.4 * (-stickslip_numerics::random::Stream::new(set).uniform(i).ln()).powf(0.4);
        let of_one = (0..40).filter(|set| {
            let values: Vec<f64> = (0..200).map(|i| draw(*set, i)).collect();
            WeibullMaxima::fit(&values).unwrap().fits(&values)
        });
        assert!(of_one.count() >= 39);
        let two: Vec<f64> = (0..200).map(|i| if i % 3 == 0 { draw(1, i) } else { 1.03 + 1e-4 * i as f64 }).collect();
        assert!(!WeibullMaxima::fit(&two).unwrap().fits(&two));
    }

    /// The 99th percentile lies in its interval about as often as stated, over many sets of 100
    /// draws.
    #[test]
    fn confidence_intervals_have_their_coverage() {
        let (bound, scale, shape) = (2.0, 0.6, 3.0);
        let truth = bound - scale * (-0.99f64.ln()).powf(1.0 / shape);
        let sets = 100;
        let held = (0..sets).filter(|set| {
            let stream = stickslip_numerics::random::Stream::new(*set);
            let draw = |i: u64| bound - scale * (-stream.uniform(i).ln()).powf(1.0 / shape);
            let (low, high) =
                WeibullMaxima::fit(&(0..100).map(draw).collect::<Vec<_>>()).unwrap().confidence_interval(0.99);
            (low..=high).contains(&truth)
        });
        // 95 % of a hundred sets, less the effect of chance and of the skewness of the bound
        assert!((84..=100).contains(&held.count()));
    }

    #[test]
    fn unsuitable_values_have_no_fit() {
        assert_eq!(WeibullMaxima::fit(&values()[..19]), None);
        assert_eq!(WeibullMaxima::fit(&[1.5; 40]), None);
        // the values of a Gumbel distribution, for which the best bound is very large
        let rising: Vec<f64> = (1..100).map(|i| -(-(f64::from(i) / 100.0).ln()).ln()).collect();
        let fit = WeibullMaxima::fit(&rising).unwrap();
        assert!((fit.quantile(0.99) - 4.6).abs() < 0.5 && fit.upper_bound > 10.0, "{fit:?}");
    }
}
