//! Resonance curves of contact nodes with three directions on a steel block, which couples all
//! of them, by number of nodes.
//!
//! `cargo bench -p stickslip --bench contacts [-- NODES[,NODES…][:DOFS]…]`. Without DOFS, the
//! block is 12 elements long. Its cross-section has room for the largest number of nodes in a
//! group, so that all curves of the group use the same block. The last line of a group is the
//! exponent of the time per point over the number of nodes.

#![allow(clippy::print_stdout)] // a bench prints its result

#[path = "../tests/it/reduction/brick.rs"]
mod brick;

use brick::Brick;
use num_complex::Complex64;
use std::collections::BTreeMap;
use std::sync::Arc;
use stickslip::law::FrictionContact;
use stickslip::method::{Method, harmonic_balance::HarmonicBalance};
use stickslip::model::{Axis, System};
use stickslip::orbit::{JointMotion, Orbit};
use stickslip::structure::Structure;
use stickslip::structure::reduction::{FullStructure, RubinBasis, StructureDamping};

/// Number of retained modes, in addition to the residual vectors of the contacts.
const MODES: usize = 20;
const HARMONICS: usize = 5;
const POINTS: usize = 21;
/// Error of five harmonics for such a motion.
const TOLERANCE: f64 = 0.01;
/// Total contact force, N, and the force on the first node, across and along the normal, which
/// slides and tilts the face.
const PRELOAD: f64 = 100.0;
const FORCE: [f64; 3] = [120.0, 30.0, 15.0];
/// Frequency range, in multiples of the first frequency of the block without contacts. At the
/// resonance, all contacts slip, and many separate.
const RANGE: [f64; 2] = [0.9, 1.7];

fn main() {
    let number = |a: &str| a.parse::<usize>().ok();
    let asked = |a: String| {
        let (nodes, dofs) = a.split_once(':').unwrap_or((&a, "0"));
        Some((nodes.split(',').map(number).collect::<Option<Vec<_>>>()?, number(dofs)?))
    };
    let blocks: Vec<_> = std::env::args().skip(1).filter_map(asked).collect();
    let blocks = if blocks.is_empty() { vec![(vec![10, 30, 100], 0)] } else { blocks };
    blocks.into_iter().for_each(|(nodes, dofs)| block(&nodes, dofs));
}

/// Computes the curves of one block for each number of nodes.
fn block(nodes: &[usize], dofs: usize) {
    let most = nodes.iter().copied().max().unwrap_or(1);
    let edge = ((most as f64).sqrt().ceil() as usize).max(6);
    let long = dofs.div_ceil(3 * edge * edge).max(12);
    let brick = Brick::new([long, edge - 1, edge - 1], [0.2, 0.08, 0.06], true);
    println!("{} degrees of freedom, {HARMONICS} harmonics, {POINTS} points", brick.dofs());
    let points: Vec<_> = nodes.iter().map(|&nodes| (nodes as f64, curve(&brick, nodes))).collect();
    if points.len() > 1 {
        println!("time of a point grows with the nodes to the power of {:.2}", exponent(&points));
    }
}

/// Returns the reduced block with this number of nodes, and its first frequency without
/// contacts, rad/s.
fn system(brick: &Brick, nodes: usize) -> (System, f64) {
    forget_memory();
    let begin = seconds();
    let ports = brick.face(nodes);
    let axes = ports.len();
    let damping = StructureDamping::Ratio { ratio: 0.005, up_to: 4e4 };
    let whole = FullStructure::new(brick.mass.clone(), damping, brick.stiffness.clone(), ports).unwrap();
    let modes = whole.modes(8e4).unwrap();
    println!("{nodes} nodes: modes in {:.1} s, {}", seconds() - begin, memory());
    let first = modes.values[0].sqrt();
    let begin = seconds();
    let free = RubinBasis::new(&whole, &modes, 0.0, 1).unwrap();
    let reduced = free.reduced(MODES.min(free.modes()), 1).unwrap();
    println!("  first mode {first:.0} rad/s, {}, in {:.1} s, {}", reduced.kind, seconds() - begin, memory());
    let names = (0..reduced.dofs()).map(|i| format!("q{i}")).collect();
    let structure =
        Structure::new(names, reduced.mass.clone(), reduced.damping.clone(), reduced.stiffness.clone()).unwrap();
    let row = |axis: usize| Axis::new((0..reduced.dofs()).map(|k| (k, reduced.ports[(axis, k)])).collect());
    // total contact stiffness well above that of the block's first mode
    let stiffness = 4.0 * reduced.stiffness[(0, 0)]
        / (reduced.ports[(0, 0)].abs().max(reduced.ports[(1, 0)].abs()).max(reduced.ports[(2, 0)].abs()).powi(2)
            * nodes as f64);
    let mut builder = System::builder(structure);
    for node in 0..axes / 3 {
        let [x, y, z] = [0, 1, 2].map(|d| 3 * node + d);
        let law = FrictionContact {
            tangential: stiffness,
            normal: stiffness,
            friction: 0.3,
            preload: PRELOAD / nodes as f64,
            tangents: 2,
        };
        builder = builder.joint(format!("c{node}"), Arc::new(law), vec![row(y), row(z), row(x)]);
    }
    for k in 0..reduced.dofs() {
        let f = (0..3).map(|d| FORCE[d] * reduced.ports[(d, k)]).sum();
        builder = builder.force(k, 1, Complex64::new(f, 0.0));
    }
    (builder.build().unwrap(), first)
}

