//! Directions in which friction alone holds a body.
//!
//! Closed faces hold a body across their planes, and springs hold it along their directions. Along
//! the other directions friction alone holds it. A body that vibrates may creep along these
//! directions, period by period, and then there is no periodic motion.

use super::super::{Axis, System, SystemJoint};
use super::rigid_body::DisjointSets;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;
use stickslip_numerics::eigen;

/// Largest number of degrees of freedom of a body, or of bodies on common springs. Larger parts of
/// a structure are not examined.
const LARGEST_PART: usize = 60;

/// A direction in which friction alone holds a body.
#[derive(Debug, Clone, PartialEq)]
pub struct FrictionDirection {
    /// The place that moves.
    pub place: String,
    /// True for a rotation.
    pub is_rotation: bool,
    /// The mass that moves, kg; the moment of inertia, kg m², for a rotation.
    pub mass: f64,
}

impl FrictionDirection {
    /// Returns the stiffness of a spring that holds the body along this direction and is soft
    /// against its inertia at `omega` (rad/s), N/m (N m/rad for a rotation).
    pub fn spring(&self, omega: f64) -> f64 {
        soft_spring(self.mass, omega)
    }

    /// Returns the unit of [`FrictionDirection::spring`].
    pub fn spring_unit(&self) -> &'static str {
        if self.is_rotation { "N m/rad" } else { "N/m" }
    }
}

/// Returns the stiffness of a spring that holds a creeping mass and is soft against its inertia,
/// N/m: a tenth of the mass (kg) times the squared frequency (rad/s). On a spring of a hundredth,
/// a wedge damper moves so far that harmonic balance fails at half of the points.
pub(crate) fn soft_spring(mass: f64, omega: f64) -> f64 {
    0.1 * mass * omega * omega
}

impl System {
    /// Returns the directions in which friction alone holds a body, while its contacts are closed.
    /// Bodies without any closed face are not listed.
    ///
    /// # Example
    /// A block of 0.2 kg lies on a plate that presses against it along z.
    /// ```
    /// use std::sync::Arc;
    /// use stickslip::law::FrictionContact;
    /// use stickslip::model::{GROUND, Joint, Mass, Model};
    /// let (tangential, normal) = (1e6, 2e6);
    /// let law = FrictionContact { tangential, normal, friction: 0.3, preload: 5.0, tangents: 1 };
    /// let block = Mass::new("block", 0.2).along(&["x", "z"]);
    /// let foot = Joint {
    ///     name: "foot".into(),
    ///     between: ["block".into(), GROUND.into()],
    ///     law: Arc::new(law),
    /// };
    /// let model = Model { masses: vec![block], joints: vec![foot], ..Model::default() };
    /// let directions = model.assemble().unwrap().directions_held_by_friction();
    /// assert_eq!((directions.len(), directions[0].place.as_str()), (1, "block.x"));
    /// assert!((directions[0].spring(100.0) - 200.0).abs() < 1e-12);
    /// ```
    pub fn directions_held_by_friction(&self) -> Vec<FrictionDirection> {
        // without faces the parts of the structure, which may be large, need not be known
        if self.joints().iter().all(|joint| joint.law().normal().is_none()) {
            return Vec::new();
        }
        self.small_parts().iter().flat_map(|part| part.free_directions(self)).collect()
    }

    /// Returns the rows of each part of the structure that has few rows. A joint connects the
    /// coordinates of a body, but not two large parts of the structure.
    fn small_row_sets(&self) -> Vec<Vec<usize>> {
        let n = self.dofs();
        let mut connected = DisjointSets::new(n);
        // modal damping couples all rows of a reduced structure
        let coupled =
            self.structure().entries().filter(|(row, column, [m, _, k])| row < column && (*m, *k) != (0.0, 0.0));
        coupled.for_each(|(row, column, _)| connected.union(row, column));
        let mut size = vec![0; n];
        (0..n).for_each(|row| size[connected.find(row)] += 1);
        let is_small: Vec<bool> = (0..n).map(|row| size[connected.find(row)] <= LARGEST_PART).collect();
        for joint in self.joints() {
            let rows = joint.axes().iter().flat_map(|axis| axis.rows()).map(|(row, _)| *row);
            let rows: Vec<usize> = rows.filter(|row| is_small[*row]).collect();
            rows.windows(2).for_each(|pair| connected.union(pair[0], pair[1]));
        }
        let mut of_set: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        (0..n).filter(|row| is_small[*row]).for_each(|row| of_set.entry(connected.find(row)).or_default().push(row));
        of_set.into_values().filter(|rows| rows.len() <= LARGEST_PART).collect()
    }

