//! Functions with a kink, and how they are differentiated there.
//!
//! Laws of hysteresis speak of `|u'|` and `sgn u'`. These stay exact, without smoothing: at the kink itself, which a motion passes at single
//! instants, the derivative is the mean of those on its sides, so that it is odd where the function is even. What integrates such a law sees a
//! jump of a derivative when the velocity changes its sign, and shortens its steps there.

use stickslip_numerics::dual::Real;

/// The sign of a number; zero of zero.
pub(super) fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        0.0
    }
}

/// `|x|`; its derivative is the sign, zero at zero.
pub(super) fn size<S: Real>(x: S) -> S {
    x * sign(x.re())
}

/// Numbers below this count as zero in [`power`]: their powers above the first vanish, and their negative powers, of which derivatives are made,
/// do not overflow.
const TINY: f64 = 1e-60;

/// `|x|` to a power of one or more.
pub(super) fn power<S: Real>(x: S, exponent: f64) -> S {
    let size = size(x);
    if exponent == 1.0 {
        size
    } else if size.re() < TINY {
        S::from(0.0)
    } else {
        size.powf(exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stickslip_numerics::dual::{Dual, partials, variable};

    #[test]
    fn powers_have_the_slopes_of_their_formula() {
        for x in [-2.0, -1e-3, 1e-150, 0.0, 0.7] {
            for exponent in [1.0, 1.5, 2.0, 3.0, 4.7] {
                let found: Dual<1> = power(variable(x, 0), exponent);
                let expected = exponent * f64::abs(x).powf(exponent - 1.0) * sign(x);
                assert!((found.re - f64::abs(x).powf(exponent)).abs() <= 1e-14 * found.re + TINY, "{x} {exponent}");
                assert!((partials(&found)[0] - expected).abs() <= 1e-13 * expected.abs() + 1e-29, "{x} {exponent}");
            }
        }
    }
}
