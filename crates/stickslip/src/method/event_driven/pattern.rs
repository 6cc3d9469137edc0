//! The linear motion in one pattern of stick and slip.
//!
//! In a pattern, stuck rigid sliders are constraints `Wₛᵀx + g(t) = c`. Slipping sliders,
//! springs in series with sliders, and stops are forces that are constant or linear in `x`. Let
//! `N` be an M-orthonormal basis of the remaining free directions and `S = M⁻¹Wₛ(WₛᵀM⁻¹Wₛ)⁺`.
//! The motion is `x = N q + S (c - g)` with `q'' + NᵀCN q' + NᵀKₚN q = Nᵀ(forces)`, which the
//! modes of [`stickslip_numerics::quadratic_modes`] solve in closed form.
//!
//! A pattern does not depend on time, excitation frequency or slip direction. Its key is the
//! set of stuck and closed parts.

use super::mechanics::{Mechanics, PartKind};
use crate::law::Contact;
use crate::method::flow::excitation::HarmonicExcitation;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use stickslip_numerics::dense::{ProductShape, multiply};
use stickslip_numerics::eigen;
use stickslip_numerics::quadratic_modes::{DefectiveModes, QuadraticModes};
use stickslip_numerics::signal::ExponentialBasis;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Thresholds of the linear motion in a pattern.
#[derive(Debug, Clone, Copy)]
struct PatternSettings {
    /// Relative eigenvalue of the Delassus matrix below which directions of stuck sliders are
    /// redundant.
    redundant: f64,
    /// Relative eigenvalue below which a mode has frequency zero: the rounding of
    /// `QuadraticModes`.
    zero_mode: f64,
    /// Relative distance of a harmonic to a mode below which they are integrated as a resonant
    /// pair. At smaller distances, the ordinary particular solution would lose more than five
    /// digits.
    resonant: f64,
    /// Number of states from which the sensitivity is carried joint by joint, in a product that is
    /// blocked for the cache.
    blocked_states: usize,
}

impl Default for PatternSettings {
    fn default() -> Self {
        PatternSettings { redundant: 1e-11, zero_mode: 1e-13, resonant: 1e-5, blocked_states: 24 }
    }
}

/// The closed-form motion of one pattern.
#[derive(Debug, Clone)]
pub(crate) struct Pattern {
    /// Marks stuck sliders and closed stops.
    pub stuck: Vec<bool>,
    /// Indices of the stuck rigid sliders.
    pub stuck_rigid: Vec<usize>,
    /// True if fewer of them would constrain the same motion, so that their forces are not
    /// unique.
    pub redundant: bool,
    /// Marks springs, in series with sliders or in stops, that the stuck rigid sliders keep
    /// from moving.
    pub immobile: Vec<bool>,
    /// Exponents of the modes.
    pub lambda: Vec<Complex64>,
    /// x = Re(shape η), n × modes, column-major.
    pub shape: DMatrix<Complex64>,
    /// Modal coordinates of a state, minus their static values under the forces of that state,
    /// modes × states.
    start: DMatrix<Complex64>,
    /// In addition to the modes, a state moves by `place + drift τ + fall τ²/2`, n × states
    /// each.
    constant: DMatrix<f64>,
    linear: DMatrix<f64>,
    quadratic: DMatrix<f64>,
    /// Modal force of a unit force, modes × n. A constant force shifts the modal coordinate by
    /// `-1/λ` times its modal force.
    input: DMatrix<Complex64>,
    /// Modes with λ = 0, which drift under a constant force.
    drifting: Vec<usize>,
    /// Free directions: displacements, n × r; coordinate and modal force, r × n.
    free: DMatrix<f64>,
    free_coordinate: DMatrix<f64>,
    free_input: DMatrix<f64>,
    /// S, n × held.
    hold: DMatrix<f64>,
    /// Stiffness including the springs of stuck sliders and closed stops, n × n.
    pub stiffness: DMatrix<f64>,
    /// Forces of the stuck rigid sliders:
    /// `multiplier (F - C v - K x - other parts) + inverse_delassus g''`. Sizes held × n and
    /// held × held.
    multiplier: DMatrix<f64>,
    inverse_delassus: DMatrix<f64>,
    /// `multiplier` times C, K, and the directions of the parts: held × n, held × n,
    /// held × parts.
    pub held_by_velocity: DMatrix<f64>,
    pub held_by_displacement: DMatrix<f64>,
    pub held_by_parts: DMatrix<f64>,
}

/// Initial data of a segment.
#[derive(Clone, Copy)]
pub(crate) struct SegmentStart<'a> {
    /// Response of the pattern to the excitation.
    pub driven: &'a ForcedResponse,
    /// Contact states.
    pub contacts: &'a [Contact],
    /// Time, s.
    pub time: f64,
    /// State (x, v, f).
    pub state: &'a [f64],
}

