//! Makes an orbit from a solution of harmonic balance: displacements, energies, evidence, and
//! the motion at any time.

use super::aft::{PortMember, Ports};
use super::dynamics::linear_dynamics::LinearDynamics;
use super::equations::{Discretization, HarmonicSolution};
use crate::law::{Contact, MAX_DIRECTIONS};
use crate::method::orbit_search::evidence::{OrbitCheck, ReturnEvidence};
use crate::model::{Axis, CyclicSymmetry, System};
use crate::orbit::postprocess::{ContactFractions, ContactSummary, PathSignals, results};
use crate::orbit::{
    Accuracy, Energy, Evidence, JointSample, Orbit, Path, Sample, Symmetry, history_dependent_joints, laws,
};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::cell::RefCell;
use std::convert::Infallible;
use std::f64::consts::TAU;
use std::sync::Arc;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Returns the harmonics of all places under the forces of a motion.
///
/// # Errors
/// A resonance without damping, rad/s.
pub(super) fn places(
    discretization: &mut Discretization,
    dynamics: &LinearDynamics,
    omega: f64,
    motion: &HarmonicSolution,
) -> Result<Vec<DVector<Complex64>>, f64> {
    let nh = discretization.harmonics().len();
    let acting = discretization.structure_forces(motion).to_vec();
    (0..nh)
        .map(|k| {
            let h = discretization.harmonics()[k];
            let along = |q: usize| acting[q * nh + k];
            if h == 0 {
                // the responses of an unsupported structure to the load and to the forces alone are
                // so large that their difference would be rounding
                let load = load_without(discretization.linear.mean_load.as_ref(), &dynamics.force_on_places(h, along));
                let mut x = DVector::from_element(load.len(), ZERO);
                match &mut discretization.banded {
                    Some(banded) => banded.respond(k, |i| load[i], x.as_mut_slice()),
                    None => x = dynamics.respond(h, omega, &load).map_err(|_| 0.0)?,
                }
                return Ok(x);
            }
            let mut x = discretization.linear.free_response[k].clone();
            match &mut discretization.banded {
                Some(banded) => {
                    let forces = dynamics.force_on_places(h, along);
                    let mut moved = x.clone();
                    banded.respond(k, |i| forces[i], moved.as_mut_slice());
                    x -= moved;
                }
                None => {
                    x -= dynamics.respond_along(h, omega, along).map_err(|_| h as f64 * omega)?;
                }
            }
            Ok(x)
        })
        .collect()
}

/// Returns the load (N) on all places minus forces on them.
fn load_without(load: Option<&DVector<Complex64>>, forces: &DVector<Complex64>) -> DVector<Complex64> {
    load.map_or_else(|| -forces, |load| load - forces)
}

/// Returns true if the mean forces balance without the springs that regularize unsupported
/// directions. `x` are the harmonics of all places.
pub(super) fn mean_forces_balance(
    (system, ports, dynamics): (&System, &Ports, &LinearDynamics),
    discretization: &Discretization,
    motion: &HarmonicSolution,
    x: &[DVector<Complex64>],
) -> bool {
    let nh = discretization.harmonics().len();
    if discretization.harmonics()[0] != 0 {
        return true;
    }
    let load = &discretization.linear.mean_load;
    let left = load_without(load.as_ref(), &dynamics.force_on_places(0, |q| motion.force[q * nh]));
    let along = |q: usize| {
        let squares: f64 = ports.axis(system, q).rows().iter().map(|(_, weight)| weight * weight).sum();
        squares.sqrt() * motion.force[q * nh].re.abs()
    };
    // all sectors of a travelling wave have the same forces
    let sectors = ports.wave().map_or(1, |wave| wave.sectors) as f64;
    let size = load.as_ref().map_or(0.0, |load| load.norm()) + sectors * (0..ports.count()).map(along).sum::<f64>();
    // at large displacements the balance is limited by the rounding of the spring forces
    let (mut held, mut rounding) = (vec![0.0; system.dofs()], vec![0.0; system.dofs()]);
    system.structure().stiffness_entries().for_each(|(row, column, stiffness)| {
        let force = stiffness * x[0][column].re;
        held[row] += force;
        // a thousand times the rounding of the largest terms
        rounding[row] += 1e3 * f64::EPSILON * force.abs();
    });
    let missing = left.iter().zip(held).zip(rounding).map(|((left, held), rounding)| {
        let missing = (left.re - held).abs() - rounding;
        missing.max(0.0).powi(2)
    });
    // the regularizing spring of an unsupported direction carries the difference
    missing.sum::<f64>().sqrt() <= 1e-6 * size
}

