//! Tests of every kind of port: derivatives against differences, orbits against
//! closed forms and other methods.

use super::super::equations::Discretization;
use super::*;
use crate::law::{
    BoucWen, Cubic, Dahl, Gap, Jenkins, Law, LawInfo, RateLaw, RateView, RelativeMotion, StepLaw, StepView, Stribeck,
};
use crate::method::harmonic_balance::HarmonicBalance;
use crate::method::harmonic_balance::dynamics::banded::BandedForm;
use crate::method::harmonic_balance::dynamics::linear_dynamics::LinearDynamics;
use crate::method::harmonic_balance::equations::contact_parameter::ContactParameters;
use crate::method::shooting::Shooting;
use crate::method::{Method, solver_with_alternatives};
use crate::model::{Force, GROUND, Joint, Mass, Model, Spring};
use crate::orbit::Orbit;
use crate::structure::Structure;
use nalgebra::{DMatrix, DVector, dmatrix, dvector};
use std::f64::consts::{FRAC_PI_6, PI};
use std::sync::Arc;
use stickslip_numerics::dual::Real;

static PLANE: LawInfo =
    LawInfo { name: "plane", summary: "", parameters: &[], sample: &[], build: |_| Arc::new(Plane::Masing) };

/// Laws of two directions, each with one view.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Plane {
    /// A spring and a slider in series, coupled: radial return of the elastic force. Its
    /// stiffness is [`STIFFNESS`], its limit [`LIMIT`].
    Masing,
    /// A spring and a damper that both stiffen with the displacement.
    Stiffening,
    /// A stiffening law with a force that follows with a delay.
    Relaxing,
    /// Rigid friction.
    Rigid,
    /// A law without a view.
    Unknown,
}

const STIFFNESS: f64 = 2.0;
const LIMIT: f64 = 0.3;

impl Law for Plane {
    fn info(&self) -> &'static LawInfo {
        &PLANE
    }
    fn values(&self) -> Vec<f64> {
        Vec::new()
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn directions(&self) -> usize {
        2
    }
    fn force_scale(&self) -> f64 {
        LIMIT
    }
    fn step(&self) -> Option<&dyn StepView> {
        (*self == Plane::Masing).then_some(self)
    }
    fn rate(&self) -> Option<&dyn RateView> {
        matches!(self, Plane::Stiffening | Plane::Relaxing).then_some(self)
    }
    fn prox(&self) -> Option<&dyn ProxView> {
        (*self == Plane::Rigid).then_some(self)
    }
}

impl StepLaw for Plane {
    fn states(&self) -> usize {
        2
    }
    fn state_scale(&self) -> f64 {
        LIMIT
    }
    fn advance<S: Real>(&self, from: &[S; 3], to: &[S; 3], z: &mut [S]) -> [S; 3] {
        for a in 0..2 {
            z[a] += (to[a] - from[a]) * STIFFNESS;
        }
        let size = (z[0] * z[0] + z[1] * z[1]).sqrt();
        if size.re() > LIMIT {
            let share = S::from(LIMIT) / size;
            (z[0], z[1]) = (z[0] * share, z[1] * share);
        }
        [z[0], z[1], S::from(0.0)]
    }
}

impl RateLaw for Plane {
    fn states(&self) -> usize {
        if *self == Plane::Relaxing { 2 } else { 0 }
    }
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, z: &[S], rate: &mut [S]) -> [S; 3] {
        let (u, v) = (motion.displacement, motion.velocity);
        let growth = (u[0] * u[0] + u[1] * u[1]) * 0.5 + 1.0;
        let mut force = [S::from(0.0); 3];
        for a in 0..2 {
            let spring = u[a] * growth + v[a] * growth * 0.1;
            force[a] = if *self == Plane::Relaxing { z[a] } else { spring };
            if *self == Plane::Relaxing {
                rate[a] = (spring - z[a]) * 3.0;
            }
        }
        force
    }
}

