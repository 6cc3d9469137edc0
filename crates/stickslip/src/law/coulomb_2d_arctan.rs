//! Dry friction in a plane, smoothed over velocity.
//!
//! `f = limit (2/π) arctan(alpha |u'|) u'/|u'|`. In one direction this is the law
//! `coulomb-arctan`.
//! Source: Pust, Pesek, Radolfova (2015), Eq. (2), made isotropic in a plane.

use super::kernels::planar_slip::{RadialForce, dot, radial};
use super::{CoulombArctan, Law, LawInfo, Parameter, ProxView, RateLaw, RateView, RelativeMotion};
use crate::dimension::Dimension;
use num_complex::Complex64;
use std::f64::consts::FRAC_2_PI;
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "coulomb-2d-arctan",
    summary: "smoothed dry friction in a plane, f = limit (2/pi) arctan(alpha |u'|) u'/|u'|",
    parameters: &[
        Parameter::limit("magnitude of the friction force at high sliding velocity"),
        Parameter::positive("alpha", Dimension::INVERSE_VELOCITY, "steepness of the arctangent at rest"),
    ],
    sample: &[2.0, 25_000.0],
    build: |values| Arc::new(Coulomb2dArctan { limit: values[0], alpha: values[1] }),
};

/// Smoothed dry friction in two directions.
///
/// # Example
/// ```
/// use stickslip::law::{Coulomb2dArctan, RateLaw, RelativeMotion};
/// let law = Coulomb2dArctan { limit: 2.0, alpha: 1.0 };
/// let motion = RelativeMotion { displacement: [0.0_f64; 3], velocity: [0.6, -0.8, 0.0] };
/// let force = law.evaluate(&motion, &[], &mut []);
/// assert!((force[0] - 0.6).abs() < 1e-15 && (force[1] + 0.8).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coulomb2dArctan {
    /// Limit of the force magnitude at high velocity, N.
    pub limit: f64,
    /// Steepness at zero velocity, s/m.
    pub alpha: f64,
}

impl Coulomb2dArctan {
    /// Returns the one-dimensional law.
    fn along(&self) -> CoulombArctan {
        CoulombArctan { limit: self.limit, alpha: self.alpha }
    }
}

impl Law for Coulomb2dArctan {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.limit, self.alpha]
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
    fn prox(&self) -> Option<&dyn ProxView> {
        Some(self)
    }
    fn is_incrementally_passive(&self) -> bool {
        true // the force is the gradient of a convex function of velocity
    }
    fn describing_function(&self, amplitude: f64, omega: f64) -> Complex64 {
        self.along().describing_function(amplitude, omega)
    }
}

impl RateLaw for Coulomb2dArctan {
    #[inline]
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, _z: &[S], _rate: &mut [S]) -> [S; 3] {
        let v = [motion.velocity[0] * self.alpha, motion.velocity[1] * self.alpha];
        let square = dot(v, v);
        // Below this squared argument, `arctan x / x` is evaluated as a series. The sixth term
        // is then below rounding.
        let share = if square.re() < 1e-3 {
            (((square * (1.0 / 9.0) - 1.0 / 7.0) * square + 0.2) * square - 1.0 / 3.0) * square + 1.0
        } else {
            let size = square.sqrt();
            size.atan() / size
        };
        let size = share * (self.limit * FRAC_2_PI);
        [v[0] * size, v[1] * size, S::from(0.0)]
    }
}

impl ProxView for Coulomb2dArctan {
    fn resolve(&self, y: &[f64], penalty: f64, force: &mut [f64], slope: &mut [f64]) {
        let size = y[0].hypot(y[1]);
        let (mut value, mut rise) = ([0.0], [0.0]);
        self.along().resolve(&[size], penalty, &mut value, &mut rise);
        radial(y, size, RadialForce { value: value[0], rise: rise[0] }, force, slope);
    }
}
