//! The memory that equations take, before they are made.

use super::ports::Ports;
use super::rest::Rest;
use super::sparse::Sparse;
use super::{NAME, coupled};
use crate::method::{MethodError, PERIOD};

/// Memory of the equations, bytes, beyond which nothing is begun: 1000 nodes of three directions with five harmonics need half of it without modes.
pub(super) const MEMORY: f64 = 4e9;
/// Memory in which laws with memory are followed, bytes, beyond which no series is compared with a longer one: every length has its own, on every thread.
pub(super) const MARCHED: f64 = 5e8;

/// What there may be less of: a motion of several periods of the drive has as many times the harmonics.
fn fewer(periods: usize) -> (&'static str, &'static str) {
    if periods > 1 { (PERIOD.key, "fewer periods, ") } else { ("harmonics", "") }
}

/// Whether what equations with so many harmonics need, `bytes`, fits into memory.
pub(super) fn check_memory(bytes: f64, ports: &Ports, (harmonics, periods): (usize, usize)) -> Result<(), MethodError> {
    if bytes <= MEMORY {
        return Ok(());
    }
    let (key, fewer) = fewer(periods);
    let message = format!(
        "the equations of {} directions of joints and {harmonics} harmonics would fill {:.0} GB, and {:.0} are allowed: {fewer}fewer harmonics, or fewer joints",
        ports.count(),
        1e-9 * bytes,
        1e-9 * MEMORY
    );
    Err(MethodError::Option { method: NAME, key, message })
}

/// Memory of a level that is not banded, bytes: derivatives of the ports; receptances and their factors, or modes along the axes with the factor of
/// what most of them add; and where a matrix may be formed, that.
pub(super) fn memory(ports: &Ports, rest: &Rest, harmonics: usize, always: bool) -> f64 {
    let (axes, pair) = (ports.count() as f64, 2.0 * harmonics as f64);
    let size = pair * axes;
    let structure = match rest.modes_for(ports).filter(|_| !always) {
        Some(structure) => structure.at.len() as f64 + 3.0 * axes * axes,
        None => 4.0 * harmonics as f64 * axes * axes,
    };
    // whoever needs it in any case has it beside a factor of it and that of the step before
    let formed = match always {
        true => 3.0 * size * size,
        false if size <= coupled::FORMED as f64 => size * size,
        false => 0.0,
    };
    tangents(ports, harmonics) + 8.0 * (structure + formed)
}

/// Memory of a level, bytes, with so many samples; of one in banded form if one harmonic of that is given.
pub(super) fn level_memory(
    banded: Option<&Sparse>,
    ports: &Ports,
    rest: &Rest,
    (harmonics, samples): (usize, usize),
) -> f64 {
    let equations = match banded {
        Some(banded) => tangents(ports, harmonics) + banded.memory(harmonics),
        None => memory(ports, rest, harmonics, false),
    };
    equations + marched(ports, harmonics, samples)
}

/// Memory in which laws with memory are followed, one after the other, bytes: the derivatives of their forces at all samples by all harmonics.
pub(super) fn marched(ports: &Ports, harmonics: usize, samples: usize) -> f64 {
    let axes = ports.iter().filter(|port| port.marches()).map(|port| port.axes * port.axes).max().unwrap_or(0);
    8.0 * 2.0 * (axes * harmonics) as f64 * samples as f64
}

/// Memory of the derivatives of the ports, bytes.
fn tangents(ports: &Ports, harmonics: usize) -> f64 {
    8.0 * ports.iter().map(|port| (2.0 * (harmonics * port.axes) as f64).powi(2)).sum::<f64>()
}
