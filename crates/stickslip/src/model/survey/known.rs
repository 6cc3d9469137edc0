//! What a survey tells of a model.

/// A mode of the linear structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearMode {
    /// Undamped natural frequency, rad/s; where the damping has a gyroscopic part that of free vibration, `Im λ`.
    pub omega: f64,
    /// Damping ratio `φᵀCφ / (2ω φᵀMφ)`: exact where damping does not couple the modes, and to first order where it is
    /// light. Where the damping has a gyroscopic part, `-Re λ / |λ|`.
    pub damping: f64,
}

/// The modes of a linear structure.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Modes {
    /// Those with a frequency, rising.
    pub elastic: Vec<LinearMode>,
    /// Motions that no spring resists.
    pub rigid: usize,
    /// Modes whose frequency is lost in rounding beside stiffnesses many orders higher.
    pub lost: usize,
}

/// How a joint holds while it is stuck, and when it lets go.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstSlip {
    /// Name of the joint.
    pub joint: String,
    /// Limit of the slider that gives way first, N; zero if the joint carries nothing. Of a joint that slips little by little the one at which all of
    /// it slips.
    pub limit: f64,
    /// Relative displacement from the unloaded state at which it gives way, m; `None` if it holds rigidly until the
    /// limit.
    pub displacement: Option<f64>,
    /// Whether it slips little by little before that: micro-slip at every load.
    pub gradual: bool,
    /// Of the direction along which faces press on each other, which opens and closes and never slips: the force with
    /// which they do where nothing gives way, N, zero if they are apart. `None` along the others.
    pub pressed: Option<f64>,
    /// What is left of it at rest, under the constant forces, after the structure has given way, N: not positive where it takes all. `None` where
    /// nobody knows: without a preload, beside rigid friction, or in models too large for a quick answer.
    pub at_rest: Option<f64>,
}

/// How much of its limit a stuck joint needs under the model's excitation, over a range of drive frequencies.
#[derive(Debug, Clone, PartialEq)]
pub struct Onset {
    /// Largest amplitude of the joint's load over its limit. The joint slips where it is above 1; the excitation times
    /// `1 / largest` is the smallest that makes it slip.
    pub largest: f64,
    /// Where that is, rad/s.
    pub at: f64,
    /// The stretches of the range in which it is above 1, rad/s. They hold for a joint that slips first: what the
    /// others do after it has slipped changes the structure.
    pub slips: Vec<(f64, f64)>,
}

/// Masses that no spring holds, as one body that can drift.
#[derive(Debug, Clone, PartialEq)]
pub struct Loose {
    /// Their names.
    pub masses: Vec<String>,
    /// Whether joints that are stuck hold it.
    pub held_by_friction: bool,
    /// Whether joints hold it whose force nothing bounds, and which have no stiffness at rest.
    pub held_in_motion: bool,
    /// The joints with faces that press on it, which hold it while they do.
    pub contacts: Vec<String>,
    /// The joints with faces that nothing presses, which may touch it.
    pub faces: Vec<String>,
}

/// Contacts that are pressed before anything is loaded, and carry nothing at rest: their preload has pushed away a body that nothing else holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Unpressed {
    /// The joints.
    pub joints: Vec<String>,
    /// The sum of their preloads, N.
    pub preload: f64,
}
