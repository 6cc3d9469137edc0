//! Time and memory of analysis, factorization, modes and reduction of a steel block with 61,000
//! degrees of freedom, compared with SciPy.
//!
//! `cargo bench -p stickslip --bench reduction [-- 50 20 18]`, with the numbers of elements
//! along each edge. Times are processor times, which are independent of other processes, if the
//! system provides them.

#![allow(clippy::print_stdout)]

#[path = "../tests/it/reduction/brick.rs"]
mod brick;
mod python;

use brick::Brick;
use python::{Peer, number};
use std::f64::consts::TAU;
use std::time::Instant;
use stickslip::structure::reduction::{FullStructure, ReferenceReceptance, RubinBasis, StructureDamping};
use stickslip_numerics::sparse::{ModeSelection, NaturalModes, SymbolicAnalysis};

const SCIPY: Peer = Peer { package: "scipy", version: "1.17.1", folder: "peers" };
const MODES: usize = 20;
/// Ratio of the highest fixed-interface mode to the highest free mode.
const BEYOND: f64 = 1.3;

fn main() {
    let numbers: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let elements = *numbers.first_chunk::<3>().unwrap_or(&[50, 20, 18]);
    let brick = Brick::new(elements, elements.map(|e| 0.005 * e as f64), true);
    println!("{} degrees of freedom, {} entries", brick.dofs(), brick.stiffness.len());
    let mut clock = Clock::new();
    let analysis = SymbolicAnalysis::new(&[&brick.stiffness, &brick.mass]);
    clock.tell(&format!("analysis ({} MB in a factor)", analysis.factor_entries() / 125_000));
    drop(analysis.factor(&[(1.0, &brick.stiffness)]).expect("the block is held"));
    clock.tell("factor");
    let modes =
        NaturalModes::new(&analysis, &brick.stiffness, &brick.mass, ModeSelection::Lowest(MODES)).expect("modes");
    clock.tell(&format!("{MODES} modes, counted ({} factors, {} vectors)", modes.cost.factors, modes.cost.vectors));
    drop(analysis);

    let up_to = modes.values[MODES - 1].sqrt();
    let ports = brick.face(16);
    let damping = StructureDamping::Ratio { ratio: 0.005, up_to };
    let whole = FullStructure::new(brick.mass.clone(), damping, brick.stiffness.clone(), ports).expect("a structure");
    clock.tell("analysis again");
    let free = RubinBasis::new(&whole, &modes, 0.0, 1).expect("residual vectors");
    let rubin = free.reduced(MODES, 1).expect("reduced");
    clock.tell(&format!("reduction: {}", rubin.kind));
    memory("with modes and reduction");
    let worst = |frequencies: Vec<f64>| {
        let off =
            frequencies.iter().zip(&modes.values).take(MODES).map(|(omega, value)| (omega / value.sqrt() - 1.0).abs());
        off.fold(0.0, f64::max)
    };
    println!("  frequencies off by {:.1e}", worst(rubin.frequencies().expect("frequencies")));
    let bampton = whole.craig_bampton(BEYOND * up_to).expect("reduced");
    clock.tell(&format!("reduction: {}", bampton.kind));
    println!("  frequencies off by {:.1e}", worst(bampton.frequencies().expect("frequencies")));
    let samples: Vec<f64> = [0.5, 0.8].iter().map(|share| share * up_to).collect();
    let reference = ReferenceReceptance::at_frequencies(&whole, &samples).expect("samples");
    clock.tell("2 samples of the whole receptance");
    for reduced in [&rubin, &bampton] {
        let deviation = reference.deviation(reduced);
        println!("  {}: off by {:.1e} at {:.0} Hz", reduced.kind, deviation.error, deviation.omega / TAU);
    }
    memory("in all");
    let input = format!("{{\"elements\": {elements:?}, \"modes\": {MODES}}}");
    match SCIPY.measure("scipy_brick.py", &input) {
        Ok(lines) => {
            let line = lines.concat();
            let key = |key| number(&line, key).unwrap_or(f64::NAN);
            let (factor, all, memory) = (key("factor_s"), key("modes_s"), key("memory_MB"));
            println!("SciPy: factor {factor:.2} s, {MODES} modes with it {all:.2} s, {memory:.0} MB");
        }
        Err(error) => println!("SciPy: {error}"),
    }
}

/// Processor time, s, or wall time if the system does not provide it.
struct Clock {
    start: Instant,
    last: f64,
}

impl Clock {
    fn new() -> Self {
        let mut clock = Clock { start: Instant::now(), last: 0.0 };
        clock.last = clock.now();
        clock
    }

    fn now(&self) -> f64 {
        let ran = std::fs::read_to_string("/proc/self/schedstat").ok();
        let ran = ran.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
        ran.map_or(self.start.elapsed().as_secs_f64(), |nanoseconds| 1e-9 * nanoseconds)
    }

    fn tell(&mut self, what: &str) {
        println!("{:6.2} s  {what}", self.now() - self.last);
        self.last = self.now();
    }
}

fn memory(when: &str) {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    println!("{} at most, {when}", line.unwrap_or("memory unknown").trim());
}