impl ProxView for Plane {
    fn resolve(&self, y: &[f64], _penalty: f64, force: &mut [f64], slope: &mut [f64]) {
        let size = (y[0] * y[0] + y[1] * y[1]).sqrt();
        for a in 0..2 {
            for b in 0..2 {
                let one = if a == b { 1.0 } else { 0.0 };
                slope[2 * a + b] = if size <= LIMIT { one } else { LIMIT / size * (one - y[a] * y[b] / (size * size)) };
            }
            force[a] = if size <= LIMIT { y[a] } else { LIMIT / size * y[a] };
        }
    }
}

fn laws() -> Vec<SharedLaw> {
    vec![
        Arc::new(Jenkins { stiffness: 2.0, limit: 0.3 }),
        Arc::new(Gap { gap: 0.2, stiffness: 1.5 }),
        Arc::new(Cubic { stiffness: 0.7 }),
        Arc::new(BoucWen { stiffness: 1.0, beta: 0.6, gamma: 0.3, exponent: 1.0 }),
        Arc::new(Dahl { stiffness: 1.5, limit: 0.8 }),
        Arc::new(Plane::Masing),
        Arc::new(Plane::Stiffening),
        Arc::new(Plane::Relaxing),
        Arc::new(Plane::Rigid),
    ]
}

/// Returns the ports of a law between coordinates and the ground, one coordinate per direction.
fn ports_of(law: &SharedLaw) -> Ports {
    let d = law.directions();
    let places = (0..d).map(|i| format!("p{i}")).collect();
    let structure = Structure::new(places, DMatrix::identity(d, d), DMatrix::zeros(d, d), DMatrix::identity(d, d));
    let axes = (0..d).map(|i| Axis::new(vec![(i, 1.0)])).collect();
    Ports::new(&System::builder(structure.unwrap()).joint("j", law.clone(), axes).build().unwrap()).unwrap()
}

/// A law without a suitable view is refused. The error names the joint, the law and an
/// alternative.
#[test]
fn refusals_name_law_and_alternative() {
    let jump = Arc::new(Stribeck { limit: 1.0, static_limit: 1.5, velocity: 0.0 });
    for (law, words) in [
        (jump as SharedLaw, "`event-driven`"),
        (Arc::new(Plane::Unknown), "no form that harmonic balance can evaluate"),
    ] {
        let d = law.directions();
        let places = (0..d).map(|i| format!("p{i}")).collect();
        let one = DMatrix::identity(d, d);
        let structure = Structure::new(places, one.clone(), one.clone(), one).unwrap();
        let axes = (0..d).map(|i| Axis::new(vec![(i, 1.0)])).collect();
        let system = System::builder(structure).joint("rub", law.clone(), axes).build().unwrap();
        let error = solver_with_alternatives(&HarmonicBalance::default(), &system).err().expect("refused").to_string();
        for part in ["harmonic-balance", "rub", law.name(), words] {
            assert!(error.contains(part), "{error}");
        }
    }
}

/// Returns a pseudo-random value between -1 and 1.
fn noise(i: usize) -> f64 {
    ((i * 7919 + 13) as f64).sin()
}

