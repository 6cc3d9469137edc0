//! Bladed disks: builds the model of the ring from the model of one sector.
//!
//! Sectors count from 0. The name `blade` in a sector becomes `blade_0`, `blade_1` … in the
//! ring. `next.blade` is the blade of the next sector; the next sector of the last one is the
//! first.

use super::{CyclicSymmetry, Element, FrequencyForce, GROUND, Model, ModelError};
use serde::Serialize;
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use stickslip_numerics::random::Stream;

/// Prefix of a place in the next sector.
pub const NEXT: &str = "next.";
/// Smallest number of sectors of a disk: a single sector would be adjacent to itself.
pub const MIN_SECTORS: usize = 2;

/// The distribution of a force or an imposed motion over the sectors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SectorDistribution {
    /// Sector n leads by `2π order n / sectors`: a travelling wave. A negative order reverses
    /// the direction.
    EngineOrder(i64),
    /// Sector n has the fraction `cos(2π diameter n / sectors)`: a standing wave.
    NodalDiameter(i64),
    /// Excitation of one sector only.
    Sector(usize),
}

impl SectorDistribution {
    /// Returns the fraction of the amplitude and the phase lead (rad) in a sector.
    fn in_sector(self, sector: usize, sectors: usize) -> (f64, f64) {
        let phase = |order: i64| crate::structure::unit_root(reduced_order(order, sector, sectors), sectors);
        match self {
            // without whole turns, so that equivalent orders give identical bits
            SectorDistribution::EngineOrder(order) => {
                (1.0, TAU * reduced_order(order, sector, sectors) as f64 / sectors as f64)
            }
            SectorDistribution::NodalDiameter(diameter) => (phase(diameter).re, 0.0),
            SectorDistribution::Sector(one) => (if one == sector { 1.0 } else { 0.0 }, 0.0),
        }
    }

    /// Returns the order of the wave, from 0 to the number of sectors, if it travels.
    fn order(self, sectors: usize) -> Option<usize> {
        match self {
            SectorDistribution::EngineOrder(order) => Some(reduced_order(order, 1, sectors) as usize),
            // a wave with all sectors in phase, or with opposite adjacent sectors, both stands
            // and travels
            SectorDistribution::NodalDiameter(diameter) => {
                let order = reduced_order(diameter, 1, sectors) as usize;
                (2 * order).is_multiple_of(sectors).then_some(order)
            }
            SectorDistribution::Sector(_) => None,
        }
    }
}

/// Returns `order · sector` without whole turns.
fn reduced_order(order: i64, sector: usize, sectors: usize) -> i64 {
    let sectors = sectors as i64;
    (order.rem_euclid(sectors) * sector as i64).rem_euclid(sectors)
}

/// A ring of sectors and the distribution of its excitation.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Disk {
    /// Number of sectors.
    pub sectors: usize,
    /// Distribution of each force of the sector; engine order 0 if missing.
    pub forces: Vec<SectorDistribution>,
    /// Distribution of each imposed motion of the sector; engine order 0 if missing.
    pub motions: Vec<SectorDistribution>,
}

/// Layout of a ring's model: elements are stored sector by sector, with equally long lists per
/// sector.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Ring {
    /// Number of sectors.
    pub sectors: usize,
    /// True if all sectors are equal.
    pub equal: bool,
    /// Order of the travelling excitation of equal sectors. Sector n repeats the motion of the
    /// first one, earlier by `order n / sectors` of a period. Harmonic h of the motion then has
    /// the nodal diameter `h order`.
    pub order: Option<usize>,
}

