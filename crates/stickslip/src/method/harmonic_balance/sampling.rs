//! What the samples of a solution leave out: laws that are followed through the period, sample by sample, err by the square of its step.

use super::coupled::Near;
use super::ease::{GIVEN, SOLVED};
use super::equations::{Level, Slopes, Solution};
use super::ports::{Alternation, Beginning, Port, Ports};

/// The last step by twice the samples, at most, as a share of the distance that is to be known: steps leave some hundredths of themselves.
const SHARE: f64 = 0.1;
/// The same of many contacts, of which another step costs as much as the first: one is enough. Measured: of 16 and of 100 nodes the distance
/// is then known to three hundredths at nearly all points of a curve, and to a tenth at every one.
const SHARE_OF_COUPLED: f64 = 3.0;
/// Steps, and what each is to leave of the one before.
const MOST_STEPS: usize = 8;
const CLOSER: f64 = 0.3;

impl Level {
    /// The motion near `start` by twice the samples, as exactly as its distance from `coarse` is to be known; `states`, those of the shorter series that is
    /// `coarse`. `None` where no law is followed through the period, and where it was not found.
    pub(super) fn approach_by_twice_the_samples(
        &mut self,
        ports: &Ports,
        omega: f64,
        start: &Solution,
        coarse: &Solution,
        states: Option<&[Beginning]>,
    ) -> Option<Solution> {
        if !ports.iter().any(Port::marches) {
            return None;
        }
        self.begin_anew(ports);
        if let Some(states) = states
            && self.keeps_sketch()
            && ports.iter().all(Port::steps)
        {
            // fewer samples find states of their own from these
            self.states.clone_from_slice(states);
            self.follow_slopes(ports, omega, &mut start.clone(), (GIVEN, true));
        }
        if let Some((motion, true)) = self.by_twice_the_samples(ports, omega, start, coarse) {
            return Some(motion);
        }
        let near = self.approach(ports, omega, start)?;
        let (motion, found) = self.by_twice_the_samples(ports, omega, &near, coarse)?;
        found.then_some(motion)
    }

    /// Steps from a motion that was sought last to the one by twice the samples, until the distance from `coarse` is known; and whether it is. `None`
    /// where no law is followed through the period: other forces are exact, or see their samples in the longer series.
    ///
    /// The derivative is the last of the search, by the samples that there are or by fewer: a step leaves some hundredths of itself, and the next one
    /// shows it.
    pub(super) fn by_twice_the_samples(
        &mut self,
        ports: &Ports,
        omega: f64,
        near: &Solution,
        coarse: &Solution,
    ) -> Option<(Solution, bool)> {
        if !ports.iter().any(Port::marches) {
            return None;
        }
        let mut motion = near.clone();
        let length = self.length(&motion);
        if !self.linearised {
            self.linearise_at(ports, omega, &mut motion, length);
        }
        let near = |residual, kept| Near { length, residual, sketched: true, kept };
        let (mut last, mut found, mut left) = (f64::INFINITY, false, MOST_STEPS);
        let share = if self.is_coupled() { SHARE_OF_COUPLED } else { SHARE };
        loop {
            self.exchange_for_twice();
            self.nearby = true;
            let residual = self.evaluate(ports, omega, &mut motion, GIVEN, length, Slopes::None);
            self.nearby = false;
            self.exchange_for_twice();
            if residual <= SOLVED {
                return Some((motion, true));
            }
            if !self.newton_step(ports, omega, GIVEN, near(residual, last.is_finite())) {
                return None;
            }
            self.before.copy(&motion);
            self.advance(ports, &mut motion, 1.0, length);
            let step = self.apart(ports, &motion, &self.before, length);
            found |= step <= share * self.apart(ports, &motion, coarse, length);
            left -= 1;
            if found || left == 0 || step > CLOSER * last {
                self.step_forces(ports, &mut motion, length);
                self.follow(&mut motion, GIVEN);
                return Some((motion, found));
            }
            last = step;
        }
    }

