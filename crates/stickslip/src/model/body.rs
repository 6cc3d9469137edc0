//! Rigid bodies with small rotations about the centre of mass, and points of them by offset.
//!
//! A point at the offset `r` moves by `u + θ × r` (right-hand rule). The first coordinates are
//! the displacements `u` of the centre of mass. Each principal axis `e` of the inertia adds the
//! length `ρ (e · θ)` with the radius of gyration `ρ = √(J/m)`. Their mass matrix is `m` times
//! the identity, and all coordinates are in metres.

use super::ElementFault;
use super::place::Place;
use crate::structure::reduction::Row;
use nalgebra::DMatrix;
use serde::Serialize;
use stickslip_numerics::eigen;
use stickslip_numerics::vector::dot;

/// Directions of displacement of a rigid body.
pub const TRANSLATIONS: [&str; 3] = ["x", "y", "z"];
/// Rotations of a rigid body about x, y and z.
pub const ROTATIONS: [&str; 3] = ["rx", "ry", "rz"];

/// A rigid body.
///
/// Its places are `name.direction`: displacements of the centre of mass in m, rotations in rad.
/// A [`Place`] of a body is a point; see [`Body::point`].
///
/// # Example
/// A bar of length L on two equal springs at its ends: it heaves at √(2k/m), and pitches at
/// √(6k/m).
/// ```
/// use stickslip::model::{Body, GROUND, Model, Spring};
/// let (mass, length, stiffness) = (3.0, 0.8, 1e4);
/// let bar = Body::in_plane("bar", mass, mass * length * length / 12.0, ["x", "z"]);
/// let end = |name: &str, x: f64| bar.point(name, [x, 0.0, 0.0]);
/// let spring =
///     |end: &str| Spring { between: [end.into(), GROUND.into()], stiffness, damping: 0.0 };
/// let model = Model {
///     places: vec![end("left", -length / 2.0), end("right", length / 2.0)],
///     springs: vec![spring("left.z"), spring("right.z"), spring("bar.x")],
///     bodies: vec![bar],
///     ..Model::default()
/// };
/// let survey = model.survey().unwrap();
/// let found: Vec<f64> = survey
///     .free()
///     .elastic
///     .iter()
///     .map(|mode| mode.omega * mode.omega * mass / stiffness)
///     .collect();
/// assert!(found.iter().zip([1.0, 2.0, 6.0]).all(|(a, b)| (a - b).abs() < 1e-12 * b), "{found:?}");
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Body {
    /// Identifier.
    pub name: String,
    /// Mass, kg.
    pub mass: f64,
    /// Inertia matrix about the centre of mass, along x, y, z, kg m². Only the rows of its
    /// rotations matter.
    pub inertia: [[f64; 3]; 3],
    /// Its directions: some of [`TRANSLATIONS`] and [`ROTATIONS`], at least one rotation.
    pub directions: Vec<String>,
}

