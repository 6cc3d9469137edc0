//! A ring whose blades differ, in the modes of the tuned one.
//!
//! A tuned ring moves in waves `x_s = c Re(a e^{jdθs})`, `θ = 2π/N`, and in the modes `a` of all of them its matrices are diagonal. Shares `δ_s` of
//! their stiffness `D` by which the blades deviate couple these modes by Fourier coefficients alone, `Δ_k = Σ_s δ_s e^{jkθs} / N`:
//!
//! `ΔK = c c' N/2 Re(aᵀ D a' Δ_{d+d'} + aᵀ D a'* Δ_{d-d'})`.
//!
//! A pattern of deviations costs one symmetric eigenvalue problem, and in the modes that it has the matrices are diagonal again. Every wave takes the modes up
//! to a multiple of the frequency of interest, and of all others their residual vectors: what they answer, as springs, at the places that are seen, and at the frequency of
//! the mode `a` to the forces `D a` of blades that deviate.
//!
//! Sources: Yang and Griffin (2001), "A reduced-order model of mistuning using a subset of nominal system modes", J. Eng. Gas Turbines Power 123,
//! 893-900; Feiner and Griffin (2002), "A fundamental model of mistuning for a single family of modes", J. Turbomach. 124, 597-605.

use super::mistuned::FREE;
use super::{Damping, Reduced, ReducedSector, ReductionError, UNSEEN, natural};
use crate::structure::sector::is_real;
use crate::structure::turn;
use nalgebra::DMatrix;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip_numerics::dense::multiply_in_blocks;
use stickslip_numerics::eigen;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);
/// Energy of what the forces of a blade move beside the modes that are taken, relative to that of its mode, below which it is left out: a deviation `δ` shifts
/// the frequency by half of `δ²` of it. At 5 % that is 1e-8, a hundred-thousandth of the half width for which errors are said.
const UNMOVED: f64 = 1e-5;

/// The modes of a wave that a ring is described by, of unit mass, or of unit stiffness where they have no mass.
#[derive(Debug)]
struct NominalWave {
    diameter: usize,
    /// `c`.
    scale: f64,
    /// Where they stand among those of the ring.
    first: usize,
    /// Real and imaginary parts of `a`, coordinates of a sector × modes.
    shapes: [DMatrix<f64>; 2],
    /// Of `D a`.
    forces: [DMatrix<f64>; 2],
}

