//! The sliding view: set-valued friction in one direction whose force during slip is a smooth
//! function of velocity.
//!
//! `|f| ≤ g(0)` at rest, `f = sgn(u') g(u')` during slip. The motion is smooth while the joint
//! sticks or keeps its direction of slip. Methods that locate the transitions therefore need no
//! regularization.

use std::fmt::Debug;

/// The friction force as a function of velocity.
pub trait SlidingView: Debug + Send + Sync {
    /// Returns the friction force `g` (N) at a velocity (m/s) and its derivative (N s/m). `g` is
    /// even in the velocity. The branch of one direction is continued smoothly beyond zero
    /// velocity, because iterations may evaluate it there.
    fn slip_force(&self, velocity: f64) -> (f64, f64);
}
