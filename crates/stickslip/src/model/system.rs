//! A checked and assembled model: a structure, its joints, its excitation.

use super::ReductionAccuracy;
use crate::law::{LawError, SharedLaw};
use crate::structure::{ReducedComponent, Structure, unit_root};
use nalgebra::DVector;
use num_complex::Complex64;
use std::collections::BTreeMap;
use std::sync::Arc;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// A checked, assembled model.
///
/// `M x'' + C x' + K x + Σ_j W_j f_j = F(t)`, with `u_j = W_jᵀ x + g_j(t)` along the axes of
/// joint `j`. Imposed motion causes `g_j`.
///
/// # Example
/// Two masses share inertia, and a joint connects the first mass to the ground.
/// ```
/// use nalgebra::dmatrix;
/// use num_complex::Complex64;
/// use std::sync::Arc;
/// use stickslip::law::Coulomb;
/// use stickslip::model::{Axis, System};
/// use stickslip::structure::Structure;
/// let places = vec!["a".to_owned(), "b".to_owned()];
/// let damping = dmatrix![0.1, 0.0; 0.0, 0.1];
/// let structure = Structure::new(
///     places,
///     dmatrix![1.0, 0.4; 0.4, 1.0],
///     damping,
///     dmatrix![2.0, -1.0; -1.0, 2.0],
/// )
/// .unwrap();
/// let system = System::builder(structure)
///     .joint("rub", Arc::new(Coulomb { limit: 0.2 }), vec![Axis::new(vec![(0, 1.0)])])
///     .force(0, 1, Complex64::new(1.0, 0.0))
///     .build()
///     .unwrap();
/// assert_eq!((system.dofs(), system.joints().len()), (2, 1));
/// ```
#[derive(Debug, Clone)]
pub struct System {
    structure: Structure,
    places: Vec<String>,
    place_axes: Vec<Axis>,
    reduced: Option<Arc<ReducedComponent>>,
    earlier: Option<ReductionAccuracy>,
    joints: Vec<SystemJoint>,
    loads: Vec<ExcitationHarmonic>,
    moved: Vec<MovedPlace>,
    cyclic: Option<CyclicSymmetry>,
}

/// The symmetry of a ring of equal sectors under a travelling excitation.
///
/// Sector n repeats the motion of the first sector, earlier by `order n / sectors` of a period
/// of the excitation. Degrees of freedom, joints and moved places are stored sector by sector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CyclicSymmetry {
    /// Number of sectors.
    pub sectors: usize,
    /// Nodal diameter of the first harmonic.
    pub order: usize,
}

impl CyclicSymmetry {
    /// Returns the nodal diameter of a harmonic of the excitation.
    pub fn diameter(self, harmonic: usize) -> usize {
        harmonic % self.sectors * self.order % self.sectors
    }

    /// Returns the phase factor of a harmonic in sector `sector` relative to the first sector,
    /// `e^{j 2π h order n / sectors}`.
    pub fn phase_factor(self, harmonic: usize, sector: usize) -> Complex64 {
        unit_root((self.diameter(harmonic) * sector) as i64, self.sectors)
    }
}

impl PartialEq for System {
    fn eq(&self, other: &Self) -> bool {
        self.structure == other.structure
            && self.places == other.places
            && self.place_axes == other.place_axes
            && self.joints == other.joints
            && self.loads == other.loads
            && self.moved == other.moved
            && self.cyclic == other.cyclic
    }
}

/// A joint in a system.
#[derive(Debug, Clone)]
pub struct SystemJoint {
    pub(super) name: String,
    pub(super) law: SharedLaw,
    pub(super) axes: Vec<Axis>,
}

impl PartialEq for SystemJoint {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && *self.law == *other.law && self.axes == other.axes
    }
}

impl SystemJoint {
    /// Returns its name.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// Returns its law.
    pub fn law(&self) -> &SharedLaw {
        &self.law
    }
    /// Returns its axes, one per direction of the law.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }
    /// Returns the labels of its axes in results: the joint's name, or `joint.direction` for
    /// each of several axes.
    pub fn labels(&self) -> impl Iterator<Item = String> {
        let several = self.axes.len() > 1;
        self.axes.iter().enumerate().map(move |(a, axis)| match &axis.name {
            Some(name) if several => format!("{}.{name}", self.name),
            None if several => format!("{}.{}", self.name, a + 1),
            _ => self.name.clone(),
        })
    }
}

