//! Elastic dry friction in a plane, smoothed over velocity: a massless spring in series with an
//! arctangent slider.
//!
//! `f = kt (u - s)`, `s' = (tan(π |f| / (2 limit)) / alpha) f/|f|`. In one direction this is the
//! law `jenkins-arctan`.
//! Source: Pust, Pesek, Radolfova (2015), Sec. 3, made isotropic in a plane.

use super::kernels::planar_slip::dot;
use super::{Coulomb2dArctan, Jenkins, Law, LawInfo, Parameter, ProxView, RateLaw, RateView, RelativeMotion};
use crate::dimension::Dimension;
use num_complex::Complex64;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "jenkins-2d-arctan",
    summary: "spring and smoothed slider in series in a plane, f' = kt (u' - tan(pi |f|/(2 limit))/alpha f/|f|)",
    parameters: &[
        Parameter::positive("stiffness", Dimension::STIFFNESS, "tangential contact stiffness"),
        Parameter::limit("magnitude of the friction force at high sliding velocity"),
        Parameter::positive("alpha", Dimension::INVERSE_VELOCITY, "steepness of the arctangent at rest"),
    ],
    sample: &[10_000.0, 2.0, 25_000.0],
    build: |values| Arc::new(Jenkins2dArctan { stiffness: values[0], limit: values[1], alpha: values[2] }),
};

/// Spring and smooth slider in two directions.
///
/// The internal states are a vector z in the direction of the force with
/// `|z| = asinh(alpha |s'|)`, for the reasons of [`super::JenkinsArctan`]:
/// `f = limit (2/π) arctan(sinh |z|) z/|z|`.
///
/// # Example
/// ```
/// use stickslip::law::{Jenkins2dArctan, RateLaw, RelativeMotion};
/// let law = Jenkins2dArctan { stiffness: 1e4, limit: 2.0, alpha: 25e3 };
/// let motion = RelativeMotion { displacement: [0.0; 3], velocity: [0.0, 1e-3, 0.0] };
/// let mut rate = [0.0; 2];
/// assert_eq!(law.evaluate(&motion, &[0.0; 2], &mut rate)[..2], [0.0; 2]);
/// assert!((rate[1] - 1e4 * std::f64::consts::PI / 4.0 * 1e-3).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jenkins2dArctan {
    /// Stiffness of the spring `kt`, N/m.
    pub stiffness: f64,
    /// Limit of the slider force magnitude at high velocity, N.
    pub limit: f64,
    /// Steepness of the slider's arctangent at zero velocity, s/m.
    pub alpha: f64,
}

impl Law for Jenkins2dArctan {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.stiffness, self.limit, self.alpha]
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn directions(&self) -> usize {
        2
    }
    fn force_scale(&self) -> f64 {
        self.limit
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
    /// Resolvent of the slider without its spring.
    fn prox(&self) -> Option<&dyn ProxView> {
        if self.limit > 0.0 { Some(self) } else { None }
    }
    fn is_incrementally_passive(&self) -> bool {
        // the spring stores |δf|²/(2 kt); the slider velocity is the gradient of a convex
        // function of the force
        true
    }
    fn describing_function(&self, amplitude: f64, omega: f64) -> Complex64 {
        // The exact law is a sufficient initial guess for the smooth one.
        Jenkins { stiffness: self.stiffness, limit: self.limit }.describing_function(amplitude, omega)
    }
}

/// Below this value of `|z|²`, functions of it are evaluated as series. Their next terms are
/// then below rounding.
const SERIES_BELOW: f64 = 1e-3;

/// Even functions of ρ, smooth at zero, from `ρ²`: `arctan(sinh ρ) / ρ = G`, `sinh ρ / ρ`, and
/// `(cosh ρ - 1/G) / ρ²`.
fn even_functions<S: Real>(square: S) -> [S; 3] {
    if square.re() < SERIES_BELOW {
        let gudermann =
            (((square * (277.0 / 72_576.0) - 61.0 / 5040.0) * square + 1.0 / 24.0) * square - 1.0 / 6.0) * square + 1.0;
        let sinh = ((square * (1.0 / 5040.0) + 1.0 / 120.0) * square + 1.0 / 6.0) * square + 1.0;
        // 1/G = 1 + q/6 - q²/72 + (43/15120) q³ - (271/362880) q⁴ + …
        let third = 1.0 / 40_320.0 + 271.0 / 362_880.0;
        let difference = ((square * third + 1.0 / 720.0 - 43.0 / 15_120.0) * square + 1.0 / 18.0) * square + 1.0 / 3.0;
        return [gudermann, sinh, difference];
    }
    let size = square.sqrt();
    let sinh = size.sinh();
    let gudermann = sinh.atan() / size;
    [gudermann, sinh / size, (size.cosh() - gudermann.recip()) / square]
}

