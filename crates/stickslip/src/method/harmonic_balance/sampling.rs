//! What the samples of a solution leave out: laws that are followed through the period, sample by sample, err by the square of its step.

use super::coupled::Near;
use super::ease::GIVEN;
use super::equations::{Level, Motion, Slopes};
use super::ports::{Alternation, Port, Ports};

/// Error of a motion by 1024 samples, relative, that laws with a memory were seen to have (hysteresis in a plane, contacts that part): as many more are
/// taken as the tolerance asks for, and the estimate says whether they were enough.
const SEEN: f64 = 2e-5;
/// Samples from which that is reckoned, and at most as many.
const AT: f64 = 1024.0;
const MOST: f64 = 65536.0;

/// Samples per period that laws with a memory need for an error of the motion, relative.
pub(super) fn samples_for(tolerance: f64) -> usize {
    (AT * (SEEN / tolerance).sqrt().max(1.0)).min(MOST) as usize
}

impl Level {
    /// A solution after a step of Newton's method with twice the samples and the derivative by those that there are: its distance is what the samples
    /// leave out, three quarters of it. `None` where no law is followed through the period: other forces are exact, or see their samples in the longer
    /// series.
    pub(super) fn by_twice_the_samples(&mut self, ports: &Ports, omega: f64, solution: &Motion) -> Option<Motion> {
        if !ports.iter().any(Port::marches) {
            return None;
        }
        let length = self.length(solution);
        let mut motion = solution.clone();
        self.nearby = false;
        self.evaluate(ports, omega, &mut motion, GIVEN, length, Slopes::Cheap);
        let sketched = self.follow_slopes(ports, omega, &mut motion, (GIVEN, self.keeps_sketch()));
        let mut twice = Alternation::new(self.harmonics().to_vec(), 2 * self.alternation.samples());
        std::mem::swap(&mut self.alternation, &mut twice);
        let residual = self.evaluate(ports, omega, &mut motion, GIVEN, length, Slopes::None);
        let stepped = self.newton_step(ports, omega, GIVEN, Near { length, residual, sketched });
        if stepped {
            self.before.copy(&motion);
            self.advance(ports, &mut motion, 1.0, length);
            self.evaluate(ports, omega, &mut motion, GIVEN, length, Slopes::None);
        }
        std::mem::swap(&mut self.alternation, &mut twice);
        stepped.then_some(motion)
    }
}

#[cfg(test)]
mod tests {
    use super::super::HarmonicBalance;
    use crate::law::{Dahl, Jenkins2d, SharedLaw, Valanis};
    use crate::method::Method;
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring, System};
    use crate::orbit::Orbit;
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
