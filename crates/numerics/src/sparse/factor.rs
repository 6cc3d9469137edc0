//! Real and complex factors of sparse matrices, and their solutions.

use super::matrix::SparseMatrix;
use super::symbolic::{Pattern, Symbolic};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::lblt::factor::LbltParams;
use faer::linalg::lu::partial_pivoting::factor::PartialPivLuParams;
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::supernodal::SupernodalIntranodeLbltRef;
use faer::sparse::linalg::cholesky::{IntranodeLbltRef, SymbolicCholeskyRaw};
use faer::sparse::linalg::lu::{LuRef, NumericLu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, MatRef, Par, Side, Spec};
use num_complex::Complex64;
use std::sync::Arc;

/// Error: the matrix is singular to rounding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "the matrix is singular: row {} (the first is 1) depends on the others; support the part that it belongs to",
    row + 1
)]
pub struct Singular {
    /// A row with a free motion, from 0.
    pub row: usize,
}

/// The factor `A = L D Lᵀ` of a real symmetric matrix.
#[derive(Debug, Clone)]
pub struct LdlFactor {
    pattern: Arc<Pattern>,
    ldl: LdlValues,
    negative: usize,
}

/// The factor of a complex matrix.
#[derive(Debug, Clone)]
pub struct ComplexFactor {
    pattern: Arc<Pattern>,
    kind: ComplexKind,
}

#[derive(Debug, Clone)]
enum ComplexKind {
    Symmetric(LdlValues),
    Exchanged(Box<NumericLu<u32, Complex64>>),
    Empty,
}

/// The numbers of `L D Lᵀ`. D has 1 × 1 and 2 × 2 pivots, with exchanges inside the supernodes.
#[derive(Debug, Clone)]
struct LdlValues {
    values: Vec<f64>,
    /// Off-diagonal entries of D.
    subdiagonal: Vec<f64>,
    order: Vec<u32>,
    inverse: Vec<u32>,
}

impl LdlFactor {
    pub(super) fn new(
        pattern: &Arc<Pattern>,
        sum: &[(f64, &SparseMatrix)],
        memory: Vec<f64>,
    ) -> Result<Self, Singular> {
        let empty = LdlValues { values: vec![], subdiagonal: vec![], order: vec![], inverse: vec![] };
        let mut factor = LdlFactor { pattern: pattern.clone(), ldl: empty, negative: 0 };
        if pattern.n == 0 {
            return Ok(factor);
        }
        let symbolic = pattern.real();
        let lower = pattern.lower_sum(sum);
        factor.ldl = LdlValues::new(symbolic, &lower, memory);
        let mut largest = vec![0.0f64; pattern.n];
        for column in 0..pattern.n {
            for at in symbolic.starts[column] as usize..symbolic.starts[column + 1] as usize {
                let (row, size) = (symbolic.rows[at] as usize, lower[at].abs());
                largest[row] = largest[row].max(size);
                largest[column] = largest[column].max(size);
            }
        }
        let (mut negative, mut singular_row) = (0, None);
        factor.ldl.pivots(symbolic, |row, pivot| {
            negative += usize::from(pivot < 0.0);
            // NaN is not a valid pivot.
            // A pivot of a real factor below this fraction of the largest entry of its row is
            // the rounding of entries that cancelled.
            if !(pivot.abs() > (64.0 * f64::EPSILON) * largest[row] && pivot.is_finite()) && singular_row.is_none() {
                singular_row = Some(row);
            }
        });
        if let Some(row) = singular_row {
            return Err(Singular { row });
        }
        factor.negative = negative;
        Ok(factor)
    }

    /// Factors another sum of the analysed matrices in the memory of this factor, like
    /// [`SymbolicAnalysis::factor`](super::SymbolicAnalysis::factor).
    ///
    /// Allocation takes a fifth of the time of a large factor.
    ///
    /// # Errors
    /// [`Singular`] if the sum is singular to rounding.
    ///
    /// # Panics
    /// If an entry lies outside the analysed pattern.
    pub fn refactor(self, sum: &[(f64, &SparseMatrix)]) -> Result<Self, Singular> {
        LdlFactor::new(&self.pattern, sum, self.ldl.values)
    }

