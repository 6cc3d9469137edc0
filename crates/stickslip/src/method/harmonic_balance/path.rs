//! The orbit of a solution of harmonic balance.

use super::equations::{Level, Motion};
use super::ports::Ports;
use super::rest::Rest;
use crate::law::{Contact, MOST_DIRECTIONS};
use crate::method::evidence::{Judge, Judged};
use crate::model::{MovedPlace, System};
use crate::orbit::{
    Accuracy, Energy, Evidence, JointMotion, JointSample, Orbit, Path, PlaceMotion, Sample, Symmetry, history, laws,
};
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
                let h = level.harmonics()[k];
                let mut x = &level.free[k] - rest.respond(h, omega, &forces);
                if h == 0 {
                    rest.settle(omega, &mut x, |q| level.mean(q, motion));
                }
                return x;
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
    for q in 0..context.ports.count() {
        let force = motion.force[q * nh].re;
        let direction = context.ports.axis(system, q).dense(system.dofs());
        left -= direction.map(|w| Complex64::new(w * force, 0.0));
        size += direction.norm() * force.abs();
    }
    let held = system.structure().spring_forces(x[0].map(|z| z.re).as_slice());
    // positions far away have forces that are rounding
    let rounding = f64::EPSILON * system.structure().largest()[2] * x[0].iter().fold(0.0, |m: f64, z| m.max(z.norm()));
    (left.map(|z| z.re) - DVector::from_vec(held)).norm() <= UNHELD * size + 1e3 * rounding
}

#[derive(Debug, Clone)]
struct Series {
    system: System,
    omega: f64,
    harmonics: Vec<usize>,
    x: Vec<DVector<Complex64>>,
    /// Forces along the axes and contact, per joint and sample.
    force: Vec<Vec<[f64; MOST_DIRECTIONS]>>,
    contact: Vec<Vec<Contact>>,
}

/// What the solver knows beside the motion.
pub(super) struct Context<'a> {
    pub system: &'a System,
    pub ports: &'a Ports,
    pub omega: f64,
    /// The harmonic that has the drive's frequency.
    pub first: usize,
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
    let Context { system, ports, omega, first, odd, truncation, tolerance, judge } = context;
    let (n, nh) = (system.dofs(), level.harmonics().len());
    let harmonics = level.harmonics().to_vec();
    let samples = level.alternation.samples();
    let mut force = vec![vec![[0.0; MOST_DIRECTIONS]; samples]; system.joints().len()];
    let mut contact = vec![vec![Contact::Stick; samples]; system.joints().len()];
    let mut joints = Vec::new();
    let mut states = Vec::new();
    let mut stuck = Vec::new();
    for (j, joint) in system.joints().iter().enumerate() {
        let (axes, force, contact) = (joint.axes(), &mut force[j], &mut contact[j]);
        // ∮ f du with the projected force: for the series it is the integral itself
        let mut dissipation = 0.0;
        // no port: what holds nothing slips all the time
        let mut told = false;
        for (p, port) in ports.iter().enumerate().filter(|(_, port)| port.joint == j) {
            for q in port.range() {
                let range = q * nh..(q + 1) * nh;
                let (c, f) = (&motion.c[range.clone()], &motion.force[range]);
                dissipation += (0..nh).map(|k| cycle_work(harmonics[k], f[k], c[k])).sum::<f64>();
            }
            level.sample(ports, p, omega, motion);
            let alternation = &level.alternation;
            for (i, force) in force.iter_mut().enumerate() {
                for (a, force) in force.iter_mut().enumerate().take(port.axes) {
                    *force += alternation.force[a][i];
                }
                if port.tells_slip() && alternation.slips[i] {
                    contact[i] = Contact::slip(alternation.force[0][i]);
                }
            }
            told |= port.tells_slip();
            match joint.law().rate() {
                Some(rate) if port.is_force() => {
                    let mut z = vec![0.0; rate.states()];
                    // the sampled force is within the law's bounds, which that of the series may pass
                    let now: [f64; MOST_DIRECTIONS] = std::array::from_fn(|a| alternation.force[a][0]);
                    rate.state_under(&now[..port.axes], &mut z);
                    states.extend(z);
                }
                _ if port.is_force() => {}
                _ => states.extend(&alternation.state),
            }
        }
        let along: Vec<Vec<(usize, Complex64)>> = axes
            .iter()
            .map(|axis| {
                let series = harmonics.iter().zip(&x);
                series.map(|(&h, x)| (h, axis.imposed_at(h as u32) + axis.along_complex(x))).collect()
            })
            .collect();
        if !told {
            let velocity: Vec<Vec<f64>> = along
                .iter()
                .map(|u| {
                    let velocity: Vec<_> =
                        u.iter().map(|(h, c)| (*h, Complex64::new(0.0, *h as f64 * omega) * c)).collect();
                    level.alternation.fourier.synthesise(&velocity, &mut level.alternation.signal);
                    level.alternation.signal.clone()
                })
                .collect();
            for (i, (contact, force)) in contact.iter_mut().zip(force.iter()).enumerate() {
                let now: [f64; MOST_DIRECTIONS] = std::array::from_fn(|a| velocity.get(a).map_or(0.0, |v| v[i]));
                *contact = joint.law().contact(&now[..axes.len()], &force[..axes.len()]);
            }
        }
        let displacement = along.iter().map(|u| extremes(u, level)).collect();
        let slipping = contact.iter().filter(|c| c.slips()).count();
        let moving = contact.iter().filter(|c| **c != Contact::Stick).count();
        let switches = (0..samples).filter(|&i| contact[i] != contact[(i + 1) % samples]).count();
        // a law that bounds no force never slips, and is one of no continuum
        if moving == 0 && joint.law().scale().is_finite() {
            stuck.push(joint.name().to_owned());
        }
        joints.push(JointMotion {
            name: joint.name().to_owned(),
            dissipation,
            slip_fraction: slipping as f64 / samples as f64,
            displacement,
            switches,
        });
    }
    let places = (0..n)
        .map(|i| {
            let series: Vec<(usize, Complex64)> = (0..nh).map(|k| (harmonics[k], x[k][i])).collect();
            let (minimum, maximum) = extremes(&series, level);
            let at = |h: usize| harmonics.binary_search(&h).map_or(ZERO, |k| x[k][i]);
            PlaceMotion {
                name: system.places()[i].clone(),
                maximum,
                minimum,
                mean: at(0).re,
                first_harmonic: at(first),
            }
        })
        .collect();
    let energy = energy(system, ports, omega, &harmonics, &x, motion, &joints);
    let possible = possible_work(system, omega, &harmonics, &x) + energy.friction.abs();
    let reference = energy.work_in.abs().max(NO_WORK * possible);
    let balance = energy.work_in - energy.viscous - energy.friction;
    let mut start: Vec<f64> = (0..n).map(|i| x.iter().map(|x| x[i].re).sum()).collect();
    start.extend((0..n).map(|i| x.iter().zip(&harmonics).map(|(x, &h)| -x[i].im * h as f64 * omega).sum::<f64>()));
    start.extend(states);
    let symmetry = if odd { Symmetry::HalfPeriod } else { Symmetry::FullPeriod };
    let contracts = judge.as_ref().is_some_and(|judge| judge.proves());
    let Judged { derivative, defect } =
        judge.map_or_else(Judged::default, |judge| judge.judge(system, omega, odd, &start));
    Some(Orbit {
        method: super::NAME,
        omega,
        periods: 1,
        symmetry,
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
            history: history(laws(system), &joints, &stuck, symmetry),
            stuck,
        },
        joints,
        energy,
        return_map: derivative.unwrap_or_else(|| DMatrix::zeros(0, 0)),
        contracts,
        path: Arc::new(Series { system: system.clone(), omega, harmonics, x, force, contact }),
    })
}

