//! Eigenvalues and singular values by iterations with a bounded number of steps.
//!
//! - [`symmetric`] and [`svd`]: nalgebra's decompositions with a bound on their iterations.
//! - [`eigenvalues`]: all eigenvalues of a general matrix, by deflation of exact
//!   zeros, balancing, and QR iteration of the Hessenberg form with Wilkinson's
//!   shift. A subdiagonal entry counts as zero relative to the *whole* matrix. The
//!   usual test compares it with its diagonal neighbours, and never passes where
//!   these vanish: return maps of sticking contacts have large nilpotent parts.
//! - [`largest_modulus`]: only the largest modulus of a large matrix, by an Arnoldi process
//!   that grows until the eigenvalue has converged.
//!
//! Source: Golub and Van Loan, "Matrix Computations" (2013), Sec. 7.4, 7.5 and
//! 10.5; Parlett and Reinsch (1969) for balancing.

use crate::dense::{Transpose, cholesky_blocked, solve_lower_blocked};
use crate::interrupt;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, SelfAdjointEvdParams, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::{ColMut, MatMut, MatRef, Par, Spec};
use nalgebra::{ComplexField, DMatrix, DVector, Dyn, SVD, SymmetricEigen};
use num_complex::Complex64;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Maximum number of QR steps per eigenvalue; 2 to 4 are usual.
const STEPS: usize = 40;

/// Returns the eigenvalues and eigenvectors of a symmetric matrix, or `None` if an entry is not
/// finite or the iteration does not converge.
pub fn symmetric(matrix: DMatrix<f64>) -> Option<SymmetricEigen<f64, Dyn>> {
    // Size from which symmetric matrices are decomposed in blocks. Measured: reducing a
    // structure with 900 ports took 7.5 s, mostly in three such decompositions. With blocks it
    // takes 1.8 s.
    if matrix.nrows() >= 256 {
        let (values, eigenvectors) = symmetric_blocked(&matrix)?;
        return Some(SymmetricEigen { eigenvalues: DVector::from_vec(values), eigenvectors });
    }
    let steps = STEPS * (matrix.nrows() + 1);
    let found = finite(&matrix).then(|| SymmetricEigen::try_new(matrix.clone(), f64::EPSILON, steps))?;
    // For a matrix with many zero rows nalgebra may return NaN, which later
    // comparisons would not notice.
    if found.as_ref().is_some_and(|found| found.eigenvalues.iter().chain(&found.eigenvectors).all(|x| x.is_finite())) {
        return found;
    }
    let (values, eigenvectors) = symmetric_blocked(&matrix)?;
    Some(SymmetricEigen { eigenvalues: DVector::from_vec(values), eigenvectors })
}

/// Returns the eigenvalues, rising, and the eigenvectors of a large symmetric
/// matrix, in blocks that stay in the cache.
///
/// Reads the lower triangle. Returns `None` if an entry is not finite or the
/// iteration does not converge.
///
/// # Example
/// ```
/// use nalgebra::dmatrix;
/// let (values, vectors) =
///     stickslip_numerics::eigen::symmetric_blocked(&dmatrix![2.0, 1.0; 1.0, 2.0]).unwrap();
/// assert!((values[0] - 1.0).abs() < 1e-14 && (values[1] - 3.0).abs() < 1e-14);
/// assert!((vectors[(0, 1)] - vectors[(1, 1)]).abs() < 1e-14);
/// ```
pub fn symmetric_blocked(matrix: &DMatrix<f64>) -> Option<(Vec<f64>, DMatrix<f64>)> {
    let n = matrix.nrows();
    if !finite(matrix) || matrix.ncols() != n {
        return None;
    }
    let params = Spec::<SelfAdjointEvdParams, f64>::default();
    let mut memory = MemBuffer::new(self_adjoint_evd_scratch::<f64>(n, ComputeEigenvectors::Yes, Par::Seq, params));
    let (mut values, mut vectors) = (vec![0.0; n], DMatrix::zeros(n, n));
    let (kept, stack) = (ColMut::from_slice_mut(&mut values).as_diagonal_mut(), MemStack::new(&mut memory));
    let wanted = MatMut::from_column_major_slice_mut(vectors.as_mut_slice(), n, n);
    let read = MatRef::from_column_major_slice(matrix.as_slice(), n, n);
    self_adjoint_evd(read, kept, Some(wanted), Par::Seq, stack, params).ok()?;
    Some((values, vectors))
}

