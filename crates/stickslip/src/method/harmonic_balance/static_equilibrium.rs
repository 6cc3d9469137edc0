//! Static equilibrium under the constant loads, where every vibration begins.
//!
//! Constant forces, preloads and constant imposed motions grow together from zero. Every joint
//! moves along a straight path from its unloaded state to its place in equilibrium, and slips
//! if its limit asks for it:
//!
//! `K x + W f(0 → Wᵀx) = F₀`
//!
//! This is harmonic balance with harmonic 0 alone, solved by the same Newton iteration.
//! Contacts without a fixed slip limit are homogeneous of degree one, and for them the straight
//! path is the exact result of the ramp. The position of each slider is kept: a permanently
//! stuck contact keeps its static friction force, and the mean friction force of a slipping
//! contact follows from it.
//!
//! Sources: Siewert, Panning, Wallaschek, Richter (2010); Zucca, Firrone, Gola (2012).

use super::aft::{Ports, StaticState};
use super::dynamics::banded::BandedForm;
use super::dynamics::linear_dynamics::LinearDynamics;
use super::equations::{Discretization, HarmonicSolution, ProximalSprings};
use super::postprocess;
use crate::model::System;
use crate::orbit::Orbit;
use std::sync::Arc;

/// Newton iterations. Each may change which joints slip; a handful of changes are usual.
const ITERATIONS: usize = 60;
/// Largest number of proximal points.
const POINTS: usize = 60;
/// Stiffness of the springs of the first proximal point, relative to closed contacts. Nothing
/// slides far at that point.
const FIRST_STIFFNESS: f64 = 1.0;
/// Number of samples of a constant motion.
const SAMPLES: usize = 8;

/// Returns the static equilibrium of a system. Returns `None` as [`static_equilibrium`] does, and
/// for laws that harmonic balance does not take.
pub(crate) fn static_equilibrium_of(system: &System) -> Option<SolvedEquilibrium> {
    let (ports, ring_ports) = Ports::for_sector(system).ok()?;
    let system = Arc::new(system.clone());
    [Regularization::Exact, Regularization::Robust].into_iter().find_map(|regularization| {
        // whether contacts alone hold a body is decided once, at the rate of the regularization
        let dynamics = LinearDynamics::new(&system, &ports);
        static_equilibrium(&system, (&ports, ring_ports.as_ref()), &dynamics, regularization)
    })
}

/// Static equilibrium of a system.
pub(crate) struct SolvedEquilibrium {
    /// The equilibrium as an orbit at rest.
    pub orbit: Orbit,
    /// Displacements and states of each port.
    pub(super) states: Vec<StaticState>,
}

/// Springs that regularize rigid-body motions. They are proportional to the square of a rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Regularization {
    /// A thousandth of the rate of the structure: the result is exact to rounding.
    Exact,
    /// The rate of the structure: such motions are found also in matrices whose rounding holds
    /// them. In a structure of many small masses on stiff springs, the springs carry some per cent
    /// of the load, and the iteration may fail.
    Robust,
}

/// Returns the static equilibrium. Returns `None` if the iteration finds none, for example if no
/// joint and no spring carries a constant load.
pub(super) fn static_equilibrium(
    system: &Arc<System>,
    (ports, ring_ports): (&Ports, Option<&Ports>),
    dynamics: &LinearDynamics,
    regularization: Regularization,
) -> Option<SolvedEquilibrium> {
    let omega = match regularization {
        Regularization::Exact => 1e-3 * characteristic_rate(system),
        Regularization::Robust => characteristic_rate(system),
    };
    let harmonics = vec![0];
    let banded = BandedForm::new(system, ports, &harmonics);
    let mut discretization = Discretization::new(harmonics, SAMPLES, ports, banded);
    discretization.set_frequency(system, ports, dynamics, omega).ok()?;
    let mut solution = discretization.static_solution(1.0);
    solve_static(&mut discretization, ports, omega, &mut solution)?;
    let states = (0..ports.len()).map(|p| discretization.initial_state_of(ports, p, omega, &solution)).collect();
    let x = postprocess::places(&mut discretization, dynamics, omega, &solution).ok()?;
    let setting = postprocess::OrbitInput {
        system,
        ports,
        dynamics,
        ring_ports,
        omega,
        excitation_harmonic: 1,
        half_period: false,
        truncation: None,
        tolerance: 0.0,
        orbit_check: None,
    };
    let orbit = postprocess::orbit(setting, &mut discretization, &solution, x)?;
    Some(SolvedEquilibrium { orbit, states })
}

