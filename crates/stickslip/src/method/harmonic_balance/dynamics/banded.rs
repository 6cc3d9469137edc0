//! Banded form of large systems with local coupling: the receptance along the joints is not
//! formed, its products are banded solutions.
//!
//! With the dynamic stiffness `Z` and the derivative `K` of the joint forces, the Newton step
//! of `c + R f - c_lin = r`, `R = Wᵀ Z⁻¹ W`, is `(1 + R K)⁻¹ r = r - Wᵀ (Z + W K Wᵀ)⁻¹ W K r`
//! (Woodbury). `Z + W K Wᵀ` has the band of the structure. Unknown forces of laws of velocity
//! border it, as if each contact were one more place: `Z y - W δλ = 0` and
//! `(1 - T) δλ + T (ε D + κ) Wᵀ y = r`, with the time derivative `D` and κ for the mean alone.

use crate::method::harmonic_balance::aft::Ports;
use crate::method::harmonic_balance::equations::contact_parameter::ContactParameters;
use crate::method::harmonic_balance::equations::homotopy::Homotopy;
use crate::method::harmonic_balance::equations::regularization::REGULARIZING_FREQUENCY;
use crate::model::System;
use num_complex::Complex64;
use stickslip_numerics::banded::{BandedMatrix, cuthill_mckee};

/// Number of degrees of freedom from which a search begins without friction. Describing
/// functions would solve the whole structure with dense matrices.
pub(crate) const DESCRIBING_DOFS: usize = 40;

/// Parameters of the linearized equations, in addition to the tangents.
pub(crate) struct StepParameters<'a> {
    /// Parameters of the force equations, per port.
    pub contacts: &'a [ContactParameters],
    /// Parameters of the homotopy.
    pub homotopy: Homotopy,
}

/// The banded form of a system at one excitation frequency.
#[derive(Debug, Clone)]
pub(crate) struct BandedForm {
    n: usize,
    /// Bandwidth, and the order of elimination of places and unknown forces.
    band: usize,
    position: Vec<usize>,
    /// Entries of (mass, damping, stiffness) that are not all zero.
    entries: Vec<(usize, usize, [f64; 3])>,
    /// Per axis: number of its unknown force, counted after the places.
    forces: Vec<Option<usize>>,
    /// Per axis: (place, direction).
    ends: Vec<Vec<(usize, f64)>>,
    /// Stiffness of closed contacts along the axes for the mean, N/m; or empty.
    springs: Vec<f64>,
    harmonics: Vec<f64>,
    omega: f64,
    /// Z per harmonic, factored.
    factors: Vec<BandedMatrix>,
    step_factor: BandedMatrix,
    /// The structure at a real rate.
    real_rate_factor: BandedMatrix,
    right: Vec<f64>,
    whole: Vec<f64>,
}

