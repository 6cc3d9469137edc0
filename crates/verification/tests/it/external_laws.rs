//! Laws and a method defined outside the library: the code that a new law needs, and its use in
//! all methods.
//!
//! Nothing in the library names these laws. Harmonic balance, shooting, transients and the
//! linear initial guess find their views.

use num_complex::Complex64;
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::dimension::Dimension;
use stickslip::law::{Law, LawInfo, Parameter, Range, RateLaw, RateView, RelativeMotion, SharedLaw, StepLaw, StepView};
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::method::shooting::Shooting;
use stickslip::method::transient::Transient;
use stickslip::method::{Budget, IntegrationError, Method, MethodError, OrbitError, Request, Solver};
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring, System};
use stickslip::orbit::{Accuracy, Orbit, OrbitData, Path, Sample, Symmetry};
use stickslip_numerics::dual::Real;
use stickslip_verification::newmark_reference::Reference;

/// Two parallel surfaces that approach their limits over different distances: a rate law with two states.
#[derive(Debug)]
struct TwoSurfaces {
    stiffness: f64,
    limit: f64,
    ratio: f64,
}

static TWO_SURFACES: LawInfo = LawInfo {
    name: "two-surfaces",
    summary: "f = limit (z1 + z2)/2, z' = stiffness/limit (u' - |u'| z), the second with the stiffness times ratio",
    parameters: &[
        Parameter::positive("stiffness", Dimension::STIFFNESS, "stiffness of the first surface at rest"),
        Parameter::limit("force that both tend to"),
        Parameter::new(
            "ratio",
            Dimension::NONE,
            Range::Within(0.1, 10.0),
            "stiffness of the second surface over that of the first",
        ),
    ],
    sample: &[1e4, 2.0, 3.0],
    build: |values| Arc::new(TwoSurfaces { stiffness: values[0], limit: values[1], ratio: values[2] }),
};

impl Law for TwoSurfaces {
    fn info(&self) -> &'static LawInfo {
        &TWO_SURFACES
    }
    fn values(&self) -> Vec<f64> {
        vec![self.stiffness, self.limit, self.ratio]
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn force_scale(&self) -> f64 {
        self.limit
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
}

impl RateLaw for TwoSurfaces {
    fn states(&self) -> usize {
        2
    }
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, z: &[S], rate: &mut [S]) -> [S; 3] {
        let v = motion.velocity[0];
        // without a limit it carries nothing, whatever its states are
        let share = if self.limit > 0.0 { 1.0 / self.limit } else { 0.0 };
        for (i, stiffness) in [self.stiffness, self.stiffness * self.ratio].into_iter().enumerate() {
            rate[i] = (v - v.abs() * z[i]) * (stiffness * share);
        }
        [(z[0] + z[1]) * (0.5 * self.limit), S::from(0.0), S::from(0.0)]
    }
}

/// A step law with linear kinematic hardening: a spring in series with a slider, and a spring
/// parallel to the slider.
#[derive(Debug)]
struct Hardening {
    stiffness: f64,
    limit: f64,
    tangent: f64,
}

static HARDENING: LawInfo = LawInfo {
    name: "hardening",
    summary: "spring and slider in series, with a spring beside the slider",
    parameters: &[
        Parameter::positive("stiffness", Dimension::STIFFNESS, "stiffness of the spring in series"),
        Parameter::limit("force at which the slider begins to move"),
        Parameter::positive("tangent", Dimension::STIFFNESS, "stiffness of the spring beside the slider"),
    ],
    sample: &[1e4, 2.0, 2e3],
    build: |values| Arc::new(Hardening { stiffness: values[0], limit: values[1], tangent: values[2] }),
};

impl Law for Hardening {
    fn info(&self) -> &'static LawInfo {
        &HARDENING
    }
    fn values(&self) -> Vec<f64> {
        vec![self.stiffness, self.limit, self.tangent]
    }
    fn is_odd(&self) -> bool {
        true
    }
    /// Without a limit the law is two springs in series, with an unbounded force.
    fn force_scale(&self) -> f64 {
        if self.limit > 0.0 { self.limit } else { f64::INFINITY }
    }
    fn step(&self) -> Option<&dyn StepView> {
        Some(self)
    }
}

