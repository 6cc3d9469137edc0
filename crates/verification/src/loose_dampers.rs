//! Random under-platform dampers that only contacts hold, and their motion in time by an
//! integration that shares no code with the library.
//!
//! The dampers are wedges between a blade and a stiff wall, roofs between two blades, and
//! cylinders, which roll. A constant force presses the damper against two faces. It sticks,
//! slips and separates there.

use crate::Random;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::law::FrictionContact;
use stickslip::model::{Axis, System};
use stickslip::structure::Structure;

/// Settings of the integration.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Steps per period.
    pub steps: usize,
    /// Periods over which the excitation grows from zero.
    pub growth: usize,
    /// Periods after which the integration fails.
    pub periods: usize,
    /// Change of the blades' amplitudes, relative to the largest, below which the motion has
    /// settled.
    pub settled: f64,
}

/// A damper with two faces under one or two blades.
#[derive(Debug, Clone)]
pub struct LooseDamper {
    /// `wedge`, `roof` or `cylinder`.
    pub kind: &'static str,
    /// Mass, damping, stiffness.
    pub matrices: [DMatrix<f64>; 3],
    /// Tangent and normal of each face, over all degrees of freedom.
    pub faces: [[DVector<f64>; 2]; 2],
    /// Tangential and normal stiffness, N/m.
    pub stiffness: [f64; 2],
    /// Coefficient of friction.
    pub friction: f64,
    /// Constant forces, N.
    pub load: DVector<f64>,
    /// Complex amplitudes of the harmonic forces, N.
    pub excitation: DVector<Complex64>,
    /// Excitation frequencies of the tests, rad/s.
    pub frequencies: Vec<f64>,
    /// Degrees of freedom of the blades, which come first.
    pub blades: usize,
}

/// Returns a number uniform in its logarithm.
fn decade(random: &mut Random, low: f64, high: f64) -> f64 {
    low * (high / low).powf(random.unit())
}

/// Returns the damper with this seed.
pub fn loose_damper(seed: u64) -> LooseDamper {
    let mut random = Random::new(seed);
    let kind = ["wedge", "roof", "cylinder"][(seed % 3) as usize];
    let mass = decade(&mut random, 0.05, 2.0);
    let rate = TAU * random.between(60.0, 300.0);
    let damping_ratio = decade(&mut random, 0.003, 0.02);
    let damper = mass * decade(&mut random, 0.005, 0.1);
    let rolls = kind == "cylinder";
    let n = if rolls { 7 } else { 6 };
    let (mut m, mut c, mut k) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n), DMatrix::zeros(n, n));
    let second = if kind == "wedge" { 1000.0 } else { random.between(0.9, 1.1) };
    for (blade, factor) in [(0, 1.0), (1, second)] {
        let (x, z) = (2 * blade, 2 * blade + 1);
        // the wall of a wedge is heavy, stiff and damped
        let wall = factor > 100.0;
        let own = mass * factor;
        let stiffness =
            if wall { 1000.0 * mass * rate * rate } else { mass * rate * rate * random.between(0.98, 1.02) };
        let radial = if wall { stiffness } else { stiffness * decade(&mut random, 20.0, 200.0) };
        for (row, stiffness) in [(x, stiffness), (z, radial)] {
            m[(row, row)] = own;
            k[(row, row)] = stiffness;
            let ratio = if wall { 0.5 } else { damping_ratio };
            c[(row, row)] = 2.0 * ratio * (own * stiffness).sqrt();
        }
    }
    let (dx, dz) = (4, 5);
    (m[(dx, dx)], m[(dz, dz)]) = (damper, damper);
    let radius = 0.004;
    if rolls {
        m[(6, 6)] = 0.5 * damper * radius * radius;
    }
    let kt = decade(&mut random, 1e6, 3e7);
    let stiffness = [kt, kt * random.between(1.0, 1.5)];
    let angle = random.between(20.0f64, 70.0).to_radians();
    let other = (angle + random.between(-0.1, 0.1)).clamp(20f64.to_radians(), 70f64.to_radians());
    let mut faces = [face(n, 0, angle), face(n, 1, other)];
    if rolls {
        // rotation moves the rim along both faces
        (faces[0][0][6], faces[1][0][6]) = (-radius, radius);
    }
    let press = decade(&mut random, 3.0, 3000.0);
    let mut load = DVector::zeros(n);
    load[dz] = press;
    let mut excitation = DVector::from_element(n, Complex64::new(0.0, 0.0));
    let force = press * decade(&mut random, 1e-3, 0.5);
    excitation[0] = Complex64::new(force, 0.0);
    if kind != "wedge" {
        excitation[2] = Complex64::from_polar(force, TAU * random.unit());
    }
    let frequencies = [random.between(0.7, 0.95), random.between(0.97, 1.05), random.between(1.05, 1.4)];
    LooseDamper {
        kind,
        matrices: [m, c, k],
        faces,
        stiffness,
        friction: random.between(0.1, 0.6),
        load,
        excitation,
        frequencies: frequencies.iter().map(|share| share * rate).collect(),
        blades: 4,
    }
}

