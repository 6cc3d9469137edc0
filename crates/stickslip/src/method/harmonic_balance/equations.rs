//! The equations of harmonic balance.
//!
//! What the structure does between the coordinates is its receptance `R`: `c = c_lin - R f` per harmonic. Unknown are
//! - along springs with sliders the motion `c`: `c - c_lin + R f = 0`, `f = f(c)`;
//! - along a law of velocity the force `λ` itself: `λ - P J(λ + ε c') = 0` with the resolvent `J` of the law and `P` the harmonics that
//!   are kept. Where the contact sticks, the force is then free to be what the motion asks for, and no velocity is multiplied by a
//!   penalty stiffness.
//!
//! `ε` is no free parameter: it is the impedance of the structure at the contact at the highest harmonic, the resolution of the series
//! ([`RIPPLE`]). Another ε changes the solution no more than the missing harmonics do.
//!
//! Source: Nacivet, Pierre, Thouverez, Jezequel (2003), "A dynamic Lagrangian frequency-time method".

use super::joints::{Alternation, Coordinate, Element, Map, Velocity};
use super::rest::Rest;
use super::sparse::Sparse;
use crate::method::guess::Guess;
use crate::model::System;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Residual relative to the motion, and to the slip limits, at which the equations count as solved: a thousand times the rounding of a
/// stiff system.
pub(super) const SOLVED: f64 = 1e-10;
/// The penalty ε is the contact's impedance at the highest harmonic times `1 + RIPPLE / highest`. Above that harmonic a series cannot
/// follow the force: with a larger ε it chatters in stick, with a smaller one a passage through zero is blurred. The second term
/// makes the passage sharp where the harmonics are few and do not chatter, so that one harmonic is the describing function.
const RIPPLE: f64 = 30.0;
/// What is added to the diagonal of the force equations, so that forces which nothing decides stay as they are: the mean in a contact
/// that sticks all the time, and forces in redundant contacts. Newton's method leaves this share of the force as an error.
const STAY: [f64; 2] = [1e-9, 1e-12];
/// Where the structure cannot move along a contact, because its motion is imposed, rigid friction changes its sign over this
/// share of the velocity.
const IMPOSED: f64 = 1e-9;
/// The receptance below which motion counts as imposed, relative to that of the excited structure.
const RIGID: f64 = 1e-14;

/// Length of a motion that is none, m: its square is a number still.
const NOTHING: f64 = 1e-150;

/// All that belongs to one number of harmonics.
#[derive(Debug, Clone)]
pub(super) struct Level {
    /// How often the derivative was assembled in the present search.
    pub assembled: usize,
    pub alternation: Alternation,
    /// Receptance per harmonic, q × q.
    receptance: Vec<DMatrix<Complex64>>,
    /// ε per coordinate, N s/m; infinite where the motion is imposed.
    pub(super) penalty: Vec<f64>,
    /// Motion of the coordinates without friction, [q][harmonic].
    pub linear: Vec<Complex64>,
    /// Motion of all places without friction, per harmonic.
    pub free: Vec<DVector<Complex64>>,
    /// In place of receptance and Jacobian, for large systems.
    pub sparse: Option<Sparse>,
    pub(super) tangents: Vec<f64>,
    pub(super) jacobian: Vec<f64>,
    pub(super) residual: Vec<f64>,
    pub(super) before: Motion,
    pub(super) best: Motion,
    pub(super) step: Vec<f64>,
    signal: Vec<Complex64>,
    image: Vec<Complex64>,
    row: Vec<f64>,
}

/// A solution or a start.
#[derive(Debug, Clone, Default)]
pub(super) struct Motion {
    /// Harmonics of the coordinates, [q][harmonic], m.
    pub c: Vec<Complex64>,
    /// Harmonics of the forces along them, N.
    pub force: Vec<Complex64>,
    pub residual: f64,
    pub iterations: usize,
}

