//! The step view (return map): the force at the end of a step, from the displacements at both
//! ends and the state before it.

use super::derivatives::{Derivatives, PASS_WIDTH, STACK_STATES, dual_argument};
use super::relative_motion::MAX_DIRECTIONS;
use std::fmt::Debug;
use stickslip_numerics::dual::{Dual, Real};

/// A law in step form, written once for numbers and for dual numbers. It is rate-independent:
/// the force depends on the path of the displacement and not on time.
pub trait StepLaw {
    /// Returns the number of internal states `z`. All states are zero before the first motion.
    fn states(&self) -> usize;
    /// Returns the typical magnitude of the internal states, in their own unit.
    fn state_scale(&self) -> f64 {
        1.0
    }
    /// Returns the force (N) at the end of a straight step of the displacement (m) from the
    /// point `from` to the point `to`. Replaces `z` by the states at the end.
    fn advance<S: Real>(
        &self,
        from: &[S; MAX_DIRECTIONS],
        to: &[S; MAX_DIRECTIONS],
        z: &mut [S],
    ) -> [S; MAX_DIRECTIONS];
    /// Advances numbers with hand-written derivatives, if the law has any; they cost a fifth of
    /// those by dual numbers. `slopes` gets one row for each of the first `directions` forces
    /// and one row for each state. The columns are the displacement before the step in all
    /// directions, the displacement after it, and the states before it.
    fn analytic_derivatives(
        &self,
        _from: &[f64; MAX_DIRECTIONS],
        _to: &[f64; MAX_DIRECTIONS],
        _z: &mut [f64],
        _slopes: StepDerivatives<'_>,
    ) -> Option<[f64; MAX_DIRECTIONS]> {
        None
    }
    /// Tells whether the joint sticks during a whole motion. The motion leads straight from
    /// `from` (m), with states `z`, to `mean` (m), and then stays within `half_width` (m) of
    /// `mean`. Force and states are then linear in the motion. `false` is always a valid answer.
    fn sticks_throughout(&self, _from: (&[f64; MAX_DIRECTIONS], &[f64]), _to: DisplacementBox<'_>) -> bool {
        false
    }
}

/// Displacements within `half_width` of `mean` in each direction, m.
#[derive(Debug, Clone, Copy)]
pub struct DisplacementBox<'a> {
    /// Centre of the motion, m.
    pub mean: &'a [f64; MAX_DIRECTIONS],
    /// Largest distance from the centre, m.
    pub half_width: &'a [f64; MAX_DIRECTIONS],
}

/// Output memory for the derivatives of a step: rows of the forces, and rows of the states.
#[derive(Debug)]
pub struct StepDerivatives<'a> {
    /// Number of directions of the joint.
    pub directions: usize,
    /// Derivatives of the forces, row by row, one row per direction.
    pub force: &'a mut [f64],
    /// Derivatives of the states, row by row, one row per state.
    pub state: &'a mut [f64],
}

/// The step view as methods use it; every [`StepLaw`] implements it.
pub trait StepView: Debug + Send + Sync {
    /// Returns the number of internal states.
    fn states(&self) -> usize;
    /// Returns the typical magnitude of the states, see [`StepLaw::state_scale`].
    fn state_scale(&self) -> f64;
    /// Returns the force (N) at the end of a step. Replaces `z` by the states there.
    fn advance_values(
        &self,
        from: &[f64; MAX_DIRECTIONS],
        to: &[f64; MAX_DIRECTIONS],
        z: &mut [f64],
    ) -> [f64; MAX_DIRECTIONS];
    /// Advances a step with exact derivatives in the first `directions`, without changing `z`.
    fn advance_with_derivatives(
        &self,
        directions: usize,
        from: &[f64; MAX_DIRECTIONS],
        to: &[f64; MAX_DIRECTIONS],
        z: &[f64],
        point: &mut StepPoint,
    );
    /// Advances the law once around a closed path `[direction][point]`: from the first point to
    /// the last and back to the first. Writes the forces at all points.
    ///
    /// `rows` gets the derivatives of the step to each point, in the first `directions`: the
    /// rows of the states, then those of the forces, with the columns of [`StepPoint`].
    ///
    /// `states` holds two arrays. The first contains the states at the first point, before and
    /// after the cycle. The second contains the states at all points, `[point][state]`, from the
    /// previous cycle on this path, or NaN. Without `rows`, the cycle ends early when its states
    /// equal those of the previous cycle: the remaining forces are then already correct. With
    /// `rows`, the second array is set to NaN.
    fn advance_cycle(
        &self,
        directions: usize,
        path: &[Vec<f64>; MAX_DIRECTIONS],
        states: (&mut [f64], &mut [f64]),
        force: &mut [Vec<f64>; MAX_DIRECTIONS],
        rows: Option<&mut [f64]>,
    );
    /// Tells whether the joint sticks, see [`StepLaw::sticks_throughout`].
    fn sticks_throughout(&self, from: (&[f64; MAX_DIRECTIONS], &[f64]), to: DisplacementBox<'_>) -> bool;
}

/// Force and states at the end of a step, with derivatives. The arguments are the displacement
/// before the step in all directions, the displacement after it, then the states before it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StepPoint {
    /// Force in each direction, N.
    pub force: [f64; MAX_DIRECTIONS],
    /// States at the end of the step.
    pub state: Vec<f64>,
    /// Derivatives: one row per force, then one row per state; one column per argument.
    slopes: Derivatives,
}

