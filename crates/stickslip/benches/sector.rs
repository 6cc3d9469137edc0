//! Time of a tuned disk with shrouds, whose sector is given by matrices: reduction, five points of
//! a resonance curve, modes by nodal diameter, and the reduction with mistuned blades.
//!
//! `cargo bench -p stickslip --bench sector [-- 30 4 3]`, with the numbers of elements of a blade
//! along its length, across and through the thickness; the default is 12 3 2.

#![allow(clippy::print_stdout)] // a bench prints its result

#[path = "../tests/it/reduction/brick.rs"]
mod brick;

use brick::Brick;
use std::f64::consts::TAU;
use std::sync::Arc;
use std::time::Instant;
use stickslip::law::FrictionContact;
use stickslip::method::{Method, harmonic_balance::HarmonicBalance};
use stickslip::model::{
    Disk, DiskPart, Force, Joint, Model, Place, SectorDistribution, Substructure, SubstructureDamping,
};
use stickslip::structure::{Boundary, Component, Reduction};

const SECTORS: usize = 18;
/// Upper end of the frequency range of the reduction, Hz.
const UP_TO: f64 = 5000.0;

fn main() {
    let numbers: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let elements = *numbers.first_chunk::<3>().unwrap_or(&[12, 3, 2]);
    let blade = Blade::new(elements);
    println!("{} rows in each of {SECTORS} sectors", blade.component.dofs());

    let mut clock = Clock(Instant::now());
    let tuned = blade.ring(&[0.0; SECTORS]);
    let system = tuned.assemble().expect("a disk");
    clock.tell(&format!("reduction to {} coordinates of a sector", system.dofs() / SECTORS));
    tuned.wave_modes_of(&system, 6).expect("modes");
    clock.tell("modes of all nodal diameters");
    let method = HarmonicBalance { harmonics: Some(5), ..HarmonicBalance::default() };
    let mut solver = method.solver(&system).expect("a solver");
    for step in 0..5 {
        let orbit = solver.orbit(TAU * (200.0 + 25.0 * f64::from(step))).expect("an orbit");
        println!("  {} iterations", orbit.evidence.iterations);
    }
    clock.tell("five points with five harmonics");
    let deviations: Vec<f64> = (0..SECTORS).map(|s| 0.03 * (2.3 * s as f64).sin()).collect();
    let system = blade.ring(&deviations).assemble().expect("a disk");
    clock.tell(&format!("mistuned disk in {} modes", system.dofs()));
}

struct Clock(Instant);

impl Clock {
    /// Prints the time since the last call.
    fn tell(&mut self, what: &str) {
        println!("{:8.2} s  {what}", self.0.elapsed().as_secs_f64());
        self.0 = Instant::now();
    }
}

/// A steel strip whose foot is welded to the next one, with three contacts at its tip.
struct Blade {
    component: Component,
    boundary: Boundary,
    rows: Vec<usize>,
    places: Vec<Place>,
}

impl Blade {
    fn new(elements: [usize; 3]) -> Self {
        let brick = Brick::new(elements, [0.15, 0.03, 0.006], true);
        let [nx, ny, nz] = elements;
        let name = |[x, y, z]: [usize; 3]| format!("{x}_{y}_{z}");
        let (mut names, mut rows, mut pairs) = (vec![String::new(); brick.dofs()], Vec::new(), Vec::new());
        for node in (1..=nx).flat_map(|x| (0..=ny).flat_map(move |y| (0..=nz).map(move |z| [x, y, z]))) {
            for (direction, along) in ["x", "y", "z"].into_iter().enumerate() {
                let row = brick.row(node, direction).expect("a free node");
                names[row] = format!("{}.{along}", name(node));
                if node[0] > 2 {
                    rows.push(row);
                }
            }
            if node[0] == 1 && node[1] == 0 {
                pairs.push((name(node), name([node[0], ny, node[2]])));
            }
        }
        // the normal, across the blade, comes last
        let node = |name: String, at: [usize; 3]| {
            let rows = [0, 2, 1].map(|direction| vec![(brick.row(at, direction).expect("a free node"), 1.0)]);
            Place::node(name, &["t1", "t2", "n"], rows.to_vec())
        };
        let contacts =
            (0..3).flat_map(|k| [node(format!("low{k}"), [nx - k, 0, 0]), node(format!("high{k}"), [nx - k, ny, 0])]);
        let places = contacts.chain([node("tip".into(), [nx, 0, nz])]).collect();
        let component = Component::new(names, brick.mass, None, brick.stiffness).expect("a structure");
        let boundary = Boundary::of_nodes(component.rows(), &pairs, None).expect("a boundary");
        Blade { component, boundary, rows, places }
    }

    /// Returns the disk with these relative deviations of the blades' stiffness, under a travelling
    /// force.
    fn ring(&self, deviations: &[f64]) -> Model {
        let law = FrictionContact { tangential: 1e6, normal: 1e6, friction: 0.3, preload: 20.0, tangents: 2 };
        let joint = |k: usize| Joint {
            name: format!("shroud{k}"),
            between: [format!("high{k}"), format!("next.low{k}")],
            law: Arc::new(law),
        };
        let sector = |deviation: f64| {
            let disk = DiskPart {
                boundary: self.boundary.clone(),
                blade: self.rows.clone(),
                deviations: vec![deviation],
                basis: None,
            };
            Model {
                substructure: Some(Substructure {
                    component: self.component.clone(),
                    damping: SubstructureDamping::Ratio(0.001),
                    reduction: Reduction::up_to(TAU * UP_TO),
                    earlier_reduction: None,
                    disk: Some(disk),
                }),
                places: self.places.clone(),
                joints: (0..3).map(joint).collect(),
                forces: vec![Force { on: "tip.t2".into(), amplitude: 2.0, phase: 0.0, harmonic: 1 }],
                ..Model::default()
            }
        };
        let forces = vec![SectorDistribution::EngineOrder(3)];
        let disk = Disk { sectors: deviations.len(), forces, motions: Vec::new() };
        disk.ring(|s| sector(deviations[s])).expect("a disk")
    }
}