impl BandedForm {
    /// Creates the banded form. `None` for a small system, springs in series, modal damping, or
    /// a solution on one sector. `None` also if elimination of a full matrix over the joints is
    /// faster: they are few, or they couple many places.
    pub fn new(system: &System, ports: &Ports, harmonics: &[usize]) -> Option<Self> {
        let n = system.dofs();
        // Number of degrees of freedom from which the banded form is considered.
        if n < 16 || ports.wave().is_some() || ports.iter().any(|port| port.series_compliance > 0.0) {
            return None;
        }
        if system.structure().damped_modes().is_some() {
            return None; // it couples all places
        }
        let entries: Vec<(usize, usize, [f64; 3])> = system.structure().entries().collect();
        let ends: Vec<Vec<(usize, f64)>> = (0..ports.count()).map(|q| ports.axis(system, q).rows().to_vec()).collect();
        // cost of elimination in the band and along the joints, both without
        // the factor (2 × harmonics)³
        let along = (ends.len() as f64).powi(3) / 3.0;
        let is_dearer = |whole: usize, band: usize| whole as f64 * ((band + 1) as f64).powi(2) > along;
        let widest = ports.iter().map(|port| port.range().map(|q| ends[q].len()).max().unwrap_or(0)).max();
        if is_dearer(n, widest.unwrap_or(0).saturating_sub(1)) {
            return None; // no band is narrower than the coupling of one joint
        }
        let mut links: Vec<(usize, usize)> = entries.iter().map(|(i, k, _)| (*i, *k)).collect();
        let mut unknown = 0;
        let mut forces = vec![None; ends.len()];
        for port in ports.iter() {
            // a port couples all its places and its forces
            let mut touched: Vec<usize> = port.range().flat_map(|q| &ends[q]).map(|(i, _)| *i).collect();
            if port.is_force() {
                for q in port.range() {
                    forces[q] = Some(n + unknown);
                    touched.push(n + unknown);
                    unknown += 1;
                }
            }
            links.extend(touched.iter().flat_map(|a| touched.iter().map(|b| (*a, *b))));
        }
        let whole = n + unknown;
        let position = cuthill_mckee(whole, &links);
        let band = links.iter().map(|&(a, b)| position[a].abs_diff(position[b])).max().unwrap_or(0);
        if is_dearer(whole, band) {
            return None;
        }
        let nh = harmonics.len();
        let (factor, tangent) = BandedForm::sizes(whole, band, nh);
        Some(BandedForm {
            n,
            band,
            position,
            entries,
            forces,
            ends,
            springs: Vec::new(),
            harmonics: harmonics.iter().map(|h| *h as f64).collect(),
            omega: 0.0,
            factors: vec![BandedMatrix::new(factor.0, factor.1); nh],
            real_rate_factor: BandedMatrix::new(whole, band),
            step_factor: BandedMatrix::new(tangent.0, tangent.1),
            right: vec![0.0; 2 * whole],
            whole: vec![0.0; 2 * whole * nh],
        })
    }

    /// Returns the memory of the banded form with a number of harmonics, bytes.
    pub fn memory(&self, harmonics: usize) -> f64 {
        let (factor, tangent) = BandedForm::sizes(self.right.len() / 2, self.band, harmonics);
        harmonics as f64 * BandedMatrix::bytes(factor.0, factor.1) + BandedMatrix::bytes(tangent.0, tangent.1)
    }

    /// Returns the multiplications in the elimination of a step with a number of harmonics.
    pub fn work(&self, harmonics: usize) -> f64 {
        let (_, (rows, band)) = BandedForm::sizes(self.right.len() / 2, self.band, harmonics);
        rows as f64 * (band as f64).powi(2)
    }

    /// Returns rows and bandwidth, first of the factor of a harmonic, then of
    /// the tangent, for `whole` places and unknown forces.
    fn sizes(whole: usize, band: usize, harmonics: usize) -> ((usize, usize), (usize, usize)) {
        ((2 * whole, 2 * band + 1), (2 * whole * harmonics, (band + 1) * 2 * harmonics - 1))
    }

    /// Sets the stiffness of closed contacts, for the mean.
    pub fn set_closed_contacts(&mut self, springs: &[f64]) {
        self.springs.clear();
        self.springs.extend(springs);
    }

    /// Returns the entries of these springs in the stiffness: positions of row and column, value.
    fn closed(&self) -> Vec<(usize, usize, f64)> {
        let pairs = |ends: &[(usize, f64)]| {
            let all = ends.iter().flat_map(|a| ends.iter().map(move |b| (*a, *b)));
            all.map(|((i, w), (l, v))| (self.position[i], self.position[l], w * v)).collect::<Vec<_>>()
        };
        let springs = self.ends.iter().zip(&self.springs);
        springs.flat_map(|(ends, k)| pairs(ends).into_iter().map(move |(i, l, w)| (i, l, w * k))).collect()
    }

