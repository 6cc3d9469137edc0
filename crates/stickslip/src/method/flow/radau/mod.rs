//! Stiff integration of smooth laws with exact sensitivities, for `shooting` and for
//! transients.
//!
//! - `radau_step`: one step of Radau IIA-9, with the structure eliminated onto the joints' axes
//! - `step_size_control`: step size control over a time interval

pub(crate) mod radau_step;
pub(crate) mod step_size_control;

use super::assembly::Assembly;
use super::assembly::carries_nothing;
use crate::method::MethodError;
use crate::model::System;

/// Creates the assembly of a system for this integration. `width` (m/s) regularizes laws that
/// support it.
///
/// # Errors
/// A joint whose law has no rate view and is not regularized, or a place without mass.
pub(crate) fn assembly(system: &System, width: Option<f64>, method: &'static str) -> Result<Assembly, MethodError> {
    Assembly::new(system, method, |law| {
        let law = width.and_then(|width| law.smooth_counterpart(width)).unwrap_or_else(|| law.clone());
        let (states, scale) = law
            .rate()
            .map(|rate| (rate.states(), rate.state_scale()))
            .or_else(|| carries_nothing(&law).then_some((0, 1.0)))
            .ok_or("its switch between stick and slip is not smooth")?;
        Ok((law, states, scale))
    })
}
