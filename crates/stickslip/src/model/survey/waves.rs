//! The modes of a disk of equal sectors by their nodal diameters, with all joints free and with all of them stuck.
//!
//! In a wave a neighbour's displacement is that of the sector itself, turned: `x e^{jφ}`. With `x = (a, b)` in the complex plane a spring between
//! both is two, one along the real and one along the imaginary part of what it is stretched by, and the modes come in pairs, a wave either way.

use super::hold::{Hold, Stuck};
use super::linear::{LARGEST, Linear, Link};
use super::{LinearMode, Model, ModelError, Modes, System};
use crate::structure::{Sector, Structure, turn};
use std::collections::{BTreeMap, HashMap};
use stickslip_numerics::sparse::{Analysis, Matrix, NaturalModes, Wanted};

/// The modes of one nodal diameter.
#[derive(Debug, Clone, PartialEq)]
pub struct WaveModes {
    /// The nodal diameter, from 0 to half the number of sectors.
    pub diameter: usize,
    /// With all joints free. Of a wave that travels either way each mode stands once.
    pub free: Modes,
    /// With all joints stuck.
    pub stuck: Modes,
}

type Row = Vec<(usize, f64)>;

/// A direction over the ring as it acts in a wave: along the real and, if the wave has one, the imaginary part.
struct Turned {
    dofs: usize,
    sectors: usize,
    diameter: usize,
    double: bool,
}

impl Turned {
    fn rows(&self, at: &[(usize, f64)]) -> Vec<Row> {
        let mut parts = [BTreeMap::new(), BTreeMap::new()];
        for &(row, weight) in at {
            let (i, sector) = (row % self.dofs, row / self.dofs);
            let phase = turn((self.diameter * sector) as i64, self.sectors) * weight;
            let entries = [[(i, phase.re), (self.dofs + i, -phase.im)], [(i, phase.im), (self.dofs + i, phase.re)]];
            for (part, entries) in parts.iter_mut().zip(entries) {
                for (i, weight) in entries {
                    *part.entry(i).or_insert(0.0) += weight;
                }
            }
        }
        let copies = if self.double { 2 } else { 1 };
        let row = |part: BTreeMap<usize, f64>| -> Row {
            part.into_iter().filter(|(i, weight)| *weight != 0.0 && *i < copies * self.dofs).collect()
        };
        parts.into_iter().take(copies).map(row).filter(|row| !row.is_empty()).collect()
    }
}

