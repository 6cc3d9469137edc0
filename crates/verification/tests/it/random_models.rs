//! Random models: the solver returns an orbit with its evidence, or an error with a reason.

#![allow(clippy::print_stdout)] // tests print measured values

use stickslip::method::{Method, event_driven::EventDriven};
use stickslip_verification::random_model;

/// Number of models.
const MODELS: u64 = 2000;

#[test]
fn random_models_converge_with_evidence() {
    let (mut converged, mut failures) = (0, Vec::new());
    let (mut gap, mut residual) = (0.0f64, 0.0f64);
    for seed in 0..MODELS {
        let (model, omega) = random_model(seed);
        let system = model.assemble().unwrap();
        match EventDriven.solver(&system).unwrap().orbit(omega) {
            Ok(orbit) => {
                converged += 1;
                gap = gap.max(orbit.evidence.energy_gap);
                residual = residual.max(orbit.evidence.residual);
                if orbit.evidence.energy_gap > 1e-9 {
                    println!("seed {seed}: {:?} {:?}", orbit.energy, orbit.evidence);
                }
            }
            Err(error) => failures.push(format!("seed {seed}: {error}")),
        }
    }
    println!("{converged} of {MODELS} converged; largest energy gap {gap:.1e}, residual {residual:.1e}");
    failures.iter().for_each(|failure| println!("{failure}"));
    assert!(converged * 100 >= MODELS * 98, "{} of {MODELS} converged", converged);
    assert!(gap < 1e-9 && residual < 1e-10);
}
