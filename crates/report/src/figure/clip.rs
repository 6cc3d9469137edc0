//! Clipping of curves to their plot area, and removal of points that make no visible
//! difference.

/// A point on the page in px.
pub(crate) type Point = (f64, f64);

/// A rectangle on the page in px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ClipRect {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

/// Flatness tolerance in px: 1/40 of the line width. A point this close to the line is removed.
const FLATNESS: f64 = 0.04;

impl ClipRect {
    pub(crate) fn contains(&self, (x, y): Point) -> bool {
        // Tolerance of the rectangle in px, so that rounding does not remove a mark from the
        // edge.
        let edge = 0.01;
        x >= self.left - edge && x <= self.right + edge && y >= self.top - edge && y <= self.bottom + edge
    }

    /// Returns the pieces of a line inside the rectangle.
    pub(crate) fn line(&self, points: &[Point]) -> Vec<Vec<Point>> {
        if points.iter().all(|p| self.contains(*p)) {
            return vec![points.to_vec()];
        }
        let mut pieces: Vec<Vec<Point>> = Vec::new();
        let mut open = false;
        for pair in points.windows(2) {
            let Some((from, to, whole)) = self.segment(pair[0], pair[1]) else {
                open = false;
                continue;
            };
            match pieces.last_mut().filter(|_| open) {
                Some(piece) => piece.push(to),
                None => pieces.push(vec![from, to]),
            }
            open = whole;
        }
        pieces
    }

    /// Returns the part of a segment inside the rectangle, and `true` if it reaches the segment's
    /// end.
    ///
    /// Source: Liang and Barsky (1984).
    fn segment(&self, a: Point, b: Point) -> Option<(Point, Point, bool)> {
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let (mut enter, mut leave) = (0.0f64, 1.0f64);
        for (rate, room) in
            [(-dx, a.0 - self.left), (dx, self.right - a.0), (-dy, a.1 - self.top), (dy, self.bottom - a.1)]
        {
            if rate == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if rate < 0.0 {
                enter = enter.max(room / rate);
            } else {
                leave = leave.min(room / rate);
            }
        }
        let at = |part: f64| (a.0 + part * dx, a.1 + part * dy);
        (enter <= leave)
            .then(|| (if enter > 0.0 { at(enter) } else { a }, if leave < 1.0 { at(leave) } else { b }, leave >= 1.0))
    }

    /// Returns the part of a polygon inside the rectangle. Source: Sutherland and Hodgman (1974).
    pub(crate) fn polygon(&self, points: &[Point]) -> Vec<Point> {
        let edges: [&dyn Fn(Point) -> f64; 4] =
            [&|p| p.0 - self.left, &|p| self.right - p.0, &|p| p.1 - self.top, &|p| self.bottom - p.1];
        let mut inside = points.to_vec();
        for room in edges {
            let mut kept = Vec::with_capacity(inside.len());
            for (i, &now) in inside.iter().enumerate() {
                let before = inside[(i + inside.len() - 1) % inside.len()];
                let (r0, r1) = (room(before), room(now));
                if (r0 < 0.0) != (r1 < 0.0) {
                    let part = r0 / (r0 - r1);
                    kept.push((before.0 + part * (now.0 - before.0), before.1 + part * (now.1 - before.1)));
                }
                if r1 >= 0.0 {
                    kept.push(now);
                }
            }
            inside = kept;
        }
        inside
    }
}

/// Returns the line without the points that make no visible difference.
pub(crate) fn simplified(points: Vec<Point>) -> Vec<Point> {
    flattened(&thinned(points))
}

/// Keeps the first, last, highest and lowest point of a dense line in every quarter of a pixel.
fn thinned(points: Vec<Point>) -> Vec<Point> {
    // A line with more points than this is first reduced column by column, because flattening is
    // slow.
    if points.len() <= 4000 {
        return points;
    }
    let column = |p: &Point| (p.0 * 4.0).floor();
    let mut kept = Vec::new();
    for run in points.chunk_by(|a, b| column(a) == column(b)) {
        let by =
            |sign: f64| (0..run.len()).max_by(|i, j| (sign * run[*i].1).total_cmp(&(sign * run[*j].1))).unwrap_or(0);
        let mut indices = [0, by(1.0), by(-1.0), run.len() - 1];
        indices.sort_unstable();
        kept.extend(indices.iter().enumerate().filter(|(i, k)| *i == 0 || indices[i - 1] != **k).map(|(_, k)| run[*k]));
    }
    kept
}

