//! Resolution of the names in a model.
//!
//! A name is a weighted sum of coordinates, the ground, or a moved place.

use super::body::{Body, ROTATIONS, TRANSLATIONS};
use super::error::{Element, ModelError};
use super::place::{Place, places_of};
use super::{GROUND, Mass, Model};
use crate::structure::reduction::Row;
use std::collections::{BTreeMap, BTreeSet};

/// The target of a name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum PlaceTarget {
    Ground,
    /// A place, by its index in [`Places::stated`].
    At(usize),
}

/// The source of a place's displacement.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum PlaceSource {
    /// Rows of the component: index of the place, and index of its direction.
    Component(usize, usize),
    /// Another view of a node of masses: index of the place, and index of its direction.
    View(usize, usize),
    /// A separate coordinate with this mass, kg.
    Own(f64),
    /// A rigid body: index of the body, and index of its direction.
    Body(usize, usize),
}

/// A declared place.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DeclaredPlace {
    pub name: String,
    pub of: PlaceSource,
    pub moved: bool,
    /// Radius for an angle, m: that of gyration of a body, or that of the structure.
    pub radius: Option<f64>,
}

/// A direction of a joint: its name, if there are several directions, and both ends.
pub(super) type JointDirection<'a> = (Option<&'a str>, [PlaceTarget; 2]);

/// All places of a model, and the directions of all nodes.
pub(super) struct Places {
    /// In this order: places of the component, masses, bodies, other views of these, places
    /// that exist only by their imposed motion.
    pub stated: Vec<DeclaredPlace>,
    ends: BTreeMap<String, PlaceTarget>,
    /// Directions of each node, in their order.
    directions: BTreeMap<String, Vec<String>>,
}