/// A weighted sum of degrees of freedom: one direction of a joint, or a place of results.
///
/// For a joint, `u = Σ w x + g(t)`, and the force acts on the structure as `-w f`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axis {
    /// Name of the direction, if the joint has several.
    name: Option<String>,
    rows: Vec<(usize, f64)>,
    imposed: Vec<(u32, Complex64)>,
    /// Radius of a rotation, m. An angle times this radius is comparable with displacements.
    radius: Option<f64>,
}

impl Axis {
    /// Creates an axis from degrees of freedom and their weights.
    pub fn new(rows: Vec<(usize, f64)>) -> Self {
        Axis { name: None, rows, imposed: Vec::new(), radius: None }
    }

    /// Returns this axis as an angle in rad instead of a displacement. In comparisons of sizes
    /// it counts as the arc at this radius, m.
    #[must_use]
    pub fn as_rotation(self, radius: f64) -> Self {
        Axis { radius: Some(radius), ..self }
    }

    /// Returns whether this axis is an angle in rad.
    pub fn is_rotation(&self) -> bool {
        self.radius.is_some()
    }

    /// Returns the SI unit of the coordinate: m or rad.
    pub fn unit(&self) -> &'static str {
        if self.is_rotation() { "rad" } else { "m" }
    }

    /// Returns the length in m to which one unit of the coordinate corresponds in comparisons
    /// with displacements.
    pub fn length_scale(&self) -> f64 {
        self.radius.unwrap_or(1.0)
    }

    /// Returns this axis with a name, for joints with several axes.
    #[must_use]
    pub fn named(mut self, name: impl Into<String>) -> Self {
        self.name = Some(name.into());
        self
    }

    /// Returns the name of the direction, for joints with several directions.
    pub fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }

    /// Returns this axis with imposed relative motion `g(t) = Re Σ_h G_h e^{j h Ω t}`, as
    /// (harmonic, complex amplitude in m).
    pub fn with_imposed_motion(mut self, imposed: impl IntoIterator<Item = (u32, Complex64)>) -> Self {
        let mut sum: BTreeMap<u32, Complex64> = self.imposed.into_iter().collect();
        for (harmonic, amplitude) in imposed {
            *sum.entry(harmonic).or_default() += amplitude;
        }
        self.imposed = sum.into_iter().collect();
        self
    }

    /// Returns the degrees of freedom and their weights.
    pub fn rows(&self) -> &[(usize, f64)] {
        &self.rows
    }

    /// Returns the imposed relative motion: sorted (harmonic, complex amplitude in m).
    pub fn imposed(&self) -> &[(u32, Complex64)] {
        &self.imposed
    }

    /// Returns the imposed relative motion of one harmonic, m.
    pub fn imposed_at(&self, harmonic: u32) -> Complex64 {
        self.imposed.iter().find(|(h, _)| *h == harmonic).map_or(ZERO, |(_, g)| *g)
    }

    /// Returns the component of displacements or velocities (length n) along this axis, without
    /// imposed motion.
    #[inline]
    pub fn component(&self, values: &[f64]) -> f64 {
        self.rows.iter().map(|&(i, w)| w * values[i]).sum()
    }

    /// Returns the component of complex amplitudes along this axis, without imposed motion.
    pub fn complex_component(&self, values: &DVector<Complex64>) -> Complex64 {
        self.rows.iter().map(|&(i, w)| values[i] * w).sum()
    }

    /// Checks that the axis uses degrees of freedom below `n` and finite numbers.
    fn check(&self, n: usize, what: impl Fn() -> String) -> Result<(), SystemError> {
        if let Some(&(row, _)) = self.rows.iter().find(|(row, _)| *row >= n) {
            return Err(SystemError::Row { what: what(), row, dofs: n });
        }
        let finite = self.rows.iter().all(|(_, w)| w.is_finite());
        if !(finite && self.imposed.iter().all(|(_, g)| g.is_finite())) {
            return Err(SystemError::NotFinite { what: what() });
        }
        Ok(())
    }

    /// Returns its weights over all `n` degrees of freedom.
    pub fn dense(&self, n: usize) -> DVector<f64> {
        let mut out = DVector::zeros(n);
        self.rows.iter().for_each(|&(i, w)| out[i] += w);
        out
    }
}