/// A ring in the modes of its waves.
#[derive(Debug)]
pub(in crate::structure) struct NominalRing {
    /// The sector whose coordinates it has.
    pub(super) sector: Arc<ReducedSector>,
    pub(super) sectors: usize,
    /// Its error is asked for up to there, rad/s.
    pub(super) up_to: f64,
    waves: Vec<NominalWave>,
    /// Modal mass, 1 or 0, and stiffness.
    own: Vec<[f64; 2]>,
    /// Of a damping matrix.
    damping: Option<DMatrix<f64>>,
    /// What is seen in every sector, one after the other, by modes.
    seen: DMatrix<f64>,
    /// The largest coordinate of every mode, at most.
    reach: Vec<f64>,
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

/// The modes of a ring over those of its waves.
pub(in crate::structure) struct Mixed {
    /// Modal mass and stiffness, as [`NominalRing`] has them.
    pub own: Vec<[f64; 2]>,
    vectors: DMatrix<f64>,
}

impl NominalRing {
    /// Of a sector with a blade of this stiffness over its coordinates, up to `up_to` rad/s.
    pub fn new(
        reduced: &Arc<ReducedSector>,
        of_blade: &[(usize, usize, f64)],
        sectors: usize,
        up_to: f64,
    ) -> Result<Self, ReductionError> {
        let (r, ports) = (reduced.dofs(), reduced.port_count);
        let mut blade = DMatrix::zeros(r, r);
        of_blade.iter().for_each(|&(row, column, value)| blade[(row, column)] += value);
        let (mut waves, mut own, mut reach) = (Vec::new(), Vec::new(), Vec::new());
        let (mut rows, mut damping) = (Vec::new(), Vec::new());
        let mut natural_waves = Vec::new();
        for diameter in 0..=sectors / 2 {
            let reduced = reduced.wave(diameter, sectors)?;
            let (values, shapes) = natural(&reduced.mass, &reduced.stiffness).ok_or(ReductionError::OutOfRange)?;
            natural_waves.push(NaturalWave { reduced, values, shapes });
        }
        // blades that deviate couple every wave with every other
        let pushes: Vec<Push> = natural_waves.iter().flat_map(|wave| pushes(wave, &blade, up_to)).collect();
        for (diameter, wave) in natural_waves.iter().enumerate() {
            let (modes, shapes) = taken(wave, &pushes, reduced, up_to)?;
            let wave = &wave.reduced;
            let real = is_real(diameter, sectors);
            let parts = |matrix: &DMatrix<f64>, rows: usize| {
                let imaginary =
                    if real { DMatrix::zeros(rows, matrix.ncols()) } else { matrix.rows(rows, rows).into() };
                [matrix.rows(0, rows).into_owned(), imaginary]
            };
            let scale = (if real { 1.0 } else { 2.0 } / sectors as f64).sqrt();
            rows.push(parts(&(&wave.ports * &shapes), ports));
            if reduced.damping.is_some() {
                damping.push(shapes.tr_mul(&(&wave.damping * &shapes)));
            }
            let shapes = parts(&shapes, r);
            reach
                .extend((0..modes.len()).map(|k| scale * shapes[0].column(k).amax().hypot(shapes[1].column(k).amax())));
            let forces = shapes.each_ref().map(|part| &blade * part);
            waves.push(NominalWave { diameter, scale, first: own.len(), shapes, forces });
            own.extend(modes);
        }
        let n = own.len();
        let mut seen = DMatrix::zeros(sectors * ports, n);
        for (wave, [re, im]) in waves.iter().zip(&rows) {
            for (s, k, port) in all([sectors, re.ncols(), ports]) {
                let phase = wave.phase(s, sectors);
                seen[(s * ports + port, wave.first + k)] =
                    wave.scale * (re[(port, k)] * phase.re - im[(port, k)] * phase.im);
            }
        }
        let damping = reduced.damping.as_ref().map(|_| {
            let mut whole = DMatrix::zeros(n, n);
            for (wave, own) in waves.iter().zip(&damping) {
                whole.view_mut((wave.first, wave.first), own.shape()).copy_from(own);
            }
            whole
        });
        Ok(NominalRing { sector: reduced.clone(), sectors, up_to, waves, own, damping, seen, reach })
    }

    /// The modes of the ring with these deviations of its blades.
    pub fn mixed(&self, deviations: &[f64]) -> Result<Mixed, ReductionError> {
        let stiffness = self.stiffness(deviations);
        let found = match self.own.iter().all(|own| own[0] == 1.0) {
            true => eigen::symmetric_in_blocks(&stiffness),
            false => natural(
                &DMatrix::from_diagonal(&self.own.iter().map(|own| own[0]).collect::<Vec<_>>().into()),
                &stiffness,
            ),
        };
        let (values, vectors) = found.ok_or(ReductionError::OutOfRange)?;
        // rounding would hold a free motion, and a constant load find its balance kilometres away
        let own = values.into_iter().map(|value| modal(if value < (FREE * self.up_to).powi(2) { 0.0 } else { value }));
        Ok(Mixed { own: own.collect(), vectors })
    }

