//! Test of an odd law: the mirrored motion must produce the mirrored force.
//!
//! Methods halve the period of odd systems and omit their even harmonics. A law that is wrongly
//! declared odd would give a result that looks like an orbit but is not one. The test evaluates
//! a few histories of every size. An odd law gives identical bits, because a change of sign
//! causes no rounding.

use crate::law::{IdealElement, Law, MAX_DIRECTIONS, ProxView, RateView, RelativeMotion, StepView};

/// Magnitudes of the displacements, as powers of ten in metres.
const DECADES: std::ops::RangeInclusive<i32> = -9..=0;
/// One history in every direction, in relative units, with reversals and varying amplitude.
const HISTORY: [[f64; MAX_DIRECTIONS]; 6] =
    [[0.3, 0.2, -0.1], [1.0, -0.4, 0.6], [0.4, -1.0, 1.0], [-0.2, -0.7, 0.3], [-0.9, 0.5, -0.8], [-0.1, 0.8, -0.3]];

type ForceVector = [f64; MAX_DIRECTIONS];

/// Tells whether any view of the law violates the symmetry.
pub(in crate::law) fn violates_odd_symmetry(law: &dyn Law) -> bool {
    // Contacts and one-sided stops are not odd by construction.
    let one_sided =
        |elements: Vec<IdealElement>| elements.iter().any(|element| matches!(element, IdealElement::Stop { .. }));
    let directions = law.directions();
    law.normal().is_some()
        || law.ideal_elements().is_some_and(one_sided)
        || law
            .rate()
            .is_some_and(|rate| DECADES.into_iter().any(|k| forces_differ(|sign| by_rate(rate, sign * size(k)))))
        || law
            .step()
            .is_some_and(|step| DECADES.into_iter().any(|k| forces_differ(|sign| by_step(step, sign * size(k)))))
        || law.prox().is_some_and(|prox| forces_differ(|sign| by_force(prox, directions, sign * force_scale(law))))
}

fn size(decade: i32) -> f64 {
    10f64.powi(decade)
}

/// Returns the force scale of a law, N; 1 N if it is unbounded.
fn force_scale(law: &dyn Law) -> f64 {
    Some(law.force_scale()).filter(|scale| scale.is_finite()).unwrap_or(1.0)
}

/// NaN counts as no difference; solvers stop at NaN.
fn forces_differ(forces: impl Fn(f64) -> Vec<ForceVector>) -> bool {
    let (there, back) = (forces(1.0), forces(-1.0));
    let all = || there.iter().flatten();
    let largest = all().fold(0.0f64, |most, force| most.max(force.abs()));
    // Difference relative to the largest force that is larger than rounding.
    all().zip(back.iter().flatten()).any(|(a, b)| (a + b).abs() > 1e-9 * largest)
}

fn by_rate(rate: &dyn RateView, size: f64) -> Vec<ForceVector> {
    // Ratio of velocities to displacements, 1/s.
    let velocity_ratio = 1e3;
    let (mut z, mut rates) = (vec![0.0; rate.states()], vec![0.0; rate.states()]);
    let mut before = [0.0; MAX_DIRECTIONS];
    let along = |point: &ForceVector| {
        let displacement = point.map(|u| u * size);
        let velocity = std::array::from_fn(|a| velocity_ratio * (displacement[a] - before[a]));
        before = displacement;
        let force = rate.evaluate_values(&RelativeMotion { displacement, velocity }, &z, &mut rates);
        z.iter_mut().zip(&rates).for_each(|(z, rate)| *z += rate / velocity_ratio);
        force
    };
    HISTORY.iter().map(along).collect()
}

fn by_step(step: &dyn StepView, size: f64) -> Vec<ForceVector> {
    let mut z = vec![0.0; step.states()];
    let mut before = [0.0; MAX_DIRECTIONS];
    let along = |point: &ForceVector| {
        let to = point.map(|u| u * size);
        let force = step.advance_values(&before, &to, &mut z);
        before = to;
        force
    };
    HISTORY.iter().map(along).collect()
}

fn by_force(prox: &dyn ProxView, directions: usize, size: f64) -> Vec<ForceVector> {
    let penalty = 2.0 * prox.minimum_penalty().max(0.5);
    // Arguments of the resolvent, relative to the law's force scale.
    let asked = [0.3, 0.9, 1.5, 10.0].iter().zip(&HISTORY).map(|(share, point)| {
        let (mut force, mut slope) = ([0.0; MAX_DIRECTIONS], [0.0; MAX_DIRECTIONS * MAX_DIRECTIONS]);
        let y = point.map(|part| share * part * size);
        prox.resolve(&y[..directions], penalty, &mut force[..directions], &mut slope[..directions * directions]);
        force
    });
    asked.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::TABLE;

    /// The test finds exactly the laws that declare themselves not odd.
    #[test]
    fn declared_symmetry_is_correct() {
        for row in TABLE {
            let law = row.sample();
            assert_eq!(violates_odd_symmetry(&*law), !law.is_odd(), "{}", row.name);
        }
    }
}
