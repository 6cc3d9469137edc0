//! Stiff integration of smooth friction laws with exact sensitivities, for `shooting` and for transients.
//!
//! - `step`: one step of Radau IIA-5, the structure eliminated onto its joints;
//! - `flow`: steps of controlled length over a stretch of time;
//! - `path`: the orbit's numbers from its steps.

pub(crate) mod flow;
pub(crate) mod path;
pub(crate) mod step;

use crate::law::{Law, RateLaw};
use crate::method::MethodError;
use crate::model::System;
use step::{MOST_STATES, SmoothJoint, Structure};

impl Structure {
    /// # Errors
    /// A joint whose law has no smooth view (and cannot be smoothed with `width`), a place without mass.
    pub fn new(system: &System, width: Option<f64>, method: &'static str) -> Result<Self, MethodError> {
        let n = system.dofs();
        if let Some(i) = (0..n).find(|&i| system.mass[(i, i)] <= 0.0) {
            return Err(MethodError::NeedsMass { method, place: system.places[i].clone() });
        }
        let inverse_mass =
            system.mass.clone().try_inverse().ok_or(MethodError::NotPositive { method, matrix: "mass" })?;
        let mut internal = 0;
        let mut joints = Vec::new();
        for joint in &system.joints {
            let refused = |instead: &'static str| MethodError::Law {
                method,
                joint: joint.name.clone(),
                law: joint.law.name(),
                instead,
            };
            let smoothed: Option<Law> = width.and_then(|width| joint.law.regularised(width));
            let law = smoothed.unwrap_or(joint.law);
            let rate = law.rate().ok_or_else(|| {
                refused(
                    "method `event-driven`, or give the method a `width` (m/s) over which friction changes its sign",
                )
            })?;
            if joint.direction.ncols() != 1 {
                return Err(refused("a law with one direction"));
            }
            if rate.states() > MOST_STATES {
                return Err(refused("a law with fewer internal states"));
            }
            joints.push(SmoothJoint {
                mobility: &inverse_mass * joint.direction.column(0),
                direction: joint.direction.column(0).into_owned(),
                law: rate,
                first_state: internal,
                states: rate.states(),
                limit: law.limit(),
            });
            internal += rate.states();
        }
        Ok(Structure {
            n,
            damping_rate: &inverse_mass * &system.damping,
            stiffness_rate: &inverse_mass * &system.stiffness,
            mass: system.mass.clone(),
            inverse_mass,
            damping: system.damping.clone(),
            stiffness: system.stiffness.clone(),
            joints,
            internal,
        })
    }
}
