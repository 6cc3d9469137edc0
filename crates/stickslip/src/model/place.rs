//! Places of a structure that came by its matrices, or of a node of masses: weighted sums of their rows, nodes with directions, and local
//! frames.

use crate::structure::reduction::Row;
use serde::Serialize;

/// The places of a name with these directions: itself, or one for each.
pub(super) fn places_of(name: &str, directions: &[String]) -> Vec<String> {
    if directions.is_empty() {
        return vec![name.to_owned()];
    }
    directions.iter().map(|along| format!("{name}.{along}")).collect()
}

/// A place of a model's [`Substructure`](super::Substructure), or of one of its nodes of masses seen in another frame: one displacement, or up to
/// three of a node.
///
/// # Example
/// ```
/// use stickslip::model::{Frame, Place};
/// // rows 6, 7, 8 of the matrices are x, y, z of a node; the contact plane is inclined by 30 degrees about x
/// let (sin, cos) = (0.5, 0.75f64.sqrt());
/// let frame = Frame::new([0.0, -sin, cos], Some([1.0, 0.0, 0.0])).unwrap();
/// let node = Place::node("n188", &["t1", "t2", "n"], [6, 7, 8].map(|row| vec![(row, 1.0)]).to_vec()).turned(frame);
/// let normal = &node.displacements(&node.rows)[2];
/// assert_eq!(normal.len(), 2);
/// assert!((normal[0].1 + sin).abs() < 1e-15 && (normal[1].1 - cos).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Identifier.
    pub name: String,
    /// Its directions if it is a node, at most three, in the order in which laws take them; a normal is the last.
    pub directions: Vec<String>,
    /// The displacement along each direction, or the one that it has: (row from 0, weight). With a frame those along x, y, z of the structure.
    pub rows: Vec<Row>,
    /// The axes that its directions have; those of the structure without it.
    pub frame: Option<Frame>,
    /// The node of a mass that it is another view of: its rows count that node's directions, from 0. Without it they are rows of the substructure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
}

impl Place {
    /// With one displacement.
    pub fn new(name: impl Into<String>, row: Row) -> Self {
        Place { name: name.into(), directions: Vec::new(), rows: vec![row], frame: None, of: None }
    }

    /// A node with a displacement along each direction.
    pub fn node(name: impl Into<String>, directions: &[&str], rows: Vec<Row>) -> Self {
        let directions = directions.iter().map(|&along| along.to_owned()).collect();
        Place { name: name.into(), directions, rows, frame: None, of: None }
    }

    /// The same along the axes of a local frame; its rows are those of x, y, z.
    #[must_use]
    pub fn turned(self, frame: Frame) -> Self {
        Place { frame: Some(frame), ..self }
    }

    /// The same, of a node of masses instead of the substructure: a face of a rigid body that is turned against the axes along which it moves.
    ///
    /// # Example
    /// A mass that moves along x and z has a face inclined by 30 degrees, which joints and forces may then name.
    /// ```
    /// use stickslip::model::Place;
    /// use stickslip::{Mass, Model};
    /// let (sin, cos) = (0.5, 0.75f64.sqrt());
    /// let node = Mass { directions: vec!["x".into(), "z".into()], ..Mass::new("block", 2.0) };
    /// let face = Place::node("face", &["t", "n"], vec![vec![(0, cos), (1, sin)], vec![(0, -sin), (1, cos)]]).of_node("block");
    /// let model = Model { masses: vec![node], places: vec![face], ..Model::default() };
    /// assert_eq!(model.assemble().unwrap().places(), ["block.x", "block.z", "face.t", "face.n"]);
    /// ```
    #[must_use]
    pub fn of_node(self, node: impl Into<String>) -> Self {
        Place { of: Some(node.into()), ..self }
    }

    /// The displacement along each direction, of `rows` that are its own, whatever they count.
    pub fn displacements(&self, rows: &[Row]) -> Vec<Row> {
        let Some(frame) = &self.frame else { return rows.to_vec() };
        let along = |axis: &[f64; 3]| {
            let parts = rows.iter().zip(axis).filter(|(_, share)| **share != 0.0);
            parts.flat_map(|(row, share)| row.iter().map(move |(at, weight)| (*at, weight * share))).collect()
        };
        frame.axes.iter().map(along).collect()
    }