/// Returns two blades of 250 g with a roof damper of 12 g at 40 degrees under their platforms.
/// The centrifugal load at a radius of 320 mm and a rotation speed in rpm presses the damper.
pub fn roof_damper(speed: f64) -> LooseDamper {
    let diagonal = |values: [f64; 6]| DMatrix::from_diagonal(&DVector::from_row_slice(&values));
    let mut load = DVector::zeros(6);
    load[5] = 0.012 * 0.320 * (speed * TAU / 60.0).powi(2);
    let mut excitation = DVector::from_element(6, Complex64::new(0.0, 0.0));
    excitation[0] = Complex64::new(3.0, 0.0);
    excitation[2] = Complex64::from_polar(3.0, -150f64.to_radians());
    let angle = 40f64.to_radians();
    LooseDamper {
        kind: "roof",
        matrices: [
            diagonal([0.25, 0.25, 0.25, 0.25, 0.012, 0.012]),
            diagonal([0.5, 5.0, 0.5, 5.0, 0.0, 0.0]),
            diagonal([160e3, 20e6, 160e3, 20e6, 0.0, 0.0]),
        ],
        faces: [face(6, 0, angle), face(6, 1, angle)],
        stiffness: [15e6, 20e6],
        friction: 0.25,
        load,
        excitation,
        frequencies: (0..=130).map(|i| TAU * (115.0 + 0.5 * f64::from(i))).collect(),
        blades: 4,
    }
}

/// Returns tangent and normal of the face towards a blade, over all degrees of freedom. The
/// angle is measured from the direction of rotation.
fn face(n: usize, blade: usize, angle: f64) -> [DVector<f64>; 2] {
    let side = if blade == 0 { -1.0 } else { 1.0 };
    let (sine, cosine) = angle.sin_cos();
    let (mut tangent, mut normal) = (DVector::zeros(n), DVector::zeros(n));
    // direction of the damper relative to the blade
    for (row, along, across) in [(0, side * sine, side * cosine), (1, -cosine, sine)] {
        (tangent[4 + row], normal[4 + row]) = (along, across);
        (tangent[2 * blade + row], normal[2 * blade + row]) = (-along, -across);
    }
    [tangent, normal]
}

impl LooseDamper {
    /// Builds the system for the library.
    ///
    /// # Panics
    /// If the matrices are invalid.
    pub fn system(&self) -> System {
        let n = self.load.len();
        let [m, c, k] = self.matrices.clone();
        let names = ["b1.x", "b1.z", "b2.x", "b2.z", "d.x", "d.z", "d.turn"];
        let places = names.iter().take(n).map(|name| (*name).to_owned()).collect();
        let mut builder = System::builder(Structure::new(places, m, c, k).expect("a structure"));
        for (i, axes) in self.faces.iter().enumerate() {
            let law = FrictionContact {
                tangential: self.stiffness[0],
                normal: self.stiffness[1],
                friction: self.friction,
                preload: 0.0,
                tangents: 1,
            };
            let axes = axes
                .iter()
                .map(|axis| Axis::new(axis.iter().copied().enumerate().filter(|(_, weight)| *weight != 0.0).collect()));
            builder = builder.joint(format!("face{i}"), Arc::new(law), axes.collect());
        }
        for row in 0..n {
            builder = builder.force(row, 0, Complex64::new(self.load[row], 0.0)).force(row, 1, self.excitation[row]);
        }
        builder.build().expect("a system")
    }