/// One harmonic of the excitation: `Re((force + s·by_velocity + s²·by_acceleration) e^{st})` at
/// `s = jhΩ`.
#[derive(Debug, Clone, PartialEq)]
pub struct ExcitationHarmonic {
    /// Harmonic number h; 0 is constant.
    pub harmonic: u32,
    /// Complex force amplitudes, length n, N.
    pub force: DVector<Complex64>,
    /// Amplitudes of imposed motion times the damping that couples it to each degree of
    /// freedom, length n, kg m/s.
    pub by_velocity: DVector<Complex64>,
    /// Amplitudes of imposed motion times the mass that couples it to each degree of freedom,
    /// length n, kg m.
    pub by_acceleration: DVector<Complex64>,
}

impl ExcitationHarmonic {
    fn zero(harmonic: u32, n: usize) -> Self {
        let zeros = || DVector::from_element(n, ZERO);
        ExcitationHarmonic { harmonic, force: zeros(), by_velocity: zeros(), by_acceleration: zeros() }
    }

    /// Returns the complex force amplitudes at excitation frequency `omega` (rad/s), length n,
    /// N.
    pub fn amplitudes_at(&self, omega: f64) -> DVector<Complex64> {
        let s = Complex64::new(0.0, f64::from(self.harmonic) * omega);
        &self.force + &self.by_velocity * s + &self.by_acceleration * (s * s)
    }

    fn amplitudes(&self) -> impl Iterator<Item = &Complex64> {
        self.force.iter().chain(self.by_velocity.iter()).chain(self.by_acceleration.iter())
    }
}

/// A harmonic of an excitation as a sum of harmonics of another one.
#[derive(Debug, Clone, PartialEq)]
pub struct ExcitationSum {
    /// Harmonic number of the sum.
    pub harmonic: u32,
    /// Harmonics of the other excitation with their factors.
    pub of: Vec<(u32, Complex64)>,
}

/// A place with imposed motion, with the data for the force that moves it.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedPlace {
    /// Name.
    pub name: String,
    /// Sorted (harmonic, complex amplitude in m).
    pub motion: Vec<(u32, Complex64)>,
    /// Applied forces of places that move with this place: sorted (harmonic, complex amplitude
    /// in N).
    pub force: Vec<(u32, Complex64)>,
    /// Row of the mass matrix over the degrees of freedom (length n) and over the moved places,
    /// kg.
    pub mass: (DVector<f64>, Vec<f64>),
    /// Row of the stiffness matrix, in the same form, N/m.
    pub stiffness: (DVector<f64>, Vec<f64>),
    /// Row of the damping matrix, in the same form, kg/s.
    pub damping: (DVector<f64>, Vec<f64>),
    /// For each axis of all joints, in their order, the sign of its force on this place. The
    /// excitation must supply `+sign · f`.
    pub joints: Vec<f64>,
}

/// The reason why a system is invalid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SystemError {
    /// The number of axes of a joint differs from the number of directions of its law.
    #[error("joint `{joint}` has {axes} axes, but its law `{law}` has {directions} directions")]
    Axes {
        /// Name of the joint.
        joint: String,
        /// Name of its law.
        law: &'static str,
        /// Number of axes of the joint.
        axes: usize,
        /// Number of directions of the law.
        directions: usize,
    },
    /// A degree of freedom does not exist.
    #[error("{what} uses degree of freedom {row}, but the system has {dofs}, numbered from 0")]
    Row {
        /// The joint, place or load.
        what: String,
        /// The invalid number of a degree of freedom.
        row: usize,
        /// Number of degrees of freedom of the system.
        dofs: usize,
    },
    /// A number is not finite.
    #[error("{what} contains a number that is not finite")]
    NotFinite {
        /// The joint, place or load.
        what: String,
    },
    /// A parameter of a law is invalid.
    #[error("joint `{joint}`: {error}")]
    Law {
        /// Name of the joint.
        joint: String,
        /// The fault in the parameters.
        error: LawError,
    },
    /// The system does not have the claimed cyclic symmetry.
    #[error("the sectors are not equal: their {0} differ from those of the first sector")]
    NotCyclic(&'static str),
}

