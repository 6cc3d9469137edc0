//! Gauss-Legendre rules on `[-1, 1]`. A rule of n nodes is exact for polynomials of degree 2n - 1.
//!
//! Source: Abramowitz and Stegun, Handbook of Mathematical Functions (1964), Table 25.4.

/// Nodes and weights of three points, nodes rising.
pub const GAUSS_3: [(f64, f64); 3] = mirrored([(0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)]);
/// Nodes and weights of five points, nodes rising.
pub const GAUSS_5: [(f64, f64); 5] = mirrored([
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
]);
/// Nodes and weights of six points, nodes rising.
pub const GAUSS_6: [(f64, f64); 6] = mirrored([
    (0.238_619_186_083_196_9, 0.467_913_934_572_691),
    (0.661_209_386_466_264_5, 0.360_761_573_048_138_6),
    (0.932_469_514_203_152, 0.171_324_492_379_170_35),
]);
/// Nodes and weights of eight points, nodes rising.
pub const GAUSS_8: [(f64, f64); 8] = mirrored([
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_2, 0.101_228_536_290_376_26),
]);

/// Returns the whole rule from its half with nodes ≥ 0. A node in the middle counts once.
const fn mirrored<const HALF: usize, const N: usize>(half: [(f64, f64); HALF]) -> [(f64, f64); N] {
    let mut all = [(0.0, 0.0); N];
    let mut k = 0;
    while k < HALF {
        let (node, weight) = half[HALF - 1 - k];
        all[k] = (-node, weight);
        all[N - 1 - k] = (node, weight);
        k += 1;
    }
    all
}

/// Returns the nodes of a rule from the middle outwards, each next to its mirror image.
///
/// In this order sums over even or odd functions keep their small parts.
pub const fn from_center<const N: usize>(rule: [(f64, f64); N]) -> [(f64, f64); N] {
    let mut all = rule;
    let middle = N % 2;
    if middle == 1 {
        all[0] = rule[N / 2];
    }
    let mut k = 0;
    while k < N / 2 {
        all[middle + 2 * k] = rule[N / 2 - 1 - k];
        all[middle + 2 * k + 1] = rule[N / 2 + middle + k];
        k += 1;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In either order, a rule is exact for powers up to its degree, and not
    /// for the next even power.
    fn check<const N: usize>(rule: [(f64, f64); N]) {
        let out = from_center(rule);
        assert!(rule.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert_eq!((out[0], out[N - 1]), (rule[(N - 1) / 2], rule[N - 1]));
        for rule in [rule, out] {
            let integral = |power: usize| rule.iter().map(|(x, w)| w * x.powi(power as i32)).sum::<f64>();
            for power in 0..2 * N {
                let exact = if power % 2 == 0 { 2.0 / (power + 1) as f64 } else { 0.0 };
                assert!((integral(power) - exact).abs() < 1e-15, "{N} {power}");
            }
            assert!((integral(2 * N) - 2.0 / (2 * N + 1) as f64).abs() > 1e-6, "{N}");
        }
    }

    #[test]
    fn polynomials_are_integrated_exactly() {
        check(GAUSS_3);
        check(GAUSS_5);
        check(GAUSS_6);
        check(GAUSS_8);
    }
}
