//! A column of numbers or texts: its name, its unit and the distance of its values.

/// A column of a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Column {
    /// Name, unique in the file.
    pub name: String,
    /// Unit as the file states it; empty if it states none.
    pub unit: String,
    /// Description of the column in the words of the file; may be empty.
    pub label: String,
    /// The values as in the file. A missing value is NaN. Texts are numbered from 1.
    pub values: Vec<f64>,
    /// The first text of a column of texts; `None` for a column of numbers.
    pub first_text: Option<String>,
}

/// Equal distances between the values of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampling {
    /// First value.
    pub first: f64,
    /// Distance between two values.
    pub step: f64,
}

impl Column {
    /// Returns the sampling of a column whose values rise in equal steps, to a thousandth of a
    /// step or to seven digits of the largest value; `None` for other columns.
    pub fn sampling(&self) -> Option<Sampling> {
        let (first, last) = (*self.values.first()?, *self.values.last()?);
        let steps = self.values.len().checked_sub(1).filter(|steps| *steps > 0)?;
        let step = (last - first) / steps as f64;
        // files with seven digits round the values of a long record
        let tolerance = (1e-3 * step).max(1e-7 * first.abs().max(last.abs()));
        let even = |(i, value): (usize, &f64)| (value - (first + step * i as f64)).abs() <= tolerance;
        (step > 0.0 && self.values.windows(2).all(|pair| pair[0] < pair[1]) && self.values.iter().enumerate().all(even))
            .then_some(Sampling { first, step })
    }

    /// Returns the smallest and the largest finite value.
    pub fn range(&self) -> Option<(f64, f64)> {
        let finite = self.values.iter().copied().filter(|value| value.is_finite());
        finite.fold(None, |range, value| {
            let (low, high) = range.unwrap_or((value, value));
            Some((low.min(value), high.max(value)))
        })
    }
}

/// Splits the title of a column into its name and its unit: `force [N]`, `force (N)`, `force / N`.
///
/// ```
/// use stickslip_formats::data::split_unit;
/// assert_eq!(split_unit("force [kN]"), ("force", "kN"));
/// assert_eq!(split_unit("acceleration (m/s^2)"), ("acceleration", "m/s^2"));
/// assert_eq!(split_unit("time / s"), ("time", "s"));
/// assert_eq!(split_unit("f(x)"), ("f(x)", ""));
/// ```
pub fn split_unit(title: &str) -> (&str, &str) {
    let title = title.trim();
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((name, unit)) = title.strip_suffix(close).and_then(|title| title.rsplit_once(open)) {
            // `f(x)` is a function, not a unit
            let (spaced, bracket) = (name.ends_with(char::is_whitespace), open == '[');
            if (spaced || bracket) && !name.trim().is_empty() {
                return (name.trim(), unit.trim());
            }
        }
    }
    match title.split_once(" / ") {
        Some((name, unit)) if !name.trim().is_empty() && !unit.trim().contains(' ') => (name.trim(), unit.trim()),
        _ => (title, ""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(values: Vec<f64>) -> Column {
        Column { values, ..Column::default() }
    }

    #[test]
    fn equal_steps_are_found_in_rounded_values() {
        let rounded = |step: f64| column((0..2000).map(|i| (f64::from(i) * step * 1e6).round() / 1e6).collect());
        assert!((rounded(1.0 / 3.0).sampling().expect("even").step - 1.0 / 3.0).abs() < 1e-9);
        assert_eq!(column(vec![0.0, 1.0, 2.01]).sampling(), None);
        assert_eq!(column(vec![0.0, 0.0, 0.0]).sampling(), None);
        assert_eq!(column(vec![1.0]).sampling(), None);
        assert_eq!(column(vec![0.0, f64::NAN, 2.0]).sampling(), None);
        assert_eq!(column(vec![2.0, f64::NAN, -1.0]).range(), Some((-1.0, 2.0)));
    }
}
