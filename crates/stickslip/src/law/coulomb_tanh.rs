//! Dry friction smoothed over velocity by a hyperbolic tangent.
//!
//! `f = limit tanh(u'/velocity)`.
//! It never sticks: at `|f| < limit` it creeps with `u' = velocity artanh(f/limit)`. It reaches
//! its limit much faster than the arctangent: at three times `velocity` it carries 99.5 % of it.
//! Source: Andersson, Söderberg, Björklund (2007), "Friction models for sliding dry, boundary
//! and mixed lubricated contacts", Tribology International 40, 580-587.

use super::interface::prox::resolve_saturating;
use super::{Law, LawInfo, Parameter, ProxView, RateLaw, RateView, RelativeMotion, SampleMeans};
use crate::dimension::Dimension;
use std::f64::consts::{LN_2, PI};
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "coulomb-tanh",
    summary: "smoothed dry friction, f = limit tanh(u'/velocity)",
    parameters: &[
        Parameter::limit("friction force at high sliding velocity"),
        Parameter::positive("velocity", Dimension::VELOCITY, "velocity at which friction reaches 76 % of `limit`"),
    ],
    sample: &[2.0, 4e-5],
    build: |values| Arc::new(CoulombTanh { limit: values[0], velocity: values[1] }),
};

/// Smooth dry friction.
///
/// # Example
/// ```
/// use stickslip::law::{CoulombTanh, RateLaw, RelativeMotion};
/// let law = CoulombTanh { limit: 2.0, velocity: 1.0 };
/// let force = law.evaluate::<f64>(&RelativeMotion::along(0.0, 3f64.ln()), &[], &mut []);
/// assert!((force[0] - 1.6).abs() < 1e-15);   // tanh(ln 3) = 4/5
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoulombTanh {
    /// Limit of the force at high velocity, N.
    pub limit: f64,
    /// Velocity over which friction changes its sign, m/s.
    pub velocity: f64,
}

impl Law for CoulombTanh {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.limit, self.velocity]
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn force_scale(&self) -> f64 {
        self.limit
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
    fn prox(&self) -> Option<&dyn ProxView> {
        Some(self)
    }
    fn is_incrementally_passive(&self) -> bool {
        true // the force grows with velocity
    }
}

impl RateLaw for CoulombTanh {
    #[inline]
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, _z: &[S], _rate: &mut [S]) -> [S; 3] {
        let zero = S::from(0.0);
        [tanh(motion.velocity[0] / self.velocity) * self.limit, zero, zero]
    }
}

impl ProxView for CoulombTanh {
    fn resolve(&self, y: &[f64], penalty: f64, force: &mut [f64], slope: &mut [f64]) {
        let (value, rise) =
            resolve_saturating(y[0] / self.limit, self.limit / (penalty * self.velocity), tanh_with_slope);
        (force[0], slope[0]) = (self.limit * value, rise);
    }
    fn force_at_velocity(&self, velocity: f64) -> Option<(f64, f64)> {
        let (value, rise) = tanh_with_slope(velocity / self.velocity);
        Some((self.limit * value, self.limit / self.velocity * rise))
    }
    fn mean_at_velocity(&self, velocity: f64, e: f64) -> Option<SampleMeans> {
        let mean = mean_of_tanh(velocity / self.velocity, e / self.velocity);
        Some(mean.scaled(self.limit, 1.0 / self.velocity))
    }
}

/// Returns `tanh x = -d/(2 + d)`, `d = e^{-2|x|} - 1`, which neither overflows nor cancels.
#[inline]
fn tanh<S: Real>(x: S) -> S {
    let negative = x.re() < 0.0;
    let d = (if negative { x * 2.0 } else { x * -2.0 }).exp_m1();
    let value = d / (d + 2.0);
    if negative { value } else { -value }
}

/// Returns `tanh x` and its derivative `1/cosh²x`.
fn tanh_with_slope(x: f64) -> (f64, f64) {
    let d = (-2.0 * x.abs()).exp();
    (tanh(x), 4.0 * d / ((1.0 + d) * (1.0 + d)))
}

