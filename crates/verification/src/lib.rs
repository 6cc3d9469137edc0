//! Tests of Stickslip against closed forms, published results and outside integrators; see `tests/`.
//!
//! The library part makes the random models that several tests share.

use stickslip::law::{Coulomb, Jenkins, Law};
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Spring};

/// A small generator of uniform numbers, so that every test can name its models by a seed.
/// Source: Steele, Lea, Flood, "Fast splittable pseudorandom number generators" (2014), SplitMix64.
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// Starts at a seed.
    pub fn new(seed: u64) -> Self {
        Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }
    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
    /// Uniform in `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
    /// A whole number in `0..n`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }
}

/// A random structure and a drive frequency (rad/s): 1 to 4 masses, 1 to 3 joints of exact laws between any two places, light
/// damping, one or two harmonics of force on some masses, driven anywhere between a third and three times a natural frequency,
/// every third one at a natural frequency of the structure without joints.
pub fn random_model(seed: u64) -> (Model, f64) {
    let mut random = Random::new(seed);
    let count = 1 + random.below(4);
    let mut model = Model::default();
    let name = |i: usize| if i == 0 { GROUND.to_owned() } else { format!("m{i}") };
    for i in 1..=count {
        model.masses.push(Mass { name: name(i), mass: random.between(0.1, 2.0) });
        // every mass is held by something: by the ground, or by a mass before it
        let other = if random.unit() < 0.6 { 0 } else { random.below(i) };
        let stiffness = 10f64.powf(random.between(2.0, 4.0));
        let damping = random.between(0.001, 0.1) * stiffness.sqrt();
        model.springs.push(Spring { between: [name(i), name(other)], stiffness, damping });
    }
    for j in 0..1 + random.below(3) {
        let a = 1 + random.below(count);
        let b = (a + 1 + random.below(count)) % (count + 1);
        let limit = 10f64.powf(random.between(-1.0, 1.0));
        let law = if random.unit() < 0.5 {
            Law::Coulomb(Coulomb { limit })
        } else {
            Law::Jenkins(Jenkins { stiffness: 10f64.powf(random.between(2.0, 4.0)), limit })
        };
        model.joints.push(Joint { name: format!("j{}", j + 1), between: [name(a), name(b)], law });
    }
    for _ in 0..1 + random.below(2) {
        let harmonic = if random.unit() < 0.8 { 1 } else { 1 + random.below(3) as u32 };
        let on = name(1 + random.below(count));
        model.forces.push(Force { on, amplitude: random.between(1.0, 10.0), phase: random.between(0.0, 6.0), harmonic });
    }
    let system = model.assemble().expect("random models are well formed");
    let at = random.below(count);
    let natural = (system.stiffness[(at, at)] / system.mass[(at, at)]).sqrt();
    let factor = if seed.is_multiple_of(3) { 1.0 } else { 3f64.powf(random.between(-1.0, 1.0)) };
    (model, natural * factor)
}
