//! The excitation at one frequency, as functions of time.

use crate::model::{Axis, System};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

/// The excitation at one frequency.
#[derive(Debug, Clone, Default)]
pub(crate) struct HarmonicExcitation {
    /// Excitation frequency Ω, rad/s.
    pub omega: f64,
    /// Frequencies hΩ of the harmonics that occur, rad/s, in rising order.
    pub rates: Vec<f64>,
    /// Force amplitudes by harmonic, N.
    pub forces: Vec<DVector<Complex64>>,
    /// Constant force, N.
    pub constant: DVector<f64>,
    /// Imposed relative motion by harmonic and contact, m, without its constant part.
    pub imposed: Vec<Vec<Complex64>>,
    /// Constant part of the imposed motion, m. It affects only laws that depend on position,
    /// not friction.
    pub offset: Vec<f64>,
}

impl HarmonicExcitation {
    /// Collects the excitation. `contacts` gives, for each contact (a slider or an axis), the
    /// index of its axis among the axes of all joints.
    pub fn new(system: &System, contacts: &[usize], omega: f64) -> Self {
        let n = system.dofs();
        let excitation = system.excitation(omega);
        let mut harmonics: Vec<u32> = excitation.iter().map(|(h, _)| *h).collect();
        harmonics.extend(system.axes().flat_map(|(_, axis)| axis.imposed()).map(|(h, _)| *h));
        harmonics.extend(system.moved_places().iter().flat_map(|place| place.motion.iter().map(|(h, _)| *h)));
        harmonics.sort_unstable();
        harmonics.dedup();
        harmonics.retain(|&h| h > 0);
        let force_at = |h: u32| excitation.iter().find(|(k, _)| *k == h).map(|(_, f)| f.clone());
        let zero = || DVector::from_element(n, Complex64::new(0.0, 0.0));
        let axes: Vec<&Axis> = system.axes().map(|(_, axis)| axis).collect();
        let imposed_at = |h: u32| -> Vec<Complex64> { contacts.iter().map(|&axis| axes[axis].imposed_at(h)).collect() };
        HarmonicExcitation {
            omega,
            rates: harmonics.iter().map(|&h| f64::from(h) * omega).collect(),
            forces: harmonics.iter().map(|&h| force_at(h).unwrap_or_else(zero)).collect(),
            constant: force_at(0).map_or_else(|| DVector::zeros(n), |f| f.map(|z| z.re)),
            imposed: harmonics.iter().map(|&h| imposed_at(h)).collect(),
            offset: imposed_at(0).iter().map(|g| g.re).collect(),
        }
    }

    /// Collects the excitation at this frequency; at zero, only the constant forces.
    pub fn at(system: &System, contacts: &[usize], omega: f64) -> Self {
        let mut excitation = HarmonicExcitation::new(system, contacts, omega);
        if omega == 0.0 {
            excitation.rates.clear();
            excitation.forces.clear();
            excitation.imposed.clear();
        }
        excitation
    }

    /// Returns the excitation with all harmonics multiplied by `share`; the constant parts stay.
    pub fn scaled(&self, share: f64) -> Self {
        let mut scaled = self.clone();
        scaled.forces.iter_mut().for_each(|force| *force *= Complex64::new(share, 0.0));
        scaled.imposed.iter_mut().flatten().for_each(|motion| *motion *= share);
        scaled
    }

    /// Returns the square root of an energy that the loads can supply to a structure with these
    /// matrices, √J. It scales vibrations near rest. Constant forces count only if no other
    /// force acts.
    pub fn energy_scale(&self, mass: &DMatrix<f64>, stiffness: &DMatrix<f64>) -> f64 {
        let held = |i: usize| stiffness[(i, i)].max(self.omega * self.omega * mass[(i, i)]).sqrt();
        let energy = |force: &dyn Fn(usize) -> f64| (0..mass.nrows()).map(|i| force(i) / held(i)).sum::<f64>();
        let moving = energy(&|i| self.forces.iter().map(|f| f[i].norm()).sum());
        if moving > 0.0 { moving } else { energy(&|i| self.constant[i].abs()) }
    }

    /// Returns the largest velocity among the imposed relative motions, m/s.
    pub fn imposed_velocity(&self) -> f64 {
        let rates = self.imposed.iter().zip(&self.rates);
        rates.flat_map(|(g, rate)| g.iter().map(move |g| g.norm() * rate)).fold(0.0, f64::max)
    }

    /// Adds the k-th time derivative of the force at `time` to `out`.
    pub fn add_force(&self, time: f64, derivative: u32, out: &mut DVector<f64>) {
        if derivative == 0 {
            *out += &self.constant;
        }
        for (rate, force) in self.rates.iter().zip(&self.forces) {
            let turn = phasor(*rate, time, derivative);
            for (o, f) in out.iter_mut().zip(force.iter()) {
                *o += (f * turn).re;
            }
        }
    }

    /// Returns the imposed relative displacement of a contact, with its constant part, and its
    /// velocity.
    pub fn relative_at(&self, contact: usize, time: f64) -> (f64, f64) {
        let mut out = (self.offset[contact], 0.0);
        for (rate, imposed) in self.rates.iter().zip(&self.imposed) {
            let g = imposed[contact];
            if g != Complex64::ZERO {
                let (sin, cos) = (rate * time).sin_cos();
                out.0 += g.re * cos - g.im * sin;
                out.1 -= rate * (g.re * sin + g.im * cos);
            }
        }
        out
    }

    /// Writes the loads at `time` into `out`, length n.
    pub fn load(&self, time: f64, out: &mut [f64]) {
        out.copy_from_slice(self.constant.as_slice());
        for (rate, force) in self.rates.iter().zip(&self.forces) {
            let (sin, cos) = (rate * time).sin_cos();
            out.iter_mut().zip(force.iter()).for_each(|(o, f)| *o += f.re * cos - f.im * sin);
        }
    }

    /// Returns the k-th time derivative of the imposed motion of a contact, without its
    /// constant part.
    pub fn imposed_at(&self, contact: usize, time: f64, derivative: u32) -> f64 {
        let moving = self.rates.iter().zip(&self.imposed).filter(|(_, g)| g[contact] != Complex64::new(0.0, 0.0));
        moving.map(|(rate, g)| (g[contact] * phasor(*rate, time, derivative)).re).sum()
    }
}

/// Returns `(jω)^k e^{jωt}`.
fn phasor(rate: f64, time: f64, derivative: u32) -> Complex64 {
    let (sin, cos) = (rate * time).sin_cos();
    let turn = Complex64::new(cos, sin);
    if derivative == 0 { turn } else { turn * Complex64::new(0.0, rate).powu(derivative) }
}
