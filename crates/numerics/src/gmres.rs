//! Linear equations known by matrix-vector products only: GMRES with right preconditioning.
//!
//! `A P⁻¹ y = b`, `x = P⁻¹ y`. Of all x in the Krylov space of
//! `P⁻¹ b, P⁻¹ A P⁻¹ b, …`, the method finds the one with the least residual.
//! With right preconditioning this is the residual of the original equations.
//! Source: Saad and Schultz (1986); Saad, "Iterative Methods for Sparse Linear
//! Systems" (2003), Sec. 6.5 and 9.3.2.

use crate::interrupt;

/// Tolerance and work limits of one solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GmresLimits {
    /// Residual relative to the right side at which the equations count as solved.
    pub tolerance: f64,
    /// Number of basis vectors. After this number of products the iteration
    /// restarts from its current solution.
    pub restart: usize,
    /// Maximum number of products. A final check of the residual may add one.
    pub products: usize,
}

/// The result of a solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GmresOutcome {
    /// Number of products with the matrix.
    pub products: usize,
    /// Residual relative to the right side: recomputed by a product, or from
    /// the recurrence if the tolerance is 1e-4 or larger.
    pub residual: f64,
    /// True if the residual is within the tolerance.
    pub solved: bool,
}

/// The GMRES solver with its memory.
#[derive(Debug, Clone, Default)]
pub struct Gmres {
    basis: Vec<f64>,
    /// Columns of the triangular factor, each of `restart + 1` entries.
    triangle: Vec<f64>,
    rotations: Vec<(f64, f64)>,
    /// Right side of the least-squares problem; its last entry is the residual.
    rotated_rhs: Vec<f64>,
    sum: Vec<f64>,
    product: Vec<f64>,
}

impl Gmres {
    /// Solves `A x = b`.
    ///
    /// `multiply(v, out)` computes A v, and `precondition(v)` replaces v by P⁻¹
    /// v. `x` contains b on entry and the solution on return. If the equations
    /// are not solved, `x` is the last iterate.
    ///
    /// # Example
    /// ```
    /// use stickslip_numerics::gmres::{Gmres, GmresLimits};
    /// let mut x = [3.0, 4.0];
    /// let multiply = |v: &[f64], out: &mut [f64]| out.copy_from_slice(&[v[0] + v[1], 2.0 * v[1]]);
    /// let limits = GmresLimits { tolerance: 1e-12, restart: 5, products: 10 };
    /// assert!(Gmres::default().solve(&mut x, limits, multiply, |_| ()).solved);
    /// assert!((x[0] - 1.0).abs() < 1e-12 && (x[1] - 2.0).abs() < 1e-12);
    /// ```
    pub fn solve(
        &mut self,
        x: &mut [f64],
        limits: GmresLimits,
        mut multiply: impl FnMut(&[f64], &mut [f64]),
        mut precondition: impl FnMut(&mut [f64]),
    ) -> GmresOutcome {
        let n = x.len();
        let most = limits.restart.clamp(1, n.max(1));
        let rhs = x.to_vec();
        let size = norm(&rhs);
        x.fill(0.0);
        let mut outcome = GmresOutcome { products: 0, residual: 0.0, solved: true };
        if size == 0.0 {
            return outcome;
        }
        let mut residual = rhs.clone();
        let mut left = size;
        loop {
            let columns = self.cycle(
                &residual,
                left,
                GmresLimits {
                    tolerance: limits.tolerance * size,
                    restart: most,
                    products: limits.products - outcome.products,
                },
                &mut multiply,
                &mut precondition,
            );
            outcome.products += columns.len();
            // A cycle without finite weights leaves the solution unchanged.
            if columns.iter().any(|c| !c.is_finite()) {
                outcome.solved = false;
                outcome.residual = left / size;
                return outcome;
            }
            self.sum.clear();
            self.sum.resize(n, 0.0);
            for (column, weight) in self.basis.chunks_exact(n).zip(&columns) {
                self.sum.iter_mut().zip(column).for_each(|(sum, v)| *sum += weight * v);
            }
            precondition(&mut self.sum);
            x.iter_mut().zip(&self.sum).for_each(|(x, sum)| *x += sum);
            let expected = self.rotated_rhs.last().map_or(left, |entry| entry.abs());
            // Tolerance from which the residual of the recurrence is trusted. With few vectors
            // it differs from the true residual by rounding only.
            if limits.tolerance >= 1e-4 && expected <= limits.tolerance * size {
                outcome.residual = expected / size;
                return outcome;
            }
            multiply(x, &mut self.product);
            outcome.products += 1;
            residual.iter_mut().zip(&rhs).zip(&self.product).for_each(|((r, b), ax)| *r = b - ax);
            let before = left;
            left = norm(&residual);
            outcome.residual = left / size;
            // SLACK: rounding of the product may make the true residual larger
            // than that of the recurrence.
            // Factor on the tolerance by which the true residual may exceed that of the
            // recurrence, because of rounding in the products.
            outcome.solved = left <= 2.0 * limits.tolerance * size;
            if outcome.solved || outcome.products >= limits.products || left.is_nan() || left >= before {
                return outcome;
            }
        }
    }

