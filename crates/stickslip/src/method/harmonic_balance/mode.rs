//! Periodic motion without excitation: the equations of a nonlinear mode.
//!
//! `M x'' + (C - 2 ζ ω M) x' + K x + Σ W f = 0`: a motion decays by friction and damping, and the artificial negative damping `2 ζ ω M`
//! that makes it periodic is its equivalent damping ratio ζ; at ζ = 0 the motion is a self-excited orbit.
//! Unknown are the harmonics of all places, those of the forces λ along laws of velocity, ω and ζ, at a given modal amplitude `a`:
//! `X₁ᴴ M X₁ = a²`. Each force has the equation that it has in forced vibration, `λ - P J(λ + ε c') = 0` with `c = wᵀx - λ/k` behind a
//! spring `k`: rigid friction is not smoothed, and a contact that sticks is a constraint.
//! Source: Krack (2015), "Nonlinear modal analysis of nonconservative systems: extension of the periodic motion concept".

use super::equations::{apply, penalty, stay};
use super::joints::{Alternation, Coordinate, Element, Velocity, coordinates};
use super::solve::{HALVINGS, SHORTENS};
use crate::method::MethodError;
use crate::model::System;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use stickslip_numerics::dense;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);
/// Newton iterations at one amplitude; 2 to 10 are usual.
pub(super) const ITERATIONS: usize = 60;
/// Residual relative to the elastic forces, and to the slip limits, at which a motion counts as periodic.
pub(super) const SOLVED: f64 = 1e-11;
/// The same where rounding lets Newton's method come no closer: a stiff joint between soft springs loses three digits.
pub(super) const ROUNDED: f64 = 1e-8;

/// A point of a nonlinear mode.
#[derive(Debug, Clone)]
pub(crate) struct ModeState {
    /// Harmonics 1, 3, … of the places, [harmonic][place], m.
    pub x: Vec<Complex64>,
    /// The same harmonics of the forces along laws of velocity, [contact][harmonic], N.
    pub force: Vec<Complex64>,
    pub omega: f64,
    pub damping: f64,
}

/// The equations.
pub(crate) struct ModeEquations<'a> {
    pub(super) system: &'a System,
    /// Sliders behind springs.
    pub(super) elastic: Vec<Coordinate>,
    pub(super) contacts: Vec<Contact>,
    pub(super) alternation: Alternation,
}

/// A law of velocity along the direction `w` of its joint, behind a spring of compliance `series` (m/N, zero without one).
pub(super) struct Contact {
    pub law: Velocity,
    w: DVector<f64>,
    series: f64,
}

/// Share of the joints' stiffness that tells the equal modes of a structure without joints apart.
const TRACE: f64 = 1e-9;
/// Distance of the squares of two frequencies, relative, up to which modes count as equal: well above [`TRACE`].
const EQUAL: f64 = 1e-7;
/// Steps of the eigenvalue iteration; two or three for each mode are usual.
const EIGEN_STEPS: usize = 10_000;

/// A linear mode of the structure without its joints.
#[derive(Debug, Clone)]
pub(crate) struct LinearMode {
    /// Square of the frequency, (rad/s)².
    pub square: f64,
    /// Shape φ with φᵀ M φ = 1, 1/√kg.
    pub shape: DVector<f64>,
}

impl<'a> ModeEquations<'a> {
    /// # Errors
    /// A law with several directions, a place without mass, a mass matrix that is not positive definite.
    pub fn new(system: &'a System, harmonics: usize, samples: usize) -> Result<Self, MethodError> {
        if let Some(massless) = (0..system.dofs()).find(|&i| system.structure().mass()[(i, i)] == 0.0) {
            return Err(MethodError::NeedsMass { method: super::NAME, place: system.places()[massless].clone() });
        }
        if system.structure().mass().clone().cholesky().is_none() {
            return Err(MethodError::NotPositive { method: super::NAME, matrix: "mass" });
        }
        let (mut elastic, mut contacts) = (Vec::new(), Vec::new());
        for coordinate in coordinates(system)? {
            let w = system.joints()[coordinate.joint].axes()[0].dense(system.dofs());
            match coordinate.element {
                Element::Springs(_) => elastic.push(coordinate),
                // between places whose motion is imposed it does nothing to the structure, and nothing in the mode moves it
                Element::Velocity(_) if w.amax() == 0.0 => {}
                Element::Velocity(law) => contacts.push(Contact { law, w, series: coordinate.series }),
            }
        }
        let odd: Vec<usize> = (1..=harmonics).step_by(2).collect();
        let alternation = Alternation::new(odd, samples);
        Ok(ModeEquations { system, elastic, contacts, alternation })
    }

