//! Modes of a disk of equal sectors by nodal diameter, with all joints free and with all joints
//! stuck.
//!
//! In a wave, the displacement of the next sector is that of the sector itself times a phase
//! factor: `x e^{jφ}`. With `x = a + jb` and the real vector `(a, b)`, a spring between both
//! sectors becomes two springs: one along the real part and one along the imaginary part of its
//! elongation. The modes then occur in pairs, one for each direction of travel.

use super::linear_modes::{LinearStructure, MAX_DOFS, SpringDamper, separate_by_damping};
use super::stuck_joint::{StuckAxis, StuckState};
use super::{LinearModes, Model, ModelError, NaturalMode, System, relative_displacement};
use crate::model::{Body, Mass, Place};
use crate::structure::reduction::Row;
use crate::structure::{Structure, unit_root};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::collections::{BTreeMap, HashMap};
use stickslip_numerics::sparse::{ModeSelection, NaturalModes, SparseMatrix, SymbolicAnalysis};
use stickslip_numerics::tie_break::first_largest;

/// The modes of one nodal diameter.
#[derive(Debug, Clone, PartialEq)]
pub struct WaveModes {
    /// The nodal diameter, from 0 to half the number of sectors.
    pub diameter: usize,
    /// Modes with all joints free. Modes of travelling waves occur in pairs; each pair is
    /// listed once.
    pub free: LinearModes,
    /// Modes with all joints stuck.
    pub stuck: LinearModes,
    /// Shapes of the modes of `free`, [mode][place of the sector] in the order of
    /// [`Model::sector_places`], 1/√kg.
    ///
    /// In sector n of N, the displacement of a standing wave is the real part of
    /// `shape · e^{j 2π diameter n/N}`, with `φᵀMφ = 1` for the whole disk. The place with the
    /// largest motion in the first sector is real and positive. Empty if the stiffnesses are
    /// too different for one eigenvalue problem.
    pub free_shapes: Vec<Vec<Complex64>>,
    /// Shapes of the modes of `stuck`, in the same form.
    pub stuck_shapes: Vec<Vec<Complex64>>,
    /// The shapes of `free` over the degrees of freedom of the first sector.
    pub free_motions: Vec<Vec<Complex64>>,
    /// The shapes of `stuck` over the degrees of freedom of the first sector.
    pub stuck_motions: Vec<Vec<Complex64>>,
}

/// Converts a direction over the ring into its form in a wave: the real part and, for a complex
/// wave, the imaginary part.
struct WaveRows {
    dofs: usize,
    sectors: usize,
    diameter: usize,
    double: bool,
}

