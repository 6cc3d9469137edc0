//! Maximum of a function in an interval, by golden-section search.
//!
//! Every step costs one function value and reduces the interval to (√5 - 1)/2 of its length.
//! The function may be smooth or have kinks; a value may be expensive, and may fail.
//! Source: Kiefer, Sequential minimax search for a maximum, Proc. AMS 4 (1953) 502-506.

/// (√5 - 1)/2.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Returns the place and the value of the largest function value that the search evaluates.
///
/// The search takes place between `ends`, in either order. It stops when `converged`
/// accepts the two ends of the remaining interval, or when rounding leaves no
/// number between them. Of equal values the first one evaluated counts. A
/// function without a value at some place returns negative infinity there.
///
/// A function with one maximum between the ends gives this maximum; another
/// function gives a local maximum.
///
/// # Errors
/// The error of `value`, at once.
///
/// # Example
/// ```
/// use stickslip_numerics::golden_section::golden_section;
/// let converged = |a: f64, b: f64| (b - a).abs() < 1e-6;
/// let (at, height) =
///     golden_section((0.0, 3.0), converged, |x| Ok::<_, ()>(1.0 - (x - 2.0).abs())).unwrap();
/// assert!((at - 2.0).abs() < 1e-6 && (height - 1.0).abs() < 1e-6);
/// ```
pub fn golden_section<E>(
    ends: (f64, f64),
    converged: impl Fn(f64, f64) -> bool,
    mut value: impl FnMut(f64) -> Result<f64, E>,
) -> Result<(f64, f64), E> {
    let (mut a, mut b) = ends;
    let (mut left, mut right) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
    let (mut value_left, mut value_right) = (value(left)?, value(right)?);
    let mut best = if value_right > value_left { (right, value_right) } else { (left, value_left) };
    let distinct = |a: f64, left: f64, right: f64, b: f64| {
        (a < left && left < right && right < b) || (a > left && left > right && right > b)
    };
    while distinct(a, left, right, b) && !converged(a, b) {
        let candidate = if value_left >= value_right {
            (b, right, value_right) = (right, left, value_left);
            left = b - GOLDEN * (b - a);
            value_left = value(left)?;
            (left, value_left)
        } else {
            (a, left, value_left) = (left, right, value_right);
            right = a + GOLDEN * (b - a);
            value_right = value(right)?;
            (right, value_right)
        };
        if candidate.1 > best.1 {
            best = candidate;
        }
    }
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places whose values differ by rounding only around a smooth maximum: the
    /// square root of rounding.
    const FLAT: f64 = 1e-7;

    fn found(ends: (f64, f64), f: impl Fn(f64) -> f64) -> (f64, f64) {
        golden_section(ends, |a, b| (b - a).abs() < 1e-9, |x| Ok::<_, ()>(f(x))).unwrap()
    }

    #[test]
    fn smooth_maxima_and_kinks_are_met_from_either_end() {
        for ends in [(0.0, 3.0), (3.0, 0.0)] {
            let (at, height) = found(ends, f64::sin);
            assert!((at - std::f64::consts::FRAC_PI_2).abs() < FLAT && (height - 1.0).abs() < 1e-14, "{at} {height}");
            let (at, _) = found(ends, |x| if x < 1.25 { x } else { 2.5 - x });
            assert!((at - 1.25).abs() < 1e-9, "{at}");
        }
    }

    #[test]
    fn a_maximum_at_an_end_is_approached() {
        let (at, _) = found((0.0, 1.0), |x| x);
        assert!(1.0 - at < 1e-9, "{at}");
    }

    #[test]
    fn ends_a_few_roundings_apart_are_an_end() {
        for roundings in 0..12u64 {
            let b = f64::from_bits(100f64.to_bits() + roundings);
            for ends in [(100.0, b), (b, 100.0), (-b, -100.0)] {
                let mut values = 0;
                let counted = |x: f64| {
                    values += 1;
                    Ok::<_, ()>(x)
                };
                let (at, _) = golden_section(ends, |_, _| false, counted).unwrap();
                let (low, high) = (ends.0.min(ends.1), ends.0.max(ends.1));
                assert!((low..=high).contains(&at) && values < 12, "{ends:?}: {at} after {values}");
            }
        }
        let (at, _) = golden_section((0.0, 3.0), |_, _| false, |x: f64| Ok::<_, ()>(-(x - 2.0).abs())).unwrap();
        assert!((at - 2.0).abs() < 1e-14, "{at}");
    }

    #[test]
    fn a_step_costs_one_value_and_keeps_the_golden_share() {
        let mut places = Vec::new();
        let value = |x: f64| {
            places.push(x);
            Ok::<_, ()>(-x * x)
        };
        // 1/φ^20 = 6.6e-5 and 1/φ^21 = 4.1e-5 of the interval.
        golden_section((-1.0, 1.0), |a, b| b - a < 2.0 * 5e-5, value).unwrap();
        assert_eq!(places.len(), 2 + 21);
        assert!((places[1] - (5f64.sqrt() - 2.0)).abs() < 1e-15 && places[0] == -places[1], "{places:?}");
    }

    #[test]
    fn missing_values_are_avoided_and_errors_end_it() {
        let (at, _) = found((0.0, 2.0), |x| if x > 1.0 { f64::NEG_INFINITY } else { x });
        assert!((at - 1.0).abs() < 1e-8, "{at}");
        let mut left = 3;
        let fails = |x: f64| {
            left -= 1;
            if left == 0 { Err("three are enough") } else { Ok(x) }
        };
        assert_eq!(golden_section((0.0, 1.0), |_, _| false, fails), Err("three are enough"));
    }
}
