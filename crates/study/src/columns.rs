//! Names of the columns that several kinds write, each said once; those of one kind stand beside it.

/// Drive frequency, Hz.
pub(crate) const FREQUENCY: &str = "frequency_Hz";
/// Amplitude of a peak, m.
pub(crate) const AMPLITUDE: &str = "amplitude_m";
/// Whether a peak is only the end of the range.
pub(crate) const AT_RANGE_END: &str = "at_range_end";
/// Whether only the way back from the last frequency to the first has a peak.
pub(crate) const WAY_BACK: &str = "way_back";
/// Defect of the return map.
pub(crate) const RESIDUAL: &str = "residual";
/// Relative gap between work put in and energy lost.
pub(crate) const ENERGY_GAP: &str = "energy_gap";
/// The largest relative error of a structure in few coordinates against the whole, of what its places see.
pub(crate) const REDUCTION_ERROR: &str = "reduction_error";

/// The amplitude of a place that is a displacement, m.
pub(crate) fn amplitude_of(place: &str) -> String {
    amplitude_in(place, "m")
}

/// The amplitude of a place in its unit: m, or rad of a rotation.
pub(crate) fn amplitude_in(place: &str, unit: &str) -> String {
    format!("{place}_amplitude_{unit}")
}

/// The size of the first harmonic of a place, m.
pub(crate) fn first_harmonic_of(place: &str) -> String {
    first_harmonic_in(place, "m")
}

/// The same in its unit: m, or rad of a rotation.
pub(crate) fn first_harmonic_in(place: &str, unit: &str) -> String {
    format!("{place}_first_harmonic_{unit}")
}

/// The phase of its first harmonic against the drive, degrees; in free vibration against the place that moves most.
pub(crate) fn phase_of(place: &str) -> String {
    format!("{place}_phase_deg")
}

/// The displacement of a place in a mode whose modal mass is one, 1/√kg.
pub(crate) fn shape_of(place: &str) -> String {
    format!("{place}_shape_per_sqrt_kg")
}

/// The fraction of the period in which a joint slips.
pub(crate) fn slips(joint: &str) -> String {
    format!("{joint}_slip_fraction")
}

/// The fraction in which its faces stick.
pub(crate) fn sticks(joint: &str) -> String {
    format!("{joint}_stick_fraction")
}

/// The fraction in which they are apart.
pub(crate) fn open(joint: &str) -> String {
    format!("{joint}_open_fraction")
}
