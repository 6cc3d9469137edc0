//! Coordinates of the nodes of a sector, to find or check the pairs of its low and high side.
//!
//! A rotation of the low side by `2π/N` about the axis gives the high side, node on node. The
//! matrices do not contain the coordinates of the nodes. A wrong pair defines another disk with
//! valid matrices, which only coordinates can detect.

use super::CoordinateAxis;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// A node and its coordinates, in any unit of length.
pub type NodeCoordinates = (String, [f64; 3]);

/// The reason why pairs of nodes are not the two sides of a sector.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FacesError {
    /// A node has no coordinates.
    #[error("node `{0}` has no coordinates")]
    Unknown(String),
    /// The nodes of a pair do not coincide after rotation.
    #[error(
        "node `{low}` of the low side, rotated by 360°/{sectors} about {axis}, is {apart:.3e} away from node \
         `{high}` (radius of the sector: {radius:.3e}), in the unit of the coordinates{}",
        hint.as_ref().map_or_else(String::new, |hint| format!("; {hint}"))
    )]
    Apart {
        /// Node of the low side.
        low: String,
        /// Node of the high side.
        high: String,
        /// Number of sectors.
        sectors: usize,
        /// Axis of the disk.
        axis: CoordinateAxis,
        /// Distance, in the unit of the coordinates.
        apart: f64,
        /// Largest distance of a node from the axis.
        radius: f64,
        /// A suggestion for a correction.
        hint: Option<String>,
    },
    /// Two nodes of the sides coincide after rotation, but no pair names them.
    #[error(
        "nodes `{low}` and `{high}` coincide after rotation, but no pair names them ({count} missing pairs); add the pairs"
    )]
    Missing {
        /// Node of the low side.
        low: String,
        /// Node of the high side.
        high: String,
        /// Number of missing pairs.
        count: usize,
    },
    /// No two nodes coincide after rotation.
    #[error(
        "no node coincides with another one after rotation by 360°/{sectors} about {axis}; check the axis and the number of sectors"
    )]
    None {
        /// Number of sectors.
        sectors: usize,
        /// Axis of the disk.
        axis: CoordinateAxis,
    },
}

/// The nodes of a sector with their coordinates.
///
/// # Example
/// A quarter of a disk: nodes 1 and 2 are its low side, 3 and 4 its high side.
/// ```
/// use stickslip::structure::{CoordinateAxis, SectorFaces};
/// let nodes = [
///     ("1", [1.0, 0.0]),
///     ("2", [2.0, 0.0]),
///     ("3", [0.0, 1.0]),
///     ("4", [0.0, 2.0]),
///     ("5", [1.0, 1.0]),
/// ];
/// let nodes = nodes.map(|(name, [x, y])| (name.to_owned(), [x, y, 0.0]));
/// let faces = SectorFaces::new(&nodes, CoordinateAxis::Z, 4);
/// let pairs = faces.pairs().unwrap();
/// assert_eq!(pairs, [("1".into(), "3".into()), ("2".into(), "4".into())]);
/// assert!(faces.check(&pairs).is_ok());
/// assert!(
///     faces.check(&[("3".into(), "1".into())]).unwrap_err().to_string().contains("exchanged")
/// );
/// ```
#[derive(Debug, Clone)]
pub struct SectorFaces<'a> {
    nodes: &'a [NodeCoordinates],
    axis: CoordinateAxis,
    sectors: usize,
    radius: f64,
    /// Nodes by grid cell.
    cells: BTreeMap<[i64; 3], Vec<usize>>,
}

impl<'a> SectorFaces<'a> {
    /// Creates it from the nodes of a sector, or from a selection of them, and the number of
    /// sectors.
    pub fn new(nodes: &'a [NodeCoordinates], axis: CoordinateAxis, sectors: usize) -> Self {
        let radius = nodes.iter().map(|(_, at)| axis.radius(*at)).fold(0.0, f64::max);
        let mut faces = SectorFaces { nodes, axis, sectors, radius, cells: BTreeMap::new() };
        for (index, (_, at)) in nodes.iter().enumerate() {
            faces.cells.entry(faces.cell(*at)).or_default().push(index);
        }
        faces
    }

    fn tolerance(&self) -> f64 {
        // Tolerance for the distance between a node and its rotated counterpart, relative to the
        // largest distance of a node from the axis. Meshes are written with six digits or more,
        // and elements are larger.
        1e-4 * self.radius
    }