    /// The derivatives of all laws at a motion, from where it is known that they repeat.
    fn linearise_at(&mut self, ports: &Ports, omega: f64, motion: &mut Solution, length: f64) {
        self.evaluate(ports, omega, motion, GIVEN, length, Slopes::Cheap);
        self.follow_slopes(ports, omega, motion, (GIVEN, self.keeps_sketch()));
    }

    /// The distance of the unknowns of two motions, without means, relative to their units.
    fn apart(&self, ports: &Ports, one: &Solution, other: &Solution, length: f64) -> f64 {
        let nh = self.harmonics().len();
        let moving = |at: &usize| self.harmonics()[at % nh] > 0;
        let squares = ports.iter().map(|port| {
            let (a, b) = if port.is_force() { (&one.force, &other.force) } else { (&one.c, &other.c) };
            let range = (port.first * nh..(port.first + port.axes) * nh).filter(moving);
            range.map(|at| (a[at] - b[at]).norm_sqr()).sum::<f64>() / port.unit(length).powi(2)
        });
        squares.sum::<f64>().sqrt()
    }

    /// Twice the samples become what is sampled, and back.
    fn exchange_for_twice(&mut self) {
        let (harmonics, samples) = (&self.alternation.harmonics, 2 * self.alternation.samples());
        let twice = self.twice.get_or_insert_with(|| Alternation::new(harmonics.clone(), samples));
        std::mem::swap(&mut self.alternation, twice);
    }
}