    /// Returns the parts of the structure that have few rows, with all that holds them.
    fn small_parts(&self) -> Vec<SmallPart<'_>> {
        let mut parts: Vec<SmallPart> = self.small_row_sets().into_iter().map(SmallPart::new).collect();
        // the part of each row, and its index in the part
        let mut place = vec![None; self.dofs()];
        for (part, own) in parts.iter().enumerate() {
            own.rows.iter().enumerate().for_each(|(index, row)| place[*row] = Some((part, index)));
        }
        for (row, column, [.., k]) in self.structure().entries() {
            if let (Some((part, row)), Some((_, column))) = (place[row], place[column]) {
                parts[part].stiffness[(row, column)] += k;
            }
        }
        let axes = self.joints().iter().flat_map(|joint| holding_axes(joint).iter().map(move |axis| (joint, axis)));
        for (joint, axis) in axes {
            let mut touched: Vec<usize> = axis.rows().iter().filter_map(|(row, _)| Some(place[*row]?.0)).collect();
            touched.sort_unstable();
            touched.dedup();
            for part in touched {
                parts[part].holding.push(axis);
                parts[part].has_faces |= joint.law().normal().is_some();
            }
        }
        for (name, axis) in self.places().iter().zip(self.place_axes()) {
            if let [(row, _)] = *axis.rows()
                && let Some((part, index)) = place[row]
            {
                parts[part].places.push((index, name, axis));
            }
        }
        parts
    }
}

/// A part of a structure with few rows.
struct SmallPart<'a> {
    rows: Vec<usize>,
    stiffness: DMatrix<f64>,
    /// Axes along which joints hold it without friction.
    holding: Vec<&'a Axis>,
    /// True if one of these axes is across faces.
    has_faces: bool,
    /// Places along one coordinate: its index in `rows`, name and axis.
    places: Vec<(usize, &'a String, &'a Axis)>,
}

impl SmallPart<'_> {
    fn new(rows: Vec<usize>) -> Self {
        let stiffness = DMatrix::zeros(rows.len(), rows.len());
        SmallPart { rows, stiffness, holding: Vec::new(), has_faces: false, places: Vec::new() }
    }

    /// Returns the directions that neither stiffness nor closed faces hold.
    fn free_directions(&self, system: &System) -> Vec<FrictionDirection> {
        let n = self.rows.len();
        let mass: Vec<f64> = self.rows.iter().map(|row| system.structure().diagonal_mass(*row)).collect();
        if !self.has_faces || mass.iter().any(|mass| *mass <= 0.0) {
            return Vec::new();
        }
        // in coordinates of equal kinetic energy
        let mut held = DMatrix::from_fn(n, n, |i, k| self.stiffness[(i, k)] / (mass[i] * mass[k]).sqrt());
        let stiffest = held.amax();
        if stiffest > 0.0 {
            held /= stiffest;
        }
        for axis in &self.holding {
            let mut along: DVector<f64> = DVector::zeros(n);
            for (row, weight) in axis.rows() {
                if let Ok(index) = self.rows.binary_search(row) {
                    along[index] += weight / mass[index].sqrt();
                }
            }
            if let Some(along) = along.try_normalize(0.0) {
                held += &along * along.transpose();
            }
        }
        let Some(eigen) = eigen::symmetric(held) else { return Vec::new() };
        let largest = eigen.eigenvalues.amax();
        // Stiffness of a direction relative to the stiffest one, below which it is rounding.
        let free: Vec<usize> = (0..n).filter(|&k| eigen.eigenvalues[k] <= 1e-9 * largest).collect();
        let mut free = eigen.eigenvectors.select_columns(&free);
        let mut found = Vec::new();
        // one place for each free direction: that which moves most in the directions left
        for _ in 0..free.ncols() {
            let share = |index: usize| free.row(index).norm_squared();
            let most = self.places.iter().reduce(|a, b| if share(b.0) > 1.01 * share(a.0) { b } else { a });
            let Some(&(index, name, axis)) = most.filter(|most| share(most.0) > 1e-6) else { break };
            let taken = free.row(index).transpose().normalize();
            free -= &free * &taken * taken.transpose();
            found.push(FrictionDirection { place: name.clone(), is_rotation: axis.is_rotation(), mass: mass[index] });
        }
        found
    }
}

