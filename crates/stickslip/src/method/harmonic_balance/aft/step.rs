//! Motion ports of laws in step form: the return map is applied from sample to sample.
//!
//! A straight step is exact for elastic-plastic laws in one direction. Between
//! samples the motion is curved. The straight step neglects `(2π h/N)²/8` of
//! the motion at harmonic h, about 5e-6 at h = 1 and 1024 samples.

use super::Port;
use super::frequency_time::{FrequencyTime, InitialState, add_entries};
use super::periodic_state::StepSequence;
use crate::law::{DisplacementBox, MAX_DIRECTIONS, StepPoint, StepView};
use num_complex::Complex64;

impl FrequencyTime {
    /// Adds the harmonics of the force in the motion `c`, [axis][harmonic], to `force`, and
    /// their derivative to `tangent`. A motion that provably sticks throughout is not sampled.
    pub(super) fn step(
        &mut self,
        step: &dyn StepView,
        port: &Port,
        c: &[Complex64],
        force: &mut [Complex64],
        tangent: Option<&mut [f64]>,
    ) {
        let (axes, nh) = (port.axes, self.harmonics.len());
        let (rest, states) = self.at_rest(port);
        let (mut mean, mut reach) = ([0.0; MAX_DIRECTIONS], [0.0; MAX_DIRECTIONS]);
        for (a, c) in c.chunks_exact(nh).enumerate() {
            for (c, h) in c.iter().zip(&self.harmonics) {
                if *h == 0 {
                    mean[a] = c.re;
                } else {
                    reach[a] += c.norm();
                }
            }
        }
        if !step.sticks_throughout((&rest, &states), DisplacementBox { mean: &mean, half_width: &reach }) {
            return self.step_by_step(step, port, c, force, tangent);
        }
        self.state.clear();
        self.dissipates = false;
        self.forgetting_inverse.clear();
        self.known_state = InitialState::default();
        let mut point = StepPoint::new(axes, step.states());
        step.advance_with_derivatives(axes, &rest, &mean, &states, &mut point);
        let mut tangent = tangent;
        for a in 0..axes {
            let to = &point.force_slope(a)[axes..2 * axes];
            for (k, &h) in self.harmonics.iter().enumerate() {
                let at = a * nh + k;
                if h == 0 {
                    force[at] += point.force[a];
                }
                for b in 0..axes {
                    let slope = to[b];
                    if h > 0 {
                        force[at] += c[b * nh + k] * slope;
                    }
                    if let Some(tangent) = tangent.as_deref_mut() {
                        add_entries(tangent, 2 * nh * axes, (at, h), (b * nh + k, h), [slope, 0.0, 0.0, slope]);
                    }
                }
            }
        }
    }

    /// Integrates the law through the samples of a period.
    pub(super) fn step_by_step(
        &mut self,
        step: &dyn StepView,
        port: &Port,
        c: &[Complex64],
        force: &mut [Complex64],
        tangent: Option<&mut [f64]>,
    ) {
        let (axes, nh) = (port.axes, self.harmonics.len());
        let (rest, states) = self.at_rest(port);
        for a in 0..axes {
            let c = &c[a * nh..(a + 1) * nh];
            self.synthesise(c, |_| Complex64::new(1.0, 0.0));
            self.displacement[a].copy_from_slice(&self.signal);
        }
        let displacement = std::mem::take(&mut self.displacement);
        let point = StepPoint::new(axes, step.states());
        let mut trail = std::mem::take(&mut self.states_at_samples);
        trail.clear();
        trail.resize(self.samples() * step.states(), f64::NAN);
        let mut stepper = ReturnMapStepper { step, axes, samples: &displacement, rest, states, point, trail };
        self.periodic_response(&mut stepper, force, tangent);
        self.states_at_samples = stepper.trail;
        self.displacement = displacement;
    }
}

