//! A reference motion in time for the tests of all methods: small implicit steps, no method of
//! the library, derivatives by differences.
//!
//! The structure is integrated by Newmark's average acceleration (trapezoidal rule), of second
//! order. Each law is integrated by the first of its views:
//!
//! - laws with a step by that step;
//! - laws with a rate by steps that damp fast processes;
//! - sliders by trial force and clamp; a rigid slider gets a spring that is stiffer than the
//!   steps resolve.

use crate::law_driver::{self, NODES};
use nalgebra::DVector;
use stickslip::law::{IdealElement, MAX_DIRECTIONS, RelativeMotion, SharedLaw, Slider};
use stickslip::model::{Axis, System};

type Along = [f64; MAX_DIRECTIONS];

/// A law with its states in this motion.
#[derive(Debug, Clone)]
struct Contact {
    law: SharedLaw,
    pieces: Option<Vec<IdealElement>>,
    axes: Vec<Axis>,
    /// Internal states, or forces of sliders; `moving` tells which sliders moved in the last
    /// step.
    z: Vec<f64>,
    moving: Vec<bool>,
    u: Along,
    v: Along,
}

/// The motion of a system under its excitation.
#[derive(Debug)]
pub struct Reference<'a> {
    system: &'a System,
    omega: f64,
    step: f64,
    x: DVector<f64>,
    v: DVector<f64>,
    a: DVector<f64>,
    contacts: Vec<Contact>,
    time: f64,
    /// Number of steps with equations that were not solved.
    pub unsolved_steps: usize,
}

/// Returns a displacement of the size that the loads cause, m.
fn travel(system: &System, omega: f64) -> f64 {
    let structure = system.structure();
    let hold = structure.stiffness().diagonal().max().max(omega * omega * structure.mass().diagonal().max());
    system.excitation(omega).iter().map(|(_, f)| f.norm()).sum::<f64>() / hold
}

impl<'a> Reference<'a> {
    /// Starts from displacements and velocities, with `steps` steps per excitation period and
    /// joints without memory.
    pub fn new(system: &'a System, omega: f64, steps: usize, displacement: &[f64], velocity: &[f64]) -> Self {
        let contacts = system.joints().iter().map(|joint| {
            let mut law = joint.law().clone();
            if law.step().is_none() && law.rate().is_none() && law.ideal_elements().is_none() {
                // a set-valued law that is not a sum of sliders: smooth it over a velocity far
                // below that of the motion
                // Velocity over which a law with only a resolvent is smoothed: a fraction of the
                // velocity of the motion, times the steps per period. The steps can resolve it.
                law = law.smooth_counterpart(0.5 / steps as f64 * omega * travel(system, omega)).unwrap_or(law);
            }
            let pieces = if law.step().is_none() && law.rate().is_none() { law.ideal_elements() } else { None };
            let states = law.step().map(|s| s.states()).or(law.rate().map(|r| r.states()));
            let states = states.unwrap_or(pieces.as_ref().map_or(0, Vec::len));
            let rest = [0.0; MAX_DIRECTIONS];
            let (z, moving) = (vec![0.0; states], vec![false; states]);
            Contact { law, pieces, axes: joint.axes().to_vec(), z, moving, u: rest, v: rest }
        });
        let mut reference = Reference {
            system,
            omega,
            step: std::f64::consts::TAU / (omega * steps as f64),
            x: DVector::from_column_slice(displacement),
            v: DVector::from_column_slice(velocity),
            a: DVector::zeros(system.dofs()),
            contacts: contacts.collect(),
            time: 0.0,
            unsolved_steps: 0,
        };
        for j in 0..reference.contacts.len() {
            let (u, v) = reference.motion(j, &reference.x, &reference.v, 0.0);
            (reference.contacts[j].u, reference.contacts[j].v) = (u, v);
        }
        reference
    }

