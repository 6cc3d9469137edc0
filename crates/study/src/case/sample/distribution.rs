//! Distributions of uncertain parameters by their quantiles: a number between zero and one
//! gives a value.
//!
//! Logarithms and exponentials come from `libm`, not from the machine, so the bits are the same
//! everywhere.

use std::f64::consts::SQRT_2;
use stickslip_numerics::random::normal_quantile_from;

/// A distribution with its numbers, SI.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Distribution {
    /// Mean and standard deviation.
    Normal([f64; 2]),
    /// Mean and standard deviation of the quantity, not of its logarithm.
    Lognormal([f64; 2]),
    /// From, to.
    Uniform([f64; 2]),
    /// The logarithm is uniform: from, to.
    Loguniform([f64; 2]),
    /// From, most likely, to.
    Triangular([f64; 3]),
    /// One of these values with equal probability.
    Values(Vec<f64>),
}

/// Names of distributions in study files, their numbers, and their descriptions.
pub(crate) const DISTRIBUTIONS: [(&str, &str, &str); 6] = [
    ("normal", "mean, deviation", "the normal distribution, which also gives negative values"),
    ("lognormal", "mean, deviation", "the lognormal distribution with this mean and deviation of the quantity itself"),
    ("uniform", "from, to", "all values between the two are equally likely"),
    ("loguniform", "from, to", "all ratios are equally likely: for quantities known by their order of magnitude only"),
    ("triangular", "from, mode, to", "most likely at the second number, falling to zero at the others"),
    ("values", "one or more values", "one of these values, all equally likely"),
];

/// The key of the bounds of a distribution: the least and the largest value.
pub(crate) const WITHIN: &str = "within";

impl Distribution {
    /// Returns the distribution of this name.
    ///
    /// # Errors
    /// Returns the index of the wrong number, from 0, and the requirement.
    pub fn new(name: &str, numbers: &[f64]) -> Result<Distribution, (usize, String)> {
        let count =
            |expected: &str| Err((0, format!("`{name}` takes {expected}; the list has length {}", numbers.len())));
        let rising = |at: usize| match numbers[at - 1] < numbers[at] {
            true => Ok(()),
            false => Err((at, "must be larger than the previous number".to_owned())),
        };
        let positive = |at: usize| match numbers[at] > 0.0 {
            true => Ok(()),
            false => Err((at, "must be more than zero".to_owned())),
        };
        match (name, numbers) {
            ("normal", &[mean, deviation]) => {
                positive(1)?;
                Ok(Distribution::Normal([mean, deviation]))
            }
            ("lognormal", &[mean, deviation]) => {
                positive(0)?;
                positive(1)?;
                Ok(Distribution::Lognormal([mean, deviation]))
            }
            ("uniform", &[from, to]) => {
                rising(1)?;
                Ok(Distribution::Uniform([from, to]))
            }
            ("loguniform", &[from, to]) => {
                positive(0)?;
                rising(1)?;
                Ok(Distribution::Loguniform([from, to]))
            }
            ("triangular", &[from, mode, to]) => {
                if mode < from {
                    return Err((1, "must not be less than the previous number".to_owned()));
                }
                if to < mode || to <= from {
                    return Err((2, "must be larger than the previous numbers".to_owned()));
                }
                Ok(Distribution::Triangular([from, mode, to]))
            }
            ("values", [_, ..]) => Ok(Distribution::Values(numbers.to_vec())),
            _ => {
                let row = DISTRIBUTIONS.iter().find(|(known, ..)| *known == name);
                count(row.map_or("its numbers", |(_, numbers, _)| numbers))
            }
        }
    }

    /// Returns true if the distribution is unbounded, so that `within` can bound it.
    pub fn has_tails(&self) -> bool {
        matches!(self, Distribution::Normal(_) | Distribution::Lognormal(_))
    }