    /// Returns friction force and normal force of a face after a straight step of its
    /// displacements `from` one point `to` the next.
    fn contact(&self, friction: f64, from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
        let [kt, kn] = self.stiffness;
        let normal = kn * to[1];
        if normal <= 0.0 {
            return [0.0, 0.0];
        }
        let (begin, share) = if from[1] < 0.0 { (0.0, to[1] / (to[1] - from[1])) } else { (friction, 1.0) };
        let limit = self.friction * normal;
        [(begin + kt * (to[0] - from[0]) * share).clamp(-limit, limit), normal]
    }

    /// Returns the displacements along the faces.
    fn along(&self, x: &DVector<f64>) -> [[f64; 2]; 2] {
        [0, 1].map(|face| [0, 1].map(|axis| self.faces[face][axis].dot(x)))
    }

    /// Solves `u = free - G f(u)` for the displacements along the faces; returns them with the
    /// forces.
    fn solve(
        &self,
        gain: &[[f64; 4]; 4],
        free: [f64; 4],
        before: ([[f64; 2]; 2], [f64; 2]),
        guess: [f64; 4],
    ) -> Option<([f64; 4], [f64; 4])> {
        let (from, friction) = before;
        let force = |u: &[f64; 4]| -> [f64; 4] {
            let at = |face: usize| self.contact(friction[face], from[face], [u[2 * face], u[2 * face + 1]]);
            let (one, two) = (at(0), at(1));
            [one[0], one[1], two[0], two[1]]
        };
        let residual = |u: &[f64; 4], f: &[f64; 4]| -> [f64; 4] {
            std::array::from_fn(|i| u[i] - free[i] + (0..4).map(|j| gain[i][j] * f[j]).sum::<f64>())
        };
        let size = |r: &[f64; 4]| r.iter().map(|r| r * r).sum::<f64>().sqrt();
        let mut u = guess;
        let mut f = force(&u);
        let mut r = residual(&u, &f);
        let scale = free.iter().chain(&guess).fold(1e-15, |m: f64, u| m.max(u.abs()));
        for _ in 0..200 {
            if size(&r) <= 1e-14 * scale {
                return Some((u, f));
            }
            // derivatives of the forces: the normal force depends on its own displacement,
            // friction on both displacements of its face
            let mut slopes = [[0.0; 4]; 4];
            for face in 0..2 {
                let (t, n) = (2 * face, 2 * face + 1);
                if f[n] <= 0.0 {
                    continue;
                }
                slopes[n][n] = self.stiffness[1];
                if f[t].abs() >= self.friction * f[n] {
                    slopes[t][n] = self.friction * self.stiffness[1] * f[t].signum();
                } else {
                    slopes[t][t] = self.stiffness[0];
                }
            }
            let mut matrix = [[0.0; 5]; 4];
            for i in 0..4 {
                for j in 0..4 {
                    let slope: f64 = (0..4).map(|k| gain[i][k] * slopes[k][j]).sum();
                    matrix[i][j] = f64::from(u8::from(i == j)) + slope;
                }
                matrix[i][4] = r[i];
            }
            let change = solve_4x4(matrix)?;
            let mut share = 1.0;
            loop {
                let tried: [f64; 4] = std::array::from_fn(|i| u[i] - share * change[i]);
                let g = force(&tried);
                let s = residual(&tried, &g);
                let closer = size(&s) < size(&r);
                if !closer && size(&r) <= 1e-12 * scale {
                    return Some((u, f)); // rounding
                }
                if closer || share < 1e-3 {
                    (u, f, r) = (tried, g, s);
                    break;
                }
                share *= 0.5;
            }
        }
        (size(&r) <= 1e-10 * scale).then_some((u, f))
    }

    /// Returns the displacements due to unit forces along the faces, first along the faces and
    /// then everywhere, for an inverse of the system matrix.
    fn gains(&self, inverse: &DMatrix<f64>) -> ([[f64; 4]; 4], Vec<DVector<f64>>) {
        let axes: Vec<&DVector<f64>> = self.faces.iter().flatten().collect();
        let moved: Vec<DVector<f64>> = axes.iter().map(|axis| inverse * *axis).collect();
        let gain = std::array::from_fn(|i| std::array::from_fn(|j| axes[i].dot(&moved[j])));
        (gain, moved)
    }