/// Solves the symmetric generalized eigenvalue problem `A x = θ H x`. Returns θ, rising, and
/// vectors X with `Xᵀ H X = 1`, `Xᵀ A X = θ`.
///
/// The coordinates may have any units. Returns `None` if H is not positive definite, an entry
/// is not finite or the iteration does not converge.
///
/// # Example
/// ```
/// use nalgebra::dmatrix;
/// let (values, vectors) = stickslip_numerics::eigen::generalized_symmetric(
///     &dmatrix![3.0, 0.0; 0.0, 8.0],
///     &dmatrix![1.0, 0.0; 0.0, 4.0],
/// )
/// .unwrap();
/// assert!((values[0] - 2.0).abs() < 1e-14 && (values[1] - 3.0).abs() < 1e-14);
/// assert!((vectors[(1, 0)].abs() - 0.5).abs() < 1e-14 && vectors[(0, 0)].abs() < 1e-14);
/// ```
pub fn generalized_symmetric(a: &DMatrix<f64>, h: &DMatrix<f64>) -> Option<(Vec<f64>, DMatrix<f64>)> {
    let n = h.nrows();
    if n == 0 {
        return Some((Vec::new(), DMatrix::zeros(0, 0)));
    }
    // Scale to a unit diagonal, so that the units of the coordinates do not matter.
    let unit = h.diagonal().map(|v| 1.0 / v.sqrt());
    let scaled = |matrix: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, k| unit[i] * matrix[(i, k)] * unit[k]);
    let mut lower = scaled(h);
    if !cholesky_blocked(lower.as_mut_slice(), n) {
        return None;
    }
    let solve = |mut right: DMatrix<f64>, transpose: Transpose| {
        solve_lower_blocked(lower.as_slice(), n, right.as_mut_slice(), transpose);
        right
    };
    let (values, vectors) = symmetric_blocked(&solve(solve(scaled(a), Transpose::No).transpose(), Transpose::No))?;
    let mut vectors = solve(vectors, Transpose::Yes);
    for mut column in vectors.column_iter_mut() {
        column.component_mul_assign(&unit);
    }
    Some((values, vectors))
}

/// Returns the singular value decomposition, or `None` if the matrix is empty, an entry is not
/// finite or the iteration does not converge.
pub fn svd<T: ComplexField<RealField = f64>>(matrix: DMatrix<T>) -> Option<SVD<T, Dyn, Dyn>> {
    let steps = STEPS * (matrix.nrows().max(matrix.ncols()) + 1);
    let usable = !matrix.is_empty() && matrix.iter().all(|z| z.clone().modulus().is_finite());
    let found = usable.then(|| SVD::try_new(matrix, true, true, 5.0 * f64::EPSILON, steps))?;
    found.filter(|found| found.singular_values.iter().all(|value| value.is_finite()))
}

/// Returns all eigenvalues of a square matrix, in no particular order, or `None` if an entry is
/// not finite or the iteration does not converge.
///
/// # Example
/// ```
/// use nalgebra::dmatrix;
/// let turn = stickslip_numerics::eigen::eigenvalues(&dmatrix![0.0, -2.0; 2.0, 0.0]).unwrap();
/// assert!((turn[0].im.abs() - 2.0).abs() < 1e-14 && turn[0].re.abs() < 1e-14);
/// ```
pub fn eigenvalues(matrix: &DMatrix<f64>) -> Option<Vec<Complex64>> {
    if !finite(matrix) {
        return None;
    }
    let (core, zeros) = deflated(matrix);
    let mut found = match core.nrows() {
        0 => Vec::new(),
        1 => vec![Complex64::new(core[0], 0.0)],
        _ => hessenberg_eigenvalues(balanced(core).hessenberg().unpack_h().map(|x| Complex64::new(x, 0.0)))?,
    };
    found.resize(found.len() + zeros, ZERO);
    Some(found)
}