    /// Factors the dynamic stiffness at an excitation frequency.
    ///
    /// # Errors
    /// Returns the frequency, rad/s, of a harmonic at which it is singular.
    pub fn factor_dynamic_stiffness(&mut self, omega: f64) -> Result<(), f64> {
        self.omega = omega;
        let closed = self.closed();
        for (k, factor) in self.factors.iter_mut().enumerate() {
            factor.clear();
            let rate = self.harmonics[k] * omega;
            for &(i, l, entry) in &self.entries {
                let (row, column) = (2 * self.position[i], 2 * self.position[l]);
                let z = dynamic(entry, rate, omega);
                factor.add(row, column, z.re);
                factor.add(row, column + 1, -z.im);
                factor.add(row + 1, column, z.im);
                factor.add(row + 1, column + 1, z.re);
            }
            for &(row, column, stiffness) in closed.iter().filter(|_| rate == 0.0) {
                factor.add(2 * row, 2 * column, stiffness);
                factor.add(2 * row + 1, 2 * column + 1, stiffness);
            }
            // unknown forces have rows of the identity here
            for &force in self.forces.iter().flatten() {
                let at = 2 * self.position[force];
                factor.add(at, at, 1.0);
                factor.add(at + 1, at + 1, 1.0);
            }
            if !factor.factor() {
                return Err(rate);
            }
        }
        Ok(())
    }

    /// Computes the displacements of all places at harmonic number `k` of the
    /// list, under the forces `values(place)`, into `out`.
    pub fn respond(&mut self, k: usize, values: impl Fn(usize) -> Complex64, out: &mut [Complex64]) {
        self.right.fill(0.0);
        for i in 0..self.n {
            let f = values(i);
            (self.right[2 * self.position[i]], self.right[2 * self.position[i] + 1]) = (f.re, f.im);
        }
        self.factors[k].solve(&mut self.right);
        for i in 0..self.n {
            out[i] = Complex64::new(self.right[2 * self.position[i]], self.right[2 * self.position[i] + 1]);
        }
    }

    /// Computes the motion along the axes at harmonic number `k` under the
    /// forces `force(q)` along them, into `out`.
    pub fn response_along_axes(
        &mut self,
        k: usize,
        force: impl Fn(usize) -> Complex64,
        mut out: impl FnMut(usize, Complex64),
    ) {
        self.right.fill(0.0);
        for (q, ends) in self.ends.iter().enumerate() {
            let f = force(q);
            for &(i, w) in ends {
                self.right[2 * self.position[i]] += w * f.re;
                self.right[2 * self.position[i] + 1] += w * f.im;
            }
        }
        self.factors[k].solve(&mut self.right);
        for (q, ends) in self.ends.iter().enumerate() {
            let mut u = Complex64::new(0.0, 0.0);
            for &(i, w) in ends {
                let at = 2 * self.position[i];
                u += Complex64::new(self.right[at], self.right[at + 1]) * w;
            }
            out(q, u);
        }
    }

    /// Returns the receptances of the axes at the real rate `s`, 1/s, which is
    /// free of resonances, m/N.
    pub fn direct_receptances(&mut self, s: f64) -> Vec<f64> {
        self.real_rate_factor.clear();
        for &(i, l, [mass, damping, stiffness]) in &self.entries {
            let value = stiffness + s * damping + s * s * mass;
            self.real_rate_factor.add(self.position[i], self.position[l], value);
        }
        for &force in self.forces.iter().flatten() {
            self.real_rate_factor.add(self.position[force], self.position[force], 1.0);
        }
        if !self.real_rate_factor.factor() {
            return vec![0.0; self.ends.len()];
        }
        let mut right = vec![0.0; self.position.len()];
        self.ends
            .iter()
            .map(|ends| {
                right.fill(0.0);
                ends.iter().for_each(|&(i, w)| right[self.position[i]] += w);
                self.real_rate_factor.solve(&mut right);
                ends.iter().map(|&(i, w)| w * right[self.position[i]]).sum()
            })
            .collect()
    }

