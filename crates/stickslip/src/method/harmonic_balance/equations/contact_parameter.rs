//! Parameters of the force equation `λ = J(λ + ε v)` of a rigid contact with velocity `v`.
//!
//! If nothing but such contacts supports a direction of the structure, no term of this equation
//! contains the mean `ū` of the contact's motion: the balance of the mean forces would follow
//! from the initial guess. There the contact moves at the mean velocity `κ ū / ε`, which is zero
//! in a periodic motion: `λ = J(λ + ε v + κ ū)`. The springs that regularize the direction turn
//! an unbalanced force into the mean, so the equation requires the balance and `ū = 0`.

use num_complex::Complex64;

/// Parameter of `ε = (1 + RIPPLE / H) Z`, with the impedance `Z` of the contact at the highest
/// harmonic `H`. The series cannot resolve forces above `H`. With a larger ε the force
/// oscillates in stick; with a smaller one a change of sign is blurred. The second term
/// sharpens the change of sign if the harmonics are few and do not oscillate. One harmonic then
/// gives the describing function.
const RIPPLE: f64 = 30.0;

/// Parameters of the force equation of one contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ContactParameters {
    /// Parameter ε, N s/m; infinite if the motion is imposed.
    pub epsilon: f64,
    /// Parameter κ, N/m: zero if springs support the contact.
    pub mean_stiffness: f64,
}

impl ContactParameters {
    /// Returns the parameters of a supported contact.
    pub fn supported(epsilon: f64) -> Self {
        ContactParameters { epsilon, mean_stiffness: 0.0 }
    }

    /// Returns true if the motion along the contact is imposed, so that no force changes it.
    pub fn is_imposed(self) -> bool {
        self.epsilon.is_infinite()
    }

    /// Returns the derivative of the argument `λ + ε v + κ ū` by the motion at harmonic `h`, N/m.
    /// It is zero if the motion is imposed.
    pub fn motion_derivative(self, h: usize, omega: f64) -> Complex64 {
        if self.is_imposed() {
            Complex64::ZERO
        } else if h == 0 {
            Complex64::new(self.mean_stiffness, 0.0)
        } else {
            Complex64::new(0.0, self.epsilon * h as f64 * omega)
        }
    }

    /// Returns the derivatives of `slopes · (Re d u, Im d u)` by the real and the imaginary part of
    /// a motion `u` at harmonic `h`, with the derivative `d` of the argument.
    pub fn row(self, slopes: (f64, f64), h: usize, omega: f64) -> (f64, f64) {
        let d = self.motion_derivative(h, omega);
        let (re, im) = slopes;
        (re * d.re + im * d.im, im * d.re - re * d.im)
    }
}

/// Returns ε (N s/m) of a contact with this receptance (m/N) at the highest harmonic `top`.
pub(crate) fn contact_parameter(receptance: f64, top: usize, omega: f64) -> f64 {
    let impedance = 1.0 / (receptance * top as f64 * omega);
    impedance * (1.0 + RIPPLE / top as f64)
}

#[cfg(test)]
mod tests {
    use crate::law::Coulomb;
    use crate::method::event_driven::EventDriven;
    use crate::method::harmonic_balance::HarmonicBalance;
    use crate::method::harmonic_balance::equations::regularization::REGULARIZING_FREQUENCY;
    use crate::method::{Method, OrbitError};
    use crate::model::{Force, GROUND, Joint, Mass, Model, Spring, System};
    use crate::orbit::Orbit;
    use std::f64::consts::TAU;
    use std::sync::Arc;

    /// Stiffness of the blades, N/m.
    const BLADES: [f64; 2] = [1.1e5, 1.6e5];

    /// Returns two blades and a damper of 0.25 kg that only rigid friction holds, against the
    /// first blade or against both. 20 N excite the first blade, `load` (N) pulls at the damper.
    fn damped_blades(joints: &[(&str, f64)], load: f64) -> System {
        let force = |on: &str, amplitude, harmonic| Force { on: on.into(), amplitude, phase: 0.0, harmonic };
        let mut model = Model {
            masses: vec![Mass::new("damper", 0.25)],
            forces: vec![force("b0", 20.0, 1), force("damper", load, 0)],
            ..Model::default()
        };
        for (i, stiffness) in BLADES.into_iter().enumerate() {
            let blade = format!("b{i}");
            model.masses.push(Mass::new(blade.clone(), 0.75 + 0.65 * i as f64));
            model.springs.push(Spring { between: [blade, GROUND.into()], stiffness, damping: 5.0 });
        }
        model.joints.extend(joints.iter().map(|&(blade, limit)| Joint {
            name: format!("to_{blade}"),
            between: ["damper".into(), blade.into()],
            law: Arc::new(Coulomb { limit }),
        }));
        model.assemble().unwrap()
    }

