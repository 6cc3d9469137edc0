//! Formatting of numbers and texts for the report.

/// Joins numbers with `digits` digits after the decimal point.
pub fn list(values: impl IntoIterator<Item = f64>, digits: usize) -> String {
    values.into_iter().map(|value| format!("{value:.digits$}")).collect::<Vec<_>>().join(", ")
}

/// Formats a ratio in percent, with more digits for smaller values.
pub fn percent(part: f64) -> String {
    let value = 100.0 * part;
    match value.abs() {
        v if v >= 10.0 => format!("{value:.0} %"),
        v if v >= 1.0 => format!("{value:.1} %"),
        v if v >= 0.01 => format!("{value:.2} %"),
        0.0 => "0 %".to_owned(),
        _ => format!("{value:.1e} %"),
    }
}

/// Joins integers.
pub fn join(numbers: &[usize]) -> String {
    numbers.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
}

/// Converts texts to strings.
pub fn words(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn per_cent_keep_two_digits() {
        assert_eq!([0.65, 0.0123, 0.00046, 1e-9, 0.0].map(percent), ["65 %", "1.2 %", "0.05 %", "1.0e-7 %", "0 %"]);
    }
}
