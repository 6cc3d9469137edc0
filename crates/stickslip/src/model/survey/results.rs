//! Results of a survey of a model.

/// A mode of the linear structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NaturalMode {
    /// Undamped natural frequency, rad/s. If the damping has a gyroscopic part, the frequency
    /// of free vibration, `Im λ`.
    pub omega: f64,
    /// Damping ratio `φᵀCφ / (2ω φᵀMφ)`.
    ///
    /// It is exact if damping does not couple the modes, and correct to first order for light
    /// damping. If the damping has a gyroscopic part, `-Re λ / |λ|`.
    pub damping: f64,
}

/// The modes of a linear structure.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LinearModes {
    /// Modes with a nonzero frequency, in ascending order.
    pub elastic: Vec<NaturalMode>,
    /// Number of motions without a restoring spring.
    pub rigid: usize,
    /// Number of modes whose frequency is lost in rounding, because other stiffnesses are many
    /// orders of magnitude higher.
    pub unresolved: usize,
}

/// The stuck state of a joint, and the load at which it slips.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstSlip {
    /// Name of the joint.
    pub joint: String,
    /// Limit of the slider that slips first, N; zero if the joint carries no force. For a joint
    /// that slips gradually, the limit of complete slip.
    pub limit: f64,
    /// Relative displacement from the unloaded state at which slip begins, m. `None` if the
    /// joint is rigid up to the limit.
    pub displacement: Option<f64>,
    /// True if the joint slips gradually, with micro-slip at every load.
    pub gradual: bool,
    /// For a normal direction, which opens and closes but never slips: the force that presses
    /// the faces together at zero displacement, N; zero if they are apart. `None` for other
    /// directions.
    pub preload: Option<f64>,
    /// Contact force in static equilibrium under the constant forces, N, with the deformation
    /// of the structure. It is zero or negative if the contact opens.
    ///
    /// `None` if it is unknown: without preload, in models with rigid friction, or in models
    /// too large for a quick answer.
    pub equilibrium_force: Option<f64>,
    /// Component along this direction of the constant forces on the places that it connects, N.
    /// Along a normal direction a positive component closes the contact.
    pub constant_force: f64,
}

/// Load of a stuck joint relative to its limit under the model's excitation, over a range of
/// excitation frequencies.
#[derive(Debug, Clone, PartialEq)]
pub struct SlipOnset {
    /// Largest amplitude of the joint's load divided by its limit. The joint slips where this
    /// is above 1. The excitation times `1 / largest` is the smallest one that makes it slip.
    pub largest: f64,
    /// Frequency of the largest load, rad/s.
    pub omega: f64,
    /// Intervals of the range with a load above 1, rad/s. They are valid for the joint that
    /// slips first: after that, the slip of other joints changes the structure.
    pub slip_ranges: Vec<(f64, f64)>,
}

/// Places of a body that no spring holds, so that it can drift.
#[derive(Debug, Clone, PartialEq)]
pub struct LooseBody {
    /// Names of the places.
    pub masses: Vec<String>,
    /// True if stuck joints hold the body.
    pub held_by_friction: bool,
    /// True if joints of unbounded force without stiffness in static equilibrium hold the body.
    pub held_in_motion: bool,
    /// Joints with faces that press on the body and hold it as long as they do.
    pub contacts: Vec<String>,
    /// Joints with faces without pressure that can touch the body.
    pub faces: Vec<String>,
}

/// Contacts with a preload that carry no force in static equilibrium. Their preload moves a
/// body that nothing else holds.
#[derive(Debug, Clone, PartialEq)]
pub struct UnloadedContacts {
    /// Names of the joints.
    pub joints: Vec<String>,
    /// The sum of their preloads, N.
    pub preload: f64,
}
