//! The geometry of one face: area, normals, the share of every node, and the closest point.
//!
//! Faces are interpolated by the shape functions `N` of their 3, 4, 6 or 8 nodes. The area is
//! shared among the nodes so that no share is negative:
//! - linear faces: `∫ N dA`, which sums to the area and keeps its first moment;
//! - quadratic faces: `∫ N² dA`, scaled to the area. `∫ N dA` is zero at the corners of a triangle
//!   of six nodes and negative at those of a quadrilateral of eight. On flat faces with straight
//!   edges a corner and a middle node of the triangle have 1/19 and 16/57 of the area, those of
//!   the quadrilateral 3/76 and 4/19.
//!
//! Source: E. Hinton, T. Rock, O. C. Zienkiewicz: A note on mass lumping and related processes in
//! the finite element method, Earthquake Eng. Struct. Dyn. 4 (1976).

use super::vector::{Vector, cross, dot, norm, scaled, sub};

/// A face: its nodes, and their positions.
#[derive(Debug, Clone, PartialEq)]
pub struct Face {
    /// Indices of its nodes in the mesh: corners around the face as seen from outside, then the
    /// middle nodes.
    pub nodes: Vec<usize>,
    points: Vec<Vector>,
}

/// A node's part of a face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeShare {
    /// Area, in the square of the mesh's unit of length.
    pub area: f64,
    /// Unit normal of the face at the node.
    pub normal: [f64; 3],
}

/// The point of a face that is closest to a given one.
#[derive(Debug, Clone, PartialEq)]
pub struct ClosestPoint {
    /// Distance between both points.
    pub distance: f64,
    /// Unit normal of the face at the point.
    pub normal: [f64; 3],
    /// Values of the shape functions: weights of the face's nodes, which sum to one.
    pub weights: Vec<f64>,
    /// Position of the point.
    pub position: [f64; 3],
}

/// Values of the shape functions, and their derivatives by both coordinates.
struct Interpolation {
    values: [f64; 8],
    derivatives: [[f64; 8]; 2],
}

/// A point of the reference face, with its weight in an integral.
struct QuadraturePoint {
    at: [f64; 2],
    weight: f64,
}

impl Face {
    pub(super) fn new(nodes: Vec<usize>, points: Vec<Vector>) -> Self {
        Face { nodes, points }
    }

    /// Turns the face over.
    pub(super) fn flip(&mut self) {
        // the first corner stays, and the edge after it becomes the last one
        let corners = self.corners();
        let order = |i: usize| match i {
            0 => 0,
            i if i < corners => corners - i,
            i => 2 * corners - 1 - (i - corners),
        };
        let turned: Vec<usize> = (0..self.nodes.len()).map(order).collect();
        self.nodes = turned.iter().map(|i| self.nodes[*i]).collect();
        self.points = turned.iter().map(|i| self.points[*i]).collect();
    }

    /// Returns the number of corners.
    fn corners(&self) -> usize {
        if self.nodes.len().is_multiple_of(3) { 3 } else { 4 }
    }

    fn is_quadratic(&self) -> bool {
        self.nodes.len() > 4
    }

    /// Returns the mean position of its nodes.
    pub fn center(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        self.points.iter().for_each(|point| (0..3).for_each(|axis| sum[axis] += point[axis]));
        scaled(&sum, 1.0 / self.points.len() as f64)
    }

    /// Returns the area.
    pub fn area(&self) -> f64 {
        self.quadrature().iter().map(|point| point.weight * norm(&self.area_vector(point.at))).sum()
    }

    /// Returns the share of every node, in the order of `nodes`; see the head of the file.
    pub fn shares(&self) -> Vec<NodeShare> {
        let count = self.nodes.len();
        let (mut shares, mut area) = (vec![0.0; count], 0.0);
        for point in self.quadrature() {
            let element = point.weight * norm(&self.area_vector(point.at));
            let values = self.interpolate(point.at).values;
            area += element;
            for (share, value) in shares.iter_mut().zip(values) {
                *share += element * if self.is_quadratic() { value * value } else { value };
            }
        }
        let sum: f64 = shares.iter().sum();
        let scale = if sum > 0.0 { area / sum } else { 0.0 };
        let share = |i: usize| NodeShare { area: shares[i] * scale, normal: self.normal(self.node_coordinates(i)) };
        (0..count).map(share).collect()
    }

    /// Returns the closest point of the face.
    pub fn closest(&self, point: &[f64; 3]) -> ClosestPoint {
        let mut best = self.interior_point(point);
        for edge in 0..self.corners() {
            let on_edge = self.edge_point(edge, point);
            if best.as_ref().is_none_or(|best| on_edge.distance < best.distance) {
                best = Some(on_edge);
            }
        }
        best.unwrap_or_else(|| self.point_at([0.0; 2], point))
    }