/// Returns the axes along which a joint holds without friction: across its faces, or all axes of a
/// law whose force is unbounded.
fn holding_axes(joint: &SystemJoint) -> &[Axis] {
    match joint.law().normal() {
        Some(normal) => &joint.axes()[normal..=normal],
        None if joint.law().force_scale().is_infinite() => joint.axes(),
        None => &[],
    }
}

#[cfg(test)]
mod tests {
    use crate::law::{Cubic, FrictionContact, Gap, SharedLaw};
    use crate::model::System;
    use crate::structure::Structure;
    use nalgebra::DMatrix;
    use std::sync::Arc;

    /// A body of 2 kg along x, y and z. Faces whose normals lie in the plane of x and y touch it.
    fn body(joints: Vec<(SharedLaw, Vec<[f64; 3]>)>) -> System {
        let names = ["x", "y", "z"].map(String::from).to_vec();
        let structure =
            Structure::new(names, DMatrix::identity(3, 3) * 2.0, DMatrix::zeros(3, 3), DMatrix::zeros(3, 3));
        let mut builder = System::builder(structure.unwrap());
        for (k, (law, axes)) in joints.into_iter().enumerate() {
            let axis = |along: [f64; 3]| {
                let rows = along.into_iter().enumerate().filter(|(_, weight)| *weight != 0.0);
                crate::model::Axis::new(rows.collect())
            };
            builder = builder.joint(format!("j{k}"), law, axes.into_iter().map(axis).collect());
        }
        builder.build().unwrap()
    }

    fn found(joints: Vec<(SharedLaw, Vec<[f64; 3]>)>) -> Vec<String> {
        body(joints).directions_held_by_friction().into_iter().map(|one| one.place).collect()
    }

    fn contact() -> SharedLaw {
        Arc::new(FrictionContact { tangential: 1e6, normal: 2e6, friction: 0.3, preload: 5.0, tangents: 2 })
    }

    /// Two faces of a wedge hold it in their plane; friction alone holds it along the third axis,
    /// unless a spring does.
    #[test]
    fn friction_alone_holds_a_wedge_along_its_faces() {
        let face = |sign: f64| (contact(), vec![[0.6, -0.8 * sign, 0.0], [0.0, 0.0, 1.0], [0.8, 0.6 * sign, 0.0]]);
        assert_eq!(found(vec![face(1.0), face(-1.0)]), ["z"]);
        assert_eq!(found(vec![face(1.0)]).len(), 2);
        let spring: SharedLaw = Arc::new(Cubic { stiffness: 1e9 });
        assert!(found(vec![face(1.0), face(-1.0), (spring, vec![[0.0, 0.0, 1.0]])]).is_empty());
    }

    /// A stop that no friction belongs to holds a body along its direction alone.
    #[test]
    fn a_stop_holds_across_its_face() {
        let stop: SharedLaw = Arc::new(Gap { gap: 0.0, stiffness: 1e6 });
        assert_eq!(found(vec![(stop, vec![[1.0, 0.0, 0.0]])]), Vec::<String>::new());
        assert!(found(Vec::new()).is_empty());
    }
}
