//! Linear equations with a banded matrix, by elimination with row exchanges inside the band.
//!
//! Memory grows with the number of unknowns times the bandwidth, and work with
//! the number of unknowns times its square.
//! Source: Golub and Van Loan, "Matrix Computations" (2013), Sec. 4.3.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use std::ops::Range;

/// Half bandwidth from which elimination in blocks is faster.
///
/// Measured: a ninth of the time with full bands of 255 and 511, a fifth with 96.
const BLOCKED_FROM: usize = 64;

/// A square matrix with `half_bandwidth` diagonals on either side of the main diagonal.
///
/// # Example
/// ```
/// use stickslip_numerics::banded::BandedMatrix;
/// let mut matrix = BandedMatrix::new(3, 1);
/// for (i, j, value) in [(0, 1, 1.0), (1, 0, 2.0), (1, 2, 1.0), (2, 2, 4.0)] {
///     matrix.add(i, j, value);
/// }
/// assert!(matrix.factor());
/// let mut x = [2.0, 5.0, 12.0];
/// matrix.solve(&mut x);
/// assert_eq!(x, [1.0, 2.0, 3.0]);
/// ```
#[derive(Debug, Clone)]
pub struct BandedMatrix {
    n: usize,
    half_bandwidth: usize,
    /// Columns factored before the trailing matrix is updated.
    block: usize,
    /// Stored entries of a row: columns i - b - block + 1 to i + 2 b + block - 1 of row i.
    ///
    /// Row exchanges widen the upper band to twice its width. All rows of a
    /// block extend to the last column of the longest one. Row exchanges inside
    /// a block move multipliers below the lower band.
    width: usize,
    rows: Vec<f64>,
    pivots: Vec<usize>,
    /// Last column of each factored row.
    ends: Vec<usize>,
    /// Multipliers of a block, row by row.
    multipliers: Vec<f64>,
    /// Runs of nonzero rows below a block, and of nonzero columns to its right.
    nonzero_runs: [Vec<Range<usize>>; 2],
}

impl BandedMatrix {
    /// Creates a zero matrix of `n` rows.
    pub fn new(n: usize, half_bandwidth: usize) -> Self {
        let block = BandedMatrix::block(half_bandwidth);
        let width = 3 * half_bandwidth + 2 * block - 1;
        let rows = vec![0.0; n * width];
        BandedMatrix {
            n,
            half_bandwidth,
            block,
            width,
            rows,
            pivots: vec![0; n],
            ends: vec![0; n],
            multipliers: Vec::new(),
            nonzero_runs: [Vec::new(), Vec::new()],
        }
    }

    /// Returns the number of columns factored at a time.
    fn block(half_bandwidth: usize) -> usize {
        // Columns of a block.
        if half_bandwidth < BLOCKED_FROM { 1 } else { 16 }
    }

    /// Returns the memory of a matrix of `n` rows, bytes.
    pub fn bytes(n: usize, half_bandwidth: usize) -> f64 {
        8.0 * n as f64 * (3 * half_bandwidth + 2 * BandedMatrix::block(half_bandwidth) + 1) as f64
    }

    /// Sets all entries to zero.
    pub fn clear(&mut self) {
        self.rows.fill(0.0);
    }

