//! What keeps the equations regular where the model decides nothing.

use num_complex::Complex64;

/// A direction that nothing holds gets, for its mean position only, a spring that makes it as slow as this fraction of the drive
/// frequency: its mean is arbitrary otherwise. The motion changes by the square of it.
pub(super) const HOLD: f64 = 1e-5;

/// The spring of such a direction at a rate, 1/s² times its mass: at rest only.
pub(super) fn soft_spring(s: Complex64, omega: f64) -> f64 {
    if s == Complex64::ZERO { (HOLD * omega).powi(2) } else { 0.0 }
}

/// How far ε stays above the least one at which a resolvent is single-valued: nearer, its slope grows without bound.
pub(super) const CLEAR: f64 = 2.0;
/// What is added to the diagonal of the force equations, so that forces which nothing decides stay as they are: the mean in a contact
/// that sticks all the time, and forces in redundant contacts. Newton's method leaves this share of the force as an error.
const STAY: [f64; 2] = [1e-9, 1e-12];

/// See [`STAY`].
pub(super) fn stay(h: usize) -> f64 {
    STAY[h.min(1)]
}
