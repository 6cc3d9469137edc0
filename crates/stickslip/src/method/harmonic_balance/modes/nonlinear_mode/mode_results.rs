//! Results of a point of a nonlinear mode: shape at the places, modal assurance, damping by
//! dampers.

use super::{ModeEquations, ModeState, ZERO};
use crate::model::Axis;
use num_complex::Complex64;
use std::f64::consts::TAU;
use stickslip_numerics::golden_section::golden_section;

/// Returns half the range of a sum of harmonics, each with its number.
fn half_range(terms: &[(f64, Complex64)]) -> f64 {
    let value = |t: f64| terms.iter().map(|(h, x)| (x * Complex64::from_polar(1.0, h * t)).re).sum::<f64>();
    let highest = terms.iter().map(|(h, _)| *h).fold(1.0, f64::max);
    // Samples per wave of the highest harmonic in which the extremes of a motion are bracketed.
    let count = (16.0 * highest) as usize;
    let step = TAU / count as f64;
    let end = |sign: f64| {
        let sampled = (0..count).map(|i| (i, sign * value(i as f64 * step)));
        let (top, best) = sampled.fold((0, f64::NEG_INFINITY), |a, b| if b.1 > a.1 { b } else { a });
        let bracket = ((top as f64 - 1.0) * step, (top as f64 + 1.0) * step);
        // Accuracy of the extremes, relative to the sample spacing.
        let found = golden_section(bracket, |a, b| b - a <= 1e-6 * step, |t| Ok::<f64, ()>(sign * value(t)));
        found.map_or(best, |found| found.1.max(best))
    };
    0.5 * (end(1.0) + end(-1.0))
}

impl ModeEquations<'_> {
    /// Returns the mass inner product `xᴴ M y` of two shapes.
    fn mass_inner_product(&self, x: &[Complex64], y: &[Complex64]) -> Complex64 {
        let (n, mass) = (self.system.dofs(), self.system.structure().mass());
        let mut sum = ZERO;
        for i in 0..n {
            for l in 0..n {
                sum += x[i].conj() * y[l] * mass[(i, l)];
            }
        }
        sum
    }

    /// Returns the modal assurance criterion of two motions: their first harmonics in the mass
    /// inner product, from 0 to 1.
    pub fn modal_assurance(&self, one: &ModeState, other: &ModeState) -> f64 {
        let (one, other) = (self.first_harmonic(one), self.first_harmonic(other));
        let squares = [one, other].map(|x| self.mass_inner_product(x, x).re);
        self.mass_inner_product(one, other).norm_sqr() / (squares[0] * squares[1])
    }

    /// Returns whether the first harmonic is the largest part of the vibration.
    pub fn is_mainly_first_harmonic(&self, state: &ModeState) -> bool {
        let n = self.system.dofs();
        let moving = state.x.chunks_exact(n).zip(&self.aft.harmonics).filter(|(_, h)| **h > 0);
        let (mut first, mut others) = (0.0, 0.0);
        for (x, h) in moving {
            *(if *h == 1 { &mut first } else { &mut others }) += self.mass_inner_product(x, x).re;
        }
        first >= others
    }

    /// Returns the contribution of the viscous dampers to the damping ratio. It is the energy
    /// that they dissipate per cycle relative to the energy that `2 ζ ω M` supplies for ζ = 1.
    pub fn viscous_damping_ratio(&self, state: &ModeState) -> f64 {
        let (n, mut dissipated, mut whole) = (self.system.dofs(), 0.0, 0.0);
        for (k, &h) in self.aft.harmonics.iter().enumerate() {
            for i in 0..n {
                for l in 0..n {
                    let pair = (state.x[k * n + i].conj() * state.x[k * n + l]).re * (h * h) as f64;
                    dissipated += pair * self.system.structure().damping()[(i, l)];
                    whole += pair * self.system.structure().mass()[(i, l)];
                }
            }
        }
        dissipated / (2.0 * state.omega * whole)
    }

    /// Returns the first harmonic of every place, m.
    pub fn places(&self, state: &ModeState) -> Vec<Complex64> {
        self.at_places(self.first_harmonic(state))
    }

    /// Returns half the range of motion of every place, m.
    pub fn half_ranges(&self, state: &ModeState) -> Vec<f64> {
        let n = self.system.dofs();
        let series: Vec<Vec<Complex64>> = state.x.chunks_exact(n).map(|x| self.at_places(x)).collect();
        let harmonics = &self.aft.harmonics;
        let of_place = |place: usize| {
            let terms: Vec<(f64, Complex64)> =
                harmonics.iter().zip(&series).map(|(h, places)| (*h as f64, places[place])).collect();
            half_range(&terms)
        };
        (0..self.system.place_axes().len()).map(of_place).collect()
    }

    /// Returns the displacements of the places from the motion of all degrees of freedom.
    pub fn at_places(&self, x: &[Complex64]) -> Vec<Complex64> {
        let at = |place: &Axis| place.rows().iter().map(|(row, weight)| x[*row] * *weight).sum();
        self.system.place_axes().iter().map(at).collect()
    }

    /// Returns a measure of how real the shape is: `|X₁ᵀ M X₁| / X₁ᴴ M X₁`.
    ///
    /// It is one if all places move in phase or in opposite phase. It is zero if two modes of
    /// the symmetric complex eigenvalue problem of the first harmonic coalesce: their shape is
    /// orthogonal to itself.
    ///
    /// Source: Heiss (2012), "The physics of exceptional points".
    pub fn phase_collinearity(&self, state: &ModeState) -> f64 {
        let x = self.first_harmonic(state);
        let conjugate: Vec<Complex64> = x.iter().map(Complex64::conj).collect();
        self.mass_inner_product(&conjugate, x).norm() / self.mass_inner_product(x, x).re
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_range_uses_all_harmonics() {
        let of = |third: f64| half_range(&[(1.0, Complex64::new(0.0, -2.0)), (3.0, Complex64::new(0.0, third))]);
        // 2 sin t - sin(3t)/5 has its maximum at 90 degrees; 2 sin t + sin(3t) has it at sin² t
        // = 5/12, with the value (5 - 5/3) sin t
        assert!((of(0.2) - 2.2).abs() < 1e-12, "{}", of(0.2));
        let expected = (10.0 / 3.0) * (5.0f64 / 12.0).sqrt();
        assert!((of(-1.0) - expected).abs() < 1e-12, "{} {expected}", of(-1.0));
        // a mean is not part of the motion
        let with_mean = half_range(&[(0.0, Complex64::new(5.0, 0.0)), (1.0, Complex64::new(3.0, 4.0))]);
        assert!((with_mean - 5.0).abs() < 1e-12, "{with_mean}");
    }
}
