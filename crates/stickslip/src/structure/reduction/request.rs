//! What a user asks of a reduction.

/// How a component is brought into few coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reduction {
    /// Not at all: all its rows are degrees of freedom, and its dynamic stiffness is factored at every frequency.
    None {
        /// The largest frequency of interest, rad/s: a damping ratio is that of every mode up to there. Nothing else asks for it.
        up_to: f64,
    },
    /// With as many modes as the error asks for.
    UpTo {
        /// The largest frequency of interest, rad/s: of the drive with all harmonics that count.
        up_to: f64,
        /// The largest relative error of what the model sees up to there.
        tolerance: f64,
        /// Of one kind only, if it is named.
        kind: Option<ReductionKind>,
    },
    /// With so many modes.
    Modes {
        /// How many.
        modes: usize,
        /// Of which kind.
        kind: ReductionKind,
        /// Orders of residual vectors beside free modes, from 1 on: each makes two more terms of their series exact.
        orders: usize,
        /// The largest frequency of interest, rad/s, up to which the error is measured; zero: as far as so many modes serve, which is up to the
        /// last of them over 1.5.
        up_to: f64,
    },
}

/// Kinds of reduction, see [`reduction`](super).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReductionKind {
    /// Free modes, and what the others add at the places.
    Rubin,
    /// Modes with the places held, and static answers to unit motions of them.
    CraigBampton,
}

impl Reduction {
    /// The relative error of what is seen that is small beside that of any law of friction.
    pub const TOLERANCE: f64 = 1e-4;

    /// As many modes as that error asks for, of whatever kind, up to a frequency in rad/s.
    pub fn up_to(up_to: f64) -> Self {
        Reduction::UpTo { up_to, tolerance: Self::TOLERANCE, kind: None }
    }
}
