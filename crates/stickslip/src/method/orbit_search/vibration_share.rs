//! The vibration's fraction of the size of a state.
//!
//! States are measured from the unloaded structure. A blade bent by a constant force, or a
//! joint stuck away from its middle, therefore has a state much larger than its vibration.
//! Tolerances and reported errors are relative to the vibration. A search on states receives
//! tolerances multiplied by this fraction.

use super::return_map::norm;
use crate::method::IntegrationError;
use crate::orbit::{Evidence, Path, Symmetry};

/// Returns the size of the vibration over the size of the state `start`, in the energy norm
/// with `weights` (displacements, velocities, states of the joints). Sizes below `rest` (√J)
/// count as `rest`.
pub(crate) fn fraction(
    path: &dyn Path,
    (symmetry, period): (Symmetry, f64),
    start: &[f64],
    (weights, rest): (&[f64], f64),
) -> f64 {
    if symmetry == Symmetry::HalfPeriod {
        return 1.0; // the mean of this motion is zero
    }
    if path.sample(0.0).displacement.is_empty() {
        return 1.0; // no structure: the states of the joints follow the imposed motion
    }
    let vibration = size(path, period, weights, rest);
    let state = norm(weights, start).max(rest);
    if vibration < state { vibration / state } else { 1.0 }
}

/// Returns the size of a vibration, without its mean, in the energy norm of displacements and
/// velocities. It is at least `rest`.
fn size(path: &dyn Path, period: f64, weights: &[f64], rest: f64) -> f64 {
    // Instants per period at which the motion is sampled. The energy oscillates between
    // displacement and velocity; the largest sample is accurate to some percent.
    let count = 32;
    let instants: Vec<_> = (0..count).map(|k| path.sample(period * k as f64 / count as f64)).collect();
    let n = instants[0].displacement.len();
    let mean = |row: usize| instants.iter().map(|at| at.displacement[row]).sum::<f64>() / count as f64;
    let mean: Vec<f64> = (0..n).map(mean).collect();
    let about = |at: &crate::orbit::Sample| {
        let moved = at.displacement.iter().zip(&mean).map(|(x, mean)| x - mean);
        norm(weights, &moved.chain(at.velocity.iter().copied()).collect::<Vec<f64>>())
    };
    instants.iter().map(about).fold(rest, f64::max)
}

/// Returns the fraction for the next search, after a search that assumed `taken` and gave
/// `found`. Returns `None` if no other search is necessary.
///
/// # Errors
/// Fails if the vibration has too few digits of its state.
pub(crate) fn next_fraction(taken: f64, found: f64) -> Result<Option<f64>, IntegrationError> {
    // A search is repeated if it assumed a fraction larger than the actual one by more than this
    // factor.
    match taken <= 2.0 * found {
        true => Ok(None),
        // Smallest fraction. It leaves the vibration at least the nine digits that its search
        // needs, of the sixteen of the state.
        false if found < 1e-6 => Err(IntegrationError::Offset { share: found }),
        false => Ok(Some(found)),
    }
}

/// Converts evidence relative to the state into evidence relative to the vibration.
pub(crate) fn rescale_evidence(evidence: &mut Evidence, share: f64) {
    evidence.residual /= share;
    for relative in [&mut evidence.error_estimate, &mut evidence.return_defect] {
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

    /// Returns a mass of 1 kg on a spring and joints, under a constant force and a small
    /// harmonic force.
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

    /// A vibration much smaller than its mean has accurate digits, and its evidence is relative
    /// to the vibration. Cases: a joint that slipped under the constant force and then sticks,
    /// event-driven; a cubic spring about its static equilibrium, integrated; both together, in
    /// equal steps.
    #[test]
    fn a_small_vibration_about_a_large_mean_keeps_its_digits() {
        let jenkins: SharedLaw = Arc::new(Jenkins { stiffness: JOINT, limit: 1.0 });
        let cubic: SharedLaw = Arc::new(Cubic { stiffness: CUBIC });
        // static equilibrium of the cubic spring: `k x + k3 x³ = F`
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
                let orbit = method.solver(system).unwrap().orbit(omega).unwrap();
                assert!(orbit.evidence.residual < 1e-6, "{:?}", orbit.evidence);
                assert!(orbit.evidence.error_estimate.unwrap_or(0.0) < 2e-5, "{:?}", orbit.evidence);
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
            // 0.7 mm and 0.1 µm: the nonlinearity of the spring is the square of their ratio
            let bent = pushed(std::slice::from_ref(&cubic), 10.0, 1e-3);
            let expected = closed_form(STIFFNESS + tangent(10.0), omega, 1e-3);
            for method in [&Shooting::default() as &dyn Method, &Transient::default(), &HarmonicBalance::default()] {
                near(method, &bent, expected, 1e-6);
            }
            // equal steps have an error of 1e-5
            let both = pushed(&[jenkins.clone(), cubic.clone()], 10.0, 1e-3);
            // the joint has slipped under the constant force, and carries its limit of 1 N at
            // the highest point
            let both_expected = |amplitude: f64| {
                let stiffness = STIFFNESS + JOINT + tangent(9.0 + JOINT * amplitude);
                closed_form(stiffness, omega, 1e-3)
            };
            let expected = both_expected(both_expected(0.0));
            near(&Shooting::default(), &both, expected, 3e-5);
        }
    }
}