/// Builder of a [`System`]; [`SystemBuilder::build`] checks it.
#[derive(Debug, Clone)]
pub struct SystemBuilder {
    structure: Structure,
    places: Option<(Vec<String>, Vec<Axis>)>,
    reduced: Option<Arc<ReducedComponent>>,
    earlier: Option<ReductionAccuracy>,
    joints: Vec<SystemJoint>,
    loads: BTreeMap<u32, ExcitationHarmonic>,
    moved: Vec<MovedPlace>,
    wrong: Option<SystemError>,
}

impl SystemBuilder {
    /// Adds a place of results. Without any call, each degree of freedom is a place.
    #[must_use]
    pub fn place(mut self, name: impl Into<String>, along: Axis) -> Self {
        let (names, place_axes) = self.places.get_or_insert_default();
        names.push(name.into());
        place_axes.push(along);
        self
    }

    /// Sets the reduced component that is a part of the structure.
    #[must_use]
    pub(super) fn reduced(self, reduced: Option<Arc<ReducedComponent>>) -> Self {
        SystemBuilder { reduced, ..self }
    }

    /// Sets the error of an earlier reduction of a part of the structure.
    #[must_use]
    pub(super) fn earlier(self, earlier: Option<ReductionAccuracy>) -> Self {
        SystemBuilder { earlier, ..self }
    }

    /// Adds a joint with one axis per direction of its law.
    #[must_use]
    pub fn joint(mut self, name: impl Into<String>, law: SharedLaw, axes: Vec<Axis>) -> Self {
        self.joints.push(SystemJoint { name: name.into(), law, axes });
        self
    }

    /// Adds a force on a degree of freedom: harmonic and complex amplitude, N.
    #[must_use]
    pub fn force(self, row: usize, harmonic: u32, amplitude: Complex64) -> Self {
        self.load(row, harmonic, [amplitude, ZERO, ZERO])
    }

    /// Adds to the load on one degree of freedom, as `[force, by_velocity, by_acceleration]`.
    ///
    /// The parts are a force (N), a force proportional to `s` (kg m/s) and a force proportional
    /// to `s²` (kg m).
    #[must_use]
    pub(super) fn load(mut self, row: usize, harmonic: u32, parts: [Complex64; 3]) -> Self {
        let n = self.structure.dofs();
        let what = || format!("a force of harmonic {harmonic}");
        if row >= n {
            self.wrong.get_or_insert_with(|| SystemError::Row { what: what(), row, dofs: n });
        } else if !parts.iter().all(|part| part.is_finite()) {
            self.wrong.get_or_insert_with(|| SystemError::NotFinite { what: what() });
        } else {
            let load = self.loads.entry(harmonic).or_insert_with(|| ExcitationHarmonic::zero(harmonic, n));
            load.force[row] += parts[0];
            load.by_velocity[row] += parts[1];
            load.by_acceleration[row] += parts[2];
        }
        self
    }

    /// Adds a place with imposed motion.
    #[must_use]
    pub(super) fn moved(mut self, place: MovedPlace) -> Self {
        self.moved.push(place);
        self
    }

    /// Checks the parts and returns the system.
    ///
    /// # Errors
    /// [`SystemError`]: axes that do not fit the law, degrees of freedom that do not exist,
    /// numbers that are not finite, or invalid parameters of a law.
    pub fn build(self) -> Result<System, SystemError> {
        if let Some(wrong) = self.wrong {
            return Err(wrong);
        }
        let n = self.structure.dofs();
        let unit = || {
            let rows = (0..n).map(|row| Axis::new(vec![(row, 1.0)]));
            (self.structure.places().to_vec(), rows.collect())
        };
        let (places, place_axes) = self.places.unwrap_or_else(unit);
        for (name, axis) in places.iter().zip(&place_axes) {
            axis.check(n, || format!("place `{name}`"))?;
        }
        for joint in &self.joints {
            let (axes, directions) = (joint.axes.len(), joint.law.directions());
            if axes != directions {
                return Err(SystemError::Axes { joint: joint.name.clone(), law: joint.law.name(), axes, directions });
            }
            joint.law.check().map_err(|error| SystemError::Law { joint: joint.name.clone(), error })?;
            for axis in &joint.axes {
                axis.check(n, || format!("joint `{}`", joint.name))?;
            }
        }
        Ok(System {
            structure: self.structure,
            places,
            place_axes,
            reduced: self.reduced,
            earlier: self.earlier,
            joints: self.joints,
            loads: self.loads.into_values().collect(),
            moved: self.moved,
            cyclic: None,
        })
    }
}

