//! A first guess of an orbit: every joint as the complex stiffness that its first harmonic has.

use crate::model::System;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

/// Rounds of the fixed-point iteration; it only has to come near.
const ROUNDS: usize = 60;
/// The guess has settled when no joint's amplitude changes by more than this fraction.
const SETTLED: f64 = 1e-3;

/// Displacements per harmonic and joint forces per harmonic.
pub(crate) struct Guess {
    /// (frequency hΩ, complex displacements).
    pub harmonics: Vec<(f64, DVector<Complex64>)>,
    /// Complex stiffness of each joint.
    pub joints: Vec<Complex64>,
}

impl Guess {
    /// Describing-function iteration at drive frequency `omega`; zero displacements where it fails.
    pub fn new(system: &System, omega: f64) -> Guess {
        let n = system.dofs();
        let excitation = system.excitation(omega);
        let mut harmonics: Vec<u32> = excitation.iter().map(|(h, _)| *h).collect();
        harmonics.extend(
            system
                .joints()
                .iter()
                .flat_map(|joint| joint.axes().iter().flat_map(|axis| axis.imposed()).map(|(h, _)| *h)),
        );
        harmonics.sort_unstable();
        harmonics.dedup();
        let mut amplitudes = vec![f64::INFINITY; system.joints().len()];
        let mut guess = Guess { harmonics: Vec::new(), joints: vec![Complex64::new(0.0, 0.0); system.joints().len()] };
        for _ in 0..ROUNDS {
            guess.joints = system
                .joints()
                .iter()
                .zip(&amplitudes)
                .map(
                    |(joint, &a)| {
                        if a.is_finite() { joint.law().linearised(a, omega) } else { Complex64::new(0.0, 0.0) }
                    },
                )
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
                        let u: Complex64 = joint.axes()[0].along_complex(&x);
                        (u + joint.axes()[0].imposed_at(*h)).norm()
                    })
                    .sum();
                let old = amplitudes[j];
                amplitudes[j] = if old.is_finite() && size > 0.0 { (old * size).sqrt() } else { size };
                settled &= (amplitudes[j] - old).abs() <= SETTLED * old && old.is_finite();
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
            return force; // a joint that is only moved; an elimination without unknowns is refused below
        }
        let s = Complex64::new(0.0, f64::from(h) * omega);
        let mut dynamic = DMatrix::from_fn(n, n, |i, k| {
            s * s * system.structure().mass()[(i, k)]
                + s * system.structure().damping()[(i, k)]
                + system.structure().stiffness()[(i, k)]
        });
        for (joint, &kappa) in system.joints().iter().zip(&self.joints) {
            let w = joint.axes()[0].dense(n);
            let g = joint.axes()[0].imposed_at(h);
            for i in 0..n {
                force[i] -= kappa * g * w[i];
                for k in 0..n {
                    dynamic[(i, k)] += kappa * (w[i] * w[k]);
                }
            }
        }
        let solution = dynamic.lu().solve(&force);
        solution
            .filter(|x| x.iter().all(|z| z.is_finite()))
            .unwrap_or_else(|| DVector::from_element(n, Complex64::new(0.0, 0.0)))
    }

    /// Displacements and velocities at t = 0, length 2n.
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