impl WaveRows {
    fn rows(&self, at: &[(usize, f64)]) -> Vec<Row> {
        let mut parts = [BTreeMap::new(), BTreeMap::new()];
        for &(row, weight) in at {
            let (i, sector) = (row % self.dofs, row / self.dofs);
            let phase = unit_root((self.diameter * sector) as i64, self.sectors) * weight;
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

    /// Returns the springs and dampers along the rows of the wave.
    fn links(&self, at: &[(usize, f64)], stiffness: f64, damping: f64) -> Vec<SpringDamper> {
        self.rows(at).into_iter().map(|at| SpringDamper { at, stiffness, damping }).collect()
    }

    /// Returns the dampers of the free joints, and the links and rigid directions of the stuck
    /// ones.
    fn joint_links(&self, joints: &[StuckAxis]) -> (Vec<SpringDamper>, Vec<SpringDamper>, Vec<Row>) {
        let of = |one: SpringDamper| self.links(&one.at, one.stiffness, one.damping);
        let dampers = joints.iter().filter_map(StuckAxis::free_link).flat_map(of).collect();
        let (mut held, mut rigid) = (Vec::new(), Vec::new());
        for joint in joints {
            match joint.state {
                StuckState::Nothing if joint.closed > 0.0 => held.extend(self.links(&joint.at, joint.closed, 0.0)),
                StuckState::Nothing | StuckState::Spring { .. } => {
                    held.extend(joint.stuck_link().into_iter().flat_map(of));
                }
                StuckState::Rigid { .. } => rigid.extend(self.rows(&joint.at)),
            }
        }
        (dampers, held, rigid)
    }

    /// Combines the modes of both joint states, with shapes at the places.
    fn modes(&self, free: SelectedModes, stuck: SelectedModes, places: &[Row]) -> WaveModes {
        let normalized = |shapes: &[DVector<f64>]| shapes.iter().map(|shape| self.normalized(shape, places)).unzip();
        let (free_shapes, free_motions) = normalized(&free.shapes);
        let (stuck_shapes, stuck_motions) = normalized(&stuck.shapes);
        WaveModes {
            diameter: self.diameter,
            free_shapes,
            stuck_shapes,
            free_motions,
            stuck_motions,
            free: free.modes,
            stuck: stuck.modes,
        }
    }

    /// Selects the lowest modes, one from each pair of travelling waves. `weigh` is the product
    /// with the mass matrix of `(a, b)`.
    ///
    /// A mode `x` of a travelling wave has the partner `jx`. The eigenvalue solution returns
    /// two directions of their plane. For several equal modes, it returns directions of a
    /// larger space. This function splits that space into orthogonal complex shapes.
    fn select_modes(
        &self,
        mut modes: LinearModes,
        shapes: Option<DMatrix<f64>>,
        lowest: usize,
        weigh: &dyn Fn(&DVector<f64>) -> DVector<f64>,
    ) -> SelectedModes {
        let columns = |shapes: DMatrix<f64>| -> Vec<DVector<f64>> {
            shapes.column_iter().take(lowest).map(|shape| shape.into_owned()).collect()
        };
        if !self.double {
            modes.elastic.truncate(lowest);
            return SelectedModes { modes, shapes: shapes.map_or_else(Vec::new, columns) };
        }
        (modes.rigid, modes.unresolved) = (modes.rigid / 2, modes.unresolved / 2);
        let most = lowest.min(modes.elastic.len() / 2);
        let split = shapes.and_then(|shapes| self.split(&modes.elastic, &shapes, most, weigh));
        let (kept, shapes) = split.unwrap_or_else(|| ((0..most).map(|mode| 2 * mode).collect(), Vec::new()));
        modes.elastic = kept.into_iter().map(|mode| modes.elastic[mode]).collect();
        SelectedModes { modes, shapes }
    }

    /// Selects `most` complex shapes from twice as many real ones. Returns their indices and
    /// orthogonal vectors `(a, b)`.
    fn split(
        &self,
        elastic: &[NaturalMode],
        shapes: &DMatrix<f64>,
        most: usize,
        weigh: &dyn Fn(&DVector<f64>) -> DVector<f64>,
    ) -> Option<(Vec<usize>, Vec<DVector<f64>>)> {
        let mut kept: Vec<usize> = Vec::new();
        // each shape x, with M x, j x and j M x
        let mut found: Vec<[DVector<f64>; 4]> = Vec::new();
        for (column, mode) in elastic.iter().enumerate() {
            if kept.len() == most {
                break;
            }
            let mut shape = shapes.column(column).into_owned();
            // Relative frequency distance within which modes can share an eigenspace. More
            // distant modes are orthogonal up to rounding. Modes of one pair differ by at most
            // 1e-6, even where frequencies have few significant digits.
            let near = |other: &&usize| mode.omega - elastic[**other].omega <= 1e-3 * mode.omega;
            let first = kept.len() - kept.iter().rev().take_while(near).count();
            for [own, weighed, turned, turned_weighed] in &found[first..] {
                let (along, across) = (weighed.dot(&shape), turned_weighed.dot(&shape));
                shape.axpy(-along, own, 1.0);
                shape.axpy(-across, turned, 1.0);
            }
            let weighed = weigh(&shape);
            let left = weighed.dot(&shape);
            // Fraction of a shape's square that remains after projection on the earlier shapes
            // and marks a new shape. For the partner in a pair, only rounding remains. Of up to
            // six equal modes, some shape always has more.
            if left >= 0.25 {
                let (shape, weighed) = (shape / left.sqrt(), weighed / left.sqrt());
                let turned = self.times_j(&shape);
                let turned_weighed = self.times_j(&weighed);
                kept.push(column);
                found.push([shape, weighed, turned, turned_weighed]);
            }
        }
        (kept.len() == most).then(|| (kept, found.into_iter().map(|[shape, ..]| shape).collect()))
    }

    /// Returns `j (a + jb)`, the same motion a quarter of a period earlier. The mass matrix of
    /// the wave is invariant under this shift.
    fn times_j(&self, shape: &DVector<f64>) -> DVector<f64> {
        let n = self.dofs;
        DVector::from_fn(2 * n, |i, _| if i < n { -shape[n + i] } else { shape[i - n] })
    }

    /// Returns a sector's shape with `aᵀMa + bᵀMb = 1`, normalized as in [`WaveModes`]: at the
    /// places, and over the degrees of freedom.
    fn normalized(&self, shape: &DVector<f64>, places: &[Row]) -> (Vec<Complex64>, Vec<Complex64>) {
        let n = self.dofs;
        // the squares of a cosine over the sectors sum to half their number
        let scale = (if self.double { 2.0 } else { 1.0 } / self.sectors as f64).sqrt();
        let whole = |i: usize| Complex64::new(shape[i], if self.double { shape[n + i] } else { 0.0 }) * scale;
        let at = |place: &Row| -> Complex64 {
            let term = |(row, weight): &(usize, f64)| {
                whole(row % n) * unit_root((self.diameter * (row / n)) as i64, self.sectors) * *weight
            };
            place.iter().map(term).sum()
        };
        let mut at: Vec<Complex64> = places.iter().map(at).collect();
        let mut motion: Vec<Complex64> = (0..n).map(whole).collect();
        let first = first_largest(at.iter().map(|x| x.norm())).map(|first| at[first]);
        if let Some(first) = first.filter(|first| first.norm() > 0.0) {
            at.iter_mut().chain(&mut motion).for_each(|x| *x *= first.conj() / first.norm());
        }
        (at, motion)
    }
}

/// The modes of a wave, each once, with their shapes `(a, b)` if they are known.
struct SelectedModes {
    modes: LinearModes,
    shapes: Vec<DVector<f64>>,
}

impl Model {
    /// Returns the `lowest` modes of a ring of equal sectors by nodal diameter.
    ///
    /// Returns `None` if the model is not a ring of equal sectors, or if its sectors are too
    /// large. Sectors given by matrices may be large if no joint is rigid.
    ///
    /// # Errors
    /// See [`Model::assemble`].
    ///
    /// # Example
    /// Blades on springs of 1 N/m, and of 0.2 N/m between them: `ω² = k + 2 kc (1 - cos θ)`.
    /// ```
    /// use stickslip::model::Disk;
    /// use stickslip::{GROUND, Mass, Model, Spring};
    /// let spring = |other: &str, stiffness| Spring {
    ///     between: ["b".into(), other.into()],
    ///     stiffness,
    ///     damping: 0.0,
    /// };
    /// let sector = Model {
    ///     masses: vec![Mass::new("b", 1.0)],
    ///     springs: vec![spring(GROUND, 1.0), spring("next.b", 0.2)],
    ///     ..Model::default()
    /// };
    /// let ring = Disk { sectors: 12, ..Disk::default() }.ring(|_| sector.clone()).unwrap();
    /// let waves = ring.wave_modes(1).unwrap().unwrap();
    /// assert_eq!(waves.len(), 7);
    /// assert!((waves[3].free.elastic[0].omega - 1.4f64.sqrt()).abs() < 1e-12);
    /// // cos(2π 3n/12) has the squares 1, 0, 1, 0 …, six in all
    /// assert!((waves[3].free_shapes[0][0].re - (1.0f64 / 6.0).sqrt()).abs() < 1e-12);
    /// ```
    pub fn wave_modes(&self, lowest: usize) -> Result<Option<Vec<WaveModes>>, ModelError> {
        if !self.ring.is_some_and(|ring| ring.equal) {
            return Ok(None);
        }
        Ok(self.wave_modes_of(&self.assemble()?, lowest))
    }

    /// Returns the modes of [`Model::wave_modes`] for the assembled model.
    pub fn wave_modes_of(&self, system: &System, lowest: usize) -> Option<Vec<WaveModes>> {
        let ring = self.ring.filter(|ring| ring.equal)?;
        let (sectors, n) = (ring.sectors, system.dofs() / ring.sectors);
        if self.substructure.is_some() || self.moves_bodies() {
            return of_matrices(system, sectors, lowest, &self.sector_axes(system));
        }
        if n == 0 || 2 * n > MAX_DOFS {
            return None;
        }
        let ends = relative_displacement(system);
        let springs = &self.springs[..self.springs.len() / sectors];
        let joints = &system.joints()[..system.joints().len() / sectors];
        let stuck: Vec<StuckAxis> =
            joints.iter().enumerate().flat_map(|(i, joint)| StuckAxis::of_joint(i, joint, &**joint.law())).collect();
        let own: Vec<f64> = (0..n).map(|i| system.structure().diagonal_mass(i)).collect();
        let places = self.sector_axes(system);
        let wave = |diameter: usize| {
            let double = !(2 * diameter).is_multiple_of(sectors);
            let turned = WaveRows { dofs: n, sectors, diameter, double };
            let mass = if double { [own.clone(), own.clone()].concat() } else { own.clone() };
            let springs: Vec<SpringDamper> =
                springs.iter().flat_map(|s| turned.links(&ends(&s.between), s.stiffness, s.damping)).collect();
            let (dampers, held, rigid) = turned.joint_links(&stuck);
            let weigh = |x: &DVector<f64>| x.component_mul(&DVector::from_column_slice(&mass));
            let once = |linear: LinearStructure| turned.select_modes(linear.modes, linear.shapes, lowest, &weigh);
            let rigid: Vec<&[(usize, f64)]> = rigid.iter().map(Vec::as_slice).collect();
            let free_ones = once(LinearStructure::new(&mass, &springs.iter().chain(&dampers).collect::<Vec<_>>(), &[]));
            let stuck_ones =
                once(LinearStructure::new(&mass, &springs.iter().chain(&held).collect::<Vec<_>>(), &rigid));
            turned.modes(free_ones, stuck_ones, &places)
        };
        Some((0..=sectors / 2).map(wave).collect())
    }

    /// Returns the places of the first sector of a disk, with their names in the ring. Empty if
    /// the model is not a disk.
    pub fn sector_places(&self) -> Vec<String> {
        let Some(ring) = self.ring else { return Vec::new() };
        let own = |all: usize| all / ring.sectors.max(1);
        let places = self.places[..own(self.places.len())].iter().flat_map(Place::places);
        let masses = self.masses[..own(self.masses.len())].iter().flat_map(Mass::places);
        places.chain(masses).chain(self.bodies[..own(self.bodies.len())].iter().flat_map(Body::places)).collect()
    }

    /// Returns the places of the first sector as weighted sums of the ring's coordinates.
    fn sector_axes(&self, system: &System) -> Vec<Row> {
        let index: HashMap<&str, usize> = system.places().iter().enumerate().map(|(i, p)| (p.as_str(), i)).collect();
        let seen =
            |name: String| index.get(name.as_str()).map_or_else(Vec::new, |i| system.place_axes()[*i].rows().to_vec());
        self.sector_places().into_iter().map(seen).collect()
    }
}

/// Returns the modes of the waves of equal sectors given by matrices.
fn of_matrices(system: &System, sectors: usize, lowest: usize, places: &[Row]) -> Option<Vec<WaveModes>> {
    let sector = system.structure().ring_sector(sectors)?;
    let joints = &system.joints()[..system.joints().len() / sectors];
    let stuck: Vec<StuckAxis> =
        joints.iter().enumerate().flat_map(|(i, joint)| StuckAxis::of_joint(i, joint, &**joint.law())).collect();
    let wave = |diameter: usize| {
        let wave = sector.wave(diameter).ok()?;
        let (structure, double) = (wave.structure(), wave.is_double());
        let turned = WaveRows { dofs: sector.dofs(), sectors, diameter, double };
        let (dampers, held, rigid) = turned.joint_links(&stuck);
        let modes = |links: &[SpringDamper], rigid: &[Row]| -> Option<SelectedModes> {
            if structure.dofs() <= MAX_DOFS {
                let rigid: Vec<&[(usize, f64)]> = rigid.iter().map(Vec::as_slice).collect();
                let LinearStructure { modes, shapes, .. } =
                    LinearStructure::of_wave(structure.full(), &links.iter().collect::<Vec<_>>(), &rigid);
                return Some(turned.select_modes(modes, shapes, lowest, &|x| &structure.full().mass * x));
            }
            if !rigid.is_empty() {
                return None;
            }
            let (mass, modes, shapes) =
                of_large(structure, links, if double { lowest.saturating_mul(2) } else { lowest })?;
            Some(turned.select_modes(modes, Some(shapes), lowest, &|x| DVector::from_vec(mass.multiply(x.as_slice()))))
        };
        Some(turned.modes(modes(&dampers, &[])?, modes(&held, &rigid)?, places))
    };
    (0..=sectors / 2).map(wave).collect()
}

/// Returns the mass matrix and the lowest modes of a large structure, with both modes of each
/// pair and their shapes.
fn of_large(
    structure: &Structure,
    links: &[SpringDamper],
    count: usize,
) -> Option<(SparseMatrix, LinearModes, DMatrix<f64>)> {
    let n = structure.dofs();
    let part = |kind: usize, more: Vec<(usize, usize, f64)>| {
        let own = structure.entries().map(|(row, column, values)| (row, column, values[kind]));
        SparseMatrix::from_triplets(n, own.filter(|entry| entry.2 != 0.0).chain(more)).ok()
    };
    let along = |value: fn(&SpringDamper) -> f64| {
        let entries = |link: &SpringDamper| {
            let pairs = link.at.iter().flat_map(|&(i, a)| link.at.iter().map(move |&(k, b)| (i, k, a * b)));
            pairs.map(|(i, k, weight)| (i, k, value(link) * weight)).collect::<Vec<_>>()
        };
        links.iter().filter(|link| value(link) != 0.0).flat_map(entries).collect::<Vec<_>>()
    };
    let mass = part(0, Vec::new())?;
    let (damping, stiffness) = (part(1, along(|link| link.damping))?, part(2, along(|link| link.stiffness))?);
    // free motions come on top of the requested elastic modes
    // Largest number of free motions: six of a body, twice for both directions of travel.
    let wanted = ModeSelection::Lowest((count.saturating_add(12)).min(n));
    let found = NaturalModes::new(&SymbolicAnalysis::new(&[&stiffness, &mass]), &stiffness, &mass, wanted).ok()?;
    let free = found.rigid_body_count();
    let power = |shape: &DVector<f64>| {
        let power = damping.multiply(shape.as_slice()).iter().zip(shape).map(|(c, x)| c * x).sum::<f64>();
        power + structure.damped_modes().map_or(0.0, |modes| modes.power(shape.as_slice()))
    };
    let squares = &found.values[free..found.count()];
    let mut shapes = DMatrix::from_fn(n, squares.len(), |row, k| found.shape(free + k)[row]);
    separate_by_damping(squares, &mut shapes, power);
    let mode = |(k, square): (usize, &f64)| {
        let omega = square.max(0.0).sqrt();
        NaturalMode { omega, damping: power(&shapes.column(k).into_owned()) / (2.0 * omega) }
    };
    let modes = LinearModes { elastic: squares.iter().enumerate().map(mode).collect(), rigid: free, unresolved: 0 };
    Some((mass, modes, shapes))
}

#[cfg(test)]
mod tests {
    use crate::law::{Coulomb, Jenkins, SharedLaw};
    use crate::model::{Disk, Joint, Mass, Model, Spring};
    use crate::structure::unit_root;
    use nalgebra::{DMatrix, DVector};
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

    /// The waves have all modes of the ring and no others. Each diameter between the first and
    /// the last counts twice. The test covers springs, rigid friction, and a disk that is free
    /// to rotate.
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

    /// The shapes of a chain around a ring are cosines, `√(2/(N m)) cos(2π d n/N)`, and
    /// `√(1/(N m))` if the wave does not travel.
    #[test]
    fn shapes_of_a_chain_are_cosines() {
        let between = |other: &str| ["blade".to_owned(), other.to_owned()];
        let spring = |other: &str, stiffness| Spring { between: between(other), stiffness, damping: 0.0 };
        let model = Model {
            masses: vec![Mass::new("blade", 0.3)],
            springs: vec![spring("ground", 3.0), spring("next.blade", 2.0)],
            ..Model::default()
        };
        let ring = Disk { sectors: 8, ..Disk::default() }.ring(|_| model.clone()).unwrap();
        assert_eq!(ring.sector_places(), ["blade_0"]);
        for wave in ring.wave_modes(4).unwrap().unwrap() {
            let waves = if [0, 4].contains(&wave.diameter) { 1.0 } else { 2.0 };
            let [shape] = &wave.free_shapes[..] else { panic!("{wave:?}") };
            assert!((shape[0] - (waves / (8.0 * 0.3f64)).sqrt()).norm() < 1e-12, "{wave:?}");
        }
    }

    /// Compares the sums of `φφᵀ` for every frequency of the ring. The first is over the
    /// eigenvectors of the whole ring. The second is over the standing waves,
    /// `Re(X e^{j 2π d n/N})` and the wave shifted by a quarter.
    ///
    /// This checks shapes, phases and `φᵀMφ = 1` together. Two uncoupled blades in a sector
    /// form pairs of pairs, which the solver must separate.
    #[test]
    fn shapes_are_those_of_the_ring() {
        let between = |a: &str, b: &str| [a.to_owned(), b.to_owned()];
        let mut twins = sector(Arc::new(Jenkins { stiffness: 2.0, limit: 1.0 }));
        twins.masses.push(Mass::new("twin", 0.3));
        twins.masses.remove(0);
        twins.springs = ["blade", "twin"]
            .into_iter()
            .flat_map(|name| {
                [("ground".to_owned(), 3.0), (format!("next.{name}"), 2.0)].map(|(other, stiffness)| Spring {
                    between: between(name, &other),
                    stiffness,
                    damping: 0.0,
                })
            })
            .collect();
        twins.joints.clear();
        for (sector, sectors) in
            [(sector(Arc::new(Jenkins { stiffness: 2.0, limit: 1.0 })), 9), (twins.clone(), 6), (twins, 7)]
        {
            let ring = Disk { sectors, ..Disk::default() }.ring(|_| sector.clone()).unwrap();
            // in the stuck state, the joint is a spring
            let mut stuck = ring.clone();
            stuck.springs.extend(stuck.joints.drain(..).map(|joint| Spring {
                between: joint.between,
                stiffness: 2.0,
                damping: 0.0,
            }));
            let waves = ring.wave_modes(usize::MAX).unwrap().unwrap();
            for (whole, state) in [(&ring, 0), (&stuck, 1)] {
                let system = whole.assemble().unwrap();
                let full = system.structure().full();
                let root = full.mass.map(|m| if m > 0.0 { 1.0 / m.sqrt() } else { 0.0 });
                let eigen = (&root * &full.stiffness * &root).symmetric_eigen();
                let n = root.nrows();
                let mut checked = 0;
                for wave in &waves {
                    let (modes, shapes) = [(&wave.free, &wave.free_shapes), (&wave.stuck, &wave.stuck_shapes)][state];
                    assert_eq!(modes.elastic.len(), shapes.len());
                    for mode in &modes.elastic {
                        let same = |omega: f64| (omega / mode.omega - 1.0).abs() < 1e-7;
                        let mut sum = DMatrix::zeros(n, n);
                        for (i, square) in eigen.eigenvalues.iter().enumerate().filter(|(_, w)| same(w.abs().sqrt())) {
                            assert!(*square > 0.0);
                            let shape = &root * eigen.eigenvectors.column(i);
                            sum += &shape * shape.transpose();
                        }
                        assert!(sum.amax() > 0.0);
                        for other in &waves {
                            let (modes, shapes) =
                                [(&other.free, &other.free_shapes), (&other.stuck, &other.stuck_shapes)][state];
                            for (_, shape) in modes.elastic.iter().zip(shapes).filter(|(mode, _)| same(mode.omega)) {
                                for quarter in 0..if 2 * other.diameter % sectors == 0 { 1 } else { 2 } {
                                    let at = |row: usize| {
                                        let place = row % shape.len();
                                        let turned = shape[place]
                                            * unit_root((other.diameter * (row / shape.len())) as i64, sectors);
                                        [turned.re, turned.im][quarter]
                                    };
                                    let whole = DVector::from_fn(n, |row, _| at(row));
                                    sum -= &whole * whole.transpose();
                                }
                            }
                        }
                        assert!(sum.amax() < 1e-9, "{sectors} {state} {}: {}", wave.diameter, sum.amax());
                        checked += 1;
                    }
                }
                assert!(checked >= sectors, "{checked}");
            }
        }
    }
}
