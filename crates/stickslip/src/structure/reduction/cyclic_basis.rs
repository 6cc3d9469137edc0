//! Reduction of a sector of a ring, valid for all its waves.
//!
//! The matrices of a wave are affine in `e^{jθ}`. Therefore its modes and residual vectors
//! depend smoothly on the nodal diameter. Real and imaginary parts of those of some diameters
//! form one real basis of the sector, `q(s) = V p(s)`. The reduced ring couples adjacent
//! sectors only, like the whole ring: `V* A(θ) V` for every θ at once.
//!
//! It has the modes of these diameters exactly and is compared with the whole ring for other
//! diameters. The number of diameters follows from the required error.
//!
//! Differences between sectors use the same basis, `Vᵀ ΔA V`: the nominal modes of the ring
//! approximately span the space of the mistuned ring (`nominal_modes`, `mistuning_error`). If
//! that is not accurate enough, the basis also receives residual vectors of the forces `D φ`,
//! which a deviating blade exerts in the modes φ.
//!
//! Source: Yang and Griffin (2001), "A reduced-order model of mistuning using a subset of
//! nominal system modes", J. Eng. Gas Turbines Power 123, 893-900.

use super::computed_wave::ComputedWave;
use super::{
    ReducedMatrices, Reduction, ReductionDeviation, ReductionError, ReductionKind, ReferenceReceptance, Row,
    StructureDamping, damping,
};
use crate::structure::sector::{is_real, wave_entries};
use crate::structure::sector_boundary::Blade;
use crate::structure::{CyclicSector, RingEntry, unit_root};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::sync::{Arc, Mutex, PoisonError};
use stickslip_numerics::eigen;
use stickslip_numerics::interrupt;
use stickslip_numerics::parallel::{map, try_map};
use stickslip_numerics::sparse::{SparseMatrix, multi_vector};

/// Orders of residual vectors, with the relative eigenvalue of the vectors' Gram matrix below
/// which a combination is dropped. They are tried in this sequence. More orders do not help while
/// combinations are missing: with 1e-9, three orders of a sector of 1,902 rows have an error of
/// 4e-4, as one has, and with 1e-12, two have 2e-7.
const SIZES: [(usize, f64); 5] = [(1, 1e-6), (1, 1e-9), (1, 1e-12), (2, 1e-12), (3, 1e-12)];
/// First entry of the sequence of extents and sizes that each step tries for different blades.
/// The first step is that of the tuned ring, without blade vectors.
pub(in crate::structure) const STEPS: [usize; 5] = [0, 1, 3, 8, 9];
/// Converts a relative shift of a natural frequency to an error of the receptance: the shift
/// divided by this half width of a resonance. Modes that no port observes are compared in this
/// way.
pub(super) const HALF_WIDTH: f64 = 1e-3;
/// Largest number of samples in the comparison of a wave; each needs a factorization of twice
/// the size of a sector. All natural frequencies are compared in addition. With five and nine
/// samples, the errors of disks differ by up to 40 % from those with three, in both directions,
/// because the samples also determine the typical receptance to which an error is relative.
const SAMPLES: usize = 3;

/// Largest number of residual vectors of one basis. The matrix of their inner products takes 0.2 GB
/// and its eigenvalues half a minute. More would be needed if some hundred contact nodes lie on a
/// sector.
const MOST_VECTORS: usize = 5000;

/// Largest number of waves that are computed at once, on as many threads: each needs a
/// factorization, and that of 60,000 rows takes half a gigabyte.
const WAVES_AT_ONCE: usize = 4;

/// Returns the number of threads for waves.
fn threads() -> usize {
    rayon::current_num_threads().min(WAVES_AT_ONCE)
}

/// The size of a basis of a sector whose error was within its tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SectorBasis {
    /// Multiple of the frequency of interest up to which it has modes.
    extent: f64,
    /// Orders of residual vectors.
    order: usize,
    /// Relative eigenvalue of the vectors' Gram matrix below which a combination is dropped.
    share: f64,
    /// Refinement level of the nodal diameters.
    level: usize,
}