    /// Returns the stiffness of the structure with the springs of both closed contacts.
    fn stuck_stiffness(&self) -> DMatrix<f64> {
        let axes = self.faces.iter().flat_map(|face| face.iter().zip(self.stiffness));
        axes.fold(self.matrices[2].clone(), |sum, (axis, stiffness)| sum + axis * axis.transpose() * stiffness)
    }

    /// Returns displacements and friction forces in static equilibrium. The constant load grows
    /// slowly, and every motion is critically damped.
    fn static_equilibrium(&self) -> Option<(DVector<f64>, [f64; 2])> {
        // Steps in which the constant load grows, and steps in which the damper then comes to
        // rest.
        let load_steps: usize = 20_000;
        let n = self.load.len();
        let [m, _, k] = &self.matrices;
        let held = self.stuck_stiffness();
        let damping = |i: usize| 2.0 * (m[(i, i)] * if i < self.blades { k[(i, i)] } else { held[(i, i)] }).sqrt();
        let damping = DMatrix::from_diagonal(&DVector::from_fn(n, |i, _| damping(i)));
        let rate = (k[(0, 0)] / m[(0, 0)]).sqrt();
        // Length of these steps, in periods of a blade.
        let mut motion = DamperMotion::new(self, &damping, 1e-3 * TAU / rate)?;
        for step in 1..=2 * load_steps {
            motion.advance(&self.load * (step as f64 / load_steps as f64).min(1.0))?;
        }
        Some((motion.x, motion.friction))
    }

    /// Returns the amplitudes of the linear motion on two contacts that stick for the whole
    /// period.
    ///
    /// Returns `None` if no constant friction force keeps both contacts within their slip limits
    /// at every instant.
    pub fn stuck(&self, omega: f64) -> Option<Vec<f64>> {
        // Instants of a period at which slip limits are checked.
        let instants: usize = 256;
        let [m, c, _] = &self.matrices;
        let dynamic = (self.stuck_stiffness() - m * (omega * omega)).map(|re| Complex64::new(re, 0.0))
            + c.map(|im| Complex64::new(0.0, omega * im));
        let x = dynamic.lu().solve(&self.excitation)?;
        let (still, _) = self.static_equilibrium()?;
        let sticks = self.faces.iter().zip(self.along(&still)).all(|(face, [_, depth])| {
            let force = |axis: usize| face[axis].map(|w| Complex64::new(w, 0.0)).dot(&x) * self.stiffness[axis];
            let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
            for instant in 0..instants {
                let turn = Complex64::cis(TAU * instant as f64 / instants as f64);
                let [friction, normal] = [0, 1].map(|axis| (force(axis) * turn).re);
                let limit = self.friction * (self.stiffness[1] * depth + normal);
                low = low.max(-limit - friction);
                high = high.min(limit - friction);
            }
            low <= high
        });
        sticks.then(|| x.iter().map(|x| x.norm()).collect())
    }

    /// Returns half the peak-to-peak value of all displacements in the settled motion from
    /// static equilibrium.
    ///
    /// The excitation grows slowly. Returns `None` if the motion does not settle.
    pub fn settled(&self, omega: f64, course: Settings) -> Option<Vec<f64>> {
        // Periods between two compared amplitudes. A prime number, so that motions which repeat
        // after several periods of the excitation do not count as settled.
        let window = 41;
        let Settings { steps, growth, periods, settled } = course;
        let n = self.load.len();
        let mut motion = DamperMotion::new(self, &self.matrices[1], TAU / (omega * steps as f64))?;
        (motion.x, motion.friction) = self.static_equilibrium()?;
        let mut before: Option<Vec<(f64, f64)>> = None;
        let mut ranges = vec![(f64::INFINITY, f64::NEG_INFINITY); n];
        for count in 0..periods {
            for step in 0..steps {
                let done = count as f64 + (step + 1) as f64 / steps as f64;
                let grown = 0.5 * (1.0 - (0.5 * TAU * (done / growth as f64).min(1.0)).cos());
                let turn = Complex64::cis(TAU * (step + 1) as f64 / steps as f64) * grown;
                let load = DVector::from_fn(n, |i, _| self.load[i] + (self.excitation[i] * turn).re);
                motion.advance(load)?;
                for (range, x) in ranges.iter_mut().zip(motion.x.iter()) {
                    *range = (range.0.min(*x), range.1.max(*x));
                }
            }
            if (count + 1) % window == 0 || count + 1 == periods {
                let now: Vec<f64> = ranges.iter().map(|(low, high)| 0.5 * (high - low)).collect();
                let size = now.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
                if let Some(before) = &before {
                    // compare both ends of the range: a cylinder that keeps rolling reaches no
                    // orbit
                    let change = |until: usize| {
                        let pairs = ranges.iter().zip(before).take(until);
                        let ends = pairs.flat_map(|(a, b): (_, &(f64, f64))| [a.0 - b.0, a.1 - b.1]);
                        ends.map(|change: f64| change.abs() / size).fold(0.0, f64::max)
                    };
                    // Tolerance for the damper in tolerances of the blades. The contacts do not
                    // damp the ringing of the damper.
                    let settles = change(self.blades) <= settled && change(n) <= 300.0 * settled;
                    if settles && count > growth + 2 * window {
                        return Some(now);
                    }
                }
                before = Some(ranges.clone());
            }
            if (count + 1) % window == window - 1 {
                // the last period before the amplitudes are compared
                ranges.fill((f64::INFINITY, f64::NEG_INFINITY));
            }
        }
        None
    }
}

