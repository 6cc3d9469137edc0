//! The orbit of a solution of harmonic balance.

use super::equations::{Level, Motion};
use super::joints::{Alternation, Coordinate, Element};
use super::rest::Rest;
use crate::law::Contact;
use crate::method::evidence::{Judge, Judged};
use crate::model::{MovedPlace, System};
use crate::orbit::{Accuracy, Energy, Evidence, JointMotion, JointSample, Orbit, Path, PlaceMotion, Sample, Symmetry};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// Harmonics of all places under the forces of a motion.
pub(super) fn places(level: &mut Level, rest: &Rest, omega: f64, motion: &Motion) -> Vec<DVector<Complex64>> {
    let nh = level.harmonics().len();
    (0..nh)
        .map(|k| {
            let forces = rest.spread(|q| motion.force[q * nh + k]);
            let Some(sparse) = &mut level.sparse else {
                return &level.free[k] - rest.respond(level.harmonics()[k], omega, &forces);
            };
            let mut x = level.free[k].clone();
            let mut moved = x.clone();
            sparse.respond(k, |i| forces[i], moved.as_mut_slice());
            x -= moved;
            x
        })
        .collect()
}

/// Share of the mean forces that may be left over: a direction that nothing holds was given a spring to have a mean position at all, and
/// what that spring carries is missing elsewhere.
const UNHELD: f64 = 1e-6;

/// Whether the mean forces balance without the springs that hold free directions.
pub(super) fn stays(context: &Context, level: &Level, motion: &Motion, x: &[DVector<Complex64>]) -> bool {
    let (system, nh) = (context.system, level.harmonics().len());
    if level.harmonics()[0] != 0 {
        return true;
    }
    let excitation = system.excitation(context.omega);
    let mut left = excitation
        .iter()
        .find(|(h, _)| *h == 0)
        .map_or_else(|| DVector::from_element(system.dofs(), ZERO), |(_, load)| load.clone());
    let mut size = left.norm();
    for (q, coordinate) in context.coordinates.iter().enumerate() {
        let force = motion.force[q * nh].re;
        let direction = system.joints()[coordinate.joint].axes()[0].dense(system.dofs());
        left -= direction.map(|w| Complex64::new(w * force, 0.0));
        size += direction.norm() * force.abs();
    }
    let held = system.structure().stiffness() * x[0].map(|z| z.re);
    // positions far away have forces that are rounding
    let rounding =
        f64::EPSILON * system.structure().stiffness().amax() * x[0].iter().fold(0.0, |m: f64, z| m.max(z.norm()));
    (left.map(|z| z.re) - held).norm() <= UNHELD * size + 1e3 * rounding
}

#[derive(Debug, Clone)]
struct Series {
    system: System,
    omega: f64,
    harmonics: Vec<usize>,
    x: Vec<DVector<Complex64>>,
    /// Force and contact per joint and sample.
    force: Vec<Vec<f64>>,
    contact: Vec<Vec<Contact>>,
}

/// What the solver knows beside the motion.
pub(super) struct Context<'a> {
    pub system: &'a System,
    pub coordinates: &'a [Coordinate],
    pub omega: f64,
    pub odd: bool,
    pub truncation: Option<f64>,
    /// The error that it is compared with.
    pub tolerance: f64,
    pub judge: Option<&'a mut Judge>,
}

