//! Names of the columns that several kinds write. The names of one kind are in its folder.

/// Excitation frequency, Hz.
pub(crate) const FREQUENCY: &str = "frequency_Hz";
/// Amplitude of a peak, m.
pub(crate) const AMPLITUDE: &str = "amplitude_m";
/// True if a peak is only the end of the range.
pub(crate) const AT_RANGE_END: &str = "at_range_end";
/// True if only the reverse sweep has the peak.
pub(crate) const REVERSE_SWEEP: &str = "reverse_sweep";
/// Return defect.
pub(crate) const RESIDUAL: &str = "residual";
/// Relative difference of the work put in and the energy lost.
pub(crate) const ENERGY_GAP: &str = "energy_gap";
/// Largest relative error of a reduced model at its places, compared with the full structure.
pub(crate) const REDUCTION_ERROR: &str = "reduction_error";

/// Name of the amplitude column of a place that is a displacement, m.
pub(crate) fn amplitude_of(place: &str) -> String {
    amplitude_in(place, "m")
}

/// Name of the amplitude column of a place in its unit: m, or rad for a rotation.
pub(crate) fn amplitude_in(place: &str, unit: &str) -> String {
    format!("{place}_amplitude_{unit}")
}

/// Name of the column with the magnitude of the first harmonic of a place, m.
pub(crate) fn first_harmonic_of(place: &str) -> String {
    first_harmonic_in(place, "m")
}

/// Name of that column for a place in its unit: m, or rad for a rotation.
pub(crate) fn first_harmonic_in(place: &str, unit: &str) -> String {
    format!("{place}_first_harmonic_{unit}")
}

/// Name of the column with the phase of the first harmonic, degrees.
///
/// The reference is the excitation; in free vibration it is the place that moves most.
pub(crate) fn phase_of(place: &str) -> String {
    format!("{place}_phase_deg")
}

/// Name of the column with the displacement of a place in a mode of unit modal mass, 1/√kg.
pub(crate) fn shape_of(place: &str) -> String {
    format!("{place}_shape_per_sqrt_kg")
}

/// Name of the column with the fraction of the period in which a joint slips.
pub(crate) fn slip_fraction(joint: &str) -> String {
    format!("{joint}_slip_fraction")
}

/// Name of the column with the fraction of the period in which the faces stick.
pub(crate) fn stick_fraction(joint: &str) -> String {
    format!("{joint}_stick_fraction")
}

/// Name of the column with the fraction of the period in which the faces are apart.
pub(crate) fn open_fraction(joint: &str) -> String {
    format!("{joint}_open_fraction")
}

/// Returns the name of a ring place in its sector, and the sector number.
///
/// Returns `None` for a name without a sector number.
///
/// # Example
/// ```
/// use stickslip_study::results::place_and_sector;
/// assert_eq!(place_and_sector("tip_12.x"), Some(("tip.x".to_owned(), 12)));
/// assert_eq!(place_and_sector("blade"), None);
/// ```
pub fn place_and_sector(name: &str) -> Option<(String, usize)> {
    let (node, along) = name.split_once('.').map_or((name, None), |(node, along)| (node, Some(along)));
    let (place, sector) = node.rsplit_once('_')?;
    let place = along.map_or_else(|| place.to_owned(), |along| format!("{place}.{along}"));
    Some((place, sector.parse().ok()?))
}
