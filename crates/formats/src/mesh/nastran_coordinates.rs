//! Coordinate systems of Nastran bulk data, in which grid points have their coordinates.
//!
//! `CORD2R`, `CORD2C` and `CORD2S` state a rectangular, cylindrical or spherical system by three
//! points in another system: the origin, a point on the third axis, and a point in the half plane
//! of the first axis. `CORD1R`, `CORD1C` and `CORD1S` name three grid points instead. System 0 is
//! the basic one. Angles are in degrees; a spherical angle θ is measured from the third axis.
//!
//! Source: MSC Nastran Quick Reference Guide, bulk data entries `CORD1x`, `CORD2x`, `GRID`,
//! `GRDSET`.

use super::vector::{Vector, cross, norm, scaled, sub};
use std::collections::BTreeMap;

/// Difference between unit vectors that counts as rounding: decks have seven digits.
const ROUNDING: f64 = 1e-6;

/// The systems of a deck, and the grid points that some of them name.
#[derive(Default)]
pub(super) struct CoordinateSystems {
    systems: BTreeMap<i64, StatedSystem>,
    points: BTreeMap<i64, Coordinates>,
    /// Axes that were requested before.
    known: BTreeMap<i64, SystemAxes>,
}

/// Origin and directions of a system, in the basic system.
#[derive(Debug, Clone, Copy)]
struct SystemAxes {
    kind: SystemKind,
    origin: Vector,
    directions: [Vector; 3],
}

/// A position in a system.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Coordinates {
    pub system: i64,
    pub values: Vector,
}

/// The kind of a system's coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SystemKind {
    /// x, y, z.
    Rectangular,
    /// r, θ, z.
    Cylindrical,
    /// r, θ, φ.
    Spherical,
}

/// A system as a card states it.
struct StatedSystem {
    kind: SystemKind,
    points: SystemPoints,
}

/// The three points of a system.
pub(super) enum SystemPoints {
    /// Their positions.
    Positions([Coordinates; 3]),
    /// Numbers of grid points.
    GridPoints([i64; 3]),
}

impl SystemKind {
    /// Returns the kind of the system of `CORD1x` or `CORD2x`.
    pub fn of_card(name: &str) -> Option<SystemKind> {
        match name.strip_prefix("CORD1").or_else(|| name.strip_prefix("CORD2"))? {
            "R" => Some(SystemKind::Rectangular),
            "C" => Some(SystemKind::Cylindrical),
            "S" => Some(SystemKind::Spherical),
            _ => None,
        }
    }

    fn rectangular(self, [a, b, c]: Vector) -> Vector {
        match self {
            SystemKind::Rectangular => [a, b, c],
            SystemKind::Cylindrical => {
                let (sin, cos) = b.to_radians().sin_cos();
                [a * cos, a * sin, c]
            }
            SystemKind::Spherical => {
                let ((sin, cos), (sin_phi, cos_phi)) = (b.to_radians().sin_cos(), c.to_radians().sin_cos());
                [a * sin * cos_phi, a * sin * sin_phi, a * cos]
            }
        }
    }
}

impl CoordinateSystems {
    /// Adds a system.
    pub fn add(&mut self, number: i64, kind: SystemKind, points: SystemPoints) {
        self.systems.insert(number, StatedSystem { kind, points });
    }