impl StepLaw for Hardening {
    fn states(&self) -> usize {
        1
    }
    fn state_scale(&self) -> f64 {
        if self.limit > 0.0 { self.limit / self.stiffness } else { 1.0 }
    }
    /// The state is where the slider stands.
    fn advance<S: Real>(&self, _from: &[S; 3], to: &[S; 3], z: &mut [S]) -> [S; 3] {
        let trial = (to[0] - z[0]) * self.stiffness;
        let over = trial - z[0] * self.tangent;
        if over.re().abs() > self.limit {
            let sign = over.re().signum();
            z[0] += (over - sign * self.limit) * (1.0 / (self.stiffness + self.tangent));
        }
        [(to[0] - z[0]) * self.stiffness, S::from(0.0), S::from(0.0)]
    }
}

/// Returns two masses with the law between them.
fn model(law: SharedLaw) -> Model {
    let spring = |a: &str, b: &str| Spring { between: [a.into(), b.into()], stiffness: 2e4, damping: 8.0 };
    Model {
        masses: vec![Mass::new("a", 1.0), Mass::new("b", 0.6)],
        springs: vec![spring("a", GROUND), spring("b", GROUND)],
        joints: vec![Joint { name: "rub".into(), between: ["a".into(), "b".into()], law }],
        forces: vec![Force { on: "a".into(), amplitude: 12.0, phase: 0.0, harmonic: 1 }],
        ..Model::default()
    }
}

fn amplitudes(orbit: &Orbit) -> Vec<f64> {
    orbit.places.iter().map(|place| place.amplitude()).collect()
}

#[test]
fn laws_from_outside_work_in_every_method_that_takes_their_view() {
    for law in [TWO_SURFACES.sample(), HARDENING.sample()] {
        let system = model(law.clone()).assemble().unwrap();
        let omega = TAU * 24.0;
        let start = [0.0; 2];
        // the reference shares no code with a method; its error is of second order in 2000
        // steps
        let (expected, change) = Reference::new(&system, omega, 2000, &start, &start).settle(80, 1e-6);
        assert!(change <= 1e-6, "{change}");
        let methods: [&dyn Method; 3] =
            [&HarmonicBalance::default(), &Shooting::default(), &Transient { tolerance: 1e-6, ..Transient::default() }];
        for method in methods {
            let orbit = method.solver(&system).unwrap().orbit(omega).unwrap();
            let allowed = 2e-4 + 2.0 * orbit.evidence.error_estimate.unwrap_or(0.0);
            for (found, expected) in amplitudes(&orbit).iter().zip(&expected) {
                assert!(
                    (found / expected - 1.0).abs() < allowed,
                    "{} {}: {found} {expected}",
                    law.name(),
                    method.name()
                );
            }
            assert!(orbit.joints[0].dissipation > 0.0 && orbit.energy.friction > 0.0);
        }
        // a method that cannot take the law names the missing view, the law and the joint
        let error = stickslip::method::event_driven::EventDriven.solver(&system).err().unwrap().to_string();
        assert!(error.contains(law.name()) && error.contains("rub"), "{error}");
    }
}

/// Without a limit the first law carries nothing, and the second is two springs in series. The
/// closed form of the linear structure gives the motion.
#[test]
fn laws_from_outside_without_a_limit_are_linear() {
    let omega = TAU * 24.0;
    let (series, beside) = (1e4, 2e3);
    let laws: [(SharedLaw, f64); 2] = [
        (Arc::new(TwoSurfaces { stiffness: 1e4, limit: 0.0, ratio: 3.0 }), 0.0),
        (Arc::new(Hardening { stiffness: series, limit: 0.0, tangent: beside }), series * beside / (series + beside)),
    ];
    for (law, spring) in laws {
        let system = model(law.clone()).assemble().unwrap();
        // `(k - m Ω² + i c Ω) x_a + spring (x_a - x_b) = F`, and the equation of b without F
        let own = |mass: f64| Complex64::new(2e4 + spring - mass * omega * omega, 8.0 * omega);
        let (a, b) = (own(1.0), own(0.6));
        let determinant = a * b - spring * spring;
        let expected = [12.0 * b / determinant, Complex64::from(12.0 * spring) / determinant].map(|x| x.norm());
        let methods: [&dyn Method; 3] =
            [&HarmonicBalance::default(), &Shooting::default(), &Transient { tolerance: 1e-6, ..Transient::default() }];
        for method in methods {
            let orbit = method.solver(&system).unwrap().orbit(omega).unwrap();
            for (found, expected) in amplitudes(&orbit).iter().zip(expected) {
                let off = (found - expected).abs() / (12.0 / a.norm());
                assert!(off < 2e-5, "{} {}: {found} {expected}", law.name(), method.name());
            }
        }
    }
}

