//! A ring whose blades differ, in its own modes.
//!
//! In few coordinates of every sector the ring has `K + ΔK`, which couples neighbours, and M. Its modes are near the space of those of the tuned ring, the
//! nominal modes, which one sector tells wave by wave. From these a subspace iteration leads to them, `Y = A⁻¹MX` with `A = K + ΔK + σM`, and X the
//! modes that the ring has in the space of Y, until those up to the frequency of interest stand still and are as many as there are; modes beyond that are
//! taken along speed it up. The
//! factor of A is one for all steps and grows with the number of sectors alone. What all other modes answer at the places are residual vectors, `A⁻¹Wᵀ`
//! without what the modes have of it. In both together the matrices are made diagonal, so that nothing is factored at any frequency of a response.
//!
//! Sources: Bathe and Wilson (1972), "Large eigenvalue problems in dynamic analysis", J. Eng. Mech. Div. ASCE 98, 1471-1485; Yang and Griffin (2001), "A
//! reduced-order model of mistuning using a subset of nominal system modes", J. Eng. Gas Turbines Power 123, 893-900; Rubin as in `free`.

use super::evidence::sign;
use super::free::{DEPENDENT, leading};
use super::mistuned::{FREE, shift};
use super::ring::HALF_WIDTH;
use super::{Damping, Deviation, ReducedSector, ReductionError, Row, UNSEEN, natural, product, symmetric};
use crate::structure::sector::is_real;
use crate::structure::{RingEntry, turn};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;
use stickslip_numerics::eigen;
use stickslip_numerics::sparse::{Analysis, Factor, Matrix, ModesError, columns};

/// Modes of the tuned ring up to these multiples of the frequency of interest begin, as they are tried: those beyond what is of interest leave to the
/// residual vectors what is nearly at rest. With one and a half sixty steel strips erred by 8.5e-5 at resonances, with three by 4e-6.
pub(in crate::structure) const EXTENTS: [f64; 2] = [3.0, 6.0];
/// Relative change of an eigenvalue by a step at which it stands still: the next changes it by a hundredth of that, as the modes that are left out have
/// nine times its eigenvalue, an error of 1e-7 at a resonance of the half width for which errors are said.
const SETTLED: f64 = 1e-5 * HALF_WIDTH;
/// Steps at most: three or four are usual.
const STEPS: usize = 40;
/// Inertia of a mode by its stiffness, relative to the largest, below which it has none.
const MASSLESS: f64 = 1e-14;

/// A ring in few coordinates of every sector, tuned, and where its modes are sought from.
#[derive(Debug)]
pub(in crate::structure) struct NominalRing {
    sector: Arc<ReducedSector>,
    sectors: usize,
    /// Of interest up to there, rad/s.
    up_to: f64,
    mass: Matrix,
    damping: Option<Matrix>,
    stiffness: Matrix,
    /// What a share of a blade's stiffness adds to its sector.
    of_blade: Vec<(usize, usize, f64)>,
    analysis: Analysis,
    /// Modes of the tuned ring up to the first of [`EXTENTS`], by columns.
    nominal: Vec<f64>,
    /// What is seen in every sector, one after the other.
    seen: Vec<Row>,
}

/// The modes of the ring with its blades differing.
pub(in crate::structure) struct Mixed {
    /// λ, rad²/s², rising: exact in the coordinates as far as they are of interest.
    pub values: Vec<f64>,
    /// Over the coordinates of all sectors, of unit mass.
    pub shapes: Vec<f64>,
    factor: Factor,
    /// At the highest frequency of interest.
    at_highest: Factor,
}

/// A ring in its own modes, each of a metre where most is seen of it.
#[derive(Debug)]
pub(crate) struct RingModes {
    /// For people.
    pub kind: String,
    /// Modal mass and stiffness.
    pub own: Vec<[f64; 2]>,
    /// Of a damping matrix.
    damping: Option<DMatrix<f64>>,
    /// What is seen in every sector, one after the other, by modes.
    pub seen: DMatrix<f64>,
}

impl NominalRing {
    /// Of a sector with a blade of this stiffness over its coordinates, up to `up_to` rad/s.
    pub fn new(
        sector: &Arc<ReducedSector>,
        of_blade: Vec<(usize, usize, f64)>,
        sectors: usize,
        up_to: f64,
    ) -> Result<Self, ReductionError> {
        let r = sector.dofs();
        let ring = |entries: &[RingEntry]| around(entries, [r, r], sectors);
        let matrix = |entries: &[RingEntry]| {
            Matrix::from_triplets(sectors * r, ring(entries)).map_err(|_| ReductionError::OutOfRange)
        };
        let (mass, stiffness) = (matrix(&sector.mass)?, matrix(&sector.stiffness)?);
        let damping = sector.damping.as_ref().map(|own| matrix(own)).transpose()?;
        let blades = all_blades(&of_blade, &vec![1.0; sectors], r)?;
        let analysis = Analysis::new(&[&stiffness, &mass, &blades]);
        let mut seen = vec![Row::new(); sectors * sector.port_count];
        for (port, at, weight) in around(&sector.ports, [sector.port_count, r], sectors) {
            seen[port].push((at, weight));
        }
        let nominal = nominal_modes(sector, sectors, EXTENTS[0] * up_to)?;
        let sector = sector.clone();
        Ok(NominalRing { sector, sectors, up_to, mass, damping, stiffness, of_blade, analysis, nominal, seen })
    }

