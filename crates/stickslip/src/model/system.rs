//! A model checked and assembled: a structure, its joints, its excitation.

use super::ReductionEvidence;
use crate::law::{LawError, SharedLaw};
use crate::structure::{ReducedComponent, Sector, Structure, turn};
use nalgebra::DVector;
use num_complex::Complex64;
use std::collections::BTreeMap;
use std::sync::Arc;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

/// A checked, assembled model.
///
/// `M x'' + C x' + K x + Σ_j W_j f_j = F(t)`, with `u_j = W_jᵀ x + g_j(t)` along the axes of joint `j`, where `g_j` comes from imposed motion.
///
/// # Example
/// Two masses that share inertia, and a joint between the first and the ground.
/// ```
/// use nalgebra::dmatrix;
/// use num_complex::Complex64;
/// use std::sync::Arc;
/// use stickslip::law::Coulomb;
/// use stickslip::model::{Axis, System};
/// use stickslip::structure::Structure;
/// let places = vec!["a".to_owned(), "b".to_owned()];
/// let damping = dmatrix![0.1, 0.0; 0.0, 0.1];
/// let structure = Structure::new(places, dmatrix![1.0, 0.4; 0.4, 1.0], damping, dmatrix![2.0, -1.0; -1.0, 2.0]).unwrap();
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
    seen: Vec<Axis>,
    reduced: Option<Arc<ReducedComponent>>,
    earlier: Option<ReductionEvidence>,
    joints: Vec<SystemJoint>,
    loads: Vec<Load>,
    moved: Vec<MovedPlace>,
    cyclic: Option<Cyclic>,
}

/// The symmetry of a ring of equal sectors under an excitation that travels around it: sector n does what the first one does, earlier by
/// `order n / sectors` of a period of the drive. Degrees of freedom, joints and moved places stand sector by sector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cyclic {
    /// Number of sectors.
    pub sectors: usize,
    /// Nodal diameters of the first harmonic.
    pub order: usize,
}

impl Cyclic {
    /// The nodal diameter of a harmonic of the drive.
    pub fn diameter(self, harmonic: usize) -> usize {
        harmonic % self.sectors * self.order % self.sectors
    }

    /// By how much a harmonic of sector `sector` leads that of the first, `e^{j 2π h order n / sectors}`.
    pub fn lead(self, harmonic: usize, sector: usize) -> Complex64 {
        turn((self.diameter(harmonic) * sector) as i64, self.sectors)
    }
}

impl PartialEq for System {
    fn eq(&self, other: &Self) -> bool {
        self.structure == other.structure
            && self.places == other.places
            && self.seen == other.seen
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
    /// Name.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// Its law.
    pub fn law(&self) -> &SharedLaw {
        &self.law
    }
    /// Its axes, one for each of the law's directions.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }
    /// What results call its axes: the joint's name, or `joint.direction` for each of several.
    pub fn labels(&self) -> impl Iterator<Item = String> {
        let several = self.axes.len() > 1;
        self.axes.iter().enumerate().map(move |(a, axis)| match &axis.name {
            Some(name) if several => format!("{}.{name}", self.name),
            None if several => format!("{}.{}", self.name, a + 1),
            _ => self.name.clone(),
        })
    }
}

/// A weighted sum of degrees of freedom: one direction of a joint, `u = Σ w x + g(t)`, whose force acts on the structure as `-w f`; or a
/// place, at which results are given.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axis {
    /// The direction's name, if its joint has several.
    name: Option<String>,
    rows: Vec<(usize, f64)>,
    imposed: Vec<(u32, Complex64)>,
    /// Of an angle: the radius, m, at which it counts beside displacements.
    radius: Option<f64>,
}

impl Axis {
    /// Along degrees of freedom with their weights.
    pub fn new(rows: Vec<(usize, f64)>) -> Self {
        Axis { name: None, rows, imposed: Vec::new(), radius: None }
    }