/// An invalid law: states of invalid size, or a NaN force beyond a distance.
#[derive(Debug)]
struct Wrong {
    size: f64,
    reach: f64,
    by_rate: bool,
}

static WRONG: LawInfo = LawInfo {
    name: "wrong",
    summary: "no law",
    parameters: &[],
    sample: &[],
    build: |_| Arc::new(Wrong { size: 1.0, reach: 0.0, by_rate: false }),
};

impl Law for Wrong {
    fn info(&self) -> &'static LawInfo {
        &WRONG
    }
    fn values(&self) -> Vec<f64> {
        Vec::new()
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn force_scale(&self) -> f64 {
        1.0
    }
    fn step(&self) -> Option<&dyn StepView> {
        if self.by_rate { None } else { Some(self) }
    }
    fn rate(&self) -> Option<&dyn RateView> {
        if self.by_rate { Some(self) } else { None }
    }
}

impl Wrong {
    fn force<S: Real>(&self, u: S) -> [S; 3] {
        let force = if u.re().abs() > self.reach { S::from(f64::NAN) } else { u * 1e3 };
        [force, S::from(0.0), S::from(0.0)]
    }
}

impl StepLaw for Wrong {
    fn states(&self) -> usize {
        1
    }
    fn state_scale(&self) -> f64 {
        self.size
    }
    fn advance<S: Real>(&self, _from: &[S; 3], to: &[S; 3], z: &mut [S]) -> [S; 3] {
        z[0] = to[0];
        self.force(to[0])
    }
}

impl RateLaw for Wrong {
    fn states(&self) -> usize {
        1
    }
    fn state_scale(&self) -> f64 {
        self.size
    }
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, z: &[S], rate: &mut [S]) -> [S; 3] {
        rate[0] = motion.velocity[0] - z[0];
        self.force(motion.displacement[0])
    }
}

/// Assembly refuses states of invalid size. A NaN force ends every search at once, with the
/// names of the joint and its law.
#[test]
fn laws_that_give_no_numbers_are_named() {
    for by_rate in [false, true] {
        for size in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = model(Arc::new(Wrong { size, reach: 1.0, by_rate })).assemble().unwrap_err().to_string();
            assert!(error.contains("wrong") && error.contains("state_scale"), "{error}");
        }
        // without the joint, the amplitude is some millimetres
        let system = model(Arc::new(Wrong { size: 1e-3, reach: 1e-4, by_rate })).assemble().unwrap();
        for method in [&Shooting::default() as &dyn Method, &Transient::default()] {
            let error = method.solver(&system).unwrap().orbit(TAU * 24.0).unwrap_err();
            let OrbitError::Breakdown { cause: IntegrationError::NotFinite { joint, law, .. }, .. } = &error else {
                panic!("{by_rate} {}: {error}", method.name())
            };
            assert_eq!((joint.as_str(), *law), ("rub", "wrong"));
        }
    }
}

/// A spring that acts on one side only but claims to be odd.
#[derive(Debug)]
struct OneSided {
    by_rate: bool,
}

static ONE_SIDED: LawInfo = LawInfo {
    name: "one-sided",
    summary: "f = 1 N/mm max(u - 1 mm, 0)",
    parameters: &[],
    sample: &[],
    build: |_| Arc::new(OneSided { by_rate: false }),
};

impl Law for OneSided {
    fn info(&self) -> &'static LawInfo {
        &ONE_SIDED
    }
    fn values(&self) -> Vec<f64> {
        Vec::new()
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn step(&self) -> Option<&dyn StepView> {
        if self.by_rate { None } else { Some(self) }
    }
    fn rate(&self) -> Option<&dyn RateView> {
        if self.by_rate { Some(self) } else { None }
    }
}

impl OneSided {
    fn force<S: Real>(u: S) -> [S; 3] {
        let beyond = u - S::from(1e-3);
        [if beyond.re() > 0.0 { beyond * 1e3 } else { S::from(0.0) }, S::from(0.0), S::from(0.0)]
    }
}

impl StepLaw for OneSided {
    fn states(&self) -> usize {
        0
    }
    fn advance<S: Real>(&self, _from: &[S; 3], to: &[S; 3], _z: &mut [S]) -> [S; 3] {
        Self::force(to[0])
    }
}

impl RateLaw for OneSided {
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, _z: &[S], _rate: &mut [S]) -> [S; 3] {
        Self::force(motion.displacement[0])
    }
}