impl StepPoint {
    /// Allocates a point for a law with these numbers of directions and internal states.
    pub fn new(directions: usize, states: usize) -> Self {
        StepPoint {
            force: [0.0; MAX_DIRECTIONS],
            state: vec![0.0; states],
            slopes: Derivatives::new(directions, states),
        }
    }

    /// Returns the derivatives of force `a` with respect to all arguments.
    pub fn force_slope(&self, a: usize) -> &[f64] {
        self.slopes.force(a)
    }

    /// Returns the derivatives of state `s` at the end with respect to all arguments.
    pub fn state_slope(&self, s: usize) -> &[f64] {
        self.slopes.state(s)
    }
}

impl<L: StepLaw + Debug + Send + Sync> StepView for L {
    fn states(&self) -> usize {
        StepLaw::states(self)
    }
    fn state_scale(&self) -> f64 {
        StepLaw::state_scale(self)
    }
    #[inline]
    fn advance_values(
        &self,
        from: &[f64; MAX_DIRECTIONS],
        to: &[f64; MAX_DIRECTIONS],
        z: &mut [f64],
    ) -> [f64; MAX_DIRECTIONS] {
        self.advance(from, to, z)
    }
    fn advance_with_derivatives(
        &self,
        directions: usize,
        from: &[f64; MAX_DIRECTIONS],
        to: &[f64; MAX_DIRECTIONS],
        z: &[f64],
        point: &mut StepPoint,
    ) {
        point.state.copy_from_slice(z);
        let (force, state) = point.slopes.force_and_state_mut();
        let slopes = StepDerivatives { directions, force, state };
        if let Some(force) = self.analytic_derivatives(from, to, &mut point.state, slopes) {
            point.force = force;
            return;
        }
        match 2 * directions + z.len() {
            0..=3 => dual_pass::<3, L>(self, directions, (from, to), z, 0, point),
            4 | 5 => dual_pass::<5, L>(self, directions, (from, to), z, 0, point),
            arguments => {
                for first in (0..arguments).step_by(PASS_WIDTH) {
                    dual_pass::<PASS_WIDTH, L>(self, directions, (from, to), z, first, point);
                }
            }
        }
    }
    fn advance_cycle(
        &self,
        directions: usize,
        path: &[Vec<f64>; MAX_DIRECTIONS],
        (z, previous_states): (&mut [f64], &mut [f64]),
        force: &mut [Vec<f64>; MAX_DIRECTIONS],
        rows: Option<&mut [f64]>,
    ) {
        let n = path[0].len();
        let at = |i: usize| std::array::from_fn(|a| if a < directions { path[a][i] } else { 0.0 });
        let mut store = |i: usize, now: [f64; MAX_DIRECTIONS]| {
            force.iter_mut().zip(now).take(directions).for_each(|(force, now)| force[i] = now);
        };
        let Some(rows) = rows else {
            match z.len() {
                1 => cycle_without_derivatives::<1, L>(self, (n, at), (z, previous_states), store),
                2 => cycle_without_derivatives::<2, L>(self, (n, at), (z, previous_states), store),
                _ => {
                    let mut from = at(0);
                    for step in 1..=n {
                        let i = step % n;
                        let to = at(i);
                        store(i, self.advance(&from, &to, z));
                        from = to;
                        let (end, here) =
                            (&previous_states[..z.len()], &previous_states[i * z.len()..(i + 1) * z.len()]);
                        if !z.is_empty() && here == z {
                            z.copy_from_slice(end);
                            return;
                        }
                        previous_states[i * z.len()..(i + 1) * z.len()].copy_from_slice(z);
                    }
                }
            }
            return;
        };
        previous_states.fill(f64::NAN);
        let (states, width) = (z.len(), 2 * directions + z.len());
        let mut point = StepPoint::new(directions, states);
        let mut from = at(0);
        for step in 1..=n {
            let i = step % n;
            let to = at(i);
            let rows = &mut rows[i * (states + directions) * width..][..(states + directions) * width];
            let (state, slopes) = rows.split_at_mut(states * width);
            let own = StepDerivatives { directions, force: &mut *slopes, state: &mut *state };
            let now = self.analytic_derivatives(&from, &to, z, own).unwrap_or_else(|| {
                self.advance_with_derivatives(directions, &from, &to, z, &mut point);
                let (of_forces, of_states) = point.slopes.force_and_state_mut();
                slopes.copy_from_slice(of_forces);
                state.copy_from_slice(of_states);
                z.copy_from_slice(&point.state);
                point.force
            });
            store(i, now);
            from = to;
        }
    }
    fn sticks_throughout(&self, from: (&[f64; MAX_DIRECTIONS], &[f64]), to: DisplacementBox<'_>) -> bool {
        StepLaw::sticks_throughout(self, from, to)
    }
}