    /// The same as an angle, rad, instead of a displacement; where sizes of both are compared, it counts as the arc at this radius, m.
    #[must_use]
    pub fn rotation(self, radius: f64) -> Self {
        Axis { radius: Some(radius), ..self }
    }

    /// Whether it is an angle, rad.
    pub fn is_rotation(&self) -> bool {
        self.radius.is_some()
    }

    /// The SI unit of what it measures: m, or rad.
    pub fn unit(&self) -> &'static str {
        if self.is_rotation() { "rad" } else { "m" }
    }

    /// The length, m, that one unit of it counts as beside displacements.
    pub fn length(&self) -> f64 {
        self.radius.unwrap_or(1.0)
    }

    /// The same with a name, where a joint has several axes.
    #[must_use]
    pub fn named(mut self, name: impl Into<String>) -> Self {
        self.name = Some(name.into());
        self
    }

    /// Name of the direction, of joints that act along several.
    pub fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }

    /// The same with imposed relative motion `g(t) = Re Σ_h G_h e^{j h Ω t}`: (harmonic, complex amplitude in m).
    pub fn moved(mut self, imposed: impl IntoIterator<Item = (u32, Complex64)>) -> Self {
        let mut sum: BTreeMap<u32, Complex64> = self.imposed.into_iter().collect();
        for (harmonic, amplitude) in imposed {
            *sum.entry(harmonic).or_default() += amplitude;
        }
        self.imposed = sum.into_iter().collect();
        self
    }

    /// Degrees of freedom and their weights.
    pub fn rows(&self) -> &[(usize, f64)] {
        &self.rows
    }

    /// Imposed relative motion: sorted (harmonic, complex amplitude in m).
    pub fn imposed(&self) -> &[(u32, Complex64)] {
        &self.imposed
    }

    /// Imposed relative motion of one harmonic, m.
    pub fn imposed_at(&self, harmonic: u32) -> Complex64 {
        self.imposed.iter().find(|(h, _)| *h == harmonic).map_or(ZERO, |(_, g)| *g)
    }

    /// What displacements or velocities of the degrees of freedom (length n) are along it, without imposed motion.
    #[inline]
    pub fn along(&self, values: &[f64]) -> f64 {
        self.rows.iter().map(|&(i, w)| w * values[i]).sum()
    }

    /// The same of complex amplitudes.
    pub fn along_complex(&self, values: &DVector<Complex64>) -> Complex64 {
        self.rows.iter().map(|&(i, w)| values[i] * w).sum()
    }

    /// That it names degrees of freedom below `n` and has finite numbers.
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

    /// Its weights over all `n` degrees of freedom.
    pub fn dense(&self, n: usize) -> DVector<f64> {
        let mut out = DVector::zeros(n);
        self.rows.iter().for_each(|&(i, w)| out[i] += w);
        out
    }
}

/// One harmonic of the excitation: `Re((force + s·by_velocity + s²·by_acceleration) e^{st})` at `s = jhΩ`.
#[derive(Debug, Clone, PartialEq)]
pub struct Load {
    /// Harmonic number h; 0 is constant.
    pub harmonic: u32,
    /// Complex force amplitudes, length n, N.
    pub force: DVector<Complex64>,
    /// Amplitudes of imposed motion times the dampers through which it acts, length n, kg m/s.
    pub by_velocity: DVector<Complex64>,
    /// Amplitudes of imposed motion times the masses that it shares with degrees of freedom, length n, kg m.
    pub by_acceleration: DVector<Complex64>,
}

impl Load {
    fn zero(harmonic: u32, n: usize) -> Self {
        let zeros = || DVector::from_element(n, ZERO);
        Load { harmonic, force: zeros(), by_velocity: zeros(), by_acceleration: zeros() }
    }

    /// Complex force amplitudes at drive frequency `omega` (rad/s), length n, N.
    pub fn at(&self, omega: f64) -> DVector<Complex64> {
        let s = Complex64::new(0.0, f64::from(self.harmonic) * omega);
        &self.force + &self.by_velocity * s + &self.by_acceleration * (s * s)
    }