impl Model {
    /// The `lowest` modes of a ring of equal sectors by nodal diameter; `None` if the model is none, or if its sectors are too large. Sectors by
    /// their matrices may be large, if no joint is rigid.
    ///
    /// # Errors
    /// [`ModelError`] as [`Model::assemble`].
    ///
    /// # Example
    /// Blades on springs of 1 N/m, and of 0.2 N/m between them: `ω² = k + 2 kc (1 - cos θ)`.
    /// ```
    /// use stickslip::model::Disk;
    /// use stickslip::{GROUND, Mass, Model, Spring};
    /// let spring = |other: &str, stiffness| Spring { between: ["b".into(), other.into()], stiffness, damping: 0.0 };
    /// let sector = Model {
    ///     masses: vec![Mass::new("b", 1.0)],
    ///     springs: vec![spring(GROUND, 1.0), spring("next.b", 0.2)],
    ///     ..Model::default()
    /// };
    /// let ring = Disk { sectors: 12, ..Disk::default() }.ring(|_| sector.clone()).unwrap();
    /// let waves = ring.wave_modes(1).unwrap().unwrap();
    /// assert_eq!(waves.len(), 7);
    /// assert!((waves[3].free.elastic[0].omega - 1.4f64.sqrt()).abs() < 1e-12);
    /// ```
    pub fn wave_modes(&self, lowest: usize) -> Result<Option<Vec<WaveModes>>, ModelError> {
        let Some(ring) = self.ring.filter(|ring| ring.equal) else { return Ok(None) };
        let system = self.assemble()?;
        let (sectors, n) = (ring.sectors, system.dofs() / ring.sectors);
        if self.substructure.is_some() {
            return Ok(of_matrices(&system, sectors, lowest));
        }
        if n == 0 || 2 * n > LARGEST {
            return Ok(None);
        }
        let index: HashMap<&str, usize> = system.places().iter().enumerate().map(|(i, p)| (p.as_str(), i)).collect();
        let ends = |between: &[String; 2]| -> Row {
            let ends = between.iter().zip([1.0, -1.0]);
            let rows = ends.filter_map(|(name, sign)| Some((system.seen()[*index.get(name.as_str())?].rows(), sign)));
            rows.flat_map(|(rows, sign)| rows.iter().map(move |(row, weight)| (*row, sign * weight))).collect()
        };
        let springs = &self.springs[..self.springs.len() / sectors];
        let joints = &system.joints()[..system.joints().len() / sectors];
        let stuck: Vec<Stuck> = joints.iter().enumerate().flat_map(Stuck::of_joint).collect();
        let own: Vec<f64> = (0..n).map(|i| system.structure().own_mass(i)).collect();
        let wave = |diameter: usize| {
            let double = !(2 * diameter).is_multiple_of(sectors);
            let turned = Turned { dofs: n, sectors, diameter, double };
            let mass = if double { [own.clone(), own.clone()].concat() } else { own.clone() };
            let link = |at: &[(usize, f64)], stiffness: f64, damping: f64| -> Vec<Link> {
                turned.rows(at).into_iter().map(|at| Link { at, stiffness, damping }).collect()
            };
            let free: Vec<Link> =
                springs.iter().flat_map(|s| link(&ends(&s.between), s.stiffness, s.damping)).collect();
            let (mut held, mut rigid) = (Vec::new(), Vec::new());
            for joint in &stuck {
                match joint.hold {
                    Hold::Nothing => {}
                    Hold::Spring { stiffness, .. } => held.extend(link(&joint.at, stiffness, 0.0)),
                    Hold::Rigid { .. } => rigid.extend(turned.rows(&joint.at)),
                }
            }
            let once = |linear: Linear| once(linear.modes, double, lowest);
            let rigid: Vec<&[(usize, f64)]> = rigid.iter().map(Vec::as_slice).collect();
            WaveModes {
                diameter,
                free: once(Linear::new(&mass, &free.iter().collect::<Vec<_>>(), &[])),
                stuck: once(Linear::new(&mass, &free.iter().chain(&held).collect::<Vec<_>>(), &rigid)),
            }
        };
        Ok(Some((0..=sectors / 2).map(wave).collect()))
    }
}

/// Each mode of a wave that travels either way once, and the lowest of them.
fn once(mut modes: Modes, double: bool, lowest: usize) -> Modes {
    if double {
        modes.elastic = modes.elastic.into_iter().step_by(2).collect();
        (modes.rigid, modes.lost) = (modes.rigid / 2, modes.lost / 2);
    }
    modes.elastic.truncate(lowest);
    modes
}

/// The modes of the waves of equal sectors that are stated by their matrices.
fn of_matrices(system: &System, sectors: usize, lowest: usize) -> Option<Vec<WaveModes>> {
    let sector = Sector::of(system.structure(), sectors)?;
    let joints = &system.joints()[..system.joints().len() / sectors];
    let stuck: Vec<Stuck> = joints.iter().enumerate().flat_map(Stuck::of_joint).collect();
    let wave = |diameter: usize| {
        let wave = sector.wave(diameter).ok()?;
        let (structure, double) = (wave.structure(), wave.is_double());
        let turned = Turned { dofs: sector.dofs(), sectors, diameter, double };
        let (mut held, mut rigid) = (Vec::new(), Vec::new());
        for joint in &stuck {
            match joint.hold {
                Hold::Nothing => {}
                Hold::Spring { stiffness, .. } => {
                    held.extend(turned.rows(&joint.at).into_iter().map(|at| Link { at, stiffness, damping: 0.0 }));
                }
                Hold::Rigid { .. } => rigid.extend(turned.rows(&joint.at)),
            }
        }
        let modes = |links: &[Link], rigid: &[Row]| -> Option<Modes> {
            if structure.dofs() <= LARGEST {
                let rigid: Vec<&[(usize, f64)]> = rigid.iter().map(Vec::as_slice).collect();
                return Some(once(Linear::of_matrices(structure.full(), links, &rigid).modes, double, lowest));
            }
            if !rigid.is_empty() {
                return None;
            }
            Some(once(of_large(structure, links, if double { 2 * lowest } else { lowest })?, double, lowest))
        };
        Some(WaveModes { diameter, free: modes(&[], &[])?, stuck: modes(&held, &rigid)? })
    };
    (0..=sectors / 2).map(wave).collect()
}

