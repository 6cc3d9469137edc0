//! Truncation error of a solution, from a second solution with twice the harmonics.

use crate::method::harmonic_balance::aft::Ports;
use crate::method::harmonic_balance::dynamics::linear_dynamics::LinearDynamics;
use crate::method::harmonic_balance::equations::harmonic_set::HarmonicSet;
use crate::method::harmonic_balance::equations::homotopy::RESIDUAL_TOLERANCE;
use crate::method::harmonic_balance::equations::{Discretization, HarmonicSolution};
use crate::model::Axis;
use nalgebra::DVector;
use num_complex::Complex64;

/// A solution for the comparison: its harmonics, and per harmonic the motions of the places and
/// along the axes of the ports.
pub(crate) struct ComparedSolution<'a> {
    pub harmonics: &'a [usize],
    pub places: &'a [DVector<Complex64>],
    pub along: &'a [Complex64],
}

/// Returns the truncation error of `coarse`, relative to the largest motion.
///
/// The error is the largest distance between both solutions, over the places and the sliders
/// behind springs. It is divided by the largest of these motions without means. The factor accounts
/// for the error of the finer solution. Resonances above the
/// harmonics of the finer solution count too. The finer solution consists of its equations, its
/// harmonics and, per harmonic, the motions of the places.
pub(crate) fn truncation_error(
    seen: &[Axis],
    ports: &Ports,
    dynamics: &LinearDynamics,
    (harmonic_set, omega, steep): (HarmonicSet, f64, bool),
    coarse: &ComparedSolution,
    (finer, better, places): (&mut Discretization, &HarmonicSolution, &[DVector<Complex64>]),
) -> f64 {
    let above = missing_resonances(finer, dynamics, ports, harmonic_set, omega, better);
    let fine = ComparedSolution { harmonics: finer.harmonics(), places, along: &better.c };
    let unhindered = |place: &Axis| {
        let moving = fine.harmonics.iter().zip(&finer.linear.free_response).filter(|(h, _)| **h > 0);
        moving.map(|(_, free)| length(place, free).norm_sqr()).sum::<f64>()
    };
    let largest = seen.iter().map(unhindered).fold(0.0, f64::max);
    // Smallest size of a motion, relative to the motion without joints. Equations are solved to a
    // tenth of it.
    let no_motion = 10.0 * RESIDUAL_TOLERANCE;
    let (mut distance, mut size) = (0.0f64, no_motion * no_motion * largest);
    let mut compare = |coarse_at: &dyn Fn(usize) -> Complex64, fine_at: &dyn Fn(usize) -> Complex64, missing: f64| {
        let (mut d, mut s) = (missing, missing);
        for (k, h) in fine.harmonics.iter().enumerate().filter(|(_, h)| **h > 0) {
            let (x, y) = (coarse.harmonics.binary_search(h).map_or(Complex64::new(0.0, 0.0), coarse_at), fine_at(k));
            d += (x - y).norm_sqr();
            s += y.norm_sqr();
        }
        (distance, size) = (distance.max(d), size.max(s));
    };
    for place in seen {
        let missing = above.iter().map(|x| length(place, x).norm_sqr()).sum();
        let at = |places: &[DVector<Complex64>], k: usize| length(place, &places[k]);
        compare(&|k| at(coarse.places, k), &|k| at(fine.places, k), missing);
    }
    let (few, many) = (coarse.harmonics.len(), fine.harmonics.len());
    for q in ports.iter().filter(|port| port.series_compliance > 0.0).flat_map(|port| port.range()) {
        compare(&|k| coarse.along[q * few + k], &|k| fine.along[q * many + k], 0.0);
    }
    let share = if steep {
        // The ratio for steep laws. Until the series resolves their transition layer, a doubling
        // leaves half of the error, as order 1 does. Friction that falls with velocity leaves no
        // less. With all other laws a doubling leaves almost nothing.
        2.0
    } else if ports.has_forces() {
        // Ratio of the error to the distance between the two solutions for rigid friction.
        // Friction makes accelerations jump, and a doubling leaves four tenths of the error. This
        // lies between the observed orders 1 (one half) and 3/2 (one third).
        1.7
    } else {
        1.0
    };
    if size > 0.0 { share * (distance / size).sqrt() } else { 0.0 }
}

/// Returns the motion of a place as a length, m.
fn length(place: &Axis, motion: &DVector<Complex64>) -> Complex64 {
    place.complex_component(motion) * place.length_scale()
}

/// Returns the motions of the places at the resonances above the harmonics of a solution, under
/// its forces.
fn missing_resonances(
    discretization: &mut Discretization,
    dynamics: &LinearDynamics,
    ports: &Ports,
    harmonic_set: HarmonicSet,
    omega: f64,
    motion: &HarmonicSolution,
) -> Vec<DVector<Complex64>> {
    let top = *discretization.harmonics().last().expect("a series has harmonics");
    let mut wanted = dynamics.resonances_above(top, omega);
    wanted.retain(|h| harmonic_set.contains(*h));
    if wanted.is_empty() {
        return Vec::new();
    }
    let forces = discretization.forces_at(ports, omega, motion, &wanted);
    let infinite =
        || DVector::from_element(discretization.linear.free_response[0].len(), Complex64::new(f64::INFINITY, 0.0));
    let respond = |h: usize, forces: &[Complex64]| dynamics.respond_along(h, omega, |q| forces[q]);
    wanted.iter().zip(&forces).map(|(h, forces)| respond(*h, forces).unwrap_or_else(|_| infinite())).collect()
}