/// Motion as a Fourier series, with the joint forces at the samples.
#[derive(Debug, Clone)]
struct FourierPath {
    system: Arc<System>,
    omega: f64,
    harmonics: Vec<usize>,
    x: Vec<DVector<Complex64>>,
    /// Forces along the axes, per joint and sample, N.
    force: Vec<Vec<[f64; MAX_DIRECTIONS]>>,
    /// Contact state per joint and sample.
    contact: Vec<Vec<Contact>>,
    /// Numbers of the joints that stick for the whole period.
    stuck: Vec<usize>,
}

/// Data of the solver for the orbit of a solution.
pub(super) struct OrbitInput<'a> {
    pub system: &'a Arc<System>,
    pub ports: &'a Ports,
    pub dynamics: &'a LinearDynamics,
    /// Ports of the whole ring, if one of its sectors was solved.
    pub ring_ports: Option<&'a Ports>,
    pub omega: f64,
    /// Harmonic at the excitation frequency.
    pub excitation_harmonic: usize,
    /// True if the motion changes its sign after half a period.
    pub half_period: bool,
    pub truncation: Option<f64>,
    /// Tolerance of the truncation error.
    pub tolerance: f64,
    pub orbit_check: Option<&'a mut OrbitCheck>,
}

/// Makes the orbit of a solution. Returns `None` if its mean forces do not balance.
pub(super) fn orbit(
    setting: OrbitInput,
    discretization: &mut Discretization,
    motion: &HarmonicSolution,
    x: Vec<DVector<Complex64>>,
) -> Option<Orbit> {
    if !mean_forces_balance((setting.system, setting.ports, setting.dynamics), discretization, motion, &x) {
        return None;
    }
    match (setting.ports.wave(), setting.ring_ports) {
        (Some(wave), Some(ports)) => {
            let (mut discretization, motion) = discretization.over_ring(wave, ports, motion);
            orbit_of_all(OrbitInput { ports, ..setting }, &mut discretization, &motion, x, Some(wave))
        }
        _ => orbit_of_all(setting, discretization, motion, x, None),
    }
}

