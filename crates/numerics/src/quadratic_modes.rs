//! Modes of `q'' + C q' + K q = g(t)` with symmetric `K`. They decouple the
//! equations and give the motion in closed form.
//!
//! Every mode `(λ, φ)` solves `(λ² + λ C + K) φ = 0` and `ψᵀ (λ² + λ C + K) = 0`.
//! If `C` is symmetric too, `ψ = φ`. With `θ = ψᵀ(2λ + C)φ` the modal coordinate
//! `η = [ψᵀ(λ + C) q + ψᵀ q'] / θ` satisfies `η' = λ η + ψᵀg/θ`, and
//! `q = Re Σ φ η`. A complex pair is kept once, with weight 2.
//!
//! A direction without stiffness and damping (`Kφ = Cφ = 0`) is a *free* direction. It keeps
//! its double zero eigenvalue: `ρ'' = φᵀ g`.
//! Source: Tisseur and Meerbergen, "The quadratic eigenvalue problem", SIAM
//! Review 43 (2001), Sec. 3.

use crate::eigen;
use crate::null_space::null_space;
use nalgebra::{DMatrix, DVector, Dyn, Schur, SymmetricEigen};
use num_complex::Complex64;

/// The modes of a system with unit mass matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct QuadraticModes {
    /// Exponents λ, one of every complex pair, rad/s.
    pub lambda: Vec<Complex64>,
    /// Columns φ times their weight (2 for a complex pair, 1 for a real mode), m × modes.
    pub shape: DMatrix<Complex64>,
    /// Rows ψᵀ(λ + C)/θ: the contribution of `q` to η, modes × m.
    pub from_displacement: DMatrix<Complex64>,
    /// Rows ψᵀ/θ: the contribution of `q'` to η, and the modal force of a unit force, modes × m.
    pub from_velocity: DMatrix<Complex64>,
    /// Orthonormal free directions, m × r.
    pub free: DMatrix<f64>,
}

/// Error: the system has no full set of modes.
///
/// Two modes coincide, as at critical damping. If the numbers are out of range,
/// `lambda` is not finite.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "two modes coincide at {lambda:.6} rad/s (critical damping); change the coefficient of one damper by a factor of 1.000001"
)]
pub struct DefectiveModes {
    /// Eigenvalue at which two modes coincide, rad/s.
    pub lambda: Complex64,
}

/// Eigenvalues of `K` below this fraction of the largest are zero: rounding of
/// the symmetric eigenvalue problem.
const RIGID: f64 = 1e-13;

impl QuadraticModes {
    /// Computes the modes of `q'' + C q' + K q`. Both matrices are m × m; K is
    /// symmetric, C may have a gyroscopic part.
    ///
    /// # Errors
    /// [`DefectiveModes`] at (nearly) critical damping, or if the numbers are out of range.
    ///
    /// # Example
    /// ```
    /// use nalgebra::dmatrix;
    /// use stickslip_numerics::quadratic_modes::QuadraticModes;
    /// let modes = QuadraticModes::new(&dmatrix![0.02], &dmatrix![1.0]).unwrap();
    /// assert!((modes.lambda[0].re + 0.01).abs() < 1e-15);
    /// ```
    pub fn new(damping: &DMatrix<f64>, stiffness: &DMatrix<f64>) -> Result<QuadraticModes, DefectiveModes> {
        let m = damping.nrows();
        let mut modes = QuadraticModes {
            lambda: Vec::new(),
            shape: DMatrix::zeros(m, 0),
            from_displacement: DMatrix::zeros(0, m),
            from_velocity: DMatrix::zeros(0, m),
            free: DMatrix::zeros(m, 0),
        };
        if m == 0 {
            return Ok(modes);
        }
        let out_of_range = DefectiveModes { lambda: Complex64::new(f64::NAN, 0.0) };
        let undamped = eigen::symmetric((stiffness + stiffness.transpose()) * 0.5).ok_or(out_of_range)?;
        let basis = split_free(damping, &undamped, &mut modes.free).ok_or(out_of_range)?;
        let (c, k) = (basis.transpose() * damping * &basis, basis.transpose() * stiffness * &basis);
        for group in coupled_groups(&c, &k) {
            let part = DMatrix::from_fn(m, group.len(), |i, j| basis[(i, group[j])]);
            let select =
                |matrix: &DMatrix<f64>| DMatrix::from_fn(group.len(), group.len(), |i, j| matrix[(group[i], group[j])]);
            modes.add_group(&part, &select(&c), &select(&k))?;
        }
        Ok(modes)
    }

