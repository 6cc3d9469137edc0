//! What the march along a motion finds: its turning points, and the intervals between which a slider's force is linear in it.

use num_complex::Complex64;
use stickslip_numerics::fourier::FourierPlan;

/// A part of the period in which the force is `stiffness u + offset`.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Interval {
    /// Phase, rad; the end may lie beyond a period.
    pub(super) begin: f64,
    pub(super) end: f64,
    pub(super) stiffness: f64,
    pub(super) offset: f64,
    pub(super) anchor: Anchor,
    pub(super) slips: bool,
}

/// What the offset moves with.
#[derive(Debug, Clone, Copy)]
pub(in super::super) enum Anchor {
    /// Nothing: the slider has not slipped since static equilibrium.
    Nothing,
    /// The motion at a phase, rad.
    At(f64),
}

/// A turning point of the motion: phase (rad) and value (m).
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Extreme {
    pub(super) at: f64,
    pub(super) value: f64,
}

/// Where a motion is looked at to tell its turning points apart.
#[derive(Debug, Clone)]
pub(in super::super) struct Grid {
    pub(super) fourier: FourierPlan,
    pub(super) pairs: Vec<(usize, Complex64)>,
    pub(super) value: Vec<f64>,
    pub(super) slope: Vec<f64>,
}

/// Points of the grid for every harmonic, at least: between two of them the motion is a cubic but for a thousandth of the highest harmonic.
const POINTS: usize = 8;

impl Grid {
    /// For harmonics up to `top`.
    pub fn new(top: usize) -> Self {
        let points = (POINTS * (top + 1)).next_power_of_two();
        Grid {
            fourier: FourierPlan::new(points),
            pairs: Vec::new(),
            value: vec![0.0; points],
            slope: vec![0.0; points],
        }
    }
}
