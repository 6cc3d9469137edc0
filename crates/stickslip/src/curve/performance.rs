//! Performance curves: the resonance peak as a function of a design parameter, and the optimal
//! value of the parameter.
//!
//! For every value, the peak is maximised over frequency; the optimum over the values is then
//! refined. With a slip limit as the parameter, this is the classical curve of a friction
//! damper: free at the left, stuck at the right, with a minimum between.
//! Source: Griffin (1980), Fig. 4.

use super::bidirectional_sweep::{BidirectionalSweep, other_intervals};
use super::branch_following;
use super::peak::{CurvePoint, Peak, drop_unused_series, highest_peak};
use super::sweep::{Watch, solve_sequence};
use crate::method::{Method, MethodError};
use crate::model::System;
use crate::orbit::{Accuracy, Orbit};
use rayon::prelude::*;
use std::sync::atomic::Ordering;
use stickslip_numerics::golden_section::golden_section;

/// Specification of a performance curve.
#[derive(Clone, Copy)]
pub struct Performance<'a, E> {
    /// Returns the system at a value of the parameter.
    pub system: &'a (dyn Fn(f64) -> Result<System, E> + Sync),
    /// The method that finds the orbits.
    pub method: &'a dyn Method,
    /// Frequency range of the peak search, rad/s.
    pub range: (f64, f64),
    /// Number of grid points over the range, from which the peak is refined. Their spacing must
    /// not exceed the width of the peak.
    pub points: usize,
    /// The quantities to maximise over frequency, for example amplitudes, m. Their number must
    /// be constant. The one with the highest peak counts.
    pub quantities: &'a (dyn Fn(&Orbit) -> Vec<f64> + Sync),
    /// Progress over the grid points of the values, and cancellation. After a stop the rows have
    /// no peaks and the curve has no optimum.
    pub watch: Watch<'a>,
}

/// The peak at one value of the parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PerformanceRow {
    /// Value of the parameter.
    pub value: f64,
    /// The highest peak; `None` if no orbit converged.
    pub peak: Option<Peak>,
    /// True if only the reverse sweep has this peak, in a system that allows several orbits at a
    /// frequency ([`super::bidirectional_sweep`]).
    pub reverse_sweep_only: bool,
    /// Number of grid orbits that were not found, plus one if the peak is unresolved.
    pub failed: usize,
    /// Number of grid orbits whose series is too short for the tolerance, or whose error was not
    /// estimated.
    pub inaccurate: usize,
    /// Number of grid orbits that are known to be unstable.
    pub unstable: usize,
}

/// A performance curve.
#[derive(Debug, Clone, PartialEq)]
pub struct PerformanceCurve {
    /// One row per value, in the given order.
    pub rows: Vec<PerformanceRow>,
    /// The value with the lowest peak, refined between its neighbours. `None` if the lowest row
    /// is the first or the last one, or if several rows are equally low.
    pub optimum: Option<PerformanceRow>,
}

/// Returns the height of a row; infinity without a peak.
fn height(row: &PerformanceRow) -> f64 {
    row.peak.map_or(f64::INFINITY, |peak| peak.value)
}

/// Returns the rows with the lowest peak.
fn lowest(rows: &[PerformanceRow]) -> Vec<usize> {
    let heights = || rows.iter().map(height).filter(|height| height.is_finite());
    let (least, most) = (heights().fold(f64::INFINITY, f64::min), heights().fold(0.0, f64::max));
    // Peaks that differ by less than this fraction of the highest are equal. Orbits are accurate
    // to about 1e-10, and smaller differences do not matter to a design.
    (0..rows.len()).filter(|row| height(&rows[*row]) <= least + 1e-9 * most).filter(|_| least.is_finite()).collect()
}

impl PerformanceCurve {
    /// Returns the rows with the lowest peak. There are several if the parameter has no
    /// influence, or if nothing moves.
    pub fn lowest(&self) -> Vec<usize> {
        lowest(&self.rows)
    }
}

/// Why no curve was computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PerformanceError<E> {
    /// The system could not be built.
    #[error("the system could not be built at the parameter value {value}: {cause}")]
    System {
        /// Value of the parameter.
        value: f64,
        /// Cause of the failure.
        cause: E,
    },
    /// The method does not support the system.
    #[error(transparent)]
    Method(MethodError),
}