/// A fault of a body: the key and the message.
type BodyFault = (&'static str, String);

impl Body {
    /// Creates a body that moves along two of x, y, z and rotates about the third axis.
    /// `inertia` is the moment of inertia about that axis (kg m²).
    pub fn in_plane(name: impl Into<String>, mass: f64, inertia: f64, directions: [&str; 2]) -> Self {
        Body { name: name.into(), mass, inertia: diagonal([inertia; 3]), directions: with_rotations(&directions) }
    }

    /// Creates a body with all six directions and the principal moments of inertia (kg m²)
    /// about x, y, z.
    pub fn in_space(name: impl Into<String>, mass: f64, inertia: [f64; 3]) -> Self {
        Body { name: name.into(), mass, inertia: diagonal(inertia), directions: with_rotations(&TRANSLATIONS) }
    }

    /// Returns the names of its places, one per direction.
    pub fn places(&self) -> Vec<String> {
        super::place::places_of(&self.name, &self.directions)
    }

    /// Returns a point at an offset (m) from the centre of mass. The point is a node with one
    /// displacement for each axis along which points of the body can move.
    pub fn point(&self, name: impl Into<String>, offset: [f64; 3]) -> Place {
        let axes = self.axes();
        let rows = axes.iter().map(|axis| self.row(offset, unit(*axis))).collect();
        let names: Vec<&str> = axes.iter().map(|axis| TRANSLATIONS[*axis]).collect();
        Place::node(name, &names, rows).as_view_of(self.name.as_str())
    }

    /// Returns the axes x, y, z, by index, along which points of the body can move. A body in a
    /// plane has two.
    pub fn axes(&self) -> Vec<usize> {
        let about = self.rotations();
        let moves = |axis: &usize| self.has(TRANSLATIONS[*axis]) || about.iter().any(|about| about != axis);
        (0..TRANSLATIONS.len()).filter(moves).collect()
    }

    /// Returns the displacement of the point at `offset` (m) along a unit vector, as a weighted
    /// sum of the body's directions, counted from 0.
    pub fn row(&self, offset: [f64; 3], along: [f64; 3]) -> Row {
        let weight = |direction: &String| {
            let find = |names: [&str; 3]| names.iter().position(|name| name == direction);
            match (find(TRANSLATIONS), find(ROTATIONS)) {
                (Some(axis), _) => along[axis],
                (None, Some(axis)) => dot(&cross(unit(axis), offset), &along),
                (None, None) => 0.0,
            }
        };
        let weights = self.directions.iter().map(weight).enumerate();
        weights.filter(|(_, weight)| *weight != 0.0).collect()
    }

    /// Returns the axes of its rotations, by index.
    fn rotations(&self) -> Vec<usize> {
        (0..ROTATIONS.len()).filter(|axis| self.has(ROTATIONS[*axis])).collect()
    }

    /// Returns the radius of gyration of a rotation, m.
    pub(super) fn radius(&self, direction: &str) -> Option<f64> {
        let axis = ROTATIONS.iter().position(|name| *name == direction)?;
        Some((self.inertia[axis][axis] / self.mass).sqrt())
    }

    fn has(&self, direction: &str) -> bool {
        self.directions.iter().any(|own| own == direction)
    }

    /// Returns whether its directions, mass and inertia are valid.
    pub fn is_valid(&self) -> bool {
        self.check().is_ok()
    }

    /// Checks directions, mass and inertia. Duplicate directions are detected together with
    /// those of all nodes.
    pub(super) fn check(&self) -> Result<(), BodyFault> {
        let known = |name: &String| TRANSLATIONS.iter().chain(&ROTATIONS).any(|known| known == name);
        if let Some(other) = self.directions.iter().find(|name| !known(name)) {
            let message = format!(
                "`{other}` is not a direction of a body; use x, y, z (displacements) and rx, ry, rz (rotations)"
            );
            return Err(("directions", message));
        }
        let about = self.rotations();
        if about.is_empty() {
            let message = "the body has no rotation; name two or three of x, y, z (the rotations then follow), or \
                           name a rotation, as in [\"z\", \"ry\"]; use a [[mass]] for a body that never rotates";
            return Err(("directions", message.to_owned()));
        }
        let along: Vec<usize> = (0..3).filter(|axis| self.has(TRANSLATIONS[*axis])).collect();
        if let [first, second] = along[..]
            && let own = 3 - first - second
            && about != [own]
        {
            let message = format!(
                "a body in the plane {}, {} rotates about {} only; its rotation is {}",
                TRANSLATIONS[first], TRANSLATIONS[second], TRANSLATIONS[own], ROTATIONS[own]
            );
            return Err(("directions", message));
        }
        if !(self.mass.is_finite() && self.mass > 0.0) {
            return Err(("mass", format!("must be a finite number above zero, in kg, found {}", self.mass)));
        }
        self.check_inertia(&about).map_err(|message| ("inertia", message))
    }

    fn check_inertia(&self, about: &[usize]) -> Result<(), String> {
        let entries = || about.iter().flat_map(|a| about.iter().map(|b| (*a, *b)));
        let symmetric = |(a, b): (usize, usize)| self.inertia[a][b] == self.inertia[b][a];
        if !entries().all(|(a, b)| self.inertia[a][b].is_finite()) || !entries().all(symmetric) {
            return Err("must be a symmetric matrix of finite numbers, in kg m^2".to_owned());
        }
        let mut moments: Vec<f64> = self.principal().iter().map(|principal| principal.moment).collect();
        moments.sort_by(f64::total_cmp);
        if moments.len() < about.len() || moments[0] <= 0.0 {
            let least = moments.first().copied().unwrap_or(f64::NAN);
            return Err(format!(
                "the moment of inertia about every axis must be above zero, but the smallest is {least:e} kg m^2; \
                 use a [[mass]] for a body without inertia"
            ));
        }
        // tolerance for typed numbers with few digits
        if let [small, middle, large] = moments[..]
            && small + middle < 0.99 * large
        {
            return Err(format!(
                "the principal moments {small:e}, {middle:e} and {large:e} kg m^2 are physically \
                 impossible: none may exceed the sum of the other two"
            ));
        }
        Ok(())
    }

    /// Returns the principal axes of its inertia, within the axes of its rotations.
    pub(super) fn principal(&self) -> Vec<PrincipalAxis> {
        let about = self.rotations();
        let matrix = DMatrix::from_fn(about.len(), about.len(), |i, k| self.inertia[about[i]][about[k]]);
        let diagonal = (0..about.len()).all(|i| (0..i).all(|k| matrix[(i, k)] == 0.0));
        let mut found = Vec::with_capacity(about.len());
        if diagonal {
            found.extend(
                about.iter().map(|axis| PrincipalAxis { moment: self.inertia[*axis][*axis], axis: unit(*axis) }),
            );
        } else if let Some(eigen) = eigen::symmetric(matrix) {
            for (moment, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
                let mut axis = [0.0; 3];
                about.iter().zip(vector.iter()).for_each(|(at, share)| axis[*at] = *share);
                found.push(PrincipalAxis { moment: *moment, axis });
            }
        }
        found
    }

    /// Returns a direction over the coordinates of the body, which begin at `first`:
    /// displacements in their order, then principal rotations.
    pub(super) fn coordinates(&self, direction: &str, first: usize) -> Row {
        let displacements = || self.directions.iter().filter(|name| TRANSLATIONS.contains(&name.as_str()));
        if let Some(at) = displacements().position(|name| name == direction) {
            return vec![(first + at, 1.0)];
        }
        let Some(axis) = ROTATIONS.iter().position(|name| *name == direction) else { return Row::new() };
        let first = first + displacements().count();
        let weight = |principal: PrincipalAxis| principal.axis[axis] / (principal.moment / self.mass).sqrt();
        let weights = self.principal().into_iter().map(weight).enumerate();
        weights.filter(|(_, weight)| *weight != 0.0).map(|(at, weight)| (first + at, weight)).collect()
    }
}

/// A principal axis of the inertia, of unit length, and its moment, kg m².
pub(super) struct PrincipalAxis {
    pub moment: f64,
    pub axis: [f64; 3],
}

/// Adds the rotations to the directions of a body if none is named: the rotation in its plane,
/// or all three in space.
///
/// # Example
/// ```
/// use stickslip::model::with_rotations;
/// assert_eq!(with_rotations(&["x", "z"]), ["x", "z", "ry"]);
/// assert_eq!(with_rotations(&["x", "y", "z"]), ["x", "y", "z", "rx", "ry", "rz"]);
/// assert_eq!(with_rotations(&["z", "ry"]), ["z", "ry"]);
/// ```
pub fn with_rotations(directions: &[&str]) -> Vec<String> {
    let has = |name: &str| directions.contains(&name);
    let missing: Vec<usize> = (0..3).filter(|axis| !has(TRANSLATIONS[*axis])).collect();
    let more: &[usize] = match missing[..] {
        _ if ROTATIONS.into_iter().any(has) => &[],
        [] => &[0, 1, 2],
        [_] => &missing,
        _ => &[],
    };
    let rotations = more.iter().map(|axis| ROTATIONS[*axis]);
    directions.iter().copied().chain(rotations).map(str::to_owned).collect()
}

/// Returns the inertia matrix of a body with these directions.
///
/// `stated` has one moment for each rotation, or in space the six entries xx, yy, zz, xy, yz, zx
/// (kg m²).
///
/// # Errors
/// [`ElementFault`]: the number of values does not match the rotations.
pub fn inertia_matrix(directions: &[String], stated: &[f64]) -> Result<[[f64; 3]; 3], ElementFault> {
    let turns = |axis: &usize| directions.iter().any(|along| along == ROTATIONS[*axis]);
    let about: Vec<usize> = (0..ROTATIONS.len()).filter(turns).collect();
    let mut matrix = [[0.0; 3]; 3];
    match (stated, &about[..]) {
        (&[xx, yy, zz, xy, yz, zx], [0, 1, 2]) => return Ok([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]),
        // the check of the directions reports this
        (_, []) => {}
        _ if stated.len() == about.len() => {
            about.iter().zip(stated).for_each(|(axis, moment)| matrix[*axis][*axis] = *moment);
        }
        _ => {
            let names: Vec<&str> = about.iter().map(|axis| ROTATIONS[*axis]).collect();
            let moments = match stated.len() {
                1 => "one moment of inertia".to_owned(),
                count => format!("{count} moments of inertia"),
            };
            let help = match about.len() {
                1 => "give one moment of inertia about that axis: inertia = \"300 g mm^2\"",
                2 => "give a list of two moments of inertia",
                _ => "give a list of the moments about x, y, z, or of the six entries xx, yy, zz, xy, yz, zx",
            };
            return Err(ElementFault::new(
                "inertia",
                format!("{moments} for the rotations {}", names.join(", ")),
                help,
            ));
        }
    }
    Ok(matrix)
}

fn diagonal(values: [f64; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|k| if i == k { values[i] } else { 0.0 }))
}

