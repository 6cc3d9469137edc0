//! Den Hartog's oscillator, `m x'' + k x + F Sgn x' = P cos(Ωt)`, with the exact law: theory
//! section 7.
//!
//! `r = Ω √(m/k)`, `beta = F/P`. Source: Den Hartog, "Forced vibrations with combined Coulomb
//! and viscous friction" (1931).

#![allow(clippy::print_stdout)] // tests print measured values

use std::f64::consts::{FRAC_PI_4, PI};
use std::sync::Arc;
use stickslip::law::{Coulomb, Jenkins};
use stickslip::method::time_history::{Excitation, TimeHistory};
use stickslip::model::{Force, GROUND, Joint, Mass, Model, Motion, Spring};
use stickslip::orbit::{Orbit, Symmetry};
use stickslip_verification::{close, exact, integral, maximum, near, zero};

/// Slip limits and frequencies inside the region without stops, away from r = 1/2, 1/3, 1/4, …
/// (theory 7.6).
const CASES: [(f64, f64); 9] =
    [(0.2, 0.8), (0.5, 0.8), (0.5, 1.2), (0.7, 1.2), (0.1, 0.4), (0.6, 0.7), (0.5, 3.0), (0.5, 2.0), (0.78, 0.99)];

fn oscillator(m: f64, k: f64, limit: f64) -> Model {
    Model {
        masses: vec![Mass::new("m", m)],
        springs: vec![Spring { between: ["m".into(), GROUND.into()], stiffness: k, damping: 0.0 }],
        joints: vec![Joint {
            name: "rub".into(),
            between: ["m".into(), GROUND.into()],
            law: Arc::new(Coulomb { limit }),
        }],
        ..Model::default()
    }
}

/// Returns the orbit with m = k = P = 1.
fn orbit(beta: f64, r: f64) -> Orbit {
    forced(1.0, 1.0, 1.0, beta, r)
}

fn forced(m: f64, k: f64, p: f64, beta: f64, r: f64) -> Orbit {
    let mut model = oscillator(m, k, beta * p);
    model.forces.push(Force { on: "m".into(), amplitude: p, phase: 0.0, harmonic: 1 });
    exact(&model.assemble().unwrap(), r * (k / m).sqrt())
}

/// Returns `U` and `V` of 7.2.
fn functions(r: f64) -> (f64, f64) {
    ((PI / (2.0 * r)).tan() / r, 1.0 / (1.0 - r * r))
}

/// Returns the amplitude of 7.2 with m = k = P = 1.
fn amplitude(beta: f64, r: f64) -> f64 {
    let (u, v) = functions(r);
    (v * v - beta * beta * u * u).sqrt()
}

/// Returns `S` of 7.3: the maximum of its function on 0 < tau < pi, with the limit at 0.
fn s(r: f64) -> f64 {
    let tan = (PI / (2.0 * r)).tan();
    let f = |tau: f64| ((tau / r).sin() + tan * (tau.cos() - (tau / r).cos())) / (r * tau.sin());
    maximum(f, [1e-4, PI - 1e-4], 4000, 1e-10).1.max(1.0 / (r * r))
}

fn beta_max(r: f64) -> f64 {
    let (u, v) = functions(r);
    v.abs() / s(r).hypot(u)
}

#[test]
fn theory_7_1_motion_between_reversals() {
    for (beta, r) in CASES {
        let (orbit, x0) = (orbit(beta, r), amplitude(beta, r));
        let (u, v) = functions(r);
        // tau = 0 at the positive maximum; the phase of the force there is phi
        let phase = (-beta * u / x0 * (x0 / v)).atan2(x0 * (x0 / v) / x0);
        for i in 0..=100 {
            let tau = f64::from(i) / 100.0 * PI;
            let x = beta * (1.0 - (tau / r).cos()) - beta * (PI / (2.0 * r)).tan() * (tau / r).sin()
                + x0 * tau.cos()
                + beta * u * tau.sin();
            let sample = orbit.sample((tau + phase) / r);
            near(&format!("x(tau) at beta {beta}, r {r}, tau {tau}"), sample.displacement[0], x, 1e-9 * x0);
        }
    }
}

#[test]
fn theory_7_2_amplitude_and_phase() {
    for (beta, r) in CASES {
        let (orbit, x0) = (orbit(beta, r), amplitude(beta, r));
        assert_eq!((orbit.evidence.switches, orbit.symmetry), (2, Symmetry::HalfPeriod));
        close("amplitude", orbit.places[0].maximum, x0, 1e-8);
        near("one minus slip fraction", orbit.joints[0].slip_fraction, 1.0, 1e-12);
        // phase of the maximum: the reversal in the first half period, or half a period later
        let (u, v) = functions(r);
        let (cos, sin) = (x0 / v, -beta * u / v);
        let time = sin.atan2(cos).rem_euclid(2.0 * PI) / r;
        let nearest = orbit.transition_times().iter().map(|t| (t - time).abs()).fold(f64::INFINITY, f64::min);
        near("instant of the maximum", nearest, 0.0, 1e-8);
    }
    // reference values of section 7
    for (beta, r, x0) in [(0.2, 0.8, 2.7114152554), (0.5, 0.8, 2.3322349875), (0.5, 1.2, 1.6574674711)] {
        near("printed amplitude", orbit(beta, r).places[0].maximum, x0, 0.5e-10);
    }
    // other units: x0 scales with P/k
    close(
        "other units",
        forced(0.3, 2000.0, 7.0, 0.5, 0.8).places[0].maximum,
        7.0 / 2000.0 * amplitude(0.5, 0.8),
        1e-9,
    );
}

