//! Branches of orbits by arc-length continuation, along the excitation frequency or any other
//! parameter.
//!
//! The continuation passes turning points; maxima of the branch are refined. A kink (the onset
//! of slip) is stepped over. The corrector converges on either side of it, with a step size that
//! is halved as necessary. If that fails, a separate search finds a point slightly further on.
//!
//! If several orbits exist at an end of the range, the curve leaves the range there and may
//! return on another orbit. The continuation therefore also follows it outside, up to half of
//! the range beyond either end. Points outside are not reported. If the curve does not reach the
//! other end, a second continuation begins there.

use crate::method::harmonic_balance::{BranchEquations, HarmonicBalance};
use crate::method::{MethodError, OrbitError};
use crate::model::System;
use crate::orbit::Orbit;
use std::convert::Infallible;
use stickslip_numerics::continuation::{self, ContinuationSettings};
use stickslip_numerics::golden_section::golden_section;

pub use stickslip_numerics::continuation::BranchEnd;

/// Specification of a branch.
#[derive(Clone, Copy)]
pub struct BranchContinuation<'a> {
    /// Returns system and excitation frequency (rad/s) at a value of the parameter.
    pub system_at: &'a dyn Fn(f64) -> (System, f64),
    /// Harmonic balance with a fixed number of harmonics (15 by default).
    pub method: HarmonicBalance,
    /// First and last value of the parameter; decreasing if the second is smaller.
    pub range: (f64, f64),
    /// Longest step in the parameter.
    pub step: f64,
    /// The quantity whose peaks are reported.
    pub quantity: &'a dyn Fn(&Orbit) -> f64,
}

/// A point of a branch.
#[derive(Debug, Clone)]
pub struct TracePoint {
    /// Value of the parameter.
    pub value: f64,
    /// Orbit at this value.
    pub orbit: Orbit,
}

/// A branch.
#[derive(Debug, Clone)]
pub struct Branch {
    /// Points in order of arc length. Two consecutive points at the same end of the range are
    /// connected outside of it, or belong to two curves.
    pub points: Vec<TracePoint>,
    /// Refined maxima of the quantity: (parameter, value).
    pub peaks: Vec<(f64, f64)>,
    /// Indices of the points at turning points of the parameter.
    pub turns: Vec<usize>,
    /// Why the branch ends.
    pub end: BranchEnd,
}

impl Branch {
    /// Tells whether the branch has a point at this value.
    pub fn reaches(&self, value: f64) -> bool {
        self.points.iter().any(|point| point.value == value)
    }

    fn append(&mut self, mut other: Branch) {
        self.turns.extend(other.turns.iter().map(|turn| turn + self.points.len()));
        self.points.append(&mut other.points);
        self.peaks.append(&mut other.peaks);
    }
}

