//! Detects axes with proportional relative motion.
//!
//! Two axes lie on one line if their relative motions differ only by a factor and a constant.

use super::Axis;
use num_complex::Complex64;
use std::cmp::Ordering;
use std::collections::BTreeMap;

/// Relative tolerance for parallel directions and imposed motions, as a fraction of the largest
/// entry.
///
/// It covers the few rounding errors in the construction of a direction. Directions with a
/// larger difference count as different.
pub(crate) const PARALLEL: f64 = 64.0 * f64::EPSILON;

/// An axis in a form that can be compared with other axes.
#[derive(Debug, Clone)]
pub(crate) struct CollinearAxis {
    /// Degrees of freedom with their weights, sorted; each degree of freedom occurs once.
    rows: Vec<(usize, f64)>,
    /// The entry with the largest absolute weight.
    lead: Option<(usize, f64)>,
    /// Imposed motion by harmonic, without its mean. Only the velocity matters, and a constant
    /// offset does not change it.
    imposed: Vec<(u32, Complex64)>,
}

impl CollinearAxis {
    pub fn of(axis: &Axis) -> Self {
        let mut rows = BTreeMap::new();
        axis.rows().iter().for_each(|&(row, weight)| *rows.entry(row).or_insert(0.0) += weight);
        let rows: Vec<(usize, f64)> = rows.into_iter().collect();
        let lead = rows.iter().copied().max_by(|(_, a), (_, b)| a.abs().total_cmp(&b.abs()));
        CollinearAxis { rows, lead, imposed: axis.imposed().iter().copied().filter(|(h, _)| *h > 0).collect() }
    }

    /// Returns the factor `velocity along self = factor · velocity along other`, if one factor
    /// holds at all times.
    pub fn ratio_to(&self, other: &CollinearAxis) -> Option<f64> {
        let (lead, weight) = other.lead?;
        let factor = self.weight(lead) / weight;
        if !factor.is_finite() || factor == 0.0 {
            return None; // the axes are orthogonal, or only imposed motion moves one of them
        }
        let near = PARALLEL * self.lead.map_or(0.0, |(_, weight)| weight.abs());
        let parallel = merge_join(&self.rows, &other.rows).all(|(own, its)| (own - factor * its).abs() <= near);
        let near = PARALLEL * self.imposed.iter().map(|(_, g)| g.norm()).fold(0.0, f64::max);
        let together =
            || merge_join(&self.imposed, &other.imposed).all(|(own, its)| (own - its * factor).norm() <= near);
        (parallel && together()).then_some(factor)
    }

    fn weight(&self, row: usize) -> f64 {
        self.rows.binary_search_by_key(&row, |(at, _)| *at).map_or(0.0, |i| self.rows[i].1)
    }
}

/// Pairs the values of two lists with sorted keys. A key that one list lacks counts as zero
/// there.
fn merge_join<'a, K: Ord, T: Copy + Default>(
    one: &'a [(K, T)],
    other: &'a [(K, T)],
) -> impl Iterator<Item = (T, T)> + 'a {
    let (mut one, mut other) = (one.iter().peekable(), other.iter().peekable());
    std::iter::from_fn(move || {
        let order = match (one.peek(), other.peek()) {
            (None, None) => return None,
            (Some(_), None) => Ordering::Less,
            (None, Some(_)) => Ordering::Greater,
            (Some((a, _)), Some((b, _))) => a.cmp(b),
        };
        let own = if order.is_le() { one.next() } else { None };
        let its = if order.is_ge() { other.next() } else { None };
        Some((own.map_or_else(T::default, |(_, value)| *value), its.map_or_else(T::default, |(_, value)| *value)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factor(one: &Axis, other: &Axis) -> Option<f64> {
        CollinearAxis::of(one).ratio_to(&CollinearAxis::of(other))
    }

    #[test]
    fn one_line_whatever_the_order_of_its_rows() {
        let axis = |rows: &[(usize, f64)]| Axis::new(rows.to_vec());
        let (first, turned) = (axis(&[(0, 1.0), (3, -1.0)]), axis(&[(3, 2.5), (0, -2.0), (0, -0.5), (7, 0.0)]));
        assert_eq!(factor(&turned, &first), Some(-2.5));
        assert_eq!(factor(&first, &turned), Some(-0.4));
        for other in
            [axis(&[(0, 1.0)]), axis(&[(0, 1.0), (3, 1.0)]), axis(&[(0, 1.0), (3, -1.0), (7, 1e-9)]), axis(&[])]
        {
            assert_eq!((factor(&first, &other), factor(&other, &first)), (None, None), "{other:?}");
        }
        // rounding errors in a direction
        let near = axis(&[(0, 0.1 + 0.2), (3, -0.3)]);
        assert!((factor(&near, &first).unwrap() - 0.3).abs() < 1e-15);
    }

    #[test]
    fn imposed_motion_goes_along_but_for_a_constant() {
        let g = Complex64::new(0.3, -0.4);
        let axis =
            |weight: f64, imposed: Vec<(u32, Complex64)>| Axis::new(vec![(1, weight)]).with_imposed_motion(imposed);
        let first = axis(1.0, vec![(1, g), (0, Complex64::new(2.0, 0.0))]);
        assert_eq!(factor(&axis(-2.0, vec![(1, g * -2.0)]), &first), Some(-2.0));
        for imposed in [vec![], vec![(1, g)], vec![(1, g * -2.0), (3, g)]] {
            assert_eq!(factor(&axis(-2.0, imposed), &first), None);
        }
        // an axis with imposed motion alone has no direction
        let moved = |rows| Axis::new(rows).with_imposed_motion([(1, g)]);
        assert_eq!(factor(&moved(vec![]), &moved(vec![])), None);
    }
}