    /// Adds the modes of a coupled group of coordinates. The columns of `part` span the group.
    fn add_group(&mut self, part: &DMatrix<f64>, c: &DMatrix<f64>, k: &DMatrix<f64>) -> Result<(), DefectiveModes> {
        // Eigenvalues closer than this fraction of the largest form a cluster. It is the square
        // root of the rounding error of a non-symmetric eigenvalue, the error of a nearly
        // defective pair.
        let cluster = 1e-7;
        // A mode is defective if `|θ|` is below this fraction of `2|λ| + |C|`: half of the
        // digits are then lost.
        let defective = 1e-7;
        let r = c.nrows();
        let out_of_range = DefectiveModes { lambda: Complex64::new(f64::NAN, 0.0) };
        let eigenvalues = if r == 1 { Some(quadratic_roots(c[0], k[0])) } else { companion_eigenvalues(c, k) };
        let eigenvalues =
            eigenvalues.filter(|all| all.iter().all(|l| l.re.is_finite() && l.im.is_finite())).ok_or(out_of_range)?;
        let scale = eigenvalues.iter().map(|l| l.norm()).fold(0.0, f64::max);
        let mut done = vec![false; eigenvalues.len()];
        let part = part.map(|x| Complex64::new(x, 0.0));
        let cc = c.map(|x| Complex64::new(x, 0.0));
        let unsymmetric = is_unsymmetric(c);
        for i in 0..eigenvalues.len() {
            // Keep the eigenvalue above the real axis of each pair. An
            // eigenvalue within rounding of the axis is real.
            let real = eigenvalues[i].im.abs() <= cluster * scale;
            if done[i] || (!real && eigenvalues[i].im < 0.0) {
                continue;
            }
            let members: Vec<usize> = (i..eigenvalues.len())
                .filter(|&j| !done[j] && (eigenvalues[j] - eigenvalues[i]).norm() <= cluster * scale)
                .collect();
            members.iter().for_each(|&j| done[j] = true);
            let mut lambda = members.iter().map(|&j| eigenvalues[j]).sum::<Complex64>() / members.len() as f64;
            if real {
                lambda.im = 0.0;
            }
            // A value has at most as many eigenvectors as there are coordinates.
            if members.len() > r {
                return Err(DefectiveModes { lambda });
            }
            // φ and ψ.
            let vectors = |lambda: Complex64| {
                let matrix = quadratic(&cc, k, lambda);
                let phi = null_space(&matrix, members.len())?;
                let psi = if unsymmetric { null_space(&matrix.transpose(), members.len())? } else { phi.clone() };
                Some((phi, psi))
            };
            let (mut phi, mut psi) = vectors(lambda).ok_or(out_of_range)?;
            let two_lambda_c = |lambda: Complex64| DMatrix::from_diagonal_element(r, r, 2.0 * lambda) + &cc;
            let mut theta = psi.transpose() * two_lambda_c(lambda) * &phi;
            if members.len() == 1 && theta[0].norm() > defective * scale {
                // One Newton step on ψᵀQ(λ)φ = 0 removes the rounding of the
                // unsymmetric eigenvalue problem.
                let correction = (psi.transpose() * quadratic(&cc, k, lambda) * &phi)[0] / theta[0];
                lambda -= if real { Complex64::new(correction.re, 0.0) } else { correction };
                (phi, psi) = vectors(lambda).ok_or(out_of_range)?;
                theta = psi.transpose() * two_lambda_c(lambda) * &phi;
            }
            if real {
                phi = real_basis(&phi).ok_or(out_of_range)?;
                psi = if unsymmetric { real_basis(&psi).ok_or(out_of_range)? } else { phi.clone() };
                theta = psi.transpose() * two_lambda_c(lambda) * &phi;
            }
            let size = (2.0 * lambda.norm() + c.norm()).max(f64::MIN_POSITIVE);
            let values = eigen::svd(theta.clone()).ok_or(out_of_range)?.singular_values;
            let singular = values.min() <= defective * size;
            let inverse = if singular { None } else { theta.try_inverse() };
            let Some(inverse) = inverse else { return Err(DefectiveModes { lambda }) };
            let left = inverse * psi.transpose();
            let weight = if real { 1.0 } else { 2.0 };
            let lambda_c = DMatrix::from_diagonal_element(r, r, lambda) + &cc;
            let m = part.nrows();
            let (shape, rows_q, rows_v) = (
                &part * &phi * Complex64::new(weight, 0.0),
                &left * lambda_c * part.transpose(),
                left * part.transpose(),
            );
            for j in 0..members.len() {
                self.lambda.push(lambda);
                let count = self.lambda.len();
                let zero = Complex64::new(0.0, 0.0);
                let empty = || DMatrix::from_element(0, m, zero);
                self.shape = std::mem::replace(&mut self.shape, DMatrix::zeros(0, 0)).insert_column(count - 1, zero);
                self.shape.set_column(count - 1, &shape.column(j));
                for (rows, target) in [(&rows_q, &mut self.from_displacement), (&rows_v, &mut self.from_velocity)] {
                    *target = std::mem::replace(target, empty()).insert_row(count - 1, zero);
                    target.set_row(count - 1, &rows.row(j));
                }
            }
        }
        Ok(())
    }
}