    /// The linear modes of the structure without its joints, by rising frequency.
    pub fn linear_modes(&self) -> Vec<LinearMode> {
        let n = self.system.dofs();
        let mut stiffness = self.system.structure().stiffness().clone();
        // a trace of the joints stays, so that equal blades move with or against each other as the joints make them
        for coordinate in &self.elastic {
            let w = self.system.joints()[coordinate.joint].axes()[0].dense(self.system.dofs());
            if let Element::Springs(springs) = &coordinate.element {
                let kt: f64 = springs.iter().map(|spring| spring.stiffness).sum();
                stiffness += &w * w.transpose() * (TRACE * kt);
            }
        }
        for Contact { w, series, .. } in &self.contacts {
            let kt = if *series > 0.0 { 1.0 / series } else { self.system.structure().stiffness().amax() };
            stiffness += w * w.transpose() * (TRACE * kt);
        }
        let Some(factor) = self.system.structure().mass().clone().cholesky() else { return Vec::new() };
        let lower = factor.l();
        let Some(inverse) = lower.solve_lower_triangular(&DMatrix::identity(n, n)) else { return Vec::new() };
        let Some(eigen) = (&inverse * stiffness * inverse.transpose()).try_symmetric_eigen(f64::EPSILON, EIGEN_STEPS)
        else {
            return Vec::new();
        };
        let shapes = inverse.transpose() * eigen.eigenvectors;
        let mut modes: Vec<LinearMode> = (0..n)
            .map(|k| LinearMode { square: eigen.eigenvalues[k].max(0.0), shape: shapes.column(k).into_owned() })
            .collect();
        modes.sort_by(|a, b| a.square.total_cmp(&b.square));
        modes
    }

    /// A linear mode at amplitude `a`; forces along laws of velocity are zero. `None` if it has no frequency.
    pub fn linear(&self, mode: &LinearMode, a: f64) -> Option<ModeState> {
        let (n, nh) = (self.system.dofs(), self.alternation.harmonics.len());
        let omega = mode.square.sqrt();
        let mut x = vec![ZERO; nh * n];
        for i in 0..n {
            x[i].re = a * mode.shape[i];
        }
        let lost = mode.shape.dot(&(self.system.structure().damping() * &mode.shape));
        let force = vec![ZERO; nh * self.contacts.len()];
        (omega > 0.0).then(|| ModeState { x, force, omega, damping: lost / (2.0 * omega) })
    }

    /// Modal assurance of two motions: how much of one first harmonic is in the other, in the mass inner product, from 0 to 1.
    pub fn assurance(&self, one: &ModeState, other: &ModeState) -> f64 {
        let (mut cross, mut squares) = (ZERO, [0.0; 2]);
        let n = self.system.dofs();
        for i in 0..n {
            for l in 0..n {
                let m = self.system.structure().mass()[(i, l)];
                cross += one.x[i].conj() * other.x[l] * m;
                squares[0] += (one.x[i].conj() * one.x[l]).re * m;
                squares[1] += (other.x[i].conj() * other.x[l]).re * m;
            }
        }
        cross.norm_sqr() / (squares[0] * squares[1])
    }

    /// The share of the viscous dampers in the damping ratio: what they lose in a cycle, against what `2 ζ ω M` puts in for ζ = 1.
    pub fn viscous(&self, state: &ModeState) -> f64 {
        let (n, mut lost, mut whole) = (self.system.dofs(), 0.0, 0.0);
        for (k, &h) in self.alternation.harmonics.iter().enumerate() {
            for i in 0..n {
                for l in 0..n {
                    let pair = (state.x[k * n + i].conj() * state.x[k * n + l]).re * (h * h) as f64;
                    lost += pair * self.system.structure().damping()[(i, l)];
                    whole += pair * self.system.structure().mass()[(i, l)];
                }
            }
        }
        lost / (2.0 * state.omega * whole)
    }

