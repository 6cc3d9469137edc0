//! Elastic dry friction: a spring in series with an ideal slider (Jenkins element).
//!
//! `f = kt (u - s)`; the slider sticks (`s' = 0`) while `|f| < limit` and slips with
//! `|f| = limit`. Eq. (1)
//! The paper prints Eq. (1) with the sign of the spring force reversed; the form here is the
//! consistent one.
//! Source: Jenkins (1962); Pust, Pesek, Radolfova (2015), Fig. 1a and Eq. (1).

use super::{IdealElement, JenkinsArctan, Law, LawInfo, Parameter, SharedLaw};
use crate::dimension::Dimension;
use std::sync::Arc;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "jenkins",
    summary: "spring and slider in series, f = kt (u - s), |f| <= limit, exact, paper Eq. (1)",
    parameters: &[
        Parameter::positive("stiffness", Dimension::STIFFNESS, "tangential contact stiffness"),
        Parameter::limit("slip limit: force during slip"),
    ],
    sample: &[10_000.0, 2.0],
    build: |values| Arc::new(Jenkins { stiffness: values[0], limit: values[1] }),
};

/// Massless spring and ideal slider in series.
///
/// # Example
/// ```
/// use stickslip::law::{Jenkins, Law, IdealElement};
/// let law = Jenkins { stiffness: 1e4, limit: 2.0 };
/// assert_eq!(law.ideal_elements().unwrap(), [IdealElement::slider(Some(1e4), 2.0)]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jenkins {
    /// Stiffness of the spring `kt`, N/m.
    pub stiffness: f64,
    /// Slip limit `Ft0`, N.
    pub limit: f64,
}

impl Law for Jenkins {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.stiffness, self.limit]
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn force_scale(&self) -> f64 {
        self.limit
    }
    #[doc(alias = "eq1")]
    fn ideal_elements(&self) -> Option<Vec<IdealElement>> {
        Some(vec![IdealElement::slider(Some(self.stiffness), self.limit)]) // Eq. (1)
    }
    fn smooth_counterpart(&self, width: f64) -> Option<SharedLaw> {
        Some(Arc::new(JenkinsArctan { stiffness: self.stiffness, limit: self.limit, alpha: 1.0 / width }))
    }
    fn is_incrementally_passive(&self) -> bool {
        true // the spring stores δf²/(2 kt), and the Coulomb slider is passive
    }
}
