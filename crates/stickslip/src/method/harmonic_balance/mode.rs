//! Periodic motion without excitation: the equations of a nonlinear mode.
//!
//! `M x'' + (C - 2 ζ ω M) x' + K x + Σ W f = 0`: a motion decays by friction and damping, and the artificial negative damping `2 ζ ω M`
//! that makes it periodic is its equivalent damping ratio ζ; at ζ = 0 the motion is a self-excited orbit.
//! Unknown are the harmonics of all places, ω and ζ, at a given modal amplitude `a`: `X₁ᴴ M X₁ = a²`.
//! Source: Krack (2015), "Nonlinear modal analysis of nonconservative systems: extension of the periodic motion concept".

use super::joints::{Alternation, Coordinate, Element, coordinates};
use crate::method::MethodError;
use crate::model::System;
use nalgebra::DMatrix;
use num_complex::Complex64;
use stickslip_numerics::dense;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);
/// Newton iterations at one amplitude.
const ITERATIONS: usize = 30;
/// Residual relative to the elastic forces at which a motion counts as periodic.
const SOLVED: f64 = 1e-11;
/// Width over which rigid friction changes its sign, relative to the velocity of the motion. A mode of rigid friction is that of
/// this slightly smoothed law.
const WIDTH: f64 = 1e-6;

/// A point of a nonlinear mode.
#[derive(Debug, Clone)]
pub(crate) struct ModeState {
    /// Harmonics 1, 3, … of the places, [harmonic][place], m.
    pub x: Vec<Complex64>,
    pub omega: f64,
    pub damping: f64,
}

/// The equations.
pub(crate) struct ModeEquations<'a> {
    system: &'a System,
    coordinates: Vec<Coordinate>,
    alternation: Alternation,
    reference: usize,
}

/// Share of the joints' stiffness that tells the equal modes of a structure without joints apart.
const TRACE: f64 = 1e-9;

impl<'a> ModeEquations<'a> {
    /// # Errors
    /// A law with several directions, or with an inner coordinate of its own.
    pub fn new(system: &'a System, harmonics: usize, samples: usize) -> Result<Self, MethodError> {
        let coordinates = coordinates(system)?;
        if let Some(coordinate) = coordinates.iter().find(|c| c.series > 0.0) {
            let joint = &system.joints[coordinate.joint];
            return Err(MethodError::Law {
                method: super::NAME,
                joint: joint.name.clone(),
                law: joint.law.name(),
                instead: "the exact law `jenkins` for nonlinear modes",
            });
        }
        let odd: Vec<usize> = (1..=harmonics).step_by(2).collect();
        Ok(ModeEquations { system, coordinates, alternation: Alternation::new(odd, samples), reference: 0 })
    }

