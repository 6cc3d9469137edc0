//! Large structures in modes that damping leaves uncoupled: their receptance is a product of real matrices, the same at all frequencies, and nothing is
//! factored at any of them.
//!
//! `R(s) = Φ diag(1 / (m s² + c s + k)) Φᵀ`, with Φ the axes by modes. Structures that were reduced by free modes and residual vectors come in these
//! coordinates; others are brought there once.

use super::hold::HOLD;
use crate::structure::{Matrices, Structure};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use stickslip_numerics::dense::{multiply_in_blocks, solve_lower_in_blocks};
use stickslip_numerics::eigen;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Damping between modes that counts as the rounding of matrices: relative to that of the two, and to the largest of all.
const UNCOUPLED: [f64; 2] = [1e-9, 1e-13];
/// Springs that hold free motions, relative to the lowest ratio of stiffness and mass on the diagonals.
const SHIFT: f64 = 1e-3;
/// Degrees of freedom up to which modes are sought: the decomposition of so many takes a minute.
const MOST: usize = 4000;
/// A dynamic stiffness below this share of its parts is their rounding: a resonance without damping.
const RESONANT: f64 = 1e-14;

/// A dynamic stiffness without an inverse: a resonance without damping.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Resonant;

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
        let (own, shapes) = match by_themselves(structure) {
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
            rows.iter().for_each(|&(i, w)| at[i * axes + q] += w);
        }
        if let Some(shapes) = &shapes {
            let along = std::mem::replace(&mut at, vec![0.0; axes * n]);
            multiply_in_blocks(&along, shapes.as_slice(), &mut at, (axes, n, n), false);
        }
        Some(Uncoupled { own, shapes, at, axes })
    }

    /// `m s² + c s + k` of mode `m`, held as all are at rest; not a number that could be divided by at a resonance without damping.
    pub fn stiffness(&self, m: usize, s: Complex64, omega: f64) -> Result<Complex64, Resonant> {
        let [mass, damping, stiffness] = self.own[m];
        let hold = if s == ZERO { (HOLD * omega).powi(2) } else { 0.0 };
        let of_mass = (s * s + hold) * mass;
        let sum = of_mass + s * damping + stiffness;
        let size = of_mass.norm() + (s * damping).norm() + stiffness.abs();
        if sum.norm() > RESONANT * size { Ok(sum) } else { Err(Resonant) }
    }

    /// The inverse of that, of all modes.
    pub fn gains(&self, s: Complex64, omega: f64) -> Result<Vec<Complex64>, Resonant> {
        (0..self.own.len()).map(|m| Ok(1.0 / self.stiffness(m, s, omega)?)).collect()
    }

    /// Receptance of the axes, p × p.
    pub fn receptance(&self, s: Complex64, omega: f64) -> Result<DMatrix<Complex64>, Resonant> {
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

    /// Forces on the modes from those on all places.
    pub fn onto_modes(&self, force: &DVector<f64>) -> DVector<f64> {
        self.shapes.as_ref().map_or_else(|| force.clone(), |shapes| shapes.tr_mul(force))
    }

    /// Displacements of all places from those of the modes.
    pub fn of_modes(&self, modal: &DVector<f64>) -> DVector<f64> {
        self.shapes.as_ref().map_or_else(|| modal.clone(), |shapes| shapes * modal)
    }

    /// Displacements of all places under the forces `force` on them.
    pub fn respond(
        &self,
        s: Complex64,
        omega: f64,
        force: &DVector<Complex64>,
    ) -> Result<DVector<Complex64>, Resonant> {
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
pub(super) fn by_themselves(structure: &Structure) -> Option<Vec<[f64; 3]>> {
    let mut own = vec![[0.0; 3]; structure.dofs()];
    for (i, k, values) in structure.entries() {
        if i != k {
            return None;
        }
        own[i] = values;
    }
    Some(own)
}

/// Modes `X` with `Xᵀ (K + σ M) X = 1` and `Xᵀ M X = θ`, so that motions without mass have their place: mass θ and stiffness `1 - σ θ`.
fn modes(matrices: &Matrices) -> Option<(Vec<[f64; 3]>, DMatrix<f64>)> {
    let Matrices { mass, damping, stiffness } = matrices;
    let n = mass.nrows();
    let mut ratios: Vec<f64> =
        (0..n).map(|i| stiffness[(i, i)] / mass[(i, i)]).filter(|v| v.is_finite() && *v > 0.0).collect();
    ratios.sort_by(f64::total_cmp);
    let shift = SHIFT * ratios.first().copied().unwrap_or(1.0);
    let held = stiffness + mass * shift;
    // ones on the diagonal, so that coordinates of any unit count alike
    let unit = held.diagonal().map(|v| 1.0 / v.sqrt());
    let scaled = |matrix: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, k| unit[i] * matrix[(i, k)] * unit[k]);
    let lower = scaled(&held).cholesky()?.unpack();
    let solve = |mut right: DMatrix<f64>, transposed: bool| {
        solve_lower_in_blocks(lower.as_slice(), n, right.as_mut_slice(), transposed);
        right
    };
    let whole = solve(solve(scaled(mass), false).transpose(), false);
    let (values, vectors) = eigen::symmetric_in_blocks(&whole)?;
    let mut shapes = solve(vectors, true);
    for mut column in shapes.column_iter_mut() {
        column.component_mul_assign(&unit);
    }
    let product = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
        let mut out = DMatrix::zeros(n, n);
        multiply_in_blocks(a.as_slice(), b.as_slice(), out.as_mut_slice(), (n, n, n), false);
        out
    };
    let modal = product(&shapes.transpose(), &product(damping, &shapes));
    let size = modal.diagonal().amax();
    for (i, k) in (0..n).flat_map(|k| (0..k).map(move |i| (i, k))) {
        let both = (modal[(i, i)] * modal[(k, k)]).abs().sqrt();
        let beside = modal[(i, k)].abs().max(modal[(k, i)].abs());
        if beside > UNCOUPLED[0] * both + UNCOUPLED[1] * size {
            return None;
        }
    }
    // a mass below zero is the rounding of none
    let own = values.iter().enumerate().map(|(m, theta)| {
        let mass = theta.max(0.0);
        [mass, modal[(m, m)], 1.0 - shift * mass]
    });
    Some((own.collect(), shapes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(i: usize) -> f64 {
        ((i * 7919 + 13) as f64).sin()
    }

    /// Modes answer as the dynamic stiffness does that they are those of: also motions without mass, and free ones; damping that couples them is told.
    #[test]
    fn modes_answer_as_the_dynamic_stiffness() {
        let n = 12;
        let spread = DMatrix::from_fn(n, n - 1, |i, k| noise(i * n + k));
        let stiffness = &spread * spread.transpose();
        let mut light = DMatrix::from_fn(n, n, |i, k| noise(i + n * k + 500));
        light = &light * light.transpose() + DMatrix::identity(n, n) * 0.1;
        // no mass in two places
        for i in [3, 7] {
            light.fill_row(i, 0.0);
            light.fill_column(i, 0.0);
        }
        let damping = &light * 0.03 + &stiffness * 0.002;
        let names = || (0..n).map(|i| i.to_string()).collect::<Vec<_>>();
        let structure = Structure::new(names(), light.clone(), damping.clone(), stiffness.clone()).unwrap();
        let directions = [vec![(0, 1.0), (4, -0.5)], vec![(3, 1.0)], vec![(7, 2.0), (1, 1.0)]];
        let modes = Uncoupled::new(&structure, &directions).unwrap();
        for (s, omega) in
            [(Complex64::new(0.0, 0.8), 0.8), (Complex64::new(0.0, 2.4), 0.8), (Complex64::new(1.5, 0.0), 0.8)]
        {
            let receptance = modes.receptance(s, omega).unwrap();
            let gains = modes.gains(s, omega).unwrap();
            let own = modes.own_receptance(&gains);
            for (b, direction) in directions.iter().enumerate() {
                let mut x = DVector::from_element(n, ZERO);
                direction.iter().for_each(|&(i, w)| x[i] += Complex64::new(w, 0.0));
                let answer = modes.respond(s, omega, &x).unwrap();
                structure.dynamic_stiffness(s).unwrap().solve(x.as_mut_slice());
                let size = x.iter().map(|x| x.norm()).fold(0.0, f64::max);
                assert!(x.iter().zip(answer.iter()).all(|(x, a)| (x - a).norm() < 1e-9 * size), "{s}: {x} {answer}");
                for (a, direction) in directions.iter().enumerate() {
                    let along: Complex64 = direction.iter().map(|&(i, w)| x[i] * w).sum();
                    assert!((receptance[(a, b)] - along).norm() < 1e-9 * size);
                }
                assert!((own[b] - receptance[(b, b)]).norm() < 1e-12 * size);
            }
        }
        let mut coupled = damping;
        coupled[(0, 0)] += 0.01;
        let structure = Structure::new(names(), light, coupled, stiffness).unwrap();
        assert!(Uncoupled::new(&structure, &directions).is_none());
    }
}
