//! Orbits without stick of any linear structure with one Coulomb contact: theory section 8
//! against event-driven orbits.
//!
//! The closed form here uses the matrix exponential (without the library's numerics) and the
//! Fourier series 8.4. Source: Den Hartog (1931) and Ferri and Dowell (1988), with damping and
//! many degrees of freedom.

#![allow(clippy::print_stdout)] // tests print measured values

use num_complex::Complex64;
use std::f64::consts::{PI, TAU};
use stickslip::model::System;
use stickslip_verification::{close, exact, near, template, zero};

type Matrix<T> = Vec<Vec<T>>;

/// Intervals of half a period in which the closed form is scanned for turning points and for
/// reversals of the sliding velocity.
const NODES: usize = 400;

/// Solves `A X = B` by Gaussian elimination with partial pivoting.
fn solve(a: &Matrix<Complex64>, b: &Matrix<Complex64>) -> Matrix<Complex64> {
    let (n, mut a, mut b) = (a.len(), a.clone(), b.clone());
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i][k].norm().total_cmp(&a[j][k].norm())).unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            for j in k..n {
                let value = a[k][j];
                a[i][j] -= factor * value;
            }
            for j in 0..b[i].len() {
                let value = b[k][j];
                b[i][j] -= factor * value;
            }
        }
    }
    for k in (0..n).rev() {
        for j in 0..b[k].len() {
            let known: Complex64 = (k + 1..n).map(|i| a[k][i] * b[i][j]).sum();
            b[k][j] = (b[k][j] - known) / a[k][k];
        }
    }
    b
}

fn product(a: &Matrix<f64>, b: &Matrix<f64>) -> Matrix<f64> {
    let columns = b[0].len();
    a.iter().map(|row| (0..columns).map(|j| row.iter().zip(b).map(|(x, b)| x * b[j]).sum()).collect()).collect()
}

fn times(a: &Matrix<f64>, x: &[f64]) -> Vec<f64> {
    a.iter().map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum()).collect()
}

/// Returns `exp(A t)` by scaling and squaring of the Taylor series.
fn exponential(a: &Matrix<f64>, t: f64) -> Matrix<f64> {
    let n = a.len();
    let norm = a.iter().map(|row| row.iter().map(|x| (x * t).abs()).sum::<f64>()).fold(0.0, f64::max);
    let squarings = norm.log2().ceil().max(0.0) as i32 + 4;
    let step = t * 0.5f64.powi(squarings);
    let identity = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
    let mut term: Matrix<f64> = (0..n).map(|i| (0..n).map(|j| identity(i, j)).collect()).collect();
    let mut sum = term.clone();
    for k in 1..20 {
        term = product(&term, a);
        for i in 0..n {
            for j in 0..n {
                term[i][j] *= step / f64::from(k);
                sum[i][j] += term[i][j];
            }
        }
    }
    for _ in 0..squarings {
        sum = product(&sum, &sum);
    }
    sum
}

/// `z' = A z + g cos(wt) - h s(t)`, with displacements before velocities and the sliding
/// velocity `c z`.
#[derive(Clone)]
struct Line {
    n: usize,
    a: Matrix<f64>,
    g: Vec<f64>,
    h: Vec<f64>,
    c: Vec<f64>,
}

impl Line {
    /// Builds the equations. Displacements are scaled by `rate`, so that they have the size of
    /// velocities.
    fn new(system: &System, rate: f64) -> Line {
        let n = system.dofs();
        assert_eq!(system.joints().len(), 1);
        let w = system.joints()[0].axes()[0].dense(system.dofs());
        let mut a = vec![vec![0.0; 2 * n]; 2 * n];
        let (mut g, mut h, mut c) = (vec![0.0; 2 * n], vec![0.0; 2 * n], vec![0.0; 2 * n]);
        let force = &system.excitation(rate)[0].1;
        for i in 0..n {
            let mass = system.structure().mass()[(i, i)]; // point masses: diagonal
            a[i][n + i] = rate;
            for k in 0..n {
                a[n + i][k] = -system.structure().stiffness()[(i, k)] / mass / rate;
                a[n + i][n + k] = -system.structure().damping()[(i, k)] / mass;
            }
            g[n + i] = force[i].re / mass;
            h[n + i] = w[i] * system.joints()[0].law().force_scale() / mass;
            c[n + i] = w[i];
        }
        Line { n, a, g, h, c }
    }
}

