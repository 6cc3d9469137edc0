//! The prox view: the resolvent of a velocity-dependent law, rigid (set-valued at rest) or
//! steep.
//!
//! For any penalty `ε > 0` (N s/m), `λ = φ(v)` is equivalent to `λ = J(λ + ε v)` with the
//! resolvent `J = (1 + ε φ⁻¹)⁻¹`. For rigid friction, `J` is the projection onto `|λ| ≤ limit`.
//! If φ does not fall with velocity, `J` is nonexpansive, however steep φ is.
//! Source: Alart and Curnier (1991); Parikh and Boyd, "Proximal Algorithms" (2014).

use std::fmt::Debug;
use stickslip_numerics::quadrature;

/// A velocity-dependent law, given by its resolvent.
pub trait ProxView: Debug + Send + Sync {
    /// Solves `λ + ε φ⁻¹(λ) ∋ y` for the force `λ` (N) in all directions. Writes it into `force`
    /// and its derivative with respect to `y` into `slope` (row-major, directions squared). `y`
    /// is in N, the `penalty` ε in N s/m.
    fn resolve(&self, y: &[f64], penalty: f64, force: &mut [f64], slope: &mut [f64]);
    /// Returns the force (N) at a velocity (m/s) in one direction and its derivative (N s/m).
    /// `None` if the law is set-valued at zero velocity.
    fn force_at_velocity(&self, _velocity: f64) -> Option<(f64, f64)> {
        None
    }
    /// Returns the compliance of a spring in series, m/N; zero if there is no spring.
    fn compliance(&self) -> f64 {
        0.0
    }
    /// Returns the penalty above which the resolvent is single-valued, N s/m. It is zero unless
    /// friction falls with velocity.
    fn minimum_penalty(&self) -> f64 {
        0.0
    }
    /// Returns means of `J(y + e ξ)` over a sample, `-1 < ξ < 1`, in one direction.
    fn resolvent_means(&self, y: f64, e: f64, penalty: f64) -> SampleMeans {
        SampleMeans::by_quadrature(y, e, |y| {
            let (mut force, mut slope) = ([0.0], [0.0]);
            self.resolve(&[y], penalty, &mut force, &mut slope);
            (force[0], slope[0])
        })
    }
    /// Returns means of the force at the velocity `velocity + e ξ`, m/s. `None` if
    /// [`ProxView::force_at_velocity`] returns `None`.
    fn mean_at_velocity(&self, velocity: f64, e: f64) -> Option<SampleMeans> {
        self.force_at_velocity(velocity)?;
        Some(SampleMeans::by_quadrature(velocity, e, |v| self.force_at_velocity(v).unwrap_or_default()))
    }
}

/// Means of a function `g(y + e ξ)` over a sample, `-1 < ξ < 1`, in the units of `g`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SampleMeans {
    /// Mean of g.
    pub zeroth: f64,
    /// Mean of ξ g.
    pub first: f64,
    /// Mean of g'.
    pub slope: f64,
    /// Mean of ξ g'.
    pub slope_first: f64,
    /// Mean of ξ² g'.
    pub slope_second: f64,
}

impl SampleMeans {
    /// Returns the means of `size g(rate v)`, where these are the means of `g`.
    pub(crate) fn scaled(self, size: f64, rate: f64) -> Self {
        let slope = size * rate;
        SampleMeans {
            zeroth: size * self.zeroth,
            first: size * self.first,
            slope: slope * self.slope,
            slope_first: slope * self.slope_first,
            slope_second: slope * self.slope_second,
        }
    }

    /// Computes the means by quadrature. `g` returns the function's value and its derivative.
    #[inline]
    pub fn by_quadrature(y: f64, e: f64, g: impl Fn(f64) -> (f64, f64)) -> Self {
        if e == 0.0 {
            let (zeroth, slope) = g(y);
            return SampleMeans { zeroth, slope, slope_second: slope / 3.0, ..SampleMeans::default() };
        }
        let mut mean = SampleMeans::default();
        for (xi, weight) in const { quadrature::from_center(quadrature::GAUSS_6) } {
            let (value, slope) = g(y + e * xi);
            mean.zeroth += 0.5 * weight * value;
            mean.first += 0.5 * weight * xi * value;
            mean.slope += 0.5 * weight * slope;
            mean.slope_first += 0.5 * weight * xi * slope;
            mean.slope_second += 0.5 * weight * xi * xi * slope;
        }
        mean
    }

    /// Computes the means in closed form. `g` returns the function and its first and second
    /// antiderivative; the constants of integration do not matter. Half the length `e` of the
    /// sample must not be so short that their differences lose all digits.
    pub fn by_antiderivatives(y: f64, e: f64, g: impl Fn(f64) -> [f64; 3]) -> Self {
        let reach = e.abs();
        let ([low, low_once, low_twice], [high, high_once, high_twice]) = (g(y - reach), g(y + reach));
        let zeroth = (high_once - low_once) / (2.0 * reach);
        let first = (high_once + low_once) / (2.0 * reach) - (high_twice - low_twice) / (2.0 * reach * reach);
        let slope = (high - low) / (2.0 * reach);
        let sign = e.signum();
        SampleMeans {
            zeroth,
            first: first * sign,
            slope,
            slope_first: ((high + low) / (2.0 * reach) - zeroth / reach) * sign,
            slope_second: slope - 2.0 * first / reach,
        }
    }
}

/// Returns `λ` and `dλ/dy` of `λ + w = y`, `λ = g(s w)`. The odd function `g`, which the closure
/// returns with its derivative, tends to one and is concave for positive arguments.
pub(crate) fn resolve_saturating(y: f64, s: f64, g: impl Fn(f64) -> (f64, f64)) -> (f64, f64) {
    let target = y.abs();
    // The left side is increasing and concave in w, so Newton's method from below converges
    // monotonically. Both bounds follow from g(x) ≤ min(1, g'(0) x).
    let mut rise = s * g(0.0).1;
    let mut w = (target - 1.0).max(target / (1.0 + rise));
    // Upper bound on the iterations; they converge quadratically.
    for _ in 0..60 {
        let (value, slope) = g(s * w);
        rise = s * slope;
        let step = (w + value - target) / (1.0 + rise);
        w -= step;
        // rounding of the left side; NaN also ends the loop
        if step.abs() <= 4.0 * f64::EPSILON * target || step.is_nan() {
            break;
        }
    }
    ((target - w).copysign(y), rise / (1.0 + rise))
}
