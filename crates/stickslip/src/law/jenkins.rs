//! Elastic dry friction: a spring in series with an ideal slider (Jenkins element).
//!
//! `f = kt (u - s)`; the slider rests (`s' = 0`) while `|f| < limit`, and moves with `|f| = limit`.   Eq. (1)
//! The paper prints Eq. (1) with the sign of the spring force reversed; the form here is the consistent one.
//! Source: Jenkins (1962); Pust, Pesek, Radolfova (2015), Fig. 1a and Eq. (1).

use super::{Branch, FrictionLaw, JenkinsArctan, Law, Parameter};
use crate::dimension::Dimension;
use num_complex::Complex64;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Spring and ideal slider in series, without mass.
///
/// # Example
/// ```
/// use stickslip::law::{FrictionLaw, Jenkins};
/// let law = Jenkins { stiffness: 1e4, limit: 2.0 };
/// assert_eq!(law.network().unwrap()[0].stiffness, Some(1e4));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Jenkins {
    /// Stiffness of the spring `kt`, N/m.
    pub stiffness: f64,
    /// Slip limit `Ft0`, N.
    pub limit: f64,
}

impl FrictionLaw for Jenkins {
    const NAME: &'static str = "jenkins";
    const SUMMARY: &'static str = "spring and slider in series, f = kt (u - s), |f| <= limit, exact, paper Eq. (1)";
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::positive("stiffness", Dimension::STIFFNESS, "tangential contact stiffness"),
        Parameter::limit("slip limit: force while the slider moves"),
    ];

    fn from_values(values: &[f64]) -> Self {
        Jenkins { stiffness: values[0], limit: values[1] }
    }
    fn values(&self) -> Vec<f64> {
        vec![self.stiffness, self.limit]
    }
    #[doc(alias = "eq1")]
    fn network(&self) -> Option<Vec<Branch>> {
        Some(vec![Branch { stiffness: Some(self.stiffness), limit: self.limit }]) // Eq. (1)
    }
    fn regularised(&self, width: f64) -> Option<Law> {
        Some(Law::JenkinsArctan(JenkinsArctan { stiffness: self.stiffness, limit: self.limit, alpha: 1.0 / width }))
    }
    fn is_incrementally_passive(&self) -> bool {
        true // the spring keeps δf²/(2 kt), and the slider is Coulomb's
    }
    fn linearised(&self, amplitude: f64, _omega: f64) -> Complex64 {
        if self.limit == 0.0 {
            return Complex64::new(0.0, 0.0); // also without motion
        }
        let hold = self.limit / self.stiffness;
        if amplitude <= hold {
            return Complex64::new(self.stiffness, 0.0);
        }
        let slip = (1.0 - 2.0 * hold / amplitude).acos(); // phase at which slip begins
        let (sin, cos) = slip.sin_cos();
        Complex64::new(slip - sin * cos, sin * sin) * (self.stiffness / PI)
    }
}