    /// Returns the value below which the share `p` lies, `0 < p < 1`.
    pub fn quantile(&self, p: f64) -> f64 {
        match self {
            Distribution::Normal([mean, deviation]) => mean + deviation * normal_quantile(p),
            Distribution::Lognormal(numbers) => {
                let [mu, sigma] = logarithm_parameters(numbers);
                libm::exp(mu + sigma * normal_quantile(p))
            }
            Distribution::Uniform([from, to]) => (from + (to - from) * p).clamp(*from, *to),
            Distribution::Loguniform([from, to]) => {
                libm::exp(libm::log(*from) + (libm::log(*to) - libm::log(*from)) * p).clamp(*from, *to)
            }
            Distribution::Triangular([from, mode, to]) => {
                let below = (mode - from) / (to - from);
                let value = if p < below {
                    from + ((to - from) * (mode - from) * p).sqrt()
                } else {
                    to - ((to - from) * (to - mode) * (1.0 - p)).sqrt()
                };
                value.clamp(*from, *to)
            }
            Distribution::Values(values) => values[((p * values.len() as f64) as usize).min(values.len() - 1)],
        }
    }

    /// Returns the quantile of the distribution restricted to `least` and `most`; `None` if the
    /// part is empty.
    pub fn quantile_within(&self, p: f64, [least, most]: [f64; 2]) -> Option<f64> {
        let (a, b) = (self.standardize(least), self.standardize(most));
        // from the side of the nearer tail, to avoid cancellation
        let value = if a > 0.0 {
            let (above_a, above_b) = (normal_cdf(-a), normal_cdf(-b));
            let above = above_a - (above_a - above_b) * p;
            (above > 0.0 && above_a > above_b).then(|| self.destandardize(-normal_quantile(above)))
        } else {
            let (below_a, below_b) = (normal_cdf(a), normal_cdf(b));
            let below = below_a + (below_b - below_a) * p;
            (below > 0.0 && below < 1.0 && below_a < below_b).then(|| self.destandardize(normal_quantile(below)))
        };
        value.map(|value| value.clamp(least, most))
    }

    /// Returns the standard normal number of a value of a distribution with tails.
    fn standardize(&self, value: f64) -> f64 {
        match self {
            Distribution::Lognormal(_) if value <= 0.0 => f64::NEG_INFINITY,
            Distribution::Lognormal(numbers) => {
                let [mu, sigma] = logarithm_parameters(numbers);
                (libm::log(value) - mu) / sigma
            }
            Distribution::Normal([mean, deviation]) => (value - mean) / deviation,
            _ => value,
        }
    }

    fn destandardize(&self, z: f64) -> f64 {
        match self {
            Distribution::Lognormal(numbers) => {
                let [mu, sigma] = logarithm_parameters(numbers);
                libm::exp(mu + sigma * z)
            }
            Distribution::Normal([mean, deviation]) => mean + deviation * z,
            _ => z,
        }
    }
}

/// Returns mean and deviation of the logarithm of a lognormal quantity with this mean and
/// deviation.
fn logarithm_parameters([mean, deviation]: &[f64; 2]) -> [f64; 2] {
    let ratio = deviation / mean;
    let variance = libm::log1p(ratio * ratio);
    [libm::log(*mean) - variance / 2.0, variance.sqrt()]
}

/// Returns the share of a standard normal quantity below `z`.
fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z / SQRT_2)
}