/// Newton's method from `solution` and from stuck joints, then the homotopy in the slip limits,
/// then the proximal point method if only contacts support a body.
///
/// Each proximal point is the equilibrium of the structure on springs that tie it to the
/// previous point. The springs become softer after each success. A body may so slide far along
/// a soft direction and turn slightly between its contacts. The path is that of an overdamped
/// structure that sinks under its load.
///
/// Source: Rockafellar, "Monotone operators and the proximal point algorithm" (1976).
fn solve_static(
    discretization: &mut Discretization,
    ports: &Ports,
    omega: f64,
    solution: &mut HarmonicSolution,
) -> Option<()> {
    let begin = solution.clone();
    if discretization.newton_from(ports, omega, solution, ITERATIONS).is_ok() {
        return Some(());
    }
    // with all joints stuck
    *solution = HarmonicSolution::zero(begin.c.len());
    if discretization.newton_from(ports, omega, solution, ITERATIONS).is_ok() {
        return Some(());
    }
    *solution = begin.clone();
    discretization.begin_search(ports);
    if discretization.slip_limit_homotopy(ports, omega, solution).is_ok() {
        return Some(());
    }
    if !discretization.is_held_by_contacts() {
        return None;
    }
    *solution = begin;
    let (mut share, mut softer) = (FIRST_STIFFNESS, 0.1f64);
    for _ in 0..POINTS {
        let anchor = solution.c.iter().map(|c| c.re).collect();
        discretization.search.tether = Some(ProximalSprings { relative_stiffness: share, anchor });
        let mut next = solution.clone();
        let tied = discretization.newton_from(ports, omega, &mut next, ITERATIONS).is_ok();
        discretization.search.tether = None;
        if !tied {
            if share >= FIRST_STIFFNESS {
                return None;
            }
            share /= softer;
            softer = softer.sqrt();
            continue;
        }
        *solution = next.clone();
        if discretization.newton_from(ports, omega, &mut next, ITERATIONS).is_ok() {
            *solution = next;
            return Some(());
        }
        share *= softer;
    }
    None
}

