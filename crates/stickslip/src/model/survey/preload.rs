//! Contact forces of preloaded contacts in static equilibrium, and the slip limits that they
//! leave.
//!
//! `(K + W k Wᵀ) x = F - W f₀`, with the springs `k` of closed stuck contacts and their forces
//! `f₀`.

use super::super::System;
use super::UnloadedContacts;
use super::linear_modes::MAX_DOFS;
use super::stuck_joint::{StuckAxis, StuckState};
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Returns the force of each preloaded contact in static equilibrium, N, if all contacts stay
/// closed and stuck.
///
/// A negative force means that the contact opens. Entries are `None` for other joints, and for
/// all joints without any preload, beyond [`MAX_DOFS`], or if a joint would slip under these
/// forces. Rigid friction is not included, because its share is undetermined.
pub(super) fn equilibrium_forces(system: &System, joints: &[StuckAxis]) -> Vec<Option<f64>> {
    let n = system.dofs();
    let unknown = || vec![None; joints.len()];
    if n > MAX_DOFS || !joints.iter().any(|joint| joint.pressed.is_some_and(|force| force > 0.0)) {
        return unknown();
    }
    let mut load = system.constant_forces();
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
    let carried: Vec<Option<f64>> = joints.iter().map(carried).collect();
    let along = |joint: &StuckAxis| springs(joint) * joint.at.iter().map(|&(row, w)| w * x[row]).sum::<f64>();
    let shares = shares_at_rest(joints, &carried);
    let slips = |axes: &[StuckAxis]| {
        let tangents = || axes.iter().filter(|axis| axis.pressed.is_none() && !axis.gradual);
        let force = tangents().map(|axis| along(axis).powi(2)).sum::<f64>().sqrt();
        let share = shares.get(&axes[0].joint).copied().unwrap_or(1.0);
        // a limit that is exceeded by rounding counts as reached
        let exceeds = |axis: &StuckAxis| matches!(axis.state, StuckState::Spring { limit, .. } if force > (1.0 + 1e-6) * share * limit);
        tangents().any(exceeds)
    };
    if joints.chunk_by(|a, b| a.joint == b.joint).any(slips) { unknown() } else { carried }
}

/// Returns the normal force at rest over the preload, by joint; without the joints whose force is
/// unknown.
fn shares_at_rest(joints: &[StuckAxis], carried: &[Option<f64>]) -> BTreeMap<usize, f64> {
    let share = |(normal, force): (&StuckAxis, &Option<f64>)| {
        let preload = normal.pressed.filter(|preload| *preload > 0.0)?;
        Some((normal.joint, force.as_ref()?.max(0.0) / preload))
    };
    joints.iter().zip(carried).filter_map(share).collect()
}

/// Replaces the slip limits under the preloads by those under the normal forces at rest.
pub(super) fn set_limits_at_rest(joints: &mut [StuckAxis], carried: &[Option<f64>]) {
    let shares = shares_at_rest(joints, carried);
    for joint in joints.iter_mut().filter(|joint| joint.pressed.is_none()) {
        if let (StuckState::Spring { limit, displacement, .. }, Some(share)) =
            (&mut joint.state, shares.get(&joint.joint))
        {
            *limit *= share;
            *displacement *= share;
        }
    }
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