/// Data of a pattern at one excitation frequency, shared by the segments of the motion.
#[derive(Debug, Clone, Default)]
pub(crate) struct ForcedResponse {
    pub basis: ExponentialBasis,
    /// Number of exponents of the basis that are modes; those of the excitation follow.
    pub modes: usize,
    /// Steady complex displacement per harmonic, n each.
    steady: Vec<DVector<Complex64>>,
    /// Modal coordinates of the steady motion, as parts with `e^{jhΩt}` and `e^{-jhΩt}`, one
    /// harmonic after the other. Resonant pairs are excluded, because they start at zero.
    steady_start: Vec<(Complex64, Complex64)>,
    /// Forces of the stuck rigid sliders due to the excitation alone: complex per harmonic, and
    /// constant.
    pub held: Vec<DVector<Complex64>>,
    pub held_constant: DVector<f64>,
    /// Resonant pairs: mode, harmonic, modal force amplitude.
    resonant: Vec<(usize, usize, Complex64)>,
    /// Steady complex coordinate of the free directions per harmonic.
    free_steady: Vec<DVector<Complex64>>,
}

impl ForcedResponse {
    /// Returns its memory, bytes.
    pub fn bytes(&self) -> usize {
        let steady = self.steady.iter().chain(&self.free_steady).map(|x| x.len()).sum::<usize>();
        let held = self.held.iter().map(|x| x.len()).sum::<usize>() + self.held_constant.len();
        size_of::<Self>()
            + 16 * (steady + held + 3 * self.basis.len())
            + 32 * (self.resonant.len() + self.steady_start.len())
    }
}

impl Pattern {
    pub fn new(mechanics: &Mechanics, stuck: &[bool]) -> Result<Self, DefectiveModes> {
        let settings = PatternSettings::default();
        let n = mechanics.n;
        let held: Vec<usize> =
            (0..stuck.len()).filter(|&s| stuck[s] && mechanics.parts[s].stiffness().is_none()).collect();
        let w = DMatrix::from_fn(n, held.len(), |i, s| mechanics.parts[held[s]].direction[i]);
        let out_of_range = DefectiveModes { lambda: Complex64::new(f64::NAN, 0.0) };
        let inverse_delassus = weighted_inverse(
            &(w.transpose() * &mechanics.inverse_mass * &w),
            &held.iter().map(|&s| mechanics.parts[s].static_limit()).collect::<Vec<_>>(),
        )
        .ok_or(out_of_range)?;
        let redundant = !held.is_empty() && {
            let values = eigen::svd(inverse_delassus.clone()).ok_or(out_of_range)?.singular_values;
            let least = settings.redundant * inverse_delassus.amax();
            values.iter().filter(|value| **value > least).count() < held.len()
        };
        let hold = &mechanics.inverse_mass * &w * &inverse_delassus;
        let multiplier = &inverse_delassus * w.transpose() * &mechanics.inverse_mass;

        let states = mechanics.states();
        let mut stiffness = mechanics.stiffness.clone();
        // constant force: -Σ w (f0 - kt wᵀx0) of stuck springs, and -Kₚ S Wₛᵀ x0
        let mut force_from_state = DMatrix::zeros(n, states);
        for (part, _) in mechanics.parts.iter().zip(stuck).filter(|(_, stuck)| **stuck) {
            let Some(kt) = part.stiffness() else { continue };
            let outer = &part.direction * part.direction.transpose() * kt;
            stiffness += &outer;
            if let Some(state) = part.state() {
                let mut block = force_from_state.columns_mut(0, n);
                block += outer;
                let mut column = force_from_state.column_mut(2 * n + state);
                column -= &part.direction;
            }
        }
        let hold_projection = &hold * w.transpose();
        {
            let mut block = force_from_state.columns_mut(0, n);
            block -= &stiffness * &hold_projection;
        }

        let basis = free_directions(&mechanics.mass, &w).ok_or(out_of_range)?;
        let modes = QuadraticModes::new(
            &(basis.transpose() * &mechanics.damping * &basis),
            &(basis.transpose() * &stiffness * &basis),
        )?;
        let frozen = mechanics
            .parts
            .iter()
            .map(|part| {
                let moves = (basis.transpose() * &part.direction).amax();
                part.stiffness().is_some() && moves <= settings.redundant.sqrt() * basis.amax() * part.direction.amax()
            })
            .collect();
        let project = basis.transpose(); // forces to modal forces
        let coordinates = &project * &mechanics.mass; // displacements to q
        let complex = |m: &DMatrix<f64>| m.map(|x| Complex64::new(x, 0.0));
        let count = modes.lambda.len();
        let fastest = modes.lambda.iter().map(|l| l.norm()).fold(0.0, f64::max);
        let mut lambda = modes.lambda.clone();
        let drifting: Vec<usize> =
            (0..count).filter(|&k| lambda[k].norm() <= settings.zero_mode * fastest || fastest == 0.0).collect();
        for &k in &drifting {
            lambda[k] = ZERO;
        }
        let input = &modes.from_velocity * complex(&project);
        let free: DMatrix<f64> = &basis * &modes.free;
        let free_coordinate = modes.free.transpose() * &coordinates;
        let free_input = modes.free.transpose() * &project;
        let shape = complex(&basis) * &modes.shape;
        // free response to the state, including the constant forces of that state
        let pushed = &input * complex(&force_from_state);
        let mut start = DMatrix::from_element(count, states, ZERO);
        start.columns_mut(0, n).copy_from(&(&modes.from_displacement * complex(&coordinates)));
        start.columns_mut(n, n).copy_from(&(&modes.from_velocity * complex(&coordinates)));
        let mut fixed = DMatrix::from_element(count, states, ZERO);
        let mut drifts = DMatrix::from_element(count, states, ZERO);
        for k in 0..count {
            if lambda[k] == ZERO {
                drifts.set_row(k, &pushed.row(k));
            } else {
                fixed.set_row(k, &(pushed.row(k) / -lambda[k]));
            }
        }
        start -= &fixed;
        let real = |m: DMatrix<Complex64>| m.map(|z| z.re);
        let (mut place, mut drift) = (real(&shape * fixed), real(&shape * drifts));
        let mut block = place.columns_mut(0, n);
        block += &hold_projection;
        block += &free * &free_coordinate;
        let mut block = drift.columns_mut(n, n);
        block += &free * &free_coordinate;
        let directions = DMatrix::from_fn(n, stuck.len(), |i, s| mechanics.parts[s].direction[i]);
        Ok(Pattern {
            stuck: stuck.to_vec(),
            stuck_rigid: held,
            redundant,
            immobile: frozen,
            lambda,
            start,
            constant: place,
            linear: drift,
            quadratic: &free * &free_input * &force_from_state,
            input,
            drifting,
            free,
            free_coordinate,
            free_input,
            hold,
            stiffness,
            held_by_velocity: &multiplier * &mechanics.damping,
            held_by_displacement: &multiplier * &mechanics.stiffness,
            held_by_parts: &multiplier * directions,
            multiplier,
            inverse_delassus,
            shape,
        })
    }

