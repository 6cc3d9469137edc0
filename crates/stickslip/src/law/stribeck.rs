//! Rigid dry friction that falls with velocity: a Stribeck curve, or a static and a dynamic
//! limit.
//!
//! `|f| <= Fs` at rest, `f = sgn(u') g(u')`, `g(v) = Fc + (Fs - Fc) exp(-(v/vs)²)` in slip. With
//! `vs = 0` the force drops from Fs to Fc as soon as the faces slip.
//! Source: Stribeck (1902); in this form Bo and Pavelescu, "The friction-speed relation and its
//! influence on the critical velocity of stick-slip motion" (1982).

use super::interface::parameter::STATIC_LIMIT;
use super::kernels::stribeck_curve::check_limits;
use super::{
    Contact, CoulombArctan, IdealElement, Law, LawInfo, Parameter, ProxView, Range, SharedLaw, Slider, SlidingView,
    StribeckArctan,
};
use crate::dimension::Dimension;
use std::f64::consts::E;
use std::sync::Arc;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "stribeck",
    summary: "rigid friction that falls with velocity, |f| <= Fs at rest, f = sgn(u') (Fc + (Fs - Fc) exp(-(u'/vs)^2)) in slip",
    parameters: &[
        Parameter::limit("friction force at high velocity, Fc"),
        Parameter::new(
            STATIC_LIMIT,
            Dimension::FORCE,
            Range::ZeroOrMore,
            "force at which slip begins, Fs; not below `limit`",
        ),
        Parameter::new(
            "velocity",
            Dimension::VELOCITY,
            Range::ZeroOrMore,
            "velocity over which friction falls, vs; 0: friction drops immediately at slip",
        )
        .with_default(0.0),
    ],
    sample: &[2.0, 2.5, 0.01],
    build: |values| Arc::new(Stribeck { limit: values[0], static_limit: values[1], velocity: values[2] }),
};

/// Rigid friction that falls with velocity.
///
/// # Example
/// ```
/// use stickslip::law::{Law, ProxView, Stribeck};
/// let law = Stribeck { limit: 2.0, static_limit: 2.5, velocity: 0.01 };
/// let (mut force, mut slope) = ([0.0], [0.0]);
/// law.resolve(&[2.4], 1e3, &mut force, &mut slope);
/// assert_eq!((force[0], slope[0]), (2.4, 1.0)); // it sticks
/// law.resolve(&[1002.0], 1e3, &mut force, &mut slope);
/// assert_eq!(force[0], 2.0); // it slips at 1 m/s
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stribeck {
    /// Friction force at high velocity `Fc`, N.
    pub limit: f64,
    /// Force at which slip begins `Fs`, N.
    pub static_limit: f64,
    /// Velocity `vs` over which friction falls, m/s.
    pub velocity: f64,
}

impl Stribeck {
    /// Tells whether the static and the dynamic limit are equal.
    fn is_constant(&self) -> bool {
        self.static_limit == self.limit
    }

    /// Returns the friction force (N) at a nonzero velocity and its derivative (N s/m).
    fn friction(&self, velocity: f64) -> (f64, f64) {
        if self.velocity == 0.0 || self.is_constant() {
            return (self.limit, 0.0);
        }
        let share = velocity / self.velocity;
        let excess = (self.static_limit - self.limit) * (-share * share).exp();
        (self.limit + excess, -2.0 * share / self.velocity * excess)
    }
}

impl Law for Stribeck {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.limit, self.static_limit, self.velocity]
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn force_scale(&self) -> f64 {
        self.static_limit
    }
    /// A slider with two limits. Available if `velocity` is zero or the limits are equal.
    fn ideal_elements(&self) -> Option<Vec<IdealElement>> {
        let slider = Slider { stiffness: None, limit: self.limit, static_limit: self.static_limit };
        (self.velocity == 0.0 || self.is_constant()).then(|| vec![IdealElement::Slider(slider)])
    }
    /// Available if `velocity` is positive or the limits are equal. Otherwise no penalty makes
    /// the resolvent single-valued.
    fn prox(&self) -> Option<&dyn ProxView> {
        if self.velocity > 0.0 || self.is_constant() { Some(self) } else { None }
    }
    /// Available under the same condition as the resolvent.
    fn sliding(&self) -> Option<&dyn SlidingView> {
        if self.velocity > 0.0 || self.is_constant() { Some(self) } else { None }
    }
    /// Available if `velocity` is positive or the limits are equal. Otherwise no smooth law with
    /// a single width has both limits.
    fn smooth_counterpart(&self, width: f64) -> Option<SharedLaw> {
        let Stribeck { limit, static_limit, velocity } = *self;
        if self.is_constant() {
            Some(Arc::new(CoulombArctan { limit, alpha: 1.0 / width }))
        } else if velocity > 0.0 {
            Some(Arc::new(StribeckArctan { limit, static_limit, velocity, alpha: 1.0 / width }))
        } else {
            None
        }
    }
    /// With equal limits, this is Coulomb's law, a monotone function of velocity.
    fn is_incrementally_passive(&self) -> bool {
        self.is_constant()
    }
    fn contact_state(&self, velocity: &[f64], force: &[f64]) -> Contact {
        let limit = if velocity[0] == 0.0 { self.static_limit } else { self.friction(velocity[0]).0 };
        Contact::of_smooth_law(limit, velocity, force)
    }
    fn check_consistency(&self) -> Result<(), String> {
        check_limits(self.limit, self.static_limit)
    }
}

