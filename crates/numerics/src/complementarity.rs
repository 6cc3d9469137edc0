//! Linear complementarity with bounds: find `λ` with `low ≤ λ ≤ high` and `w = b - D λ` such
//! that `w = 0` where `low < λ < high`, `w ≥ 0` where `λ = high`, and `w ≤ 0` where `λ = low`.
//!
//! With `D` symmetric positive semidefinite these are the optimality conditions of
//! `min ½ λᵀDλ - bᵀλ` within the bounds. `w` is unique, and so is `λ` if `D` is definite. In a
//! contact problem `λ` are friction forces and `w` relative accelerations.
//!
//! The method is block pivoting. Murty's least-index rule is the safeguard that makes it finite.
//! Source: Cottle, Pang, Stone, "The Linear Complementarity Problem" (1992),
//! Ch. 4; Júdice and Pires (1994).

use crate::eigen;
use nalgebra::{DMatrix, DVector};

/// The position of a component of the solution between its bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BoundState {
    Inside,
    Low,
    High,
}

/// A component is infeasible if it violates its condition by more than this fraction of the
/// problem's scale. The value is the rounding of a small dense solve.
const FEASIBILITY_TOLERANCE: f64 = 1e-13;

/// Solves the problem. Returns `None` if the pivoting cycles, which an indefinite `D` can cause.
///
/// # Example
/// ```
/// use nalgebra::{dmatrix, dvector};
/// use stickslip_numerics::complementarity::solve;
/// // the load is 3 and the limit 2: the contact slips with acceleration 1
/// let λ = solve(&dmatrix![1.0], &dvector![3.0], &dvector![-2.0], &dvector![2.0]).unwrap();
/// assert_eq!(λ[0], 2.0);
/// ```
pub fn solve(d: &DMatrix<f64>, b: &DVector<f64>, low: &DVector<f64>, high: &DVector<f64>) -> Option<DVector<f64>> {
    let mut lambda = DVector::zeros(b.len());
    solve_into(d, b, low, high, &mut lambda).then_some(lambda)
}

/// Solves the problem like [`solve`], into `lambda`. Returns false if [`solve`] returns `None`.
/// A problem of one component allocates no memory.
pub fn solve_into(
    d: &DMatrix<f64>,
    b: &DVector<f64>,
    low: &DVector<f64>,
    high: &DVector<f64>,
    lambda: &mut DVector<f64>,
) -> bool {
    let solution = match b.len() {
        1 => solve_one(d[0], b[0], low[0], high[0]).map(|one| lambda[0] = one),
        _ => pivot(d, b, low, high).map(|all| lambda.copy_from(&all)),
    };
    solution.is_some()
}

/// Solves the problem by block pivoting.
fn pivot(d: &DMatrix<f64>, b: &DVector<f64>, low: &DVector<f64>, high: &DVector<f64>) -> Option<DVector<f64>> {
    // Block pivots without a decrease of the number of infeasible components, after which single
    // pivots take over.
    let block_pivots_without_progress: usize = 3;
    let n = b.len();
    let mut side = vec![BoundState::Inside; n];
    let (mut fewest, mut remaining_block_pivots) = (n + 1, block_pivots_without_progress);
    for _ in 0..(100 + 20 * n * n) {
        let mut lambda = solve_inside(d, b, low, high, &side);
        let w = b - d * &lambda;
        let w_scale = FEASIBILITY_TOLERANCE * (b.amax() + (d * &lambda).amax());
        let l_scale = FEASIBILITY_TOLERANCE * lambda.amax();
        let infeasible: Vec<usize> = (0..n)
            .filter(|&i| match side[i] {
                BoundState::Inside => lambda[i] > high[i] + l_scale || lambda[i] < low[i] - l_scale,
                BoundState::High => w[i] < -w_scale,
                BoundState::Low => w[i] > w_scale,
            })
            .collect();
        if infeasible.is_empty() {
            for i in 0..n {
                lambda[i] = lambda[i].clamp(low[i], high[i]);
            }
            return Some(lambda);
        }
        if infeasible.len() < fewest {
            (fewest, remaining_block_pivots) = (infeasible.len(), block_pivots_without_progress);
        } else {
            remaining_block_pivots = remaining_block_pivots.saturating_sub(1);
        }
        let change = if remaining_block_pivots > 0 { &infeasible[..] } else { &infeasible[..1] };
        for &i in change {
            side[i] = match side[i] {
                BoundState::Inside if lambda[i] > high[i] => BoundState::High,
                BoundState::Inside => BoundState::Low,
                _ => BoundState::Inside,
            };
        }
    }
    None
}

