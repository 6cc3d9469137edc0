//! The sliding view: set-valued friction along one direction whose force in slip is a smooth curve.
//!
//! `|f| ≤ g(0)` at rest, `f = sgn(u') g(u')` in slip. While the faces keep one direction of slip, or rest, the motion is
//! smooth; methods that locate the switches between these need no smoothing.

use std::fmt::Debug;

/// The curve of a friction force over the velocity.
pub trait Sliding: Debug + Send + Sync {
    /// Friction `g` at a velocity (m/s), N, and its derivative, N s/m. It is even in the velocity, and the branch of one
    /// direction goes on smoothly beyond zero: iterations may look there.
    fn slip_force(&self, velocity: f64) -> (f64, f64);
}