    /// Returns the closest point by the method of Gauss and Newton, if it lies inside.
    fn interior_point(&self, point: &Vector) -> Option<ClosestPoint> {
        let mut at = if self.corners() == 3 { [1.0 / 3.0; 2] } else { [0.0; 2] };
        for _ in 0..30 {
            let [along, across] = self.tangents(at);
            let gap = sub(point, &self.position(at));
            let (a, b, c) = (dot(&along, &along), dot(&along, &across), dot(&across, &across));
            let determinant = a * c - b * b;
            if determinant <= 0.0 {
                return None;
            }
            let (right, up) = (dot(&along, &gap), dot(&across, &gap));
            let step = [(c * right - b * up) / determinant, (a * up - b * right) / determinant];
            // a point far outside of a curved face does not matter
            at = [0, 1].map(|i| (at[i] + step[i]).clamp(-3.0, 3.0));
            if step[0].abs().max(step[1].abs()) < 1e-13 {
                break;
            }
        }
        let inside = match self.corners() {
            3 => at[0] >= 0.0 && at[1] >= 0.0 && at[0] + at[1] <= 1.0,
            _ => at[0].abs() <= 1.0 && at[1].abs() <= 1.0,
        };
        inside.then(|| self.point_at(at, point))
    }

    /// Returns the closest point of an edge.
    fn edge_point(&self, edge: usize, point: &Vector) -> ClosestPoint {
        let (from, to) = (self.node_coordinates(edge), self.node_coordinates((edge + 1) % self.corners()));
        let along = [to[0] - from[0], to[1] - from[1]];
        let at = |t: f64| [from[0] + t * along[0], from[1] + t * along[1]];
        let mut t = 0.5;
        for _ in 0..30 {
            let [first, second] = self.tangents(at(t));
            let tangent = [0, 1, 2].map(|axis| along[0] * first[axis] + along[1] * second[axis]);
            let length = dot(&tangent, &tangent);
            if length <= 0.0 {
                break;
            }
            let next = (t + dot(&tangent, &sub(point, &self.position(at(t)))) / length).clamp(0.0, 1.0);
            let step = next - t;
            t = next;
            if step.abs() < 1e-13 {
                break;
            }
        }
        self.point_at(at(t), point)
    }

    fn point_at(&self, at: [f64; 2], point: &Vector) -> ClosestPoint {
        let position = self.position(at);
        let weights = self.interpolate(at).values[..self.nodes.len()].to_vec();
        ClosestPoint { distance: norm(&sub(point, &position)), normal: self.normal(at), weights, position }
    }

    fn position(&self, at: [f64; 2]) -> Vector {
        self.combine(&self.interpolate(at).values)
    }

    fn tangents(&self, at: [f64; 2]) -> [Vector; 2] {
        let Interpolation { derivatives, .. } = self.interpolate(at);
        derivatives.map(|by| self.combine(&by))
    }

    /// Returns the sum of the nodes' positions with these weights.
    fn combine(&self, weights: &[f64; 8]) -> Vector {
        let mut sum = [0.0; 3];
        for (point, weight) in self.points.iter().zip(weights) {
            (0..3).for_each(|axis| sum[axis] += weight * point[axis]);
        }
        sum
    }

    /// Returns the normal, with the area per unit area of the reference face as its length.
    fn area_vector(&self, at: [f64; 2]) -> Vector {
        let [along, across] = self.tangents(at);
        cross(&along, &across)
    }

    /// Returns the unit normal; zero on a face without area.
    fn normal(&self, at: [f64; 2]) -> Vector {
        let vector = self.area_vector(at);
        let length = norm(&vector);
        if length > 0.0 { scaled(&vector, 1.0 / length) } else { [0.0; 3] }
    }