/// Makes the orbit of a solution over all joints, which is a travelling wave of a ring if `wave` is
/// given.
fn orbit_of_all(
    setting: OrbitInput,
    discretization: &mut Discretization,
    motion: &HarmonicSolution,
    x: Vec<DVector<Complex64>>,
    wave: Option<CyclicSymmetry>,
) -> Option<Orbit> {
    let harmonics = discretization.harmonics().to_vec();
    let JointSamples { force, contact, states } = sample_joints(&setting, discretization, motion, &x);
    let OrbitInput {
        system,
        ports,
        omega,
        excitation_harmonic: first,
        half_period: odd,
        truncation,
        tolerance,
        orbit_check,
        dynamics: _,
        ring_ports: _,
    } = setting;
    let symmetry = if odd { Symmetry::HalfPeriod } else { Symmetry::FullPeriod };
    let period = TAU / omega;
    let measuring = SolutionSignals {
        axes: system.axes().map(|(_, axis)| axis).collect(),
        ports: ports_of_axes(system, ports),
        wave,
        motion,
        x: &x,
        harmonics: &harmonics,
        contact: &contact,
        omega,
        returns_per_period: if odd { 2 } else { 1 },
        discretization: RefCell::new(discretization),
    };
    let Ok(mut measured) = results(system, &measuring, omega, (symmetry, period));
    for (place, axis) in measured.places.iter_mut().zip(system.place_axes()) {
        place.first_harmonic = harmonics.binary_search(&first).map_or(ZERO, |k| axis.complex_component(&x[k]));
    }
    let n = system.dofs();
    let mut start: Vec<f64> = (0..n).map(|i| x.iter().map(|x| x[i].re).sum()).collect();
    start.extend((0..n).map(|i| x.iter().zip(&harmonics).map(|(x, &h)| -x[i].im * h as f64 * omega).sum::<f64>()));
    start.extend(states);
    let contracts = orbit_check.as_ref().is_some_and(|orbit_check| orbit_check.proves());
    let top = harmonics.last().copied();
    let stuck_names = measured.stuck_names();
    let path =
        FourierPath { system: system.clone(), omega, harmonics, x, force, contact, stuck: measured.stuck.clone() };
    let ReturnEvidence { derivative, defect, step } = orbit_check.map_or_else(ReturnEvidence::default, |orbit_check| {
        orbit_check.check(system, omega, (&path, symmetry), &start, &path.stuck)
    });
    // If a normal force changes the slip limit, or vanishes, a series with twice the harmonics
    // may be as wrong as the shorter one. The time integration shows it. It compares one instant of
    // the period, at which the error may be below its maximum.
    let joints = system.joints().iter().zip(&measured.joints);
    let rubs = joints.filter(|(joint, _)| joint.law().normal().is_some()).any(|(_, moved)| moved.stick_fraction < 1.0);
    let returned = step.filter(|_| rubs).map_or(0.0, |step| 1.5 * distance_at_places(&path, step.as_slice()));
    let truncation = truncation.map(|error| error.max(returned));
    Some(Orbit {
        method: super::NAME,
        omega,
        periods: 1,
        symmetry,
        initial_state: start,
        evidence: Evidence {
            residual: motion.residual,
            energy_gap: measured.energy_gap(negligible_energy(system, omega)),
            switches: measured.joints.iter().map(|joint| joint.switches).sum(),
            iterations: motion.iterations,
            harmonics: top,
            error_estimate: truncation,
            return_defect: defect,
            accuracy: match truncation {
                Some(error) if error <= tolerance => Accuracy::Converged,
                Some(_) => Accuracy::Truncated,
                None => Accuracy::Unchecked,
            },
            history_dependent: history_dependent_joints(laws(system), &measured.joints, &stuck_names, symmetry),
            stuck: stuck_names,
            history_spread: None,
            found_by: motion.found_by.name(),
            fallback_from: None,
        },
        places: measured.places,
        joints: measured.joints,
        energy: measured.energy,
        return_map: derivative.unwrap_or_else(|| DMatrix::zeros(0, 0)),
        contracts,
        path: Arc::new(path),
        series: None,
    })
}

/// Returns the largest displacement of a place in this step of a state, relative to the largest
/// vibration of a place.
fn distance_at_places(path: &FourierPath, step: &[f64]) -> f64 {
    let largest = |values: &dyn Fn(&Axis) -> f64| {
        let lengths = path.system.place_axes().iter().map(|axis| axis.length_scale() * values(axis));
        lengths.fold(0.0, f64::max)
    };
    let vibration = |axis: &Axis| {
        let moving = path.harmonics.iter().zip(&path.x).filter(|(h, _)| **h > 0);
        moving.map(|(_, x)| axis.complex_component(x).norm_sqr()).sum::<f64>().sqrt()
    };
    largest(&|axis| axis.component(step).abs()) / largest(&vibration).max(f64::MIN_POSITIVE)
}