    /// Amplitude of the first harmonic of every place, m.
    pub fn amplitudes(&self, state: &ModeState) -> Vec<f64> {
        (0..self.system.dofs()).map(|i| state.x[i].norm()).collect()
    }

    /// How real the shape is: `|X₁ᵀ M X₁| / X₁ᴴ M X₁`, one if all places move in phase or against each other. Where two modes of the symmetric
    /// complex eigenvalue problem that the first harmonic solves become one, it is zero: their shape is orthogonal to itself.
    /// Source: Heiss (2012), "The physics of exceptional points".
    pub fn rigidity(&self, state: &ModeState) -> f64 {
        let (mut transposed, mut adjoint) = (ZERO, 0.0);
        for i in 0..self.system.dofs() {
            for l in 0..self.system.dofs() {
                let m = self.system.structure().mass()[(i, l)];
                transposed += state.x[i] * state.x[l] * m;
                adjoint += (state.x[i].conj() * state.x[l]).re * m;
            }
        }
        transposed.norm() / adjoint
    }

    /// Modal amplitude, m √kg, from which on the first harmonic of friction is at most a share of the forces of inertia of the linear mode
    /// `index`, and of what distinguishes it from every other mode.
    pub fn faint(&self, modes: &[LinearMode], index: usize, share: f64, apart: f64) -> f64 {
        let Some(mode) = modes.get(index) else { return 0.0 };
        let mut forces: Vec<(DVector<f64>, f64)> = Vec::new();
        for coordinate in &self.elastic {
            if let Element::Springs(springs) = &coordinate.element {
                let w = self.system.joints()[coordinate.joint].axes()[0].dense(self.system.dofs());
                forces.push((w, springs.iter().map(|spring| spring.limit).sum()));
            }
        }
        forces.extend(self.contacts.iter().map(|contact| (contact.w.clone(), contact.law.limit)));
        let onto = |shape: &DVector<f64>| -> f64 { forces.iter().map(|(w, limit)| limit * w.dot(shape).abs()).sum() };
        let own = onto(&mode.shape) / (share * mode.square);
        let others = modes.iter().enumerate().filter(|(k, _)| *k != index).map(|(_, other)| {
            let gap = (other.square - mode.square).abs();
            if gap <= EQUAL * mode.square { 0.0 } else { onto(&other.shape) / (apart * gap) }
        });
        4.0 / std::f64::consts::PI * others.fold(own, f64::max)
    }

    /// Unknowns: real and imaginary parts of motions and forces, ω and ζ.
    pub(super) fn size(&self) -> usize {
        2 * self.alternation.harmonics.len() * (self.system.dofs() + self.contacts.len()) + 2
    }

    /// ε of every contact, N s/m, see [`super::equations::penalty`]. In place of the receptance of the highest harmonic stands that without
    /// its resonances, `wᵀ (K + h² ω² M)⁻¹ w`: it changes smoothly along the mode, and where the harmonics are many it is the same.
    fn penalties(&self, omega: f64) -> Vec<f64> {
        if self.contacts.is_empty() {
            return Vec::new();
        }
        let top = self.alternation.harmonics[self.alternation.harmonics.len() - 1];
        let rate = top as f64 * omega;
        let stiff = self.system.structure().stiffness() + self.system.structure().mass() * (rate * rate);
        // masses are positive: only an ω that overflows has no factor, and its residual is no number either
        let factor = stiff.cholesky();
        let receptance = |w: &DVector<f64>| factor.as_ref().map_or(0.0, |factor| w.dot(&factor.solve(w)));
        self.contacts.iter().map(|contact| penalty(receptance(&contact.w) + contact.series, top, omega)).collect()
    }

