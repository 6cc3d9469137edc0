//! Shooting on the smooth law: against orbits that SciPy integrated (`data/smooth_orbits`), on
//! every point of the paper's Fig. 6, and towards the exact law for a steep arctangent.

#![allow(clippy::print_stdout)] // tests print measured values

use std::f64::consts::TAU;
use std::sync::Arc;
use stickslip::law::CoulombArctan;
use stickslip::method::{Method, event_driven::EventDriven, shooting::Shooting, transient::Transient};
use stickslip::model::System;
use stickslip::orbit::{Orbit, Seed};
use stickslip_verification::{close, exact, near, number, table, template, template_with};

fn couple(ft: f64, alpha: f64) -> System {
    template_with("blade-couple", &[("Ft", ft)], |limit| Arc::new(CoulombArctan { limit, alpha }))
}

fn shoot(system: &System, omega: f64, tolerance: f64) -> Orbit {
    Shooting { tolerance, width: None, ..Shooting::default() }.solver(system).unwrap().orbit(omega).unwrap()
}

/// Amplitudes, phases, energies and the state at t = 0 of three orbits, one of them in
/// stick-slip.
#[test]
fn couple_agrees_with_scipy() {
    let rows = table("smooth_orbits/couple_arctan.csv");
    assert_eq!(rows.len(), 3);
    for (tolerance, amplitudes, losses) in [(1e-11, 1e-9, 5e-9), (1e-8, 2e-8, 1e-7)] {
        let (mut worst, mut worst_loss) = (0.0f64, 0.0f64);
        for row in &rows {
            let system = couple(number(row, "Ft_N"), number(row, "alpha_s_per_m"));
            let orbit = shoot(&system, TAU * number(row, "frequency_Hz"), tolerance);
            for (i, place) in orbit.places.iter().enumerate() {
                let expected = number(row, &format!("x{}_amplitude_m", i + 1));
                worst = worst.max((place.amplitude() / expected - 1.0).abs());
                close(&format!("amplitude {i} of {row:?}"), place.amplitude(), expected, amplitudes);
                let first = number(row, &format!("x{}_first_harmonic_m", i + 1));
                close("first harmonic", place.first_harmonic.norm(), first, amplitudes);
                near("phase", place.phase_deg(), number(row, &format!("x{}_phase_deg", i + 1)), 200.0 * amplitudes);
                near(
                    "displacement at 0",
                    orbit.initial_state[i],
                    number(row, &format!("x{}_0_m", i + 1)),
                    1e2 * amplitudes * expected,
                );
                let speed = orbit.omega * expected;
                near(
                    "velocity at 0",
                    orbit.initial_state[3 + i],
                    number(row, &format!("v{}_0_m_per_s", i + 1)),
                    1e2 * amplitudes * speed,
                );
            }
            for (found, column) in [
                (orbit.joints[0].dissipation, "friction_loss_J"),
                (orbit.energy.work_in, "work_in_J"),
                (orbit.energy.viscous, "viscous_loss_J"),
            ] {
                worst_loss = worst_loss.max((found / number(row, column) - 1.0).abs());
                close(column, found, number(row, column), losses);
            }
            let largest = orbit.multipliers().unwrap()[0].norm();
            near("multiplier", largest, number(row, "largest_half_period_multiplier").powi(2), 1e-6);
        }
        println!("tolerance {tolerance:.0e}: amplitudes within {worst:.1e}, energies within {worst_loss:.1e} of SciPy");
    }
}

