//! Reference motion of bodies on contacts with friction and separation. It shares no code with the
//! methods of the library.
//!
//! While no contact changes its state, the motion is linear, and its state vector is multiplied
//! by a matrix exponential in each step. A step in which a contact sticks, slips, opens or
//! closes is divided at the switch, which bisection locates on the Taylor series of the motion.

use crate::Random;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::law::FrictionContact;
use stickslip::model::{Axis, System};
use stickslip::structure::Structure;

/// Bodies on contacts, with a harmonic force and constant preloads.
#[derive(Debug, Clone)]
pub struct ContactModel {
    /// Mass, damping, stiffness.
    pub matrices: [DMatrix<f64>; 3],
    /// Contacts: tangent and normal over all degrees of freedom, and law with one tangent.
    pub contacts: Vec<([DVector<f64>; 2], FrictionContact)>,
    /// Complex amplitudes of the excitation, N.
    pub excitation: DVector<Complex64>,
    /// Frequency of the excitation, rad/s.
    pub omega: f64,
}

/// State of a contact. In slip, the sign is the direction of the friction force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum ContactState {
    Stuck,
    Slipping { positive: bool },
    Open,
}

use ContactState::{Open, Slipping, Stuck};

/// Returns a model with two to four degrees of freedom and one or two contacts, whose preloads are
/// of the size of the vibrating normal forces.
pub fn contact_model(seed: u64) -> ContactModel {
    let mut random = Random::new(seed << 20);
    let n = 2 + random.below(3);
    let mass = super::definite(&mut random, n, 0.5, 0.5);
    let stiffness = super::definite(&mut random, n, 1e4, 5e3);
    let natural = (stiffness[(0, 0)] / mass[(0, 0)]).sqrt();
    let ratio = random.between(0.02, 0.05);
    let damping = &mass * (ratio * natural) + &stiffness * (ratio / natural);
    let unit = |random: &mut Random| {
        let v = DVector::from_fn(n, |_, _| random.between(-1.0, 1.0));
        &v / v.norm()
    };
    let contacts = (0..1 + random.below(2)).map(|_| {
        let law = FrictionContact {
            tangential: 1e4 * 10f64.powf(random.between(-0.5, 0.7)),
            normal: 1e4 * 10f64.powf(random.between(-0.5, 0.7)),
            friction: random.between(0.1, 0.6),
            preload: 10.0 * 10f64.powf(random.between(-1.0, 0.5)),
            tangents: 1,
        };
        ([unit(&mut random), unit(&mut random)], law)
    });
    let contacts = contacts.collect();
    let excitation =
        DVector::from_fn(n, |_, _| Complex64::from_polar(random.between(2.0, 10.0), random.between(0.0, TAU)));
    ContactModel {
        matrices: [mass, damping, stiffness],
        contacts,
        excitation,
        omega: natural * random.between(0.5, 1.6),
    }
}

impl ContactModel {
    /// Builds the system for the library.
    ///
    /// # Panics
    /// If the matrices are invalid.
    pub fn system(&self) -> System {
        let [mass, damping, stiffness] = self.matrices.clone();
        let places = (0..mass.nrows()).map(|i| format!("p{i}")).collect();
        let mut builder = System::builder(Structure::new(places, mass, damping, stiffness).expect("a structure"));
        for (i, (axes, law)) in self.contacts.iter().enumerate() {
            let axes = axes.iter().map(|axis| Axis::new(axis.iter().copied().enumerate().collect())).collect();
            builder = builder.joint(format!("c{i}"), Arc::new(*law), axes);
        }
        for (row, force) in self.excitation.iter().enumerate() {
            builder = builder.force(row, 1, *force);
        }
        builder.build().expect("a system")
    }