    /// Adds `value` to the entry (i, j).
    ///
    /// # Panics
    /// If the entry lies outside the band.
    #[inline]
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        assert!(
            i.abs_diff(j) <= self.half_bandwidth,
            "entry ({i}, {j}) lies outside the half bandwidth {}",
            self.half_bandwidth
        );
        let at = self.index()(i, j);
        self.rows[at] += value;
    }

    /// Factors the matrix in place. Returns false if it is singular.
    pub fn factor(&mut self) -> bool {
        let (n, b) = (self.n, self.half_bandwidth);
        let index = self.index();
        // The last nonzero column of every row before row exchanges.
        self.ends.iter_mut().enumerate().for_each(|(i, end)| *end = (i + b).min(n - 1));
        let mut first = 0;
        while first < n {
            let next = (first + self.block).min(n);
            if !self.factor_panel(first, next) {
                return false;
            }
            let end = self.ends[first..next].iter().fold(0, |most, end| most.max(*end)) + 1;
            if next < end {
                self.eliminate(first, next, end, index);
            }
            first = next;
        }
        true
    }

    /// Returns the function that maps entry (i, j) to its index in `rows`.
    fn index(&self) -> impl Fn(usize, usize) -> usize + Copy + use<> {
        let (width, below) = (self.width, self.half_bandwidth + self.block - 1);
        move |i: usize, j: usize| i * width + j + below - i
    }

    /// Factors the columns `first..next` in all rows that they reach. Row
    /// exchanges begin at column `first`.
    fn factor_panel(&mut self, first: usize, next: usize) -> bool {
        let (n, b, index) = (self.n, self.half_bandwidth, self.index());
        for k in first..next {
            let last = (k + b).min(n - 1);
            let mut pivot = k;
            for i in k + 1..=last {
                if self.rows[index(i, k)].abs() > self.rows[index(pivot, k)].abs() {
                    pivot = i;
                }
            }
            let value = self.rows[index(pivot, k)];
            if value == 0.0 || !value.is_finite() {
                return false;
            }
            self.pivots[k] = pivot;
            if pivot != k {
                for j in first..=self.ends[k].max(self.ends[pivot]) {
                    self.rows.swap(index(k, j), index(pivot, j));
                }
                self.ends.swap(k, pivot);
            }
            let end = self.ends[k];
            let inverse = 1.0 / value;
            for i in k + 1..=last {
                let at = index(i, k);
                let factor = self.rows[at] * inverse;
                self.rows[at] = factor;
                if factor != 0.0 {
                    self.ends[i] = self.ends[i].max(end);
                    let (top, bottom) = self.rows.split_at_mut(index(i, k + 1));
                    let source = &top[index(k, k + 1)..index(k, next)];
                    bottom.iter_mut().zip(source).for_each(|(x, p)| *x -= factor * p);
                }
            }
        }
        true
    }

    /// Updates the columns `next..end`: first in the rows of the panel, then in the rows below it.
    fn eliminate(&mut self, first: usize, next: usize, end: usize, index: impl Fn(usize, usize) -> usize) {
        for k in first..next {
            for i in k + 1..next {
                let factor = self.rows[index(i, k)];
                if factor != 0.0 {
                    let (top, bottom) = self.rows.split_at_mut(index(i, next));
                    let source = &top[index(k, next)..index(k, end)];
                    bottom.iter_mut().zip(source).for_each(|(x, p)| *x -= factor * p);
                }
            }
        }
        let last = (next + self.half_bandwidth).min(self.n);
        if next >= last {
            return;
        }
        if self.block == 1 {
            for i in next..last {
                let factor = self.rows[index(i, first)];
                if factor != 0.0 {
                    let (top, bottom) = self.rows.split_at_mut(index(i, next));
                    let source = &top[index(first, next)..index(first, self.ends[first] + 1)];
                    bottom.iter_mut().zip(source).for_each(|(x, p)| *x -= factor * p);
                }
            }
            return;
        }
        // Distance in memory between two entries of one column in consecutive rows.
        let stride = self.width - 1;
        self.multipliers.clear();
        for i in next..last {
            self.multipliers.extend_from_slice(&self.rows[index(i, first)..index(i, next)]);
        }
        let (rows, columns, inner) = (last - next, end - next, next - first);
        let (top, bottom) = self.rows.split_at_mut(index(next, next));
        let right = &top[index(first, next)..index(next - 1, end)];
        runs(
            rows,
            |i| self.multipliers[i * inner..(i + 1) * inner].iter().any(|x| *x != 0.0),
            &mut self.nonzero_runs[0],
        );
        runs(columns, |j| (0..inner).any(|k| right[k * stride + j] != 0.0), &mut self.nonzero_runs[1]);
        let [row_runs, column_runs] = &self.nonzero_runs;
        for (i, j) in row_runs.iter().flat_map(|i| column_runs.iter().map(move |j| (i, j))) {
            // The storage is row-major and `matmul` reads columns, so all three
            // matrices are transposed.
            let left =
                MatRef::from_column_major_slice(&self.multipliers[i.start * inner..i.end * inner], inner, i.len());
            let right = &right[j.start..(inner - 1) * stride + j.end];
            let right = MatRef::from_column_major_slice_with_stride(right, j.len(), inner, stride);
            let rest = &mut bottom[i.start * stride + j.start..(i.end - 1) * stride + j.end];
            let rest = MatMut::from_column_major_slice_with_stride_mut(rest, j.len(), i.len(), stride);
            matmul(rest, Accum::Add, right, left, -1.0, Par::Seq);
        }
    }

    /// Solves with the factors. Replaces `right` by the solution.
    pub fn solve(&self, right: &mut [f64]) {
        let (n, b, index) = (self.n, self.half_bandwidth, self.index());
        for first in (0..n).step_by(self.block) {
            let next = (first + self.block).min(n);
            (first..next).for_each(|k| right.swap(k, self.pivots[k]));
            for k in first..next {
                // Row exchanges inside a panel move multipliers below the band.
                let last = if self.block == 1 { k + b } else { next - 1 + b };
                for i in k + 1..=last.min(n - 1) {
                    right[i] -= self.rows[index(i, k)] * right[k];
                }
            }
        }
        for k in (0..n).rev() {
            let end = self.ends[k];
            let row = &self.rows[index(k, k)..=index(k, end)];
            let sum: f64 = row[1..].iter().zip(&right[k + 1..=end]).map(|(a, x)| a * x).sum();
            right[k] = (right[k] - sum) / row[0];
        }
    }
}