    /// Factors the equations of the Newton step. `tangents` contains K or T, one block per
    /// port. Returns false if they are singular.
    pub fn linearize(&mut self, ports: &Ports, along: &StepParameters, tangents: &[f64]) -> bool {
        let nh = self.harmonics.len();
        let size = 2 * nh;
        let (blocks, _) = crate::method::harmonic_balance::aft::tangent_ranges(ports, nh);
        self.step_factor.clear();
        for &(i, l, entry) in &self.entries {
            for k in 0..nh {
                let rate = self.harmonics[k] * self.omega;
                let (row, column) = (self.position[i] * size + 2 * k, self.position[l] * size + 2 * k);
                let z = dynamic(entry, rate, self.omega);
                self.step_factor.add(row, column, z.re);
                self.step_factor.add(row, column + 1, -z.im);
                self.step_factor.add(row + 1, column, z.im);
                self.step_factor.add(row + 1, column + 1, z.re);
            }
        }
        for (row, column, stiffness) in self.closed() {
            // for the mean, which is the first harmonic
            self.step_factor.add(row * size, column * size, stiffness);
            self.step_factor.add(row * size + 1, column * size + 1, stiffness);
        }
        for (p, port) in ports.iter().enumerate() {
            let tangent = &tangents[crate::method::harmonic_balance::aft::tangent_range(&blocks, p, port, nh)];
            let wide = size * port.axes;
            let contact = along.contacts[p];
            for (a, row) in tangent.chunks_exact(wide).enumerate() {
                let own = port.first_axis + a / size;
                let Some(force) = self.forces[own] else {
                    for &(i, w) in &self.ends[own] {
                        let at = self.position[i] * size + a % size;
                        for (other, row) in port.range().zip(row.chunks_exact(size)) {
                            for &(l, v) in &self.ends[other] {
                                let column = self.position[l] * size;
                                for (b, value) in row.iter().enumerate() {
                                    self.step_factor.add(at, column + b, w * v * value);
                                }
                            }
                        }
                    }
                    continue;
                };
                let at = self.position[force] * size + a % size;
                self.step_factor.add(at, at, 1.0 + along.homotopy.diagonal_term(self.harmonics[a % size / 2] as usize));
                for &(i, w) in &self.ends[own] {
                    self.step_factor.add(self.position[i] * size + a % size, at, -w);
                }
                for (other, row) in port.range().zip(row.chunks_exact(size)) {
                    let Some(force) = self.forces[other] else { continue };
                    let base = self.position[force] * size;
                    for (b, value) in row.iter().enumerate() {
                        self.step_factor.add(at, base + b, -value);
                    }
                    if contact.is_imposed() {
                        continue;
                    }
                    for &(i, w) in &self.ends[other] {
                        let column = self.position[i] * size;
                        for (k, &h) in self.harmonics.iter().enumerate() {
                            // T (ε jhΩ + κ)
                            let (re, im) = contact.row((row[2 * k], row[2 * k + 1]), h as usize, self.omega);
                            self.step_factor.add(at, column + 2 * k, re * w);
                            self.step_factor.add(at, column + 2 * k + 1, im * w);
                        }
                    }
                }
            }
        }
        self.step_factor.factor()
    }