    /// Returns the number of rows and columns.
    pub fn n(&self) -> usize {
        self.pattern.n
    }

    /// Returns the supernodes, or `None` for a matrix without rows.
    pub(super) fn supernodes(&self) -> Option<SupernodalIntranodeLbltRef<'_, u32, f64>> {
        (self.pattern.n > 0).then(|| self.ldl.supernodes(self.pattern.real()))
    }

    /// Returns the place of a row of the matrix in the elimination order.
    pub(super) fn elimination_place(&self, row: usize) -> usize {
        let at = self.pattern.real().cholesky.perm().map_or(row, |order| order.arrays().1[row] as usize);
        self.pivoted_place(at)
    }

    /// Returns the place of a row of the supernodes after the exchanges inside them.
    pub(super) fn pivoted_place(&self, row: usize) -> usize {
        self.ldl.inverse[row] as usize
    }

    /// Divides rows of length `k` by the pivots of the supernode that begins with row `first`.
    pub(super) fn divide_by_pivots(&self, first: usize, block: MatRef<'_, f64>, rows: &mut [f64], k: usize) {
        let mut at = 0;
        while at < block.ncols() {
            let (a, b) = (block[(at, at)], self.ldl.subdiagonal[first + at]);
            if b == 0.0 {
                rows[at * k..(at + 1) * k].iter_mut().for_each(|x| *x /= a);
                at += 1;
                continue;
            }
            let c = block[(at + 1, at + 1)];
            // Divide by the off-diagonal entry first, which is the largest.
            let (a, c) = (a / b, c / b);
            let scale = 1.0 / (b * (a * c - 1.0));
            let (upper, lower) = rows[at * k..(at + 2) * k].split_at_mut(k);
            for (x, y) in upper.iter_mut().zip(lower) {
                (*x, *y) = ((c * *x - *y) * scale, (a * *y - *x) * scale);
            }
            at += 2;
        }
    }

    /// Returns the number of negative pivots, which is the number of negative
    /// eigenvalues of the matrix.
    ///
    /// For `K - ω² M` with M positive definite it is the number of natural frequencies below ω.
    ///
    /// Source: Sylvester's law of inertia.
    pub fn negative_pivots(&self) -> usize {
        self.negative
    }

    /// Solves in place for right sides of length n, stored consecutively.
    ///
    /// # Panics
    /// If the length of `right` is not a multiple of n.
    pub fn solve(&self, right: &mut [f64]) {
        let n = self.pattern.n;
        if n == 0 || right.is_empty() {
            return;
        }
        assert!(right.len().is_multiple_of(n), "{} numbers do not form columns of length {n}", right.len());
        self.ldl.solve(self.pattern.real(), right);
    }
}

impl ComplexFactor {
    /// Returns the memory of the factor, bytes; an estimate if rows were exchanged.
    pub fn bytes(&self) -> usize {
        match &self.kind {
            ComplexKind::Symmetric(ldl) => size_of::<f64>() * (ldl.values.len() + ldl.subdiagonal.len()),
            ComplexKind::Exchanged(_) => 2 * size_of::<Complex64>() * self.pattern.real().cholesky.len_val(),
            ComplexKind::Empty => 0,
        }
    }

    pub(super) fn new(pattern: &Arc<Pattern>, values: Vec<Complex64>) -> Result<Self, Singular> {
        // Largest error of a test solution, relative to matrix times solution, at which a factor
        // without exchanges between supernodes is accurate; 1e-15 is usual.
        let accurate = 1e-12;
        let make = |kind| ComplexFactor { pattern: pattern.clone(), kind };
        if pattern.n == 0 {
            return Ok(make(ComplexKind::Empty));
        }
        if pattern.is_symmetric(&values) {
            let factor =
                make(ComplexKind::Symmetric(LdlValues::new(pattern.complex(), &pattern.doubled(&values), vec![])));
            if factor.error(&values) <= accurate {
                return Ok(factor);
            }
        }
        let factor = make(ComplexKind::Exchanged(factor_with_exchanges(pattern, &values)));
        if factor.error(&values) <= accurate {
            return Ok(factor);
        }
        Err(Singular { row: factor.unsupported_row(values) })
    }

