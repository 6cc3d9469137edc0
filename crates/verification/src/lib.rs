//! Tests of Stickslip against closed forms, published results and independent integrators; see
//! `tests/`.
//!
//! The library part holds code that several tests share: random models, changed templates, and
//! small numerics (search, quadrature). It does not use the numerics of the other crates.

pub mod law_driver;
pub mod laws_of_seeds;
pub mod located_contacts;
pub mod loose_dampers;
pub mod newmark_reference;
pub mod single_mass;

use laws_of_seeds::LAWS_OF_SEEDS;
use nalgebra::DMatrix;
use num_complex::Complex64;
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;
use stickslip::law::{Coulomb, Jenkins, LawInfo, Parameter, Range, SharedLaw, TABLE};
use stickslip::method::{Method, event_driven::EventDriven};
use stickslip::model::{Axis, Force, GROUND, Joint, Mass, Model, Spring, System};
use stickslip::orbit::{Orbit, Sample};
use stickslip::structure::{Structure, StructureError};
use stickslip_numerics::golden_section::golden_section;
use stickslip_numerics::random::SplitMix64;
use stickslip_study::templates;

/// A small generator of uniform random numbers, so that a seed identifies each model of a test.
#[derive(Debug, Clone)]
pub struct Random(SplitMix64);

impl Random {
    /// Makes a generator from a seed.
    pub fn new(seed: u64) -> Self {
        Random(SplitMix64::new(0).skip(seed))
    }
    /// Returns a number uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0.next_unit()
    }
    /// Returns a number uniform in `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
    /// Returns a whole number in `0..n`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }
}

/// Returns a symmetric matrix with eigenvalues of at least `least`.
fn definite(random: &mut Random, n: usize, least: f64, size: f64) -> DMatrix<f64> {
    let b = DMatrix::from_fn(n, n, |_, _| random.between(-1.0, 1.0));
    DMatrix::identity(n, n) * least + &b * b.transpose() * size
}