impl Disk {
    /// Builds the ring from the sectors that `sector` returns. All sectors have the same
    /// elements, with different values.
    ///
    /// # Errors
    /// [`ModelError`], with the element of the sector: a place that the sector does not have,
    /// fewer than two sectors, a force on a sector that does not exist.
    ///
    /// # Panics
    /// If the numbers of elements differ between the sectors.
    ///
    /// # Example
    /// Blades with springs between them, an engine order of 3 on 24 sectors: one wave with 3
    /// nodal diameters.
    /// ```
    /// use stickslip::model::{Disk, SectorDistribution};
    /// use stickslip::{Force, GROUND, Mass, Model, Spring};
    /// let spring = |other: &str, stiffness| Spring {
    ///     between: ["blade".into(), other.into()],
    ///     stiffness,
    ///     damping: 0.1,
    /// };
    /// let sector = Model {
    ///     masses: vec![Mass::new("blade", 0.2)],
    ///     springs: vec![spring(GROUND, 1e5), spring("next.blade", 2e4)],
    ///     forces: vec![Force { on: "blade".into(), amplitude: 1.0, phase: 0.0, harmonic: 1 }],
    ///     ..Model::default()
    /// };
    /// let disk =
    ///     Disk { sectors: 24, forces: vec![SectorDistribution::EngineOrder(3)], motions: vec![] };
    /// let ring = disk.ring(|_| sector.clone()).unwrap();
    /// assert_eq!((ring.masses.len(), ring.masses[23].name.as_str()), (24, "blade_23"));
    /// assert_eq!(ring.springs[47].between, ["blade_23", "blade_0"]);
    /// assert_eq!(ring.ring.unwrap().order, Some(3));
    /// ```
    pub fn ring(&self, sector: impl Fn(usize) -> Model) -> Result<Model, ModelError> {
        let first = sector(0);
        self.check(&first)?;
        let count = |model: &Model| {
            let Model { places, masses, bodies, springs, joints, forces, motions, .. } = model;
            [places.len(), masses.len(), bodies.len(), springs.len(), joints.len(), forces.len(), motions.len()]
        };
        let mut model = Model { substructure: first.substructure.clone(), ..Model::default() };
        let mut deviations = Vec::new();
        let mut equal = true;
        for s in 0..self.sectors {
            let mut one = if s == 0 { first.clone() } else { sector(s) };
            assert_eq!(count(&one), count(&first), "sector {s} has other elements than the first");
            equal &= s == 0 || one == first;
            let name = |name: &String| self.name(name.as_str(), s);
            deviations.extend(one.substructure.iter().flat_map(|own| &own.disk).flat_map(|disk| &disk.deviations));
            one.places.iter_mut().for_each(|place| place.name = name(&place.name));
            one.places.iter_mut().for_each(|place| place.view_of = place.view_of.as_ref().map(name));
            one.masses.iter_mut().for_each(|mass| mass.name = name(&mass.name));
            one.bodies.iter_mut().for_each(|body| body.name = name(&body.name));
            one.springs.iter_mut().for_each(|spring| spring.between = spring.between.each_ref().map(name));
            for joint in &mut one.joints {
                joint.name = format!("{}_{s}", joint.name);
                joint.between = joint.between.each_ref().map(name);
            }
            for (force, around) in one.forces.iter_mut().zip(distributions(&self.forces)) {
                let (share, lead) = around.in_sector(s, self.sectors);
                force.on = name(&force.on);
                (force.amplitude, force.phase) = (force.amplitude * share, force.phase + lead);
            }
            for part in &one.frequency_forces {
                let around = distributions(&self.forces).nth(part.force).unwrap_or(SectorDistribution::EngineOrder(0));
                let share = around.in_sector(s, self.sectors).0;
                model.frequency_forces.push(FrequencyForce {
                    force: s * one.forces.len() + part.force,
                    linear: part.linear * share,
                    quadratic: part.quadratic * share,
                });
            }
            for (motion, around) in one.motions.iter_mut().zip(distributions(&self.motions)) {
                let (share, lead) = around.in_sector(s, self.sectors);
                motion.on = name(&motion.on);
                (motion.amplitude, motion.phase) = (motion.amplitude * share, motion.phase + lead);
            }
            model.places.append(&mut one.places);
            model.masses.append(&mut one.masses);
            model.bodies.append(&mut one.bodies);
            model.springs.append(&mut one.springs);
            model.joints.append(&mut one.joints);
            model.forces.append(&mut one.forces);
            model.motions.append(&mut one.motions);
        }
        if let Some(disk) = model.substructure.as_mut().and_then(|own| own.disk.as_mut()) {
            disk.deviations = deviations;
        }
        let order = if equal { self.order(&first) } else { None };
        model.ring = Some(Ring { sectors: self.sectors, equal, order });
        Ok(model)
    }

