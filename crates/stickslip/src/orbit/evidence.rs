//! Evidence for an orbit: residuals, energy balance, error estimates.

/// Accuracy of an orbit with solved equations relative to the requested tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accuracy {
    /// The orbit is exact, or its estimated error is within the tolerance.
    Converged,
    /// The estimated error of the series exceeds the tolerance.
    Truncated,
    /// The error of the series was not estimated.
    Unchecked,
}

impl Accuracy {
    /// Returns the status word for tables.
    pub fn status(self) -> &'static str {
        match self {
            Accuracy::Converged => "converged",
            Accuracy::Truncated => "truncated",
            Accuracy::Unchecked => "unchecked",
        }
    }
}

/// Numbers that quantify the reliability of an orbit.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// Distance between the state and its return, relative to the vibration (the state without
    /// its mean), in the energy norm. In harmonic balance the residual of its equations.
    pub residual: f64,
    /// `|work in - viscous - friction| / work in`, from independent integrals.
    pub energy_gap: f64,
    /// Transitions per period.
    pub switches: usize,
    /// Iterations of the method.
    pub iterations: usize,
    /// Highest harmonic of the motion's own frequency, if the orbit is a series.
    pub harmonics: Option<usize>,
    /// Estimated relative error of the amplitudes from discretisation; `None` for a method
    /// without such an estimate.
    pub error_estimate: Option<f64>,
    /// Comparison of that error with the tolerance.
    pub accuracy: Accuracy,
    /// Distance between the state at t = 0 and its return under an independent time integration,
    /// relative to the vibration, in the energy norm. It equals the residual of a method that
    /// integrates in time. `None` if no integrator supports the system, or if the system is too
    /// large for an automatic check (see [`Orbit::return_defect`](super::Orbit::return_defect)).
    pub return_defect: Option<f64>,
    /// Names of joints that stick for the whole period. Their offset is not unique, and the
    /// orbit belongs to a continuum. (It is the symmetric one with
    /// [`Symmetry::HalfPeriod`](super::Symmetry::HalfPeriod).)
    pub stuck: Vec<String>,
    /// Names of joints that are at least partly stuck for the whole period, in a motion without
    /// half-period symmetry. The unstressed position of a stuck part depends on the history of
    /// the motion. The means depend on it too, and so do the amplitudes if a law depends on
    /// position. The reported orbit is the one that starts at static equilibrium under the
    /// constant loads ([`StaticEquilibrium`](crate::method::StaticEquilibrium)). With method
    /// `transient`, it is the one that the integrated motion reached.
    pub history_dependent: Vec<String>,
    /// Largest change of an amplitude under two other histories of the joints in
    /// `history_dependent`, relative to the largest amplitude. The other histories have no
    /// friction forces in static equilibrium, or the opposite ones. `None` if amplitudes do not
    /// depend on the history, or if it was not measured (methods other than harmonic balance).
    pub history_spread: Option<f64>,
    /// The algorithm that found the orbit: the method's name, or the successful search of harmonic
    /// balance.
    ///
    /// These are `newton`, `interior-points`, `proximal-points`, `slip-limit-homotopy`,
    /// `growing-vibration`, where the excitation grows and stuck joints keep their history, and
    /// `time-integration`, where Newton's method starts from a motion that was followed in time. If
    /// several searches contributed, this is the last one that is not `newton`.
    pub found_by: &'static str,
    /// The method that was tried first and failed, if another method found the orbit. See
    /// [`Auto`](crate::method::auto::Auto).
    pub fallback_from: Option<&'static str>,
}
