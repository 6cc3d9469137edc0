//! How much of a motion vibrates.
//!
//! States are measured from where nothing loads the structure, so that a blade that is bent by a constant force, or a joint that sticks away from its
//! middle, has a state that is large beside its vibration. What is asked for and what is told is relative to the vibration: a search that works on
//! states is told its share of them.

use super::Breakdown;
use super::periodic::norm;
use crate::orbit::{Evidence, Path, Symmetry};

/// Instants of a period at which the motion is looked at: energy goes to and fro between them, and their largest has it within some percent.
const INSTANTS: usize = 32;
/// A search that took the vibration for so many times its share of the state, or less, has done what was asked for.
const NEARLY: f64 = 2.0;
/// The least share that leaves a vibration the nine digits that its search asks for at least, of the sixteen of its state.
const LEAST: f64 = 1e-6;
/// Share below which work that does not balance is that of lost digits.
pub(super) const SMALL: f64 = 1e-3;

/// The vibration's share of the size of a state `start`, in the energy norm of `weights` (displacements, velocities, states of the joints); what is
/// smaller than `rest` counts as that (√J).
pub(super) fn share(
    path: &dyn Path,
    (symmetry, period): (Symmetry, f64),
    start: &[f64],
    (weights, rest): (&[f64], f64),
) -> f64 {
    if symmetry == Symmetry::HalfPeriod {
        return 1.0; // its mean is zero
    }
    let instants: Vec<_> = (0..INSTANTS).map(|k| path.sample(period * k as f64 / INSTANTS as f64)).collect();
    let n = instants[0].displacement.len();
    if n == 0 {
        return 1.0; // joints that are only moved: their states go round with the motion
    }
    let mean = |row: usize| instants.iter().map(|at| at.displacement[row]).sum::<f64>() / INSTANTS as f64;
    let mean: Vec<f64> = (0..n).map(mean).collect();
    let about = |at: &crate::orbit::Sample| {
        let moved = at.displacement.iter().zip(&mean).map(|(x, mean)| x - mean);
        norm(weights, &moved.chain(at.velocity.iter().copied()).collect::<Vec<f64>>())
    };
    let vibration = instants.iter().map(about).fold(rest, f64::max);
    let state = norm(weights, start).max(rest);
    if vibration < state { vibration / state } else { 1.0 }
}

/// The share with which a search goes on that took the vibration for `taken` of the state where it is `found` to be; `None` if it need not.
///
/// # Errors
/// A vibration that has too few of the digits of its state.
pub(super) fn next(taken: f64, found: f64) -> Result<Option<f64>, Breakdown> {
    match taken <= NEARLY * found {
        true => Ok(None),
        false if found < LEAST => Err(Breakdown::Offset { share: found }),
        false => Ok(Some(found)),
    }
}

/// Evidence relative to the state becomes relative to the vibration.
pub(super) fn relate(evidence: &mut Evidence, share: f64) {
    evidence.residual /= share;
    for relative in [&mut evidence.truncation, &mut evidence.return_defect] {
        *relative = relative.map(|of_state| of_state / share);
    }
}

