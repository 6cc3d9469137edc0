//! Error of a reduced ring with different blades, relative to all rows of all sectors.
//!
//! A mode of the reduced ring, `x = V p` with λ, has the residual `ρ = (K + ΔK - λM) x`, which
//! is orthogonal to all columns of `V`. The eigenvalue of the whole ring is lower by `ρᵀ K⁻¹ ρ`
//! for unit mass (the bounds of Lehmann and Temple are of this order). With `A = K + σM`, only
//! those parts of `λ + σ` times the inertia and of the blade forces contribute that the
//! coordinates cannot represent:
//!
//! `ρᵀ A⁻¹ ρ = gᵀ (A⁻¹ - V (VᵀAV)⁻¹ Vᵀ) g`, `g = ΔK V p - (λ + σ) M V p`.
//!
//! With A of the tuned ring, this is a sum over its waves. Each term is a quadratic form whose
//! size is the number of coordinates of a sector. The forms of a few nodal diameters are
//! computed once. They serve the adjacent diameters and every pattern of deviations. The
//! estimate covers every mode of every pattern.
//!
//! Motions outside the coordinates are approximated as static, with an error of the square of
//! the frequency ratio. Their stiffness is that of the tuned ring, with an error of the order
//! of the deviation.
//!
//! Source: Parlett, "The Symmetric Eigenvalue Problem" (1998), Sec. 10.5 and 11.7.

use super::cyclic_basis::HALF_WIDTH;
use super::{FullStructure, ReducedSector, ReductionDeviation, ReductionError, Row};
use crate::structure::sector::is_real;
use crate::structure::sector_boundary::{Blade, CyclicSector};
use crate::structure::unit_root;
use nalgebra::DMatrix;
use stickslip_numerics::eigen;
use stickslip_numerics::sparse::multi_vector;

/// Frequencies below this fraction of the range are free motions, which blade stiffness does
/// not affect.
pub(super) const FREE: f64 = 1e-4;

/// Returns σ, rad²/s², for a range up to `up_to`, rad/s.
pub(super) fn shift(up_to: f64) -> f64 {
    // σ relative to the squared range: it makes A nonsingular for free motions and hardly
    // affects other modes.
    1e-3 * up_to * up_to
}

/// The forces that the coordinates of a sector cannot represent, wave by wave.
#[derive(Debug)]
pub(in crate::structure) struct MistuningError {
    sectors: usize,
    dofs: usize,
    /// Highest frequency of the estimated modes, rad/s.
    up_to: f64,
    forms: Vec<WaveForm>,
}

/// Rows `L` such that `|L z|²` is the energy outside the coordinates. `z` contains the inertia
/// divided by `up_to²`, then the blade forces; each has a real part and, for a complex wave, an
/// imaginary part.
#[derive(Debug)]
struct WaveForm {
    diameter: usize,
    rows: DMatrix<f64>,
}

impl MistuningError {
    /// Creates the estimate from a reduced sector with this blade, for frequencies up to
    /// `up_to`, rad/s.
    pub fn new(
        (sector, seen): (&CyclicSector, &[Row]),
        blade: &Blade,
        reduced: &ReducedSector,
        up_to: f64,
    ) -> Result<Self, ReductionError> {
        let form = |diameter: usize| WaveForm::new(&sector.wave(diameter, seen)?, blade, reduced, (diameter, up_to));
        // Refinement level of the nodal diameters whose forms are computed.
        let forms = sector.diameters(1).into_iter().map(form);
        let forms = forms.collect::<Result<_, _>>()?;
        Ok(MistuningError { sectors: sector.sectors, dofs: reduced.dofs(), up_to, forms })
    }

    /// Returns the largest error at a resonance of the reduced ring with these blade
    /// deviations.
    ///
    /// The modes have unit mass and these eigenvalues, ascending. An error of one is a relative
    /// frequency shift by the half width [`HALF_WIDTH`].
    pub fn deviation(&self, values: &[f64], shapes: &[f64], deviations: &[f64]) -> ReductionDeviation {
        let (r, sectors) = (self.dofs, self.sectors);
        let phases = self.phases(deviations);
        let [lowest, highest] = [FREE * self.up_to, self.up_to].map(|omega| omega * omega);
        let mut worst = ReductionDeviation { error: 0.0, omega: self.up_to };
        for (&value, shape) in values.iter().zip(shapes.chunks_exact(r * sectors)) {
            if !(lowest..=highest).contains(&value) {
                continue;
            }
            let waves = multi_vector::combine(r, shape, &phases);
            let inertia = -(value + shift(self.up_to)) / highest;
            let mut beyond = 0.0;
            for (diameter, wave) in waves.chunks_exact(4 * r).enumerate() {
                let (moved, pushed) = wave.split_at(2 * r);
                let parts = [moved, pushed].map(|of| of.split_at(r));
                beyond += self.nearest(diameter).energy(parts, inertia);
            }
            let error = 0.5 * beyond / value / HALF_WIDTH;
            // NaN counts as an infinite error
            let error = if error.is_nan() { f64::INFINITY } else { error };
            if error > worst.error {
                worst = ReductionDeviation { error, omega: value.sqrt() };
            }
        }
        worst
    }