/// Stores the free directions in `free`. Returns an orthonormal basis of the other directions,
/// which consists of undamped modes if possible.
fn split_free(
    damping: &DMatrix<f64>,
    undamped: &SymmetricEigen<f64, Dyn>,
    free: &mut DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let m = damping.nrows();
    let largest = undamped.eigenvalues.amax();
    let soft: Vec<usize> = (0..m).filter(|&i| undamped.eigenvalues[i].abs() <= RIGID * largest).collect();
    let mut columns: Vec<DVector<f64>> =
        (0..m).filter(|i| !soft.contains(i)).map(|i| undamped.eigenvectors.column(i).into_owned()).collect();
    if !soft.is_empty() {
        let null = undamped.eigenvectors.select_columns(&soft);
        // The quadratic form of a gyroscopic matrix vanishes. Instead, the test uses the
        // products of the direction with the matrix and its transpose.
        let (resists, threshold) = if is_unsymmetric(damping) {
            (damping.transpose() * damping + damping * damping.transpose(), (RIGID * damping.amax()).powi(2))
        } else {
            (damping.clone(), RIGID * damping.amax())
        };
        let inner = eigen::symmetric(null.transpose() * resists * &null)?;
        let mut free_columns = Vec::new();
        for i in 0..soft.len() {
            let direction = &null * inner.eigenvectors.column(i);
            if inner.eigenvalues[i].abs() <= threshold { free_columns.push(direction) } else { columns.push(direction) }
        }
        if !free_columns.is_empty() {
            *free = DMatrix::from_columns(&free_columns);
        }
    }
    Some(if columns.is_empty() { DMatrix::zeros(m, 0) } else { DMatrix::from_columns(&columns) })
}

/// Returns true if a damping matrix is not symmetric.
fn is_unsymmetric(damping: &DMatrix<f64>) -> bool {
    // A damping matrix is not symmetric if mirrored entries differ by more than this fraction of
    // the largest entry.
    (damping - damping.transpose()).amax() > 1e-12 * damping.amax()
}

/// Returns the groups of coordinates that damping or stiffness couples.
fn coupled_groups(c: &DMatrix<f64>, k: &DMatrix<f64>) -> Vec<Vec<usize>> {
    let r = c.nrows();
    // Damping couples two undamped modes if its entry exceeds this fraction of the largest.
    let (c_scale, k_scale) = (1e-14 * c.amax(), 10.0 * RIGID * k.amax());
    let one_way = |i: usize, j: usize| c[(i, j)].abs() > c_scale || k[(i, j)].abs() > k_scale;
    let coupled = |i: usize, j: usize| one_way(i, j) || one_way(j, i);
    let mut left: Vec<usize> = (0..r).collect();
    let mut groups = Vec::new();
    while let Some(first) = left.pop() {
        let mut group = vec![first];
        let mut next = 0;
        while next < group.len() {
            let i = group[next];
            let (linked, rest): (Vec<usize>, Vec<usize>) = left.iter().partition(|&&j| coupled(i, j));
            group.extend(linked);
            left = rest;
            next += 1;
        }
        group.sort_unstable();
        groups.push(group);
    }
    groups
}

/// Returns the roots of λ² + cλ + k without cancellation.
fn quadratic_roots(c: f64, k: f64) -> Vec<Complex64> {
    let discriminant = 0.25 * c * c - k;
    if discriminant < 0.0 {
        let root = (-discriminant).sqrt();
        return vec![Complex64::new(-0.5 * c, root), Complex64::new(-0.5 * c, -root)];
    }
    let large = -(0.5 * c + discriminant.sqrt().copysign(c));
    let small = if large == 0.0 { 0.0 } else { k / large };
    vec![Complex64::new(large, 0.0), Complex64::new(small, 0.0)]
}

