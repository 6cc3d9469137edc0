//! Orbits at given frequencies, each started from its neighbour.
//!
//! The frequencies are cut into blocks of fixed length; a block starts cold and runs in order, and blocks run in parallel. The
//! start of every point is thus the same on any number of threads, and so are its bits.

use crate::method::{Method, MethodError, OrbitError};
use crate::model::System;
use crate::orbit::Orbit;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Points per block. A cold start costs about as much as five warm points.
pub const BLOCK: usize = 61;

/// What happens while a sweep runs.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    /// Called once per finished point, from any thread.
    pub finished: &'a (dyn Fn() + Sync),
    /// When true the sweep ends early; points that were not reached are `None`.
    pub stop: &'a AtomicBool,
}

/// Runs `system` over the frequencies `omega(0), …, omega(count - 1)` (rad/s); `row` turns each outcome into what is kept.
///
/// # Errors
/// The method cannot take the system.
///
/// # Example
/// ```
/// use std::sync::atomic::AtomicBool;
/// use stickslip::curve::sweep::{Watch, sweep};
/// use stickslip::method::event_driven::EventDriven;
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// let watch = Watch { finished: &|| (), stop: &AtomicBool::new(false) };
/// let curve = sweep(&EventDriven, &system, 3, &|i| 760.0 + i as f64, watch, &|_, orbit| {
///     orbit.map(|orbit| orbit.places[0].amplitude()).ok()
/// }).unwrap();
/// assert!(curve.iter().all(|point| point.unwrap().is_some()));
/// ```
pub fn sweep<R: Send>(
    method: &dyn Method,
    system: &System,
    count: usize,
    omega: &(dyn Fn(usize) -> f64 + Sync),
    watch: Watch<'_>,
    row: &(dyn Fn(usize, Result<&Orbit, &OrbitError>) -> R + Sync),
) -> Result<Vec<Option<R>>, MethodError> {
    let blocks: Vec<Result<Vec<Option<R>>, MethodError>> = (0..count.div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let range = block * BLOCK..((block + 1) * BLOCK).min(count);
            let mut rows = Vec::with_capacity(range.len());
            stretch(method, system, &mut range.clone().map(omega), watch, &mut |_, outcome| {
                let index = range.start + rows.len();
                rows.push(outcome.map(|outcome| row(index, outcome)));
            })?;
            Ok(rows)
        })
        .collect();
    let mut all = Vec::with_capacity(count);
    for block in blocks {
        all.extend(block?);
    }
    Ok(all)
}

/// Looks at an outcome at a frequency (rad/s); `None` if the sweep was stopped before.
pub type See<'a> = dyn FnMut(f64, Option<Result<&Orbit, &OrbitError>>) + 'a;

/// Runs `system` over some frequencies (rad/s), one after the other, each started from the one before; `see` looks at each outcome as soon
/// as it is there.
///
/// # Errors
/// The method cannot take the system.
pub fn stretch(
    method: &dyn Method,
    system: &System,
    omegas: &mut dyn Iterator<Item = f64>,
    watch: Watch<'_>,
    see: &mut See<'_>,
) -> Result<(), MethodError> {
    let mut solver = method.solver(system)?;
    let mut start: Option<Vec<f64>> = None;
    for omega in omegas {
        if watch.stop.load(Ordering::Relaxed) {
            see(omega, None);
            continue;
        }
        let outcome = solver.orbit(omega, start.as_deref());
        see(omega, Some(outcome.as_ref()));
        // after a failure the next point starts cold: the last good orbit may be far away
        start = outcome.ok().map(|orbit| orbit.start);
        (watch.finished)();
    }
    Ok(())
}