    /// The modes of the ring with these deviations of its blades, sought from those up to one of [`EXTENTS`].
    pub fn mixed(&self, deviations: &[f64], extent: f64) -> Result<Mixed, ReductionError> {
        let (n, highest, shift) = (self.mass.n(), self.up_to * self.up_to, shift(self.up_to));
        let blades = all_blades(&self.of_blade, deviations, self.sector.dofs())?;
        let sum = [(1.0, &self.stiffness), (1.0, &blades), (shift, &self.mass)];
        let factor = self.analysis.factor(&sum);
        let factor = factor.map_err(|singular| ReductionError::Singular { omega: 0.0, singular })?;
        if factor.negative() > 0 {
            return Err(ModesError::Negative { count: factor.negative(), below: -shift }.into());
        }
        let mut shapes = match extent > EXTENTS[0] {
            true => nominal_modes(&self.sector, self.sectors, extent * self.up_to)?,
            false => self.nominal.clone(),
        };
        let (mut values, mut begun): (Vec<f64>, bool) = (Vec::new(), false);
        for _ in 0..STEPS {
            let forces = self.mass.times_columns(&shapes);
            let mut moved = forces.clone();
            factor.solve(&mut moved);
            let held = columns::products(n, &moved, &forces);
            let mass = columns::products(n, &moved, &self.mass.times_columns(&moved));
            // the largest has the lowest frequency
            let found = eigen::symmetric_pair(&symmetric(mass), &symmetric(held)).ok_or(ReductionError::OutOfRange)?;
            let rising: Vec<usize> = (0..found.0.len()).rev().collect();
            let thetas: Vec<f64> = rising.iter().map(|&k| found.0[k]).collect();
            let mut mixing = found.1.select_columns(&rising);
            for (mut column, theta) in mixing.column_iter_mut().zip(&thetas) {
                column.unscale_mut(theta.sqrt());
            }
            shapes = columns::combination(n, &moved, &mixing);
            let before = std::mem::replace(&mut values, thetas.iter().map(|theta| 1.0 / theta - shift).collect());
            let stands = |(now, before): (&f64, &f64)| (now - before).abs() <= SETTLED * (now + shift);
            let inside = values.partition_point(|value| *value <= highest);
            if !std::mem::replace(&mut begun, true) || !values.iter().zip(&before).take(inside).all(stands) {
                continue;
            }
            // so many eigenvalues lie below as the factor has negative pivots
            let sum = [(1.0, &self.stiffness), (1.0, &blades), (-highest, &self.mass)];
            let at_highest = self.analysis.factor(&sum);
            let singular = |singular| ReductionError::Singular { omega: self.up_to, singular };
            let at_highest = at_highest.map_err(singular)?;
            if at_highest.negative() == inside {
                return Ok(Mixed { values, shapes, factor, at_highest });
            }
        }
        let found = values.partition_point(|value| *value <= highest);
        Err(ModesError::NotConverged { found: 0, counted: found, below: highest }.into())
    }

    /// The ring in its own modes, and what residual vectors leave out: the relative error of the answer to loads on everything that is seen, where it is
    /// largest, at the highest frequency of interest.
    pub fn modes(&self, mixed: &Mixed) -> Result<(RingModes, Deviation), ReductionError> {
        let (n, ports, shift) = (self.mass.n(), self.seen.len(), shift(self.up_to));
        let Mixed { values, shapes, factor, at_highest } = mixed;
        let low = values.len();
        // modes of unit A, and residual vectors, free of them in A
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
        columns::add(n, &mut moved, -1.0, shapes, &answered);
        let flexible = self.rows_of(&moved);
        let independent = independent(&flexible, &whole)?;
        // inertia of both, over vectors of unit A
        let heavy = self.mass.times_columns(&moved);
        let mut coupling = product(&columns::products(n, shapes, &heavy), &independent);
        for (mut row, root) in coupling.row_iter_mut().zip(&root) {
            row.unscale_mut(*root);
        }
        let residual = product(&independent.transpose(), &product(&columns::products(n, &moved, &heavy), &independent));
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
        let (thetas, mixing) = eigen::symmetric_in_blocks(&inertia).ok_or(ReductionError::OutOfRange)?;
        let [of_modes, of_rest] = [mixing.rows(0, low), mixing.rows(low, all - low)].map(|rows| rows.into_owned());
        let seen_rest = product(&flexible, &independent);
        let mut seen = product(&seen_low, &of_modes) + product(&seen_rest, &of_rest);
        let most = thetas.last().copied().unwrap_or(0.0);
        let mut own: Vec<[f64; 2]> = thetas.iter().map(|theta| self.own(*theta, most)).collect();
        // coordinates that are seen nowhere have the size that their coordinates may have at most
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
        let error = self.left_out((&own, &seen), &whole, at_highest);
        let damping = self.damping.as_ref().map(|damping| {
            let mut of_modes = of_modes;
            for (mut row, root) in of_modes.row_iter_mut().zip(&root) {
                row.unscale_mut(*root);
            }
            let mut whole = columns::combination(n, shapes, &of_modes);
            columns::add(n, &mut whole, 1.0, &moved, &product(&independent, &of_rest));
            whole
                .chunks_exact_mut(n.max(1))
                .zip(&sizes)
                .for_each(|(column, size)| column.iter_mut().for_each(|x| *x /= size));
            columns::products(n, &whole, &damping.times_columns(&whole))
        });
        let kind = format!("modes of the mistuned ring; {}", self.sector.kind);
        Ok((RingModes { kind, own, damping, seen }, Deviation { error, omega: self.up_to }))
    }

