//! An elastic stop with a gap: a spring that acts only beyond the gap.
//!
//! `f = k max(u - gap, 0)`. A negative gap is a spring that is compressed at `u = 0`: it presses
//! with `-k gap` and loses contact at `u = gap`. The force is single-valued with a kink at
//! contact, so no impact law is needed.
//! Source: den Hartog, "Mechanical Vibrations" (1956), Sec. 8.11; Shaw and Holmes, "A
//! periodically forced piecewise linear oscillator" (1983).

use super::{Contact, IdealElement, Law, LawInfo, Parameter, Range, RateLaw, RateView, RelativeMotion, SharedLaw};
use crate::dimension::Dimension;
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "gap",
    summary: "elastic stop with a gap, f = stiffness max(u - gap, 0), exact",
    parameters: &[
        Parameter::new(
            "gap",
            Dimension::LENGTH,
            Range::Any,
            "displacement at which the faces touch; negative: the stop is compressed at zero displacement",
        ),
        Parameter::positive("stiffness", Dimension::STIFFNESS, "stiffness of the stop"),
    ],
    sample: &[2e-4, 10_000.0],
    build: |values| Arc::new(Gap { gap: values[0], stiffness: values[1] }),
};

/// An elastic stop with a gap.
///
/// # Example
/// ```
/// use stickslip::law::{Gap, Law};
/// let law = Gap { gap: 0.0, stiffness: 1e4 };
/// // closed for half of the period: half the stiffness
/// assert!((law.describing_function(1e-3, 1.0).re - 5e3).abs() < 1e-9);
/// assert!(!law.is_odd());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// Displacement at which the faces meet, m.
    pub gap: f64,
    /// Stiffness of the stop, N/m.
    pub stiffness: f64,
}

impl Law for Gap {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.gap, self.stiffness]
    }
    fn normal(&self) -> Option<usize> {
        Some(0)
    }
    fn with_preload(&self, force: f64) -> Option<SharedLaw> {
        (self.gap >= 0.0).then(|| Arc::new(Gap { gap: -force / self.stiffness, ..*self }) as SharedLaw)
    }
    fn closed_stiffness(&self) -> Option<Vec<f64>> {
        Some(vec![self.stiffness])
    }
    fn ideal_elements(&self) -> Option<Vec<IdealElement>> {
        Some(vec![IdealElement::Stop { gap: self.gap, stiffness: self.stiffness }])
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
    fn is_odd(&self) -> bool {
        false
    }
    fn contact_state(&self, _velocity: &[f64], force: &[f64]) -> Contact {
        if force[0] > 0.0 { Contact::Touch } else { Contact::Open }
    }
}

impl RateLaw for Gap {
    #[inline]
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, _z: &[S], _rate: &mut [S]) -> [S; 3] {
        let zero = S::from(0.0);
        let depth = motion.displacement[0] - self.gap;
        [if depth.re() > 0.0 { depth * self.stiffness } else { zero }, zero, zero]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::RateView;

    #[test]
    fn contact_depends_on_the_gap() {
        let at = |gap: f64, u: f64| {
            let law = Gap { gap, stiffness: 1e3 };
            let force = RateView::evaluate_values(&law, &RelativeMotion::along(u, 0.0), &[], &mut [])[0];
            (force, law.contact_state(&[0.0], &[force]))
        };
        assert_eq!(at(0.5, 0.25), (0.0, Contact::Open));
        assert_eq!(at(0.5, 0.75), (250.0, Contact::Touch));
        assert_eq!(at(-0.5, 0.0), (500.0, Contact::Touch));
        assert_eq!(at(-0.5, -1.0), (0.0, Contact::Open));
    }
}
