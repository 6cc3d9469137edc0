//! Lowest natural modes of `K φ = λ M φ`, λ = ω², with a proof that none is missing.
//!
//! The method is a block Lanczos process with the operator `(K - σM)⁻¹ M` in the inner product
//! of M, with full reorthogonalization. Near the shift σ the eigenvalues `θ = 1 / (λ - σ)` of
//! the operator are large and well separated, and converge first. A block finds eigenvalues of
//! its own multiplicity at once. Modes that are already found are projected out, so that the
//! next run finds the other modes of a larger cluster.
//!
//! The number of eigenvalues below μ is known without computing them: it is the number of
//! negative pivots of the factor of `K - μM`. The search ends when this number agrees with the
//! number of modes found below μ. Otherwise the factor becomes that of the next shift, and the
//! search continues there. A run without any converged mode, because all eigenvalues are about
//! equally far from the shift, estimates their place, and the next run begins there.
//!
//! M may be singular. Results of the operator have no massless component, except rounding that
//! another multiplication removes. K may be singular too, because the first shift is negative.
//!
//! Sources: Ericsson and Ruhe (1980), "The spectral transformation Lanczos method for the
//! numerical solution of large sparse generalized symmetric eigenvalue problems"; Nour-Omid,
//! Parlett, Ericsson and Jensen (1987), "How to implement the spectral transformation", for
//! singular M; Grimes, Lewis and Simon (1994), "A shifted block Lanczos algorithm for solving
//! sparse symmetric generalized eigenproblems", for blocks, shifts and counts.

mod lanczos;
mod natural_modes;

use super::{LdlFactor, Singular, SparseMatrix, SymbolicAnalysis};
use lanczos::{Lanczos, RitzPair};
use natural_modes::BLOCK;
pub use natural_modes::{ModesCost, ModesError, NaturalModes};

/// Settings of the search for modes.
#[derive(Debug, Clone)]
struct ModesSettings {
    /// Residual in the Lanczos process, relative to θ, at which a mode has
    /// converged. The error of the eigenvalue is about its square.
    tolerance: f64,
    /// An eigenvalue above a bound by less than this relative difference counts as below it.
    rounding: f64,
    /// Maximum number of vectors of a run. Each takes memory of n numbers.
    max_vectors: usize,
    /// Maximum number of runs. Each run except the first starts where eigenvalues are known to be
    /// missing, and finds about `max_vectors` / 3 modes.
    max_runs: usize,
    /// The first shift without other knowledge, relative to a typical `k_ii / m_ii`.
    ///
    /// It is below the first mode of a compact body and far above the rounding of a rigid-body
    /// mode. An eigenvalue as far below zero is not rounding.
    shift: f64,
    /// Smallest shift relative to a typical `k_ii / m_ii`: the rounding of K.
    least_shift: f64,
    /// The first shift relative to the upper bound of the wanted modes.
    shift_of_bound: f64,
    /// Number of blocks after which an unfinished search tests if its first shift was too large.
    /// These blocks cost about as much as another factor.
    slender_check_blocks: usize,
    /// Number of blocks between two convergence checks.
    check_interval: usize,
    /// Divisor of the number of blocks so far that gives a longer interval between checks. The
    /// cost of the projected problem grows with the cube of the blocks.
    check_divisor: usize,
    /// Smallest gap between two eigenvalues, relative to their distance from the
    /// first shift, in which eigenvalues can be counted.
    gap: f64,
    /// Distance beyond the last mode found at which eigenvalues are counted and the next run
    /// starts. It is relative to the distance of that mode from the first shift.
    ///
    /// It is at least the magnitude of that shift, for structures with many rigid-body modes.
    next_shift_distance: f64,
    /// Number of attempts to factor near an eigenvalue, each further away by `gap`.
    attempts: usize,
}

impl Default for ModesSettings {
    fn default() -> Self {
        ModesSettings {
            tolerance: 1e-10,
            rounding: 1e-9,
            max_vectors: 320,
            max_runs: 100,
            shift: 1e-6,
            least_shift: 1e-12,
            shift_of_bound: 0.01,
            slender_check_blocks: 12,
            check_interval: 4,
            check_divisor: 8,
            gap: 1e-5,
            next_shift_distance: 0.1,
            attempts: 8,
        }
    }
}

/// Range of the first eigenvalue, relative to the first shift, in which the shift is far too
/// large for a slender structure. Below the range the mode is a rigid-body mode.
const SLENDER: (f64, f64) = (1e-6, 0.1);

