//! Points of a curve, and its peaks.

use crate::orbit::{Orbit, Seed};

/// A refined peak.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Frequency, rad/s.
    pub omega: f64,
    /// Value of the maximised quantity.
    pub value: f64,
    /// True if the largest value is at an end of the range; the actual peak may lie beyond.
    pub at_end: bool,
    /// Why the actual peak may be higher; `None` if the search found it.
    pub unresolved: Option<UnresolvedPeak>,
}

/// Why a search left the height of a peak undetermined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnresolvedPeak {
    /// Orbits next to the highest one were not found.
    MissingNeighbours,
    /// The curve still rises steeply from both sides at the end of the search.
    TooNarrow,
    /// The curve still rises steeply at a jump to another orbit.
    CutOff,
    /// The search reached its maximum number of orbits, and the neighbours predict a higher
    /// value.
    OrbitLimit,
}

impl std::fmt::Display for UnresolvedPeak {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            UnresolvedPeak::MissingNeighbours => {
                "orbits next to this peak were not found; the actual peak may be higher: much higher with little or \
                 no damping, or if friction cannot bound the motion; use a finer range or another method"
            }
            UnresolvedPeak::TooNarrow => {
                "this peak is narrower than the resolution of the search; the actual peak is higher or unbounded: \
                 without damping, friction bounds a resonance only up to a certain force; add the damping of the \
                 structure, or use a narrower range"
            }
            UnresolvedPeak::CutOff => {
                "the curve still rises steeply to this peak at a jump to another orbit, so the actual peak is higher \
                 or unbounded; follow the curve with kind `branch`, and if the model has no damping, add the damping \
                 of the structure"
            }
            UnresolvedPeak::OrbitLimit => {
                "the search for this peak reached its maximum number of orbits, and the actual peak is higher; use a \
                 finer range, or follow the curve with kind `branch`"
            }
        })
    }
}

/// A point of a curve for the peak search.
#[derive(Debug, Clone, PartialEq)]
pub struct CurvePoint {
    /// Frequency, rad/s.
    pub omega: f64,
    /// The quantities; empty if there is no orbit.
    pub values: Vec<f64>,
    /// The orbit, from which the search for its neighbours begins.
    pub seed: Option<Seed>,
    /// Estimated relative error of the quantities; zero for exact orbits.
    pub error: f64,
}

impl CurvePoint {
    /// Extracts the data of an orbit that a curve needs.
    pub fn new(orbit: &Orbit, quantities: &dyn Fn(&Orbit) -> Vec<f64>) -> Self {
        let error = orbit.evidence.error_estimate.unwrap_or(0.0);
        CurvePoint { omega: orbit.omega, values: quantities(orbit), seed: Some(orbit.seed()), error }
    }

    /// Creates a point without an orbit.
    pub fn failed(omega: f64) -> Self {
        CurvePoint { omega, values: Vec::new(), seed: None, error: 0.0 }
    }

    /// Returns a quantity; negative infinity if there is no orbit.
    pub(super) fn value(&self, quantity: usize) -> f64 {
        self.values.get(quantity).copied().filter(|value| value.is_finite()).unwrap_or(f64::NEG_INFINITY)
    }
}

/// A peak of one of several quantities.
#[derive(Debug, Clone, PartialEq)]
pub struct QuantityPeak {
    /// Index of the quantity.
    pub quantity: usize,
    /// The peak.
    pub peak: Peak,
    /// Values of all quantities at the peak.
    pub values: Vec<f64>,
}
