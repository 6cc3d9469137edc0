//! Dual numbers: a value and its partial derivatives, for kernels that are written once and differentiated exactly.
//!
//! `(a + a' ε)(b + b' ε) = ab + (a'b + ab') ε`, `ε² = 0`. Source: Clifford (1873); Griewank and Walther (2008), Ch. 3.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// What a law's kernel may do with a number: plain, or with derivatives.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// A constant.
    fn from_f64(value: f64) -> Self;
    /// The value without derivatives.
    fn value(self) -> f64;
    /// Arctangent.
    fn atan(self) -> Self;
    /// Hyperbolic sine.
    fn sinh(self) -> Self;
    /// Hyperbolic cosine.
    fn cosh(self) -> Self;
}

impl Real for f64 {
    #[inline]
    fn from_f64(value: f64) -> Self {
        value
    }
    #[inline]
    fn value(self) -> f64 {
        self
    }
    #[inline]
    fn atan(self) -> Self {
        self.atan()
    }
    #[inline]
    fn sinh(self) -> Self {
        self.sinh()
    }
    #[inline]
    fn cosh(self) -> Self {
        self.cosh()
    }
}

/// A value with `N` partial derivatives.
///
/// # Example
/// ```
/// use stickslip_numerics::dual::{Dual, Real};
/// let x = Dual::variable(2.0, 0);
/// let y: Dual<1> = x * x * Dual::from_f64(3.0);
/// assert_eq!((y.value, y.partials[0]), (12.0, 12.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dual<const N: usize> {
    /// Value.
    pub value: f64,
    /// Partial derivatives.
    pub partials: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// The variable number `index` at `value`.
    #[inline]
    pub fn variable(value: f64, index: usize) -> Self {
        let mut partials = [0.0; N];
        partials[index] = 1.0;
        Dual { value, partials }
    }

    /// `f(self)` from the value and the derivative of `f`.
    #[inline]
    fn chain(self, value: f64, derivative: f64) -> Self {
        Dual { value, partials: self.partials.map(|p| derivative * p) }
    }

    #[inline]
    fn combine(self, other: Self, value: f64, d_self: f64, d_other: f64) -> Self {
        let mut partials = [0.0; N];
        for i in 0..N {
            partials[i] = d_self * self.partials[i] + d_other * other.partials[i];
        }
        Dual { value, partials }
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        self.combine(other, self.value + other.value, 1.0, 1.0)
    }
}
impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self.combine(other, self.value - other.value, 1.0, -1.0)
    }
}
impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        self.combine(other, self.value * other.value, other.value, self.value)
    }
}
impl<const N: usize> Div for Dual<N> {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        let quotient = self.value / other.value;
        self.combine(other, quotient, 1.0 / other.value, -quotient / other.value)
    }
}
impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl<const N: usize> Real for Dual<N> {
    #[inline]
    fn from_f64(value: f64) -> Self {
        Dual { value, partials: [0.0; N] }
    }
    #[inline]
    fn value(self) -> f64 {
        self.value
    }
    #[inline]
    fn atan(self) -> Self {
        self.chain(self.value.atan(), 1.0 / (1.0 + self.value * self.value))
    }
    #[inline]
    fn sinh(self) -> Self {
        self.chain(self.value.sinh(), self.value.cosh())
    }
    #[inline]
    fn cosh(self) -> Self {
        self.chain(self.value.cosh(), self.value.sinh())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every rule against a central difference.
    #[test]
    fn derivatives_match_central_differences() {
        fn f<S: Real>(x: S, y: S) -> S {
            (x * y + x.sinh() / y.cosh() - -y).atan() * x / (x * x + S::from_f64(1.0))
        }
        let (x, y, h) = (0.7, -0.3, 1e-6);
        let exact = f(Dual::<2>::variable(x, 0), Dual::variable(y, 1));
        let differences = [(f(x + h, y) - f(x - h, y)) / (2.0 * h), (f(x, y + h) - f(x, y - h)) / (2.0 * h)];
        assert_eq!(exact.value, f(x, y));
        for i in 0..2 {
            assert!((exact.partials[i] - differences[i]).abs() < 1e-9, "{i}: {} {}", exact.partials[i], differences[i]);
        }
    }
}