/// A reduced sector.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct ReducedSector {
    pub kind: String,
    /// Columns over the remaining rows.
    pub basis: Vec<f64>,
    pub n: usize,
    /// Entries as row, column, shift, value.
    pub mass: Vec<RingEntry>,
    pub damping: Option<Vec<RingEntry>>,
    pub stiffness: Vec<RingEntry>,
    /// Ports over coordinates: port, coordinate, shift, weight.
    pub ports: Vec<RingEntry>,
    pub port_count: usize,
    /// The last result of [`ReducedSector::damped`]: the cases of a study repeat it.
    #[serde(skip)]
    damped: Arc<Mutex<Option<KeptDamping>>>,
}

/// Damping that depends on modes, with its law and the number of sectors.
type KeptDamping = (StructureDamping, usize, Arc<Vec<RingEntry>>);

/// Result of a reduction.
#[derive(Debug, Clone)]
pub(in crate::structure) struct SectorReduction {
    pub reduced: ReducedSector,
    pub deviation: ReductionDeviation,
    /// Frequencies of the computed waves, rad/s, ascending. Each pair of travelling waves is
    /// listed once.
    pub frequencies: Vec<f64>,
    /// Number of free motions among them.
    pub free: usize,
    /// Upper end of the frequency range of the deviation, rad/s.
    pub up_to: f64,
    /// Highest frequency for which the basis is intended, rad/s.
    pub serves: f64,
    /// The size of the basis, if it follows from the required error.
    pub basis: Option<SectorBasis>,
}

/// Returns the first Gram tolerance for this number of orders.
fn share(orders: usize) -> f64 {
    SIZES.iter().find(|(order, _)| *order >= orders).map_or(SIZES[SIZES.len() - 1].1, |(_, share)| *share)
}

/// The waves of a sector, computed on request.
struct WaveCollection<'a> {
    sector: &'a CyclicSector,
    /// Mass, stiffness and damping, if any.
    matrices: (ShiftedMatrices, ShiftedMatrices, Option<ShiftedMatrices>),
    seen: &'a [Row],
    /// For different blades: the blade, and the highest frequency of interest.
    blade: Option<(&'a Blade, f64)>,
    computed: Vec<ComputedWave>,
    /// The vectors of the last basis: the next one often drops fewer of their combinations.
    vectors: Option<SectorVectors>,
}

/// Vectors of several waves over the remaining rows, and their combinations that are orthogonal
/// in the energy of the sector.
struct SectorVectors {
    /// Nodal diameters, orders of residual vectors, and the multiple of the frequency of interest
    /// up to which modes are included.
    source: (Vec<usize>, usize, f64),
    kind: String,
    columns: Vec<f64>,
    /// Weights of the vectors in each combination of unit energy, one column per combination.
    weights: DMatrix<f64>,
    /// Eigenvalues of the Gram matrix relative to the largest one, falling.
    shares: Vec<f64>,
}

impl SectorBasis {
    /// Returns its position in the sequence of extents and sizes that are tried.
    pub(in crate::structure) fn position(&self) -> Option<usize> {
        tried_bases().position(|(extent, size)| extent == self.extent && size == (self.order, self.share))
    }
}

/// Returns the extents and sizes in the sequence in which they are tried. Extents are multiples of
/// the frequency of interest up to which the modes of every wave are taken.
fn tried_bases() -> impl Iterator<Item = (f64, (usize, f64))> {
    [1.5, 3.0].into_iter().flat_map(|extent| SIZES.map(|size| (extent, size)))
}

impl CyclicSector {
    /// Returns the reduced sector, observed at these weighted sums of the component's rows. For
    /// different blades, it includes blade vectors, from this entry of [`STEPS`] on.
    pub(in crate::structure) fn reduced(
        &self,
        seen: &[Row],
        how: &Reduction,
        blade: Option<(&Blade, usize)>,
    ) -> Result<SectorReduction, ReductionError> {
        if seen.is_empty() {
            return Err(ReductionError::NoPorts);
        }
        let mut waves = WaveCollection::new(self, seen, None)?;
        match *how {
            Reduction::None { .. } => Err(ReductionError::NoPorts),
            Reduction::UpTo { up_to, tolerance, kind } => {
                waves.blade = blade.map(|(blade, _)| (blade, up_to));
                waves.up_to(up_to, tolerance, kind, blade.map_or(0, |(_, step)| STEPS[step]))
            }
            Reduction::Modes { modes, kind, orders, up_to } => waves.with_modes(modes, (kind, orders), up_to),
        }
    }

