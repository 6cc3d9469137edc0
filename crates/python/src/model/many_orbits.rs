//! Many orbits of a model in one call: at many frequencies, or for many values of parameters.

use super::disk;
use super::orbit_table::Row;
use super::parameters::{self, VariedParameters};
use crate::error;
use pyo3::prelude::*;
use rayon::prelude::*;
use std::sync::Arc;
use stickslip::curve::sweep::{BLOCK, Watch as Sweep, sweep};
use stickslip::method::{Method, OrbitError, solver_with_alternatives};
use stickslip::model::{Model, ModelError, System};
use stickslip::orbit::Orbit;
use stickslip_study::run::Context;

/// System and method of a request.
pub struct OrbitRequest {
    pub system: Arc<System>,
    pub method: Box<dyn Method>,
}

/// Describes an error in a model, with the name of its element and key.
pub fn describe(cause: &ModelError, model: &Model) -> String {
    format!("{}, `{}`: {}", cause.element.named(model), cause.key, cause.message)
}

/// Reason why a point cannot be computed.
pub enum PointError {
    Model(String),
    Method(String),
}

impl PointError {
    pub fn raised(self, py: Python<'_>) -> PyErr {
        match self {
            PointError::Model(message) => error::model(py, message),
            PointError::Method(message) => error::method(py, message),
        }
    }
}

/// Computes orbits of one model at all frequencies, each from the adjacent solution.
pub fn along_frequencies(request: &OrbitRequest, omegas: &[f64], context: &Context) -> Result<Vec<Row>, PointError> {
    let watch = Sweep { finished: &*context.finished, stop: &context.stop };
    let row = |index: usize, outcome: Result<&Orbit, &OrbitError>| Row::new(&request.system, omegas[index], outcome);
    let rows = sweep(&*request.method, &request.system, omegas.len(), &|index| omegas[index], watch, &row);
    // If the run was stopped, the caller raises the exception that stopped it.
    Ok(rows.map_err(|cause| PointError::Method(cause.to_string()))?.into_iter().flatten().collect())
}

/// Computes one model per point, in blocks of points per thread.
pub fn along_parameters(
    model: &Model,
    request: &OrbitRequest,
    omegas: &[f64],
    varied: &VariedParameters,
    context: &Context,
) -> Result<Vec<Row>, PointError> {
    let point = |index: usize| -> Result<Option<Row>, PointError> {
        if context.stopped() {
            return Ok(None);
        }
        let mut model = model.clone();
        // A changed parameter may make one sector different from the others.
        disk::mark_sectors_unequal(&mut model);
        let at = |message: String| format!("point {index}: {message}");
        for (name, values) in varied {
            parameters::set(&mut model, name, values[index]).map_err(|message| PointError::Model(at(message)))?;
        }
        let system = model.assemble().map_err(|cause| PointError::Model(at(describe(&cause, &model))))?;
        let solver = solver_with_alternatives(&*request.method, &system);
        let mut solver = solver.map_err(|cause| PointError::Method(at(cause.to_string())))?;
        let outcome = solver.orbit(omegas[index]);
        (context.finished)();
        Ok(Some(Row::new(&system, omegas[index], outcome.as_ref())))
    };
    let blocks: Result<Vec<Vec<Row>>, PointError> = (0..omegas.len().div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let points = block * BLOCK..((block + 1) * BLOCK).min(omegas.len());
            points.filter_map(|index| point(index).transpose()).collect()
        })
        .collect();
    Ok(blocks?.into_iter().flatten().collect())
}
