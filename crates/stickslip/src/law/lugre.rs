//! LuGre friction: bristles with presliding, a static limit, friction that falls with velocity,
//! and frictional lag.
//!
//! `z' = v - s0 |v| z / g(v)`, `f = s0 z + s1 z' + s2 v`, `g(v) = Fc + (Fs - Fc) exp(-(v/vs)²)`,
//! with the bristle deflection z and `v = u'`.
//! Steady sliding: `f = g(v) sgn v + s2 v`. Without s1 and s2 and with `Fs = Fc` it is Dahl's
//! law.
//! Source: Canudas de Wit, Olsson, Åström, Lischinsky, "A new model for control of systems with
//! friction" (1995).
//!
//! The law is passive (gives no energy in a closed motion) while `s1 |v| <= 4 g(v)`. The power
//! that does not go into the bristles' elastic energy is `|v| (g q² + s1 |v| (1 - q)) + s2 v²`
//! with `q = s0 z sgn(v) / g`. Under this condition the bracket is never negative.

use super::interface::parameter::STATIC_LIMIT;
use super::kernels::kink::abs;
use super::kernels::stribeck_curve::stribeck_force;
use super::{Contact, Law, LawInfo, Parameter, Range, RateLaw, RateView, RelativeMotion};
use crate::dimension::Dimension;
use std::sync::Arc;
use stickslip_numerics::dual::Real;

/// Entry of this law in [`super::TABLE`].
pub(super) static INFO: LawInfo = LawInfo {
    name: "lugre",
    summary: "bristle friction, f = stiffness z + damping z' + viscous u', z' = u' - stiffness |u'| z/g(u')",
    parameters: &[
        Parameter::positive("stiffness", Dimension::STIFFNESS, "stiffness of the bristles, s0"),
        Parameter::new("damping", Dimension::DAMPING, Range::ZeroOrMore, "damping of the bristles, s1")
            .with_default(0.0),
        Parameter::new("viscous", Dimension::DAMPING, Range::ZeroOrMore, "viscous friction, s2").with_default(0.0),
        Parameter::limit("friction force at high velocity, Fc"),
        Parameter::new(
            STATIC_LIMIT,
            Dimension::FORCE,
            Range::ZeroOrMore,
            "force at which slip begins, Fs; not below `limit`",
        ),
        Parameter::positive("velocity", Dimension::VELOCITY, "velocity over which friction falls from Fs to Fc, vs"),
    ],
    sample: &[10_000.0, 10.0, 0.4, 2.0, 2.5, 0.01],
    build: |values| {
        Arc::new(LuGre {
            stiffness: values[0],
            damping: values[1],
            viscous: values[2],
            limit: values[3],
            static_limit: values[4],
            velocity: values[5],
        })
    },
};

/// Bristle friction. The internal state is the bristles' elastic force divided by the static
/// limit, dimensionless, between -1 and 1.
///
/// # Example
/// ```
/// use stickslip::law::{LuGre, RateLaw, RelativeMotion};
/// let law = LuGre {
///     stiffness: 1e4,
///     damping: 10.0,
///     viscous: 0.4,
///     limit: 2.0,
///     static_limit: 2.5,
///     velocity: 0.01,
/// };
/// // steady sliding at 1 m/s: the bristles carry `limit`, plus viscous friction
/// let mut rate = [0.0_f64];
/// let force = law.evaluate(&RelativeMotion::along(0.0, 1.0), &[2.0 / 2.5], &mut rate);
/// assert!((force[0] - 2.4).abs() < 1e-12 && rate[0].abs() < 1e-9);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LuGre {
    /// Stiffness of the bristles `s0`, N/m.
    pub stiffness: f64,
    /// Damping of the bristles `s1`, kg/s.
    pub damping: f64,
    /// Viscous friction `s2`, kg/s.
    pub viscous: f64,
    /// Friction force at high velocity `Fc`, N.
    pub limit: f64,
    /// Force at which slip begins `Fs`, N.
    pub static_limit: f64,
    /// Velocity `vs` over which friction falls, m/s.
    pub velocity: f64,
}

impl LuGre {
    /// Returns the force of steady sliding without viscous friction, N.
    fn steady<S: Real>(&self, velocity: S) -> S {
        stribeck_force(velocity, self.limit, self.static_limit, self.velocity)
    }
}

impl Law for LuGre {
    fn info(&self) -> &'static LawInfo {
        &INFO
    }
    fn values(&self) -> Vec<f64> {
        vec![self.stiffness, self.damping, self.viscous, self.limit, self.static_limit, self.velocity]
    }
    fn is_odd(&self) -> bool {
        true
    }
    /// The static limit. With both limits zero, viscous friction alone is unbounded.
    fn force_scale(&self) -> f64 {
        if self.static_limit == 0.0 && self.viscous > 0.0 { f64::INFINITY } else { self.static_limit }
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
    fn contact_state(&self, velocity: &[f64], force: &[f64]) -> Contact {
        Contact::of_smooth_law(self.steady(velocity[0]), velocity, &[force[0] - self.viscous * velocity[0]])
    }
    fn check_consistency(&self) -> Result<(), String> {
        super::kernels::stribeck_curve::check_limits(self.limit, self.static_limit)?;
        if self.limit == 0.0 && self.static_limit > 0.0 {
            return Err("`limit` is zero, but `static_limit` is positive: the law divides by the \
                 friction force, which is `limit` at high velocity; make `limit` positive"
                .to_owned());
        }
        Ok(())
    }
}

impl RateLaw for LuGre {
    fn states(&self) -> usize {
        usize::from(self.static_limit > 0.0) // without a limit there are no bristles
    }
    fn state_from_force(&self, force: &[f64], z: &mut [f64]) -> bool {
        z.fill((force[0] / self.static_limit).clamp(-1.0, 1.0));
        true
    }
    #[inline]
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, z: &[S], rate: &mut [S]) -> [S; 3] {
        let (zero, v) = (S::from(0.0), motion.velocity[0]);
        let viscous = v * self.viscous;
        let Some(&share) = z.first() else { return [viscous, zero, zero] };
        let bending = share * self.static_limit;
        let deflected = v - abs(v) * bending / self.steady(v); // z'
        rate[0] = deflected * (self.stiffness / self.static_limit);
        [bending + deflected * self.damping + viscous, zero, zero]
    }
}
