//! From a model to a system: checks, and the matrices of `M x'' + C x' + K x + Σ W f = F(t)`.

use super::{GROUND, Model};
use crate::law::Law;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use std::collections::BTreeMap;
use std::fmt;
use stickslip_numerics::eigen;

/// A checked, assembled model.
///
/// `n` degrees of freedom, the masses that are not moved, in the order of the model.
/// `M x'' + C x' + K x + Σ_j W_j f_j = F(t)`, with `u_j = W_jᵀ x + g_j(t)` for joint `j`, where `g_j` comes from imposed motion.
#[derive(Debug, Clone, PartialEq)]
pub struct System {
    /// Names of the degrees of freedom, length n.
    pub places: Vec<String>,
    /// Mass matrix `M`, n × n, kg.
    pub mass: DMatrix<f64>,
    /// Damping matrix `C`, n × n, kg/s.
    pub damping: DMatrix<f64>,
    /// Stiffness matrix `K` of the structure without its joints, n × n, N/m.
    pub stiffness: DMatrix<f64>,
    /// The joints.
    pub joints: Vec<SystemJoint>,
    /// Excitation by harmonics, sorted by harmonic number, each at most once.
    pub loads: Vec<Load>,
    /// Places with imposed motion that belong to no degree of freedom.
    pub moved: Vec<MovedPlace>,
}

/// A joint in a system.
#[derive(Debug, Clone, PartialEq)]
pub struct SystemJoint {
    /// Name.
    pub name: String,
    /// Direction matrix `W`, n × d: `u = Wᵀ x + g(t)`, force on the structure `-W f`.
    pub direction: DMatrix<f64>,
    /// Friction law.
    pub law: Law,
    /// `g(t) = Re Σ_h G_h e^{j h Ω t}`: sorted (harmonic, complex amplitude in m) of the first direction.
    pub imposed: Vec<(u32, Complex64)>,
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
    /// For each joint the sign with which its force acts back on this place: the drive must supply `+sign · f`.
    pub joints: Vec<f64>,
}

impl System {
    /// Number of degrees of freedom.
    pub fn dofs(&self) -> usize {
        self.places.len()
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

    /// `√(φᵀMφ)` of mode `index` of the structure without its joints, scaled to a largest displacement of one: the modal amplitude
    /// (m √kg) of a metre at the place that moves most. Modes count by rising frequency from 0; zero if there is no such mode.
    pub fn modal_unit(&self, index: usize) -> f64 {
        let Some(factor) = self.mass.clone().cholesky() else { return 0.0 };
        let n = self.dofs();
        let Some(inverse) = factor.l().solve_lower_triangular(&DMatrix::identity(n, n)) else { return 0.0 };
        let Some(eigen) = eigen::symmetric(&inverse * &self.stiffness * inverse.transpose()) else { return 0.0 };
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        // an M-normalised shape has φᵀMφ = 1
        order.get(index).map_or(0.0, |&k| 1.0 / (inverse.transpose() * eigen.eigenvectors.column(k)).amax())
    }

    /// Whether the excitation changes its sign after half a period, and all friction laws with it: then an orbit with
    /// `x(t + T/2) = -x(t)` exists.
    pub fn is_odd(&self) -> bool {
        let laws = self.joints.iter().all(|joint| joint.law.is_odd());
        laws && self.harmonics_of_excitation(|z| z != Complex64::new(0.0, 0.0)).iter().all(|h| !h.is_multiple_of(2))
    }

    /// The harmonics of loads and imposed motions whose amplitudes `counts` accepts; some may stand more than once.
    pub(crate) fn harmonics_of_excitation(&self, counts: impl Fn(Complex64) -> bool) -> Vec<u32> {
        let loads = self
            .loads
            .iter()
            .filter(|load| load.force.iter().chain(load.by_velocity.iter()).any(|z| counts(*z)))
            .map(|load| load.harmonic);
        let imposed = self.joints.iter().flat_map(|joint| &joint.imposed);
        let moved = self.moved.iter().flat_map(|place| &place.motion);
        loads.chain(imposed.chain(moved).filter(|(_, z)| counts(*z)).map(|(h, _)| *h)).collect()
    }
}

/// The element of a model that an error is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs)] // index into the list of the model that has the same name
pub enum Element {
    Mass(usize),
    Spring(usize),
    Joint(usize),
    Force(usize),
    Motion(usize),
    Whole,
}

impl fmt::Display for Element {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, index) = match self {
            Element::Mass(i) => ("mass", i),
            Element::Spring(i) => ("spring", i),
            Element::Joint(i) => ("joint", i),
            Element::Force(i) => ("force", i),
            Element::Motion(i) => ("motion", i),
            Element::Whole => return write!(f, "model"),
        };
        write!(f, "{what} {}", index + 1)
    }
}