    /// Returns the order of the wave that the complete excitation of equal sectors forms.
    /// `harmonic · order` is the engine order of each part, up to whole turns.
    fn order(&self, sector: &Model) -> Option<usize> {
        let forces = sector.forces.iter().zip(distributions(&self.forces)).enumerate().map(|(i, (force, around))| {
            let grows = sector.frequency_forces.iter().any(|part| part.force == i);
            (if grows { 1.0 } else { force.amplitude }, force.harmonic, around)
        });
        let motions = sector
            .motions
            .iter()
            .zip(distributions(&self.motions))
            .map(|(m, around)| (m.amplitude, m.harmonic, around));
        let excitation: Vec<(u32, SectorDistribution)> = forces
            .chain(motions)
            .filter(|(amplitude, ..)| *amplitude != 0.0)
            .map(|(_, harmonic, around)| (harmonic, around))
            .collect();
        if excitation.is_empty() {
            return None;
        }
        (0..self.sectors).find(|order| {
            excitation.iter().all(|(harmonic, around)| {
                let made = (*harmonic as usize % self.sectors * order) % self.sectors;
                around.order(self.sectors) == Some(made)
            })
        })
    }

    /// Returns the name in the ring for a place name in sector `s`.
    fn name(&self, name: &str, s: usize) -> String {
        let (name, s) = match name.strip_prefix(NEXT) {
            Some(name) => (name, (s + 1) % self.sectors),
            None => (name, s),
        };
        match name.split_once('.') {
            _ if name == GROUND => name.to_owned(),
            Some((node, along)) => format!("{node}_{s}.{along}"),
            None => format!("{name}_{s}"),
        }
    }

    /// Checks the names of a sector. The assembly of the ring finds other errors.
    fn check(&self, sector: &Model) -> Result<(), ModelError> {
        let refuse = |element, key, message: String| Err(ModelError::new(element, key, message));
        if self.sectors < MIN_SECTORS {
            let message = format!("a disk needs at least {MIN_SECTORS} sectors, found {}", self.sectors);
            return refuse(Element::Whole, "sectors", message);
        }
        if sector.substructure.as_ref().is_some_and(|own| own.disk.is_none()) {
            let message = "the matrices of a sector need the node pairs of its low and high side, which connect it to the next sector";
            return refuse(Element::Substructure, "stiffness", message.to_owned());
        }
        let next = |name: &str| NEXT.strip_suffix('.') == Some(name);
        if let Some(i) = sector.places.iter().position(|place| next(&place.name)) {
            let message = "`next` is reserved for the next sector of a disk; choose another name".to_owned();
            return refuse(Element::Place(i), "name", message);
        }
        for (i, mass) in sector.masses.iter().enumerate() {
            if next(&mass.name) {
                let message = "`next` is reserved for the next sector of a disk; choose another name".to_owned();
                return refuse(Element::Mass(i), "name", message);
            }
        }
        if let Some(i) = sector.bodies.iter().position(|body| next(&body.name)) {
            let message = "`next` is reserved for the next sector of a disk; choose another name".to_owned();
            return refuse(Element::Body(i), "name", message);
        }
        let mut known: BTreeSet<String> = sector.place_names().into_iter().collect();
        known.extend(sector.nodes().map(|(name, _)| name.to_owned()));
        let find = |name: &String, element: Element, key: &'static str| {
            let place = name.strip_prefix(NEXT).unwrap_or(name);
            if known.contains(place) && (place != GROUND || name == place) {
                return Ok(());
            }
            let message = format!("there is no place `{place}` in a sector");
            let adjacent = place.split_once('.').map(|(_, own)| own).filter(|own| known.contains(*own));
            Err(match adjacent {
                Some(own) => {
                    let message = format!("{message}; for that of the next sector write `{NEXT}{own}`");
                    ModelError::new(element, key, message)
                }
                None => ModelError { wrong_name: Some(place.to_owned()), ..ModelError::new(element, key, message) },
            })
        };
        for (i, spring) in sector.springs.iter().enumerate() {
            spring.between.iter().try_for_each(|name| find(name, Element::Spring(i), "between"))?;
        }
        for (i, joint) in sector.joints.iter().enumerate() {
            joint.between.iter().try_for_each(|name| find(name, Element::Joint(i), "between"))?;
        }
        let excited = |on: &String, around: SectorDistribution, element: Element| {
            if let Some(place) = on.strip_prefix(NEXT) {
                let message =
                    format!("name a place of the sector itself, such as `{place}`; each sector has its own excitation");
                return refuse(element, "on", message);
            }
            match around {
                SectorDistribution::Sector(sector) if sector >= self.sectors => {
                    let message =
                        format!("there is no sector {sector}; sectors are numbered from 0 to {}", self.sectors - 1);
                    refuse(element, "sector", message)
                }
                _ => Ok(()),
            }
        };
        for (i, (force, around)) in sector.forces.iter().zip(distributions(&self.forces)).enumerate() {
            excited(&force.on, around, Element::Force(i))?;
            find(&force.on, Element::Force(i), "on")?;
        }
        for (i, (motion, around)) in sector.motions.iter().zip(distributions(&self.motions)).enumerate() {
            excited(&motion.on, around, Element::Motion(i))?;
        }
        Ok(())
    }
}

