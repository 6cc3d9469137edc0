//! Common rows of the matrices of one structure, and their constrained rows.
//!
//! Some programs omit rows without entries in one matrix but not in the other.
//! Such rows are matched by their names. ANSYS writes a constrained row as a
//! row of zeros, and Abaqus with [`CONSTRAINED_DIAGONAL`] on its diagonal.

use crate::error::Error;
use crate::matrix::Matrix;

/// Diagonal value of a constrained row in Abaqus. A larger value is not a stiffness either.
pub(crate) const CONSTRAINED_DIAGONAL: f64 = 1e36;

/// Returns `matrix` with the rows of `first`, in their order. If either has no
/// names, the function returns `matrix` unchanged.
///
/// ```
/// use stickslip_formats::{Matrix, Symmetry, align_rows};
///
/// let named = |names: &[&str], value| {
///     let diagonal = (0..names.len()).map(|row| (row, row, value));
///     let names = names.iter().map(|name| name.to_string()).collect();
///     Matrix::new(diagonal.len(), diagonal.len(), Symmetry::Symmetric, diagonal)?
///         .with_names(names)
/// };
/// let (stiffness, mass) = (named(&["1.x", "1.y"], 5.0)?, named(&["1.y"], 2.0)?);
/// let mass = align_rows(mass, &stiffness)?;
/// assert_eq!((mass.rows(), mass.get(0, 0), mass.get(1, 1)), (2, 0.0, 2.0));
/// # Ok::<(), stickslip_formats::Error>(())
/// ```
///
/// # Errors
/// [`ErrorKind::Names`](crate::ErrorKind::Names) if a row of `matrix` is missing in `first`.
pub fn align_rows(matrix: Matrix, first: &Matrix) -> Result<Matrix, Error> {
    match (first.names(), matrix.names()) {
        (Some(names), Some(own)) if names != own => matrix.reordered(names),
        _ => Ok(matrix),
    }
}

/// Returns the constrained rows of `matrices` with `rows` rows, counted from zero.
///
/// A row is constrained if it has no entry in any matrix, or if it has 1e36 or more on a diagonal.
///
/// ```
/// use stickslip_formats::{Matrix, Symmetry, constrained_rows};
///
/// let stiffness = Matrix::new(3, 3, Symmetry::Symmetric, [(0, 0, 1e36), (2, 2, 5.0)])?;
/// assert_eq!(constrained_rows(&[&stiffness], 3), [0, 1]);
/// # Ok::<(), stickslip_formats::Error>(())
/// ```
pub fn constrained_rows(matrices: &[&Matrix], rows: usize) -> Vec<usize> {
    let mut free = vec![false; rows];
    let entries = || matrices.iter().flat_map(|matrix| matrix.entries());
    entries().for_each(|entry| (free[entry.row as usize], free[entry.column as usize]) = (true, true));
    entries()
        .filter(|entry| entry.row == entry.column && entry.value >= CONSTRAINED_DIAGONAL)
        .for_each(|entry| free[entry.row as usize] = false);
    (0..rows).filter(|&row| !free[row]).collect()
}