impl ProxView for Jenkins2dArctan {
    fn resolve(&self, y: &[f64], penalty: f64, force: &mut [f64], slope: &mut [f64]) {
        Coulomb2dArctan { limit: self.limit, alpha: self.alpha }.resolve(y, penalty, force, slope);
    }
    fn compliance(&self) -> f64 {
        1.0 / self.stiffness
    }
}

impl RateLaw for Jenkins2dArctan {
    #[inline]
    fn states(&self) -> usize {
        if self.limit > 0.0 { 2 } else { 0 } // without a limit, the spring carries no force
    }
    fn state_from_force(&self, force: &[f64], z: &mut [f64]) -> bool {
        let size = force[0].hypot(force[1]);
        // Forces beyond the limit are replaced by values just below it.
        // Largest force that determines a state, relative to the limit.
        let rho = ((size / self.limit).min(1.0 - 1e-12) / FRAC_2_PI).tan().asinh();
        let share = if size > 0.0 { rho / size } else { 0.0 };
        z.iter_mut().zip(force).for_each(|(z, force)| *z = force * share);
        true
    }
    #[inline]
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, z: &[S], rate: &mut [S]) -> [S; 3] {
        let zero = S::from(0.0);
        let &[x, y] = z else { return [zero; 3] };
        let z = [x, y];
        let [gudermann, sinh, difference] = even_functions(dot(z, z));
        // rate of the spring's elongation: u' - s'
        let creep = [0, 1].map(|a| motion.velocity[a] - z[a] * sinh * (1.0 / self.alpha));
        // Radially, df = limit (2/π) / cosh |z| d|z|; tangentially, df = limit (2/π) G dz.
        let speed = self.stiffness * FRAC_PI_2 / self.limit;
        let along = dot(z, creep) * difference;
        for a in 0..2 {
            rate[a] = (creep[a] / gudermann + z[a] * along) * speed;
        }
        let size = gudermann * (self.limit * FRAC_2_PI);
        [z[0] * size, z[1] * size, zero]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn state_from_force_is_exact() {
        let law = Jenkins2dArctan { stiffness: 3.0, limit: 2.0, alpha: 5.0 };
        for force in [[0.0, 0.0], [0.5, -1.2], [1e-9, 0.0], [-1.9, 0.6]] {
            let mut z = [0.0; 2];
            assert!(RateLaw::state_from_force(&law, &force, &mut z));
            let found = law.evaluate(&RelativeMotion::along(0.0, 0.0), &z, &mut [0.0; 2]);
            assert!((found[0] - force[0]).abs() < 1e-12 && (found[1] - force[1]).abs() < 1e-12, "{force:?} {found:?}");
        }
    }

    #[test]
    fn series_join_the_closed_forms() {
        for scale in [0.999, 1.001] {
            let square: f64 = SERIES_BELOW * scale;
            let rho = square.sqrt();
            let gudermann = rho.sinh().atan() / rho;
            let expected = [gudermann, rho.sinh() / rho, (rho.cosh() - 1.0 / gudermann) / square];
            for (found, expected) in even_functions(square).into_iter().zip(expected) {
                // the last function loses digits to cancellation
                assert!((found - expected).abs() < 1e-12, "{found} {expected}");
            }
        }
    }

    #[test]
    fn the_force_changes_as_the_spring_and_the_slider_say() {
        let law = Jenkins2dArctan { stiffness: 3.0, limit: 2.0, alpha: 5.0 };
        let force = |z: [f64; 2]| {
            let f = law.evaluate(&RelativeMotion::along(0.0, 0.0), &z, &mut [0.0; 2]);
            [f[0], f[1]]
        };
        for (z, v) in [([0.4, -1.0], [0.3, 0.7]), ([2.0, 3.0], [-1.0, 0.2]), ([1e-4, 0.0], [0.1, 0.1])] {
            let motion = RelativeMotion { displacement: [0.0; 3], velocity: [v[0], v[1], 0.0] };
            let mut rate = [0.0; 2];
            law.evaluate(&motion, &z, &mut rate);
            let now = force(z);
            let size = now[0].hypot(now[1]);
            let slip = (std::f64::consts::PI * size / 4.0).tan() / 5.0;
            for a in 0..2 {
                let h = 1e-5 / (1.0 + rate[0].hypot(rate[1]));
                let [up, down] = [h, -h].map(|h| force([z[0] + h * rate[0], z[1] + h * rate[1]])[a]);
                let expected = 3.0 * (v[a] - slip * now[a] / size);
                assert!(((up - down) / (2.0 * h) - expected).abs() < 1e-6, "{z:?}");
            }
        }
    }
}