/// Returns whether `name` is an identifier `[A-Za-z][A-Za-z0-9_]*`.
pub fn is_identifier(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Returns whether `name` is an identifier, or a node and its direction, `node.direction`.
pub fn is_place(name: &str) -> bool {
    name.split_once('.')
        .map_or_else(|| is_identifier(name), |(node, along)| is_identifier(node) && is_identifier(along))
}

impl Mass {
    /// Returns the names of its places: its own name, or one name per direction.
    pub fn places(&self) -> Vec<String> {
        places_of(&self.name, &self.directions)
    }
}

impl Model {
    /// Iterates over the declared nodes and places, as names with directions. A place with one
    /// displacement has no directions.
    ///
    /// The places come first, then the masses, then the bodies.
    pub fn nodes(&self) -> impl Iterator<Item = (&str, &[String])> {
        let places = self.places.iter().map(|place| (place.name.as_str(), place.directions.as_slice()));
        let masses = self.masses.iter().map(|mass| (mass.name.as_str(), mass.directions.as_slice()));
        places.chain(masses).chain(self.bodies.iter().map(|body| (body.name.as_str(), body.directions.as_slice())))
    }

    /// Returns whether a name is a place of a rigid body: a direction of the body, or of one of
    /// its points.
    pub(super) fn is_of_body(&self, place: &str) -> bool {
        let node = place.split_once('.').map_or(place, |(node, _)| node);
        let of = self.places.iter().find(|place| place.name == node).and_then(|place| place.view_of.as_deref());
        self.bodies.iter().any(|body| body.name == of.unwrap_or(node))
    }

    /// Returns whether an imposed motion acts on a body. The other directions of that body then
    /// share mass with the moved one.
    pub(super) fn moves_bodies(&self) -> bool {
        !self.bodies.is_empty() && self.motions.iter().any(|motion| self.is_of_body(&motion.on))
    }

    /// Returns whether a place is a rotation, an angle in rad: of a body, or an observed one of the
    /// structure.
    pub fn is_rotation(&self, place: &str) -> bool {
        let of_body = |node: &str| self.bodies.iter().any(|body| body.name == node);
        place.split_once('.').is_some_and(|(node, along)| ROTATIONS.contains(&along) && of_body(node))
            || self.observed_rotation(place).is_some()
    }

    /// Returns the radius (m) of a place that is a rotation of the structure, if no joint, spring,
    /// force or motion acts on it. Those on rotations are stated like those on displacements.
    fn observed_rotation(&self, place: &str) -> Option<f64> {
        let component = &self.substructure.as_ref()?.component;
        let radius = component.rotation_radius()?;
        let (node, along) = place.split_once('.').map_or((place, None), |(node, along)| (node, Some(along)));
        let stated = self.places.iter().find(|stated| stated.name == node)?;
        if stated.view_of.is_some() || stated.frame.is_some() {
            return None;
        }
        let direction = match along {
            Some(along) => stated.directions.iter().position(|name| name == along)?,
            None if stated.directions.is_empty() => 0,
            None => return None,
        };
        let row = stated.rows.get(direction)?;
        let joints = self.joints.iter().flat_map(|joint| &joint.between);
        let springs = self.springs.iter().flat_map(|spring| &spring.between);
        let forces = self.forces.iter().map(|force| &force.on);
        let motions = self.motions.iter().map(|motion| &motion.on);
        let is_loaded = joints.chain(springs).chain(forces).chain(motions).any(|name| name == place || name == node);
        let is_rotation = !row.is_empty() && row.iter().all(|(at, _)| component.is_rotation(*at));
        (is_rotation && !is_loaded).then_some(radius)
    }
}

impl Places {
    /// Collects all names and checks that each is an identifier and occurs once.
    pub fn new(model: &Model) -> Result<Self, ModelError> {
        if model.masses.is_empty() && model.bodies.is_empty() && model.motions.is_empty() && model.places.is_empty() {
            let message = if model.substructure.is_some() {
                "a structure needs at least one place, for joints, forces or results"
            } else {
                "a model needs at least one mass or one imposed motion"
            };
            return Err(ModelError::new(Element::Whole, "mass", message));
        }
        let ends = BTreeMap::from([(GROUND.to_owned(), PlaceTarget::Ground)]);
        let mut collected = PlaceCollector {
            places: Places { stated: Vec::new(), ends, directions: BTreeMap::new() },
            columns: BTreeSet::new(),
            motions: model.motions.iter().map(|motion| motion.on.as_str()).collect(),
        };
        for (i, place) in model.places.iter().enumerate() {
            let element = Element::Place(i);
            let expected = place.directions.len().max(1);
            if place.rows.len() != expected {
                let message = format!("found {} displacements, expected {expected}", place.rows.len());
                return Err(ModelError::new(element, "dofs", message));
            }
            if place.frame.is_some() && expected != 3 {
                let message = "a local frame needs three displacements, along x, y and z";
                return Err(ModelError::new(element, "normal", message));
            }
            if place.view_of.is_none() {
                collected.node(element, &place.name, &place.directions, |along| PlaceSource::Component(i, along))?;
            }
        }
        for place in &mut collected.places.stated {
            place.radius = model.observed_rotation(&place.name);
        }
        for (i, mass) in model.masses.iter().enumerate() {
            collected.node(Element::Mass(i), &mass.name, &mass.directions, |_| PlaceSource::Own(mass.mass))?;
        }
        for (i, body) in model.bodies.iter().enumerate() {
            collected.body(i, body)?;
        }
        for (i, place) in model.places.iter().enumerate().filter(|(_, place)| place.view_of.is_some()) {
            check_view(model, place, Element::Place(i))?;
            collected.node(Element::Place(i), &place.name, &place.directions, |along| PlaceSource::View(i, along))?;
        }
        collected.moved(model)?;
        let PlaceCollector { places, columns, .. } = collected;
        let mut joints = BTreeSet::new();
        for (i, joint) in model.joints.iter().enumerate() {
            let element = Element::Joint(i);
            check_identifier(&joint.name, element, "name", is_identifier)?;
            let taken = columns.contains(&joint.name) || places.directions.contains_key(&joint.name);
            if taken || !joints.insert(joint.name.as_str()) {
                return duplicate_name(&joint.name, element, "name");
            }
        }
        Ok(places)
    }

    /// Returns the target of a place name.
    pub fn find(&self, name: &str, element: Element, key: &'static str) -> Result<PlaceTarget, ModelError> {
        if let Some(end) = self.ends.get(name) {
            return Ok(*end);
        }
        if self.directions.contains_key(name) {
            let places = self.stated.iter().map(|place| place.name.as_str());
            let own = places.filter(|place| place.split_once('.').is_some_and(|(node, _)| node == name));
            let places: Vec<String> = own.map(|place| format!("`{place}`")).collect();
            let message = match &places[..] {
                [place] => format!("`{name}` stands for all of its directions; name the direction: {place}"),
                _ => format!("`{name}` has several directions; name one of them: {}", places.join(", ")),
            };
            return Err(ModelError::new(element, key, message));
        }
        let node = name.split_once('.').filter(|(node, _)| self.directions.contains_key(*node));
        let message = match node {
            Some((node, along)) => format!("there is no place `{name}`: `{node}` has no direction {along}"),
            None => format!("there is no place `{name}`"),
        };
        Err(ModelError { wrong_name: Some(name.to_owned()), ..ModelError::new(element, key, message) })
    }

    /// Returns whether the target of a name is an angle.
    pub fn is_rotation(&self, end: PlaceTarget) -> bool {
        matches!(end, PlaceTarget::At(place) if self.stated[place].radius.is_some())
    }

    /// Returns both ends of a joint along each of its `count` directions. `normal` is the index
    /// of the normal direction.
    pub fn axes(
        &self,
        between: &[String; 2],
        count: usize,
        normal: Option<usize>,
        element: Element,
    ) -> Result<Vec<JointDirection<'_>>, ModelError> {
        let key = "between";
        let nodes: Vec<&Vec<String>> = between.iter().filter_map(|name| self.directions.get(name)).collect();
        let Some(directions) = nodes.first().copied() else {
            let [a, b] = [self.find(&between[0], element, key)?, self.find(&between[1], element, key)?];
            if [a, b].into_iter().any(|end| self.is_rotation(end)) {
                let message = "a joint connects displacements, but this is a rotation; name a [[place]] of the body, whose offset is the lever";
                return Err(ModelError::new(element, key, message));
            }
            if count == 1 {
                return Ok(vec![(None, [a, b])]);
            }
            let message = format!(
                "the law acts along {count} directions, but `{}` and `{}` have one; connect nodes with `directions`",
                between[0], between[1]
            );
            return Err(ModelError::new(element, key, message));
        };
        if directions.is_empty() {
            let message = "the body has rotations only; name a [[place]] of the body, whose offset is the lever";
            return Err(ModelError::new(element, key, message));
        }
        if directions.len() != count {
            let node = if self.directions.contains_key(&between[0]) { &between[0] } else { &between[1] };
            let message = format!(
                "the law acts along {count} direction{}, but the node `{node}` has {}: {}",
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
        let is_displacement = |name: &&String| {
            let end = self.ends.get(*name).filter(|end| matches!(end, PlaceTarget::At(_)));
            end.is_some_and(|end| !self.is_rotation(*end))
        };
        if let Some(name) = between.iter().find(is_displacement) {
            let node = name.split_once('.').map(|(node, _)| node).filter(|node| self.directions.contains_key(*node));
            let other = if *name == between[0] { &between[1] } else { &between[0] };
            let message = match (count, node) {
                (1, _) => {
                    format!("`{name}` is a displacement, but `{other}` is a node: write `{other}.{}`", directions[0])
                }
                (_, Some(node)) => format!(
                    "the law acts along {count} directions ({}): write the node `{node}` instead of `{name}`",
                    directions.join(", ")
                ),
                (_, None) => format!(
                    "the law acts along {count} directions ({}), but `{name}` has one; connect nodes with `directions`",
                    directions.join(", ")
                ),
            };
            return Err(ModelError::new(element, key, message));
        }
        // tangents are interchangeable, but with different normals the order of the nodes would
        // decide which one counts
        let normals = normal.map(|at| nodes.iter().filter_map(|own| own.get(at)).collect::<Vec<_>>());
        if let Some([one, other]) = normals.as_deref().filter(|ends| ends.len() == 2 && ends[0] != ends[1]) {
            let message = format!(
                "the normal directions of both nodes differ: {one} of `{}` and {other} of `{}`; list the directions \
                 of both nodes in the same order, tangents first, or give both a [[place]] with the same `normal`",
                between[0], between[1]
            );
            return Err(ModelError::new(element, key, message));
        }
        directions
            .iter()
            .map(|along| {
                let end = |name: &String| {
                    if name == GROUND {
                        Ok(PlaceTarget::Ground)
                    } else {
                        self.find(&format!("{name}.{along}"), element, key)
                    }
                };
                Ok((Some(along.as_str()), [end(&between[0])?, end(&between[1])?]))
            })
            .collect()
    }
}

/// Checks a place that is a view of another node: the node must have the directions that its
/// rows use.
fn check_view(model: &Model, place: &Place, element: Element) -> Result<(), ModelError> {
    let Some(of) = &place.view_of else { return Ok(()) };
    let mass = model.masses.iter().find(|mass| mass.name == *of).map(|mass| mass.places().len());
    let body = model.bodies.iter().find(|body| body.name == *of).map(|body| body.directions.len());
    let Some(count) = mass.or(body) else {
        let message = format!("there is no mass or body `{of}`, of which `{}` is declared to be a place", place.name);
        return Err(ModelError { wrong_name: Some(of.clone()), ..ModelError::new(element, "of", message) });
    };
    let still = place.rows.iter().position(|row| row.iter().all(|(_, weight)| *weight == 0.0));
    if let (Some(along), Some(_)) = (still, body) {
        let message = format!(
            "`{}` cannot move along its direction {}: the body has no displacement along it and no rotation with a lever",
            place.name,
            place.directions.get(along).map_or("", String::as_str)
        );
        return Err(ModelError::new(element, "directions", message));
    }
    let weights = || place.rows.iter().flatten();
    let usable = |row: &Row| row.iter().any(|(_, weight)| *weight != 0.0);
    if weights().any(|(at, weight)| *at >= count || !weight.is_finite()) || !place.rows.iter().all(usable) {
        let message = format!("the weights must be finite numbers, not all zero, for the {count} directions of `{of}`");
        return Err(ModelError::new(element, "of", message));
    }
    Ok(())
}

/// The places during collection.
struct PlaceCollector<'a> {
    places: Places,
    /// Column names of results: names of places with `_` instead of the point.
    columns: BTreeSet<String>,
    /// Places with an imposed motion.
    motions: BTreeSet<&'a str>,
}

impl PlaceCollector<'_> {
    /// Adds a node, or a place with one displacement.
    fn node(
        &mut self,
        element: Element,
        name: &str,
        directions: &[String],
        of: impl Fn(usize) -> PlaceSource,
    ) -> Result<(), ModelError> {
        check_identifier(name, element, "name", is_identifier)?;
        if directions.len() > crate::law::MAX_DIRECTIONS {
            let message = format!("a node has at most three directions, found {}", directions.len());
            return Err(ModelError::new(element, "directions", message));
        }
        for (k, along) in directions.iter().enumerate() {
            check_identifier(along, element, "directions", is_identifier)?;
            if directions[..k].contains(along) {
                return duplicate_name(along, element, "directions");
            }
        }
        if self.places.directions.contains_key(name) || self.places.ends.contains_key(name) {
            return duplicate_name(name, element, "name");
        }
        for (along, place) in places_of(name, directions).into_iter().enumerate() {
            let moved = self.motions.contains(place.as_str());
            self.place(DeclaredPlace { name: place, of: of(along), moved, radius: None }, element, "name")?;
        }
        if !directions.is_empty() {
            self.places.directions.insert(name.to_owned(), directions.to_owned());
        }
        Ok(())
    }

    /// Adds a rigid body. As a node, the body has the displacements of its centre of mass.
    fn body(&mut self, index: usize, body: &Body) -> Result<(), ModelError> {
        let element = Element::Body(index);
        check_identifier(&body.name, element, "name", is_identifier)?;
        body.check().map_err(|(key, message)| ModelError::new(element, key, message))?;
        if self.places.directions.contains_key(&body.name) || self.places.ends.contains_key(&body.name) {
            return duplicate_name(&body.name, element, "name");
        }
        for (along, (name, place)) in body.directions.iter().zip(body.places()).enumerate() {
            if body.directions[..along].contains(name) {
                return duplicate_name(name, element, "directions");
            }
            let (moved, radius) = (self.motions.contains(place.as_str()), body.radius(name));
            self.place(
                DeclaredPlace { name: place, of: PlaceSource::Body(index, along), moved, radius },
                element,
                "name",
            )?;
        }
        let displacements = body.directions.iter().filter(|name| TRANSLATIONS.contains(&name.as_str()));
        self.places.directions.insert(body.name.clone(), displacements.cloned().collect());
        Ok(())
    }

    fn place(&mut self, place: DeclaredPlace, element: Element, key: &'static str) -> Result<(), ModelError> {
        let column = place.name.replace('.', "_");
        if !self.columns.insert(column.clone()) {
            return duplicate_name(&column, element, key);
        }
        self.places.ends.insert(place.name.clone(), PlaceTarget::At(self.places.stated.len()));
        self.places.stated.push(place);
        Ok(())
    }

    /// Adds the places that exist only by their imposed motion.
    fn moved(&mut self, model: &Model) -> Result<(), ModelError> {
        for (i, motion) in model.motions.iter().enumerate() {
            let element = Element::Motion(i);
            check_identifier(&motion.on, element, "on", is_place)?;
            if self.places.ends.contains_key(&motion.on) {
                continue;
            }
            if self.places.directions.contains_key(&motion.on) {
                // returns the error that a direction is missing
                self.places.find(&motion.on, element, "on")?;
            }
            let place = DeclaredPlace { name: motion.on.clone(), of: PlaceSource::Own(0.0), moved: true, radius: None };
            self.place(place, element, "on")?;
            if let Some((node, along)) = motion.on.split_once('.') {
                self.places.directions.entry(node.to_owned()).or_default().push(along.to_owned());
            }
        }
        Ok(())
    }
}

fn check_identifier(
    name: &str,
    element: Element,
    key: &'static str,
    accepts: fn(&str) -> bool,
) -> Result<(), ModelError> {
    if name == GROUND {
        Err(ModelError::new(element, key, "`ground` is the fixed frame and cannot be declared"))
    } else if accepts(name) {
        Ok(())
    } else {
        let message = format!("`{name}` is not a valid name: use a letter first, then letters, digits and `_`");
        Err(ModelError::new(element, key, message))
    }
}

fn duplicate_name<T>(name: &str, element: Element, key: &'static str) -> Result<T, ModelError> {
    Err(ModelError::new(element, key, format!("the name `{name}` appears twice")))
}
