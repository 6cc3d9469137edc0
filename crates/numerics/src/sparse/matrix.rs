//! A square sparse matrix in compressed column storage.

use std::ops::Range;

/// Maximum number of rows and entries. Indices have 32 bits, which halves the
/// memory of the pattern.
const MAX_SIZE: usize = i32::MAX as usize;

/// A square matrix of which only nonzero entries are stored, by columns with rising rows.
///
/// A symmetric matrix stores both triangles; [`asymmetry`](SparseMatrix::asymmetry) tests it.
///
/// # Example
/// ```
/// use stickslip_numerics::sparse::SparseMatrix;
/// // a spring between two masses, as its contributions to either mass
/// let k = SparseMatrix::from_triplets(
///     2,
///     [(0, 0, 5.0), (1, 1, 5.0), (0, 1, -5.0), (1, 0, -5.0), (0, 0, 1.0)],
/// )
/// .unwrap();
/// assert_eq!((k.get(0, 0), k.get(0, 1), k.entries().count()), (6.0, -5.0, 4));
/// assert_eq!(k.multiply(&[1.0, 1.0]), [1.0, 0.0]);
/// assert!(k.asymmetry(0.0).is_none());
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SparseMatrix {
    n: usize,
    /// Start of each column in `rows` and `values`, n + 1 numbers.
    pub(super) starts: Vec<u32>,
    pub(super) rows: Vec<u32>,
    pub(super) values: Vec<f64>,
}

/// The reason why triplets do not form a matrix. Rows and columns count from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MatrixError {
    /// An entry lies outside the matrix.
    #[error("an entry in row {row}, column {column} (counted from 0) lies outside the {n} x {n} matrix")]
    OutOfRange {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// Rows and columns of the matrix.
        n: usize,
    },
    /// An entry is not finite.
    #[error("the entry in row {row}, column {column} (counted from 0) is {value}; every entry must be finite")]
    NotFinite {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// Value of the entry.
        value: f64,
    },
    /// The numbers of rows or entries exceed the 32-bit indices.
    #[error(
        "a matrix with {n} rows and {entries} entries is too large; at most {MAX_SIZE} rows and {MAX_SIZE} entries are supported"
    )]
    TooLarge {
        /// Number of rows.
        n: usize,
        /// Number of entries.
        entries: usize,
    },
}

/// Two mirrored entries that differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Asymmetry {
    /// Row of `value`, from 0.
    pub row: usize,
    /// Column of `value`, from 0.
    pub column: usize,
    /// Value of the entry.
    pub value: f64,
    /// Value of the mirrored entry.
    pub mirrored: f64,
}

impl SparseMatrix {
    /// Builds a matrix from entries (row, column, value), counted from 0, in any order.
    ///
    /// Entries at the same place are added in the order in which they come. Zeros are dropped.
    ///
    /// # Errors
    /// [`MatrixError`]: an entry outside, a sum that is not finite, more
    /// entries than 32 bits count.
    pub fn from_triplets(
        n: usize,
        triplets: impl IntoIterator<Item = (usize, usize, f64)>,
    ) -> Result<Self, MatrixError> {
        let triplets = triplets.into_iter();
        let mut entries = Vec::with_capacity(triplets.size_hint().0);
        for (row, column, value) in triplets {
            if row >= n || column >= n {
                return Err(MatrixError::OutOfRange { row, column, n });
            }
            if n > MAX_SIZE || entries.len() == MAX_SIZE {
                return Err(MatrixError::TooLarge { n, entries: entries.len() + 1 });
            }
            entries.push((column as u32, row as u32, value));
        }
        // Both sorts are stable, so contributions to one place keep their order.
        if !entries.is_sorted_by_key(|&(column, row, _)| (column, row)) {
            entries = counting_sort(n, &entries, |entry| entry.1);
            entries = counting_sort(n, &entries, |entry| entry.0);
        }
        entries.dedup_by(|next, kept| {
            let same = (next.0, next.1) == (kept.0, kept.1);
            if same {
                kept.2 += next.2;
            }
            same
        });
        if let Some(&(column, row, value)) = entries.iter().find(|entry| !entry.2.is_finite()) {
            return Err(MatrixError::NotFinite { row: row as usize, column: column as usize, value });
        }
        entries.retain(|entry| entry.2 != 0.0);
        let mut starts = vec![0; n + 1];
        entries.iter().for_each(|&(column, ..)| starts[column as usize + 1] += 1);
        (0..n).for_each(|column| starts[column + 1] += starts[column]);
        let rows = entries.iter().map(|entry| entry.1).collect();
        Ok(SparseMatrix { n, starts, rows, values: entries.iter().map(|entry| entry.2).collect() })
    }