    fn amplitudes(&self) -> impl Iterator<Item = &Complex64> {
        self.force.iter().chain(self.by_velocity.iter()).chain(self.by_acceleration.iter())
    }
}

/// A place with imposed motion, and what hangs on it: needed for the force that moves it.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedPlace {
    /// Name.
    pub name: String,
    /// Sorted (harmonic, complex amplitude in m).
    pub motion: Vec<(u32, Complex64)>,
    /// Forces that act on it besides, those of places that move along: sorted (harmonic, complex amplitude in N).
    pub force: Vec<(u32, Complex64)>,
    /// Row of the mass matrix towards the degrees of freedom (length n), and towards the moved places, kg.
    pub mass: (DVector<f64>, Vec<f64>),
    /// The same of the stiffness matrix, N/m.
    pub stiffness: (DVector<f64>, Vec<f64>),
    /// The same of the damping matrix, kg/s.
    pub damping: (DVector<f64>, Vec<f64>),
    /// For each axis of all joints, in their order, the sign with which its force acts back on this place: the drive must supply `+sign · f`.
    pub joints: Vec<f64>,
}

/// Why a system cannot be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SystemError {
    /// A joint has another number of axes than its law has directions.
    #[error("joint `{joint}` has {axes} axes, but its law `{law}` has {directions} directions")]
    Axes {
        /// The joint.
        joint: String,
        /// Its law.
        law: &'static str,
        /// Its axes.
        axes: usize,
        /// The law's directions.
        directions: usize,
    },
    /// A degree of freedom does not exist.
    #[error("{what} uses degree of freedom {row}, but the system has {dofs}, numbered from 0")]
    Row {
        /// The joint or load.
        what: String,
        /// The number.
        row: usize,
        /// Degrees of freedom.
        dofs: usize,
    },
    /// A number is not finite.
    #[error("{what} contains a number that is not finite")]
    NotFinite {
        /// The joint or load.
        what: String,
    },
    /// The law's parameters are wrong.
    #[error("joint `{joint}`: {error}")]
    Law {
        /// The joint.
        joint: String,
        /// What is wrong.
        error: LawError,
    },
    /// It is not as symmetric as it is said to be.
    #[error("the sectors are not equal: their {0} differ from those of the first sector")]
    NotCyclic(&'static str),
}

/// Puts a system together; [`SystemBuilder::build`] checks it.
#[derive(Debug, Clone)]
pub struct SystemBuilder {
    structure: Structure,
    places: Option<(Vec<String>, Vec<Axis>)>,
    reduced: Option<Arc<ReducedComponent>>,
    earlier: Option<ReductionEvidence>,
    joints: Vec<SystemJoint>,
    loads: BTreeMap<u32, Load>,
    moved: Vec<MovedPlace>,
    wrong: Option<SystemError>,
}

impl SystemBuilder {
    /// Adds a place at which results are given; without any, each degree of freedom is one.
    #[must_use]
    pub fn place(mut self, name: impl Into<String>, along: Axis) -> Self {
        let (names, seen) = self.places.get_or_insert_default();
        names.push(name.into());
        seen.push(along);
        self
    }

    /// Says that part of the structure is a component in few coordinates.
    #[must_use]
    pub(super) fn reduced(self, reduced: Option<Arc<ReducedComponent>>) -> Self {
        SystemBuilder { reduced, ..self }
    }

    /// Says that part of the structure came in few coordinates.
    #[must_use]
    pub(super) fn earlier(self, earlier: Option<ReductionEvidence>) -> Self {
        SystemBuilder { earlier, ..self }
    }

    /// Adds a joint with one axis for each of its law's directions.
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