    /// The places that it makes: itself, or one for each of its directions.
    pub fn places(&self) -> Vec<String> {
        places_of(&self.name, &self.directions)
    }
}

/// Two tangents and a normal, orthogonal and of unit length, right-handed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Frame {
    axes: [[f64; 3]; 3],
}

/// Vectors that make no frame.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// A vector without direction.
    #[error("the {0} must be three finite numbers, not all zero")]
    NoDirection(&'static str),
    /// The tangent is no tangent.
    #[error("the angle between tangent and normal is {angle:.1} degrees; it must be more than {LEAST} degrees")]
    Parallel {
        /// Angle between both, degrees.
        angle: f64,
    },
}

/// Angle in degrees that a tangent must have to the normal or its opposite: vectors of three digits then still make a plane.
const LEAST: f64 = 1.0;

impl Frame {
    /// Of a normal, and a vector whose part across the normal is the first tangent; the second completes a right-handed frame. Without a vector
    /// the first tangent lies along the axis that is farthest from the normal.
    ///
    /// # Errors
    /// [`FrameError`]: a vector without direction, or both along one line.
    pub fn new(normal: [f64; 3], tangent: Option<[f64; 3]>) -> Result<Self, FrameError> {
        let normal = unit(normal).ok_or(FrameError::NoDirection("normal"))?;
        let along = match tangent {
            Some(tangent) => unit(tangent).ok_or(FrameError::NoDirection("tangent"))?,
            None => {
                let axis = (0..3).min_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(0);
                std::array::from_fn(|i| f64::from(u8::from(i == axis)))
            }
        };
        let share = dot(along, normal);
        let across: [f64; 3] = std::array::from_fn(|i| along[i] - share * normal[i]);
        let angle = dot(across, across).sqrt().atan2(share.abs()).to_degrees();
        let first = unit(across).filter(|_| angle > LEAST).ok_or(FrameError::Parallel { angle })?;
        let second = [
            normal[1] * first[2] - normal[2] * first[1],
            normal[2] * first[0] - normal[0] * first[2],
            normal[0] * first[1] - normal[1] * first[0],
        ];
        Ok(Frame { axes: [first, second, normal] })
    }

    /// First tangent, second tangent, normal.
    pub fn axes(&self) -> &[[f64; 3]; 3] {
        &self.axes
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The same direction with length one.
fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let largest = vector.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    if !(vector.iter().all(|v| v.is_finite()) && largest > 0.0) {
        return None;
    }
    let scaled = vector.map(|v| v / largest);
    let length = dot(scaled, scaled).sqrt();
    Some(scaled.map(|v| v / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_right_handed_and_orthonormal() {
        for (normal, tangent) in
            [([0.0, 0.0, 3.0], None), ([1.0, 2.0, -0.5], Some([1.0, 0.0, 0.1])), ([1e-200, 2e-200, 0.0], None)]
        {
            let axes = *Frame::new(normal, tangent).unwrap().axes();
            for a in 0..3 {
                for b in 0..3 {
                    assert!((dot(axes[a], axes[b]) - f64::from(u8::from(a == b))).abs() < 1e-15);
                }
            }
            let [t, s, n] = axes;
            let triple = t[0] * (s[1] * n[2] - s[2] * n[1])
                + t[1] * (s[2] * n[0] - s[0] * n[2])
                + t[2] * (s[0] * n[1] - s[1] * n[0]);
            assert!((triple - 1.0).abs() < 1e-15, "{triple}");
        }
        let no = |normal, tangent| Frame::new(normal, tangent).unwrap_err().to_string();
        assert!(no([0.0; 3], None).contains("not all zero"));
        assert!(no([0.0, 0.0, 1.0], Some([0.0, 0.01, 2.0])).contains("0.3 degrees"));
        assert!(no([0.0, f64::NAN, 1.0], None).contains("finite"));
    }
}