    /// Returns the number of rows and columns.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Returns the number of nonzero entries.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Returns true if all entries are zero.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    pub(super) fn range(&self, column: usize) -> Range<usize> {
        self.starts[column] as usize..self.starts[column + 1] as usize
    }

    /// Returns the nonzero entries of a column: (row, value), rows rising.
    pub fn column(&self, column: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.range(column);
        self.rows[range.clone()].iter().zip(&self.values[range]).map(|(&row, &value)| (row as usize, value))
    }

    /// Returns all nonzero entries: (row, column, value), column by column.
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        (0..self.n).flat_map(move |column| self.column(column).map(move |(row, value)| (row, column, value)))
    }

    /// Returns the entry (row, column), from 0.
    ///
    /// # Panics
    /// If the column lies outside the matrix.
    pub fn get(&self, row: usize, column: usize) -> f64 {
        let range = self.range(column);
        let rows = &self.rows[range.clone()];
        rows.binary_search_by(|r| (*r as usize).cmp(&row)).map_or(0.0, |at| self.values[range.start + at])
    }

    /// Returns the largest magnitude of an entry.
    pub fn max_abs(&self) -> f64 {
        self.values.iter().fold(0.0, |largest, value| largest.max(value.abs()))
    }

    /// Returns the first two mirrored entries that differ by more than `rounding`, in the unit
    /// of the entries, or `None` if the matrix is symmetric.
    pub fn asymmetry(&self, rounding: f64) -> Option<Asymmetry> {
        // Columns come rising, and so do the mirrored rows of a column.
        let mut met: Vec<u32> = self.starts[..self.n].to_vec();
        self.entries().find_map(|(row, column, value)| {
            let (at, end) = (&mut met[row], self.starts[row + 1]);
            while *at < end && (self.rows[*at as usize] as usize) < column {
                *at += 1;
            }
            let found = *at < end && self.rows[*at as usize] as usize == column;
            let mirrored = if found { self.values[*at as usize] } else { 0.0 };
            ((value - mirrored).abs() > rounding).then_some(Asymmetry { row, column, value, mirrored })
        })
    }

    /// Returns `A x`.
    ///
    /// # Panics
    /// If `x` does not have n entries.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        assert_eq!(x.len(), self.n, "the vector must have as many entries as the matrix has columns");
        let mut product = vec![0.0; self.n];
        for (row, column, value) in self.entries() {
            product[row] += value * x[column];
        }
        product
    }
}

/// Column, row, value.
type Entry = (u32, u32, f64);

/// Returns the entries sorted by rising `key` below `n`, by a stable counting sort.
///
/// Two such sorts, by row and by column, take as long as reading the entries a
/// few times, for any number of entries.
fn counting_sort(n: usize, entries: &[Entry], key: impl Fn(&Entry) -> u32) -> Vec<Entry> {
    let mut next = vec![0u32; n + 1];
    entries.iter().for_each(|entry| next[key(entry) as usize + 1] += 1);
    (0..n).for_each(|at| next[at + 1] += next[at]);
    let mut sorted = vec![(0, 0, 0.0); entries.len()];
    for entry in entries {
        let to = &mut next[key(entry) as usize];
        sorted[*to as usize] = *entry;
        *to += 1;
    }
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_triplets_are_refused_with_their_place() {
        let make = |entries: &[(usize, usize, f64)]| SparseMatrix::from_triplets(2, entries.iter().copied());
        assert_eq!(make(&[(2, 0, 1.0)]), Err(MatrixError::OutOfRange { row: 2, column: 0, n: 2 }));
        assert!(matches!(make(&[(0, 1, f64::NAN)]), Err(MatrixError::NotFinite { row: 0, column: 1, .. })));
        assert!(matches!(make(&[(0, 1, f64::MAX), (0, 1, f64::MAX)]), Err(MatrixError::NotFinite { .. })));
        // Entries that cancel are not stored.
        assert!(make(&[(0, 1, 2.0), (0, 1, -2.0)]).unwrap().is_empty());
        let one_sided = make(&[(0, 1, 2.0), (0, 0, 1.0)]).unwrap();
        assert_eq!(one_sided.asymmetry(1.0), Some(Asymmetry { row: 0, column: 1, value: 2.0, mirrored: 0.0 }));
        assert_eq!(one_sided.asymmetry(2.0), None);
        // Above the diagonal only, below it only, and both.
        let sided = |entries: &[(usize, usize, f64)]| {
            let matrix = SparseMatrix::from_triplets(4, entries.iter().copied()).unwrap();
            matrix.asymmetry(0.0).map(|pair| (pair.row, pair.column, pair.mirrored))
        };
        assert_eq!(sided(&[(0, 3, 1.0), (3, 0, 1.0), (1, 3, 2.0)]), Some((1, 3, 0.0)));
        assert_eq!(sided(&[(0, 3, 1.0), (3, 0, 1.0), (3, 1, 2.0)]), Some((3, 1, 0.0)));
        assert_eq!(sided(&[(2, 2, 1.0), (2, 0, 1.0), (0, 2, 1.0), (3, 0, 5.0), (0, 3, 5.0)]), None);
    }

    /// Products agree with those of the dense matrix. Any order of triplets
    /// without repetitions gives the same matrix.
    #[test]
    fn products_and_orders() {
        let n = 7;
        let value = |i: usize, k: usize| ((i * 31 + k * 17 + 1) as f64).sin();
        let all: Vec<(usize, usize, f64)> =
            (0..n * n).filter(|at| at % 3 == 0).map(|at| (at / n, at % n, value(at / n, at % n))).collect();
        let matrix = SparseMatrix::from_triplets(n, all.iter().copied()).unwrap();
        assert_eq!(matrix, SparseMatrix::from_triplets(n, all.iter().rev().copied()).unwrap());
        assert_eq!(matrix.len(), all.len());
        let x: Vec<f64> = (0..n).map(|i| 1.0 + i as f64).collect();
        for (i, y) in matrix.multiply(&x).iter().enumerate() {
            let row: f64 = (0..n).filter(|k| (i * n + k) % 3 == 0).map(|k| value(i, k) * x[k]).sum();
            assert!((y - row).abs() < 1e-13, "{y} {row}");
        }
    }
}
