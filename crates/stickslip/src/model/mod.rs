//! The model as the user defines it: matrices, places, masses, bodies, springs, joints,
//! excitation.
//!
//! A [`Model`] is plain data in SI units. [`Model::assemble`] checks it and converts it into a
//! [`System`] of matrices.

mod assemble;
mod body;
mod collinear;
mod coordinates;
mod disk;
mod displacement_field;
mod error;
pub mod example;
mod incremental_stability;
mod name_resolution;
mod place;
mod substructure;
mod survey;
mod system;
mod view;

pub use body::{Body, ROTATIONS, TRANSLATIONS, inertia_matrix, with_rotations};
pub(crate) use collinear::{CollinearAxis, PARALLEL};
pub use disk::{
    Disk, MIN_SECTORS, MistunedProperty, NEXT, Ring, SectorDistribution, deviation_error, normal_deviations,
};
pub use displacement_field::DisplacementField;
pub use error::{Element, ElementFault, ModelError};
pub use name_resolution::{is_identifier, is_place};
pub use place::{Frame, FrameError, Place};
pub(crate) use survey::soft_spring;
pub use survey::{
    FirstSlip, FrictionDirection, LinearModes, LooseBody, NaturalMode, SlipOnset, Survey, UnloadedContacts, WaveModes,
};
pub use system::{
    Axis, CyclicSymmetry, ExcitationHarmonic, ExcitationSum, MovedPlace, System, SystemBuilder, SystemError,
    SystemJoint,
};
pub use view::View;

use crate::law::SharedLaw;
use crate::structure::{Boundary, Component, ReducedComponent, Reduction, SectorBasis};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

/// Name of the fixed frame.
pub const GROUND: &str = "ground";

/// A structure with joints and its excitation; all values in SI units.
///
/// A place is a mass, a direction of a mass (`name.direction`), [`GROUND`], or a place with an
/// imposed motion (see [`Motion`]).
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Model {
    /// A structure given by its matrices. Other elements attach to it at its places.
    pub substructure: Option<Substructure>,
    /// Places of the substructure.
    pub places: Vec<Place>,
    /// Point masses. Each mass has one degree of freedom per direction.
    pub masses: Vec<Mass>,
    /// Rigid bodies, with translations and rotations.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<Body>,
    /// Springs and dampers.
    pub springs: Vec<Spring>,
    /// Joints between places that touch or rub.
    pub joints: Vec<Joint>,
    /// Forces, harmonic in time.
    pub forces: Vec<Force>,
    /// Parts of forces that grow with the excitation frequency.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frequency_forces: Vec<FrequencyForce>,
    /// Imposed motions, harmonic in time.
    pub motions: Vec<Motion>,
    /// Layout of the elements if the model is the ring of a [`Disk`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ring: Option<Ring>,
}

/// A structure given by its matrices, as a part of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Substructure {
    /// The matrices.
    pub component: Component,
    /// Its damping.
    pub damping: SubstructureDamping,
    /// Reduction of the component to fewer coordinates.
    pub reduction: Reduction,
    /// Error of an earlier reduction, if the matrices themselves come from a reduced model.
    pub earlier_reduction: Option<ReductionAccuracy>,
    /// Coupling to the next sector, if the structure is a sector of a [`Disk`].
    pub disk: Option<DiskPart>,
}

impl Substructure {
    /// Returns this structure with the same damping and a reduction that is accurate to a
    /// higher frequency: `times` the range of the reduced component `few`. A sector keeps the size
    /// of its basis apart from the number of modes, and the error of the new basis is not computed.
    #[must_use]
    pub fn with_extended_range(&self, few: &ReducedComponent, times: f64) -> Substructure {
        let (tolerance, kind) = match self.reduction {
            Reduction::UpTo { tolerance, kind, .. } => (tolerance, kind),
            Reduction::Modes { .. } | Reduction::None { .. } => (Reduction::TOLERANCE, None),
        };
        let damping = match self.damping {
            SubstructureDamping::Ratio(ratio) => SubstructureDamping::RatioUpTo { ratio, up_to: few.intended_up_to() },
            damping => damping,
        };
        let reduction = Reduction::UpTo { up_to: times * few.intended_up_to(), tolerance, kind };
        let disk = self.disk.clone().map(|disk| DiskPart { basis: few.sector_basis(), ..disk });
        Substructure { damping, reduction, disk, ..self.clone() }
    }
}

