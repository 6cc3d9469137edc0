//! A model checked and assembled: a structure, its joints, its excitation.

use crate::law::{LawError, SharedLaw};
use crate::structure::Structure;
use nalgebra::DVector;
use num_complex::Complex64;
use std::collections::BTreeMap;

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
#[derive(Debug, Clone, PartialEq)]
pub struct System {
    structure: Structure,
    joints: Vec<SystemJoint>,
    loads: Vec<Load>,
    moved: Vec<MovedPlace>,
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

/// One direction of a joint: `u = Σ w x + g(t)`, and its force acts on the structure as `-w f`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axis {
    /// The direction's name, if its joint has several.
    name: Option<String>,
    rows: Vec<(usize, f64)>,
    imposed: Vec<(u32, Complex64)>,
}

impl Axis {
    /// Along degrees of freedom with their weights.
    pub fn new(rows: Vec<(usize, f64)>) -> Self {
        Axis { name: None, rows, imposed: Vec::new() }
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

    /// Its weights over all `n` degrees of freedom.
    pub fn dense(&self, n: usize) -> DVector<f64> {
        let mut out = DVector::zeros(n);
        self.rows.iter().for_each(|&(i, w)| out[i] += w);
        out
    }
}

/// One harmonic of the excitation: `Re((force + jhΩ·by_velocity) e^{j h Ω t})`.
#[derive(Debug, Clone, PartialEq)]
pub struct Load {
    /// Harmonic number h; 0 is constant.
    pub harmonic: u32,
    /// Complex force amplitudes, length n, N.
    pub force: DVector<Complex64>,
    /// Amplitudes of imposed motion times the dampers through which it acts, length n, kg m/s.
    pub by_velocity: DVector<Complex64>,
}

/// A place with imposed motion, and what hangs on it: needed for the force that moves it.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedPlace {
    /// Name.
    pub name: String,
    /// Sorted (harmonic, complex amplitude in m).
    pub motion: Vec<(u32, Complex64)>,
    /// Mass that moves along, kg.
    pub mass: f64,
    /// Row of the stiffness matrix towards the degrees of freedom (length n), and towards the moved places.
    pub stiffness: (DVector<f64>, Vec<f64>),
    /// The same for damping.
    pub damping: (DVector<f64>, Vec<f64>),
    /// For each axis of all joints, in their order, the sign with which its force acts back on this place: the drive must supply `+sign · f`.
    pub joints: Vec<f64>,
}

/// Why a system cannot be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SystemError {
    /// A joint has another number of axes than its law has directions.
    #[error("joint `{joint}` has {axes} axes, and its law `{law}` acts along {directions}")]
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
    #[error("{what} names degree of freedom {row}, and there are {dofs}: they count from 0")]
    Row {
        /// The joint or load.
        what: String,
        /// The number.
        row: usize,
        /// Degrees of freedom.
        dofs: usize,
    },
    /// A number is not finite.
    #[error("{what} has an entry that is not finite")]
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
}

/// Puts a system together; [`SystemBuilder::build`] checks it.
#[derive(Debug, Clone)]
pub struct SystemBuilder {
    structure: Structure,
    joints: Vec<SystemJoint>,
    loads: BTreeMap<u32, (DVector<Complex64>, DVector<Complex64>)>,
    moved: Vec<MovedPlace>,
    wrong: Option<SystemError>,
}

impl SystemBuilder {
    /// Adds a joint with one axis for each of its law's directions.
    #[must_use]
    pub fn joint(mut self, name: impl Into<String>, law: SharedLaw, axes: Vec<Axis>) -> Self {
        self.joints.push(SystemJoint { name: name.into(), law, axes });
        self
    }

    /// Adds a force on a degree of freedom: harmonic and complex amplitude, N.
    #[must_use]
    pub fn force(self, row: usize, harmonic: u32, amplitude: Complex64) -> Self {
        self.load(row, harmonic, amplitude, ZERO)
    }

