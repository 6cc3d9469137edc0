//! Contact forces of preloaded contacts in static equilibrium.
//!
//! `(K + W k Wᵀ) x = F - W f₀`, with the springs `k` of closed stuck contacts and their forces
//! `f₀`.

use super::super::System;
use super::UnloadedContacts;
use super::linear_modes::MAX_DOFS;
use super::stuck_joint::{StuckAxis, StuckState};
use nalgebra::{DMatrix, DVector};

/// Returns the sum of the constant forces on each row, N.
pub(super) fn constant_forces(system: &System) -> DVector<f64> {
    let mut load = DVector::zeros(system.dofs());
    for (_, force) in system.excitation(0.0).iter().filter(|(harmonic, _)| *harmonic == 0) {
        load += force.map(|f| f.re);
    }
    load
}

/// Returns the force of each preloaded contact in static equilibrium, N, if all contacts stay
/// closed and stuck.
///
/// A negative force means that the contact opens. Entries are `None` for other joints, and for
/// all joints without any preload or beyond [`MAX_DOFS`]. Rigid friction is not included,
/// because its share is undetermined.
pub(super) fn equilibrium_forces(system: &System, joints: &[StuckAxis]) -> Vec<Option<f64>> {
    let n = system.dofs();
    let unknown = || vec![None; joints.len()];
    if n > MAX_DOFS || !joints.iter().any(|joint| joint.pressed.is_some_and(|force| force > 0.0)) {
        return unknown();
    }
    let mut load = constant_forces(system);
    let mut stiffness = DMatrix::zeros(n, n);
    for (row, column, [.., k]) in system.structure().entries() {
        stiffness[(row, column)] += k;
    }
    let springs = |joint: &StuckAxis| match joint.state {
        StuckState::Spring { stiffness, .. } => stiffness,
        _ => 0.0,
    };
    let stiffest = joints.iter().map(springs).fold(0.0, f64::max);
    for joint in joints {
        let k = springs(joint);
        for &(a, w) in &joint.at {
            load[a] -= w * joint.pressed.unwrap_or(0.0);
            joint.at.iter().for_each(|&(b, v)| stiffness[(a, b)] += k * w * v);
        }
    }
    // Stiffness of directions that nothing holds, relative to the stiffest contact. It lets them
    // move without a significant force.
    (0..n).for_each(|i| stiffness[(i, i)] += 1e-12 * stiffest);
    // without free coordinates nothing deforms
    let solved = if n == 0 { Some(load) } else { stiffness.lu().solve(&load) };
    let Some(x) = solved else { return unknown() };
    let carried = |joint: &StuckAxis| {
        let preload = joint.pressed.filter(|force| *force > 0.0)?;
        let force = preload + springs(joint) * joint.at.iter().map(|&(row, w)| w * x[row]).sum::<f64>();
        // Fraction of the preload below which a contact force is zero. In directions that
        // nothing holds, it is rounding.
        Some(if force.abs() <= 1e-6 * preload { 0.0 } else { force })
    };
    joints.iter().map(carried).collect()
}

/// Returns the preloaded contacts that carry no force; `None` if each carries some.
pub(super) fn unpressed(system: &System, joints: &[StuckAxis], carried: &[Option<f64>]) -> Option<UnloadedContacts> {
    let mut found = UnloadedContacts { joints: Vec::new(), preload: 0.0 };
    for (joint, _) in joints.iter().zip(carried).filter(|(_, carried)| carried.is_some_and(|force| force <= 0.0)) {
        found.joints.push(system.joints()[joint.joint].name().to_owned());
        found.preload += joint.pressed.unwrap_or(0.0);
    }
    (!found.joints.is_empty()).then_some(found)
}
