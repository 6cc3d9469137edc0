//! Bidirectional sweep: a reverse sweep finds orbits that the forward sweep missed, if several
//! orbits may exist at one frequency.

pub use super::branch_following::is_followed;
use super::peak::{CurvePoint, held_amplitude};
use super::sweep::reverse_sweep;
use crate::method::{Method, MethodError, OrbitError, solver_with_alternatives};
use crate::model::System;
use crate::orbit::Orbit;
use std::sync::atomic::AtomicBool;

/// The points of a curve, as the forward sweep found them.
///
/// # Example
/// A softening spring bends the resonance to lower frequencies. The forward sweep jumps to the
/// branch of high amplitudes late.
/// ```
/// use std::sync::{Arc, atomic::AtomicBool};
/// use stickslip::curve::bidirectional_sweep::BidirectionalSweep;
/// use stickslip::method::{Method, harmonic_balance::HarmonicBalance};
/// use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring};
/// let on_ground = || ["m".to_owned(), GROUND.to_owned()];
/// let system = Model {
///     masses: vec![Mass::new("m", 1.0)],
///     springs: vec![Spring { between: on_ground(), stiffness: 1e4, damping: 2.0 }],
///     joints: vec![Joint {
///         name: "j".into(),
///         between: on_ground(),
///         law: Arc::new(stickslip::law::Cubic { stiffness: -1e9 }),
///     }],
///     forces: vec![Force { on: "m".into(), amplitude: 0.3, phase: 0.0, harmonic: 1 }],
///     ..Model::default()
/// }
/// .assemble()
/// .unwrap();
/// let method = HarmonicBalance::default();
/// let (mut sweep, mut solver) =
///     (BidirectionalSweep::for_system(&system).unwrap(), method.solver(&system).unwrap());
/// let mut seed = None;
/// for i in 0..41 {
///     let orbit = solver.orbit_near(88.0 + 0.4 * f64::from(i), seed.as_ref()).unwrap();
///     sweep.add(orbit.omega, Ok(&orbit));
///     seed = Some(orbit.seed());
/// }
/// let others = sweep.reverse_sweep(&method, &system, &AtomicBool::new(false)).unwrap();
/// assert!(others.len() > 10 && others.iter().all(|other| other.ratio > 1.5));
/// ```
#[derive(Debug, Clone, Default)]
pub struct BidirectionalSweep {
    points: Vec<CurvePoint>,
}

/// An orbit of the reverse sweep at a frequency at which the forward sweep found another one.
#[derive(Debug, Clone)]
pub struct OtherOrbit {
    /// The orbit of the reverse sweep.
    pub orbit: Orbit,
    /// Ratio of its largest amplitude to that of the orbit of the forward sweep.
    pub ratio: f64,
}

impl BidirectionalSweep {
    /// Returns `None` if the system has one orbit per frequency, or is large.
    pub fn for_system(system: &System) -> Option<Self> {
        is_followed(system).then(Self::default)
    }

    /// Adds the next point.
    pub fn add(&mut self, omega: f64, outcome: Result<&Orbit, &OrbitError>) {
        self.add_point(outcome.map_or_else(|_| CurvePoint::failed(omega), |orbit| CurvePoint::new(orbit, &amplitudes)));
    }

    /// Adds the next point. Its values are the amplitudes of all places (m), or none without an
    /// orbit.
    pub fn add_point(&mut self, point: CurvePoint) {
        self.points.push(point);
    }