    /// The linear mode number `index` (by rising frequency) of the structure with the springs of its elastic joints (`stuck`), or
    /// without its joints, at amplitude `a`. `None` if there is no such mode.
    pub fn linear(&mut self, index: usize, stuck: bool, a: f64) -> Option<ModeState> {
        let n = self.system.dofs();
        let mut stiffness = self.system.stiffness.clone();
        // without joints a trace of them stays, so that equal blades move with or against each other as the joints make them
        let share = if stuck { 1.0 } else { TRACE };
        for coordinate in &self.coordinates {
            let w = self.system.joints[coordinate.joint].direction.column(0);
            match &coordinate.element {
                Element::Springs(springs) => {
                    let kt: f64 = springs.iter().map(|spring| spring.stiffness).sum();
                    stiffness += w * w.transpose() * (share * kt);
                }
                Element::Velocity(_) if !stuck => {
                    stiffness += w * w.transpose() * (TRACE * self.system.stiffness.amax());
                }
                Element::Velocity(_) => {}
            }
        }
        let scale: Vec<f64> = (0..n).map(|i| 1.0 / self.system.mass[(i, i)].sqrt()).collect();
        let normal = DMatrix::from_fn(n, n, |i, k| scale[i] * stiffness[(i, k)] * scale[k]);
        let eigen = normal.symmetric_eigen();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&i, &k| eigen.eigenvalues[i].total_cmp(&eigen.eigenvalues[k]));
        let &column = order.get(index)?;
        let omega = eigen.eigenvalues[column].max(0.0).sqrt();
        let nh = self.alternation.harmonics.len();
        let mut x = vec![ZERO; nh * n];
        for i in 0..n {
            x[i].re = a * scale[i] * eigen.eigenvectors[(i, column)];
        }
        self.reference = (0..n).max_by(|&i, &k| x[i].re.abs().total_cmp(&x[k].re.abs()))?;
        let phi: Vec<f64> = (0..n).map(|i| x[i].re).collect();
        let mut lost = 0.0;
        for i in 0..n {
            for k in 0..n {
                lost += phi[i] * self.system.damping[(i, k)] * phi[k];
            }
        }
        (omega > 0.0).then(|| ModeState { x, omega, damping: lost / (2.0 * omega * a * a) })
    }

    fn evaluate(&mut self, state: &ModeState, a: f64, residual: &mut [f64], mut jacobian: Option<&mut [f64]>) {
        let n = self.system.dofs();
        let harmonics = self.alternation.harmonics.clone();
        let nh = harmonics.len();
        let size = 2 * n * nh + 2;
        let (omega, zeta) = (state.omega, state.damping);
        if let Some(jacobian) = jacobian.as_deref_mut() {
            jacobian.fill(0.0);
        }
        residual.fill(0.0);
        let put = |jacobian: &mut Option<&mut [f64]>, row: usize, column: usize, z: Complex64| {
            if let Some(jacobian) = jacobian {
                jacobian[row * size + column] += z.re;
                jacobian[row * size + column + 1] -= z.im;
                jacobian[(row + 1) * size + column] += z.im;
                jacobian[(row + 1) * size + column + 1] += z.re;
            }
        };
        for (k, &h) in harmonics.iter().enumerate() {
            let h = h as f64;
            for i in 0..n {
                let row = 2 * (k * n + i);
                let (mut sum, mut by_omega, mut by_zeta) = (ZERO, ZERO, ZERO);
                for l in 0..n {
                    let (m, c, s) =
                        (self.system.mass[(i, l)], self.system.damping[(i, l)], self.system.stiffness[(i, l)]);
                    if m == 0.0 && c == 0.0 && s == 0.0 {
                        continue;
                    }
                    let z = Complex64::new(s - h * h * omega * omega * m, h * omega * (c - 2.0 * zeta * omega * m));
                    let x = state.x[k * n + l];
                    sum += z * x;
                    by_omega += x * Complex64::new(-2.0 * h * h * omega * m, h * (c - 4.0 * zeta * omega * m));
                    by_zeta += x * Complex64::new(0.0, -2.0 * h * omega * omega * m);
                    put(&mut jacobian, row, 2 * (k * n + l), z);
                }
                (residual[row], residual[row + 1]) = (sum.re, sum.im);
                if let Some(jacobian) = jacobian.as_deref_mut() {
                    for (column, value) in [(size - 2, by_omega), (size - 1, by_zeta)] {
                        jacobian[row * size + column] = value.re;
                        jacobian[(row + 1) * size + column] = value.im;
                    }
                }
            }
        }
        // friction
        let mut force = vec![ZERO; nh];
        let mut tangent = vec![0.0; 4 * nh * nh];
        for coordinate in &self.coordinates {
            let w = self.system.joints[coordinate.joint].direction.column(0);
            let c: Vec<Complex64> =
                (0..nh).map(|k| (0..n).map(|i| state.x[k * n + i] * w[i]).sum::<Complex64>()).collect();
            let wanted = jacobian.is_some().then_some(&mut tangent[..]);
            match &coordinate.element {
                Element::Springs(springs) => self.alternation.springs(springs, 1.0, &c, &mut force, wanted),
                Element::Velocity(law) => {
                    let speed: f64 = c.iter().zip(&harmonics).map(|(z, h)| z.norm() * *h as f64 * omega).sum();
                    self.alternation.velocity(*law, WIDTH * speed, omega, &c, &mut force, wanted);
                }
            }
            for k in 0..nh {
                for i in (0..n).filter(|&i| w[i] != 0.0) {
                    let row = 2 * (k * n + i);
                    residual[row] += w[i] * force[k].re;
                    residual[row + 1] += w[i] * force[k].im;
                    let Some(jacobian) = jacobian.as_deref_mut() else { continue };
                    for part in 0..2 {
                        for l in 0..nh {
                            for p in (0..n).filter(|&p| w[p] != 0.0) {
                                let at = (row + part) * size + 2 * (l * n + p);
                                let from = (2 * k + part) * 2 * nh + 2 * l;
                                jacobian[at] += w[i] * w[p] * tangent[from];
                                jacobian[at + 1] += w[i] * w[p] * tangent[from + 1];
                            }
                        }
                    }
                }
            }
        }
        // modal amplitude, relative, and phase of the reference place
        let (mut square, last) = (0.0, size - 2);
        for i in 0..n {
            let m = self.system.mass[(i, i)];
            square += m * state.x[i].norm_sqr();
            if let Some(jacobian) = jacobian.as_deref_mut() {
                jacobian[last * size + 2 * i] = 2.0 * m * state.x[i].re / (a * a);
                jacobian[last * size + 2 * i + 1] = 2.0 * m * state.x[i].im / (a * a);
            }
        }
        residual[last] = square / (a * a) - 1.0;
        residual[last + 1] = state.x[self.reference].im / a;
        if let Some(jacobian) = jacobian {
            jacobian[(last + 1) * size + 2 * self.reference + 1] = 1.0 / a;
        }
    }

    /// Solves at amplitude `a` from `start`, whose motion is scaled to it.
    pub fn solve(&mut self, start: &ModeState, before: f64, a: f64) -> Option<ModeState> {
        let n = self.system.dofs();
        let size = 2 * n * self.alternation.harmonics.len() + 2;
        let mut state = start.clone();
        state.x.iter_mut().for_each(|x| *x *= a / before);
        let (mut residual, mut jacobian) = (vec![0.0; size], vec![0.0; size * size]);
        let stiffness = self.system.stiffness.amax().max(start.omega * start.omega * self.system.mass.amax());
        let scale = (stiffness * a).max(f64::MIN_POSITIVE);
        let norm = |r: &[f64]| {
            let sum: f64 = r[..size - 2].iter().map(|x| (x / scale) * (x / scale)).sum();
            (sum + r[size - 2] * r[size - 2] + r[size - 1] * r[size - 1]).sqrt()
        };
        self.evaluate(&state, a, &mut residual, Some(&mut jacobian));
        let mut now = norm(&residual);
        for _ in 0..ITERATIONS {
            if now <= SOLVED {
                return Some(state);
            }
            for row in 0..size - 2 {
                residual[row] /= scale;
                jacobian[row * size..(row + 1) * size].iter_mut().for_each(|x| *x /= scale);
            }
            if !dense::solve(&mut jacobian, size, &mut residual) {
                return None;
            }
            let step = residual.clone();
            let mut fraction = 1.0;
            let mut accepted = false;
            for _ in 0..8 {
                let mut trial = state.clone();
                for (x, d) in trial.x.iter_mut().zip(step.chunks_exact(2)) {
                    *x -= Complex64::new(d[0], d[1]) * fraction;
                }
                trial.omega -= step[size - 2] * fraction;
                trial.damping -= step[size - 1] * fraction;
                self.evaluate(&trial, a, &mut residual, Some(&mut jacobian));
                let after = norm(&residual);
                if after < now && trial.omega > 0.0 {
                    (state, now, accepted) = (trial, after, true);
                    break;
                }
                fraction *= 0.5;
            }
            if !accepted {
                return (now <= 1e3 * SOLVED).then_some(state);
            }
        }
        (now <= 1e3 * SOLVED).then_some(state)
    }
}
