//! Events of a motion: its turning points, and the intervals in which a
//! slider's force is linear in it.

use num_complex::Complex64;
use stickslip_numerics::fourier::FourierPlan;

/// A part of the period in which the force is `stiffness u + offset`.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Interval {
    /// Phase, rad; the end may exceed one period.
    pub(super) begin: f64,
    pub(super) end: f64,
    pub(super) stiffness: f64,
    pub(super) offset: f64,
    pub(super) anchor: OffsetSource,
    pub(super) slips: bool,
}

/// The quantity on which the offset depends.
#[derive(Debug, Clone, Copy)]
pub(in super::super) enum OffsetSource {
    /// None: the offset is constant, as for a slider that has not slipped since static
    /// equilibrium.
    Nothing,
    /// The motion at a phase, rad.
    At(f64),
}

/// A turning point of the motion: phase (rad) and displacement (m).
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct TurningPoint {
    pub(super) phase: f64,
    pub(super) value: f64,
}

/// Samples of a motion that separate its turning points.
#[derive(Debug, Clone)]
pub(in super::super) struct BracketingGrid {
    pub(super) fourier: FourierPlan,
    pub(super) pairs: Vec<(usize, Complex64)>,
    pub(super) value: Vec<f64>,
    pub(super) slope: Vec<f64>,
}

impl BracketingGrid {
    /// Creates a grid for harmonics up to `top`.
    pub fn new(top: usize) -> Self {
        // Least number of grid points per harmonic. Between two of them the motion is a cubic up
        // to a thousandth of the highest harmonic.
        let points = (8 * (top + 1)).next_power_of_two();
        BracketingGrid {
            fourier: FourierPlan::new(points),
            pairs: Vec::new(),
            value: vec![0.0; points],
            slope: vec![0.0; points],
        }
    }
}
