//! The coordinates of a model, and its places as weighted sums of them.
//!
//! They are those of its substructure (all its rows, or the few of its reduction), then one for each mass along each of its directions. Places
//! with an imposed motion are coordinates too: each takes the place of the one that it depends on most, so that `x = T (q, u)` with the moved
//! displacements `u` at the end, and `Tᵀ M T` has what they share with the others.

use super::assemble::{Element, ModelError};
use super::places::{Of, Places};
use super::{Model, Substructure, SubstructureDamping};
use crate::structure::reduction::{Damping, Reduced, Row};
use crate::structure::{ReducedComponent, Reduction};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Row, column, value.
type Entries = Vec<(usize, usize, f64)>;

/// Coordinates of a model.
pub(super) struct Coordinates {
    /// How many are free.
    pub free: usize,
    /// How many are moved; they follow the free ones.
    pub moved: usize,
    /// Names of the free ones.
    pub names: Vec<String>,
    /// The stated places, over free and then moved coordinates.
    pub places: Vec<Row>,
    /// Mass, damping and stiffness of the substructure.
    pub entries: [Entries; 3],
    pub reduced: Option<Arc<ReducedComponent>>,
}

/// A moved place that depends on the others by all but this share is no coordinate of its own.
const DEPENDENT: f64 = 1e-10;

impl Coordinates {
    pub fn new(model: &Model, places: &Places) -> Result<Self, ModelError> {
        let part = model.substructure.as_ref().map_or_else(|| Ok(Part::default()), |own| Part::new(own, model))?;
        let mut names = part.names;
        let first = names.len();
        let mut own = first;
        let mut rows: Vec<Row> = Vec::with_capacity(places.stated.len());
        for place in &places.stated {
            rows.push(match place.of {
                Of::Component(index, along) => match part.places.get(index) {
                    Some(rows) => rows[along].clone(),
                    None => {
                        let message = "there is no structure that it could be a place of; add [structure]";
                        return Err(ModelError::new(Element::Place(index), "name", message));
                    }
                },
                Of::Own(_) => {
                    names.push(place.name.clone());
                    own += 1;
                    vec![(own - 1, 1.0)]
                }
            });
        }
        let moved: Vec<(&str, &Row)> = places
            .stated
            .iter()
            .zip(&rows)
            .filter(|(place, _)| place.moved)
            .map(|(place, row)| (place.name.as_str(), row))
            .collect();
        let turned = Turned::new(names.len(), &moved)?;
        let placed: Vec<Row> = rows.iter().map(|row| turned.row(row)).collect();
        follows(model, places, &placed, turned.free)?;
        Ok(Coordinates {
            free: turned.free,
            moved: moved.len(),
            names: names.into_iter().zip(&turned.pivot).filter(|(_, pivot)| !**pivot).map(|(name, _)| name).collect(),
            places: placed,
            entries: part.entries.map(|entries| turned.entries(entries)),
            reduced: part.reduced,
        })
    }

    /// The number of a stated place among those that are moved.
    pub fn moved_number(&self, places: &Places, place: usize) -> Option<usize> {
        places.stated[place].moved.then(|| places.stated[..place].iter().filter(|place| place.moved).count())
    }
}

/// Refuses places that follow a moved one directly, as all do in few coordinates: results are read off the free coordinates alone.
fn follows(model: &Model, places: &Places, rows: &[Row], free: usize) -> Result<(), ModelError> {
    for (place, row) in places.stated.iter().zip(rows).filter(|(place, _)| !place.moved) {
        let size = row.iter().fold(0.0, |most: f64, (_, weight)| most.max(weight.abs()));
        let on = row.iter().find(|(at, weight)| *at >= free && weight.abs() > DEPENDENT * size);
        let Some((at, _)) = on else { continue };
        let name =
            places.stated.iter().filter(|place| place.moved).nth(at - free).map_or("", |place| place.name.as_str());
        let motion = model.motions.iter().position(|motion| motion.on == name).unwrap_or(0);
        let message = format!(
            "`{}` follows `{name}`, whose motion is imposed, as places of a structure in few coordinates do; say reduce = false in \
             [structure], or move another place that a stiff spring ties to it",
            place.name
        );
        return Err(ModelError::new(Element::Motion(motion), "on", message));
    }
    Ok(())
}