/// Returns a message if a relative deviation of a sector is -1 or less, or 1 or more.
///
/// Such a deviation leaves no mass or stiffness, or it was meant in percent.
///
/// # Example
/// ```
/// assert_eq!(stickslip::model::deviation_error(&[0.02, -0.01]), None);
/// assert!(
///     stickslip::model::deviation_error(&[2.0, -1.0])
///         .unwrap()
///         .contains("sector 1 deviates by -100.0 %: no stiffness or mass remains")
/// );
/// ```
pub fn deviation_error(deviations: &[f64]) -> Option<String> {
    let first = |far: fn(f64) -> bool| deviations.iter().position(|deviation| far(*deviation));
    let said = |sector: usize| format!("sector {sector} deviates by {:.1} %", 100.0 * deviations[sector]);
    let nothing = first(|deviation| deviation <= -1.0).map(|sector| said(sector) + ": no stiffness or mass remains");
    nothing.or_else(|| first(|deviation| deviation >= 1.0).map(said))
}

/// Returns normally distributed deviations of sectors with mean 0 and the given standard
/// deviation.
///
/// The seed determines the same bits on every machine. Different seeds are samples of the same
/// distribution. A longer pattern begins with the shorter one.
///
/// # Example
/// ```
/// let pattern = stickslip::model::normal_deviations(24, 0.02, 7);
/// assert_eq!(pattern[..12], stickslip::model::normal_deviations(12, 0.02, 7));
/// ```
pub fn normal_deviations(sectors: usize, deviation: f64, seed: u64) -> Vec<f64> {
    let stream = Stream::new(seed);
    (0..sectors as u64).map(|sector| deviation * stream.normal(sector)).collect()
}

/// The property of a sector that deviates in a mistuned disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MistunedProperty {
    /// The mass with this name.
    Mass(String),
    /// The stiffness of the springs between these two places.
    Spring([String; 2]),
    /// The stiffness of the blade, in a sector given by matrices.
    BladeStiffness,
    /// All cantilever frequencies of that blade, with the same relative deviation.
    BladeFrequency,
}

impl MistunedProperty {
    /// Returns the sector with this property multiplied by `1 + deviation`.
    ///
    /// # Example
    /// ```
    /// use stickslip::model::{Mass, MistunedProperty, Model};
    /// let sector = Model { masses: vec![Mass::new("blade", 2.0)], ..Model::default() };
    /// assert_eq!(
    ///     MistunedProperty::Mass("blade".to_owned()).apply(&sector, 0.5).masses[0].mass,
    ///     3.0
    /// );
    /// ```
    #[must_use]
    pub fn apply(&self, sector: &Model, deviation: f64) -> Model {
        let (mut model, factor) = (sector.clone(), 1.0 + deviation);
        let of_stiffness = match self {
            MistunedProperty::Mass(name) => {
                model.masses.iter_mut().filter(|mass| mass.name == *name).for_each(|mass| mass.mass *= factor);
                return model;
            }
            MistunedProperty::Spring(ends) => {
                let springs = model.springs.iter_mut().filter(|spring| joins(&spring.between, ends));
                springs.for_each(|spring| spring.stiffness *= factor);
                return model;
            }
            MistunedProperty::BladeStiffness => deviation,
            // stiffness changes with the square of the frequency
            MistunedProperty::BladeFrequency => deviation * (2.0 + deviation),
        };
        if let Some(disk) = model.substructure.as_mut().and_then(|own| own.disk.as_mut()) {
            disk.deviations = vec![of_stiffness];
        }
        model
    }

    /// Returns whether the sector has this property.
    pub fn is_in(&self, sector: &Model) -> bool {
        match self {
            MistunedProperty::Mass(name) => sector.masses.iter().any(|mass| mass.name == *name),
            MistunedProperty::Spring(ends) => sector.springs.iter().any(|spring| joins(&spring.between, ends)),
            MistunedProperty::BladeStiffness | MistunedProperty::BladeFrequency => {
                let disk = sector.substructure.as_ref().and_then(|own| own.disk.as_ref());
                disk.is_some_and(|disk| !disk.blade.is_empty())
            }
        }
    }
}

