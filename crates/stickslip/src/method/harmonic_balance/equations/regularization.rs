//! Regularization of equations that the model leaves singular.

use num_complex::Complex64;

/// Frequency, relative to the excitation frequency, that a regularizing spring gives to an
/// unsupported direction. The spring acts on the mean position alone, which is otherwise
/// undetermined. It changes the motion by the square of this number.
pub(crate) const REGULARIZING_FREQUENCY: f64 = 1e-5;

/// Returns the regularizing stiffness per mass, 1/s², at the complex rate `s`. It is zero
/// unless `s` is zero.
pub(crate) fn regularizing_stiffness(s: Complex64, omega: f64) -> f64 {
    if s == Complex64::ZERO { (REGULARIZING_FREQUENCY * omega).powi(2) } else { 0.0 }
}

/// Least ratio of ε to the value at which the resolvent becomes single-valued. Closer to that
/// value the slope of the resolvent grows without bound.
pub(crate) const LEAST_EPSILON_RATIO: f64 = 2.0;
/// Regularization on the diagonal of the force equations: for the mean, and for the other
/// harmonics. It keeps undetermined forces at their values: the mean force of a permanently
/// stuck contact, and the forces of redundant contacts. Newton's method leaves this share of
/// the force as an error.
const FORCE_REGULARIZATION: [f64; 2] = [1e-9, 1e-12];

/// Returns the regularization of a force equation at harmonic `h`, see [`FORCE_REGULARIZATION`].
pub(crate) fn force_regularization(h: usize) -> f64 {
    FORCE_REGULARIZATION[h.min(1)]
}
