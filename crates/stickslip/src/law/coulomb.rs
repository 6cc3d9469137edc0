//! Dry friction of two rigid faces: Coulomb's set-valued law.
//!
//! `f = limit · Sgn(u')`: any force in `[-limit, limit]` while the faces stick, `±limit` while they slip.
//! Source: the "2V" law of Pust, Pesek, Radolfova (2015), Sec. 1; as a set-valued law Moreau (1988).

use super::{Branch, CoulombArctan, FrictionLaw, Law, Parameter};
use num_complex::Complex64;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Rigid dry friction with a fixed slip limit.
///
/// # Example
/// ```
/// use stickslip::law::{Coulomb, FrictionLaw};
/// assert_eq!(Coulomb { limit: 2.0 }.network().unwrap()[0].stiffness, None);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Coulomb {
    /// Slip limit `Ft0`, N.
    pub limit: f64,
}

impl FrictionLaw for Coulomb {
    const NAME: &'static str = "coulomb";
    const SUMMARY: &'static str = "rigid dry friction, f = limit Sgn(u'), exact";
    const PARAMETERS: &'static [Parameter] = &[Parameter::limit("slip limit: friction force while slipping")];

    fn from_values(values: &[f64]) -> Self {
        Coulomb { limit: values[0] }
    }
    fn values(&self) -> Vec<f64> {
        vec![self.limit]
    }
    fn network(&self) -> Option<Vec<Branch>> {
        Some(vec![Branch { stiffness: None, limit: self.limit }])
    }
    fn regularised(&self, width: f64) -> Option<Law> {
        Some(Law::CoulombArctan(CoulombArctan { limit: self.limit, alpha: 1.0 / width }))
    }
    fn is_incrementally_passive(&self) -> bool {
        true // the force is a monotone function of velocity, if a set-valued one
    }
    fn linearised(&self, amplitude: f64, _omega: f64) -> Complex64 {
        if self.limit == 0.0 {
            return Complex64::new(0.0, 0.0); // also without motion
        }
        Complex64::new(0.0, 4.0 * self.limit / (PI * amplitude))
    }
}
