//! From a model to a system: checks, and the matrices of `M x'' + C x' + K x + Σ W f = F(t)`.

use super::system::{Axis, MovedPlace, System, SystemBuilder};
use super::{GROUND, Joint, Mass, Model};
use crate::structure::Structure;
use nalgebra::DVector;
use num_complex::Complex64;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use stickslip_numerics::sparse::Matrix;

/// The element of a model that an error is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)] // index into the list of the model that has the same name
pub enum Element {
    Mass(usize),
    Spring(usize),
    Joint(usize),
    Force(usize),
    Motion(usize),
    Whole,
}

impl fmt::Display for Element {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, index) = match self {
            Element::Mass(i) => ("mass", i),
            Element::Spring(i) => ("spring", i),
            Element::Joint(i) => ("joint", i),
            Element::Force(i) => ("force", i),
            Element::Motion(i) => ("motion", i),
            Element::Whole => return write!(f, "model"),
        };
        write!(f, "{what} {}", index + 1)
    }
}

/// Why a model is refused: which element, which key of it, what is wrong.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{element}, `{key}`: {message}")]
pub struct ModelError {
    /// The element.
    pub element: Element,
    /// Its key (as in the study file).
    pub key: &'static str,
    /// What is wrong and what was expected.
    pub message: String,
    /// The name that was probably meant, if there is one like it.
    pub wrong_name: Option<String>,
}

impl ModelError {
    fn new(element: Element, key: &'static str, message: impl Into<String>) -> Self {
        ModelError { element, key, message: message.into(), wrong_name: None }
    }
}

/// Where a name leads.
#[derive(Debug, Clone, Copy, PartialEq)]
enum End {
    Ground,
    Free(usize),
    Moved(usize),
}

/// Whether `name` is an identifier `[A-Za-z][A-Za-z0-9_]*`.
pub fn is_identifier(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Whether `name` is an identifier, or a node and a direction of it, `node.direction`.
pub fn is_place(name: &str) -> bool {
    name.split_once('.')
        .map_or_else(|| is_identifier(name), |(node, along)| is_identifier(node) && is_identifier(along))
}

impl Mass {
    /// The places that it makes: itself, or one for each of its directions.
    pub fn places(&self) -> Vec<String> {
        if self.directions.is_empty() {
            return vec![self.name.clone()];
        }
        self.directions.iter().map(|along| format!("{}.{along}", self.name)).collect()
    }
}

/// A direction that a joint acts along: its name, if there are several, and where both ends lead.
type Along<'a> = (Option<&'a str>, [End; 2]);

/// Every place of a model, and the directions of every node.
struct Places {
    ends: BTreeMap<String, End>,
    /// Directions in their order, of names that have any.
    directions: BTreeMap<String, Vec<String>>,
}

impl Places {
    fn count(&self, wanted: fn(&End) -> bool) -> usize {
        self.ends.values().filter(|end| wanted(end)).count()
    }

    /// Where one place leads.
    fn find(&self, name: &str, element: Element, key: &'static str) -> Result<End, ModelError> {
        if let Some(end) = self.ends.get(name) {
            return Ok(*end);
        }
        if let Some(directions) = self.directions.get(name) {
            let places: Vec<String> = directions.iter().map(|along| format!("`{name}.{along}`")).collect();
            let message = format!("`{name}` moves in several directions; name one of them: {}", places.join(", "));
            return Err(ModelError::new(element, key, message));
        }
        let node = name.split_once('.').filter(|(node, _)| self.directions.contains_key(*node));
        let message = match node {
            Some((node, along)) => format!("there is no place `{name}`: `{node}` has no direction {along}"),
            None => format!("there is no place `{name}`"),
        };
        Err(ModelError { wrong_name: Some(name.to_owned()), ..ModelError::new(element, key, message) })
    }