#[test]
fn theory_7_3_no_stop_limits() {
    let printed = [(0.4, 0.143890), (0.7, 0.722071), (0.8, 0.817406), (1.2, 0.713207), (2.0, 0.596285), (3.0, 0.5625)];
    for (r, printed) in printed {
        let limit = beta_max(r);
        near("printed limit", limit, printed, 0.6e-6);
        // stops begin at the closed-form limit: orbits just below have no stop, orbits just
        // above have two or more per period
        let (below, above) = (orbit(limit * (1.0 - 1e-6), r), orbit(limit * (1.0 + 1e-6), r));
        assert_eq!(below.evidence.switches, 2, "r {r}");
        assert!(above.evidence.switches > 2 && above.joints[0].slip_fraction < 1.0, "r {r}: {above:?}");
        let found = zero(
            |beta| if orbit(beta, r).evidence.switches == 2 { 1.0 } else { -1.0 },
            [limit * (1.0 - 1e-5), limit * (1.0 + 1e-5)],
        );
        println!("r {r}: no stop up to {limit:.12}, bisected {found:.12}, {:.1e}", (found / limit - 1.0).abs());
        close("limit by bisection", found, limit, 1e-8);
        if r >= 0.5 {
            close("S = 1/r^2", s(r), 1.0 / (r * r), 1e-12);
        }
    }
    close("r = 3 is 9/16", beta_max(3.0), 9.0 / 16.0, 1e-12);
    close("r to infinity", beta_max(1e4), 1.0 / (1.0 + (PI / 2.0).powi(2)).sqrt(), 1e-7);
}

#[test]
fn theory_7_4_friction_loss() {
    for (beta, r) in CASES {
        let orbit = orbit(beta, r);
        let expected = 4.0 * beta * amplitude(beta, r);
        close("loss", orbit.joints[0].dissipation, expected, 1e-8);
        close("work in", orbit.energy.work_in, expected, 1e-8);
        close("work in from the first harmonic", -PI * orbit.places[0].first_harmonic.im, expected, 1e-8);
    }
    // towards resonance without stops: below beta = pi/4 the amplitude grows without bound;
    // above it, no such motion exists
    for r in [0.99, 0.999, 0.9999, 1.0001, 1.001] {
        let (u, v) = functions(r);
        near("limit of boundedness", (v / u).abs(), FRAC_PI_4, 0.6 * (1.0 - r).abs());
        close("amplitude near resonance", orbit(0.5, r).places[0].maximum, amplitude(0.5, r), 1e-8);
        assert!(amplitude(0.9, r).is_nan());
        let stops = orbit(0.9, r);
        assert!(stops.joints[0].slip_fraction < 1.0 && stops.places[0].maximum < 10.0, "{stops:?}");
    }
}

#[test]
fn theory_7_5_determinant_of_the_return_map() {
    for (beta, r) in CASES {
        let (orbit, x0) = (orbit(beta, r), amplitude(beta, r));
        let map = &orbit.return_map;
        let determinant = map[(0, 0)] * map[(1, 1)] - map[(0, 1)] * map[(1, 0)];
        close("determinant", determinant, (x0 * r * r - beta) / (x0 * r * r + beta), 1e-8);
        // both multipliers of the full period have the modulus |det|: they are the squares of a
        // pair of equal modulus over half a period
        let multipliers = orbit.multipliers().unwrap();
        close("product", (multipliers[0] * multipliers[1]).re, determinant * determinant, 1e-8);
        if multipliers[0].im != 0.0 {
            close("modulus", multipliers[0].norm(), determinant, 1e-8);
        }
        assert_eq!(orbit.is_stable(), Some(true));
    }
    let orbit = orbit(0.5, 0.8);
    let map = &orbit.return_map;
    near("printed", map[(0, 0)] * map[(1, 1)] - map[(0, 1)] * map[(1, 0)], 0.49815078, 0.5e-8);
}

