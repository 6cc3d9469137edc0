//! A run of the block Lanczos process: a basis that grows by blocks, and the
//! modes that converge in it.

use super::natural_modes::{BLOCK, ModesError, NaturalModes};
use crate::eigen;
use crate::interrupt;
use crate::random::SplitMix64;
use crate::sparse::{LdlFactor, SparseMatrix, multi_vector};
use crate::vector::dot;
use nalgebra::DMatrix;

/// An eigenvalue of the projected operator (Ritz value) and its vector.
pub(super) struct RitzPair {
    pub(super) theta: f64,
    /// Coefficients of the Ritz vector in the basis.
    vector: Vec<f64>,
    /// `‖(K - σM)⁻¹ M y - θ y‖` in the norm of M, for the Ritz vector y.
    pub(super) residual: f64,
}

/// An M-orthonormal basis V, orthogonal to the modes already found, and `T = Vᵀ M (K - σM)⁻¹ M V`.
pub(super) struct Lanczos<'a> {
    factor: &'a LdlFactor,
    mass: &'a SparseMatrix,
    /// Largest entry of the mass matrix.
    max_mass_entry: f64,
    locked: &'a [f64],
    n: usize,
    basis: Vec<f64>,
    /// M times the basis vectors that are not expanded yet.
    mass_times_basis: Vec<f64>,
    /// Columns of T, each as long as the basis was at its expansion.
    projected: Vec<Vec<f64>>,
    /// Number of basis vectors to which the operator was applied.
    pub(super) expanded: usize,
    /// Components of the last expansion along the block that it added.
    coupling: DMatrix<f64>,
    /// State of the random start vectors.
    random: SplitMix64,
}

impl<'a> Lanczos<'a> {
    pub(super) fn new(factor: &'a LdlFactor, mass: &'a SparseMatrix, locked: &'a [f64]) -> Self {
        let n = mass.n();
        let coupling = DMatrix::zeros(0, 0);
        Lanczos {
            factor,
            mass,
            max_mass_entry: mass.max_abs(),
            locked,
            n,
            basis: vec![],
            mass_times_basis: vec![],
            projected: vec![],
            expanded: 0,
            coupling,
            random: SplitMix64::new(0),
        }
    }

    fn size(&self) -> usize {
        self.basis.len().checked_div(self.n).unwrap_or(0)
    }

    /// Applies the operator to the last block and adds the new directions.
    /// Returns false if there are no new directions.
    pub(super) fn expand(&mut self) -> Result<bool, ModesError> {
        if self.size() == 0 {
            self.add_random_vectors(BLOCK)?;
            if self.size() == 0 {
                return Ok(false);
            }
        }
        interrupt::check();
        let n = self.n;
        let mut block = std::mem::take(&mut self.mass_times_basis);
        self.factor.solve(&mut block);
        let width = block.len() / n;
        let mut forces = self.mass.multiply_columns(&block);
        let sizes = self.norms(&block, &forces)?;
        let coefficients = self.project_out(&mut block, &mut forces);
        for k in 0..width {
            self.projected.push(coefficients.column(k).iter().copied().collect());
        }
        self.expanded += width;
        self.coupling = self.orthonormalize(block, forces, &sizes)?;
        let added = self.size() - self.expanded;
        if added < BLOCK {
            self.add_random_vectors(BLOCK - added)?;
        }
        Ok(self.size() > self.expanded)
    }

    /// Returns `(K - σM)⁻¹ M V`.
    fn operator(&self, v: &[f64]) -> Vec<f64> {
        let mut block = self.mass.multiply_columns(v);
        self.factor.solve(&mut block);
        block
    }

    /// Returns the norms of the columns of a block in the inner product of M.
    /// `forces` is M times the block.
    fn norms(&self, block: &[f64], forces: &[f64]) -> Result<Vec<f64>, ModesError> {
        block.chunks(self.n).zip(forces.chunks(self.n)).map(|(v, force)| self.norm(v, force)).collect()
    }

    /// Returns the norm of a vector `v`, with `force` = M v. It is zero if all digits of
    /// `vᵀ M v` cancel, as for a motion without mass.
    fn norm(&self, v: &[f64], force: &[f64]) -> Result<f64, ModesError> {
        // A negative `vᵀ M v` up to this fraction of `Σ |vᵢ Mᵢₖ vₖ|` is the rounding of a file
        // with ten digits.
        let massless = 1e-10;
        let (square, longest) = (dot(v, force), self.max_mass_entry * dot(v, v));
        if !square.is_finite() {
            return Err(ModesError::OutOfRange);
        }
        if square > massless * longest {
            return Ok(square.sqrt());
        }
        let sum: f64 = self.mass.entries().map(|(row, column, value)| (v[row] * value * v[column]).abs()).sum();
        let rounding = f64::EPSILON * self.n.max(16) as f64;
        if square > rounding * sum {
            Ok(square.sqrt())
        } else if square >= -massless * sum - 8.0 * rounding * longest {
            Ok(0.0)
        } else {
            Err(ModesError::NegativeMass)
        }
    }