#[cfg(test)]
mod tests {
    use super::super::equations::{Level, Solution, transfer};
    use super::super::options::{HarmonicBalance, LEFT, TOLERANCE, samples_for, samples_of_steps};
    use super::super::ports::Ports;
    use super::super::rest::Rest;
    use crate::law::{Dahl, FrictionContact, Jenkins2d, SharedLaw, Valanis};
    use crate::method::Method;
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring, System};
    use crate::orbit::Orbit;
    use num_complex::Complex64;
    use std::f64::consts::TAU;
    use std::sync::Arc;

    /// A kilogram on springs of 1e4 N/m with a law in one direction or two.
    fn system(law: SharedLaw) -> System {
        let ground = GROUND.to_owned();
        let directions: Vec<String> = ["x", "z"][..law.directions()].iter().map(|d| (*d).to_owned()).collect();
        let mut model = Model::default();
        for (i, direction) in directions.iter().enumerate() {
            let place = format!("m.{direction}");
            model.springs.push(Spring {
                between: [place.clone(), ground.clone()],
                stiffness: 1e4 * (1.0 + 0.1 * i as f64),
                damping: 3.0,
            });
            let (amplitude, phase) = (10.0 / (1.0 + i as f64), 0.7 * i as f64);
            model.forces.push(Force { on: place, amplitude, phase, harmonic: 1 });
        }
        model.masses.push(Mass { name: "m".to_owned(), mass: 1.0, directions });
        model.joints.push(Joint { name: "j".to_owned(), between: ["m".to_owned(), ground], law });
        model.assemble().unwrap()
    }

    /// A row of bodies on springs that rub in a plane, each on the next one.
    fn row(bodies: usize) -> System {
        let name = |i: usize| format!("m{i}");
        let ground = GROUND.to_owned();
        let mut model = Model::default();
        for i in 0..bodies {
            let directions = vec!["x".to_owned(), "z".to_owned()];
            model.masses.push(Mass { name: name(i), mass: 1.0 + 0.02 * i as f64, directions });
            for (place, stiffness) in [("x", 1e4), ("z", 1.2e4)] {
                let between = [format!("m{i}.{place}"), ground.clone()];
                model.springs.push(Spring { between, stiffness, damping: 5.0 });
            }
            if i > 0 {
                let law: SharedLaw = Arc::new(Jenkins2d { stiffness: 5e3, limit: 1.5 + 0.1 * i as f64 });
                model.joints.push(Joint { name: format!("j{i}"), between: [name(i - 1), name(i)], law });
            }
        }
        model.forces.push(Force { on: "m0.x".to_owned(), amplitude: 8.0, phase: 0.0, harmonic: 1 });
        model.forces.push(Force { on: "m1.z".to_owned(), amplitude: 4.0, phase: 0.7, harmonic: 1 });
        model.assemble().unwrap()
    }

    /// With a few steps the distance from a motion of half the harmonics and samples is that of the whole solution, also where there are so many contacts
    /// that derivatives are by fewer samples and one step is enough.
    #[test]
    fn a_few_steps_know_the_distance() {
        for (bodies, share) in [(3, 0.01), (22, 0.03)] {
            let system = row(bodies);
            let ports = Ports::new(&system).unwrap();
            let rest = Rest::new(&system, &ports);
            let (few, many, omega) = (vec![1, 3, 5], vec![1, 3, 5, 7, 9, 11], 110.0);
            let level = |harmonics: &[usize], samples: usize| {
                let mut level = Level::new(harmonics.to_vec(), samples, &ports, None);
                level.drive(&system, &ports, &rest, omega).unwrap();
                level
            };
            let solve = |mut level: Level| {
                let start = level.begin(&system, &ports, None, omega);
                level.solve(&ports, omega, start).unwrap()
            };
            let coarse = transfer(&solve(level(&few, 1024)), &few, &many);
            let whole = solve(level(&many, 2048));
            let mut near = level(&many, 1024);
            assert_eq!(near.keeps_sketch(), bodies > 20);
            let found = near.approach_by_twice_the_samples(&ports, omega, &coarse, &coarse, None).unwrap();
            let apart = |a: &Solution, b: &Solution| near.apart(&ports, a, b, 1.0);
            let (distance, error) = (apart(&whole, &coarse), apart(&whole, &found));
            assert!(distance > 1e-5 * apart(&whole, &Solution::rest(whole.c.len())), "{distance:.1e} shows nothing");
            assert!(error < share * distance, "{bodies} bodies: {error:.1e} of {distance:.1e}");
            let forces = |a: &Solution, b: &Solution| -> f64 {
                a.force.iter().zip(&b.force).map(|(a, b)| (a - b).norm_sqr()).sum::<f64>().sqrt()
            };
            assert!(forces(&whole, &found) < share * forces(&whole, &coarse), "{bodies} bodies");
        }
    }

    /// States of the shorter series, and what a neighbouring point left of the harmonics above, lead to the same distance.
    #[test]
    fn a_neighbour_leaves_what_the_longer_series_adds() {
        let system = row(22);
        let ports = Ports::new(&system).unwrap();
        let rest = Rest::new(&system, &ports);
        let harmonics = |top: usize| -> Vec<usize> { (1..=top).step_by(2).collect() };
        let (few, many) = (harmonics(9), harmonics(19));
        let [mut short, mut long, mut whole] =
            [(&few, 1024), (&many, 1024), (&many, 2048)].map(|(h, n)| Level::new(h.clone(), n, &ports, None));
        let mut added = vec![Complex64::new(0.0, 0.0); ports.count() * many.len()];
        for omega in [110.0, 110.2] {
            for level in [&mut short, &mut long, &mut whole] {
                level.drive(&system, &ports, &rest, omega).unwrap();
            }
            let solve = |level: &mut Level| {
                let start = level.begin(&system, &ports, None, omega);
                level.solve(&ports, omega, start).unwrap()
            };
            let coarse = transfer(&solve(&mut short), &few, &many);
            let whole = solve(&mut whole);
            assert!(short.states.iter().any(|known| !known.state.is_empty()), "some slip");
            let mut start = coarse.clone();
            start.c.iter_mut().zip(&added).for_each(|(c, added)| *c += added);
            let found =
                long.approach_by_twice_the_samples(&ports, omega, &start, &coarse, Some(&short.states)).unwrap();
            let apart = |a: &Solution, b: &Solution| long.apart(&ports, a, b, 1.0);
            let (distance, error) = (apart(&whole, &coarse), apart(&whole, &found));
            assert!(error < 0.1 * distance, "{omega}: {error:.1e} of {distance:.1e}");
            added = found.c.iter().zip(&coarse.c).map(|(found, coarse)| found - coarse).collect();
        }
    }

    /// The relative distance of the first harmonics.
    fn distance(one: &Orbit, other: &Orbit) -> f64 {
        let pairs = || one.places.iter().zip(&other.places);
        let apart: f64 = pairs().map(|(a, b)| (a.first_harmonic - b.first_harmonic).norm_sqr()).sum();
        let size: f64 = pairs().map(|(_, b)| b.first_harmonic.norm_sqr()).sum();
        (apart / size).sqrt()
    }

    fn laws() -> [SharedLaw; 3] {
        [
            Arc::new(Jenkins2d { stiffness: 5e3, limit: 3.0 }),
            Arc::new(Dahl { stiffness: 5e3, limit: 3.0 }),
            Arc::new(Valanis { stiffness: 5e3, slip_stiffness: 500.0, lambda: 2e3, kappa: 0.5 }),
        ]
    }

    /// What sixteen times the samples add is in the estimate, where the harmonics leave next to nothing.
    #[test]
    fn the_estimate_has_the_error_of_the_samples() {
        // where a turning point lies between two samples decides the error of `valanis`, which 1024 and 4096 may share
        for law in &laws()[..2] {
            let system = system(law.clone());
            let orbit = |samples| {
                let method = HarmonicBalance { harmonics: Some(63), samples, ..HarmonicBalance::default() };
                method.solver(&system).unwrap().orbit(TAU * 17.0, None).unwrap()
            };
            let (found, truth) = (orbit(None), orbit(Some(16_384)));
            let (error, estimate) = (distance(&found, &truth), found.evidence.truncation.unwrap());
            assert!(error > 1e-8, "{}: {error:.1e} shows nothing", law.name());
            assert!((0.5..3.0).contains(&(estimate / error)), "{}: {error:.1e}, said {estimate:.1e}", law.name());
        }
    }

    /// Laws in steps take fewer samples at a larger tolerance, and leave their share of it.
    #[test]
    fn steps_take_few_samples_at_a_large_tolerance() {
        assert_eq!((samples_of_steps(TOLERANCE), samples_of_steps(1e-6)), (647, samples_for(1e-6)));
        let tolerance = 0.01;
        assert!(samples_of_steps(tolerance) <= 256);
        let contact = FrictionContact { tangential: 5e3, normal: 5e3, friction: 0.3, preload: 5.0, tangents: 1 };
        for law in [laws()[0].clone(), Arc::new(contact)] {
            let system = system(law.clone());
            let orbit = |samples| {
                let method = HarmonicBalance { harmonics: Some(15), samples, tolerance: Some(tolerance) };
                method.solver(&system).unwrap().orbit(TAU * 17.0, None).unwrap()
            };
            let error = distance(&orbit(None), &orbit(Some(16_384)));
            assert!(error > 1e-7 && error < LEFT * tolerance, "{}: {error:.1e}", law.name());
        }
    }

    /// A tolerance below the error of 1024 samples takes more of them, and is met.
    #[test]
    fn samples_follow_the_tolerance() {
        for law in laws() {
            let system = system(law.clone());
            let orbit = |method: HarmonicBalance| method.solver(&system).unwrap().orbit(TAU * 17.0, None).unwrap();
            let found = orbit(HarmonicBalance { tolerance: Some(1e-6), ..HarmonicBalance::default() });
            let finest = HarmonicBalance { harmonics: Some(255), samples: Some(32_768), tolerance: None };
            let error = distance(&found, &orbit(finest));
            assert!(found.evidence.truncation.unwrap() <= 1e-6 && error < 1e-6, "{}: {error:.1e}", law.name());
        }
    }
}