impl Motion {
    pub fn rest(length: usize) -> Self {
        Motion { c: vec![ZERO; length], force: vec![ZERO; length], ..Motion::default() }
    }

    /// The same without new memory.
    pub fn copy(&mut self, other: &Motion) {
        self.c.clone_from(&other.c);
        self.force.clone_from(&other.force);
        (self.residual, self.iterations) = (other.residual, other.iterations);
    }
}

/// The equations between the given ones and those that are easier to solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ease {
    /// Factor on slip limits.
    pub limits: f64,
    /// Factor on the penalty.
    pub penalty: f64,
}

pub(super) const GIVEN: Ease = Ease { limits: 1.0, penalty: 1.0 };

impl Level {
    pub fn new(harmonics: Vec<usize>, samples: usize, coordinates: usize, sparse: Option<Sparse>) -> Self {
        let nh = harmonics.len();
        let size = 2 * nh * coordinates;
        Level {
            assembled: 0,
            alternation: Alternation::new(harmonics, samples),
            receptance: Vec::new(),
            penalty: vec![0.0; coordinates],
            linear: vec![ZERO; nh * coordinates],
            free: Vec::new(),
            tangents: vec![0.0; 4 * nh * nh * coordinates],
            jacobian: vec![0.0; if sparse.is_some() { 0 } else { size * size }],
            sparse,
            residual: vec![0.0; size],
            before: Motion::rest(nh * coordinates),
            best: Motion::rest(nh * coordinates),
            step: vec![0.0; size],
            signal: vec![ZERO; nh],
            image: vec![ZERO; nh],
            row: vec![0.0; 2 * nh],
        }
    }

    pub fn harmonics(&self) -> &[usize] {
        &self.alternation.harmonics
    }

    /// Prepares for a drive frequency.
    pub fn drive(&mut self, system: &System, coordinates: &[Coordinate], rest: &Rest, omega: f64) {
        let n = system.dofs();
        let excitation = system.excitation(omega);
        let nh = self.harmonics().len();
        self.receptance.clear();
        self.free.clear();
        if let Some(sparse) = &mut self.sparse
            && !sparse.drive(omega)
        {
            // a singular frequency: the next number has none of its zeros
            sparse.drive(omega * (1.0 + f64::EPSILON));
        }
        for k in 0..nh {
            let h = self.alternation.harmonics[k];
            let load = excitation.iter().find(|(number, _)| *number as usize == h);
            let mut free = DVector::from_element(n, ZERO);
            if let Some(sparse) = &mut self.sparse {
                if let Some((_, force)) = load {
                    sparse.respond(k, |i| force[i], free.as_mut_slice());
                }
            } else {
                let mut receptance = rest.receptance(h, omega);
                for (q, coordinate) in coordinates.iter().enumerate() {
                    receptance[(q, q)] += coordinate.series;
                }
                self.receptance.push(receptance);
                if let Some((_, force)) = load {
                    free = rest.respond(h, omega, force);
                }
            }
            for (q, coordinate) in coordinates.iter().enumerate() {
                let joint = &system.joints()[coordinate.joint];
                let imposed = joint.axes()[0].imposed_at(h as u32);
                let u: Complex64 = joint.axes()[0].along_complex(&free);
                self.linear[q * nh + k] = u + imposed;
            }
            self.free.push(free);
        }
        let top = self.alternation.harmonics[nh - 1].max(1);
        let stiff = 1.0
            / system
                .structure()
                .stiffness()
                .amax()
                .max(omega * omega * system.structure().mass().amax())
                .max(f64::MIN_POSITIVE);
        if !coordinates.iter().any(|c| matches!(c.element, Element::Velocity(_))) {
            return;
        }
        // on the real axis: the impedance of the highest harmonic without the resonances that it may meet
        let rate = top as f64 * omega;
        let smooth = match &mut self.sparse {
            Some(sparse) => sparse.own_at(rate),
            None => {
                let receptance = rest.receptance_at(Complex64::new(rate, 0.0), omega);
                (0..coordinates.len()).map(|q| receptance[(q, q)].norm()).collect()
            }
        };
        for (q, coordinate) in coordinates.iter().enumerate() {
            if !matches!(coordinate.element, Element::Velocity(_)) {
                continue;
            }
            let receptance: f64 = smooth[q] + coordinate.series;
            let imposed = coordinate.series == 0.0 && receptance <= RIGID * stiff / (top * top) as f64;
            self.penalty[q] = if imposed { f64::INFINITY } else { penalty(receptance, top, omega) };
        }
    }