    /// Returns whether motion other than exponentials exists.
    fn drifts(&self) -> bool {
        !self.drifting.is_empty() || self.free.ncols() > 0
    }

    /// Returns the modal force of a force, length n.
    fn push(&self, k: usize, force: &[f64]) -> Complex64 {
        force.iter().enumerate().map(|(i, f)| self.input[(k, i)] * f).sum()
    }

    /// Returns the static value of modal coordinate `k` under a constant force; zero for λ = 0,
    /// because that mode drifts.
    fn fixed(&self, k: usize, force: &[f64]) -> Complex64 {
        if self.lambda[k] == ZERO { ZERO } else { -self.push(k, force) / self.lambda[k] }
    }

    /// Returns its memory, bytes: matrices of some multiples of n² numbers.
    pub fn bytes(&self) -> usize {
        let complex = self.lambda.len() + self.shape.len() + self.start.len() + self.input.len();
        let real = 3 * self.constant.len()
            + self.free.len()
            + self.free_coordinate.len()
            + self.free_input.len()
            + self.hold.len()
            + self.stiffness.len()
            + self.multiplier.len()
            + self.inverse_delassus.len()
            + 2 * self.held_by_velocity.len()
            + self.held_by_parts.len();
        size_of::<Self>() + 16 * complex + 8 * real + 16 * self.stuck.len()
    }

    /// Computes the steady response and the basis at one excitation frequency.
    pub fn excitation(&self, mechanics: &Mechanics, excitation: &HarmonicExcitation) -> ForcedResponse {
        let settings = PatternSettings::default();
        let n = mechanics.n;
        let mut driven = ForcedResponse { modes: self.lambda.len(), ..ForcedResponse::default() };
        driven.basis.drifts = self.drifts();
        driven.basis.exponents = self.lambda.clone();
        driven.basis.exponents.extend(excitation.rates.iter().map(|&rate| Complex64::new(0.0, rate)));
        let complex = |m: &DMatrix<f64>| m.map(|x| Complex64::new(x, 0.0));
        for (h, &rate) in excitation.rates.iter().enumerate() {
            let s = Complex64::new(0.0, rate);
            let held = DVector::from_fn(self.stuck_rigid.len(), |i, _| excitation.imposed[h][self.stuck_rigid[i]]);
            let moved = complex(&self.hold) * held; // S g: the constrained part moves with -S g
            let mut force =
                excitation.forces[h].clone() + (complex(&self.stiffness) + complex(&mechanics.damping) * s) * &moved;
            for (i, part) in mechanics.parts.iter().enumerate() {
                if let (Some(kt), true) = (part.stiffness(), self.stuck[i]) {
                    force -= complex_vector(&part.direction) * (excitation.imposed[h][i] * kt);
                }
            }
            let mut steady = -moved;
            for (k, &lambda) in self.lambda.iter().enumerate() {
                let forward: Complex64 = (0..n).map(|i| self.input[(k, i)] * force[i]).sum::<Complex64>() * 0.5;
                let backward: Complex64 = (0..n).map(|i| self.input[(k, i)] * force[i].conj()).sum::<Complex64>() * 0.5;
                let near = (s - lambda).norm() <= settings.resonant * rate;
                if near && forward != ZERO {
                    driven.resonant.push((k, h, forward));
                    driven.basis.resonant.push((lambda, s - lambda));
                    driven.basis.driven_by.push(self.lambda.len() + h);
                }
                let plus = if near { ZERO } else { forward / (s - lambda) };
                let minus = backward / (-s - lambda);
                driven.steady_start.push((plus, minus));
                for i in 0..n {
                    steady[i] += self.shape[(i, k)] * plus + (self.shape[(i, k)] * minus).conj();
                }
            }
            let free: DVector<Complex64> = complex(&self.free_input) * &force / (s * s);
            steady += complex(&self.free) * &free;
            let inertia = DVector::from_fn(self.stuck_rigid.len(), |i, _| {
                excitation.imposed[h][self.stuck_rigid[i]] * (rate * rate)
            });
            let held = complex(&self.multiplier) * &excitation.forces[h] - complex(&self.inverse_delassus) * inertia;
            driven.held.push(held);
            driven.free_steady.push(free);
            driven.steady.push(steady);
        }
        driven.held_constant = &self.multiplier * &excitation.constant;
        driven
    }

