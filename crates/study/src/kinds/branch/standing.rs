//! Which tops of a branch are peaks of their own: those that stand out by more than the error of its rows.
//!
//! A top stands out by its height above the higher one of the two valleys over which higher ground is reached (its prominence). What is less than the
//! estimated error of the rows from there to the top may be a ripple that a longer series has not.

/// A top of the branch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Top {
    /// The row that is next to it.
    pub row: usize,
    /// Its height, no less than that of its row.
    pub height: f64,
}

/// Whether each of these tops, in the order of their rows, stands out; rows have heights and relative errors, NaN where an error is not known.
pub(super) fn out(tops: &[Top], heights: &[f64], errors: &[f64]) -> Vec<bool> {
    let mut ground = heights.to_vec();
    tops.iter().for_each(|top| ground[top.row] = ground[top.row].max(top.height));
    let stands = |top: &Top| {
        // of two equal tops the first is the higher ground
        let before = valley((0..top.row).rev(), &ground, errors, &|height| height >= top.height);
        let behind = valley(top.row + 1..ground.len(), &ground, errors, &|height| height > top.height);
        let higher = |a: Valley, b: Valley| if b.height > a.height { b } else { a };
        let over = [before, behind].into_iter().flatten().reduce(higher);
        over.is_none_or(|valley| top.height - valley.height > valley.error.max(errors[top.row]) * top.height)
    };
    tops.iter().map(stands).collect()
}

/// The way to higher ground: its lowest height, and the largest error on it.
#[derive(Clone, Copy)]
struct Valley {
    height: f64,
    error: f64,
}

/// The valley on these rows before the first that is higher; `None` if none is.
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
        let tops: Vec<Top> =
            (1..heights.len() - 1).filter(is_top).map(|row| Top { row, height: heights[row] }).collect();
        let kept = out(&tops, heights, &vec![error; heights.len()]);
        tops.iter().zip(kept).filter(|(_, kept)| *kept).map(|(top, _)| top.row).collect()
    }

    #[test]
    fn a_ripple_below_the_error_is_no_peak() {
        // two resonances, the second with a ripple of 2e-3 on its top, and a low one that stands out
        let heights = [0.1, 0.5, 0.2, 0.99, 0.998, 1.0, 0.3, 0.301, 0.1];
        let rippled = [0.1, 0.5, 0.2, 0.99, 1.0, 0.998, 0.999, 0.3, 0.31, 0.1];
        assert_eq!(standing(&heights, 1e-4), [1, 5, 7]);
        assert_eq!(standing(&heights, 1e-2), [1, 5]);
        assert_eq!(standing(&rippled, 1e-4), [1, 4, 6, 8]);
        assert_eq!(standing(&rippled, 2e-3), [1, 4, 8]);
        // unknown errors take nothing away; of twins one stays
        assert_eq!(standing(&rippled, f64::NAN), [1, 4, 6, 8]);
        assert_eq!(standing(&[0.0, 1.0, 0.999, 1.0, 0.0], 2e-3), [1]);
        // on the flank towards an end that is higher
        assert_eq!(standing(&[0.0, 0.5, 0.4999, 0.8, 1.0], 1e-3), [0usize; 0]);
    }

    /// A refined top between two rows counts with its own height.
    #[test]
    fn a_refined_top_is_ground_for_others() {
        let tops = [Top { row: 1, height: 1.1 }, Top { row: 3, height: 1.05 }];
        assert_eq!(out(&tops, &[0.0, 1.0, 0.99, 1.02, 0.0], &[0.1; 5]), [true, false]);
    }
}