    /// The motion to begin with: that of the describing functions, or without friction.
    pub fn begin(&self, system: &System, coordinates: &[Coordinate], guess: Option<&Guess>, omega: f64) -> Motion {
        let nh = self.harmonics().len();
        let mut motion = Motion { c: self.linear.clone(), ..Motion::rest(self.linear.len()) };
        let Some(guess) = guess else { return motion };
        for (q, coordinate) in coordinates.iter().enumerate() {
            let joint = &system.joints()[coordinate.joint];
            for (rate, x) in &guess.harmonics {
                let h = (rate / omega).round() as usize;
                let Ok(k) = self.harmonics().binary_search(&h) else { continue };
                let imposed = joint.axes()[0].imposed_at(h as u32);
                let u = joint.axes()[0].along_complex(x) + imposed;
                let force = guess.joints[coordinate.joint] * u;
                if !force.is_finite() {
                    continue; // rigid friction that does not move at all
                }
                motion.c[q * nh + k] = u - force * coordinate.series;
                motion.force[q * nh + k] = force;
            }
        }
        motion
    }

    /// Forces and residual at the unknowns in `motion`; the rest of it follows. The derivative goes into `self.tangents` and, in the dense
    /// form, `self.jacobian` if `tangent`. Returns the size of the residual, relative.
    pub fn evaluate(
        &mut self,
        coordinates: &[Coordinate],
        omega: f64,
        motion: &mut Motion,
        ease: Ease,
        length: f64,
        tangent: bool,
    ) -> f64 {
        self.assembled += usize::from(tangent);
        let (nh, count) = (self.harmonics().len(), coordinates.len());
        let block = 4 * nh * nh;
        for (q, coordinate) in coordinates.iter().enumerate() {
            if let Element::Springs(springs) = &coordinate.element {
                let range = q * nh..(q + 1) * nh;
                let slot = tangent.then_some(&mut self.tangents[q * block..(q + 1) * block]);
                let (c, force) = (&motion.c[range.clone()], &mut motion.force[range]);
                self.alternation.springs(springs, ease.limits, c, force, slot);
            }
        }
        // what the structure does: into the residual of motions, and into the motions whose force is unknown
        for k in 0..nh {
            let (residual, linear) = (&mut self.residual, &self.linear);
            let (c, force) = (&mut motion.c, &motion.force);
            let mut follow = |q: usize, u: Complex64| {
                let at = q * nh + k;
                let moved = linear[at] - u;
                if matches!(coordinates[q].element, Element::Springs(_)) {
                    let r = c[at] - moved;
                    (residual[2 * at], residual[2 * at + 1]) = (r.re, r.im);
                } else {
                    c[at] = moved;
                }
            };
            match &mut self.sparse {
                Some(sparse) => sparse.receive(k, |q| force[q * nh + k], follow),
                None => {
                    for q in 0..count {
                        follow(q, (0..count).map(|p| self.receptance[k][(q, p)] * force[p * nh + k]).sum());
                    }
                }
            }
        }
        for (q, coordinate) in coordinates.iter().enumerate() {
            let Element::Velocity(law) = coordinate.element else { continue };
            let range = q * nh..(q + 1) * nh;
            let law = Velocity { limit: law.limit * ease.limits, ..law };
            let penalty = self.penalty[q] * ease.penalty;
            let (c, force) = (&motion.c[range.clone()], &motion.force[range]);
            let slot = &mut self.tangents[q * block..(q + 1) * block];
            slot.fill(0.0);
            let slot = tangent.then_some(slot);
            apply(&mut self.alternation, (law, penalty), omega, (c, force), (&mut self.signal, &mut self.image), slot);
            for k in 0..nh {
                let r = force[k] - self.image[k];
                let at = 2 * (q * nh + k);
                (self.residual[at], self.residual[at + 1]) = (r.re, r.im);
            }
        }
        if tangent && self.sparse.is_none() {
            self.assemble(coordinates, omega, ease, length);
        }
        // relative to the motion, weighted as velocities are, and to the limits
        let mut sum = 0.0;
        for (q, coordinate) in coordinates.iter().enumerate() {
            for (k, &h) in self.alternation.harmonics.iter().enumerate() {
                let at = 2 * (q * nh + k);
                let square = self.residual[at] * self.residual[at] + self.residual[at + 1] * self.residual[at + 1];
                let unit = unit(coordinate, length);
                let weight = if matches!(coordinate.element, Element::Springs(_)) { weight(h) } else { 1.0 };
                sum += square * weight / (unit * unit);
            }
        }
        sum.sqrt()
    }

