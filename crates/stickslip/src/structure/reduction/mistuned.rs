//! How far a reduced ring whose blades differ is from the whole one, all rows of all sectors.
//!
//! `A = (1 + jη)(K + ΔK) - ω² M` of the ring, with the stiffness of each blade deviating, answers loads on what is seen by `x`. The reduced ring
//! answers with `x₀ = V p`, and leaves the residual `f - A x₀`, which no column of `V` sees. What it lacks is sought among vectors `e` that
//! answer the residuals in every sector alone, with its neighbours held, each made free of what the reduced ring answers to it,
//! `e - V (VᵀAV)⁻¹ VᵀA e`: a few of them, one after the other, until they change nothing. No factor is larger than a sector, or than the reduced ring.
//!
//! A factor of loss `η` stands for damping, of which a reduction adds no error of its own: at a resonance the error is the shift of its frequency
//! by the half width. The loads have random signs, so that all modes answer. Frequencies are resonances of the reduced ring near those modes of the
//! tuned one that lack most of what their blades' forces move, found by Rayleigh quotients from where the softest and the stiffest blade put them.
//!
//! Source: Nicolaides (1987), "Deflation of conjugate gradients with applications to boundary value problems", SIAM J. Numer. Anal. 24, 355-365.

use super::evidence::sign;
use super::ring::HALF_WIDTH;
use super::{Deviation, ReducedSector, ReductionError, Row, natural};
use crate::structure::cyclic::{Blade, CyclicSector};
use crate::structure::{RingEntry, RingRow};
use nalgebra::DMatrix;
use num_complex::Complex64;
use stickslip_numerics::sparse::{Analysis, ComplexFactor, Factor, Matrix, columns};

const ZERO: Complex64 = Complex64::new(0.0, 0.0);
const ONE: Complex64 = Complex64::new(1.0, 0.0);

/// Modes of the tuned ring near which both are compared, at most.
const MODES: usize = 5;
/// Nodal diameters whose modes are looked at: those of this level.
const LEVEL: usize = 1;
/// Frequencies below this share of the range are those of free motions, which no blade's stiffness moves.
const FREE: f64 = 1e-4;
/// Frequencies closer than this share are of one family of blades.
const SAME_FAMILY: f64 = 0.01;
/// Steps by which the Rayleigh quotient of an answer finds a resonance: it converges with the third power.
const TOWARDS: usize = 2;
/// Vectors beside the reduced ring, at most.
const VECTORS: usize = 12;
/// Share of the error by which one more vector changes it, from which on it is known.
const KNOWN: f64 = 0.05;

/// A ring whose blades differ, whole.
pub(in crate::structure) struct MistunedRing<'a> {
    sector: &'a CyclicSector,
    blade: &'a Blade,
    /// Of the stiffness of every blade.
    deviations: &'a [f64],
    /// What is seen of each sector.
    ports: Vec<RingRow>,
    /// Sizes of the ports, √(m/N), so that units do not count.
    scales: Vec<f64>,
    alone: &'a Factor,
}

/// A sector with its neighbours held.
pub(in crate::structure) fn alone(sector: &CyclicSector) -> Result<Factor, ReductionError> {
    let stiffness = sector.alone(&sector.stiffness)?;
    let factor = Analysis::new(&[&stiffness]).factor(&[(1.0, &stiffness)]);
    factor.map_err(|singular| ReductionError::Singular { omega: 0.0, singular })
}