impl System {
    /// Creates a builder for a system on a structure.
    pub fn builder(structure: Structure) -> SystemBuilder {
        SystemBuilder {
            structure,
            places: None,
            reduced: None,
            earlier: None,
            joints: Vec::new(),
            loads: BTreeMap::new(),
            moved: Vec::new(),
            wrong: None,
        }
    }

    /// Returns the linear part of the system.
    pub fn structure(&self) -> &Structure {
        &self.structure
    }

    /// Returns the same joints and loads on another structure with the same number of degrees
    /// of freedom.
    ///
    /// # Errors
    /// See [`SystemBuilder::build`].
    pub fn with_structure(&self, structure: Structure) -> Result<System, SystemError> {
        self.builder_on(structure).build()
    }

    fn builder_on(&self, structure: Structure) -> SystemBuilder {
        let loads = self.loads.iter().map(|load| (load.harmonic, load.clone()));
        SystemBuilder {
            places: Some((self.places.clone(), self.place_axes.clone())),
            reduced: self.reduced.clone(),
            earlier: self.earlier,
            joints: self.joints.clone(),
            loads: loads.collect(),
            moved: self.moved.clone(),
            ..System::builder(structure)
        }
    }

    /// Returns the same system with further springs to ground along axes: stiffness (N/m), and a
    /// constant force along the same axis (N). Returns `None` if an entry is then not finite.
    pub(crate) fn with_springs(&self, springs: &[(&Axis, f64, f64)]) -> Option<System> {
        let added: Vec<_> = springs.iter().map(|(axis, stiffness, _)| (axis.rows().to_vec(), *stiffness)).collect();
        let mut builder = self.builder_on(self.structure.with_springs(&added)?);
        for (axis, _, force) in springs {
            for (row, weight) in axis.rows() {
                builder = builder.force(*row, 0, Complex64::from(weight * force));
            }
        }
        builder.build().ok()
    }

    /// Returns the same system with other laws in the joints for which `law` returns one.
    pub(crate) fn with_laws(&self, law: impl Fn(&SystemJoint) -> Option<SharedLaw>) -> System {
        let mut system = self.clone();
        for joint in &mut system.joints {
            joint.law = law(joint).unwrap_or_else(|| joint.law.clone());
        }
        system
    }

    /// Returns the same system in terms of a lower base frequency, for subharmonic orbits.
    ///
    /// Harmonic h becomes `h · periods`. A motion that repeats after `periods` periods of the
    /// excitation repeats after one period of the new system.
    pub(crate) fn subharmonic(&self, periods: u32) -> System {
        // a motion of several periods need not travel with the excitation
        let mut system = System { cyclic: None, ..self.clone() };
        system.loads.iter_mut().for_each(|load| load.harmonic *= periods);
        let axes = system.joints.iter_mut().flat_map(|joint| &mut joint.axes);
        axes.flat_map(|axis| &mut axis.imposed).for_each(|(h, _)| *h *= periods);
        system.moved.iter_mut().flat_map(|place| &mut place.motion).for_each(|(h, _)| *h *= periods);
        system
    }

