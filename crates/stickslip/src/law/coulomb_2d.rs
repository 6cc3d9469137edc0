//! Dry friction of two rigid faces that slide in a plane.
//!
//! `|f| <= limit` in stick, `f = limit u'/|u'|` in slip: the isotropic friction disk.
//! Source: Coulomb (1785); as a set-valued law Moreau (1988).

use super::kernels::planar_slip::{RadialForce, radial};
use super::{Coulomb, Coulomb2dArctan, Law, LawInfo, Parameter, ProxView, SharedLaw};
use num_complex::Complex64;
use std::sync::Arc;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "coulomb-2d",
    summary: "rigid dry friction in a plane, |f| <= limit, f = limit u'/|u'| in slip",
    parameters: &[Parameter::limit("slip limit: magnitude of the friction force during slip")],
    sample: &[2.0],
    build: |values| Arc::new(Coulomb2d { limit: values[0] }),
};

/// Rigid dry friction in two directions.
///
/// # Example
/// ```
/// use stickslip::law::{Coulomb2d, ProxView};
/// let law = Coulomb2d { limit: 2.0 };
/// let (mut force, mut slope) = ([0.0; 2], [0.0; 4]);
/// law.resolve(&[3.0, 4.0], 1.0, &mut force, &mut slope);
/// assert!((force[0] - 1.2).abs() < 1e-15 && (force[1] - 1.6).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coulomb2d {
    /// Slip limit, N.
    pub limit: f64,
}

impl Law for Coulomb2d {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.limit]
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
    fn prox(&self) -> Option<&dyn ProxView> {
        Some(self)
    }
    fn smooth_counterpart(&self, width: f64) -> Option<SharedLaw> {
        Some(Arc::new(Coulomb2dArctan { limit: self.limit, alpha: 1.0 / width }))
    }
    fn is_incrementally_passive(&self) -> bool {
        true // the force is the subgradient of limit |u'|, which is convex
    }
    /// Motion in one direction gives Coulomb's law.
    fn describing_function(&self, amplitude: f64, omega: f64) -> Complex64 {
        Coulomb { limit: self.limit }.describing_function(amplitude, omega)
    }
}

impl ProxView for Coulomb2d {
    /// Projects onto the disk.
    fn resolve(&self, y: &[f64], _penalty: f64, force: &mut [f64], slope: &mut [f64]) {
        let size = y[0].hypot(y[1]);
        let inside = size <= self.limit;
        let (value, rise) = if inside { (size, 1.0) } else { (self.limit, 0.0) };
        radial(y, size, RadialForce { value, rise }, force, slope);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_is_that_of_the_projection() {
        let law = Coulomb2d { limit: 2.0 };
        let resolve = |y: [f64; 2]| {
            let (mut force, mut slope) = ([0.0; 2], [0.0; 4]);
            law.resolve(&y, 1.0, &mut force, &mut slope);
            (force, slope)
        };
        for y in [[0.0, 0.0], [0.5, -1.0], [3.0, 1.0], [-2.0, 9.0]] {
            let (force, slope) = resolve(y);
            assert!(force[0].hypot(force[1]) <= 2.0 + 1e-15);
            for j in 0..2 {
                let (mut up, mut down) = (y, y);
                up[j] += 1e-6;
                down[j] -= 1e-6;
                let (up, down) = (resolve(up).0, resolve(down).0);
                for i in 0..2 {
                    assert!(((up[i] - down[i]) / 2e-6 - slope[2 * i + j]).abs() < 1e-9, "{y:?}");
                }
            }
        }
    }
}
