//! The linear motion while a pattern of stick and slip lasts.
//!
//! In a pattern the rigid sliders that stick hold `Wₛᵀx + g(t) = c`; those that slip, and the springs in front of sliders, are
//! forces that are constant or linear in `x`. With `N` an M-orthonormal basis of the directions that are left free and
//! `S = M⁻¹Wₛ(WₛᵀM⁻¹Wₛ)⁺`, the motion is `x = N q + S (c - g)` and `q'' + NᵀCN q' + NᵀKₚN q = Nᵀ(forces)`, which the modes of
//! [`stickslip_numerics::modes`] solve in closed form. Nothing here depends on time, drive frequency or slip direction:
//! a pattern is known by what sticks.

use super::mechanics::Mechanics;
use crate::law::Contact;
use crate::method::drive::Drive;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use stickslip_numerics::eigen;
use stickslip_numerics::modes::{Defective, Modes};
use stickslip_numerics::signal::Basis;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Directions of stuck sliders are redundant below this fraction of the largest eigenvalue of their Delassus matrix.
const REDUNDANT: f64 = 1e-11;
/// A mode slower than this fraction of the fastest is taken to be exactly at zero: the rounding of `Modes`.
const STILL: f64 = 1e-13;
/// A harmonic this close to a mode (relative) is integrated as a resonant pair; nearer than this the plain particular solution
/// would lose more than the last five digits.
const RESONANT: f64 = 1e-5;

/// The closed-form motion of one pattern.
#[derive(Debug, Clone)]
pub(crate) struct Pattern {
    /// Which sliders stick.
    pub stuck: Vec<bool>,
    /// Rigid sliders that stick.
    pub held: Vec<usize>,
    /// Whether fewer of them would hold the same motion, so that their forces are not unique.
    pub redundant: bool,
    /// Sliders behind springs that the held ones keep from moving.
    pub frozen: Vec<bool>,
    /// Exponents.
    pub lambda: Vec<Complex64>,
    /// x = Re(shape η), n × modes, column-major.
    pub shape: DMatrix<Complex64>,
    /// Modal coordinates of displacements and velocities, modes × 2n.
    coordinate: DMatrix<Complex64>,
    /// Modal force of a unit force, modes × n; a constant one moves the coordinate by `-1/λ` of it.
    input: DMatrix<Complex64>,
    /// Modes exactly at λ = 0: they drift under a constant force.
    drifting: Vec<usize>,
    /// Free directions: x part, n × r; coordinate and modal force, r × n.
    free: DMatrix<f64>,
    free_coordinate: DMatrix<f64>,
    free_input: DMatrix<f64>,
    /// Constant force on the structure from the state, n × states.
    force_from_state: DMatrix<f64>,
    /// S, n × held; S Wₛᵀ, n × n.
    hold: DMatrix<f64>,
    hold_projection: DMatrix<f64>,
    /// Stiffness with the springs of stuck sliders, n × n.
    pub stiffness: DMatrix<f64>,
    /// λ = multiplier (forces) + inverse_delassus g'': held × n, held × held.
    pub multiplier: DMatrix<f64>,
    pub inverse_delassus: DMatrix<f64>,
}

/// Where a stretch of motion begins.
#[derive(Clone, Copy)]
pub(crate) struct Beginning<'a> {
    /// The pattern's response to the drive.
    pub driven: &'a Driven,
    /// What sticks, and which way the others slip.
    pub contacts: &'a [Contact],
    /// Time, s.
    pub time: f64,
    /// State (x, v, f).
    pub state: &'a [f64],
}

/// What a pattern adds at one drive frequency; the motion's segments share it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Driven {
    pub basis: Basis,
    /// Exponents of the basis that are modes; those of the drive follow.
    pub modes: usize,
    /// Steady complex displacement per harmonic, n each.
    steady: Vec<DVector<Complex64>>,
    /// Resonant pairs: mode, harmonic, modal force amplitude.
    resonant: Vec<(usize, usize, Complex64)>,
    /// Steady complex coordinate of the free directions per harmonic.
    free_steady: Vec<DVector<Complex64>>,
}

impl Driven {
    /// Memory that it takes, bytes.
    pub fn bytes(&self) -> usize {
        let steady = self.steady.iter().chain(&self.free_steady).map(|x| x.len()).sum::<usize>();
        size_of::<Self>() + 16 * (steady + 3 * self.basis.len()) + 32 * self.resonant.len()
    }
}