    /// Adds a force (N), one that grows with frequency (kg m/s, times s) and one that grows with its square (kg m, times s²) on a degree
    /// of freedom.
    #[must_use]
    pub(super) fn load(mut self, row: usize, harmonic: u32, parts: [Complex64; 3]) -> Self {
        let n = self.structure.dofs();
        let what = || format!("a force of harmonic {harmonic}");
        if row >= n {
            self.wrong.get_or_insert_with(|| SystemError::Row { what: what(), row, dofs: n });
        } else if !parts.iter().all(|part| part.is_finite()) {
            self.wrong.get_or_insert_with(|| SystemError::NotFinite { what: what() });
        } else {
            let load = self.loads.entry(harmonic).or_insert_with(|| Load::zero(harmonic, n));
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

    /// The system.
    ///
    /// # Errors
    /// [`SystemError`]: axes that do not fit the law, numbers of degrees of freedom that do not exist, numbers that are not finite, a law
    /// whose parameters are wrong.
    pub fn build(self) -> Result<System, SystemError> {
        if let Some(wrong) = self.wrong {
            return Err(wrong);
        }
        let n = self.structure.dofs();
        let unit = || {
            let rows = (0..n).map(|row| Axis::new(vec![(row, 1.0)]));
            (self.structure.places().to_vec(), rows.collect())
        };
        let (places, seen) = self.places.unwrap_or_else(unit);
        for (name, axis) in places.iter().zip(&seen) {
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
            seen,
            reduced: self.reduced,
            earlier: self.earlier,
            joints: self.joints,
            loads: self.loads.into_values().collect(),
            moved: self.moved,
            cyclic: None,
        })
    }
}

/// Difference between loads of a sector and those of the first, relative to the largest, that counts as rounding of phases.
const ALIKE: f64 = 1e-12;

impl System {
    /// Begins a system on a structure.
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

    /// Its linear part.
    pub fn structure(&self) -> &Structure {
        &self.structure
    }

    /// The same joints and loads on another structure with as many degrees of freedom.
    ///
    /// # Errors
    /// As [`SystemBuilder::build`].
    pub fn on(&self, structure: Structure) -> Result<System, SystemError> {
        let loads = self.loads.iter().map(|load| (load.harmonic, load.clone()));
        let builder = SystemBuilder {
            places: Some((self.places.clone(), self.seen.clone())),
            reduced: self.reduced.clone(),
            earlier: self.earlier,
            joints: self.joints.clone(),
            loads: loads.collect(),
            moved: self.moved.clone(),
            ..System::builder(structure)
        };
        builder.build()
    }

    /// The same system, driven by harmonics of a frequency that is so many times lower: harmonic h becomes `h · periods`, and what repeats after
    /// so many periods of the drive repeats after one.
    pub(crate) fn slowed(&self, periods: u32) -> System {
        // what repeats after several periods need not travel as the drive does
        let mut system = System { cyclic: None, ..self.clone() };
        system.loads.iter_mut().for_each(|load| load.harmonic *= periods);
        let axes = system.joints.iter_mut().flat_map(|joint| &mut joint.axes);
        axes.flat_map(|axis| &mut axis.imposed).for_each(|(h, _)| *h *= periods);
        system.moved.iter_mut().flat_map(|place| &mut place.motion).for_each(|(h, _)| *h *= periods);
        system
    }

    /// The same system, known to be a ring of equal sectors in a travelling wave: harmonic balance then solves one sector.
    ///
    /// # Errors
    /// [`SystemError::NotCyclic`]: its sectors differ, or its loads do not travel so.
    pub fn travelling(self, cyclic: Cyclic) -> Result<System, SystemError> {
        match self.off(cyclic) {
            Some(what) => Err(SystemError::NotCyclic(what)),
            None => Ok(System { cyclic: Some(cyclic), ..self }),
        }
    }

    /// The symmetry of a ring in a travelling wave, if it is known, see [`System::travelling`].
    pub fn cyclic(&self) -> Option<Cyclic> {
        self.cyclic
    }