/// Returns the eigenvalues of the companion matrix, scaled by a frequency.
fn companion_eigenvalues(c: &DMatrix<f64>, k: &DMatrix<f64>) -> Option<Vec<Complex64>> {
    let r = c.nrows();
    let omega = k.amax().sqrt().max(c.amax()).max(f64::MIN_POSITIVE);
    let mut companion = DMatrix::zeros(2 * r, 2 * r);
    for i in 0..r {
        companion[(i, r + i)] = omega;
        for j in 0..r {
            companion[(r + i, j)] = -k[(i, j)] / omega;
            companion[(r + i, r + j)] = -c[(i, j)];
        }
    }
    // Maximum number of QR steps per eigenvalue; 2 to 4 are usual.
    let steps = 40 * (2 * r + 1);
    let finite = companion.iter().all(|x| x.is_finite());
    let schur = finite.then(|| Schur::try_new(companion.clone(), f64::EPSILON, steps))?;
    // The real iteration gives exact pairs. If it does not converge, the complex iteration does.
    schur.map(|schur| schur.complex_eigenvalues().iter().copied().collect()).or_else(|| eigen::eigenvalues(&companion))
}

/// Returns `λ² + λ C + K`.
fn quadratic(c: &DMatrix<Complex64>, k: &DMatrix<f64>, lambda: Complex64) -> DMatrix<Complex64> {
    DMatrix::from_fn(k.nrows(), k.ncols(), |i, j| {
        let diagonal = if i == j { lambda * lambda } else { Complex64::new(0.0, 0.0) };
        diagonal + c[(i, j)] * lambda + k[(i, j)]
    })
}

