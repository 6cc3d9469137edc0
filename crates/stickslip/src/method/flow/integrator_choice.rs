//! Choice of the time integration for a system.
//!
//! - [`ExactFlow`]: laws of sliders and stops; closed forms
//!   between switches.
//! - [`RadauFlow`]: laws with a rate; Radau IIA-9 with
//!   controlled steps.
//! - [`SetValuedFlow`]: friction that slides along a smooth
//!   curve, together with laws with a rate; Radau IIA-9 between located switches.
//! - [`AverageAccelerationFlow`]: laws with a step and laws
//!   with a rate together; average acceleration in equal steps.

use super::Flow;
use super::assembly::carries_nothing;
use super::average_acceleration::equal_steps::AverageAccelerationFlow;
use super::event_flow::ExactFlow;
use super::radau::step_size_control::RadauFlow;
use super::set_valued;
use super::set_valued::located_switches::SetValuedFlow;
use crate::law::SharedLaw;
use crate::method::MethodError;
use crate::method::event_driven::{Mechanics, supports};
use crate::model::System;

/// Makes the integration for the laws of a system.
///
/// `tolerance` is the relative error per step for smooth laws. `width` (m/s) smooths exact
/// laws.
///
/// # Errors
/// Fails if no integration takes the law of a joint, or if a place has no mass.
pub(crate) fn integrator(
    system: &System,
    width: Option<f64>,
    tolerance: f64,
    method: &'static str,
) -> Result<Box<dyn Flow>, MethodError> {
    match IntegratorKind::of(system, width) {
        IntegratorKind::Exact => Ok(Box::new(ExactFlow::new(Mechanics::new(system, method)?))),
        IntegratorKind::Smooth => {
            Ok(Box::new(RadauFlow::new(super::radau::assembly(system, width, method)?, tolerance)))
        }
        IntegratorKind::Switched => Ok(Box::new(SetValuedFlow::new(system, tolerance, method)?)),
        IntegratorKind::Incremental => Ok(Box::new(AverageAccelerationFlow::new(system, width, method)?)),
    }
}

/// The kind of time integration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum IntegratorKind {
    Exact,
    Smooth,
    Switched,
    Incremental,
}

impl IntegratorKind {
    /// Chooses the exact integration for sliders and stops alone, and controlled steps for laws
    /// with a rate alone. Friction on a smooth curve together with laws with a rate is
    /// integrated between switches; all other systems in equal steps.
    pub fn of(system: &System, width: Option<f64>) -> IntegratorKind {
        // a width that smooths no law has no effect
        let smooths = |width| system.joints().iter().any(|joint| joint.law().smooth_counterpart(width).is_some());
        if !width.is_some_and(smooths) && system.joints().iter().all(|joint| supports(joint.law().as_ref())) {
            return IntegratorKind::Exact;
        }
        IntegratorKind::stepping(system, width)
    }