/// Collects the numbers below `count` that are `taken` as runs in `out`.
fn runs(count: usize, taken: impl Fn(usize) -> bool, out: &mut Vec<Range<usize>>) {
    out.clear();
    for i in (0..count).filter(|i| taken(*i)) {
        match out.last_mut() {
            // Runs of nonzero rows or columns are merged across gaps of at most this length.
            Some(run) if i - run.end <= 8 => run.end = i + 1,
            _ => out.push(i..i + 1),
        }
    }
}

/// Returns an order of the nodes of a graph that places connected nodes close together.
///
/// The result contains the position of every node. `links` lists the connected pairs.
///
/// Source: Cuthill and McKee (1969).
pub fn cuthill_mckee(nodes: usize, links: &[(usize, usize)]) -> Vec<usize> {
    let mut neighbours = vec![Vec::new(); nodes];
    for &(a, b) in links {
        if a != b {
            neighbours[a].push(b);
            neighbours[b].push(a);
        }
    }
    for list in &mut neighbours {
        list.sort_unstable();
        list.dedup();
    }
    let mut position = vec![usize::MAX; nodes];
    let mut sequence: Vec<usize> = Vec::with_capacity(nodes);
    while sequence.len() < nodes {
        let free = (0..nodes).filter(|&i| position[i] == usize::MAX);
        let first = free.min_by_key(|&i| neighbours[i].len()).expect("a node is left");
        position[first] = sequence.len();
        sequence.push(first);
        let mut next = sequence.len() - 1;
        while next < sequence.len() {
            let mut found: Vec<usize> =
                neighbours[sequence[next]].iter().copied().filter(|&i| position[i] == usize::MAX).collect();
            found.sort_by_key(|&i| neighbours[i].len());
            for i in found {
                position[i] = sequence.len();
                sequence.push(i);
            }
            next += 1;
        }
    }
    position
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dense;
    use crate::random::Stream;

    /// The diagonal is zero, so rows are exchanged as far as the band permits.
    /// The solution agrees with that of the full matrix.
    #[test]
    fn blocks_solve_what_the_full_matrix_does() {
        for (n, half_bandwidth) in [(40, 7), (300, BLOCKED_FROM), (331, BLOCKED_FROM + 45), (150, 149), (97, 96)] {
            let stream = Stream::new(n as u64);
            let (mut full, mut banded) = (vec![0.0; n * n], BandedMatrix::new(n, half_bandwidth));
            for i in 0..n {
                for j in i.saturating_sub(half_bandwidth)..=(i + half_bandwidth).min(n - 1) {
                    let value = if i == j || (i + 3 * j) % 5 == 0 || (40..75).contains(&i.abs_diff(j)) {
                        0.0
                    } else {
                        stream.normal((i * n + j) as u64)
                    };
                    full[i * n + j] = value;
                    banded.add(i, j, value);
                }
            }
            let mut right: Vec<f64> = (0..n).map(|i| stream.normal((n * n + i) as u64)).collect();
            let mut other = right.clone();
            assert!(banded.factor() && dense::solve(&mut full, n, &mut right));
            banded.solve(&mut other);
            let size = right.iter().fold(0.0f64, |most, x| most.max(x.abs()));
            let apart = right.iter().zip(&other).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
            assert!(apart < 1e-9 * size, "{n} {half_bandwidth}: {apart:.1e} of {size:.1e}");
        }
    }
}