/// Returns the largest modulus of the eigenvalues, zero for an empty matrix.
///
/// Returns `None` if an entry is not finite or the iteration does not converge.
///
/// # Example
/// ```
/// use nalgebra::dmatrix;
/// let largest =
///     stickslip_numerics::eigen::largest_modulus(&dmatrix![0.5, 1e3; 0.0, -0.9]).unwrap();
/// assert!((largest - 0.9).abs() < 1e-13);
/// ```
pub fn largest_modulus(matrix: &DMatrix<f64>) -> Option<f64> {
    if !finite(matrix) {
        return None;
    }
    let (core, _) = deflated(matrix);
    // Size from which computing the largest eigenvalue alone is cheaper than computing all.
    if core.nrows() > 64
        && let Some(largest) = arnoldi(&balanced(core.clone()))
    {
        return Some(largest);
    }
    Some(eigenvalues(&core)?.iter().map(|z| z.norm()).fold(0.0, f64::max))
}

fn finite(matrix: &DMatrix<f64>) -> bool {
    matrix.iter().all(|x| x.is_finite())
}

/// Removes zero rows and columns repeatedly until none is left. Returns the remaining matrix
/// and the number of zero eigenvalues removed.
fn deflated(matrix: &DMatrix<f64>) -> (DMatrix<f64>, usize) {
    let mut kept: Vec<usize> = (0..matrix.nrows()).collect();
    loop {
        let empty =
            |i: usize| kept.iter().all(|&k| matrix[(i, k)] == 0.0) || kept.iter().all(|&k| matrix[(k, i)] == 0.0);
        let left: Vec<usize> = kept.iter().copied().filter(|&i| !empty(i)).collect();
        if left.len() == kept.len() {
            let core = DMatrix::from_fn(kept.len(), kept.len(), |i, k| matrix[(kept[i], kept[k])]);
            return (core, matrix.nrows() - kept.len());
        }
        kept = left;
    }
}