fn joins([a, b]: &[String; 2], [c, d]: &[String; 2]) -> bool {
    (a, b) == (c, d) || (a, b) == (d, c)
}

/// Extends the list with engine order 0 for all further elements.
fn distributions(stated: &[SectorDistribution]) -> impl Iterator<Item = SectorDistribution> {
    stated.iter().copied().chain(std::iter::repeat(SectorDistribution::EngineOrder(0)))
}

impl Ring {
    /// Returns the wave that travels around the ring.
    pub(super) fn wave(self) -> Option<CyclicSymmetry> {
        self.order.map(|order| CyclicSymmetry { sectors: self.sectors, order })
    }

    /// Returns the element of the sector that corresponds to an element of the ring's model
    /// `model`.
    pub fn in_sector(self, element: Element, model: &Model) -> Element {
        let own = |index: usize, all: usize| index % (all / self.sectors.max(1)).max(1);
        match element {
            Element::Mass(i) => Element::Mass(own(i, model.masses.len())),
            Element::Body(i) => Element::Body(own(i, model.bodies.len())),
            Element::Spring(i) => Element::Spring(own(i, model.springs.len())),
            Element::Joint(i) => Element::Joint(own(i, model.joints.len())),
            Element::Force(i) => Element::Force(own(i, model.forces.len())),
            Element::Motion(i) => Element::Motion(own(i, model.motions.len())),
            Element::Place(i) => Element::Place(own(i, model.places.len())),
            Element::Substructure | Element::Whole => element,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::Jenkins;
    use crate::model::{Force, Joint, Mass, Motion, Spring};
    use std::sync::Arc;

    fn sector() -> Model {
        let between = |a: &str, b: &str| [a.to_owned(), b.to_owned()];
        Model {
            masses: vec![Mass::new("disk", 2.0), Mass::new("blade", 0.2).along(&["x", "z"])],
            springs: vec![
                Spring { between: between("disk", "next.disk"), stiffness: 1e5, damping: 0.0 },
                Spring { between: between("disk", "blade.x"), stiffness: 1e5, damping: 0.1 },
                Spring { between: between("blade.z", "ground"), stiffness: 1e5, damping: 0.1 },
            ],
            joints: vec![Joint {
                name: "shroud".into(),
                between: between("blade.x", "next.blade.x"),
                law: Arc::new(Jenkins { stiffness: 1e4, limit: 1.0 }),
            }],
            forces: vec![Force { on: "blade.x".into(), amplitude: 2.0, phase: 0.5, harmonic: 1 }],
            ..Model::default()
        }
    }

    fn disk(sectors: usize, forces: &[SectorDistribution]) -> Disk {
        Disk { sectors, forces: forces.to_vec(), motions: Vec::new() }
    }

    #[test]
    fn names_lead_around_the_ring() {
        let ring = disk(3, &[SectorDistribution::EngineOrder(-1)]).ring(|_| sector()).unwrap();
        let system = ring.assemble().unwrap();
        assert_eq!(system.places()[6..], ["disk_2", "blade_2.x", "blade_2.z"]);
        assert_eq!(ring.joints[2].between, ["blade_2.x", "blade_0.x"]);
        assert_eq!(ring.ring, Some(Ring { sectors: 3, equal: true, order: Some(2) }));
        assert!((ring.forces[1].phase - (0.5 + TAU * 2.0 / 3.0)).abs() < 1e-15);
        let element = Ring { sectors: 3, equal: true, order: None }.in_sector(Element::Spring(7), &ring);
        assert_eq!(element, Element::Spring(1));
    }

    /// Engine orders that differ by whole turns give the same excitation, to the last bit.
    #[test]
    fn orders_alias() {
        for (a, b) in [(3, 27), (3, -21), (-3, 21), (0, 24), (12, -12)] {
            let [a, b] =
                [a, b].map(|order| disk(24, &[SectorDistribution::EngineOrder(order)]).ring(|_| sector()).unwrap());
            assert_eq!(a, b);
        }
    }

    /// One sector is solved only if the complete excitation travels with the wave.
    #[test]
    fn travelling_waves_are_detected() {
        let order = |forces: &[(u32, SectorDistribution)], sectors: usize| {
            let mut sector = sector();
            sector.forces = forces
                .iter()
                .map(|(harmonic, _)| Force { on: "blade.x".into(), amplitude: 1.0, phase: 0.0, harmonic: *harmonic })
                .collect();
            let around: Vec<SectorDistribution> = forces.iter().map(|(_, around)| *around).collect();
            disk(sectors, &around).ring(|_| sector.clone()).unwrap().ring.unwrap().order
        };
        use SectorDistribution::{EngineOrder, NodalDiameter, Sector};
        assert_eq!(order(&[(1, EngineOrder(3))], 24), Some(3));
        assert_eq!(order(&[(1, EngineOrder(3)), (0, EngineOrder(0))], 24), Some(3), "and a constant load");
        assert_eq!(order(&[(0, EngineOrder(3))], 24), None, "a constant load that differs from blade to blade");
        assert_eq!(order(&[(2, EngineOrder(3)), (4, EngineOrder(6))], 24), None, "no wave has half a diameter");
        assert_eq!(order(&[(2, EngineOrder(3))], 7), Some(5), "2 · 5 = 3 + 7");
        // the excitation frequency is the speed of the rotor
        assert_eq!(order(&[(3, EngineOrder(3)), (5, EngineOrder(5))], 24), Some(1));
        assert_eq!(order(&[(1, EngineOrder(3)), (1, EngineOrder(4))], 24), None);
        assert_eq!(order(&[(1, NodalDiameter(3))], 24), None);
        assert_eq!(order(&[(1, NodalDiameter(12))], 24), Some(12));
        assert_eq!(order(&[(1, NodalDiameter(24))], 24), Some(0));
        assert_eq!(order(&[(1, Sector(3))], 24), None);
        assert_eq!(order(&[], 24), None);
    }

    #[test]
    fn sectors_that_differ_are_mistuned() {
        let one = |s: usize| {
            let mut sector = sector();
            sector.springs[1].stiffness *= 1.0 + 0.01 * s as f64;
            sector
        };
        let ring = disk(5, &[SectorDistribution::EngineOrder(1)]).ring(one).unwrap();
        assert_eq!(ring.ring.unwrap().order, None);
        assert_eq!(ring.springs[3 * 4 + 1].stiffness, 1.04e5);
    }

    #[test]
    fn waves_that_stand() {
        let ring = disk(8, &[SectorDistribution::NodalDiameter(2)]).ring(|_| sector()).unwrap();
        let amplitudes: Vec<f64> = ring.forces.iter().map(|force| force.amplitude).collect();
        assert_eq!(amplitudes, [2.0, 0.0, -2.0, 0.0, 2.0, 0.0, -2.0, 0.0]);
        let one = disk(3, &[SectorDistribution::Sector(1)]).ring(|_| sector()).unwrap();
        assert_eq!(one.forces.iter().map(|force| force.amplitude).collect::<Vec<_>>(), [0.0, 2.0, 0.0]);
    }

    #[test]
    fn wrong_sectors_are_refused_with_their_element() {
        let wrong = |change: fn(&mut Model), around: SectorDistribution, sectors: usize| {
            let mut sector = sector();
            change(&mut sector);
            let error = disk(sectors, &[around]).ring(|_| sector.clone()).unwrap_err();
            (error.element, error.message)
        };
        let wave = SectorDistribution::EngineOrder(1);
        let (element, message) = wrong(|m| m.springs[0].between[1] = "next.disc".into(), wave, 3);
        assert_eq!((element, message.as_str()), (Element::Spring(0), "there is no place `disc` in a sector"));
        assert!(wrong(|m| m.springs[0].between[1] = "next.ground".into(), wave, 3).1.contains("`ground`"));
        assert!(wrong(|m| m.joints[0].between[0] = "blade.y".into(), wave, 3).1.contains("`blade.y`"));
        assert!(wrong(|m| m.masses[0].name = "next".into(), wave, 3).1.contains("`next` is reserved"));
        assert!(wrong(|m| m.forces[0].on = "next.blade.x".into(), wave, 3).1.contains("such as `blade.x`"));
        assert!(wrong(|_| {}, wave, 1).1.contains("at least 2 sectors"));
        assert!(wrong(|_| {}, SectorDistribution::Sector(3), 3).1.contains("from 0 to 2"));
        let mut moved = sector();
        moved.motions.push(Motion { on: "next.base".into(), amplitude: 1.0, phase: 0.0, harmonic: 1 });
        assert!(disk(3, &[wave]).ring(|_| moved.clone()).is_err());
    }
}