    /// Where both ends of a joint lead, along each of `count` directions.
    fn axes(&self, between: &[String; 2], count: usize, element: Element) -> Result<Vec<Along<'_>>, ModelError> {
        let key = "between";
        let nodes: Vec<&Vec<String>> = between.iter().filter_map(|name| self.directions.get(name)).collect();
        let Some(directions) = nodes.first().copied() else {
            let [a, b] = [self.find(&between[0], element, key)?, self.find(&between[1], element, key)?];
            if count == 1 {
                return Ok(vec![(None, [a, b])]);
            }
            let message = format!(
                "the law acts along {count} directions, and `{}` and `{}` have one; join nodes with `directions`",
                between[0], between[1]
            );
            return Err(ModelError::new(element, key, message));
        };
        if directions.len() != count {
            let node = if self.directions.contains_key(&between[0]) { &between[0] } else { &between[1] };
            let message = format!(
                "the law acts along {count} direction{}, and the node `{node}` has {}: {}",
                if count == 1 { "" } else { "s" },
                directions.len(),
                if count == 1 {
                    format!("name one, such as `{node}.{}`", directions[0])
                } else {
                    directions.join(", ")
                }
            );
            return Err(ModelError::new(element, key, message));
        }
        directions
            .iter()
            .map(|along| {
                let end = |name: &String| {
                    if name == GROUND { Ok(End::Ground) } else { self.find(&format!("{name}.{along}"), element, key) }
                };
                Ok((Some(along.as_str()), [end(&between[0])?, end(&between[1])?]))
            })
            .collect()
    }
}

impl Model {
    /// The names of all places: ground, the masses with their directions, the moved places.
    pub fn place_names(&self) -> Vec<String> {
        let mut names = vec![GROUND.to_owned()];
        names.extend(self.masses.iter().flat_map(Mass::places));
        for motion in &self.motions {
            if !names.contains(&motion.on) {
                names.push(motion.on.clone());
            }
        }
        names
    }

    /// The places that can move freely or are moved: all but the ground.
    pub fn moving_names(&self) -> Vec<String> {
        self.place_names().split_off(1)
    }

    /// What results call the axes of a joint: its name, or `joint.direction` where it joins nodes.
    pub fn joint_labels(&self, joint: &Joint) -> Vec<String> {
        let of_node = |name: &String| -> Vec<String> {
            let places = self.place_names();
            let along = |place: &String| place.strip_prefix(name.as_str())?.strip_prefix('.').map(str::to_owned);
            places.iter().filter_map(along).collect()
        };
        let directions = joint.between.iter().map(of_node).find(|directions| directions.len() > 1);
        let label = |along: &String| format!("{}.{along}", joint.name);
        directions.map_or_else(|| vec![joint.name.clone()], |directions| directions.iter().map(label).collect())
    }

    /// Checks the model and assembles its matrices.
    ///
    /// # Errors
    /// [`ModelError`] names the first element that is wrong: a name that is no identifier or stands twice, a place that does
    /// not exist, a value that is not finite or has the wrong sign, a force on a place that is no degree of freedom, a law whose directions are
    /// not those of the nodes that it joins.
    ///
    /// # Example
    /// ```
    /// let system = stickslip::model::example::blade_couple().assemble().unwrap();
    /// assert_eq!(system.places(), ["blade1", "contact", "blade3"]);
    /// ```
    pub fn assemble(&self) -> Result<System, ModelError> {
        let places = self.check_places()?;
        let free = places.count(|end| matches!(end, End::Free(_)));
        let moved = places.count(|end| matches!(end, End::Moved(_)));
        let assembler = Assembler { model: self, places, free, moved };
        let matrices = assembler.matrices()?;
        let motions = assembler.motions()?;
        let mut builder = System::builder(assembler.structure(&matrices)?);
        builder = assembler.forces(builder)?;
        builder = assembler.loads_of_motions(builder, &matrices, &motions);
        let (builder, signs) = assembler.joints(builder, &motions)?;
        assembler.moved(builder, &matrices, &motions, &signs).build().map_err(|error| whole(&error))
    }