/// One orbit of 8.1: `z(t0 + t) = exp(A t) y0 + q + Re(zp e^{j(psi + wt)})`.
struct Closed {
    line: Line,
    y0: Vec<f64>,
    q: Vec<f64>,
    zp: Vec<Complex64>,
    psi: f64,
    omega: f64,
}

impl Closed {
    /// Returns the scaled state at `t` in `[0, T/2]` after the reversal.
    fn at(&self, t: f64) -> Vec<f64> {
        let free = times(&exponential(&self.line.a, t), &self.y0);
        let turn = Complex64::from_polar(1.0, self.psi + self.omega * t);
        (0..free.len()).map(|i| free[i] + self.q[i] + (self.zp[i] * turn).re).collect()
    }

    /// Returns the scaled states at `NODES + 1` instants over `[0, T/2]`.
    fn nodes(&self) -> Vec<Vec<f64>> {
        let step = PI / self.omega / NODES as f64;
        let (carry, mut free) = (exponential(&self.line.a, step), self.y0.clone());
        let mut nodes = Vec::new();
        for k in 0..=NODES {
            let turn = Complex64::from_polar(1.0, self.psi + self.omega * step * k as f64);
            nodes.push((0..free.len()).map(|i| free[i] + self.q[i] + (self.zp[i] * turn).re).collect());
            free = times(&carry, &free);
        }
        nodes
    }

    /// Returns displacement (m) and velocity of place `i` at the time `t` of the excitation.
    fn motion(&self, i: usize, t: f64) -> (f64, f64) {
        let half = PI / self.omega;
        let since = (t - self.psi / self.omega).rem_euclid(2.0 * half);
        let (since, sign) = if since >= half { (since - half, -1.0) } else { (since, 1.0) };
        let z = self.at(since);
        (sign * z[i] / self.omega, sign * z[self.line.n + i])
    }

    /// Returns the largest displacement, from zeros of the velocity between the nodes.
    fn amplitude(&self, i: usize) -> f64 {
        let (step, n, nodes) = (PI / self.omega / NODES as f64, self.line.n, self.nodes());
        let mut largest = 0.0f64;
        for k in 0..NODES {
            largest = largest.max(nodes[k][i].abs());
            if nodes[k][n + i] * nodes[k + 1][n + i] < 0.0 {
                let turning = zero(|t| self.at(t)[n + i], [k, k + 1].map(|k| step * k as f64));
                largest = largest.max(self.at(turning)[i].abs());
            }
        }
        largest / self.omega
    }
}

/// Returns the orbit of section 8 if the conditions 8.2 and 8.3 for motion without stick hold.
fn two_reversals(system: &System, omega: f64) -> Option<Closed> {
    let line = Line::new(system, omega);
    let size = 2 * line.n;
    let complex = |m: &Matrix<f64>| -> Matrix<Complex64> {
        m.iter().map(|row| row.iter().map(|x| Complex64::new(*x, 0.0)).collect()).collect()
    };
    let column = |v: &[f64]| -> Matrix<Complex64> { v.iter().map(|x| vec![Complex64::new(*x, 0.0)]).collect() };
    let real = |m: Matrix<Complex64>| -> Vec<f64> { m.into_iter().map(|row| row[0].re).collect() };
    // equilibrium under constant friction of one sign
    let q = real(solve(&complex(&line.a), &column(&line.h)));
    let mut dynamic = complex(&line.a);
    for i in 0..size {
        for k in 0..size {
            dynamic[i][k] = -dynamic[i][k];
        }
        dynamic[i][i] += Complex64::new(0.0, omega);
    }
    let zp: Vec<Complex64> = solve(&dynamic, &column(&line.g)).into_iter().map(|row| row[0]).collect();
    let mut e = complex(&exponential(&line.a, PI / omega));
    for i in 0..size {
        e[i][i] += 1.0;
    }
    let y0: Vec<f64> = real(solve(&e, &column(&q))).iter().map(|y| -2.0 * y).collect();
    let along = |v: &[f64]| -> f64 { v.iter().zip(&line.c).map(|(v, c)| v * c).sum() };
    let drive: Complex64 = zp.iter().zip(&line.c).map(|(z, c)| z * c).sum();
    let cosine = -(along(&y0) + along(&q)) / drive.norm();
    if cosine.abs() > 1.0 {
        return None;
    }
    for side in [1.0, -1.0] {
        let psi = side * cosine.acos() - drive.arg();
        let orbit = Closed { line: line.clone(), y0: y0.clone(), q: q.clone(), zp: zp.clone(), psi, omega };
        if orbit.nodes()[1..NODES].iter().all(|z| along(z) > 0.0) {
            return Some(orbit);
        }
    }
    None
}