impl SlidingView for Stribeck {
    fn slip_force(&self, velocity: f64) -> (f64, f64) {
        self.friction(velocity)
    }
}

impl ProxView for Stribeck {
    fn resolve(&self, y: &[f64], penalty: f64, force: &mut [f64], slope: &mut [f64]) {
        let target = y[0].abs();
        if target <= self.static_limit {
            (force[0], slope[0]) = (y[0], 1.0);
            return;
        }
        // Solve g(v) + penalty v = target for the velocity v, by Newton's method within a
        // bracket.
        let (mut low, mut high) = (0.0, (target - self.limit) / penalty);
        // rounding of the force, expressed as a velocity
        let rounding = f64::EPSILON * target / penalty;
        let mut v = high;
        // Upper bound on the iterations for the velocity. Bisection alone needs one per bit of
        // the result.
        for _ in 0..100 {
            let (friction, fall) = self.friction(v);
            let excess = friction + penalty * v - target;
            if excess > 0.0 {
                high = v
            } else {
                low = v
            }
            let next = v - excess / (penalty + fall);
            let next = if next >= low && next <= high { next } else { 0.5 * (low + high) };
            let step = (next - v).abs();
            v = next;
            if step <= rounding {
                break;
            }
        }
        let (friction, fall) = self.friction(v);
        (force[0], slope[0]) = (friction.copysign(y[0]), fall / (fall + penalty));
    }
    /// The steepest slope of the friction curve, at `v = vs / √2`.
    fn minimum_penalty(&self) -> f64 {
        if self.is_constant() {
            return 0.0;
        }
        (2.0 / E).sqrt() * (self.static_limit - self.limit) / self.velocity
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAW: Stribeck = Stribeck { limit: 2.0, static_limit: 2.5, velocity: 0.01 };

    #[test]
    fn the_resolvent_solves_its_equation_and_has_its_slope() {
        let penalty = 1.5 * LAW.minimum_penalty();
        let resolve = |y: f64| {
            let (mut force, mut slope) = ([0.0], [0.0]);
            LAW.resolve(&[y], penalty, &mut force, &mut slope);
            (force[0], slope[0])
        };
        for k in 0..200 {
            let y = -4.0 + 0.04 * f64::from(k);
            let (force, slope) = resolve(y);
            let velocity = (y - force) / penalty;
            let friction: f64 = super::super::kernels::stribeck_curve::stribeck_force(velocity, 2.0, 2.5, 0.01);
            if velocity == 0.0 {
                assert!(force.abs() <= 2.5);
            } else {
                assert!((force - friction.copysign(velocity)).abs() < 1e-13, "{y}: {force} {friction}");
            }
            let h = 1e-7;
            let difference = (resolve(y + h).0 - resolve(y - h).0) / (2.0 * h);
            if (y.abs() - 2.5).abs() > 2.0 * h {
                assert!((slope - difference).abs() < 1e-5 * (1.0 + slope.abs()), "{y}: {slope} {difference}");
            }
        }
    }

    #[test]
    fn the_least_penalty_is_the_steepest_fall() {
        let steepest = (1..4000).map(|k| -LAW.friction(f64::from(k) * 1e-5).1).fold(0.0, f64::max);
        assert!((LAW.minimum_penalty() / steepest - 1.0).abs() < 1e-5);
    }

    #[test]
    fn without_a_velocity_it_is_a_slider_with_two_limits() {
        let law = Stribeck { velocity: 0.0, ..LAW };
        let slider = Slider { stiffness: None, limit: 2.0, static_limit: 2.5 };
        assert_eq!(law.ideal_elements(), Some(vec![IdealElement::Slider(slider)]));
        assert!(law.prox().is_none() && law.smooth_counterpart(1e-5).is_none());
        let coulomb = Stribeck { static_limit: 2.0, ..law };
        assert!(
            coulomb.prox().is_some()
                && coulomb.smooth_counterpart(1e-5).is_some()
                && coulomb.is_incrementally_passive()
        );
    }
}
