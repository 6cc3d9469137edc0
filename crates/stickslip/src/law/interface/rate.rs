//! The rate view: force and rates of the internal states, as smooth functions of the motion.

use super::derivatives::{Derivatives, PASS_WIDTH, STACK_STATES, dual_argument};
use super::relative_motion::{MAX_DIRECTIONS, RelativeMotion};
use std::fmt::Debug;
use stickslip_numerics::dual::{Dual, Real};

/// A law in rate form, written once for numbers and for dual numbers: `f = h(u, u', z)`,
/// `z' = g(u, u', z)`. Both functions are continuous. They are smooth except at kinks, such as
/// `|u'|` at a velocity reversal, where time integration shortens its steps.
pub trait RateLaw {
    /// Returns the number of internal states `z`.
    fn states(&self) -> usize {
        0
    }
    /// Returns the typical magnitude of the internal states, in their own unit. Error estimates
    /// of the states are relative to it.
    fn state_scale(&self) -> f64 {
        1.0
    }
    /// Writes into `z` the states at which the law carries a `force` (N) in its directions.
    /// Returns `false` if the force does not determine the states.
    fn state_from_force(&self, _force: &[f64], _z: &mut [f64]) -> bool {
        false
    }
    /// Returns the force (N) and writes the rates at one instant. `z` and `rate` have length
    /// [`RateLaw::states`]; the law defines their units.
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, z: &[S], rate: &mut [S]) -> [S; MAX_DIRECTIONS];
}

/// The rate view as methods use it; every [`RateLaw`] implements it.
pub trait RateView: Debug + Send + Sync {
    /// Returns the number of internal states.
    fn states(&self) -> usize;
    /// Returns the typical magnitude of the states, see [`RateLaw::state_scale`].
    fn state_scale(&self) -> f64;
    /// Writes the states at which the law carries a force, see [`RateLaw::state_from_force`].
    fn state_from_force(&self, force: &[f64], z: &mut [f64]) -> bool;
    /// Returns the force (N) and writes the rates at one instant.
    fn evaluate_values(&self, motion: &RelativeMotion<f64>, z: &[f64], rate: &mut [f64]) -> [f64; MAX_DIRECTIONS];
    /// Evaluates force and rates with exact derivatives, in the first `directions`.
    fn evaluate_with_derivatives(
        &self,
        directions: usize,
        motion: &RelativeMotion<f64>,
        z: &[f64],
        point: &mut RatePoint,
    );
    /// Tells whether one evaluation at many instants is much cheaper than many evaluations, as for
    /// a law that an interpreter evaluates over arrays.
    fn is_batched(&self) -> bool {
        false
    }
    /// Writes the force (N) at many instants of a law without internal states.
    fn evaluate_many_values(&self, motions: &[RelativeMotion<f64>], forces: &mut [[f64; MAX_DIRECTIONS]]) {
        forces.iter_mut().zip(motions).for_each(|(force, motion)| *force = self.evaluate_values(motion, &[], &mut []));
    }
    /// Evaluates force and rates with exact derivatives at many instants. `z` has the states of the
    /// first instant, then those of the second one, and so on.
    fn evaluate_many_with_derivatives(
        &self,
        directions: usize,
        motions: &[RelativeMotion<f64>],
        z: &[f64],
        points: &mut [RatePoint],
    ) {
        let states = self.states();
        for (i, (motion, point)) in motions.iter().zip(points).enumerate() {
            self.evaluate_with_derivatives(directions, motion, &z[i * states..(i + 1) * states], point);
        }
    }
}

/// Force and rates of a law at one instant, with derivatives. The arguments are `u` in all
/// directions, `u'` in all directions, then `z`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RatePoint {
    /// Force in each direction, N.
    pub force: [f64; MAX_DIRECTIONS],
    /// Rates of the internal states.
    pub rate: Vec<f64>,
    /// Derivatives: one row per force, then one row per rate; one column per argument.
    slopes: Derivatives,
}

