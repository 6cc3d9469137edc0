//! Names of the model's places and joints that the value of a key may use.
//!
//! The name of a node stands for all its directions, and so does the name of a joint between
//! nodes. On a disk, a name of the sector stands for that element in all sectors. A key that
//! takes one place refuses such a name and lists the directions.

use crate::kinds::info::KeyError;
use crate::syntax::suggest::{alternatives, excerpt, suggest};
use std::collections::BTreeSet;
use stickslip::model::Model;

/// Largest number of names that a message lists.
const MAX_LISTED: usize = 12;

/// The names that a key may take, each with the labels that it stands for.
#[derive(Debug, Default)]
pub(crate) struct ModelNames {
    known: Vec<(String, Vec<String>)>,
    /// Rotations, which the key does not take.
    rotations: Vec<String>,
}

/// Returns one entry per label. If no label equals `name`, adds `name` as an entry for all of
/// them.
fn entries(name: &str, labels: Vec<String>) -> Vec<(String, Vec<String>)> {
    let mut entries: Vec<_> = labels.iter().map(|label| (label.clone(), vec![label.clone()])).collect();
    if labels.iter().all(|label| label != name) {
        entries.push((name.to_owned(), labels));
    }
    entries
}

fn body_places(model: &Model) -> impl Iterator<Item = (String, Vec<String>)> {
    model.bodies.iter().flat_map(|body| entries(&body.name, body.places()))
}

fn mass_places(model: &Model) -> impl Iterator<Item = (String, Vec<String>)> {
    model.masses.iter().flat_map(|mass| entries(&mass.name, mass.places()))
}

impl ModelNames {
    /// The places of the structure, of masses and of bodies, and their nodes.
    pub fn places(model: &Model) -> ModelNames {
        let places = model.places.iter().flat_map(|place| entries(&place.name, place.places()));
        let known = places.chain(mass_places(model)).chain(body_places(model)).collect();
        let mut names = ModelNames { known, rotations: Vec::new() };
        names.add_sector_names(model, model.masses.iter().map(|mass| (mass.name.as_str(), mass.places())).collect());
        names.add_sector_names(model, model.bodies.iter().map(|body| (body.name.as_str(), body.places())).collect());
        names.add_sector_names(model, model.places.iter().map(|place| (place.name.as_str(), place.places())).collect());
        names
    }

    /// Adds the sector's names: `blade` stands for the blades of all sectors. `all` are the
    /// elements of the ring, in order.
    fn add_sector_names(&mut self, model: &Model, all: Vec<(&str, Vec<String>)>) {
        let Some(ring) = model.ring else { return };
        let each = all.len() / ring.sectors.max(1);
        for (i, (name, _)) in all.iter().enumerate().take(each) {
            let Some(name) = name.strip_suffix("_0") else { continue };
            let labels: Vec<Vec<String>> = all.iter().skip(i).step_by(each).map(|(_, labels)| labels.clone()).collect();
            if labels.first().is_some_and(|labels| labels.len() > 1) {
                for along in 0..labels[0].len() {
                    let Some((_, direction)) = labels[0][along].split_once('.') else { continue };
                    let places = labels.iter().map(|labels| labels[along].clone()).collect();
                    self.known.push((format!("{name}.{direction}"), places));
                }
            }
            self.known.push((name.to_owned(), labels.into_iter().flatten().collect()));
        }
    }

    /// The places that are displacements, not rotations: their amplitudes can be compared.
    pub fn displacements(model: &Model) -> ModelNames {
        ModelNames::places(model).without_rotations(model)
    }

    fn without_rotations(mut self, model: &Model) -> ModelNames {
        for (_, places) in &mut self.known {
            let (rotations, displacements): (Vec<String>, _) =
                std::mem::take(places).into_iter().partition(|place| model.is_rotation(place));
            self.rotations.extend(rotations);
            *places = displacements;
        }
        self.known.retain(|(_, places)| !places.is_empty());
        self
    }

    /// The displacements of masses, bodies and places whose motion is not imposed.
    pub fn free_displacements(model: &Model) -> ModelNames {
        let of_places = model.places.iter().flat_map(|place| entries(&place.name, place.places()));
        let known = mass_places(model).chain(body_places(model)).chain(of_places).collect();
        let mut names = ModelNames { known, rotations: Vec::new() }.without_rotations(model);
        let moved: BTreeSet<&str> = model.motions.iter().map(|motion| motion.on.as_str()).collect();
        names.known.retain(|(_, places)| !places.iter().any(|place| moved.contains(place.as_str())));
        names
    }

    /// Adds the joints and their directions.
    #[must_use]
    pub fn with_joints(mut self, model: &Model) -> ModelNames {
        let labels = model.joint_labels();
        let all: Vec<(&str, Vec<String>)> = model.joints.iter().map(|joint| joint.name.as_str()).zip(labels).collect();
        self.known.extend(all.iter().flat_map(|(name, labels)| entries(name, labels.clone())));
        self.add_sector_names(model, all);
        self
    }