    /// Returns the sector weights that split displacements, and displacements times deviations,
    /// into the real and imaginary parts of the waves. Four columns belong to each nodal
    /// diameter.
    fn phases(&self, deviations: &[f64]) -> DMatrix<f64> {
        let sectors = self.sectors;
        DMatrix::from_fn(sectors, 4 * (sectors / 2 + 1), |s, column| {
            let (diameter, part) = (column / 4, column % 4);
            let share = if is_real(diameter, sectors) { 1.0 } else { 2.0 } / sectors as f64;
            let phase = unit_root(-((diameter * s) as i64), sectors) * share.sqrt();
            let weight = if part < 2 { 1.0 } else { deviations[s] };
            weight * if part % 2 == 0 { phase.re } else { phase.im }
        })
    }

    fn nearest(&self, diameter: usize) -> &WaveForm {
        let apart = |form: &&WaveForm| form.diameter.abs_diff(diameter);
        self.forms.iter().min_by_key(apart).expect("a ring has waves")
    }
}

impl WaveForm {
    fn new(
        whole: &FullStructure,
        blade: &Blade,
        reduced: &ReducedSector,
        (diameter, up_to): (usize, f64),
    ) -> Result<Self, ReductionError> {
        let n = reduced.n;
        let copies = whole.dofs() / n;
        let lifted = |columns: &[f64]| -> Vec<f64> {
            let all = (0..copies).flat_map(|copy| columns.chunks_exact(n).map(move |column| (copy, column)));
            all.flat_map(|(copy, column)| {
                let zeros = |count: usize| std::iter::repeat_n(0.0, count * n);
                zeros(copy).chain(column.iter().copied()).chain(zeros(copies - 1 - copy)).collect::<Vec<_>>()
            })
            .collect()
        };
        let basis = lifted(&reduced.basis);
        let mut forces: Vec<f64> =
            whole.mass.multiply_columns(&basis).iter().map(|force| force * up_to * up_to).collect();
        forces
            .extend(lifted(&reduced.basis.chunks_exact(n).flat_map(|column| blade.times(column)).collect::<Vec<_>>()));
        let sum = [(1.0, &*whole.stiffness), (shift(up_to), &*whole.mass)];
        let singular = |singular| ReductionError::Singular { omega: 0.0, singular };
        let factor = whole.analysis.factor(&sum).map_err(singular)?;
        let mut moved = forces.clone();
        factor.solve(&mut moved);
        let tall = copies * n;
        let size = multi_vector::inner_products(tall, &moved, &forces).diagonal().amax();
        // subtract the part that the coordinates represent
        let mut own = multi_vector::inner_products(tall, &basis, &whole.stiffness.multiply_columns(&basis));
        own += multi_vector::inner_products(tall, &basis, &whole.mass.multiply_columns(&basis)) * shift(up_to);
        let own = ((&own + own.transpose()) * 0.5).cholesky().ok_or(ReductionError::OutOfRange)?;
        let answered = own.solve(&multi_vector::inner_products(tall, &basis, &forces));
        multi_vector::add(tall, &mut moved, -1.0, &basis, &answered);
        let energy = multi_vector::inner_products(tall, &moved, &forces);
        let eigen = eigen::symmetric((&energy + energy.transpose()) * 0.5).ok_or(ReductionError::OutOfRange)?;
        // Energy outside the coordinates, relative to that of the forces, below which it is
        // rounding.
        let kept: Vec<usize> = (0..energy.nrows()).filter(|&k| eigen.eigenvalues[k] > 1e-15 * size).collect();
        let row = |i: usize, k: usize| eigen.eigenvectors[(k, kept[i])] * eigen.eigenvalues[kept[i]].sqrt();
        Ok(WaveForm { diameter, rows: DMatrix::from_fn(kept.len(), energy.nrows(), row) })
    }

    /// Returns the energy for the real and imaginary parts of displacements and of forces; the
    /// displacements are multiplied by `inertia`.
    fn energy(&self, [moved, pushed]: [(&[f64], &[f64]); 2], inertia: f64) -> f64 {
        let r = moved.0.len();
        let real = self.rows.ncols() == 2 * r;
        let square = |parts: &[(f64, &[f64])]| -> f64 {
            let mut sum = vec![0.0; self.rows.nrows()];
            for ((factor, values), first) in parts.iter().zip((0..).step_by(r)) {
                for (k, value) in values.iter().enumerate() {
                    let column = self.rows.column(first + k);
                    sum.iter_mut().zip(column.iter()).for_each(|(sum, l)| *sum += l * factor * value);
                }
            }
            sum.iter().map(|x| x * x).sum()
        };
        match real {
            true => square(&[(inertia, moved.0), (1.0, pushed.0)]) + square(&[(inertia, moved.1), (1.0, pushed.1)]),
            false => square(&[(inertia, moved.0), (inertia, moved.1), (1.0, pushed.0), (1.0, pushed.1)]),
        }
    }
}
