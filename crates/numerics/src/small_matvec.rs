//! Products with matrices of a few rows, with loop lengths that the compiler knows.
//!
//! For two to six numbers the overhead of a loop costs more than the arithmetic.

/// Adds `matrix x` to `out`. `matrix` is column-major, with columns as long as `out`.
///
/// # Example
/// ```
/// let mut out = [1.0, 0.0];
/// stickslip_numerics::small_matvec::add_matvec(&[1.0, 2.0, 3.0, 4.0], &[1.0, 10.0], &mut out);
/// assert_eq!(out, [32.0, 42.0]);
/// ```
pub fn add_matvec(matrix: &[f64], x: &[f64], out: &mut [f64]) {
    match out.len() {
        2 => add_columns::<2>(matrix, x, out),
        4 => add_columns::<4>(matrix, x, out),
        5 => add_columns::<5>(matrix, x, out),
        6 => add_columns::<6>(matrix, x, out),
        rows => {
            for (column, factor) in matrix.chunks_exact(rows.max(1)).zip(x) {
                axpy(*factor, column, out);
            }
        }
    }
}

/// Adds `matrix x` to the first `rows` rows of `out`.
///
/// `matrix` is column-major with `rows` rows. `x` and `out` are row-major with `columns` columns.
///
/// # Example
/// ```
/// let mut out = [0.0; 4];
/// // twice the identity matrix, and rows of two columns
/// stickslip_numerics::small_matvec::add_matmul_row_major(
///     &[2.0, 0.0, 0.0, 2.0],
///     2,
///     &[1.0, 2.0, 3.0, 4.0],
///     &mut out,
///     2,
/// );
/// assert_eq!(out, [2.0, 4.0, 6.0, 8.0]);
/// ```
pub fn add_matmul_row_major(matrix: &[f64], rows: usize, x: &[f64], out: &mut [f64], columns: usize) {
    match columns {
        0 => {}
        2 => add_rows::<2>(matrix, rows, x, out),
        4 => add_rows::<4>(matrix, rows, x, out),
        6 => add_rows::<6>(matrix, rows, x, out),
        _ => {
            for (i, out) in out.chunks_exact_mut(columns).take(rows).enumerate() {
                for (column, row) in matrix.chunks_exact(rows).zip(x.chunks_exact(columns)) {
                    axpy(column[i], row, out);
                }
            }
        }
    }
}

/// Adds `factor` times `row` to `out`.
pub fn axpy(factor: f64, row: &[f64], out: &mut [f64]) {
    out.iter_mut().zip(row).for_each(|(out, entry)| *out += factor * entry);
}

fn add_columns<const ROWS: usize>(matrix: &[f64], x: &[f64], out: &mut [f64]) {
    let Some(out) = out.first_chunk_mut::<ROWS>() else { return };
    let mut sum = *out;
    for (column, factor) in matrix.as_chunks::<ROWS>().0.iter().zip(x) {
        sum.iter_mut().zip(column).for_each(|(sum, entry)| *sum += factor * entry);
    }
    *out = sum;
}

fn add_rows<const COLUMNS: usize>(matrix: &[f64], rows: usize, x: &[f64], out: &mut [f64]) {
    let (x, out) = (x.as_chunks::<COLUMNS>().0, out.as_chunks_mut::<COLUMNS>().0);
    for (i, out) in out.iter_mut().take(rows).enumerate() {
        let mut sum = *out;
        for (column, row) in matrix.chunks_exact(rows).zip(x) {
            let factor = column[i];
            sum.iter_mut().zip(row).for_each(|(sum, entry)| *sum += factor * entry);
        }
        *out = sum;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// Every length gives the product of the matrices.
    #[test]
    fn every_length_is_the_same_product() {
        let entry = |i: usize, k: usize| ((i * 7919 + k * 104_729 + 1) as f64).sin();
        for rows in 1..=8 {
            for columns in 1..=8 {
                let (matrix, x) = (DMatrix::from_fn(rows, 3, entry), DMatrix::from_fn(3, columns, |i, k| entry(k, i)));
                let expected = &matrix * &x;
                let mut by_rows = vec![0.0; (rows + 1) * columns];
                let x_rows = x.transpose();
                add_matmul_row_major(matrix.as_slice(), rows, x_rows.as_slice(), &mut by_rows, columns);
                for k in 0..columns {
                    let mut column = vec![1.0; rows];
                    add_matvec(matrix.as_slice(), x.column(k).as_slice(), &mut column);
                    for i in 0..rows {
                        assert!((column[i] - 1.0 - expected[(i, k)]).abs() < 1e-14, "{rows} by {columns}");
                        assert!((by_rows[i * columns + k] - expected[(i, k)]).abs() < 1e-14, "{rows} by {columns}");
                    }
                }
                assert!(by_rows[rows * columns..].iter().all(|rest| *rest == 0.0), "{rows} by {columns}");
            }
        }
    }
}