    /// Solves in place for right sides of length n, stored consecutively.
    ///
    /// # Panics
    /// If the length of `right` is not a multiple of n.
    pub fn solve(&self, right: &mut [Complex64]) {
        let n = self.pattern.n;
        if n == 0 || right.is_empty() {
            return;
        }
        assert!(right.len().is_multiple_of(n), "{} numbers do not form columns of length {n}", right.len());
        match &self.kind {
            ComplexKind::Symmetric(ldl) => {
                let mut parts: Vec<f64> = right.iter().flat_map(|z| [z.re, z.im]).collect();
                ldl.solve(self.pattern.complex(), &mut parts);
                // The real form gives the conjugate.
                for (z, part) in right.iter_mut().zip(parts.chunks_exact(2)) {
                    *z = Complex64::new(part[0], -part[1]);
                }
            }
            ComplexKind::Exchanged(numeric) => {
                let symbolic = self.pattern.unsymmetric();
                let columns = right.len() / n;
                let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<Complex64>(columns, Par::Seq));
                LuRef::new_unchecked(symbolic, numeric).solve_in_place_with_conj(
                    Conj::No,
                    MatMut::from_column_major_slice_mut(right, n, columns),
                    Par::Seq,
                    MemStack::new(&mut memory),
                );
            }
            ComplexKind::Empty => {}
        }
    }

    /// Returns the error of a solution for a known right side, relative to matrix times
    /// solution: the accuracy of the factor.
    fn error(&self, values: &[Complex64]) -> f64 {
        let n = self.pattern.n;
        // Entries without a pattern.
        let right: Vec<Complex64> =
            (0..n).map(|i| Complex64::new((i as f64 * 0.7 + 1.0).sin(), (i as f64 * 1.3 + 0.4).cos())).collect();
        let mut x = right.clone();
        self.solve(&mut x);
        let (mut left, mut size) = (vec![Complex64::new(0.0, 0.0); n], vec![0.0; n]);
        for column in 0..n {
            for at in self.pattern.column(column) {
                let (row, product) = (self.pattern.rows[at] as usize, values[at] * x[column]);
                left[row] += product;
                size[row] += product.norm();
            }
        }
        let off = left.iter().zip(&right).map(|(l, r)| (l - r).norm());
        let share = off.zip(&size).map(|(off, size)| off / (size + 1.0));
        // NaN counts as an infinite error.
        share.fold(0.0, |most, share| if share.is_finite() { share.max(most) } else { f64::INFINITY })
    }

    /// Returns the row with the largest motion in the null vector of a singular matrix, by
    /// inverse iteration with a slightly shifted matrix.
    fn unsupported_row(&self, mut values: Vec<Complex64>) -> usize {
        let pattern = &self.pattern;
        let largest = values.iter().fold(0.0f64, |m, v| m.max(v.norm()));
        for column in 0..pattern.n {
            for at in pattern.column(column).filter(|at| pattern.rows[*at] as usize == column) {
                // Addition to the diagonal of a singular matrix, relative to its largest entry,
                // with which its null vector is computed.
                values[at] += Complex64::new(1.0, 1.0) * (1e-9 * largest.max(f64::MIN_POSITIVE));
            }
        }
        let shifted = ComplexFactor {
            pattern: pattern.clone(),
            kind: ComplexKind::Exchanged(factor_with_exchanges(pattern, &values)),
        };
        let mut x: Vec<Complex64> = (0..pattern.n).map(|i| Complex64::new(1.0 + (i as f64).cos(), 0.0)).collect();
        shifted.solve(&mut x);
        (0..pattern.n).max_by(|&a, &b| x[a].norm().total_cmp(&x[b].norm())).unwrap_or(0)
    }
}