/// Compares an event-driven orbit with the closed form: amplitudes, motion, reversals, loss.
/// Returns false if the closed form does not exist.
fn compare(system: &System, hertz: f64) -> bool {
    let omega = TAU * hertz;
    let orbit = exact(system, omega);
    let Some(closed) = two_reversals(system, omega) else {
        assert!(orbit.joints[0].slip_fraction < 1.0, "no orbit without stick exists at {hertz} Hz: {orbit:?}");
        return false;
    };
    assert_eq!(orbit.evidence.switches, 2, "{hertz} Hz");
    let reversal = (closed.psi / omega).rem_euclid(0.5 * orbit.period());
    let found = orbit.transition_times()[0].rem_euclid(0.5 * orbit.period());
    near("reversal", (found - reversal).abs().min(0.5 * orbit.period() - (found - reversal).abs()), 0.0, 1e-8 / omega);
    for (i, place) in orbit.places.iter().enumerate() {
        let largest = closed.amplitude(i);
        close(&format!("amplitude of {} at {hertz} Hz", place.name), place.amplitude(), largest, 1e-8);
        for k in 0..20 {
            let t = orbit.period() * f64::from(k) / 20.0;
            let (x, v) = closed.motion(i, t);
            let sample = orbit.sample(t);
            near("displacement", sample.displacement[i], x, 1e-8 * largest);
            near("velocity", sample.velocity[i], v, 1e-8 * largest * omega);
        }
    }
    // `4 Ft0` times the amplitude of the sliding displacement
    let slide = 0.5 * {
        let [a, b] = [0.0, PI / omega].map(|t| {
            let z = closed.at(t);
            (0..closed.line.n).map(|i| z[i] * closed.line.c[closed.line.n + i]).sum::<f64>() / omega
        });
        b - a
    };
    close("loss", orbit.joints[0].dissipation, 4.0 * system.joints()[0].law().force_scale() * slide, 1e-8);
    true
}

#[test]
fn theory_8_1_to_8_3_couple_without_stick() {
    let mut without_stick = Vec::new();
    for m1 in [0.001_82, 0.000_91] {
        for ft in [0.5, 1.0, 2.0, 4.0, 5.0, 6.0] {
            let system = template("blade-couple", &[("Ft", ft), ("m1", m1)]);
            for k in 0..=30 {
                let hertz = 119.5 + 0.1 * f64::from(k);
                if compare(&system, hertz) {
                    without_stick.push((m1, ft, hertz));
                }
            }
        }
    }
    println!("{} of {} points of the couple are without stick", without_stick.len(), 2 * 6 * 31);
    assert!(without_stick.len() > 40);
    // the paper's points
    for (ft, hertz) in [(2.0, 121.25), (4.0, 121.25)] {
        assert!(compare(&template("blade-couple", &[("Ft", ft)]), hertz), "{ft} N, {hertz} Hz");
    }
}

#[test]
fn theory_8_1_to_8_3_symmetric_couple_and_den_hartog_with_damping() {
    let mut without_stick = 0;
    for ft in [0.2, 0.5, 1.0, 2.0, 3.0] {
        let system = template("symmetric-couple", &[("Ft", ft)]);
        for k in 0..=12 {
            without_stick += usize::from(compare(&system, 119.5 + 0.25 * f64::from(k)));
        }
    }
    println!("{without_stick} points of the symmetric couple are without stick");
    assert!(without_stick > 10);
}

