//! Assembles a system from a model: checks, and the matrices of
//! `M x'' + C x' + K x + Σ W f = F(t)`.

use super::coordinates::{Coordinates, merge_duplicates};
use super::error::{Element, ModelError};
use super::name_resolution::{PlaceSource, PlaceTarget, Places};
use super::place::places_of;
use super::substructure::{Entries, RingEntries};
use super::system::{Axis, MovedPlace, System, SystemBuilder};
use super::{GROUND, Joint, Model, Ring};
use crate::structure::reduction::Row;
use crate::structure::{ModalDamping, RingSector, Structure, sector_entries};
use nalgebra::DVector;
use num_complex::Complex64;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;
use stickslip_numerics::sparse::SparseMatrix;

impl Model {
    /// Returns the names of all places: the ground, those of the nodes with their directions,
    /// the moved places.
    pub fn place_names(&self) -> Vec<String> {
        let mut names = vec![GROUND.to_owned()];
        names.extend(self.nodes().flat_map(|(name, directions)| places_of(name, directions)));
        let mut known: BTreeSet<String> =
            if self.motions.is_empty() { BTreeSet::new() } else { names.iter().cloned().collect() };
        names.extend(
            self.motions.iter().filter(|motion| known.insert(motion.on.clone())).map(|motion| motion.on.clone()),
        );
        names
    }

    /// Returns the labels of the axes of every joint in results: its name, or `joint.direction`
    /// for joints between nodes.
    ///
    /// # Example
    /// ```
    /// let couple = stickslip::model::example::blade_couple();
    /// assert_eq!(couple.joint_labels(), [["shroud"]]);
    /// ```
    pub fn joint_labels(&self) -> Vec<Vec<String>> {
        let places = self.place_names();
        let mut nodes: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        let displacements = places.iter().filter(|place| !self.is_rotation(place));
        for (node, along) in displacements.filter_map(|place| place.split_once('.')) {
            nodes.entry(node).or_default().push(along);
        }
        let labels = |joint: &Joint| {
            let directions = joint.between.iter().filter_map(|name| nodes.get(name.as_str())).find(|all| all.len() > 1);
            let label = |along: &&str| format!("{}.{along}", joint.name);
            directions.map_or_else(|| vec![joint.name.clone()], |directions| directions.iter().map(label).collect())
        };
        self.joints.iter().map(labels).collect()
    }

    /// Checks the model and assembles its matrices.
    ///
    /// # Errors
    /// [`ModelError`] names the first invalid element:
    ///
    /// - a name that is not an identifier or occurs twice
    /// - a place that does not exist
    /// - a value that is not finite or has the wrong sign
    /// - a force on a place that is not a degree of freedom
    /// - a law whose directions differ from those of the nodes at the joint
    ///
    /// # Example
    /// ```
    /// let system = stickslip::model::example::blade_couple().assemble().unwrap();
    /// assert_eq!(system.places(), ["blade1", "contact", "blade3"]);
    /// ```
    pub fn assemble(&self) -> Result<System, ModelError> {
        let places = Places::new(self)?;
        let mut coordinates = Coordinates::new(self, &places)?;
        let entries = std::mem::take(&mut coordinates.entries);
        let assembler = Assembler { model: self, places, coordinates };
        let matrices = assembler.matrices(entries)?;
        let motions = assembler.motions()?;
        let builder = System::builder(assembler.structure(&matrices)?).reduced(assembler.coordinates.reduced.clone());
        let builder =
            builder.earlier(self.substructure.as_ref().and_then(|substructure| substructure.earlier_reduction));
        let (builder, forces) = assembler.forces(assembler.add_places(builder))?;
        let builder = assembler.loads_of_motions(builder, &matrices, &motions);
        let (builder, signs) = assembler.joints(builder, &motions)?;
        let builder = assembler.moved(builder, &matrices, (&motions, &forces), &signs);
        let system = builder.build().map_err(|error| model_error(&error))?;
        // a ring that was edited after its creation can lack the symmetry; then the whole ring
        // is solved
        Ok(match self.ring.and_then(Ring::wave) {
            Some(wave) => system.clone().with_cyclic_symmetry(wave).unwrap_or(system),
            None => system,
        })
    }
}

