//! A curve with adaptive points: dense at peaks and at transitions between stick and slip,
//! sparse elsewhere.
//!
//! Each interval is bisected until the orbit in its middle agrees with the straight line between
//! its ends. Bisection proceeds level by level, so the points are identical for any number of
//! threads.

use super::PointBudget;
use super::branch_following;
use super::peak::CurvePoint;
use crate::method::{Method, MethodError, OrbitError, Request};
use crate::model::System;
use crate::orbit::{Orbit, Seed};
use rayon::prelude::*;

/// Specification of an adaptive curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdaptiveCurve {
    /// First and last frequency, rad/s.
    pub range: (f64, f64),
    /// Permitted distance between the curve and its polygon, relative to the largest value of
    /// each quantity.
    pub tolerance: f64,
}

/// Number of initial intervals.
pub const INITIAL_INTERVALS: usize = 64;
/// No interval is bisected beyond this number of points.
pub const MAX_POINTS: usize = 20_000;

/// A point of the curve, with the result of `keep`.
pub type KeptPoint<R> = (CurvePoint, R);

impl AdaptiveCurve {
    /// Computes the points in order of frequency. The polygon must be accurate for all
    /// `quantities` of an orbit. `keep` converts each outcome into the stored result. If `stop`
    /// returns true, the points so far are returned.
    ///
    /// # Errors
    /// The method does not support the system.
    ///
    /// # Example
    /// ```
    /// use stickslip::curve::adaptive::AdaptiveCurve;
    /// use stickslip::method::event_driven::EventDriven;
    /// let system = stickslip::model::example::blade_couple().assemble().unwrap();
    /// let range = (std::f64::consts::TAU * 110.0, std::f64::consts::TAU * 130.0);
    /// let curve = AdaptiveCurve { range, tolerance: 0.01 }
    ///     .curve(
    ///         &EventDriven,
    ///         &system,
    ///         &|orbit| vec![orbit.places[0].amplitude()],
    ///         &|_| (),
    ///         &|| false,
    ///     )
    ///     .unwrap();
    /// // the resonance at 121.25 Hz is 0.2 Hz wide; a uniform grid takes 1000 points
    /// assert!(curve.len() < 200);
    /// ```
    pub fn curve<R: Send>(
        &self,
        method: &dyn Method,
        system: &System,
        quantities: &(dyn Fn(&Orbit) -> Vec<f64> + Sync),
        keep: &(dyn Fn(Result<&Orbit, &OrbitError>) -> R + Sync),
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<KeptPoint<R>>, MethodError> {
        // If the laws allow several orbits at a frequency, a search without initial guess can
        // find another orbit than the branch of the previous points. All points are then solved
        // in sequence.
        // Points per solver.
        let chunk = if system.has_passive_joints() { 16 } else { MAX_POINTS };
        let solve = |omegas: &[(f64, Option<&Seed>)]| -> Result<Vec<KeptPoint<R>>, MethodError> {
            // One solver per chunk, because its stored data save work. The chunks are identical
            // for any number of threads.
            let chunks: Vec<Result<Vec<KeptPoint<R>>, MethodError>> = omegas
                .par_chunks(chunk)
                .map(|chunk| {
                    let mut solver = branch_following::solver(method, system)?;
                    let mut kept = Vec::with_capacity(chunk.len());
                    let mut last: Option<Seed> = None;
                    let mut budget = PointBudget::default();
                    for (omega, seed) in chunk {
                        if stop() {
                            break;
                        }
                        let request = Request::at(*omega).near(seed.or(last.as_ref()));
                        let outcome = budget.solve(&mut *solver, &request);
                        let row = keep(outcome.as_ref());
                        let point = match &outcome {
                            Ok(orbit) => CurvePoint::new(orbit, quantities),
                            Err(_) => CurvePoint::failed(*omega),
                        };
                        last = point.seed.clone();
                        kept.push((point, row));
                    }
                    Ok(kept)
                })
                .collect();
            let mut all = Vec::with_capacity(omegas.len());
            for chunk in chunks {
                all.extend(chunk?);
            }
            Ok(all)
        };
        let (from, to) = self.range;
        let grid: Vec<(f64, Option<&Seed>)> =
            (0..=INITIAL_INTERVALS)
                .map(|i| {
                    if i == INITIAL_INTERVALS { to } else { from + (to - from) * (i as f64 / INITIAL_INTERVALS as f64) }
                })
                .map(|omega| (omega, None))
                .collect();
        let mut points = solve(&grid)?;
        let mut open: Vec<bool> = vec![true; points.len().saturating_sub(1)];
        // Number of bisections of an initial interval. The resulting width, 1/4096 of it, is
        // below the width of any peak that the initial grid can indicate.
        for _ in 0..12 {
            if stop() || points.len() + open.iter().filter(|open| **open).count() > MAX_POINTS {
                break;
            }
            let middles: Vec<(f64, Option<&Seed>)> = (0..open.len())
                .filter(|&i| open[i])
                .map(|i| (0.5 * (points[i].0.omega + points[i + 1].0.omega), points[i].0.seed.as_ref()))
                .collect();
            if middles.is_empty() {
                break;
            }
            let found = solve(&middles)?;
            if found.len() < middles.len() {
                break;
            }
            (points, open) = self.insert_middles(points, &open, found);
        }
        Ok(points)
    }

    /// Inserts the middle points of the open intervals. Returns all points, and which of the new
    /// intervals are open.
    fn insert_middles<R>(
        &self,
        points: Vec<KeptPoint<R>>,
        open: &[bool],
        middles: Vec<KeptPoint<R>>,
    ) -> (Vec<KeptPoint<R>>, Vec<bool>) {
        let all = || points.iter().chain(&middles).map(|(point, _)| &point.values);
        let count = all().map(Vec::len).max().unwrap_or(0);
        let largest = |quantity: usize| {
            let values = all().filter_map(|values| values.get(quantity).copied());
            values.filter(|value| value.is_finite()).fold(0.0f64, |a, b| a.max(b.abs()))
        };
        let allowed: Vec<f64> = (0..count).map(|quantity| self.tolerance * largest(quantity)).collect();
        let bends = |a: &CurvePoint, middle: &CurvePoint, b: &CurvePoint| {
            let [a, middle, b] = [a, middle, b].map(|point| &point.values);
            // Next to a failed point the shape of the curve is unknown. The failure is already a
            // point of the curve.
            !a.is_empty()
                && !middle.is_empty()
                && !b.is_empty()
                && (0..count).any(|q| (middle[q] - 0.5 * (a[q] + b[q])).abs() > allowed[q])
        };
        let bent: Vec<bool> = (0..open.len())
            .filter(|&i| open[i])
            .zip(&middles)
            .map(|(i, (middle, _))| bends(&points[i].0, middle, &points[i + 1].0))
            .collect();
        let (mut joined, mut still) = (Vec::with_capacity(points.len() + middles.len()), Vec::new());
        let mut middles = middles.into_iter().zip(bent);
        for (i, point) in points.into_iter().enumerate() {
            joined.push(point);
            match open.get(i) {
                Some(true) => {
                    if let Some((middle, bent)) = middles.next() {
                        joined.push(middle);
                        still.extend([bent, bent]);
                    }
                }
                Some(false) => still.push(false),
                None => {}
            }
        }
        (joined, still)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::event_driven::EventDriven;
    use std::f64::consts::TAU;

    /// The polygon has the requested accuracy at frequencies between its points.
    #[test]
    fn the_polygon_is_near_the_curve() {
        let mut couple = crate::model::example::blade_couple();
        couple.joints[0].law = std::sync::Arc::new(crate::law::Coulomb { limit: 4.0 });
        let system = couple.assemble().unwrap();
        let tolerance = 0.01;
        let amplitude = |orbit: &Orbit| vec![orbit.places[0].amplitude()];
        let curve = AdaptiveCurve { range: (TAU * 119.0, TAU * 123.0), tolerance }
            .curve(&EventDriven, &system, &amplitude, &|outcome| outcome.is_ok(), &|| false)
            .unwrap();
        assert!(curve.iter().all(|(_, converged)| *converged));
        let largest = curve.iter().map(|(point, _)| point.values[0]).fold(0.0, f64::max);
        let mut solver = EventDriven.solver(&system).unwrap();
        let mut worst = 0.0f64;
        for pair in curve.windows(2) {
            for share in [0.25, 0.6] {
                let omega = pair[0].0.omega + share * (pair[1].0.omega - pair[0].0.omega);
                let line = pair[0].0.values[0] + share * (pair[1].0.values[0] - pair[0].0.values[0]);
                let orbit = solver.orbit_near(omega, pair[0].0.seed.as_ref()).unwrap();
                worst = worst.max((orbit.places[0].amplitude() - line).abs());
            }
        }
        assert!(worst < tolerance * largest, "{worst} of {largest}, {} points", curve.len());
        assert!(curve.len() < 300, "{}", curve.len());
    }

    #[test]
    fn stopping_returns_the_points_so_far() {
        let system = crate::model::example::blade_couple().assemble().unwrap();
        let adaptive = AdaptiveCurve { range: (700.0, 800.0), tolerance: 0.01 };
        assert!(adaptive.curve(&EventDriven, &system, &|_| vec![0.0], &|_| (), &|| true).unwrap().is_empty());
    }
}
