//! The search that found a solution.

/// The search that found a solution, from the usual one to the last resort.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum FoundBy {
    /// Newton's method from a guess or from a neighbouring orbit.
    #[default]
    Newton,
    /// An interior-point path along all rigid joints, then Newton's method.
    InteriorPoints,
    /// Proximal points for friction forces that the equations leave open.
    ProximalPoints,
    /// Slip limits lowered from values at which everything sticks.
    SlipLimitHomotopy,
    /// Newton's method from a motion that was followed in time.
    TimeIntegration,
}

impl FoundBy {
    /// The name in tables and in [`Evidence::found_by`](crate::orbit::Evidence::found_by).
    pub fn name(self) -> &'static str {
        match self {
            FoundBy::Newton => "newton",
            FoundBy::InteriorPoints => "interior-points",
            FoundBy::ProximalPoints => "proximal-points",
            FoundBy::SlipLimitHomotopy => "slip-limit-homotopy",
            FoundBy::TimeIntegration => "time-integration",
        }
    }
}