/// The substructure in coordinates of its own.
#[derive(Default)]
struct Part {
    names: Vec<String>,
    /// For each place of the model, each of its directions.
    places: Vec<Vec<Row>>,
    entries: [Entries; 3],
    reduced: Option<Arc<ReducedComponent>>,
}

impl Part {
    fn new(substructure: &Substructure, model: &Model) -> Result<Self, ModelError> {
        let n = substructure.component.dofs();
        for (i, place) in model.places.iter().enumerate() {
            for row in &place.rows {
                let wrong = |key, message: String| Err(ModelError::new(Element::Place(i), key, message));
                if let Some((at, _)) = row.iter().find(|(at, _)| *at >= n) {
                    return wrong("dof", format!("row {} of a structure of {n} rows", at + 1));
                }
                if row.iter().all(|(_, weight)| *weight == 0.0) || row.iter().any(|(_, weight)| !weight.is_finite()) {
                    return wrong("dof", "its weights must be finite numbers, not all zero".to_owned());
                }
            }
        }
        match substructure.reduction {
            Reduction::None => Part::whole(substructure, model),
            _ => Part::reduced(substructure, model),
        }
    }

    fn whole(substructure: &Substructure, model: &Model) -> Result<Self, ModelError> {
        let (mass, own, stiffness) = substructure.component.matrices();
        let entries: Entries = mass.entries().collect();
        let springs: Entries = stiffness.entries().collect();
        let damping = match substructure.damping {
            SubstructureDamping::Own => own.map_or_else(Vec::new, |own| own.entries().collect()),
            SubstructureDamping::Rayleigh { mass, stiffness } => {
                let times = |entries: &Entries, factor: f64| -> Entries {
                    let all = entries.iter().filter(|_| factor != 0.0);
                    all.map(|(row, column, value)| (*row, *column, factor * value)).collect()
                };
                [times(&entries, mass), times(&springs, stiffness)].concat()
            }
            SubstructureDamping::Ratio(_) => {
                let message = "a damping ratio belongs to modes, and without a reduction there are none";
                let help = "; state `rayleigh`, a damping matrix, or leave out `reduce = false`";
                return Err(ModelError::new(Element::Substructure, "modal_damping", format!("{message}{help}")));
            }
        };
        let named = |(at, name): (usize, &String)| {
            if name.is_empty() { format!("row {}", at + 1) } else { format!("row {name}") }
        };
        Ok(Part {
            names: substructure.component.rows().iter().enumerate().map(named).collect(),
            places: model.places.iter().map(|place| place.displacements(&place.rows)).collect(),
            entries: [entries, damping, springs],
            reduced: None,
        })
    }

    fn reduced(substructure: &Substructure, model: &Model) -> Result<Self, ModelError> {
        let seen: Vec<Row> = model.places.iter().flat_map(|place| place.rows.iter().cloned()).collect();
        let failed = |error: crate::structure::reduction::ReductionError| {
            ModelError::new(Element::Substructure, "reduce", error.to_string())
        };
        let component = substructure.component.reduced(&seen, &substructure.reduction).map_err(failed)?;
        let damping = match substructure.damping {
            SubstructureDamping::Own => None,
            SubstructureDamping::Ratio(ratio) => Some(Damping::Ratio { ratio, up_to: component.up_to() }),
            SubstructureDamping::Rayleigh { mass, stiffness } => Some(Damping::Rayleigh { mass, stiffness }),
        };
        let reduced = component.matrices(damping.as_ref()).map_err(failed)?;
        let entries = |matrix: &nalgebra::DMatrix<f64>| -> Entries {
            let all = (0..matrix.ncols()).flat_map(|k| (0..matrix.nrows()).map(move |i| (i, k)));
            all.map(|at| (at.0, at.1, matrix[at])).filter(|entry| entry.2 != 0.0).collect()
        };
        let Reduced { mass, damping, stiffness, ports, .. } = &reduced;
        let row = |port: usize| ports.row(port).iter().copied().enumerate().filter(|(_, w)| *w != 0.0).collect();
        let mut next = 0;
        let of_place = |place: &super::Place| -> Vec<Row> {
            next += place.rows.len();
            place.displacements(&(next - place.rows.len()..next).map(row).collect::<Vec<_>>())
        };
        Ok(Part {
            names: (1..=reduced.dofs()).map(|number| format!("coordinate {number}")).collect(),
            places: model.places.iter().map(of_place).collect(),
            entries: [entries(mass), entries(damping), entries(stiffness)],
            reduced: Some(component),
        })
    }
}