    /// Returns the same system under other sums of its harmonics: for every harmonic of the new
    /// excitation the factors of harmonics of this one.
    ///
    /// # Example
    /// The excitation of the first harmonic becomes a constant force of half its amplitude.
    /// ```
    /// use num_complex::Complex64;
    /// use stickslip::model::ExcitationSum;
    /// let system = stickslip::model::example::blade_couple_massless().assemble().unwrap();
    /// let half = ExcitationSum { harmonic: 0, of: vec![(1, Complex64::new(0.5, 0.0))] };
    /// let constant = system.with_excitation_sums(&[half]);
    /// let force = |system: &stickslip::model::System| system.excitation(1.0)[0].1[0];
    /// assert_eq!(force(&constant), 0.5 * force(&system));
    /// ```
    #[must_use]
    pub fn with_excitation_sums(&self, sums: &[ExcitationSum]) -> System {
        let combine = |harmonics: &[(u32, Complex64)]| -> Vec<(u32, Complex64)> {
            let value = |old: u32| harmonics.iter().find(|(h, _)| *h == old).map_or(ZERO, |(_, amplitude)| *amplitude);
            let sum = |sum: &ExcitationSum| sum.of.iter().map(|(old, factor)| factor * value(*old)).sum::<Complex64>();
            sums.iter().map(|one| (one.harmonic, sum(one))).filter(|(_, amplitude)| *amplitude != ZERO).collect()
        };
        let n = self.dofs();
        let load = |sum: &ExcitationSum| {
            let mut new = ExcitationHarmonic::zero(sum.harmonic, n);
            for (old, factor) in &sum.of {
                for load in self.loads.iter().filter(|load| load.harmonic == *old) {
                    new.force += &load.force * *factor;
                    new.by_velocity += &load.by_velocity * *factor;
                    new.by_acceleration += &load.by_acceleration * *factor;
                }
            }
            new
        };
        let mut system = System { cyclic: None, ..self.clone() };
        system.loads = sums.iter().map(load).collect();
        system.loads.sort_by_key(|load| load.harmonic);
        let axes = system.joints.iter_mut().flat_map(|joint| &mut joint.axes);
        axes.chain(&mut system.place_axes).for_each(|axis| axis.imposed = combine(&axis.imposed));
        for place in &mut system.moved {
            (place.motion, place.force) = (combine(&place.motion), combine(&place.force));
        }
        system
    }

    /// Returns this system with the cyclic symmetry of a ring in a travelling wave. Harmonic
    /// balance then solves one sector.
    ///
    /// # Errors
    /// [`SystemError::NotCyclic`]: the sectors differ, or the loads do not travel with the wave.
    pub fn with_cyclic_symmetry(self, cyclic: CyclicSymmetry) -> Result<System, SystemError> {
        match self.symmetry_violation(cyclic) {
            Some(what) => Err(SystemError::NotCyclic(what)),
            None => Ok(System { cyclic: Some(cyclic), ..self }),
        }
    }

    /// Returns the symmetry of a ring in a travelling wave, if it is known; see
    /// [`System::with_cyclic_symmetry`].
    pub fn cyclic(&self) -> Option<CyclicSymmetry> {
        self.cyclic
    }

