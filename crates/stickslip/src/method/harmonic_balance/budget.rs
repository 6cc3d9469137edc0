//! What searches may take: the work that ends a search, and that which ends a point.

/// What one search may take, and what all searches of a point may take, from the first to those of the estimate: Newton's method, interior points, and
/// proximal points with the limits that are lowered after them, eliminate as much as one each; laws with a memory are followed as far as for one search in
/// all. Measured: of 173 random points, with half of [`WORK`], those that were found took 1.01 of the three at most, all but one 0.4.
pub(super) const SEARCH: Work = Work { eliminated: 1.0, marched: 1.0 };
pub(super) const POINT: Work = Work { eliminated: 3.0, marched: 1.0 };

/// Points in a row that took more than this share of what a point may, and found nothing, after which the next ones of the same solver may take no more
/// than that: nearly all that are found take less, and a curve without orbits is to end. Whatever is found gives back all.
const IN_VAIN: usize = 2;
pub(super) const ENOUGH: f64 = 0.1;

/// Multiplications of one search, about four seconds of one core.
pub(super) const WORK: f64 = 2e10;
/// Eliminations of a search in any case, where nothing shorter was solved before or where laws are smooth: one that is to end takes a few of them.
pub(super) const FEWEST: f64 = 40.0;
/// Steps for which a point must have work left where a longer series is begun. From a shorter one it takes 6 to 25 in banded form, and by products, whose
/// steps are then short, as much as three counted ones: `coulomb-2d` at 4 contacts has its 1023 harmonics within 0.3 s.
const BEGUN: f64 = 3.0;

/// Whether a series whose steps take so many multiplications is begun by a point that has taken so much of what it may.
pub(super) fn is_affordable(step: f64, taken: Work, allowed: Work) -> bool {
    BEGUN * step <= WORK * (allowed.eliminated - taken.eliminated)
}

/// What a point may take after so many in a row that found nothing with more than [`ENOUGH`].
pub(super) fn allowed_after(in_vain: usize) -> Work {
    if in_vain < IN_VAIN { POINT } else { POINT.times(ENOUGH) }
}

/// Work, relative to that of one search: eliminations, and steps of laws with a memory.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Work {
    pub eliminated: f64,
    pub marched: f64,
}

impl Work {
    /// Both together.
    pub fn and(self, other: Work) -> Work {
        Work { eliminated: self.eliminated + other.eliminated, marched: self.marched + other.marched }
    }

    /// A share of both.
    pub fn times(self, share: f64) -> Work {
        Work { eliminated: share * self.eliminated, marched: share * self.marched }
    }

    /// Whether there is more of one or the other than so much.
    pub fn is_beyond(self, limit: Work) -> bool {
        self.eliminated > limit.eliminated || self.marched > limit.marched
    }
}