/// `x = T (q, u)`: coordinates of which some have given way to moved displacements.
struct Turned {
    free: usize,
    /// Which coordinates have given way.
    pivot: Vec<bool>,
    rows: Vec<Row>,
}

impl Turned {
    fn new(count: usize, moved: &[(&str, &Row)]) -> Result<Self, ModelError> {
        // x_p = Σ a x + Σ b u of every coordinate that gave way; u counts from `count`
        let mut given: BTreeMap<usize, Row> = BTreeMap::new();
        for (k, (name, row)) in moved.iter().enumerate() {
            let row = combined(substituted(row, &given));
            let size = row.iter().fold(0.0, |most: f64, (_, weight)| most.max(weight.abs()));
            let free = row.iter().filter(|(at, _)| *at < count);
            let most = free.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()).then(b.0.cmp(&a.0)));
            let Some(&(at, weight)) = most.filter(|(_, weight)| weight.abs() > DEPENDENT * size) else {
                let message =
                    format!("the motion of `{name}` follows from other imposed motions; leave one of them out");
                return Err(ModelError::new(Element::Motion(0), "on", message));
            };
            let mut own: Row = vec![(count + k, 1.0 / weight)];
            own.extend(row.iter().filter(|part| part.0 != at).map(|part| (part.0, -part.1 / weight)));
            let one = BTreeMap::from([(at, own)]);
            given.values_mut().for_each(|other| *other = combined(substituted(other, &one)));
            given.extend(one);
        }
        let free = count - given.len();
        let pivot: Vec<bool> = (0..count).map(|at| given.contains_key(&at)).collect();
        let mut new = Vec::with_capacity(count);
        let mut next = 0;
        for gone in &pivot {
            new.push(next);
            next += usize::from(!gone);
        }
        let renumber = |at: usize| if at < count { new[at] } else { free + (at - count) };
        let row = |at: usize| match given.get(&at) {
            Some(row) => row.iter().map(|(at, weight)| (renumber(*at), *weight)).collect(),
            None => vec![(renumber(at), 1.0)],
        };
        Ok(Turned { free, rows: (0..count).map(row).collect(), pivot })
    }

    /// A weighted sum of the coordinates over free and then moved ones.
    fn row(&self, row: &Row) -> Row {
        let parts = row.iter().flat_map(|(at, weight)| self.rows[*at].iter().map(move |(to, w)| (*to, weight * w)));
        combined(parts.collect())
    }

    /// `Tᵀ A T`.
    fn entries(&self, entries: Entries) -> Entries {
        if !self.pivot.contains(&true) {
            return entries;
        }
        let mut out = Vec::with_capacity(entries.len());
        for (row, column, value) in entries {
            for &(i, a) in &self.rows[row] {
                out.extend(self.rows[column].iter().map(|&(k, b)| (i, k, value * (a * b))));
            }
        }
        out
    }
}

/// A row in which coordinates that gave way are replaced.
fn substituted(row: &Row, given: &BTreeMap<usize, Row>) -> Row {
    let mut out = Row::new();
    for &(at, weight) in row {
        match given.get(&at) {
            Some(other) => out.extend(other.iter().map(|(to, w)| (*to, weight * w))),
            None => out.push((at, weight)),
        }
    }
    out
}

/// The same sum with every coordinate once, in the order in which they first stand there.
pub(super) fn combined(row: Row) -> Row {
    let mut seen: BTreeMap<usize, usize> = BTreeMap::new();
    let mut out: Row = Vec::with_capacity(row.len());
    for (at, weight) in row {
        match seen.get(&at) {
            Some(&k) => out[k].1 += weight,
            None => {
                seen.insert(at, out.len());
                out.push((at, weight));
            }
        }
    }
    out
}
