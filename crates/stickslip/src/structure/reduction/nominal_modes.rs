//! A ring with different blades, in its own modes.
//!
//! In the reduced coordinates of every sector, the ring has the mass matrix M and the stiffness
//! `K + ΔK`, which couples adjacent sectors. Its modes are close to the space of the nominal
//! modes, those of the tuned ring, which one sector yields wave by wave.
//!
//! A subspace iteration starts from them: `Y = A⁻¹MX` with `A = K + ΔK + σM`, where X are the
//! modes of the ring in the space of Y. It ends when all modes up to the frequency of interest
//! have converged and their number is correct. Additional modes above that frequency accelerate
//! convergence. All steps use one factorization of A, whose cost grows only with the number of
//! sectors.
//!
//! Residual vectors, `A⁻¹Wᵀ` without their modal part, represent all other modes at the places.
//! Both together diagonalize the matrices, so that a response needs no factorization at any
//! frequency.
//!
//! Sources: Bathe and Wilson (1972), "Large eigenvalue problems in dynamic analysis", J. Eng.
//! Mech. Div. ASCE 98, 1471-1485; Yang and Griffin (2001), "A reduced-order model of mistuning
//! using a subset of nominal system modes", J. Eng. Gas Turbines Power 123, 893-900; Rubin as
//! in `free`.

use super::cyclic_basis::HALF_WIDTH;
use super::mistuning_error::{FREE, shift};
use super::receptance_error::sign;
use super::rubin::{DEPENDENCE_TOLERANCE, independent_eigenvectors};
use super::{
    ReducedSector, ReductionDeviation, ReductionError, Row, StructureDamping, UNSEEN, natural, product, symmetric,
};
use crate::structure::sector::is_real;
use crate::structure::{RingEntry, unit_root};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;
use stickslip_numerics::eigen;
use stickslip_numerics::sparse::{LdlFactor, ModesError, SparseMatrix, SymbolicAnalysis, multi_vector};

/// Multiples of the frequency of interest up to which modes of the tuned ring start the
/// iteration. Modes above that frequency leave an almost static remainder to the residual
/// vectors. Sixty steel strips had an error of 8.5e-5 at resonances with a multiple of 1.5, and
/// 4e-6 with 3.
pub(in crate::structure) const EXTENTS: [f64; 2] = [3.0, 6.0];

/// A tuned ring in reduced coordinates of every sector, with the start of the iteration for its
/// modes.
#[derive(Debug)]
pub(in crate::structure) struct NominalRing {
    sector: Arc<ReducedSector>,
    sectors: usize,
    /// Highest frequency of interest, rad/s.
    up_to: f64,
    mass: SparseMatrix,
    damping: Option<SparseMatrix>,
    stiffness: SparseMatrix,
    /// Stiffness of a sector per unit relative deviation of its blade.
    of_blade: Vec<(usize, usize, f64)>,
    analysis: SymbolicAnalysis,
    /// Modes of the tuned ring up to the first of [`EXTENTS`], by columns.
    nominal: Vec<f64>,
    /// Observed displacements of every sector, one sector after the other.
    seen: Vec<Row>,
}

/// The modes of the ring with different blades.
pub(in crate::structure) struct MistunedModes {
    /// λ, rad²/s², ascending. They are exact in the coordinates up to the frequency of
    /// interest.
    pub values: Vec<f64>,
    /// Shapes of unit mass over the coordinates of all sectors.
    pub shapes: Vec<f64>,
    factor: LdlFactor,
    /// Factor at the highest frequency of interest.
    at_highest: LdlFactor,
}

/// A ring in its own modes, each scaled to one metre at the place that moves most.
#[derive(Debug)]
pub(crate) struct RingModes {
    /// Description of the reduction.
    pub kind: String,
    /// Modal mass and stiffness.
    pub own: Vec<[f64; 2]>,
    /// Modal damping from a damping matrix.
    damping: Option<DMatrix<f64>>,
    /// Observed displacements of every sector, one sector after the other, by modes.
    pub seen: DMatrix<f64>,
    /// Shapes of the modes, if they were asked for.
    pub shapes: Option<RingShapes>,
}

/// Shapes of the modes of a ring.
#[derive(Debug, Clone)]
pub(crate) struct RingShapes {
    /// The sector whose coordinates they use.
    pub sector: Arc<ReducedSector>,
    /// One column per mode, over the coordinates of all sectors.
    pub columns: Arc<DMatrix<f64>>,
}

