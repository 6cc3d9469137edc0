//! Tolerances of exact orbits.

/// The name of the method in study files.
pub(super) const NAME: &str = "event-driven";

/// Residual of a converged orbit, relative to its state: a hundred times the rounding of one
/// period.
pub(super) const RESIDUAL_TOLERANCE: f64 = 1e-12;
/// Energy gap per distance of a motion that has not completely settled. It is the ratio of
/// stored energy to the work of a period in a structure with a quality factor of 1000.
pub(crate) const GAP_PER_DISTANCE: f64 = 1e3;
/// Fraction of the state that the loads can cause below which a state counts as rest.
pub(super) const REST_FRACTION: f64 = 1e-3;
/// Largest energy gap of a converged orbit. The closed-form integrals are exact to about 1e-12.
pub(super) const ENERGY_GAP: f64 = 1e-8;