    /// Returns the grid points that define systems.
    pub fn defining_points(&self) -> impl Iterator<Item = i64> + '_ {
        let points = self.systems.values().map(|system| match &system.points {
            SystemPoints::GridPoints(numbers) => &numbers[..],
            SystemPoints::Positions(_) => &[],
        });
        points.flatten().copied()
    }

    /// Adds the position of a grid point that defines a system.
    pub fn add_point(&mut self, number: i64, at: Coordinates) {
        self.points.insert(number, at);
    }

    /// Returns a position in the basic system.
    ///
    /// # Errors
    /// The reason: a system or a grid point is missing, systems depend on each other, or the points
    /// of a system do not define its axes.
    pub fn position(&mut self, at: Coordinates) -> Result<Vector, String> {
        self.position_within(at, &mut Vec::new())
    }

    /// Returns whether the axes of a system are those of the basic one.
    ///
    /// # Errors
    /// See [`CoordinateSystems::position`].
    pub fn is_parallel(&mut self, system: i64) -> Result<bool, String> {
        let unit: [Vector; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        if system == 0 {
            return Ok(true);
        }
        let axes = self.axes(system, &mut Vec::new())?;
        let near = |(axis, unit): (&Vector, &Vector)| norm(&sub(axis, unit)) < ROUNDING;
        Ok(axes.kind == SystemKind::Rectangular && axes.directions.iter().zip(&unit).all(near))
    }

    /// Returns a position in the basic system. `path` are the systems that depend on it.
    fn position_within(&mut self, at: Coordinates, path: &mut Vec<i64>) -> Result<Vector, String> {
        if at.system == 0 {
            return Ok(at.values);
        }
        let SystemAxes { kind, origin, directions } = self.axes(at.system, path)?;
        let local = kind.rectangular(at.values);
        Ok([0, 1, 2].map(|i| origin[i] + (0..3).map(|k| local[k] * directions[k][i]).sum::<f64>()))
    }

    /// Returns the axes of a system. `path` are the systems that depend on it.
    fn axes(&mut self, number: i64, path: &mut Vec<i64>) -> Result<SystemAxes, String> {
        // More systems than any deck nests; each needs memory of the stack.
        let deepest = 64;
        if let Some(known) = self.known.get(&number) {
            return Ok(*known);
        }
        let system = self.systems.get(&number);
        let system = system.ok_or_else(|| format!("coordinate system {number} is not in the deck"))?;
        if path.contains(&number) || path.len() == deepest {
            return Err(format!("coordinate system {number} depends on itself, or on more than {deepest} others"));
        }
        let (kind, points) = (system.kind, self.points(number, system)?);
        path.push(number);
        let mut basic = [[0.0; 3]; 3];
        for (basic, point) in basic.iter_mut().zip(points) {
            *basic = self.position_within(point, path)?;
        }
        path.pop();
        let [origin, b, c] = basic;
        let (third, plane) = (sub(&b, &origin), sub(&c, &origin));
        let second = cross(&third, &plane);
        // NaN has no direction either
        let is_plane = norm(&second) > ROUNDING * norm(&third) * norm(&plane);
        if !is_plane {
            return Err(format!("the three points of coordinate system {number} lie on a line"));
        }
        let unit = |axis: &Vector| scaled(axis, norm(axis).recip());
        let (third, second) = (unit(&third), unit(&second));
        let axes = SystemAxes { kind, origin, directions: [cross(&second, &third), second, third] };
        self.known.insert(number, axes);
        Ok(axes)
    }

    /// Returns the three points that define a system.
    fn points(&self, number: i64, system: &StatedSystem) -> Result<[Coordinates; 3], String> {
        let grid_points = match &system.points {
            SystemPoints::Positions(positions) => return Ok(*positions),
            SystemPoints::GridPoints(numbers) => numbers,
        };
        let point = |point: &i64| {
            let missing =
                || format!("grid point {point}, which defines coordinate system {number}, is not in the deck");
            self.points.get(point).copied().ok_or_else(missing)
        };
        let [a, b, c] = grid_points;
        Ok([point(a)?, point(b)?, point(c)?])
    }
}

#[cfg(test)]
mod tests {
    use crate::mesh::read_bytes;