/// Frequencies (rad/s) up to `up_to` of modes φ of the tuned ring of which the reduced one may lack most: by the energy of what the forces `D φ` of
/// their blades move in a sector with its neighbours held, beyond what the coordinates move, relative to that of the mode. The first lacks most; of modes
/// of one family only the worst is there.
pub(in crate::structure) fn lacking_most(
    sector: &CyclicSector,
    blade: &Blade,
    alone: &Factor,
    reduced: &ReducedSector,
    up_to: f64,
) -> Result<Vec<f64>, ReductionError> {
    let (n, r) = (reduced.n, reduced.dofs());
    let own = sector.alone(&sector.stiffness)?;
    let small = columns::products(n, &reduced.basis, &own.times_columns(&reduced.basis));
    let small = ((&small + small.transpose()) * 0.5).cholesky().ok_or(ReductionError::OutOfRange)?;
    let mut found: Vec<(f64, f64)> = Vec::new();
    for diameter in sector.diameters(LEVEL) {
        let wave = reduced.wave(diameter, sector.sectors)?;
        let (values, shapes) = natural(&wave.mass, &wave.stiffness).ok_or(ReductionError::OutOfRange)?;
        let inside =
            values.iter().enumerate().filter(|(_, value)| (FREE * up_to..=up_to).contains(&value.max(0.0).sqrt()));
        for (k, &value) in inside {
            let mut lacks = 0.0;
            for part in shapes.column(k).as_slice().chunks_exact(r) {
                let shape = columns::combination(n, &reduced.basis, &DMatrix::from_column_slice(r, 1, part));
                let forces = blade.times(&shape);
                let mut moved = forces.clone();
                alone.solve(&mut moved);
                let along = columns::products(n, &reduced.basis, &forces);
                let all: f64 = forces.iter().zip(&moved).map(|(force, moved)| force * moved).sum();
                lacks += all - along.dot(&small.solve(&along));
            }
            found.push((lacks / value, value.sqrt()));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut frequencies: Vec<f64> = Vec::new();
    for (_, omega) in found {
        let met = frequencies.iter().any(|other| (omega / other - 1.0).abs() < SAME_FAMILY);
        if !met && frequencies.len() < MODES {
            frequencies.push(omega);
        }
    }
    Ok(frequencies)
}

/// The reduced ring, its blades differing.
struct Small<'a> {
    sector: &'a ReducedSector,
    sectors: usize,
    mass: Matrix,
    stiffness: Matrix,
    analysis: Analysis,
}

impl<'a> MistunedRing<'a> {
    pub fn new(
        sector: &'a CyclicSector,
        (blade, alone): (&'a Blade, &'a Factor),
        deviations: &'a [f64],
        seen: &[Row],
    ) -> Result<Self, ReductionError> {
        let stiffness = sector.alone(&sector.stiffness)?;
        let ports: Vec<RingRow> = seen.iter().map(|row| sector.row(row)).collect();
        let size = |row: &RingRow| -> f64 {
            let parts = row.iter().map(|(at, _, weight)| (weight, stiffness.get(*at, *at)));
            parts.filter(|(_, own)| *own > 0.0).map(|(weight, own)| weight * weight / own).sum()
        };
        let scales = ports.iter().map(size).map(|size| if size > 0.0 { size.sqrt() } else { 1.0 }).collect();
        Ok(MistunedRing { sector, blade, deviations, ports, scales, alone })
    }

    /// The largest error of the reduced ring at resonances up to `up_to` (rad/s) near these frequencies of the tuned one. Beyond `enough` no further one
    /// is looked at.
    pub fn deviation(
        &self,
        reduced: &ReducedSector,
        of_blade: &[(usize, usize, f64)],
        near: &[f64],
        up_to: f64,
        enough: f64,
    ) -> Result<Deviation, ReductionError> {
        let small = self.small(reduced, of_blade)?;
        let of = |pick: fn(f64, f64) -> f64| self.deviations.iter().copied().fold(0.0, pick);
        let ends = [of(f64::max), of(f64::min)].map(|deviation| (1.0 + deviation).sqrt());
        let mut worst = Deviation { error: 0.0, omega: up_to };
        for omega in near.iter().flat_map(|omega| ends.map(|end| omega * end)) {
            let one = self.at_resonance(&small, omega, up_to)?;
            if one.error > worst.error {
                worst = one;
            }
            if worst.error > enough {
                break;
            }
        }
        Ok(worst)
    }

    fn small<'b>(
        &self,
        reduced: &'b ReducedSector,
        of_blade: &[(usize, usize, f64)],
    ) -> Result<Small<'b>, ReductionError> {
        let (r, sectors) = (reduced.dofs(), self.sector.sectors);
        let ring = |entries: &[RingEntry], more: &[(usize, usize, f64)]| {
            let around = (0..sectors).flat_map(|s| {
                entries
                    .iter()
                    .map(move |&(row, column, shift, value)| (s * r + row, next(s, shift, sectors) * r + column, value))
            });
            let blades = (0..sectors).flat_map(|s| {
                let deviation = self.deviations[s];
                more.iter().map(move |&(row, column, value)| (s * r + row, s * r + column, deviation * value))
            });
            Matrix::from_triplets(sectors * r, around.chain(blades)).map_err(|_| ReductionError::OutOfRange)
        };
        let (mass, stiffness) = (ring(&reduced.mass, &[])?, ring(&reduced.stiffness, of_blade)?);
        let analysis = Analysis::new(&[&stiffness, &mass]);
        Ok(Small { sector: reduced, sectors, mass, stiffness, analysis })
    }

    /// At the resonance of the reduced ring that an answer near `omega` leads to.
    fn at_resonance(&self, small: &Small, omega: f64, up_to: f64) -> Result<Deviation, ReductionError> {
        let load = self.load();
        let seen = small.along(&load);
        let mut omega = omega;
        for _ in 0..TOWARDS {
            let mut answer = seen.clone();
            small.factor(omega)?.solve(&mut answer);
            let found = small.quotient(&answer).max(0.0).sqrt();
            // an answer of many modes may lead out of the range
            if found > 0.0 && found <= up_to {
                omega = found;
            }
        }
        let factor = small.factor(omega)?;
        let mut coordinates = seen;
        factor.solve(&mut coordinates);
        let first = small.expanded(&coordinates);
        let error = self.lacking(small, &factor, omega, &load, &first);
        Ok(Deviation { error: if error.is_nan() { f64::INFINITY } else { error }, omega })
    }

    /// The relative change at the ports by what the whole ring adds to an answer of the reduced one.
    fn lacking(
        &self,
        small: &Small,
        factor: &ComplexFactor,
        omega: f64,
        load: &[Complex64],
        first: &[Complex64],
    ) -> f64 {
        let residual = minus(load, &self.times(omega, first));
        let seen = self.seen(first);
        let size = norm(&seen);
        // vectors, and the forces that they take
        let (mut vectors, mut forces): (Vec<Vec<Complex64>>, Vec<Vec<Complex64>>) = Default::default();
        let (mut left, mut added, mut error) = (residual.clone(), vec![ZERO; seen.len()], 0.0);
        for _ in 0..VECTORS {
            let mut vector = self.alone(&left);
            let mut force = self.times(omega, &vector);
            let mut answered = small.along(&force);
            factor.solve(&mut answered);
            let answered = small.expanded(&answered);
            vector = minus(&vector, &answered);
            force = minus(&force, &self.times(omega, &answered));
            let length = norm(&vector);
            if length == 0.0 {
                break;
            }
            vector.iter_mut().chain(&mut force).for_each(|z| *z /= length);
            vectors.push(vector);
            forces.push(force);
            let m = vectors.len();
            let matrix = DMatrix::from_fn(m, m, |i, k| dot(&vectors[i], &forces[k]));
            let right = nalgebra::DVector::from_fn(m, |i, _| dot(&vectors[i], &residual));
            let Some(weights) = matrix.lu().solve(&right) else { break };
            let sum = |all: &[Vec<Complex64>]| -> Vec<Complex64> {
                let mut sum = vec![ZERO; residual.len()];
                all.iter()
                    .zip(weights.iter())
                    .for_each(|(one, w)| sum.iter_mut().zip(one).for_each(|(s, z)| *s += w * z));
                sum
            };
            left = minus(&residual, &sum(&forces));
            let found = self.seen(&sum(&vectors));
            let change = norm(&minus(&found, &added));
            error = norm(&found)
                / norm(&seen.iter().zip(&found).map(|(a, b)| a + b).collect::<Vec<_>>()).max(f64::MIN_POSITIVE);
            added = found;
            if change <= KNOWN * norm(&added) || norm(&added) <= NOTHING * size {
                break;
            }
        }
        error
    }

    /// Forces of random signs on everything that is seen, over all rows of all sectors.
    fn load(&self) -> Vec<Complex64> {
        let (n, sectors) = (self.sector.dofs, self.sector.sectors);
        let mut load = vec![ZERO; n * sectors];
        for s in 0..sectors {
            for (p, (row, scale)) in self.ports.iter().zip(&self.scales).enumerate() {
                for (at, shift, weight) in row {
                    load[next(s, *shift, sectors) * n + at] += sign(s * self.ports.len() + p) * weight / scale;
                }
            }
        }
        load
    }

    /// What is seen of displacements, each port by its size.
    fn seen(&self, x: &[Complex64]) -> Vec<Complex64> {
        let (n, sectors) = (self.sector.dofs, self.sector.sectors);
        let all = (0..sectors).flat_map(|s| self.ports.iter().zip(&self.scales).map(move |port| (s, port)));
        all.map(|(s, (row, scale))| {
            row.iter().map(|(at, shift, weight)| x[next(s, *shift, sectors) * n + at] * *weight).sum::<Complex64>()
                / *scale
        })
        .collect()
    }

    /// `A x`.
    fn times(&self, omega: f64, x: &[Complex64]) -> Vec<Complex64> {
        let (n, sectors) = (self.sector.dofs, self.sector.sectors);
        let (of_stiffness, of_mass) = (lossy(), Complex64::new(-omega * omega, 0.0));
        let mut y = vec![ZERO; x.len()];
        for (entries, factor) in [(&self.sector.stiffness, of_stiffness), (&self.sector.mass, of_mass)] {
            for s in 0..sectors {
                for &(row, column, shift, value) in entries {
                    y[s * n + row] += factor * (value * x[next(s, shift, sectors) * n + column]);
                }
            }
        }
        for (s, &deviation) in self.deviations.iter().enumerate().filter(|(_, deviation)| **deviation != 0.0) {
            let one = &x[s * n..(s + 1) * n];
            let parts =
                [|z: &Complex64| z.re, |z: &Complex64| z.im].map(|part| one.iter().map(part).collect::<Vec<f64>>());
            let [re, im] = parts.map(|part| self.blade.times(&part));
            for (i, (re, im)) in re.iter().zip(&im).enumerate() {
                y[s * n + i] += deviation * of_stiffness * Complex64::new(*re, *im);
            }
        }
        y
    }

    /// Answers of every sector with its neighbours held, at rest.
    fn alone(&self, forces: &[Complex64]) -> Vec<Complex64> {
        let mut parts: Vec<f64> = forces.iter().map(|z| z.re).chain(forces.iter().map(|z| z.im)).collect();
        self.alone.solve(&mut parts);
        let (re, im) = parts.split_at(forces.len());
        re.iter().zip(im).map(|(re, im)| Complex64::new(*re, *im)).collect()
    }
}