/// At the end of stick a step begins stiff and ends in slip. An error estimate that is filtered
/// by the start of the step alone accepts steps that jump over this, with an error of 8e-8
/// here. The reference is the orbit in much shorter steps.
#[test]
fn the_end_of_stick_is_not_jumped_over() {
    let system = couple(8.0, 25e3);
    let mut solver = Shooting { tolerance: 1e-8, ..Shooting::default() }.solver(&system).unwrap();
    let neighbour = solver.orbit(TAU * 120.9875).unwrap();
    let orbit = solver.orbit_near(TAU * 121.0, Some(&neighbour.seed())).unwrap();
    let reference = shoot(&system, TAU * 121.0, 1e-12);
    let pairs = orbit.places.iter().zip(&reference.places);
    let worst = pairs.map(|(a, b)| (a.amplitude() / b.amplitude() - 1.0).abs()).fold(0.0, f64::max);
    println!("amplitudes within {worst:.1e} of those in short steps");
    assert!(worst < 1e-8, "{worst}");
}

/// The slip fraction does not depend on the ends of the steps, because changes are located
/// inside the steps. The reference has much shorter steps.
#[test]
fn slip_fractions_do_not_depend_on_the_steps() {
    let (mut worst, mut changing) = (0.0f64, 0);
    for ft in [2.0, 4.0, 8.0] {
        let system = couple(ft, 25e3);
        for hertz in [119.7, 120.6, 121.0, 121.9] {
            let [slips, reference] =
                [1e-8, 1e-12].map(|tolerance| shoot(&system, TAU * hertz, tolerance).joints[0].slip_fraction);
            changing += usize::from((0.05..0.999).contains(&reference));
            worst = worst.max((slips - reference).abs());
        }
    }
    println!("slip fractions within {worst:.1e}, {changing} of them of joints that stick and slip");
    assert!(changing > 4, "{changing}");
    assert!(worst < 1e-5, "{worst}");
}

/// The paper's alpha on every point of Fig. 6, with warm starts, without a failure.
#[test]
fn figure_6_converges_on_every_point() {
    let (mut points, mut residual, mut gap, mut iterations) = (0, 0.0f64, 0.0f64, 0);
    for ft in [2.0, 4.0, 6.0, 8.0] {
        let system = couple(ft, 25e3);
        let mut solver = Shooting::default().solver(&system).unwrap();
        let mut start: Option<Seed> = None;
        for i in 0..241 {
            let hertz = 119.5 + f64::from(i) / 80.0;
            let orbit =
                solver.orbit_near(TAU * hertz, start.as_ref()).unwrap_or_else(|e| panic!("{ft} N, {hertz} Hz: {e}"));
            residual = residual.max(orbit.evidence.residual);
            gap = gap.max(orbit.evidence.energy_gap);
            iterations += orbit.evidence.iterations;
            points += 1;
            start = Some(orbit.seed());
        }
    }
    println!("{points} points, residual {residual:.1e}, gap {gap:.1e}, {iterations} iterations");
    assert!(points == 4 * 241 && residual < 1e-9 && gap < 1e-6, "{residual} {gap}");
}

/// Every tenth point of Fig. 6 without a warm start gives the same orbits.
#[test]
fn figure_6_does_not_depend_on_the_start() {
    let mut worst = 0.0f64;
    for ft in [2.0, 4.0, 6.0, 8.0] {
        let system = couple(ft, 25e3);
        let mut solver = Shooting::default().solver(&system).unwrap();
        let mut start: Option<Seed> = None;
        for i in (0..241).step_by(10) {
            let omega = TAU * (119.5 + f64::from(i) / 80.0);
            let (warm, cold) = (solver.orbit_near(omega, start.as_ref()).unwrap(), solver.orbit(omega).unwrap());
            for (a, b) in warm.places.iter().zip(&cold.places) {
                worst = worst.max((a.amplitude() / b.amplitude() - 1.0).abs());
            }
            start = Some(warm.seed());
        }
    }
    println!("warm and cold starts differ by {worst:.1e}");
    assert!(worst < 1e-6, "{worst}");
}