    /// Every name once, an identifier, and where it leads. Moved masses are no degrees of freedom.
    fn check_places(&self) -> Result<Places, ModelError> {
        if self.masses.is_empty() && self.motions.is_empty() {
            return Err(ModelError::new(
                Element::Whole,
                "mass",
                "a model needs at least one mass or one imposed motion",
            ));
        }
        let identifier = |name: &str, element: Element, key: &'static str, accepts: fn(&str) -> bool| {
            if name == GROUND {
                Err(ModelError::new(element, key, "`ground` is the fixed frame and cannot be declared"))
            } else if accepts(name) {
                Ok(())
            } else {
                let message = format!("`{name}` is no name: a letter first, then letters, digits and `_`");
                Err(ModelError::new(element, key, message))
            }
        };
        let mut places =
            Places { ends: BTreeMap::from([(GROUND.to_owned(), End::Ground)]), directions: BTreeMap::new() };
        // columns of results are named after places, with `_` for the point
        let mut columns = BTreeSet::new();
        let twice = |name: &str, element: Element, key| {
            Err(ModelError::new(element, key, format!("the name `{name}` stands twice")))
        };
        let (mut free, mut moved) = (0, 0);
        for (i, mass) in self.masses.iter().enumerate() {
            let element = Element::Mass(i);
            identifier(&mass.name, element, "name", is_identifier)?;
            if mass.directions.len() > crate::law::MOST_DIRECTIONS {
                let message = format!("a node has up to three directions, found {}", mass.directions.len());
                return Err(ModelError::new(element, "directions", message));
            }
            for (k, along) in mass.directions.iter().enumerate() {
                identifier(along, element, "directions", is_identifier)?;
                if mass.directions[..k].contains(along) {
                    return twice(along, element, "directions");
                }
            }
            if places.directions.contains_key(&mass.name) || places.ends.contains_key(&mass.name) {
                return twice(&mass.name, element, "name");
            }
            for place in mass.places() {
                let end = if self.motions.iter().any(|m| m.on == place) {
                    moved += 1;
                    End::Moved(moved - 1)
                } else {
                    free += 1;
                    End::Free(free - 1)
                };
                if !columns.insert(place.replace('.', "_")) {
                    return twice(&place.replace('.', "_"), element, "name");
                }
                places.ends.insert(place, end);
            }
            if !mass.directions.is_empty() {
                places.directions.insert(mass.name.clone(), mass.directions.clone());
            }
        }
        for (i, motion) in self.motions.iter().enumerate() {
            let element = Element::Motion(i);
            identifier(&motion.on, element, "on", is_place)?;
            if places.ends.contains_key(&motion.on) {
                continue;
            }
            if places.directions.contains_key(&motion.on) {
                places.find(&motion.on, element, "on")?; // says that a direction is missing
            }
            if !columns.insert(motion.on.replace('.', "_")) {
                return twice(&motion.on.replace('.', "_"), element, "on");
            }
            places.ends.insert(motion.on.clone(), End::Moved(moved));
            moved += 1;
            if let Some((node, along)) = motion.on.split_once('.') {
                places.directions.entry(node.to_owned()).or_default().push(along.to_owned());
            }
        }
        for (i, joint) in self.joints.iter().enumerate() {
            let element = Element::Joint(i);
            identifier(&joint.name, element, "name", is_identifier)?;
            let taken = columns.contains(&joint.name) || places.directions.contains_key(&joint.name);
            if taken || self.joints[..i].iter().any(|j| j.name == joint.name) {
                return twice(&joint.name, element, "name");
            }
        }
        Ok(places)
    }
}

/// What is wrong with the structure as a whole.
fn whole(error: &dyn fmt::Display) -> ModelError {
    ModelError::new(Element::Whole, "mass", error.to_string())
}

/// A model while it becomes a system.
struct Assembler<'a> {
    model: &'a Model,
    places: Places,
    /// How many places are free.
    free: usize,
    /// How many have an imposed motion.
    moved: usize,
}

/// Matrices over free and then moved places.
struct Matrices {
    names: Vec<String>,
    mass: Vec<f64>,
    damping: Matrix,
    stiffness: Matrix,
}

/// Harmonics of an imposed motion.
type Harmonics = BTreeMap<u32, Complex64>;