/// The modes to be found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ModeSelection {
    /// The given number of lowest modes, or all if there are fewer.
    Lowest(usize),
    /// All modes with an eigenvalue λ = ω² up to a bound.
    UpTo {
        /// The bound, rad²/s².
        value: f64,
        /// Largest number of modes allowed: each takes memory of n numbers.
        most: usize,
    },
}

impl NaturalModes {
    /// Finds the lowest modes of symmetric, positive semidefinite `stiffness` K and `mass` M.
    ///
    /// Both are among the matrices of `analysis`.
    ///
    /// # Errors
    /// [`ModesError`]: a motion without mass and stiffness, a negative
    /// eigenvalue, more modes than allowed, no convergence.
    ///
    /// # Panics
    /// If the matrices do not have the size of the analysis.
    ///
    /// # Example
    /// ```
    /// use stickslip_numerics::sparse::{
    ///     ModeSelection, NaturalModes, SparseMatrix, SymbolicAnalysis,
    /// };
    /// // two equal masses connected by two parallel springs, without support: 0 and 4
    /// let k =
    ///     SparseMatrix::from_triplets(2, [(0, 0, 2.0), (1, 1, 2.0), (0, 1, -2.0), (1, 0, -2.0)])
    ///         .unwrap();
    /// let m = SparseMatrix::from_triplets(2, [(0, 0, 1.0), (1, 1, 1.0)]).unwrap();
    /// let modes =
    ///     NaturalModes::new(&SymbolicAnalysis::new(&[&k, &m]), &k, &m, ModeSelection::Lowest(2))
    ///         .unwrap();
    /// assert!(modes.values[0].abs() < 1e-12 && (modes.values[1] - 4.0).abs() < 1e-12);
    /// ```
    pub fn new(
        analysis: &SymbolicAnalysis,
        stiffness: &SparseMatrix,
        mass: &SparseMatrix,
        wanted: ModeSelection,
    ) -> Result<Self, ModesError> {
        if mass.n() == 0 {
            return Ok(NaturalModes::empty());
        }
        let scale = typical_eigenvalue(stiffness, mass);
        let found = NaturalModes { scale, ..NaturalModes::empty() };
        Search { analysis, stiffness, mass, wanted, scale, found, settings: ModesSettings::default() }.run()
    }
}

/// Returns the median of `k_ii / m_ii`, rad²/s², or one if no ratio is positive and finite.
fn typical_eigenvalue(stiffness: &SparseMatrix, mass: &SparseMatrix) -> f64 {
    let mut ratios: Vec<f64> = (0..mass.n())
        .map(|i| stiffness.get(i, i) / mass.get(i, i))
        .filter(|ratio| ratio.is_finite() && *ratio > 0.0)
        .collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied().unwrap_or(1.0)
}

/// A search in progress.
struct Search<'a> {
    analysis: &'a SymbolicAnalysis,
    stiffness: &'a SparseMatrix,
    mass: &'a SparseMatrix,
    wanted: ModeSelection,
    /// A typical `k_ii / m_ii`, rad²/s².
    scale: f64,
    found: NaturalModes,
    settings: ModesSettings,
}

/// The result of a run of the Lanczos process.
struct LanczosRun {
    modes: NaturalModes,
    vectors: usize,
    end: RunEnd,
}

/// The reason why a run ended.
enum RunEnd {
    /// Enough modes, or the maximum number of vectors.
    Full,
    /// The maximum number of vectors without a converged mode: the eigenvalues are closer to
    /// each other than to the shift. The value estimates their place.
    Clustered(f64),
    /// The Krylov space is exhausted: all modes are known.
    Exhausted,
    /// The first shift is much larger than this eigenvalue.
    Slender(f64),
}