/// Why no branch was computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TraceError {
    /// The method does not support the system.
    #[error(transparent)]
    Method(#[from] MethodError),
    /// No orbit was found at the start.
    #[error(transparent)]
    Start(#[from] OrbitError),
}

/// A point, with its unknowns and its parameter.
type PathPoint = (TracePoint, (Vec<f64>, f64));

/// The computed part of a curve, in order of arc length.
#[derive(Default)]
struct CurvePart {
    points: Vec<PathPoint>,
    /// True if there is one orbit at every value, so that the curve does not return.
    single: bool,
}

impl CurvePart {
    /// Follows the curve from a point, also outside of the range if it returns from there.
    fn follow(
        &mut self,
        equations: &mut BranchEquations<'_>,
        from: (Vec<f64>, f64),
        steps: ContinuationSettings,
    ) -> BranchEnd {
        let mut from = (from, steps);
        loop {
            let ((x, value), steps) = from;
            let left = ContinuationSettings { points: steps.points.saturating_sub(self.points.len()), ..steps };
            let end = continuation::trace(equations, &x, value, left, &mut |equations, x, value| {
                let Some(orbit) = equations.orbit(x, value) else { return false };
                self.points.push((TracePoint { value, orbit }, (x.to_vec(), value)));
                true
            });
            let leaves = end == BranchEnd::Border && !self.single;
            let Some((_, last)) = self.points.last().filter(|_| leaves) else { return end };
            match CurvePart::excursion(equations, last.clone(), steps) {
                Some(back) if !self.contains(&back.0) => from = back,
                _ => return end,
            }
        }
    }

    /// Leaves the range from a point at its border, and follows the curve if it returns.
    fn outside(&mut self, equations: &mut BranchEquations<'_>, from: (Vec<f64>, f64), steps: ContinuationSettings) {
        if let Some((back, steps)) = CurvePart::excursion(equations, from, steps) {
            self.follow(equations, back, steps);
        }
    }

    /// Follows the curve out of the range from a point at its border. Returns the point at which
    /// it comes back, and the steps from there.
    fn excursion(
        equations: &mut BranchEquations<'_>,
        (x, border): (Vec<f64>, f64),
        steps: ContinuationSettings,
    ) -> Option<((Vec<f64>, f64), ContinuationSettings)> {
        let (low, high) = steps.range;
        let reach = 0.5 * (high - low);
        let (range, direction) = if border == low { ((low - reach, low), -1.0) } else { ((high, high + reach), 1.0) };
        let mut last = None;
        let outside = ContinuationSettings { range, direction, ..steps };
        let end = continuation::trace(equations, &x, border, outside, &mut |_, x, value| {
            last = Some((x.to_vec(), value));
            true
        });
        let back = last.filter(|(_, value)| end == BranchEnd::Border && *value == border)?;
        Some((back, ContinuationSettings { direction: -direction, ..steps }))
    }

    /// Tells whether the curve contains a point at a border of the range.
    fn contains(&self, (x, value): &(Vec<f64>, f64)) -> bool {
        let distance = |other: &[f64]| x.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
        let size = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        // Two points at the same parameter are equal if their unknowns differ by less than this
        // fraction.
        self.points.iter().any(|(_, (other, at))| at == value && distance(other) <= 1e-6 * size)
    }
}

impl BranchContinuation<'_> {
    /// Follows the branch from the start of the range until it leaves the range and does not
    /// return.
    ///
    /// # Errors
    /// The method does not support the system, or no orbit is found at the start. A branch that
    /// fails later is returned up to this point.
    ///
    /// # Example
    /// ```
    /// use stickslip::curve::continuation::BranchContinuation;
    /// use stickslip::method::harmonic_balance::HarmonicBalance;
    /// let system = stickslip::model::example::blade_couple_massless().assemble().unwrap();
    /// let branch = BranchContinuation {
    ///     system_at: &|omega| (system.clone(), omega),
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
        let mut equations = BranchEquations::new(self.system_at, self.method, self.range)?;
        let start = equations.start(self.range.0)?;
        let steps = ContinuationSettings::between(self.range.0, self.range.1, self.step);
        let single = (self.system_at)(self.range.0).0.is_incrementally_stable();
        let mut part = CurvePart { single, ..CurvePart::default() };
        let end = part.follow(&mut equations, (start.clone(), self.range.0), steps);
        if !single && end == BranchEnd::Border {
            // In the opposite direction, the same curve may return into the range.
            let mut before = CurvePart::default();
            let out = ContinuationSettings { direction: -steps.direction, ..steps };
            before.outside(&mut equations, (start, self.range.0), out);
            before.points.reverse();
            part.points.splice(..0, before.points);
        }
        let mut branch = self.with_peaks_and_turns(&mut equations, part, end);
        if end == BranchEnd::Border && !branch.reaches(self.range.1) {
            let mut part = CurvePart { single, ..CurvePart::default() };
            if let Ok(start) = equations.start(self.range.1) {
                part.follow(
                    &mut equations,
                    (start, self.range.1),
                    ContinuationSettings { direction: -steps.direction, ..steps },
                );
            }
            part.points.reverse();
            branch.append(self.with_peaks_and_turns(&mut equations, part, end));
        }
        Ok(branch)
    }

    /// Computes peaks and turning points of the curve.
    fn with_peaks_and_turns(&self, equations: &mut BranchEquations<'_>, part: CurvePart, end: BranchEnd) -> Branch {
        let (points, arc): (Vec<TracePoint>, Vec<(Vec<f64>, f64)>) = part.points.into_iter().unzip();
        let heights: Vec<f64> = points.iter().map(|point| (self.quantity)(&point.orbit)).collect();
        // Maxima below this fraction of the largest one are rounding, in a motion that a joint
        // blocks.
        let rounding = 1e-9 * heights.iter().fold(0.0f64, |largest, height| largest.max(height.abs()));
        let mut peaks = Vec::new();
        let mut turns = Vec::new();
        for i in 1..points.len().saturating_sub(1) {
            let (a, b, c) = (points[i - 1].value, points[i].value, points[i + 1].value);
            if (b - a) * (c - b) < 0.0 {
                turns.push(i);
            }
            // at an end of the range the curve continues outside
            let inside = a != b && b != c;
            if inside && heights[i] > rounding && heights[i] >= heights[i - 1] && heights[i] > heights[i + 1] {
                peaks.push(self.refine(equations, &arc[i - 1..=i + 1], (b, heights[i])));
            }
        }
        Branch { points, peaks, turns, end }
    }

    /// Returns the highest point between three neighbours, if the parameter is monotonic there.
    fn refine(&self, equations: &mut BranchEquations<'_>, arc: &[(Vec<f64>, f64)], best: (f64, f64)) -> (f64, f64) {
        let (a, b) = (arc[0].1, arc[2].1);
        if (arc[1].1 - a) * (b - arc[1].1) <= 0.0 {
            return best;
        }
        let mut height = |value: f64| {
            let orbit = equations.orbit_near(&arc[1].0, value);
            orbit.map_or(f64::NEG_INFINITY, |orbit| (self.quantity)(&orbit))
        };
        // Relative width at which the search for a peak ends. The height of a smooth peak is
        // then accurate to rounding, that of a kink to about this fraction.
        let close = |a: f64, b: f64| (b - a).abs() <= 1e-9 * (a.abs() + b.abs());
        let Ok(found) = golden_section((a, b), close, |value| Ok::<_, Infallible>(height(value)));
        if found.1 > best.1 { found } else { best }
    }
}
