//! Null directions of a singular system of equations, and minimum-norm steps.
//!
//! Consider a wave in which each blade leads the next by a quarter period. It loads every
//! second joint alike, and the joints between them alike, but the two halves do not interact.
//! The phase between the halves is not determined, and the mixtures form a continuum of
//! motions. While joints stick, any mixture of two equal modes is a motion. Newton's step and
//! the tangent then have no unique solution. The step of minimum norm is taken, which stays
//! close to the motion that it comes from.
//!
//! Source: Allgower and Georg, "Introduction to Numerical Continuation Methods"
//! (2003), Ch. 3 (Moore-Penrose inverse).

use crate::dense::DenseLu;
use crate::vector::dot;

/// Returns the null directions of a matrix (row-major, n × n). A matrix that
/// has no factor, such as one with NaN, returns none.
pub fn null_directions(matrix: &[f64], n: usize) -> Vec<Vec<f64>> {
    // Maximum number of null directions: all mixtures of two equal modes.
    let most = 2;
    let size = |column: usize| (0..n).map(|row| matrix[row * n + column].powi(2)).sum::<f64>().sqrt();
    let sizes: Vec<f64> = (0..n).map(|column| size(column).max(f64::MIN_POSITIVE)).collect();
    let scaled: Vec<f64> = matrix[..n * n].iter().enumerate().map(|(at, value)| value / sizes[at % n]).collect();
    // the matrix is row-major: its transpose is factored
    let Ok(factor) = DenseLu::new(scaled.clone(), n) else { return Vec::new() };
    // pseudo-random columns
    let mut found: Vec<Vec<f64>> =
        (0..most.min(n)).map(|j| (0..n).map(|i| (1.0 + 7.0 * (i * most + j) as f64).sin()).collect()).collect();
    // Steps of inverse iteration. Null directions are separated from the others by a factor of
    // more than a thousand.
    for _ in 0..3 {
        found.iter_mut().for_each(|z| factor.solve(z));
        orthonormal(&mut found, &|a, b| dot(a, b));
        found.iter_mut().for_each(|z| factor.solve_adjoint(z));
        orthonormal(&mut found, &|a, b| dot(a, b));
    }
    found.retain(|z| {
        let change = |row: &[f64]| dot(row, z).powi(2);
        // Change of the equations by a step of one along a null direction, both relative, at
        // most. Rounding leaves 1e-13. Friction of only 1e-4 of the forces separates the
        // mixtures of two modes by 1e-6.
        scaled.chunks_exact(n).map(change).sum::<f64>().sqrt() <= 1e-9
    });
    for z in &mut found {
        z.iter_mut().zip(&sizes).for_each(|(z, size)| *z /= size);
    }
    found
}

/// Subtracts the components along null directions from a step: the result has
/// minimum norm in the product `inner`.
pub fn min_norm_step(step: &mut [f64], mut null: Vec<Vec<f64>>, inner: &dyn Fn(&[f64], &[f64]) -> f64) {
    orthonormal(&mut null, inner);
    for z in &null {
        let along = inner(z, step);
        step.iter_mut().zip(z).for_each(|(step, z)| *step -= along * z);
    }
}

/// Orthonormalises the columns. Columns that are zero or not finite are omitted.
fn orthonormal(columns: &mut Vec<Vec<f64>>, inner: &dyn Fn(&[f64], &[f64]) -> f64) {
    let mut made: Vec<Vec<f64>> = Vec::with_capacity(columns.len());
    for mut column in columns.drain(..) {
        // scaled first: the solution of a nearly singular matrix may overflow when squared
        let largest = column.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        column.iter_mut().for_each(|x| *x /= largest);
        for before in &made {
            let along = inner(before, &column);
            column.iter_mut().zip(before).for_each(|(x, y)| *x -= along * y);
        }
        let length = inner(&column, &column).sqrt();
        column.iter_mut().for_each(|x| *x /= length);
        if column.iter().all(|x| x.is_finite()) {
            made.push(column);
        }
    }
    *columns = made;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `x + y = 2` twice, up to rounding, does not determine `x - y`. The
    /// minimum-norm solution is orthogonal to that direction.
    #[test]
    fn minimum_norm_solution_is_orthogonal_to_the_null_direction() {
        let found = null_directions(&[1.0, 1.0 + 1e-15, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 3.0], 3);
        let [z] = &found[..] else { panic!("{found:?}") };
        assert!((z[0] + z[1]).abs() < 1e-12 * z[0].abs() && z[2].abs() < 1e-12 * z[0].abs(), "{z:?}");
        let mut step = vec![5.0, -3.0, 1.0];
        min_norm_step(&mut step, found, &|a, b| dot(a, b));
        assert!(step.iter().zip([1.0, 1.0, 1.0]).all(|(a, b): (&f64, f64)| (a - b).abs() < 1e-12), "{step:?}");
        // a regular matrix has no null directions
        assert!(null_directions(&[2.0, 1.0, 1.0, -1.0], 2).is_empty());
    }
}
