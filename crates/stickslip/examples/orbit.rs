//! One orbit: two blades that rub on each other, excited at 121 Hz.
//!
//! `cargo run --release -p stickslip --example orbit`

#![allow(clippy::print_stdout)] // a program

use std::error::Error;
use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::law::Jenkins;
use stickslip::method::auto::Auto;
use stickslip::{Force, GROUND, Joint, Mass, Method, Model, Spring};

fn main() -> Result<(), Box<dyn Error>> {
    // all numbers are in SI
    let blade = |name: &str| Spring { between: [name.into(), GROUND.into()], stiffness: 105_103.0, damping: 0.2 };
    let model = Model {
        masses: vec![Mass::new("left", 0.182), Mass::new("right", 0.182)],
        springs: vec![blade("left"), blade("right")],
        joints: vec![Joint {
            name: "shroud".into(),
            between: ["left".into(), "right".into()],
            law: Arc::new(Jenkins { stiffness: 1e4, limit: 2.0 }),
        }],
        forces: vec![Force { on: "left".into(), amplitude: 10.0, phase: 0.0, harmonic: 1 }],
        ..Model::default()
    };
    let system = model.assemble()?;
    let orbit = Auto.solver(&system)?.orbit(TAU * 121.0)?;

    for place in &orbit.places {
        println!("{}: {:.3} mm", place.name, 1e3 * place.amplitude());
    }
    let shroud = &orbit.joints[0];
    println!("shroud: {:.2} mJ a period, slips {:.0} % of it", 1e3 * shroud.dissipation, 100.0 * shroud.slip_fraction);
    println!("energy gap {:.1e}, residual {:.1e}", orbit.evidence.energy_gap, orbit.evidence.residual);
    for step in 0..=8 {
        let time = orbit.period() * f64::from(step) / 8.0;
        let sample = orbit.sample(time);
        println!(
            "{:.3} ms: {:+.3} mm, force {:+.3} N",
            1e3 * time,
            1e3 * sample.displacement[0],
            sample.joints[0].force[0]
        );
    }
    Ok(())
}
