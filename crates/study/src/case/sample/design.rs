//! Designs: the points of the draws of a sample in the unit cube.
//!
//! Every coordinate of a draw is a function of the seed, its number and its dimension alone,
//! computed in integers. The draws are the same on every machine, and a draw does not need the
//! previous ones.
//!
//! Sources: McKay, Beckman, Conover (1979) for Latin hypercubes; Joe, Kuo (2008), Constructing
//! Sobol sequences with better two-dimensional projections, and their table
//! `new-joe-kuo-6.21201` for the direction numbers; Owen (1995) for the scrambling, which
//! preserves the net property and makes each draw uniform.

use stickslip_numerics::random::{SplitMix64, mix64, open_unit};

/// The distribution of draws in the unit cube.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Design {
    /// Independent draws.
    Random,
    /// Latin hypercube: each dimension has as many equal intervals as draws, with one draw in
    /// each.
    LatinHypercube,
    /// A scrambled Sobol sequence.
    Sobol,
}

/// Names of the designs in study files, and their descriptions.
pub(crate) const DESIGNS: [(&str, &str, Design); 3] = [
    ("random", "independent draws", Design::Random),
    (
        "latin-hypercube",
        "one draw in each of `count` parts of equal probability, for every parameter",
        Design::LatinHypercube,
    ),
    (
        "sobol",
        "a scrambled Sobol sequence: even coverage of all parameters together; best if `count` is a power of two",
        Design::Sobol,
    ),
];

/// Largest number of dimensions of the Sobol sequence.
pub(crate) const MAX_SOBOL: usize = DIRECTIONS.len() + 1;

/// Returns a hash of several numbers.
fn hash(numbers: &[u64]) -> u64 {
    let step = SplitMix64::INCREMENT;
    numbers.iter().fold(0, |hash, number| mix64(hash.wrapping_add(step) ^ mix64(number.wrapping_add(step))))
}

impl Design {
    /// Returns coordinate `dimension` of draw `index` of `count`, strictly between zero and
    /// one.
    pub fn coordinate(self, seed: u64, index: usize, count: usize, dimension: usize) -> f64 {
        let (index, dimension) = (index as u64, dimension as u64);
        match self {
            Design::Random => open_unit(hash(&[seed, dimension, index])),
            Design::LatinHypercube => {
                let part = feistel_permutation(index, count as u64, hash(&[seed, dimension, u64::MAX]));
                let value = (part as f64 + open_unit(hash(&[seed, dimension, index]))) / count as f64;
                // rounding in the last part could give the end of the interval
                value.min(1.0 - f64::EPSILON / 2.0)
            }
            Design::Sobol => {
                let bits = owen_scramble(sobol(index as u32, dimension as usize), hash(&[seed, dimension]));
                (f64::from(bits) + 0.5) / (1u64 << 32) as f64
            }
        }
    }
}

/// Returns the image of `index` in a permutation of `0..count`.
///
/// A Feistel network on an even number of bits that hold `count` is applied until the result is
/// below `count` (cycle walking).
fn feistel_permutation(index: u64, count: u64, key: u64) -> u64 {
    let half = (u64::BITS - count.saturating_sub(1).leading_zeros()).div_ceil(2).max(1);
    let mask = (1u64 << half) - 1;
    let mut at = index;
    loop {
        let (mut left, mut right) = (at >> half, at & mask);
        // Rounds of the network: four give a random appearance, and small networks need a few
        // more.
        for round in 0..8 {
            (left, right) = (right, left ^ hash(&[key, round, right]) & mask);
        }
        at = left << half | right;
        // the permutation has at most four times as many numbers, so the walk is short
        if at < count {
            return at;
        }
    }
}

/// Returns a coordinate of the Sobol sequence, 32 bits: element `index` in Gray code order.
fn sobol(index: u32, dimension: usize) -> u32 {
    let gray = index ^ index >> 1;
    (0..u32::BITS).filter(|bit| gray >> bit & 1 == 1).fold(0, |value, bit| value ^ direction(dimension, bit as usize))
}