/// Returns the standard normal quantile of `p`.
fn normal_quantile(p: f64) -> f64 {
    let q = p - 0.5;
    normal_quantile_from(q, 0.425 * 0.425 - q * q, || (-libm::log(p.min(1.0 - p))).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles of SciPy 1.16, `norm.ppf`.
    #[test]
    fn the_normal_quantile_has_fifteen_digits() {
        for (p, expected) in [
            (1e-300, -37.0470962993612),
            (1e-20, -9.262340089798409),
            (1e-10, -6.361340902404056),
            (1e-5, -4.264890793922825),
            (0.01, -2.3263478740408408),
            (0.05, -1.6448536269514729),
            (0.075, -1.4395314709384563),
            (0.3, -0.5244005127080409),
            (0.5, 0.0),
            (0.6, 0.2533471031357997),
            (0.95, 1.6448536269514722),
            (0.999, 3.090232306167813),
        ] {
            let found = normal_quantile(p);
            assert!((found - expected).abs() <= 1e-15 * expected.abs().max(1.0), "{p}: {found} {expected}");
        }
    }

    /// Moments of the values at the middles of 200,000 equal shares, compared with closed
    /// forms.
    #[test]
    fn distributions_have_the_moments_that_they_say() {
        let moments = |distribution: &Distribution| {
            let count = 200_000;
            let values = (0..count).map(|i| distribution.quantile((f64::from(i) + 0.5) / f64::from(count)));
            let (sum, squares) = values.fold((0.0, 0.0), |(a, b), v| (a + v, b + v * v));
            let mean = sum / f64::from(count);
            (mean, (squares / f64::from(count) - mean * mean).sqrt())
        };
        let ln2 = std::f64::consts::LN_2;
        for (name, numbers, mean, deviation) in [
            ("normal", vec![2.0, 0.2], 2.0, 0.2),
            ("lognormal", vec![2.0, 1.0], 2.0, 1.0),
            ("uniform", vec![1.0, 4.0], 2.5, 3.0 / 12f64.sqrt()),
            ("loguniform", vec![1.0, 2.0], 1.0 / ln2, (1.5 / ln2 - 1.0 / (ln2 * ln2)).sqrt()),
            ("triangular", vec![0.0, 1.0, 5.0], 2.0, ((25.0 + 1.0 - 5.0) / 18.0f64).sqrt()),
            ("values", vec![1.0, 2.0, 6.0], 3.0, (14.0 / 3.0f64).sqrt()),
        ] {
            let (found, spread) = moments(&Distribution::new(name, &numbers).unwrap());
            // the sum omits a small part of the tails
            assert!((found - mean).abs() < 1e-4 && (spread - deviation).abs() < 2e-3, "{name}: {found} {spread}");
        }
    }

    #[test]
    fn bounded_distributions_keep_their_shape() {
        for distribution in [Distribution::Normal([2.0, 0.5]), Distribution::Lognormal([2.0, 0.5])] {
            for bounds in [[1.5, 2.1], [2.5, 9.0], [0.1, 1.0], [4.0, 5.0]] {
                let (a, b) = (distribution.standardize(bounds[0]), distribution.standardize(bounds[1]));
                let mut last = bounds[0];
                for p in [0.01, 0.25, 0.5, 0.75, 0.99] {
                    let value = distribution.quantile_within(p, bounds).unwrap();
                    assert!(last <= value && value <= bounds[1], "{distribution:?} {bounds:?} {p}: {value}");
                    last = value;
                    // the share below the value, relative to the share between the bounds, from
                    // the shares above
                    let above = |z: f64| normal_cdf(-z);
                    let share = (above(a) - above(distribution.standardize(value))) / (above(a) - above(b));
                    assert!((share - p).abs() < 1e-9, "{distribution:?} {bounds:?}: {share} {p}");
                }
            }
            assert_eq!(distribution.quantile_within(0.5, [1e5, 2e5]), None);
        }
    }

    #[test]
    fn wrong_numbers_are_named() {
        for (name, numbers, at) in [
            ("normal", vec![1.0], 0),
            ("normal", vec![1.0, 0.0], 1),
            ("lognormal", vec![-1.0, 1.0], 0),
            ("uniform", vec![2.0, 2.0], 1),
            ("loguniform", vec![0.0, 2.0], 0),
            ("triangular", vec![0.0, -1.0, 2.0], 1),
            ("triangular", vec![0.0, 1.0, 0.5], 2),
            ("values", vec![], 0),
        ] {
            assert_eq!(Distribution::new(name, &numbers).unwrap_err().0, at, "{name} {numbers:?}");
        }
    }
}