/// Joint forces and contact states at the samples of a period, and the internal states at
/// t = 0.
struct JointSamples {
    force: Vec<Vec<[f64; MAX_DIRECTIONS]>>,
    contact: Vec<Vec<Contact>>,
    states: Vec<f64>,
}

fn sample_joints(
    setting: &OrbitInput,
    discretization: &mut Discretization,
    motion: &HarmonicSolution,
    x: &[DVector<Complex64>],
) -> JointSamples {
    let OrbitInput { system, ports, omega, .. } = *setting;
    let harmonics = discretization.harmonics().to_vec();
    let samples = discretization.aft.samples();
    let mut force = vec![vec![[0.0; MAX_DIRECTIONS]; samples]; system.joints().len()];
    let mut contact = vec![vec![Contact::Stick; samples]; system.joints().len()];
    let mut states = Vec::new();
    for (j, joint) in system.joints().iter().enumerate() {
        let (axes, force, contact) = (joint.axes(), &mut force[j], &mut contact[j]);
        // without a port the joint carries no force and slips permanently
        let (mut has_slip_states, mut dissipates) = (false, true);
        for (p, port) in ports.iter().enumerate() {
            let Some(&PortMember { force_ratio: share, .. }) = port.member(j) else { continue };
            discretization.sample(ports, p, omega, motion);
            let aft = &discretization.aft;
            for (a, own) in aft.force.iter().enumerate().take(port.axes) {
                force.iter_mut().zip(own).for_each(|(force, own)| force[a] += share * own);
            }
            if port.samples_slip() {
                let slips = aft.slips.iter().zip(&aft.force[0]);
                for (contact, (slips, force)) in contact.iter_mut().zip(slips) {
                    if *slips {
                        *contact = Contact::slip(share * force);
                    }
                }
            }
            has_slip_states |= port.samples_slip();
            if port.has_memory_steps() {
                dissipates = aft.dissipates;
            }
            match joint.law().rate() {
                Some(rate) if port.is_force() => {
                    let mut z = vec![0.0; rate.states()];
                    // the sampled force is within the bounds of the law; the truncated series
                    // may exceed them
                    let now: [f64; MAX_DIRECTIONS] = std::array::from_fn(|a| share * aft.force[a][0]);
                    rate.state_from_force(&now[..port.axes], &mut z);
                    states.extend(z);
                }
                _ if port.is_force() => {}
                _ => states.extend(&aft.state),
            }
        }
        if has_slip_states {
            continue;
        }
        let velocity: Vec<Vec<f64>> = axes
            .iter()
            .map(|axis| {
                let u = relative(axis, &harmonics, x);
                let velocity: Vec<_> =
                    harmonics.iter().zip(u).map(|(&h, c)| (h, Complex64::new(0.0, h as f64 * omega) * c)).collect();
                discretization.aft.fourier.synthesize(&velocity, &mut discretization.aft.signal);
                discretization.aft.signal.clone()
            })
            .collect();
        for (i, (contact, force)) in contact.iter_mut().zip(force.iter()).enumerate() {
            let now: [f64; MAX_DIRECTIONS] = std::array::from_fn(|a| velocity.get(a).map_or(0.0, |v| v[i]));
            *contact = joint.law().contact_state(&now[..axes.len()], &force[..axes.len()]);
            // A joint that dissipates nothing only touches its limit, up to which it slipped
            // before, unless it has no friction force at all.
            let has_friction = || (0..axes.len()).any(|a| joint.law().normal() != Some(a) && force[a] != 0.0);
            if contact.slips() && !dissipates && has_friction() {
                *contact = Contact::Stick;
            }
        }
    }
    JointSamples { force, contact, states }
}

/// Returns the harmonics of the relative displacement along an axis.
fn relative(axis: &Axis, harmonics: &[usize], x: &[DVector<Complex64>]) -> Vec<Complex64> {
    harmonics.iter().zip(x).map(|(&h, x)| axis.imposed_at(h as u32) + axis.complex_component(x)).collect()
}