    /// Replaces the residual by the Newton step, with the factored equations.
    /// Returns false if the step is not finite.
    pub fn step(&mut self, ports: &Ports, tangents: &[f64], residual: &mut [f64]) -> bool {
        let nh = self.harmonics.len();
        let size = 2 * nh;
        let (blocks, _) = crate::method::harmonic_balance::aft::tangent_ranges(ports, nh);
        self.whole.fill(0.0);
        for (p, port) in ports.iter().enumerate() {
            let tangent = &tangents[crate::method::harmonic_balance::aft::tangent_range(&blocks, p, port, nh)];
            let wide = size * port.axes;
            let r = &residual[port.first_axis * size..port.first_axis * size + wide];
            for (a, row) in tangent.chunks_exact(wide).enumerate() {
                let own = port.first_axis + a / size;
                if let Some(force) = self.forces[own] {
                    self.whole[self.position[force] * size + a % size] = r[a];
                    continue;
                }
                let pull: f64 = row.iter().zip(r).map(|(k, r)| k * r).sum();
                for &(i, w) in &self.ends[own] {
                    self.whole[self.position[i] * size + a % size] += w * pull;
                }
            }
        }
        self.step_factor.solve(&mut self.whole);
        for (q, ends) in self.ends.iter().enumerate() {
            for a in 0..size {
                match self.forces[q] {
                    Some(force) => residual[q * size + a] = self.whole[self.position[force] * size + a],
                    None => {
                        for &(i, w) in ends {
                            residual[q * size + a] -= w * self.whole[self.position[i] * size + a];
                        }
                    }
                }
            }
        }
        residual.iter().all(|r| r.is_finite())
    }
}

/// Returns an entry of the dynamic stiffness from those of mass, damping and
/// stiffness, at a harmonic's rate (rad/s).
fn dynamic([mass, damping, stiffness]: [f64; 3], rate: f64, omega: f64) -> Complex64 {
    // a direction without support has the soft spring of the dense form for its mean
    let hold = if rate == 0.0 { (REGULARIZING_FREQUENCY * omega).powi(2) } else { 0.0 };
    Complex64::new(stiffness - rate * rate * mass + hold * mass, rate * damping)
}

#[cfg(test)]
mod tests {
    use crate::law::Coulomb;
    use crate::method::{Method, harmonic_balance::HarmonicBalance};
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring, System};
    use std::f64::consts::TAU;
    use std::sync::Arc;

    /// Blades around a disk with rigid friction between adjacent blades, under
    /// engine-order forces. Springs differ by up to 1 %.
    fn ring(blades: usize, limit: f64) -> System {
        let name = |i: usize| format!("b{}", i % blades);
        let mut model = Model::default();
        for i in 0..blades {
            let stiffness = 1e5 * (1.0 + 0.01 * (1.7 * (i * i) as f64).sin());
            model.masses.push(Mass::new(name(i), 0.2));
            model.springs.push(Spring { between: [name(i), GROUND.into()], stiffness, damping: 0.1 });
            let phase = TAU * 3.0 * i as f64 / blades as f64;
            model.forces.push(Force { on: name(i), amplitude: 5.0, phase, harmonic: 1 });
            let law = Arc::new(Coulomb { limit });
            model.joints.push(Joint { name: format!("j{i}"), between: [name(i), name(i + 1)], law });
        }
        model.assemble().unwrap()
    }

    /// Engine-order forces sum to zero on blades that stick together. Their
    /// rounding must not request harmonics.
    #[test]
    fn a_ring_at_rest_needs_few_harmonics() {
        let system = ring(24, 1e15);
        let method = HarmonicBalance { tolerance: Some(1e-6), ..HarmonicBalance::default() };
        let orbit = method.solver(&system).unwrap().orbit(TAU * 110.1).unwrap();
        assert!(orbit.places.iter().all(|place| place.amplitude() < 1e-15), "{:?}", orbit.places);
        assert!(orbit.evidence.error_estimate.unwrap() < 1e-6, "{:?}", orbit.evidence);
    }

    /// The factor of the band would take 600 GB.
    #[test]
    fn bands_that_fill_the_memory_are_refused() {
        let method = HarmonicBalance { harmonics: Some(10_000), ..HarmonicBalance::default() };
        let system = ring(24, 10.0);
        let error = method.solver(&system).err().expect("too many harmonics").to_string();
        assert!(error.contains("harmonics need") && error.contains("GB"), "{error}");
    }
}
