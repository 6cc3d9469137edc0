//! Work limits: when a search ends, and when a point is given up.

/// Work limit of one search, relative to [`SEARCH_MULTIPLICATIONS`].
pub(super) const SEARCH_LIMIT: WorkShare = WorkShare { multiplications: 1.0, time_steps: 1.0 };
/// Work limit of all searches of a point, including those of the error estimate.
///
/// Newton's method, the interior point method, and the proximal point method with the
/// slip-limit homotopy after it may each use the eliminations of one search. All together may
/// use the time steps of one search. Measured on 173 random points with half of
/// [`SEARCH_MULTIPLICATIONS`]: converged points used at most 1.01 of the 3.0 eliminations, all
/// but one at most 0.4.
pub(super) const POINT_LIMIT: WorkShare = WorkShare { multiplications: 3.0, time_steps: 1.0 };

/// Multiplications of one search; about four seconds on one core.
pub(super) const SEARCH_MULTIPLICATIONS: f64 = 2e10;
/// Least number of eliminations in the work limit of a search. A converging search takes a few.
/// It does not apply to a series with force ports that refines a shorter one.
pub(super) const LEAST_ELIMINATIONS: f64 = 40.0;
/// Newton steps that the remaining budget of a point must cover before a longer series is
/// begun. Refining a shorter series takes 6 to 25 steps in banded form. With GMRES the steps
/// are then short, and the total is at most three counted steps: `coulomb-2d` with 4 contacts
/// reaches its 1023 harmonics within 0.3 s.
const RESERVED_STEPS: f64 = 3.0;

/// Returns true if the remaining budget of a point covers a longer series.
///
/// `step` is the number of multiplications of one of its Newton steps, `taken` the work used by
/// the point, and `allowed` its limit.
pub(super) fn is_affordable(step: f64, taken: WorkShare, allowed: WorkShare) -> bool {
    RESERVED_STEPS * step <= SEARCH_MULTIPLICATIONS * (allowed.multiplications - taken.multiplications)
}

/// Work of a point, relative to that of its first orbit, up to which longer series may reduce the
/// error of that orbit: a few doublings of the number of harmonics.
const IMPROVES: f64 = 8.0;

/// Returns the work limit of a point that found its first orbit with this work.
pub(super) fn to_improve(taken: WorkShare) -> WorkShare {
    taken.times(IMPROVES)
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
            limit: POINT_LIMIT,
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
