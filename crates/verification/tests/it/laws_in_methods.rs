//! Every law of the table in every method that takes it, against an independent integration in
//! small steps.

#![allow(clippy::print_stdout)] // tests print measured values

use nalgebra::DMatrix;
use num_complex::Complex64;
use std::f64::consts::TAU;
use stickslip::law::TABLE;
use stickslip::method::{self, Method, MethodError, Options, Refusal, auto::Auto, solver_with_alternatives};
use stickslip::model::{Axis, System};
use stickslip::orbit::Orbit;
use stickslip::structure::Structure;
use stickslip_verification::newmark_reference::Reference;
use stickslip_verification::single_mass::{OMEGA, mass_on_law};

/// Damping for a ratio of 0.1: a transient falls to 1e-8 in 30 periods.
const DAMPING: f64 = 28.0;

/// Steps per period of the reference, and of a coarser one.
const STEPS: usize = 2000;
const COARSE: usize = 1000;
/// Most periods of the reference, and the relative change per period at which it counts as
/// periodic. A creep of order `1/t` still moves by this change times the periods.
const PERIODS: usize = 60;
const SETTLED: f64 = 1e-7;
/// Error of the finer reference in distances of the two references; two covers steps of first
/// order, as at kinks.
const ORDER: f64 = 2.0;
/// Largest error of a useful reference, relative to the motion.
const RESOLVED: f64 = 1e-3;
/// Largest error of the amplitude of one place in estimated errors of the whole motion.
const SHARE: f64 = 3.0;
/// Error of sampled amplitudes, of the references and of the orbits: the square of half a step.
const SAMPLED: f64 = 5e-6;

/// Returns the amplitudes of the motion that begins at an orbit, in `steps` steps per period,
/// and its distance from a periodic motion. From rest, a smooth law would creep for thousands
/// of periods; a motion that is not an orbit still leaves its start.
fn followed(system: &System, steps: usize, orbit: &Orbit) -> (Vec<f64>, f64) {
    let begin = orbit.sample(0.0);
    let states = &orbit.initial_state[2 * system.dofs()..];
    let mut reference = Reference::new(system, OMEGA, steps, &begin.displacement, &begin.velocity).with_states(states);
    let (amplitudes, change) = reference.settle(PERIODS, SETTLED);
    (amplitudes, if change > SETTLED { PERIODS as f64 * change } else { change })
}

#[test]
fn every_law_in_every_method_moves_as_the_reference() {
    for info in TABLE {
        let law = info.sample();
        let system = mass_on_law(&law, DAMPING, 0.0);
        let begins = Auto.solver(&system).unwrap().orbit(OMEGA).unwrap();
        let [(fine, missing), (coarse, _)] = [STEPS, COARSE].map(|steps| followed(&system, steps, &begins));
        let size = fine.iter().fold(0.0f64, |size, x| size.max(*x));
        let apart = fine.iter().zip(&coarse).fold(0.0f64, |most, (a, b)| most.max((a - b).abs())) / size;
        let apart = ORDER * apart + missing;
        println!("{}: the reference errs by {apart:.1e}, of which {missing:.1e} is to come", info.name);
        assert!(apart < RESOLVED, "{}: the reference errs by {apart:.1e}", info.name);
        let mut taken = 0;
        for row in method::TABLE {
            let method = (row.build)(&Options::new()).unwrap();
            let mut solver = match solver_with_alternatives(&*method, &system) {
                Ok(solver) => solver,
                // refused by name, with alternative methods
                Err(MethodError { refusal: Refusal::Law { law, .. }, alternatives: ways }) => {
                    assert!(law == info.name && !ways.methods.is_empty(), "{} in {}: {ways}", info.name, row.name);
                    continue;
                }
                Err(error) => panic!("{} in {}: {error}", info.name, row.name),
            };
            taken += 1;
            let orbit = solver.orbit(OMEGA).unwrap_or_else(|error| panic!("{}: {error}", info.name));
            let allowed = SAMPLED + apart + SHARE * orbit.evidence.error_estimate.unwrap_or(0.0);
            let off = orbit.places.iter().zip(&fine).map(|(place, x)| (place.amplitude() - x).abs() / size);
            let off = off.fold(0.0, f64::max);
            println!("{} in {}: {off:.1e} of {allowed:.1e}", info.name, row.name);
            assert!(off < allowed, "{} in {}: {off:.1e} of {allowed:.1e}", info.name, row.name);
        }
        assert!(taken > 0, "{}: no method takes it", info.name);
    }
}

/// Method `transient` chooses the steps of a steep law anew in every period, and their errors
/// may keep the motion from settling. The solver must not report this as a motion of several
/// periods. Newton's method finds the orbit of one period, and the reference confirms it.
#[test]
fn step_errors_are_not_reported_as_subharmonics() {
    let one = |value: f64| DMatrix::from_element(1, 1, value);
    let values = [("limit", 2.0), ("static_limit", 2.5), ("velocity", 0.01), ("alpha", 25_000.0)];
    let law = stickslip::law::find("stribeck-arctan").unwrap().build(&values.into()).unwrap();
    // force, damping, frequency in Hz
    for (force, damping, hertz) in [(10.0, 20.0, 23.0), (40.0, 1.0, 32.0), (40.0, 20.0, 29.0)] {
        let structure = Structure::new(vec!["m".to_owned()], one(1.0), one(damping), one(1e4)).unwrap();
        let builder = System::builder(structure).joint("j", law.clone(), vec![Axis::new(vec![(0, 1.0)])]);
        let system = builder.force(0, 1, Complex64::new(force, 0.0)).build().unwrap();
        let [waited, found] = ["transient", "shooting"].map(|name| {
            let method = (method::TABLE.iter().find(|row| row.name == name).unwrap().build)(&Options::new()).unwrap();
            let orbit = method.solver(&system).unwrap().orbit(TAU * hertz);
            orbit.unwrap_or_else(|error| panic!("{name} at {hertz} Hz: {error}"))
        });
        assert_eq!((waited.periods, waited.is_stable()), (1, Some(true)));
        let begin = found.sample(0.0);
        let mut reference = Reference::new(&system, TAU * hertz, STEPS, &begin.displacement, &begin.velocity);
        let (amplitudes, change) = reference.settle(PERIODS, SETTLED);
        let off = [found.places[0].amplitude(), amplitudes[0]].map(|other| waited.places[0].amplitude() / other - 1.0);
        println!("{hertz} Hz: {off:?} beside shooting and the reference, which changes by {change:.1e}");
        assert!(off[0].abs() < 1e-6 && off[1].abs() < RESOLVED, "{hertz} Hz: {off:?}");
    }
}