/// Returns direction number `k` of a dimension, as a binary fraction of 32 bits.
fn direction(dimension: usize, k: usize) -> u32 {
    let Some((coefficients, first)) = dimension.checked_sub(1).map(|at| DIRECTIONS[at]) else {
        return 1 << (31 - k);
    };
    let degree = first.len();
    // m_k = 2 a_1 m_{k-1} ^ 4 a_2 m_{k-2} ^ … ^ 2^s m_{k-s} ^ m_{k-s}
    let mut m = [0u64; 32];
    for i in 0..=k {
        m[i] = match first.get(i) {
            Some(value) => u64::from(*value),
            None => {
                let inner = (1..degree).filter(|j| coefficients >> (degree - 1 - j) & 1 == 1);
                inner.fold(m[i - degree] << degree ^ m[i - degree], |value, j| value ^ m[i - j] << j)
            }
        };
    }
    (m[k] << (31 - k)) as u32
}

/// Scrambles bits: each bit is flipped or not, depending on the bits before it.
fn owen_scramble(bits: u32, key: u64) -> u32 {
    let turned = |level: u32| {
        // the leading one makes prefixes of different length distinct
        let prefix = 1u64 << level | u64::from(bits) >> (32 - level);
        (hash(&[key, prefix]) & 1) as u32
    };
    (0..u32::BITS).fold(bits, |value, level| value ^ turned(level) << (31 - level))
}

