//! Derivatives of a law's forces and states with respect to its arguments, shared by the rate
//! view and the step view. Each pass of dual numbers fills some columns.

use stickslip_numerics::dual::{Dual, partials, variable};

/// Number of derivatives per pass for laws with many arguments.
pub(in crate::law) const PASS_WIDTH: usize = 8;
/// Largest number of internal states that are stored on the stack.
pub(in crate::law) const STACK_STATES: usize = 8;

/// One row per force, then one row per state (or per state rate). The columns are two vectors in
/// all directions, then the states.
#[derive(Debug, Clone, PartialEq, Default)]
pub(in crate::law) struct Derivatives {
    values: Vec<f64>,
    directions: usize,
    arguments: usize,
}

impl Derivatives {
    pub fn new(directions: usize, states: usize) -> Self {
        let arguments = 2 * directions + states;
        Derivatives { values: vec![0.0; (directions + states) * arguments], directions, arguments }
    }

    /// Returns the row of force `a`.
    #[inline]
    pub fn force(&self, a: usize) -> &[f64] {
        &self.values[a * self.arguments..(a + 1) * self.arguments]
    }

    /// Returns the row of state `s`, or of its rate.
    #[inline]
    pub fn state(&self, s: usize) -> &[f64] {
        self.force(self.directions + s)
    }

    /// Returns all rows.
    pub fn all_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Returns the rows of the forces and the rows of the states.
    pub fn force_and_state_mut(&mut self) -> (&mut [f64], &mut [f64]) {
        self.values.split_at_mut(self.directions * self.arguments)
    }

    /// Stores the derivatives of one pass, from argument `first` on, in a row. The rows of the
    /// states follow those of the forces.
    #[inline]
    pub fn store<const N: usize>(&mut self, row: usize, first: usize, value: &Dual<N>) {
        let width = N.min(self.arguments - first);
        let kept = &mut self.values[row * self.arguments + first..];
        match kept.first_chunk_mut::<N>() {
            Some(kept) if width == N => *kept = partials(value), // the compiler knows this length
            _ => kept[..width].copy_from_slice(&partials(value)[..width]),
        }
    }
}

/// Returns an argument as a dual number. It carries a derivative if the pass that starts at
/// `first` contains it.
#[inline]
pub(in crate::law) fn dual_argument<const N: usize>(value: f64, argument: usize, first: usize) -> Dual<N> {
    match argument.checked_sub(first) {
        Some(at) if at < N => variable(value, at),
        _ => Dual::from(value),
    }
}