/// A motion in steps of average acceleration.
struct DamperMotion<'a> {
    damper: &'a LooseDamper,
    damping: &'a DMatrix<f64>,
    length: f64,
    inverse: DMatrix<f64>,
    gain: [[f64; 4]; 4],
    /// Displacements under unit forces along the faces.
    moved: Vec<DVector<f64>>,
    x: DVector<f64>,
    v: DVector<f64>,
    a: DVector<f64>,
    friction: [f64; 2],
}

impl<'a> DamperMotion<'a> {
    fn new(damper: &'a LooseDamper, damping: &'a DMatrix<f64>, length: f64) -> Option<Self> {
        let [m, _, k] = &damper.matrices;
        let inverse = (m + damping * (0.5 * length) + k * (0.25 * length * length)).try_inverse()?;
        let (gain, moved) = damper.gains(&(&inverse * (0.25 * length * length)));
        let still = DVector::zeros(damper.load.len());
        let (x, v, a) = (still.clone(), still.clone(), still);
        Some(DamperMotion { damper, damping, length, inverse, gain, moved, x, v, a, friction: [0.0; 2] })
    }

    /// Makes one step; `load` acts at its end.
    fn advance(&mut self, load: DVector<f64>) -> Option<()> {
        let h = self.length;
        let ahead = &self.x + &self.v * h + &self.a * (0.25 * h * h);
        let faster = &self.v + &self.a * (0.5 * h);
        let mut next = &self.inverse * (load - self.damping * &faster - &self.damper.matrices[2] * &ahead);
        let free = self.damper.along(&(&ahead + &next * (0.25 * h * h)));
        let from = self.damper.along(&self.x);
        let (_, f) = self.damper.solve(&self.gain, flat(free), (from, self.friction), flat(from))?;
        for (moved, force) in self.moved.iter().zip(f) {
            next -= moved * (force / (0.25 * h * h));
        }
        self.x = ahead + &next * (0.25 * h * h);
        self.v = faster + &next * (0.5 * h);
        self.friction = [f[0], f[2]];
        self.a = next;
        Some(())
    }
}

fn flat([one, two]: [[f64; 2]; 2]) -> [f64; 4] {
    [one[0], one[1], two[0], two[1]]
}

/// Solves four equations with the right-hand side in the last column.
fn solve_4x4(mut matrix: [[f64; 5]; 4]) -> Option<[f64; 4]> {
    for i in 0..4 {
        let pivot = (i..4).max_by(|a, b| matrix[*a][i].abs().total_cmp(&matrix[*b][i].abs()))?;
        matrix.swap(i, pivot);
        if matrix[i][i] == 0.0 {
            return None;
        }
        for row in i + 1..4 {
            let factor = matrix[row][i] / matrix[i][i];
            for column in i..5 {
                matrix[row][column] -= factor * matrix[i][column];
            }
        }
    }
    let mut x = [0.0; 4];
    for i in (0..4).rev() {
        x[i] = (matrix[i][4] - (i + 1..4).map(|j| matrix[i][j] * x[j]).sum::<f64>()) / matrix[i][i];
    }
    Some(x)
}