/// Why a model is refused: which element, which key of it, what is wrong.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{element}, `{key}`: {message}")]
pub struct ModelError {
    /// The element.
    pub element: Element,
    /// Its key (as in the study file).
    pub key: &'static str,
    /// What is wrong and what was expected.
    pub message: String,
    /// The name that was probably meant, if there is one like it.
    pub wrong_name: Option<String>,
}

impl ModelError {
    fn new(element: Element, key: &'static str, message: impl Into<String>) -> Self {
        ModelError { element, key, message: message.into(), wrong_name: None }
    }
}

/// Where a name leads.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Place {
    Ground,
    Free(usize),
    Moved(usize),
}

/// Whether `name` is an identifier `[A-Za-z][A-Za-z0-9_]*`.
pub fn is_identifier(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

impl Model {
    /// The names of all places: ground, the masses, the moved places.
    pub fn place_names(&self) -> Vec<&str> {
        let mut names = vec![GROUND];
        names.extend(self.masses.iter().map(|m| m.name.as_str()));
        for motion in &self.motions {
            if !names.contains(&motion.on.as_str()) {
                names.push(&motion.on);
            }
        }
        names
    }

    /// Checks the model and assembles its matrices.
    ///
    /// # Errors
    /// [`ModelError`] names the first element that is wrong: a name that is no identifier or stands twice, a place that does
    /// not exist, a value that is not finite or has the wrong sign, a force on a place that is no degree of freedom.
    ///
    /// # Example
    /// ```
    /// let system = stickslip::model::example::blade_couple().assemble().unwrap();
    /// assert_eq!(system.places, ["blade1", "contact", "blade3"]);
    /// ```
    pub fn assemble(&self) -> Result<System, ModelError> {
        let places = self.check_places()?;
        let (n, moved_count) = (
            places.values().filter(|p| matches!(p, Place::Free(_))).count(),
            places.values().filter(|p| matches!(p, Place::Moved(_))).count(),
        );
        let find = |name: &str, element: Element, key: &'static str| -> Result<Place, ModelError> {
            places.get(name).copied().ok_or_else(|| ModelError {
                wrong_name: Some(name.to_owned()),
                ..ModelError::new(element, key, format!("there is no place `{name}`"))
            })
        };

        // one matrix over free and moved places; it is cut into blocks below
        let total = n + moved_count;
        let index = |place: Place| match place {
            Place::Ground => None,
            Place::Free(i) => Some(i),
            Place::Moved(i) => Some(n + i),
        };
        let (mut mass, mut damping, mut stiffness) =
            (DVector::zeros(total), DMatrix::zeros(total, total), DMatrix::zeros(total, total));
        let mut names = vec![String::new(); total];
        for (name, place) in &places {
            if let Some(i) = index(*place) {
                names[i] = (*name).to_owned();
            }
        }
        for (i, m) in self.masses.iter().enumerate() {
            finite_at_least_zero(m.mass, Element::Mass(i), "mass", "kg")?;
            if let Some(row) = index(places[m.name.as_str()]) {
                mass[row] = m.mass;
            }
        }
        for (i, spring) in self.springs.iter().enumerate() {
            let element = Element::Spring(i);
            finite_at_least_zero(spring.stiffness, element, "stiffness", "N/m")?;
            if !spring.damping.is_finite() {
                return Err(ModelError::new(
                    element,
                    "damping",
                    format!("must be a finite number in kg/s, found {}", spring.damping),
                ));
            }
            let a = find(&spring.between[0], element, "between")?;
            let b = find(&spring.between[1], element, "between")?;
            differ(&spring.between, element)?;
            for (matrix, value) in [(&mut stiffness, spring.stiffness), (&mut damping, spring.damping)] {
                add_between(matrix, index(a), index(b), value);
            }
        }

        let mut motion_of = vec![BTreeMap::<u32, Complex64>::new(); moved_count];
        for (i, motion) in self.motions.iter().enumerate() {
            let element = Element::Motion(i);
            let value = harmonic_amplitude(motion.amplitude, motion.phase, element)?;
            if let Place::Moved(k) = find(&motion.on, element, "on")? {
                *motion_of[k].entry(motion.harmonic).or_default() += value;
            }
        }

        let mut loads = BTreeMap::<u32, (DVector<Complex64>, DVector<Complex64>)>::new();
        let zeros = || (DVector::zeros(n), DVector::zeros(n));
        for (i, force) in self.forces.iter().enumerate() {
            let element = Element::Force(i);
            let value = harmonic_amplitude(force.amplitude, force.phase, element)?;
            match find(&force.on, element, "on")? {
                Place::Free(row) => loads.entry(force.harmonic).or_insert_with(zeros).0[row] += value,
                Place::Ground => {
                    return Err(ModelError::new(element, "on", "a force on `ground` moves nothing; name a mass"));
                }
                Place::Moved(_) => {
                    let message = format!("`{}` has an imposed motion, a force on it changes nothing", force.on);
                    return Err(ModelError::new(element, "on", message));
                }
            }
        }
        for (k, motion) in motion_of.iter().enumerate() {
            for (&harmonic, &amplitude) in motion {
                let (force, by_velocity) = loads.entry(harmonic).or_insert_with(zeros);
                for row in 0..n {
                    force[row] -= amplitude * stiffness[(row, n + k)];
                    by_velocity[row] -= amplitude * damping[(row, n + k)];
                }
            }
        }

        let mut joints = Vec::with_capacity(self.joints.len());
        let mut signs = vec![vec![0.0; self.joints.len()]; moved_count];
        for (j, joint) in self.joints.iter().enumerate() {
            let element = Element::Joint(j);
            joint.law.check().map_err(|error| ModelError::new(element, "law", error.to_string()))?;
            differ(&joint.between, element)?;
            let mut direction = DMatrix::zeros(n, joint.law.directions());
            let mut imposed = BTreeMap::<u32, Complex64>::new();
            for (name, sign) in joint.between.iter().zip([1.0, -1.0]) {
                match find(name, element, "between")? {
                    Place::Ground => {}
                    Place::Free(row) => direction[(row, 0)] += sign,
                    Place::Moved(k) => {
                        signs[k][j] += sign;
                        for (&harmonic, &amplitude) in &motion_of[k] {
                            *imposed.entry(harmonic).or_default() += amplitude * sign;
                        }
                    }
                }
            }
            let imposed = imposed.into_iter().collect();
            joints.push(SystemJoint { name: joint.name.clone(), direction, law: joint.law, imposed });
        }

        let moved = (0..moved_count)
            .map(|k| {
                let row = |matrix: &DMatrix<f64>| {
                    (
                        DVector::from_fn(n, |i, _| matrix[(n + k, i)]),
                        (0..moved_count).map(|i| matrix[(n + k, n + i)]).collect(),
                    )
                };
                MovedPlace {
                    name: names[n + k].clone(),
                    motion: motion_of[k].iter().map(|(h, a)| (*h, *a)).collect(),
                    mass: mass[n + k],
                    stiffness: row(&stiffness),
                    damping: row(&damping),
                    joints: signs[k].clone(),
                }
            })
            .collect();
        Ok(System {
            places: names[..n].to_vec(),
            mass: DMatrix::from_diagonal(&mass.rows(0, n).into_owned()),
            damping: damping.view((0, 0), (n, n)).into_owned(),
            stiffness: stiffness.view((0, 0), (n, n)).into_owned(),
            joints,
            loads: loads
                .into_iter()
                .map(|(harmonic, (force, by_velocity))| Load { harmonic, force, by_velocity })
                .collect(),
            moved,
        })
    }

    /// Every name once, an identifier, and where it leads. Moved masses are no degrees of freedom.
    fn check_places(&self) -> Result<BTreeMap<&str, Place>, ModelError> {
        if self.masses.is_empty() && self.motions.is_empty() {
            return Err(ModelError::new(
                Element::Whole,
                "mass",
                "a model needs at least one mass or one imposed motion",
            ));
        }
        let identifier = |name: &str, element: Element, key: &'static str| {
            if name == GROUND {
                Err(ModelError::new(element, key, "`ground` is the fixed frame and cannot be declared"))
            } else if is_identifier(name) {
                Ok(())
            } else {
                let message = format!("`{name}` is no name: a letter first, then letters, digits and `_`");
                Err(ModelError::new(element, key, message))
            }
        };
        let mut places = BTreeMap::from([(GROUND, Place::Ground)]);
        let (mut free, mut moved) = (0, 0);
        for (i, mass) in self.masses.iter().enumerate() {
            identifier(&mass.name, Element::Mass(i), "name")?;
            let place = if self.motions.iter().any(|m| m.on == mass.name) {
                moved += 1;
                Place::Moved(moved - 1)
            } else {
                free += 1;
                Place::Free(free - 1)
            };
            if places.insert(&mass.name, place).is_some() {
                let message = format!("the name `{}` stands twice", mass.name);
                return Err(ModelError::new(Element::Mass(i), "name", message));
            }
        }
        for (i, motion) in self.motions.iter().enumerate() {
            identifier(&motion.on, Element::Motion(i), "on")?;
            if !places.contains_key(motion.on.as_str()) {
                places.insert(&motion.on, Place::Moved(moved));
                moved += 1;
            }
        }
        for (i, joint) in self.joints.iter().enumerate() {
            identifier(&joint.name, Element::Joint(i), "name")?;
            if places.contains_key(joint.name.as_str()) || self.joints[..i].iter().any(|j| j.name == joint.name) {
                let message = format!("the name `{}` stands twice", joint.name);
                return Err(ModelError::new(Element::Joint(i), "name", message));
            }
        }
        Ok(places)
    }
}

fn differ(between: &[String; 2], element: Element) -> Result<(), ModelError> {
    if between[0] == between[1] {
        let message = format!("both ends are `{}`; two different places are needed", between[0]);
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

fn harmonic_amplitude(amplitude: f64, phase: f64, element: Element) -> Result<Complex64, ModelError> {
    for (value, key) in [(amplitude, "amplitude"), (phase, "phase")] {
        if !value.is_finite() {
            return Err(ModelError::new(element, key, format!("must be a finite number, found {value}")));
        }
    }
    Ok(Complex64::from_polar(1.0, phase) * amplitude)
}

fn add_between(matrix: &mut DMatrix<f64>, a: Option<usize>, b: Option<usize>, value: f64) {
    for (row, other) in [(a, b), (b, a)] {
        if let Some(row) = row {
            matrix[(row, row)] += value;
            if let Some(column) = other {
                matrix[(row, column)] -= value;
            }
        }
    }
}
