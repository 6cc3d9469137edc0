//! Large structures in modes that damping leaves uncoupled: their receptance is a product of real matrices, the same at all frequencies, and nothing is
//! factored at any of them.
//!
//! `R(s) = Φ diag(1 / (m s² + c s + k)) Φᵀ`, with Φ the axes by modes. Structures that were reduced by free modes and residual vectors come in these
//! coordinates; others are brought there once.

use super::hold::HOLD;
use crate::structure::{Matrices, Structure};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use stickslip_numerics::dense::multiply_in_blocks;
use stickslip_numerics::eigen;
use stickslip_numerics::sparse::Singular;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Damping between modes that counts as the rounding of matrices: relative to that of the two, and to the largest of all.
const UNCOUPLED: [f64; 2] = [1e-9, 1e-13];
/// Degrees of freedom up to which modes are sought: the decomposition of so many takes a minute.
const MOST: usize = 4000;
/// A dynamic stiffness below this share of its parts is their rounding: a resonance without damping.
const RESONANT: f64 = 1e-14;

/// A structure in its own modes.
#[derive(Debug, Clone)]
pub(super) struct Uncoupled {
    /// Modal mass, damping and stiffness.
    pub own: Vec<[f64; 3]>,
    /// The places by modes, n × n; none where they are the same.
    shapes: Option<DMatrix<f64>>,
    /// The axes by modes, p × n, column after column.
    pub at: Vec<f64>,
    pub axes: usize,
}

impl Uncoupled {
    /// `None` if damping couples the modes, or if there are too many.
    pub fn new(structure: &Structure, directions: &[Vec<(usize, f64)>]) -> Option<Self> {
        let n = structure.dofs();
        let (own, shapes) = match diagonal(structure) {
            Some(own) => (own, None),
            None if structure.is_sparse() || n > MOST => return None,
            None => {
                let (own, shapes) = modes(structure.full())?;
                (own, Some(shapes))
            }
        };
        let axes = directions.len();
        let mut at = vec![0.0; axes * n];
        for (q, rows) in directions.iter().enumerate() {
            for &(i, w) in rows {
                match &shapes {
                    None => at[i * axes + q] += w,
                    Some(shapes) => (0..n).for_each(|m| at[m * axes + q] += w * shapes[(i, m)]),
                }
            }
        }
        Some(Uncoupled { own, shapes, at, axes })
    }

    /// `m s² + c s + k` of mode `m`, held as all are at rest; not a number that could be divided by at a resonance without damping.
    pub fn stiffness(&self, m: usize, s: Complex64, omega: f64) -> Result<Complex64, Singular> {
        let [mass, damping, stiffness] = self.own[m];
        let hold = if s == ZERO { (HOLD * omega).powi(2) } else { 0.0 };
        let of_mass = (s * s + hold) * mass;
        let sum = of_mass + s * damping + stiffness;
        let size = of_mass.norm() + (s * damping).norm() + stiffness.abs();
        if sum.norm() > RESONANT * size { Ok(sum) } else { Err(Singular { row: m }) }
    }

    /// The inverse of that, of all modes.
    pub fn gains(&self, s: Complex64, omega: f64) -> Result<Vec<Complex64>, Singular> {
        (0..self.own.len()).map(|m| Ok(1.0 / self.stiffness(m, s, omega)?)).collect()
    }

    /// Receptance of the axes, p × p.
    pub fn receptance(&self, s: Complex64, omega: f64) -> Result<DMatrix<Complex64>, Singular> {
        let (p, n) = (self.axes, self.own.len());
        let gains = self.gains(s, omega)?;
        let part = |read: fn(&Complex64) -> f64| {
            let columns = self.at.chunks_exact(p.max(1)).zip(&gains);
            let weighted: Vec<f64> = columns.flat_map(|(at, g)| at.iter().map(move |a| a * read(g))).collect();
            let mut product = vec![0.0; p * p];
            multiply_in_blocks(&weighted, &self.at, &mut product, (p, n, p), true);
            product
        };
        let re = part(|g| g.re);
        // at rest and along the real axis there is none
        let im = if gains.iter().all(|g| g.im == 0.0) { vec![0.0; p * p] } else { part(|g| g.im) };
        Ok(DMatrix::from_iterator(p, p, re.into_iter().zip(im).map(|(re, im)| Complex64::new(re, im))))
    }

    /// Its diagonal.
    pub fn own_receptance(&self, gains: &[Complex64]) -> Vec<Complex64> {
        let mut sum = vec![ZERO; self.axes];
        for (at, gain) in self.at.chunks_exact(self.axes.max(1)).zip(gains) {
            sum.iter_mut().zip(at).for_each(|(sum, a)| *sum += gain * (a * a));
        }
        sum
    }

    /// Displacements of all places under the forces `force` on them.
    pub fn respond(
        &self,
        s: Complex64,
        omega: f64,
        force: &DVector<Complex64>,
    ) -> Result<DVector<Complex64>, Singular> {
        let gains = self.gains(s, omega)?;
        let Some(shapes) = &self.shapes else {
            return Ok(DVector::from_iterator(force.len(), force.iter().zip(&gains).map(|(f, g)| f * g)));
        };
        let modal = |read: fn(&Complex64) -> f64| shapes.tr_mul(&force.map(|f| read(&f)));
        let (re, im) = (modal(|f| f.re), modal(|f| f.im));
        let moved: Vec<Complex64> =
            gains.iter().zip(re.iter().zip(im.iter())).map(|(g, (re, im))| g * Complex64::new(*re, *im)).collect();
        let part = |read: fn(&Complex64) -> f64| shapes * DVector::from_iterator(moved.len(), moved.iter().map(read));
        Ok(part(|z| z.re).zip_map(&part(|z| z.im), Complex64::new))
    }
}

/// The diagonals of a structure that has nothing beside them.
fn diagonal(structure: &Structure) -> Option<Vec<[f64; 3]>> {
    let mut own = vec![[0.0; 3]; structure.dofs()];
    for (i, k, values) in structure.entries() {
        if i != k {
            return None;
        }
        own[i] = values;
    }
    Some(own)
}

/// Modes of unit mass.
fn modes(matrices: &Matrices) -> Option<(Vec<[f64; 3]>, DMatrix<f64>)> {
    let Matrices { mass, damping, stiffness } = matrices;
    let n = mass.nrows();
    // M = L Lᵀ; with q = Lᵀ x the masses are ones
    let lower = mass.clone().cholesky()?.unpack();
    let half = lower.solve_lower_triangular(stiffness)?;
    let whole = lower.solve_lower_triangular(&half.transpose())?;
    let (values, vectors) = eigen::symmetric_in_blocks(&whole)?;
    let shapes = lower.tr_solve_lower_triangular(&vectors)?;
    let product = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
        let mut out = DMatrix::zeros(n, n);
        multiply_in_blocks(a.as_slice(), b.as_slice(), out.as_mut_slice(), (n, n, n), false);
        out
    };
    let modal = product(&shapes.transpose(), &product(damping, &shapes));
    let size = modal.diagonal().amax();
    let apart = (0..n).flat_map(|k| (0..n).map(move |i| (i, k))).filter(|(i, k)| i != k);
    if apart.into_iter().any(|(i, k)| {
        let both = (modal[(i, i)] * modal[(k, k)]).abs().sqrt();
        modal[(i, k)].abs() > UNCOUPLED[0] * both + UNCOUPLED[1] * size
    }) {
        return None;
    }
    Some((values.iter().enumerate().map(|(m, value)| [1.0, modal[(m, m)], *value]).collect(), shapes))
}