    /// Its lower triangle, and more.
    fn stiffness(&self, deviations: &[f64]) -> DMatrix<f64> {
        let sectors = self.sectors;
        let coefficients: Vec<Complex64> = (0..sectors)
            .map(|k| {
                let all =
                    deviations.iter().enumerate().map(|(s, deviation)| turn((k * s) as i64, sectors) * *deviation);
                all.sum::<Complex64>() / sectors as f64
            })
            .collect();
        let mut stiffness = DMatrix::from_diagonal(&self.own.iter().map(|own| own[1]).collect::<Vec<_>>().into());
        for (number, a) in self.waves.iter().enumerate() {
            for b in &self.waves[..=number] {
                let scale = 0.5 * sectors as f64 * a.scale * b.scale;
                let plus = coefficients[(a.diameter + b.diameter) % sectors] * scale;
                let minus = coefficients[a.diameter - b.diameter] * scale;
                // aᵀ D a' and aᵀ D a'*, each of four real products
                let mut add = |part: usize, of: usize, factor: f64| {
                    if factor != 0.0 {
                        let mut block = stiffness.view_mut((a.first, b.first), (a.count(), b.count()));
                        block.gemm_tr(factor, &a.shapes[part], &b.forces[of], 1.0);
                    }
                };
                add(0, 0, plus.re + minus.re);
                if !is_real(a.diameter, sectors) {
                    add(1, 0, -plus.im - minus.im);
                }
                if !is_real(b.diameter, sectors) {
                    add(0, 1, minus.im - plus.im);
                }
                if !is_real(a.diameter, sectors) && !is_real(b.diameter, sectors) {
                    add(1, 1, minus.re - plus.re);
                }
            }
        }
        stiffness
    }

    /// The ring in its own modes.
    pub fn modes(&self, mixed: Mixed) -> RingModes {
        let Mixed { mut own, mut vectors } = mixed;
        let n = own.len();
        let product = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
            let mut product = DMatrix::zeros(a.nrows(), b.ncols());
            multiply_in_blocks(a.as_slice(), b.as_slice(), product.as_mut_slice(), (a.nrows(), n, b.ncols()), false);
            product
        };
        let mut seen = product(&self.seen, &vectors);
        for (k, own) in own.iter_mut().enumerate() {
            let bound: f64 = vectors.column(k).iter().zip(&self.reach).map(|(x, reach)| x.abs() * reach).sum();
            let port = if seen.nrows() > 0 { seen.column(k).amax() } else { 0.0 };
            let size = if port > UNSEEN * bound { port } else { bound };
            if size > 0.0 {
                seen.column_mut(k).unscale_mut(size);
                vectors.column_mut(k).unscale_mut(size);
                own.iter_mut().for_each(|of| *of /= size * size);
            }
        }
        let damping = self.damping.as_ref().map(|own| product(&vectors.transpose(), &product(own, &vectors)));
        RingModes { kind: format!("modes of the ring by those of its waves; {}", self.sector.kind), own, damping, seen }
    }

    /// Forces on the modes of the waves from those on the coordinates of all sectors.
    fn along(&self, forces: &[Complex64]) -> Vec<Complex64> {
        let (r, sectors) = (self.sector.dofs(), self.sectors);
        let mut out = vec![ZERO; self.own.len()];
        for wave in &self.waves {
            // Re(a e^{jdθs})ᵀ f of all sectors
            let (mut cosine, mut sine) = (vec![ZERO; r], vec![ZERO; r]);
            for (s, forces) in forces.chunks_exact(r).enumerate() {
                let phase = wave.phase(s, sectors) * wave.scale;
                cosine.iter_mut().zip(forces).for_each(|(sum, force)| *sum += force * phase.re);
                sine.iter_mut().zip(forces).for_each(|(sum, force)| *sum += force * phase.im);
            }
            for k in 0..wave.count() {
                let [re, im] = wave.shapes.each_ref().map(|part| part.column(k));
                let pairs = cosine.iter().zip(&sine).zip(re.iter().zip(im.iter()));
                out[wave.first + k] = pairs.map(|((cosine, sine), (re, im))| cosine * *re - sine * *im).sum();
            }
        }
        out
    }