/// The smooth orbit tends to the exact one as alpha grows, with order 1 without stick and 2/3
/// with stick.
///
/// In slip the force is too small by `2/(π alpha v)` of the limit. This is an impulse of order
/// 1/alpha, with log(alpha) from the reversals, where v grows as the time t since the reversal.
/// At the end of stick the load exceeds the limit as t, and v grows only as t². Slip therefore
/// takes over at t³ ~ 1/alpha. Until then the force has an error of order t, which is an
/// impulse of order t² ~ alpha^(-2/3).
#[test]
fn smooth_orbit_tends_to_the_exact_one() {
    for (ft, hertz, alphas, order) in [
        (2.0, 121.25, &[25e3, 25e4, 25e5][..], 1.0),
        (4.0, 120.75, &[25e3, 25e4, 25e5, 25e6][..], 2.0 / 3.0),
        (8.0, 121.0, &[25e3, 25e4, 25e5, 25e6][..], 2.0 / 3.0),
        (6.0, 121.1, &[25e3, 25e4, 25e5, 25e6][..], 2.0 / 3.0),
    ] {
        let omega = TAU * hertz;
        let reference = exact(&template("blade-couple", &[("Ft", ft)]), omega);
        assert_eq!(reference.joints[0].slip_fraction < 1.0 - 1e-9, order < 1.0);
        let distance = |alpha: f64| {
            let orbit = shoot(&couple(ft, alpha), omega, 1e-11);
            let pairs = orbit.places.iter().zip(&reference.places);
            pairs
                .map(|(s, e)| (s.first_harmonic - e.first_harmonic).norm() / e.first_harmonic.norm())
                .fold(0.0, f64::max)
        };
        let errors: Vec<f64> = alphas.iter().map(|alpha| distance(*alpha)).collect();
        let orders: Vec<f64> = errors.windows(2).map(|pair| (pair[0] / pair[1]).log10()).collect();
        println!("{ft} N, {hertz} Hz: alpha 25e3 s/m and up: errors {errors:?}, orders {orders:?}");
        for measured in orders {
            near(&format!("order at {ft} N, {hertz} Hz"), measured, order, 0.03);
        }
    }
}

/// The option `width` of the method makes the same smooth law from the exact one.
#[test]
fn width_is_one_over_alpha() {
    let system = template("blade-couple", &[("Ft", 4.0)]);
    let method = Shooting { tolerance: 1e-9, width: Some(1.0 / 25e3), ..Shooting::default() };
    let smoothed = method.solver(&system).unwrap().orbit(TAU * 120.75).unwrap();
    let smooth = shoot(&couple(4.0, 25e3), TAU * 120.75, 1e-9);
    for (a, b) in smoothed.places.iter().zip(&smooth.places) {
        close("amplitude", a.amplitude(), b.amplitude(), 1e-12);
    }
}

/// Method `transient` finds the orbit of Newton's method within its own error estimate, for the
/// smooth and the exact law.
#[test]
fn settling_agrees_with_newton_within_its_own_estimate() {
    for (smooth, omega) in [(false, TAU * 120.75), (true, TAU * 121.25)] {
        let system = if smooth { couple(4.0, 25e3) } else { template("blade-couple", &[("Ft", 4.0)]) };
        let waiting = Transient { tolerance: 1e-4, ..Transient::default() };
        let waited = waiting.solver(&system).unwrap().orbit(omega).unwrap();
        let found = if smooth {
            Shooting::default().solver(&system).unwrap().orbit(omega).unwrap()
        } else {
            EventDriven.solver(&system).unwrap().orbit(omega).unwrap()
        };
        let missing = waited.evidence.error_estimate.unwrap();
        assert!(missing <= 1e-4, "{missing}");
        for (waited, found) in waited.places.iter().zip(&found.places) {
            let error = (waited.amplitude() / found.amplitude() - 1.0).abs();
            // the estimate is for the whole state in the energy norm; a light place may have a
            // larger error
            assert!(error < 10.0 * missing, "{}: {error:e} against {missing:e}", found.name);
        }
    }
}
