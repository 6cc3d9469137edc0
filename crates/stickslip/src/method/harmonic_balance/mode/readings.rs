//! What is read off a point of a nonlinear mode: its shape at the places, how like it is to another, how real, how damped by dampers.

use super::{ModeEquations, ModeState, ZERO};
use crate::model::Axis;
use num_complex::Complex64;

impl ModeEquations<'_> {
    /// `xᴴ M y` of two shapes.
    fn in_masses(&self, x: &[Complex64], y: &[Complex64]) -> Complex64 {
        let (n, mass) = (self.system.dofs(), self.system.structure().mass());
        let mut sum = ZERO;
        for i in 0..n {
            for l in 0..n {
                sum += x[i].conj() * y[l] * mass[(i, l)];
            }
        }
        sum
    }

    /// Modal assurance of two motions: how much of one first harmonic is in the other, in the mass inner product, from 0 to 1.
    pub fn assurance(&self, one: &ModeState, other: &ModeState) -> f64 {
        let (one, other) = (self.first(one), self.first(other));
        let squares = [one, other].map(|x| self.in_masses(x, x).re);
        self.in_masses(one, other).norm_sqr() / (squares[0] * squares[1])
    }

    /// The inner product of two changes of motion in the masses, all harmonics together.
    pub(super) fn kinetic(&self, one: &[f64], other: &[f64]) -> f64 {
        let n = self.system.dofs();
        let shape = |parts: &[f64]| -> Vec<Complex64> {
            parts.chunks_exact(2).map(|part| Complex64::new(part[0], part[1])).collect()
        };
        let harmonics = one.chunks_exact(2 * n).zip(other.chunks_exact(2 * n));
        harmonics.map(|(one, other)| self.in_masses(&shape(one), &shape(other)).re).sum()
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

    /// First harmonic of every place, m.
    pub fn places(&self, state: &ModeState) -> Vec<Complex64> {
        self.at_places(self.first(state))
    }

    /// What the places see of a motion of all degrees of freedom.
    pub fn at_places(&self, x: &[Complex64]) -> Vec<Complex64> {
        let at = |place: &Axis| place.rows().iter().map(|(row, weight)| x[*row] * *weight).sum();
        self.system.seen().iter().map(at).collect()
    }

    /// How real the shape is: `|X₁ᵀ M X₁| / X₁ᴴ M X₁`, one if all places move in phase or against each other. Where two modes of the symmetric
    /// complex eigenvalue problem that the first harmonic solves become one, it is zero: their shape is orthogonal to itself.
    /// Source: Heiss (2012), "The physics of exceptional points".
    pub fn rigidity(&self, state: &ModeState) -> f64 {
        let x = self.first(state);
        let conjugate: Vec<Complex64> = x.iter().map(Complex64::conj).collect();
        self.in_masses(&conjugate, x).norm() / self.in_masses(x, x).re
    }
}