    /// Sets the joint states of an orbit's start, if they are all of the states here: forces of
    /// sliders behind springs, and states of steps and rates.
    #[must_use]
    pub fn with_states(mut self, states: &[f64]) -> Self {
        let mut left = states;
        let mut take = |count: usize| -> Option<&[f64]> {
            let (now, rest) = left.split_at_checked(count)?;
            left = rest;
            Some(now)
        };
        let mut found = Vec::new();
        for contact in &self.contacts {
            let mut z = contact.z.clone();
            let elastic = |piece: &IdealElement| matches!(piece, IdealElement::Slider(s) if s.stiffness.is_some() && s.static_limit > 0.0);
            match &contact.pieces {
                Some(pieces) => {
                    for (z, _) in z.iter_mut().zip(pieces).filter(|(_, piece)| elastic(piece)) {
                        let Some(one) = take(1) else { return self };
                        *z = one[0];
                    }
                }
                None => {
                    let Some(all) = take(z.len()) else { return self };
                    z.copy_from_slice(all);
                }
            }
            found.push(z);
        }
        if left.is_empty() {
            self.contacts.iter_mut().zip(found).for_each(|(contact, z)| contact.z = z);
        }
        self
    }

    fn motion(&self, j: usize, x: &DVector<f64>, v: &DVector<f64>, time: f64) -> (Along, Along) {
        let (mut u, mut rate) = ([0.0; MAX_DIRECTIONS], [0.0; MAX_DIRECTIONS]);
        for (k, axis) in self.contacts[j].axes.iter().enumerate() {
            (u[k], rate[k]) = (axis.component(x.as_slice()), axis.component(v.as_slice()));
            for &(h, g) in axis.imposed() {
                let turn = num_complex::Complex64::cis(f64::from(h) * self.omega * time) * g;
                u[k] += turn.re;
                rate[k] -= turn.im * f64::from(h) * self.omega;
            }
        }
        (u, rate)
    }

    fn load(&self, time: f64) -> DVector<f64> {
        let mut out = DVector::zeros(self.system.dofs());
        for (h, force) in self.system.excitation(self.omega) {
            let turn = num_complex::Complex64::cis(f64::from(h) * self.omega * time);
            out += force.map(|f| (f * turn).re);
        }
        out
    }

    /// Makes one step. The unknown is the acceleration at its end.
    pub fn advance(&mut self) {
        let (n, h) = (self.system.dofs(), self.step);
        let structure = self.system.structure();
        let (m, c, k) = (structure.mass(), structure.damping(), structure.stiffness());
        let time = self.time + h;
        let load = self.load(time);
        let scale = load.amax().max((m * &self.a).amax()).max((k * &self.x).amax()).max(f64::MIN_POSITIVE);
        let mut a = self.a.clone();
        // Stiffness of the spring in series with a rigid slider, in masses over the square of a
        // step.
        let stiff = 100.0 * m.diagonal().max() / (h * h);
        let mut solved = false;
        // Newton iterations of a step.
        for _ in 0..40 {
            let x = &self.x + &self.v * h + (&self.a + &a) * (0.25 * h * h);
            let v = &self.v + (&self.a + &a) * (0.5 * h);
            let mut residual = m * &a + c * &v + k * &x - &load;
            let mut jacobian = m + c * (0.5 * h) + k * (0.25 * h * h);
            for j in 0..self.contacts.len() {
                let (u, rate) = self.motion(j, &x, &v, time);
                let axes = self.contacts[j].axes.clone();
                let force = self.contacts[j].after(u, rate, h, stiff).0;
                for (p, axis) in axes.iter().enumerate() {
                    axis.rows().iter().for_each(|&(i, w)| residual[i] += w * force[p]);
                }
                for (q, other) in axes.iter().enumerate() {
                    // the final acceleration changes final velocity and displacement together
                    // Relative increment of the differences.
                    let by = 1e-6 * (rate[q].abs() + (self.omega * u[q]).abs()).max(1e-9);
                    let side = |sign: f64| {
                        let (mut moved, mut faster) = (u, rate);
                        moved[q] += sign * by * 0.5 * h;
                        faster[q] += sign * by;
                        self.contacts[j].after(moved, faster, h, stiff).0
                    };
                    let (up, down) = (side(1.0), side(-1.0));
                    for (p, axis) in axes.iter().enumerate() {
                        let slope = (up[p] - down[p]) / (2.0 * by) * 0.5 * h;
                        for &(i, w) in axis.rows() {
                            other.rows().iter().for_each(|&(l, o)| jacobian[(i, l)] += w * slope * o);
                        }
                    }
                }
            }
            // Residual, relative to the forces, at which a step is solved.
            if residual.amax() <= 1e-9 * scale {
                solved = true;
                break;
            }
            let Some(change) = jacobian.lu().solve(&residual) else { break };
            a -= change;
        }
        self.unsolved_steps += usize::from(!solved && n > 0);
        let x = &self.x + &self.v * h + (&self.a + &a) * (0.25 * h * h);
        let v = &self.v + (&self.a + &a) * (0.5 * h);
        for j in 0..self.contacts.len() {
            let (u, rate) = self.motion(j, &x, &v, time);
            let (_, z, moving) = self.contacts[j].after(u, rate, h, stiff);
            let contact = &mut self.contacts[j];
            (contact.z, contact.moving, contact.u, contact.v) = (z, moving, u, rate);
        }
        (self.x, self.v, self.a, self.time) = (x, v, a, time);
    }

