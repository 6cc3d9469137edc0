//! Initial guess of an orbit by describing functions: each joint acts as the complex stiffness
//! of its first harmonic.
//!
//! A law of several directions uses its small-motion stiffness. Rigid friction in several
//! directions uses the same complex stiffness along all of them.

use crate::law::{Law, MAX_DIRECTIONS, RatePoint, RelativeMotion, StepPoint};
use crate::model::System;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::f64::consts::PI;

/// Displacements by harmonic, and the stiffness of each joint.
pub(crate) struct DescribingGuess {
    /// Pairs of the frequency hΩ and the complex displacements.
    pub harmonics: Vec<(f64, DVector<Complex64>)>,
    /// Complex stiffness of each joint, directions × directions.
    pub joints: Vec<DMatrix<Complex64>>,
}

/// Returns the complex stiffness at amplitude `a`, directions × directions, N/m.
fn complex_stiffness(law: &dyn Law, a: f64, omega: f64) -> DMatrix<Complex64> {
    let d = law.directions();
    let along = match law.prox() {
        _ if d == 1 => law.describing_function(a, omega),
        None => return small_motion_stiffness(law, omega),
        Some(prox) => {
            let rigid = Complex64::new(0.0, 4.0 * law.force_scale() / (PI * a));
            rigid / (1.0 + rigid * prox.compliance())
        }
    };
    DMatrix::from_diagonal_element(d, d, along)
}

/// Returns the complex stiffness of small motions about rest, directions × directions, N/m. It
/// is zero for a law without a step and a rate.
pub(crate) fn small_motion_stiffness(law: &dyn Law, omega: f64) -> DMatrix<Complex64> {
    let d = law.directions();
    let zero = Complex64::new(0.0, 0.0);
    if let Some(step) = law.step() {
        let mut point = StepPoint::new(d, step.states());
        let rest = [0.0; MAX_DIRECTIONS];
        step.advance_with_derivatives(d, &rest, &rest, &vec![0.0; step.states()], &mut point);
        return DMatrix::from_fn(d, d, |a, b| Complex64::new(point.force_slope(a)[d + b], 0.0));
    }
    let Some(rate) = law.rate() else { return DMatrix::from_element(d, d, zero) };
    let states = rate.states();
    let mut point = RatePoint::new(d, states);
    let rest = [0.0; MAX_DIRECTIONS];
    rate.evaluate_with_derivatives(
        d,
        &RelativeMotion { displacement: rest, velocity: rest },
        &vec![0.0; states],
        &mut point,
    );
    let s = Complex64::new(0.0, omega);
    let by_motion = |slope: &[f64], b: usize| s * slope[d + b] + slope[b];
    // `s z = g_u u + g_v s u + g_z z`
    let matrix =
        DMatrix::from_fn(states, states, |i, k| (if i == k { s } else { zero }) - point.rate_slope(i)[2 * d + k]);
    let right = DMatrix::from_fn(states, d, |i, b| by_motion(point.rate_slope(i), b));
    let z = if states > 0 { matrix.lu().solve(&right) } else { None };
    DMatrix::from_fn(d, d, |a, b| {
        let slope = point.force_slope(a);
        let kept: Complex64 = z.iter().flat_map(|z| (0..states).map(|i| z[(i, b)] * slope[2 * d + i])).sum();
        by_motion(slope, b) + kept
    })
}