impl Pattern {
    pub fn new(mechanics: &Mechanics, stuck: &[bool]) -> Result<Self, Defective> {
        let n = mechanics.n;
        let held: Vec<usize> =
            (0..stuck.len()).filter(|&s| stuck[s] && mechanics.sliders[s].stiffness.is_none()).collect();
        let w = DMatrix::from_fn(n, held.len(), |i, s| mechanics.sliders[held[s]].direction[i]);
        let out_of_range = Defective { lambda: Complex64::new(f64::NAN, 0.0) };
        let inverse_delassus = weighted_inverse(
            &(w.transpose() * &mechanics.inverse_mass * &w),
            &held.iter().map(|&s| mechanics.sliders[s].limit).collect::<Vec<_>>(),
        )
        .ok_or(out_of_range)?;
        let redundant = !held.is_empty() && {
            let values = eigen::singular(inverse_delassus.clone()).ok_or(out_of_range)?.singular_values;
            let least = REDUNDANT * inverse_delassus.amax();
            values.iter().filter(|value| **value > least).count() < held.len()
        };
        let hold = &mechanics.inverse_mass * &w * &inverse_delassus;
        let multiplier = &inverse_delassus * w.transpose() * &mechanics.inverse_mass;

        let states = mechanics.states();
        let mut stiffness = mechanics.stiffness.clone();
        // constant force: -Σ w (f0 - kt wᵀx0) of stuck springs, and -Kₚ S Wₛᵀ x0
        let mut force_from_state = DMatrix::zeros(n, states);
        for (slider, stuck) in mechanics.sliders.iter().zip(stuck) {
            if let (Some(kt), Some(state), true) = (slider.stiffness, slider.state, stuck) {
                let outer = &slider.direction * slider.direction.transpose() * kt;
                stiffness += &outer;
                let mut block = force_from_state.columns_mut(0, n);
                block += outer;
                let mut column = force_from_state.column_mut(2 * n + state);
                column -= &slider.direction;
            }
        }
        let hold_projection = &hold * w.transpose();
        {
            let mut block = force_from_state.columns_mut(0, n);
            block -= &stiffness * &hold_projection;
        }

        let basis = free_directions(&mechanics.mass, &w).ok_or(out_of_range)?;
        let modes =
            Modes::new(&(basis.transpose() * &mechanics.damping * &basis), &(basis.transpose() * &stiffness * &basis))?;
        let frozen = mechanics
            .sliders
            .iter()
            .map(|slider| {
                let moves = (basis.transpose() * &slider.direction).amax();
                slider.stiffness.is_some() && moves <= REDUNDANT.sqrt() * basis.amax() * slider.direction.amax()
            })
            .collect();
        let project = basis.transpose(); // forces to modal
        let coordinates = &project * &mechanics.mass; // displacements to q
        let complex = |m: &DMatrix<f64>| m.map(|x| Complex64::new(x, 0.0));
        let count = modes.lambda.len();
        let fastest = modes.lambda.iter().map(|l| l.norm()).fold(0.0, f64::max);
        let mut lambda = modes.lambda.clone();
        let drifting: Vec<usize> =
            (0..count).filter(|&k| lambda[k].norm() <= STILL * fastest || fastest == 0.0).collect();
        for &k in &drifting {
            lambda[k] = ZERO;
        }
        let input = &modes.from_velocity * complex(&project);
        let mut coordinate = DMatrix::from_element(count, 2 * n, ZERO);
        coordinate.columns_mut(0, n).copy_from(&(&modes.from_displacement * complex(&coordinates)));
        coordinate.columns_mut(n, n).copy_from(&(&modes.from_velocity * complex(&coordinates)));
        Ok(Pattern {
            stuck: stuck.to_vec(),
            held,
            redundant,
            frozen,
            lambda,
            shape: complex(&basis) * &modes.shape,
            coordinate,
            input,
            drifting,
            free: &basis * &modes.free,
            free_coordinate: modes.free.transpose() * &coordinates,
            free_input: modes.free.transpose() * &project,
            force_from_state,
            hold,
            hold_projection,
            stiffness,
            multiplier,
            inverse_delassus,
        })
    }

    /// Modal force of a force, length n.
    fn push(&self, k: usize, force: &[f64]) -> Complex64 {
        force.iter().enumerate().map(|(i, f)| self.input[(k, i)] * f).sum()
    }

    /// Where a constant force moves modal coordinate `k`; a mode at λ = 0 drifts instead.
    fn fixed(&self, k: usize, force: &[f64]) -> Complex64 {
        if self.lambda[k] == ZERO { ZERO } else { -self.push(k, force) / self.lambda[k] }
    }

