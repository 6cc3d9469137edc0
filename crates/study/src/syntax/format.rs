//! Formats numbers, quantities and times for readers.

/// Returns the plural ending of a counted noun.
pub(crate) fn plural_suffix(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

/// Formats a number with this number of significant digits, without trailing zeros.
pub(crate) fn format_significant(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    if !(1e-9..1e7).contains(&value.abs()) {
        return format!("{value:.*e}", (digits - 1).max(0) as usize);
    }
    let decimals = (digits - 1 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Formats a quantity with the prefix that suits its size.
pub(crate) fn format_with_prefix(value: f64, si: &str) -> String {
    if value >= 1e4 {
        return format!("{:.3e} {si}", value);
    }
    let (unit, factor) = prefixed_unit(value.abs(), si);
    format!("{} {unit}", format_significant(value * factor, 4))
}

/// Formats a frequency for a title or legend, to a microhertz: `80 Hz`.
pub(crate) fn format_hertz(frequency: f64) -> String {
    let text = format!("{frequency:.6}");
    format!("{} Hz", text.trim_end_matches('0').trim_end_matches('.'))
}

/// Returns the unit in which `largest` (SI) lies between 0.5 and 500: its name and the factor
/// from SI.
pub(crate) fn prefixed_unit(largest: f64, si: &str) -> (String, f64) {
    for (prefix, factor) in [("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9)] {
        if largest * factor >= 0.5 {
            return (format!("{prefix}{si}"), factor);
        }
    }
    (si.to_owned(), 1.0)
}

/// Formats a number of bytes: `4.2 GB`.
pub fn format_bytes(bytes: u64) -> String {
    let value = bytes as f64;
    for (size, unit) in [(1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (1e3, "kB")] {
        if value >= size {
            let scaled = value / size;
            return if scaled < 10.0 { format!("{scaled:.1} {unit}") } else { format!("{scaled:.0} {unit}") };
        }
    }
    format!("{bytes} B")
}

/// Formats an estimated time, rounded to one digit.
pub(crate) fn format_estimate(seconds: f64) -> String {
    if seconds < 1.0 { "less than a second".to_owned() } else { format!("about {}", format_duration(seconds)) }
}

/// Formats a time in seconds, minutes, hours or days.
pub(crate) fn format_duration(seconds: f64) -> String {
    match seconds {
        s if s < 100.0 => format!("{} s", format_significant(s, 1)),
        s if s < 2.0 * 3600.0 => format!("{} minutes", format_significant(s / 60.0, 1)),
        s if s < 48.0 * 3600.0 => format!("{} hours", format_significant(s / 3600.0, 1)),
        s => format!("{} days", format_significant(s / 86_400.0, 1)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_significant_digits() {
        assert_eq!(
            [format_significant(121.2503, 5), format_significant(0.072_31, 2), format_significant(2.0, 4)],
            ["121.25", "0.072", "2"]
        );
        assert_eq!([format_significant(12_345.6, 3), format_significant(1200.0, 3)], ["12346", "1200"]);
        assert_eq!(format_significant(3.110_516e15, 3), "3.11e15");
        assert_eq!(
            [
                format_estimate(0.3),
                format_estimate(34.0),
                format_estimate(600.0),
                format_estimate(1e5),
                format_estimate(1e6)
            ],
            ["less than a second", "about 34 s", "about 10 minutes", "about 28 hours", "about 12 days",]
        );
        assert_eq!(
            [format_with_prefix(2e-4, "m"), format_with_prefix(2.0, "N"), format_with_prefix(4e4, "N")],
            ["200 µm", "2 N", "4.000e4 N"]
        );
    }
}