impl Search<'_> {
    fn run(mut self) -> Result<NaturalModes, ModesError> {
        let least = self.settings.least_shift * self.scale;
        // The magnitude of the first, negative shift.
        let mut first_shift = match self.wanted {
            ModeSelection::Lowest(0) => return Ok(self.found),
            ModeSelection::Lowest(_) => self.settings.shift * self.scale,
            ModeSelection::UpTo { value, .. } if value.is_nan() || value <= 0.0 => return Ok(self.found),
            ModeSelection::UpTo { value, .. } => (self.settings.shift_of_bound * value).max(least),
        };
        let (mut shift, mut factor) = self.first_factor(first_shift, None)?;
        let mut counted = 0;
        for _ in 0..self.settings.max_runs {
            let run = self.run_at(shift, &factor, counted, first_shift)?;
            self.found.cost.vectors += run.vectors;
            if let RunEnd::Slender(value) = run.end {
                first_shift = value.max(least);
                (shift, factor) = self.first_factor(first_shift, Some(factor))?;
                continue;
            }
            if let RunEnd::Clustered(value) = run.end {
                (shift, factor) = self.factor_near(value, first_shift, factor)?;
                counted = factor.negative_pivots();
                continue;
            }
            let (exhausted, more) = (matches!(run.end, RunEnd::Exhausted), run.modes.count());
            self.found.merge(self.mass.n(), run.modes);
            (shift, factor) = self.factor_near(self.complete_up_to(exhausted, first_shift), first_shift, factor)?;
            counted = factor.negative_pivots();
            let found = self.found.below(shift);
            let (enough, keep) = match self.wanted {
                ModeSelection::Lowest(n) => (found >= n, n),
                ModeSelection::UpTo { value, most } if counted > most => {
                    return Err(ModesError::TooMany { count: counted, below: shift.min(value), most });
                }
                ModeSelection::UpTo { value, .. } => {
                    (shift >= value, self.found.below(value + self.settings.rounding * value.abs()))
                }
            };
            if found == counted && (enough || exhausted) {
                return self.checked(keep);
            }
            if found > counted || exhausted || more == 0 {
                break;
            }
        }
        Err(ModesError::NotConverged { found: self.found.below(shift), counted, below: shift })
    }

    /// Returns the first `keep` modes. Fails if a mode is negative, because a large first shift
    /// does not detect eigenvalues just below zero.
    fn checked(mut self, keep: usize) -> Result<NaturalModes, ModesError> {
        let below = -self.settings.shift * self.scale;
        match self.found.below(below) {
            0 => {
                self.found.truncate(keep);
                Ok(self.found)
            }
            count => Err(ModesError::Negative { count, below }),
        }
    }

    /// Factors at a shift, in the memory of the last factor.
    fn factor(&mut self, shift: f64, last: Option<LdlFactor>) -> Result<LdlFactor, Singular> {
        self.found.cost.factors += 1;
        let sum = [(1.0, self.stiffness), (-shift, self.mass)];
        match last {
            Some(last) => last.refactor(&sum),
            None => self.analysis.factor(&sum),
        }
    }

    /// Factors at the first, negative shift.
    fn first_factor(&mut self, first_shift: f64, last: Option<LdlFactor>) -> Result<(f64, LdlFactor), ModesError> {
        let factor = self.factor(-first_shift, last).map_err(ModesError::Massless)?;
        match factor.negative_pivots() {
            0 => Ok((-first_shift, factor)),
            count => Err(ModesError::Negative { count, below: -first_shift }),
        }
    }

    /// Factors at a shift, or slightly above it if the shift is an eigenvalue.
    fn factor_near(&mut self, shift: f64, first_shift: f64, last: LdlFactor) -> Result<(f64, LdlFactor), ModesError> {
        let (mut last, mut failed) = (Some(last), Singular { row: 0 });
        for attempt in 0..self.settings.attempts {
            let shift = shift + attempt as f64 * self.settings.gap * (shift.abs() + first_shift);
            match self.factor(shift, last.take()) {
                Ok(factor) => return Ok((shift, factor)),
                Err(singular) => failed = singular,
            }
        }
        Err(ModesError::Massless(failed))
    }

    /// Returns a value up to which the modes found may be complete, in a gap between them.
    fn complete_up_to(&self, exhausted: bool, first_shift: f64) -> f64 {
        let values = &self.found.values;
        // The bound needs this number of modes below it, and lies above `above`.
        let (below, above) = match self.wanted {
            ModeSelection::Lowest(n) => (n.min(values.len()), f64::NEG_INFINITY),
            ModeSelection::UpTo { value, .. } => match values.partition_point(|v| *v <= value) {
                all if all == values.len() && !exhausted => (all, f64::NEG_INFINITY),
                below => (below, value),
            },
        };
        let last = values.last().copied().unwrap_or(0.0).max(above);
        let gaps = (below..values.len()).map(|i| (if i == 0 { above } else { values[i - 1].max(above) }, values[i]));
        let wide = |share: f64| move |(low, high): &(f64, f64)| high - low > share * (high + first_shift);
        // Inside a cluster no gap is wide, so the widest one serves.
        let widest =
            || gaps.clone().filter(wide(self.settings.rounding)).max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)));
        let gap = gaps.clone().find(wide(self.settings.gap)).or_else(widest);
        gap.map_or(last + (self.settings.next_shift_distance * (last + first_shift)).max(first_shift), |(low, high)| {
            0.5 * (low + high)
        })
    }

    /// Runs the Lanczos process at a shift with `counted` eigenvalues below it.
    fn run_at(
        &self,
        shift: f64,
        factor: &LdlFactor,
        counted: usize,
        first_shift: f64,
    ) -> Result<LanczosRun, ModesError> {
        let mut lanczos = Lanczos::new(factor, self.mass, &self.found.shapes);
        let missing = counted.saturating_sub(self.found.below(shift));
        let wanted = match self.wanted {
            ModeSelection::Lowest(n) => missing.max((n + 1).saturating_sub(self.found.count())),
            ModeSelection::UpTo { .. } => self.settings.max_vectors,
        };
        let value = |pair: &RitzPair| shift + 1.0 / pair.theta;
        let (mut blocks, mut next) = (0, self.settings.check_interval);
        loop {
            blocks += 1;
            let exhausted = !lanczos.expand()?;
            let full = lanczos.expanded + BLOCK > self.settings.max_vectors;
            if !(exhausted || full || blocks == next) {
                continue;
            }
            next += self.settings.check_interval.max(blocks / self.settings.check_divisor);
            let mut pairs = lanczos.pairs()?;
            let nearest_value = pairs.first().map(value);
            let converged = |pair: &RitzPair| pair.residual <= self.settings.tolerance * pair.theta.abs();
            let nearest = pairs.iter().take_while(|pair| converged(pair)).count();
            pairs.retain(converged);
            let near = &pairs[..nearest];
            let low = near.iter().filter(|pair| pair.theta < 0.0).count();
            let enough = match self.wanted {
                ModeSelection::Lowest(_) => nearest >= wanted,
                ModeSelection::UpTo { value: bound, .. } => {
                    self.found.values.last().is_some_and(|v| *v > bound) || near.iter().any(|pair| value(pair) > bound)
                }
            };
            if (enough && low >= missing) || full || exhausted {
                let modes = lanczos.modes(self.stiffness, shift, &pairs)?;
                let end = match nearest_value {
                    _ if exhausted => RunEnd::Exhausted,
                    Some(value) if pairs.is_empty() => RunEnd::Clustered(value),
                    _ => RunEnd::Full,
                };
                return Ok(LanczosRun { modes, vectors: lanczos.expanded, end });
            }
            if blocks >= self.settings.slender_check_blocks
                && self.found.count() == 0
                && first_shift > self.settings.least_shift * self.scale
            {
                let elastic = pairs.iter().map(value).filter(|value| *value > SLENDER.0 * first_shift);
                let first = elastic.fold(f64::INFINITY, f64::min);
                if first < SLENDER.1 * first_shift {
                    let end = RunEnd::Slender(first);
                    return Ok(LanczosRun { modes: NaturalModes::empty(), vectors: lanczos.expanded, end });
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparse::multi_vector;
    use nalgebra::DMatrix;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn modes(k: &SparseMatrix, m: &SparseMatrix, wanted: ModeSelection) -> Result<NaturalModes, ModesError> {
        NaturalModes::new(&SymbolicAnalysis::new(&[k, m]), k, m, wanted)
    }

    fn matrix(n: usize, entries: impl IntoIterator<Item = (usize, usize, f64)>) -> SparseMatrix {
        SparseMatrix::from_triplets(n, entries).unwrap()
    }

    fn identity(n: usize) -> SparseMatrix {
        matrix(n, (0..n).map(|i| (i, i, 1.0)))
    }

    /// Springs of stiffness one between i and k. A pair (i, i) is a spring to the ground.
    fn springs(n: usize, between: impl IntoIterator<Item = (usize, usize)>) -> SparseMatrix {
        let spring = |(i, k): (usize, usize)| match i == k {
            true => vec![(i, i, 1.0)],
            false => vec![(i, i, 1.0), (k, k, 1.0), (i, k, -1.0), (k, i, -1.0)],
        };
        matrix(n, between.into_iter().flat_map(spring))
    }

    /// The eigenvalues agree with the expected ones to `tolerance` of the value plus
    /// `rounding`. The shapes are orthonormal and satisfy the equations.
    fn check(k: &SparseMatrix, m: &SparseMatrix, modes: &NaturalModes, expected: &[f64], rounding: f64) {
        assert_eq!(modes.count(), expected.len(), "{:?}", modes.values);
        let n = k.n();
        for (value, expected) in modes.values.iter().zip(expected) {
            assert!((value - expected).abs() <= 1e-11 * expected + rounding, "{value} instead of {expected}");
        }
        let gram = multi_vector::inner_products(n, &modes.shapes, &m.multiply_columns(&modes.shapes));
        assert!((gram - DMatrix::identity(modes.count(), modes.count())).amax() < 1e-10);
        let (kx, mx) = (k.multiply_columns(&modes.shapes), m.multiply_columns(&modes.shapes));
        for mode in 0..modes.count() {
            let length = modes.shape(mode).iter().map(|x| x * x).sum::<f64>().sqrt();
            let size = k.max_abs() * length;
            let off =
                (0..n).map(|i| (kx[mode * n + i] - modes.values[mode] * mx[mode * n + i]).abs()).fold(0.0, f64::max);
            assert!(off < 1e-9 * size, "mode {mode}: {off:e} of {size:e}");
        }
    }

    /// A chain between walls: `λ = 4 sin²(π i / 2 (n + 1))`. A free chain: `4 sin²(π i / 2 n)`
    /// from zero. A ring: `4 sin²(π i / n)`, twice each.
    #[test]
    fn chains_and_rings() {
        for n in [1, 2, 3, 5, 40, 900] {
            let m = identity(n);
            let count = n.min(12);
            let sine = |x: f64| 4.0 * x.sin().powi(2);
            let held = springs(n, (1..n).map(|i| (i - 1, i)).chain([(0, 0), (n - 1, n - 1)]));
            let expected: Vec<f64> = (1..=count).map(|i| sine(PI * i as f64 / (2 * n + 2) as f64)).collect();
            check(&held, &m, &modes(&held, &m, ModeSelection::Lowest(12)).unwrap(), &expected, 1e-14);
            if n == 1 {
                continue;
            }
            let free = springs(n, (1..n).map(|i| (i - 1, i)));
            let expected: Vec<f64> = (0..count).map(|i| sine(PI * i as f64 / (2 * n) as f64)).collect();
            let found = modes(&free, &m, ModeSelection::Lowest(12)).unwrap();
            check(&free, &m, &found, &expected, 1e-14);
            assert_eq!(found.rigid_body_count(), 1);
            let ring = springs(n, (0..n).map(|i| (i, (i + 1) % n)));
            let expected: Vec<f64> = (0..count).map(|i| sine(PI * i.div_ceil(2) as f64 / n as f64)).collect();
            check(&ring, &m, &modes(&ring, &m, ModeSelection::Lowest(12)).unwrap(), &expected, 1e-14);
        }
    }

    /// A bar of linear elements with consistent mass, fixed at one end:
    /// `λ = (6 / h²) (1 - cos β) / (2 + cos β)`, `β = (i - ½) π / n`.
    #[test]
    fn a_bar_held_at_one_end() {
        let n = 400;
        let h = 1.0 / n as f64;
        let element = |i: usize, a: f64, b: f64| {
            let own = [(i, i, a)];
            let linked = (i > 0).then(|| [(i - 1, i - 1, a), (i, i - 1, b), (i - 1, i, b)]);
            own.into_iter().chain(linked.into_iter().flatten())
        };
        let k = matrix(n, (0..n).flat_map(|i| element(i, 1.0 / h, -1.0 / h)));
        let m = matrix(n, (0..n).flat_map(|i| element(i, h / 3.0, h / 6.0)));
        let value = |i: usize| {
            let cosine = ((i as f64 + 0.5) * PI / n as f64).cos();
            6.0 / (h * h) * (1.0 - cosine) / (2.0 + cosine)
        };
        let expected: Vec<f64> = (0..30).map(value).collect();
        // The largest eigenvalue is 12 / h² = 2e6. Its rounding affects all others.
        check(&k, &m, &modes(&k, &m, ModeSelection::Lowest(30)).unwrap(), &expected, 1e-9);
        let bound = 0.5 * (expected[24] + expected[25]);
        let up_to = modes(&k, &m, ModeSelection::UpTo { value: bound, most: 25 }).unwrap();
        check(&k, &m, &up_to, &expected[..25], 1e-9);
        let many = modes(&k, &m, ModeSelection::UpTo { value: bound, most: 24 });
        assert_eq!(many.unwrap_err(), ModesError::TooMany { count: 25, below: bound, most: 24 });
        assert_eq!(modes(&k, &m, ModeSelection::UpTo { value: 0.9 * expected[0], most: 9 }).unwrap().count(), 0);
        assert_eq!(modes(&k, &m, ModeSelection::UpTo { value: -1.0, most: 9 }).unwrap().count(), 0);
    }

    /// Clusters of eigenvalues larger than a block, and an upper bound equal to an eigenvalue.
    #[test]
    fn groups_larger_than_a_block() {
        let n = 300;
        let value = |i: usize| 1.0 + (i / 11) as f64;
        let (k, m) = (matrix(n, (0..n).map(|i| (i, i, 2.0 * value(i)))), matrix(n, (0..n).map(|i| (i, i, 2.0))));
        let expected: Vec<f64> = (0..n).map(value).collect();
        check(&k, &m, &modes(&k, &m, ModeSelection::Lowest(30)).unwrap(), &expected[..30], 0.0);
        check(&k, &m, &modes(&k, &m, ModeSelection::UpTo { value: 3.0, most: 99 }).unwrap(), &expected[..33], 0.0);
        check(&k, &m, &modes(&k, &m, ModeSelection::Lowest(n + 5)).unwrap(), &expected, 0.0);
    }

    /// Equal oscillators with weak coupling springs: all eigenvalues agree to 0.4 %,
    /// `λ = k (1 + 2 ε - 2 ε cos(π i / (n + 1)))`.
    #[test]
    fn clusters_larger_than_a_run() {
        let (n, stiffness, weak) = (500, 1e6, 1e-3);
        let links = (1..n).flat_map(|i| [(i, i - 1, -weak * stiffness), (i - 1, i, -weak * stiffness)]);
        let k = matrix(n, links.chain((0..n).map(|i| (i, i, (1.0 + 2.0 * weak) * stiffness))));
        let cosine = |i: usize| (PI * i as f64 / (n + 1) as f64).cos();
        let expected: Vec<f64> = (1..=n).map(|i| stiffness * (1.0 + 2.0 * weak * (1.0 - cosine(i)))).collect();
        check(&k, &identity(n), &modes(&k, &identity(n), ModeSelection::Lowest(6)).unwrap(), &expected[..6], 1e-8);
        let bound = ModeSelection::UpTo { value: 1.1 * stiffness, most: n };
        check(&k, &identity(n), &modes(&k, &identity(n), bound).unwrap(), &expected, 1e-8);
        let bound = ModeSelection::UpTo { value: 0.5 * (expected[29] + expected[30]), most: n };
        check(&k, &identity(n), &modes(&k, &identity(n), bound).unwrap(), &expected[..30], 1e-8);
    }

    /// More modes than fit into one run.
    #[test]
    fn hundreds_of_modes() {
        let n = 1500;
        let (k, m) = (springs(n, (0..n).map(|i| (i, (i + 1) % n))), identity(n));
        let expected: Vec<f64> =
            (0..401usize).map(|i| 4.0 * (PI * i.div_ceil(2) as f64 / n as f64).sin().powi(2)).collect();
        let found = modes(&k, &m, ModeSelection::Lowest(401)).unwrap();
        check(&k, &m, &found, &expected, 1e-13);
        assert!(found.cost.factors > 2, "{:?}", found.cost);
        let bound = 0.5 * (expected[350] + expected[351]);
        let found = modes(&k, &m, ModeSelection::UpTo { value: bound, most: 400 }).unwrap();
        check(&k, &m, &found, &expected[..351], 1e-13);
    }

    /// A slender beam is softer than its elements by many orders of magnitude. A cantilever has
    /// `λ = (β / L)⁴ EI / (ρA)`, β = 1.8751, 4.6941, 7.8548.
    #[test]
    fn a_slender_cantilever() {
        let n = 120;
        let h = 1.0 / n as f64;
        let place = |node: usize, k: usize| (2 * node + k).checked_sub(2);
        let element = |values: [[f64; 4]; 4], factor: f64| {
            let at = move |e: usize| {
                let entry = move |i: usize, k: usize| {
                    let (row, column) = (place(e + i / 2, i % 2)?, place(e + k / 2, k % 2)?);
                    let units = [h, 1.0][1 - i % 2] * [h, 1.0][1 - k % 2];
                    Some((row, column, factor * values[i][k] * units))
                };
                (0..16).filter_map(move |at| entry(at / 4, at % 4))
            };
            matrix(2 * n, (0..n).flat_map(at))
        };
        let bending =
            [[12.0, 6.0, -12.0, 6.0], [6.0, 4.0, -6.0, 2.0], [-12.0, -6.0, 12.0, -6.0], [6.0, 2.0, -6.0, 4.0]];
        let inertia = [
            [156.0, 22.0, 54.0, -13.0],
            [22.0, 4.0, 13.0, -3.0],
            [54.0, 13.0, 156.0, -22.0],
            [-13.0, -3.0, -22.0, 4.0],
        ];
        let (k, m) = (element(bending, h.powi(-3)), element(inertia, h / 420.0));
        let found = modes(&k, &m, ModeSelection::Lowest(8)).unwrap();
        assert_eq!(found.rigid_body_count(), 0);
        // Roots of cos β cosh β = -1, by Newton's method.
        for (i, value) in found.values.iter().enumerate() {
            let mut beta = (i as f64 + 0.5) * PI;
            for _ in 0..50 {
                let f = beta.cos() + 1.0 / beta.cosh();
                beta += f / (beta.sin() + beta.sinh() / beta.cosh().powi(2));
            }
            // The discretization error is (β h)⁴ / 720. The rounding is that of
            // the largest eigenvalue, 9e11.
            let tolerance = (beta * h).powi(4) / 700.0 * beta.powi(4) + 1e-4;
            assert!((value - beta.powi(4)).abs() < tolerance, "{i}: {value} instead of {}", beta.powi(4));
        }
    }

    /// Massless places follow the others: in a chain with every second place
    /// massless, the springs act in series.
    #[test]
    fn places_without_mass() {
        let n = 201;
        let k = springs(n, (1..n).map(|i| (i - 1, i)).chain([(0, 0), (n - 1, n - 1)]));
        let m = matrix(n, (0..n).filter(|i| i % 2 == 1).map(|i| (i, i, 1.0)));
        let expected: Vec<f64> = (1..=100).map(|i| 2.0 * (PI * i as f64 / 202.0).sin().powi(2)).collect();
        check(&k, &m, &modes(&k, &m, ModeSelection::Lowest(9)).unwrap(), &expected[..9], 1e-14);
        // No more modes than places with mass.
        check(&k, &m, &modes(&k, &m, ModeSelection::Lowest(150)).unwrap(), &expected, 1e-14);
        let none = matrix(n, []);
        assert_eq!(modes(&k, &none, ModeSelection::Lowest(3)).unwrap().count(), 0);
    }

    #[test]
    fn errors_of_systems_without_modes() {
        let n = 30;
        let (free, m) = (springs(n, (1..n).map(|i| (i - 1, i))), identity(n));
        let unstable = matrix(n, free.entries().chain([(4, 4, -0.5)]));
        for wanted in [ModeSelection::Lowest(2), ModeSelection::UpTo { value: 100.0, most: n }] {
            assert!(matches!(modes(&unstable, &m, wanted), Err(ModesError::Negative { count: 1, .. })), "{wanted:?}");
        }
        let massless = matrix(n, m.entries().filter(|(i, ..)| *i < n - 2));
        let loose = springs(n, (1..n - 2).map(|i| (i - 1, i)));
        assert!(matches!(modes(&loose, &massless, ModeSelection::Lowest(2)), Err(ModesError::Massless(_))));
        let negative = matrix(n, m.entries().map(|(i, k, v)| (i, k, if i == 3 { -v } else { v })));
        let held = springs(n, (1..n).map(|i| (i - 1, i)).chain([(0, 0)]));
        let wrong = modes(&held, &negative, ModeSelection::Lowest(2));
        assert!(matches!(wrong, Err(ModesError::NegativeMass | ModesError::Negative { .. })), "{wrong:?}");
        let none = matrix(0, []);
        assert_eq!(modes(&none, &none, ModeSelection::Lowest(3)).unwrap().count(), 0);
    }

    /// Two sets of three masses. All modes fill the space, and further vectors are rounding:
    /// this must not count as a negative mass.
    #[test]
    fn all_modes_of_few_rows() {
        for step in 0..400 {
            let more = (0.01 * step as f64).powi(2);
            let masses = [2.0, 0.3, 0.2];
            let k = [[3.5e5, -5e4, 0.0], [-5e4, 8e4 + 2e3 * more, -3e4], [0.0, -3e4, 3e4 + 5e3 * more]];
            let both = (0..2).flat_map(|set| (0..9).map(move |at| (set, at / 3, at % 3)));
            let k = matrix(6, both.map(|(set, i, l)| (3 * set + i, 3 * set + l, k[i][l])));
            let m = matrix(6, (0..6).map(|i| (i, i, masses[i % 3])));
            let found = modes(&k, &m, ModeSelection::Lowest(6)).unwrap();
            assert_eq!(found.count(), 6, "{step}");
            assert!(found.values.chunks(2).all(|pair| (pair[1] / pair[0] - 1.0).abs() < 1e-9), "{:?}", found.values);
        }
    }

    #[test]
    fn same_bits_on_every_thread() {
        let solve = || {
            let (k, m) = (springs(500, (0..500).map(|i| (i, (i + 1) % 500))), identity(500));
            modes(&k, &m, ModeSelection::Lowest(21)).unwrap()
        };
        let here = solve();
        let there: Vec<_> = (0..3).map(|_| std::thread::spawn(solve)).collect();
        assert!(there.into_iter().all(|thread| thread.join().unwrap() == here));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]

        /// A singular mass `M = Tᵀ T` of lower rank than the number of
        /// coordinates. Then 1/λ are the eigenvalues of the flexibility
        /// `T K⁻¹ Tᵀ`. The units of the coordinates differ by factors up to 10⁶.
        #[test]
        fn massless_combinations(
            size in 2usize..24,
            share in 0.05f64..0.95,
            entries in proptest::collection::vec(-1.0f64..1.0, 600),
            springs in proptest::collection::vec(0.1f64..10.0, 24),
            units in proptest::collection::vec(-3.0f64..3.0, 24),
        ) {
            let rank = ((size as f64 * share) as usize).max(1);
            let unit = |i: usize| 10f64.powf(units[i]);
            let t = DMatrix::from_fn(rank, size, |i, k| entries[i * size + k] * unit(k));
            let coupled = DMatrix::from_fn(size, size, |i, k| 0.2 * entries[599 - (i.min(k) * size + i.max(k)) % 600]);
            let own = DMatrix::from_fn(size, size, |i, k| if i == k { springs[i] + size as f64 * 0.2 } else { 0.0 });
            let k = DMatrix::from_fn(size, size, |i, k| (own[(i, k)] + coupled[(i, k)]) * unit(i) * unit(k));
            let mut m = t.transpose() * &t;
            m.fill_lower_triangle_with_upper_triangle();
            let flexibility = &t * k.clone().cholesky().unwrap().solve(&t.transpose());
            let mut thetas: Vec<f64> = flexibility.symmetric_eigenvalues().iter().copied().collect();
            thetas.sort_by(|a, b| b.total_cmp(a));
            prop_assume!(thetas[rank - 1] > 1e-6 * thetas[0]);
            let all = |a: &DMatrix<f64>| matrix(size, (0..size * size).map(|at| (at / size, at % size, a[at])));
            let (k, m) = (all(&k), all(&m));
            for count in [1, rank, rank + 1, size + 3] {
                let found = modes(&k, &m, ModeSelection::Lowest(count)).unwrap();
                prop_assert_eq!(found.count(), count.min(rank), "{:?} of {:?}", found.values, thetas);
                for (value, theta) in found.values.iter().zip(&thetas) {
                    // The relative error of a mode grows with its eigenvalue
                    // relative to the lowest.
                    let error = (value * theta - 1.0).abs();
                    prop_assert!(error < 1e-11 * thetas[0] / theta, "{} instead of {}", value, 1.0 / theta);
                }
            }
        }
    }

    proptest! {
        /// Random structures: the eigenvalues agree with those of the dense
        /// problem `L⁻¹ K L⁻ᵀ`, M = L Lᵀ.
        #[test]
        fn random_structures(
            links in proptest::collection::vec((0usize..40, 0usize..40, 0.1f64..10.0), 30..120),
            masses in proptest::collection::vec(0.1f64..10.0, 40),
            count in 1usize..45,
        ) {
            let n = 40;
            let spring = |&(i, k, v): &(usize, usize, f64)| match i == k {
                true => vec![(i, i, v)],
                false => vec![(i, i, v), (k, k, v), (i, k, -v), (k, i, -v)],
            };
            let k = matrix(n, links.iter().flat_map(spring));
            let coupled = links.iter().take(8).flat_map(|(i, k, v)| [(*i, *i, *v), (*k, *k, *v), (*i, *k, 0.5 * v), (*k, *i, 0.5 * v)]);
            let m = matrix(n, (0..n).map(|i| (i, i, masses[i])).chain(coupled));
            let dense = |a: &SparseMatrix| DMatrix::from_fn(n, n, |i, k| a.get(i, k));
            let l = dense(&m).cholesky().unwrap().l();
            let inverse = l.solve_lower_triangular(&DMatrix::identity(n, n)).unwrap();
            let mut expected: Vec<f64> = (&inverse * dense(&k) * inverse.transpose()).symmetric_eigenvalues().iter().copied().collect();
            expected.sort_by(f64::total_cmp);
            let found = modes(&k, &m, ModeSelection::Lowest(count)).unwrap();
            check(&k, &m, &found, &expected[..count.min(n)], 1e-11 * expected[n - 1]);
            let bound = 0.5 * (expected[count.min(n) - 1] + expected.get(count).copied().unwrap_or(1e3 * expected[n - 1]));
            prop_assume!(expected.iter().all(|e| (e - bound).abs() > 1e-9 * expected[n - 1]));
            let found = modes(&k, &m, ModeSelection::UpTo { value: bound, most: n }).unwrap();
            prop_assert_eq!(found.count(), count.min(n));
        }
    }
}
