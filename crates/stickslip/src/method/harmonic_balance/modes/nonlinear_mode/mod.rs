//! Equations of a nonlinear mode: periodic motion without excitation, about an equilibrium under
//! the constant forces F₀.
//!
//! `M x'' + (C - 2 ζ ω M) x' + K x + Σ W f = F₀`
//!
//! Friction and damping let a free motion decay. The artificial negative damping `2 ζ ω M`
//! makes it periodic, and ζ is the equivalent damping ratio. At ζ = 0 the motion is a
//! self-excited orbit.
//!
//! The unknowns are the harmonics of all places, the harmonics of the forces λ of the force
//! ports, ω and ζ. The modal amplitude `a` is given by `X₁ᴴ M X₁ = a²`. Forces have the same
//! equation as in forced vibration, `λ - P J(λ + ε c') = 0`. Behind a spring `k` the motion is
//! `c = wᵀx - λ/k`. Rigid friction is not smoothed, and a sticking contact is a constraint.
//!
//! Source: Krack (2015), "Nonlinear modal analysis of nonconservative systems: extension of the
//! periodic motion concept".
//!
//! - `linear_modes`: linear modes, where nonlinear modes begin
//! - `mode_results`: results of a point: shape, modal assurance, damping by dampers

mod linear_modes;
mod mode_results;

pub(crate) use linear_modes::{LinearMode, SmallMode};

use crate::method::MethodError;
use crate::method::harmonic_balance::aft::{FrequencyTime, Port, Ports};
use crate::method::harmonic_balance::equations::contact_parameter::ContactParameters;
use crate::method::harmonic_balance::equations::contact_parameter::contact_parameter;
use crate::method::harmonic_balance::equations::regularization::{LEAST_EPSILON_RATIO, force_regularization};
use crate::method::harmonic_balance::static_equilibrium::static_equilibrium_of;
use crate::model::System;
use nalgebra::DVector;
use num_complex::Complex64;
use stickslip_numerics::dense::{self, ProductShape, Transpose};

const ZERO: Complex64 = Complex64::new(0.0, 0.0);
/// Settings of Newton's method for a nonlinear mode.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ModeSettings {
    /// Newton iterations at one amplitude; 2 to 10 are usual.
    pub iterations: usize,
    /// Newton iterations of a step of the continuation. If they do not suffice, a shorter step is
    /// taken.
    pub step_iterations: usize,
    /// Residual, relative to the elastic forces and to the slip limits, at which a motion counts
    /// as periodic.
    pub tolerance: f64,
    /// Residual up to which an iteration that cannot reduce it, or has used its steps, counts as
    /// converged. A stiff joint between soft springs loses three digits to rounding.
    pub rounding: f64,
    /// Least motion that the residual is relative to, as a fraction of the static displacements.
    pub least_motion: f64,
    /// Stiffness of the springs of [`ModeEquations::hold_free_bodies`], relative to the inertia
    /// of the mode. The mean changes by this fraction.
    pub mean_springs: f64,
}

impl Default for ModeSettings {
    fn default() -> Self {
        ModeSettings {
            iterations: 60,
            step_iterations: 20,
            tolerance: 1e-11,
            rounding: 1e-8,
            least_motion: 1e-5,
            mean_springs: 1e-10,
        }
    }
}

/// Point of a nonlinear mode.
#[derive(Debug, Clone)]
pub(crate) struct ModeState {
    /// Harmonics of the places relative to the equilibrium, [harmonic][place], m: 1, 3, … if all
    /// laws are odd, otherwise 0, 1, 2, …
    pub x: Vec<Complex64>,
    /// Harmonics of the forces of force ports, [axis][harmonic], N.
    pub force: Vec<Complex64>,
    /// Frequency, rad/s.
    pub omega: f64,
    /// Equivalent damping ratio ζ.
    pub damping: f64,
}