/// Factors with row exchanges.
fn factor_with_exchanges(pattern: &Pattern, values: &[Complex64]) -> Box<NumericLu<u32, Complex64>> {
    let n = pattern.n;
    let symbolic = pattern.unsymmetric();
    let matrix =
        SparseColMatRef::new(SymbolicSparseColMatRef::new_checked(n, n, &pattern.starts, None, &pattern.rows), values);
    let params = Spec::<PartialPivLuParams, Complex64>::default();
    let mut memory = MemBuffer::new(symbolic.factorize_numeric_lu_scratch::<Complex64>(Par::Seq, params));
    let mut numeric = Box::new(NumericLu::new());
    if let Err(error) =
        symbolic.factorize_numeric_lu(&mut numeric, matrix, Par::Seq, MemStack::new(&mut memory), params).map(|_| ())
    {
        // The diagonal is part of every pattern, so each column has a pivot.
        panic!("{n} rows, {} entries: {error:?}", values.len());
    }
    numeric
}

impl LdlValues {
    /// Factors the lower triangle, in the memory of an earlier factor if its size fits.
    fn new(symbolic: &Symbolic, lower: &[f64], mut memory: Vec<f64>) -> Self {
        let cholesky = &symbolic.cholesky;
        let n = cholesky.nrows();
        let params = Spec::<LbltParams, f64>::default();
        let mut scratch = MemBuffer::new(cholesky.factorize_numeric_intranode_lblt_scratch::<f64>(Par::Seq, params));
        if memory.len() != cholesky.len_val() {
            // Zeroed memory that the system need not touch yet.
            memory = vec![0.0; cholesky.len_val()];
        }
        let mut ldl = LdlValues { values: memory, subdiagonal: vec![0.0; n], order: vec![0; n], inverse: vec![0; n] };
        cholesky.factorize_numeric_intranode_lblt(
            &mut ldl.values,
            &mut ldl.subdiagonal,
            &mut ldl.order,
            &mut ldl.inverse,
            SparseColMatRef::new(
                SymbolicSparseColMatRef::new_checked(n, n, &symbolic.starts, None, &symbolic.rows),
                lower,
            ),
            Side::Lower,
            Par::Seq,
            MemStack::new(&mut scratch),
            params,
        );
        ldl
    }

    fn solve(&self, symbolic: &Symbolic, right: &mut [f64]) {
        let n = self.order.len();
        let columns = right.len() / n;
        let exchanges = PermRef::new_checked(&self.order, &self.inverse, n);
        let mut memory = MemBuffer::new(symbolic.cholesky.solve_in_place_scratch::<f64>(columns, Par::Seq));
        IntranodeLbltRef::new(&symbolic.cholesky, &self.values, &self.subdiagonal, exchanges).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(right, n, columns),
            Par::Seq,
            MemStack::new(&mut memory),
        );
    }

    fn supernodes<'a>(&'a self, symbolic: &'a Symbolic) -> SupernodalIntranodeLbltRef<'a, u32, f64> {
        let SymbolicCholeskyRaw::Supernodal(supernodal) = symbolic.cholesky.raw() else {
            unreachable!("blocks of columns were asked for");
        };
        let exchanges = PermRef::new_checked(&self.order, &self.inverse, self.order.len());
        SupernodalIntranodeLbltRef::new(supernodal, &self.values, &self.subdiagonal, exchanges)
    }

    /// Calls `each` with a row and the eigenvalue of D that belongs to it.
    fn pivots(&self, symbolic: &Symbolic, mut each: impl FnMut(usize, f64)) {
        let supernodes = self.supernodes(symbolic);
        let row = |at: usize| match symbolic.cholesky.perm() {
            Some(order) => order.arrays().0[self.order[at] as usize] as usize,
            None => self.order[at] as usize,
        };
        for s in 0..supernodes.symbolic().n_supernodes() {
            let part = supernodes.supernode(s);
            let (first, values) = (part.start(), part.val());
            let mut k = 0;
            while k < values.ncols() {
                let (a, b) = (values[(k, k)], self.subdiagonal[first + k]);
                if b == 0.0 {
                    each(row(first + k), a);
                    k += 1;
                    continue;
                }
                let c = values[(k + 1, k + 1)];
                let (mean, radius) = (0.5 * (a + c), (0.5 * (a - c)).hypot(b));
                // Compute the eigenvalue of larger magnitude first. The determinant gives the
                // other one without a difference of large numbers.
                let large = if mean < 0.0 { mean - radius } else { mean + radius };
                each(row(first + k), large);
                each(row(first + k + 1), (a * c - b * b) / large);
                k += 2;
            }
        }
    }
}