    /// Samples of the force of a law of velocity, into the alternation.
    pub fn apply(&mut self, law: Velocity, q: usize, omega: f64, motion: &Motion) {
        let nh = self.harmonics().len();
        let range = q * nh..(q + 1) * nh;
        let along = (&motion.c[range.clone()], &motion.force[range]);
        let memory = (&mut self.signal[..], &mut self.image[..]);
        apply(&mut self.alternation, (law, self.penalty[q]), omega, along, memory, None);
    }

    /// Forces of all coordinates at the harmonics `wanted`, from the samples: they may lie above those that are kept. Per harmonic.
    pub fn forces_at(
        &mut self,
        coordinates: &[Coordinate],
        omega: f64,
        motion: &Motion,
        wanted: &[usize],
    ) -> Vec<Vec<Complex64>> {
        let nh = self.harmonics().len();
        let mut forces = vec![vec![ZERO; coordinates.len()]; wanted.len()];
        for (q, coordinate) in coordinates.iter().enumerate() {
            match &coordinate.element {
                Element::Springs(springs) => {
                    let c = &motion.c[q * nh..(q + 1) * nh];
                    self.alternation.synthesise(c);
                    for spring in springs {
                        self.alternation.slide(spring, 1.0, c);
                        self.alternation.add_harmonics(wanted, |k, f| forces[k][q] += f);
                    }
                }
                Element::Velocity(law) => {
                    self.apply(*law, q, omega, motion);
                    self.alternation.add_harmonics(wanted, |k, f| forces[k][q] += f);
                }
            }
        }
        forces
    }

