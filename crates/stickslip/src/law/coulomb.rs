//! Dry friction of two rigid faces: Coulomb's set-valued law.
//!
//! `f = limit · Sgn(u')`: any force in `[-limit, limit]` while the faces stick, `±limit` while
//! they slip.
//! Source: the "2V" law of Pust, Pesek, Radolfova (2015), Sec. 1; as a set-valued law Moreau
//! (1988).

use super::{CoulombArctan, IdealElement, Law, LawInfo, Parameter, ProxView, SharedLaw, SlidingView};
use num_complex::Complex64;
use std::f64::consts::PI;
use std::sync::Arc;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "coulomb",
    summary: "rigid dry friction, f = limit Sgn(u'), exact",
    parameters: &[Parameter::limit("slip limit: friction force during slip")],
    sample: &[2.0],
    build: |values| Arc::new(Coulomb { limit: values[0] }),
};

/// Rigid dry friction.
///
/// # Example
/// ```
/// use stickslip::law::{Coulomb, Law, IdealElement};
/// let law = Coulomb { limit: 2.0 };
/// assert_eq!(law.ideal_elements().unwrap(), [IdealElement::slider(None, 2.0)]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coulomb {
    /// Slip limit `Ft0`, N.
    pub limit: f64,
}

impl Law for Coulomb {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.limit]
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn force_scale(&self) -> f64 {
        self.limit
    }
    fn ideal_elements(&self) -> Option<Vec<IdealElement>> {
        Some(vec![IdealElement::slider(None, self.limit)])
    }
    fn prox(&self) -> Option<&dyn ProxView> {
        Some(self)
    }
    fn sliding(&self) -> Option<&dyn SlidingView> {
        Some(self)
    }
    fn smooth_counterpart(&self, width: f64) -> Option<SharedLaw> {
        Some(Arc::new(CoulombArctan { limit: self.limit, alpha: 1.0 / width }))
    }
    fn is_incrementally_passive(&self) -> bool {
        true // the force is a monotone set-valued function of velocity
    }
    fn describing_function(&self, amplitude: f64, _omega: f64) -> Complex64 {
        if self.limit == 0.0 {
            return Complex64::new(0.0, 0.0); // also at zero amplitude
        }
        Complex64::new(0.0, 4.0 * self.limit / (PI * amplitude))
    }
}

impl SlidingView for Coulomb {
    fn slip_force(&self, _velocity: f64) -> (f64, f64) {
        (self.limit, 0.0)
    }
}

impl ProxView for Coulomb {
    /// Projects onto `[-limit, limit]`.
    fn resolve(&self, y: &[f64], _penalty: f64, force: &mut [f64], slope: &mut [f64]) {
        force[0] = y[0].clamp(-self.limit, self.limit);
        slope[0] = if y[0].abs() < self.limit { 1.0 } else { 0.0 };
    }
}