/// Returns a similar matrix in which the largest entries of row i and column i
/// agree to a factor of two.
///
/// This removes the effect of different units of the states. The factors are
/// powers of two, so nothing is rounded.
fn balanced(mut matrix: DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    // Maximum number of balancing sweeps; 3 or 4 are usual.
    for _ in 0..20 {
        let mut changed = false;
        for i in 0..n {
            let off = |k: usize| k != i;
            let row = (0..n).filter(|&k| off(k)).map(|k| matrix[(i, k)].abs()).fold(0.0, f64::max);
            let column = (0..n).filter(|&k| off(k)).map(|k| matrix[(k, i)].abs()).fold(0.0, f64::max);
            // The square root of either may be out of range, but not the
            // difference of the exponents.
            let power = if row > 0.0 && column > 0.0 { (0.5 * (row.log2() - column.log2())).round() } else { 0.0 };
            if power != 0.0 && power.abs() < 500.0 {
                let factor = power.exp2();
                matrix.column_mut(i).scale_mut(factor);
                matrix.row_mut(i).scale_mut(1.0 / factor);
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    matrix
}

/// Returns the eigenvalues of an upper Hessenberg matrix.
fn hessenberg_eigenvalues(mut h: DMatrix<Complex64>) -> Option<Vec<Complex64>> {
    let n = h.nrows();
    let small = f64::EPSILON * h.norm();
    if !small.is_finite() {
        return None;
    }
    let mut found = Vec::with_capacity(n);
    let (mut end, mut steps) = (n, 0);
    while end > 0 {
        interrupt::check();
        // The last unreduced block.
        let mut start = end - 1;
        while start > 0 && h[(start, start - 1)].norm() > small {
            start -= 1;
        }
        if start + 1 == end {
            found.push(h[(end - 1, end - 1)]);
            (end, steps) = (end - 1, 0);
            continue;
        }
        if steps == STEPS {
            return None;
        }
        steps += 1;
        // After this number of steps without an eigenvalue, an exceptional shift breaks a cycle.
        let shift =
            if steps % 10 == 0 { h[(end - 1, end - 1)] + h[(end - 1, end - 2)].norm() } else { wilkinson(&h, end) };
        qr_step(&mut h, start, end, shift);
    }
    Some(found)
}

/// Returns the eigenvalue of the last 2 × 2 block that is closer to its corner entry.
fn wilkinson(h: &DMatrix<Complex64>, end: usize) -> Complex64 {
    let (a, b) = (h[(end - 2, end - 2)], h[(end - 2, end - 1)]);
    let (c, d) = (h[(end - 1, end - 2)], h[(end - 1, end - 1)]);
    let half = (a - d) * 0.5;
    let root = (half * half + b * c).sqrt();
    // d - bc / (half ± root), with the sign that avoids cancellation.
    let sum = if (half + root).norm() >= (half - root).norm() { half + root } else { half - root };
    if sum == ZERO { d } else { d - b * c / sum }
}

/// Performs one QR step, `H - μ = Q R`, `H := R Q + μ`, within rows and columns
/// `start..end`, by plane rotations.
fn qr_step(h: &mut DMatrix<Complex64>, start: usize, end: usize, shift: Complex64) {
    for i in start..end {
        h[(i, i)] -= shift;
    }
    let mut rotations = Vec::with_capacity(end - start);
    for k in start..end - 1 {
        let (x, y) = (h[(k, k)], h[(k + 1, k)]);
        let length = x.norm().hypot(y.norm());
        let (c, s) = if length == 0.0 { (Complex64::new(1.0, 0.0), ZERO) } else { (x / length, y / length) };
        for j in k..end {
            let (above, below) = (h[(k, j)], h[(k + 1, j)]);
            h[(k, j)] = c.conj() * above + s.conj() * below;
            h[(k + 1, j)] = c * below - s * above;
        }
        rotations.push((c, s));
    }
    for (k, (c, s)) in (start..).zip(rotations) {
        for i in start..(k + 2).min(end) {
            let (left, right) = (h[(i, k)], h[(i, k + 1)]);
            h[(i, k)] = c * left + s * right;
            h[(i, k + 1)] = c.conj() * right - s.conj() * left;
        }
    }
    for i in start..end {
        h[(i, i)] += shift;
    }
}

/// Returns the largest modulus by an Arnoldi process whose dimension doubles
/// until the leading eigenvalues have converged.
///
/// Returns `None` if they have not at half of the full dimension: computing all
/// eigenvalues then costs no more.
fn arnoldi(matrix: &DMatrix<f64>) -> Option<f64> {
    let n = matrix.nrows();
    let most = n / 2;
    let mut basis = DMatrix::zeros(n, most + 1);
    let mut h = DMatrix::zeros(most + 1, most);
    // The start vector needs a component along every eigenvector. Golden-ratio steps never repeat.
    let first = DVector::from_fn(n, |i, _| 0.5 + (i as f64 * 0.618_033_988_749_894_9).fract());
    basis.set_column(0, &first.normalize());
    // First dimension of the Arnoldi process; it doubles from there.
    let mut check = 24.min(most);
    for k in 0..most {
        interrupt::check();
        let mut next = matrix * basis.column(k);
        let before = next.norm();
        // Orthogonalize twice, to recover the digits that cancel the first time.
        for _ in 0..2 {
            let part = basis.columns(0, k + 1).tr_mul(&next);
            next -= basis.columns(0, k + 1) * &part;
            let mut column = h.view_mut((0, k), (k + 1, 1));
            column += part;
        }
        let length = next.norm();
        if length <= f64::EPSILON * before {
            return None; // an invariant subspace says nothing about the other eigenvalues
        }
        h[(k + 1, k)] = length;
        basis.set_column(k + 1, &(next / length));
        if k + 1 == check {
            let square = h.view((0, 0), (check, check)).into_owned();
            let found = hessenberg_eigenvalues(square.map(|x| Complex64::new(x, 0.0)))?;
            let largest = found.iter().map(|z| z.norm()).fold(0.0, f64::max);
            // Residual, relative to the eigenvalue, at which an eigenvalue of the Arnoldi
            // process has converged. Its error is then far below the threshold of stability
            // decisions (1e-6), even if the eigenvectors are a hundred times worse conditioned
            // than orthogonal ones.
            let converged = |value: Complex64| residual(&square, value, length) <= 1e-9 * largest;
            // Eigenvalues with a modulus above this fraction of the largest must converge too,
            // because one of them may still exceed it.
            if found.iter().filter(|z| z.norm() >= 0.9 * largest).all(|z| converged(*z)) {
                return Some(largest);
            }
            check = (2 * check).min(most);
        }
    }
    None
}

/// Returns the residual of an eigenvalue of the Arnoldi process: the last entry of its
/// eigenvector times the next subdiagonal entry.
fn residual(square: &DMatrix<f64>, value: Complex64, next: f64) -> f64 {
    let n = square.nrows();
    // Inverse iteration. The offset by rounding keeps the shifted matrix regular.
    let offset = f64::EPSILON * square.norm();
    let shifted = square.map(|x| Complex64::new(x, 0.0)) - DMatrix::from_diagonal_element(n, n, value + offset);
    let factor = shifted.lu();
    let mut vector = DVector::from_element(n, Complex64::new(1.0, 0.0));
    for _ in 0..2 {
        let Some(solved) = factor.solve(&vector) else { return f64::INFINITY };
        let size = solved.norm();
        if !(size.is_finite() && size > 0.0) {
            return f64::INFINITY;
        }
        vector = solved / Complex64::new(size, 0.0);
    }
    vector[n - 1].norm() * next
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;
    use proptest::prelude::*;

    fn noise(i: usize) -> f64 {
        (i as f64 * 0.618_033_988_749_894_9 + 0.37).fract() - 0.5
    }

    /// Returns `S D S⁻¹` with a unit lower triangular `S`.
    fn with_eigenvalues(block: &DMatrix<f64>) -> DMatrix<f64> {
        let n = block.nrows();
        let s = DMatrix::from_fn(n, n, |i, k| {
            if i == k {
                1.0
            } else if i > k {
                0.3 * noise(i * n + k)
            } else {
                0.0
            }
        });
        &s * block * s.clone().try_inverse().unwrap()
    }

    /// Returns a matrix with known eigenvalues `r e^{±jφ}`, the last one real
    /// for odd n, and their moduli.
    fn planted(n: usize, top: f64) -> (DMatrix<f64>, Vec<f64>) {
        let mut block = DMatrix::zeros(n, n);
        let mut moduli = Vec::new();
        for i in (0..n).step_by(2) {
            let r = top * 0.98f64.powi(i as i32 / 2);
            let (sin, cos) = (1.0 + i as f64).sin_cos();
            if i + 1 == n {
                block[(i, i)] = r;
                moduli.push(r);
            } else {
                block.view_mut((i, i), (2, 2)).copy_from(&dmatrix![r * cos, -r * sin; r * sin, r * cos]);
                moduli.extend([r, r]);
            }
        }
        (with_eigenvalues(&block), moduli)
    }

    /// Products of five directions among thirty: nalgebra returns NaN for two of their
    /// eigenvalues, in blocks of one, two and three rows.
    #[test]
    fn rows_of_zeros_leave_numbers() {
        let entries = [
            (4, 4, 0.5731315910132967),
            (8, 4, -0.8321290738060748),
            (8, 8, 2.416334420683823),
            (21, 8, -1.1017587806194558),
            (21, 21, 1.0047221943132723),
            (7, 7, 0.5442176870748298),
            (20, 7, -0.5536069438123217),
            (20, 20, 0.56315819113589),
            (14, 14, 0.7699414844471819),
            (27, 27, 0.752558699578567),
            (29, 27, -0.7661718256644131),
            (29, 29, 0.7800312012480498),
        ];
        let mut matrix = DMatrix::zeros(30, 30);
        for (i, k, value) in entries {
            (matrix[(i, k)], matrix[(k, i)]) = (value, value);
        }
        let found = symmetric(matrix.clone()).unwrap();
        let zeros = found.eigenvalues.iter().filter(|value| value.abs() < 1e-14).count();
        assert_eq!(zeros, 25, "{}", found.eigenvalues);
        assert!((found.eigenvalues.sum() - matrix.trace()).abs() < 1e-14);
        let rest = &matrix * &found.eigenvectors - &found.eigenvectors * DMatrix::from_diagonal(&found.eigenvalues);
        assert!(rest.amax() < 1e-14);
        let one = found.eigenvectors.transpose() * &found.eigenvectors;
        assert!((one - DMatrix::identity(30, 30)).amax() < 1e-14);
    }

    #[test]
    fn all_eigenvalues_of_planted_matrices() {
        for n in [1, 2, 3, 7, 24, 61] {
            let (matrix, mut moduli) = planted(n, 1.1);
            let mut found: Vec<f64> = eigenvalues(&matrix).unwrap().iter().map(|z| z.norm()).collect();
            moduli.sort_by(f64::total_cmp);
            found.sort_by(f64::total_cmp);
            assert_eq!(found.len(), n);
            for (a, b) in found.iter().zip(&moduli) {
                assert!((a - b).abs() < 1e-10, "{n}: {a} {b}");
            }
        }
    }

    /// Nilpotent parts, which made an unbounded iteration hang: a Jordan block
    /// of zeros, plain and under a similarity.
    #[test]
    fn nilpotent_parts_end() {
        for n in [2, 10, 40, 150] {
            let mut shift = DMatrix::zeros(n, n);
            for i in 1..n {
                shift[(i, i - 1)] = 1.0;
            }
            assert!(eigenvalues(&shift).unwrap().iter().all(|z| *z == ZERO));
            shift[(0, 0)] = 0.5;
            let largest = largest_modulus(&with_eigenvalues(&shift)).unwrap();
            // The n-th root of the rounding of the matrix perturbs a chain of n
            // zeros: up to one for a long chain.
            assert!(n > 10 || (largest - 0.5).abs() < 0.1, "{n}: {largest}");
            // Rank one, like contacts that absorb their input.
            let rank_one = DMatrix::from_fn(n, n, |i, k| noise(i) * (1.0 + noise(k + 7)));
            let trace = rank_one.trace().abs();
            assert!((largest_modulus(&rank_one).unwrap() - trace).abs() < 1e-9 * n as f64, "{n}");
        }
    }

    /// The Arnoldi process finds the known largest modulus.
    #[test]
    fn the_largest_of_many() {
        for (n, top) in [(80, 1.0 + 1e-5), (200, 0.7), (300, 1.3)] {
            let (matrix, _) = planted(n, top);
            assert!((largest_modulus(&matrix).unwrap() - top).abs() < 1e-9, "{n}");
        }
        // One eigenvalue far away from the others, in the middle of the matrix.
        let mut single = DMatrix::from_diagonal_element(150, 150, 0.2);
        single[(97, 97)] = -1.01;
        assert!((largest_modulus(&single).unwrap() - 1.01).abs() < 1e-12);
    }

    /// Units do not matter: a similarity by a diagonal of thirty decades.
    #[test]
    fn units_do_not_matter() {
        let (matrix, _) = planted(30, 1.05);
        let unit = |i: usize| 10f64.powi((i as i32 % 7 - 3) * 5);
        let scaled = DMatrix::from_fn(30, 30, |i, k| unit(i) * matrix[(i, k)] / unit(k));
        assert!((largest_modulus(&scaled).unwrap() - 1.05).abs() < 1e-9);
    }

    #[test]
    fn non_finite_matrices_have_no_eigenvalues() {
        assert_eq!(eigenvalues(&dmatrix![f64::NAN, 0.0; 1.0, 2.0]), None);
        assert_eq!(largest_modulus(&dmatrix![f64::INFINITY]), None);
        assert!(symmetric(dmatrix![1.0, f64::NAN; f64::NAN, 1.0]).is_none());
        assert!(svd(dmatrix![f64::INFINITY, 1.0; 0.0, 1.0]).is_none());
        assert!(svd(DMatrix::<f64>::zeros(0, 0)).is_none());
        assert_eq!(eigenvalues(&DMatrix::zeros(0, 0)), Some(vec![]));
        assert_eq!(largest_modulus(&DMatrix::zeros(0, 0)), Some(0.0));
    }

    proptest! {
        /// The trace and the determinant are the sum and the product of the eigenvalues.
        #[test]
        fn trace_and_determinant(entries in proptest::collection::vec(-1.0f64..1.0, 25)) {
            let matrix = DMatrix::from_vec(5, 5, entries);
            let found = eigenvalues(&matrix).unwrap();
            let (sum, product) = (found.iter().sum::<Complex64>(), found.iter().product::<Complex64>());
            prop_assert!((sum - matrix.trace()).norm() < 1e-12);
            prop_assert!((product - matrix.determinant()).norm() < 1e-11);
        }
    }
}