/// Returns the unknowns along each axis, by their numbers among all ports, with the share of
/// the joint.
fn ports_of_axes(system: &System, ports: &Ports) -> Vec<Vec<(usize, PortMember)>> {
    let mut firsts = Vec::with_capacity(system.joints().len());
    let mut count = 0;
    for joint in system.joints() {
        firsts.push(count);
        count += joint.axes().len();
    }
    let mut of = vec![Vec::new(); count];
    for port in ports.iter() {
        for member in &port.members {
            port.range().enumerate().for_each(|(axis, q)| of[firsts[member.joint] + axis].push((q, *member)));
        }
    }
    of
}

/// View of a solution for the measurement of its results.
struct SolutionSignals<'a> {
    axes: Vec<&'a Axis>,
    /// Unknowns along each axis, see [`ports_of_axes`].
    ports: Vec<Vec<(usize, PortMember)>>,
    /// The symmetry of a travelling wave.
    wave: Option<CyclicSymmetry>,
    motion: &'a HarmonicSolution,
    x: &'a [DVector<Complex64>],
    harmonics: &'a [usize],
    /// Contact states per joint and sample of the full period.
    contact: &'a [Vec<Contact>],
    omega: f64,
    /// Number of returns per period.
    returns_per_period: usize,
    /// Scratch memory of the transforms.
    discretization: RefCell<&'a mut Discretization>,
}

impl SolutionSignals<'_> {
    /// Returns the duration of a return, s.
    fn length(&self) -> f64 {
        TAU / (self.omega * self.returns_per_period as f64)
    }

    fn range_of(&self, signal: &[Complex64]) -> (f64, f64) {
        self.discretization.borrow_mut().aft.range(signal)
    }

    fn derivative(&self, mut signal: Vec<Complex64>) -> Vec<Complex64> {
        for (c, &h) in signal.iter_mut().zip(self.harmonics) {
            *c *= Complex64::new(0.0, h as f64 * self.omega);
        }
        signal
    }

    /// Returns the index of the harmonic at a frequency (rad/s), if the series has it.
    fn harmonic(&self, rate: f64) -> Option<usize> {
        self.harmonics.binary_search(&((rate / self.omega).round() as usize)).ok()
    }
}

