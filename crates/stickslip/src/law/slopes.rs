//! Derivatives of a law's forces and states by its arguments, filled in passes of dual numbers: what the rate and the step view share.

use stickslip_numerics::dual::{Dual, partials, variable};

/// Derivatives that are computed in one pass, where there are more than fit a smaller number.
pub(super) const WIDTH: usize = 8;
/// Internal states that are kept on the stack.
pub(super) const FEW: usize = 8;

/// One row of arguments for each force, then for each state (or its rate). Arguments are two motions along all directions, then the states.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Slopes {
    values: Vec<f64>,
    directions: usize,
    arguments: usize,
}

impl Slopes {
    pub fn new(directions: usize, states: usize) -> Self {
        let arguments = 2 * directions + states;
        Slopes { values: vec![0.0; (directions + states) * arguments], directions, arguments }
    }

    /// Of force `a`.
    #[inline]
    pub fn force(&self, a: usize) -> &[f64] {
        &self.values[a * self.arguments..(a + 1) * self.arguments]
    }

    /// Of state `s`, or of its rate.
    #[inline]
    pub fn state(&self, s: usize) -> &[f64] {
        self.force(self.directions + s)
    }

    /// All of them, row by row.
    pub fn all_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Those of the forces, and those of the states, row by row.
    pub fn parts_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        self.values.split_at_mut(self.directions * self.arguments)
    }

    /// Keeps what a pass found by the arguments from `first` on, for a force or, behind the forces, a state.
    #[inline]
    pub fn keep<const N: usize>(&mut self, row: usize, first: usize, value: &Dual<N>) {
        let width = N.min(self.arguments - first);
        let kept = &mut self.values[row * self.arguments + first..];
        match kept.first_chunk_mut::<N>() {
            Some(kept) if width == N => *kept = partials(value), // a length that the compiler knows
            _ => kept[..width].copy_from_slice(&partials(value)[..width]),
        }
    }
}

/// The argument of a number as a dual number of the pass by the arguments from `first` on.
#[inline]
pub(super) fn seeded<const N: usize>(value: f64, argument: usize, first: usize) -> Dual<N> {
    match argument.checked_sub(first) {
        Some(at) if at < N => variable(value, at),
        _ => Dual::from(value),
    }
}