    /// Sweeps the points in reverse, beginning at the last one with an orbit that is found
    /// without initial guess, or with that of the forward sweep if none is found. Returns the
    /// orbits that differ from the forward sweep, in the order of the forward sweep. Ends early if
    /// `stop` is true.
    ///
    /// # Errors
    /// The method does not support the system.
    pub fn reverse_sweep(
        &self,
        method: &dyn Method,
        system: &System,
        stop: &AtomicBool,
    ) -> Result<Vec<OtherOrbit>, MethodError> {
        let Some(last) = self.points.last() else { return Ok(Vec::new()) };
        let mut solver = solver_with_alternatives(method, system)?;
        // A search without initial guess can find another orbit than the forward sweep.
        let seed = solver.orbit(last.omega).ok().map(|orbit| orbit.seed()).or_else(|| last.seed.clone());
        let mut omegas = self.points.iter().rev().map(|point| point.omega);
        let mut others = Vec::new();
        reverse_sweep(method, system, seed, &mut omegas, stop, &mut |orbit| {
            let Some(point) = self.points.iter().find(|point| point.omega == orbit.omega) else { return };
            let held = held_amplitude(system, orbit.omega);
            // The reverse sweep estimates no errors, so an orbit that is reported is solved
            // again with an error estimate.
            let shown = amplitude_ratio(point, orbit, held)
                .and_then(|_| solver.orbit_near(orbit.omega, Some(&orbit.seed())).ok());
            // unstable orbits are not reported, because no motion stays on them
            let shown = shown.filter(|orbit| orbit.is_stable() != Some(false));
            others.extend(
                shown.and_then(|orbit| amplitude_ratio(point, &orbit, held).map(|ratio| OtherOrbit { orbit, ratio })),
            );
        })?;
        others.reverse();
        Ok(others)
    }
}

/// Returns the frequency intervals in which the reverse sweep has other orbits. `there` are the
/// points of the forward sweep, `others` the other orbits of the reverse sweep. Each interval
/// includes its two neighbours, which both sweeps share.
pub fn other_intervals(there: &[CurvePoint], others: &[CurvePoint]) -> Vec<Vec<CurvePoint>> {
    let mut stretches: Vec<Vec<CurvePoint>> = Vec::new();
    let mut others = others.iter().peekable();
    let mut open = false;
    for (i, point) in there.iter().enumerate() {
        let other = others.next_if(|other| other.omega == point.omega);
        if other.is_some() && !open {
            stretches.push(i.checked_sub(1).map(|before| there[before].clone()).into_iter().collect());
        }
        if (other.is_some() || open)
            && let Some(stretch) = stretches.last_mut()
        {
            stretch.push(other.unwrap_or(point).clone());
        }
        open = other.is_some();
    }
    stretches
}

fn amplitudes(orbit: &Orbit) -> Vec<f64> {
    orbit.places.iter().map(|place| place.length_amplitude()).collect()
}

/// Returns the ratio of the largest amplitude of an orbit to that of a point at the same
/// frequency, if the two orbits differ. Amplitudes below `held` (m), or below the rounding of
/// the means, count as zero.
fn amplitude_ratio(point: &CurvePoint, orbit: &Orbit, held: f64) -> Option<f64> {
    if point.values.is_empty() {
        return None;
    }
    let found = amplitudes(orbit);
    // Amplitudes below this fraction of a mean are rounding.
    let held = orbit.places.iter().map(|place| 1e-10 * place.mean.abs()).fold(held, f64::max);
    let largest = |values: &[f64]| values.iter().copied().fold(held.max(f64::MIN_POSITIVE), f64::max);
    let (here, there) = (largest(&point.values), largest(&found));
    // Two orbits differ if their amplitudes differ by more than a hundredth of the largest
    // amplitude, and by more than three times the estimated error.
    let enough = (1e-2f64.max(3.0 * point.error) * here.max(there)).max(held);
    let differs = point.values.iter().zip(&found).any(|(a, b)| (a - b).abs() > enough);
    differs.then(|| (there / here).clamp(f64::MIN_POSITIVE, f64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_has_a_neighbour_where_there_is_one() {
        let point = |omega: f64| CurvePoint { values: vec![omega], ..CurvePoint::failed(omega) };
        let there: Vec<CurvePoint> = (0..8).map(|i| point(f64::from(i))).collect();
        let of = |omegas: &[f64]| -> Vec<Vec<f64>> {
            let others: Vec<CurvePoint> = omegas.iter().map(|omega| point(*omega)).collect();
            let omegas = |stretch: Vec<CurvePoint>| stretch.iter().map(|point| point.omega).collect();
            other_intervals(&there, &others).into_iter().map(omegas).collect()
        };
        assert!(of(&[]).is_empty());
        assert_eq!(of(&[2.0, 3.0]), [[1.0, 2.0, 3.0, 4.0]]);
        assert_eq!(of(&[0.0, 4.0, 6.0]), [vec![0.0, 1.0], vec![3.0, 4.0, 5.0], vec![5.0, 6.0, 7.0]]);
        assert_eq!(of(&[7.0]), [[6.0, 7.0]]);
    }
}