    /// Returns the matrix of the linear motion `z' = A z` of displacements, velocities, positions
    /// of the sliders, and of `1`, `cos ωt`, `sin ωt`.
    fn generator(&self, states: &[ContactState]) -> DMatrix<f64> {
        let n = self.excitation.len();
        let (sliders, constant) = (2 * n, 2 * n + self.contacts.len());
        let size = constant + 3;
        let inverse = self.matrices[0].clone().try_inverse().expect("positive masses");
        let mut force = DMatrix::zeros(n, size);
        force.view_mut((0, 0), (n, n)).copy_from(&-&self.matrices[2]);
        force.view_mut((0, n), (n, n)).copy_from(&-&self.matrices[1]);
        let mut a = DMatrix::zeros(size, size);
        for (row, z) in self.excitation.iter().enumerate() {
            (force[(row, constant + 1)], force[(row, constant + 2)]) = (z.re, -z.im);
        }
        for (i, (([tangent, normal], law), state)) in self.contacts.iter().zip(states).enumerate() {
            if *state == Open {
                a.view_mut((sliders + i, n), (1, n)).copy_from(&tangent.transpose());
                continue;
            }
            let mut pressure = DVector::zeros(size).transpose();
            pressure.columns_mut(0, n).copy_from(&(normal.transpose() * law.normal));
            pressure[constant] = law.preload;
            let mut friction = DVector::zeros(size).transpose();
            match *state {
                Slipping { positive } => {
                    let friction_ratio = if positive { law.friction } else { -law.friction };
                    friction.copy_from(&(&pressure * friction_ratio));
                    let slip = tangent - normal * (friction_ratio * law.normal / law.tangential);
                    a.view_mut((sliders + i, n), (1, n)).copy_from(&slip.transpose());
                }
                _ => {
                    friction.columns_mut(0, n).copy_from(&(tangent.transpose() * law.tangential));
                    friction[sliders + i] = -law.tangential;
                }
            }
            force -= normal * &pressure + tangent * &friction;
        }
        a.view_mut((0, n), (n, n)).copy_from(&DMatrix::identity(n, n));
        a.view_mut((n, 0), (n, size)).copy_from(&(inverse * force));
        (a[(constant + 1, constant + 2)], a[(constant + 2, constant + 1)]) = (-self.omega, self.omega);
        a
    }

    /// Returns how far each contact is from leaving its state (negative beyond it), with the state
    /// that follows: forces in N, slip rates times the tangential stiffness in N/s.
    fn margins(&self, z: &DVector<f64>, states: &[ContactState]) -> Vec<(f64, ContactState)> {
        let n = self.excitation.len();
        let (x, v) = (z.rows(0, n), z.rows(n, n));
        let contacts = self.contacts.iter().zip(states).enumerate();
        contacts
            .map(|(i, (([tangent, normal], law), state))| {
                let pressure = law.preload + law.normal * normal.dot(&x);
                let limit = law.friction * pressure;
                let limit_rate = law.friction * law.normal * normal.dot(&v);
                let friction_rate = law.tangential * tangent.dot(&v);
                let least = |a: (f64, ContactState), b: (f64, ContactState)| if b.0 < a.0 { b } else { a };
                match *state {
                    Open => {
                        let slips = friction_rate.abs() > limit_rate;
                        let closed = if slips { Slipping { positive: friction_rate > 0.0 } } else { Stuck };
                        (-pressure, closed)
                    }
                    Stuck => {
                        let friction = law.tangential * (tangent.dot(&x) - z[2 * n + i]);
                        let slip = (limit - friction.abs(), Slipping { positive: friction > 0.0 });
                        least(slip, (pressure, Open))
                    }
                    Slipping { positive } => {
                        let rate = if positive { friction_rate - limit_rate } else { -friction_rate - limit_rate };
                        least((rate, Stuck), (pressure, Open))
                    }
                }
            })
            .collect()
    }

    /// Integrates from the initial state of an orbit until the displacements repeat after a period.
    /// Returns them at equal times of one period, one column each, and the share of the period in
    /// which at least one contact is open. Returns `None` if they do not repeat.
    ///
    /// # Panics
    /// If the state is shorter than that of the system.
    pub fn settled(&self, initial_state: &[f64], settings: LocatedSettings) -> Option<(DMatrix<f64>, f64)> {
        let n = self.excitation.len();
        let mut motion = LocatedMotion::new(self, initial_state, settings);
        let mut before = motion.z.clone();
        for _ in 0..settings.periods {
            let mut samples = DMatrix::zeros(n, settings.steps);
            let mut open = 0;
            for k in 0..settings.steps {
                samples.column_mut(k).copy_from(&motion.z.rows(0, n));
                open += usize::from(motion.states.contains(&Open));
                motion.step()?;
            }
            let size = samples.amax();
            if (motion.z.rows(0, n) - before.rows(0, n)).amax() <= settings.settled * size {
                return Some((samples, open as f64 / settings.steps as f64));
            }
            before.copy_from(&motion.z);
        }
        None
    }
}