impl NominalRing {
    /// Creates the ring from a sector and the stiffness of its blade over the coordinates, for
    /// frequencies up to `up_to` rad/s.
    pub fn new(
        sector: &Arc<ReducedSector>,
        of_blade: Vec<(usize, usize, f64)>,
        sectors: usize,
        up_to: f64,
    ) -> Result<Self, ReductionError> {
        let r = sector.dofs();
        let ring = |entries: &[RingEntry]| around(entries, [r, r], sectors);
        let matrix = |entries: &[RingEntry]| {
            SparseMatrix::from_triplets(sectors * r, ring(entries)).map_err(|_| ReductionError::OutOfRange)
        };
        let (mass, stiffness) = (matrix(&sector.mass)?, matrix(&sector.stiffness)?);
        let damping = sector.damping.as_ref().map(|own| matrix(own)).transpose()?;
        let blades = all_blades(&of_blade, &vec![1.0; sectors], r)?;
        let analysis = SymbolicAnalysis::new(&[&stiffness, &mass, &blades]);
        let mut seen = vec![Row::new(); sectors * sector.port_count];
        for (port, at, weight) in around(&sector.ports, [sector.port_count, r], sectors) {
            seen[port].push((at, weight));
        }
        let nominal = nominal_modes(sector, sectors, EXTENTS[0] * up_to)?;
        let sector = sector.clone();
        Ok(NominalRing { sector, sectors, up_to, mass, damping, stiffness, of_blade, analysis, nominal, seen })
    }

    /// Returns the modes of the ring with these blade deviations. The iteration starts from
    /// nominal modes up to `extent`, one of [`EXTENTS`].
    pub fn mistuned_modes(&self, deviations: &[f64], extent: f64) -> Result<MistunedModes, ReductionError> {
        let (n, highest, shift) = (self.mass.n(), self.up_to * self.up_to, shift(self.up_to));
        let blades = all_blades(&self.of_blade, deviations, self.sector.dofs())?;
        let sum = [(1.0, &self.stiffness), (1.0, &blades), (shift, &self.mass)];
        let factor = self.analysis.factor(&sum);
        let factor = factor.map_err(|singular| ReductionError::Singular { omega: 0.0, singular })?;
        if factor.negative_pivots() > 0 {
            return Err(ModesError::Negative { count: factor.negative_pivots(), below: -shift }.into());
        }
        let mut shapes = match extent > EXTENTS[0] {
            true => nominal_modes(&self.sector, self.sectors, extent * self.up_to)?,
            false => self.nominal.clone(),
        };
        let (mut values, mut begun): (Vec<f64>, bool) = (Vec::new(), false);
        // Largest number of steps; three or four are typical.
        for _ in 0..40 {
            let forces = self.mass.multiply_columns(&shapes);
            let mut moved = forces.clone();
            factor.solve(&mut moved);
            let held = multi_vector::inner_products(n, &moved, &forces);
            let mass = multi_vector::inner_products(n, &moved, &self.mass.multiply_columns(&moved));
            // the largest θ has the lowest frequency
            let found =
                eigen::generalized_symmetric(&symmetric(mass), &symmetric(held)).ok_or(ReductionError::OutOfRange)?;
            let rising: Vec<usize> = (0..found.0.len()).rev().collect();
            let thetas: Vec<f64> = rising.iter().map(|&k| found.0[k]).collect();
            let mut mixing = found.1.select_columns(&rising);
            for (mut column, theta) in mixing.column_iter_mut().zip(&thetas) {
                column.unscale_mut(theta.sqrt());
            }
            shapes = multi_vector::combine(n, &moved, &mixing);
            let before = std::mem::replace(&mut values, thetas.iter().map(|theta| 1.0 / theta - shift).collect());
            // Relative change of an eigenvalue in one step at which it counts as converged. The
            // next step changes it by about a hundredth of that, because the omitted modes have
            // nine times its eigenvalue. This is an error of 1e-7 at a resonance of half width
            // `HALF_WIDTH`.
            let stands = |(now, before): (&f64, &f64)| (now - before).abs() <= (1e-5 * HALF_WIDTH) * (now + shift);
            let inside = values.partition_point(|value| *value <= highest);
            if !std::mem::replace(&mut begun, true) || !values.iter().zip(&before).take(inside).all(stands) {
                continue;
            }
            // the number of negative pivots is the number of eigenvalues below
            let sum = [(1.0, &self.stiffness), (1.0, &blades), (-highest, &self.mass)];
            let at_highest = self.analysis.factor(&sum);
            let singular = |singular| ReductionError::Singular { omega: self.up_to, singular };
            let at_highest = at_highest.map_err(singular)?;
            if at_highest.negative_pivots() == inside {
                return Ok(MistunedModes { values, shapes, factor, at_highest });
            }
        }
        let found = values.partition_point(|value| *value <= highest);
        Err(ModesError::NotConverged { found: 0, counted: found, below: highest }.into())
    }

