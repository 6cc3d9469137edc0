//! Dense linear equations in memory that the caller owns.

/// Solves `A x = b` by elimination with row exchanges: `matrix` is A, row-major, `n × n`, and is destroyed; `right` is b and
/// becomes x. Returns false if a pivot vanishes or is not finite.
///
/// Source: Golub and Van Loan, "Matrix Computations" (2013), Sec. 3.4.
///
/// # Example
/// ```
/// let (mut a, mut b) = (vec![0.0, 2.0, 4.0, 1.0], vec![2.0, 9.0]);
/// assert!(stickslip_numerics::dense::solve(&mut a, 2, &mut b));
/// assert_eq!(b, [2.0, 1.0]);
/// ```
pub fn solve(matrix: &mut [f64], n: usize, right: &mut [f64]) -> bool {
    for k in 0..n {
        let mut pivot = k;
        for i in k + 1..n {
            if matrix[i * n + k].abs() > matrix[pivot * n + k].abs() {
                pivot = i;
            }
        }
        let largest = matrix[pivot * n + k];
        if largest == 0.0 || !largest.is_finite() {
            return false;
        }
        if pivot != k {
            let (top, bottom) = matrix.split_at_mut(pivot * n);
            top[k * n + k..(k + 1) * n].swap_with_slice(&mut bottom[k..n]);
            right.swap(k, pivot);
        }
        let (top, bottom) = matrix.split_at_mut((k + 1) * n);
        let pivot_row = &top[k * n + k..];
        let inverse = 1.0 / largest;
        for (i, row) in bottom.chunks_exact_mut(n).enumerate() {
            let factor = row[k] * inverse;
            if factor != 0.0 {
                for (x, p) in row[k + 1..].iter_mut().zip(&pivot_row[1..]) {
                    *x -= factor * p;
                }
                right[k + 1 + i] -= factor * right[k];
            }
        }
    }
    for k in (0..n).rev() {
        let row = &matrix[k * n..(k + 1) * n];
        let sum: f64 = row[k + 1..].iter().zip(&right[k + 1..n]).map(|(a, x)| a * x).sum();
        right[k] = (right[k] - sum) / row[k];
    }
    right[..n].iter().all(|x| x.is_finite())
}