/// Equations of a nonlinear mode.
pub(crate) struct ModeEquations<'a> {
    pub(crate) system: &'a System,
    /// Motion ports.
    pub(super) motion_ports: Vec<PlacedPort>,
    /// Force ports. Their axes have separate numbers.
    pub(super) force_ports: Vec<PlacedPort>,
    pub(super) aft: FrequencyTime,
    /// Index of the first harmonic.
    first: usize,
    /// True if constant forces act.
    has_constant_forces: bool,
    /// Displacements in equilibrium under them, m.
    equilibrium: DVector<f64>,
    /// Forces on the structure without joints in this equilibrium, `K x - F₀`, N.
    joint_loads: DVector<f64>,
    /// Square of the rate, (rad/s)², of springs between the mean and the equilibrium; see
    /// [`ModeEquations::hold_free_bodies`].
    mean_springs: f64,
    /// True if motions may be mixtures of two modes of equal frequency, so that the equations
    /// may be singular.
    pub may_be_singular: bool,
}

/// Port with the directions of its axes in the structure.
pub(super) struct PlacedPort {
    pub port: Port,
    pub directions: Vec<DVector<f64>>,
}

impl PlacedPort {
    /// Returns the motions along the axes, [axis][harmonic], from those of the places.
    fn along(&self, x: &[Complex64], nh: usize) -> Vec<Complex64> {
        let one = |w: &DVector<f64>, k: usize| -> Complex64 {
            x[k * w.len()..(k + 1) * w.len()].iter().zip(w.iter()).map(|(x, w)| x * *w).sum()
        };
        self.directions.iter().flat_map(|w| (0..nh).map(move |k| one(w, k))).collect()
    }

    /// Converts a row of derivatives by the motions along the axes, [axis][harmonic] with real
    /// and imaginary parts, to those by the places, [harmonic][place]. Further entries of
    /// `by_places` are zero.
    fn by_places(&self, by_axes: &[f64], by_places: &mut [f64]) {
        by_places.fill(0.0);
        let width = by_axes.len() / self.directions.len();
        for (w, by_axis) in self.directions.iter().zip(by_axes.chunks_exact(width)) {
            let n = w.len();
            // most axes of models of masses move one or two places
            for (place, w) in w.iter().enumerate().filter(|(_, w)| **w != 0.0) {
                for (slope, places) in by_axis.chunks_exact(2).zip(by_places.chunks_exact_mut(2 * n)) {
                    places[2 * place] += w * slope[0];
                    places[2 * place + 1] += w * slope[1];
                }
            }
        }
    }
}

impl<'a> ModeEquations<'a> {
    /// Makes the equations.
    ///
    /// # Errors
    /// A law with several directions, a place without mass, a mass matrix that is not positive
    /// definite.
    pub fn new(system: &'a System, harmonics: usize, samples: usize) -> Result<Self, MethodError> {
        if let Some(error) = MethodError::too_large("modes", system) {
            return Err(error);
        }
        if let Some(massless) = (0..system.dofs()).find(|&i| system.structure().diagonal_mass(i) == 0.0) {
            return Err(MethodError::needs_mass(crate::method::harmonic_balance::NAME, system, massless));
        }
        if !system.structure().has_definite_mass() {
            return Err(MethodError::mass_not_positive(crate::method::harmonic_balance::NAME));
        }
        let mut ports = Ports::new(system)?;
        let constant = system.constant_forces();
        let has_constant_forces = constant.amax() > 0.0;
        let mut equilibrium = DVector::zeros(system.dofs());
        if has_constant_forces && let Some(found) = static_equilibrium_of(system) {
            equilibrium.copy_from_slice(&found.orbit.initial_state[..system.dofs()]);
            ports.set_static_states(&found.states);
        }
        let (mut elastic, mut contacts): (Vec<PlacedPort>, Vec<PlacedPort>) = (Vec::new(), Vec::new());
        for port in ports.iter() {
            let w: Vec<DVector<f64>> = port.range().map(|q| ports.axis(system, q).dense(system.dofs())).collect();
            if !port.is_force() {
                elastic.push(PlacedPort { port: port.clone(), directions: w });
            } else if w.iter().any(|w| w.amax() > 0.0) {
                // a contact between imposed places exerts no force on the structure, and the
                // mode does not move it
                let first = contacts.last().map_or(0, |last| last.port.first_axis + last.port.axes);
                let mut port = port.clone();
                port.first_axis = first;
                contacts.push(PlacedPort { port, directions: w });
            }
        }
        let joint_loads = system.structure().stiffness() * &equilibrium - constant;
        let odd = !has_constant_forces && system.joints().iter().all(|joint| joint.law().is_odd());
        let list: Vec<usize> = if odd { (1..=harmonics).step_by(2).collect() } else { (0..=harmonics).collect() };
        let mut aft = FrequencyTime::new(list, samples);
        aft.by_frequency = Some(Vec::new());
        Ok(ModeEquations {
            system,
            motion_ports: elastic,
            force_ports: contacts,
            aft,
            first: usize::from(!odd),
            has_constant_forces,
            equilibrium,
            joint_loads,
            mean_springs: 0.0,
            may_be_singular: false,
        })
    }