    /// The relative error of modes and what is seen of them, under loads of random signs, each place by its flexibility.
    fn left_out(&self, (own, seen): (&[[f64; 2]], &DMatrix<f64>), flexibility: &[f64], at_highest: &Factor) -> f64 {
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
        // what is no number is no small error
        if error.is_nan() { f64::INFINITY } else { error }
    }

    /// Modal mass and stiffness of unit A, of a mode with this mass.
    fn own(&self, theta: f64, most: f64) -> [f64; 2] {
        if theta <= MASSLESS * most {
            return [0.0, 1.0];
        }
        let stiffness = 1.0 - shift(self.up_to) * theta;
        // rounding would hold a free motion, and a constant load find its balance kilometres away
        let free = stiffness < (FREE * self.up_to).powi(2) * theta;
        [theta, if free { 0.0 } else { stiffness }]
    }

    /// What is seen of columns.
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
    /// Damping between the modes, as (row, column, value).
    pub fn damped(&self, by: Option<&Damping>) -> Result<Vec<(usize, usize, f64)>, ReductionError> {
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

/// The modes of all waves of a tuned ring up to `highest`, rad/s, over the coordinates of all sectors: `x_s = c Re(a e^{jdθs})`, `c² = 2/N`, or `1/N` of
/// a wave that does not travel.
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
                let phase = turn((diameter * s) as i64, sectors) * scale;
                all.extend((0..r).map(|i| match real {
                    true => shapes[(i, k)] * phase.re,
                    false => shapes[(i, k)] * phase.re - shapes[(r + i, k)] * phase.im,
                }));
            }
        }
    }
    Ok(all)
}

/// Combinations of residual vectors that are independent and of unit stiffness, by their flexibility at the places and that of the whole ring.
fn independent(flexible: &DMatrix<f64>, whole: &[f64]) -> Result<DMatrix<f64>, ReductionError> {
    let moving: Vec<usize> = (0..whole.len()).filter(|&k| flexible[(k, k)] > DEPENDENT * whole[k]).collect();
    let size: Vec<f64> = moving.iter().map(|&k| flexible[(k, k)].sqrt()).collect();
    let gram = DMatrix::from_fn(moving.len(), moving.len(), |i, k| {
        let (a, b) = (moving[i], moving[k]);
        0.5 * (flexible[(a, b)] + flexible[(b, a)]) / (size[i] * size[k])
    });
    if moving.is_empty() {
        return Ok(DMatrix::zeros(whole.len(), 0));
    }
    let few = leading(&gram).ok_or(ReductionError::OutOfRange)?;
    let mut weights = DMatrix::zeros(whole.len(), few.ncols());
    for (i, &row) in moving.iter().enumerate() {
        weights.set_row(row, &(few.row(i) / size[i]));
    }
    Ok(weights)
}

/// Entries of all sectors, of so many rows and columns each.
fn around(entries: &[RingEntry], [rows, of]: [usize; 2], sectors: usize) -> Vec<(usize, usize, f64)> {
    let next = |s: usize, shift: i64| (s as i64 + shift).rem_euclid(sectors as i64) as usize;
    let all = (0..sectors).flat_map(|s| entries.iter().map(move |entry| (s, entry)));
    all.map(|(s, &(row, column, shift, value))| (s * rows + row, next(s, shift) * of + column, value)).collect()
}

/// What deviations of all blades add to the stiffness.
fn all_blades(of_blade: &[(usize, usize, f64)], deviations: &[f64], dofs: usize) -> Result<Matrix, ReductionError> {
    let all = deviations.iter().enumerate().flat_map(|(s, deviation)| {
        of_blade.iter().map(move |&(row, column, value)| (s * dofs + row, s * dofs + column, deviation * value))
    });
    Matrix::from_triplets(deviations.len() * dofs, all).map_err(|_| ReductionError::OutOfRange)
}

fn along(row: &Row, column: &[f64]) -> f64 {
    row.iter().map(|(at, weight)| weight * column[*at]).sum()
}