    /// Residual at `state` for amplitude `a`, and its derivative. The phase of the motion is that of `start`.
    pub(super) fn evaluate(
        &mut self,
        state: &ModeState,
        (start, a): (&ModeState, f64),
        residual: &mut [f64],
        mut jacobian: Option<&mut [f64]>,
    ) {
        let n = self.system.dofs();
        let harmonics = self.alternation.harmonics.clone();
        let size = self.size();
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
                    let (m, c, s) = (
                        self.system.structure().mass()[(i, l)],
                        self.system.structure().damping()[(i, l)],
                        self.system.structure().stiffness()[(i, l)],
                    );
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
        self.add_elastic_forces(state, residual, jacobian.as_deref_mut());
        self.add_contact_forces(state, residual, jacobian.as_deref_mut());
        // modal amplitude, relative, and phase: no single place may stand for it, as the contact masses that move most when they slip
        // may stand still when they stick
        let (mut square, mut turned, last) = (0.0, 0.0, size - 2);
        for i in 0..n {
            let (mut x, mut before) = (ZERO, ZERO);
            for l in 0..n {
                let m = self.system.structure().mass()[(i, l)] / (a * a);
                x += state.x[l] * m;
                before += start.x[l] * m;
            }
            square += (state.x[i].conj() * x).re;
            turned += (before.conj() * state.x[i]).im;
            if let Some(jacobian) = jacobian.as_deref_mut() {
                jacobian[last * size + 2 * i] = 2.0 * x.re;
                jacobian[last * size + 2 * i + 1] = 2.0 * x.im;
                jacobian[(last + 1) * size + 2 * i] = -before.im;
                jacobian[(last + 1) * size + 2 * i + 1] = before.re;
            }
        }
        residual[last] = square - 1.0;
        residual[last + 1] = turned;
    }