    /// Modal coordinate `k` of displacements and velocities, length 2n.
    fn coordinate(&self, k: usize, state: &[f64]) -> Complex64 {
        state.iter().enumerate().map(|(i, z)| self.coordinate[(k, i)] * z).sum()
    }

    /// Memory that it takes, bytes: matrices of some multiples of n² numbers.
    pub fn bytes(&self) -> usize {
        let complex = self.lambda.len() + self.shape.len() + self.coordinate.len() + self.input.len();
        let real = self.free.len()
            + self.free_coordinate.len()
            + self.free_input.len()
            + self.force_from_state.len()
            + self.hold.len()
            + self.hold_projection.len()
            + self.stiffness.len()
            + self.multiplier.len()
            + self.inverse_delassus.len();
        size_of::<Self>() + 16 * complex + 8 * real + 16 * self.stuck.len()
    }

    /// Steady response and basis at one drive frequency.
    pub fn drive(&self, mechanics: &Mechanics, drive: &Drive) -> Driven {
        let n = mechanics.n;
        let mut driven = Driven { modes: self.lambda.len(), ..Driven::default() };
        driven.basis.exponents = self.lambda.clone();
        driven.basis.exponents.extend(drive.rates.iter().map(|&rate| Complex64::new(0.0, rate)));
        let complex = |m: &DMatrix<f64>| m.map(|x| Complex64::new(x, 0.0));
        for (h, &rate) in drive.rates.iter().enumerate() {
            let s = Complex64::new(0.0, rate);
            let held = DVector::from_fn(self.held.len(), |i, _| drive.imposed[h][self.held[i]]);
            let moved = complex(&self.hold) * held; // S g: the stuck part moves with -S g
            let mut force =
                drive.forces[h].clone() + (complex(&self.stiffness) + complex(&mechanics.damping) * s) * &moved;
            for (i, slider) in mechanics.sliders.iter().enumerate() {
                if let (Some(kt), true) = (slider.stiffness, self.stuck[i]) {
                    force -= complex_vector(&slider.direction) * (drive.imposed[h][i] * kt);
                }
            }
            let mut steady = -moved;
            for (k, &lambda) in self.lambda.iter().enumerate() {
                let forward: Complex64 = (0..n).map(|i| self.input[(k, i)] * force[i]).sum::<Complex64>() * 0.5;
                let backward: Complex64 = (0..n).map(|i| self.input[(k, i)] * force[i].conj()).sum::<Complex64>() * 0.5;
                let near = (s - lambda).norm() <= RESONANT * rate;
                if near && forward != ZERO {
                    driven.resonant.push((k, h, forward));
                    driven.basis.resonant.push((lambda, s - lambda));
                    driven.basis.driven_by.push(self.lambda.len() + h);
                }
                let plus = if near { ZERO } else { forward / (s - lambda) };
                let minus = backward / (-s - lambda);
                for i in 0..n {
                    steady[i] += self.shape[(i, k)] * plus + (self.shape[(i, k)] * minus).conj();
                }
            }
            let free: DVector<Complex64> = complex(&self.free_input) * &force / (s * s);
            steady += complex(&self.free) * &free;
            driven.free_steady.push(free);
            driven.steady.push(steady);
        }
        driven
    }