/// The base moves by `Y cos(Ωt)`, with friction against the base. The relative motion obeys the
/// same equation with `P = m Ω² Y`. Source: Hundal (1979).
#[test]
fn theory_7_base_excitation() {
    for (beta, r, y) in [(0.5, 0.8, 0.01), (0.4, 1.3, 0.02), (0.5, 2.5, 0.01)] {
        let (m, k) = (2.0f64, 50.0f64);
        let omega = r * (k / m).sqrt();
        let p = m * omega * omega * y;
        let model = Model {
            masses: vec![Mass::new("m", m)],
            springs: vec![Spring { between: ["m".into(), "base".into()], stiffness: k, damping: 0.0 }],
            joints: vec![Joint {
                name: "rub".into(),
                between: ["m".into(), "base".into()],
                law: Arc::new(Coulomb { limit: beta * p }),
            }],
            motions: vec![Motion { on: "base".into(), amplitude: y, phase: 0.0, harmonic: 1 }],
            ..Model::default()
        };
        let orbit = exact(&model.assemble().unwrap(), omega);
        let x0 = p / k * amplitude(beta, r);
        close("relative amplitude", orbit.joints[0].displacement[0].1, x0, 1e-8);
        close("loss", orbit.joints[0].dissipation, 4.0 * beta * p * x0, 1e-8);
        close("work of the base", orbit.energy.work_in, orbit.joints[0].dissipation, 1e-8);
    }
}

/// Free decay: each half cycle of duration π √(m/k) lowers the turning point by `2 F/k`, until
/// the mass stops within `F/k`.
#[test]
fn theory_7_free_decay() {
    let (m, k, limit, x0) = (0.7f64, 30.0f64, 0.9, 0.5);
    let xf = limit / k;
    let half = PI * (m / k).sqrt();
    let mut model = oscillator(m, k, limit);
    model.forces.clear();
    let system = model.assemble().unwrap();
    let motion = TimeHistory {
        displacement: vec![x0],
        velocity: vec![0.0],
        states: Vec::new(),
        excitation: Excitation::Free,
        duration: 20.0 * half,
        step: half,
        width: None,
        tolerance: None,
    };
    let mut found = Vec::new();
    motion
        .run(&system, &mut |_, _, state| {
            found.push((state.displacement[0], state.velocity[0]));
            true
        })
        .unwrap();
    let (mut expected, mut stops) = (x0, 0);
    for (i, (x, v)) in found.iter().enumerate() {
        near(&format!("turning point {i}"), *x, expected, 1e-12 * x0);
        near(&format!("velocity at turning point {i}"), *v, 0.0, 1e-10 * x0 * (k / m).sqrt());
        if expected.abs() > xf {
            expected = -(expected.abs() - 2.0 * xf) * expected.signum();
        } else {
            stops += 1;
        }
    }
    assert!(found.len() >= 20 && stops > 10, "{} {stops}", found.len());
}

/// Relative error of the closed forms for the ringing spring: twice the fall of the holding
/// force over one ring; a stick has a hundred rings or more.
const RINGS: f64 = 0.02;

/// (11.12): a stiff spring in series with the slider rings during stick, and tends slowly to
/// rigid friction.
///
/// Rigid friction holds with `R = P cos(Ωt) - k x₀` until `R = -F`. The limit cuts a ring about
/// this force, so its amplitude is `a = F + R` while R falls. The velocity is `a/√(kt m)`, of
/// order `kt^-1/2`. From ring to ring R falls by `δ = |R'| 2π/w` with `w = √(kt/m)`. The
/// fraction `√(2δ/a)/2π` of each ring slips, of order `kt^-1/4`.
#[test]
fn theory_11_12_a_stiff_spring_rings_in_stick() {
    let (limit, omega) = (0.6, 0.4);
    let rigid = orbit(limit, omega);
    let (amplitude, slips) = (rigid.places[0].amplitude(), rigid.joints[0].slip_fraction);
    let hold = |phase: f64| phase.cos() - amplitude;
    let end = (amplitude - limit).acos();
    let begin = end - PI * (1.0 - slips);
    // R hardly rises after the first contact, so the limit cuts all rings
    assert!(begin < 0.0 && hold(0.0) - hold(begin) < 1e-3, "{begin}");
    let mut shares = Vec::new();
    for stiffness in [1e5f64, 1e6] {
        let mut model = oscillator(1.0, 1.0, limit);
        model.joints[0].law = Arc::new(Jenkins { stiffness, limit });
        model.forces.push(Force { on: "m".into(), amplitude: 1.0, phase: 0.0, harmonic: 1 });
        let elastic = exact(&model.assemble().unwrap(), omega);
        let ring = 2.0 * PI / stiffness.sqrt();
        let share = |phase: f64| (2.0 * omega * phase.sin() * ring / (limit + hold(phase))).sqrt() / (2.0 * PI);
        // integrate over the root of the phase to the end of stick, because the slip fraction
        // is unbounded there
        let expected = integral(|root| 2.0 * root * share(end - root * root), end.sqrt(), &[]) / PI;
        let found = elastic.joints[0].slip_fraction - slips;
        close("share that slips in stick", found, expected, RINGS);
        shares.push(found);
        let middle = 0.5 * end;
        let speeds =
            (0..=2000).map(|i| elastic.sample(middle / omega + ring * f64::from(i) / 2000.0).velocity[0].abs());
        let speed = (limit + hold(middle)) / stiffness.sqrt();
        close("velocity in stick", speeds.fold(0.0, f64::max), speed, RINGS);
    }
    close("fall over a decade", shares[0] / shares[1], 10f64.powf(0.25), RINGS);
}