impl<E: Send> Performance<'_, E> {
    /// Computes the peak at one value of the parameter.
    ///
    /// # Errors
    /// The system cannot be built, or the method does not support it.
    pub fn peak(&self, value: f64) -> Result<PerformanceRow, PerformanceError<E>> {
        self.watched_peak(value, self.watch)
    }

    fn watched_peak(&self, value: f64, watch: Watch<'_>) -> Result<PerformanceRow, PerformanceError<E>> {
        let system = (self.system)(value).map_err(|cause| PerformanceError::System { value, cause })?;
        let mut solver = branch_following::solver(self.method, &system).map_err(PerformanceError::Method)?;
        let last = self.points.max(3) - 1;
        let omegas: Vec<f64> =
            (0..=last).map(|i| self.range.0 + (self.range.1 - self.range.0) * i as f64 / last as f64).collect();
        let (mut failed, mut inaccurate, mut unstable) = (0, 0, 0);
        let mut points: Vec<CurvePoint> = Vec::with_capacity(omegas.len());
        let mut bidirectional = BidirectionalSweep::for_system(&system);
        solve_sequence(&mut *solver, &mut omegas.into_iter(), watch, &mut |omega, outcome| {
            let Some(outcome) = outcome else { return };
            bidirectional.iter_mut().for_each(|sweep| sweep.add(omega, outcome));
            points.push(match outcome {
                Ok(orbit) => {
                    inaccurate += usize::from(orbit.evidence.accuracy != Accuracy::Converged);
                    unstable += usize::from(orbit.is_stable() == Some(false));
                    CurvePoint::new(orbit, self.quantities)
                }
                Err(_) => {
                    failed += 1;
                    CurvePoint::failed(omega)
                }
            });
            drop_unused_series(&mut points);
        });
        if watch.stop.load(Ordering::Relaxed) {
            return Ok(PerformanceRow { value, peak: None, reverse_sweep_only: false, failed, inaccurate, unstable });
        }
        let wanted = points.iter().map(|point| point.values.len()).max().unwrap_or(0);
        let mut peak = highest_peak(&mut *solver, &points, wanted, self.quantities);
        let mut reverse_sweep_only = false;
        if let Some(bidirectional) = bidirectional {
            let others =
                bidirectional.reverse_sweep(self.method, &system, watch.stop).map_err(PerformanceError::Method)?;
            let others: Vec<CurvePoint> =
                others.iter().map(|other| CurvePoint::new(&other.orbit, self.quantities)).collect();
            for points in other_intervals(&points, &others) {
                let other = highest_peak(&mut *solver, &points, wanted, self.quantities);
                if other.is_some_and(|other| peak.is_none_or(|peak| other.value > peak.value)) {
                    (peak, reverse_sweep_only) = (other, true);
                }
            }
        }
        // an unresolved peak counts as not found
        failed += usize::from(peak.is_some_and(|peak| peak.unresolved.is_some()));
        Ok(PerformanceRow { value, peak, reverse_sweep_only, failed, inaccurate, unstable })
    }

    /// Computes the curve over `values` (in increasing order) and its optimum.
    ///
    /// # Errors
    /// The system cannot be built at some value, or the method does not support it.
    ///
    /// # Example
    /// ```
    /// use stickslip::curve::performance::Performance;
    /// use stickslip::curve::sweep::Watch;
    /// use stickslip::method::event_driven::EventDriven;
    /// use stickslip::law::Coulomb;
    /// use stickslip::model::example;
    /// let curve = Performance {
    ///     system: &|limit| {
    ///         let mut couple = example::blade_couple();
    ///         couple.joints[0].law = std::sync::Arc::new(Coulomb { limit });
    ///         couple.assemble()
    ///     },
    ///     method: &EventDriven,
    ///     range: (119.5 * std::f64::consts::TAU, 122.5 * std::f64::consts::TAU),
    ///     points: 31,
    ///     quantities: &|orbit| vec![orbit.places[0].amplitude()],
    ///     watch: Watch::none(),
    /// }
    /// .curve(&[5.5, 6.5, 7.5])
    /// .unwrap();
    /// let best = curve.optimum.unwrap();
    /// assert!((best.value - 6.684).abs() < 0.01);
    /// ```
    pub fn curve(&self, values: &[f64]) -> Result<PerformanceCurve, PerformanceError<E>> {
        let rows: Vec<PerformanceRow> = values.par_iter().map(|value| self.peak(*value)).collect::<Result<_, _>>()?;
        let optimum = match lowest(&rows)[..] {
            [i] if i > 0 && i + 1 < rows.len() => Some(self.refine(rows[i - 1].value, rows[i], rows[i + 1].value)?),
            _ => None,
        };
        Ok(PerformanceCurve { rows, optimum })
    }

    /// Refines the optimum by golden-section search, because the minimum can be smooth or a kink
    /// between two branches.
    fn refine(&self, low: f64, middle: PerformanceRow, high: f64) -> Result<PerformanceRow, PerformanceError<E>> {
        let mut best = middle;
        // Relative width at which the search for the optimum ends. Peaks are accurate to 1e-10, so
        // a smooth minimum is determined to the square root of that.
        let close = |a: f64, b: f64| b - a <= 1e-5 * (a.abs() + b.abs());
        // the steps are not points of the curve; after a stop they end at once
        let watch = Watch { finished: &|| (), stop: self.watch.stop };
        golden_section((low, high), close, |value| {
            let row = self.watched_peak(value, watch)?;
            if height(&row) < height(&best) {
                best = row;
            }
            Ok(-height(&row))
        })?;
        Ok(best)
    }
}
