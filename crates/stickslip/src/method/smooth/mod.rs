//! Stiff integration of smooth friction laws with exact sensitivities, for `shooting` and for transients.
//!
//! - `step`: one step of Radau IIA-5, the structure eliminated onto its joints;
//! - `flow`: steps of controlled length over a stretch of time;
//! - `path`: the orbit's numbers from its steps.

pub(crate) mod flow;
pub(crate) mod path;
pub(crate) mod step;

use crate::law::SharedLaw;
use crate::method::MethodError;
use crate::model::System;
use step::{MOST_STATES, SmoothJoint, Structure};

impl Structure {
    /// # Errors
    /// A joint whose law has no smooth view (and cannot be smoothed with `width`), a place without mass.
    pub fn new(system: &System, width: Option<f64>, method: &'static str) -> Result<Self, MethodError> {
        let n = system.dofs();
        if let Some(i) = (0..n).find(|&i| system.structure().mass()[(i, i)] <= 0.0) {
            return Err(MethodError::NeedsMass { method, place: system.places()[i].clone() });
        }
        let inverse_mass = system
            .structure()
            .mass()
            .clone()
            .try_inverse()
            .ok_or(MethodError::NotPositive { method, matrix: "mass" })?;
        let mut internal = 0;
        let mut joints = Vec::new();
        for joint in system.joints() {
            let refused = |instead: &'static str| MethodError::Law {
                method,
                joint: joint.name().to_owned(),
                law: joint.law().name(),
                instead,
            };
            let smoothed: Option<SharedLaw> = width.and_then(|width| joint.law().regularised(width));
            let law = smoothed.unwrap_or_else(|| joint.law().clone());
            let rate = law.rate().ok_or_else(|| {
                refused(
                    "method `event-driven`, or give the method a `width` (m/s) over which friction changes its sign",
                )
            })?;
            if joint.axes().len() != 1 {
                return Err(refused("a law with one direction"));
            }
            if rate.states() > MOST_STATES {
                return Err(refused("a law with fewer internal states"));
            }
            joints.push(SmoothJoint {
                mobility: &inverse_mass * joint.axes()[0].dense(n),
                direction: joint.axes()[0].dense(n),
                law: law.clone(),
                first_state: internal,
                states: rate.states(),
                limit: law.scale(),
            });
            internal += rate.states();
        }
        Ok(Structure {
            n,
            damping_rate: &inverse_mass * system.structure().damping(),
            stiffness_rate: &inverse_mass * system.structure().stiffness(),
            mass: system.structure().mass().clone(),
            inverse_mass,
            damping: system.structure().damping().clone(),
            stiffness: system.structure().stiffness().clone(),
            joints,
            internal,
        })
    }
}
