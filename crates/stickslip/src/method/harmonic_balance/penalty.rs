//! The penalty ε of a rigid contact: what of its velocity is added to its force before the slip limit cuts it.

/// The penalty ε is the contact's impedance at the highest harmonic times `1 + RIPPLE / highest`. Above that harmonic a series cannot
/// follow the force: with a larger ε it chatters in stick, with a smaller one a passage through zero is blurred. The second term
/// makes the passage sharp where the harmonics are few and do not chatter, so that one harmonic is the describing function.
const RIPPLE: f64 = 30.0;

/// The penalty ε (N s/m) of a contact with the receptance (m/N) of the highest harmonic `top`, see [`RIPPLE`].
pub(super) fn penalty(receptance: f64, top: usize, omega: f64) -> f64 {
    let impedance = 1.0 / (receptance * top as f64 * omega);
    impedance * (1.0 + RIPPLE / top as f64)
}