    /// Returns the sector reduced by a basis of a known size with the modes of a higher frequency
    /// range, up to `up_to`, rad/s. For different blades, it includes blade vectors. Its error is
    /// not computed.
    pub(in crate::structure) fn reduced_by_size(
        &self,
        seen: &[Row],
        up_to: f64,
        basis: SectorBasis,
        blade: Option<&Blade>,
    ) -> Result<SectorReduction, ReductionError> {
        let SectorBasis { extent, order, share, level } = basis;
        let blade = blade.map(|blade| (blade, up_to));
        let mut waves = WaveCollection::new(self, seen, blade)?;
        let taken = self.diameters(level);
        waves.computed = try_map(taken.iter().copied(), threads(), |diameter| -> Result<_, ReductionError> {
            let whole = self.wave(diameter, seen)?;
            let modes = whole.modes(extent * up_to)?;
            let mut wave = ComputedWave::new(diameter, whole, (modes, extent), None);
            wave.vectors(order, self.dofs)?;
            if blade.is_none() {
                wave.whole = None;
            }
            Ok(wave)
        })?;
        let reduced = waves.basis(&taken, (order, share), ReductionKind::Rubin)?;
        let unknown = ReductionDeviation { error: f64::NAN, omega: up_to };
        Ok(SectorReduction { basis: Some(basis), ..waves.chosen(reduced, unknown, (up_to, up_to)) })
    }

    /// Returns the nodal diameters of a refinement level. High levels contain all diameters.
    pub(super) fn diameters(&self, level: usize) -> Vec<usize> {
        let (half, parts) = (self.sectors / 2, 2usize << level);
        let mut all: Vec<usize> = (0..=parts).map(|part| (part * half + parts / 2) / parts).collect();
        all.dedup();
        all
    }
}

/// The matrices of a sector's entries with the shifts -1, 0 and 1.
struct ShiftedMatrices([SparseMatrix; 3]);

impl ShiftedMatrices {
    const SHIFTS: [i64; 3] = [-1, 0, 1];

    fn new(n: usize, entries: &[RingEntry]) -> Result<Self, ReductionError> {
        let of = |shift: i64| {
            let own = entries.iter().filter(|entry| entry.2 == shift);
            let own = own.map(|&(row, column, _, value)| (row, column, value));
            SparseMatrix::from_triplets(n, own).map_err(|_| ReductionError::OutOfRange)
        };
        let [previous, own, next] = Self::SHIFTS.map(of);
        Ok(ShiftedMatrices([previous?, own?, next?]))
    }

    /// Returns the entries of `Vᵀ A V`.
    fn projected(&self, basis: &[f64]) -> Vec<RingEntry> {
        entries(self.0.each_ref().map(|matrix| congruence(matrix, basis)))
    }

    /// Returns the entries of `Vᵀ A V` for the symmetric matrix of a ring, symmetric in all digits.
    fn projected_symmetric(&self, basis: &[f64]) -> Vec<RingEntry> {
        let [_, own, next] = &self.0;
        let (own, next) = (congruence(own, basis), congruence(next, basis));
        entries([next.transpose(), (&own + own.transpose()) * 0.5, next])
    }
}

/// Returns the entries of matrices with the shifts -1, 0 and 1.
fn entries(matrices: [DMatrix<f64>; 3]) -> Vec<RingEntry> {
    let mut out = Vec::with_capacity(matrices.iter().map(DMatrix::len).sum());
    for (matrix, shift) in matrices.iter().zip(ShiftedMatrices::SHIFTS) {
        let all = (0..matrix.nrows()).flat_map(|row| (0..matrix.ncols()).map(move |column| (row, column)));
        out.extend(all.map(|at| (at.0, at.1, shift, matrix[at])).filter(|entry| entry.3 != 0.0));
    }
    out
}

