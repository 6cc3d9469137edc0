//! Branches of orbits by arc length: along the drive frequency, or along any parameter.
//!
//! A branch is followed around turning points; its maxima are refined. A kink (the onset of slip) is stepped over: the corrector
//! converges on either side of it, with steps that are halved until it does, or with a search of its own a little further on.

use crate::method::harmonic_balance::{BranchEquations, HarmonicBalance};
use crate::method::{MethodError, OrbitError};
use crate::model::System;
use crate::orbit::Orbit;
use std::convert::Infallible;
use stickslip_numerics::continuation::{self, Steps};
use stickslip_numerics::maximum::maximum;

pub use stickslip_numerics::continuation::End;

/// What is followed.
#[derive(Clone, Copy)]
pub struct Trace<'a> {
    /// System and drive frequency (rad/s) at a value of the parameter.
    pub at: &'a dyn Fn(f64) -> (System, f64),
    /// Harmonic balance with a fixed number of harmonics (15 if it names none).
    pub method: HarmonicBalance,
    /// From which value to which; falling if the second is less.
    pub range: (f64, f64),
    /// Longest step along the parameter.
    pub step: f64,
    /// What has peaks.
    pub quantity: &'a dyn Fn(&Orbit) -> f64,
}

/// A point of a branch.
#[derive(Debug, Clone)]
pub struct TracePoint {
    /// Value of the parameter.
    pub value: f64,
    /// The orbit there.
    pub orbit: Orbit,
}

/// A branch.
#[derive(Debug, Clone)]
pub struct Branch {
    /// Its points in the order of the arc.
    pub points: Vec<TracePoint>,
    /// Refined maxima of the quantity: (parameter, value).
    pub peaks: Vec<(f64, f64)>,
    /// Indices of the points next to turning points of the parameter.
    pub turns: Vec<usize>,
    /// Why it ends.
    pub end: End,
}

/// No branch at all.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TraceError {
    /// The method cannot take the system.
    #[error(transparent)]
    Method(#[from] MethodError),
    /// There is no orbit to start from.
    #[error(transparent)]
    Start(#[from] OrbitError),
}

/// Maxima below this share of the largest are those of rounding, where a joint holds all motion.
const ROUNDING: f64 = 1e-9;
/// Relative width at which the search for a peak ends: the height of a smooth one is then right to rounding, of a kink to about this share.
const LOCATED: f64 = 1e-9;

impl Trace<'_> {
    /// Follows the branch from the start of the range until it leaves it.
    ///
    /// # Errors
    /// The method cannot take the system, or there is no orbit at the start. A branch that is lost later is returned as far as it got.
    ///
    /// # Example
    /// ```
    /// use stickslip::curve::trace::Trace;
    /// use stickslip::method::harmonic_balance::HarmonicBalance;
    /// let system = stickslip::model::example::blade_couple_massless().assemble().unwrap();
    /// let branch = Trace {
    ///     at: &|omega| (system.clone(), omega),
    ///     method: HarmonicBalance { harmonics: Some(5), ..HarmonicBalance::default() },
    ///     range: (750.0, 775.0),
    ///     step: 1.0,
    ///     quantity: &|orbit| orbit.places[0].amplitude(),
    /// }
    /// .branch()
    /// .unwrap();
    /// assert_eq!(branch.peaks.len(), 1);
    /// ```
    pub fn branch(&self) -> Result<Branch, TraceError> {
        let mut equations = BranchEquations::new(self.at, self.method, self.range)?;
        let start = equations.start(self.range.0)?;
        let steps = Steps::between(self.range.0, self.range.1, self.step);
        let mut points: Vec<TracePoint> = Vec::new();
        let mut arc: Vec<(Vec<f64>, f64)> = Vec::new();
        let end = continuation::trace(&mut equations, &start, self.range.0, steps, &mut |equations, x, value| {
            let Some(orbit) = equations.orbit(x, value) else { return false };
            points.push(TracePoint { value, orbit });
            arc.push((x.to_vec(), value));
            true
        });
        let heights: Vec<f64> = points.iter().map(|point| (self.quantity)(&point.orbit)).collect();
        let rounding = ROUNDING * heights.iter().fold(0.0f64, |largest, height| largest.max(height.abs()));
        let mut peaks = Vec::new();
        let mut turns = Vec::new();
        for i in 1..points.len().saturating_sub(1) {
            let (a, b, c) = (points[i - 1].value, points[i].value, points[i + 1].value);
            if (b - a) * (c - b) < 0.0 {
                turns.push(i);
            }
            if heights[i] > rounding && heights[i] >= heights[i - 1] && heights[i] > heights[i + 1] {
                peaks.push(self.refine(&mut equations, &arc[i - 1..=i + 1], (b, heights[i])));
            }
        }
        Ok(Branch { points, peaks, turns, end })
    }

    /// The highest place between three neighbours where the parameter is monotonic.
    fn refine(&self, equations: &mut BranchEquations<'_>, arc: &[(Vec<f64>, f64)], best: (f64, f64)) -> (f64, f64) {
        let (a, b) = (arc[0].1, arc[2].1);
        if (arc[1].1 - a) * (b - arc[1].1) <= 0.0 {
            return best;
        }
        let mut height = |value: f64| {
            let orbit = equations.near(&arc[1].0, value);
            orbit.map_or(f64::NEG_INFINITY, |orbit| (self.quantity)(&orbit))
        };
        let close = |a: f64, b: f64| (b - a).abs() <= LOCATED * (a.abs() + b.abs());
        let Ok(found) = maximum((a, b), close, |value| Ok::<_, Infallible>(height(value)));
        if found.1 > best.1 { found } else { best }
    }
}