/// For each dimension after the first: inner coefficients of the primitive polynomial, and
/// initial direction numbers.
const DIRECTIONS: [(u32, &[u32]); 49] = [
    (0, &[1]),
    (1, &[1, 3]),
    (1, &[1, 3, 1]),
    (2, &[1, 1, 1]),
    (1, &[1, 1, 3, 3]),
    (4, &[1, 3, 5, 13]),
    (2, &[1, 1, 5, 5, 17]),
    (4, &[1, 1, 5, 5, 5]),
    (7, &[1, 1, 7, 11, 19]),
    (11, &[1, 1, 5, 1, 1]),
    (13, &[1, 1, 1, 3, 11]),
    (14, &[1, 3, 5, 5, 31]),
    (1, &[1, 3, 3, 9, 7, 49]),
    (13, &[1, 1, 1, 15, 21, 21]),
    (16, &[1, 3, 1, 13, 27, 49]),
    (19, &[1, 1, 1, 15, 7, 5]),
    (22, &[1, 3, 1, 15, 13, 25]),
    (25, &[1, 1, 5, 5, 19, 61]),
    (1, &[1, 3, 7, 11, 23, 15, 103]),
    (4, &[1, 3, 7, 13, 13, 15, 69]),
    (7, &[1, 1, 3, 13, 7, 35, 63]),
    (8, &[1, 3, 5, 9, 1, 25, 53]),
    (14, &[1, 3, 1, 13, 9, 35, 107]),
    (19, &[1, 3, 1, 5, 27, 61, 31]),
    (21, &[1, 1, 5, 11, 19, 41, 61]),
    (28, &[1, 3, 5, 3, 3, 13, 69]),
    (31, &[1, 1, 7, 13, 1, 19, 1]),
    (32, &[1, 3, 7, 5, 13, 19, 59]),
    (37, &[1, 1, 3, 9, 25, 29, 41]),
    (41, &[1, 3, 5, 13, 23, 1, 55]),
    (42, &[1, 3, 7, 3, 13, 59, 17]),
    (50, &[1, 3, 1, 3, 5, 53, 69]),
    (55, &[1, 1, 5, 5, 23, 33, 13]),
    (56, &[1, 1, 7, 7, 1, 61, 123]),
    (59, &[1, 1, 7, 9, 13, 61, 49]),
    (62, &[1, 3, 3, 5, 3, 55, 33]),
    (14, &[1, 3, 1, 15, 31, 13, 49, 245]),
    (21, &[1, 3, 5, 15, 31, 59, 63, 97]),
    (22, &[1, 3, 1, 11, 11, 11, 77, 249]),
    (38, &[1, 3, 1, 11, 27, 43, 71, 9]),
    (47, &[1, 1, 7, 15, 21, 11, 81, 45]),
    (49, &[1, 3, 7, 3, 25, 31, 65, 79]),
    (50, &[1, 3, 1, 1, 19, 11, 3, 205]),
    (52, &[1, 1, 5, 9, 19, 21, 29, 157]),
    (56, &[1, 3, 7, 11, 1, 33, 89, 185]),
    (67, &[1, 3, 3, 3, 15, 9, 79, 71]),
    (70, &[1, 3, 7, 11, 15, 39, 119, 27]),
    (84, &[1, 1, 3, 1, 11, 31, 97, 225]),
    (97, &[1, 1, 1, 3, 23, 43, 57, 177]),
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Draws of SciPy 1.16, `qmc.Sobol(d=50, scramble=False, bits=32)`, with the table of Joe
    /// and Kuo.
    #[test]
    fn the_sequence_is_that_of_joe_and_kuo() {
        for (index, expected) in [
            (1, [2147483648, 2147483648, 2147483648, 2147483648, 2147483648, 2147483648]),
            (2, [3221225472, 1073741824, 1073741824, 3221225472, 1073741824, 3221225472]),
            (3, [1073741824, 3221225472, 3221225472, 1073741824, 3221225472, 1073741824]),
            (7, [536870912, 2684354560, 1610612736, 1610612736, 3758096384, 536870912]),
            (100, [1778384896, 1107296256, 3321888768, 3187671040, 3254779904, 2852126720]),
            (1023, [4194304, 3233808384, 2629828608, 1883242496, 3720347648, 3535798272u32]),
        ] {
            let found = [0, 1, 2, 5, 20, 49].map(|dimension| sobol(index, dimension));
            assert_eq!(found, expected, "{index}");
        }
    }

    /// With 2^m draws, scrambled or not, each of 2^m intervals of every dimension has one draw.
    ///
    /// The first two dimensions form a net of quality zero: each box has one draw.
    #[test]
    fn scrambling_keeps_the_net() {
        for seed in [1, 2, 77] {
            for dimension in 0..MAX_SOBOL {
                let parts: BTreeSet<u64> =
                    (0..256).map(|i| (Design::Sobol.coordinate(seed, i, 256, dimension) * 256.0) as u64).collect();
                assert_eq!(parts.len(), 256, "dimension {dimension}");
            }
            let boxes: BTreeSet<[u64; 2]> = (0..256)
                .map(|i| [0, 1].map(|dimension| (Design::Sobol.coordinate(seed, i, 256, dimension) * 16.0) as u64))
                .collect();
            assert_eq!(boxes.len(), 256);
        }
    }

    #[test]
    fn a_hypercube_has_one_draw_in_every_part() {
        for count in [1, 2, 3, 10, 255, 256, 257, 1000] {
            for dimension in 0..5 {
                let parts: BTreeSet<usize> = (0..count)
                    .map(|i| (Design::LatinHypercube.coordinate(3, i, count, dimension) * count as f64) as usize)
                    .collect();
                assert_eq!(parts.len(), count, "{count} draws, dimension {dimension}");
            }
        }
        // the dimensions have different orders
        let order =
            |dimension: usize| (0..50).map(move |i| feistel_permutation(i, 50, hash(&[1, dimension as u64, u64::MAX])));
        assert!(!order(0).eq(order(1)));
    }

    /// Moments of independent uniform draws, within five standard deviations: mean 1/2,
    /// variance 1/12, no correlation of successive draws, dimensions, or seeds.
    #[test]
    fn random_draws_are_uniform_and_independent() {
        let count = 100_000;
        let draws = |seed: u64, dimension: usize| -> Vec<f64> {
            (0..count).map(|i| Design::Random.coordinate(seed, i, count, dimension) - 0.5).collect()
        };
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / count as f64;
        let (a, b, c) = (draws(1, 0), draws(1, 1), draws(2, 0));
        let bound = |variance: f64| 5.0 * (variance / count as f64).sqrt();
        assert!(mean(&mut a.iter().copied()).abs() < bound(1.0 / 12.0));
        // the variance of x² is 1/80 - 1/144
        assert!((mean(&mut a.iter().map(|x| x * x)) - 1.0 / 12.0).abs() < bound(1.0 / 180.0));
        let product = |x: &[f64], y: &[f64]| mean(&mut x.iter().zip(y).map(|(x, y)| x * y)).abs();
        for (what, value) in [
            ("neighbours", product(&a[1..], &a[..count - 1])),
            ("dimensions", product(&a, &b)),
            ("seeds", product(&a, &c)),
        ] {
            assert!(value < bound(1.0 / 144.0), "{what}: {value}");
        }
        // 100 parts: chi squared of 99 degrees of freedom exceeds 180 with a probability of one
        // in a million
        let mut parts = [0f64; 100];
        a.iter().for_each(|x| parts[((x + 0.5) * 100.0) as usize] += 1.0);
        let chi: f64 = parts.iter().map(|n| (n - 1000.0) * (n - 1000.0) / 1000.0).sum();
        assert!((40.0..180.0).contains(&chi), "{chi}");
    }
}