/// Returns `Vᵀ A V`, with the columns of `V` on several threads.
fn congruence(matrix: &SparseMatrix, columns: &[f64]) -> DMatrix<f64> {
    let n = matrix.n();
    let count = columns.len() / n.max(1);
    // Number of columns in one part: few enough to keep all threads busy, and enough for a fast
    // product of matrices.
    let together = 32;
    let parts = map(columns.chunks((together * n).max(1)), threads(), |part| {
        interrupt::check();
        multi_vector::inner_products(n, columns, &matrix.multiply_columns(part))
    });
    DMatrix::from_iterator(count, count, parts.iter().flat_map(DMatrix::iter).copied())
}

impl<'a> WaveCollection<'a> {
    fn new(sector: &'a CyclicSector, seen: &'a [Row], blade: Option<(&'a Blade, f64)>) -> Result<Self, ReductionError> {
        let shifted = |entries: &Vec<RingEntry>| ShiftedMatrices::new(sector.dofs, entries);
        let damping = sector.damping.as_ref().map(shifted).transpose()?;
        let matrices = (shifted(&sector.mass)?, shifted(&sector.stiffness)?, damping);
        Ok(WaveCollection { sector, matrices, seen, blade, computed: Vec::new(), vectors: None })
    }

    /// Computes the waves of these diameters, with all modes up to `extent` times the frequency
    /// of interest. The matrices of waves that are not `taken` are dropped.
    fn compute(
        &mut self,
        diameters: &[usize],
        (up_to, extent): (f64, f64),
        taken: &[usize],
    ) -> Result<(), ReductionError> {
        let (sector, seen) = (self.sector, self.seen);
        let known = |wave: &ComputedWave| diameters.contains(&wave.diameter);
        let new = diameters.iter().filter(|diameter| self.computed.iter().all(|wave| wave.diameter != **diameter));
        // the matrices of all waves at once would be the largest part of the memory
        let dropped = |wave: &mut ComputedWave| {
            if !taken.contains(&wave.diameter) {
                wave.whole = None;
            }
        };
        let computed = try_map(new.copied(), threads(), |diameter| -> Result<_, ReductionError> {
            let whole = sector.wave(diameter, seen)?;
            let modes = whole.modes(extent * up_to)?;
            let reference = ReferenceReceptance::with_samples(&whole, &modes, up_to, SAMPLES)?;
            let mut wave = ComputedWave::new(diameter, whole, (modes, extent), Some(reference));
            dropped(&mut wave);
            Ok(wave)
        })?;
        let extended = self.computed.iter_mut().filter(|wave| known(wave) && wave.extent < extent);
        try_map(extended, threads(), |wave| -> Result<(), ReductionError> {
            let modes = wave.whole(|diameter| sector.wave(diameter, seen))?.modes(extent * up_to)?;
            wave.set_modes(modes, extent);
            dropped(wave);
            Ok(())
        })?;
        self.computed.iter_mut().for_each(dropped);
        self.computed.extend(computed);
        Ok(())
    }

    fn up_to(
        &mut self,
        up_to: f64,
        tolerance: f64,
        kind: Option<ReductionKind>,
        from: usize,
    ) -> Result<SectorReduction, ReductionError> {
        for (what, value) in
            [("the largest frequency of a reduction (rad/s)", up_to), ("the tolerance of a reduction", tolerance)]
        {
            if !(value.is_finite() && value > 0.0) {
                return Err(ReductionError::Number { what, value, must: "positive" });
            }
        }
        let kind = kind.unwrap_or(ReductionKind::Rubin);
        // Ratio of the error of the waves between the computed ones to that of the computed ones
        // above which larger bases of the same diameters do not help.
        let dominance = 10.0;
        let mut best: Option<(ReductionDeviation, usize)> = None;
        let mut level = 0;
        for (extent, size) in tried_bases().skip(from) {
            loop {
                let taken = self.sector.diameters(level);
                let columns = |diameter: &usize| if is_real(*diameter, self.sector.sectors) { 1 } else { 2 };
                if best.is_some() && size.0 * self.seen.len() * taken.iter().map(columns).sum::<usize>() > MOST_VECTORS
                {
                    break;
                }
                let between = self.sector.diameters(level + 1);
                self.compute(&between, (up_to, extent), &taken)?;
                let reduced = self.basis(&taken, size, kind)?;
                let each = self.deviations(&reduced, &between, up_to)?;
                let own = largest(each.iter().filter(|(diameter, _)| taken.contains(diameter)).map(|(_, own)| *own));
                let all = largest(each.iter().map(|(_, own)| *own));
                if best.is_none_or(|(least, _)| all.error < least.error) {
                    best = Some((all, reduced.dofs()));
                }
                if all.error <= tolerance {
                    let (order, share) = size;
                    let basis = Some(SectorBasis { extent, order, share, level });
                    let basis = basis.filter(|_| kind == ReductionKind::Rubin);
                    return Ok(SectorReduction { basis, ..self.chosen(reduced, all, (up_to, up_to)) });
                }
                // other diameters are missing if the computed waves are accurate, or much more
                // accurate than the waves between them
                let missing = own.error <= tolerance || all.error > dominance * own.error;
                if !missing || taken == between {
                    break;
                }
                level += 1;
            }
        }
        let (least, dofs) = best.unwrap_or((ReductionDeviation { error: f64::INFINITY, omega: up_to }, 0));
        Err(ReductionError::ToleranceNotReached { best: least.error, at: least.omega, dofs, tolerance })
    }

    /// Reduces the sector with a fixed number of modes of every wave.
    fn with_modes(
        &mut self,
        count: usize,
        (kind, orders): (ReductionKind, usize),
        up_to: f64,
    ) -> Result<SectorReduction, ReductionError> {
        // Same ratio as in `Reduction::Modes` of a component: the last modes only improve those
        // below.
        let beyond = 1.5;
        let level = 1;
        let (taken, between) = (self.sector.diameters(level), self.sector.diameters(level + 1));
        let mut serves = f64::INFINITY;
        let mut wholes = Vec::new();
        for &diameter in &between {
            let whole = self.sector.wave(diameter, self.seen)?;
            let copies = if is_real(diameter, self.sector.sectors) { 1 } else { 2 };
            let modes = whole.lowest_modes(copies * count)?;
            let last = modes.values.last().map_or(0.0, |value| value.max(0.0).sqrt());
            serves = last.min(serves);
            wholes.push((diameter, whole, modes));
        }
        serves /= beyond;
        let up_to = if up_to > 0.0 { up_to } else { serves };
        for (diameter, whole, modes) in wholes {
            let reference = ReferenceReceptance::with_samples(&whole, &modes, up_to, SAMPLES)?;
            self.computed.push(ComputedWave::new(diameter, whole, (modes, beyond), Some(reference)));
        }
        let reduced = self.basis(&taken, (orders, share(orders)), kind)?;
        let each = self.deviations(&reduced, &between, up_to)?;
        let deviation = largest(each.into_iter().map(|(_, deviation)| deviation));
        Ok(self.chosen(reduced, deviation, (up_to, serves)))
    }

    fn chosen(
        &self,
        reduced: ReducedSector,
        deviation: ReductionDeviation,
        (up_to, serves): (f64, f64),
    ) -> SectorReduction {
        let (mut frequencies, mut free) = (Vec::new(), 0);
        for wave in &self.computed {
            let step = if is_real(wave.diameter, self.sector.sectors) { 1 } else { 2 };
            frequencies.extend(wave.modes.values.iter().step_by(step).map(|value| value.max(0.0).sqrt()));
            free += wave.modes.rigid_body_count() / step;
        }
        frequencies.sort_by(f64::total_cmp);
        SectorReduction { reduced, deviation, frequencies, free, up_to, serves, basis: None }
    }

    /// Builds one basis from the waves of these diameters.
    fn basis(
        &mut self,
        diameters: &[usize],
        (order, share): (usize, f64),
        kind: ReductionKind,
    ) -> Result<ReducedSector, ReductionError> {
        let extent = self.computed.iter().fold(0.0f64, |most, wave| most.max(wave.extent));
        let source = (diameters.to_vec(), order, extent);
        let vectors = match self.vectors.take() {
            Some(known) if known.source == source => known,
            _ => self.sector_vectors(source, kind)?,
        };
        let reduced = self.projected(vectors.kind.clone(), self.independent(&vectors, share));
        self.vectors = Some(vectors);
        Ok(reduced)
    }

    /// Collects the vectors of the waves of some diameters.
    fn sector_vectors(
        &mut self,
        source: (Vec<usize>, usize, f64),
        kind: ReductionKind,
    ) -> Result<SectorVectors, ReductionError> {
        let (diameters, order) = (&source.0, source.1);
        let n = self.sector.dofs;
        let (mut vectors, mut counts): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut modes = 0;
        let (sector, seen, blade) = (self.sector, self.seen, self.blade);
        let taken = self.computed.iter_mut().filter(|wave| diameters.contains(&wave.diameter));
        let own_vectors = try_map(taken, threads(), |wave| -> Result<_, ReductionError> {
            if !wave.has_vectors(order) || kind == ReductionKind::CraigBampton || blade.is_some() {
                wave.whole(|diameter| sector.wave(diameter, seen))?;
            }
            let of_blade = blade.map(|(blade, up_to)| wave.blade_vectors(blade, up_to, order, n)).transpose()?;
            let (diameter, modes) = (wave.diameter, wave.modes.count());
            let mut own = match kind {
                ReductionKind::Rubin => Cow::Borrowed(wave.vectors(order, n)?),
                ReductionKind::CraigBampton => Cow::Owned(wave.craig_bampton()?),
            };
            if let Some(of_blade) = of_blade {
                own.to_mut().extend(of_blade);
            }
            Ok((diameter, modes, own))
        })?;
        for (diameter, count, own) in own_vectors {
            vectors.extend_from_slice(&own);
            modes = modes.max(count);
            // a vector and its partner split into the same columns
            let both = kind == ReductionKind::Rubin && !is_real(diameter, sector.sectors);
            counts.resize(vectors.len() / n.max(1), if both { 2.0 } else { 1.0 });
        }
        let (weights, shares) = self.combinations(&vectors, &counts)?;
        let name = match kind {
            ReductionKind::Rubin => "modes and residual vectors",
            ReductionKind::CraigBampton => "Craig-Bampton",
        };
        let count = diameters.len();
        let differing = if self.blade.is_some() { ", with blade vectors" } else { "" };
        let modes = modes.div_ceil(2).max(1);
        let kind = format!("one sector: {name} of {count} nodal diameters, up to {modes} modes each{differing}");
        Ok(SectorVectors { source, kind, columns: vectors, weights, shares })
    }

    /// Returns the weights and shares of [`SectorVectors`]. A column counts as often as `counts`
    /// states.
    fn combinations(&self, vectors: &[f64], counts: &[f64]) -> Result<(DMatrix<f64>, Vec<f64>), ReductionError> {
        let highest =
            self.computed.iter().flat_map(|wave| wave.modes.values.last()).fold(0.0f64, |most, v| most.max(*v));
        let weighted =
            self.sector.mass.iter().map(|&(row, column, shift, value)| (row, column, shift, highest * value));
        let energy = self.sector.with_fixed_adjacent(self.sector.stiffness.iter().copied().chain(weighted))?;
        let energies = congruence(&energy, vectors);
        let size: Vec<f64> =
            energies.diagonal().iter().zip(counts).map(|(e, count)| (e.max(0.0) / count).sqrt()).collect();
        let moving: Vec<usize> = (0..size.len()).filter(|&k| size[k] > 0.0).collect();
        let gram = DMatrix::from_fn(moving.len(), moving.len(), |i, k| {
            let (i, k) = (moving[i], moving[k]);
            0.5 * (energies[(i, k)] + energies[(k, i)]) / (size[i] * size[k])
        });
        let eigen = eigen::symmetric(gram).ok_or(ReductionError::OutOfRange)?;
        let largest = eigen.eigenvalues.amax();
        let least = SIZES.iter().fold(1.0f64, |least, (_, share)| least.min(*share));
        let mut kept: Vec<usize> = (0..moving.len()).filter(|&k| eigen.eigenvalues[k] > least * largest).collect();
        kept.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let mut weights = DMatrix::zeros(size.len(), kept.len());
        for (column, &k) in kept.iter().enumerate() {
            for (i, &row) in moving.iter().enumerate() {
                weights[(row, column)] = eigen.eigenvectors[(i, k)] / (eigen.eigenvalues[k].sqrt() * size[row]);
            }
        }
        let shares = kept.iter().map(|&k| eigen.eigenvalues[k] / largest).collect();
        Ok((weights, shares))
    }

    /// Returns the combinations of which this share of the energy is independent of the others.
    /// Each is scaled to unit displacement at the port that moves most.
    fn independent(&self, vectors: &SectorVectors, share: f64) -> Vec<f64> {
        let n = self.sector.dofs;
        let count = vectors.shares.partition_point(|own| *own > share);
        let mut basis = multi_vector::combine(n, &vectors.columns, &vectors.weights.columns(0, count).into_owned());
        let seen: Vec<_> = self.seen.iter().map(|row| self.sector.row(row)).collect();
        for column in basis.chunks_exact_mut(n.max(1)) {
            let largest = column.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            let port = seen.iter().map(|row| row.iter().map(|(at, _, w)| w * column[*at]).sum::<f64>().abs());
            let port = port.fold(0.0, f64::max);
            let size = if port > super::UNSEEN * largest { port } else { largest };
            column.iter_mut().for_each(|x| *x /= size);
        }
        basis
    }

    fn projected(&self, kind: String, basis: Vec<f64>) -> ReducedSector {
        let sector = self.sector;
        let n = sector.dofs;
        let (mass, stiffness, damping) = &self.matrices;
        let mut ports = Vec::new();
        for (port, row) in self.seen.iter().enumerate() {
            for (k, column) in basis.chunks_exact(n.max(1)).enumerate() {
                for shift in [0, 1] {
                    let parts = sector.row(row).into_iter().filter(|part| part.1 == shift);
                    let weight: f64 = parts.map(|(at, _, weight)| weight * column[at]).sum();
                    if weight != 0.0 {
                        ports.push((port, k, shift, weight));
                    }
                }
            }
        }
        ReducedSector {
            kind,
            n,
            mass: mass.projected_symmetric(&basis),
            damping: damping.as_ref().map(|damping| damping.projected(&basis)),
            stiffness: stiffness.projected_symmetric(&basis),
            ports,
            port_count: self.seen.len(),
            basis,
            damped: Arc::default(),
        }
    }

    /// Returns the error of each wave of these diameters relative to the whole ring.
    fn deviations(
        &self,
        reduced: &ReducedSector,
        diameters: &[usize],
        up_to: f64,
    ) -> Result<Vec<(usize, ReductionDeviation)>, ReductionError> {
        let waves = self.computed.iter().filter(|wave| diameters.contains(&wave.diameter));
        try_map(waves, threads(), |wave| {
            let small = reduced.wave(wave.diameter, self.sector.sectors)?;
            let of_ports = wave.reference.as_ref().map(|reference| reference.deviation(&small));
            let own = small.frequencies().unwrap_or_default();
            let found = wave
                .modes
                .values
                .iter()
                .map(|value| value.max(0.0).sqrt())
                .enumerate()
                .skip(wave.modes.rigid_body_count());
            let shifts = found.take_while(|(_, omega)| *omega <= up_to).map(|(k, omega)| {
                let error = own.get(k).map_or(f64::INFINITY, |own| (own / omega - 1.0).abs() / HALF_WIDTH);
                ReductionDeviation { error, omega }
            });
            Ok((wave.diameter, largest(shifts.chain(of_ports))))
        })
    }
}

/// Returns the first of the largest errors.
fn largest(all: impl Iterator<Item = ReductionDeviation>) -> ReductionDeviation {
    let none = ReductionDeviation { error: 0.0, omega: 0.0 };
    all.fold(none, |worst, one| if one.error > worst.error { one } else { worst })
}

impl ReducedSector {
    /// Returns the number of coordinates of a sector.
    pub fn dofs(&self) -> usize {
        self.basis.len() / self.n.max(1)
    }

