//! Places of a matrix structure or of a node of masses.
//!
//! A place is a weighted sum of rows. A node has several directions, optionally in a local
//! frame.

use crate::structure::reduction::Row;
use serde::Serialize;
use stickslip_numerics::vector::dot;

/// Returns the names of the places of a node: the name itself, or one name per direction.
pub(super) fn places_of(name: &str, directions: &[String]) -> Vec<String> {
    if directions.is_empty() {
        return vec![name.to_owned()];
    }
    directions.iter().map(|along| format!("{name}.{along}")).collect()
}

/// A place of a model's [`Substructure`](super::Substructure), or a second view of a node of
/// masses.
///
/// A place has one displacement; a node has up to three.
///
/// # Example
/// ```
/// use stickslip::model::{Frame, Place};
/// // rows 6, 7, 8 of the matrices are x, y, z of a node
/// // the contact plane is inclined by 30 degrees about x
/// let (sin, cos) = (0.5, 0.75f64.sqrt());
/// let frame = Frame::new([0.0, -sin, cos], Some([1.0, 0.0, 0.0])).unwrap();
/// let node =
///     Place::node("n188", &["t1", "t2", "n"], [6, 7, 8].map(|row| vec![(row, 1.0)]).to_vec())
///         .in_frame(frame);
/// let normal = &node.displacements(&node.rows)[2];
/// assert_eq!(normal.len(), 2);
/// assert!((normal[0].1 + sin).abs() < 1e-15 && (normal[1].1 - cos).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Identifier.
    pub name: String,
    /// Directions of a node, at most three, in the order that laws expect; a normal comes last.
    /// Empty for a place with one displacement.
    pub directions: Vec<String>,
    /// The displacement along each direction, as (row from 0, weight). With a frame, the
    /// displacements along x, y, z of the structure.
    pub rows: Vec<Row>,
    /// Axes of the directions. `None` means the axes of the structure.
    pub frame: Option<Frame>,
    /// The node of masses of which this place is another view. The rows then count the
    /// directions of that node, from 0. `None` means that they are rows of the substructure.
    #[serde(rename = "of", skip_serializing_if = "Option::is_none")]
    pub view_of: Option<String>,
}

impl Place {
    /// Returns the rows of the substructure in all places, without second views of a node: those
    /// whose displacements a reduction keeps.
    pub fn substructure_rows(places: &[Place]) -> Vec<Row> {
        places.iter().filter(|place| place.view_of.is_none()).flat_map(|place| place.rows.iter().cloned()).collect()
    }

    /// Creates a place with one displacement.
    pub fn new(name: impl Into<String>, row: Row) -> Self {
        Place { name: name.into(), directions: Vec::new(), rows: vec![row], frame: None, view_of: None }
    }

    /// Creates a node with one displacement per direction.
    pub fn node(name: impl Into<String>, directions: &[&str], rows: Vec<Row>) -> Self {
        let directions = directions.iter().map(|&along| along.to_owned()).collect();
        Place { name: name.into(), directions, rows, frame: None, view_of: None }
    }

    /// Returns this node with axes along a local frame. Its rows are the displacements along x,
    /// y, z.
    #[must_use]
    pub fn in_frame(self, frame: Frame) -> Self {
        Place { frame: Some(frame), ..self }
    }

    /// Returns this place as a view of a node of masses instead of the substructure.
    ///
    /// An example is a face of a rigid body that is inclined to the axes of its motion.
    ///
    /// # Example
    /// A mass moves along x and z. It has a face inclined by 30 degrees, which joints and
    /// forces can name.
    /// ```
    /// use stickslip::model::Place;
    /// use stickslip::{Mass, Model};
    /// let (sin, cos) = (0.5, 0.75f64.sqrt());
    /// let node = Mass { directions: vec!["x".into(), "z".into()], ..Mass::new("block", 2.0) };
    /// let face = Place::node(
    ///     "face",
    ///     &["t", "n"],
    ///     vec![vec![(0, cos), (1, sin)], vec![(0, -sin), (1, cos)]],
    /// )
    /// .as_view_of("block");
    /// let model = Model { masses: vec![node], places: vec![face], ..Model::default() };
    /// assert_eq!(model.assemble().unwrap().places(), ["block.x", "block.z", "face.t", "face.n"]);
    /// ```
    #[must_use]
    pub fn as_view_of(self, node: impl Into<String>) -> Self {
        Place { view_of: Some(node.into()), ..self }
    }

