//! A bladed disk with friction between its blades, tuned and mistuned.
//!
//! `cargo run --release -p stickslip --example disk`

#![allow(clippy::print_stdout)] // a program

use std::error::Error;
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::law::Jenkins;
use stickslip::method::harmonic_balance::HarmonicBalance;
use stickslip::model::{Disk, SectorDistribution, normal_deviations};
use stickslip::{Force, GROUND, Joint, Mass, Method, Model, Spring};

/// Returns one sector; a joint leads to the blade of the next one.
fn sector(mass: f64) -> Model {
    Model {
        masses: vec![Mass::new("blade", mass)],
        springs: vec![Spring { between: ["blade".into(), GROUND.into()], stiffness: 105_103.0, damping: 0.2 }],
        joints: vec![Joint {
            name: "shroud".into(),
            between: ["blade".into(), "next.blade".into()],
            law: Arc::new(Jenkins { stiffness: 2e3, limit: 1.0 }),
        }],
        forces: vec![Force { on: "blade".into(), amplitude: 2.0, phase: 0.0, harmonic: 1 }],
        ..Model::default()
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let disk = Disk { sectors: 12, forces: vec![SectorDistribution::EngineOrder(3)], motions: vec![] };
    let deviations = normal_deviations(disk.sectors, 0.003, 1);
    let tuned = disk.ring(|_| sector(0.182))?.assemble()?;
    let mistuned = disk.ring(|at| sector(0.182 * (1.0 + deviations[at])))?.assemble()?;
    let method = HarmonicBalance::default();
    let (mut tuned, mut mistuned) = (method.solver(&tuned)?, method.solver(&mistuned)?);
    println!("frequency (Hz)  tuned (mm)  worst blade, mistuned (mm)");
    for step in 0..=20 {
        let hertz = 120.0 + 0.2 * f64::from(step);
        let [one, all] = [&mut tuned, &mut mistuned].map(|solver| solver.orbit(TAU * hertz));
        let largest = |orbit: &stickslip::Orbit| orbit.places.iter().map(|place| place.amplitude()).fold(0.0, f64::max);
        println!("{hertz:14.1}  {:10.4}  {:10.4}", 1e3 * largest(&one?), 1e3 * largest(&all?));
    }
    Ok(())
}
