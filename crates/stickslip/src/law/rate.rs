//! The rate view: force and rates of internal states, smooth in the motion.

use super::relative::{MOST_DIRECTIONS, Relative};
use super::slopes::{FEW, Slopes, WIDTH, seeded};
use std::fmt::Debug;
use stickslip_numerics::dual::{Dual, Real};

/// What the author of a law of rate form writes, once for numbers and for dual numbers: `f = h(u, u', z)`, `z' = g(u, u', z)`, both continuous, and
/// smooth but for kinks, such as `|u'|` where the motion turns: integration shortens its steps there.
pub trait RateLaw {
    /// Number of internal states `z`.
    fn states(&self) -> usize {
        0
    }
    /// The size that internal states have in motion, in their own unit: what errors in them are compared with.
    fn state_scale(&self) -> f64 {
        1.0
    }
    /// The states with which it carries a `force` (N) along its directions, into `z`; false if a force does not decide them.
    fn state_under(&self, _force: &[f64], _z: &mut [f64]) -> bool {
        false
    }
    /// Force (N) and rates at one instant. `z` and `rate` have length [`RateLaw::states`]; units belong to the law.
    fn evaluate<S: Real>(&self, motion: &Relative<S>, z: &[S], rate: &mut [S]) -> [S; MOST_DIRECTIONS];
}

/// The rate view as methods see it; every [`RateLaw`] has it.
pub trait Rate: Debug + Send + Sync {
    /// Number of internal states.
    fn states(&self) -> usize;
    /// Their size in motion, see [`RateLaw::state_scale`].
    fn state_scale(&self) -> f64;
    /// The states with which it carries a force, see [`RateLaw::state_under`].
    fn state_under(&self, force: &[f64], z: &mut [f64]) -> bool;
    /// Force (N) and rates at one instant.
    fn value(&self, motion: &Relative<f64>, z: &[f64], rate: &mut [f64]) -> [f64; MOST_DIRECTIONS];
    /// The same with exact derivatives, along the first `directions`.
    fn linearise(&self, directions: usize, motion: &Relative<f64>, z: &[f64], point: &mut RatePoint);
}

/// Force and rates of a law at one instant, with derivatives by its arguments: `u` along all directions, `u'` along all directions, `z`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RatePoint {
    /// Force along the directions, N.
    pub force: [f64; MOST_DIRECTIONS],
    /// Rates of the internal states.
    pub rate: Vec<f64>,
    /// Derivatives, one row of arguments for each force, then for each rate.
    slopes: Slopes,
}

impl RatePoint {
    /// For a law with so many directions and internal states.
    pub fn new(directions: usize, states: usize) -> Self {
        RatePoint { force: [0.0; MOST_DIRECTIONS], rate: vec![0.0; states], slopes: Slopes::new(directions, states) }
    }

    /// Derivatives of force `a` by all arguments.
    pub fn force_slope(&self, a: usize) -> &[f64] {
        self.slopes.force(a)
    }

    /// Derivatives of the rate of state `s` by all arguments.
    pub fn rate_slope(&self, s: usize) -> &[f64] {
        self.slopes.state(s)
    }

    /// All derivatives, for a law that computes them by itself: one row of arguments for each force, then for each rate.
    pub fn slopes_mut(&mut self) -> &mut [f64] {
        self.slopes.all_mut()
    }
}

impl<L: RateLaw + Debug + Send + Sync> Rate for L {
    fn states(&self) -> usize {
        RateLaw::states(self)
    }
    fn state_scale(&self) -> f64 {
        RateLaw::state_scale(self)
    }
    fn state_under(&self, force: &[f64], z: &mut [f64]) -> bool {
        RateLaw::state_under(self, force, z)
    }
    #[inline]
    fn value(&self, motion: &Relative<f64>, z: &[f64], rate: &mut [f64]) -> [f64; MOST_DIRECTIONS] {
        self.evaluate(motion, z, rate)
    }
    fn linearise(&self, directions: usize, motion: &Relative<f64>, z: &[f64], point: &mut RatePoint) {
        match 2 * directions + z.len() {
            0..=2 => pass::<2, L>(self, directions, motion, z, 0, point),
            3 => pass::<3, L>(self, directions, motion, z, 0, point),
            4 => pass::<4, L>(self, directions, motion, z, 0, point),
            5 | 6 => pass::<6, L>(self, directions, motion, z, 0, point),
            arguments => {
                for first in (0..arguments).step_by(WIDTH) {
                    pass::<WIDTH, L>(self, directions, motion, z, first, point);
                }
            }
        }
    }
}

/// Derivatives by the arguments from `first` on, as many as the dual number has.
#[inline]
fn pass<const N: usize, L: RateLaw>(
    law: &L,
    directions: usize,
    motion: &Relative<f64>,
    z: &[f64],
    first: usize,
    point: &mut RatePoint,
) {
    let seeded = |value: f64, argument: usize| -> Dual<N> { seeded(value, argument, first) };
    let mut moving = Relative::along(Dual::from(0.0), Dual::from(0.0));
    for a in 0..directions {
        moving.displacement[a] = seeded(motion.displacement[a], a);
        moving.velocity[a] = seeded(motion.velocity[a], directions + a);
    }
    let zero = Dual::<N>::from(0.0);
    let mut few = [zero; 2 * FEW];
    let mut many = vec![zero; if z.len() > FEW { 2 * z.len() } else { 0 }];
    let both = if z.len() > FEW { &mut many[..] } else { &mut few[..2 * z.len()] };
    let (state, rate) = both.split_at_mut(z.len());
    for (s, (dual, &value)) in state.iter_mut().zip(z).enumerate() {
        *dual = seeded(value, 2 * directions + s);
    }
    let force = law.evaluate(&moving, state, rate);
    for a in 0..directions {
        point.force[a] = force[a].re;
        point.slopes.keep(a, first, &force[a]);
    }
    for (s, rate) in rate.iter().enumerate() {
        point.rate[s] = rate.re;
        point.slopes.keep(directions + s, first, rate);
    }
}