    /// Returns the displacement along each direction for the given `rows`, in the numbering of
    /// those rows.
    pub fn displacements(&self, rows: &[Row]) -> Vec<Row> {
        let Some(frame) = &self.frame else { return rows.to_vec() };
        let along = |axis: &[f64; 3]| {
            let parts = rows.iter().zip(axis).filter(|(_, share)| **share != 0.0);
            parts.flat_map(|(row, share)| row.iter().map(move |(at, weight)| (*at, weight * share))).collect()
        };
        frame.axes.iter().map(along).collect()
    }

    /// Returns the names of its places: its own name, or one name per direction.
    pub fn places(&self) -> Vec<String> {
        places_of(&self.name, &self.directions)
    }
}

/// Two tangents and a normal: orthogonal unit vectors, right-handed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Frame {
    axes: [[f64; 3]; 3],
}

/// Vectors that do not define a frame.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// A vector is zero or not finite.
    #[error("the {0} must be three finite numbers, not all zero")]
    NoDirection(&'static str),
    /// The tangent is parallel to the normal.
    #[error("the angle between tangent and normal is {angle:.1}°; it must exceed {MIN_TANGENT_ANGLE}°")]
    Parallel {
        /// Angle between tangent and normal, degrees.
        angle: f64,
    },
}

/// Smallest angle between a tangent and the normal or its opposite, degrees. Vectors with three
/// digits still define a plane at this angle.
const MIN_TANGENT_ANGLE: f64 = 1.0;

impl Frame {
    /// Creates a frame from a normal and an optional tangent.
    ///
    /// The component of `tangent` orthogonal to the normal is the first tangent; the second
    /// tangent completes a right-handed frame. Without `tangent`, the first tangent follows the
    /// coordinate axis that has the largest angle to the normal.
    ///
    /// # Errors
    /// [`FrameError`]: a vector has no direction, or both vectors are parallel.
    pub fn new(normal: [f64; 3], tangent: Option<[f64; 3]>) -> Result<Self, FrameError> {
        let normal = unit(normal).ok_or(FrameError::NoDirection("normal"))?;
        let along = match tangent {
            Some(tangent) => unit(tangent).ok_or(FrameError::NoDirection("tangent"))?,
            None => {
                let axis = (0..3).min_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(0);
                std::array::from_fn(|i| f64::from(u8::from(i == axis)))
            }
        };
        let share = dot(&along, &normal);
        let across: [f64; 3] = std::array::from_fn(|i| along[i] - share * normal[i]);
        let angle = dot(&across, &across).sqrt().atan2(share.abs()).to_degrees();
        let first = unit(across).filter(|_| angle > MIN_TANGENT_ANGLE).ok_or(FrameError::Parallel { angle })?;
        let second = [
            normal[1] * first[2] - normal[2] * first[1],
            normal[2] * first[0] - normal[0] * first[2],
            normal[0] * first[1] - normal[1] * first[0],
        ];
        Ok(Frame { axes: [first, second, normal] })
    }

    /// Returns the first tangent, the second tangent and the normal.
    pub fn axes(&self) -> &[[f64; 3]; 3] {
        &self.axes
    }
}

/// Returns the unit vector of the same direction, or `None` if the vector is zero or not
/// finite.
fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let largest = vector.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    if !(vector.iter().all(|v| v.is_finite()) && largest > 0.0) {
        return None;
    }
    let scaled = vector.map(|v| v / largest);
    let length = dot(&scaled, &scaled).sqrt();
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
                    assert!((dot(&axes[a], &axes[b]) - f64::from(u8::from(a == b))).abs() < 1e-15);
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
        assert!(no([0.0, 0.0, 1.0], Some([0.0, 0.01, 2.0])).contains("0.3°"));
        assert!(no([0.0, f64::NAN, 1.0], None).contains("finite"));
    }
}