    /// What of the system has not this symmetry.
    fn off(&self, cyclic: Cyclic) -> Option<&'static str> {
        let Cyclic { sectors, order } = cyclic;
        let n = self.dofs();
        if order >= sectors || Sector::of(&self.structure, sectors).is_none() {
            return Some("masses, dampers or springs");
        }
        let size = n / sectors;
        let near = |first: Complex64, harmonic: u32, sector: usize, z: Complex64, largest: f64| {
            (first * cyclic.lead(harmonic as usize, sector) - z).norm() <= ALIKE * largest
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

    /// Number of degrees of freedom.
    pub fn dofs(&self) -> usize {
        self.structure.dofs()
    }

    /// Names of the places, at which results are given. In a model of masses they are the degrees of freedom; of a reduced structure
    /// they are what is looked at, and fewer or more.
    pub fn places(&self) -> &[String] {
        &self.places
    }

    /// How each place follows from the degrees of freedom.
    pub fn seen(&self) -> &[Axis] {
        &self.seen
    }

    /// The component in few coordinates that part of the structure is, and its error.
    pub fn reduced(&self) -> Option<&ReducedComponent> {
        self.reduced.as_deref()
    }

    /// What its structure lacks of the whole: the largest relative error of what places see, of all reductions that made it, one after the other, and up
    /// to which frequency (rad/s) it holds; none where nothing was reduced.
    pub fn reduction_evidence(&self) -> Option<ReductionEvidence> {
        let now = self.reduced().map(|reduced| ReductionEvidence { error: reduced.error(), up_to: reduced.up_to() });
        match (self.earlier, now) {
            (Some(first), Some(then)) => Some(first.then(then)),
            (one, other) => one.or(other),
        }
    }

    /// Displacements, velocities or accelerations of the degrees of freedom (length n), at the places.
    pub fn at_places(&self, values: &[f64]) -> Vec<f64> {
        self.seen.iter().map(|axis| axis.along(values)).collect()
    }

    /// The joints.
    pub fn joints(&self) -> &[SystemJoint] {
        &self.joints
    }

    /// The axes of all joints, in their order: (joint, axis).
    pub fn axes(&self) -> impl Iterator<Item = (usize, &Axis)> {
        self.joints.iter().enumerate().flat_map(|(j, joint)| joint.axes.iter().map(move |axis| (j, axis)))
    }

    /// Excitation by harmonics, sorted by harmonic number, each at most once.
    pub fn loads(&self) -> &[Load] {
        &self.loads
    }

    /// Places with imposed motion that belong to no degree of freedom.
    pub fn moved(&self) -> &[MovedPlace] {
        &self.moved
    }

    /// Complex force amplitudes at drive frequency `omega` (rad/s): (harmonic, length n).
    pub fn excitation(&self, omega: f64) -> Vec<(u32, DVector<Complex64>)> {
        self.loads.iter().map(|load| (load.harmonic, load.at(omega))).collect()
    }

    /// Whether the excitation changes its sign after half a period, and all laws with it: then an orbit with `x(t + T/2) = -x(t)` exists.
    pub fn is_odd(&self) -> bool {
        let laws = self.joints.iter().all(|joint| joint.law.is_odd());
        laws && self.harmonics_of_excitation(|z| z != ZERO).iter().all(|h| !h.is_multiple_of(2))
    }

    /// The harmonics of loads and imposed motions whose amplitudes `counts` accepts; some may stand more than once.
    pub(crate) fn harmonics_of_excitation(&self, counts: impl Fn(Complex64) -> bool) -> Vec<u32> {
        let loads = self.loads.iter().filter(|load| load.amplitudes().any(|z| counts(*z))).map(|load| load.harmonic);
        let imposed = self.axes().flat_map(|(_, axis)| &axis.imposed);
        let moved = self.moved.iter().flat_map(|place| &place.motion);
        loads.chain(imposed.chain(moved).filter(|(_, z)| counts(*z)).map(|(h, _)| *h)).collect()
    }
}