/// A law with a false claim is refused. Its orbit would be mirrored into a symmetric motion
/// that does not exist.
#[test]
fn a_law_that_is_not_odd_must_not_say_so() {
    for by_rate in [false, true] {
        let error = model(Arc::new(OneSided { by_rate })).assemble().unwrap_err().to_string();
        assert!(error.contains("one-sided") && error.contains("is_odd"), "{error}");
    }
}

/// A method outside the library: solves linear systems harmonic by harmonic.
#[derive(Debug)]
struct Linear;

struct LinearSolver<'a>(&'a System);

struct Harmonics {
    omega: f64,
    x: Vec<(f64, Vec<Complex64>)>,
}

impl Path for Harmonics {
    fn sample(&self, time: f64) -> Sample {
        let n = self.x.first().map_or(0, |(_, x)| x.len());
        let of = |order: u32| -> Vec<f64> {
            (0..n)
                .map(|i| {
                    let term = |(h, x): &(f64, Vec<Complex64>)| {
                        let s = Complex64::new(0.0, h * self.omega);
                        (x[i] * s.powu(order) * (s * time).exp()).re
                    };
                    self.x.iter().map(term).sum()
                })
                .collect()
        };
        let [displacement, velocity, acceleration] = [of(0), of(1), of(2)];
        Sample { displacement, velocity, acceleration, joints: Vec::new(), imposed: Vec::new() }
    }
    fn transition_times(&self) -> Vec<f64> {
        Vec::new()
    }
}

impl Method for Linear {
    fn name(&self) -> &'static str {
        "linear"
    }
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        match system.joints().first() {
            None => Ok(Box::new(LinearSolver(system))),
            Some(joint) => Err(MethodError::law("linear", joint, "it takes no joints")),
        }
    }
}

impl Solver for LinearSolver<'_> {
    fn solve(&mut self, request: &Request<'_>, _budget: &mut Budget) -> Result<Orbit, OrbitError> {
        let omega = request.omega;
        let structure = self.0.structure();
        let x = self.0.excitation(omega).into_iter().map(|(h, force)| {
            let s = Complex64::new(0.0, f64::from(h) * omega);
            let complex = |matrix: &nalgebra::DMatrix<f64>| matrix.map(|v| Complex64::new(v, 0.0));
            let dynamic =
                complex(structure.mass()) * (s * s) + complex(structure.damping()) * s + complex(structure.stiffness());
            let x = dynamic.lu().solve(&force).expect("no undamped resonance in this test");
            (f64::from(h), x.iter().copied().collect())
        });
        let path = Harmonics { omega, x: x.collect() };
        let start = path.sample(0.0);
        let found = OrbitData {
            method: "linear",
            omega,
            periods: 1,
            symmetry: Symmetry::FullPeriod,
            initial_state: [start.displacement, start.velocity].concat(),
            residual: 0.0,
            iterations: 1,
            error_estimate: None,
            accuracy: Accuracy::Converged,
        };
        Orbit::new(self.0, Arc::new(path), found)
    }
}

#[test]
fn a_method_from_outside_makes_orbits_with_evidence() {
    let mut linear = model(TWO_SURFACES.sample());
    assert!(Linear.solver(&linear.assemble().unwrap()).is_err());
    linear.joints.clear();
    linear.forces.push(Force { on: "b".into(), amplitude: 3.0, phase: 0.4, harmonic: 2 });
    let system = linear.assemble().unwrap();
    let omega = TAU * 20.0;
    let orbit = Linear.solver(&system).unwrap().orbit(omega).unwrap();
    let exact = stickslip_verification::exact(&system, omega);
    for (one, other) in amplitudes(&orbit).iter().zip(amplitudes(&exact)) {
        assert!((one / other - 1.0).abs() < 1e-6, "{one} {other}");
    }
    assert!(orbit.evidence.energy_gap < 1e-6, "{}", orbit.evidence.energy_gap);
}

/// Every Rust block of the book's page is code of this file.
#[test]
fn the_book_shows_the_code_of_this_file() {
    let page = include_str!("../../../../docs/src/extending.md");
    let blocks: Vec<&str> = page.split("```rust\n").skip(1).filter_map(|rest| rest.split("\n```").next()).collect();
    assert_eq!(blocks.len(), 3);
    for block in blocks {
        for part in block.split("\n\nimpl ") {
            assert!(include_str!("external_laws.rs").contains(part), "not in this file:\n{part}");
        }
    }
}
