//! The user's request for a reduction.

/// The method of reduction of a component.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reduction {
    /// No reduction: all rows are degrees of freedom, and the dynamic stiffness is factored at
    /// every frequency.
    None {
        /// Highest frequency of interest, rad/s. It is used only for a damping ratio, which
        /// applies to every mode up to this frequency.
        up_to: f64,
    },
    /// The number of modes follows from the required error.
    UpTo {
        /// Highest frequency of interest, rad/s, including all significant harmonics of the
        /// excitation.
        up_to: f64,
        /// Largest relative error of the observed displacements up to this frequency.
        tolerance: f64,
        /// Kind of reduction; `None` allows all.
        kind: Option<ReductionKind>,
    },
    /// A fixed number of modes.
    Modes {
        /// Number of modes.
        modes: usize,
        /// Kind of reduction.
        kind: ReductionKind,
        /// Orders of residual vectors for free modes, at least 1. Each order makes two more
        /// terms of their series exact.
        orders: usize,
        /// Highest frequency for the error estimate, rad/s. Zero means the frequency of the
        /// last mode divided by 1.5.
        up_to: f64,
    },
}

/// Kinds of reduction; see [`reduction`](super).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReductionKind {
    /// Free modes, and the static response of the omitted modes at the places.
    Rubin,
    /// Modes with fixed places, and static responses to unit displacements of the places.
    CraigBampton,
}

impl Reduction {
    /// Default relative error of the observed displacements. It is small compared with the
    /// uncertainty of any friction law.
    pub const TOLERANCE: f64 = 1e-4;

    /// Requests as many modes of any kind as the default error requires, up to a frequency in
    /// rad/s.
    pub fn up_to(up_to: f64) -> Self {
        Reduction::UpTo { up_to, tolerance: Self::TOLERANCE, kind: None }
    }
}
