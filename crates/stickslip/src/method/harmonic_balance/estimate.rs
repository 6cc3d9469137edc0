//! The error of a motion by a finer one.

use super::ease::SOLVED;
use super::equations::{Level, Solution};
use super::kept::Kept;
use super::ports::Ports;
use super::rest::Rest;
use crate::model::Axis;
use nalgebra::DVector;
use num_complex::Complex64;

/// The error relative to the distance from the solution with twice the harmonics. Where rigid friction makes accelerations jump, the
/// doubling leaves four tenths of the error, between order 1 (one half) and 3/2 (a third): both are observed.
const RIGID_SHARE: f64 = 1.7;
/// The same of laws that are steep: until the series resolves their layer they leave half of it, as order 1 does, and where friction falls with
/// velocity no less. Elsewhere the doubling leaves next to nothing.
const STEEP_SHARE: f64 = 2.0;
/// A motion that is less than this share of what it would be without the joints is rest: equations count as solved where they leave a tenth of that.
const CANCELS: f64 = 10.0 * SOLVED;

/// A motion for the comparison with a finer one: its harmonics and, per harmonic, the motions of the places and along the axes of the ports.
pub(super) struct Compared<'a> {
    pub harmonics: &'a [usize],
    pub places: &'a [DVector<Complex64>],
    pub along: &'a [Complex64],
}

/// The error of a motion by a finer one: their distance, as the largest of the places and of the inner sliders behind springs, relative to
/// the largest of these motions, without means ([`CANCELS`]), times the share that the finer one may be off itself. What the finer one lacks at
/// resonances above its own harmonics counts too. The finer one is its level, its motion and, per harmonic, the motions of the places.
pub(super) fn estimate(
    seen: &[Axis],
    ports: &Ports,
    rest: &Rest,
    (kept, omega, steep): (Kept, f64, bool),
    coarse: &Compared,
    (finer, better, places): (&mut Level, &Solution, &[DVector<Complex64>]),
) -> f64 {
    let above = above(finer, rest, ports, kept, omega, better);
    let fine = Compared { harmonics: finer.harmonics(), places, along: &better.c };
    let unhindered = |place: &Axis| {
        let moving = fine.harmonics.iter().zip(&finer.free).filter(|(h, _)| **h > 0);
        moving.map(|(_, free)| length(place, free).norm_sqr()).sum::<f64>()
    };
    let largest = seen.iter().map(unhindered).fold(0.0, f64::max);
    let (mut distance, mut size) = (0.0f64, CANCELS * CANCELS * largest);
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
    for q in ports.iter().filter(|port| port.series > 0.0).flat_map(|port| port.range()) {
        compare(&|k| coarse.along[q * few + k], &|k| fine.along[q * many + k], 0.0);
    }
    let share = if steep {
        STEEP_SHARE
    } else if ports.has_forces() {
        RIGID_SHARE
    } else {
        1.0
    };
    if size > 0.0 { share * (distance / size).sqrt() } else { 0.0 }
}

/// The motion of a place as a length, m.
fn length(place: &Axis, motion: &DVector<Complex64>) -> Complex64 {
    place.along_complex(motion) * place.length()
}

/// What a solution lacks at the resonances above its harmonics: the motions of the places there, under the forces that it has.
fn above(
    level: &mut Level,
    rest: &Rest,
    ports: &Ports,
    kept: Kept,
    omega: f64,
    motion: &Solution,
) -> Vec<DVector<Complex64>> {
    let top = *level.harmonics().last().expect("a series has harmonics");
    let mut wanted = rest.resonances_above(top, omega);
    wanted.retain(|h| kept.has(*h));
    if wanted.is_empty() {
        return Vec::new();
    }
    let forces = level.forces_at(ports, omega, motion, &wanted);
    let infinite = || DVector::from_element(level.free[0].len(), Complex64::new(f64::INFINITY, 0.0));
    let respond = |h: usize, forces: &[Complex64]| rest.respond_along(h, omega, |q| forces[q]);
    wanted.iter().zip(&forces).map(|(h, forces)| respond(*h, forces).unwrap_or_else(|_| infinite())).collect()
}
