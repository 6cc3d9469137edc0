//! The unit at the end of a column's name: `force_N`, `acceleration_m_per_s2`.

use crate::syntax::units::{self, Unit};

/// Standard gravity, m/s², of accelerations that are stated in multiples of it.
pub(super) const STANDARD_GRAVITY: f64 = 9.80665;

/// Splits a name into its beginning and the unit at its end; the longest end that is a unit
/// counts.
pub(super) fn split_name(name: &str) -> Option<(&str, Unit)> {
    name.match_indices('_').find_map(|(at, _)| {
        let (begin, end) = (&name[..at], &name[at + 1..]);
        (!begin.is_empty()).then_some(())?;
        Some((begin, parse_end(end)?))
    })
}

/// Parses a unit as column names write it: `N_per_m`, `m_per_s2`.
fn parse_end(text: &str) -> Option<Unit> {
    let mut unit = text.replace("_per_", "/").replace('_', " ");
    // a digit at the end is a power
    if let Some(digit) = unit.chars().last().filter(char::is_ascii_digit) {
        unit.truncate(unit.len() - 1);
        unit.push('^');
        unit.push(digit);
    }
    unit.starts_with(|c: char| c.is_alphabetic()).then(|| units::parse(&unit)).flatten()
}

/// Parses a unit as titles write it. Titles write powers without a sign, and brackets around
/// the parts of a quotient: `m/s2`, `(m/s^2)/(N)`.
pub(super) fn parse_title(text: &str) -> Option<Unit> {
    let plain: String = text.chars().filter(|c| !"()[]".contains(*c)).collect();
    if let Some(unit) = units::parse(&plain) {
        return Some(unit);
    }
    let mut powers = String::with_capacity(plain.len() + 2);
    let mut before = None;
    for c in plain.chars() {
        if c.is_ascii_digit() && before.is_some_and(char::is_alphabetic) {
            powers.push('^');
        }
        powers.push(c);
        before = Some(c);
    }
    units::parse(&powers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use stickslip::dimension::Dimension;

    #[test]
    fn units_at_the_end_of_names_and_in_titles() {
        let split =
            |name: &str| split_name(name).map(|(begin, unit)| (begin.to_owned(), unit.si_value("1"), unit.dimension));
        let acceleration = Dimension { kg: 0, m: 1, s: -2, rad: 0 };
        assert_eq!(split("tip_acceleration_m_per_s2"), Some(("tip_acceleration".to_owned(), 1.0, acceleration)));
        assert_eq!(split("force_kN"), Some(("force".to_owned(), 1000.0, Dimension::FORCE)));
        assert_eq!(split("k_N_per_m"), Some(("k".to_owned(), 1.0, Dimension::STIFFNESS)));
        assert_eq!((split("force"), split("sweep_1"), split("_N")), (None, None, None));
        assert_eq!(parse_title("m/s2").map(|unit| unit.dimension), Some(acceleration));
        assert_eq!(parse_title("(mm/s^2)").map(|unit| unit.si_value("1")), Some(1e-3));
    }
}
