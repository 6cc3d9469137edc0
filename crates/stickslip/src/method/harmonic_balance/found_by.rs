//! The search that found a solution.

/// The search that found a solution, roughly in the order in which the searches are tried. All but
/// the first and the last two are rows of the table in `globalization`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum FoundBy {
    /// Newton's method from an initial guess or a warm start.
    #[default]
    Newton,
    /// Interior point method for rigid friction, then Newton's method.
    InteriorPoints,
    /// Proximal point method for friction forces that the equations leave undetermined.
    ProximalPoints,
    /// Homotopy in the slip limits, from limits at which all joints stick.
    SlipLimitHomotopy,
    /// Newton's method with the history of a vibration that grows slowly.
    GrowingVibration,
    /// Newton's method from a time integration.
    TimeIntegration,
}

impl FoundBy {
    /// Returns the name in tables and in
    /// [`Evidence::found_by`](crate::orbit::Evidence::found_by).
    pub fn name(self) -> &'static str {
        match self {
            FoundBy::Newton => "newton",
            FoundBy::InteriorPoints => "interior-points",
            FoundBy::ProximalPoints => "proximal-points",
            FoundBy::SlipLimitHomotopy => "slip-limit-homotopy",
            FoundBy::GrowingVibration => "growing-vibration",
            FoundBy::TimeIntegration => "time-integration",
        }
    }
}