/// Signals are lists of harmonics. If the motion has a half-period symmetry, all harmonics are
/// odd and orthogonal over half a period too.
impl PathSignals for SolutionSignals<'_> {
    type Signal = Vec<Complex64>;
    type Error = Infallible;

    fn displacement(&self, row: usize) -> Vec<Complex64> {
        self.x.iter().map(|x| x[row]).collect()
    }
    // with modal coordinates, there is one row for each mode
    fn place_displacement(&self, place: &Axis) -> Vec<Complex64> {
        self.x.iter().map(|x| place.complex_component(x)).collect()
    }
    fn velocity(&self, row: usize) -> Vec<Complex64> {
        self.derivative(self.displacement(row))
    }
    fn relative_velocity(&self, axis: usize) -> Vec<Complex64> {
        // use the unknown, not the displacement under the forces: the energies then balance
        // only as well as the equations hold
        let nh = self.harmonics.len();
        let unknown = self.ports[axis].first().map(|(q, PortMember { motion_ratio: factor, .. })| {
            let along = &self.motion.c[q * nh..(q + 1) * nh];
            along.iter().map(|c| c * factor).collect()
        });
        self.derivative(unknown.unwrap_or_else(|| relative(self.axes[axis], self.harmonics, self.x)))
    }
    fn force(&self, axis: usize) -> Vec<Complex64> {
        let nh = self.harmonics.len();
        let acting =
            |k: usize| self.ports[axis].iter().map(move |(q, m)| self.motion.force[q * nh + k] * m.force_ratio);
        (0..nh).map(|k| acting(k).sum()).collect()
    }
    fn harmonics(&self, parts: &[(f64, Complex64)]) -> Vec<Complex64> {
        let mut signal = vec![ZERO; self.harmonics.len()];
        for (rate, a) in parts {
            if let Some(k) = self.harmonic(*rate) {
                signal[k] += a;
            }
        }
        signal
    }
    fn add(&self, to: &mut Vec<Complex64>, signal: &Vec<Complex64>, factor: f64) {
        to.iter_mut().zip(signal).for_each(|(to, value)| *to += value * factor);
    }
    fn product(&self, a: &Vec<Complex64>, b: &Vec<Complex64>) -> f64 {
        let terms = self.harmonics.iter().zip(a.iter().zip(b));
        let sum: f64 = terms.map(|(&h, (a, b))| if h == 0 { a.re * b.re } else { 0.5 * (a.conj() * b).re }).sum();
        self.length() * sum
    }
    /// In a travelling wave, all sectors lose the same energy, and each harmonic is a wave.
    fn viscous_loss(&self, system: &System, velocity: &[Vec<Complex64>]) -> f64 {
        let sector = self.wave.and_then(|wave| Some((wave, system.structure().ring_sector(wave.sectors)?)));
        let Some((cyclic, sector)) = sector else { return self.viscous_loss_of_entries(system, velocity) };
        let loss = |(k, &h): (usize, &usize)| {
            let own: Vec<Complex64> = velocity[..sector.dofs()].iter().map(|signal| signal[k]).collect();
            // the mean does not move
            sector.wave(cyclic.diameter(h)).map_or(f64::NAN, |wave| 0.5 * wave.damping_power(&own))
        };
        self.length() * cyclic.sectors as f64 * self.harmonics.iter().enumerate().map(loss).sum::<f64>()
    }
    fn fourier(&self, signal: &Vec<Complex64>, omega: f64) -> Complex64 {
        let share = if omega == 0.0 { 1.0 } else { 0.5 };
        self.harmonic(omega).map_or(ZERO, |k| signal[k] * (share * self.length()))
    }
    fn range(&self, place: &Axis) -> Result<(f64, f64), Infallible> {
        Ok(self.range_of(&self.place_displacement(place)))
    }
    fn relative_range(&self, axis: usize) -> Result<(f64, f64), Infallible> {
        Ok(self.range_of(&relative(self.axes[axis], self.harmonics, self.x)))
    }
    fn faces(&self, joint: usize) -> ContactSummary {
        let contact = &self.contact[joint];
        let runs: Vec<_> = contact.chunk_by(PartialEq::eq).map(|run| (run[0], run.len() as f64)).collect();
        let changes = runs.len() - usize::from(contact.first() == contact.last());
        let shares = ContactFractions::of(runs.into_iter());
        ContactSummary::of_samples(shares, changes / self.returns_per_period, contact.iter().copied())
    }
}

/// Relative energy gap above which a solution is no orbit. Energies balance to the residual,
/// except at a resonance without damping, where the receptance is infinite.
const UNBALANCED_ENERGY: f64 = 1e-2;
/// Energies below this share of the energy that the loads could store in the structure are
/// rounding: all joints stick.
const NEGLIGIBLE_ENERGY: f64 = 1e-9;

/// Returns the energy (J) that counts as zero at this frequency.
fn negligible_energy(system: &System, omega: f64) -> f64 {
    let [mass, _, stiffness] = system.structure().largest();
    let stiff = stiffness.max(omega * omega * mass);
    let loads: f64 = system.excitation(omega).iter().map(|(_, load)| load.norm_squared()).sum();
    NEGLIGIBLE_ENERGY * loads / stiff.max(f64::MIN_POSITIVE)
}