fn unit(axis: usize) -> [f64; 3] {
    std::array::from_fn(|i| f64::from(u8::from(i == axis)))
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Coulomb;
    use crate::model::{Force, GROUND, Joint, Mass, Model, Motion, Spring};
    use nalgebra::{DMatrix, DVector};
    use std::sync::Arc;
    use stickslip_numerics::random::Stream;

    fn spring(a: &str, b: &str, stiffness: f64) -> Spring {
        Spring { between: [a.into(), b.into()], stiffness, damping: 0.0 }
    }

    fn frequencies(model: &Model) -> Vec<f64> {
        model.survey().unwrap().free().elastic.iter().map(|mode| mode.omega).collect()
    }

    fn near(found: &[f64], expected: &[f64], tolerance: f64) {
        assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
        let close = |(a, b): (&f64, &f64)| (a - b).abs() <= tolerance * b.abs();
        assert!(found.iter().zip(expected).all(close), "{found:?} {expected:?}");
    }

    /// An unsymmetric bar on two springs at its ends. Both frequencies are roots of
    /// `det(K - ω² M)` with `K = [[k+l, (l-k)a], [(l-k)a, (k+l)a²]]`.
    #[test]
    fn a_bar_on_two_springs_has_its_two_frequencies() {
        let (m, j, a, k, l) = (2.0, 0.3, 0.7, 1.1e4, 3.7e3);
        let bar = Body { directions: with_rotations(&["z", "ry"]), ..Body::in_plane("bar", m, j, ["x", "z"]) };
        let model = Model {
            places: vec![bar.point("left", [-a, 0.0, 0.0]), bar.point("right", [a, 0.0, 0.0])]
                .into_iter()
                .map(|place| Place { directions: vec!["z".into()], rows: vec![place.rows[1].clone()], ..place })
                .collect(),
            springs: vec![spring("left.z", GROUND, k), spring(GROUND, "right.z", l)],
            bodies: vec![bar],
            ..Model::default()
        };
        // m j x² - (m (k+l) a² + j (k+l)) x + 4 k l a² = 0
        let (half, last) = (0.5 * (k + l) * (a * a / j + 1.0 / m), 4.0 * k * l * a * a / (m * j));
        let root = (half * half - last).sqrt();
        near(&frequencies(&model), &[(half - root).sqrt(), (half + root).sqrt()], 1e-13);
    }

    /// `J + m d²` about the pivot: a motion of amplitude zero fixes the pivot, and a spring
    /// acts on the other end.
    #[test]
    fn a_pinned_bar_turns_about_its_pivot() {
        let (m, length, k) = (1.3, 0.6, 900.0);
        let bar = Body::in_plane("bar", m, m * length * length / 12.0, ["x", "z"]);
        let pin = |on: &str| Motion { on: on.into(), amplitude: 0.0, phase: 0.0, harmonic: 1 };
        let model = Model {
            places: vec![bar.point("pivot", [-length / 2.0, 0.0, 0.0]), bar.point("tip", [length / 2.0, 0.0, 0.0])],
            springs: vec![spring("tip.z", GROUND, k)],
            forces: vec![Force { on: "bar.ry".into(), amplitude: 4.0, phase: 0.0, harmonic: 1 }],
            motions: vec![pin("pivot.x"), pin("pivot.z")],
            bodies: vec![bar],
            ..Model::default()
        };
        near(&frequencies(&model), &[(k * length * length / (m * length * length / 3.0)).sqrt()], 1e-13);
        let system = model.assemble().unwrap();
        assert_eq!(system.dofs(), 1);
        assert_eq!(system.places(), ["bar.x", "bar.z", "bar.ry", "tip.x", "tip.z"]);
        // a static moment rotates it by M/(k L²); its tip moves down, along -z
        let turned = solved(&system, 0.0);
        let ry = system.places().iter().position(|place| place == "bar.ry").unwrap();
        assert!((turned[ry] - 4.0 / (k * length * length)).abs() < 1e-15, "{turned:?}");
        assert!((turned[4] + turned[ry] * length).abs() < 1e-15 && turned[3].abs() < 1e-18);
    }

    /// Returns the places under the forces of the first harmonic at `omega`, without joints.
    fn solved(system: &crate::model::System, omega: f64) -> Vec<f64> {
        let dynamic = system.structure().stiffness() - system.structure().mass() * (omega * omega);
        let force = system.excitation_harmonics()[0].amplitudes_at(omega).map(|f| f.re);
        let x = dynamic.lu().solve(&force).unwrap();
        system.at_places(x.as_slice())
    }

    /// A cylinder that rolls without slip has an effective mass of 3/2 of its mass.
    #[test]
    fn a_rolling_cylinder_has_three_halves_of_its_mass() {
        let (m, r, k) = (0.04, 3e-3, 2e4);
        let roller = Body::in_plane("roller", m, 0.5 * m * r * r, ["x", "z"]);
        let foot = roller.point("foot", [0.0, 0.0, -r]);
        let foot = Place { directions: vec!["x".into()], rows: vec![foot.rows[0].clone()], ..foot };
        let model = Model {
            places: vec![foot],
            springs: vec![spring("roller.x", GROUND, k), spring("roller.z", GROUND, 10.0 * k)],
            joints: vec![Joint {
                name: "floor".into(),
                between: ["foot.x".into(), GROUND.into()],
                law: Arc::new(Coulomb { limit: 1.0 }),
            }],
            bodies: vec![roller],
            ..Model::default()
        };
        let survey = model.survey().unwrap();
        let stuck: Vec<f64> = survey.stuck().elastic.iter().map(|mode| mode.omega).collect();
        near(&stuck, &[(k / (1.5 * m)).sqrt(), (10.0 * k / m).sqrt()], 1e-12);
        near(&frequencies(&model), &[(k / m).sqrt(), (10.0 * k / m).sqrt()], 1e-12);
        assert_eq!(survey.free().rigid, 1, "free it turns as it likes");
    }

    /// Three point masses on stiff bars approach the body of the same mass and inertia as the
    /// bars become stiffer.
    #[test]
    fn point_masses_on_stiff_bars_become_the_body() {
        let (points, masses) = ([[0.0, 0.0], [0.05, 0.01], [0.02, 0.04]], [0.3, 0.2, 0.4]);
        let total: f64 = masses.iter().sum();
        let mean = |axis: usize| (0..3).map(|i| masses[i] * points[i][axis]).sum::<f64>() / total;
        let centre = [mean(0), mean(1)];
        let offset = |i: usize| [points[i][0] - centre[0], 0.0, points[i][1] - centre[1]];
        let inertia = (0..3).map(|i| masses[i] * (offset(i)[0].powi(2) + offset(i)[2].powi(2))).sum();
        let springs = || {
            let stiffness = [1e4, 2e4, 3e4, 5e3, 8e3, 1.5e4];
            (0..6).map(move |i| spring(&format!("p{}.{}", i / 2, ["x", "z"][i % 2]), GROUND, stiffness[i])).collect()
        };
        let body = Body::in_plane("body", total, inertia, ["x", "z"]);
        let rigid = Model {
            places: (0..3).map(|i| body.point(format!("p{i}"), offset(i))).collect(),
            springs: springs(),
            bodies: vec![body],
            ..Model::default()
        };
        let expected = frequencies(&rigid);
        let error = |stiffness: f64| {
            let mut model = Model { springs: springs(), ..Model::default() };
            model.masses = (0..3).map(|i| Mass::new(format!("p{i}"), masses[i]).along(&["x", "z"])).collect();
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let [x, z] = [0, 1].map(|axis| points[b][axis] - points[a][axis]);
                let ends = [a, b].map(|i| format!("end{a}{b}_{i}"));
                for (end, i) in ends.iter().zip([a, b]) {
                    let row = vec![(0, x / x.hypot(z)), (1, z / x.hypot(z))];
                    model.places.push(Place::new(end.clone(), row).as_view_of(format!("p{i}")));
                }
                model.springs.push(spring(&ends[0], &ends[1], stiffness));
            }
            let found = frequencies(&model);
            found.iter().zip(&expected).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
        };
        let (soft, stiff) = (error(1e8), error(1e9));
        assert!(soft < 1e-3 && stiff < 0.11 * soft && stiff > 0.09 * soft, "{soft} {stiff}");
    }

    /// Compares 50 random bodies on springs with `Tᵀ K T` and `diag(m, J)`, assembled here: the
    /// static and dynamic motion of a point under forces and moments.
    #[test]
    fn random_bodies_agree_with_independent_assembly() {
        for case in 0..50u64 {
            let stream = Stream::new(case);
            let mut draw = 0;
            let mut next = || {
                draw += 1;
                stream.normal(draw)
            };
            let plane = case % 2 == 0;
            let mass = 1.0 + next().abs();
            // a cloud of points has a physically possible inertia
            let cloud: Vec<[f64; 3]> = (0..6).map(|_| [next(), next(), next()].map(|x| 0.02 * x)).collect();
            let mut inertia = [[0.0; 3]; 3];
            for r in &cloud {
                for (i, row) in inertia.iter_mut().enumerate() {
                    for (k, entry) in row.iter_mut().enumerate() {
                        let own = if i == k { dot(r, r) } else { 0.0 };
                        *entry += mass / 6.0 * (own - r[i] * r[k]);
                    }
                }
            }
            let directions = if plane { with_rotations(&["z", "x"]) } else { with_rotations(&TRANSLATIONS) };
            let body = Body { name: "b".into(), mass, inertia, directions: directions.clone() };
            let free: Vec<usize> = directions
                .iter()
                .map(|name| TRANSLATIONS.iter().chain(&ROTATIONS).position(|known| known == name).unwrap())
                .collect();
            let (mut stiffness, mut model) = (DMatrix::<f64>::zeros(6, 6), Model::default());
            let transform = |offset: [f64; 3]| {
                // u + θ × r as a matrix
                let [x, y, z] = offset;
                nalgebra::dmatrix![1.0, 0.0, 0.0, 0.0, z, -y; 0.0, 1.0, 0.0, -z, 0.0, x; 0.0, 0.0, 1.0, y, -x, 0.0]
            };
            let mut pushed = DVector::zeros(6);
            for p in 0..4 {
                let offset = [next(), next(), next()].map(|x| 0.03 * x);
                let t = transform(offset);
                if p == 0 {
                    pushed = t.row(0).transpose();
                }
                model.places.push(body.point(format!("p{p}"), offset));
                for axis in body.axes() {
                    let k = 1e4 * (1.0 + next().abs());
                    model.springs.push(spring(&format!("p{p}.{}", TRANSLATIONS[axis]), GROUND, k));
                    stiffness += t.row(axis).transpose() * t.row(axis) * k;
                }
            }
            let turning = 10.0 + next().abs();
            let about = if plane { 4 } else { 3 };
            model.springs.push(spring(&format!("b.{}", ROTATIONS[about - 3]), GROUND, turning));
            stiffness[(about, about)] += turning;
            let mut mass_matrix = DMatrix::<f64>::zeros(6, 6);
            for i in 0..3 {
                mass_matrix[(i, i)] = mass;
                (0..3).for_each(|k| mass_matrix[(3 + i, 3 + k)] = inertia[i][k]);
            }
            let (push, moment) = (next(), next());
            for (on, amplitude) in [("p0.x".to_owned(), push), (format!("b.{}", ROTATIONS[about - 3]), moment)] {
                model.forces.push(Force { on, amplitude, phase: 0.0, harmonic: 1 });
            }
            model.bodies.push(body.clone());
            let system = model.assemble().unwrap();
            assert_eq!((model.places[0].rows.len(), system.dofs()), (body.axes().len(), directions.len()));
            let select = |m: &DMatrix<f64>| DMatrix::from_fn(free.len(), free.len(), |i, k| m[(free[i], free[k])]);
            let mut force = &pushed * push;
            force[about] += moment;
            let select_row = |row: &DVector<f64>| DVector::from_fn(free.len(), |i, _| row[free[i]]);
            let (force, along) = (select_row(&force), select_row(&pushed));
            for omega in [0.0, 60.0, 400.0] {
                let x = (select(&stiffness) - select(&mass_matrix) * (omega * omega)).lu().solve(&force).unwrap();
                let found = solved(&system, omega);
                let size = x.amax();
                let own = directions.iter().zip(x.iter()).map(|(along, value)| (format!("b.{along}"), *value));
                for (name, value) in own.chain([("p0.x".to_owned(), along.dot(&x))]) {
                    let at = system.places().iter().position(|place| *place == name).unwrap();
                    assert!((found[at] - value).abs() < 1e-9 * size, "{case} {name}: {} {value}", found[at]);
                }
            }
        }
    }

    #[test]
    fn what_no_body_has_is_refused() {
        let message = |body: Body| {
            let error = Model { bodies: vec![body], ..Model::default() }.assemble().unwrap_err();
            format!("{} {}", error.key, error.message)
        };
        let plane = || Body::in_plane("b", 1.0, 1e-4, ["x", "z"]);
        let along = |directions: &[&str]| Body { directions: with_rotations(directions), ..plane() };
        assert!(
            message(Body::in_plane("b", 1.0, 0.0, ["x", "z"]))
                .contains("inertia the moment of inertia about every axis")
        );
        assert!(message(Body::in_plane("b", 0.0, 1.0, ["x", "z"])).contains("mass must be a finite number above zero"));
        assert!(message(Body::in_space("b", 1.0, [1.0, 1.0, 2.5])).contains("none may exceed the sum"));
        assert!(message(along(&["x", "z", "rx"])).contains("rotates about y only; its rotation is ry"));
        assert!(message(along(&["x"])).contains("the body has no rotation"));
        assert!(message(along(&["x", "north"])).contains("`north` is not a direction"));
        assert!(message(along(&["x", "x", "ry"])).contains("appears twice"));
        let model = Model { bodies: vec![plane()], masses: vec![Mass::new("b", 1.0)], ..Model::default() };
        assert!(model.assemble().unwrap_err().message.contains("appears twice"));
        let model = Model { springs: vec![spring("b.ry", "b.x", 1.0)], bodies: vec![plane()], ..Model::default() };
        assert!(model.assemble().unwrap_err().message.contains("`b.ry` is a rotation and `b.x` is a displacement"));
        let joint = Joint {
            name: "rub".into(),
            between: ["b.ry".into(), GROUND.into()],
            law: Arc::new(Coulomb { limit: 1.0 }),
        };
        let model = Model { joints: vec![joint], bodies: vec![plane()], ..Model::default() };
        assert!(model.assemble().unwrap_err().message.contains("this is a rotation"));
    }
}