    /// The Jacobian from the tangents: rows and columns in units of the motion's length and of the limits.
    fn assemble(&mut self, coordinates: &[Coordinate], omega: f64, ease: Ease, length: f64) {
        let (nh, count) = (self.harmonics().len(), coordinates.len());
        let (block, width) = (4 * nh * nh, 2 * nh);
        let size = width * count;
        self.jacobian.fill(0.0);
        for (q, row) in coordinates.iter().enumerate() {
            for (p, column) in coordinates.iter().enumerate() {
                let scale = unit(column, length) / unit(row, length);
                let (tangents, receptance) = (&self.tangents, &self.receptance);
                let own = &tangents[q * block..(q + 1) * block];
                let other = &tangents[p * block..(p + 1) * block];
                let corner = q * width * size + p * width;
                match (&row.element, &column.element) {
                    (Element::Springs(_), Element::Springs(_)) => {
                        // R K
                        for k in 0..nh {
                            let r = receptance[k][(q, p)] * scale;
                            let (re, im) = (
                                &other[2 * k * width..(2 * k + 1) * width],
                                &other[(2 * k + 1) * width..(2 * k + 2) * width],
                            );
                            let (first, second) = self.jacobian[corner + 2 * k * size..].split_at_mut(size);
                            for b in 0..width {
                                first[b] += r.re * re[b] - r.im * im[b];
                                second[b] += r.re * im[b] + r.im * re[b];
                            }
                        }
                    }
                    (Element::Springs(_), Element::Velocity(_)) => {
                        for k in 0..nh {
                            let r = receptance[k][(q, p)] * scale;
                            let at = corner + 2 * k * size + 2 * k;
                            self.jacobian[at] += r.re;
                            self.jacobian[at + 1] -= r.im;
                            self.jacobian[at + size] += r.im;
                            self.jacobian[at + size + 1] += r.re;
                        }
                    }
                    (Element::Velocity(_), _) if self.penalty[q].is_infinite() => {}
                    (Element::Velocity(_), Element::Velocity(_)) => {
                        // ε T D R
                        for (k, &h) in self.alternation.harmonics.iter().enumerate() {
                            let turn = Complex64::new(0.0, self.penalty[q] * ease.penalty * h as f64 * omega);
                            let z = turn * receptance[k][(q, p)] * scale;
                            for a in 0..width {
                                let (x, y) = (own[a * width + 2 * k], own[a * width + 2 * k + 1]);
                                let at = corner + a * size + 2 * k;
                                self.jacobian[at] += x * z.re + y * z.im;
                                self.jacobian[at + 1] += y * z.re - x * z.im;
                            }
                        }
                    }
                    (Element::Velocity(_), Element::Springs(_)) => {
                        // ε T D R K
                        for a in 0..width {
                            self.row.fill(0.0);
                            for (k, &h) in self.alternation.harmonics.iter().enumerate() {
                                let turn = Complex64::new(0.0, self.penalty[q] * ease.penalty * h as f64 * omega);
                                let z = turn * receptance[k][(q, p)] * scale;
                                let (x, y) = (own[a * width + 2 * k], own[a * width + 2 * k + 1]);
                                let (x, y) = (x * z.re + y * z.im, y * z.re - x * z.im);
                                let (re, im) = (
                                    &other[2 * k * width..(2 * k + 1) * width],
                                    &other[(2 * k + 1) * width..(2 * k + 2) * width],
                                );
                                for (sum, (re, im)) in self.row.iter_mut().zip(re.iter().zip(im)) {
                                    *sum += x * re + y * im;
                                }
                            }
                            let at = corner + a * size;
                            for (j, sum) in self.jacobian[at..at + width].iter_mut().zip(&self.row) {
                                *j += sum;
                            }
                        }
                    }
                }
            }
            let forces = matches!(row.element, Element::Velocity(_));
            for a in 0..width {
                let at = (q * width + a) * size + q * width;
                if forces {
                    let own = &self.tangents[q * block + a * width..q * block + (a + 1) * width];
                    for (j, t) in self.jacobian[at..at + width].iter_mut().zip(own) {
                        *j -= t;
                    }
                }
                self.jacobian[at + a] += 1.0 + if forces { stay(self.alternation.harmonics[a / 2]) } else { 0.0 };
            }
        }
    }

    /// Residual of the equations at `unknowns` (per coordinate a motion or a force, relative to [`unit`]) into `residual`, in the same
    /// units; the derivative into `jacobian`, row-major. Only in the dense form.
    pub fn residual_at(
        &mut self,
        coordinates: &[Coordinate],
        omega: f64,
        (unknowns, length): (&[f64], f64),
        motion: &mut Motion,
        residual: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) {
        self.unpack(coordinates, (unknowns, length), motion);
        self.evaluate(coordinates, omega, motion, GIVEN, length, jacobian.is_some());
        let width = 2 * self.harmonics().len();
        for (i, (out, r)) in residual.iter_mut().zip(&self.residual).enumerate() {
            *out = r / unit(&coordinates[i / width], length);
        }
        if let Some(jacobian) = jacobian {
            jacobian.copy_from_slice(&self.jacobian);
        }
    }