    /// Returns the ring in its own modes, with the error of the residual vectors.
    ///
    /// The error is that of the response to loads on all observed displacements. It is
    /// evaluated at the highest frequency of interest, where it is largest.
    pub fn modes(
        &self,
        mixed: &MistunedModes,
        with_shapes: bool,
    ) -> Result<(RingModes, ReductionDeviation), ReductionError> {
        let (n, ports, shift) = (self.mass.n(), self.seen.len(), shift(self.up_to));
        let MistunedModes { values, shapes, factor, at_highest } = mixed;
        let low = values.len();
        // modes normalized in A, and residual vectors orthogonal to them in A
        let root: Vec<f64> = values.iter().map(|value| (value + shift).sqrt()).collect();
        let mut moved = vec![0.0; n * ports];
        for (column, row) in moved.chunks_exact_mut(n.max(1)).zip(&self.seen) {
            row.iter().for_each(|(at, weight)| column[*at] += weight);
        }
        factor.solve(&mut moved);
        let mut seen_low = self.rows_of(shapes);
        for (mut column, root) in seen_low.column_iter_mut().zip(&root) {
            column.unscale_mut(*root);
        }
        let whole: Vec<f64> =
            self.seen.iter().zip(moved.chunks_exact(n.max(1))).map(|(row, x)| along(row, x)).collect();
        let mut answered = seen_low.transpose();
        for (mut row, root) in answered.row_iter_mut().zip(&root) {
            row.unscale_mut(*root);
        }
        multi_vector::add(n, &mut moved, -1.0, shapes, &answered);
        let flexible = self.rows_of(&moved);
        let independent = independent(&flexible, &whole)?;
        // inertia of both, over vectors normalized in A
        let heavy = self.mass.multiply_columns(&moved);
        let mut coupling = product(&multi_vector::inner_products(n, shapes, &heavy), &independent);
        for (mut row, root) in coupling.row_iter_mut().zip(&root) {
            row.unscale_mut(*root);
        }
        let residual =
            product(&independent.transpose(), &product(&multi_vector::inner_products(n, &moved, &heavy), &independent));
        let all = low + independent.ncols();
        let inertia = DMatrix::from_fn(all, all, |i, k| match (i.min(k), i.max(k)) {
            (i, k) if k < low => {
                if i == k {
                    1.0 / (root[i] * root[i])
                } else {
                    0.0
                }
            }
            (i, k) if i < low => coupling[(i, k - low)],
            (i, k) => 0.5 * (residual[(i - low, k - low)] + residual[(k - low, i - low)]),
        });
        let (thetas, mixing) = eigen::symmetric_blocked(&inertia).ok_or(ReductionError::OutOfRange)?;
        let [of_modes, of_rest] = [mixing.rows(0, low), mixing.rows(low, all - low)].map(|rows| rows.into_owned());
        let seen_rest = product(&flexible, &independent);
        let mut seen = product(&seen_low, &of_modes) + product(&seen_rest, &of_rest);
        let most = thetas.last().copied().unwrap_or(0.0);
        let mut own: Vec<[f64; 2]> = thetas.iter().map(|theta| self.own(*theta, most)).collect();
        // unobserved modes are scaled by an upper bound of their coordinates
        let reach = |shape: &[f64]| shape.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let reach: Vec<f64> =
            shapes.chunks_exact(n.max(1)).zip(&root).map(|(shape, root)| reach(shape) / root).collect();
        let sizes: Vec<f64> = (0..all)
            .map(|k| {
                let bound: f64 = of_modes.column(k).iter().zip(&reach).map(|(x, reach)| x.abs() * reach).sum();
                let port = if ports > 0 { seen.column(k).amax() } else { 0.0 };
                if port > UNSEEN * bound { port } else { bound }
            })
            .map(|size| if size > 0.0 { size } else { 1.0 })
            .collect();
        for (k, size) in sizes.iter().enumerate() {
            seen.column_mut(k).unscale_mut(*size);
            own[k].iter_mut().for_each(|of| *of /= size * size);
        }
        let error = self.residual_error((&own, &seen), &whole, at_highest);
        let whole = (with_shapes || self.damping.is_some()).then(|| {
            let mut of_modes = of_modes;
            for (mut row, root) in of_modes.row_iter_mut().zip(&root) {
                row.unscale_mut(*root);
            }
            let mut whole = multi_vector::combine(n, shapes, &of_modes);
            multi_vector::add(n, &mut whole, 1.0, &moved, &product(&independent, &of_rest));
            whole
                .chunks_exact_mut(n.max(1))
                .zip(&sizes)
                .for_each(|(column, size)| column.iter_mut().for_each(|x| *x /= size));
            whole
        });
        let damping = self.damping.as_ref().zip(whole.as_ref());
        let damping =
            damping.map(|(damping, whole)| multi_vector::inner_products(n, whole, &damping.multiply_columns(whole)));
        let kind = format!("modes of the mistuned ring; {}", self.sector.kind);
        let shapes = whole.filter(|_| with_shapes).map(|whole| RingShapes {
            sector: self.sector.clone(),
            columns: Arc::new(DMatrix::from_vec(n, all, whole)),
        });
        Ok((RingModes { kind, own, damping, seen, shapes }, ReductionDeviation { error, omega: self.up_to }))
    }