/// Converts an error of the whole structure.
pub(super) fn model_error(error: &dyn fmt::Display) -> ModelError {
    ModelError::new(Element::Whole, "mass", error.to_string())
}

/// Intermediate data of the assembly.
struct Assembler<'a> {
    model: &'a Model,
    places: Places,
    coordinates: Coordinates,
}

/// Matrices over the free coordinates, followed by the moved coordinates.
struct AssembledMatrices {
    mass: SparseMatrix,
    damping: SparseMatrix,
    /// Damped modes, in addition to `damping`.
    modes: Option<ModalDamping>,
    stiffness: SparseMatrix,
}

impl AssembledMatrices {
    /// Returns an entry of the total damping.
    fn damping(&self, row: usize, column: usize) -> f64 {
        self.damping.get(row, column) + self.modes.as_ref().map_or(0.0, |modes| modes.get(row, column))
    }
}

/// Amplitudes of an imposed motion by harmonic.
type HarmonicAmplitudes = BTreeMap<u32, Complex64>;

impl Assembler<'_> {
    /// Returns the sum of places with the given signs, as weights of the free and then the
    /// moved coordinates.
    fn row_of(&self, ends: &[(PlaceTarget, f64)]) -> Row {
        let parts = ends.iter().flat_map(|(end, sign)| {
            let row: &[(usize, f64)] = match end {
                PlaceTarget::Ground => &[],
                PlaceTarget::At(place) => &self.coordinates.places[*place],
            };
            row.iter().map(move |(at, weight)| (*at, weight * sign))
        });
        merge_duplicates(parts.collect())
    }

    /// Checks that a spring connects two rotations or two displacements.
    fn check_same_kind(
        &self,
        between: &[String; 2],
        ends: [PlaceTarget; 2],
        element: Element,
    ) -> Result<(), ModelError> {
        let turns = ends.map(|end| self.places.is_rotation(end));
        if turns[0] == turns[1] || ends.contains(&PlaceTarget::Ground) {
            return Ok(());
        }
        let (angle, other) = if turns[0] { (&between[0], &between[1]) } else { (&between[1], &between[0]) };
        let message = format!(
            "`{angle}` is a rotation and `{other}` is a displacement, but a spring connects two rotations or two \
             displacements; for a lever, add a [[place]] of the body with `offset`"
        );
        Err(ModelError::new(element, "between", message))
    }

    /// Adds masses, springs and dampers to the entries of the substructure and the bodies.
    fn matrices(&self, entries: [Entries; 3]) -> Result<AssembledMatrices, ModelError> {
        let total = self.coordinates.free + self.coordinates.moved;
        for (i, mass) in self.model.masses.iter().enumerate() {
            finite_at_least_zero(mass.mass, Element::Mass(i), "mass", "kg")?;
        }
        let [mut mass, mut damping, mut stiffness] = entries;
        for (place, row) in self.places.stated.iter().zip(&self.coordinates.places) {
            if let PlaceSource::Own(own) = place.of {
                add_along(&mut mass, row, own);
            }
        }
        for (i, spring) in self.model.springs.iter().enumerate() {
            let element = Element::Spring(i);
            finite_at_least_zero(spring.stiffness, element, "stiffness", "N/m")?;
            if !spring.damping.is_finite() {
                let message = format!("must be a finite number in kg/s, found {}", spring.damping);
                return Err(ModelError::new(element, "damping", message));
            }
            let a = self.places.find(&spring.between[0], element, "between")?;
            let b = self.places.find(&spring.between[1], element, "between")?;
            check_distinct(&spring.between, element)?;
            self.check_same_kind(&spring.between, [a, b], element)?;
            let along = self.row_of(&[(a, 1.0), (b, -1.0)]);
            add_along(&mut stiffness, &along, spring.stiffness);
            add_along(&mut damping, &along, spring.damping);
        }
        let sum = |entries| SparseMatrix::from_triplets(total, entries).map_err(|error| model_error(&error));
        let modes = self.coordinates.modes.clone();
        Ok(AssembledMatrices { mass: sum(mass)?, damping: sum(damping)?, modes, stiffness: sum(stiffness)? })
    }

    /// Returns the structure of the free coordinates.
    fn structure(&self, matrices: &AssembledMatrices) -> Result<Structure, ModelError> {
        let Coordinates { free: n, moved, names, ring, .. } = &self.coordinates;
        if let Some(ring) = ring {
            return self.ring_structure(ring, matrices);
        }
        let block = |matrix: &SparseMatrix| {
            if *moved == 0 {
                return Ok(matrix.clone());
            }
            let free = matrix.entries().filter(|(row, column, _)| row < n && column < n);
            SparseMatrix::from_triplets(*n, free).map_err(|error| model_error(&error))
        };
        let (mass, damping) = (block(&matrices.mass)?, block(&matrices.damping)?);
        let structure = Structure::sparse(names.clone(), mass, damping, block(&matrices.stiffness)?);
        let structure = structure.map_err(|error| model_error(&error))?;
        Ok(match &matrices.modes {
            None => structure,
            Some(modes) if *moved == 0 => structure.with_damped_modes(modes),
            Some(modes) => {
                let free: Vec<f64> = modes.iter().flat_map(|column| &column[..*n]).copied().collect();
                structure.with_damped_modes(&ModalDamping::new(*n, Arc::new(free)))
            }
        })
    }

    /// Returns the structure of a ring without imposed motion, from its equal sectors and the
    /// masses and springs on them.
    fn ring_structure(&self, ring: &RingEntries, matrices: &AssembledMatrices) -> Result<Structure, ModelError> {
        let names = self.coordinates.names.clone();
        let more = [&matrices.mass, &matrices.damping, &matrices.stiffness];
        let found = more.map(|matrix| sector_entries(matrix, ring.sectors));
        let dofs = names.len() / ring.sectors;
        let structure = match found {
            [Some(mass), Some(damping), Some(stiffness)] => {
                let more = [mass, damping, stiffness];
                let all = std::array::from_fn(|k| ring.entries[k].iter().chain(&more[k]).copied());
                let sector = RingSector::from_entries(names[..dofs].to_vec(), ring.sectors, all);
                Structure::ring(names, sector)
            }
            // a ring that was edited after its creation
            _ => {
                let [mass, damping, stiffness] = ring.around(dofs);
                let sum = |own: Entries, more: &SparseMatrix| {
                    let all = own.into_iter().chain(more.entries());
                    SparseMatrix::from_triplets(names.len(), all).map_err(|error| model_error(&error))
                };
                let (mass, damping) = (sum(mass, more[0])?, sum(damping, more[1])?);
                let stiffness = sum(stiffness, more[2])?;
                Structure::sparse(names, mass, damping, stiffness)
            }
        };
        structure.map_err(|error| model_error(&error))
    }

    /// Adds the places of results: those without imposed motion.
    fn add_places(&self, mut builder: SystemBuilder) -> SystemBuilder {
        let without_results = &self.coordinates.without_results;
        for ((place, row), without_results) in
            self.places.stated.iter().zip(&self.coordinates.places).zip(without_results)
        {
            if !place.moved && !without_results {
                let axis = self.axis(row).0;
                let axis = match place.radius {
                    Some(radius) => axis.as_rotation(radius),
                    None => axis,
                };
                builder = builder.place(place.name.clone(), axis);
            }
        }
        builder
    }

    /// Splits a row into an axis over the free coordinates and the part over the moved
    /// coordinates.
    fn axis(&self, row: &Row) -> (Axis, Row) {
        let n = self.coordinates.free;
        let (free, moved): (Row, Row) = row.iter().partition(|(at, _)| *at < n);
        (Axis::new(free), moved.into_iter().map(|(at, weight)| (at - n, weight)).collect())
    }

    /// Returns the motion of every moved place.
    fn motions(&self) -> Result<Vec<HarmonicAmplitudes>, ModelError> {
        let mut motions = vec![HarmonicAmplitudes::new(); self.coordinates.moved];
        for (i, motion) in self.model.motions.iter().enumerate() {
            let element = Element::Motion(i);
            let value = harmonic_amplitude(motion.amplitude, motion.phase, element)?;
            if let PlaceTarget::At(place) = self.places.find(&motion.on, element, "on")?
                && let Some(k) = self.coordinates.moved_number(&self.places, place)
            {
                *motions[k].entry(motion.harmonic).or_default() += value;
            }
        }
        Ok(motions)
    }

    /// Adds the forces on free coordinates and returns those on moved coordinates.
    fn forces(&self, mut builder: SystemBuilder) -> Result<(SystemBuilder, Vec<HarmonicAmplitudes>), ModelError> {
        let mut on_moved = vec![HarmonicAmplitudes::new(); self.coordinates.moved];
        for (i, force) in self.model.forces.iter().enumerate() {
            let element = Element::Force(i);
            let value = harmonic_amplitude(force.amplitude, force.phase, element)?;
            let PlaceTarget::At(place) = self.places.find(&force.on, element, "on")? else {
                return Err(ModelError::new(
                    element,
                    "on",
                    "a force on `ground` has no effect; name a mass or a place",
                ));
            };
            if self.places.stated[place].moved {
                let message = format!(
                    "`{}` has an imposed motion, so that a force on it has no effect; remove one of the two",
                    force.on
                );
                return Err(ModelError::new(element, "on", message));
            }
            let (axis, moved) = self.axis(&self.coordinates.places[place]);
            let growth = self.growth(i)?;
            for &(row, weight) in axis.rows() {
                let parts = [value, growth[0], growth[1]];
                builder = builder.load(row, force.harmonic, parts.map(|part| part * weight));
            }
            if !moved.is_empty() && growth.iter().any(|part| *part != Complex64::ZERO) {
                let message =
                    "a force that grows with the frequency cannot act on a place that follows an imposed motion";
                return Err(ModelError::new(element, "on", message));
            }
            for (k, weight) in moved {
                *on_moved[k].entry(force.harmonic).or_default() += value * weight;
            }
        }
        Ok((builder, on_moved))
    }

    /// Returns the parts of force `i` that grow with the frequency, as factors of `s = jhΩ` and of
    /// `s²`.
    fn growth(&self, i: usize) -> Result<[Complex64; 2], ModelError> {
        let (force, element) = (&self.model.forces[i], Element::Force(i));
        let mut sum = [Complex64::ZERO; 2];
        for part in self.model.frequency_forces.iter().filter(|part| part.force == i) {
            if force.harmonic == 0 && (part.linear != 0.0 || part.quadratic != 0.0) {
                let message = "a constant force cannot depend on the frequency; use a harmonic above zero";
                return Err(ModelError::new(element, "amplitude", message));
            }
            let harmonic = f64::from(force.harmonic.max(1));
            let linear = harmonic_amplitude(part.linear, force.phase, element)?;
            let quadratic = harmonic_amplitude(part.quadratic, force.phase, element)?;
            sum[0] += linear / Complex64::new(0.0, harmonic);
            sum[1] -= quadratic / (harmonic * harmonic);
        }
        Ok(sum)
    }

    /// Adds the loads of moved places on free coordinates through shared springs, dampers and
    /// masses.
    fn loads_of_motions(
        &self,
        mut builder: SystemBuilder,
        matrices: &AssembledMatrices,
        motions: &[HarmonicAmplitudes],
    ) -> SystemBuilder {
        let (n, zero) = (self.coordinates.free, Complex64::new(0.0, 0.0));
        for (k, motion) in motions.iter().enumerate() {
            for (&harmonic, &amplitude) in motion {
                for row in 0..n {
                    let at = (row, n + k);
                    let parts = [
                        matrices.stiffness.get(at.0, at.1),
                        matrices.damping(at.0, at.1),
                        matrices.mass.get(at.0, at.1),
                    ];
                    let parts = parts.map(|value| zero - amplitude * value);
                    builder = builder.load(row, harmonic, parts);
                }
            }
        }
        builder
    }

    /// Adds the joints and returns, for every moved place, its sign along each of their axes.
    fn joints(
        &self,
        mut builder: SystemBuilder,
        motions: &[HarmonicAmplitudes],
    ) -> Result<(SystemBuilder, Vec<Vec<f64>>), ModelError> {
        let mut signs = vec![Vec::new(); self.coordinates.moved];
        for (j, joint) in self.model.joints.iter().enumerate() {
            let element = Element::Joint(j);
            joint.law.check().map_err(|error| ModelError::new(element, "law", error.to_string()))?;
            check_distinct(&joint.between, element)?;
            let mut axes = Vec::new();
            let (directions, normal) = (joint.law.directions(), joint.law.normal());
            for (along, [a, b]) in self.places.axes(&joint.between, directions, normal, element)? {
                signs.iter_mut().for_each(|signs| signs.push(0.0));
                let (axis, moved) = self.axis(&self.row_of(&[(a, 1.0), (b, -1.0)]));
                let mut imposed = Vec::new();
                for (k, sign) in moved {
                    if let Some(last) = signs[k].last_mut() {
                        *last += sign;
                    }
                    imposed.extend(motions[k].iter().map(|(&harmonic, &amplitude)| (harmonic, amplitude * sign)));
                }
                let axis = axis.with_imposed_motion(imposed);
                axes.push(if let Some(along) = along { axis.named(along) } else { axis });
            }
            builder = builder.joint(joint.name.clone(), joint.law.clone(), axes);
        }
        Ok((builder, signs))
    }

    /// Adds the moved places with the data for the forces that move them.
    fn moved(
        &self,
        mut builder: SystemBuilder,
        matrices: &AssembledMatrices,
        (motions, forces): (&[HarmonicAmplitudes], &[HarmonicAmplitudes]),
        signs: &[Vec<f64>],
    ) -> SystemBuilder {
        let Coordinates { free: n, moved, .. } = self.coordinates;
        let names = self.places.stated.iter().filter(|place| place.moved).map(|place| &place.name);
        for (k, name) in names.enumerate() {
            let row = |entry: &dyn Fn(usize, usize) -> f64| {
                (DVector::from_fn(n, |i, _| entry(n + k, i)), (0..moved).map(|i| entry(n + k, n + i)).collect())
            };
            let list = |harmonics: &HarmonicAmplitudes| harmonics.iter().map(|(h, a)| (*h, *a)).collect();
            builder = builder.moved(MovedPlace {
                name: name.clone(),
                motion: list(&motions[k]),
                force: list(&forces[k]),
                mass: row(&|i, l| matrices.mass.get(i, l)),
                stiffness: row(&|i, l| matrices.stiffness.get(i, l)),
                damping: row(&|i, l| matrices.damping(i, l)),
                joints: signs[k].clone(),
            });
        }
        builder
    }
}

