//! The matrices of one structure, as programs write them: in which rows they agree, and which of those are constrained.
//!
//! Some programs leave rows without entries out of one matrix and not of the other, so that names of rows count, not their numbers. What is
//! constrained they keep as a row of zeros (ANSYS) or with [`CLAMPED`] on its diagonal (Abaqus).

use crate::error::Error;
use crate::matrix::Matrix;

/// What Abaqus puts on the diagonal of a constrained row; larger is no stiffness either.
pub(crate) const CLAMPED: f64 = 1e36;

/// `matrix` with the rows of `first` in their order, where both have names.
///
/// ```
/// use stickslip_formats::{Matrix, Symmetry, aligned};
///
/// let named = |names: &[&str], value| {
///     let diagonal = (0..names.len()).map(|row| (row, row, value));
///     let names = names.iter().map(|name| name.to_string()).collect();
///     Matrix::new(diagonal.len(), diagonal.len(), Symmetry::Symmetric, diagonal)?.with_names(names)
/// };
/// let (stiffness, mass) = (named(&["1.x", "1.y"], 5.0)?, named(&["1.y"], 2.0)?);
/// let mass = aligned(mass, &stiffness)?;
/// assert_eq!((mass.rows(), mass.get(0, 0), mass.get(1, 1)), (2, 0.0, 2.0));
/// # Ok::<(), stickslip_formats::Error>(())
/// ```
///
/// # Errors
/// [`Kind::Names`](crate::Kind::Names): a row of `matrix` is none of `first`.
pub fn aligned(matrix: Matrix, first: &Matrix) -> Result<Matrix, Error> {
    match (first.names(), matrix.names()) {
        (Some(names), Some(own)) if names != own => matrix.in_order_of(names),
        _ => Ok(matrix),
    }
}

/// Rows, from zero, that are constrained in `matrices` of so many `rows`: without an entry in any of them, or with 1e36 on a diagonal.
///
/// ```
/// use stickslip_formats::{Matrix, Symmetry, constrained};
///
/// let stiffness = Matrix::new(3, 3, Symmetry::Symmetric, [(0, 0, 1e36), (2, 2, 5.0)])?;
/// assert_eq!(constrained(&[&stiffness], 3), [0, 1]);
/// # Ok::<(), stickslip_formats::Error>(())
/// ```
pub fn constrained(matrices: &[&Matrix], rows: usize) -> Vec<usize> {
    let mut free = vec![false; rows];
    let entries = || matrices.iter().flat_map(|matrix| matrix.entries());
    entries().for_each(|entry| (free[entry.row as usize], free[entry.column as usize]) = (true, true));
    entries()
        .filter(|entry| entry.row == entry.column && entry.value >= CLAMPED)
        .for_each(|entry| free[entry.row as usize] = false);
    (0..rows).filter(|&row| !free[row]).collect()
}
