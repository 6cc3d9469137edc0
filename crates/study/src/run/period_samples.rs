//! Samples of an orbit over its period, for the columns that need them.

use std::cell::OnceCell;
use stickslip::orbit::{Orbit, Sample};

/// Instants per period at which ranges are evaluated, in addition to every switch. The range of
/// a sine has an error of 2e-6.
pub(super) const INSTANTS: usize = 1024;

/// Samples of an orbit at evenly spaced instants of the period, then at all switches. They are
/// computed by the first group of columns that uses them.
pub(super) struct PeriodSamples<'a> {
    orbit: &'a Orbit,
    samples: OnceCell<Vec<Sample>>,
}

impl<'a> PeriodSamples<'a> {
    pub(super) fn new(orbit: &'a Orbit) -> Self {
        PeriodSamples { orbit, samples: OnceCell::new() }
    }

    /// Returns all samples.
    pub(super) fn all(&self) -> &[Sample] {
        self.samples.get_or_init(|| {
            let period = self.orbit.period();
            let times = (0..INSTANTS).map(|i| period * i as f64 / INSTANTS as f64);
            times.chain(self.orbit.transition_times()).map(|time| self.orbit.sample(time)).collect()
        })
    }

    /// Returns the samples at evenly spaced instants.
    pub(super) fn even(&self) -> &[Sample] {
        &self.all()[..INSTANTS]
    }
}