/// The derivative of every port's force or image agrees with differences, for
/// motions that slip and for small motions that stick.
#[test]
fn derivatives_agree_with_differences() {
    let omega = 0.9;
    for law in laws() {
        let ports = ports_of(&law);
        for (harmonics, size) in [(vec![1, 3, 5], 0.6), (vec![0, 1, 2, 3], 0.6), (vec![0, 1, 2], 0.01)] {
            let nh = harmonics.len();
            let mut aft = FrequencyTime::new(harmonics.clone(), 512);
            let port = &ports[0];
            let count = nh * port.axes;
            let is_real = |i: usize| harmonics[i % nh] == 0;
            let c: Vec<Complex64> = (0..count)
                .map(|i| Complex64::new(noise(2 * i), if is_real(i) { 0.0 } else { noise(2 * i + 1) }) * size)
                .collect();
            let mut force_at = |c: &[Complex64], tangent: Option<&mut [f64]>| {
                let mut force = vec![ZERO; count];
                if port.is_force() {
                    // without motion the argument of the image is the force alone
                    let contact = ContactParameters::supported(1.0);
                    aft.force_port_image(port, (omega, contact, 1.0), (&vec![ZERO; count], c), &mut force, tangent);
                } else {
                    aft.motion_port_force(port, (omega, 1.0), c, &mut force, tangent);
                }
                force
            };
            let mut tangent = vec![0.0; 4 * count * count];
            force_at(&c, Some(&mut tangent));
            let largest = tangent.iter().fold(0.0, |m: f64, t| m.max(t.abs()));
            // a difference misses the kinks of sampled maps within its step:
            // occasionally one slope in 512 samples
            let (step, kinks) = (1e-6 * size, if law.ideal_elements().is_some() { 1e-7 } else { 2e-3 });
            for k in (0..2 * count).filter(|k| !(is_real(k / 2) && k % 2 == 1)) {
                let moved = |by: f64| {
                    let mut c = c.clone();
                    if k % 2 == 0 {
                        c[k / 2].re += by
                    } else {
                        c[k / 2].im += by
                    }
                    c
                };
                let (up, down) = (force_at(&moved(step), None), force_at(&moved(-step), None));
                for i in 0..count {
                    let difference = (up[i] - down[i]) / (2.0 * step);
                    let given = |part: usize| tangent[(2 * i + part) * 2 * count + k];
                    let off = (difference - Complex64::new(given(0), given(1))).norm();
                    assert!(
                        off <= kinks * largest,
                        "{law:?} {harmonics:?} {i} {k}: {difference} {} {}",
                        given(0),
                        given(1)
                    );
                }
            }
        }
    }
}

/// One mass on a spring with a damper and a joint to the ground. A force acts
/// at harmonic 1, and at harmonic 0 with `constant`.
fn oscillator(law: SharedLaw, force: f64, constant: f64) -> System {
    let mut model = Model::default();
    model.masses.push(Mass::new("m", 1.0));
    model.springs.push(Spring { between: ["m".into(), GROUND.into()], stiffness: 1.0, damping: 0.1 });
    model.joints.push(Joint { name: "j".into(), between: ["m".into(), GROUND.into()], law });
    model.forces.push(Force { on: "m".into(), amplitude: force, phase: 0.0, harmonic: 1 });
    if constant != 0.0 {
        model.forces.push(Force { on: "m".into(), amplitude: constant, phase: 0.0, harmonic: 0 });
    }
    model.assemble().unwrap()
}

fn balanced(system: &System, harmonics: usize, omega: f64) -> Orbit {
    let method = HarmonicBalance { harmonics: Some(harmonics), ..HarmonicBalance::default() };
    method.solver(system).unwrap().orbit(omega).unwrap()
}

/// With one harmonic, Duffing's oscillator has the closed form
/// `(1 - ω² + ¾ b a²)² a² + (c ω a)² = F²`.
#[test]
fn one_harmonic_of_duffings_oscillator_is_the_closed_form() {
    let (b, force) = (0.5, 0.1);
    let system = oscillator(Arc::new(Cubic { stiffness: b }), force, 0.0);
    for omega in [0.6, 0.9, 1.3] {
        let a = balanced(&system, 1, omega).places[0].first_harmonic.norm();
        let left = ((1.0 - omega * omega + 0.75 * b * a * a) * a).hypot(0.1 * omega * a);
        assert!((left - force).abs() < 1e-9 * force, "{omega}: {left}");
    }
}

