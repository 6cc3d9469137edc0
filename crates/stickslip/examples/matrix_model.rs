//! A model given by matrices: a bar of ten finite elements that rubs at its end.
//!
//! `cargo run --release -p stickslip --example matrix_model`

#![allow(clippy::print_stdout)] // a program

use nalgebra::DMatrix;
use num_complex::Complex64;
use std::error::Error;
use std::sync::Arc;
use stickslip::law::Jenkins;
use stickslip::method::auto::Auto;
use stickslip::{Axis, Method, Structure, System};

fn main() -> Result<(), Box<dyn Error>> {
    // a steel bar of 1 m by 1 cm², clamped at the left
    let (elements, modulus, area, density) = (10, 2.1e11, 1e-4, 7850.0);
    let length = 1.0 / elements as f64;
    let (axial, mass_of_element) = (modulus * area / length, density * area * length);
    let (mut mass, mut stiffness) = (DMatrix::zeros(elements, elements), DMatrix::zeros(elements, elements));
    for element in 0..elements {
        let nodes = [element.checked_sub(1), Some(element)];
        for (i, row) in nodes.iter().enumerate() {
            for (k, column) in nodes.iter().enumerate() {
                if let (Some(row), Some(column)) = (*row, *column) {
                    stiffness[(row, column)] += if i == k { axial } else { -axial };
                    mass[(row, column)] += mass_of_element * if i == k { 1.0 / 3.0 } else { 1.0 / 6.0 };
                }
            }
        }
    }
    let damping = &stiffness * 1e-7;
    let names = (1..=elements).map(|node| format!("node{node}")).collect();
    let structure = Structure::new(names, mass, damping, stiffness)?;
    let end = elements - 1;
    let system = System::builder(structure)
        .joint("end", Arc::new(Jenkins { stiffness: 1e7, limit: 50.0 }), vec![Axis::new(vec![(end, 1.0)])])
        .force(end, 1, Complex64::new(200.0, 0.0))
        .build()?;

    // the first frequency of a clamped bar is √(E/ρ)/(4 L)
    let first = (modulus / density).sqrt() / 4.0;
    println!("first natural frequency without friction: {first:.1} Hz");
    let mut solver = Auto.solver(&system)?;
    let mut seed = None;
    for step in 0..=10 {
        let hertz = first * (0.95 + 0.02 * f64::from(step));
        let orbit = solver.orbit_near(std::f64::consts::TAU * hertz, seed.as_ref())?;
        let (tip, joint) = (&orbit.places[end], &orbit.joints[0]);
        println!("{hertz:7.1} Hz: {:.3} µm, {:.2e} J a period", 1e6 * tip.amplitude(), joint.dissipation);
        seed = Some(orbit.seed());
    }
    Ok(())
}
