//! Every law of the table in every method that takes it, against a motion in small steps that no method has a part in.

#![allow(clippy::print_stdout)] // tests say what they measured

use nalgebra::DMatrix;
use num_complex::Complex64;
use std::f64::consts::TAU;
use stickslip::law::TABLE;
use stickslip::method::{self, Method, MethodError, Options, Refusal, advised, auto::Auto};
use stickslip::model::{Axis, System};
use stickslip::orbit::Orbit;
use stickslip::structure::Structure;
use stickslip_verification::held::{OMEGA, held};
use stickslip_verification::reference::Reference;

/// A damping ratio of 0.1: a transient falls to 1e-8 in 30 periods.
const DAMPING: f64 = 28.0;

/// Steps of a period of the reference, and of the coarser one beside it.
const STEPS: usize = 2000;
const COARSE: usize = 1000;
/// Its periods, and the change from one to the next at which it is periodic, relative. What creeps as `1/t` still goes that change times the periods.
const PERIODS: usize = 60;
const SETTLED: f64 = 1e-7;
/// Distances of both references that the finer one may err by: one where its steps are of first order, as at kinks.
const ORDER: f64 = 2.0;
/// The largest error of a reference that says anything, relative to the motion.
const RESOLVED: f64 = 1e-3;
/// What errors that a method estimates of the whole motion may come to in the amplitude of one place.
const SHARE: f64 = 3.0;
/// What the sampling of amplitudes errs by, both of the references and of the orbits: the square of half a step.
const SAMPLED: f64 = 5e-6;

/// Amplitudes of the motion in so many steps of a period that begins as an orbit does, followed until it repeats, and how far from that it ends. From
/// rest a smooth law creeps for thousands of periods; a motion that is no orbit leaves its beginning all the same.
fn followed(system: &System, steps: usize, orbit: &Orbit) -> (Vec<f64>, f64) {
    let begin = orbit.sample(0.0);
    let states = &orbit.start[2 * system.dofs()..];
    let mut reference = Reference::new(system, OMEGA, steps, &begin.displacement, &begin.velocity).with_states(states);
    let (amplitudes, change) = reference.settle(PERIODS, SETTLED);
    (amplitudes, if change > SETTLED { PERIODS as f64 * change } else { change })
}

#[test]
fn every_law_in_every_method_moves_as_the_reference() {
    for info in TABLE {
        let law = info.sample();
        let system = held(&law, DAMPING, 0.0);
        let begins = Auto.solver(&system).unwrap().orbit(OMEGA, None).unwrap();
        let [(fine, missing), (coarse, _)] = [STEPS, COARSE].map(|steps| followed(&system, steps, &begins));
        let size = fine.iter().fold(0.0f64, |size, x| size.max(*x));
        let apart = fine.iter().zip(&coarse).fold(0.0f64, |most, (a, b)| most.max((a - b).abs())) / size;
        let apart = ORDER * apart + missing;
        println!("{}: the reference errs by {apart:.1e}, of which {missing:.1e} is to come", info.name);
        assert!(apart < RESOLVED, "{}: the reference errs by {apart:.1e}", info.name);
        let mut taken = 0;
        for row in method::TABLE {
            let method = (row.build)(&Options::new()).unwrap();
            let mut solver = match advised(&*method, &system) {
                Ok(solver) => solver,
                // refused by name, with what to use instead
                Err(MethodError { refusal: Refusal::Law { law, .. }, ways }) => {
                    assert!(law == info.name && !ways.methods.is_empty(), "{} in {}: {ways}", info.name, row.name);
                    continue;
                }
                Err(error) => panic!("{} in {}: {error}", info.name, row.name),
            };
            taken += 1;
            let orbit = solver.orbit(OMEGA, None).unwrap_or_else(|error| panic!("{}: {error}", info.name));
            let allowed = SAMPLED + apart + SHARE * orbit.evidence.truncation.unwrap_or(0.0);
            let off = orbit.places.iter().zip(&fine).map(|(place, x)| (place.amplitude() - x).abs() / size);
            let off = off.fold(0.0, f64::max);
            println!("{} in {}: {off:.1e} of {allowed:.1e}", info.name, row.name);
            assert!(off < allowed, "{} in {}: {off:.1e} of {allowed:.1e}", info.name, row.name);
        }
        assert!(taken > 0, "{}: no method takes it", info.name);
    }
}

/// A steep law's steps are chosen anew in every period of a motion that is waited for, and what that does to the motion may go round for ever. It is
/// no motion of several periods: Newton's method finds the orbit of one, from which the reference does not depart.
#[test]
fn what_steps_do_is_no_motion_of_several_periods() {
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
            let orbit = method.solver(&system).unwrap().orbit(TAU * hertz, None);
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