    /// Chooses among the integrations with steps. Returns [`IntegratorKind::Exact`] only for
    /// sliders without a width.
    pub fn stepping(system: &System, width: Option<f64>) -> IntegratorKind {
        let all = |has: &dyn Fn(&SharedLaw) -> bool| system.joints().iter().all(|joint| has(joint.law()));
        let regular = |law: &SharedLaw| width.and_then(|width| law.smooth_counterpart(width));
        // a law that carries no force counts as smooth even without a rate
        let smooth = |law: &SharedLaw| regular(law).as_ref().unwrap_or(law).rate().is_some() || carries_nothing(law);
        if all(&smooth) {
            IntegratorKind::Smooth
        } else if width.is_none() && all(&|law| law.sliders().is_some()) {
            IntegratorKind::Exact
        } else if width.is_none() && set_valued::supports(system) {
            IntegratorKind::Switched
        } else {
            IntegratorKind::Incremental
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dimension::Dimension;
    use crate::law::{
        Coulomb, FrictionContact, Gap, Jenkins, Jenkins2d, Law, LawInfo, Parameter, RateLaw, RateView, RelativeMotion,
        StepLaw,
    };
    use crate::method::harmonic_balance::{self, HarmonicBalance};
    use crate::method::shooting::Shooting;
    use crate::method::{Method, OrbitError, event_driven, solver_with_alternatives, transient::Transient};
    use crate::model::{Axis, Force, GROUND, Joint, Mass, Model, Spring};
    use crate::orbit::{Orbit, Symmetry};
    use crate::structure::Structure;
    use nalgebra::DMatrix;
    use nalgebra::{DVector, dmatrix};
    use num_complex::Complex64;
    use std::f64::consts::TAU;
    use std::sync::Arc;
    use stickslip_numerics::dual::Real;

    /// Laws for these tests alone.
    #[derive(Debug, Clone, Copy)]
    enum TestLaw {
        /// `f = 3 u + 0.2 u'` in a plane.
        Plane,
        /// Two parallel branches, each a spring in series with a damper: `f = Σ k z`,
        /// `z' = u' - z/τ`.
        Relaxing,
        /// A plane law with two states, fully coupled.
        Coupled,
        /// A spring of stiffness 5 in series with a slider of limit 0.4 in a plane, by radial
        /// return.
        Sliding,
    }

    static INFO: LawInfo = LawInfo {
        name: "sample",
        summary: "a law that only tests need",
        parameters: &[Parameter::positive("stiffness", Dimension::STIFFNESS, "not read")],
        sample: &[1.0],
        build: |_| Arc::new(TestLaw::Plane),
    };
    /// Pairs (k, τ) of the relaxing law.
    const RELAXING: [(f64, f64); 2] = [(0.7, 0.5), (1.3, 2.0)];
    const SLIDING: (f64, f64) = (5.0, 0.4);

    impl Law for TestLaw {
        fn info(&self) -> &'static LawInfo {
            &INFO
        }
        fn values(&self) -> Vec<f64> {
            vec![1.0]
        }
        fn is_odd(&self) -> bool {
            !matches!(self, TestLaw::Coupled)
        }
        fn directions(&self) -> usize {
            if matches!(self, TestLaw::Relaxing) { 1 } else { 2 }
        }
        fn force_scale(&self) -> f64 {
            if matches!(self, TestLaw::Sliding) { SLIDING.1 } else { f64::INFINITY }
        }
        fn rate(&self) -> Option<&dyn RateView> {
            if matches!(self, TestLaw::Sliding) { None } else { Some(self) }
        }
        fn step(&self) -> Option<&dyn crate::law::StepView> {
            if matches!(self, TestLaw::Sliding) { Some(self) } else { None }
        }
    }

    impl RateLaw for TestLaw {
        fn states(&self) -> usize {
            if matches!(self, TestLaw::Plane) { 0 } else { 2 }
        }
        fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, z: &[S], rate: &mut [S]) -> [S; 3] {
            let ([u, w, _], [v, q, _], zero) = (motion.displacement, motion.velocity, S::from(0.0));
            match self {
                TestLaw::Plane | TestLaw::Sliding => [u * 3.0 + v * 0.2, w * 3.0 + q * 0.2, zero],
                TestLaw::Relaxing => {
                    let mut force = zero;
                    for (s, (k, tau)) in RELAXING.into_iter().enumerate() {
                        rate[s] = v - z[s] / tau;
                        force += z[s] * k;
                    }
                    [force, zero, zero]
                }
                TestLaw::Coupled => {
                    rate[0] = v - z[0] * (z[1] * z[1] + 1.0) * 2.0;
                    rate[1] = q * 0.5 + u * z[0] - z[1].sinh();
                    [z[0] * 2.0 + u * w * 0.3 + v * 0.1, z[1] + w * 2.0 + q * z[0] * 0.2, zero]
                }
            }
        }
    }

    impl StepLaw for TestLaw {
        fn states(&self) -> usize {
            2 // the force
        }
        fn state_scale(&self) -> f64 {
            SLIDING.1
        }
        fn advance<S: Real>(&self, from: &[S; 3], to: &[S; 3], z: &mut [S]) -> [S; 3] {
            let (stiffness, limit) = SLIDING;
            let tried = [z[0] + (to[0] - from[0]) * stiffness, z[1] + (to[1] - from[1]) * stiffness];
            let square = tried[0] * tried[0] + tried[1] * tried[1];
            let share = if square.re() > limit * limit { square.sqrt().recip() * limit } else { S::from(1.0) };
            (z[0], z[1]) = (tried[0] * share, tried[1] * share);
            [z[0], z[1], S::from(0.0)]
        }
    }