/// Returns true if the energies of an orbit balance, or count as zero.
pub(super) fn energies_balance(system: &System, orbit: &Orbit) -> bool {
    let Energy { work_in, viscous, friction } = orbit.energy;
    orbit.evidence.energy_gap <= UNBALANCED_ENERGY
        || (work_in - viscous - friction).abs() <= negligible_energy(system, orbit.omega)
}

/// Returns the amplitude of harmonic `h`, or zero.
fn amplitude_at(harmonics: &[(u32, Complex64)], h: usize) -> Complex64 {
    harmonics.iter().find(|(k, _)| *k as usize == h).map_or(ZERO, |(_, g)| *g)
}

/// Returns harmonic `h` of the force that moves a place, without the joint forces.
fn linear_reaction(system: &System, m: usize, h: usize, s: Complex64, x: &DVector<Complex64>) -> Complex64 {
    let place = &system.moved_places()[m];
    let mut force = -amplitude_at(&place.force, h);
    for (other, (k, c)) in place.stiffness.1.iter().zip(&place.damping.1).enumerate() {
        force += amplitude_at(&system.moved_places()[other].motion, h) * (*k + s * *c + s * s * place.mass.1[other]);
    }
    for i in 0..x.len() {
        force += x[i] * (place.stiffness.0[i] + s * place.damping.0[i] + s * s * place.mass.0[i]);
    }
    force
}

impl Path for FourierPath {
    fn sample(&self, time: f64) -> Sample {
        let n = self.system.dofs();
        let (mut x, mut v, mut a) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut moved_now = vec![(0.0, 0.0); self.system.moved_places().len()];
        for (&h, amplitude) in self.harmonics.iter().zip(&self.x) {
            let s = Complex64::new(0.0, h as f64 * self.omega);
            let turn = Complex64::cis(h as f64 * self.omega * time);
            for i in 0..n {
                let z = amplitude[i] * turn;
                x[i] += z.re;
                v[i] += (s * z).re;
                a[i] += (s * s * z).re;
            }
            for (m, now) in moved_now.iter_mut().enumerate() {
                now.0 += (amplitude_at(&self.system.moved_places()[m].motion, h) * turn).re;
                now.1 += (linear_reaction(&self.system, m, h, s, amplitude) * turn).re;
            }
        }
        let period = TAU / self.omega;
        let joints: Vec<JointSample> = self
            .system
            .joints()
            .iter()
            .enumerate()
            .map(|(j, joint)| {
                let samples = self.force[j].len();
                let at = time / period * samples as f64;
                let (low, part) = (at.floor() as usize, at.fract());
                let (before, after) = (self.force[j][low % samples], self.force[j][(low + 1) % samples]);
                let mut sample =
                    JointSample::one_dimensional(0.0, 0.0, 0.0, self.contact[j][(at.round() as usize) % samples]);
                for (a, axis) in joint.axes().iter().enumerate() {
                    sample.displacement[a] = axis.component(&x);
                    sample.velocity[a] = axis.component(&v);
                    for &(h, g) in axis.imposed() {
                        let rate = f64::from(h) * self.omega;
                        let z = g * Complex64::cis(rate * time);
                        sample.displacement[a] += z.re;
                        sample.velocity[a] -= rate * z.im;
                    }
                    sample.force[a] = (1.0 - part) * before[a] + part * after[a];
                }
                sample
            })
            .collect();
        let forces: Vec<f64> = joints
            .iter()
            .zip(self.system.joints())
            .flat_map(|(now, joint)| now.force[..joint.axes().len()].to_vec())
            .collect();
        for (m, now) in moved_now.iter_mut().enumerate() {
            now.1 +=
                forces.iter().zip(&self.system.moved_places()[m].joints).map(|(force, sign)| force * sign).sum::<f64>();
        }
        Sample { displacement: x, velocity: v, acceleration: a, joints, imposed: moved_now }
    }