/// Returns the mean time of a point of the curve, s.
fn curve(brick: &Brick, nodes: usize) -> f64 {
    let (system, first) = system(brick, nodes);
    forget_memory();
    let method =
        HarmonicBalance { harmonics: Some(HARMONICS), tolerance: Some(TOLERANCE), ..HarmonicBalance::default() };
    let mut solver = method.solver(&system).unwrap();
    let (mut start, mut found, mut peak) = (None, Tally::default(), String::new());
    let mut largest = 0.0;
    let whole_curve = seconds();
    for i in 0..POINTS {
        let along = i as f64 / (POINTS - 1) as f64;
        let omega = first * (RANGE[0] * (1.0 - along) + RANGE[1] * along);
        let begin = seconds();
        let orbit = match solver.orbit_near(omega, start.as_ref()) {
            Ok(orbit) => orbit,
            Err(error) => {
                println!("  {omega:8.1} rad/s: {:.3} s, {error}", seconds() - begin);
                continue;
            }
        };
        found.add(&orbit, seconds() - begin);
        let driven = orbit.joints[0].displacement[0];
        let amplitude = 0.5 * (driven.1 - driven.0);
        if amplitude > largest {
            let share = |of: fn(&JointMotion) -> f64| 100.0 * orbit.joints.iter().map(of).sum::<f64>() / nodes as f64;
            let separate = orbit.joints.iter().filter(|joint| joint.open_fraction > 0.0).count();
            largest = amplitude;
            peak = format!(
                "{:.2} um at {omega:.0} rad/s, where {:.0} % slip, {:.0} % are apart, and {separate} separate at times",
                1e6 * amplitude,
                share(|joint| joint.slip_fraction),
                share(|joint| joint.open_fraction),
            );
        }
        start = Some(orbit.seed());
    }
    let point = (seconds() - whole_curve) / POINTS as f64;
    println!("  {point:.3} s a point, {}; {}", found.text(), memory());
    println!("  largest {peak}");
    point
}

/// Statistics of the points of a curve.
#[derive(Default)]
struct Tally {
    status: BTreeMap<&'static str, usize>,
    iterations: Vec<usize>,
    longest: f64,
    error: Option<f64>,
}

impl Tally {
    fn add(&mut self, orbit: &Orbit, seconds: f64) {
        *self.status.entry(orbit.evidence.accuracy.status()).or_default() += 1;
        self.iterations.push(orbit.evidence.iterations);
        self.longest = self.longest.max(seconds);
        self.error =
            orbit.evidence.error_estimate.map_or(self.error, |error| Some(self.error.unwrap_or(0.0).max(error)));
    }

    fn text(&self) -> String {
        let of = self.iterations.len().max(1) as f64;
        let status: Vec<_> = self.status.iter().map(|(status, count)| format!("{count} {status}")).collect();
        let error = self.error.map_or(String::new(), |error| format!(", error {error:.1e} at most"));
        format!(
            "{:.3} s at most; {:.1} iterations, {} at most; {}{error}",
            self.longest,
            self.iterations.iter().sum::<usize>() as f64 / of,
            self.iterations.iter().max().unwrap_or(&0),
            status.join(", "),
        )
    }
}

/// Returns the least-squares slope in logarithms.
fn exponent(points: &[(f64, f64)]) -> f64 {
    let logarithms: Vec<_> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let mean = |of: fn(&(f64, f64)) -> f64| logarithms.iter().map(of).sum::<f64>() / logarithms.len() as f64;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let (above, below) =
        logarithms.iter().fold((0.0, 0.0), |(a, b), p| (a + (p.0 - x) * (p.1 - y), b + (p.0 - x).powi(2)));
    above / below
}

/// Resets the peak memory of this process.
fn forget_memory() {
    // if the system does not support this, the overall peak is reported
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Returns the peak memory.
fn memory() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let most = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or("").trim();
    format!("{most} at most")
}

/// Returns the processor time of this process, s, which is independent of other processes.
fn seconds() -> f64 {
    let ran = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    ran.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).map_or(0.0, |ns| 1e-9 * ns)
}
