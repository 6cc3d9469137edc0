//! Brute force: the motion is followed until its transient has died.
//!
//! Exact laws are followed by events, smooth ones by stiff integration, others and mixtures in equal steps. What is still missing when the search
//! stops is estimated from the measured decay, and from the derivative of a return where the decay was measured over few, and reported as the
//! orbit's truncation: a lightly damped structure needs hundreds of periods per digit, and a smooth law creeps for seconds. Which orbit that is,
//! nothing but time tells, so it is an independent check of the other methods; in equal steps Newton's method then finds it again in finer ones.

use super::event_driven::Exact;
use super::followed::Kind;
use super::option::{PERIOD, periods, width};
use super::periodic::Search;
use super::shooting::{Shooter, Shooting};
use super::{Method, MethodError, MethodInfo, MethodOption, Solver, WIDTH};
use crate::dimension::Dimension;
use crate::model::System;

const NAME: &str = "transient";

/// Estimated distance to the orbit, relative to it, at which a motion counts as settled when none is given.
const TOLERANCE: f64 = 1e-7;
/// Periods after which the search is given up when none are given: ten times what a structure with Q of 700 takes.
const PERIODS: usize = 50_000;

/// The row of this method in [`super::TABLE`].
pub(super) const INFO: MethodInfo = MethodInfo {
    name: NAME,
    summary: "brute force: follow the motion until its transient has died, with an estimate of the rest",
    options: &[
        MethodOption {
            key: "tolerance",
            dimension: Dimension::NONE,
            count: false,
            doc: "estimated relative distance to the orbit at which the motion counts as settled; 1e-7 when absent",
        },
        MethodOption {
            key: "periods",
            dimension: Dimension::NONE,
            count: true,
            doc: "periods after which the search is given up; 50000 when absent",
        },
        MethodOption {
            key: WIDTH,
            dimension: Dimension::VELOCITY,
            count: false,
            doc: "replaces exact laws by smooth ones that change sign over this velocity; exact laws are followed exactly when absent",
        },
        PERIOD,
    ],
    build: |options| {
        let tolerance = options.get("tolerance").copied().unwrap_or(TOLERANCE);
        if !(1e-12..=1e-2).contains(&tolerance) {
            let message = format!("must lie between 1e-12 and 1e-2, found {tolerance}");
            return Err(MethodError::option(NAME, "tolerance", message));
        }
        let most = options.get("periods").map_or(PERIODS, |periods| *periods as usize);
        let (width, period) = (width(NAME, options)?, periods(NAME, options)?);
        Ok(Box::new(Transient { tolerance, periods: most, width, period }))
    },
};

/// Waiting for the transient to die.
///
/// # Example
/// ```
/// use stickslip::method::{Method, event_driven::EventDriven, transient::Transient};
/// let system = stickslip::model::example::blade_couple().assemble().unwrap();
/// let omega = std::f64::consts::TAU * 121.25;
/// let waited = Transient::default().solver(&system).unwrap().orbit(omega, None).unwrap();
/// let found = EventDriven.solver(&system).unwrap().orbit(omega, None).unwrap();
/// assert!((waited.places[0].amplitude() / found.places[0].amplitude() - 1.0).abs() < 1e-6);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transient {
    /// Estimated relative distance to the orbit at which the motion counts as settled.
    pub tolerance: f64,
    /// Periods after which the search is given up.
    pub periods: usize,
    /// Velocity over which exact laws are smoothed, m/s; they are followed exactly without it.
    pub width: Option<f64>,
    /// Periods of the drive after which the motion repeats.
    pub period: usize,
}

impl Default for Transient {
    fn default() -> Self {
        Transient { tolerance: TOLERANCE, periods: PERIODS, width: None, period: 1 }
    }
}

impl Method for Transient {
    fn name(&self) -> &'static str {
        NAME
    }
    fn solver<'a>(&self, system: &'a System) -> Result<Box<dyn Solver + Send + 'a>, MethodError> {
        let returns = self.periods.div_ceil(self.period);
        let search = Search::Settle { tolerance: self.tolerance, returns };
        if Kind::of(system, self.width) == Kind::Exact {
            return Ok(Box::new(Exact::new(system, NAME, search, self.period)?));
        }
        let options = Shooting { width: self.width, period: self.period, ..Shooting::default() };
        Ok(Box::new(Shooter::new(system, options, NAME, search)?))
    }
}