/// The verified point of section 8: amplitudes and energies at 4 N, 121.25 Hz.
#[test]
fn theory_8_printed_point() {
    let orbit = exact(&template("blade-couple", &[("Ft", 4.0)]), TAU * 121.25);
    for (place, printed, digit) in [(0, 3.22744, 0.5e-5), (1, 0.755499, 0.5e-6), (2, 0.474841, 0.5e-6)] {
        near("amplitude", 100.0 * orbit.places[place].amplitude(), printed, 3e-5 * printed + digit);
    }
    near("input", orbit.energy.work_in, 1.0129933, 0.5e-7);
    near("viscous", orbit.energy.viscous, 0.5095171, 0.5e-7);
    near("friction", orbit.energy.friction, 0.5034762, 0.5e-7);
    let slide = 0.5 * (orbit.joints[0].displacement[0].1 - orbit.joints[0].displacement[0].0);
    close("4 Ft0 a_rel", orbit.energy.friction, 16.0 * slide, 1e-9);
}

/// (8.4): the phase follows also from the mobility of the contact and the Fourier series of the
/// friction force.
#[test]
fn theory_8_4_fourier_form() {
    for (ft, hertz) in [(2.0, 121.25), (4.0, 121.25), (1.0, 121.0)] {
        let system = template("blade-couple", &[("Ft", ft)]);
        let omega = TAU * hertz;
        let orbit = exact(&system, omega);
        let n = system.dofs();
        // displacements due to a unit force on blade 1 or a unit contact force, at a frequency
        let response = |w: f64, unit: &dyn Fn(usize) -> f64| -> Vec<Complex64> {
            let s = Complex64::new(0.0, w);
            let dynamic: Matrix<Complex64> = (0..n)
                .map(|i| {
                    let entry = |k: usize| {
                        s * s * system.structure().mass()[(i, k)]
                            + s * system.structure().damping()[(i, k)]
                            + system.structure().stiffness()[(i, k)]
                    };
                    (0..n).map(entry).collect()
                })
                .collect();
            let right = (0..n).map(|i| vec![Complex64::new(unit(i), 0.0)]).collect();
            solve(&dynamic, &right).into_iter().map(|row| row[0]).collect()
        };
        let w = |i: usize| system.joints()[0].axes()[0].dense(system.dofs())[i];
        let slide = |x: &[Complex64]| -> Complex64 { (0..n).map(|i| x[i] * w(i)).sum() };
        let drive = slide(&response(omega, &|i| if i == 0 { 10.0 } else { 0.0 })) * Complex64::new(0.0, omega);
        // `s(t) = (4/pi) Σ sin(h w (t - t0))/h` over odd h. At t0 its part of the velocity is
        // the sum of `Im(Y_h)/h`. It converges as 1/h², because Re Y and Im Y fall as 1/h³ and
        // 1/h. The tail follows from `Y ~ 1/(jw m)`
        let mut sum = 0.0;
        let inverse_mass: f64 = (0..n).map(|i| w(i) * w(i) / system.structure().mass()[(i, i)]).sum();
        let last = 20_001u32;
        for h in (1..=last).step_by(2) {
            let rate = f64::from(h) * omega;
            let mobility = slide(&response(rate, &w)) * Complex64::new(0.0, rate);
            // velocity due to `-Ft0 s(t)`: `-Ft0 (4/pi) Im(Y e^{jh w (t - t0)})/h`
            sum += mobility.im / f64::from(h);
        }
        // tail of the sum of 1/h² over odd h
        sum += -inverse_mass / omega / (2.0 * f64::from(last + 1));
        let friction = -ft * 4.0 / PI * sum;
        // psi: `Re(drive e^{j psi}) + friction = 0` at the reversal to positive sliding
        let t0 = orbit
            .transition_times()
            .into_iter()
            .find(|t| orbit.sample(t + 1e-3 * orbit.period()).joints[0].velocity[0] > 0.0);
        let psi = omega * t0.unwrap();
        let balance = (drive * Complex64::from_polar(1.0, psi)).re + friction;
        near("velocity at the reversal", balance, 0.0, 1e-8 * drive.norm());
    }
}