    fn cell(&self, at: [f64; 3]) -> [i64; 3] {
        at.map(|x| (x / self.tolerance().max(f64::MIN_POSITIVE)).floor() as i64)
    }

    /// Returns the pairs (low, high) according to the coordinates, in the order of the nodes.
    /// Nodes on the axis are excluded.
    ///
    /// # Errors
    /// [`FacesError::None`].
    pub fn pairs(&self) -> Result<Vec<(String, String)>, FacesError> {
        let turn = self.axis.rotation(TAU / self.sectors as f64);
        let off_axis = self.nodes.iter().enumerate().filter(|(_, (_, at))| self.axis.radius(*at) > self.tolerance());
        let met = off_axis.filter_map(|(own, (low, at))| {
            let high = self.nearest(turned(&turn, *at))?;
            // with two sectors, each is the next one of the other, and every pair is found from
            // both ends
            (self.sectors != 2 || own < high).then(|| (low.clone(), self.nodes[high].0.clone()))
        });
        let pairs: Vec<_> = met.collect();
        if pairs.is_empty() { Err(FacesError::None { sectors: self.sectors, axis: self.axis }) } else { Ok(pairs) }
    }

    /// Returns the node at a point.
    fn nearest(&self, point: [f64; 3]) -> Option<usize> {
        let cell = self.cell(point);
        let adjacent = (0..27).map(|k| [k / 9 - 1, k / 3 % 3 - 1, k % 3 - 1]);
        let cells = adjacent.filter_map(|step| self.cells.get(&[0, 1, 2].map(|i| cell[i].saturating_add(step[i]))));
        let near = cells.flatten().map(|&index| (distance(self.nodes[index].1, point), index));
        near.filter(|(apart, _)| *apart <= self.tolerance()).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, index)| index)
    }

    /// Checks that these pairs (low, high) agree with the coordinates and are complete.
    ///
    /// # Errors
    /// [`FacesError`]: a node without coordinates, a pair that does not coincide, or a missing
    /// pair.
    pub fn check(&self, pairs: &[(String, String)]) -> Result<(), FacesError> {
        let of: BTreeMap<&str, [f64; 3]> = self.nodes.iter().map(|(name, at)| (name.as_str(), *at)).collect();
        let find = |name: &String| of.get(name.as_str()).copied().ok_or_else(|| FacesError::Unknown(name.clone()));
        for (low, high) in pairs {
            let (from, to) = (find(low)?, find(high)?);
            let apart = self.rotated_distance(self.axis, TAU / self.sectors as f64, from, to);
            if apart > self.tolerance() {
                return Err(FacesError::Apart {
                    low: low.clone(),
                    high: high.clone(),
                    sectors: self.sectors,
                    axis: self.axis,
                    apart,
                    radius: self.radius,
                    hint: self.hint(from, to),
                });
            }
        }
        let named: BTreeMap<&str, &str> = pairs.iter().map(|(low, high)| (low.as_str(), high.as_str())).collect();
        let all = self.pairs()?;
        let is = |low: &String, high: &String| named.get(low.as_str()) == Some(&high.as_str());
        let mut missing =
            all.iter().filter(|(low, high)| !(named.contains_key(low.as_str()) || self.sectors == 2 && is(high, low)));
        match missing.next() {
            Some((low, high)) => {
                let count = 1 + missing.count();
                Err(FacesError::Missing { low: low.clone(), high: high.clone(), count })
            }
            None => Ok(()),
        }
    }

    fn rotated_distance(&self, axis: CoordinateAxis, angle: f64, from: [f64; 3], to: [f64; 3]) -> f64 {
        distance(turned(&axis.rotation(angle), from), to)
    }

    /// Returns a suggestion that makes a pair fit.
    fn hint(&self, from: [f64; 3], to: [f64; 3]) -> Option<String> {
        let angle = TAU / self.sectors as f64;
        let fits = |axis: CoordinateAxis, angle: f64| self.rotated_distance(axis, angle, from, to) <= self.tolerance();
        if fits(self.axis, -angle) {
            return Some(format!(
                "the sides are exchanged: the low side is the start of the sector by the right-hand rule about {}",
                self.axis
            ));
        }
        let others =
            [CoordinateAxis::X, CoordinateAxis::Y, CoordinateAxis::Z].into_iter().filter(|axis| *axis != self.axis);
        for axis in others {
            if fits(axis, angle) {
                return Some(format!("they coincide for a rotation about {axis}"));
            }
        }
        let between = self.axis.angle(from, to);
        (fits(self.axis, between) && between.abs() > 0.0).then(|| {
            format!(
                "they are {:.3}° apart about {}, as in a disk with {:.2} sectors",
                between.to_degrees(),
                self.axis,
                TAU / between.abs()
            )
        })
    }
}