    /// System 1 has its origin in (1, 2, 3), its first axis along y and its second along -x; 2 is
    /// the cylindrical system of its axes. System 3 is spherical, with the first axis along -x and
    /// the second along -y. System 4 has its axes along y, z and x.
    const SYSTEMS: &str = "CORD2S,3,2,0.,0.,0.,0.,0.,1.\n,1.,90.,0.\n\
        CORD2R,1,0,1.,2.,3.,1.,2.,4.\n,1.,3.,3.\n\
        CORD2C*,2,1,0.,0.\n*,0.,0.,0.,1.\n*,1.,0.,0.\n\
        CORD1R,4,10,11,12,5,20,21,22\nCORD2R,6,0,1.,2.,3.,1.,2.,4.\n,2.,2.,3.\n\
        GRID,10,0,0.,0.,0.\nGRID,11,0,1.,0.,0.\nGRID,12,0,0.,1.,0.\n";

    fn position(cards: &str) -> Result<[f64; 3], String> {
        let mesh = read_bytes(format!("{cards}{SYSTEMS}").as_bytes()).map_err(|error| error.to_string())?;
        Ok(mesh.nodes()[0].position)
    }

    #[test]
    fn positions_are_in_the_basic_system() {
        for (cards, expected) in [
            ("GRID,1,1,1.,2.,3.\n", [-1.0, 3.0, 6.0]),
            ("GRID,1,2,2.,90.,5.\n", [-1.0, 2.0, 8.0]),
            ("GRID,1,3,2.,90.,90.\n", [1.0, 0.0, 3.0]),
            ("GRID,1,3,2.,0.,17.\n", [1.0, 2.0, 5.0]),
            ("GRID,1,4,1.,2.,3.\n", [3.0, 1.0, 2.0]),
            // the default system; system 0 is the basic one
            ("GRID,1,,2.,90.,5.\nGRDSET,,2\n", [-1.0, 2.0, 8.0]),
            ("GRID,1,0,2.,90.,5.\nGRDSET,,2\n", [2.0, 90.0, 5.0]),
        ] {
            let found = position(cards).unwrap();
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-13), "{cards}: {found:?}");
        }
    }

    /// System 6 is parallel to the basic one; -1 is the pressure of a fluid.
    #[test]
    fn displacements_along_other_axes_are_stated() {
        let cards = "GRID,1,,0.,0.,0.,6\nGRID,2,,0.,0.,0.,-1\nGRID,3,,0.,0.,0.,2\nGRID,4,,0.,0.,0.,1\nGRDSET,,,,,,4\n";
        let systems = SYSTEMS.replace("GRID,10,0,0.,0.,0.", "GRID,10,0,0.,0.,0.,0");
        let mesh = read_bytes(format!("{cards}{systems}").as_bytes()).unwrap();
        let stated: Vec<(i64, i64)> =
            mesh.displacement_systems().iter().map(|(node, system)| (*node, *system)).collect();
        assert_eq!(stated, [(3, 2), (4, 1), (11, 4), (12, 4)]);
        let note = "nodes with displacements along other axes than x, y and z: 4 (node 3: coordinate system 2)";
        assert_eq!(mesh.notes(), [note]);
    }

    #[test]
    fn systems_without_axes_are_refused() {
        for (cards, words) in [
            ("GRID,1,7,0.,0.,0.\n", "coordinate system 7 is not in the deck"),
            ("GRID,1,5,0.,0.,0.\n", "grid point 20, which defines coordinate system 5, is not in the deck"),
            ("GRID,1,8,0.,0.,0.\nCORD2R,8,0,0.,0.,0.,0.,0.,1.\n,0.,0.,2.\n", "system 8 lie on a line"),
            ("GRID,1,8,0.,0.,0.\nCORD2R,8,9,0.,0.,0.,0.,0.,1.\n,1.\nCORD2R,9,8,0.,0.,0.,0.,0.,1.\n,1.\n", "on itself"),
            ("GRID,1,,0.,0.,0.,7\n", "coordinate system 7 is not in the deck"),
        ] {
            let found = position(cards).unwrap_err();
            assert!(found.contains(words) && found.contains("line 1"), "{cards}: {found}");
        }
    }
}
