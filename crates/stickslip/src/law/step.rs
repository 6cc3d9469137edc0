//! The step view: the force at the end of a step, from the motion over it and the state before it (return map).

use super::relative::MOST_DIRECTIONS;
use super::slopes::{FEW, Slopes, WIDTH, seeded};
use std::fmt::Debug;
use stickslip_numerics::dual::{Dual, Real};

/// What the author of a law of step form writes, once for numbers and for dual numbers. Time does not occur in it: what happens depends on the
/// way and not on the speed.
pub trait StepLaw {
    /// Number of internal states `z`; all are zero in a contact that has not been moved.
    fn states(&self) -> usize;
    /// The size that internal states have in motion, in their own unit.
    fn state_scale(&self) -> f64 {
        1.0
    }
    /// Force (N) at the end of a straight step of the displacement `from` one point `to` the next (m); `z` is replaced by the states at its end.
    fn advance<S: Real>(
        &self,
        from: &[S; MOST_DIRECTIONS],
        to: &[S; MOST_DIRECTIONS],
        z: &mut [S],
    ) -> [S; MOST_DIRECTIONS];
    /// The same for numbers, with derivatives by hand, if the author has any: they cost a fifth of those by dual numbers. One row for each of the first
    /// `directions` forces and one for each state, of derivatives by the displacement before along all directions, the one after, and the states before.
    fn tangent(
        &self,
        _from: &[f64; MOST_DIRECTIONS],
        _to: &[f64; MOST_DIRECTIONS],
        _z: &mut [f64],
        _slopes: StepSlopes<'_>,
    ) -> Option<[f64; MOST_DIRECTIONS]> {
        None
    }
    /// Whether the joint sticks throughout a motion that leads straight from `from` (m), where the states are `z`, to
    /// `mean` (m) and then stays within `reach` (m) of it: force and states are then linear in the motion. `false` is
    /// always right.
    fn holds(&self, _from: (&[f64; MOST_DIRECTIONS], &[f64]), _to: Reach<'_>) -> bool {
        false
    }
}

/// Displacements within `reach` of `mean` along each direction, m.
#[derive(Debug, Clone, Copy)]
pub struct Reach<'a> {
    /// Centre of the motion, m.
    pub mean: &'a [f64; MOST_DIRECTIONS],
    /// Largest distance from it, m.
    pub reach: &'a [f64; MOST_DIRECTIONS],
}

/// Where the derivatives of a step go: rows of the forces, and rows of the states.
#[derive(Debug)]
pub struct StepSlopes<'a> {
    /// Directions of the joint.
    pub directions: usize,
    /// Row after row, one for each direction.
    pub force: &'a mut [f64],
    /// Row after row, one for each state.
    pub state: &'a mut [f64],
}

/// The step view as methods see it; every [`StepLaw`] has it.
pub trait Step: Debug + Send + Sync {
    /// Number of internal states.
    fn states(&self) -> usize;
    /// Their size in motion, see [`StepLaw::state_scale`].
    fn state_scale(&self) -> f64;
    /// Force (N) at the end of a step; `z` is replaced by the states there.
    fn value(
        &self,
        from: &[f64; MOST_DIRECTIONS],
        to: &[f64; MOST_DIRECTIONS],
        z: &mut [f64],
    ) -> [f64; MOST_DIRECTIONS];
    /// The same with exact derivatives, along the first `directions`; `z` stays.
    fn linearise(
        &self,
        directions: usize,
        from: &[f64; MOST_DIRECTIONS],
        to: &[f64; MOST_DIRECTIONS],
        z: &[f64],
        point: &mut StepPoint,
    );
    /// Steps around a closed way, `[direction][point]`, from its first point to the next and in the end from the last to the first: forces at the points,
    /// and with `rows` the derivatives of the step to every point along the first `directions`: rows of the states, then of the forces, as long as in
    /// [`StepPoint`]. `states` are those at the first point, before and after, and those at all points, `[point][state]`, as the last time around
    /// this way has left them, with the forces, or no numbers: from where both meet on the forces are there already.
    fn around(
        &self,
        directions: usize,
        way: &[Vec<f64>; MOST_DIRECTIONS],
        states: (&mut [f64], &mut [f64]),
        force: &mut [Vec<f64>; MOST_DIRECTIONS],
        rows: Option<&mut [f64]>,
    );
    /// See [`StepLaw::holds`].
    fn holds(&self, from: (&[f64; MOST_DIRECTIONS], &[f64]), to: Reach<'_>) -> bool;
}

/// Force and states at the end of a step, with derivatives by its arguments: the displacement before along all directions, the one after along
/// all directions, the states before.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StepPoint {
    /// Force along the directions, N.
    pub force: [f64; MOST_DIRECTIONS],
    /// States at the end.
    pub state: Vec<f64>,
    /// Derivatives, one row of arguments for each force, then for each state.
    slopes: Slopes,
}

