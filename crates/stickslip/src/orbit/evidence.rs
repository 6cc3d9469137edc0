//! Why an orbit may be trusted, and how far.

/// Whether an orbit, whose equations are solved, is as accurate as it was asked to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accuracy {
    /// It is: exactly, or by the estimate of its error.
    Converged,
    /// The estimated error of its series is larger than the tolerance.
    Truncated,
    /// It is a series whose error was not estimated.
    Unchecked,
}

impl Accuracy {
    /// The status that tables show.
    pub fn status(self) -> &'static str {
        match self {
            Accuracy::Converged => "converged",
            Accuracy::Truncated => "truncated",
            Accuracy::Unchecked => "unchecked",
        }
    }
}

/// The numbers that say how far an orbit may be trusted.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// Distance between the state and its return, relative to the vibration (the state without its mean), in the energy norm.
    pub residual: f64,
    /// `|work in - viscous - friction| / work in`, from independent integrals.
    pub energy_gap: f64,
    /// Switches per period.
    pub switches: usize,
    /// Iterations of the method.
    pub iterations: usize,
    /// The highest harmonic of the motion's own frequency in it, if it is a series.
    pub harmonics: Option<usize>,
    /// Estimated relative error of the amplitudes from discretisation; `None` for a method that has none.
    pub truncation: Option<f64>,
    /// Whether that is as little as was asked for.
    pub accuracy: Accuracy,
    /// Distance between the state at t = 0 and where an independent flow brings it after a return, relative to the vibration, in the energy norm;
    /// the residual itself where the orbit was found by a flow, `None` where no flow follows the system, or where it is too large to be followed
    /// without being asked ([`Orbit::return_defect`](super::Orbit::return_defect)).
    pub return_defect: Option<f64>,
    /// Names of joints that stick for the whole period: their offset is not unique, the orbit is one of a continuum
    /// (the symmetric one, with [`Symmetry::HalfPeriod`](super::Symmetry::HalfPeriod)).
    pub stuck: Vec<String>,
    /// Names of joints of which a part, a slider behind a spring or all, sticks for the whole period of a motion that is not its own mirror image:
    /// where it is relaxed depends on how the motion began, and with it the means, and the amplitudes too where a law knows positions. The orbit
    /// is then the one that begins at static equilibrium under the constant loads
    /// ([`StaticEquilibrium`](crate::method::StaticEquilibrium)); with method `transient` the one that its motion led to.
    pub history: Vec<String>,
    /// The largest change of an amplitude with two other histories of the joints named there, without friction forces in static
    /// equilibrium and with the opposite ones, relative to the largest amplitude; `None` where amplitudes do not depend on them, or
    /// where it was not measured (methods other than harmonic balance).
    pub history_spread: Option<f64>,
    /// The algorithm that found the orbit: the method's name, or for harmonic balance the search that succeeded.
    ///
    /// `newton`, `interior-points`, `proximal-points`, `slip-limit-homotopy`, or `time-integration` where Newton's method starts
    /// from a motion that was followed in time. If several searches contributed, the last one that is not `newton` is named.
    pub found_by: &'static str,
    /// The method that was to find it and did not, where another one did: see [`Auto`](crate::method::auto::Auto).
    pub instead_of: Option<&'static str>,
}