    /// Runs one cycle from a residual, up to an absolute `tolerance`. Returns the weights of its
    /// basis vectors.
    fn cycle(
        &mut self,
        residual: &[f64],
        size: f64,
        limits: GmresLimits,
        multiply: &mut impl FnMut(&[f64], &mut [f64]),
        precondition: &mut impl FnMut(&mut [f64]),
    ) -> Vec<f64> {
        let n = residual.len();
        let GmresLimits { tolerance, restart, products } = limits;
        let tall = restart + 1;
        self.basis.clear();
        self.basis.extend(residual.iter().map(|r| r / size));
        self.triangle.clear();
        self.rotations.clear();
        self.rotated_rhs.clear();
        self.rotated_rhs.push(size);
        self.product.resize(n, 0.0);
        let mut count = 0;
        while count < restart.min(products) {
            interrupt::check();
            self.sum.clear();
            self.sum.extend_from_slice(&self.basis[count * n..]);
            precondition(&mut self.sum);
            multiply(&self.sum, &mut self.product);
            let whole = norm(&self.product);
            let start = count * tall;
            self.triangle.resize(start + tall, 0.0);
            // Orthogonalize twice, to remove the rounding of the first projection.
            for _ in 0..2 {
                for (i, v) in self.basis.chunks_exact(n).enumerate() {
                    let component = dot(v, &self.product);
                    self.triangle[start + i] += component;
                    self.product.iter_mut().zip(v).for_each(|(p, v)| *p -= component * v);
                }
            }
            let next = norm(&self.product);
            let column = &mut self.triangle[start..start + tall];
            for (i, &(c, s)) in self.rotations.iter().enumerate() {
                (column[i], column[i + 1]) = (c * column[i] + s * column[i + 1], c * column[i + 1] - s * column[i]);
            }
            let length = column[count].hypot(next);
            if !(length > 0.0 && length.is_finite()) {
                break; // the product has no new direction
            }
            let (c, s) = (column[count] / length, next / length);
            column[count] = length;
            self.rotations.push((c, s));
            let left = self.rotated_rhs[count];
            self.rotated_rhs[count] = c * left;
            self.rotated_rhs.push(-s * left);
            count += 1;
            // A new vector shorter than this fraction of the product it comes from is rounding:
            // the Krylov space is exhausted.
            if (s * left).abs() <= tolerance || next <= 1e-14 * whole {
                break;
            }
            self.basis.extend(self.product.iter().map(|p| p / next));
        }
        let mut weights = self.rotated_rhs[..count].to_vec();
        for i in (0..count).rev() {
            let sum: f64 = (i + 1..count).map(|j| self.triangle[j * tall + i] * weights[j]).sum();
            weights[i] = (weights[i] - sum) / self.triangle[i * tall + i];
        }
        weights
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four partial sums, always in the same order.
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let tail: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a4.zip(b4) {
        for i in 0..4 {
            sums[i] += a[i] * b[i];
        }
    }
    sums.iter().sum::<f64>() + tail
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Entries without a pattern, and a rising diagonal.
    fn entry(i: usize, k: usize, n: usize) -> f64 {
        let noise = ((i * 7919 + k * 104_729 + 1) as f64).sin() / (n as f64).sqrt();
        if i == k { 1.0 + i as f64 / n as f64 + noise } else { noise }
    }

    fn solve(n: usize, limits: GmresLimits, diagonal: bool) -> (GmresOutcome, f64) {
        let wanted: Vec<f64> = (0..n).map(|i| (i as f64 * 0.7).cos()).collect();
        let product = |v: &[f64], out: &mut [f64]| {
            for (i, out) in out.iter_mut().enumerate() {
                *out = (0..n).map(|k| entry(i, k, n) * v[k]).sum();
            }
        };
        let mut x = vec![0.0; n];
        product(&wanted, &mut x);
        let outcome = Gmres::default().solve(&mut x, limits, product, |v| {
            if diagonal {
                v.iter_mut().enumerate().for_each(|(i, v)| *v /= 1.0 + i as f64 / n as f64);
            }
        });
        (outcome, x.iter().zip(&wanted).map(|(x, w)| (x - w).abs()).fold(0.0, f64::max))
    }

    /// The solution is the vector that the matrix was multiplied with: in one
    /// cycle, in several, and with a preconditioner.
    #[test]
    fn the_solution_is_found() {
        for n in [1, 5, 80] {
            let whole = GmresLimits { tolerance: 1e-12, restart: n, products: 2 * n + 2 };
            let (outcome, error) = solve(n, whole, false);
            assert!(outcome.solved && error < 1e-9, "{n}: {outcome:?} {error:.1e}");
        }
        let limits = GmresLimits { tolerance: 1e-10, restart: 60, products: 400 };
        let (plain, error) = solve(80, limits, false);
        assert!(plain.solved && error < 1e-7, "{plain:?} {error:.1e}");
        let (restarted, error) = solve(80, GmresLimits { restart: 25, ..limits }, true);
        assert!(restarted.solved && error < 1e-7, "{restarted:?} {error:.1e}");
    }

    /// Without a solution, or with too few products, the outcome is not solved.
    #[test]
    fn unsolved_systems_are_reported() {
        let limits = GmresLimits { tolerance: 1e-12, restart: 10, products: 4 };
        let (outcome, _) = solve(80, limits, false);
        assert!(!outcome.solved && outcome.products <= 5, "{outcome:?}");
        assert!(outcome.residual > 1e-12 && outcome.residual < 1.0);
        let mut x = [1.0, 1.0];
        let singular = |v: &[f64], out: &mut [f64]| out.copy_from_slice(&[v[0] + v[1], 0.0]);
        let outcome =
            Gmres::default().solve(&mut x, GmresLimits { tolerance: 1e-9, restart: 9, products: 30 }, singular, |_| ());
        assert!(!outcome.solved && outcome.residual > 0.5, "{outcome:?}");
        let mut x = [1.0; 3];
        let none = Gmres::default().solve(&mut x, limits, |_, out| out.fill(f64::NAN), |_| ());
        assert!(!none.solved, "{none:?}");
    }
}