    /// The coordinates of all sectors from those of the modes of the waves.
    fn expanded(&self, modal: &[Complex64]) -> Vec<Complex64> {
        let (r, sectors) = (self.sector.dofs(), self.sectors);
        let mut out = vec![ZERO; r * sectors];
        for wave in &self.waves {
            let (mut re, mut im) = (vec![ZERO; r], vec![ZERO; r]);
            for (k, z) in modal[wave.first..wave.first + wave.count()].iter().enumerate() {
                re.iter_mut().zip(wave.shapes[0].column(k).iter()).for_each(|(sum, a)| *sum += z * *a);
                im.iter_mut().zip(wave.shapes[1].column(k).iter()).for_each(|(sum, a)| *sum += z * *a);
            }
            for (s, out) in out.chunks_exact_mut(r).enumerate() {
                let phase = wave.phase(s, sectors) * wave.scale;
                out.iter_mut().zip(re.iter().zip(&im)).for_each(|(x, (re, im))| *x += re * phase.re - im * phase.im);
            }
        }
        out
    }

    /// Displacements of the coordinates of all sectors under forces on them, at ω with a factor on the stiffness.
    pub(super) fn answers(
        &self,
        mixed: &Mixed,
        (factor, omega): (Complex64, f64),
        forces: &[Complex64],
    ) -> Vec<Complex64> {
        let along = self.along(forces);
        let mut modal = vec![ZERO; along.len()];
        for (column, [mass, stiffness]) in mixed.vectors.column_iter().zip(&mixed.own) {
            let force: Complex64 = column.iter().zip(&along).map(|(x, force)| force * *x).sum();
            let moved = force / (factor * *stiffness - omega * omega * mass);
            modal.iter_mut().zip(column.iter()).for_each(|(sum, x)| *sum += moved * *x);
        }
        self.expanded(&modal)
    }
}

impl NominalWave {
    fn count(&self) -> usize {
        self.shapes[0].ncols()
    }

    fn phase(&self, sector: usize, sectors: usize) -> Complex64 {
        turn((self.diameter * sector) as i64, sectors)
    }
}

