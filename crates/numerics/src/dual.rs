//! Dual numbers: a value and its partial derivatives. A kernel is written once
//! and differentiated exactly.
//!
//! The arithmetic comes from the crate `num-dual`.
//! Source: Clifford (1873); Griewank and Walther (2008), Ch. 3.

use num_dual::{Derivative, DualNum, DualSVec64};

/// The numbers of a law's kernel: plain, or with derivatives.
///
/// `S::from(1.0)` makes a constant, `.re()` returns the value, and the
/// elementary functions are methods.
pub trait Real: DualNum<Primitive = f64> + Copy {}

impl<T: DualNum<Primitive = f64> + Copy> Real for T {}

/// A value with `N` partial derivatives.
///
/// # Example
/// ```
/// use stickslip_numerics::dual::{Dual, partials, variable};
/// let x: Dual<1> = variable(2.0, 0);
/// let y = x * x * 3.0;
/// assert_eq!((y.re, partials(&y)[0]), (12.0, 12.0));
/// ```
pub type Dual<const N: usize> = DualSVec64<N>;

/// Returns the independent variable number `index`: its derivative with respect to itself is one.
///
/// # Panics
/// If `index` is not less than `N`.
#[inline]
pub fn variable<const N: usize>(value: f64, index: usize) -> Dual<N> {
    Dual::from_re(value).derivative(index)
}

/// Returns the partial derivatives.
#[inline]
pub fn partials<const N: usize>(dual: &Dual<N>) -> [f64; N] {
    match &dual.eps {
        Derivative(Some(eps)) => std::array::from_fn(|i| eps[i]),
        Derivative(None) => [0.0; N],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A kernel with every kind of operation that the laws use.
    fn kernel<S: Real>(x: S, y: S) -> S {
        (x * y - y / (x + 3.0)).atan() + (x * 0.5).sinh() * y.cosh() - (y.powi(2) + 1.0).sqrt() * (-x).exp()
    }

    #[test]
    fn partials_are_the_slopes() {
        let at = (0.7, -0.4);
        let d = kernel::<Dual<2>>(variable(at.0, 0), variable(at.1, 1));
        assert_eq!(d.re, kernel(at.0, at.1));
        let step = 1e-5;
        let by_x = (kernel(at.0 + step, at.1) - kernel(at.0 - step, at.1)) / (2.0 * step);
        let by_y = (kernel(at.0, at.1 + step) - kernel(at.0, at.1 - step)) / (2.0 * step);
        let [x, y] = partials(&d);
        assert!((x - by_x).abs() < 1e-9 && (y - by_y).abs() < 1e-9, "{x} {by_x} {y} {by_y}");
    }

    #[test]
    fn a_constant_has_no_slope() {
        assert_eq!(partials(&Dual::<3>::from(2.0)), [0.0; 3]);
    }
}