/// Stiffening springs, stops and hysteresis with states: the orbit agrees with time
/// integration, with and without a constant force.
#[test]
fn orbits_agree_with_integration() {
    let laws: [(SharedLaw, f64); 5] = [
        (Arc::new(Cubic { stiffness: 0.5 }), 1e-6),
        (Arc::new(Gap { gap: 0.3, stiffness: 1.5 }), 1e-4),
        (Arc::new(Gap { gap: -0.2, stiffness: 1.5 }), 1e-4),
        (Arc::new(BoucWen { stiffness: 1.0, beta: 0.6, gamma: 0.3, exponent: 1.0 }), 1e-3),
        (Arc::new(Dahl { stiffness: 1.5, limit: 0.3 }), 1e-3),
    ];
    for (law, truncation) in laws {
        for constant in [0.0, 0.15] {
            let system = oscillator(law.clone(), 0.4, constant);
            let omega = 0.7;
            let series = balanced(&system, 41, omega);
            let flow = Shooting::default().solver(&system).unwrap().orbit(omega).unwrap();
            let period = 2.0 * PI / omega;
            let size = flow.places[0].amplitude();
            for i in 0..16 {
                let t = period * f64::from(i) / 16.0;
                let (a, b) = (series.sample(t), flow.sample(t));
                let off = (a.displacement[0] - b.displacement[0]).abs();
                assert!(off < truncation * size, "{law:?} {constant}: {off} of {size} at {i}/16");
            }
            assert!(
                (series.energy.friction - flow.energy.friction).abs() < 3.0 * truncation * flow.energy.work_in.abs()
            );
        }
    }
}

/// A body held by a stop alone rests where the force of the stop balances the
/// constant force: `k (u - gap) = F`.
#[test]
fn a_body_that_only_a_law_holds_has_its_mean_where_the_law_bears_it() {
    let mut model = Model::default();
    model.masses.push(Mass::new("m", 1.0));
    model.springs.push(Spring { between: ["m".into(), GROUND.into()], stiffness: 0.0, damping: 0.1 });
    let law = Arc::new(Gap { gap: 0.1, stiffness: 2.0 });
    model.joints.push(Joint { name: "j".into(), between: ["m".into(), GROUND.into()], law });
    model.forces.push(Force { on: "m".into(), amplitude: 0.05, phase: 0.0, harmonic: 1 });
    model.forces.push(Force { on: "m".into(), amplitude: 0.5, phase: 0.0, harmonic: 0 });
    let orbit = balanced(&model.assemble().unwrap(), 5, 0.7);
    let place = &orbit.places[0];
    // in contact all the time: linear about the mean
    let amplitude = 0.05 / (2.0f64 - 0.49).hypot(0.07);
    assert!((place.mean - 0.35).abs() < 1e-6 && (place.amplitude() - amplitude).abs() < 1e-6, "{place:?}");
}

/// A coupled law of a plane, moved along a line, agrees with the law of that line.
#[test]
fn along_a_line_a_coupled_law_is_that_of_one_direction() {
    let pairs: [(SharedLaw, SharedLaw); 2] = [
        (Arc::new(Plane::Masing), Arc::new(Jenkins { stiffness: STIFFNESS, limit: LIMIT })),
        (Arc::new(Plane::Rigid), Arc::new(crate::law::Coulomb { limit: LIMIT })),
    ];
    let (cos, sin) = (FRAC_PI_6.cos(), FRAC_PI_6.sin());
    for (plane, line) in pairs {
        let places = vec!["x".to_owned(), "y".to_owned()];
        let (one, damping) = (DMatrix::identity(2, 2), DMatrix::identity(2, 2) * 0.1);
        let structure = Structure::new(places, one.clone(), damping, one).unwrap();
        let system = System::builder(structure)
            .joint("j", plane, vec![Axis::new(vec![(0, 1.0)]), Axis::new(vec![(1, 1.0)])])
            .force(0, 1, Complex64::new(0.5 * cos, 0.0))
            .force(1, 1, Complex64::new(0.5 * sin, 0.0))
            .build()
            .unwrap();
        let (orbit, reference) = (balanced(&system, 21, 0.9), balanced(&oscillator(line, 0.5, 0.0), 21, 0.9));
        let size = reference.places[0].amplitude();
        for (place, share) in orbit.places.iter().zip([cos, sin]) {
            // steps between samples neglect the curvature of the motion; a
            // sampled kink causes the rest of the error
            assert!((place.amplitude() - share * size).abs() < 2e-4 * size, "{place:?} {size}");
        }
        let lost = reference.energy.friction;
        assert!((orbit.energy.friction - lost).abs() < 1e-3 * lost, "{} {lost}", orbit.energy.friction);
    }
}