impl RingModes {
    /// Damping between the modes, as (row, column, value).
    pub fn damped(&self, by: Option<&Damping>) -> Result<Vec<(usize, usize, f64)>, ReductionError> {
        let Some(by) = by else {
            let own = self
                .damping
                .iter()
                .flat_map(|own| all([1, own.ncols(), own.nrows()]).map(|(_, k, i)| (i, k, own[(i, k)])));
            return Ok(own.filter(|entry| entry.2 != 0.0).collect());
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

/// Modal mass and stiffness of an eigenvalue.
fn modal(value: f64) -> [f64; 2] {
    if value.is_finite() { [1.0, value.max(0.0)] } else { [0.0, 1.0] }
}

/// A wave with all modes that its coordinates have.
struct NaturalWave {
    reduced: Reduced,
    values: Vec<f64>,
    shapes: DMatrix<f64>,
}

/// Forces of a blade that deviates, in a mode of a wave.
struct Push {
    /// Over the coordinates of a sector, `D a / ω`.
    force: DMatrix<f64>,
    /// ω², rad²/s².
    value: f64,
}

/// Those of the modes of a wave up to `up_to`, rad/s, for its real and its imaginary part; free motions have none.
fn pushes(wave: &NaturalWave, blade: &DMatrix<f64>, up_to: f64) -> Vec<Push> {
    let r = blade.nrows();
    let inside = |value: f64| value > (FREE * up_to).powi(2) && value <= up_to * up_to;
    let all = wave.values.iter().enumerate().filter(|(_, value)| inside(**value));
    let parts = all.flat_map(|(k, value)| (0..wave.values.len()).step_by(r.max(1)).map(move |part| (k, *value, part)));
    parts
        .map(|(k, value, part)| Push { force: blade * wave.shapes.view((part, k), (r, 1)) / value.sqrt(), value })
        .collect()
}

/// Modal mass and stiffness of what is taken of a wave, and the shapes, real parts before imaginary ones.
fn taken(
    wave: &NaturalWave,
    pushes: &[Push],
    reduced: &ReducedSector,
    up_to: f64,
) -> Result<(Vec<[f64; 2]>, DMatrix<f64>), ReductionError> {
    let NaturalWave { reduced: wave, values, shapes } = wave;
    let (n, r) = (values.len(), reduced.dofs());
    let low = values.partition_point(|value| *value <= (reduced.extent * up_to).powi(2));
    let others = shapes.columns(low, n - low);
    let own: Vec<[f64; 2]> = values.iter().copied().map(modal).collect();
    let [mass, root] = [|[mass, _]: [f64; 2]| mass, |[_, stiffness]: [f64; 2]| stiffness.sqrt()]
        .map(|read| -> Vec<f64> { own[low..].iter().copied().map(read).collect() });
    if low == n {
        return Ok((own, shapes.clone()));
    }
    // vectors over the others by √stiffness, so that their products are energies; first what is seen
    let pushed = others.tr_mul(&wave.ports.transpose());
    let mut one = DMatrix::from_fn(n - low, pushed.ncols(), |k, at| pushed[(k, at)] / root[k]);
    let mut vectors = one.clone();
    for _ in 1..reduced.order {
        one = DMatrix::from_fn(n - low, one.ncols(), |k, at| one[(k, at)] * mass[k] / (root[k] * root[k]));
        vectors = joined(&vectors, &one);
    }
    for mut column in vectors.column_iter_mut() {
        let size = column.norm();
        if size > 0.0 {
            column.unscale_mut(size);
        }
    }
    let mut few = main_directions(&vectors, |largest| reduced.share * largest)?;
    // then how blades that deviate move, at the frequency of their mode, beyond that
    let parts = n / r.max(1);
    let mut relief = DMatrix::zeros(n - low, parts * pushes.len());
    for (at, push) in pushes.iter().enumerate() {
        for part in 0..parts {
            let force = others.rows(part * r, r).tr_mul(&push.force);
            for k in 0..n - low {
                relief[(k, at * parts + part)] = force[k] * root[k] / (root[k] * root[k] - push.value * mass[k]);
            }
        }
    }
    relief -= &few * few.tr_mul(&relief);
    few = joined(&few, &main_directions(&relief, |_| UNMOVED)?);
    if few.ncols() >= n - low {
        return Ok((own, shapes.clone()));
    }
    for (k, mut row) in few.row_iter_mut().enumerate() {
        row.unscale_mut(root[k]);
    }
    let square = |of: usize| {
        let weighted = DMatrix::from_fn(n - low, few.ncols(), |k, at| own[low + k][of] * few[(k, at)]);
        let product = few.tr_mul(&weighted);
        (&product + product.transpose()) * 0.5
    };
    let (values, mixed) = natural(&square(0), &square(1)).ok_or(ReductionError::OutOfRange)?;
    let shapes = joined(&shapes.columns(0, low).into_owned(), &(others * (few * mixed)));
    let own = own.into_iter().take(low).chain(values.into_iter().map(modal));
    Ok((own.collect(), shapes))
}

/// Orthonormal directions that columns have, of a squared size above a bound that is said of the largest.
fn main_directions(columns: &DMatrix<f64>, bound: impl Fn(f64) -> f64) -> Result<DMatrix<f64>, ReductionError> {
    let eigen = eigen::symmetric(columns * columns.transpose()).ok_or(ReductionError::OutOfRange)?;
    let least = bound(eigen.eigenvalues.amax());
    let kept: Vec<usize> = (0..columns.nrows()).filter(|&k| eigen.eigenvalues[k] > least).collect();
    Ok(eigen.eigenvectors.select_columns(&kept))
}

fn joined(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let columns: Vec<_> = a.column_iter().chain(b.column_iter()).collect();
    if columns.is_empty() { a.clone() } else { DMatrix::from_columns(&columns) }
}

/// All triples of numbers below these, the last running first.
fn all([a, b, c]: [usize; 3]) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..a).flat_map(move |i| (0..b).flat_map(move |k| (0..c).map(move |l| (i, k, l))))
}
