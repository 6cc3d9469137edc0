//! Sparsity pattern of several matrices, their elimination order, and the symbolic factors.

use super::matrix::SparseMatrix;
use faer::Side;
use faer::perm::PermRef;
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::linalg::lu::{LuSymbolicParams, SymbolicLu, factorize_symbolic_lu};
use feral_metis::{CscPattern, metis_order};
use std::ops::{AddAssign, Mul};
use std::sync::OnceLock;

/// The pattern and order that all factors of an analysis share.
#[derive(Debug)]
pub(super) struct Pattern {
    pub n: usize,
    /// Both triangles and the whole diagonal, by columns.
    pub starts: Vec<u32>,
    pub rows: Vec<u32>,
    /// The row eliminated at each place of the order, and the place of every row.
    order: Vec<u32>,
    inverse: Vec<u32>,
    real: OnceLock<Symbolic>,
    complex: OnceLock<Symbolic>,
    unsymmetric: OnceLock<SymbolicLu<u32>>,
}

/// The rows of the entries of each column, rising.
struct Columns {
    /// Start of each column in `rows`, n + 1 numbers.
    starts: Vec<u32>,
    rows: Vec<u32>,
}

/// The lower triangle of the pattern and its symbolic factor.
#[derive(Debug)]
pub(super) struct Symbolic {
    pub starts: Vec<u32>,
    pub rows: Vec<u32>,
    pub cholesky: SymbolicCholesky<u32>,
}

impl Pattern {
    /// Builds the pattern of matrices of one size, with mirrored entries added, and orders it.
    pub fn new(matrices: &[&SparseMatrix]) -> Self {
        let n = matrices.first().map_or(0, |matrix| matrix.n());
        let union = union(n, matrices);
        let order = order(n, &union.starts, &union.rows);
        Pattern::ordered(n, union, &order)
    }

    /// Builds the pattern of other matrices with the order of this one,
    /// rearranged by their elimination tree.
    pub fn with_order(&self, matrices: &[&SparseMatrix]) -> Self {
        Pattern::ordered(self.n, union(self.n, matrices), &self.order)
    }

    fn ordered(n: usize, columns: Columns, order: &[u32]) -> Self {
        let Columns { starts, rows } = columns;
        let order = postordered(order, &starts, &rows);
        let mut inverse = vec![0; n];
        order.iter().enumerate().for_each(|(at, &row)| inverse[row as usize] = at as u32);
        let (real, complex, unsymmetric) = (OnceLock::new(), OnceLock::new(), OnceLock::new());
        Pattern { n, starts, rows, order, inverse, real, complex, unsymmetric }
    }

    /// Returns the entries of a sum, in the storage order of the pattern.
    pub fn sum<T: Copy + Default + AddAssign + Mul<f64, Output = T>>(&self, sum: &[(T, &SparseMatrix)]) -> Vec<T> {
        let mut values = vec![T::default(); self.rows.len()];
        for &(factor, matrix) in sum {
            assert_eq!(matrix.n(), self.n, "the matrices of a sum must have the size of the analysed matrices");
            for column in 0..self.n {
                let mut at = self.starts[column] as usize;
                for (row, value) in matrix.column(column) {
                    while self.rows[at] as usize != row {
                        at += 1;
                        assert!(
                            at < self.starts[column + 1] as usize,
                            "entry ({row}, {column}) lies outside the analysed pattern"
                        );
                    }
                    values[at] += factor * value;
                }
            }
        }
        values
    }

    /// Returns the lower triangle of a sum, in the storage order of the real factor.
    pub fn lower_sum(&self, sum: &[(f64, &SparseMatrix)]) -> Vec<f64> {
        let symbolic = self.real();
        let mut values = vec![0.0; symbolic.rows.len()];
        for &(factor, matrix) in sum {
            assert_eq!(matrix.n(), self.n, "the matrices of a sum must have the size of the analysed matrices");
            for column in 0..self.n {
                let (mut at, end) = (symbolic.starts[column] as usize, symbolic.starts[column + 1] as usize);
                let own = matrix.range(column);
                let above = matrix.rows[own.clone()].partition_point(|row| (*row as usize) < column);
                let own = own.start + above..own.end;
                for (&row, value) in matrix.rows[own.clone()].iter().zip(&matrix.values[own]) {
                    while symbolic.rows[at] != row {
                        at += 1;
                        assert!(at < end, "entry ({row}, {column}) lies outside the analysed pattern");
                    }
                    values[at] += factor * value;
                }
            }
        }
        values
    }

