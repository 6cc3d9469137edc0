//! Keys of `signal`: excitations of a transient that a study states by a few numbers.

use super::key::{Bounds, Key, ValueType, default, optional, required};
use stickslip::dimension::Dimension;

const FREQUENCY: ValueType = ValueType::Quantity(Dimension::FREQUENCY, Bounds::Positive);

/// The kinds of signals.
fn kinds() -> Vec<(&'static str, &'static str)> {
    vec![
        ("half-sine", "a shock: half of a sine of `amplitude` and `duration`"),
        ("chirp", "a sine of `amplitude` whose frequency changes from `from` to `to`"),
        ("random", "a normal process of constant spectral `density` between `from` and `to`"),
    ]
}

fn scales() -> Vec<(&'static str, &'static str)> {
    vec![("linear", "equal differences in equal times"), ("log", "equal ratios in equal times")]
}

/// Returns the keys of a signal of this dimension.
const fn keys(dimension: Dimension, amplitude: &'static str, density: &'static str) -> [Key; 9] {
    let Dimension { kg, m, s, rad } = dimension;
    let per_frequency = Dimension { kg: 2 * kg, m: 2 * m, s: 2 * s + 1, rad: 2 * rad - 1 };
    [
        required("kind", ValueType::Choice(kinds), "the signal", "\"half-sine\""),
        optional(
            "amplitude",
            ValueType::Quantity(dimension, Bounds::Finite),
            "amplitude of a half-sine or a chirp",
            amplitude,
        ),
        optional(
            "density",
            ValueType::Quantity(per_frequency, Bounds::Positive),
            "one-sided power spectral density of a random process",
            density,
        ),
        optional("from", FREQUENCY, "first frequency of a chirp, lowest frequency of a random process", "\"5 Hz\""),
        optional("to", FREQUENCY, "last frequency of a chirp, highest frequency of a random process", "\"50 Hz\""),
        required(
            "duration",
            ValueType::Quantity(Dimension::TIME, Bounds::Positive),
            "length of the signal; it is zero before and after",
            "\"11 ms\"",
        ),
        default(
            "begin",
            ValueType::Quantity(Dimension::TIME, Bounds::AtLeastZero),
            "0 s",
            "beginning of the signal",
            "\"0.1 s\"",
        ),
        default("scale", ValueType::Choice(scales), "linear", "frequency of a chirp over time", "\"log\""),
        default("seed", ValueType::Count(0, i64::MAX), "1", "seed of a random process", "7"),
    ]
}

/// Keys of the signal of a force.
pub const FORCE_SIGNAL: &[Key] = &keys(Dimension::FORCE, "\"50 N\"", "\"2 N^2/Hz\"");

/// Keys of the signal of the ground's acceleration.
pub const GROUND_SIGNAL: &[Key] =
    &keys(Dimension { kg: 0, m: 1, s: -2, rad: 0 }, "\"100 m/s^2\"", "\"0.5 m^2/s^4/Hz\"");