impl Pattern {
    fn column(&self, column: usize) -> std::ops::Range<usize> {
        self.starts[column] as usize..self.starts[column + 1] as usize
    }

    fn is_symmetric(&self, values: &[Complex64]) -> bool {
        (0..self.n).all(|column| {
            self.column(column).filter(|at| self.rows[*at] as usize > column).all(|at| {
                let mirrored = self.column(self.rows[at] as usize);
                let rows = &self.rows[mirrored.clone()];
                rows.binary_search(&(column as u32)).is_ok_and(|k| values[mirrored.start + k] == values[at])
            })
        })
    }

    /// Returns the lower triangle of `[Re Im; Im -Re]`.
    fn doubled(&self, values: &[Complex64]) -> Vec<f64> {
        let mut lower = Vec::with_capacity(2 * values.len());
        for column in 0..self.n {
            for part in 0..2 {
                for at in self.column(column).filter(|at| self.rows[*at] as usize >= column) {
                    let (z, on) = (values[at], self.rows[at] as usize == column);
                    match part {
                        0 => lower.extend([z.re, z.im]),
                        _ if on => lower.push(-z.re),
                        _ => lower.extend([z.im, -z.re]),
                    }
                }
            }
        }
        lower
    }
}

#[cfg(test)]
mod tests {
    use super::super::{SparseMatrix, SymbolicAnalysis};
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    /// Springs of stiffness one between neighbours and, if `held`, to walls at both ends.
    fn chain(n: usize, held: bool) -> SparseMatrix {
        let between = (1..n).flat_map(|i| [(i, i, 1.0), (i - 1, i - 1, 1.0), (i, i - 1, -1.0), (i - 1, i, -1.0)]);
        let walls = [(0, 0, f64::from(u8::from(held))), (n - 1, n - 1, f64::from(u8::from(held)))];
        SparseMatrix::from_triplets(n, between.chain(walls)).unwrap()
    }

    fn identity(n: usize) -> SparseMatrix {
        SparseMatrix::from_triplets(n, (0..n).map(|i| (i, i, 1.0))).unwrap()
    }

    /// Springs between the neighbours of a cube of `side`³ nodes. One face is
    /// connected to the ground.
    fn brick(side: usize) -> SparseMatrix {
        let at = |x: usize, y: usize, z: usize| (x * side + y) * side + z;
        let mut entries = Vec::new();
        for x in 0..side {
            for y in 0..side {
                for z in 0..side {
                    let here = at(x, y, z);
                    entries.push((here, here, if x == 0 { 1.5 } else { 0.0 }));
                    let next = [(x + 1, y, z, 1.0), (x, y + 1, z, 0.7), (x, y, z + 1, 0.4)];
                    for (x, y, z, k) in next.into_iter().filter(|(x, y, z, _)| *x.max(y).max(z) < side) {
                        let there = at(x, y, z);
                        entries.extend([(here, here, k), (there, there, k), (here, there, -k), (there, here, -k)]);
                    }
                }
            }
        }
        SparseMatrix::from_triplets(side * side * side, entries).unwrap()
    }

    fn dense(matrix: &SparseMatrix) -> DMatrix<f64> {
        let mut full = DMatrix::zeros(matrix.n(), matrix.n());
        matrix.entries().for_each(|(i, k, value)| full[(i, k)] = value);
        full
    }

    /// Between two frequencies `4 sin²(π k / 2 (n + 1))` of a chain between
    /// walls, the count below is exact.
    #[test]
    fn the_frequencies_of_a_chain_are_counted() {
        for n in [1, 2, 3, 40, 257] {
            let (k, m) = (chain(n, true), identity(n));
            let analysis = SymbolicAnalysis::new(&[&k, &m]);
            let frequency = |i: f64| 4.0 * (std::f64::consts::FRAC_PI_2 * i / (n + 1) as f64).sin().powi(2);
            for below in 0..=n {
                let shift = frequency(below as f64 + 0.5);
                let factor = analysis.factor(&[(1.0, &k), (-shift, &m)]).unwrap();
                assert_eq!(factor.negative_pivots(), below, "{n} masses, shift {shift}");
            }
        }
    }