    /// Returns the damping within every sector and between any two sectors, for damping that
    /// depends on modes. The last result is kept.
    pub fn damped(&self, by: &StructureDamping, sectors: usize) -> Result<Arc<Vec<RingEntry>>, ReductionError> {
        let mut kept = self.damped.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((law, of, damping)) = &*kept
            && (law, *of) == (by, sectors)
        {
            return Ok(damping.clone());
        }
        let damping = Arc::new(self.compute_damping(by, sectors)?);
        *kept = Some((by.clone(), sectors, damping.clone()));
        Ok(damping)
    }

    fn compute_damping(&self, by: &StructureDamping, sectors: usize) -> Result<Vec<RingEntry>, ReductionError> {
        by.check()?;
        let r = self.dofs();
        if let StructureDamping::Rayleigh { mass, stiffness } = *by {
            let of = |entries: &[RingEntry], factor: f64| -> Vec<RingEntry> {
                entries.iter().map(|&(row, column, shift, value)| (row, column, shift, factor * value)).collect()
            };
            return Ok([of(&self.mass, mass), of(&self.stiffness, stiffness)].concat());
        }
        // damping by the modes of every wave; C of a sector is the phase-weighted mean over the
        // waves
        let mut between = vec![DMatrix::<f64>::zeros(r, r); sectors];
        let waves = try_map(0..=sectors / 2, threads(), |diameter| {
            let wave = self.wave(diameter, sectors)?;
            damping(by, &wave.mass, &wave.stiffness, None)
        })?;
        for (diameter, own) in waves.into_iter().enumerate() {
            let real = is_real(diameter, sectors);
            let share = if real { 1.0 } else { 2.0 } / sectors as f64;
            for (shift, sum) in between.iter_mut().enumerate() {
                let phase = unit_root(-((diameter * shift) as i64), sectors);
                *sum += own.view((0, 0), (r, r)) * (phase.re * share);
                if !real {
                    *sum -= own.view((r, 0), (r, r)) * (phase.im * share);
                }
            }
        }
        // symmetric in all digits: the damping towards a sector is that of the sector towards it
        let mean = |shift: usize, at: (usize, usize)| {
            0.5 * (between[shift][at] + between[(sectors - shift) % sectors][(at.1, at.0)])
        };
        let mut entries = Vec::with_capacity(r * r * sectors);
        for at in (0..r).flat_map(|row| (0..r).map(move |column| (row, column))) {
            entries.extend((0..sectors).map(|shift| (at.0, at.1, shift as i64, mean(shift, at))));
        }
        Ok(entries)
    }

    /// Returns the reduced structure in a wave.
    pub(super) fn wave(&self, diameter: usize, sectors: usize) -> Result<ReducedMatrices, ReductionError> {
        let r = self.dofs();
        let copies = if is_real(diameter, sectors) { 1 } else { 2 };
        let matrix = |entries: &[RingEntry], rows: usize| {
            let mut sum = DMatrix::zeros(copies * rows, copies * r);
            for (row, column, value) in wave_entries(entries.iter().copied(), [rows, r], diameter, sectors) {
                sum[(row, column)] += value;
            }
            sum
        };
        let mass = matrix(&self.mass, r);
        Ok(ReducedMatrices {
            kind: String::new(),
            damping: self.damping.as_ref().map_or_else(|| &mass * 0.0, |own| matrix(own, r)),
            stiffness: matrix(&self.stiffness, r),
            ports: matrix(&self.ports, self.port_count),
            mass,
            basis: Arc::default(),
            weights: DMatrix::zeros(0, 0),
            n: 0,
        })
    }
}
