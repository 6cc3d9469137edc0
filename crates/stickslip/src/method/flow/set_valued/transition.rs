//! Transition at a switch: stick or slip of the joints afterwards, and the effect on
//! sensitivities.
//!
//! Joints at rest stick if forces within their limits keep their accelerations at zero. This is
//! a linear complementarity problem in the box of the limits, for all of them together. A
//! switch at time τ is a zero of `n(z, t)`. There the sensitivity is multiplied by the
//! saltation matrix `I + (f⁺ - f⁻) nᵀ/(nᵀ f⁻ + ∂n/∂t)`, with the time derivatives f⁻ and f⁺ of
//! the state before and after.
//!
//! Source: Leine and Nijmeijer, "Dynamics and Bifurcations of Non-Smooth Mechanical Systems"
//! (2004), Ch. 7.

use super::friction_mode::FrictionMode;
use crate::method::flow::assembly::Assembly;
use nalgebra::{DMatrix, DVector};
use stickslip_numerics::complementarity;

/// Returns `Wᵀ M⁻¹ W` for some axes.
pub(super) fn delassus_matrix(assembly: &Assembly, axes: &[usize]) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(axes.len(), axes.len());
    for (b, &other) in axes.iter().enumerate() {
        let moved = &assembly.inverse_mass * assembly.directions.column(other);
        for (a, &axis) in axes.iter().enumerate() {
            out[(a, b)] = assembly.axes[axis].component(moved.as_slice());
        }
    }
    out
}

/// Returns the modes of joints at rest. `free` are the relative accelerations without their
/// forces, and `limits` the limits of these forces. Returns `None` if the problem has no
/// solution.
pub(super) fn contact_modes(mobility: &DMatrix<f64>, free: &[f64], limits: &[f64]) -> Option<Vec<FrictionMode>> {
    let high = DVector::from_column_slice(limits);
    let free = DVector::from_column_slice(free);
    let force = complementarity::solve(mobility, &free, &-&high, &high)?;
    let mode = |(force, limit): (&f64, &f64)| {
        if force.abs() < *limit { FrictionMode::Stick } else { FrictionMode::Slip(force.signum()) }
    };
    Some(force.iter().zip(limits).map(mode).collect())
}

/// Removes the velocities along these axes from those of the structure, like the impulse that
/// stops them.
///
/// `velocity` contains `columns` vectors of length n, row by row. `imposed` are the imposed
/// velocities of the axes; they are zero for sensitivities. Returns false if the axes are not
/// independent.
pub(super) fn remove_velocity(
    assembly: &Assembly,
    axes: &[usize],
    imposed: &[f64],
    (velocity, columns): (&mut [f64], usize),
) -> bool {
    if axes.is_empty() {
        return true;
    }
    let Some(inverse) = delassus_matrix(assembly, axes).try_inverse() else { return false };
    for column in 0..columns {
        let along = DVector::from_iterator(
            axes.len(),
            axes.iter().zip(imposed).map(|(&axis, imposed)| {
                let rows = assembly.axes[axis].rows().iter();
                imposed + rows.map(|&(i, w)| w * velocity[i * columns + column]).sum::<f64>()
            }),
        );
        let impulse = &inverse * along;
        let mut on_masses = DVector::zeros(assembly.n);
        for (&axis, impulse) in axes.iter().zip(impulse.iter()) {
            assembly.axes[axis].rows().iter().for_each(|&(i, w)| on_masses[i] += w * impulse);
        }
        let change = &assembly.inverse_mass * on_masses;
        (0..assembly.n).for_each(|i| velocity[i * columns + column] -= change[i]);
    }
    true
}

/// Multiplies a sensitivity, stored row by row, by the saltation matrix of a switch. There the
/// velocity along an axis passes zero at this `rate` (m/s²); `before` and `after` are the time
/// derivatives of the state.
pub(super) fn apply_saltation(
    assembly: &Assembly,
    (axis, rate): (usize, f64),
    (before, after): (&[f64], &[f64]),
    (derivative, columns): (&mut [f64], usize),
) {
    let n = assembly.n;
    let mut along = vec![0.0; columns];
    for &(i, w) in assembly.axes[axis].rows() {
        let row = &derivative[(n + i) * columns..(n + i + 1) * columns];
        along.iter_mut().zip(row).for_each(|(along, value)| *along += w * value / rate);
    }
    for ((row, before), after) in derivative.chunks_exact_mut(columns).zip(before).zip(after) {
        let jump = after - before;
        row.iter_mut().zip(&along).for_each(|(value, along)| *value += jump * along);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two masses with friction to each other and to the ground. A mass that is pushed beyond
    /// its limit may or may not move the other.
    #[test]
    fn faces_hold_what_their_limits_allow() {
        // joint 1: mass 1 to ground, joint 2: mass 2 to mass 1; both of 1 kg
        let mobility = DMatrix::from_row_slice(2, 2, &[1.0, -1.0, -1.0, 2.0]);
        let modes = |push: [f64; 2], limits: [f64; 2]| {
            contact_modes(&mobility, &[push[0], push[1] - push[0]], &limits).unwrap()
        };
        assert_eq!(modes([0.5, 0.3], [1.0, 1.0]), [FrictionMode::Stick, FrictionMode::Stick]);
        assert_eq!(modes([0.0, 1.5], [1.0, 2.0]), [FrictionMode::Slip(1.0), FrictionMode::Stick]);
        assert_eq!(modes([0.0, 1.5], [2.0, 1.0]), [FrictionMode::Stick, FrictionMode::Slip(1.0)]);
        assert_eq!(modes([0.0, -5.0], [0.5, 1.0]), [FrictionMode::Slip(-1.0), FrictionMode::Slip(-1.0)]);
    }
}