/// Error of a reduced model relative to the full structure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ReductionAccuracy {
    /// Largest relative error at the observed places.
    pub error: f64,
    /// Upper end of the frequency range in which the error holds, rad/s.
    pub up_to: f64,
}

impl ReductionAccuracy {
    /// Combines the errors of two successive reductions: small relative errors add.
    #[must_use]
    pub fn combine(self, next: ReductionAccuracy) -> ReductionAccuracy {
        ReductionAccuracy { error: self.error + next.error, up_to: self.up_to.min(next.up_to) }
    }
}

/// Data of a structure that is one sector of a disk.
#[derive(Debug, Clone, PartialEq)]
pub struct DiskPart {
    /// Coupling to the next sector.
    pub boundary: Boundary,
    /// Rows of the matrices that belong to the blade. Empty if all blades are equal.
    pub blade: Vec<usize>,
    /// Relative deviations of the blade stiffness. A sector has one entry, a ring has one entry
    /// per sector; empty if all blades are equal.
    pub deviations: Vec<f64>,
    /// The size of the basis of a reduction up to a frequency, from an earlier reduction of a disk
    /// with equal blades. By default the size follows from the required error.
    pub basis: Option<SectorBasis>,
}

/// Damping of a substructure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SubstructureDamping {
    /// The damping matrix of the component, or no damping if the component has no damping
    /// matrix.
    Own,
    /// Each mode up to the frequency of interest has this fraction of critical damping. Motion
    /// above that frequency is damped in proportion to its stiffness.
    Ratio(f64),
    /// Like `Ratio`, up to a given frequency that does not depend on the reduction.
    RatioUpTo {
        /// Fraction of critical damping.
        ratio: f64,
        /// Highest frequency with this ratio, rad/s.
        up_to: f64,
    },
    /// `C = mass M + stiffness K`.
    Rayleigh {
        /// Factor of the mass matrix, 1/s.
        mass: f64,
        /// Factor of the stiffness matrix, s.
        stiffness: f64,
    },
}

impl Serialize for Substructure {
    /// Serializes the settings and the sizes of the matrices, not the matrices.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (mass, _, stiffness) = self.component.matrices();
        let fields = 5 + usize::from(self.earlier_reduction.is_some());
        let mut out = serializer.serialize_struct("Substructure", fields)?;
        out.serialize_field("rows", &self.component.dofs())?;
        out.serialize_field("entries_of_mass", &mass.len())?;
        out.serialize_field("entries_of_stiffness", &stiffness.len())?;
        out.serialize_field("damping", &format!("{:?}", self.damping))?;
        out.serialize_field("reduction", &format!("{:?}", self.reduction))?;
        if let Some(earlier) = &self.earlier_reduction {
            out.serialize_field("earlier", earlier)?;
        }
        out.end()
    }
}

/// A point mass.
///
/// A mass with one displacement is a place. A mass with several directions is a node, with one
/// place `name.direction` per direction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mass {
    /// Identifier.
    pub name: String,
    /// Mass, kg.
    pub mass: f64,
    /// Directions of a node, at most three, in the order that laws expect; a normal comes last.
    /// Empty for a mass with one displacement.
    pub directions: Vec<String>,
}

impl Mass {
    /// Creates a mass with one displacement.
    pub fn new(name: impl Into<String>, mass: f64) -> Self {
        Mass { name: name.into(), mass, directions: Vec::new() }
    }