    /// Returns the symbolic real factor.
    pub fn real(&self) -> &Symbolic {
        self.real.get_or_init(|| {
            let mut lower = Columns { starts: vec![0], rows: Vec::new() };
            for column in 0..self.n {
                let rows = &self.rows[self.starts[column] as usize..self.starts[column + 1] as usize];
                lower.rows.extend(rows.iter().copied().filter(|row| *row as usize >= column));
                lower.starts.push(lower.rows.len() as u32);
            }
            self.symbolic(lower, &self.order, &self.inverse)
        })
    }

    /// Returns the symbolic factor of `[Re Im; Im -Re]`, with interleaved rows and columns.
    ///
    /// This is a symmetric complex matrix as a symmetric real one of twice the size. Its
    /// solution is the conjugate of the complex solution.
    pub fn complex(&self) -> &Symbolic {
        self.complex.get_or_init(|| {
            let mut lower = Columns { starts: vec![0], rows: Vec::new() };
            for column in 0..self.n {
                let rows = &self.rows[self.starts[column] as usize..self.starts[column + 1] as usize];
                for part in 0..2 {
                    for &row in rows.iter().filter(|row| **row as usize >= column) {
                        // On the diagonal the upper entry belongs to the other triangle.
                        let first = if row as usize == column { part } else { 0 };
                        lower.rows.extend((first..2).map(|other| 2 * row + other));
                    }
                    lower.starts.push(lower.rows.len() as u32);
                }
            }
            let double = |order: &[u32]| order.iter().flat_map(|row| [2 * row, 2 * row + 1]).collect::<Vec<u32>>();
            self.symbolic(lower, &double(&self.order), &double(&self.inverse))
        })
    }

    fn symbolic(&self, columns: Columns, order: &[u32], inverse: &[u32]) -> Symbolic {
        let Columns { starts, rows } = columns;
        let n = order.len();
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &starts, None, &rows);
        let ordering = SymmetricOrdering::Custom(PermRef::new_checked(order, inverse, n));
        // Always use supernodes, because pivots are chosen inside supernodes only.
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let cholesky = factorize_symbolic_cholesky(pattern, Side::Lower, ordering, params)
            .unwrap_or_else(|error| panic!("{n} rows, {} entries: {error:?}", rows.len()));
        Symbolic { starts, rows, cholesky }
    }

    /// Returns the symbolic LU factor with row exchanges.
    pub fn unsymmetric(&self) -> &SymbolicLu<u32> {
        self.unsymmetric.get_or_init(|| {
            let pattern = SymbolicSparseColMatRef::new_checked(self.n, self.n, &self.starts, None, &self.rows);
            factorize_symbolic_lu(pattern, LuSymbolicParams::default())
                .unwrap_or_else(|error| panic!("{} rows, {} entries: {error:?}", self.n, self.rows.len()))
        })
    }
}

/// Returns the union of the patterns, the mirrored patterns and the diagonal,
/// by columns with rising rows.
fn union(n: usize, matrices: &[&SparseMatrix]) -> Columns {
    assert!(matrices.iter().all(|matrix| matrix.n() == n), "the matrices of a sum must have one size");
    let transposed: Vec<_> = matrices.iter().map(|matrix| transposed(n, &matrix.starts, &matrix.rows)).collect();
    let most = matrices.iter().map(|matrix| matrix.rows.len()).max().unwrap_or(0);
    let (mut starts, mut rows) = (Vec::with_capacity(n + 1), Vec::with_capacity(most + n));
    starts.push(0);
    // The last column in which a row was added.
    let mut met = vec![NO_ROW; n];
    for column in 0..n {
        let first = rows.len();
        let mut meet = |some: &[u32]| {
            for &row in some {
                if met[row as usize] != column as u32 {
                    met[row as usize] = column as u32;
                    rows.push(row);
                }
            }
        };
        for (matrix, (starts, rows)) in matrices.iter().zip(&transposed) {
            meet(&matrix.rows[matrix.range(column)]);
            meet(&rows[starts[column] as usize..starts[column + 1] as usize]);
        }
        meet(&[column as u32]);
        rows[first..].sort_unstable();
        starts.push(rows.len() as u32);
    }
    Columns { starts, rows }
}

/// Returns the transposed pattern, by columns with rising rows.
fn transposed(n: usize, starts: &[u32], rows: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let mut next = vec![0; n + 1];
    rows.iter().for_each(|row| next[*row as usize + 1] += 1);
    (0..n).for_each(|row| next[row + 1] += next[row]);
    let own = next.clone();
    let mut across = vec![0; rows.len()];
    for column in 0..n {
        for &row in &rows[starts[column] as usize..starts[column + 1] as usize] {
            across[next[row as usize] as usize] = column as u32;
            next[row as usize] += 1;
        }
    }
    (own, across)
}