/// What the whole adds, relative to the answer, below which it is rounding.
const NOTHING: f64 = 1e-10;

impl Small<'_> {
    fn factor(&self, omega: f64) -> Result<ComplexFactor, ReductionError> {
        let sum = [(lossy(), &self.stiffness), (-omega * omega * ONE, &self.mass)];
        self.analysis.factor_complex(&sum).map_err(|singular| ReductionError::Singular { omega, singular })
    }

    /// `ω²` of the Rayleigh quotient.
    fn quotient(&self, x: &[Complex64]) -> f64 {
        let energy = |matrix: &Matrix| -> f64 {
            matrix.times_complex(x).iter().zip(x).map(|(force, x)| (x.conj() * force).re).sum()
        };
        energy(&self.stiffness) / energy(&self.mass)
    }

    /// `Vᵀ f`.
    fn along(&self, forces: &[Complex64]) -> Vec<Complex64> {
        let n = self.sector.n;
        let [re, im] = parts(forces).map(|part| columns::products(n, &self.sector.basis, &part));
        re.iter().zip(im.iter()).map(|(re, im)| Complex64::new(*re, *im)).collect()
    }

    /// `V p`.
    fn expanded(&self, coordinates: &[Complex64]) -> Vec<Complex64> {
        let (n, r) = (self.sector.n, self.sector.dofs());
        let [re, im] = parts(coordinates)
            .map(|part| columns::combination(n, &self.sector.basis, &DMatrix::from_vec(r, self.sectors, part)));
        re.iter().zip(&im).map(|(re, im)| Complex64::new(*re, *im)).collect()
    }
}

/// `1 + jη` with the half width of a resonance at which modes that shift are an error.
fn lossy() -> Complex64 {
    Complex64::new(1.0, 2.0 * HALF_WIDTH)
}

fn parts(of: &[Complex64]) -> [Vec<f64>; 2] {
    [of.iter().map(|z| z.re).collect(), of.iter().map(|z| z.im).collect()]
}

/// A sector further by `shift`.
fn next(sector: usize, shift: i64, sectors: usize) -> usize {
    (sector as i64 + shift).rem_euclid(sectors as i64) as usize
}

fn minus(a: &[Complex64], b: &[Complex64]) -> Vec<Complex64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// `aᵀ b`: of a matrix that is symmetric and not Hermitian.
fn dot(a: &[Complex64], b: &[Complex64]) -> Complex64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[Complex64]) -> f64 {
    a.iter().map(|z| z.norm_sqr()).sum::<f64>().sqrt()
}
