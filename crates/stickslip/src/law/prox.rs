//! The prox view: the resolvent of a law that the velocity decides, rigid (set-valued at rest) or steep.
//!
//! For any penalty `ε > 0` (N s/m), `λ = φ(v)` says the same as `λ = J(λ + ε v)` with the resolvent `J = (1 + ε φ⁻¹)⁻¹`. For rigid friction
//! that is the projection onto `|λ| ≤ limit`. `J` never rises faster than its argument, however steep φ is.
//! Source: Alart and Curnier (1991); Parikh and Boyd, "Proximal Algorithms" (2014).

use std::fmt::Debug;
use stickslip_numerics::quadrature;

/// A law of velocity by its resolvent.
pub trait Prox: Debug + Send + Sync {
    /// The force `λ` (N) of `λ + ε φ⁻¹(λ) ∋ y` along all directions, and its derivative by `y` (row-major, directions squared), into `force`
    /// and `slope`. `y` is in N, the `penalty` ε in N s/m.
    fn resolve(&self, y: &[f64], penalty: f64, force: &mut [f64], slope: &mut [f64]);
    /// The force at a velocity along one direction (m/s) and its derivative, N and N s/m; `None` if a velocity of zero leaves it open.
    fn at_velocity(&self, _velocity: f64) -> Option<(f64, f64)> {
        None
    }
    /// Compliance of a spring in series with it, m/N; zero if there is none.
    fn compliance(&self) -> f64 {
        0.0
    }
    /// The penalty above which the resolvent is single-valued, N s/m: zero unless friction falls with velocity.
    fn least_penalty(&self) -> f64 {
        0.0
    }
    /// Means of `J(y + e ξ)` over a sample, `-1 < ξ < 1`, along one direction.
    fn mean(&self, y: f64, e: f64, penalty: f64) -> Mean {
        Mean::of(y, e, |y| {
            let (mut force, mut slope) = ([0.0], [0.0]);
            self.resolve(&[y], penalty, &mut force, &mut slope);
            (force[0], slope[0])
        })
    }
    /// The same of the force at the velocity `velocity + e ξ`, m/s; `None` where [`Prox::at_velocity`] is.
    fn mean_at_velocity(&self, velocity: f64, e: f64) -> Option<Mean> {
        self.at_velocity(velocity)?;
        Some(Mean::of(velocity, e, |v| self.at_velocity(v).unwrap_or_default()))
    }
}

/// Means over a sample of a map `g(y + e ξ)`, `-1 < ξ < 1`, in its own units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mean {
    /// Of g.
    pub zeroth: f64,
    /// Of ξ g.
    pub first: f64,
    /// Of g'.
    pub slope: f64,
    /// Of ξ g'.
    pub slope_first: f64,
    /// Of ξ² g'.
    pub slope_second: f64,
}

impl Mean {
    /// By quadrature of g and g', which `g` gives.
    #[inline]
    pub fn of(y: f64, e: f64, g: impl Fn(f64) -> (f64, f64)) -> Self {
        if e == 0.0 {
            let (zeroth, slope) = g(y);
            return Mean { zeroth, slope, slope_second: slope / 3.0, ..Mean::default() };
        }
        let mut mean = Mean::default();
        for (xi, weight) in const { quadrature::outwards(quadrature::SIX) } {
            let (value, slope) = g(y + e * xi);
            mean.zeroth += 0.5 * weight * value;
            mean.first += 0.5 * weight * xi * value;
            mean.slope += 0.5 * weight * slope;
            mean.slope_first += 0.5 * weight * xi * slope;
            mean.slope_second += 0.5 * weight * xi * xi * slope;
        }
        mean
    }
}