    /// Computes the coefficients of the displacements (n × basis, row by row) of the motion
    /// that starts at `time` from `state`.
    pub fn displacement(
        &self,
        mechanics: &Mechanics,
        excitation: &HarmonicExcitation,
        SegmentStart { driven, contacts, time, state }: SegmentStart<'_>,
        work: &mut PatternScratch,
        out: &mut [Complex64],
    ) {
        let (n, nb, count) = (mechanics.n, driven.basis.len(), self.lambda.len());
        let constant = driven.basis.constant();
        out[..n * nb].fill(ZERO);
        // constant forces that do not depend on the state: loads, slip, imposed motion at the
        // start
        work.force.clear();
        work.force.extend(excitation.constant.iter());
        work.held.clear();
        work.held.extend(self.stuck_rigid.iter().map(|&s| excitation.imposed_at(s, time, 0)));
        for (i, part) in mechanics.parts.iter().enumerate() {
            let value = match (contacts[i], part.kind) {
                (Contact::Stick, PartKind::Rigid { .. }) => continue,
                (Contact::Stick, PartKind::Elastic { stiffness, .. }) => stiffness * excitation.imposed_at(i, time, 0),
                (contact, _) => -part.constant_force(contact),
            };
            for row in 0..n {
                work.force[row] += value * part.direction[row];
            }
        }
        for row in 0..n {
            // displacement S c with the part of c due to imposed motion; `place` contains the
            // part due to x0
            let shift: f64 = (0..self.stuck_rigid.len()).map(|s| self.hold[(row, s)] * work.held[s]).sum();
            out[row * nb + constant].re += shift;
            work.shift[row] = shift;
        }
        if work.held.iter().any(|&g| g != 0.0) {
            for row in 0..n {
                for i in 0..n {
                    work.force[row] -= self.stiffness[(row, i)] * work.shift[i];
                }
            }
        }
        for h in 0..excitation.rates.len() {
            let (sin, cos) = (excitation.rates[h] * time).sin_cos();
            work.turn[h] = Complex64::new(cos, sin);
            for row in 0..n {
                out[row * nb + count + h] = driven.steady[h][row] * work.turn[h];
            }
        }
        work.eta[..count].fill(ZERO);
        for (j, &z) in state.iter().enumerate().filter(|(_, z)| **z != 0.0) {
            for (eta, start) in work.eta.iter_mut().zip(&self.start.as_slice()[j * count..(j + 1) * count]) {
                *eta += start * z;
            }
            for (row, place) in self.constant.as_slice()[j * n..(j + 1) * n].iter().enumerate() {
                out[row * nb + constant].re += place * z;
            }
        }
        for k in 0..count {
            work.fixed[k] = self.fixed(k, &work.force);
            work.eta[k] -= work.fixed[k];
        }
        for (h, turn) in work.turn.iter().enumerate() {
            let parts = &driven.steady_start[h * count..(h + 1) * count];
            for (eta, (forward, backward)) in work.eta.iter_mut().zip(parts) {
                *eta -= forward * turn + backward * turn.conj();
            }
        }
        for row in 0..n {
            let out = &mut out[row * nb..(row + 1) * nb];
            let shapes = self.shape.as_slice().iter().skip(row).step_by(n);
            let mut moved = out[constant].re;
            for (((out, shape), eta), fixed) in out[..count].iter_mut().zip(shapes).zip(&work.eta).zip(&work.fixed) {
                *out = shape * eta;
                moved += (shape * fixed).re;
            }
            out[constant].re = moved;
            for (r, (k, h, forward)) in driven.resonant.iter().enumerate() {
                out[count + excitation.rates.len() + r] = self.shape[(row, *k)] * forward * work.turn[*h];
            }
        }
        self.add_polynomials(mechanics, excitation, driven, state, work, out);
    }

    /// Adds free directions and drifting modes: 1, τ, τ²/2.
    fn add_polynomials(
        &self,
        mechanics: &Mechanics,
        excitation: &HarmonicExcitation,
        driven: &ForcedResponse,
        state: &[f64],
        work: &mut PatternScratch,
        out: &mut [Complex64],
    ) {
        if !self.drifts() {
            return;
        }
        let (n, nb, constant) = (mechanics.n, driven.basis.len(), driven.basis.constant());
        for (j, &z) in state.iter().enumerate().filter(|(_, z)| **z != 0.0) {
            for row in 0..n {
                out[row * nb + constant + 1].re += self.linear[(row, j)] * z;
                out[row * nb + constant + 2].re += self.quadratic[(row, j)] * z;
            }
        }
        for &k in &self.drifting {
            let drift = self.push(k, &work.force);
            for row in 0..n {
                out[row * nb + constant + 1].re += (self.shape[(row, k)] * drift).re;
            }
        }
        for r in 0..self.free.ncols() {
            let (mut place, mut speed) = (0.0, 0.0);
            for h in 0..excitation.rates.len() {
                let z = driven.free_steady[h][r] * work.turn[h];
                place -= z.re;
                speed -= (z * Complex64::new(0.0, excitation.rates[h])).re;
            }
            let push: f64 = (0..n).map(|i| self.free_input[(r, i)] * work.force[i]).sum();
            for row in 0..n {
                out[row * nb + constant].re += self.free[(row, r)] * place;
                out[row * nb + constant + 1].re += self.free[(row, r)] * speed;
                out[row * nb + constant + 2].re += self.free[(row, r)] * push;
            }
        }
    }

