//! Shapes of elements: their corners, edges and sides.
//!
//! The nodes of an element are its corners, then the middle nodes of its edges in the order of
//! [`Family::edges`]. This is the order of Abaqus, CalculiX, Ansys and VTK; other readers permute
//! to it. Sides are numbered as `S1`, `S2` … in Abaqus, here from zero.
//! Source: Abaqus Elements Guide, "Solid (continuum) elements"; VTK file formats, cell types.

use std::fmt;

/// A family of shapes with the same corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Three corners in a face.
    Triangle,
    /// Four corners in a face.
    Quadrilateral,
    /// Four corners in space.
    Tetrahedron,
    /// A quadrilateral and a fifth corner.
    Pyramid,
    /// Two triangles.
    Wedge,
    /// Two quadrilaterals.
    Hexahedron,
}

impl Family {
    /// Returns the number of corners.
    pub fn corners(self) -> usize {
        match self {
            Family::Triangle => 3,
            Family::Quadrilateral | Family::Tetrahedron => 4,
            Family::Pyramid => 5,
            Family::Wedge => 6,
            Family::Hexahedron => 8,
        }
    }

    /// Returns the corners at both ends of each edge.
    pub(crate) fn edges(self) -> &'static [[usize; 2]] {
        match self {
            Family::Triangle => &[[0, 1], [1, 2], [2, 0]],
            Family::Quadrilateral => &[[0, 1], [1, 2], [2, 3], [3, 0]],
            Family::Tetrahedron => &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]],
            Family::Pyramid => &[[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4]],
            Family::Wedge => &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]],
            Family::Hexahedron => {
                &[[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]]
            }
        }
    }

    /// Returns the corners of each side.
    fn sides(self) -> &'static [&'static [usize]] {
        match self {
            Family::Triangle => &[&[0, 1, 2]],
            Family::Quadrilateral => &[&[0, 1, 2, 3]],
            Family::Tetrahedron => &[&[0, 1, 2], &[0, 3, 1], &[1, 3, 2], &[2, 3, 0]],
            Family::Pyramid => &[&[0, 1, 2, 3], &[0, 4, 1], &[1, 4, 2], &[2, 4, 3], &[3, 4, 0]],
            Family::Wedge => &[&[0, 1, 2], &[3, 5, 4], &[0, 3, 4, 1], &[1, 4, 5, 2], &[2, 5, 3, 0]],
            Family::Hexahedron => {
                &[&[0, 1, 2, 3], &[4, 7, 6, 5], &[0, 4, 5, 1], &[1, 5, 6, 2], &[2, 6, 7, 3], &[3, 7, 4, 0]]
            }
        }
    }
}

/// The shape of an element: its family, with or without middle nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// The corners and edges.
    pub family: Family,
    /// True if every edge has a middle node.
    pub quadratic: bool,
}

/// All families.
const FAMILIES: [Family; 6] =
    [Family::Triangle, Family::Quadrilateral, Family::Tetrahedron, Family::Pyramid, Family::Wedge, Family::Hexahedron];

impl Shape {
    /// Returns the shape of a face (triangle, quadrilateral) with this number of nodes.
    pub fn face(nodes: usize) -> Option<Shape> {
        Shape::with_nodes(&FAMILIES[..2], nodes)
    }

    /// Returns the shape of a solid with this number of nodes.
    pub fn solid(nodes: usize) -> Option<Shape> {
        Shape::with_nodes(&FAMILIES[2..], nodes)
    }

    fn with_nodes(families: &[Family], nodes: usize) -> Option<Shape> {
        let both = |family: &Family| [false, true].map(|quadratic| Shape { family: *family, quadratic });
        families.iter().flat_map(both).find(|shape| shape.nodes() == nodes)
    }

    /// Returns the number of nodes.
    pub fn nodes(self) -> usize {
        self.family.corners() + if self.quadratic { self.family.edges().len() } else { 0 }
    }

    /// Returns true for an element with a volume.
    pub fn is_solid(self) -> bool {
        !matches!(self.family, Family::Triangle | Family::Quadrilateral)
    }

    /// Returns the number of sides; a face has one.
    pub fn sides(self) -> usize {
        self.family.sides().len()
    }

    /// Returns the positions of a side's nodes in the element: corners around the side, then the
    /// middle nodes between them.
    pub fn side(self, side: usize) -> Vec<usize> {
        let corners = self.family.sides()[side];
        let mut nodes = corners.to_vec();
        if self.quadratic {
            let pairs = (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]]);
            nodes.extend(pairs.filter_map(|pair| self.middle_node(pair)));
        }
        nodes
    }

    /// Returns the position of the node between two corners.
    fn middle_node(self, [a, b]: [usize; 2]) -> Option<usize> {
        let edge = self.family.edges().iter().position(|edge| *edge == [a, b] || *edge == [b, a]);
        edge.map(|edge| self.family.corners() + edge)
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.family {
            Family::Triangle => "triangles",
            Family::Quadrilateral => "quadrilaterals",
            Family::Tetrahedron => "tetrahedra",
            Family::Pyramid => "pyramids",
            Family::Wedge => "wedges",
            Family::Hexahedron => "hexahedra",
        };
        write!(f, "{name} of {} nodes", self.nodes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every edge of a solid belongs to two sides, which pass it in opposite directions.
    #[test]
    fn sides_of_a_solid_close() {
        for family in &FAMILIES[2..] {
            let mut passed = Vec::new();
            for side in family.sides() {
                passed.extend((0..side.len()).map(|i| [side[i], side[(i + 1) % side.len()]]));
            }
            assert_eq!(passed.len(), 2 * family.edges().len(), "{family:?}");
            for [a, b] in family.edges() {
                assert!(passed.contains(&[*a, *b]) && passed.contains(&[*b, *a]), "{family:?}: {a} {b}");
            }
        }
    }

    #[test]
    fn middle_nodes_lie_between_the_corners_of_their_side() {
        let shape = Shape::solid(20).unwrap();
        assert_eq!(shape.side(3), [1, 5, 6, 2, 17, 13, 18, 9]); // S4 of C3D20: 2-6-7-3, 18, 14, 19, 10
        assert_eq!(Shape::solid(10).unwrap().side(1), [0, 3, 1, 7, 8, 4]); // S2 of C3D10: 1-4-2, 8, 9, 5
        assert_eq!((Shape::face(8).unwrap().side(0), Shape::solid(27)), ((0..8).collect(), None));
        assert_eq!(Shape::solid(15).unwrap().to_string(), "wedges of 15 nodes");
    }
}