    /// Returns this mass with several directions of motion.
    #[must_use]
    pub fn along(mut self, directions: &[&str]) -> Self {
        self.directions = directions.iter().map(|&along| along.to_owned()).collect();
        self
    }
}

/// A spring, with a viscous damper in parallel to it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spring {
    /// The two places that it connects.
    pub between: [String; 2],
    /// Stiffness, N/m; between rotations N m/rad.
    pub stiffness: f64,
    /// Viscous damping, kg/s; between rotations N m s/rad.
    pub damping: f64,
}

/// A joint between two places or nodes.
///
/// Along each direction, `u` is the displacement of the first place minus that of the second.
/// The force `f` of the law acts as `-f` on the first place and as `+f` on the second.
#[derive(Debug, Clone, Serialize)]
pub struct Joint {
    /// Identifier.
    pub name: String,
    /// The two places.
    pub between: [String; 2],
    /// Friction law.
    pub law: SharedLaw,
}

impl PartialEq for Joint {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && self.between == other.between && *self.law == *other.law
    }
}

/// A force `amplitude · cos(harmonic · Ω t + phase)`. Harmonic 0 is a constant force.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Force {
    /// The place on which it acts.
    pub on: String,
    /// Amplitude, N; for a moment on a rotation, N m.
    pub amplitude: f64,
    /// Phase lead, rad.
    pub phase: f64,
    /// Multiple of the excitation frequency.
    pub harmonic: u32,
}

/// A part of a force that grows with the excitation frequency Ω, such as the unbalance `m e Ω²`. It
/// adds `linear Ω + quadratic Ω²` to the amplitude of the force.
///
/// # Example
/// A rotor far above its resonance turns about its centre of mass: the amplitude is `m e / m`.
/// ```
/// use stickslip::method::{Method, event_driven::EventDriven};
/// use stickslip::model::{Force, FrequencyForce, GROUND, Mass, Model, Spring};
/// let (mass, unbalance) = (5.0, 1e-4);
/// let model = Model {
///     masses: vec![Mass::new("rotor", mass)],
///     springs: vec![Spring {
///         between: ["rotor".into(), GROUND.into()],
///         stiffness: 1.0,
///         damping: 1e-3,
///     }],
///     forces: vec![Force { on: "rotor".into(), amplitude: 0.0, phase: 0.0, harmonic: 1 }],
///     frequency_forces: vec![FrequencyForce { force: 0, linear: 0.0, quadratic: unbalance }],
///     ..Model::default()
/// };
/// let system = model.assemble().unwrap();
/// let orbit = EventDriven.solver(&system).unwrap().orbit(1e3).unwrap();
/// assert!((orbit.places[0].amplitude() * mass / unbalance - 1.0).abs() < 1e-5);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FrequencyForce {
    /// Index of the force, which has a harmonic above zero.
    pub force: usize,
    /// Amplitude per frequency, N s/rad.
    pub linear: f64,
    /// Amplitude per squared frequency, N s²/rad².
    pub quadratic: f64,
}

impl Model {
    /// Returns the amplitude of a force at an excitation frequency (rad/s), N.
    pub fn force_amplitude(&self, force: usize, omega: f64) -> f64 {
        let parts = self.frequency_forces.iter().filter(|part| part.force == force);
        let constant = self.forces.get(force).map_or(0.0, |force| force.amplitude);
        constant + parts.map(|part| omega * (part.linear + omega * part.quadratic)).sum::<f64>()
    }
}

/// An imposed motion `amplitude · cos(harmonic · Ω t + phase)` of a place.
///
/// The place either exists only because of this motion, or it is a mass, which then is no
/// longer a degree of freedom. Several motions of one place add up.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Motion {
    /// The place that moves.
    pub on: String,
    /// Amplitude, m; for a rotation, rad.
    pub amplitude: f64,
    /// Phase lead, rad.
    pub phase: f64,
    /// Multiple of the excitation frequency.
    pub harmonic: u32,
}
