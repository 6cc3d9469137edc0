//! Linear springs in the directions of a joint, `f = k u`: a contact whose faces stay closed, or
//! stay apart.
//!
//! This law is not in the table. It replaces other laws in the linear references, see
//! [`crate::law::Law::closed_stiffness`].

use crate::dimension::Dimension;
use crate::law::interface::ideal_elements::UNREACHABLE_LIMIT;
use crate::law::{
    IdealElement, Law, LawInfo, MAX_DIRECTIONS, Parameter, Range, RateLaw, RateView, RelativeMotion, SharedLaw,
};
use std::sync::Arc;
use stickslip_numerics::dual::Real;

const fn along(key: &'static str) -> Parameter {
    Parameter::new(key, Dimension::STIFFNESS, Range::ZeroOrMore, "stiffness along this direction")
}

static INFO: LawInfo = LawInfo {
    name: "springs",
    summary: "linear springs, f = stiffness u along every direction",
    parameters: &[
        along("first"),
        along("second"),
        along("third"),
        Parameter::new("directions", Dimension::NONE, Range::Count(3), "number of directions"),
    ],
    sample: &[1e4, 1e4, 1e4, 3.0],
    build: |values| LinearSprings::shared(&values[..(values[3] as usize).clamp(1, MAX_DIRECTIONS)]),
};

/// Linear springs in one to three directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::law) struct LinearSprings {
    /// Stiffness, N/m; zero beyond `directions`.
    stiffness: [f64; MAX_DIRECTIONS],
    directions: usize,
}

impl LinearSprings {
    /// Returns a shared law with these stiffnesses, N/m, one per direction.
    pub fn shared(along: &[f64]) -> SharedLaw {
        let stiffness = std::array::from_fn(|a| along.get(a).copied().unwrap_or(0.0));
        Arc::new(LinearSprings { stiffness, directions: along.len() })
    }
}

impl Law for LinearSprings {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        self.stiffness.iter().copied().chain([self.directions as f64]).collect()
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn directions(&self) -> usize {
        self.directions
    }
    fn force_scale(&self) -> f64 {
        if self.stiffness.iter().all(|k| *k == 0.0) { 0.0 } else { f64::INFINITY }
    }
    /// In one direction, exact methods take the spring as a slider that never slips, or as
    /// nothing.
    fn ideal_elements(&self) -> Option<Vec<IdealElement>> {
        match (self.directions, self.stiffness[0]) {
            (1, 0.0) => Some(Vec::new()),
            (1, stiffness) => Some(vec![IdealElement::slider(Some(stiffness), UNREACHABLE_LIMIT)]),
            _ => None,
        }
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
    fn is_incrementally_passive(&self) -> bool {
        true // springs store the energy that they receive
    }
}

impl RateLaw for LinearSprings {
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, _z: &[S], _rate: &mut [S]) -> [S; MAX_DIRECTIONS] {
        std::array::from_fn(|a| motion.displacement[a] * self.stiffness[a])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{FrictionContact, Gap};

    #[test]
    fn references_of_contacts_are_linear_springs() {
        let contact = FrictionContact { tangential: 3.0, normal: 5.0, friction: 0.1, preload: 1.0, tangents: 1 };
        let law: &dyn Law = &contact;
        let (stuck, free) = (law.stuck_reference().unwrap(), law.frictionless_reference().unwrap());
        let at = RelativeMotion { displacement: [2.0, -1.0, 0.0], velocity: [1.0; 3] };
        let force = |law: &SharedLaw| law.rate().unwrap().evaluate_values(&at, &[], &mut []);
        // The stuck reference also carries tension.
        assert_eq!((force(&stuck), force(&free)), ([6.0, -5.0, 0.0], [0.0; 3]));
        assert!(free.carries_no_force() && !stuck.carries_no_force() && stuck.directions() == 2);
        assert!(stuck.check().is_ok() && *(INFO.build)(&stuck.values()) == *stuck);
        let gap: &dyn Law = &Gap { gap: 1e-3, stiffness: 7.0 };
        assert_eq!(
            (gap.stuck_reference().unwrap().values()[0], gap.frictionless_reference().unwrap().carries_no_force()),
            (7.0, true)
        );
        assert!(gap.frictionless_reference().unwrap().sliders().is_some_and(|sliders| sliders.is_empty()));
    }
}
