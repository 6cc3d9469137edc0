//! Functions with a kink, and their derivatives at the kink.
//!
//! Hysteresis laws contain `|u'|` and `sgn u'`. These functions stay exact, without smoothing. A
//! motion passes the kink at isolated instants. There, the derivative is the mean of the
//! one-sided derivatives, so it is odd if the function is even. Time integration sees a jump of
//! a derivative at a velocity reversal and shortens its steps there.

use stickslip_numerics::dual::Real;

/// Returns the sign of a number; zero for zero.
pub(in crate::law) fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        0.0
    }
}

/// Returns `|x|`. Its derivative is the sign, zero at zero.
pub(in crate::law) fn abs<S: Real>(x: S) -> S {
    x * sign(x.re())
}

/// [`power`] treats numbers below this as zero. Their powers above the first are negligible, and
/// the negative powers in the derivatives would overflow.
const TINY: f64 = 1e-60;

/// Returns `|x|` raised to a power of one or more.
pub(in crate::law) fn power<S: Real>(x: S, exponent: f64) -> S {
    let size = abs(x);
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