#[cfg(test)]
mod tests {
    use crate::law::{Cubic, Jenkins, SharedLaw};
    use crate::method::harmonic_balance::HarmonicBalance;
    use crate::method::shooting::Shooting;
    use crate::method::transient::Transient;
    use crate::method::{Method, event_driven::EventDriven};
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring, System};
    use std::sync::Arc;

    const STIFFNESS: f64 = 1e4;
    const DAMPING: f64 = 2.0;
    const JOINT: f64 = 2e3;
    const CUBIC: f64 = 1e9;

    /// One mass of 1 kg on a spring and joints, under a constant force and a small one that vibrates.
    fn pushed(laws: &[SharedLaw], constant: f64, vibrating: f64) -> System {
        let force = |amplitude, harmonic| Force { on: "m".into(), amplitude, phase: 0.0, harmonic };
        let joint = |(j, law): (usize, &SharedLaw)| Joint {
            name: format!("j{j}"),
            between: ["m".into(), GROUND.into()],
            law: law.clone(),
        };
        let model = Model {
            masses: vec![Mass::new("m", 1.0)],
            springs: vec![Spring { between: ["m".into(), GROUND.into()], stiffness: STIFFNESS, damping: DAMPING }],
            joints: laws.iter().enumerate().map(joint).collect(),
            forces: vec![force(constant, 0), force(vibrating, 1)],
            ..Model::default()
        };
        model.assemble().unwrap()
    }

    /// `F / |k - ω² + jωc|` with the stiffness at the mean.
    fn closed_form(stiffness: f64, omega: f64, force: f64) -> f64 {
        force / (stiffness - omega * omega).hypot(omega * DAMPING)
    }

    /// A vibration that is small beside its mean has its digits all the same, and its evidence is its own: a joint that has slipped to where the
    /// constant force took it, and sticks there, by events; a cubic spring about its rest position, by integration; both in equal steps.
    #[test]
    fn a_small_vibration_about_a_large_mean_keeps_its_digits() {
        let jenkins: SharedLaw = Arc::new(Jenkins { stiffness: JOINT, limit: 1.0 });
        let cubic: SharedLaw = Arc::new(Cubic { stiffness: CUBIC });
        // where the cubic spring rests: k x + k3 x³ = F
        let tangent = |force: f64| {
            let mut rest = 1e-3;
            for _ in 0..50 {
                let slope = STIFFNESS + 3.0 * CUBIC * rest * rest;
                rest -= (STIFFNESS * rest + CUBIC * f64::powi(rest, 3) - force) / slope;
            }
            3.0 * CUBIC * rest * rest
        };
        for omega in [88.0, 107.0, 125.0] {
            let amplitude = |method: &dyn Method, system: &System| {
                let orbit = method.solver(system).unwrap().orbit(omega, None).unwrap();
                assert!(orbit.evidence.residual < 1e-6, "{:?}", orbit.evidence);
                assert!(orbit.evidence.truncation.unwrap_or(0.0) < 2e-5, "{:?}", orbit.evidence);
                assert!(orbit.evidence.return_defect.unwrap() < 1e-6, "{:?}", orbit.evidence);
                orbit.places[0].amplitude()
            };
            let near = |method: &dyn Method, system: &System, expected: f64, tolerance: f64| {
                let found = amplitude(method, system);
                assert!((found / expected - 1.0).abs() < tolerance, "{} {omega}: {found} {expected}", method.name());
            };
            // 100 mm and 0.1 µm
            let stuck = pushed(std::slice::from_ref(&jenkins), 1e3, 1e-3);
            let expected = closed_form(STIFFNESS + JOINT, omega, 1e-3);
            for method in [&EventDriven as &dyn Method, &Transient::default(), &HarmonicBalance::default()] {
                near(method, &stuck, expected, 1e-6);
            }
            // 0.7 mm and 0.1 µm: what the spring is not linear by is the square of their ratio
            let bent = pushed(std::slice::from_ref(&cubic), 10.0, 1e-3);
            let expected = closed_form(STIFFNESS + tangent(10.0), omega, 1e-3);
            for method in [&Shooting::default() as &dyn Method, &Transient::default(), &HarmonicBalance::default()] {
                near(method, &bent, expected, 1e-6);
            }
            // equal steps err by 1e-5
            let both = pushed(&[jenkins.clone(), cubic.clone()], 10.0, 1e-3);
            // the joint has slipped under the constant force, and carries its limit of 1 N at the highest point
            let both_expected = |amplitude: f64| {
                let stiffness = STIFFNESS + JOINT + tangent(9.0 + JOINT * amplitude);
                closed_form(stiffness, omega, 1e-3)
            };
            let expected = both_expected(both_expected(0.0));
            near(&Shooting::default(), &both, expected, 3e-5);
        }
    }
}