    /// Forces of sliders behind springs on the places.
    fn add_elastic_forces(&mut self, state: &ModeState, residual: &mut [f64], mut jacobian: Option<&mut [f64]>) {
        let (n, size, nh) = (self.system.dofs(), self.size(), self.alternation.harmonics.len());
        let mut force = vec![ZERO; nh];
        let mut tangent = vec![0.0; 4 * nh * nh];
        for coordinate in &self.elastic {
            let Element::Springs(springs) = &coordinate.element else { continue };
            let w = self.system.joints()[coordinate.joint].axes()[0].dense(self.system.dofs());
            let c: Vec<Complex64> =
                (0..nh).map(|k| (0..n).map(|i| state.x[k * n + i] * w[i]).sum::<Complex64>()).collect();
            let wanted = jacobian.is_some().then_some(&mut tangent[..]);
            self.alternation.springs(springs, 1.0, &c, &mut force, wanted);
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
    }

    /// Forces λ along laws of velocity on the places, and the equations of these forces.
    ///
    /// The derivative leaves out that ε follows ω: λ solves the law for any ε, so that the solution feels ε only through the harmonics
    /// that are missing, and Newton's method does not miss it.
    fn add_contact_forces(&mut self, state: &ModeState, residual: &mut [f64], mut jacobian: Option<&mut [f64]>) {
        let (n, size, nh) = (self.system.dofs(), self.size(), self.alternation.harmonics.len());
        let width = 2 * nh;
        let penalties = self.penalties(state.omega);
        let (mut signal, mut image) = (vec![ZERO; nh], vec![ZERO; nh]);
        let mut tangent = vec![0.0; width * width];
        for (q, (contact, &penalty)) in self.contacts.iter().zip(&penalties).enumerate() {
            let w = &contact.w;
            let first = 2 * nh * n + width * q;
            let force = &state.force[q * nh..(q + 1) * nh];
            let c: Vec<Complex64> = (0..nh)
                .map(|k| (0..n).map(|i| state.x[k * n + i] * w[i]).sum::<Complex64>() - force[k] * contact.series)
                .collect();
            let wanted = jacobian.is_some().then_some(&mut tangent[..]);
            let law = (contact.law, penalty);
            apply(&mut self.alternation, law, state.omega, (&c, force), (&mut signal, &mut image), wanted);
            for k in 0..nh {
                let r = force[k] - image[k];
                (residual[first + 2 * k], residual[first + 2 * k + 1]) = (r.re, r.im);
                for i in (0..n).filter(|&i| w[i] != 0.0) {
                    let row = 2 * (k * n + i);
                    residual[row] += w[i] * force[k].re;
                    residual[row + 1] += w[i] * force[k].im;
                    let Some(jacobian) = jacobian.as_deref_mut() else { continue };
                    jacobian[row * size + first + 2 * k] += w[i];
                    jacobian[(row + 1) * size + first + 2 * k + 1] += w[i];
                }
            }
            let Some(jacobian) = jacobian.as_deref_mut() else { continue };
            for a in 0..width {
                let row = &mut jacobian[(first + a) * size..(first + a + 1) * size];
                row[first + a] += 1.0 + stay(self.alternation.harmonics[a / 2]);
                for (l, &h) in self.alternation.harmonics.iter().enumerate() {
                    let (x, y) = (tangent[a * width + 2 * l], tangent[a * width + 2 * l + 1]);
                    let by = |z: Complex64| (x * z.re + y * z.im, y * z.re - x * z.im);
                    let turn = Complex64::new(0.0, penalty * h as f64 * state.omega);
                    let (re, im) = by(1.0 - turn * contact.series);
                    row[first + 2 * l] -= re;
                    row[first + 2 * l + 1] -= im;
                    for i in (0..n).filter(|&i| w[i] != 0.0) {
                        let (re, im) = by(turn * w[i]);
                        row[2 * (l * n + i)] -= re;
                        row[2 * (l * n + i) + 1] -= im;
                    }
                    row[size - 2] -= by(turn * c[l] / state.omega).0;
                }
            }
        }
    }

    /// Units of the residual: elastic forces, slip limits; amplitude and phase are relative.
    pub(super) fn units(&self, start: &ModeState, a: f64) -> Vec<f64> {
        let stiffness = self
            .system
            .structure()
            .stiffness()
            .amax()
            .max(start.omega * start.omega * self.system.structure().mass().amax());
        let mut scale = vec![(stiffness * a).max(f64::MIN_POSITIVE); 2 * start.x.len()];
        let width = 2 * self.alternation.harmonics.len();
        scale.extend(self.contacts.iter().flat_map(|contact| vec![contact.law.limit; width]));
        scale.extend([1.0; 2]);
        scale
    }

    /// Solves at amplitude `a` from `start`, whose motion is scaled to it; forces along laws of velocity stay, as in slip.
    ///
    /// Newton's method as in forced vibration: the longest of the halved steps that comes closer, and where none does the whole one, which
    /// may lead out of a set of slipping samples that repeats, and over the amplitude at which two modes become one.
    pub fn solve(&mut self, start: &ModeState, before: f64, a: f64) -> Option<ModeState> {
        let size = self.size();
        let mut start = start.clone();
        start.x.iter_mut().for_each(|x| *x *= a / before);
        let mut state = start.clone();
        let (mut residual, mut jacobian) = (vec![0.0; size], vec![0.0; size * size]);
        let scale = self.units(&start, a);
        let norm = |r: &[f64]| r.iter().zip(&scale).map(|(r, s)| (r / s) * (r / s)).sum::<f64>().sqrt();
        self.evaluate(&state, (&start, a), &mut residual, Some(&mut jacobian));
        let mut now = norm(&residual);
        for _ in 0..ITERATIONS {
            if now <= SOLVED {
                return Some(state);
            }
            for (row, scale) in scale.iter().enumerate() {
                residual[row] /= scale;
                jacobian[row * size..(row + 1) * size].iter_mut().for_each(|x| *x /= scale);
            }
            if !dense::solve(&mut jacobian, size, &mut residual) {
                return None;
            }
            let step = residual.clone();
            let mut fraction = 1.0;
            for halving in 0..=HALVINGS + 1 {
                if halving > HALVINGS {
                    if now <= ROUNDED {
                        return Some(state);
                    }
                    fraction = 1.0;
                }
                let mut trial = state.clone();
                for (value, d) in trial.x.iter_mut().chain(&mut trial.force).zip(step.chunks_exact(2)) {
                    *value -= Complex64::new(d[0], d[1]) * fraction;
                }
                trial.omega -= step[size - 2] * fraction;
                trial.damping -= step[size - 1] * fraction;
                let mut after = f64::INFINITY;
                if trial.omega > 0.0 {
                    self.evaluate(&trial, (&start, a), &mut residual, Some(&mut jacobian));
                    after = norm(&residual);
                }
                let whole = halving > HALVINGS && after.is_finite();
                if after < (1.0 - SHORTENS * fraction) * now || whole {
                    (state, now) = (trial, after);
                    break;
                }
                if halving > HALVINGS {
                    return None;
                }
                fraction *= 0.5;
            }
        }
        (now <= ROUNDED).then_some(state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, CoulombArctan, Jenkins, JenkinsArctan, SharedLaw};
    use crate::model::{GROUND, Joint, Mass, Model, Spring};
    use std::sync::Arc;

    /// A row of masses with a joint of every law.
    fn mixed() -> System {
        let laws: [SharedLaw; 4] = [
            Arc::new(Jenkins { stiffness: 2.0, limit: 0.3 }),
            Arc::new(Coulomb { limit: 0.2 }),
            Arc::new(CoulombArctan { limit: 0.25, alpha: 5.0 }),
            Arc::new(JenkinsArctan { stiffness: 3.0, limit: 0.2, alpha: 8.0 }),
        ];
        let name = |i: usize| format!("m{i}");
        let mut model = Model::default();
        for i in 0..=laws.len() {
            model.masses.push(Mass::new(name(i), 1.0 + 0.1 * i as f64));
            model.springs.push(Spring { between: [name(i), GROUND.into()], stiffness: 1.0, damping: 0.05 });
        }
        for (i, law) in laws.into_iter().enumerate() {
            model.joints.push(Joint { name: format!("j{i}"), between: [name(i), name(i + 1)], law });
        }
        model.assemble().unwrap()
    }

    /// The derivative agrees with differences by every unknown. By ω, the equations of the forces are left out: their derivative takes ε
    /// for constant.
    #[test]
    fn the_derivative_agrees_with_differences() {
        let system = mixed();
        let mut equations = ModeEquations::new(&system, 5, 512).unwrap();
        let start = equations.linear(&equations.linear_modes()[1], 1.0).unwrap();
        let mut state = start.clone();
        for (i, value) in state.x.iter_mut().chain(&mut state.force).enumerate() {
            *value += Complex64::from_polar(0.3 / (1.0 + (i / 5) as f64), 1.7 * i as f64);
        }
        state.damping = 0.03;
        let size = equations.size();
        let (mut residual, mut jacobian) = (vec![0.0; size], vec![0.0; size * size]);
        equations.evaluate(&state, (&start, 1.0), &mut residual, Some(&mut jacobian));
        let motions = 2 * state.x.len();
        let step = 1e-6;
        // a turning point is taken to move with the motion at its time, and not with the parabola through three samples that finds it
        let parabola = (5.0 * std::f64::consts::TAU / 512.0f64).powi(3);
        let largest = jacobian.iter().fold(0.0, |m: f64, j| m.max(j.abs()));
        for column in 0..size {
            let mut sides = [vec![0.0; size], vec![0.0; size]];
            for (side, sign) in sides.iter_mut().zip([1.0, -1.0]) {
                let mut moved = state.clone();
                let mut unknowns: Vec<&mut f64> = Vec::with_capacity(size);
                for value in moved.x.iter_mut().chain(&mut moved.force) {
                    unknowns.extend([&mut value.re, &mut value.im]);
                }
                unknowns.extend([&mut moved.omega, &mut moved.damping]);
                *unknowns[column] += sign * step;
                equations.evaluate(&moved, (&start, 1.0), side, None);
            }
            for row in 0..size {
                if column == size - 2 && (motions..size - 2).contains(&row) {
                    continue;
                }
                let difference = (sides[0][row] - sides[1][row]) / (2.0 * step);
                let given = jacobian[row * size + column];
                assert!((difference - given).abs() < parabola * largest, "{row} {column}: {difference} {given}");
            }
        }
    }
}
