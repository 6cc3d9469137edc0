//! What exact orbits are held to, by every file that makes one.

/// The name of the method in study files.
pub(super) const NAME: &str = "event-driven";

/// Residual at which an orbit is closed, relative to its state: a hundred times the rounding of one period.
pub(super) const CLOSED: f64 = 1e-12;
/// Energy gap per missing distance of a motion that has not quite settled: the stored energy, over the work of a period, of a
/// structure with Q of a thousand.
pub(crate) const MISSING_WORK: f64 = 1e3;
/// A state counts as rest below this fraction of what the loads could cause.
pub(super) const NEAR_REST: f64 = 1e-3;
/// Energy gap above which an orbit is not reported as converged. The closed-form integrals are exact to about 1e-12.
pub(super) const ENERGY_GAP: f64 = 1e-8;