/// Makes the orbit.
/// `None` if it does not stay where it is.
pub(super) fn orbit(context: Context, level: &mut Level, motion: &Motion, x: Vec<DVector<Complex64>>) -> Option<Orbit> {
    if !stays(&context, level, motion, &x) {
        return None;
    }
    let Context { system, coordinates, omega, odd, truncation, tolerance, judge } = context;
    let (n, nh) = (system.dofs(), level.harmonics().len());
    let harmonics = level.harmonics().to_vec();
    let samples = level.alternation.samples();
    let mut force = vec![vec![0.0; samples]; system.joints().len()];
    let mut contact = vec![vec![Contact::Stick; samples]; system.joints().len()];
    let mut joints = Vec::new();
    let mut elastic_states = Vec::new();
    let mut stuck = Vec::new();
    for (j, joint) in system.joints().iter().enumerate() {
        // ∮ f du with the projected force: for the series it is the integral itself
        let mut dissipation = 0.0;
        for (q, coordinate) in coordinates.iter().enumerate().filter(|(_, coordinate)| coordinate.joint == j) {
            let range = q * nh..(q + 1) * nh;
            let (c, f) = (&motion.c[range.clone()], &motion.force[range]);
            dissipation += (0..nh).map(|k| cycle_work(harmonics[k], f[k], c[k])).sum::<f64>();
            let mut add = |alternation: &Alternation| {
                for i in 0..samples {
                    force[j][i] += alternation.force[i];
                    if alternation.slips[i] {
                        contact[j][i] = Contact::slip(alternation.force[i]);
                    }
                }
            };
            match &coordinate.element {
                Element::Springs(springs) => {
                    level.alternation.synthesise(c);
                    for spring in springs {
                        level.alternation.slide(spring, 1.0, c);
                        elastic_states.push(level.alternation.force[0]);
                        add(&level.alternation);
                    }
                }
                Element::Velocity(law) => {
                    level.apply(*law, q, omega, motion);
                    if let Some(rate) = joint.law().rate() {
                        let mut z = vec![0.0; rate.states()];
                        rate.state_under((0..nh).map(|k| f[k].re).sum(), &mut z);
                        elastic_states.extend(z);
                    }
                    add(&level.alternation);
                }
            }
        }
        let u: Vec<(usize, Complex64)> = harmonics
            .iter()
            .zip(&x)
            .map(|(&h, x)| {
                let imposed = joint.axes()[0].imposed_at(h as u32);
                (h, imposed + joint.axes()[0].along_complex(x))
            })
            .collect();
        if joint.law().is_free() {
            // what holds nothing slips all the time
            let velocity: Vec<_> = u.iter().map(|(h, c)| (*h, Complex64::new(0.0, *h as f64 * omega) * c)).collect();
            level.alternation.fourier.synthesise(&velocity, &mut level.alternation.signal);
            contact[j] = level.alternation.signal.iter().map(|v| Contact::slip(*v)).collect();
        }
        let (low, high) = extremes(&u, level);
        let slipping = contact[j].iter().filter(|c| **c != Contact::Stick).count();
        let switches = (0..samples).filter(|&i| contact[j][i] != contact[j][(i + 1) % samples]).count();
        if slipping == 0 {
            stuck.push(joint.name().to_owned());
        }
        joints.push(JointMotion {
            name: joint.name().to_owned(),
            dissipation,
            slip_fraction: slipping as f64 / samples as f64,
            displacement: vec![(low, high)],
            switches,
        });
    }
    let places = (0..n)
        .map(|i| {
            let series: Vec<(usize, Complex64)> = (0..nh).map(|k| (harmonics[k], x[k][i])).collect();
            let (minimum, maximum) = extremes(&series, level);
            let at = |h: usize| harmonics.binary_search(&h).map_or(ZERO, |k| x[k][i]);
            PlaceMotion { name: system.places()[i].clone(), maximum, minimum, mean: at(0).re, first_harmonic: at(1) }
        })
        .collect();
    let energy = energy(system, coordinates, omega, &harmonics, &x, motion, &joints);
    let possible = possible_work(system, omega, &harmonics, &x) + energy.friction.abs();
    let reference = energy.work_in.abs().max(NO_WORK * possible);
    let balance = energy.work_in - energy.viscous - energy.friction;
    let mut start: Vec<f64> = (0..n).map(|i| x.iter().map(|x| x[i].re).sum()).collect();
    start.extend((0..n).map(|i| x.iter().zip(&harmonics).map(|(x, &h)| -x[i].im * h as f64 * omega).sum::<f64>()));
    start.extend(elastic_states);
    let contracts = judge.as_ref().is_some_and(|judge| judge.proves());
    let Judged { derivative, defect } =
        judge.map_or_else(Judged::default, |judge| judge.judge(system, omega, odd, &start));
    Some(Orbit {
        method: super::NAME,
        omega,
        periods: 1,
        symmetry: if odd { Symmetry::HalfPeriod } else { Symmetry::FullPeriod },
        start,
        places,
        evidence: Evidence {
            residual: motion.residual,
            energy_gap: if reference > 0.0 { balance.abs() / reference } else { balance.abs() },
            switches: joints.iter().map(|j| j.switches).sum(),
            iterations: motion.iterations,
            truncation,
            return_defect: defect,
            accuracy: match truncation {
                Some(error) if error <= tolerance => Accuracy::Converged,
                Some(_) => Accuracy::Truncated,
                None => Accuracy::Unchecked,
            },
            stuck,
        },
        joints,
        energy,
        return_map: derivative.unwrap_or_else(|| DMatrix::zeros(0, 0)),
        contracts,
        path: Arc::new(Series { system: system.clone(), omega, harmonics, x, force, contact }),
    })
}