/// Returns means of `tanh(y + eξ)` over `-1 < ξ < 1`, in closed form, or by quadrature where the
/// closed form would lose digits to cancellation.
fn mean_of_tanh(y: f64, e: f64) -> SampleMeans {
    // Quadrature is exact to rounding if the sample is much shorter than the distance π/2 of the
    // poles, or if the tangent differs from ±1 by less than rounding, 2 e^{-2·20}.
    if e.abs() < 0.2 || y.abs() - e.abs() > 20.0 {
        return SampleMeans::by_quadrature(y, e, tanh_with_slope);
    }
    SampleMeans::by_antiderivatives(y, e, |x| [tanh(x), log_cosh(x), integral_of_log_cosh(x)])
}

/// Returns `ln cosh x`, the integral of `tanh` from zero.
fn log_cosh(x: f64) -> f64 {
    x.abs() - LN_2 + (-2.0 * x.abs()).exp().ln_1p()
}

/// Returns the integral of `ln cosh` from zero:
/// `x²/2 - x ln 2 + π²/24 + Li₂(-e^{-2x})/2` for `x ≥ 0`, an odd function.
fn integral_of_log_cosh(x: f64) -> f64 {
    let size = x.abs();
    let value = 0.5 * size * size - LN_2 * size + PI * PI / 24.0 + 0.5 * dilogarithm_of_negative((-2.0 * size).exp());
    value.copysign(x)
}

/// Returns `Li₂(-q)` for `0 ≤ q ≤ 1`, by Landen's identity
/// `Li₂(-q) = -Li₂(q/(1+q)) - ½ ln²(1+q)`, whose argument is at most one half.
fn dilogarithm_of_negative(q: f64) -> f64 {
    let (z, log) = (q / (1.0 + q), q.ln_1p());
    // the terms fall by more than half; 55 leave less than rounding
    let mut power = 1.0;
    let series: f64 = (1..=55)
        .map(|n| {
            power *= z;
            power / f64::from(n * n)
        })
        .sum();
    -series - 0.5 * log * log
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: SciPy, `-spence(1 + q)`.
    #[test]
    fn dilogarithms_are_those_of_scipy() {
        for (q, expected) in
            [(1.0, -PI * PI / 12.0), (0.5, -0.448_414_206_923_646_2), (1e-3, -9.997_501_110_485_408e-4), (0.0, 0.0)]
        {
            let found = dilogarithm_of_negative(q);
            assert!((found - expected).abs() <= 4e-16, "{q}: {found} {expected}");
        }
    }

    /// Means over samples against the midpoint rule with 100,000 points.
    #[test]
    fn means_are_those_of_a_fine_sum() {
        for (y, e) in [(0.0, 1.0), (0.3, -0.7), (-2.0, 5.0), (30.0, 40.0), (0.1, 300.0), (1e3, 10.0), (0.5, 0.1)] {
            let n = 100_000;
            let mut sums = [0.0; 5];
            for k in 0..n {
                let xi = 2.0 * (f64::from(k) + 0.5) / f64::from(n) - 1.0;
                let value = f64::tanh(y + e * xi);
                let slope = f64::cosh(y + e * xi).powi(-2);
                let terms = [value, xi * value, slope, xi * slope, xi * xi * slope];
                sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term / f64::from(n));
            }
            let mean = mean_of_tanh(y, e);
            let found = [mean.zeroth, mean.first, mean.slope, mean.slope_first, mean.slope_second];
            for (found, expected) in found.iter().zip(sums) {
                assert!((found - expected).abs() < 2e-6, "{y} {e}: {found} {expected}");
            }
        }
    }

    #[test]
    fn the_resolvent_solves_its_equation() {
        for s in [1e-6, 0.3, 1.0, 50.0, 1e9] {
            for y in [-7.0, -1.0, -1e-3, 0.0, 1e-9, 0.4, 0.999, 1.0, 1.001, 3.0] {
                let (value, rise) = resolve_saturating(y, s, tanh_with_slope);
                let w: f64 = y - value;
                // both differences round to the last digit of y, and the slope at w is at most s
                let rounding = f64::EPSILON * (1.0 + y.abs()) * (1.0 + s);
                assert!((value - (s * w).tanh()).abs() <= rounding, "{s} {y}: {value}");
                let step = 1e-6;
                let difference = (resolve_saturating(y + step, s, tanh_with_slope).0
                    - resolve_saturating(y - step, s, tanh_with_slope).0)
                    / (2.0 * step);
                // near the limit of a steep law the slope changes within the step
                let smooth = s < 100.0 || (y.abs() - 1.0).abs() > 0.01;
                assert!(!smooth || (rise - difference).abs() < 1e-6, "{s} {y}: {rise} {difference}");
            }
        }
    }
}
