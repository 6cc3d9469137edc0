//! A law of one's own: the drag of a fluid, `f = drag |u'| u'`.
//!
//! `cargo run --release -p stickslip --example own_law`

#![allow(clippy::print_stdout)] // a program

use std::error::Error;
use std::sync::Arc;
use stickslip::dimension::Dimension;
use stickslip::law::{LawInfo, Parameter, RateLaw, RateView, RelativeMotion};
use stickslip::method::{harmonic_balance::HarmonicBalance, shooting::Shooting};
use stickslip::{Force, GROUND, Joint, Law, Mass, Method, Model, Spring};
use stickslip_numerics::dual::Real;

#[derive(Debug)]
struct Drag {
    /// Force over the square of the velocity, N s²/m².
    drag: f64,
}

static DRAG: LawInfo = LawInfo {
    name: "drag",
    summary: "f = drag |u'| u'",
    parameters: &[Parameter::positive("drag", Dimension::NONE, "force over the square of the velocity, N s^2/m^2")],
    sample: &[5.0],
    build: |values| Arc::new(Drag { drag: values[0] }),
};

impl Law for Drag {
    fn info(&self) -> &'static LawInfo {
        &DRAG
    }
    fn values(&self) -> Vec<f64> {
        vec![self.drag]
    }
    fn is_odd(&self) -> bool {
        true
    }
    fn rate(&self) -> Option<&dyn RateView> {
        Some(self)
    }
}

// Written once for all numbers: dual numbers give the exact derivatives.
impl RateLaw for Drag {
    fn evaluate<S: Real>(&self, motion: &RelativeMotion<S>, _z: &[S], _rate: &mut [S]) -> [S; 3] {
        let velocity = motion.velocity[0];
        [velocity * velocity.abs() * self.drag, S::from(0.0), S::from(0.0)]
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let model = Model {
        masses: vec![Mass::new("plate", 1.0)],
        springs: vec![Spring { between: ["plate".into(), GROUND.into()], stiffness: 1e4, damping: 0.0 }],
        joints: vec![Joint {
            name: "water".into(),
            between: ["plate".into(), GROUND.into()],
            law: Arc::new(Drag { drag: 5.0 }),
        }],
        forces: vec![Force { on: "plate".into(), amplitude: 2.0, phase: 0.0, harmonic: 1 }],
        ..Model::default()
    };
    let system = model.assemble()?;
    // At resonance the drag balances the force: 8/(3π) drag V² = 2 N for the velocity amplitude V.
    let omega = 100.0;
    let expected = (2.0 * 3.0 * std::f64::consts::PI / (8.0 * 5.0)).sqrt() / omega;
    for method in [&Shooting::default() as &dyn Method, &HarmonicBalance::default()] {
        let orbit = method.solver(&system)?.orbit(omega)?;
        println!(
            "{}: {:.4} mm; one harmonic would give {:.4} mm",
            method.name(),
            1e3 * orbit.places[0].amplitude(),
            1e3 * expected
        );
    }
    Ok(())
}