    /// Coefficients of the displacements (n × basis, one row after the other) for the motion that starts at `time` from `state`.
    pub fn displacement(
        &self,
        mechanics: &Mechanics,
        drive: &Drive,
        Beginning { driven, contacts, time, state }: Beginning<'_>,
        work: &mut Work,
        out: &mut [Complex64],
    ) {
        let (n, nb, count) = (mechanics.n, driven.basis.len(), self.lambda.len());
        let constant = driven.basis.constant();
        out[..n * nb].fill(ZERO);
        // constant force that does not come from the state: loads, slip, imposed motion at the start
        work.force.clear();
        work.force.extend(drive.constant.iter());
        work.held.clear();
        work.held.extend(self.held.iter().map(|&s| drive.imposed_at(s, time, 0)));
        for (i, slider) in mechanics.sliders.iter().enumerate() {
            let value = match (contacts[i], slider.stiffness) {
                (Contact::Stick, None) => continue,
                (Contact::Stick, Some(kt)) => kt * drive.imposed_at(i, time, 0),
                (slip, _) => -slip.sign() * slider.limit,
            };
            for row in 0..n {
                work.force[row] += value * slider.direction[row];
            }
        }
        for row in 0..n {
            // displacement S c with the part of c that imposed motion gives; the part from x0 is in hold_projection
            let shift: f64 = (0..self.held.len()).map(|s| self.hold[(row, s)] * work.held[s]).sum();
            let carried: f64 = (0..n).map(|i| self.hold_projection[(row, i)] * state[i]).sum();
            out[row * nb + constant].re += shift + carried;
            work.shift[row] = shift;
        }
        if work.held.iter().any(|&g| g != 0.0) {
            for row in 0..n {
                for i in 0..n {
                    work.force[row] -= self.stiffness[(row, i)] * work.shift[i];
                }
            }
        }
        for h in 0..drive.rates.len() {
            let (sin, cos) = (drive.rates[h] * time).sin_cos();
            work.turn[h] = Complex64::new(cos, sin);
            for row in 0..n {
                out[row * nb + count + h] = driven.steady[h][row] * work.turn[h];
            }
        }
        for (i, &z) in state.iter().enumerate() {
            for row in 0..n {
                work.force[row] += self.force_from_state[(row, i)] * z;
            }
        }
        for k in 0..count {
            work.fixed[k] = self.fixed(k, &work.force);
            work.eta[k] = self.coordinate(k, &state[..2 * n]) - work.fixed[k];
        }
        self.subtract_steady(mechanics, drive, driven, work);
        for row in 0..n {
            for k in 0..count {
                out[row * nb + k] = self.shape[(row, k)] * work.eta[k];
                out[row * nb + constant].re += (self.shape[(row, k)] * work.fixed[k]).re;
            }
            for (r, (k, h, forward)) in driven.resonant.iter().enumerate() {
                out[row * nb + count + drive.rates.len() + r] = self.shape[(row, *k)] * forward * work.turn[*h];
            }
        }
        self.add_polynomials(mechanics, drive, driven, state, work, out);
    }

    /// η of the steady response, taken off `work.eta`.
    fn subtract_steady(&self, mechanics: &Mechanics, drive: &Drive, driven: &Driven, work: &mut Work) {
        let n = mechanics.n;
        for h in 0..drive.rates.len() {
            let rate = Complex64::new(0.0, drive.rates[h]);
            for i in 0..n {
                let z = driven.steady[h][i] * work.turn[h];
                work.steady[i] = z.re;
                work.steady[n + i] = (z * rate).re;
            }
            for k in 0..self.lambda.len() {
                work.eta[k] -= self.coordinate(k, &work.steady[..2 * n]);
            }
        }
    }

    /// Free directions and drifting modes: 1, τ, τ²/2.
    fn add_polynomials(
        &self,
        mechanics: &Mechanics,
        drive: &Drive,
        driven: &Driven,
        state: &[f64],
        work: &mut Work,
        out: &mut [Complex64],
    ) {
        if self.drifting.is_empty() && self.free.ncols() == 0 {
            return;
        }
        let (n, nb, constant) = (mechanics.n, driven.basis.len(), driven.basis.constant());
        for &k in &self.drifting {
            let drift = self.push(k, &work.force);
            for row in 0..n {
                out[row * nb + constant + 1].re += (self.shape[(row, k)] * drift).re;
            }
        }
        for r in 0..self.free.ncols() {
            let dot = |v: &[f64]| (0..n).map(|i| self.free_coordinate[(r, i)] * v[i]).sum::<f64>();
            let (mut place, mut speed) = (dot(&state[..n]), dot(&state[n..2 * n]));
            for h in 0..drive.rates.len() {
                let z = driven.free_steady[h][r] * work.turn[h];
                place -= z.re;
                speed -= (z * Complex64::new(0.0, drive.rates[h])).re;
            }
            let push: f64 = (0..n).map(|i| self.free_input[(r, i)] * work.force[i]).sum();
            for row in 0..n {
                out[row * nb + constant].re += self.free[(row, r)] * place;
                out[row * nb + constant + 1].re += self.free[(row, r)] * speed;
                out[row * nb + constant + 2].re += self.free[(row, r)] * push;
            }
        }
    }