    /// Returns harmonics times samples.
    pub fn resolution(&self) -> usize {
        self.aft.resolution()
    }

    /// Returns the number of time steps per law with memory.
    pub fn time_steps(&self) -> usize {
        let with_memory = self.motion_ports.iter().filter(|placed| placed.port.has_memory_steps()).count();
        self.aft.law_steps / with_memory.max(1)
    }

    /// Returns true if the system has one degree of freedom and a law with memory.
    pub fn is_single_dof_with_memory(&self) -> bool {
        self.system.dofs() == 1 && self.motion_ports.iter().any(|placed| placed.port.has_memory_steps())
    }

    /// Holds the mean of bodies that only joints hold, by springs that are negligible at the
    /// frequency `omega`. Nothing else determines the mean while such a body slides.
    pub fn hold_free_bodies(&mut self, omega: f64) {
        let settings = ModeSettings::default();
        let is_free = self.linear_modes().first().is_some_and(|mode| mode.squared_frequency == 0.0);
        self.mean_springs = if is_free { settings.mean_springs * omega * omega } else { 0.0 };
    }

    /// Returns true if constant forces act.
    pub fn has_constant_forces(&self) -> bool {
        self.has_constant_forces
    }

    /// Returns the number of axes of the force ports.
    pub(crate) fn force_axes(&self) -> usize {
        self.force_ports.last().map_or(0, |last| last.port.first_axis + last.port.axes)
    }

    /// Returns the harmonics of the places from those relative to the equilibrium.
    fn absolute(&self, relative: &[Complex64]) -> Vec<Complex64> {
        let mut x = relative.to_vec();
        if self.first > 0 {
            x.iter_mut().zip(&self.equilibrium).for_each(|(x, mean)| x.re += mean);
        }
        x
    }