/// Settings of the integration.
#[derive(Debug, Clone, Copy)]
pub struct LocatedSettings {
    /// Steps and samples per period.
    pub steps: usize,
    /// Periods after which the integration fails.
    pub periods: usize,
    /// Change of the displacements after a period, relative to the largest one, below which the
    /// motion has settled.
    pub settled: f64,
}

struct LocatedMotion<'a> {
    model: &'a ContactModel,
    step: f64,
    z: DVector<f64>,
    states: Vec<ContactState>,
    /// Generator and exponential of a step, by the states of the contacts.
    known: HashMap<Vec<ContactState>, [DMatrix<f64>; 2]>,
}

impl<'a> LocatedMotion<'a> {
    fn new(model: &'a ContactModel, initial_state: &[f64], settings: LocatedSettings) -> Self {
        let (n, contacts) = (model.excitation.len(), model.contacts.len());
        let mut z = DVector::zeros(2 * n + contacts + 3);
        z.rows_mut(0, 2 * n).copy_from_slice(&initial_state[..2 * n]);
        (z[2 * n + contacts], z[2 * n + contacts + 1]) = (1.0, 1.0);
        let mut states = Vec::new();
        for (i, ([tangent, normal], law)) in model.contacts.iter().enumerate() {
            let x = z.rows(0, n);
            let pressure = law.preload + law.normal * normal.dot(&x);
            let (friction, along) = (initial_state[2 * n + i], tangent.dot(&x));
            // a contact at its limit begins in stick; it slips at once if it must
            let limit = (law.friction * pressure).max(0.0);
            z[2 * n + i] = along - friction.clamp(-limit, limit) / law.tangential;
            states.push(if pressure > 0.0 { Stuck } else { Open });
        }
        LocatedMotion { model, step: TAU / model.omega / settings.steps as f64, z, states, known: HashMap::new() }
    }

    /// Advances by one step; returns `None` if it does not end.
    fn step(&mut self) -> Option<()> {
        let [generator, exponential] = self.matrices();
        let end = &exponential * &self.z;
        let Some(mut first) = self.first_switch(&generator, &end, self.step) else {
            self.z = end;
            return Some(());
        };
        let mut left = self.step;
        // a contact changes its state a few times in a step at most
        for _ in 0..50 {
            let [generator, _] = self.matrices();
            self.z = taylor(&generator, &self.z, first.0);
            left -= first.0;
            self.states[first.1] = first.2;
            let [generator, _] = self.matrices();
            let end = taylor(&generator, &self.z, left);
            match self.first_switch(&generator, &end, left) {
                Some(next) => first = next,
                None => {
                    self.z = end;
                    return Some(());
                }
            }
        }
        None
    }

    fn matrices(&mut self) -> [DMatrix<f64>; 2] {
        let (model, step) = (self.model, self.step);
        let make = || {
            let generator = model.generator(&self.states);
            let exponential = (&generator * step).exp();
            [generator, exponential]
        };
        self.known.entry(self.states.clone()).or_insert_with(make).clone()
    }

    /// Returns the first switch within `time`: its time, its contact, and the state after it. `end`
    /// is the state vector at the end without a switch.
    fn first_switch(
        &self,
        generator: &DMatrix<f64>,
        end: &DVector<f64>,
        time: f64,
    ) -> Option<(f64, usize, ContactState)> {
        // rounding of forces, in N; slip rates have a larger size
        let rounding = 1e-11;
        let beyond = |z: &DVector<f64>, contact: usize| self.model.margins(z, &self.states)[contact].0 < -rounding;
        let late = (0..self.states.len()).filter(|contact| beyond(end, *contact));
        let located = late.map(|contact| {
            let (mut low, mut high) = (0.0, time);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if beyond(&taylor(generator, &self.z, middle), contact) { high = middle } else { low = middle }
            }
            (high, contact, self.model.margins(&taylor(generator, &self.z, high), &self.states)[contact].1)
        });
        located.min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

/// Returns `exp(A t) z` by its Taylor series, for steps of a fraction of a natural period.
fn taylor(generator: &DMatrix<f64>, z: &DVector<f64>, time: f64) -> DVector<f64> {
    let (mut sum, mut term) = (z.clone(), z.clone());
    for k in 1..=12 {
        term = generator * &term * (time / f64::from(k));
        sum += &term;
    }
    sum
}