/// Work below this fraction of what the loads could do is no yardstick for the energy gap: the motion is conservative.
const NO_WORK: f64 = 1e-6;

/// `∫ f u' dt` over a period of `Re(F e^{jhΩt})` and `Re(U e^{jhΩt})`.
fn cycle_work(h: usize, f: Complex64, u: Complex64) -> f64 {
    -PI * h as f64 * (f.conj() * u).im
}

/// Loads and imposed motion by harmonic.
fn moved(place: &MovedPlace, h: usize) -> Complex64 {
    place.motion.iter().find(|(k, _)| *k as usize == h).map_or(ZERO, |(_, g)| *g)
}

fn energy(
    system: &System,
    coordinates: &[Coordinate],
    omega: f64,
    harmonics: &[usize],
    x: &[DVector<Complex64>],
    motion: &Motion,
    joints: &[JointMotion],
) -> Energy {
    let n = system.dofs();
    let nh = harmonics.len();
    let (mut work, mut viscous) = (0.0, 0.0);
    let excitation = system.excitation(omega);
    for (k, &h) in harmonics.iter().enumerate() {
        let s = Complex64::new(0.0, h as f64 * omega);
        let x = &x[k];
        if let Some((_, load)) = excitation.iter().find(|(number, _)| *number as usize == h) {
            work += (0..n).map(|i| cycle_work(h, load[i], x[i])).sum::<f64>();
        }
        for i in 0..n {
            for l in 0..n {
                let c = system.structure().damping()[(i, l)];
                if c != 0.0 {
                    viscous += cycle_work(h, s * x[l] * c, x[i]);
                }
            }
        }
        for (m, place) in system.moved().iter().enumerate() {
            let g = moved(place, h);
            let forces = |j: usize| -> Complex64 {
                coordinates
                    .iter()
                    .enumerate()
                    .filter(|(_, c)| c.joint == j)
                    .map(|(q, _)| motion.force[q * nh + k])
                    .sum()
            };
            let joint_part: Complex64 = (0..system.joints().len()).map(|j| place.joints[j] * forces(j)).sum();
            work += cycle_work(h, linear_reaction(system, m, h, s, x) + joint_part, g);
            for i in 0..n {
                let (stiffness, damping) = (place.stiffness.0[i], place.damping.0[i]);
                // the load on the masses contains what the moved place does to them: that is no work from outside
                work += cycle_work(h, g * (stiffness + s * damping), x[i]);
                viscous += 2.0 * cycle_work(h, s * g * damping, x[i]);
            }
            for (other, c) in place.damping.1.iter().enumerate() {
                viscous += cycle_work(h, s * moved(&system.moved()[other], h) * *c, g);
            }
        }
    }
    Energy { work_in: work, viscous, friction: joints.iter().map(|joint| joint.dissipation).sum() }
}