    /// Multiplies the columns of `sensitivity` (states × columns) by the derivative over a
    /// segment. `values` are the exponentials at its end.
    pub fn carry(
        &self,
        mechanics: &Mechanics,
        length: f64,
        values: &[Complex64],
        sensitivity: &mut DMatrix<f64>,
        work: &mut PatternScratch,
    ) {
        let settings = PatternSettings::default();
        let (n, count, states) = (mechanics.n, self.lambda.len(), mechanics.states());
        if states == 0 {
            return;
        }
        for (k, value) in values[..count].iter().enumerate() {
            let (real, imaginary) = work.moved[4 * n * k..4 * n * (k + 1)].split_at_mut(2 * n);
            for row in 0..n {
                let now = self.shape[(row, k)] * value;
                let rate = now * self.lambda[k];
                (real[row], real[n + row]) = (now.re, rate.re);
                (imaginary[row], imaginary[n + row]) = (now.im, rate.im);
            }
        }
        if states >= settings.blocked_states {
            self.carry_by_joints(mechanics, length, sensitivity, work);
            return;
        }
        // derivative of the end state with respect to the initial state, column by column
        for (j, column) in work.transition.chunks_exact_mut(states).enumerate() {
            let (motion, springs) = column.split_at_mut(2 * n);
            self.moved_by(j, length, &work.moved, motion);
            for (part, stuck) in mechanics.parts.iter().zip(&self.stuck) {
                if let PartKind::Elastic { stiffness: kt, state, .. } = part.kind {
                    springs[state] = if *stuck {
                        let moved: f64 = part.direction.iter().zip(&*motion).map(|(w, x)| w * x).sum();
                        let before = if j < n { part.direction[j] } else { 0.0 };
                        kt * (moved - before) + if j == 2 * n + state { 1.0 } else { 0.0 }
                    } else {
                        0.0
                    };
                }
            }
        }
        let (transition, columns) = (work.transition.as_slice(), sensitivity.as_mut_slice());
        match states {
            2 => carry_columns::<2>(transition, columns),
            3 => carry_columns::<3>(transition, columns),
            4 => carry_columns::<4>(transition, columns),
            5 => carry_columns::<5>(transition, columns),
            6 => carry_columns::<6>(transition, columns),
            _ => {
                for (to, from) in work.product.chunks_exact_mut(states).zip(columns.chunks_exact(states)) {
                    to.fill(0.0);
                    for (column, factor) in transition.chunks_exact(states).zip(from) {
                        to.iter_mut().zip(column).for_each(|(to, x)| *to += x * factor);
                    }
                }
                columns.copy_from_slice(&work.product);
            }
        }
    }

    /// Computes displacements and velocities at the end of a segment per unit of state `j` at
    /// its start, in `motion` (2n).
    fn moved_by(&self, j: usize, length: f64, moved: &[f64], motion: &mut [f64]) {
        let (n, count) = (motion.len() / 2, self.lambda.len());
        motion[..n].copy_from_slice(&self.constant.as_slice()[j * n..(j + 1) * n]);
        motion[n..].fill(0.0);
        if self.drifts() {
            for row in 0..n {
                let (drift, fall) = (self.linear[(row, j)], self.quadratic[(row, j)]);
                motion[row] += drift * length + 0.5 * fall * length * length;
                motion[n + row] += drift + fall * length;
            }
        }
        let starts = &self.start.as_slice()[j * count..(j + 1) * count];
        match n {
            1 => add_modes::<2>(starts, moved, motion),
            2 => add_modes::<4>(starts, moved, motion),
            3 => add_modes::<6>(starts, moved, motion),
            _ => {
                for (start, moved) in starts.iter().zip(moved.chunks_exact(4 * n.max(1))) {
                    let (real, imaginary) = moved.split_at(2 * n);
                    for ((motion, re), im) in motion.iter_mut().zip(real).zip(imaginary) {
                        *motion += re * start.re - im * start.im;
                    }
                }
            }
        }
    }