impl RatePoint {
    /// Allocates a point for a law with these numbers of directions and internal states.
    pub fn new(directions: usize, states: usize) -> Self {
        RatePoint {
            force: [0.0; MAX_DIRECTIONS],
            rate: vec![0.0; states],
            slopes: Derivatives::new(directions, states),
        }
    }

    /// Returns the derivatives of force `a` with respect to all arguments.
    pub fn force_slope(&self, a: usize) -> &[f64] {
        self.slopes.force(a)
    }

    /// Returns the derivatives of the rate of state `s` with respect to all arguments.
    pub fn rate_slope(&self, s: usize) -> &[f64] {
        self.slopes.state(s)
    }

    /// Returns all derivatives for writing, for a law that computes them without dual numbers.
    /// One row per force, then one row per rate.
    pub fn slopes_mut(&mut self) -> &mut [f64] {
        self.slopes.all_mut()
    }
}

impl<L: RateLaw + Debug + Send + Sync> RateView for L {
    fn states(&self) -> usize {
        RateLaw::states(self)
    }
    fn state_scale(&self) -> f64 {
        RateLaw::state_scale(self)
    }
    fn state_from_force(&self, force: &[f64], z: &mut [f64]) -> bool {
        RateLaw::state_from_force(self, force, z)
    }
    #[inline]
    fn evaluate_values(&self, motion: &RelativeMotion<f64>, z: &[f64], rate: &mut [f64]) -> [f64; MAX_DIRECTIONS] {
        self.evaluate(motion, z, rate)
    }
    fn evaluate_with_derivatives(
        &self,
        directions: usize,
        motion: &RelativeMotion<f64>,
        z: &[f64],
        point: &mut RatePoint,
    ) {
        match 2 * directions + z.len() {
            0..=2 => dual_pass::<2, L>(self, directions, motion, z, 0, point),
            3 => dual_pass::<3, L>(self, directions, motion, z, 0, point),
            4 => dual_pass::<4, L>(self, directions, motion, z, 0, point),
            5 | 6 => dual_pass::<6, L>(self, directions, motion, z, 0, point),
            arguments => {
                for first in (0..arguments).step_by(PASS_WIDTH) {
                    dual_pass::<PASS_WIDTH, L>(self, directions, motion, z, first, point);
                }
            }
        }
    }
}

/// Computes the derivatives with respect to `N` arguments, starting at argument `first`.
#[inline]
fn dual_pass<const N: usize, L: RateLaw>(
    law: &L,
    directions: usize,
    motion: &RelativeMotion<f64>,
    z: &[f64],
    first: usize,
    point: &mut RatePoint,
) {
    let seeded = |value: f64, argument: usize| -> Dual<N> { dual_argument(value, argument, first) };
    let mut moving = RelativeMotion::along(Dual::from(0.0), Dual::from(0.0));
    for a in 0..directions {
        moving.displacement[a] = seeded(motion.displacement[a], a);
        moving.velocity[a] = seeded(motion.velocity[a], directions + a);
    }
    let zero = Dual::<N>::from(0.0);
    let mut few = [zero; 2 * STACK_STATES];
    let mut many = vec![zero; if z.len() > STACK_STATES { 2 * z.len() } else { 0 }];
    let both = if z.len() > STACK_STATES { &mut many[..] } else { &mut few[..2 * z.len()] };
    let (state, rate) = both.split_at_mut(z.len());
    for (s, (dual, &value)) in state.iter_mut().zip(z).enumerate() {
        *dual = seeded(value, 2 * directions + s);
    }
    let force = law.evaluate(&moving, state, rate);
    for a in 0..directions {
        point.force[a] = force[a].re;
        point.slopes.store(a, first, &force[a]);
    }
    for (s, rate) in rate.iter().enumerate() {
        point.rate[s] = rate.re;
        point.slopes.store(directions + s, first, rate);
    }
}