    /// Returns the first harmonic of the places.
    pub fn first_harmonic<'s>(&self, state: &'s ModeState) -> &'s [Complex64] {
        let n = self.system.dofs();
        &state.x[self.first * n..(self.first + 1) * n]
    }

    /// Returns true if the force of some law is unbounded, so that it stays significant at
    /// large amplitudes.
    pub fn is_unbounded(&self) -> bool {
        self.motion_ports.iter().chain(&self.force_ports).any(|placed| !placed.port.scale.is_finite())
    }

    /// Returns the number of unknowns: real and imaginary parts of motions and forces, ω and ζ.
    pub(crate) fn size(&self) -> usize {
        2 * self.aft.harmonics.len() * (self.system.dofs() + self.force_axes()) + 2
    }

    /// Returns ε of every contact, N s/m, see [`contact_parameter`].
    ///
    /// The receptance is that without resonances, `wᵀ (K + h² ω² M)⁻¹ w`, at the highest
    /// harmonic `h`. It changes smoothly along the mode. With many harmonics it equals the
    /// receptance of the structure.
    fn penalties(&self, omega: f64) -> Vec<f64> {
        if self.force_ports.is_empty() {
            return Vec::new();
        }
        let top = self.aft.harmonics[self.aft.harmonics.len() - 1];
        let rate = top as f64 * omega;
        let stiff = self.system.structure().stiffness() + self.system.structure().mass() * (rate * rate);
        // masses are positive; only an ω that overflows has no factor, and its residual is not
        // finite either
        let factor = stiff.cholesky();
        let receptance = |w: &DVector<f64>| factor.as_ref().map_or(0.0, |factor| w.dot(&factor.solve(w)));
        self.force_ports
            .iter()
            .map(|PlacedPort { port, directions: w }| {
                let mean = w.iter().map(receptance).sum::<f64>() / w.len() as f64;
                contact_parameter(mean + port.series_compliance, top, omega)
                    .max(LEAST_EPSILON_RATIO * port.least_penalty)
            })
            .collect()
    }

    /// Evaluates the residual at `state` for amplitude `a`, and its Jacobian. The phase of the
    /// motion is that of `start`.
    pub(crate) fn evaluate(
        &mut self,
        state: &ModeState,
        (start, a): (&ModeState, f64),
        residual: &mut [f64],
        mut jacobian: Option<&mut [f64]>,
    ) {
        let n = self.system.dofs();
        let harmonics = self.aft.harmonics.clone();
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
                if harmonics[k] == 0 {
                    sum.re += self.joint_loads[i];
                }
                for l in 0..n {
                    let (m, c, s) = (
                        self.system.structure().mass()[(i, l)],
                        self.system.structure().damping()[(i, l)],
                        self.system.structure().stiffness()[(i, l)],
                    );
                    let s = if harmonics[k] == 0 { s + self.mean_springs * m } else { s };
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
        self.make_means_real(state, start, residual, jacobian.as_deref_mut());
        // modal amplitude, relative, and phase; a single place cannot stand for the motion,
        // because a contact mass that moves most in slip may rest in stick
        let (mut square, mut turned, last) = (0.0, 0.0, size - 2);
        let (now, then) = (self.first_harmonic(state), self.first_harmonic(start));
        for i in 0..n {
            let (mut x, mut before) = (ZERO, ZERO);
            for l in 0..n {
                let m = self.system.structure().mass()[(i, l)] / (a * a);
                x += now[l] * m;
                before += then[l] * m;
            }
            square += (now[i].conj() * x).re;
            turned += (before.conj() * now[i]).im;
            if let Some(jacobian) = jacobian.as_deref_mut() {
                let at = 2 * (self.first * n + i);
                jacobian[last * size + at] = 2.0 * x.re;
                jacobian[last * size + at + 1] = 2.0 * x.im;
                jacobian[(last + 1) * size + at] = -before.im;
                jacobian[(last + 1) * size + at + 1] = before.re;
            }
        }
        residual[last] = square - 1.0;
        residual[last + 1] = turned;
    }

    /// Sets the equations of the imaginary parts of the means, which are zero. Those of the
    /// structure would be singular for a body that only its joints hold.
    fn make_means_real(
        &self,
        state: &ModeState,
        start: &ModeState,
        residual: &mut [f64],
        mut jacobian: Option<&mut [f64]>,
    ) {
        let (n, size, stiffness) = (self.system.dofs(), self.size(), self.largest_stiffness(start.omega));
        for i in 0..self.first * n {
            let row = 2 * i + 1;
            residual[row] = stiffness * state.x[i].im;
            if let Some(jacobian) = jacobian.as_deref_mut() {
                jacobian[row * size..(row + 1) * size].fill(0.0);
                jacobian[row * size + row] = stiffness;
            }
        }
    }

    /// Adds the forces of motion ports on the places.
    fn add_elastic_forces(&mut self, state: &ModeState, residual: &mut [f64], jacobian: Option<&mut [f64]>) {
        let (n, size, nh) = (self.system.dofs(), self.size(), self.aft.harmonics.len());
        let x = self.absolute(&state.x);
        let mut tangents = Vec::with_capacity(self.motion_ports.len());
        for placed in &self.motion_ports {
            let wide = 2 * nh * placed.directions.len();
            let mut force = vec![ZERO; nh * placed.directions.len()];
            let mut tangent = vec![0.0; if jacobian.is_some() { wide * wide } else { 0 }];
            let c = placed.along(&x, nh);
            let wanted = jacobian.is_some().then_some(&mut tangent[..]);
            self.aft.motion_port_force(&placed.port, (state.omega, 1.0), &c, &mut force, wanted);
            for (w, force) in placed.directions.iter().zip(force.chunks_exact(nh)) {
                for (k, force) in force.iter().enumerate() {
                    for i in 0..n {
                        let row = 2 * (k * n + i);
                        residual[row] += w[i] * force.re;
                        residual[row + 1] += w[i] * force.im;
                    }
                }
            }
            let by_frequency = self.aft.by_frequency.as_ref().filter(|_| jacobian.is_some());
            tangents.push((tangent, by_frequency.cloned()));
        }
        let Some(jacobian) = jacobian.filter(|_| !self.motion_ports.is_empty()) else { return };
        // all axes at once: in reduced structures every axis moves all places
        let axes: Vec<&DVector<f64>> = self.motion_ports.iter().flat_map(|placed| &placed.directions).collect();
        let places_by_axes: Vec<f64> = (0..n).flat_map(|i| axes.iter().map(move |w| w[i])).collect();
        let (mut slopes, mut by_places) = (vec![0.0; axes.len() * (size - 1)], vec![0.0; n * (size - 1)]);
        // by columns, as the product reads its matrices: the slopes of an axis, the axes of a place
        let shape = ProductShape { rows: size - 1, inner: axes.len(), columns: n };
        for (k, part) in (0..nh).flat_map(|k| [(k, 0), (k, 1)]) {
            let mut of_axes = slopes.chunks_exact_mut(size - 1);
            for (placed, (tangent, by_frequency)) in self.motion_ports.iter().zip(&tangents) {
                let wide = 2 * nh * placed.directions.len();
                for (a, slopes) in of_axes.by_ref().take(placed.directions.len()).enumerate() {
                    placed.by_places(&tangent[(2 * (a * nh + k) + part) * wide..][..wide], slopes);
                    let by_frequency = by_frequency.as_ref().map_or(ZERO, |by| by[a * nh + k]);
                    slopes[size - 2] = [by_frequency.re, by_frequency.im][part];
                }
            }
            dense::multiply_blocked(&slopes, &places_by_axes, &mut by_places, shape, Transpose::No);
            for (i, slopes) in by_places.chunks_exact(size - 1).enumerate() {
                let row = &mut jacobian[(2 * (k * n + i) + part) * size..];
                row.iter_mut().zip(slopes).for_each(|(entry, slope)| *entry += slope);
            }
        }
    }

    /// Adds the forces λ of force ports on the places, and the equations of these forces.
    ///
    /// The Jacobian ignores that ε depends on ω. The force λ solves the law for any ε, so ε
    /// affects the solution only through the missing harmonics. Newton's method converges
    /// without this term.
    fn add_contact_forces(&mut self, state: &ModeState, residual: &mut [f64], mut jacobian: Option<&mut [f64]>) {
        let (n, size, nh) = (self.system.dofs(), self.size(), self.aft.harmonics.len());
        let (x, penalties) = (self.absolute(&state.x), self.penalties(state.omega));
        for (placed, &penalty) in self.force_ports.iter().zip(&penalties) {
            let port = &placed.port;
            let wide = 2 * nh * port.axes;
            let first = 2 * nh * (n + port.first_axis);
            let force = &state.force[port.first_axis * nh..(port.first_axis + port.axes) * nh];
            let mut c = placed.along(&x, nh);
            c.iter_mut().zip(force).for_each(|(c, force)| *c -= force * port.series_compliance);
            let mut image = vec![ZERO; force.len()];
            let mut tangent = vec![0.0; if jacobian.is_some() { wide * wide } else { 0 }];
            let wanted = jacobian.is_some().then_some(&mut tangent[..]);
            let contact = ContactParameters::supported(penalty);
            self.aft.force_port_image(port, (state.omega, contact, 1.0), (&c, force), &mut image, wanted);
            for (a, w) in placed.directions.iter().enumerate() {
                for k in 0..nh {
                    let at = a * nh + k;
                    let r = force[at] - image[at];
                    (residual[first + 2 * at], residual[first + 2 * at + 1]) = (r.re, r.im);
                    for i in (0..n).filter(|&i| w[i] != 0.0) {
                        let row = 2 * (k * n + i);
                        residual[row] += w[i] * force[at].re;
                        residual[row + 1] += w[i] * force[at].im;
                        let Some(jacobian) = jacobian.as_deref_mut() else { continue };
                        jacobian[row * size + first + 2 * at] += w[i];
                        jacobian[(row + 1) * size + first + 2 * at + 1] += w[i];
                    }
                }
            }
            let Some(jacobian) = jacobian.as_deref_mut() else { continue };
            for (i, slopes) in tangent.chunks_exact(wide).enumerate() {
                let row = &mut jacobian[(first + i) * size..(first + i + 1) * size];
                row[first + i] += 1.0 + force_regularization(self.aft.harmonics[i / 2 % nh]);
                for (b, v) in placed.directions.iter().enumerate() {
                    for (l, &h) in self.aft.harmonics.iter().enumerate() {
                        let at = b * nh + l;
                        let (x, y) = (slopes[2 * at], slopes[2 * at + 1]);
                        let by = |z: Complex64| (x * z.re + y * z.im, y * z.re - x * z.im);
                        let turn = Complex64::new(0.0, penalty * h as f64 * state.omega);
                        let (re, im) = by(1.0 - turn * port.series_compliance);
                        row[first + 2 * at] -= re;
                        row[first + 2 * at + 1] -= im;
                        for p in (0..n).filter(|&p| v[p] != 0.0) {
                            let (re, im) = by(turn * v[p]);
                            row[2 * (l * n + p)] -= re;
                            row[2 * (l * n + p) + 1] -= im;
                        }
                        row[size - 2] -= by(turn * c[at] / state.omega).0;
                    }
                }
            }
        }
    }

    /// Returns the units of the residual: elastic forces and slip limits. The conditions for
    /// amplitude and phase are dimensionless.
    pub(crate) fn units(&self, start: &ModeState, a: f64) -> Vec<f64> {
        let stiffness = self.largest_stiffness(start.omega);
        // the forces of a motion far below the static displacements have their rounding errors
        let a = a.max(ModeSettings::default().least_motion * self.equilibrium.amax());
        let mut scale = vec![(stiffness * a).max(f64::MIN_POSITIVE); 2 * start.x.len()];
        let width = 2 * self.aft.harmonics.len();
        scale.extend(self.force_ports.iter().flat_map(|placed| vec![placed.port.scale; width * placed.port.axes]));
        scale.extend([1.0; 2]);
        scale
    }

    /// Returns the largest entry of the stiffness or of the inertia forces, N/m.
    fn largest_stiffness(&self, omega: f64) -> f64 {
        let structure = self.system.structure();
        structure.stiffness().amax().max(omega * omega * structure.mass().amax())
    }

    /// Returns true if every smaller motion about the equilibrium is a multiple of this one.
    pub fn is_proportional(&mut self, state: &ModeState, a: f64) -> bool {
        let settings = ModeSettings::default();
        let mut residual = vec![0.0; self.size()];
        // Factors of smaller motions that test proportionality. If these motions solve the
        // equations, all smaller ones do.
        [0.7, 0.5, 0.01].iter().all(|factor| {
            let (smaller, a) = (self.scaled(state, *factor), a * factor);
            let units = self.units(&smaller, a);
            self.evaluate(&smaller, (&smaller, a), &mut residual, None);
            scaled_norm(&units, &residual) <= settings.tolerance
        })
    }

    /// Returns a multiple of a motion about the equilibrium. Contact forces that balance constant
    /// forces remain.
    pub fn scaled(&self, state: &ModeState, factor: f64) -> ModeState {
        let (mut scaled, nh) = (state.clone(), self.aft.harmonics.len());
        scaled.x.iter_mut().for_each(|x| *x *= factor);
        for (i, force) in scaled.force.iter_mut().enumerate() {
            let is_static = self.has_constant_forces && self.aft.harmonics[i % nh] == 0;
            *force *= if is_static { 1.0 } else { factor };
        }
        scaled
    }
}