/// Solves a problem of one component: inside if that is feasible, else at the violated bound.
fn solve_one(d: f64, b: f64, low: f64, high: f64) -> Option<f64> {
    let lambda = if d > 0.0 { b / d } else { 0.0 };
    let bound = if lambda > high { high } else { low };
    if (low..=high).contains(&lambda) || (lambda - bound).abs() <= FEASIBILITY_TOLERANCE * lambda.abs() {
        return Some(lambda.clamp(low, high));
    }
    let w = b - d * bound;
    let violation = if bound == high { -w } else { w };
    (violation <= FEASIBILITY_TOLERANCE * (b.abs() + (d * bound).abs())).then_some(bound)
}

fn solve_inside(
    d: &DMatrix<f64>,
    b: &DVector<f64>,
    low: &DVector<f64>,
    high: &DVector<f64>,
    side: &[BoundState],
) -> DVector<f64> {
    // Singular values of `D` below this fraction of the largest count as zero: redundant
    // contacts.
    let rank_tolerance = 1e-12;
    let n = b.len();
    let mut lambda = DVector::from_fn(n, |i, _| match side[i] {
        BoundState::Inside => 0.0,
        BoundState::Low => low[i],
        BoundState::High => high[i],
    });
    let inside: Vec<usize> = (0..n).filter(|&i| side[i] == BoundState::Inside).collect();
    if inside.is_empty() {
        return lambda;
    }
    let rhs = b - d * &lambda;
    if let [i] = inside[..] {
        lambda[i] = if d[(i, i)] > 0.0 { rhs[i] / d[(i, i)] } else { 0.0 };
        return lambda;
    }
    // Redundant contacts share the load in proportion to their limits, which minimizes Σ λ²/high.
    let weight = |i: usize| if high[i].is_finite() && high[i] > 0.0 { high[i].sqrt() } else { 1.0 };
    let scaled = DMatrix::from_fn(inside.len(), inside.len(), |i, j| {
        weight(inside[i]) * d[(inside[i], inside[j])] * weight(inside[j])
    });
    let weighted_rhs = DVector::from_fn(inside.len(), |i, _| weight(inside[i]) * rhs[inside[i]]);
    let solution = match scaled.clone().cholesky() {
        Some(factor) if factor.l_dirty().diagonal().iter().all(|p| p * p > rank_tolerance * scaled.amax()) => {
            factor.solve(&weighted_rhs)
        }
        _ => {
            let least = eigen::svd(scaled)
                .and_then(|svd| svd.solve(&weighted_rhs, rank_tolerance * svd.singular_values.amax()).ok());
            least.unwrap_or_else(|| DVector::zeros(inside.len()))
        }
    };
    for (k, &i) in inside.iter().enumerate() {
        lambda[i] = solution[k] * weight(i);
    }
    lambda
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The conditions hold on random definite problems, whichever pivots were taken.
        #[test]
        fn solution_satisfies_the_conditions(
            entries in prop::collection::vec(-1.0..1.0f64, 36),
            b in prop::collection::vec(-3.0..3.0f64, 6),
            limits in prop::collection::vec(0.01..2.0f64, 6),
        ) {
            let a = DMatrix::from_vec(6, 6, entries);
            let d = &a.transpose() * &a + DMatrix::identity(6, 6) * 1e-3;
            let (b, high) = (DVector::from_vec(b), DVector::from_vec(limits));
            let low = -&high;
            let lambda = solve(&d, &b, &low, &high).expect("definite problems end");
            let w = &b - &d * &lambda;
            for i in 0..6 {
                prop_assert!(lambda[i].abs() <= high[i]);
                if lambda[i] < high[i] * (1.0 - 1e-12) { prop_assert!(w[i] < 1e-10); }
                if lambda[i] > low[i] * (1.0 - 1e-12) { prop_assert!(w[i] > -1e-10); }
            }
        }
    }

    /// Two parallel contacts share the load in proportion to their limits.
    #[test]
    fn parallel_contacts_share_by_limit() {
        let d = DMatrix::from_element(2, 2, 1.0);
        let (b, high) = (DVector::from_vec(vec![1.5, 1.5]), DVector::from_vec(vec![1.0, 2.0]));
        let lambda = solve(&d, &b, &-&high, &high).unwrap();
        assert!((lambda[0] - 0.5).abs() < 1e-12 && (lambda[1] - 1.0).abs() < 1e-12, "{lambda}");
    }
}
