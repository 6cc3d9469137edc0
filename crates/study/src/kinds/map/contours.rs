//! Contour lines of values on a rectangular grid (marching squares).
//!
//! Each cell between four grid points contributes the straight pieces on which the bilinear
//! interpolation of its edges equals the level. A cell with a missing corner has no pieces.
//! Source: Lorensen and Cline (1987), in two dimensions. A saddle is resolved by the mean of
//! the corners.

/// Values on a grid: `values[row][column]` at `(x[column], y[row])`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Grid {
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    pub values: Vec<Vec<f64>>,
}

/// A grid point and its value.
#[derive(Debug, Clone, Copy)]
struct Corner {
    x: f64,
    y: f64,
    value: f64,
}

impl Grid {
    /// Returns the pieces of the contour of a level: the abscissae and the ordinates of both
    /// ends of each piece, with NaN between pieces.
    pub fn contour(&self, level: f64) -> [Vec<f64>; 2] {
        let (mut x, mut y) = (Vec::new(), Vec::new());
        for row in 0..self.y.len().saturating_sub(1) {
            for column in 0..self.x.len().saturating_sub(1) {
                for [from, to] in self.pieces(row, column, level) {
                    x.extend([from[0], to[0], f64::NAN]);
                    y.extend([from[1], to[1], f64::NAN]);
                }
            }
        }
        [x, y]
    }

    /// Returns the pieces in the cell whose lower left corner has this row and column.
    fn pieces(&self, row: usize, column: usize, level: f64) -> Vec<[[f64; 2]; 2]> {
        let corner =
            |row: usize, column: usize| Corner { x: self.x[column], y: self.y[row], value: self.values[row][column] };
        // counterclockwise
        let corners =
            [corner(row, column), corner(row, column + 1), corner(row + 1, column + 1), corner(row + 1, column)];
        if corners.iter().any(|corner| !corner.value.is_finite()) {
            return Vec::new();
        }
        // where the contour crosses the edge from corner `i` to the next one
        let crossing = |i: usize| {
            let (a, b) = (corners[i], corners[(i + 1) % 4]);
            let part = (level - a.value) / (b.value - a.value);
            ((a.value >= level) != (b.value >= level)).then_some([a.x + part * (b.x - a.x), a.y + part * (b.y - a.y)])
        };
        let crossings: Vec<[f64; 2]> = (0..4).filter_map(crossing).collect();
        match crossings[..] {
            [a, b] => vec![[a, b]],
            [a, b, c, d] => {
                let mean = corners.iter().map(|corner| corner.value).sum::<f64>() / 4.0;
                // the corners on the side of the mean are connected, so the pieces cut off the
                // other corners
                if (mean >= level) == (corners[0].value >= level) { vec![[a, b], [c, d]] } else { vec![[d, a], [b, c]] }
            }
            _ => Vec::new(),
        }
    }
}

/// Returns about six levels between the smallest and the largest value, at multiples of 1, 2 or
/// 5 times a power of ten.
pub(super) fn levels(values: impl Iterator<Item = f64>) -> Option<Levels> {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    let span = high - low;
    if !(span > 0.0 && span.is_finite()) {
        return None;
    }
    let rough = span / 6.0;
    let exponent = format!("{rough:e}").split_once('e').and_then(|(_, exponent)| exponent.parse::<i32>().ok())?;
    let step = |mantissa: u32, exponent: i32| format!("{mantissa}e{exponent}").parse().unwrap_or(rough);
    let candidates = [step(1, exponent), step(2, exponent), step(5, exponent), step(1, exponent + 1)];
    let distance = |step: &f64| if *step > rough { step / rough } else { rough / step };
    let step = candidates.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    let first = (low / step).floor() as i64 + 1;
    let values = (first..).map(|multiple| multiple as f64 * step).take_while(|level| *level < high).collect();
    Some(Levels { step, values })
}

/// The levels of the contours of a map.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Levels {
    /// Distance between two levels.
    pub step: f64,
    /// The levels, ascending.
    pub values: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(count: usize, value: impl Fn(f64, f64) -> f64) -> Grid {
        let axis: Vec<f64> = (0..count).map(|i| 2.0 * i as f64 / (count - 1) as f64 - 1.0).collect();
        let values = axis.iter().map(|y| axis.iter().map(|x| value(*x, *y)).collect()).collect();
        Grid { x: axis.clone(), y: axis, values }
    }

    /// The contour of `x² + y² = r²` has the circumference `2 π r` and encloses the area `π r²`.
    #[test]
    fn the_contour_of_a_bowl_is_a_circle() {
        let radius = 0.7f64;
        let [x, y] = grid(101, |x, y| x * x + y * y).contour(radius * radius);
        let (mut length, mut worst) = (0.0, 0.0f64);
        for i in (0..x.len()).step_by(3) {
            assert!(x[i + 2].is_nan() && y[i + 2].is_nan());
            length += (x[i] - x[i + 1]).hypot(y[i] - y[i + 1]);
            worst = worst.max((x[i].hypot(y[i]) - radius).abs());
        }
        // linear interpolation on an edge of length h misses by h²/(8 r) at most
        assert!(worst < 0.02f64.powi(2) / (8.0 * radius) * 1.01, "{worst:e}");
        assert!((length / (std::f64::consts::TAU * radius) - 1.0).abs() < 1e-3, "{length}");
    }

    #[test]
    fn a_plane_has_straight_contours() {
        let plane = grid(5, |x, y| 2.0 * x + y);
        let [x, y] = plane.contour(0.3);
        assert!(x.len() >= 12);
        for (x, y) in x.iter().zip(&y).filter(|(x, _)| x.is_finite()) {
            assert!((2.0 * x + y - 0.3).abs() < 1e-12);
        }
        assert_eq!(plane.contour(9.0), [Vec::<f64>::new(), Vec::new()]);
    }

    /// The level 0 of `x y` is a saddle in the middle cell; contours nearby do not cross it.
    #[test]
    fn pieces_of_a_saddle_do_not_cross() {
        let saddle = grid(2, |x, y| x * y);
        for (level, product) in [(0.25, 1.0), (-0.25, -1.0)] {
            let [x, y] = saddle.contour(level);
            assert_eq!(x.len(), 6);
            for i in [0, 3] {
                // both ends of a piece are near one corner of the quadrants with this sign
                let (mx, my) = (x[i] + x[i + 1], y[i] + y[i + 1]);
                assert!(mx * my * product > 0.0, "{level}: {x:?} {y:?}");
            }
        }
    }

    #[test]
    fn a_missing_value_leaves_a_hole() {
        let mut plane = grid(3, |x, _| x);
        plane.values[1][1] = f64::NAN;
        assert!(plane.contour(0.5)[0].is_empty());
    }

    #[test]
    fn levels_are_round_numbers_inside_the_range() {
        let of = |low: f64, high: f64| levels([low, f64::NAN, high].into_iter());
        assert_eq!(of(0.0, 1.0).unwrap().values, [0.2, 0.4, 0.6000000000000001, 0.8]);
        assert_eq!(of(0.0, 1.0).unwrap().step, 0.2);
        assert_eq!(of(-30.0, 31.0).unwrap().values, [-20.0, -10.0, 0.0, 10.0, 20.0, 30.0]);
        assert_eq!(of(1.0, 1.0), None);
        assert_eq!(of(f64::NAN, f64::NAN), None);
        assert!(of(0.0, 1e-310).is_some());
    }
}