impl DescribingGuess {
    /// Iterates the describing functions at the excitation frequency `omega`. The displacements
    /// are zero where the linear system is singular.
    pub fn new(system: &System, omega: f64) -> DescribingGuess {
        let n = system.dofs();
        let excitation = system.excitation(omega);
        let mut harmonics: Vec<u32> = excitation.iter().map(|(h, _)| *h).collect();
        harmonics.extend(system.axes().flat_map(|(_, axis)| axis.imposed()).map(|(h, _)| *h));
        harmonics.sort_unstable();
        harmonics.dedup();
        let mut amplitudes = vec![f64::INFINITY; system.joints().len()];
        let none = |d: usize| DMatrix::from_element(d, d, Complex64::new(0.0, 0.0));
        let mut guess = DescribingGuess { harmonics: Vec::new(), joints: Vec::new() };
        // Most rounds of the fixed-point iteration; a rough result is enough.
        for _ in 0..60 {
            let joints = system.joints().iter().zip(&amplitudes);
            guess.joints =
                joints
                    .map(|(joint, &a)| {
                        if a.is_finite() {
                            complex_stiffness(&**joint.law(), a, omega)
                        } else {
                            none(joint.axes().len())
                        }
                    })
                    .collect();
            guess.harmonics = harmonics
                .iter()
                .map(|&h| {
                    let force = excitation
                        .iter()
                        .find(|(k, _)| *k == h)
                        .map_or_else(|| DVector::from_element(n, Complex64::new(0.0, 0.0)), |(_, f)| f.clone());
                    (f64::from(h) * omega, guess.response(system, h, omega, force))
                })
                .collect();
            let mut settled = true;
            for (j, joint) in system.joints().iter().enumerate() {
                let size: f64 = harmonics
                    .iter()
                    .zip(&guess.harmonics)
                    .filter(|(h, _)| **h > 0)
                    .map(|(h, (_, x))| {
                        let along = joint.axes().iter().map(|axis| axis.complex_component(x) + axis.imposed_at(*h));
                        along.map(|u| u.norm_sqr()).sum::<f64>().sqrt()
                    })
                    .sum();
                let old = amplitudes[j];
                amplitudes[j] = if old.is_finite() && size > 0.0 { (old * size).sqrt() } else { size };
                // The iteration stops when no amplitude of a joint changes by more than this
                // fraction.
                settled &= (amplitudes[j] - old).abs() <= 1e-3 * old && old.is_finite();
            }
            if settled {
                break;
            }
        }
        guess
    }

    fn response(&self, system: &System, h: u32, omega: f64, mut force: DVector<Complex64>) -> DVector<Complex64> {
        let n = system.dofs();
        if n == 0 {
            return force; // no structure, only a moved joint; the elimination below needs unknowns
        }
        let s = Complex64::new(0.0, f64::from(h) * omega);
        let mut dynamic = DMatrix::from_fn(n, n, |i, k| {
            s * s * system.structure().mass()[(i, k)]
                + s * system.structure().damping()[(i, k)]
                + system.structure().stiffness()[(i, k)]
        });
        for (joint, stiffness) in system.joints().iter().zip(&self.joints) {
            for (a, to) in joint.axes().iter().enumerate() {
                for (b, from) in joint.axes().iter().enumerate() {
                    let kappa = stiffness[(a, b)];
                    let g = from.imposed_at(h);
                    for &(i, w) in to.rows() {
                        force[i] -= kappa * g * w;
                        for &(k, v) in from.rows() {
                            dynamic[(i, k)] += kappa * (w * v);
                        }
                    }
                }
            }
        }
        let solution = dynamic.lu().solve(&force);
        solution
            .filter(|x| x.iter().all(|z| z.is_finite()))
            .unwrap_or_else(|| DVector::from_element(n, Complex64::new(0.0, 0.0)))
    }

    /// Returns the force along an axis of a joint at a harmonic with its displacements, N.
    pub fn force(
        &self,
        system: &System,
        (joint, axis): (usize, usize),
        (h, x): (u32, &DVector<Complex64>),
    ) -> Complex64 {
        let axes = system.joints()[joint].axes().iter().enumerate();
        axes.map(|(b, along)| self.joints[joint][(axis, b)] * (along.complex_component(x) + along.imposed_at(h))).sum()
    }

    /// Returns displacements and velocities at t = 0, length 2n.
    pub fn state(&self, n: usize) -> Vec<f64> {
        let mut state = vec![0.0; 2 * n];
        for (rate, x) in &self.harmonics {
            for i in 0..n {
                state[i] += x[i].re;
                state[n + i] += (x[i] * Complex64::new(0.0, *rate)).re;
            }
        }
        state
    }
}