    /// Returns the relative error of a modal response under loads of random signs. Each place
    /// is scaled by its flexibility.
    fn residual_error(
        &self,
        (own, seen): (&[[f64; 2]], &DMatrix<f64>),
        flexibility: &[f64],
        at_highest: &LdlFactor,
    ) -> f64 {
        let scale = |place: usize| if flexibility[place] > 0.0 { flexibility[place].sqrt().recip() } else { 0.0 };
        let loads = DVector::from_fn(self.seen.len(), |place, _| sign(place) * scale(place));
        let mut moved = vec![0.0; self.mass.n()];
        for (row, load) in self.seen.iter().zip(loads.iter()) {
            row.iter().for_each(|(at, weight)| moved[*at] += weight * load);
        }
        at_highest.solve(&mut moved);
        let mut modal = seen.tr_mul(&loads);
        for (x, [mass, stiffness]) in modal.iter_mut().zip(own) {
            *x /= stiffness - self.up_to * self.up_to * mass;
        }
        let found = seen * modal;
        let (mut apart, mut all) = (0.0, 0.0);
        for (place, (row, found)) in self.seen.iter().zip(found.iter()).enumerate() {
            let exact = along(row, &moved);
            apart += (scale(place) * (found - exact)).powi(2);
            all += (scale(place) * exact).powi(2);
        }
        let error = if all > 0.0 { (apart / all).sqrt() } else { 0.0 };
        // NaN counts as an infinite error
        if error.is_nan() { f64::INFINITY } else { error }
    }

    /// Returns modal mass and stiffness, normalized in A, of a mode with mass `theta`.
    fn own(&self, theta: f64, most: f64) -> [f64; 2] {
        // Inertia of a mode relative to its stiffness, in units of the largest, below which it
        // has no mass.
        if theta <= 1e-14 * most {
            return [0.0, 1.0];
        }
        let stiffness = 1.0 - shift(self.up_to) * theta;
        // a nonzero value from rounding would restrain the free motion, and a constant load
        // would displace it by kilometres
        let free = stiffness < (FREE * self.up_to).powi(2) * theta;
        [theta, if free { 0.0 } else { stiffness }]
    }

    /// Returns the observed displacements of columns.
    fn rows_of(&self, columns: &[f64]) -> DMatrix<f64> {
        let n = self.mass.n();
        let mut rows = DMatrix::zeros(self.seen.len(), columns.len() / n.max(1));
        for (mut out, column) in rows.column_iter_mut().zip(columns.chunks_exact(n.max(1))) {
            out.iter_mut().zip(&self.seen).for_each(|(out, row)| *out = along(row, column));
        }
        rows
    }
}