impl StepPoint {
    /// For a law with so many directions and internal states.
    pub fn new(directions: usize, states: usize) -> Self {
        StepPoint { force: [0.0; MOST_DIRECTIONS], state: vec![0.0; states], slopes: Slopes::new(directions, states) }
    }

    /// Derivatives of force `a` by all arguments.
    pub fn force_slope(&self, a: usize) -> &[f64] {
        self.slopes.force(a)
    }

    /// Derivatives of state `s` at the end by all arguments.
    pub fn state_slope(&self, s: usize) -> &[f64] {
        self.slopes.state(s)
    }
}

impl<L: StepLaw + Debug + Send + Sync> Step for L {
    fn states(&self) -> usize {
        StepLaw::states(self)
    }
    fn state_scale(&self) -> f64 {
        StepLaw::state_scale(self)
    }
    #[inline]
    fn value(
        &self,
        from: &[f64; MOST_DIRECTIONS],
        to: &[f64; MOST_DIRECTIONS],
        z: &mut [f64],
    ) -> [f64; MOST_DIRECTIONS] {
        self.advance(from, to, z)
    }
    fn linearise(
        &self,
        directions: usize,
        from: &[f64; MOST_DIRECTIONS],
        to: &[f64; MOST_DIRECTIONS],
        z: &[f64],
        point: &mut StepPoint,
    ) {
        point.state.copy_from_slice(z);
        let (force, state) = point.slopes.parts_mut();
        let slopes = StepSlopes { directions, force, state };
        if let Some(force) = self.tangent(from, to, &mut point.state, slopes) {
            point.force = force;
            return;
        }
        match 2 * directions + z.len() {
            0..=3 => pass::<3, L>(self, directions, (from, to), z, 0, point),
            4 | 5 => pass::<5, L>(self, directions, (from, to), z, 0, point),
            arguments => {
                for first in (0..arguments).step_by(WIDTH) {
                    pass::<WIDTH, L>(self, directions, (from, to), z, first, point);
                }
            }
        }
    }
    fn around(
        &self,
        directions: usize,
        way: &[Vec<f64>; MOST_DIRECTIONS],
        (z, trail): (&mut [f64], &mut [f64]),
        force: &mut [Vec<f64>; MOST_DIRECTIONS],
        rows: Option<&mut [f64]>,
    ) {
        let n = way[0].len();
        let at = |i: usize| std::array::from_fn(|a| if a < directions { way[a][i] } else { 0.0 });
        let mut keep = |i: usize, now: [f64; MOST_DIRECTIONS]| {
            force.iter_mut().zip(now).take(directions).for_each(|(force, now)| force[i] = now);
        };
        let Some(rows) = rows else {
            match z.len() {
                1 => values::<1, L>(self, (n, at), (z, trail), keep),
                2 => values::<2, L>(self, (n, at), (z, trail), keep),
                _ => {
                    let mut from = at(0);
                    for step in 1..=n {
                        let i = step % n;
                        let to = at(i);
                        keep(i, self.advance(&from, &to, z));
                        from = to;
                        let (end, here) = (&trail[..z.len()], &trail[i * z.len()..(i + 1) * z.len()]);
                        if !z.is_empty() && here == z {
                            z.copy_from_slice(end);
                            return;
                        }
                        trail[i * z.len()..(i + 1) * z.len()].copy_from_slice(z);
                    }
                }
            }
            return;
        };
        trail.fill(f64::NAN);
        let (states, width) = (z.len(), 2 * directions + z.len());
        let mut point = StepPoint::new(directions, states);
        let mut from = at(0);
        for step in 1..=n {
            let i = step % n;
            let to = at(i);
            let rows = &mut rows[i * (states + directions) * width..][..(states + directions) * width];
            let (state, slopes) = rows.split_at_mut(states * width);
            let own = StepSlopes { directions, force: &mut *slopes, state: &mut *state };
            let now = self.tangent(&from, &to, z, own).unwrap_or_else(|| {
                self.linearise(directions, &from, &to, z, &mut point);
                let (of_forces, of_states) = point.slopes.parts_mut();
                slopes.copy_from_slice(of_forces);
                state.copy_from_slice(of_states);
                z.copy_from_slice(&point.state);
                point.force
            });
            keep(i, now);
            from = to;
        }
    }
    fn holds(&self, from: (&[f64; MOST_DIRECTIONS], &[f64]), to: Reach<'_>) -> bool {
        StepLaw::holds(self, from, to)
    }
}

