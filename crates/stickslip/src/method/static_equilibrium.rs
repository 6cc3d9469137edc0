//! Static equilibrium under the constant loads, from which every method begins.
//!
//! Where a contact sticks for a whole period, its mean friction force is that of its past: the same vibration has many
//! solutions. All methods choose one by the same rule. Constant forces and preloads grow from zero in one ramp, joints slip
//! on the way where their limits ask for it, and the vibration then begins from there: a slider that it does not move stays
//! where the ramp has left it, and one that it does goes only as far as it must.
//!
//! `K x + W f(0 → Wᵀx) = F₀`, solved by harmonic balance of order zero.

use super::harmonic_balance;
use super::incremental::law;
use crate::law::{Law, MOST_DIRECTIONS, Piece, Relative};
use crate::model::System;
use crate::orbit::Orbit;
use num_complex::Complex64;

/// Displacements, joint states and joint forces under the constant loads.
///
/// # Example
/// A mass of 1 kg on a spring of 1000 N/m, with a Jenkins joint of the same stiffness that slips at 2 N, under 10 N: the joint
/// slips, and the spring carries the other 8 N.
/// ```
/// use std::sync::Arc;
/// use stickslip::law::Jenkins;
/// use stickslip::method::StaticEquilibrium;
/// use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring};
/// let between = || ["m".to_owned(), GROUND.to_owned()];
/// let model = Model {
///     masses: vec![Mass::new("m", 1.0)],
///     springs: vec![Spring { between: between(), stiffness: 1000.0, damping: 1.0 }],
///     joints: vec![Joint { name: "j".into(), between: between(), law: Arc::new(Jenkins { stiffness: 1000.0, limit: 2.0 }) }],
///     forces: vec![Force { on: "m".into(), amplitude: 10.0, phase: 0.0, harmonic: 0 }],
///     ..Model::default()
/// };
/// let equilibrium = StaticEquilibrium::of(&model.assemble().unwrap()).unwrap();
/// assert!((equilibrium.displacement()[0] - 8e-3).abs() < 1e-12);
/// assert!((equilibrium.forces()[0][0] - 2.0).abs() < 1e-9);
/// ```
#[derive(Debug, Clone)]
pub struct StaticEquilibrium {
    /// An orbit on which nothing moves.
    orbit: Orbit,
    dofs: usize,
}

impl StaticEquilibrium {
    /// The static equilibrium of a system; `None` where nothing carries a constant load, or where the iteration finds none.
    pub fn of(system: &System) -> Option<Self> {
        let orbit = harmonic_balance::static_equilibrium_of(system)?;
        Some(StaticEquilibrium { orbit, dofs: system.dofs() })
    }

    /// The same; `None` also where no constant force, imposed displacement or preload acts, so that nothing is loaded.
    pub fn under_load(system: &System) -> Option<Self> {
        let constant = system.harmonics_of_excitation(|z| z != Complex64::ZERO).contains(&0);
        let loaded = constant || system.joints().iter().any(|joint| is_preloaded(&**joint.law()));
        if loaded { StaticEquilibrium::of(system) } else { None }
    }

    /// Displacements of all degrees of freedom, m.
    pub fn displacement(&self) -> &[f64] {
        &self.orbit.start[..self.dofs]
    }

    /// Forces of each joint along its directions, N.
    pub fn forces(&self) -> Vec<[f64; MOST_DIRECTIONS]> {
        self.orbit.sample(0.0).joints.iter().map(|joint| joint.force).collect()
    }

    /// The internal states of all joints, in their order.
    pub fn joint_states(&self) -> &[f64] {
        &self.orbit.start[2 * self.dofs..]
    }
}

/// Whether a law has a force where its joint has not moved.
fn is_preloaded(law: &dyn Law) -> bool {
    let rest = [0.0; MOST_DIRECTIONS];
    let force = match (law.step(), law.rate()) {
        (Some(step), _) => step.value(&rest, &rest, &mut vec![0.0; step.states()]),
        (None, Some(rate)) => {
            let mut z = vec![0.0; rate.states()];
            rate.value(&Relative { displacement: rest, velocity: rest }, &z.clone(), &mut z)
        }
        (None, None) => rest,
    };
    let pressed = |piece: &Piece| matches!(piece, Piece::Stop { gap, stiffness } if *gap < 0.0 && *stiffness > 0.0);
    force != rest || law.pieces().is_some_and(|pieces| pieces.iter().any(pressed))
}

/// The internal states of all joints at other displacements (m), after a straight and slow way there from static equilibrium.
/// Without one nothing is loaded before it vibrates, and joints begin unloaded there. Imposed motions are at the phase zero of a
/// drive. `count`: how many states the flow that begins there has; where its joints keep others than these all of them are zero.
pub(crate) fn states_at(
    equilibrium: Option<&StaticEquilibrium>,
    system: &System,
    displacement: &[f64],
    count: usize,
) -> Vec<f64> {
    let Some(equilibrium) = equilibrium else { return vec![0.0; count] };
    let known = equilibrium.joint_states();
    let mut states = Vec::with_capacity(count);
    for joint in system.joints() {
        let axes = joint.axes();
        let Some((own, scale)) = law::states(joint.law()) else { continue };
        let along = |x: &[f64], vibrates: bool| -> [f64; MOST_DIRECTIONS] {
            std::array::from_fn(|a| {
                let Some(axis) = axes.get(a) else { return 0.0 };
                let imposed = axis.imposed().iter().filter(|(h, _)| vibrates || *h == 0).map(|(_, g)| g.re);
                axis.along(x) + imposed.sum::<f64>()
            })
        };
        let from = along(equilibrium.displacement(), false);
        let first = states.len();
        let before = known.get(first..first + own).map_or_else(|| vec![0.0; own], <[f64]>::to_vec);
        let to = along(displacement, true);
        states.extend(law::moved(joint.law(), (axes.len(), scale), (from, &before), to));
    }
    if states.len() == count { states } else { vec![0.0; count] }
}