    /// Adds a force (N) and one that grows with frequency (kg m/s, times jhΩ) on a degree of freedom.
    #[must_use]
    pub(super) fn load(mut self, row: usize, harmonic: u32, force: Complex64, by_velocity: Complex64) -> Self {
        let n = self.structure.dofs();
        let what = || format!("a force of harmonic {harmonic}");
        if row >= n {
            self.wrong.get_or_insert_with(|| SystemError::Row { what: what(), row, dofs: n });
        } else if !(force.is_finite() && by_velocity.is_finite()) {
            self.wrong.get_or_insert_with(|| SystemError::NotFinite { what: what() });
        } else {
            let zeros = || (DVector::from_element(n, ZERO), DVector::from_element(n, ZERO));
            let load = self.loads.entry(harmonic).or_insert_with(zeros);
            load.0[row] += force;
            load.1[row] += by_velocity;
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
        for joint in &self.joints {
            let (axes, directions) = (joint.axes.len(), joint.law.directions());
            if axes != directions {
                return Err(SystemError::Axes { joint: joint.name.clone(), law: joint.law.name(), axes, directions });
            }
            joint.law.check().map_err(|error| SystemError::Law { joint: joint.name.clone(), error })?;
            for axis in &joint.axes {
                let what = || format!("joint `{}`", joint.name);
                if let Some(&(row, _)) = axis.rows.iter().find(|(row, _)| *row >= n) {
                    return Err(SystemError::Row { what: what(), row, dofs: n });
                }
                let finite = axis.rows.iter().all(|(_, w)| w.is_finite());
                if !(finite && axis.imposed.iter().all(|(_, g)| g.is_finite())) {
                    return Err(SystemError::NotFinite { what: what() });
                }
            }
        }
        let load = |(harmonic, (force, by_velocity))| Load { harmonic, force, by_velocity };
        Ok(System {
            structure: self.structure,
            joints: self.joints,
            loads: self.loads.into_iter().map(load).collect(),
            moved: self.moved,
        })
    }
}

impl System {
    /// Begins a system on a structure.
    pub fn builder(structure: Structure) -> SystemBuilder {
        SystemBuilder { structure, joints: Vec::new(), loads: BTreeMap::new(), moved: Vec::new(), wrong: None }
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
        let loads = self.loads.iter().map(|load| (load.harmonic, (load.force.clone(), load.by_velocity.clone())));
        let builder = SystemBuilder {
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
        let mut system = self.clone();
        system.loads.iter_mut().for_each(|load| load.harmonic *= periods);
        let axes = system.joints.iter_mut().flat_map(|joint| &mut joint.axes);
        axes.flat_map(|axis| &mut axis.imposed).for_each(|(h, _)| *h *= periods);
        system.moved.iter_mut().flat_map(|place| &mut place.motion).for_each(|(h, _)| *h *= periods);
        system
    }

    /// Number of degrees of freedom.
    pub fn dofs(&self) -> usize {
        self.structure.dofs()
    }

    /// Names of the degrees of freedom, length n.
    pub fn places(&self) -> &[String] {
        self.structure.places()
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
        self.loads
            .iter()
            .map(|load| {
                let rate = Complex64::new(0.0, f64::from(load.harmonic) * omega);
                (load.harmonic, &load.force + &load.by_velocity * rate)
            })
            .collect()
    }

    /// Whether the excitation changes its sign after half a period, and all laws with it: then an orbit with `x(t + T/2) = -x(t)` exists.
    pub fn is_odd(&self) -> bool {
        let laws = self.joints.iter().all(|joint| joint.law.is_odd());
        laws && self.harmonics_of_excitation(|z| z != ZERO).iter().all(|h| !h.is_multiple_of(2))
    }

    /// The harmonics of loads and imposed motions whose amplitudes `counts` accepts; some may stand more than once.
    pub(crate) fn harmonics_of_excitation(&self, counts: impl Fn(Complex64) -> bool) -> Vec<u32> {
        let loads = self
            .loads
            .iter()
            .filter(|load| load.force.iter().chain(load.by_velocity.iter()).any(|z| counts(*z)))
            .map(|load| load.harmonic);
        let imposed = self.axes().flat_map(|(_, axis)| &axis.imposed);
        let moved = self.moved.iter().flat_map(|place| &place.motion);
        loads.chain(imposed.chain(moved).filter(|(_, z)| counts(*z)).map(|(h, _)| *h)).collect()
    }
}