    /// Adds the places with an imposed motion, except rotations.
    #[must_use]
    pub fn with_imposed_motions(mut self, model: &Model) -> ModelNames {
        let moved = model.motions.iter().filter(|motion| !model.is_rotation(&motion.on));
        self.known.extend(moved.map(|motion| (motion.on.clone(), vec![motion.on.clone()])));
        self
    }

    /// Returns whether there are no names.
    pub fn is_empty(&self) -> bool {
        self.known.is_empty()
    }

    /// Returns the labels that a name stands for: itself, or all its directions. `what` names
    /// the expected object for the message.
    pub fn labels(&self, key: &'static str, what: &str, name: &str) -> Result<&[String], KeyError> {
        let found = self.known.iter().find(|(known, _)| known == name).map(|(_, labels)| labels.as_slice());
        found.ok_or_else(|| {
            let words = || self.known.iter().map(|(known, _)| known.as_str());
            let help = match self.directions_of(name) {
                Some(directions) => format!("write {}", alternatives(directions.iter().map(String::as_str))),
                None => match suggest(name, words()) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None if self.is_empty() => format!("the model has no {what}"),
                    None => format!("choose {}", alternatives(words().take(MAX_LISTED))),
                },
            };
            KeyError { name: Some(name.to_owned()), ..KeyError::new(key, self.unknown_name(what, name), help) }
        })
    }

    /// Returns the one place or joint that a name stands for.
    pub fn single_label(&self, key: &'static str, what: &str, name: &str) -> Result<&str, KeyError> {
        match self.labels(key, what, name)? {
            [one] => Ok(one),
            several => {
                let of_node =
                    several.iter().all(|label| label.strip_prefix(name).is_some_and(|rest| rest.starts_with('.')));
                let message = match of_node {
                    true => format!("`{name}` has several directions; this key needs one of them"),
                    // on a disk: the places with this name in every sector
                    false => format!("`{name}` stands for {} places; this key needs one of them", several.len()),
                };
                let help = format!("write {}", alternatives(several.iter().take(MAX_LISTED).map(String::as_str)));
                Err(KeyError { name: Some(name.to_owned()), ..KeyError::new(key, message, help) })
            }
        }
    }

    /// Returns the existing directions of a node for a name with an unknown direction: those of
    /// `tip` for `tip.y`.
    pub fn directions_of(&self, name: &str) -> Option<&[String]> {
        let (node, _) = name.split_once('.')?;
        let (_, labels) = self.known.iter().find(|(known, labels)| known == node && labels.len() > 1)?;
        Some(labels)
    }

    /// Returns the message that a name is unknown.
    pub fn unknown_name(&self, what: &str, name: &str) -> String {
        if self.rotations.iter().any(|rotation| rotation == name) {
            return format!("`{}` is a rotation, but this key needs a displacement", excerpt(name));
        }
        let none = format!("there is no {what} `{}`", excerpt(name));
        match name.split_once('.').filter(|_| self.directions_of(name).is_some()) {
            Some((node, direction)) => format!("{none}: `{node}` has no direction {}", excerpt(direction)),
            None => none,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use stickslip::law::FrictionContact;
    use stickslip::model::{GROUND, Joint, Mass};

    fn model() -> Model {
        let law = FrictionContact { tangential: 1.0, normal: 1.0, friction: 0.1, preload: 1.0, tangents: 1 };
        Model {
            masses: vec![
                Mass { name: "tip".into(), mass: 1.0, directions: vec!["x".into(), "z".into()] },
                Mass::new("root", 1.0),
            ],
            joints: vec![Joint { name: "rub".into(), between: ["tip".into(), GROUND.into()], law: Arc::new(law) }],
            ..Model::default()
        }
    }

    #[test]
    fn a_node_stands_for_its_directions_or_names_them() {
        let names = ModelNames::places(&model()).with_joints(&model());
        assert_eq!(names.labels("only", "place", "tip").unwrap(), ["tip.x", "tip.z"]);
        assert_eq!(names.labels("only", "place", "rub").unwrap(), ["rub.x", "rub.z"]);
        assert_eq!(
            (names.single_label("start", "place", "tip.z"), names.single_label("start", "mass", "root")),
            (Ok("tip.z"), Ok("root"))
        );
        let help = |found: Result<&str, KeyError>| found.unwrap_err().help.unwrap();
        for wrong in ["tip", "tip.y"] {
            assert_eq!(help(names.single_label("start", "place", wrong)), "write `tip.x` or `tip.z`", "{wrong}");
        }
        let wrong = names.single_label("start", "place", "tip.y").unwrap_err();
        assert_eq!(wrong.message, "there is no place `tip.y`: `tip` has no direction y");
        assert_eq!(help(names.single_label("start", "place", "roof")), "did you mean `root`?");
        assert!(help(names.single_label("start", "place", "q")).contains("`root`"));
    }
}
