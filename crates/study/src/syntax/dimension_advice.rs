//! Advice for a quantity of the wrong dimension: its probable meaning, and the correct way to
//! write it.

use stickslip::dimension::Dimension;

const fn dimension(kg: i8, m: i8, s: i8, rad: i8) -> Dimension {
    Dimension { kg, m, s, rad }
}

/// Pairs of the expected dimension and the dimension that a model of rotation has there.
const ROTATION_PAIRS: [(Dimension, Dimension); 9] = [
    (Dimension::MASS, dimension(1, 2, 0, 0)),
    (Dimension::STIFFNESS, dimension(1, 2, -2, -1)),
    (Dimension::STIFFNESS, Dimension::ENERGY),
    (Dimension::DAMPING, dimension(1, 2, -1, -1)),
    (Dimension::DAMPING, dimension(1, 2, -1, 0)),
    (Dimension::FORCE, Dimension::ENERGY),
    (Dimension::LENGTH, Dimension::ANGLE),
    (Dimension::VELOCITY, Dimension::FREQUENCY),
    (Dimension::CUBIC_STIFFNESS, dimension(1, 2, -2, -3)),
];

const TORSION: &str = "this quantity belongs to a rotation, but the masses of this model are in kg; in a model of \
    rotation every `mass` is a moment of inertia in kg m^2, and then stiffnesses are in N m/rad, dampings in N m s/rad, \
    forces and slip limits in N m, motions in rad";

/// Returns advice for a quantity of dimension `found` where `expected` is required; `text` is
/// the user's text.
pub(crate) fn dimension_advice(expected: Dimension, found: Dimension, text: &str) -> Option<String> {
    let said = match (expected, found) {
        _ if ROTATION_PAIRS.contains(&(expected, found)) => TORSION,
        (Dimension::STIFFNESS, Dimension::PRESSURE) => {
            "this is a pressure; write a stiffness as a force over a length, such as \"10 N/mm\", or as a pressure \
             times an area over a length: \"210 GPa * 3 mm^2/(40 mm)\""
        }
        (Dimension::FORCE, Dimension::PRESSURE) => {
            "this is a pressure; multiply it by the area on which it acts: \"10 N/mm^2 * 25 mm^2\""
        }
        (_, Dimension::PRESSURE) => "this is a pressure, a force over an area",
        (Dimension::LENGTH | Dimension::ACCELERATION | Dimension::FORCE, Dimension::MASS) if is_grams(text) => {
            match expected {
                Dimension::FORCE => {
                    "`g` is the gram; write the acceleration of gravity as 9.80665 m/s^2, and a force as a mass times \
                 it: \"2 kg * 9.80665 m/s^2\""
                }
                Dimension::LENGTH => {
                    "`g` is the gram; write the acceleration of gravity as 9.80665 m/s^2; a motion is stated by its \
                 displacement, which at one frequency is the acceleration over the squared angular frequency: \
                 \"2*9.80665 m/s^2/(50 Hz)^2 * (1 rad)^2\""
                }
                _ => "`g` is the gram; write the acceleration of gravity as 9.80665 m/s^2",
            }
        }
        (Dimension::LENGTH, Dimension::ACCELERATION) => {
            "a motion is stated by its displacement, which at one frequency is the acceleration over the squared \
             angular frequency: \"20 m/s^2/(50 Hz)^2 * (1 rad)^2\""
        }
        (Dimension::FORCE, Dimension::ACCELERATION) => "a force is a mass times an acceleration: \"2 kg * 20 m/s^2\"",
        _ => return None,
    };
    Some(said.to_owned())
}

/// Returns whether a number is in grams. Users write `g` for the acceleration of gravity.
fn is_grams(text: &str) -> bool {
    let unit = text.trim().trim_start_matches(|c: char| c.is_ascii_digit() || "+-.eE ".contains(c));
    unit == "g" && !text.contains('*')
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::syntax::expression::quantity;

    fn said(text: &str, expected: Dimension) -> String {
        quantity(text, expected).unwrap_err().help.unwrap_or_default()
    }

    #[test]
    fn advice_names_the_intended_quantity() {
        for (text, expected, words) in [
            ("10 N/mm^2", Dimension::STIFFNESS, "this is a pressure"),
            ("1 MPa", Dimension::FORCE, "10 N/mm^2 * 25 mm^2"),
            ("0.05 kg m^2", Dimension::MASS, "moment of inertia in kg m^2"),
            ("2000 N m/rad", Dimension::STIFFNESS, "stiffnesses are in N m/rad"),
            ("0.05 N m s/rad", Dimension::DAMPING, "dampings in N m s/rad"),
            ("3 N m", Dimension::FORCE, "slip limits in N m"),
            ("2 g", Dimension::LENGTH, "`g` is the gram"),
            ("2 g", Dimension::FORCE, "2 kg * 9.80665 m/s^2"),
            ("20 m/s^2", Dimension::LENGTH, "over the squared angular frequency"),
        ] {
            assert!(said(text, expected).contains(words), "{text}: {}", said(text, expected));
        }
        // a mass in grams where a stiffness is expected is not mistaken for an acceleration
        assert_eq!(said("2 g", Dimension::STIFFNESS), "");
    }

    /// The quantities in the advice are valid and have the expected dimension.
    #[test]
    fn advised_quantities_have_the_dimension() {
        for (text, dimension) in [
            ("210 GPa * 3 mm^2/(40 mm)", Dimension::STIFFNESS),
            ("10 N/mm^2 * 25 mm^2", Dimension::FORCE),
            ("2 kg * 9.80665 m/s^2", Dimension::FORCE),
            ("2*9.80665 m/s^2/(50 Hz)^2 * (1 rad)^2", Dimension::LENGTH),
            ("20 m/s^2/(50 Hz)^2 * (1 rad)^2", Dimension::LENGTH),
        ] {
            assert!(quantity(text, dimension).is_ok(), "{text}");
        }
        // 2 g at 50 Hz is 0.2 mm: 2 * 9.80665 / (2 pi 50)^2
        let amplitude = quantity("2*9.80665 m/s^2/(50 Hz)^2 * (1 rad)^2", Dimension::LENGTH).unwrap();
        assert!((amplitude / 1.9872428e-04 - 1.0).abs() < 1e-6, "{amplitude}");
    }
}