/// The force that moves a place, without that of the joints.
fn linear_reaction(system: &System, m: usize, h: usize, s: Complex64, x: &DVector<Complex64>) -> Complex64 {
    let place = &system.moved()[m];
    let mut force = moved(place, h) * s * s * place.mass;
    for (other, (k, c)) in place.stiffness.1.iter().zip(&place.damping.1).enumerate() {
        force += moved(&system.moved()[other], h) * (*k + s * *c);
    }
    for i in 0..x.len() {
        force += x[i] * (place.stiffness.0[i] + s * place.damping.0[i]);
    }
    force
}

/// What the loads could do: force amplitude times displacement amplitude.
fn possible_work(system: &System, omega: f64, harmonics: &[usize], x: &[DVector<Complex64>]) -> f64 {
    let mut sum = 0.0;
    for (number, load) in system.excitation(omega) {
        if let Ok(k) = harmonics.binary_search(&(number as usize)) {
            sum += PI * number as f64 * (0..load.len()).map(|i| load[i].norm() * x[k][i].norm()).sum::<f64>();
        }
    }
    sum
}

/// Least and largest value of a series: the extremes of its samples, moved to the zero of the slope.
fn extremes(series: &[(usize, Complex64)], level: &mut Level) -> (f64, f64) {
    let alternation = &mut level.alternation;
    alternation.fourier.synthesise(series, &mut alternation.signal);
    let n = alternation.signal.len();
    let (mut lowest, mut highest) = (0, 0);
    for i in 1..n {
        if alternation.signal[i] < alternation.signal[lowest] {
            lowest = i;
        }
        if alternation.signal[i] > alternation.signal[highest] {
            highest = i;
        }
    }
    let refined = |start: usize| {
        let mut theta = start as f64 * TAU / n as f64;
        let mut best = alternation.signal[start];
        for _ in 0..3 {
            let (mut slope, mut bend) = (0.0, 0.0);
            for &(h, c) in series {
                let z = c * Complex64::cis(h as f64 * theta);
                let h = h as f64;
                slope -= h * z.im;
                bend -= h * h * z.re;
            }
            let step = slope / bend;
            if !step.is_finite() || step.abs() > TAU / n as f64 {
                break;
            }
            theta -= step;
            best = series.iter().map(|&(h, c)| (c * Complex64::cis(h as f64 * theta)).re).sum();
        }
        best
    };
    let (low, high) = (refined(lowest), refined(highest));
    (low.min(alternation.signal[lowest]), high.max(alternation.signal[highest]))
}

impl Path for Series {
    fn sample(&self, time: f64) -> Sample {
        let n = self.system.dofs();
        let (mut x, mut v, mut a) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut moved_now = vec![(0.0, 0.0); self.system.moved().len()];
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
                now.0 += (moved(&self.system.moved()[m], h) * turn).re;
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
                let axis = &joint.axes()[0];
                let (mut displacement, mut velocity) = (axis.along(&x), axis.along(&v));
                for &(h, g) in joint.axes()[0].imposed() {
                    let rate = f64::from(h) * self.omega;
                    let z = g * Complex64::cis(rate * time);
                    displacement += z.re;
                    velocity -= rate * z.im;
                }
                let force = (1.0 - part) * self.force[j][low % samples] + part * self.force[j][(low + 1) % samples];
                JointSample::along(displacement, velocity, force, self.contact[j][(at.round() as usize) % samples])
            })
            .collect();
        for (m, now) in moved_now.iter_mut().enumerate() {
            now.1 += joints
                .iter()
                .zip(&self.system.moved()[m].joints)
                .map(|(joint, sign)| joint.force[0] * sign)
                .sum::<f64>();
        }
        Sample { displacement: x, velocity: v, acceleration: a, joints, moved: moved_now }
    }

    fn switch_times(&self) -> Vec<f64> {
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
        let odd = symmetry == Symmetry::HalfPeriod;
        Judge::of_any_size(&self.system).judge(&self.system, self.omega, odd, start).derivative
    }
}
