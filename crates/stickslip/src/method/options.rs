//! Options of methods: keys in `[method]`, and the options that several methods share.

use super::MethodError;
use crate::dimension::Dimension;
use std::collections::BTreeMap;

/// An option of a method: a key in `[method]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MethodOption {
    /// Key in `[method]`.
    pub key: &'static str,
    /// Physical dimension.
    pub dimension: Dimension,
    /// True if the value is a count: a whole number from 1.
    pub count: bool,
    /// One line that says what the option does, and its default.
    pub doc: &'static str,
}

/// The option for the number of excitation periods in one period of the orbit.
pub(super) const PERIOD: MethodOption = MethodOption {
    key: "period",
    dimension: Dimension::NONE,
    count: true,
    doc: "number of excitation periods after which the orbit repeats; the method also finds orbits that repeat earlier; default 1",
};

/// Reads the option [`PERIOD`] of a method.
pub(super) fn periods(method: &'static str, options: &Options) -> Result<usize, MethodError> {
    // A motion with a longer period does not count as periodic.
    let most_periods: f64 = 100.0;
    let periods = options.get(PERIOD.key).copied().unwrap_or(1.0);
    if (1.0..=most_periods).contains(&periods) {
        return Ok(periods as usize);
    }
    let message = format!("must lie between 1 and {most_periods}, found {periods}");
    Err(MethodError::option(method, PERIOD.key, message))
}

/// Key of the velocity over which methods smooth exact laws.
pub const WIDTH: &str = "width";

/// Reads the option [`WIDTH`] of a method, m/s.
pub(super) fn width(method: &'static str, options: &Options) -> Result<Option<f64>, MethodError> {
    match options.get(WIDTH).copied() {
        Some(width) if !(width.is_finite() && width > 0.0) => {
            let message = format!("must be more than zero, found {width}; omit it if all laws are smooth");
            Err(MethodError::option(method, WIDTH, message))
        }
        width => Ok(width),
    }
}

/// The given options of a method: SI values by key.
pub type Options = BTreeMap<String, f64>;