    fn transition_times(&self) -> Vec<f64> {
        let period = TAU / self.omega;
        let mut times: Vec<f64> = self
            .contact
            .iter()
            .flat_map(|contact| {
                let n = contact.len();
                (0..n)
                    .filter(|&i| contact[i] != contact[(i + n - 1) % n])
                    .map(move |i| ((i as f64 - 0.5).rem_euclid(n as f64)) * period / n as f64)
                    .collect::<Vec<_>>()
            })
            .collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }

    fn return_map(&self, start: &[f64], symmetry: Symmetry) -> Option<DMatrix<f64>> {
        let judged =
            OrbitCheck::of_any_size(&self.system).check(&self.system, self.omega, (self, symmetry), start, &self.stuck);
        judged.derivative
    }

    fn return_defect(&self, start: &[f64], symmetry: Symmetry) -> Option<f64> {
        OrbitCheck::of_any_size(&self.system).defect(&self.system, self.omega, (self, symmetry), start)
    }
}

#[cfg(test)]
mod tests {
    use crate::law::FrictionContact;
    use crate::method::Method;
    use crate::method::harmonic_balance::HarmonicBalance;
    use crate::model::{Axis, System};
    use crate::structure::Structure;
    use nalgebra::{DMatrix, DVector, dmatrix};
    use num_complex::Complex64;
    use std::f64::consts::TAU;
    use std::sync::Arc;

    /// Returns a blade with a stiff pad whose contact is pressed by a varying force, in the
    /// coordinates q of `x = transformation q`. The coordinates x are blade, pad and normal
    /// direction.
    fn pressed(transformation: &DMatrix<f64>) -> System {
        let project = |matrix: DMatrix<f64>| transformation.transpose() * matrix * transformation;
        let mass = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 0.01, 0.1]));
        let stiffness = dmatrix![1.01e6, -1e6, 0.0; -1e6, 1e6, 0.0; 0.0, 0.0, 1e5];
        let names = ["a", "b", "c"].map(str::to_owned).to_vec();
        let damping = 1e-4 * &stiffness;
        let structure = Structure::new(names, project(mass), project(damping), project(stiffness)).unwrap();
        let axis = |x: usize| Axis::new((0..3).map(|q| (q, transformation[(x, q)])).collect());
        let law = FrictionContact { tangential: 1e5, normal: 1e5, friction: 0.5, preload: 4.0, tangents: 1 };
        let mut builder = System::builder(structure).joint("face", Arc::new(law), vec![axis(1), axis(2)]);
        for (x, name) in ["blade", "pad", "normal"].into_iter().enumerate() {
            builder = builder.place(name, axis(x));
        }
        for (x, force) in [(0, Complex64::new(5.0, 0.0)), (2, Complex64::new(0.0, 3.0))] {
            for q in 0..3 {
                builder = builder.force(q, 1, transformation[(x, q)] * force);
            }
        }
        builder.build().unwrap()
    }

    /// The estimate concerns places. A reduced structure has coordinates of large stiffness, whose
    /// energy is no measure of the motion of any place.
    #[test]
    fn the_error_estimate_is_independent_of_the_coordinates() {
        let pad_relative_to_blade = dmatrix![1.0, 0.0, 0.0; 1.0, 1.0, 0.0; 0.0, 0.0, 1.0];
        let estimate = |transformation: DMatrix<f64>| {
            let method = HarmonicBalance { harmonics: Some(5), ..HarmonicBalance::default() };
            let orbit = method.solver(&pressed(&transformation)).unwrap().orbit(TAU * 14.0).unwrap();
            assert!(orbit.joints[0].slip_fraction > 0.1);
            orbit.evidence.error_estimate.unwrap()
        };
        let (own, relative) = (estimate(DMatrix::identity(3, 3)), estimate(pad_relative_to_blade));
        assert!((own / relative - 1.0).abs() < 1e-6, "{own:e} {relative:e}");
    }
}