    fn orbits(system: &System, hertz: f64) -> [Result<Orbit, OrbitError>; 2] {
        let methods: [&dyn Method; 2] = [&HarmonicBalance::default(), &EventDriven];
        methods.map(|method| method.solver(system).unwrap().orbit(TAU * hertz))
    }

    /// The spring of the blade carries the load, and the joint stays at its place of rest.
    #[test]
    fn a_stuck_damper_rests_where_the_load_moves_its_blade() {
        let (load, hertz) = (-3.0f64, 40.0);
        let [found, _] = orbits(&damped_blades(&[("b0", 20.0)], load), hertz);
        // the compliance of the regularizing spring of 0.25 kg multiplies the rounding of the load
        let rounding = f64::EPSILON * load.abs() / (0.25 * (REGULARIZING_FREQUENCY * TAU * hertz).powi(2));
        for place in &found.unwrap().places[..2] {
            assert!((place.mean - load / BLADES[0]).abs() < 4.0 * rounding, "{}", place.mean);
        }
    }

    /// The load acts on a part of the body, at some distance from the stuck joint that holds it:
    /// its mean is that of a spring, `F₀/k`, and its amplitude `F/|k - m Ω² + j c Ω|`.
    #[test]
    fn a_stuck_joint_carries_a_load_through_a_spring() {
        let (load, force, hertz, stiffness, damping) = (0.4, 3.0, 6.0, 4000.0, 2.0);
        let on = |amplitude, harmonic| Force { on: "a".into(), amplitude, phase: 0.0, harmonic };
        let model = Model {
            masses: vec![Mass::new("a", 1.0), Mass::new("b", 1.0)],
            springs: vec![Spring { between: ["a".into(), "b".into()], stiffness, damping }],
            joints: vec![Joint {
                name: "j".into(),
                between: ["b".into(), GROUND.into()],
                law: Arc::new(Coulomb { limit: 16.0 }),
            }],
            forces: vec![on(force, 1), on(load, 0)],
            ..Model::default()
        };
        let rate = TAU * hertz;
        let amplitude = force / (stiffness - rate * rate).hypot(damping * rate);
        let orbit = HarmonicBalance::default().solver(&model.assemble().unwrap()).unwrap().orbit(rate).unwrap();
        let place = &orbit.places[0];
        assert!((place.amplitude() / amplitude - 1.0).abs() < 1e-9, "{} {amplitude}", place.amplitude());
        // rounding times the compliance of the regularizing spring of 2 kg, as above
        let rounding = f64::EPSILON * load / (2.0 * (REGULARIZING_FREQUENCY * rate).powi(2));
        assert!((place.mean - load / stiffness).abs() < 4.0 * rounding, "{}", place.mean);
        assert_eq!(orbit.joints[0].slip_fraction, 0.0);
    }

    /// The damper slips and sticks against both blades. The springs of the blades carry the load,
    /// and the vibration is that of the exact solution.
    #[test]
    fn friction_carries_a_load_while_it_slips() {
        let load = -2.5;
        for hertz in [52.0, 54.0, 60.0] {
            let [found, exact] = orbits(&damped_blades(&[("b0", 2.0), ("b1", 6.0)], load), hertz).map(Result::unwrap);
            let carried: f64 =
                found.places[1..].iter().zip(BLADES).map(|(place, stiffness)| place.mean * stiffness).sum();
            // the balance is that of a solution: its residual is rounding
            assert!((carried / load - 1.0).abs() < 1e-9, "{hertz} Hz: {carried} N");
            let truncation = found.evidence.error_estimate.unwrap();
            let largest = exact.places.iter().map(|place| place.amplitude()).fold(0.0, f64::max);
            for (found, exact) in found.places.iter().zip(&exact.places) {
                let error = (found.amplitude() - exact.amplitude()).abs() / largest;
                assert!(error < 3.0 * truncation, "{hertz} Hz: {} {}", found.amplitude(), exact.amplitude());
            }
            assert!(exact.joints.iter().any(|joint| joint.slip_fraction > 0.5), "{hertz} Hz: {:?}", exact.joints);
        }
    }

    /// The load exceeds the limit, or the damper slips in one direction only.
    #[test]
    fn a_load_that_friction_does_not_hold_drifts() {
        for (joints, load) in [(&[("b0", 2.0)][..], 4.0), (&[("b0", 2.0), ("b1", 6.0)], -2.5)] {
            for error in orbits(&damped_blades(joints, load), 46.0).map(Result::unwrap_err) {
                assert_eq!(error.status(), "drifts", "{error}");
            }
        }
    }
}