    /// The unknowns of a motion, see [`Level::residual_at`].
    pub fn pack(&self, coordinates: &[Coordinate], motion: &Motion, length: f64) -> Vec<f64> {
        let nh = self.harmonics().len();
        let value = |i: usize| {
            let coordinate = &coordinates[i / nh];
            let values = if matches!(coordinate.element, Element::Springs(_)) { &motion.c } else { &motion.force };
            values[i] / unit(coordinate, length)
        };
        (0..nh * coordinates.len()).flat_map(|i| [value(i).re, value(i).im]).collect()
    }

    /// The other way round.
    pub fn unpack(&self, coordinates: &[Coordinate], (unknowns, length): (&[f64], f64), motion: &mut Motion) {
        let nh = self.harmonics().len();
        for (i, pair) in unknowns.chunks_exact(2).enumerate() {
            let coordinate = &coordinates[i / nh];
            let value = Complex64::new(pair[0], pair[1]) * unit(coordinate, length);
            match coordinate.element {
                Element::Springs(_) => motion.c[i] = value,
                Element::Velocity(_) => motion.force[i] = value,
            }
        }
    }

    /// The yardstick of motions: their size, or a hundredth of that without friction, as velocities relative to the drive frequency.
    pub fn length(&self, motion: &Motion) -> f64 {
        let nh = self.alternation.harmonics.len();
        let norm = |c: &[Complex64]| {
            c.iter()
                .enumerate()
                .map(|(i, z)| z.norm_sqr() * weight(self.alternation.harmonics[i % nh]))
                .sum::<f64>()
                .sqrt()
        };
        (norm(&motion.c) + 1e-2 * norm(&self.linear)).max(NOTHING)
    }
}

/// The penalty ε (N s/m) of a contact with the receptance (m/N) of the highest harmonic `top`, see [`RIPPLE`].
pub(super) fn penalty(receptance: f64, top: usize, omega: f64) -> f64 {
    let impedance = 1.0 / (receptance * top as f64 * omega);
    impedance * (1.0 + RIPPLE / top as f64)
}

/// The image of a force λ along a motion c: `P J(λ + ε c')`, or the law itself where the motion is imposed, which λ does not change.
pub(super) fn apply(
    alternation: &mut Alternation,
    (law, penalty): (Velocity, f64),
    omega: f64,
    (c, force): (&[Complex64], &[Complex64]),
    (signal, image): (&mut [Complex64], &mut [Complex64]),
    tangent: Option<&mut [f64]>,
) {
    if penalty.is_infinite() {
        let speed: f64 = c.iter().zip(&alternation.harmonics).map(|(c, &h)| c.norm() * h as f64 * omega).sum();
        return alternation.velocity(law, IMPOSED * speed, omega, c, image);
    }
    for (k, &h) in alternation.harmonics.iter().enumerate() {
        signal[k] = force[k] + c[k] * Complex64::new(0.0, penalty * h as f64 * omega);
    }
    let map = if law.is_rigid() {
        Map::Projection { limit: law.limit }
    } else {
        Map::Resolvent { limit: law.limit, alpha: law.alpha, penalty }
    };
    alternation.map(map, signal, image, tangent);
}

/// Unit of a coordinate's unknown: the motion's length, m, or the slip limit, N.
pub(super) fn unit(coordinate: &Coordinate, length: f64) -> f64 {
    match &coordinate.element {
        Element::Springs(_) => length,
        Element::Velocity(law) => law.limit,
    }
}

/// See [`STAY`].
pub(super) fn stay(h: usize) -> f64 {
    STAY[h.min(1)]
}

/// Weight of a harmonic in norms: that of its velocity.
fn weight(h: usize) -> f64 {
    ((h * h) as f64).max(1.0)
}

