//! Method `transient`: integrates the motion until its transient has decayed.
//!
//! Exact laws are integrated from event to event, smooth laws by a stiff integration, other
//! laws and mixtures in equal steps. When the search stops, the measured decay gives the
//! remaining distance to the orbit. If the decay was measured over few returns, the derivative
//! of a return is used too. The orbit reports this distance as its truncation. A lightly damped
//! structure needs hundreds of periods per digit, and a smooth law creeps for seconds.
//!
//! The motion itself selects the orbit, so the method is an independent check of the others. In
//! equal steps, Newton's method then finds the same orbit in finer steps.

use super::event_driven::ExactSolver;
use super::flow::integrator_choice::IntegratorKind;
use super::options::{PERIOD, periods, width};
use super::orbit_search::return_map::ClosingMethod;
use super::shooting::{Shooting, ShootingSolver};
use super::{Method, MethodError, MethodInfo, MethodOption, Solver, WIDTH};
use crate::dimension::Dimension;
use crate::model::System;

/// Name of the method.
pub const NAME: &str = "transient";

/// The row of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: NAME,
    summary: "integrates the motion until its transient has decayed, and estimates the remaining error",
    options: &[
        MethodOption {
            key: "tolerance",
            dimension: Dimension::NONE,
            count: false,
            doc: "the motion counts as settled if its estimated relative distance to the orbit is smaller; default 1e-7; \
                  for kind `transient`, relative error of the integration",
        },
        MethodOption {
            key: "periods",
            dimension: Dimension::NONE,
            count: true,
            doc: "largest number of excitation periods; the search ends earlier if the decay is too slow; default 50000",
        },
        MethodOption {
            key: WIDTH,
            dimension: Dimension::VELOCITY,
            count: false,
            doc: "smooths exact laws: friction changes sign over this velocity; without it, exact laws stay exact",
        },
        PERIOD,
    ],
    build: |options| {
        let default = Transient::default();
        let tolerance = options.get("tolerance").copied().unwrap_or(default.tolerance);
        if !(1e-12..=1e-2).contains(&tolerance) {
            let message = format!("must lie between 1e-12 and 1e-2, found {tolerance}");
            return Err(MethodError::option(NAME, "tolerance", message));
        }
        let most = options.get("periods").map_or(default.periods, |periods| *periods as usize);
        let (width, period) = (width(NAME, options)?, periods(NAME, options)?);
        Ok(Box::new(Transient { tolerance, periods: most, width, period }))
    },
};

/// Method `transient`: waits until the transient has decayed.
///
/// # Example
/// ```
/// use stickslip::method::{Method, event_driven::EventDriven, transient::Transient};
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// let omega = std::f64::consts::TAU * 121.25;
/// let waited = Transient::default().solver(&system).unwrap().orbit(omega).unwrap();
/// let found = EventDriven.solver(&system).unwrap().orbit(omega).unwrap();
/// assert!((waited.places[0].amplitude() / found.places[0].amplitude() - 1.0).abs() < 1e-6);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transient {
    /// Estimated relative distance to the orbit at which the motion counts as settled.
    pub tolerance: f64,
    /// Most periods before the search fails.
    pub periods: usize,
    /// Velocity over which exact laws are smoothed, m/s; without it, they stay exact.
    pub width: Option<f64>,
    /// Excitation periods after which the motion repeats.
    pub period: usize,
}

impl Default for Transient {
    fn default() -> Self {
        // 50,000 periods are ten times the need of a structure with a Q of 700.
        Transient { tolerance: 1e-7, periods: 50_000, width: None, period: 1 }
    }
}

impl Method for Transient {
    fn name(&self) -> &'static str {
        NAME
    }
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        let returns = self.periods.div_ceil(self.period);
        let search = ClosingMethod::Settle { tolerance: self.tolerance, returns };
        if IntegratorKind::of(system, self.width) == IntegratorKind::Exact {
            return Ok(Box::new(ExactSolver::new(system, NAME, search, self.period)?));
        }
        let options = Shooting { width: self.width, period: self.period, ..Shooting::default() };
        Ok(Box::new(ShootingSolver::new(system, options, NAME, search)?))
    }
}