/// Returns one of these laws with parameters between half and twice those of its sample.
/// Parameters with a default keep the sample's value.
pub fn random_law(random: &mut Random, among: &[&'static LawInfo]) -> SharedLaw {
    drawn_law(random, among, |random, value, p| if p.default.is_some() { value } else { around(random, value) })
}

/// Returns one of these laws with parameters from their whole ranges: zero, either sign, any
/// count.
pub fn any_law(random: &mut Random, among: &[&'static LawInfo]) -> SharedLaw {
    drawn_law(random, among, |random, value, p| match p.range {
        Range::Positive => around(random, value),
        Range::ZeroOrMore => around(random, value) * f64::from(random.unit() > 0.15),
        Range::Any => around(random, value) * if random.unit() < 0.3 { -1.0 } else { 1.0 },
        Range::Within(least, most) => random.between(least.max(-10.0), most.min(10.0)),
        Range::UpTo(most) => random.below(most.min(2 * value as u32) as usize + 1) as f64,
        Range::Count(most) => 1.0 + random.below(most.min(2 * value as u32) as usize) as f64,
    })
}

/// Returns a value between half and twice `value`.
fn around(random: &mut Random, value: f64) -> f64 {
    value * 2f64.powf(random.between(-1.0, 1.0))
}

fn drawn_law(
    random: &mut Random,
    among: &[&'static LawInfo],
    draw: impl Fn(&mut Random, f64, &Parameter) -> f64,
) -> SharedLaw {
    let row = among[(random.unit() * among.len() as f64) as usize];
    for _ in 0..20 {
        let pairs = row.sample.iter().zip(row.parameters);
        let values: Vec<f64> = pairs.map(|(value, p)| draw(random, *value, p)).collect();
        let keys = row.parameters.iter().map(|p| p.key).zip(values).collect();
        if let Ok(law) = row.build(&keys) {
            return law;
        }
    }
    row.sample()
}

fn laws_of_seeds() -> Vec<&'static LawInfo> {
    TABLE.iter().copied().filter(|row| LAWS_OF_SEEDS.contains(&row.name)).collect()
}

/// Returns a system with one to four degrees of freedom, full matrices and one or two joints,
/// with an excitation frequency in rad/s. The joints have any laws of the table.
pub fn random_system(seed: u64) -> (System, f64) {
    random_system_of(seed, &laws_of_seeds())
}

/// Returns such a system with law parameters from their whole ranges.
pub fn random_system_of_any_parameters(seed: u64) -> (System, f64) {
    let laws = laws_of_seeds();
    system_with(seed, &|random| any_law(random, &laws))
}

/// Returns such a system with joints of these laws.
pub fn random_system_of(seed: u64, among: &[&'static LawInfo]) -> (System, f64) {
    system_with(seed, &|random| random_law(random, among))
}

fn system_with(seed: u64, law: &dyn Fn(&mut Random) -> SharedLaw) -> (System, f64) {
    let mut random = Random::new(seed);
    let n = 1 + (random.unit() * 4.0) as usize;
    let mass = definite(&mut random, n, 0.5, 1.0);
    let stiffness = definite(&mut random, n, 1e4, 1e4);
    let natural = (stiffness[(0, 0)] / mass[(0, 0)]).sqrt();
    // damping ratios of some percent, so that transients decay
    let damping = definite(&mut random, n, 0.1 * natural, 0.05 * natural);
    let places = (0..n).map(|i| format!("p{i}")).collect();
    let structure = Structure::new(places, mass, damping, stiffness).unwrap();
    let mut builder = System::builder(structure);
    for j in 0..1 + (random.unit() * 2.0) as usize {
        let law = law(&mut random);
        let axes = (0..law.directions()).map(|_| {
            let one = (random.unit() * n as f64) as usize;
            let other = (random.unit() * n as f64) as usize;
            Axis::new(if one == other { vec![(one, 1.0)] } else { vec![(one, 1.0), (other, -0.7)] })
        });
        let axes = axes.collect();
        builder = builder.joint(format!("j{j}"), law, axes);
    }
    builder = builder.force(0, 1, Complex64::from_polar(random.between(2.0, 20.0), random.between(0.0, 6.0)));
    if random.unit() < 0.3 {
        builder = builder.force(n - 1, 0, Complex64::new(random.between(-5.0, 5.0), 0.0));
    }
    if random.unit() < 0.2 {
        builder = builder.force(n - 1, 2, Complex64::from_polar(random.between(0.5, 4.0), random.between(0.0, 6.0)));
    }
    (builder.build().unwrap(), natural * random.between(0.4, 1.6))
}

/// Returns a mistuned row or ring of 6 to 20 bodies and an excitation frequency near its band,
/// rad/s.
///
/// The bodies are connected to the ground and to their neighbours. About every other pair of
/// neighbours has a joint with any law of the table. A force with a random phase acts on each
/// body.
pub fn random_row(seed: u64) -> (System, f64) {
    // spread the seeds: the sequences of neighbouring seeds are shifted by one number
    let mut random = Random::new(seed << 20);
    let (count, closed) = (6 + random.below(15), random.unit() < 0.5);
    let pairs = if closed { count } else { count - 1 };
    let natural: f64 = 100.0;
    let (mut mass, mut stiffness) = (DMatrix::zeros(count, count), DMatrix::zeros(count, count));
    for i in 0..count {
        mass[(i, i)] = random.between(0.95, 1.05);
        stiffness[(i, i)] += natural * natural * random.between(0.95, 1.05);
    }
    let between = natural * natural * random.between(0.0, 0.2);
    for (i, j) in (0..pairs).map(|i| (i, (i + 1) % count)) {
        stiffness[(i, i)] += between;
        stiffness[(j, j)] += between;
        stiffness[(i, j)] -= between;
        stiffness[(j, i)] -= between;
    }
    // damping ratios of some percent, so that transients decay
    let damping = &mass * (0.08 * natural);
    let places = (0..count).map(|i| format!("p{i}")).collect();
    let mut builder = System::builder(Structure::new(places, mass, damping, stiffness).unwrap());
    for i in 0..pairs {
        if random.unit() < 0.5 {
            continue;
        }
        let law = random_law(&mut random, &laws_of_seeds());
        // the first direction of a law acts between the pair, the others against the ground
        let axis = |d: usize| match d {
            0 => Axis::new(vec![(i, 1.0), ((i + 1) % count, -1.0)]),
            d => Axis::new(vec![((i + d) % count, 1.0)]),
        };
        let axes = (0..law.directions()).map(axis).collect();
        builder = builder.joint(format!("j{i}"), law, axes);
    }
    for i in 0..count {
        let force = Complex64::from_polar(random.between(2.0, 10.0), random.between(0.0, 6.0));
        builder = builder.force(i, 1, force);
    }
    if random.unit() < 0.3 {
        builder = builder.force(count - 1, 0, Complex64::new(random.between(-5.0, 5.0), 0.0));
    }
    (builder.build().unwrap(), natural * random.between(0.8, 1.3))
}

/// Returns a random model and an excitation frequency, rad/s.
///
/// The model has 1 to 4 masses, 1 to 3 joints of exact laws between any two places, and light
/// damping. Forces of one or two harmonics act on some masses. The frequency lies between a
/// third and three times a natural frequency. For every third seed it equals a natural
/// frequency of the structure without joints.
pub fn random_model(seed: u64) -> (Model, f64) {
    let mut random = Random::new(seed);
    let count = 1 + random.below(4);
    let mut model = Model::default();
    let name = |i: usize| if i == 0 { GROUND.to_owned() } else { format!("m{i}") };
    for i in 1..=count {
        model.masses.push(Mass::new(name(i), random.between(0.1, 2.0)));
        // a spring connects every mass to the ground or to an earlier mass
        let other = if random.unit() < 0.6 { 0 } else { random.below(i) };
        let stiffness = 10f64.powf(random.between(2.0, 4.0));
        let damping = random.between(0.001, 0.1) * stiffness.sqrt();
        model.springs.push(Spring { between: [name(i), name(other)], stiffness, damping });
    }
    for j in 0..1 + random.below(3) {
        let a = 1 + random.below(count);
        let b = (a + 1 + random.below(count)) % (count + 1);
        let limit = 10f64.powf(random.between(-1.0, 1.0));
        let law: SharedLaw = if random.unit() < 0.5 {
            Arc::new(Coulomb { limit })
        } else {
            Arc::new(Jenkins { stiffness: 10f64.powf(random.between(2.0, 4.0)), limit })
        };
        model.joints.push(Joint { name: format!("j{}", j + 1), between: [name(a), name(b)], law });
    }
    for _ in 0..1 + random.below(2) {
        let harmonic = if random.unit() < 0.8 { 1 } else { 1 + random.below(3) as u32 };
        let on = name(1 + random.below(count));
        model.forces.push(Force {
            on,
            amplitude: random.between(1.0, 10.0),
            phase: random.between(0.0, 6.0),
            harmonic,
        });
    }
    let system = model.assemble().expect("random models are well formed");
    let at = random.below(count);
    let natural = (system.structure().stiffness()[(at, at)] / system.structure().mass()[(at, at)]).sqrt();
    let factor = if seed.is_multiple_of(3) { 1.0 } else { 3f64.powf(random.between(-1.0, 1.0)) };
    (model, natural * factor)
}

/// Assembles a template with some parameters changed.
pub fn template(name: &str, changes: &[(&str, f64)]) -> System {
    let template = templates::find(name).unwrap_or_else(|| panic!("no template {name}"));
    template.model_with(changes).unwrap_or_else(|error| panic!("{error}")).assemble().expect("well formed")
}

/// Returns the same system with another mass matrix.
///
/// # Errors
/// Same as [`Structure::new`], which refuses an invalid mass matrix.
pub fn with_mass(system: &System, change: impl FnOnce(&mut DMatrix<f64>)) -> Result<System, StructureError> {
    let old = system.structure();
    let mut mass = old.mass().clone();
    change(&mut mass);
    let structure = Structure::new(old.places().to_vec(), mass, old.damping().clone(), old.stiffness().clone())?;
    Ok(system.with_structure(structure).expect("as many degrees of freedom"))
}

/// Assembles a template with the laws of all joints replaced by `law(limit)`, given the slip
/// limit of each.
pub fn template_with(name: &str, changes: &[(&str, f64)], law: impl Fn(f64) -> SharedLaw) -> System {
    let template = templates::find(name).unwrap_or_else(|| panic!("no template {name}"));
    let mut model = template.model_with(changes).unwrap_or_else(|error| panic!("{error}"));
    for joint in &mut model.joints {
        joint.law = law(joint.law.force_scale());
    }
    model.assemble().expect("well formed")
}

/// Returns the exact orbit at `omega` (rad/s), found without a warm start, and asserts its
/// evidence.
pub fn exact(system: &System, omega: f64) -> Orbit {
    let orbit = EventDriven.solver(system).expect("exact laws").orbit(omega).expect("an orbit");
    assert!(orbit.evidence.residual < 1e-10 && orbit.evidence.energy_gap < 1e-9, "{orbit:?}");
    orbit
}

/// Asserts that two numbers agree within a relative tolerance.
#[track_caller]
pub fn close(what: &str, actual: f64, expected: f64, relative: f64) {
    let error = (actual - expected).abs() / expected.abs();
    assert!(error <= relative, "{what}: {actual:.12e} instead of {expected:.12e}, relative error {error:.1e}");
}

/// Asserts that two numbers agree within an absolute tolerance.
#[track_caller]
pub fn near(what: &str, actual: f64, expected: f64, absolute: f64) {
    let error = (actual - expected).abs();
    assert!(error <= absolute, "{what}: {actual:.12e} instead of {expected:.12e}, error {error:.1e}");
}

/// Returns the maximizer of `function` in `[low, high]` and the maximum.
///
/// A scan over `points` intervals gives the three highest local maxima. Golden-section search
/// refines each between its neighbours until the bracket is below `width`.
pub fn maximum(mut function: impl FnMut(f64) -> f64, [low, high]: [f64; 2], points: usize, width: f64) -> (f64, f64) {
    let at = |i: usize| low + (high - low) * i as f64 / points as f64;
    let values: Vec<f64> = (0..=points).map(|i| function(at(i))).collect();
    let mut tops: Vec<usize> = (0..=points)
        .filter(|&i| values[i] >= values[i.saturating_sub(1)] && values[i] >= values[(i + 1).min(points)])
        .collect();
    tops.sort_by(|&i, &j| values[j].total_cmp(&values[i]));
    tops.truncate(3);
    let refined = tops.iter().map(|&i| {
        let ends = (at(i.saturating_sub(1)), at((i + 1).min(points)));
        let Ok((x, value)) = golden_section(ends, |a, b| b - a <= width, |x| Ok::<_, Infallible>(function(x)));
        if value > values[i] { (x, value) } else { (at(i), values[i]) }
    });
    refined.max_by(|x, y| x.1.total_cmp(&y.1)).expect("a scan has a maximum")
}

/// Returns the zero of `function` in `[low, high]` by bisection to the last bit. The function
/// must change its sign.
pub fn zero(mut function: impl FnMut(f64) -> f64, [mut low, mut high]: [f64; 2]) -> f64 {
    let sign = function(low).signum();
    assert!(function(high).signum() != sign, "no change of sign between {low} and {high}");
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if function(middle).signum() == sign { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Returns the integral of `function(t)` over `[0, end]`, with a function that is smooth
/// between the `breaks`. Uses the Gauss rule with eight points on 16 parts of each piece.
pub fn integral(mut function: impl FnMut(f64) -> f64, end: f64, breaks: &[f64]) -> f64 {
    let parts: usize = 16;
    // abscissas and weights: Abramowitz and Stegun (1964), Table 25.4
    const POINTS: [(f64, f64); 4] = [
        (0.183_434_642_495_649_8, 0.362_683_783_378_362),
        (0.525_532_409_916_329, 0.313_706_645_877_887_27),
        (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
        (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
    ];
    let mut ends = vec![0.0];
    ends.extend(breaks.iter().copied().filter(|t| *t > 0.0 && *t < end));
    ends.push(end);
    ends.sort_by(f64::total_cmp);
    let mut sum = 0.0;
    for pair in ends.windows(2) {
        let half = 0.5 * (pair[1] - pair[0]) / parts as f64;
        for part in 0..parts {
            let centre = pair[0] + half * (2 * part + 1) as f64;
            for (x, weight) in POINTS {
                sum += half * weight * (function(centre - half * x) + function(centre + half * x));
            }
        }
    }
    sum
}

/// Returns harmonic `n` of a quantity of an orbit, `X` in `Re(X e^{jnΩt})`, by the Gauss rule
/// between the switches.
pub fn harmonic(orbit: &Orbit, n: u32, quantity: impl Fn(&Sample) -> f64) -> Complex64 {
    let (period, mut breaks) = (orbit.period(), orbit.transition_times());
    breaks.push(0.5 * period);
    let rate = f64::from(n) * orbit.omega;
    let part = |turn: fn(f64) -> f64| {
        integral(|t| quantity(&orbit.sample(t)) * turn(rate * t), period, &breaks) * 2.0 / period
    };
    Complex64::new(part(f64::cos), -part(f64::sin))
}

/// Reads a table of `data/`: one map from column to text per row.
pub fn table(path: &str) -> Vec<BTreeMap<String, String>> {
    let path = format!("{}/../../data/{path}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let cells = |line: &str| {
        let (mut cells, mut quoted) = (vec![String::new()], false);
        for c in line.chars() {
            match c {
                '"' => quoted = !quoted,
                ',' if !quoted => cells.push(String::new()),
                c => cells.last_mut().expect("one cell at least").push(c),
            }
        }
        cells
    };
    let mut lines = text.lines();
    let names = cells(lines.next().expect("a heading"));
    lines.map(|line| names.iter().cloned().zip(cells(line)).collect()).collect()
}

/// Returns a number in a row of a [`table`].
pub fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("column {column}: `{}` is no number", row[column]))
}
