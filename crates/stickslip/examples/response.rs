//! Response curves for four slip limits, as columns for a figure.
//!
//! `cargo run --release -p stickslip --example response > response.csv`

#![allow(clippy::print_stdout, clippy::print_stderr)] // a program

use std::error::Error;
use std::f64::consts::TAU;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use stickslip::curve::sweep::{Watch, sweep};
use stickslip::law::Coulomb;
use stickslip::method::auto::Auto;
use stickslip::model::example;

fn main() -> Result<(), Box<dyn Error>> {
    let hertz = |index: usize| 119.5 + 0.05 * index as f64;
    println!("limit_N,frequency_Hz,amplitude_m");
    for limit in [2.0, 4.0, 6.0, 8.0] {
        let mut model = example::blade_couple();
        model.joints[0].law = Arc::new(Coulomb { limit });
        let system = model.assemble()?;
        let watch = Watch { finished: &|| (), stop: &AtomicBool::new(false) };
        // the points are solved in parallel; each takes its neighbour as initial guess
        let amplitudes = sweep(&Auto, &system, 61, &|index| TAU * hertz(index), watch, &|_, orbit| {
            orbit.map(|orbit| orbit.places[0].amplitude()).map_err(ToString::to_string)
        })?;
        let mut highest = (0.0, 0.0);
        for (index, amplitude) in amplitudes.into_iter().enumerate() {
            match amplitude {
                Some(Ok(amplitude)) => {
                    println!("{limit},{:.2},{amplitude:e}", hertz(index));
                    if amplitude > highest.1 {
                        highest = (hertz(index), amplitude);
                    }
                }
                Some(Err(reason)) => eprintln!("{limit} N, {:.2} Hz: {reason}", hertz(index)),
                None => {}
            }
        }
        eprintln!("{limit} N: at most {:.2} mm, at {:.2} Hz", 1e3 * highest.1, highest.0);
    }
    Ok(())
}