fn turned(turn: &[[f64; 3]; 3], at: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| (0..3).map(|k| turn[i][k] * at[k]).sum())
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two radii and two heights on both sides of one of ten sectors, and a blade in its
    /// middle.
    fn nodes(axis: CoordinateAxis) -> Vec<NodeCoordinates> {
        let turn = |angle: f64, at: [f64; 3]| turned(&axis.rotation(angle), at);
        let mut nodes = Vec::new();
        for (k, angle) in [0.3, 0.3 + TAU / 10.0, 0.6].into_iter().enumerate() {
            for (i, (radius, height)) in [(50.0, 0.0), (50.0, 8.0), (90.0, 0.0), (90.0, 8.0)].into_iter().enumerate() {
                // along the axis and across it
                let own = axis as usize;
                let mut at = [0.0; 3];
                (at[own], at[(own + 1) % 3]) = (height, radius);
                nodes.push((format!("{}", 10 * k + i), turn(angle, at)));
            }
        }
        nodes
    }

    fn named(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
        pairs.iter().map(|(low, high)| ((*low).to_owned(), (*high).to_owned())).collect()
    }

    #[test]
    fn coordinates_tell_the_pairs() {
        for axis in [CoordinateAxis::X, CoordinateAxis::Y, CoordinateAxis::Z] {
            let nodes = nodes(axis);
            let pairs = SectorFaces::new(&nodes, axis, 10).pairs().unwrap();
            assert_eq!(pairs, named(&[("0", "10"), ("1", "11"), ("2", "12"), ("3", "13")]), "{axis}");
        }
    }

    #[test]
    fn wrong_pairs_are_refused_with_what_would_fit() {
        let nodes = nodes(CoordinateAxis::Z);
        let right = [("0", "10"), ("1", "11"), ("2", "12"), ("3", "13")];
        let refused = |axis: CoordinateAxis, sectors: usize, pairs: &[(&str, &str)]| {
            SectorFaces::new(&nodes, axis, sectors).check(&named(pairs)).map_err(|error| error.to_string())
        };
        assert_eq!(refused(CoordinateAxis::Z, 10, &right), Ok(()));
        for (axis, sectors, pairs, words) in [
            (CoordinateAxis::Z, 10, &right.map(|(low, high)| (high, low))[..], "sides are exchanged"),
            (CoordinateAxis::Z, 12, &right[..], "as in a disk with 10.00 sectors"),
            (CoordinateAxis::X, 10, &right[..], "they coincide for a rotation about z"),
            (CoordinateAxis::Z, 10, &[("0", "11"), ("1", "10")][..], "8.000e0 away from node `11`"),
            (CoordinateAxis::Z, 10, &right[..3], "nodes `3` and `13` coincide after rotation, but no pair names them"),
            (CoordinateAxis::Z, 10, &[("0", "99")][..], "node `99` has no coordinates"),
        ] {
            let message = refused(axis, sectors, pairs).unwrap_err();
            assert!(message.contains(words), "{words}: {message}");
        }
        // with two sectors, the order of the sides does not matter
        let half: Vec<NodeCoordinates> =
            [("1", 3.0), ("2", -3.0)].map(|(name, x)| (name.to_owned(), [x, 0.0, 1.0])).to_vec();
        let faces = SectorFaces::new(&half, CoordinateAxis::Z, 2);
        assert_eq!(faces.pairs().unwrap(), named(&[("1", "2")]));
        assert!([[("1", "2")], [("2", "1")]].iter().all(|pairs| faces.check(&named(pairs)).is_ok()));
        assert!(
            SectorFaces::new(&nodes, CoordinateAxis::Z, 11)
                .pairs()
                .unwrap_err()
                .to_string()
                .contains("number of sectors")
        );
    }
}
