//! Picks a method: event-driven for exact laws, shooting for smooth ones.

use super::{Method, MethodError, MethodInfo, Solver, event_driven::EventDriven, shooting::Shooting};
use crate::model::System;

/// The row of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: "auto",
    summary: "event-driven for exact laws, shooting for smooth laws",
    options: &[],
    build: |_| Ok(Box::new(Auto)),
};

/// The choice by the laws of a system's joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Auto;

impl Method for Auto {
    fn name(&self) -> &'static str {
        INFO.name
    }
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        let exact = system.joints.iter().all(|joint| joint.law.network().is_some());
        if exact { EventDriven.solver(system) } else { Shooting::default().solver(system) }
    }
}
