//! Parameter ε of the force equation `λ = J(λ + ε v)` of a rigid contact with velocity `v`.

/// Parameter of `ε = (1 + RIPPLE / H) Z`, with the impedance `Z` of the contact at the highest
/// harmonic `H`. The series cannot resolve forces above `H`. With a larger ε the force
/// oscillates in stick; with a smaller one a change of sign is blurred. The second term
/// sharpens the change of sign if the harmonics are few and do not oscillate. One harmonic then
/// gives the describing function.
const RIPPLE: f64 = 30.0;

/// Returns ε (N s/m) of a contact with this receptance (m/N) at the highest harmonic `top`.
pub(crate) fn contact_parameter(receptance: f64, top: usize, omega: f64) -> f64 {
    let impedance = 1.0 / (receptance * top as f64 * omega);
    impedance * (1.0 + RIPPLE / top as f64)
}
