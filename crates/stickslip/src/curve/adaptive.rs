//! A curve whose points lie where it bends: closer at peaks and at the borders of stick and slip, wider where a straight line does.
//!
//! Every interval is halved until the orbit in its middle lies where the straight line between its ends says it does. Intervals are
//! halved level by level, so that the points are the same on any number of threads.

use super::onward;
use super::peak::Point;
use crate::method::{Method, MethodError, OrbitError};
use crate::model::System;
use crate::orbit::Orbit;
use rayon::prelude::*;

/// What is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adaptive {
    /// First and last frequency, rad/s.
    pub range: (f64, f64),
    /// Distance of the curve from its polygon, as a share of the largest value of each quantity.
    pub tolerance: f64,
}

/// Intervals to begin with.
pub const FIRST: usize = 64;
/// Halvings of an interval: its parts are then a four-thousandth of it, below the width of any peak that two points of the first grid
/// could tell of.
const LEVELS: usize = 12;
/// Points beyond which no interval is halved any more.
pub const MOST: usize = 20_000;

/// A point of the curve with what is kept of it.
pub type Kept<R> = (Point, R);

impl Adaptive {
    /// The points, rising in frequency. `quantities` of an orbit are those whose polygon is judged; `keep` turns each outcome into what
    /// is kept. When `stop` says so, what is there is returned.
    ///
    /// # Errors
    /// The method cannot take the system.
    ///
    /// # Example
    /// ```
    /// use stickslip::curve::adaptive::Adaptive;
    /// use stickslip::method::event_driven::EventDriven;
    /// let system = stickslip::model::example::blade_couple().assemble().unwrap();
    /// let range = (std::f64::consts::TAU * 110.0, std::f64::consts::TAU * 130.0);
    /// let curve = Adaptive { range, tolerance: 0.01 }
    ///     .curve(&EventDriven, &system, &|orbit| vec![orbit.places[0].amplitude()], &|_| (), &|| false)
    ///     .unwrap();
    /// // the resonance at 121.25 Hz is 0.2 Hz wide: an even grid that shows it as well takes a thousand points
    /// assert!(curve.len() < 200);
    /// ```
    pub fn curve<R: Send>(
        &self,
        method: &dyn Method,
        system: &System,
        quantities: &(dyn Fn(&Orbit) -> Vec<f64> + Sync),
        keep: &(dyn Fn(Result<&Orbit, &OrbitError>) -> R + Sync),
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<Vec<Kept<R>>, MethodError> {
        // where laws allow several orbits at a frequency, what is found alone need not be what the points before lead to: one after the other then
        let chunk = if system.has_passive_joints() { CHUNK } else { MOST };
        let solve = |omegas: &[(f64, Option<&[f64]>)]| -> Result<Vec<Kept<R>>, MethodError> {
            // a solver for every few points: its memory pays, and the chunks are the same on any number of threads
            let chunks: Vec<Result<Vec<Kept<R>>, MethodError>> = omegas
                .par_chunks(chunk)
                .map(|chunk| {
                    let mut solver = onward::solver(method, system)?;
                    let mut kept = Vec::with_capacity(chunk.len());
                    let mut last: Option<Vec<f64>> = None;
                    for (omega, start) in chunk {
                        if stop() {
                            break;
                        }
                        let outcome = solver.orbit(*omega, start.or(last.as_deref()));
                        let row = keep(outcome.as_ref());
                        let point = match &outcome {
                            Ok(orbit) => Point::new(orbit, quantities),
                            Err(_) => Point::failed(*omega),
                        };
                        last = point.start.clone();
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
        let grid: Vec<(f64, Option<&[f64]>)> = (0..=FIRST)
            .map(|i| if i == FIRST { to } else { from + (to - from) * (i as f64 / FIRST as f64) })
            .map(|omega| (omega, None))
            .collect();
        let mut points = solve(&grid)?;
        let mut open: Vec<bool> = vec![true; points.len().saturating_sub(1)];
        for _ in 0..LEVELS {
            if stop() || points.len() + open.iter().filter(|open| **open).count() > MOST {
                break;
            }
            let middles: Vec<(f64, Option<&[f64]>)> = (0..open.len())
                .filter(|&i| open[i])
                .map(|i| (0.5 * (points[i].0.omega + points[i + 1].0.omega), points[i].0.start.as_deref()))
                .collect();
            if middles.is_empty() {
                break;
            }
            let found = solve(&middles)?;
            if found.len() < middles.len() {
                break;
            }
            (points, open) = self.joined(points, &open, found);
        }
        Ok(points)
    }

    /// The points with those in the middle of the open intervals, and which of the new intervals are still open.
    fn joined<R>(&self, points: Vec<Kept<R>>, open: &[bool], middles: Vec<Kept<R>>) -> (Vec<Kept<R>>, Vec<bool>) {
        let all = || points.iter().chain(&middles).map(|(point, _)| &point.values);
        let count = all().map(Vec::len).max().unwrap_or(0);
        let largest = |quantity: usize| {
            let values = all().filter_map(|values| values.get(quantity).copied());
            values.filter(|value| value.is_finite()).fold(0.0f64, |a, b| a.max(b.abs()))
        };
        let allowed: Vec<f64> = (0..count).map(|quantity| self.tolerance * largest(quantity)).collect();
        let bends = |a: &Point, middle: &Point, b: &Point| {
            let [a, middle, b] = [a, middle, b].map(|point| &point.values);
            // beside a failed point nothing is known; the failure is a point of the curve already
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

/// Points per solver.
const CHUNK: usize = 16;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::event_driven::EventDriven;
    use std::f64::consts::TAU;

    /// The polygon is as near to the curve as was asked, judged at frequencies that it has no points at.
    #[test]
    fn the_polygon_is_near_the_curve() {
        let mut couple = crate::model::example::blade_couple();
        couple.joints[0].law = std::sync::Arc::new(crate::law::Coulomb { limit: 4.0 });
        let system = couple.assemble().unwrap();
        let tolerance = 0.01;
        let amplitude = |orbit: &Orbit| vec![orbit.places[0].amplitude()];
        let curve = Adaptive { range: (TAU * 119.0, TAU * 123.0), tolerance }
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
                let orbit = solver.orbit(omega, pair[0].0.start.as_deref()).unwrap();
                worst = worst.max((orbit.places[0].amplitude() - line).abs());
            }
        }
        assert!(worst < tolerance * largest, "{worst} of {largest}, {} points", curve.len());
        assert!(curve.len() < 300, "{}", curve.len());
    }

    #[test]
    fn what_is_stopped_returns_what_is_there() {
        let system = crate::model::example::blade_couple().assemble().unwrap();
        let adaptive = Adaptive { range: (700.0, 800.0), tolerance: 0.01 };
        assert!(adaptive.curve(&EventDriven, &system, &|_| vec![0.0], &|_| (), &|| true).unwrap().is_empty());
    }
}