    /// Projects the modes found and the basis out of a block and of M times the block. Returns
    /// the components along the basis. Two passes are enough.
    fn project_out(&self, block: &mut [f64], forces: &mut Vec<f64>) -> DMatrix<f64> {
        let n = self.n;
        let mut coefficients = DMatrix::zeros(self.size(), block.len() / n);
        if self.locked.is_empty() && self.basis.is_empty() {
            return coefficients;
        }
        for _ in 0..2 {
            let known = multi_vector::inner_products(n, self.locked, forces);
            multi_vector::add(n, block, -1.0, self.locked, &known);
            let along = multi_vector::inner_products(n, &self.basis, forces);
            multi_vector::add(n, block, -1.0, &self.basis, &along);
            coefficients += along;
            *forces = self.mass.multiply_columns(block);
        }
        coefficients
    }

    /// Orthonormalizes the columns of a projected block one by one, together
    /// with M times them, and adds them to the basis.
    ///
    /// Columns that are rounding relative to their former `sizes` are dropped. Returns the
    /// components of the block along the new vectors.
    fn orthonormalize(&mut self, block: Vec<f64>, forces: Vec<f64>, sizes: &[f64]) -> Result<DMatrix<f64>, ModesError> {
        let n = self.n;
        let first = self.size();
        let mut components = DMatrix::zeros(0, sizes.len());
        for (k, ((column, force), size)) in block.chunks(n).zip(forces.chunks(n)).zip(sizes).enumerate() {
            let (mut column, mut force) = (column.to_vec(), force.to_vec());
            let mut along = DMatrix::zeros(self.size() - first, 1);
            let mut left = self.norm(&column, &force)?;
            for _ in 0..2 {
                let part = multi_vector::inner_products(n, &self.basis[first * n..], &force);
                multi_vector::add(n, &mut column, -1.0, &self.basis[first * n..], &part);
                multi_vector::add(n, &mut force, -1.0, &self.mass_times_basis[(first - self.expanded) * n..], &part);
                along += part;
                // The sign of a product that cancels to rounding is not reliable either.
                // Below this fraction `M v` is recomputed, because the digits of a projected `M
                // v` cancel with those of v.
                if dot(&column, &force) < (0.1 * left).powi(2) {
                    force = self.mass.multiply_columns(&column);
                }
                left = self.norm(&column, &force)?;
            }
            (0..along.nrows()).for_each(|i| components[(i, k)] = along[(i, 0)]);
            // A new vector is rounding if its norm, relative to its norm before the projection,
            // is below this.
            if left <= 1e-14 * size {
                continue;
            }
            scale(&mut column, 1.0 / left);
            scale(&mut force, 1.0 / left);
            // Below this fraction, so much has cancelled that the vector is orthogonalized once
            // more. If half of it then vanishes, it was rounding.
            if left < 1e-6 * size {
                self.project_out(&mut column, &mut force);
                let second = self.norm(&column, &force)?;
                if second < 0.5 {
                    continue;
                }
                scale(&mut column, 1.0 / second);
                scale(&mut force, 1.0 / second);
            }
            self.basis.extend(column);
            self.mass_times_basis.extend(force);
            components = components.insert_row(self.size() - first - 1, 0.0);
            components[(self.size() - first - 1, k)] = left;
        }
        Ok(components)
    }

    /// Adds up to `count` random vectors that are orthogonal to the known ones,
    /// fewer if the space is exhausted.
    fn add_random_vectors(&mut self, count: usize) -> Result<(), ModesError> {
        let mut start: Vec<f64> = (0..count * self.n).map(|_| self.random()).collect();
        let mut forces = self.mass.multiply_columns(&start);
        // Project out the known vectors before the operator, which would amplify them.
        self.project_out(&mut start, &mut forces);
        start = forces;
        self.factor.solve(&mut start);
        forces = self.mass.multiply_columns(&start);
        let sizes = self.norms(&start, &forces)?;
        self.project_out(&mut start, &mut forces);
        self.orthonormalize(start, forces, &sizes)?;
        Ok(())
    }

    /// Returns a random number between -1 and 1, with the same bits on every machine.
    fn random(&mut self) -> f64 {
        2.0 * self.random.next_unit() - 1.0
    }

