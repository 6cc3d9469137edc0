//! LU factors of a small dense matrix, in memory that is reused from one matrix to the next.

/// The factorization `P A = L U` with row exchanges.
///
/// Source: Golub and Van Loan, "Matrix Computations" (2013), Sec. 3.4.
///
/// # Example
/// ```
/// use stickslip_numerics::small_lu::SmallLu;
/// let mut lu = SmallLu::default();
/// lu.zeros(2).copy_from_slice(&[0.0, 2.0, 4.0, 1.0]);
/// assert!(lu.factor());
/// let mut x = [2.0, 9.0];
/// lu.solve(&mut x);
/// assert_eq!(x, [2.0, 1.0]);
/// ```
#[derive(Debug, Clone, Default)]
pub struct SmallLu {
    n: usize,
    entries: Vec<f64>,
    /// The row exchanged with row k when column k was eliminated.
    pivots: Vec<usize>,
}

impl SmallLu {
    /// Returns a zero matrix, row-major, for the caller to fill before [`SmallLu::factor`].
    pub fn zeros(&mut self, n: usize) -> &mut [f64] {
        self.n = n;
        self.entries.clear();
        self.entries.resize(n * n, 0.0);
        &mut self.entries
    }

    /// Returns the entries, row-major.
    pub fn entries(&mut self) -> &mut [f64] {
        &mut self.entries
    }

    /// Factors the matrix in place. Returns false if a pivot is zero or not finite.
    pub fn factor(&mut self) -> bool {
        // Lengths known to the compiler: five stages of one axis, and of one axis with a state.
        match self.n {
            5 => self.eliminate(5),
            10 => self.eliminate(10),
            n => self.eliminate(n),
        }
    }

    #[inline(always)]
    fn eliminate(&mut self, n: usize) -> bool {
        self.pivots.clear();
        let entries = &mut self.entries[..n * n];
        for k in 0..n {
            let mut pivot = k;
            for i in k + 1..n {
                if entries[i * n + k].abs() > entries[pivot * n + k].abs() {
                    pivot = i;
                }
            }
            let largest = entries[pivot * n + k];
            if largest == 0.0 || !largest.is_finite() {
                return false;
            }
            self.pivots.push(pivot);
            let (top, bottom) = entries.split_at_mut((k + 1) * n);
            let row = &mut top[k * n..];
            if pivot != k {
                let start = (pivot - k - 1) * n;
                row.swap_with_slice(&mut bottom[start..start + n]);
            }
            for below in bottom.chunks_exact_mut(n) {
                let factor = below[k] / largest;
                below[k] = factor;
                if factor != 0.0 {
                    below[k + 1..].iter_mut().zip(&row[k + 1..]).for_each(|(x, p)| *x -= factor * p);
                }
            }
        }
        true
    }

    /// Replaces the right side by the solution.
    pub fn solve(&self, rhs: &mut [f64]) {
        let n = self.n;
        for k in 0..n {
            rhs.swap(k, self.pivots[k]);
        }
        for i in 1..n {
            let row = &self.entries[i * n..i * n + i];
            rhs[i] -= row.iter().zip(&*rhs).map(|(l, x)| l * x).sum::<f64>();
        }
        for i in (0..n).rev() {
            let row = &self.entries[i * n..(i + 1) * n];
            let sum: f64 = row[i + 1..].iter().zip(&rhs[i + 1..n]).map(|(u, x)| u * x).sum();
            rhs[i] = (rhs[i] - sum) / row[i];
        }
    }

    /// Replaces several right sides by their solutions. `rhs` is row-major,
    /// with one column for each right side.
    pub fn solve_rows(&self, rhs: &mut [f64], columns: usize) {
        let n = self.n;
        for k in 0..n {
            let other = self.pivots[k];
            if other != k {
                let (top, bottom) = rhs.split_at_mut(other * columns);
                top[k * columns..(k + 1) * columns].swap_with_slice(&mut bottom[..columns]);
            }
        }
        for i in 1..n {
            let (above, row) = rhs[..(i + 1) * columns].split_at_mut(i * columns);
            subtract_multiples(&self.entries[i * n..i * n + i], above, row);
        }
        for i in (0..n).rev() {
            let (row, below) = rhs[i * columns..n * columns].split_at_mut(columns);
            subtract_multiples(&self.entries[i * n + i + 1..(i + 1) * n], below, row);
            let pivot = self.entries[i * n + i];
            row.iter_mut().for_each(|x| *x /= pivot);
        }
    }
}

/// Subtracts the rows of `others` from `row`: `row -= Σ factor · other row`.
fn subtract_multiples(factors: &[f64], others: &[f64], row: &mut [f64]) {
    for (factor, other) in factors.iter().zip(others.chunks_exact(row.len().max(1))) {
        row.iter_mut().zip(other).for_each(|(x, o)| *x -= factor * o);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The solution is the vector that the matrix was multiplied with, for
    /// several matrices in the same memory.
    #[test]
    fn solves_what_was_multiplied() {
        let mut lu = SmallLu::default();
        for n in [0, 1, 2, 5, 23, 4] {
            let entry =
                |i: usize, k: usize| if i == k && n > 1 { 0.0 } else { ((i * 7919 + k * 104_729 + 1) as f64).sin() };
            let matrix = lu.zeros(n);
            (0..n * n).for_each(|at| matrix[at] = entry(at / n, at % n));
            assert!(lu.factor());
            let mut rhs: Vec<f64> = (0..n).map(|i| (0..n).map(|k| entry(i, k) * (1.0 + k as f64)).sum()).collect();
            lu.solve(&mut rhs);
            for (i, x) in rhs.iter().enumerate() {
                assert!((x - 1.0 - i as f64).abs() < 1e-10, "{n}: {x}");
            }
            // Two right sides: the one above, and twice of it.
            let entry_sum = |i: usize| (0..n).map(|k| entry(i, k) * (1.0 + k as f64)).sum::<f64>();
            let mut rows: Vec<f64> = (0..n).flat_map(|i| [entry_sum(i), 2.0 * entry_sum(i)]).collect();
            lu.solve_rows(&mut rows, 2);
            for (i, x) in rows.chunks_exact(2).enumerate() {
                assert!((x[0] - 1.0 - i as f64).abs() < 1e-10 && (x[1] - 2.0 * x[0]).abs() < 1e-10, "{n}: {x:?}");
            }
        }
        lu.zeros(2).fill(1.0);
        assert!(!lu.factor());
    }
}