    /// The static deflection of a chain under a force on one mass consists of two straight lines.
    #[test]
    fn the_deflection_of_a_chain() {
        let n = 1000;
        let k = chain(n, true);
        let factor = SymbolicAnalysis::new(&[&k]).factor(&[(1.0, &k)]).unwrap();
        assert_eq!(factor.negative_pivots(), 0);
        let mut x = vec![0.0; 2 * n];
        (x[0], x[n + 399]) = (1.0, 1.0);
        factor.solve(&mut x);
        let line = |at: f64, i: f64| if i <= at { i * (1001.0 - at) / 1001.0 } else { at * (1001.0 - i) / 1001.0 };
        // Condition number 4 (n / π)², times the rounding of the largest deflection.
        let rounding = 4.0 * 1e6 / 9.9 * f64::EPSILON * 240.0;
        for i in 0..n {
            assert!((x[i] - line(1.0, i as f64 + 1.0)).abs() < rounding);
            assert!((x[n + i] - line(400.0, i as f64 + 1.0)).abs() < rounding);
        }
    }

    /// A part without support is singular, and the reported row belongs to it.
    /// A soft spring next to stiff ones is a support.
    #[test]
    fn unsupported_row_is_named() {
        let n = 50;
        for first in [0, 20] {
            // Masses from `first` on have no support; the others have a wall.
            let mut entries: Vec<_> =
                chain(n, false).entries().filter(|(i, k, _)| (*i < first) == (*k < first)).collect();
            if first > 0 {
                entries.extend([(0, 0, 1.0), (first - 1, first - 1, -1.0), (first, first, -1.0)]);
            }
            let k = SparseMatrix::from_triplets(n, entries.clone()).unwrap();
            let analysis = SymbolicAnalysis::new(&[&k]);
            let real = analysis.factor(&[(1.0, &k)]).unwrap_err();
            assert!(real.row >= first, "{real}");
            entries.push((n - 1, n - 1, 1e-10));
            let k = SparseMatrix::from_triplets(n, entries).unwrap();
            assert_eq!(analysis.factor(&[(1.0, &k)]).unwrap().negative_pivots(), 0);
        }
        let empty_row = SparseMatrix::from_triplets(3, [(0, 0, 1.0), (2, 2, 4.0)]).unwrap();
        let analysis = SymbolicAnalysis::new(&[&empty_row]);
        assert_eq!(analysis.factor(&[(1.0, &empty_row)]).unwrap_err(), Singular { row: 1 });
        let complex = analysis.factor_complex(&[(Complex64::new(0.0, 2.0), &empty_row)]);
        assert_eq!(complex.unwrap_err(), Singular { row: 1 });
    }

    /// Dynamic stiffness with symmetric and with gyroscopic damping, compared
    /// with the dense solution.
    #[test]
    fn dynamic_stiffness_against_dense() {
        for (k, gyroscopic) in [(brick(4), false), (brick(4), true), (chain(64, true), false), (chain(64, true), true)]
        {
            let n = k.n();
            let m = identity(n);
            let spin = (0..if gyroscopic { n / 2 } else { 0 })
                .flat_map(|i| [(2 * i, 2 * i + 1, 0.2), (2 * i + 1, 2 * i, -0.2)]);
            let c = SparseMatrix::from_triplets(n, (0..n).map(|i| (i, i, 0.01)).chain(spin)).unwrap();
            let analysis = SymbolicAnalysis::new(&[&k, &m, &c]);
            for omega in [0.0, 0.3, 1.1, 1.7] {
                let sum = [(1.0, 0.0), (-omega * omega, 0.0), (0.0, omega)].map(|(re, im)| Complex64::new(re, im));
                let factor = analysis.factor_complex(&[(sum[0], &k), (sum[1], &m), (sum[2], &c)]).unwrap();
                let right: Vec<Complex64> =
                    (0..3 * n).map(|i| Complex64::new((i as f64).sin(), (2.0 * i as f64).cos())).collect();
                let mut x = right.clone();
                factor.solve(&mut x);
                let complex = |a: &SparseMatrix, factor: Complex64| dense(a).map(|v| factor * v);
                let full = (complex(&k, sum[0]) + complex(&m, sum[1]) + complex(&c, sum[2])).lu();
                for (x, right) in x.chunks(n).zip(right.chunks(n)) {
                    let expected = full.solve(&DVector::from_column_slice(right)).unwrap();
                    let error = (DVector::from_column_slice(x) - &expected).norm() / expected.norm();
                    assert!(error < 1e-10, "{n}, {omega}, {gyroscopic}: {error:.1e}");
                }
            }
        }
    }