    /// Returns a structure of two places with coupled masses, on springs and dampers.
    fn structure() -> Structure {
        let names = vec!["x".to_owned(), "z".to_owned()];
        let (mass, damping) = (dmatrix![1.0, 0.3; 0.3, 1.5], dmatrix![0.05, -0.02; -0.02, 0.08]);
        Structure::new(names, mass, damping, dmatrix![2.0, -0.5; -0.5, 3.0]).unwrap()
    }

    fn plane() -> Vec<Axis> {
        vec![Axis::new(vec![(0, 1.0)]), Axis::new(vec![(0, -0.5), (1, 1.0)])]
    }

    fn system(joints: &[(SharedLaw, Vec<Axis>)]) -> System {
        let mut builder = System::builder(structure());
        for (i, (law, axes)) in joints.iter().enumerate() {
            builder = builder.joint(format!("j{i}"), law.clone(), axes.clone());
        }
        builder.force(0, 1, Complex64::new(1.0, 0.0)).force(1, 1, Complex64::new(0.2, -0.8)).build().unwrap()
    }

    fn near(a: f64, b: f64, tolerance: f64) {
        assert!((a - b).abs() <= tolerance * (a.abs() + b.abs()), "{a} and {b}");
    }

    /// Checks the derivative of a run against central differences of its end by its start.
    fn check_derivative(flow: &mut dyn Flow, system: &System, start: &[f64]) {
        let states = flow.states();
        flow.set_excitation(system, 1.3);
        let mut derivative = DMatrix::identity(states, states);
        flow.run(&mut start.to_vec(), 2.0, Some(&mut derivative)).unwrap();
        let step = 1e-5;
        for column in 0..states {
            let mut end = [start.to_vec(), start.to_vec()];
            end[0][column] += step;
            end[1][column] -= step;
            for end in &mut end {
                flow.run(end, 2.0, None).unwrap();
            }
            for row in 0..states {
                let slope = (end[0][row] - end[1][row]) / (2.0 * step);
                let exact = derivative[(row, column)];
                assert!((slope - exact).abs() < 2e-7 * (1.0 + exact.abs()), "{row} {column}: {slope} {exact}");
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_discrete_steps() {
        let joint = (Arc::new(TestLaw::Coupled) as SharedLaw, plane());
        let relaxing = (Arc::new(TestLaw::Relaxing) as SharedLaw, vec![Axis::new(vec![(1, 1.0)])]);
        let smooth = system(&[joint.clone(), relaxing.clone()]);
        let start = [0.3, -0.2, 0.5, 0.1, 0.2, -0.4, 0.1, 0.3];
        let mut flow = RadauFlow::new(super::super::radau::assembly(&smooth, None, "test").unwrap(), 1e-8);
        flow.set_excitation(&smooth, 1.3);
        flow.run(&mut start.to_vec(), 2.0, None).unwrap();
        flow.lengths = super::super::radau::step_size_control::StepSizes::Repeated;
        check_derivative(&mut flow, &smooth, &start);
        // all views together; the sliders slip during the run, at the same times for the
        // changed starts
        let jenkins = (Arc::new(Jenkins { stiffness: 4.0, limit: 0.3 }) as SharedLaw, vec![Axis::new(vec![(0, 1.0)])]);
        let gap = (Arc::new(Gap { gap: 0.1, stiffness: 2.0 }) as SharedLaw, vec![Axis::new(vec![(0, 1.0), (1, -1.0)])]);
        let mixed = system(&[joint, (Arc::new(TestLaw::Sliding), plane()), jenkins, gap, relaxing]);
        let mut flow = AverageAccelerationFlow::new(&mixed, None, "test").unwrap();
        flow.count = 40;
        let start = [0.3, -0.2, 0.5, 0.1, 0.2, -0.4, 0.1, -0.1, 0.05, 0.1, 0.3];
        check_derivative(&mut flow, &mixed, &start);
    }

    /// Returns the amplitudes of the two places with these complex stiffnesses along axes.
    fn linear(omega: f64, stiff: &[(Complex64, &Axis)]) -> DVector<Complex64> {
        let structure = structure();
        let s = Complex64::new(0.0, omega);
        let mut dynamic = DMatrix::from_fn(2, 2, |i, k| {
            s * s * structure.mass()[(i, k)] + s * structure.damping()[(i, k)] + structure.stiffness()[(i, k)]
        });
        for (stiffness, axis) in stiff {
            let w = axis.dense(2);
            dynamic += (&w * w.transpose()).map(|w| stiffness * w);
        }
        dynamic.lu().solve(&DVector::from_vec(vec![Complex64::new(1.0, 0.0), Complex64::new(0.2, -0.8)])).unwrap()
    }

    fn shoot(system: &System, omega: f64) -> Orbit {
        Shooting::default().solver(system).unwrap().orbit(omega).unwrap()
    }

    /// A width affects only laws that it smooths. A stop is integrated exactly at any width.
    #[test]
    fn a_width_that_smooths_nothing_changes_nothing() {
        let of = |law: SharedLaw| IntegratorKind::of(&system(&[(law, vec![Axis::new(vec![(0, 1.0)])])]), Some(1e-3));
        assert_eq!(of(Arc::new(Gap { gap: 0.1, stiffness: 2.0 })), IntegratorKind::Exact);
        assert_eq!(of(Arc::new(Coulomb { limit: 0.1 })), IntegratorKind::Smooth);
    }

    /// Linear laws of one and two directions, with and without states, give the linear
    /// response. The mass matrix is full, and both integrations are tested.
    #[test]
    fn linear_laws_give_the_linear_response() {
        let omega = 1.3;
        let relaxing_axis = Axis::new(vec![(1, 1.0)]);
        let mut joints: Vec<(SharedLaw, Vec<Axis>)> =
            vec![(Arc::new(TestLaw::Plane), plane()), (Arc::new(TestLaw::Relaxing), vec![relaxing_axis.clone()])];
        let s = Complex64::new(0.0, omega);
        let relaxing: Complex64 = RELAXING.iter().map(|(k, tau)| s * *tau * *k / (s * *tau + 1.0)).sum();
        let axes = plane();
        let stiff = Complex64::new(3.0, 0.2 * omega);
        let mut parts = vec![(stiff, &axes[0]), (stiff, &axes[1]), (relaxing, &relaxing_axis)];
        let check = |orbit: &Orbit, expected: &DVector<Complex64>, tolerance: f64| {
            for (place, x) in orbit.places.iter().zip(expected.iter()) {
                assert!((place.first_harmonic - x).norm() < tolerance * x.norm(), "{} {x}", place.first_harmonic);
                near(place.amplitude(), x.norm(), tolerance);
            }
            assert!(orbit.evidence.energy_gap < 10.0 * tolerance, "{:?}", orbit.evidence);
            assert!(orbit.evidence.stuck.is_empty());
        };
        let orbit = shoot(&system(&joints), omega);
        check(&orbit, &linear(omega, &parts), 1e-7);
        // loss in the joints: `π ω c |u|²` along each axis; the relaxing joints lose by their
        // loss stiffness
        let x = linear(omega, &parts);
        let loss: f64 = parts.iter().map(|(k, axis)| TAU / 2.0 * k.im * axis.complex_component(&x).norm_sqr()).sum();
        near(orbit.energy.friction, loss, 1e-7);
        near(orbit.joints[0].displacement[1].1, axes[1].complex_component(&x).norm(), 1e-7);
        // a slider behind a spring that never slips requires equal steps
        let held = Axis::new(vec![(0, 1.0)]);
        joints.push((Arc::new(Jenkins { stiffness: 4.0, limit: 100.0 }), vec![held.clone()]));
        parts.push((Complex64::new(4.0, 0.0), &held));
        let mixed = system(&joints);
        assert_eq!(IntegratorKind::of(&mixed, None), IntegratorKind::Incremental);
        let orbit = shoot(&mixed, omega);
        let x = linear(omega, &parts);
        let estimate = orbit.evidence.error_estimate.unwrap();
        assert!(estimate <= 1e-5, "{estimate}");
        for (place, x) in orbit.places.iter().zip(x.iter()) {
            assert!(
                (place.first_harmonic - x).norm() < 3.0 * estimate * x.norm(),
                "{} {x} {estimate}",
                place.first_harmonic
            );
        }
    }

    /// A slider in a plane follows a circle. Its spring is stretched by r = limit/stiffness at
    /// right angles to its path of radius √(a² - r²). It loses 2π limit √(a² - r²) per cycle.
    #[test]
    fn slider_on_a_circle_has_the_closed_form_loss() {
        let a = 0.3;
        let circle = [Complex64::new(a, 0.0), Complex64::new(0.0, -a)]
            .map(|g| Axis::new(Vec::new()).with_imposed_motion([(1, g)]));
        let nothing = DMatrix::zeros(0, 0);
        let empty = Structure::new(Vec::new(), nothing.clone(), nothing.clone(), nothing).unwrap();
        let system = System::builder(empty).joint("led", Arc::new(TestLaw::Sliding), circle.to_vec()).build().unwrap();
        let orbit = Transient::default().solver(&system).unwrap().orbit(2.0).unwrap();
        let (stiffness, limit) = SLIDING;
        let r = limit / stiffness;
        near(orbit.joints[0].dissipation, TAU * limit * (a * a - r * r).sqrt(), 1e-5);
        assert!((orbit.joints[0].slip_fraction - 1.0).abs() < 1e-12);
        for (low, high) in &orbit.joints[0].displacement {
            near(*high, a, 1e-5);
            near(*low, -a, 1e-5);
        }
    }

    /// A contact moves around a circle. It sticks if the circle is 1 % smaller than the
    /// slider's reach, and slips all the time if the circle is 1 % larger. After the first
    /// cycle the slider's offset leaves a smaller, off-centre circle that touches the limit at
    /// one instant.
    #[test]
    fn what_stays_below_its_limit_sticks() {
        let (stiffness, limit, preload) = (4.0, 0.3, 1.0);
        let contact =
            FrictionContact { tangential: stiffness, normal: 1.0, friction: limit / preload, preload, tangents: 2 };
        let laws: [SharedLaw; 2] = [Arc::new(Jenkins2d { stiffness, limit }), Arc::new(contact)];
        let methods: [&dyn Method; 3] = [&Transient::default(), &Shooting::default(), &HarmonicBalance::default()];
        for (law, (part, slips)) in laws.iter().flat_map(|law| [(0.99, 0.0), (1.01, 1.0)].map(|case| (law, case))) {
            let a = part * limit / stiffness;
            let still = Axis::new(Vec::new());
            let circle =
                [Complex64::new(a, 0.0), Complex64::new(0.0, -a)].map(|g| still.clone().with_imposed_motion([(1, g)]));
            let axes = circle.into_iter().chain([still]).take(law.directions()).collect();
            let nothing = DMatrix::zeros(0, 0);
            let empty = Structure::new(Vec::new(), nothing.clone(), nothing.clone(), nothing).unwrap();
            let system = System::builder(empty).joint("led", law.clone(), axes).build().unwrap();
            for method in methods {
                let orbit = method.solver(&system).unwrap().orbit(2.0).unwrap();
                let told = orbit.joints[0].slip_fraction;
                assert!((told - slips).abs() < 1e-2, "{law:?} at {part} of its limit by {}: {told}", orbit.method);
            }
        }
    }

    /// Jenkins elements in equal steps converge to the exact orbit within the estimated error.
    #[test]
    fn equal_steps_come_to_the_exact_orbit() {
        let along = |row: usize| vec![Axis::new(vec![(row, 1.0)])];
        let jenkins: SharedLaw = Arc::new(Jenkins { stiffness: 4.0, limit: 0.3 });
        let exact_system = system(&[(jenkins.clone(), along(0))]);
        let exact = event_driven::EventDriven.solver(&exact_system).unwrap().orbit(1.3).unwrap();
        // a law that carries no force and does not consist of sliders
        let idle: SharedLaw = Arc::new(Gap { gap: 1e3, stiffness: 1.0 });
        let orbit = shoot(&system(&[(jenkins, along(0)), (idle, along(1))]), 1.3);
        let estimate = orbit.evidence.error_estimate.unwrap();
        assert!(estimate > 0.0 && estimate <= 1e-5);
        for (a, b) in orbit.places.iter().zip(&exact.places) {
            near(a.amplitude(), b.amplitude(), 3.0 * estimate);
        }
        near(orbit.joints[0].dissipation, exact.joints[0].dissipation, 10.0 * estimate);
        assert!((orbit.joints[0].slip_fraction - exact.joints[0].slip_fraction).abs() < 1e-2);
        let largest = |orbit: &Orbit| orbit.multipliers().unwrap()[0].norm();
        // the exact motion returns after half a period, the other one after a whole period
        near(largest(&orbit), largest(&exact), 1e-3);
    }

    /// A stuck contact leaves its offset free, so motions in different steps may begin with
    /// equal states. The estimate still covers the error of their amplitudes.
    #[test]
    fn an_open_offset_hides_no_error() {
        let law = FrictionContact { tangential: 5e3, normal: 2e4, friction: 0.3, preload: 1e5, tangents: 1 };
        let mut body = Mass::new("b", 1.0);
        body.directions = vec!["x".into(), "z".into()];
        let held = |direction: &str| Spring {
            between: [format!("b.{direction}"), GROUND.into()],
            stiffness: 1e4,
            damping: 2.0,
        };
        let force = |on: &str, amplitude, harmonic| Force { on: on.into(), amplitude, phase: 0.0, harmonic };
        let model = Model {
            masses: vec![body],
            springs: vec![held("x"), held("z")],
            joints: vec![Joint { name: "j".into(), between: ["b".into(), GROUND.into()], law: Arc::new(law) }],
            // the constant force balances the preload
            forces: vec![force("b.x", 1.0, 1), force("b.z", 1e5, 0)],
            ..Model::default()
        };
        let system = model.assemble().unwrap();
        for frequency in [14.0, 25.0, 40.0] {
            let omega = TAU * frequency;
            let orbit = shoot(&system, omega);
            let expected = 1.0 / (1.5e4 - omega * omega).hypot(2.0 * omega);
            let error = (orbit.places[0].amplitude() / expected - 1.0).abs();
            let estimate = orbit.evidence.error_estimate.unwrap();
            assert!(error <= estimate && estimate <= 1e-5, "{frequency}: {error:e} {estimate:e}");
        }
    }

    /// A transient in equal steps agrees with the exact one, at the ends of the periods and
    /// between them. The allowed error grows by one period's error per period.
    #[test]
    fn transients_in_equal_steps_go_as_the_exact_one() {
        let along = |row: usize| vec![Axis::new(vec![(row, 1.0)])];
        let jenkins = |stiffness, limit| -> SharedLaw { Arc::new(Jenkins { stiffness, limit }) };
        let stop: SharedLaw = Arc::new(Gap { gap: 0.4, stiffness: 2.0 });
        let system = system(&[(jenkins(4.0, 0.3), along(0)), (jenkins(1.5, 0.6), along(1)), (stop, along(1))]);
        let shared = Arc::new(system.clone());
        let omega = 1.3;
        let period = TAU / omega;
        let mut exact = integrator(&system, None, 1e-9, "test").unwrap();
        let mut steps = AverageAccelerationFlow::new(&system, None, "test").unwrap();
        let mut states = [vec![0.0; exact.states()], vec![0.0; steps.states()]];
        exact.set_excitation(&system, omega);
        steps.set_excitation(&system, omega);
        steps.set_recording(true);
        for cycle in 1..=12 {
            exact.run_accurately(&mut states[0], period).unwrap();
            steps.run_accurately(&mut states[1], period).unwrap();
            assert!(steps.count <= 4096, "{} steps", steps.count);
            let size = states[0].iter().fold(0.0, |a: f64, z| a.max(z.abs()));
            for (a, b) in states[0].iter().zip(&states[1]) {
                assert!((a - b).abs() < 1e-6 * f64::from(cycle) * size, "{cycle}: {states:?}");
            }
            let paths =
                [exact.path(&shared, Symmetry::FullPeriod, period), steps.path(&shared, Symmetry::FullPeriod, period)];
            for i in 0..50 {
                let [a, b] = [0, 1].map(|k| paths[k].sample(period * (f64::from(i) + 0.3) / 50.0));
                assert!((a.displacement[0] - b.displacement[0]).abs() < 2e-6 * f64::from(cycle) * size);
                assert!((a.velocity[1] - b.velocity[1]).abs() < 2e-5 * f64::from(cycle) * size);
            }
        }
    }

    #[test]
    fn what_no_flow_takes_is_refused_by_name() {
        let along = |row: usize| vec![Axis::new(vec![(row, 1.0)])];
        let rigid: SharedLaw = Arc::new(Coulomb { limit: 0.3 });
        let system = system(&[(rigid.clone(), along(0)), (Arc::new(TestLaw::Sliding), plane())]);
        // next to a smooth law, the switches of the rigid slider are located
        let smooth = self::system(&[(rigid, along(0)), (Arc::new(TestLaw::Relaxing), along(1))]);
        assert_eq!(
            (IntegratorKind::of(&smooth, None), IntegratorKind::of(&system, None)),
            (IntegratorKind::Switched, IntegratorKind::Incremental)
        );
        // a joint that carries no force does not matter
        let idle: SharedLaw = Arc::new(Coulomb { limit: 0.0 });
        let beside = self::system(&[(idle, along(0)), (Arc::new(TestLaw::Relaxing), along(1))]);
        assert_eq!(IntegratorKind::of(&beside, None), IntegratorKind::Smooth);
        let alone = shoot(&self::system(&[(Arc::new(TestLaw::Relaxing), along(1))]), 1.3);
        let orbit = shoot(&beside, 1.3);
        near(orbit.places[0].amplitude(), alone.places[0].amplitude(), 1e-12);
        assert_eq!((orbit.joints[0].dissipation, orbit.joints[0].slip_fraction), (0.0, 1.0));
        let refused = solver_with_alternatives(&Shooting::default(), &system).map(|_| ()).unwrap_err().to_string();
        assert!(refused.contains("`coulomb` of joint `j0`") && refused.contains("width"), "{refused}");
        let smoothed = Shooting { width: Some(1e-3), ..Shooting::default() };
        assert!(smoothed.solver(&system).is_ok());
    }

    /// Returns `x'' + 0.1 x' + x + k max(x, 0) = cos Ωt` with one place.
    fn stopped(k: f64) -> System {
        damped(0.1, k)
    }

    /// Returns this system with another damping.
    fn damped(c: f64, k: f64) -> System {
        let one = |value: f64| DMatrix::from_element(1, 1, value);
        let structure = Structure::new(vec!["m".into()], one(1.0), one(c), one(1.0)).unwrap();
        let stop: SharedLaw = Arc::new(Gap { gap: 0.0, stiffness: k });
        let axes = vec![Axis::new(vec![(0, 1.0)])];
        System::builder(structure).joint("stop", stop, axes).force(0, 1, Complex64::new(1.0, 0.0)).build().unwrap()
    }

    /// Integrates the equation by the classical Runge-Kutta method. Returns the largest
    /// displacement and the states after the last periods.
    fn followed(k: f64, omega: f64) -> (f64, Vec<f64>) {
        let steps = 2000;
        let h = TAU / omega / f64::from(steps);
        let rate = |t: f64, [x, v]: [f64; 2]| [v, (omega * t).cos() - 0.1 * v - x - k * x.max(0.0)];
        let (mut state, mut largest, mut ends) = ([0.0f64; 2], 0.0f64, Vec::new());
        for period in 0..400 {
            for i in 0..steps {
                let t = f64::from(i) * h;
                let on = |k: [f64; 2], h: f64| [state[0] + h * k[0], state[1] + h * k[1]];
                let a = rate(t, state);
                let b = rate(t + 0.5 * h, on(a, 0.5 * h));
                let c = rate(t + 0.5 * h, on(b, 0.5 * h));
                let d = rate(t + h, on(c, h));
                state = std::array::from_fn(|k| state[k] + h / 6.0 * (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]));
                largest = if period < 394 { 0.0 } else { largest.max(state[0]) };
            }
            ends.push(state[0]);
        }
        (largest, ends.split_off(394))
    }

    /// Orbits of two and three excitation periods are found and are stable. The orbit that
    /// repeats after one period reports that it is unstable.
    #[test]
    fn motions_of_several_periods_are_found() {
        for (k, omega, periods) in [(4.0, 2.6, 2), (10.0, 2.2, 3)] {
            let (largest, ends) = followed(k, omega);
            assert!((ends[0] - ends[periods]).abs() < 1e-9 && (ends[0] - ends[1]).abs() > 0.1, "{ends:?}");
            let system = stopped(k);
            let shooting = Shooting { period: periods, ..Shooting::default() };
            let waiting = Transient { period: periods, ..Transient::default() };
            for method in [&shooting as &dyn Method, &waiting] {
                let orbit = method.solver(&system).unwrap().orbit(omega).unwrap();
                assert_eq!(orbit.periods, periods);
                near(orbit.period(), periods as f64 * TAU / omega, 1e-14);
                // the Runge-Kutta grid misses the turning point by up to (h v')²
                near(orbit.places[0].maximum, largest, 1e-5);
                assert_eq!(orbit.is_stable(), Some(true));
                let TwoInstants { start, later } = TwoInstants::of(&orbit, omega);
                assert!((start - later).abs() > 0.1, "it repeats after one period");
                near(orbit.sample(orbit.period() - 1e-9).displacement[0], start, 1e-6);
            }
            if periods == 2 {
                let orbit = Shooting::default().solver(&system).unwrap().orbit(omega).unwrap();
                assert_eq!((orbit.periods, orbit.is_stable()), (1, Some(false)));
            }
        }
    }

    /// A sweep reaches the orbits of two periods along the orbit of one period, which is
    /// unstable there, and leaves it.
    #[test]
    fn a_neighbour_does_not_keep_a_search_on_an_unstable_orbit() {
        let system = stopped(4.0);
        let shooting = Shooting { period: 2, ..Shooting::default() };
        let exact = event_driven::SubharmonicEventDriven { period: 2 };
        let series = harmonic_balance::Subharmonic { balance: HarmonicBalance::default(), period: 2 };
        let mut amplitudes = Vec::new();
        for method in [&shooting as &dyn Method, &exact, &series] {
            let mut solver = method.solver(&system).unwrap();
            let first = solver.orbit(3.9).unwrap();
            assert_eq!((first.minimal_periods(), first.is_stable()), (1, Some(true)), "{}", method.name());
            let orbit = solver.orbit_near(3.5, Some(&first.seed())).unwrap();
            assert_eq!((orbit.minimal_periods(), orbit.is_stable()), (2, Some(true)), "{}", method.name());
            amplitudes.push(orbit.places[0].amplitude());
        }
        near(amplitudes[1], amplitudes[0], 1e-6);
        near(amplitudes[2], amplitudes[0], 1e-3);
    }

    /// A search by waiting ends with the reason if nothing attracts the motion: an orbit of
    /// several periods, or almost no damping.
    #[test]
    fn waiting_ends_where_nothing_settles() {
        let wait = |system: &System, omega: f64| {
            let error = Transient::default().solver(system).unwrap().orbit(omega).unwrap_err();
            assert_eq!(error.status(), "not-settled", "{error}");
            let OrbitError::Unsettled { returns, repeats, .. } = error else { panic!("{error}") };
            (returns, repeats)
        };
        assert_eq!(wait(&stopped(4.0), 2.6), (1024, Some(2)));
        assert_eq!(wait(&stopped(10.0), 2.2), (1024, Some(3)));
        assert_eq!(wait(&damped(1e-7, 0.5), 1.7), (4096, None));
    }

    /// Displacements at the start and one excitation period later.
    struct TwoInstants {
        start: f64,
        later: f64,
    }

    impl TwoInstants {
        fn of(orbit: &Orbit, omega: f64) -> TwoInstants {
            TwoInstants { start: orbit.sample(0.0).displacement[0], later: orbit.sample(TAU / omega).displacement[0] }
        }
    }
}