/// Energy gap beyond which a solution is no orbit: where the equations hold, energies balance to the residual, but for a resonance without
/// damping, whose receptance has no number.
const UNBALANCED: f64 = 1e-2;
/// Energies below this fraction of what the loads could store in the structure are those of rounding: all is stuck.
const STILL: f64 = 1e-9;

/// Whether the energies of an orbit balance, or are none.
pub(super) fn balances(system: &System, orbit: &Orbit) -> bool {
    let [mass, _, stiffness] = system.structure().largest();
    let stiff = stiffness.max(orbit.omega * orbit.omega * mass);
    let loads: f64 = system.excitation(orbit.omega).iter().map(|(_, load)| load.norm_squared()).sum();
    let Energy { work_in, viscous, friction } = orbit.energy;
    let balance = (work_in - viscous - friction).abs();
    orbit.evidence.energy_gap <= UNBALANCED || balance <= STILL * loads / stiff.max(f64::MIN_POSITIVE)
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
    ports: &Ports,
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
    let entries = system.structure().entries();
    let dampers: Vec<(usize, usize, f64)> =
        entries.map(|(i, l, [_, c, _])| (i, l, c)).filter(|(_, _, c)| *c != 0.0).collect();
    for (k, &h) in harmonics.iter().enumerate() {
        let s = Complex64::new(0.0, h as f64 * omega);
        let x = &x[k];
        if let Some((_, load)) = excitation.iter().find(|(number, _)| *number as usize == h) {
            work += (0..n).map(|i| cycle_work(h, load[i], x[i])).sum::<f64>();
        }
        for &(i, l, c) in &dampers {
            viscous += cycle_work(h, s * x[l] * c, x[i]);
        }
        for (m, place) in system.moved().iter().enumerate() {
            let g = moved(place, h);
            let numbers: Vec<(usize, usize)> = system
                .joints()
                .iter()
                .enumerate()
                .flat_map(|(j, joint)| (0..joint.axes().len()).map(move |a| (j, a)))
                .collect();
            let joint_part: Complex64 = (0..ports.count())
                .map(|q| {
                    let number = numbers.binary_search(&ports.place(q)).unwrap_or(0);
                    motion.force[q * nh + k] * place.joints[number]
                })
                .sum();
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
            // harmonics stand at equal distances
            let first = series[0].0;
            let mut turn = Complex64::cis(first as f64 * theta);
            let next = Complex64::cis(series.get(1).map_or(0, |(h, _)| h - first) as f64 * theta);
            let (mut value, mut slope, mut bend) = (0.0, 0.0, 0.0);
            for &(h, c) in series {
                let z = c * turn;
                let h = h as f64;
                value += z.re;
                slope -= h * z.im;
                bend -= h * h * z.re;
                turn *= next;
            }
            let step = slope / bend;
            if !step.is_finite() || step.abs() > TAU / n as f64 {
                break;
            }
            theta -= step;
            // the vertex of the parabola there: what it leaves out has the third power of the step
            best = value - 0.5 * slope * step;
            if step.abs() * step.abs() < f64::EPSILON {
                break;
            }
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
                let (before, after) = (self.force[j][low % samples], self.force[j][(low + 1) % samples]);
                let mut sample = JointSample::along(0.0, 0.0, 0.0, self.contact[j][(at.round() as usize) % samples]);
                for (a, axis) in joint.axes().iter().enumerate() {
                    sample.displacement[a] = axis.along(&x);
                    sample.velocity[a] = axis.along(&v);
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
            now.1 += forces.iter().zip(&self.system.moved()[m].joints).map(|(force, sign)| force * sign).sum::<f64>();
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