/// Steps of a law from sample to sample. The inputs of a step are the
/// displacements before it, then after it.
struct ReturnMapStepper<'a> {
    step: &'a dyn StepView,
    axes: usize,
    samples: &'a [Vec<f64>; MAX_DIRECTIONS],
    /// Displacements and states in static equilibrium, where the initial step begins.
    rest: [f64; MAX_DIRECTIONS],
    states: Vec<f64>,
    point: StepPoint,
    /// States at the samples of the last period, see [`StepView::advance_cycle`].
    trail: Vec<f64>,
}

impl ReturnMapStepper<'_> {
    fn read(&self, i: usize) -> [f64; MAX_DIRECTIONS] {
        std::array::from_fn(|a| if a < self.axes { self.samples[a][i] } else { 0.0 })
    }

    fn advance(
        &mut self,
        (from, to): (&[f64; MAX_DIRECTIONS], &[f64; MAX_DIRECTIONS]),
        before: &[f64],
        after: &mut [f64],
        force: &mut [f64; MAX_DIRECTIONS],
        rows: Option<&mut [f64]>,
    ) -> bool {
        let Some(rows) = rows else {
            after.copy_from_slice(before);
            *force = self.step.advance_values(from, to, after);
            return after.iter().all(|z| z.is_finite());
        };
        self.step.advance_with_derivatives(self.axes, from, to, before, &mut self.point);
        *force = self.point.force;
        after.copy_from_slice(&self.point.state);
        let (m, width) = (before.len(), 2 * self.axes + before.len());
        for s in 0..m {
            rows[s * width..(s + 1) * width].copy_from_slice(self.point.state_slope(s));
        }
        for a in 0..self.axes {
            rows[(m + a) * width..(m + a + 1) * width].copy_from_slice(self.point.force_slope(a));
        }
        after.iter().all(|z| z.is_finite())
    }
}