/// The lowest modes of a large structure, each of a pair among them.
fn of_large(structure: &Structure, links: &[Link], count: usize) -> Option<Modes> {
    let n = structure.dofs();
    let part = |kind: usize, more: Vec<(usize, usize, f64)>| {
        let own = structure.entries().map(|(row, column, values)| (row, column, values[kind]));
        Matrix::from_triplets(n, own.filter(|entry| entry.2 != 0.0).chain(more)).ok()
    };
    let mut springs = Vec::new();
    for link in links {
        for &(i, a) in &link.at {
            springs.extend(link.at.iter().map(|&(k, b)| (i, k, link.stiffness * (a * b))));
        }
    }
    let (mass, damping, stiffness) = (part(0, Vec::new())?, part(1, Vec::new())?, part(2, springs)?);
    // free motions are none of the elastic ones that are asked for
    let wanted = Wanted::Lowest((count.saturating_add(FREE_AT_MOST)).min(n));
    let found = NaturalModes::new(&Analysis::new(&[&stiffness, &mass]), &stiffness, &mass, wanted).ok()?;
    let free = found.free();
    let mode = |k: usize| {
        let (omega, shape) = (found.values[k].max(0.0).sqrt(), found.shape(k));
        let power: f64 = damping.times(shape).iter().zip(shape).map(|(c, x)| c * x).sum();
        LinearMode { omega, damping: power / (2.0 * omega) }
    };
    Some(Modes { elastic: (free..found.count()).map(mode).collect(), rigid: free, lost: 0 })
}

/// Free motions of a body, twice: a wave either way.
const FREE_AT_MOST: usize = 12;

#[cfg(test)]
mod tests {
    use crate::law::{Coulomb, Jenkins, SharedLaw};
    use crate::model::{Disk, Joint, Mass, Model, Spring};
    use std::sync::Arc;

    fn sector(law: SharedLaw) -> Model {
        let between = |a: &str, b: &str| [a.to_owned(), b.to_owned()];
        let spring = |a: &str, b: &str, stiffness| Spring { between: between(a, b), stiffness, damping: 0.01 };
        Model {
            masses: vec![Mass::new("disk", 2.0), Mass::new("blade", 0.3)],
            springs: vec![spring("disk", "next.disk", 20.0), spring("blade", "disk", 3.0)],
            joints: vec![Joint { name: "shroud".into(), between: between("blade", "next.blade"), law }],
            ..Model::default()
        }
    }

    /// All modes of the ring, each diameter between the first and the last counted twice, and no others; with springs and with rigid friction, and
    /// with a disk that is free to turn.
    #[test]
    fn waves_are_the_modes_of_the_ring() {
        for law in [Arc::new(Jenkins { stiffness: 2.0, limit: 1.0 }) as SharedLaw, Arc::new(Coulomb { limit: 1.0 })] {
            for sectors in [2, 3, 8, 9] {
                let sector = sector(law.clone());
                let ring = Disk { sectors, ..Disk::default() }.ring(|_| sector.clone()).unwrap();
                let (survey, waves) = (ring.survey().unwrap(), ring.wave_modes(usize::MAX).unwrap().unwrap());
                for stuck in [false, true] {
                    let mut all = Vec::new();
                    let mut drifts = 0;
                    for wave in &waves {
                        let modes = if stuck { &wave.stuck } else { &wave.free };
                        let times = if 2 * wave.diameter % sectors == 0 { 1 } else { 2 };
                        all.extend(modes.elastic.iter().flat_map(|mode| vec![mode.omega; times]));
                        drifts += times * modes.rigid;
                    }
                    all.sort_by(f64::total_cmp);
                    let whole = if stuck { survey.stuck() } else { survey.free() };
                    assert_eq!(
                        (all.len(), drifts),
                        (whole.elastic.len(), whole.rigid),
                        "{} {sectors} {stuck}",
                        law.name()
                    );
                    for (a, b) in all.iter().zip(&whole.elastic) {
                        assert!((a / b.omega - 1.0).abs() < 1e-9, "{} {sectors} {stuck}: {a} {}", law.name(), b.omega);
                    }
                }
            }
        }
    }
}