impl RingModes {
    /// Returns the damping between the modes, as (row, column, value).
    pub fn damped(&self, by: Option<&StructureDamping>) -> Result<Vec<(usize, usize, f64)>, ReductionError> {
        let Some(by) = by else {
            let all = self
                .damping
                .iter()
                .flat_map(|own| (0..own.ncols()).flat_map(move |k| (0..own.nrows()).map(move |i| (i, k, own[(i, k)]))));
            return Ok(all.filter(|entry| entry.2 != 0.0).collect());
        };
        by.check()?;
        let (_, of_springs) = by.proportional().unwrap_or_default();
        let one = |[mass, stiffness]: [f64; 2]| match mass > 0.0 {
            true => mass * by.of_mode((stiffness / mass).sqrt()).unwrap_or(0.0),
            false => stiffness * of_springs,
        };
        Ok(self.own.iter().enumerate().map(|(k, own)| (k, k, one(*own))).collect())
    }
}

/// Returns the modes of all waves of a tuned ring up to `highest`, rad/s, over the coordinates
/// of all sectors: `x_s = c Re(a e^{jdθs})`, `c² = 2/N`, or `1/N` for a wave that does not
/// travel.
fn nominal_modes(sector: &ReducedSector, sectors: usize, highest: f64) -> Result<Vec<f64>, ReductionError> {
    let r = sector.dofs();
    let mut all = Vec::new();
    for diameter in 0..=sectors / 2 {
        let wave = sector.wave(diameter, sectors)?;
        let (values, shapes) = natural(&wave.mass, &wave.stiffness).ok_or(ReductionError::OutOfRange)?;
        let inside = values.partition_point(|value| *value <= highest * highest);
        let real = is_real(diameter, sectors);
        let scale = (if real { 1.0 } else { 2.0 } / sectors as f64).sqrt();
        for k in 0..inside {
            for s in 0..sectors {
                let phase = unit_root((diameter * s) as i64, sectors) * scale;
                all.extend((0..r).map(|i| match real {
                    true => shapes[(i, k)] * phase.re,
                    false => shapes[(i, k)] * phase.re - shapes[(r + i, k)] * phase.im,
                }));
            }
        }
    }
    Ok(all)
}

/// Returns independent combinations of residual vectors of unit stiffness, from their
/// flexibility at the places and that of the whole ring.
fn independent(flexible: &DMatrix<f64>, whole: &[f64]) -> Result<DMatrix<f64>, ReductionError> {
    let moving: Vec<usize> = (0..whole.len()).filter(|&k| flexible[(k, k)] > DEPENDENCE_TOLERANCE * whole[k]).collect();
    let size: Vec<f64> = moving.iter().map(|&k| flexible[(k, k)].sqrt()).collect();
    let gram = DMatrix::from_fn(moving.len(), moving.len(), |i, k| {
        let (a, b) = (moving[i], moving[k]);
        0.5 * (flexible[(a, b)] + flexible[(b, a)]) / (size[i] * size[k])
    });
    if moving.is_empty() {
        return Ok(DMatrix::zeros(whole.len(), 0));
    }
    let few = independent_eigenvectors(&gram).ok_or(ReductionError::OutOfRange)?;
    let mut weights = DMatrix::zeros(whole.len(), few.ncols());
    for (i, &row) in moving.iter().enumerate() {
        weights.set_row(row, &(few.row(i) / size[i]));
    }
    Ok(weights)
}

/// Returns the entries of all sectors, each of size `rows` by `of`.
fn around(entries: &[RingEntry], [rows, of]: [usize; 2], sectors: usize) -> Vec<(usize, usize, f64)> {
    let next = |s: usize, shift: i64| (s as i64 + shift).rem_euclid(sectors as i64) as usize;
    let all = (0..sectors).flat_map(|s| entries.iter().map(move |entry| (s, entry)));
    all.map(|(s, &(row, column, shift, value))| (s * rows + row, next(s, shift) * of + column, value)).collect()
}

/// Returns the change of stiffness due to the deviations of all blades.
fn all_blades(
    of_blade: &[(usize, usize, f64)],
    deviations: &[f64],
    dofs: usize,
) -> Result<SparseMatrix, ReductionError> {
    let all = deviations.iter().enumerate().flat_map(|(s, deviation)| {
        of_blade.iter().map(move |&(row, column, value)| (s * dofs + row, s * dofs + column, deviation * value))
    });
    SparseMatrix::from_triplets(deviations.len() * dofs, all).map_err(|_| ReductionError::OutOfRange)
}

fn along(row: &Row, column: &[f64]) -> f64 {
    row.iter().map(|(at, weight)| weight * column[*at]).sum()
}
