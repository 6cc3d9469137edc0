//! Peaks of a branch whose prominence exceeds the error of its rows.
//!
//! The prominence of a top is its height above the higher of the two valleys that separate it
//! from higher points. A prominence below the estimated error of the rows between the valley
//! and the top may be a ripple that more harmonics remove.

/// A top of the branch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LocalMaximum {
    /// The nearest row.
    pub row: usize,
    /// Its height, at least that of its row.
    pub height: f64,
}

/// Returns for each top, in row order, whether it is a peak.
///
/// `heights` and relative `errors` belong to the rows; an unknown error is NaN.
pub(super) fn prominent(tops: &[LocalMaximum], heights: &[f64], errors: &[f64]) -> Vec<bool> {
    let mut ground = heights.to_vec();
    tops.iter().for_each(|top| ground[top.row] = ground[top.row].max(top.height));
    let is_prominent = |top: &LocalMaximum| {
        // the first of two equal tops counts as the higher point
        let before = valley((0..top.row).rev(), &ground, errors, &|height| height >= top.height);
        let behind = valley(top.row + 1..ground.len(), &ground, errors, &|height| height > top.height);
        let higher = |a: Valley, b: Valley| if b.height > a.height { b } else { a };
        let over = [before, behind].into_iter().flatten().reduce(higher);
        over.is_none_or(|valley| top.height - valley.height > valley.error.max(errors[top.row]) * top.height)
    };
    tops.iter().map(is_prominent).collect()
}

/// The rows up to the next higher point: lowest height and largest error.
#[derive(Clone, Copy)]
struct Valley {
    height: f64,
    error: f64,
}

/// Returns the valley before the first higher row; `None` without a higher row.
fn valley(
    rows: impl Iterator<Item = usize>,
    ground: &[f64],
    errors: &[f64],
    is_higher: &dyn Fn(f64) -> bool,
) -> Option<Valley> {
    let mut valley = Valley { height: f64::INFINITY, error: 0.0 };
    for row in rows {
        if is_higher(ground[row]) {
            return Some(valley);
        }
        valley = Valley { height: valley.height.min(ground[row]), error: valley.error.max(errors[row]) };
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standing(heights: &[f64], error: f64) -> Vec<usize> {
        let is_top = |row: &usize| heights[*row] >= heights[row - 1] && heights[*row] > heights[row + 1];
        let tops: Vec<LocalMaximum> =
            (1..heights.len() - 1).filter(is_top).map(|row| LocalMaximum { row, height: heights[row] }).collect();
        let kept = prominent(&tops, heights, &vec![error; heights.len()]);
        tops.iter().zip(kept).filter(|(_, kept)| *kept).map(|(top, _)| top.row).collect()
    }

    #[test]
    fn a_ripple_below_the_error_is_not_a_peak() {
        // two resonances, the second with a ripple of 2e-3 on its top, and a low one with
        // enough prominence
        let heights = [0.1, 0.5, 0.2, 0.99, 0.998, 1.0, 0.3, 0.301, 0.1];
        let rippled = [0.1, 0.5, 0.2, 0.99, 1.0, 0.998, 0.999, 0.3, 0.31, 0.1];
        assert_eq!(standing(&heights, 1e-4), [1, 5, 7]);
        assert_eq!(standing(&heights, 1e-2), [1, 5]);
        assert_eq!(standing(&rippled, 1e-4), [1, 4, 6, 8]);
        assert_eq!(standing(&rippled, 2e-3), [1, 4, 8]);
        // unknown errors remove no peak; one of two equal tops remains
        assert_eq!(standing(&rippled, f64::NAN), [1, 4, 6, 8]);
        assert_eq!(standing(&[0.0, 1.0, 0.999, 1.0, 0.0], 2e-3), [1]);
        // a ripple on the flank below a higher end
        assert_eq!(standing(&[0.0, 0.5, 0.4999, 0.8, 1.0], 1e-3), [0usize; 0]);
    }

    /// A refined top between two rows counts with its refined height.
    #[test]
    fn a_refined_top_counts_with_its_height() {
        let tops = [LocalMaximum { row: 1, height: 1.1 }, LocalMaximum { row: 3, height: 1.05 }];
        assert_eq!(prominent(&tops, &[0.0, 1.0, 0.99, 1.02, 0.0], &[0.1; 5]), [true, false]);
    }
}