    /// Carries the sensitivity as in [`Pattern::carry`] for many states, joint by joint.
    ///
    /// The stuck springs of one joint exert one total force and have one elongation. Therefore
    /// the motion depends on them through one number, and they depend on the motion through
    /// another.
    fn carry_by_joints(
        &self,
        mechanics: &Mechanics,
        length: f64,
        sensitivity: &mut DMatrix<f64>,
        work: &mut PatternScratch,
    ) {
        let (n, states) = (mechanics.n, mechanics.states());
        // the states of one joint's springs are adjacent; slipping springs have zero stiffness,
        // and their states are dropped
        work.springs.clear();
        work.stiffness.clear();
        work.kept.clear();
        for (i, part) in mechanics.parts.iter().enumerate() {
            let PartKind::Elastic { stiffness, state, .. } = part.kind else { continue };
            match work.springs.last_mut() {
                Some(springs) if mechanics.parts[springs.part].joint == part.joint => springs.states.end = state + 1,
                _ => work.springs.push(JointSprings { part: i, states: state..state + 1, sticking: None }),
            }
            if let (true, Some(springs)) = (self.stuck[i], work.springs.last_mut()) {
                springs.sticking.get_or_insert(state);
            }
            work.stiffness.push(if self.stuck[i] { stiffness } else { 0.0 });
            work.kept.push(if self.stuck[i] { 1.0 } else { 0.0 });
        }
        let inner = 2 * n + work.springs.len();
        work.transition.resize(2 * n * inner, 0.0);
        for (column, motion) in work.transition.chunks_exact_mut((2 * n).max(1)).enumerate() {
            match column.checked_sub(2 * n).map(|joint| work.springs[joint].sticking) {
                None => self.moved_by(column, length, &work.moved, motion),
                Some(Some(state)) => self.moved_by(2 * n + state, length, &work.moved, motion),
                Some(None) => motion.fill(0.0),
            }
        }
        work.rows.resize(inner * states, 0.0);
        let columns = sensitivity.as_slice().chunks_exact(states);
        for (row, from) in work.rows.chunks_exact_mut(inner.max(1)).zip(columns) {
            let (motion, pushes) = row.split_at_mut(2 * n);
            let (from, springs) = from.split_at(2 * n);
            motion.copy_from_slice(from);
            for (push, JointSprings { states, .. }) in pushes.iter_mut().zip(&work.springs) {
                *push = sum_of_products(&work.kept[states.clone()], &springs[states.clone()]);
            }
        }
        work.product.resize(2 * n * states, 0.0);
        multiply(&work.transition, &work.rows, &mut work.product, ProductShape { rows: 2 * n, inner, columns: states });
        for (c, column) in sensitivity.as_mut_slice().chunks_exact_mut(states).enumerate() {
            let moved = &work.product[c * 2 * n..(c + 1) * 2 * n];
            let (motion, springs) = column.split_at_mut(2 * n);
            for JointSprings { part, states, .. } in &work.springs {
                let part = &mechanics.parts[*part];
                let stretch = part.along(&moved[..n]) - part.along(&motion[..n]);
                let of_joint = work.stiffness[states.clone()].iter().zip(&work.kept[states.clone()]);
                for (force, (stiffness, kept)) in springs[states.clone()].iter_mut().zip(of_joint) {
                    *force = kept * *force + stiffness * stretch;
                }
            }
            motion.copy_from_slice(moved);
        }
    }
}

/// Multiplies the `columns` of a sensitivity by a `transition`, column by column, in registers.
fn carry_columns<const STATES: usize>(transition: &[f64], columns: &mut [f64]) {
    for column in columns.as_chunks_mut::<STATES>().0 {
        let mut sum = [0.0; STATES];
        for (moved, factor) in transition.as_chunks::<STATES>().0.iter().zip(&*column) {
            (0..STATES).for_each(|i| sum[i] += moved[i] * factor);
        }
        *column = sum;
    }
}

/// Adds the modal motion from `starts` to the displacements and velocities `motion`, in
/// registers.
fn add_modes<const MOTIONS: usize>(starts: &[Complex64], moved: &[f64], motion: &mut [f64]) {
    let mut sum = [0.0; MOTIONS];
    sum.copy_from_slice(motion);
    for (start, parts) in starts.iter().zip(moved.as_chunks::<MOTIONS>().0.as_chunks::<2>().0) {
        let [real, imaginary] = parts;
        (0..MOTIONS).for_each(|i| sum[i] += real[i] * start.re - imaginary[i] * start.im);
    }
    motion.copy_from_slice(&sum);
}

/// Returns `Σ a b`, with four parallel sums.
fn sum_of_products(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (whole, rest) = (a.chunks_exact(4).zip(b.chunks_exact(4)), a.len() - a.len() % 4);
    for (a, b) in whole {
        (0..4).for_each(|k| sums[k] += a[k] * b[k]);
    }
    let last: f64 = a[rest..].iter().zip(&b[rest..]).map(|(a, b)| a * b).sum();
    sums[0] + sums[1] + sums[2] + sums[3] + last
}

/// Scratch memory of the pattern's formulas.
#[derive(Debug, Clone, Default)]
pub(crate) struct PatternScratch {
    force: Vec<f64>,
    held: Vec<f64>,
    shift: Vec<f64>,
    /// `e^{jhΩt}` at the start of the last segment, per harmonic.
    pub turn: Vec<Complex64>,
    eta: Vec<Complex64>,
    fixed: Vec<Complex64>,
    /// Displacements and velocities at the end of a segment per unit modal coordinate: for
    /// every mode, 2n real parts and 2n imaginary parts.
    moved: Vec<f64>,
    /// Derivative of the end state with respect to the initial state, column by column, and its
    /// product with the sensitivity.
    transition: Vec<f64>,
    product: Vec<f64>,
    /// Data of [`Pattern::carry_by_joints`]: the springs of each joint, their stiffness,
    /// whether they stick (1 or 0), and the rows of motion and total spring force in the
    /// sensitivity.
    springs: Vec<JointSprings>,
    stiffness: Vec<f64>,
    kept: Vec<f64>,
    rows: Vec<f64>,
}