    /// Returns the eigenvalues of the projected operator, in falling order of |θ|.
    pub(super) fn pairs(&self) -> Result<Vec<RitzPair>, ModesError> {
        let m = self.expanded;
        if m == 0 {
            return Ok(vec![]);
        }
        // Only the upper triangle of the symmetric matrix is computed.
        let upper = |i: usize, k: usize| self.projected[k].get(i).copied().unwrap_or(0.0);
        let t = DMatrix::from_fn(m, m, |i, k| upper(i.min(k), i.max(k)));
        let eigen = eigen::symmetric(t).ok_or(ModesError::OutOfRange)?;
        let mut order: Vec<usize> = (0..m).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].abs().total_cmp(&eigen.eigenvalues[a].abs()));
        let last = self.coupling.ncols();
        let pair = |k: usize| {
            let vector: Vec<f64> = eigen.eigenvectors.column(k).iter().copied().collect();
            let tail = DMatrix::from_column_slice(last, 1, &vector[m - last..]);
            RitzPair { theta: eigen.eigenvalues[k], vector, residual: (&self.coupling * tail).norm() }
        };
        Ok(order.into_iter().map(pair).filter(|pair| pair.theta != 0.0).collect())
    }

    /// Computes modes from Ritz pairs: applies the operator once more and
    /// diagonalizes K and M in the resulting space.
    pub(super) fn modes(
        &self,
        stiffness: &SparseMatrix,
        shift: f64,
        pairs: &[RitzPair],
    ) -> Result<NaturalModes, ModesError> {
        let (n, count) = (self.n, pairs.len());
        if count == 0 {
            return Ok(NaturalModes::empty());
        }
        let failed = || ModesError::NotConverged { found: 0, counted: count, below: shift };
        let coefficients = DMatrix::from_fn(self.expanded, count, |i, k| pairs[k].vector[i]);
        let ritz = multi_vector::combine(n, &self.basis[..self.expanded * n], &coefficients);
        let mut shapes = self.operator(&ritz);
        shapes.chunks_mut(n).zip(pairs).for_each(|(shape, pair)| scale(shape, 1.0 / pair.theta));
        let mut forces = self.mass.multiply_columns(&shapes);
        if !self.locked.is_empty() {
            let known = multi_vector::inner_products(n, self.locked, &forces);
            multi_vector::add(n, &mut shapes, -1.0, self.locked, &known);
            forces = self.mass.multiply_columns(&shapes);
        }
        let m = multi_vector::inner_products(n, &shapes, &forces);
        let k = multi_vector::inner_products(n, &shapes, &stiffness.multiply_columns(&shapes));
        let inverse = m
            .clone()
            .cholesky()
            .map(|c| c.l())
            .and_then(|l| l.solve_lower_triangular(&DMatrix::identity(count, count)));
        let inverse = inverse.ok_or_else(failed)?;
        // Relative to the shift, so that the rounding of modes far above does
        // not affect those near it.
        let eigen = eigen::symmetric(&inverse * (k - m * shift) * inverse.transpose()).ok_or_else(failed)?;
        let shapes = multi_vector::combine(n, &shapes, &(inverse.transpose() * &eigen.eigenvectors));
        let values: Vec<f64> = eigen.eigenvalues.iter().map(|v| v + shift).collect();
        let mut off = self.operator(&shapes);
        for ((off, shape), value) in off.chunks_mut(n).zip(shapes.chunks(n)).zip(&values) {
            off.iter_mut().zip(shape).for_each(|(off, x)| *off = x - (value - shift) * *off);
        }
        // K and M are diagonal in the space of the modes. The rounding of the factor inside
        // that space is therefore not an error of the modes.
        for modes in [self.locked, &shapes].into_iter().filter(|modes| !modes.is_empty()) {
            let inside = multi_vector::inner_products(n, modes, &self.mass.multiply_columns(&off));
            multi_vector::add(n, &mut off, -1.0, modes, &inside);
        }
        let residuals = self.norms(&off, &self.mass.multiply_columns(&off))?;
        // A rigid-body mode not found yet may spoil others by the rounding of
        // the factor. A later run finds those.
        // Largest residual (a relative error bound of `λ - σ`) of an accepted mode; 1e-11 to
        // 1e-15 is usual. The error is about its square.
        let good: Vec<usize> = (0..count).filter(|&k| residuals[k] <= 1e-8).collect();
        if good.is_empty() {
            return Err(ModesError::Inaccurate { value: values[0], residual: residuals[0] });
        }
        let shapes = good.iter().flat_map(|&k| shapes[k * n..(k + 1) * n].iter().copied()).collect();
        let [values, residuals] = [values, residuals].map(|all| good.iter().map(|&k| all[k]).collect());
        let mut modes = NaturalModes::empty();
        modes.merge(n, NaturalModes { values, shapes, residuals, ..NaturalModes::empty() });
        Ok(modes)
    }
}

fn scale(v: &mut [f64], factor: f64) {
    v.iter_mut().for_each(|x| *x *= factor);
}