    /// Integrates at most `periods` periods, until the amplitudes change by less than
    /// `settled`, relative, in one period.
    ///
    /// Returns half the peak-to-peak value of every degree of freedom over the last period, and
    /// the last change.
    pub fn settle(&mut self, periods: usize, settled: f64) -> (Vec<f64>, f64) {
        let steps = (std::f64::consts::TAU / (self.omega * self.step)).round() as usize;
        let mut before = vec![0.0; self.x.len()];
        let mut change = f64::INFINITY;
        for _ in 0..periods {
            let mut range = vec![(f64::INFINITY, f64::NEG_INFINITY); self.x.len()];
            for _ in 0..steps {
                self.advance();
                for (range, x) in range.iter_mut().zip(self.x.iter()) {
                    *range = (range.0.min(*x), range.1.max(*x));
                }
            }
            let now: Vec<f64> = range.iter().map(|(low, high)| 0.5 * (high - low)).collect();
            let size = now.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
            change = now.iter().zip(&before).map(|(a, b)| (a - b).abs() / size).fold(0.0, f64::max);
            before = now;
            if change <= settled {
                break;
            }
        }
        (before, change)
    }
}

impl Contact {
    /// Returns force, states and moving sliders after a step of length `h` to `u`, `v`.
    fn after(&self, u: Along, v: Along, h: f64, stiff: f64) -> (Along, Vec<f64>, Vec<bool>) {
        let (mut z, mut moving) = (self.z.clone(), self.moving.clone());
        if let Some(step) = self.law.step() {
            let force = step.advance_values(&self.u, &u, &mut z);
            return (force, z, moving);
        }
        if let Some(rate) = self.law.rate() {
            // the joint moves with the structure, with the mean acceleration of the step
            let motion = NODES.map(|c| {
                let velocity = std::array::from_fn(|a| self.v[a] + c * (v[a] - self.v[a]));
                let way = |a: usize| c * h * (self.v[a] + 0.5 * c * (v[a] - self.v[a]));
                RelativeMotion { displacement: std::array::from_fn(|a| self.u[a] + way(a)), velocity }
            });
            z = law_driver::radau_step(rate, self.axes.len(), h, &motion, &self.z);
            let force =
                rate.evaluate_values(&RelativeMotion { displacement: u, velocity: v }, &z, &mut vec![0.0; z.len()]);
            return (force, z, moving);
        }
        let mut force = 0.0;
        for (i, piece) in self.pieces.iter().flatten().enumerate() {
            match *piece {
                IdealElement::Stop { gap, stiffness } => force += stiffness * (u[0] - gap).max(0.0),
                IdealElement::Slider(Slider { stiffness, limit, static_limit }) => {
                    let trial = self.z[i] + stiffness.unwrap_or(stiff) * (u[0] - self.u[0]);
                    let most = if self.moving[i] { limit } else { static_limit };
                    moving[i] = trial.abs() > most;
                    z[i] = if moving[i] { limit.copysign(trial) } else { trial };
                    force += z[i];
                }
            }
        }
        ([force, 0.0, 0.0], z, moving)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::template;

    /// Compares with the exact orbit of the paper's couple: the amplitudes agree to the order
    /// of the steps.
    #[test]
    fn it_finds_the_exact_orbit() {
        let system = template("blade-couple-massless", &[("b", 4.0)]);
        let omega = std::f64::consts::TAU * 120.0;
        let exact = crate::exact(&system, omega);
        let sample = exact.sample(0.0);
        let mut reference = Reference::new(&system, omega, 1000, &sample.displacement, &sample.velocity);
        let (amplitudes, change) = reference.settle(80, 1e-5);
        assert!(change < 1e-4 && reference.unsolved_steps == 0, "{change} {}", reference.unsolved_steps);
        for (place, amplitude) in exact.places.iter().zip(amplitudes) {
            assert!((amplitude / place.amplitude() - 1.0).abs() < 1e-3, "{amplitude} {}", place.amplitude());
        }
    }
}