/// `motion` with other harmonics: those that are new are zero.
pub(super) fn transfer(motion: &Motion, from: &[usize], to: &[usize], coordinates: usize) -> Motion {
    let pick = |values: &[Complex64]| {
        let mut out = Vec::with_capacity(coordinates * to.len());
        for q in 0..coordinates {
            for h in to {
                let at = from.binary_search(h).ok();
                out.push(at.map_or(ZERO, |k| values[q * from.len() + k]));
            }
        }
        out
    };
    Motion { c: pick(&motion.c), force: pick(&motion.force), ..*motion }
}

#[cfg(test)]
mod tests {
    use super::super::{joints, path};
    use super::*;
    use crate::law::{Coulomb, CoulombArctan, Jenkins, JenkinsArctan, SharedLaw};
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring, example};
    use std::sync::Arc;

    /// A row of masses with joints of every law between them, driven with or without a mean.
    fn mixed(masses: usize, constant: f64) -> System {
        let name = |i: usize| format!("m{i}");
        let mut model = Model::default();
        let laws: [SharedLaw; 4] = [
            Arc::new(Jenkins { stiffness: 2.0, limit: 0.3 }),
            Arc::new(Coulomb { limit: 0.2 }),
            Arc::new(CoulombArctan { limit: 0.25, alpha: 5.0 }),
            Arc::new(JenkinsArctan { stiffness: 3.0, limit: 0.2, alpha: 8.0 }),
        ];
        for i in 0..masses {
            model.masses.push(Mass::new(name(i), 1.0 + 0.1 * i as f64));
            model.springs.push(Spring { between: [name(i), GROUND.into()], stiffness: 1.0, damping: 0.05 });
            if i > 0 {
                let law = laws[i % if masses < 10 { 4 } else { 3 }].clone();
                model.joints.push(Joint { name: format!("j{i}"), between: [name(i - 1), name(i)], law });
            }
        }
        model.forces.push(Force { on: name(0), amplitude: 1.0, phase: 0.2, harmonic: 1 });
        if constant != 0.0 {
            model.forces.push(Force { on: name(1), amplitude: constant, phase: 0.0, harmonic: 0 });
        }
        model.assemble().unwrap()
    }

    struct Case {
        system: System,
        coordinates: Vec<Coordinate>,
        rest: Rest,
        omega: f64,
    }

    impl Case {
        fn new(system: System, omega: f64) -> Self {
            let coordinates = joints::coordinates(&system).unwrap();
            let rest = Rest::new(&system, &coordinates);
            Case { system, coordinates, rest, omega }
        }

        fn level(&self, harmonics: Vec<usize>, sparse: bool) -> Level {
            let sparse = sparse.then(|| Sparse::new(&self.system, &self.coordinates, &harmonics).unwrap());
            let samples = 256.max(16 * harmonics[harmonics.len() - 1]);
            let mut level = Level::new(harmonics, samples, self.coordinates.len(), sparse);
            level.drive(&self.system, &self.coordinates, &self.rest, self.omega);
            level
        }
    }

    /// Values without a pattern between -1 and 1.
    fn noise(i: usize) -> f64 {
        ((i * 7919 + 13) as f64).sin()
    }

    /// The Jacobian against central differences, for all laws together, with and without a mean.
    #[test]
    fn the_jacobian_is_the_derivative() {
        for (constant, harmonics) in [(0.0, vec![1, 3, 5]), (0.2, vec![0, 1, 2, 3])] {
            let case = Case::new(mixed(6, constant), 0.9);
            let mut level = case.level(harmonics, false);
            let size = level.residual.len();
            let mut motion = Motion::rest(level.linear.len());
            // the mean has no imaginary part
            let real = |i: usize| level.harmonics()[(i / 2) % level.harmonics().len()] == 0 && i % 2 == 1;
            let x: Vec<f64> = (0..size).map(|i| if real(i) { 0.0 } else { 0.4 * noise(i) }).collect();
            let imaginary: Vec<bool> = (0..size).map(real).collect();
            let (mut r, mut j) = (vec![0.0; size], vec![0.0; size * size]);
            let mut at = |x: &[f64], j: Option<&mut [f64]>| {
                level.residual_at(&case.coordinates, case.omega, (x, 1.5), &mut motion, &mut r, j);
                r.clone()
            };
            at(&x, Some(&mut j));
            let step = 1e-6;
            // a turning point is taken to move with the motion at its time, and not with the parabola through three samples that finds it
            let parabola = (5.0 * std::f64::consts::TAU / 256.0f64).powi(3);
            let largest = j.iter().fold(0.0, |m: f64, j| m.max(j.abs()));
            let mut wrong = 0;
            for k in (0..size).filter(|&k| !imaginary[k]) {
                let moved = |by: f64| {
                    let mut x = x.clone();
                    x[k] += by;
                    x
                };
                let (up, down) = (at(&moved(step), None), at(&moved(-step), None));
                for i in 0..size {
                    let difference = (up[i] - down[i]) / (2.0 * step);
                    wrong += usize::from((difference - j[i * size + k]).abs() > parabola * largest);
                }
            }
            assert_eq!(wrong, 0, "of {}", size * size);
        }
    }

    /// The banded form finds the motion of the dense one, with every law that it takes.
    #[test]
    fn banded_and_dense_agree() {
        let case = Case::new(mixed(44, 0.0), 0.9);
        let solve = |sparse: bool| {
            let mut level = case.level(vec![1, 3, 5], sparse);
            let start = level.begin(&case.system, &case.coordinates, None, case.omega);
            level.solve(&case.coordinates, case.omega, start).unwrap()
        };
        let (dense, banded) = (solve(false), solve(true));
        for (a, b) in dense.c.iter().zip(&banded.c).chain(dense.force.iter().zip(&banded.force)) {
            assert!((a - b).norm() < 1e-8, "{a} {b}");
        }
    }

    /// ε belongs to the resolution, and is no stiffness: half and double of it change a curve by no more than the missing harmonics do, and
    /// the less, the more harmonics there are.
    #[test]
    fn the_penalty_matters_no_more_than_missing_harmonics() {
        for limit in [2.0, 4.0, 6.0, 8.0] {
            let (mut missing, mut few, mut many) = (0.0f64, 0.0f64, 0.0f64);
            for hertz in [120.0, 121.0, 121.1, 121.25, 122.0] {
                let mut couple = example::blade_couple();
                couple.joints[0].law = Arc::new(Coulomb { limit });
                let system = couple.assemble().unwrap();
                let case = Case::new(system, std::f64::consts::TAU * hertz);
                let solution = |top: usize, factor: f64| {
                    let mut level = case.level((1..=top).step_by(2).collect(), false);
                    level.penalty[0] *= factor;
                    let start = level.begin(&case.system, &case.coordinates, None, case.omega);
                    let motion = level.solve(&case.coordinates, case.omega, start).unwrap();
                    path::places(&mut level, &case.rest, case.omega, &motion)
                };
                let distance = |a: &[DVector<Complex64>], b: &[DVector<Complex64>]| {
                    let zero = DVector::from_element(3, ZERO);
                    let apart = b.iter().enumerate().map(|(k, b)| (a.get(k).unwrap_or(&zero) - b).norm_squared());
                    apart.sum::<f64>().sqrt() / b[0].norm()
                };
                let (given, better) = (solution(15, 1.0), solution(63, 1.0));
                missing = missing.max(distance(&given, &better));
                for factor in [0.5, 2.0] {
                    few = few.max(distance(&given, &solution(15, factor)));
                    many = many.max(distance(&better, &solution(63, factor)));
                }
            }
            assert!(few <= missing + 1e-9 && many <= 0.7 * few + 1e-9, "{limit} N: {missing:.1e} {few:.1e} {many:.1e}");
        }
    }
}