    /// Returns the first part of the system that violates the given symmetry.
    fn symmetry_violation(&self, cyclic: CyclicSymmetry) -> Option<&'static str> {
        let CyclicSymmetry { sectors, order } = cyclic;
        let n = self.dofs();
        if order >= sectors || self.structure.ring_sector(sectors).is_none() {
            return Some("masses, dampers or springs");
        }
        let size = n / sectors;
        let near = |first: Complex64, harmonic: u32, sector: usize, z: Complex64, largest: f64| {
            // Relative difference between loads of a sector and those of the first sector that
            // counts as rounding of the phases. It is relative to the largest load.
            (first * cyclic.phase_factor(harmonic as usize, sector) - z).norm() <= 1e-12 * largest
        };
        for load in &self.loads {
            for values in [&load.force, &load.by_velocity, &load.by_acceleration] {
                let largest = values.iter().fold(0.0, |m: f64, z| m.max(z.norm()));
                if !(0..n).all(|i| near(values[i % size], load.harmonic, i / size, values[i], largest)) {
                    return Some("forces");
                }
            }
        }
        if !self.joints.len().is_multiple_of(sectors) {
            return Some("joints");
        }
        let each = self.joints.len() / sectors;
        let sorted = |mut rows: Vec<(usize, f64)>| {
            rows.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
            rows
        };
        for (j, joint) in self.joints.iter().enumerate() {
            let (first, sector) = (&self.joints[j % each], j / each);
            let same = joint.axes.len() == first.axes.len() && *joint.law == *first.law;
            let alike = same
                && joint.axes.iter().zip(&first.axes).all(|(axis, first)| {
                    let shifted = first.rows.iter().map(|(i, w)| ((i + sector * size) % n, *w)).collect();
                    let largest = first.imposed.iter().fold(0.0, |m: f64, (_, g)| m.max(g.norm()));
                    sorted(axis.rows.clone()) == sorted(shifted)
                        && axis.imposed.len() == first.imposed.len()
                        && axis
                            .imposed
                            .iter()
                            .zip(&first.imposed)
                            .all(|((h, g), (k, f))| h == k && near(*f, *h, sector, *g, largest))
                });
            if !alike {
                return Some("joints");
            }
        }
        None
    }

    /// Returns the number of degrees of freedom.
    pub fn dofs(&self) -> usize {
        self.structure.dofs()
    }

    /// Returns the names of the places of results.
    ///
    /// In a model of masses they are the degrees of freedom. In a reduced structure they are
    /// the observed displacements, whose number differs from the number of coordinates.
    pub fn places(&self) -> &[String] {
        &self.places
    }

    /// Returns each place as a weighted sum of degrees of freedom.
    pub fn place_axes(&self) -> &[Axis] {
        &self.place_axes
    }

    /// Returns the reduced component that is a part of the structure, with its error.
    pub fn reduced(&self) -> Option<&ReducedComponent> {
        self.reduced.as_deref()
    }

    /// Returns the error of all successive reductions of the structure, or `None` if nothing is
    /// reduced.
    ///
    /// It is the largest relative error at the places and the upper end of its frequency range
    /// (rad/s).
    pub fn reduction_evidence(&self) -> Option<ReductionAccuracy> {
        let now = self.reduced().map(|reduced| ReductionAccuracy { error: reduced.error(), up_to: reduced.up_to() });
        match (self.earlier, now) {
            (Some(first), Some(then)) => Some(first.combine(then)),
            (one, other) => one.or(other),
        }
    }

    /// Returns displacements, velocities or accelerations at the places, from those of the
    /// degrees of freedom (length n).
    pub fn at_places(&self, values: &[f64]) -> Vec<f64> {
        self.place_axes.iter().map(|axis| axis.component(values)).collect()
    }

    /// Returns the joints.
    pub fn joints(&self) -> &[SystemJoint] {
        &self.joints
    }

    /// Iterates over the axes of all joints, in their order: (joint, axis).
    pub fn axes(&self) -> impl Iterator<Item = (usize, &Axis)> {
        self.joints.iter().enumerate().flat_map(|(j, joint)| joint.axes.iter().map(move |axis| (j, axis)))
    }

    /// Returns the excitation by harmonic, sorted by harmonic number; each number occurs at
    /// most once.
    pub fn excitation_harmonics(&self) -> &[ExcitationHarmonic] {
        &self.loads
    }

    /// Returns the places with imposed motion, which are not degrees of freedom.
    pub fn moved_places(&self) -> &[MovedPlace] {
        &self.moved
    }

    /// Returns the sum of the constant forces on each row, N.
    pub(crate) fn constant_forces(&self) -> DVector<f64> {
        let mut load = DVector::zeros(self.dofs());
        for (_, force) in self.excitation(0.0).iter().filter(|(harmonic, _)| *harmonic == 0) {
            load += force.map(|f| f.re);
        }
        load
    }

    /// Returns the complex force amplitudes at excitation frequency `omega` (rad/s): (harmonic,
    /// length n).
    pub fn excitation(&self, omega: f64) -> Vec<(u32, DVector<Complex64>)> {
        self.loads.iter().map(|load| (load.harmonic, load.amplitudes_at(omega))).collect()
    }

    /// Returns whether excitation and laws are odd, so that an orbit with `x(t + T/2) = -x(t)`
    /// exists.
    ///
    /// The excitation is odd if it has odd harmonics only, so that it changes its sign after
    /// half a period.
    pub fn is_odd(&self) -> bool {
        let laws = self.joints.iter().all(|joint| joint.law.is_odd());
        laws && self.harmonics_of_excitation(|z| z != ZERO).iter().all(|h| !h.is_multiple_of(2))
    }

    /// Returns the harmonics of loads and imposed motions whose amplitudes `counts` accepts. A
    /// harmonic can occur more than once.
    pub(crate) fn harmonics_of_excitation(&self, counts: impl Fn(Complex64) -> bool) -> Vec<u32> {
        let loads = self.loads.iter().filter(|load| load.amplitudes().any(|z| counts(*z))).map(|load| load.harmonic);
        let imposed = self.axes().flat_map(|(_, axis)| &axis.imposed);
        let moved = self.moved.iter().flat_map(|place| &place.motion);
        loads.chain(imposed.chain(moved).filter(|(_, z)| counts(*z)).map(|(h, _)| *h)).collect()
    }
}