fn check_distinct(between: &[String; 2], element: Element) -> Result<(), ModelError> {
    if between[0] == between[1] {
        let message = format!("both ends are `{}`; name two different places", between[0]);
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

/// Amplitudes (N, m) for which energies neither underflow nor overflow after division by
/// stiffness or damping.
const AMPLITUDE_RANGE: std::ops::RangeInclusive<f64> = 1e-140..=1e140;

fn harmonic_amplitude(amplitude: f64, phase: f64, element: Element) -> Result<Complex64, ModelError> {
    for (value, key) in [(amplitude, "amplitude"), (phase, "phase")] {
        if !value.is_finite() {
            return Err(ModelError::new(element, key, format!("must be a finite number, found {value}")));
        }
    }
    if amplitude != 0.0 && !AMPLITUDE_RANGE.contains(&amplitude.abs()) {
        let message = format!("{amplitude:e} in SI units is out of range (1e-140 to 1e140); check its unit");
        return Err(ModelError::new(element, "amplitude", message));
    }
    Ok(Complex64::from_polar(1.0, phase) * amplitude)
}

/// Computes `matrix += value · row rowᵀ`.
fn add_along(entries: &mut Vec<(usize, usize, f64)>, row: &Row, value: f64) {
    for &(i, a) in row {
        entries.extend(row.iter().map(|&(k, b)| (i, k, value * (a * b))));
    }
}
