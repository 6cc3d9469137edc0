//! The pieces view: ideal sliders and stops side by side.

/// One of the ideal parts of a law; parts of one law stand side by side and move alike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Piece {
    /// Holds while its force is below its limit, and moves with the force at its limit.
    Slider(Slider),
    /// A spring that acts only beyond a gap: `f = stiffness max(u - gap, 0)`.
    Stop {
        /// Displacement at which it begins to act, m; negative if it is compressed at rest.
        gap: f64,
        /// Stiffness beyond the gap, N/m.
        stiffness: f64,
    },
}

/// An ideal slider, rigid or in series with a spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slider {
    /// Stiffness of the spring in front of it, N/m; `None` if it is rigid.
    pub stiffness: Option<f64>,
    /// Force while it moves, N.
    pub limit: f64,
    /// Force up to which it holds once it rests, N; not below `limit`.
    pub static_limit: f64,
}

impl Piece {
    /// A slider that holds up to the force with which it moves.
    pub fn slider(stiffness: Option<f64>, limit: f64) -> Self {
        Piece::Slider(Slider { stiffness, limit, static_limit: limit })
    }

    /// Whether it is a slider that holds more than it carries in slip.
    pub fn drops(&self) -> bool {
        matches!(self, Piece::Slider(slider) if slider.static_limit > slider.limit)
    }

    /// Whether it never carries a force.
    pub(crate) fn is_nothing(&self) -> bool {
        match self {
            Piece::Slider(slider) => slider.static_limit == 0.0,
            Piece::Stop { stiffness, .. } => *stiffness == 0.0,
        }
    }
}

/// A slip limit that nothing reaches, N; the weight of a mountain.
pub(super) const STUCK: f64 = 1e15;
