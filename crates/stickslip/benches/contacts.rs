//! Contact nodes of three directions on a block of steel, all coupled through it: time per point of a resonance curve by their number.
//!
//! `cargo bench -p stickslip --bench contacts [-- NODES[:DOFS]…]`; without a number of degrees of freedom the block is 12 elements long.

#![allow(clippy::print_stdout)] // a bench prints its result

#[path = "../tests/reduction/brick.rs"]
mod brick;

use brick::Brick;
use num_complex::Complex64;
use std::sync::Arc;
use stickslip::law::FrictionContact;
use stickslip::method::{Method, harmonic_balance::HarmonicBalance};
use stickslip::model::{Axis, System};
use stickslip::structure::Structure;
use stickslip::structure::reduction::{Damping, Free, Whole};

/// Modes that are kept, beside the residual vectors of the contacts.
const MODES: usize = 20;
const HARMONICS: usize = 5;
const POINTS: usize = 25;

fn main() {
    let number = |a: &str| a.parse::<usize>().ok();
    let asked = |a: String| match a.split_once(':') {
        Some((nodes, dofs)) => Some((number(nodes)?, number(dofs)?)),
        None => Some((number(&a)?, 0)),
    };
    let rows: Vec<_> = std::env::args().skip(1).filter_map(asked).collect();
    let rows = if rows.is_empty() { vec![(10, 0), (30, 0), (100, 0)] } else { rows };
    rows.into_iter().for_each(|(nodes, dofs)| row(nodes, dofs));
}

fn row(nodes: usize, dofs: usize) {
    let edge = ((nodes as f64).sqrt().ceil() as usize).max(6);
    let long = dofs.div_ceil(3 * edge * edge).max(12);
    let begin = seconds();
    let brick = Brick::new([long, edge - 1, edge - 1], [0.2, 0.08, 0.06], true);
    let ports = brick.face(nodes);
    let axes = ports.len();
    let damping = Damping::Ratio { ratio: 0.005, up_to: 4e4 };
    let whole = Whole::new(brick.mass.clone(), damping, brick.stiffness.clone(), ports).unwrap();
    let modes = whole.modes(8e4).unwrap();
    println!("{nodes} nodes: matrices and modes in {:.1} s, {}", seconds() - begin, memory());
    let first = modes.values[0].sqrt();
    let begin = seconds();
    let free = Free::new(&whole, &modes, 0.0, 1).unwrap();
    let reduced = free.reduced(MODES.min(free.modes()), 1).unwrap();
    println!(
        "  {} dofs, {} modes, first {:.0} rad/s, reduced to {} in {:.1} s, {}",
        brick.dofs(),
        free.modes(),
        first,
        reduced.dofs(),
        seconds() - begin,
        memory()
    );
    let begin = seconds();
    let names = (0..reduced.dofs()).map(|i| format!("q{i}")).collect();
    let structure =
        Structure::new(names, reduced.mass.clone(), reduced.damping.clone(), reduced.stiffness.clone()).unwrap();
    let row = |axis: usize| Axis::new((0..reduced.dofs()).map(|k| (k, reduced.ports[(axis, k)])).collect());
    // stiff beside the block's first mode, together
    let stiffness = 4.0 * reduced.stiffness[(0, 0)]
        / (reduced.ports[(0, 0)].abs().max(reduced.ports[(1, 0)].abs()).max(reduced.ports[(2, 0)].abs()).powi(2)
            * nodes as f64);
    let mut builder = System::builder(structure);
    let load = 100.0;
    for node in 0..axes / 3 {
        let [x, y, z] = [0, 1, 2].map(|d| 3 * node + d);
        let law = FrictionContact {
            tangential: stiffness,
            normal: stiffness,
            friction: 0.3,
            preload: load / nodes as f64,
            tangents: 2,
        };
        builder = builder.joint(format!("c{node}"), Arc::new(law), vec![row(y), row(z), row(x)]);
    }
    for k in 0..reduced.dofs() {
        let f = 8.0 * (reduced.ports[(1, k)] + 0.5 * reduced.ports[(2, k)]);
        builder = builder.force(k, 1, Complex64::new(f, 0.0));
    }
    let system = builder.build().unwrap();
    println!("  system in {:.1} s, {}", seconds() - begin, memory());
    let method = HarmonicBalance { harmonics: Some(HARMONICS), ..HarmonicBalance::default() };
    let begin = seconds();
    let mut solver = method.solver(&system).unwrap();
    println!("  solver in {:.2} s, {}", seconds() - begin, memory());
    let mut start: Option<Vec<f64>> = None;
    for i in 0..POINTS {
        let omega = first * (0.8 + 1.2 * i as f64 / (POINTS - 1) as f64);
        let begin = seconds();
        match solver.orbit(omega, start.as_deref()) {
            Ok(orbit) => {
                let slip = orbit.joints.iter().map(|j| j.slip_fraction).sum::<f64>() / nodes as f64;
                println!(
                    "  {:8.1} rad/s: {:8.4} s, {} iterations, slip {:.2}, truncation {:?}",
                    omega,
                    seconds() - begin,
                    orbit.evidence.iterations,
                    slip,
                    orbit.evidence.truncation
                );
                start = Some(orbit.start);
            }
            Err(error) => println!("  {omega:8.1} rad/s: {:.4} s, {error}", seconds() - begin),
        }
    }
}

/// The most memory that was held.
fn memory() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let most = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or("").trim();
    format!("{most} at most")
}

/// Seconds of this processor, so that other work on the machine does not count.
fn seconds() -> f64 {
    let ran = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    ran.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).map_or(0.0, |ns| 1e-9 * ns)
}