/// Performs the steps of [`StepView::advance_cycle`] without derivatives, for a fixed number of
/// states. Most laws have one or two.
fn cycle_without_derivatives<const STATES: usize, L: StepLaw>(
    law: &L,
    (n, at): (usize, impl Fn(usize) -> [f64; MAX_DIRECTIONS]),
    (z, previous_states): (&mut [f64], &mut [f64]),
    mut store: impl FnMut(usize, [f64; MAX_DIRECTIONS]),
) {
    let mut now: [f64; STATES] = std::array::from_fn(|s| z[s]);
    let (previous_states, _) = previous_states.as_chunks_mut::<STATES>();
    let mut from = at(0);
    for step in 1..=n {
        let i = if step == n { 0 } else { step };
        let to = at(i);
        store(i, law.advance(&from, &to, &mut now));
        from = to;
        if previous_states[i] == now {
            now = previous_states[0];
            break;
        }
        previous_states[i] = now;
    }
    z.copy_from_slice(&now);
}

/// Computes the derivatives with respect to `N` arguments, starting at argument `first`.
fn dual_pass<const N: usize, L: StepLaw>(
    law: &L,
    directions: usize,
    (from, to): (&[f64; MAX_DIRECTIONS], &[f64; MAX_DIRECTIONS]),
    z: &[f64],
    first: usize,
    point: &mut StepPoint,
) {
    let seeded = |value: f64, argument: usize| -> Dual<N> { dual_argument(value, argument, first) };
    let zero = Dual::<N>::from(0.0);
    let (mut before, mut after) = ([zero; MAX_DIRECTIONS], [zero; MAX_DIRECTIONS]);
    for a in 0..directions {
        before[a] = seeded(from[a], a);
        after[a] = seeded(to[a], directions + a);
    }
    let mut few = [zero; STACK_STATES];
    let mut many = vec![zero; if z.len() > STACK_STATES { z.len() } else { 0 }];
    let state = if z.len() > STACK_STATES { &mut many[..] } else { &mut few[..z.len()] };
    for (s, (dual, &value)) in state.iter_mut().zip(z).enumerate() {
        *dual = seeded(value, 2 * directions + s);
    }
    let force = law.advance(&before, &after, state);
    for a in 0..directions {
        point.force[a] = force[a].re;
        point.slopes.store(a, first, &force[a]);
    }
    for (s, state) in state.iter().enumerate() {
        point.state[s] = state.re;
        point.slopes.store(directions + s, first, state);
    }
}