/// Returns the rows in elimination order, by nested dissection. Rows with equal patterns, such
/// as those of one node, are one vertex of the graph.
fn order(n: usize, starts: &[u32], rows: &[u32]) -> Vec<u32> {
    let column = |at: u32| &rows[starts[at as usize] as usize..starts[at as usize + 1] as usize];
    // The first row with the same pattern. The diagonal is whole, so this row
    // is one of the row's entries.
    let mut first: Vec<u32> = (0..n as u32).collect();
    let mut vertex_of = vec![0u32; n];
    let mut number = 0;
    for row in 0..n as u32 {
        let own = column(row);
        let same = own.iter().take_while(|other| **other < row);
        let same = same.filter(|other| first[**other as usize] == **other).find(|other| column(**other) == own);
        match same {
            Some(&other) => (first[row as usize], vertex_of[row as usize]) = (other, vertex_of[other as usize]),
            None => {
                vertex_of[row as usize] = number;
                number += 1;
            }
        }
    }
    let (mut among, mut links) = (vec![0i32], Vec::new());
    for row in (0..n as u32).filter(|row| first[*row as usize] == *row) {
        let others = column(row).iter().filter(|other| first[**other as usize] == **other);
        links.extend(others.map(|other| vertex_of[*other as usize] as i32));
        among.push(links.len() as i32);
    }
    let pattern = CscPattern::new(number as usize, &among, &links).expect("the union of patterns is a pattern");
    let order = metis_order(&pattern).unwrap_or_else(|error| panic!("{n} rows, {} entries: {error:?}", rows.len()));
    let mut members = vec![Vec::new(); number as usize];
    vertex_of.iter().enumerate().for_each(|(row, &number)| members[number as usize].push(row as u32));
    order.iter().flat_map(|number| members[*number as usize].iter().copied()).collect()
}

/// Marks the absence of a row.
const NO_ROW: u32 = u32::MAX;

/// Returns the order sorted by the elimination tree, children before parents.
///
/// The fill-in stays the same. Columns with similar patterns become consecutive
/// and form the largest possible supernodes.
///
/// Source: Liu (1990), "The role of elimination trees in sparse factorization".
fn postordered(order: &[u32], starts: &[u32], rows: &[u32]) -> Vec<u32> {
    let n = order.len();
    let mut at = vec![0u32; n];
    order.iter().enumerate().for_each(|(place, &row)| at[row as usize] = place as u32);
    let (mut parent, mut ancestor) = (vec![NO_ROW; n], vec![NO_ROW; n]);
    for place in 0..n as u32 {
        let row = order[place as usize] as usize;
        for other in &rows[starts[row] as usize..starts[row + 1] as usize] {
            let mut below = at[*other as usize];
            // Path compression: visited paths lead directly to this place.
            while below < place {
                let next = std::mem::replace(&mut ancestor[below as usize], place);
                if next == NO_ROW {
                    parent[below as usize] = place;
                    break;
                }
                below = next;
            }
        }
    }
    // The children of each row as a linked list, the lowest first.
    let (mut child, mut next) = (vec![NO_ROW; n + 1], vec![NO_ROW; n]);
    for place in (0..n).rev() {
        let owner = if parent[place] == NO_ROW { n } else { parent[place] as usize };
        (next[place], child[owner]) = (child[owner], place as u32);
    }
    let mut sorted = Vec::with_capacity(n);
    let mut path = vec![n];
    while let Some(&last) = path.last() {
        match child[last] {
            NO_ROW => {
                path.pop();
                sorted.extend(order.get(last));
            }
            below => {
                child[last] = next[below as usize];
                path.push(below as usize);
            }
        }
    }
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nodes of three rows each on a grid: the order contains all rows, the rows of a node
    /// follow each other, and children precede their parents.
    #[test]
    fn rows_of_a_node_are_ordered_as_one() {
        let (wide, n) = (12, 3 * 12 * 12);
        let linked = |a: usize, b: usize| (a / wide).abs_diff(b / wide) <= 1 && (a % wide).abs_diff(b % wide) <= 1;
        let pairs = (0..n).flat_map(|i| (0..n).filter(move |k| linked(i / 3, k / 3)).map(move |k| (i, k, 1.0)));
        let matrix = SparseMatrix::from_triplets(n, pairs).unwrap();
        let pattern = Pattern::new(&[&matrix]);
        let mut sorted = pattern.order.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(at, row)| at == *row as usize));
        assert!(pattern.order.chunks(3).all(|rows| rows.iter().all(|row| row / 3 == rows[0] / 3)));
        // An order that follows the tree does not change.
        assert_eq!(postordered(&pattern.order, &pattern.starts, &pattern.rows), pattern.order);
        // A diagonal matrix has an elimination tree without edges, so the order does not change.
        let one = SparseMatrix::from_triplets(n, (0..n).map(|i| (i, i, 1.0))).unwrap();
        assert_eq!(pattern.with_order(&[&one]).order, pattern.order);
    }
}
