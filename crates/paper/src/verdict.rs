//! Rules that derive a verdict on a claim from a measured number.

use stickslip_report::Verdict;

/// Relative difference up to which two quantities are the same or similar: visible in a printed
/// figure.
pub const SIMILAR: f64 = 0.05;
/// Relative difference up to which two quantities are approximately the same.
pub const APPROXIMATE: f64 = 0.10;
/// Relative difference beyond which two quantities are not similar by any reading.
pub const DIFFERENT: f64 = 0.25;
/// Tolerance in Hz for frequencies that the paper prints in steps of 0.25 Hz: half a step.
pub const PRINTED: f64 = 0.125;

/// Returns the verdict on a claim that a value is small.
///
/// The claim holds up to `holds`, and with a qualification up to `qualified`.
pub fn small(value: f64, holds: f64, qualified: f64) -> Verdict {
    if value.abs() <= holds {
        Verdict::Holds
    } else if value.abs() <= qualified {
        Verdict::HoldsWithQualification
    } else {
        Verdict::DoesNotHold // NaN also has this verdict.
    }
}

/// Returns the verdict on a claim about several cases: it holds in all, in some, or in none.
pub fn in_all(cases: &[bool]) -> Verdict {
    if !cases.is_empty() && cases.iter().all(|ok| *ok) {
        Verdict::Holds
    } else if cases.iter().any(|ok| *ok) {
        Verdict::HoldsWithQualification
    } else {
        Verdict::DoesNotHold
    }
}

/// Returns the verdict on a claim that a quantity only rises (`sign` = 1) or only falls (-1).
///
/// The claim holds if every step agrees. It holds with a qualification if the first step and
/// the total change agree.
pub fn monotone(values: &[f64], sign: f64) -> Verdict {
    let steps: Vec<bool> = values.windows(2).map(|pair| sign * (pair[1] - pair[0]) > 0.0).collect();
    let whole = matches!(values, [first, .., last] if sign * (last - first) > 0.0);
    match in_all(&steps) {
        Verdict::HoldsWithQualification if !(whole && steps[0]) => Verdict::DoesNotHold,
        verdict => verdict,
    }
}

/// Returns the weaker of two verdicts.
pub fn both(a: Verdict, b: Verdict) -> Verdict {
    a.max(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use Verdict::{DoesNotHold, Holds, HoldsWithQualification};

    #[test]
    fn small_numbers_hold_and_large_or_missing_ones_do_not() {
        assert_eq!(
            [0.01, -0.05, 0.07, 0.3, f64::NAN].map(|v| small(v, 0.05, 0.1)),
            [Holds, Holds, HoldsWithQualification, DoesNotHold, DoesNotHold]
        );
    }

    #[test]
    fn some_cases_are_a_qualification() {
        assert_eq!(in_all(&[true, true]), Holds);
        assert_eq!(in_all(&[true, false]), HoldsWithQualification);
        assert_eq!(in_all(&[false, false]), DoesNotHold);
        assert_eq!(in_all(&[]), DoesNotHold);
    }

    #[test]
    fn a_turn_is_a_qualification_and_the_wrong_way_is_none() {
        assert_eq!(monotone(&[4.0, 3.0, 2.0], -1.0), Holds);
        assert_eq!(monotone(&[4.0, 2.0, 3.0], -1.0), HoldsWithQualification);
        assert_eq!(monotone(&[4.0, 2.0, 5.0], -1.0), DoesNotHold);
        assert_eq!(monotone(&[1.0, 2.0, 3.0], -1.0), DoesNotHold);
        assert_eq!(monotone(&[1.0, f64::NAN, 3.0], 1.0), DoesNotHold);
        assert_eq!(monotone(&[1.0], 1.0), DoesNotHold);
    }

    #[test]
    fn the_weaker_verdict_decides() {
        assert_eq!(both(Holds, DoesNotHold), DoesNotHold);
        assert_eq!(both(HoldsWithQualification, Holds), HoldsWithQualification);
    }
}