/// Returns the norm of a residual whose entries have these units.
pub(super) fn scaled_norm(units: &[f64], residual: &[f64]) -> f64 {
    residual.iter().zip(units).map(|(r, unit)| (r / unit) * (r / unit)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, CoulombArctan, Cubic, Dahl, Gap, Jenkins, JenkinsArctan, LuGre, SharedLaw};
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring};
    use std::sync::Arc;

    /// Returns a row of masses with a joint of every law.
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

    /// Returns one mass on a spring with a rate law and little viscous damping.
    fn rated(law: SharedLaw) -> System {
        let between = || ["m".to_owned(), GROUND.to_owned()];
        let model = Model {
            masses: vec![Mass::new("m", 1.0)],
            springs: vec![Spring { between: between(), stiffness: 1.0, damping: 0.02 }],
            joints: vec![Joint { name: "j".into(), between: between(), law }],
            ..Model::default()
        };
        model.assemble().unwrap()
    }

    /// A small mass on a big one, held by its joint alone. Without the joint, the free motion of
    /// the small mass is the first mode. With the stiff joint, both masses move in the first mode.
    #[test]
    fn the_stuck_mode_of_the_most_similar_shape_has_another_number() {
        let name = |i: usize| format!("m{i}");
        let law: SharedLaw = Arc::new(Jenkins { stiffness: 100.0, limit: 0.3 });
        let model = Model {
            masses: vec![Mass::new(name(0), 1.0), Mass::new(name(1), 0.01)],
            springs: vec![Spring { between: [name(0), GROUND.into()], stiffness: 1.0, damping: 0.02 }],
            joints: vec![Joint { name: "j".into(), between: [name(0), name(1)], law }],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let mut equations = ModeEquations::new(&system, 3, 64).unwrap();
        let linear = equations.linear_modes();
        assert!(linear[0].squared_frequency == 0.0 && (linear[1].squared_frequency - 1.0).abs() < 1e-3);
        let state = equations.linear_state(&linear[1], 1.0).unwrap();
        assert_eq!(equations.most_similar_small_mode(&state, 1), Some(0));
        let stuck = equations.small_amplitude_mode(0, 1.0).unwrap().state;
        assert!((stuck.omega - 1.01f64.sqrt().recip()).abs() < 1e-4, "{}", stuck.omega);
        assert_eq!(equations.most_similar_small_mode(&stuck, 1), Some(0));
    }

    /// Newton's method converges quadratically if forces depend on the frequency of the motion:
    /// bristles with dampers, creep, viscous terms.
    #[test]
    fn newton_is_quadratic_for_laws_of_rates() {
        let laws: [SharedLaw; 3] = [
            Arc::new(LuGre {
                stiffness: 3.0,
                damping: 0.3,
                viscous: 0.2,
                limit: 0.3,
                static_limit: 0.4,
                velocity: 0.5,
            }),
            Arc::new(Dahl { stiffness: 3.0, limit: 0.3 }),
            Arc::new(JenkinsArctan { stiffness: 3.0, limit: 0.3, alpha: 4.0 }),
        ];
        for law in laws {
            let system = rated(law.clone());
            let mut equations = ModeEquations::new(&system, 5, 1024).unwrap();
            let linear = equations.linear_state(&equations.linear_modes()[0], 1.0).unwrap();
            let start = equations.solve(&linear, 1.0, 1.0).unwrap();
            let mut state = start.clone();
            state.omega *= 1.02;
            state.damping += 0.01;
            let size = equations.size();
            let scale = equations.units(&start, 1.0);
            let (mut residual, mut jacobian) = (vec![0.0; size], vec![0.0; size * size]);
            let mut norms = Vec::new();
            for _ in 0..5 {
                equations.evaluate(&state, (&start, 1.0), &mut residual, Some(&mut jacobian));
                norms.push(scaled_norm(&scale, &residual));
                assert!(dense::solve(&mut jacobian, size, &mut residual));
                for (value, d) in state.x.iter_mut().chain(&mut state.force).zip(residual.chunks_exact(2)) {
                    *value -= Complex64::new(d[0], d[1]);
                }
                state.omega -= residual[size - 2];
                state.damping -= residual[size - 1];
            }
            // from one percent to rounding in four steps; without the derivative by ω,
            // convergence is linear
            for pair in norms.windows(2) {
                assert!(pair[1] <= 30.0 * pair[0] * pair[0] + 1e-11, "{law:?}: {norms:?}");
            }
            assert!(norms[0] > 1e-3 && norms[4] < 1e-10, "{law:?}: {norms:?}");
        }
    }

    /// The Jacobian agrees with finite differences by every unknown. The derivative of the
    /// force equations by ω is left out, because it treats ε as constant.
    #[test]
    fn the_derivative_agrees_with_differences() {
        let system = mixed();
        let mut equations = ModeEquations::new(&system, 5, 512).unwrap();
        let start = equations.linear_state(&equations.linear_modes()[1], 1.0).unwrap();
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
        // a difference has a rounding error of this share of the largest entry
        let rounded = 1e-8;
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
                assert!((difference - given).abs() < rounded * largest, "{row} {column}: {difference} {given}");
            }
        }
    }

    /// Returns a unit mass on a unit spring without damping, with a law to the ground and a
    /// constant force.
    fn oscillator(law: SharedLaw, constant_force: f64) -> System {
        let mut model = Model::default();
        let between = || ["m".to_owned(), GROUND.to_owned()];
        model.masses.push(Mass::new("m", 1.0));
        model.springs.push(Spring { between: between(), stiffness: 1.0, damping: 0.0 });
        model.joints.push(Joint { name: "j".into(), between: between(), law });
        model.forces.push(Force { on: "m".into(), amplitude: constant_force, phase: 0.0, harmonic: 0 });
        model.assemble().unwrap()
    }

    /// Returns the mode at the last of the amplitudes, which are solved one after the other, with
    /// the amplitude and the mean of the only place.
    fn mode(system: &System, harmonics: usize, amplitudes: &[f64]) -> (ModeState, f64, f64) {
        let mut equations = ModeEquations::new(system, harmonics, 1024).unwrap();
        let first = &equations.linear_modes()[0];
        let (mut state, mut before) = (equations.linear_state(first, amplitudes[0]).unwrap(), amplitudes[0]);
        for &a in amplitudes {
            state = equations.solve(&state, before, a).unwrap();
            before = a;
        }
        let (first, mean) = (equations.places(&state)[0].norm(), equations.absolute(&state.x)[0].re);
        (state, first, mean)
    }

    /// A constant force shifts the motion to `x + f(x) = F₀`, about which small motions have
    /// `ω² = 1 + f'(x)`: on a cubic spring, and on a stop that the force closes.
    #[test]
    fn a_constant_force_shifts_the_mean() {
        let laws: [(SharedLaw, f64, f64, f64); 2] = [
            (Arc::new(Cubic { stiffness: 0.5 }), 1.2 + 0.5 * 1.728, 1.2, 1.0 + 1.5 * 1.44),
            (Arc::new(Gap { gap: 0.1, stiffness: 1.25 }), 0.5 + 1.25 * 0.4, 0.5, 2.25),
        ];
        for (law, force, expected, slope) in laws {
            let (state, first, mean) = mode(&oscillator(law, force), 3, &[1e-2, 1e-4]);
            assert!((mean - expected).abs() < 1e-7 && (first - 1e-4).abs() < 1e-12, "{:?}", state.x);
            assert!((state.omega / slope.sqrt() - 1.0).abs() < 1e-7, "{} {slope}", state.omega);
        }
    }

    /// With one harmonic, Duffing's oscillator has `ω² = 1 + ¾ b a²` and no damping.
    #[test]
    fn a_cubic_spring_has_its_backbone() {
        let system = oscillator(Arc::new(Cubic { stiffness: 0.5 }), 0.0);
        for a in [0.1, 0.7, 2.0] {
            let (state, first, _) = mode(&system, 1, &[a]);
            let expected = (1.0 + 0.375 * a * a).sqrt();
            assert!((first - a).abs() < 1e-9 && (state.omega - expected).abs() < 1e-9, "{a}: {}", state.omega);
            assert!(state.damping.abs() < 1e-9);
        }
    }

    /// A mass against a stop without a gap moves half a period on the spring and half a period
    /// on spring and stop: `2/ω = 1/ω₁ + 1/ω₂`. Its mean is not zero, and all harmonics occur.
    #[test]
    fn a_stop_without_a_gap_has_the_bilinear_frequency() {
        let system = oscillator(Arc::new(Gap { gap: 0.0, stiffness: 1.25 }), 0.0);
        let (state, _, mean) = mode(&system, 31, &[0.8]);
        let expected = 2.0 / (1.0 + 1.0 / 1.5);
        // accelerations have kinks: harmonics decay with their third power, and the frequency
        // error with the square of that
        assert!((state.omega - expected).abs() < 1e-5, "{}", state.omega);
        assert!(state.damping.abs() < 1e-9 && mean < 0.0, "{state:?}");
    }
}