/// Returns a rate of the system, 1/s, from its largest stiffness and mass. Equations at rest
/// need one.
fn characteristic_rate(system: &System) -> f64 {
    let [mass, _, stiffness] = system.structure().largest();
    let rate = (stiffness / mass).sqrt();
    if rate.is_finite() && rate > 0.0 { rate } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{FrictionContact, Gap};
    use crate::model::Axis;
    use crate::structure::Structure;
    use nalgebra::{DMatrix, DVector};
    use num_complex::Complex64;

    const TANGENTIAL: f64 = 15e6;
    const NORMAL: f64 = 20e6;
    const ANGLE: f64 = 40.0;

    /// Returns half of a wedge of 6 g. A load along z presses it against one rigid face at
    /// [`ANGLE`] to z. By symmetry its x is zero.
    fn wedge(load: f64, friction: f64) -> Arc<System> {
        let one = DMatrix::identity(1, 1);
        let structure =
            Structure::new(vec!["z".into()], &one * 0.006, DMatrix::zeros(1, 1), DMatrix::zeros(1, 1)).unwrap();
        let law = FrictionContact { tangential: TANGENTIAL, normal: NORMAL, friction, preload: 0.0, tangents: 1 };
        let (sine, cosine) = ANGLE.to_radians().sin_cos();
        let axes = vec![Axis::new(vec![(0, cosine)]), Axis::new(vec![(0, sine)])];
        let builder = System::builder(structure).joint("face", Arc::new(law), axes);
        let builder = builder.force(0, 0, Complex64::new(load, 0.0)).force(0, 1, Complex64::new(1.0, 0.0));
        Arc::new(builder.build().unwrap())
    }

    fn equilibrium(system: &Arc<System>) -> Option<SolvedEquilibrium> {
        let ports = Ports::new(system).unwrap();
        static_equilibrium(system, (&ports, None), &LinearDynamics::new(system, &ports), Regularization::Exact)
    }

    /// In stick, `z (kn sin² + kt cos²) = Q`. In slip, `z kn (sin² + µ sin cos) = Q`. The
    /// friction coefficient selects the case.
    #[test]
    fn the_equilibrium_of_a_wedge_is_exact() {
        let (sine, cosine) = ANGLE.to_radians().sin_cos();
        for (friction, sticks) in [(0.9, true), (0.25, false)] {
            let SolvedEquilibrium { orbit, states } = equilibrium(&wedge(500.0, friction)).unwrap();
            let by_friction = if sticks { TANGENTIAL * cosine * cosine } else { friction * NORMAL * sine * cosine };
            let z = 500.0 / (NORMAL * sine * sine + by_friction);
            assert!((orbit.places[0].mean / z - 1.0).abs() < 1e-9, "{} {z}", orbit.places[0].mean);
            let tangential = if sticks { TANGENTIAL * cosine * z } else { friction * NORMAL * sine * z };
            assert!((states[0].states[0] / tangential - 1.0).abs() < 1e-9, "{states:?} {tangential}");
            assert!((states[0].displacement[1] / (sine * z) - 1.0).abs() < 1e-9);
        }
    }

    /// Thirty masses on stiff springs stand on one contact. Springs that regularize their rigid
    /// motion at the rate of a stiff spring on one mass would carry 3 % of the load.
    #[test]
    fn a_body_of_many_stiff_parts_stands_on_its_contact() {
        let (parts, stiff, load) = (30, 1e14, 500.0);
        let coupling = |i: usize, j: usize| match i.abs_diff(j) {
            0 if i == 0 || i == parts - 1 => stiff,
            0 => 2.0 * stiff,
            1 => -stiff,
            _ => 0.0,
        };
        let stiffness = DMatrix::from_fn(parts, parts, coupling);
        let mass = DMatrix::identity(parts, parts) / parts as f64;
        let names = (0..parts).map(|i| i.to_string()).collect();
        let structure = Structure::new(names, mass, DMatrix::zeros(parts, parts), stiffness).unwrap();
        let axes = vec![Axis::new(vec![(parts - 1, 1.0)])];
        let builder = System::builder(structure).joint("foot", Arc::new(Gap { gap: 0.0, stiffness: NORMAL }), axes);
        let system = Arc::new(builder.force(parts - 1, 0, Complex64::new(load, 0.0)).build().unwrap());
        let found = equilibrium(&system).unwrap();
        let depth = found.states[0].displacement[0];
        assert!((depth * NORMAL / load - 1.0).abs() < 1e-4, "{}", depth * NORMAL / load);
    }

    /// A spring holds a body along one direction, a contact along the other. The projection of a
    /// mesh leaves a stiffness of 1e-14 of the largest there, which would hold the body 400 km
    /// away.
    #[test]
    fn rounding_of_the_stiffness_holds_no_body() {
        let (stiff, load) = (1e10, 40.0);
        let (sine, cosine) = ANGLE.to_radians().sin_cos();
        let (held, free) = (DVector::from_vec(vec![cosine, sine]), DVector::from_vec(vec![-sine, cosine]));
        let stiffness = &held * held.transpose() * stiff + &free * free.transpose() * (1e-14 * stiff);
        let mass = DMatrix::identity(2, 2) * 0.01;
        let structure = Structure::new(vec!["x".into(), "z".into()], mass, DMatrix::zeros(2, 2), stiffness).unwrap();
        let axis = Axis::new(vec![(0, free[0]), (1, free[1])]);
        let builder =
            System::builder(structure).joint("foot", Arc::new(Gap { gap: 0.0, stiffness: NORMAL }), vec![axis]);
        let builder = (0..2).fold(builder, |builder, row| builder.force(row, 0, Complex64::new(load * free[row], 0.0)));
        let found = equilibrium(&Arc::new(builder.build().unwrap())).unwrap();
        let depth = found.states[0].displacement[0];
        assert!((depth * NORMAL / load - 1.0).abs() < 1e-9, "{depth}");
    }

    /// A load that pulls the wedge out has no equilibrium.
    #[test]
    fn an_unsupported_load_has_no_equilibrium() {
        assert!(equilibrium(&wedge(-500.0, 0.25)).is_none());
    }
}