/// The springs in series with the sliders of one joint.
#[derive(Debug, Clone)]
struct JointSprings {
    /// Index of the first part.
    part: usize,
    /// Indices of their forces among those of all springs.
    states: std::ops::Range<usize>,
    /// The first stuck one.
    sticking: Option<usize>,
}

impl PatternScratch {
    pub fn new(mechanics: &Mechanics, harmonics: usize) -> Self {
        let settings = PatternSettings::default();
        let n = mechanics.n;
        let small = if mechanics.states() < settings.blocked_states { mechanics.states() } else { 0 };
        PatternScratch {
            force: vec![0.0; n],
            held: Vec::with_capacity(mechanics.parts.len()),
            shift: vec![0.0; n],
            turn: vec![ZERO; harmonics],
            eta: vec![ZERO; 2 * n],
            fixed: vec![ZERO; 2 * n],
            moved: vec![0.0; 8 * n * n],
            transition: vec![0.0; small * small],
            product: vec![0.0; small * small],
            springs: Vec::new(),
            stiffness: Vec::new(),
            kept: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// Sets the number of harmonics.
    pub fn set_harmonics(&mut self, harmonics: usize) {
        self.turn.resize(harmonics, ZERO);
    }
}

fn complex_vector(v: &DVector<f64>) -> DVector<Complex64> {
    v.map(|x| Complex64::new(x, 0.0))
}

/// Returns an M-orthonormal basis of the null space of `Wᵀ`.
fn free_directions(mass: &DMatrix<f64>, w: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let settings = PatternSettings::default();
    let n = mass.nrows();
    if n == 0 {
        return Some(DMatrix::zeros(0, 0));
    }
    let l_inverse = mass.clone().cholesky()?.l().solve_lower_triangular(&DMatrix::identity(n, n))?;
    if w.ncols() == 0 {
        return Some(l_inverse.transpose());
    }
    let scaled = &l_inverse * w;
    let eigen = eigen::symmetric(&scaled * scaled.transpose())?;
    let largest = eigen.eigenvalues.amax();
    let null: Vec<usize> = (0..n).filter(|&i| eigen.eigenvalues[i] <= settings.redundant * largest).collect();
    Some(l_inverse.transpose() * eigen.eigenvectors.select_columns(&null))
}

/// Returns the inverse of the Delassus matrix. If stuck contacts are redundant, it distributes
/// the load in proportion to their limits.
fn weighted_inverse(delassus: &DMatrix<f64>, limits: &[f64]) -> Option<DMatrix<f64>> {
    let settings = PatternSettings::default();
    let s = delassus.nrows();
    if s == 0 {
        return Some(DMatrix::zeros(0, 0));
    }
    let weight = DMatrix::from_fn(s, s, |i, j| if i == j { limits[i].sqrt() } else { 0.0 });
    let eigen = eigen::symmetric(&weight * delassus * &weight)?;
    let largest = eigen.eigenvalues.amax();
    let inverse = eigen.eigenvalues.map(|value| if value > settings.redundant * largest { 1.0 / value } else { 0.0 });
    Some(&weight * &eigen.eigenvectors * DMatrix::from_diagonal(&inverse) * eigen.eigenvectors.transpose() * &weight)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Coulomb, Jenkins, SharedLaw};
    use crate::model::{Force, GROUND, Joint, Mass, Model, Motion, Spring};
    use nalgebra::{Matrix2, Vector2};
    use std::sync::Arc;
    use stickslip_numerics::signal::real_dot;

    const STIFFNESS: f64 = 4.0;
    const DAMPING: f64 = 0.6;
    const LIMIT: f64 = 0.5;
    const LOAD: f64 = 1.7;
    const MEAN: f64 = 0.3;
    const OMEGA: f64 = 1.3;
    /// Start and length of the segment, s.
    const TIME: f64 = 0.4;
    const LENGTH: f64 = 2.1;

    /// A mass of 1 kg on a spring and a damper, under a harmonic and a constant force. A law
    /// connects it to a floor that moves by `0.2 cos(ωt)`. Returns displacement and velocity at
    /// the end of the segment, and the derivative of the whole end state with respect to the
    /// initial state.
    fn after(law: SharedLaw, contact: Contact, state: &[f64]) -> ([f64; 2], DMatrix<f64>) {
        let between = |other: &str| ["m".to_owned(), other.to_owned()];
        let force = |amplitude: f64, harmonic: u32| Force { on: "m".into(), amplitude, phase: 0.0, harmonic };
        let model = Model {
            masses: vec![Mass::new("m", 1.0)],
            springs: vec![Spring { between: between(GROUND), stiffness: STIFFNESS, damping: DAMPING }],
            joints: vec![Joint { name: "j".into(), between: between("floor"), law }],
            forces: vec![force(LOAD, 1), force(MEAN, 0)],
            motions: vec![Motion { on: "floor".into(), amplitude: 0.2, phase: 0.0, harmonic: 1 }],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        let mechanics = Mechanics::new(&system, "test").unwrap();
        let excitation = HarmonicExcitation::new(&system, &mechanics.part_joints(), OMEGA);
        let pattern = Pattern::new(&mechanics, &[contact == Contact::Stick]).unwrap();
        let driven = pattern.excitation(&mechanics, &excitation);
        let mut work = PatternScratch::new(&mechanics, excitation.rates.len());
        let mut signal = vec![ZERO; driven.basis.len()];
        let mut speed = signal.clone();
        let beginning = SegmentStart { driven: &driven, contacts: &[contact], time: TIME, state };
        pattern.displacement(&mechanics, &excitation, beginning, &mut work, &mut signal);
        driven.basis.differentiate(&signal, &mut speed);
        let mut values = signal.clone();
        driven.basis.evaluate(LENGTH, &mut values);
        let mut derivative = DMatrix::identity(state.len(), state.len());
        pattern.carry(&mechanics, LENGTH, &values, &mut derivative, &mut work);
        ([real_dot(&signal, &values), real_dot(&speed, &values)], derivative)
    }

    /// Returns displacement and velocity at the end of the segment of
    /// `x'' + c x' + k x = Re(load e^{iωt}) + constant`, and their derivative: the steady
    /// motion plus the matrix exponential of the remainder.
    fn closed_form(k: f64, load: Complex64, constant: f64, start: [f64; 2]) -> ([f64; 2], Matrix2<f64>) {
        let s = Complex64::new(0.0, OMEGA);
        let steady = |time: f64| {
            let x = load / (k + s * DAMPING + s * s) * (s * time).exp();
            Vector2::new(x.re + constant / k, (s * x).re)
        };
        let moved = (Matrix2::new(0.0, 1.0, -k, -DAMPING) * LENGTH).exp();
        let end = steady(TIME + LENGTH) + moved * (Vector2::from(start) - steady(TIME));
        ([end[0], end[1]], moved)
    }

    fn alike(found: [f64; 2], expected: [f64; 2]) {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-13), "{found:?} {expected:?}");
    }