/// Returns a real basis of the span of the columns. A real basis must exist.
fn real_basis(columns: &DMatrix<Complex64>) -> Option<DMatrix<Complex64>> {
    let (r, count) = columns.shape();
    let parts =
        DMatrix::from_fn(r, 2 * count, |i, j| if j < count { columns[(i, j)].re } else { columns[(i, j - count)].im });
    let svd = eigen::svd(parts)?;
    let u = svd.u.expect("asked for");
    let mut order: Vec<usize> = (0..svd.singular_values.len()).collect();
    order.sort_by(|&a, &b| svd.singular_values[b].total_cmp(&svd.singular_values[a]));
    Some(DMatrix::from_fn(r, count, |i, j| Complex64::new(u[(i, order[j])], 0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The modal coordinates recover `q` and `q'` and satisfy the equation of the system.
    fn check(c: &DMatrix<f64>, k: &DMatrix<f64>, tolerance: f64) {
        let m = c.nrows();
        let modes = QuadraticModes::new(c, k).unwrap();
        let count: usize = modes.lambda.iter().map(|l| if l.im == 0.0 { 1 } else { 2 }).sum();
        assert_eq!(count + 2 * modes.free.ncols(), 2 * m);
        let (q, v) = (DVector::from_fn(m, |i, _| 1.0 + i as f64), DVector::from_fn(m, |i, _| 0.3 - 0.2 * i as f64));
        let complex = |x: &DVector<f64>| x.map(|x| Complex64::new(x, 0.0));
        let eta = &modes.from_displacement * complex(&q) + &modes.from_velocity * complex(&v);
        let free = &modes.free * (modes.free.transpose() * &q);
        let free_v = &modes.free * (modes.free.transpose() * &v);
        let lambda_eta = DVector::from_fn(eta.len(), |i, _| modes.lambda[i] * eta[i]);
        let lambda2_eta = DVector::from_fn(eta.len(), |i, _| modes.lambda[i] * lambda_eta[i]);
        let real = |x: &DVector<Complex64>| (&modes.shape * x).map(|z| z.re);
        let size = 1.0 + k.amax();
        assert!((real(&eta) + free - &q).amax() < tolerance * size, "displacement");
        assert!((real(&lambda_eta) + free_v - &v).amax() < tolerance * size, "velocity");
        assert!((real(&lambda2_eta) + c * &v + k * &q).amax() < tolerance * size * size, "equation");
    }

    #[test]
    fn repeated_free_and_overdamped_modes() {
        use nalgebra::dmatrix;
        check(&DMatrix::zeros(3, 3), &DMatrix::identity(3, 3), 1e-13); // threefold eigenvalue
        check(&(DMatrix::identity(3, 3) * 0.2), &DMatrix::identity(3, 3), 1e-13);
        check(&DMatrix::zeros(2, 2), &dmatrix![1.0, -1.0; -1.0, 1.0], 1e-13); // free together
        check(&dmatrix![0.5, 0.0; 0.0, 0.0], &dmatrix![1.0, -1.0; -1.0, 1.0], 1e-12);
        check(&dmatrix![5.0], &dmatrix![1.0], 1e-13); // overdamped
        check(&dmatrix![0.1], &dmatrix![0.0], 1e-13); // damped, without stiffness
        check(&dmatrix![0.0], &dmatrix![0.0], 1e-13);
        // Two equal pairs of masses, with damping that couples the masses of each pair.
        let (c, k) = (dmatrix![0.3, 0.0; 0.0, 0.0], dmatrix![2.0, -1.0; -1.0, 1.5]);
        let twice =
            |a: &DMatrix<f64>| DMatrix::from_fn(4, 4, |i, j| if i / 2 == j / 2 { a[(i % 2, j % 2)] } else { 0.0 });
        check(&twice(&c), &twice(&k), 1e-10);
        // Mixed by a rotation, which hides the two groups.
        let h = 0.5f64.sqrt();
        let turn = dmatrix![h, 0.0, h, 0.0; 0.0, h, 0.0, h; -h, 0.0, h, 0.0; 0.0, -h, 0.0, h];
        check(&(&turn * twice(&c) * turn.transpose()), &(&turn * twice(&k) * turn.transpose()), 1e-10);
        assert!(QuadraticModes::new(&dmatrix![2.0], &dmatrix![1.0]).is_err(), "critical damping is defective");
    }

    /// A chain of many masses with dampers that couple all of its modes; then two such chains
    /// in parallel, with pairs of equal modes.
    #[test]
    fn chains_with_nonproportional_damping() {
        let n = 24;
        let chain = |of: fn(usize) -> f64| {
            DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
                0 => of(i) + of(i + 1),
                1 => -of(i.max(j)),
                _ => 0.0,
            })
        };
        let (c, k) = (chain(|i| 1e-3 * (1.0 + (i % 5) as f64)), chain(|i| 1.0 + 0.1 * (i % 3) as f64));
        check(&c, &k, 1e-11);
        let twice = |a: &DMatrix<f64>| a.kronecker(&DMatrix::<f64>::identity(2, 2));
        let turn = DMatrix::from_fn(2 * n, 2 * n, |i, j| (0.3 + (i * j) as f64).sin()).qr().q();
        check(&(&turn * twice(&c) * turn.transpose()), &(&turn * twice(&k) * turn.transpose()), 1e-8);
    }

    #[test]
    fn gyroscopic_modes() {
        use nalgebra::dmatrix;
        let k = dmatrix![12e3, -3e3; -3e3, 15e3];
        check(&dmatrix![2.0, 50.0; -50.0, 2.0], &k, 1e-12);
        check(&dmatrix![2.0, 50.0; 0.0, 2.0], &k, 1e-12); // in one direction only
        check(&dmatrix![0.0, 50.0; -50.0, 0.0], &k, 1e-12);
        check(&dmatrix![0.1, 0.3; 0.0, 0.2], &dmatrix![1.0, 0.0; 0.0, 4.0], 1e-12);
        // A charge in a magnetic field: two motions circle, and one body stays
        // at rest in its position.
        check(
            &dmatrix![0.0, 1.0, 0.0; -1.0, 0.0, 0.0; 0.0, 0.0, 0.0],
            &dmatrix![1.0, 0.0, 0.0; 0.0, 2.0, 0.0; 0.0, 0.0, 0.0],
            1e-12,
        );
    }

    proptest! {
        #[test]
        fn random_gyroscopic_systems(entries in prop::collection::vec(-1.0..1.0f64, 48), size in 2usize..5) {
            let part = |first: usize| DMatrix::from_fn(size, size, |i, j| entries[first + i * 4 + j]);
            let (a, b, g) = (part(0), part(16), part(32));
            let k = &a * a.transpose() + DMatrix::identity(size, size) * 0.1;
            check(&(&b * b.transpose() * 0.05 + (&g - g.transpose()) * 0.3), &k, 1e-8);
        }

        #[test]
        fn random_systems(entries in prop::collection::vec(-1.0..1.0f64, 32), size in 1usize..5) {
            let a = DMatrix::from_fn(size, size, |i, j| entries[i * 4 + j]);
            let b = DMatrix::from_fn(size, size, |i, j| entries[16 + i * 4 + j]);
            let (k, c) = (&a * a.transpose(), &b * b.transpose() * 0.05);
            check(&c, &k, 1e-8);
        }
    }
}