/// Removes the points within [`FLATNESS`] of the line through the kept points.
///
/// Source: Douglas and Peucker (1973).
fn flattened(points: &[Point]) -> Vec<Point> {
    if points.len() < 3 {
        return points.to_vec();
    }
    let mut keep = vec![false; points.len()];
    (keep[0], keep[points.len() - 1]) = (true, true);
    let mut open = vec![(0, points.len() - 1)];
    while let Some((from, to)) = open.pop() {
        let farthest = (from + 1..to)
            .map(|i| (i, distance(points[i], points[from], points[to])))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((middle, _)) = farthest.filter(|(_, far)| *far > FLATNESS) {
            keep[middle] = true;
            open.push((from, middle));
            open.push((middle, to));
        }
    }
    points.iter().zip(keep).filter(|(_, keep)| *keep).map(|(p, _)| *p).collect()
}

/// Returns the distance of a point from the segment between two others.
fn distance(p: Point, a: Point, b: Point) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let square = dx * dx + dy * dy;
    let part = if square > 0.0 { (((p.0 - a.0) * dx + (p.1 - a.1) * dy) / square).clamp(0.0, 1.0) } else { 0.0 };
    let (ex, ey) = (p.0 - a.0 - part * dx, p.1 - a.1 - part * dy);
    (ex * ex + ey * ey).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RECT: ClipRect = ClipRect { left: 0.0, top: 0.0, right: 10.0, bottom: 10.0 };

    #[test]
    fn a_line_that_leaves_and_returns_is_two_pieces() {
        let pieces = RECT.line(&[(1.0, 5.0), (3.0, 15.0), (5.0, 5.0), (8.0, 5.0)]);
        // The line crosses the lower edge half way to (3, 15), and again half way back.
        assert_eq!(pieces, [vec![(1.0, 5.0), (2.0, 10.0)], vec![(4.0, 10.0), (5.0, 5.0), (8.0, 5.0)]]);
        assert!(RECT.line(&[(-5.0, 1.0), (-1.0, 9.0)]).is_empty());
        // Both ends are outside, the middle is inside.
        assert_eq!(RECT.line(&[(-5.0, 5.0), (15.0, 5.0)]), [vec![(0.0, 5.0), (10.0, 5.0)]]);
        let inside = [(0.0, 0.0), (10.0, 10.0)];
        assert_eq!(RECT.line(&inside), [inside.to_vec()]);
    }

    #[test]
    fn a_polygon_keeps_its_area_inside() {
        let area = |p: &[Point]| {
            (0..p.len()).map(|i| (p[i], p[(i + 1) % p.len()])).map(|(a, b)| a.0 * b.1 - b.0 * a.1).sum::<f64>() / 2.0
        };
        // The lower half of the triangle is outside the rectangle: three quarters of its area of
        // 50.
        let triangle = [(0.0, 15.0), (10.0, 15.0), (5.0, 5.0)];
        assert!((area(&RECT.polygon(&triangle)).abs() - 12.5).abs() < 1e-12);
        assert!(RECT.polygon(&[(20.0, 1.0), (30.0, 1.0), (20.0, 9.0)]).is_empty());
        assert!(RECT.polygon(&[]).is_empty());
    }

    #[test]
    fn a_dense_line_is_thinned_without_losing_its_extremes() {
        let points: Vec<Point> = (0..100_000).map(|i| (f64::from(i) * 0.005, f64::from(i % 97))).collect();
        let kept = thinned(points.clone());
        assert!(kept.len() < 10_000 && kept.first() == points.first() && kept.last() == points.last());
        assert!(kept.iter().any(|p| p.1 == 96.0) && kept.iter().any(|p| p.1 == 0.0));
    }

    #[test]
    fn what_is_left_out_lies_on_the_line_that_is_kept() {
        let points: Vec<Point> =
            (0..1000).map(|i| f64::from(i) * 0.5).map(|x| (x, 200.0 / (1.0 + ((x - 250.0) / 20.0).powi(2)))).collect();
        let kept = simplified(points.clone());
        assert!(kept.len() < 200, "{}", kept.len());
        for p in points {
            let off = kept.windows(2).map(|w| distance(p, w[0], w[1])).fold(f64::INFINITY, f64::min);
            assert!(off <= FLATNESS, "{p:?}: {off}");
        }
    }
}