    /// A slipping rigid slider is a constant force against the motion.
    #[test]
    fn a_slipping_slider_is_a_constant_force() {
        let start = [0.7, -0.2];
        for (contact, sign) in [(Contact::SlipForward, 1.0), (Contact::SlipBackward, -1.0)] {
            let (found, derivative) = after(Arc::new(Coulomb { limit: LIMIT }), contact, &start);
            let (expected, moved) = closed_form(STIFFNESS, LOAD.into(), MEAN - sign * LIMIT, start);
            alike(found, expected);
            assert!((0..4).all(|i| (derivative[(i / 2, i % 2)] - moved[(i / 2, i % 2)]).abs() < 1e-13), "{derivative}");
        }
    }

    /// A stuck rigid slider follows its counterpart, `x = x₀ + g₀ - g`, and the derivative with
    /// respect to the velocity is zero.
    #[test]
    fn a_sticking_slider_follows_the_floor() {
        let floor = |t: f64| 0.2 * (OMEGA * t).cos();
        let speed = |t: f64| -0.2 * OMEGA * (OMEGA * t).sin();
        let (found, derivative) = after(Arc::new(Coulomb { limit: LIMIT }), Contact::Stick, &[0.7, speed(TIME)]);
        let end = TIME + LENGTH;
        alike(found, [0.7 + floor(end) - floor(TIME), speed(end)]);
        assert!((derivative - DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.0])).amax() < 1e-13);
    }

    /// A stuck slider in series with a spring acts as that spring:
    /// `f = f₀ + kt (x - x₀ - (g - g₀))`. Its force is also a state.
    #[test]
    fn a_sticking_spring_is_a_spring() {
        let (kt, force) = (2.5, 0.1);
        let law = Arc::new(Jenkins { stiffness: kt, limit: LIMIT });
        let (place, floor) = (0.7, 0.2 * (OMEGA * TIME).cos());
        let (found, derivative) = after(law, Contact::Stick, &[place, -0.2, force]);
        // kt (x - g) on the side of the structure, the other terms are constant
        let constant = MEAN - force + kt * (place - floor);
        let (expected, moved) = closed_form(STIFFNESS + kt, (LOAD + 0.2 * kt).into(), constant, [place, -0.2]);
        alike(found, expected);
        // derivatives with respect to the initial state: the displacement also shifts the
        // centre, the force acts directly
        let centre = |push: f64| {
            let shift = push / (STIFFNESS + kt);
            Vector2::new(shift * (1.0 - moved[(0, 0)]), -shift * moved[(1, 0)])
        };
        let columns = [moved.column(0) + centre(kt), moved.column(1).into_owned(), centre(-1.0)];
        for (k, column) in columns.iter().enumerate() {
            let own = [-kt, 0.0, 1.0][k] + kt * column[0];
            for (i, expected) in [column[0], column[1], own].into_iter().enumerate() {
                let found = derivative[(i, k)];
                assert!((found - expected).abs() < 1e-13, "{i} by {k}: {found} {expected}");
            }
        }
    }
}