/// The steps of [`Step::around`] without derivatives, of a law with so many states: most have one or two.
fn values<const STATES: usize, L: StepLaw>(
    law: &L,
    (n, at): (usize, impl Fn(usize) -> [f64; MOST_DIRECTIONS]),
    (z, trail): (&mut [f64], &mut [f64]),
    mut keep: impl FnMut(usize, [f64; MOST_DIRECTIONS]),
) {
    let mut now: [f64; STATES] = std::array::from_fn(|s| z[s]);
    let (trail, _) = trail.as_chunks_mut::<STATES>();
    let mut from = at(0);
    for step in 1..=n {
        let i = if step == n { 0 } else { step };
        let to = at(i);
        keep(i, law.advance(&from, &to, &mut now));
        from = to;
        if trail[i] == now {
            now = trail[0];
            break;
        }
        trail[i] = now;
    }
    z.copy_from_slice(&now);
}

/// Derivatives by the arguments from `first` on, as many as the dual number has.
fn pass<const N: usize, L: StepLaw>(
    law: &L,
    directions: usize,
    (from, to): (&[f64; MOST_DIRECTIONS], &[f64; MOST_DIRECTIONS]),
    z: &[f64],
    first: usize,
    point: &mut StepPoint,
) {
    let seeded = |value: f64, argument: usize| -> Dual<N> { seeded(value, argument, first) };
    let zero = Dual::<N>::from(0.0);
    let (mut before, mut after) = ([zero; MOST_DIRECTIONS], [zero; MOST_DIRECTIONS]);
    for a in 0..directions {
        before[a] = seeded(from[a], a);
        after[a] = seeded(to[a], directions + a);
    }
    let mut few = [zero; FEW];
    let mut many = vec![zero; if z.len() > FEW { z.len() } else { 0 }];
    let state = if z.len() > FEW { &mut many[..] } else { &mut few[..z.len()] };
    for (s, (dual, &value)) in state.iter_mut().zip(z).enumerate() {
        *dual = seeded(value, 2 * directions + s);
    }
    let force = law.advance(&before, &after, state);
    for a in 0..directions {
        point.force[a] = force[a].re;
        point.slopes.keep(a, first, &force[a]);
    }
    for (s, state) in state.iter().enumerate() {
        point.state[s] = state.re;
        point.slopes.keep(directions + s, first, state);
    }
}
