//! What the kinds share that look at whole orbits: all orbits of a study, their instants, their failures.

use crate::run::{Context, NOT_REACHED, Outcome, Prepared, place_of};
use crate::study::Case;
use rayon::prelude::*;
use stickslip::curve::sweep::sweep;
use stickslip::method::OrbitError;
use stickslip::orbit::{Accuracy, Orbit};

/// A frequency (rad/s) and what was found there; `None` if the run was stopped before.
pub(super) type Point = (f64, Option<Result<Orbit, OrbitError>>);

/// The orbits of every case at every frequency.
pub(super) fn all(cases: &[Prepared], context: &Context<'_>) -> Vec<Vec<Point>> {
    cases
        .par_iter()
        .map(|prepared| {
            let omegas: Vec<f64> = prepared.case.frequencies.iter().flat_map(|f| f.iter()).collect();
            let keep = |_: usize, outcome: Result<&Orbit, &OrbitError>| outcome.cloned().map_err(Clone::clone);
            let omega = |i: usize| omegas[i];
            // the method took this system when the case was prepared
            let points = sweep(&*prepared.method, &prepared.system, omegas.len(), &omega, context.watch(), &keep);
            omegas.iter().copied().zip(points.unwrap_or_default()).collect()
        })
        .collect()
}

/// Points whose series is too short, or was not compared with a longer one.
#[derive(Default)]
pub(super) struct Inaccurate {
    truncated: usize,
    largest: f64,
    unchecked: usize,
}

impl Inaccurate {
    pub fn add(&mut self, orbit: &Orbit) {
        self.count(orbit.evidence.accuracy.status(), orbit.evidence.truncation.unwrap_or(0.0));
    }

    /// A point with this status and estimated error.
    pub fn count(&mut self, status: &str, estimate: f64) {
        if status == Accuracy::Truncated.status() {
            self.truncated += 1;
            self.largest = self.largest.max(estimate);
        }
        self.unchecked += usize::from(status == Accuracy::Unchecked.status());
    }

    /// What the reader has to know about them.
    pub fn notes(&self) -> Vec<String> {
        let points = |count: usize| format!("{count} point{}", if count == 1 { "" } else { "s" });
        let truncated = (self.truncated > 0).then(|| {
            format!(
                "At {} the series is too short: its estimated error is beyond the `tolerance` of the method, and up to {:.1e}. \
                 Leave `harmonics` out or raise it, raise `tolerance` if that is good enough, or use `event-driven` where the laws \
                 are exact.",
                points(self.truncated),
                self.largest
            )
        });
        let unchecked = (self.unchecked > 0).then(|| {
            format!(
                "At {} nothing is known of the error of the series: the longer one that tells it has too many unknowns or was not found. \
                 Try fewer `harmonics`.",
                points(self.unchecked)
            )
        });
        truncated.into_iter().chain(unchecked).collect()
    }
}

/// Counts a point that has no orbit.
pub(super) fn count_missing(outcome: &mut Outcome, case: &Case, omega: f64, point: Option<&Result<Orbit, OrbitError>>) {
    match point {
        Some(Err(error)) => outcome.count(|| place_of(case, omega), error.status(), Some(error.to_string())),
        _ => outcome.count(|| place_of(case, omega), NOT_REACHED, None),
    }
}

/// `samples` equal steps over the period, both ends included, and every switch, rising, s.
pub(super) fn times(orbit: &Orbit, samples: usize) -> Vec<f64> {
    let period = orbit.period();
    let mut times: Vec<f64> = (0..=samples).map(|i| period * i as f64 / samples as f64).collect();
    times.extend(orbit.switch_times());
    times.sort_by(f64::total_cmp);
    // a switch on a grid point would stand twice
    times.dedup_by(|a, b| (*a - *b).abs() <= 1e-12 * period);
    times
}
