//! The view of ideal elements: ideal sliders and stops in parallel.

/// An ideal part of a law. The parts of one law act in parallel and have the same displacement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum IdealElement {
    /// Sticks while its force is below its limit, and slips with the force at its limit.
    Slider(Slider),
    /// A spring that acts only beyond a gap: `f = stiffness max(u - gap, 0)`.
    Stop {
        /// Displacement at which the stop begins to act, m; negative if it is compressed at
        /// `u = 0`.
        gap: f64,
        /// Stiffness beyond the gap, N/m.
        stiffness: f64,
    },
}

/// An ideal slider, rigid or in series with a spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slider {
    /// Stiffness of the spring in series, N/m; `None` if the slider is rigid.
    pub stiffness: Option<f64>,
    /// Force during slip, N.
    pub limit: f64,
    /// Largest force during stick, N; not below `limit`.
    pub static_limit: f64,
}

impl IdealElement {
    /// Returns a slider with equal static and dynamic limits.
    pub fn slider(stiffness: Option<f64>, limit: f64) -> Self {
        IdealElement::Slider(Slider { stiffness, limit, static_limit: limit })
    }

    /// Tells whether this is a slider whose static limit exceeds its dynamic limit.
    pub fn has_force_drop(&self) -> bool {
        matches!(self, IdealElement::Slider(slider) if slider.static_limit > slider.limit)
    }

    /// Tells whether the part never carries a force.
    pub(crate) fn carries_no_force(&self) -> bool {
        match self {
            IdealElement::Slider(slider) => slider.static_limit == 0.0,
            IdealElement::Stop { stiffness, .. } => *stiffness == 0.0,
        }
    }
}

/// A slip limit that no force reaches, N.
pub(in crate::law) const UNREACHABLE_LIMIT: f64 = 1e15;