    /// Returns the coordinates of a node in the reference face.
    fn node_coordinates(&self, node: usize) -> [f64; 2] {
        let corner = |i: usize| match (self.corners(), i) {
            (3, i) => [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]][i],
            (_, i) => [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]][i],
        };
        let corners = self.corners();
        if node < corners {
            return corner(node);
        }
        let (a, b) = (corner(node - corners), corner((node - corners + 1) % corners));
        [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
    }

    fn interpolate(&self, at: [f64; 2]) -> Interpolation {
        match self.corners() {
            3 => triangle(at, self.is_quadratic()),
            _ => quadrilateral(at, self.is_quadratic()),
        }
    }

    /// Returns the points of Gauss quadrature: 7 on a triangle (degree 5), 9 on a quadrilateral
    /// (degree 5 in each coordinate). Both are exact for `∫ N² dA` on flat faces.
    fn quadrature(&self) -> Vec<QuadraturePoint> {
        let root = 15.0f64.sqrt();
        if self.corners() == 3 {
            let mut points = vec![QuadraturePoint { at: [1.0 / 3.0; 2], weight: 9.0 / 80.0 }];
            for sign in [1.0, -1.0] {
                let (a, weight) = ((6.0 + sign * root) / 21.0, (155.0 + sign * root) / 2400.0);
                let b = 1.0 - 2.0 * a;
                points.extend([[a, a], [a, b], [b, a]].map(|at| QuadraturePoint { at, weight }));
            }
            return points;
        }
        let line = [(-root / 5.0, 5.0 / 9.0), (0.0, 8.0 / 9.0), (root / 5.0, 5.0 / 9.0)];
        let pairs = line.iter().flat_map(|first| line.iter().map(move |second| (first, second)));
        pairs.map(|((r, of_r), (s, of_s))| QuadraturePoint { at: [*r, *s], weight: of_r * of_s }).collect()
    }
}

/// Shape functions of a triangle over area coordinates.
fn triangle([r, s]: [f64; 2], quadratic: bool) -> Interpolation {
    let areas = [1.0 - r - s, r, s];
    let by = [[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]];
    let mut found = Interpolation { values: [0.0; 8], derivatives: [[0.0; 8]; 2] };
    for i in 0..3 {
        let j = (i + 1) % 3;
        found.values[i] = if quadratic { areas[i] * (2.0 * areas[i] - 1.0) } else { areas[i] };
        for (derivatives, by) in found.derivatives.iter_mut().zip(&by) {
            derivatives[i] = if quadratic { (4.0 * areas[i] - 1.0) * by[i] } else { by[i] };
            if quadratic {
                derivatives[3 + i] = 4.0 * (by[i] * areas[j] + areas[i] * by[j]);
            }
        }
        if quadratic {
            found.values[3 + i] = 4.0 * areas[i] * areas[j];
        }
    }
    found
}

