//! Statistics of a matrix, for inspection by a user.

use std::fmt;

use crate::constrained::CONSTRAINED_DIAGONAL;
use crate::matrix::Matrix;

/// Number of rows and names that a report shows.
const SHOWN: usize = 6;

/// Statistics of one matrix.
///
/// ```
/// use stickslip_formats::{Matrix, MatrixReport, Symmetry};
///
/// let k = Matrix::new(2, 2, Symmetry::Symmetric, [(0, 0, 2e5), (1, 0, -1e5)])?;
/// let report = MatrixReport::new(&k);
/// assert_eq!((report.entries, &report.zero_diagonal[..]), (2, &[1][..]));
/// assert!(report.to_string().contains("2 x 2, 2 entries"));
/// # Ok::<(), stickslip_formats::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MatrixReport {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Number of stored entries: one triangle for a symmetric matrix.
    pub entries: usize,
    /// Number of explicit zeros in the file.
    pub zeros: usize,
    /// Largest absolute value.
    pub largest: f64,
    /// Smallest nonzero absolute value; infinite without entries.
    pub smallest: f64,
    /// Largest `|a_ij - a_ji|` divided by the largest absolute value; infinite
    /// unless the matrix is square.
    pub asymmetry: f64,
    /// Rows with a zero diagonal, counted from zero: massless in a mass matrix,
    /// unconnected in a stiffness matrix.
    pub zero_diagonal: Vec<usize>,
    /// Rows with a negative diagonal, counted from zero. A matrix with such a
    /// row is not positive semidefinite.
    pub negative_diagonal: Vec<usize>,
    /// Rows without any entry, counted from zero.
    pub empty_rows: Vec<usize>,
    /// Rows with 1e36 or more on their diagonal, counted from zero: constrained rows of Abaqus.
    pub constrained: Vec<usize>,
    /// The first names of rows, and the number of names.
    pub names: Option<(Vec<String>, usize)>,
    /// Format and variable.
    pub origin: String,
}

impl MatrixReport {
    /// Computes the statistics of a matrix.
    pub fn new(matrix: &Matrix) -> Self {
        let mut diagonal = vec![0.0; matrix.rows()];
        let mut filled = vec![false; matrix.rows()];
        for e in matrix.both_triangles() {
            filled[e.row as usize] = true;
            if e.row == e.column {
                diagonal[e.row as usize] = e.value;
            }
        }
        // Only the diagonal of a square matrix is meaningful.
        let rows = if matrix.rows() == matrix.columns() { matrix.rows() } else { 0 };
        let where_is = |test: fn(f64) -> bool| (0..rows).filter(|&row| test(diagonal[row])).collect();
        let largest = matrix.max_abs();
        let origin = matrix.origin();
        Self {
            rows: matrix.rows(),
            columns: matrix.columns(),
            entries: matrix.entries().len(),
            zeros: origin.zeros,
            largest,
            smallest: matrix.entries().iter().map(|e| e.value.abs()).fold(f64::INFINITY, f64::min),
            asymmetry: match matrix.asymmetry() {
                0.0 => 0.0,
                gap => gap / largest,
            },
            zero_diagonal: where_is(|value| value == 0.0),
            negative_diagonal: where_is(|value| value < 0.0),
            empty_rows: (0..matrix.rows()).filter(|&row| !filled[row]).collect(),
            constrained: where_is(|value| value >= CONSTRAINED_DIAGONAL),
            names: matrix.names().map(|names| (names.iter().take(SHOWN).cloned().collect(), names.len())),
            origin: [origin.format, &origin.variable].map(str::trim).join(" ").trim().to_string(),
        }
    }
}

impl fmt::Display for MatrixReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rows, columns, entries, zeros, largest, smallest, asymmetry, .. } = self;
        write!(f, "{rows} x {columns}, {entries} {}", if *entries == 1 { "entry" } else { "entries" })?;
        if *zeros > 0 {
            write!(f, " and {}", counted(*zeros, "explicit zero"))?;
        }
        if !self.origin.is_empty() {
            write!(f, ", from {}", self.origin)?;
        }
        if *entries > 0 {
            write!(f, "\nmagnitudes from {smallest:.3e} to {largest:.3e}")?;
        }
        match *asymmetry {
            0.0 => write!(f, "\nsymmetric")?,
            gap if gap.is_finite() => {
                write!(f, "\nnot symmetric: the triangles differ by {gap:.1e} of the largest value")?
            }
            _ => write!(f, "\nnot square")?,
        }
        let lists = [
            ("a zero diagonal", &self.zero_diagonal),
            ("a negative diagonal", &self.negative_diagonal),
            ("no entry", &self.empty_rows),
            ("1e36 on the diagonal (constrained)", &self.constrained),
        ];
        for (what, list) in lists.into_iter().filter(|(_, list)| !list.is_empty()) {
            let first: Vec<String> = list.iter().take(SHOWN).map(|row| (row + 1).to_string()).collect();
            let more = if list.len() > SHOWN { ", …" } else { "" };
            write!(f, "\n{} with {what}: {}{more}", counted(list.len(), "row"), first.join(", "))?;
        }
        if let Some((names, count)) = &self.names {
            let more = if *count > SHOWN { ", …" } else { "" };
            write!(f, "\nrows are named {}{more}", names.join(", "))?;
        }
        Ok(())
    }
}

/// Returns a count with its noun.
pub(crate) fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use crate::matrix::Symmetry;

    #[test]
    fn a_report_says_what_looks_wrong() -> Result<(), Error> {
        let entries = [(0, 0, 1e36), (1, 1, -2.0), (2, 1, 4.0), (1, 2, 5.0), (3, 3, 0.0)];
        let names = (1..=4).map(|row| format!("{row}.x")).collect();
        let report = MatrixReport::new(&Matrix::new(4, 4, Symmetry::General, entries)?.with_names(names)?);
        assert_eq!(report.constrained, [0]);
        assert_eq!(report.negative_diagonal, [1]);
        assert_eq!(report.zero_diagonal, [2, 3]);
        assert_eq!(report.empty_rows, [3]);
        assert_eq!(report.asymmetry, 1e-36);
        assert_eq!((report.smallest, report.zeros), (2.0, 1));
        let text = "4 x 4, 4 entries and 1 explicit zero\nmagnitudes from 2.000e0 to 1.000e36\nnot symmetric: the triangles \
                    differ by 1.0e-36 of the largest value\n2 rows with a zero diagonal: 3, 4\n1 row with a negative \
                    diagonal: 2\n1 row with no entry: 4\n1 row with 1e36 on the diagonal (constrained): 1\nrows are \
                    named 1.x, 2.x, 3.x, 4.x";
        assert_eq!(report.to_string(), text);
        let wide = MatrixReport::new(&Matrix::new(1, 2, Symmetry::General, [])?);
        assert_eq!(wide.to_string(), "1 x 2, 0 entries\nnot square\n1 row with no entry: 1");
        Ok(())
    }
}