impl Assembler<'_> {
    /// The row of a place among free and then moved ones.
    fn row(&self, end: End) -> Option<usize> {
        match end {
            End::Ground => None,
            End::Free(i) => Some(i),
            End::Moved(i) => Some(self.free + i),
        }
    }

    fn matrices(&self) -> Result<Matrices, ModelError> {
        let total = self.free + self.moved;
        let mut names = vec![String::new(); total];
        for (name, end) in &self.places.ends {
            if let Some(row) = self.row(*end) {
                names[row].clone_from(name);
            }
        }
        let mut mass = vec![0.0; total];
        for (i, m) in self.model.masses.iter().enumerate() {
            finite_at_least_zero(m.mass, Element::Mass(i), "mass", "kg")?;
            for place in m.places() {
                if let Some(row) = self.row(self.places.ends[&place]) {
                    mass[row] = m.mass;
                }
            }
        }
        let (mut damping, mut stiffness) = (Vec::new(), Vec::new());
        for (i, spring) in self.model.springs.iter().enumerate() {
            let element = Element::Spring(i);
            finite_at_least_zero(spring.stiffness, element, "stiffness", "N/m")?;
            if !spring.damping.is_finite() {
                let message = format!("must be a finite number in kg/s, found {}", spring.damping);
                return Err(ModelError::new(element, "damping", message));
            }
            let a = self.places.find(&spring.between[0], element, "between")?;
            let b = self.places.find(&spring.between[1], element, "between")?;
            differ(&spring.between, element)?;
            for (matrix, value) in [(&mut stiffness, spring.stiffness), (&mut damping, spring.damping)] {
                add_between(matrix, self.row(a), self.row(b), value);
            }
        }
        let sum = |entries| Matrix::from_triplets(total, entries).map_err(|error| whole(&error));
        Ok(Matrices { names, mass, damping: sum(damping)?, stiffness: sum(stiffness)? })
    }

    /// What of the matrices belongs to free places.
    fn structure(&self, matrices: &Matrices) -> Result<Structure, ModelError> {
        let n = self.free;
        let block = |matrix: &Matrix| {
            let free = matrix.entries().filter(|(row, column, _)| *row < n && *column < n);
            Matrix::from_triplets(n, free).map_err(|error| whole(&error))
        };
        let mass = Matrix::from_triplets(n, (0..n).map(|i| (i, i, matrices.mass[i]))).map_err(|error| whole(&error))?;
        let names = matrices.names[..n].to_vec();
        Structure::sparse(names, mass, block(&matrices.damping)?, block(&matrices.stiffness)?)
            .map_err(|error| whole(&error))
    }

    /// The motion of every moved place.
    fn motions(&self) -> Result<Vec<Harmonics>, ModelError> {
        let mut motions = vec![Harmonics::new(); self.moved];
        for (i, motion) in self.model.motions.iter().enumerate() {
            let element = Element::Motion(i);
            let value = harmonic_amplitude(motion.amplitude, motion.phase, element)?;
            if let End::Moved(k) = self.places.find(&motion.on, element, "on")? {
                *motions[k].entry(motion.harmonic).or_default() += value;
            }
        }
        Ok(motions)
    }

    fn forces(&self, mut builder: SystemBuilder) -> Result<SystemBuilder, ModelError> {
        for (i, force) in self.model.forces.iter().enumerate() {
            let element = Element::Force(i);
            let value = harmonic_amplitude(force.amplitude, force.phase, element)?;
            match self.places.find(&force.on, element, "on")? {
                End::Free(row) => builder = builder.force(row, force.harmonic, value),
                End::Ground => {
                    return Err(ModelError::new(element, "on", "a force on `ground` moves nothing; name a mass"));
                }
                End::Moved(_) => {
                    let message = format!("`{}` has an imposed motion, a force on it changes nothing", force.on);
                    return Err(ModelError::new(element, "on", message));
                }
            }
        }
        Ok(builder)
    }

    /// What moved places do to free ones by springs and dampers.
    fn loads_of_motions(
        &self,
        mut builder: SystemBuilder,
        matrices: &Matrices,
        motions: &[Harmonics],
    ) -> SystemBuilder {
        let (n, zero) = (self.free, Complex64::new(0.0, 0.0));
        for (k, motion) in motions.iter().enumerate() {
            for (&harmonic, &amplitude) in motion {
                for row in 0..n {
                    let [stiffness, damping] =
                        [&matrices.stiffness, &matrices.damping].map(|matrix| matrix.get(row, n + k));
                    builder = builder.load(row, harmonic, zero - amplitude * stiffness, zero - amplitude * damping);
                }
            }
        }
        builder
    }

    /// The joints, and for every moved place its sign along each of their axes.
    fn joints(
        &self,
        mut builder: SystemBuilder,
        motions: &[Harmonics],
    ) -> Result<(SystemBuilder, Vec<Vec<f64>>), ModelError> {
        let mut signs = vec![Vec::new(); self.moved];
        for (j, joint) in self.model.joints.iter().enumerate() {
            let element = Element::Joint(j);
            joint.law.check().map_err(|error| ModelError::new(element, "law", error.to_string()))?;
            differ(&joint.between, element)?;
            let mut axes = Vec::new();
            for (along, ends) in self.places.axes(&joint.between, joint.law.directions(), element)? {
                signs.iter_mut().for_each(|signs| signs.push(0.0));
                let (mut rows, mut imposed) = (Vec::new(), Vec::new());
                for (end, sign) in ends.into_iter().zip([1.0, -1.0]) {
                    match end {
                        End::Ground => {}
                        End::Free(row) => rows.push((row, sign)),
                        End::Moved(k) => {
                            if let Some(last) = signs[k].last_mut() {
                                *last += sign;
                            }
                            imposed
                                .extend(motions[k].iter().map(|(&harmonic, &amplitude)| (harmonic, amplitude * sign)));
                        }
                    }
                }
                let axis = Axis::new(rows).moved(imposed);
                axes.push(if let Some(along) = along { axis.named(along) } else { axis });
            }
            builder = builder.joint(joint.name.clone(), joint.law.clone(), axes);
        }
        Ok((builder, signs))
    }

    /// The moved places, for the forces that move them.
    fn moved(
        &self,
        mut builder: SystemBuilder,
        matrices: &Matrices,
        motions: &[Harmonics],
        signs: &[Vec<f64>],
    ) -> SystemBuilder {
        let n = self.free;
        for k in 0..self.moved {
            let row = |matrix: &Matrix| {
                (
                    DVector::from_fn(n, |i, _| matrix.get(n + k, i)),
                    (0..self.moved).map(|i| matrix.get(n + k, n + i)).collect(),
                )
            };
            builder = builder.moved(MovedPlace {
                name: matrices.names[n + k].clone(),
                motion: motions[k].iter().map(|(h, a)| (*h, *a)).collect(),
                mass: matrices.mass[n + k],
                stiffness: row(&matrices.stiffness),
                damping: row(&matrices.damping),
                joints: signs[k].clone(),
            });
        }
        builder
    }
}

fn differ(between: &[String; 2], element: Element) -> Result<(), ModelError> {
    if between[0] == between[1] {
        let message = format!("both ends are `{}`; two different places are needed", between[0]);
        return Err(ModelError::new(element, "between", message));
    }
    Ok(())
}

fn finite_at_least_zero(value: f64, element: Element, key: &'static str, unit: &str) -> Result<(), ModelError> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    Err(ModelError::new(element, key, format!("must be a finite number, zero or more, in {unit}, found {value}")))
}

fn harmonic_amplitude(amplitude: f64, phase: f64, element: Element) -> Result<Complex64, ModelError> {
    for (value, key) in [(amplitude, "amplitude"), (phase, "phase")] {
        if !value.is_finite() {
            return Err(ModelError::new(element, key, format!("must be a finite number, found {value}")));
        }
    }
    Ok(Complex64::from_polar(1.0, phase) * amplitude)
}

fn add_between(entries: &mut Vec<(usize, usize, f64)>, a: Option<usize>, b: Option<usize>, value: f64) {
    for (row, other) in [(a, b), (b, a)] {
        if let Some(row) = row {
            entries.push((row, row, value));
            if let Some(column) = other {
                entries.push((row, column, -value));
            }
        }
    }
}