/// On a circle of radius r a coupled slider dissipates `2π r F cos φ` per period. The spring's
/// elongation `F/k` leads the slider's radius by the angle φ with `sin φ = F/(k r)`.
#[test]
fn round_a_circle_the_loss_is_the_closed_form() {
    let ports = ports_of(&(Arc::new(Plane::Masing) as SharedLaw));
    let radius = 0.5;
    let work = |samples: usize| {
        let mut aft = FrequencyTime::new(vec![1], samples);
        let c = [Complex64::new(radius, 0.0), Complex64::new(0.0, -radius)];
        let mut force = [ZERO; 2];
        aft.motion_port_force(&ports[0], (1.0, 1.0), &c, &mut force, None);
        (0..2).map(|a| -PI * (force[a].conj() * c[a]).im).sum::<f64>()
    };
    let lead = (LIMIT / (STIFFNESS * radius)).asin();
    let expected = 2.0 * PI * radius * LIMIT * lead.cos();
    // the radial return has a first-order error where the direction turns; two
    // numbers of samples extrapolate to the limit
    let (coarse, fine) = (work(1024), work(2048));
    assert!((fine - expected).abs() < 1e-3 * expected, "{fine} {expected}");
    assert!((2.0 * fine - coarse - expected).abs() < 1e-5 * expected, "{coarse} {fine} {expected}");
}

/// A contact that slips little per period forgets its initial force across the motion slowly. Its
/// periodic force is that of an integration until nothing changes.
#[test]
fn a_slowly_forgotten_force_is_that_of_many_periods() {
    let ports = ports_of(&(Arc::new(Plane::Masing) as SharedLaw));
    let samples = 64;
    // slip begins where the amplitude exceeds the spring's longest stretch
    for (excess, across) in [(1e-3, 0.05), (3e-3, 0.1), (1e-2, 0.12), (0.1, 0.14)] {
        let amplitude = (1.0 + excess) * LIMIT / STIFFNESS;
        let (mean, small) = (Complex64::new(across, 0.0), Complex64::new(0.0, -0.01 * amplitude));
        let c = [ZERO, Complex64::new(amplitude, 0.0), mean, small];
        let mut aft = FrequencyTime::new(vec![0, 1], samples);
        let mut force = [ZERO; 4];
        aft.motion_port_force(&ports[0], (1.0, 1.0), &c, &mut force, Some(&mut [0.0; 64]));
        // radial return, from static equilibrium straight to the first sample
        let at = |i: usize| {
            let phase = std::f64::consts::TAU * i as f64 / samples as f64;
            [amplitude * phase.cos(), across + 0.01 * amplitude * phase.sin()]
        };
        let (mut before, mut elastic) = ([0.0; 2], [0.0; 2]);
        let mut advance = |to: [f64; 2]| {
            let trial = [0, 1].map(|a| elastic[a] + STIFFNESS * (to[a] - before[a]));
            let shorten = (LIMIT / trial[0].hypot(trial[1])).min(1.0);
            (before, elastic) = (to, trial.map(|f| f * shorten));
            elastic
        };
        for i in 0..50_000 * samples {
            advance(at(i % samples));
        }
        let mut expected = [ZERO; 4];
        for i in 0..samples {
            let now = advance(at(i));
            let phase = -std::f64::consts::TAU * i as f64 / samples as f64;
            for a in 0..2 {
                expected[2 * a] += now[a] / samples as f64;
                expected[2 * a + 1] += Complex64::from_polar(2.0 * now[a] / samples as f64, phase);
            }
        }
        for (found, expected) in force.iter().zip(&expected) {
            assert!((found - expected).norm() < 1e-9 * LIMIT, "excess {excess}: {force:?} {expected}");
        }
    }
}