/// Bilinear shape functions, or those of the serendipity quadrilateral with eight nodes.
fn quadrilateral([r, s]: [f64; 2], quadratic: bool) -> Interpolation {
    let mut found = Interpolation { values: [0.0; 8], derivatives: [[0.0; 8]; 2] };
    for (i, [a, b]) in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].into_iter().enumerate() {
        let (p, q) = (1.0 + a * r, 1.0 + b * s);
        let (value, by_r, by_s) = if quadratic {
            let inner = a * r + b * s - 1.0;
            (p * q * inner / 4.0, a * q * (inner + p) / 4.0, b * p * (inner + q) / 4.0)
        } else {
            (p * q / 4.0, a * q / 4.0, b * p / 4.0)
        };
        (found.values[i], found.derivatives[0][i], found.derivatives[1][i]) = (value, by_r, by_s);
    }
    if quadratic {
        for (i, end) in [(4, -1.0), (6, 1.0)] {
            let q = 1.0 + end * s;
            (found.values[i], found.derivatives[0][i], found.derivatives[1][i]) =
                ((1.0 - r * r) * q / 2.0, -r * q, end * (1.0 - r * r) / 2.0);
        }
        for (i, end) in [(5, 1.0), (7, -1.0)] {
            let p = 1.0 + end * r;
            (found.values[i], found.derivatives[0][i], found.derivatives[1][i]) =
                ((1.0 - s * s) * p / 2.0, end * (1.0 - s * s) / 2.0, -s * p);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a face of straight edges on these corners, with middle nodes or without.
    fn face(corners: &[Vector], quadratic: bool) -> Face {
        let mut points = corners.to_vec();
        if quadratic {
            let next = |i: usize| &corners[(i + 1) % corners.len()];
            let middle = |i: usize| [0, 1, 2].map(|axis| 0.5 * (corners[i][axis] + next(i)[axis]));
            points.extend((0..corners.len()).map(middle));
        }
        Face::new((0..points.len()).collect(), points)
    }

    const TRIANGLE: [Vector; 3] = [[1.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, 2.0, 0.0]];
    const RECTANGLE: [Vector; 4] = [[0.0, 1.0, 0.0], [0.0, 3.0, 0.0], [0.0, 3.0, 5.0], [0.0, 1.0, 5.0]];

    /// The fractions of Hinton, Rock and Zienkiewicz: ratios of the integrals of the squares of
    /// shape functions, 1/60 : 4/45 on the triangle, 1/5 · 1/9 … on the quadrilateral.
    #[test]
    fn shares_are_those_of_the_lumped_mass() {
        for (face, area, shares) in [
            (face(&TRIANGLE, false), 3.0, vec![1.0 / 3.0; 3]),
            (face(&RECTANGLE, false), 10.0, vec![0.25; 4]),
            (face(&TRIANGLE, true), 3.0, [vec![1.0 / 19.0; 3], vec![16.0 / 57.0; 3]].concat()),
            (face(&RECTANGLE, true), 10.0, [vec![3.0 / 76.0; 4], vec![4.0 / 19.0; 4]].concat()),
        ] {
            assert!((face.area() - area).abs() < 1e-13 * area);
            for (found, share) in face.shares().iter().zip(&shares) {
                assert!((found.area - share * area).abs() < 1e-13 * area, "{found:?} {share}");
            }
        }
    }

    /// A triangle of six nodes on the unit sphere. Its area is that of the spherical triangle,
    /// `2 atan(a·(b×c)/(1 + a·b + b·c + c·a))` (van Oosterom and Strackee 1983), up to the error of
    /// the interpolation, and its normals are the radii.
    #[test]
    fn curved_faces_have_the_normals_of_their_nodes() {
        let unit = |x: Vector| scaled(&x, 1.0 / norm(&x));
        let [a, b, c] = [[1.0, 0.0, 0.0], [1.0, 0.3, 0.0], [1.0, 0.1, 0.25]].map(unit);
        let between = |a: &Vector, b: &Vector| unit([0, 1, 2].map(|i| a[i] + b[i]));
        let points = vec![a, b, c, between(&a, &b), between(&b, &c), between(&c, &a)];
        let face = Face::new((0..6).collect(), points.clone());
        let exact = 2.0 * (dot(&a, &cross(&b, &c)) / (1.0 + dot(&a, &b) + dot(&b, &c) + dot(&c, &a))).atan();
        assert!((face.area() / exact - 1.0).abs() < 1e-3, "{} {exact}", face.area());
        for (share, point) in face.shares().iter().zip(&points) {
            assert!(share.area > 0.0 && dot(&share.normal, point) > 0.9999, "{share:?} {point:?}");
        }
    }

    #[test]
    fn a_turned_face_has_the_opposite_normal_and_the_same_shares() {
        for (corners, quadratic) in [(&TRIANGLE[..], true), (&RECTANGLE[..], true), (&RECTANGLE[..], false)] {
            let one = face(corners, quadratic);
            let mut other = one.clone();
            other.flip();
            assert_eq!(other.nodes[0], 0);
            for (share, node) in other.shares().iter().zip(&other.nodes) {
                let before = one.shares()[*node];
                assert!((share.area - before.area).abs() < 1e-14);
                assert!(dot(&share.normal, &before.normal) < -0.999_999);
            }
        }
    }

    #[test]
    fn the_closest_point_lies_inside_or_on_an_edge() {
        for quadratic in [false, true] {
            let inside = face(&RECTANGLE, quadratic).closest(&[0.3, 1.4, 2.2]);
            assert!((inside.distance - 0.3).abs() < 1e-12 && (inside.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let beside = face(&RECTANGLE, quadratic).closest(&[0.0, 4.0, 6.0]);
            assert!((beside.distance - 2.0f64.sqrt()).abs() < 1e-12 && (beside.weights[2] - 1.0).abs() < 1e-12);
            // the foot on the slanted edge, with the line 2x + 3y = 8
            let slanted = face(&TRIANGLE, quadratic).closest(&[4.0, 3.0, 0.0]);
            assert!((slanted.distance - 9.0 / 13.0f64.sqrt()).abs() < 1e-12, "{slanted:?}");
        }
    }

    /// Derivatives of the shape functions against central differences.
    #[test]
    fn derivatives_agree_with_differences() {
        for quadratic in [false, true] {
            for of in [triangle as fn([f64; 2], bool) -> Interpolation, quadrilateral] {
                for i in 0..2 {
                    let at = |step: f64| {
                        let mut at = [0.2, 0.37];
                        at[i] += step;
                        of(at, quadratic).values
                    };
                    let (up, down, exact) = (at(1e-5), at(-1e-5), of([0.2, 0.37], quadratic).derivatives[i]);
                    for node in 0..8 {
                        assert!(((up[node] - down[node]) / 2e-5 - exact[node]).abs() < 1e-9, "{quadratic} {node}");
                    }
                }
            }
        }
    }
}