    /// Carries the columns of `sensitivity` (states × columns) over a stretch whose exponentials at its end are `values`.
    pub fn carry(
        &self,
        mechanics: &Mechanics,
        length: f64,
        values: &[Complex64],
        sensitivity: &mut DMatrix<f64>,
        work: &mut Work,
    ) {
        let (n, count) = (mechanics.n, self.lambda.len());
        for mut column in sensitivity.column_iter_mut() {
            work.column.copy_from_slice(column.as_slice());
            let z = &work.column;
            for row in 0..n {
                work.shift[row] = (0..n).map(|i| self.hold_projection[(row, i)] * z[i]).sum();
                work.steady[row] = 0.0;
            }
            work.force.fill(0.0);
            for (i, &z) in z.iter().enumerate().filter(|(_, z)| **z != 0.0) {
                for row in 0..n {
                    work.force[row] += self.force_from_state[(row, i)] * z;
                }
            }
            for k in 0..count {
                let fixed = self.fixed(k, &work.force);
                let decaying = self.coordinate(k, &z[..2 * n]) - fixed;
                let (now, rate) = (decaying * values[k], decaying * values[k] * self.lambda[k]);
                for row in 0..n {
                    let shape = self.shape[(row, k)];
                    work.shift[row] += (shape * (now + fixed)).re;
                    work.steady[row] += (shape * rate).re;
                }
            }
            if !self.drifting.is_empty() || self.free.ncols() > 0 {
                for &k in &self.drifting {
                    let drift = self.push(k, &work.force);
                    for row in 0..n {
                        let speed = (self.shape[(row, k)] * drift).re;
                        work.shift[row] += speed * length;
                        work.steady[row] += speed;
                    }
                }
                for r in 0..self.free.ncols() {
                    let dot = |v: &[f64]| (0..n).map(|i| self.free_coordinate[(r, i)] * v[i]).sum::<f64>();
                    let (place, speed) = (dot(&z[..n]), dot(&z[n..2 * n]));
                    let push: f64 = (0..n).map(|i| self.free_input[(r, i)] * work.force[i]).sum();
                    for row in 0..n {
                        work.shift[row] +=
                            self.free[(row, r)] * (place + speed * length + 0.5 * push * length * length);
                        work.steady[row] += self.free[(row, r)] * (speed + push * length);
                    }
                }
            }
            for (slider, stuck) in mechanics.sliders.iter().zip(&self.stuck) {
                if let (Some(kt), Some(state)) = (slider.stiffness, slider.state) {
                    column[2 * n + state] = if *stuck {
                        let stretch: f64 = (0..n).map(|i| slider.direction[i] * (work.shift[i] - z[i])).sum();
                        z[2 * n + state] + kt * stretch
                    } else {
                        0.0
                    };
                }
            }
            for row in 0..n {
                column[row] = work.shift[row];
                column[n + row] = work.steady[row];
            }
        }
    }
}

/// Scratch memory of the pattern's formulas.
#[derive(Debug, Clone, Default)]
pub(crate) struct Work {
    force: Vec<f64>,
    held: Vec<f64>,
    shift: Vec<f64>,
    steady: Vec<f64>,
    column: Vec<f64>,
    turn: Vec<Complex64>,
    eta: Vec<Complex64>,
    fixed: Vec<Complex64>,
}

impl Work {
    pub fn new(mechanics: &Mechanics, harmonics: usize) -> Self {
        let n = mechanics.n;
        Work {
            force: vec![0.0; n],
            held: Vec::with_capacity(mechanics.sliders.len()),
            shift: vec![0.0; n],
            steady: vec![0.0; 2 * n],
            column: vec![0.0; mechanics.states()],
            turn: vec![ZERO; harmonics],
            eta: vec![ZERO; 2 * n],
            fixed: vec![ZERO; 2 * n],
        }
    }
}

fn complex_vector(v: &DVector<f64>) -> DVector<Complex64> {
    v.map(|x| Complex64::new(x, 0.0))
}

/// M-orthonormal basis of the displacements that `Wᵀ` maps to zero.
fn free_directions(mass: &DMatrix<f64>, w: &DMatrix<f64>) -> Option<DMatrix<f64>> {
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
    let null: Vec<usize> = (0..n).filter(|&i| eigen.eigenvalues[i] <= REDUNDANT * largest).collect();
    Some(l_inverse.transpose() * eigen.eigenvectors.select_columns(&null))
}

/// Inverse of the Delassus matrix; where stuck contacts are redundant, the one that loads them in proportion to their limits.
fn weighted_inverse(delassus: &DMatrix<f64>, limits: &[f64]) -> Option<DMatrix<f64>> {
    let s = delassus.nrows();
    if s == 0 {
        return Some(DMatrix::zeros(0, 0));
    }
    let weight = DMatrix::from_fn(s, s, |i, j| if i == j { limits[i].sqrt() } else { 0.0 });
    let eigen = eigen::symmetric(&weight * delassus * &weight)?;
    let largest = eigen.eigenvalues.amax();
    let inverse = eigen.eigenvalues.map(|value| if value > REDUNDANT * largest { 1.0 / value } else { 0.0 });
    Some(&weight * &eigen.eigenvectors * DMatrix::from_diagonal(&inverse) * eigen.eigenvectors.transpose() * &weight)
}