/// Two masses with inertial coupling: the response is `(K + jΩC - Ω²M)⁻¹ F`
/// with the full mass matrix.
#[test]
fn a_full_mass_matrix_is_that_of_the_equations() {
    let (mass, stiffness) = (dmatrix![1.0, 0.4; 0.4, 1.0], dmatrix![2.0, -1.0; -1.0, 2.0]);
    let damping = DMatrix::identity(2, 2) * 0.1;
    let omega = 0.9;
    let structure = Structure::new(vec!["a".into(), "b".into()], mass.clone(), damping.clone(), stiffness.clone());
    let system = System::builder(structure.unwrap())
        .joint("j", Arc::new(Cubic { stiffness: 0.0 }), vec![Axis::new(vec![(0, 1.0)])])
        .force(0, 1, Complex64::new(1.0, 0.0))
        .build()
        .unwrap();
    let complex = |m: &DMatrix<f64>| m.map(|x| Complex64::new(x, 0.0));
    let dynamic = complex(&stiffness) + complex(&damping) * Complex64::new(0.0, omega)
        - complex(&mass) * Complex64::new(omega * omega, 0.0);
    let load: DVector<Complex64> = dvector![Complex64::new(1.0, 0.0), ZERO];
    let expected = dynamic.lu().solve(&load).unwrap();
    let orbit = balanced(&system, 3, omega);
    for (place, x) in orbit.places.iter().zip(expected.iter()) {
        assert!((place.first_harmonic - x).norm() < 1e-9, "{place:?} {x}");
    }
}

/// A row of nodes in a plane with coupled laws of every view between them: the
/// banded form finds the motion of the dense form.
#[test]
fn banded_and_dense_agree_in_a_plane() {
    let nodes = 24;
    let n = 2 * nodes;
    let places = (0..n).map(|i| format!("p{i}")).collect();
    let stiffness = DMatrix::from_fn(n, n, |i, k| match i.abs_diff(k) {
        0 => 2.0 + 0.01 * i as f64,
        2 => -0.3,
        _ => 0.0,
    });
    let structure = Structure::new(places, DMatrix::identity(n, n), DMatrix::identity(n, n) * 0.1, stiffness).unwrap();
    let laws = [Plane::Masing, Plane::Rigid, Plane::Stiffening];
    let mut builder = System::builder(structure);
    for i in 1..nodes {
        let axis = |a: usize| Axis::new(vec![(2 * i + a, 1.0), (2 * i - 2 + a, -1.0)]);
        builder = builder.joint(format!("j{i}"), Arc::new(laws[i % laws.len()]), vec![axis(0), axis(1)]);
    }
    for i in (0..n).step_by(7) {
        builder = builder.force(i, 1, Complex64::from_polar(1.0, 0.7 * i as f64));
    }
    let system = builder.build().unwrap();
    let ports = Ports::new(&system).unwrap();
    let dynamics = LinearDynamics::new(&system, &ports);
    let (harmonics, omega) = (vec![1, 3, 5], 1.2);
    let solve = |banded: bool| {
        let banded = banded.then(|| BandedForm::new(&system, &ports, &harmonics).unwrap());
        let mut discretization = Discretization::new(harmonics.clone(), 256, &ports, banded);
        discretization.set_frequency(&system, &ports, &dynamics, omega).unwrap();
        let start = discretization.initial_guess(&system, &ports, None, omega);
        discretization.solve(&ports, omega, start).unwrap()
    };
    let (dense, banded) = (solve(false), solve(true));
    assert!(dense.force.iter().any(|f| f.norm() > 0.5 * LIMIT), "{:?}", dense.force);
    for (a, b) in dense.c.iter().zip(&banded.c).chain(dense.force.iter().zip(&banded.force)) {
        assert!((a - b).norm() < 1e-8, "{a} {b}");
    }
}