    /// Zero diagonal with coupled pairs of rows: pivots of two rows, each with
    /// one negative eigenvalue.
    #[test]
    fn zeros_on_the_diagonal() {
        let n = 60;
        let pairs = (0..n / 2).flat_map(|i| [(2 * i, 2 * i + 1, 2.0), (2 * i + 1, 2 * i, 2.0)]);
        let matrix = SparseMatrix::from_triplets(n, pairs).unwrap();
        let factor = SymbolicAnalysis::new(&[&matrix]).factor(&[(1.0, &matrix)]).unwrap();
        assert_eq!(factor.negative_pivots(), n / 2);
        let mut x: Vec<f64> = (0..n).map(|i| i as f64).collect();
        factor.solve(&mut x);
        assert!((0..n).all(|i| (x[i] - 0.5 * (i ^ 1) as f64).abs() < 1e-14));
    }

    #[test]
    fn empty_matrix_has_a_factor() {
        let none = SparseMatrix::from_triplets(0, []).unwrap();
        let analysis = SymbolicAnalysis::new(&[&none]);
        analysis.factor(&[(1.0, &none)]).unwrap().solve(&mut []);
        analysis.factor_complex(&[]).unwrap().solve(&mut []);
        assert_eq!(analysis.factor_entries(), 0);
    }

    /// Same input, same bits, on any thread. One elimination order serves every shift.
    #[test]
    fn same_bits_on_every_thread() {
        let solve = || {
            let (k, m) = (brick(7), identity(343));
            let analysis = SymbolicAnalysis::new(&[&k, &m]);
            let mut x = vec![1.0; 343];
            analysis.factor(&[(1.0, &k), (-0.8, &m)]).unwrap().solve(&mut x);
            let mut z = vec![Complex64::new(1.0, 0.5); 343];
            analysis.factor_complex(&[(Complex64::new(1.0, 0.1), &k)]).unwrap().solve(&mut z);
            (x, z)
        };
        let here = solve();
        let there: Vec<_> = (0..3).map(|_| std::thread::spawn(solve)).collect();
        assert!(there.into_iter().all(|thread| thread.join().unwrap() == here));
    }

    proptest! {
        /// Random symmetric matrices: solutions and numbers of negative
        /// eigenvalues agree with the dense ones.
        #[test]
        fn random_matrices(entries in proptest::collection::vec((0usize..30, 0usize..30, -1.0f64..1.0), 20..200)) {
            let both = entries.iter().flat_map(|&(i, k, v)| [(i, k, v), (k, i, v)]);
            let loose = (0..30).map(|i| (i, i, 0.3 * ((i * 7919 + 13) as f64).sin()));
            let matrix = SparseMatrix::from_triplets(30, both.chain(loose)).unwrap();
            let full = dense(&matrix);
            let eigenvalues = full.clone().symmetric_eigenvalues();
            prop_assume!(eigenvalues.iter().all(|e| e.abs() > 1e-3));
            let analysis = SymbolicAnalysis::new(&[&matrix]);
            let right = DVector::from_fn(30, |i, _| (i as f64).cos());
            let expected = full.lu().solve(&right).unwrap();
            if let Ok(factor) = analysis.factor(&[(1.0, &matrix)]) {
                prop_assert_eq!(factor.negative_pivots(), eigenvalues.iter().filter(|e| **e < 0.0).count());
            }
            let complex = analysis.factor_complex(&[(Complex64::new(0.0, 1.0), &matrix)]).unwrap();
            let mut z: Vec<Complex64> = right.iter().map(|r| Complex64::new(0.0, *r)).collect();
            complex.solve(&mut z);
            for (z, x) in z.iter().zip(expected.iter()) {
                prop_assert!((z - Complex64::new(*x, 0.0)).norm() < 1e-8 * (1.0 + expected.norm()));
            }
        }
    }
}