impl StepSequence for ReturnMapStepper<'_> {
    fn states(&self) -> usize {
        self.step.states()
    }
    fn state_scale(&self) -> f64 {
        self.step.state_scale()
    }
    fn axes(&self) -> usize {
        self.axes
    }
    fn inputs(&self) -> usize {
        2
    }
    fn input_factors(&self, h: usize, angle: f64, at: Complex64) -> [Complex64; 4] {
        let zero = Complex64::new(0.0, 0.0);
        [at * Complex64::cis(-angle * h as f64), at, zero, zero]
    }
    fn initial_input_factors(&self, _h: usize) -> [Complex64; 4] {
        [0.0, 1.0, 0.0, 0.0].map(|x| Complex64::new(x, 0.0))
    }
    fn period(&mut self, z: &mut [f64], force: &mut [Vec<f64>; MAX_DIRECTIONS], rows: Option<&mut [f64]>) -> bool {
        self.step.advance_cycle(self.axes, self.samples, (&mut *z, &mut self.trail), force, rows);
        z.iter().all(|z| z.is_finite())
    }
    /// Slip dissipates energy. The trapezoidal rule is exact for a joint that sticks.
    fn dissipates(&self, force: &[Vec<f64>; MAX_DIRECTIONS]) -> bool {
        // Dissipated energy, relative to the work that is exchanged, that is more than rounding.
        let rounding = 1e-9;
        let (mut dissipated, mut exchanged) = (0.0, 0.0);
        for (force, motion) in force.iter().zip(self.samples).take(self.axes) {
            for i in 0..motion.len() {
                let next = (i + 1) % motion.len();
                let work = 0.5 * (force[i] + force[next]) * (motion[next] - motion[i]);
                dissipated += work;
                exchanged += work.abs();
            }
        }
        dissipated > rounding * exchanged
    }
    fn initial_step(&mut self, after: &mut [f64], force: &mut [f64; MAX_DIRECTIONS], rows: Option<&mut [f64]>) -> bool {
        let (from, to) = (self.rest, self.read(0));
        let before = std::mem::take(&mut self.states);
        let found = self.advance((&from, &to), &before, after, force, rows);
        self.states = before;
        found
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Kernel, StaticState};
    use super::*;
    use crate::law::{FrictionContact, Jenkins2d, Law};
    use std::sync::Arc;

    fn port(law: impl Law + 'static, axes: usize) -> Port {
        let states = law.step().map_or(0, |step| step.states());
        Port {
            members: Vec::new(),
            first_axis: 0,
            axes,
            series_compliance: 0.0,
            scale: law.force_scale(),
            least_penalty: 0.0,
            static_state: StaticState { states: vec![0.0; states], ..StaticState::default() },
            kernel: Kernel::Step(Arc::new(law)),
        }
    }

    /// For a motion that sticks, the shortcut agrees with the samples. A larger
    /// motion does not use the shortcut.
    #[test]
    fn sticking_shortcut_agrees_with_samples() {
        let contact = FrictionContact { tangential: 3.0, normal: 2.0, friction: 0.5, preload: 4.0, tangents: 2 };
        let line = FrictionContact { tangents: 1, ..contact };
        let plane = Jenkins2d { stiffness: 3.0, limit: 1.8 };
        let ports = [port(contact, 3), port(line, 2), port(plane, 2)];
        let laws: [&dyn StepView; 3] = [&contact, &line, &plane];
        for (law, port) in laws.into_iter().zip(&ports) {
            let axes = port.axes;
            for harmonics in [vec![0, 1, 2, 3], vec![1, 3]] {
                let nh = harmonics.len();
                let imaginary = |k: usize| if harmonics[k] == 0 { 0.0 } else { 0.1 };
                let c: Vec<Complex64> = (0..axes * nh)
                    .map(|i| Complex64::new(0.12 / (1.0 + i as f64), -imaginary(i % nh) / (2.0 + i as f64)))
                    .collect();
                let mut aft = FrequencyTime::new(harmonics, 256);
                let size = 2 * nh * axes;
                let mut found = [(); 2].map(|()| (vec![Complex64::new(0.0, 0.0); axes * nh], vec![0.0; size * size]));
                let [(force, slopes), (sampled, sampled_slopes)] = &mut found;
                aft.law_steps = 0;
                aft.step(law, port, &c, force, Some(slopes));
                assert_eq!(aft.law_steps, 0, "{law:?} was sampled");
                aft.step_by_step(law, port, &c, sampled, Some(sampled_slopes));
                assert!(force.iter().zip(&*sampled).all(|(a, b)| (a - b).norm() < 1e-12), "{force:?} {sampled:?}");
                for (i, (a, b)) in slopes.iter().zip(&*sampled_slopes).enumerate() {
                    assert!((a - b).abs() < 1e-11, "{law:?}, row {}, column {}: {a} {b}", i / size, i % size);
                }
                let far: Vec<Complex64> = c.iter().map(|c| c * 9.0).collect();
                aft.step(law, port, &far, force, None);
                assert!(aft.law_steps > 0, "{law:?} slips");
            }
        }
    }

    /// From the states of a nearby motion, the evaluation finds the same states
    /// as from static equilibrium, in fewer periods.
    #[test]
    fn states_follow_from_those_of_a_motion_nearby() {
        let contact = FrictionContact { tangential: 3.0, normal: 2.0, friction: 0.5, preload: 1.0, tangents: 2 };
        let harmonics = vec![0, 1, 2, 3];
        let nh = harmonics.len();
        let at = |change: f64| -> Vec<Complex64> {
            let own = |i: usize| Complex64::new(0.2 / (1.0 + i as f64), if i.is_multiple_of(nh) { 0.0 } else { -0.1 });
            (0..3 * nh).map(|i| own(i) * (1.0 + change * (i as f64).sin())).collect()
        };
        let none = vec![Complex64::new(0.0, 0.0); 3 * nh];
        let mut aft = FrequencyTime::new(harmonics, 512);
        let mut slopes = vec![0.0; (6 * nh).pow(2)];
        let port = port(contact, 3);
        aft.step(&contact, &port, &at(0.0), &mut none.clone(), Some(&mut slopes));
        let known = InitialState { state: aft.state.clone(), forgetting_inverse: aft.forgetting_inverse.clone() };
        assert!(known.forgetting_inverse.len() == 4, "a contact that slips forgets");
        for change in [1e-6, 1e-2, 0.3] {
            let mut run = |begin: InitialState| {
                let mut force = none.clone();
                (aft.known_state, aft.law_steps) = (begin, 0);
                aft.step(&contact, &port, &at(change), &mut force, None);
                (force, aft.law_steps)
            };
            let (from_rest, many) = run(InitialState::default());
            let (nearby, few) = run(known.clone());
            assert!(
                from_rest.iter().zip(&nearby).all(|(a, b)| (a - b).norm() < 1e-11),
                "{change}: {from_rest:?} {nearby:?}"
            );
            assert!(few < many || change > 0.1, "{change}: {few} steps, {many} from rest");
        }
    }

    /// A contact that slips for some periods and then sticks: the forces do not depend on the
    /// states of a nearby motion, and their derivatives are those of the difference quotient.
    #[test]
    fn a_contact_that_slips_into_stick_has_exact_derivatives() {
        let contact = FrictionContact { tangential: 3.0, normal: 2.0, friction: 0.5, preload: 4.0, tangents: 2 };
        let (harmonics, port) = (vec![0, 1, 2, 3], port(contact, 3));
        let nh = harmonics.len();
        let size = 6 * nh;
        let at = |factor: f64, change: f64, part: usize, seed: usize| -> Vec<Complex64> {
            let own = |i: usize| {
                let phase = Complex64::cis(1.0 + ((seed + 1) * i) as f64);
                let c = if i.is_multiple_of(nh) { Complex64::new(0.1, 0.0) } else { phase * (1.2 / (1.0 + i as f64)) };
                let moved = [Complex64::new(change, 0.0), Complex64::new(0.0, change)][part % 2];
                c * factor + if i == part / 2 { moved } else { Complex64::new(0.0, 0.0) }
            };
            (0..3 * nh).map(own).collect()
        };
        let mut aft = FrequencyTime::new(harmonics, 128);
        let mut run = |c: &[Complex64], known: InitialState, slopes: Option<&mut [f64]>| {
            let mut force = vec![Complex64::new(0.0, 0.0); 3 * nh];
            aft.known_state = known;
            aft.step_by_step(&contact, &port, c, &mut force, slopes);
            let state = aft.dissipating_state().to_vec();
            (force, InitialState { state, forgetting_inverse: aft.forgetting_inverse.clone() })
        };
        for (factor, seed) in (0..20).flat_map(|seed| (25..60).map(move |i| (0.02 * f64::from(i), seed))) {
            let mut slopes = vec![0.0; size * size];
            let (force, known) = run(&at(factor, 0.0, 0, seed), InitialState::default(), Some(&mut slopes));
            assert!(force.iter().all(|f| f.is_finite()));
            let [nearby, rest] =
                [known, InitialState::default()].map(|known| run(&at(1.01 * factor, 0.0, 0, seed), known, None).0);
            let apart = nearby.iter().zip(&rest).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            assert!(apart < 1e-9, "{factor}, {seed}: {apart:.1e} between two histories");
            // the mean has no imaginary part
            for part in (0..size).filter(|part| part % (2 * nh) != 1) {
                let step = 1e-7;
                let [ahead, behind] =
                    [step, -step].map(|change| run(&at(factor, change, part, seed), InitialState::default(), None).0);
                for (i, (a, b)) in ahead.iter().zip(&behind).enumerate() {
                    let quotient = (a - b) / (2.0 * step);
                    for (row, value) in [(2 * i, quotient.re), (2 * i + 1, quotient.im)] {
                        let slope = slopes[row * size + part];
                        assert!((slope - value).abs() < 1e-3, "{factor}, {seed}, {row} by {part}: {slope} {value}");
                    }
                }
            }
        }
    }
}
