//! Work limits: when a search ends, and when a point is given up.

use super::settings::WorkSettings;

/// Returns true if the remaining budget of a point covers a longer series.
///
/// `step` is the number of multiplications of one of its Newton steps, `taken` the work used by
/// the point, and `allowed` its limit.
pub(super) fn is_affordable(step: f64, taken: WorkShare, allowed: WorkShare) -> bool {
    let settings = WorkSettings::default();
    let left = allowed.multiplications - taken.multiplications;
    settings.reserved_steps * step <= settings.multiplications * left
}

/// Work relative to the limit of one search.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct WorkShare {
    /// Multiplications of Newton steps and evaluations.
    pub multiplications: f64,
    /// Time steps of laws with memory.
    pub time_steps: f64,
}

impl WorkShare {
    /// Returns the sum.
    pub fn and(self, other: WorkShare) -> WorkShare {
        WorkShare {
            multiplications: self.multiplications + other.multiplications,
            time_steps: self.time_steps + other.time_steps,
        }
    }

    /// Returns both parts multiplied by `share`.
    pub fn times(self, share: f64) -> WorkShare {
        WorkShare { multiplications: share * self.multiplications, time_steps: share * self.time_steps }
    }

    /// Returns the smaller of each part.
    pub fn and_at_most(self, other: WorkShare) -> WorkShare {
        WorkShare {
            multiplications: self.multiplications.min(other.multiplications),
            time_steps: self.time_steps.min(other.time_steps),
        }
    }

    /// Returns true if either part exceeds that of `limit`.
    pub fn exceeds(self, limit: WorkShare) -> bool {
        self.multiplications > limit.multiplications || self.time_steps > limit.time_steps
    }
}

/// Work of the searches on one discretization.
#[derive(Debug, Clone)]
pub(super) struct WorkCounter {
    /// Number of evaluations of laws with derivatives in the present search.
    pub evaluations: usize,
    /// Number of eliminations of the Jacobian in the present search.
    pub eliminations: usize,
    /// Number of products with the Jacobian in the present search.
    pub products: usize,
    /// True if the search begins with the solution of a shorter series, which remains valid if the
    /// search fails. With unknown forces, the work limit then holds without a guaranteed number of
    /// steps.
    pub extends_shorter: bool,
    /// Work of earlier searches of the point on this discretization.
    pub before: WorkShare,
    /// Work of the point on other discretizations.
    pub elsewhere: WorkShare,
    /// Work limit of the point.
    pub limit: WorkShare,
}

impl Default for WorkCounter {
    fn default() -> Self {
        WorkCounter {
            evaluations: 0,
            eliminations: 0,
            products: 0,
            extends_shorter: false,
            before: WorkShare::default(),
            elsewhere: WorkShare::default(),
            limit: WorkSettings::default().point,
        }
    }
}

impl WorkCounter {
    /// Begins a point: no work is used, and the limit stays.
    pub fn begin_point(&mut self) {
        *self = WorkCounter { limit: self.limit, ..WorkCounter::default() };
    }

    /// Begins a search after searches of the same point that used `before`.
    pub fn begin_search(&mut self, before: WorkShare) {
        *self = WorkCounter { before, evaluations: 0, eliminations: 0, products: 0, ..self.clone() };
    }
}
