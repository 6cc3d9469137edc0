//! The modes of a disk of equal sectors by their nodal diameters, with all joints free and with all of them stuck.
//!
//! In a wave a neighbour's displacement is that of the sector itself, turned: `x e^{jφ}`. With `x = (a, b)` in the complex plane a spring between
//! both is two, one along the real and one along the imaginary part of what it is stretched by, and the modes come in pairs, a wave either way.

use super::hold::{Hold, Stuck};
use super::linear::{LARGEST, Linear, Link};
use super::{Model, ModelError, Modes};
use crate::structure::turn;
use std::collections::{BTreeMap, HashMap};

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
    /// The modes of a ring of equal sectors by nodal diameter; `None` if the model is none, or if its sectors are too large.
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
    /// let waves = ring.wave_modes().unwrap().unwrap();
    /// assert_eq!(waves.len(), 7);
    /// assert!((waves[3].free.elastic[0].omega - 1.4f64.sqrt()).abs() < 1e-12);
    /// ```
    pub fn wave_modes(&self) -> Result<Option<Vec<WaveModes>>, ModelError> {
        let Some(ring) = self.ring.filter(|ring| ring.equal) else { return Ok(None) };
        let system = self.assemble()?;
        let (sectors, n) = (ring.sectors, system.dofs() / ring.sectors);
        if n == 0 || 2 * n > LARGEST {
            return Ok(None);
        }
        let index: HashMap<&str, usize> = system.places().iter().enumerate().map(|(i, p)| (p.as_str(), i)).collect();
        let ends = |between: &[String; 2]| -> Row {
            let ends = between.iter().zip([1.0, -1.0]);
            ends.filter_map(|(name, sign)| Some((*index.get(name.as_str())?, sign))).collect()
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
            let once = |linear: Linear| {
                let mut modes = linear.modes;
                if double {
                    modes.elastic = modes.elastic.into_iter().step_by(2).collect();
                    (modes.rigid, modes.lost) = (modes.rigid / 2, modes.lost / 2);
                }
                modes
            };
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
                let (survey, waves) = (ring.survey().unwrap(), ring.wave_modes().unwrap().unwrap());
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
