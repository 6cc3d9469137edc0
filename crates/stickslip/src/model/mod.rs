//! What the user states: a structure by its matrices and its places, masses, rigid bodies, springs, joints, forces, imposed motions.
//!
//! A [`Model`] is plain data in SI units. [`Model::assemble`] checks it and turns it into a [`System`] of matrices.

mod assemble;
mod body;
mod contraction;
mod coordinates;
mod disk;
mod error;
pub mod example;
mod line;
mod part;
mod place;
mod places;
mod survey;
mod system;

pub use body::{Body, ROTATIONS, TRANSLATIONS, with_rotations};
pub use disk::{Around, Disk, LEAST_SECTORS, Mistuned, NEXT, Ring, normal_pattern, too_far};
pub use error::{Element, ModelError};
pub(crate) use line::{Line, PARALLEL};
pub use place::{Frame, FrameError, Place};
pub use places::{is_identifier, is_place};
pub use survey::{FirstSlip, LinearMode, Loose, Modes, Onset, Survey, Unpressed, WaveModes};
pub use system::{Axis, Cyclic, Load, MovedPlace, System, SystemBuilder, SystemError, SystemJoint};

use crate::law::SharedLaw;
use crate::structure::{Boundary, Component, ReducedComponent, Reduction};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

/// Name of the fixed frame.
pub const GROUND: &str = "ground";

/// A structure with joints and its excitation, as stated by the user; all values SI.
///
/// A place is a mass, a direction of one (`name.direction`), [`GROUND`], or a place that is moved (see [`Motion`]).
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Model {
    /// A structure by its matrices; all else may be added to it at its places.
    pub substructure: Option<Substructure>,
    /// Places of the substructure.
    pub places: Vec<Place>,
    /// Point masses; each is one degree of freedom.
    pub masses: Vec<Mass>,
    /// Rigid bodies, which turn as well.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<Body>,
    /// Springs and dampers.
    pub springs: Vec<Spring>,
    /// Places that rub.
    pub joints: Vec<Joint>,
    /// Forces, harmonic in time.
    pub forces: Vec<Force>,
    /// Imposed motions, harmonic in time.
    pub motions: Vec<Motion>,
    /// If it is the ring of a [`Disk`]: how its elements stand.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ring: Option<Ring>,
}

/// A structure by its matrices, as a part of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Substructure {
    /// The matrices.
    pub component: Component,
    /// Its damping.
    pub damping: SubstructureDamping,
    /// How it is brought into few coordinates.
    pub reduction: Reduction,
    /// Where its matrices are themselves those of a reduction: what that one left out.
    pub earlier: Option<ReductionEvidence>,
    /// If it is a sector of a [`Disk`]: how it goes on.
    pub disk: Option<DiskPart>,
}

impl Substructure {
    /// The same structure, with the same damping, in as many coordinates as it takes to reach `times` as far as `few` of it do.
    #[must_use]
    pub fn farther(&self, few: &ReducedComponent, times: f64) -> Substructure {
        let (tolerance, kind) = match self.reduction {
            Reduction::UpTo { tolerance, kind, .. } => (tolerance, kind),
            Reduction::Modes { .. } | Reduction::None { .. } => (Reduction::TOLERANCE, None),
        };
        let damping = match self.damping {
            SubstructureDamping::Ratio(ratio) => SubstructureDamping::RatioUpTo { ratio, up_to: few.serves() },
            damping => damping,
        };
        let reduction = Reduction::UpTo { up_to: times * few.serves(), tolerance, kind };
        Substructure { damping, reduction, ..self.clone() }
    }
}

/// How far a structure in few coordinates is from the whole.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ReductionEvidence {
    /// The largest relative error of what is seen.
    pub error: f64,
    /// The error holds up to there, rad/s.
    pub up_to: f64,
}

impl ReductionEvidence {
    /// Of one reduction and another of its result: small relative errors add.
    #[must_use]
    pub fn then(self, next: ReductionEvidence) -> ReductionEvidence {
        ReductionEvidence { error: self.error + next.error, up_to: self.up_to.min(next.up_to) }
    }
}

/// A structure by its matrices as a sector of a disk.
#[derive(Debug, Clone, PartialEq)]
pub struct DiskPart {
    /// How it is tied to the next sector.
    pub boundary: Boundary,
    /// Rows of the matrices that belong to the blade; none if the blades do not differ.
    pub blade: Vec<usize>,
    /// Deviation of the blade's stiffness, relative: that of this sector, and of a ring those of all sectors. None if they do not differ.
    pub deviations: Vec<f64>,
}

/// Damping of a substructure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SubstructureDamping {
    /// That of the component's own matrix; none if it has none.
    Own,
    /// Every mode up to the frequency of interest has this share of critical damping; what lies above is damped in proportion to its
    /// stiffness.
    Ratio(f64),
    /// The same up to a frequency that is stated, whatever the reduction reaches.
    RatioUpTo {
        /// Share of critical damping.
        ratio: f64,
        /// rad/s.
        up_to: f64,
    },
    /// `C = mass M + stiffness K`, 1/s and s.
    Rayleigh {
        /// 1/s.
        mass: f64,
        /// s.
        stiffness: f64,
    },
}

impl Serialize for Substructure {
    /// What it is, without its matrices.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (mass, _, stiffness) = self.component.matrices();
        let fields = 5 + usize::from(self.earlier.is_some());
        let mut out = serializer.serialize_struct("Substructure", fields)?;
        out.serialize_field("rows", &self.component.dofs())?;
        out.serialize_field("entries_of_mass", &mass.len())?;
        out.serialize_field("entries_of_stiffness", &stiffness.len())?;
        out.serialize_field("damping", &format!("{:?}", self.damping))?;
        out.serialize_field("reduction", &format!("{:?}", self.reduction))?;
        if let Some(earlier) = &self.earlier {
            out.serialize_field("earlier", earlier)?;
        }
        out.end()
    }
}

/// A point mass. It has one displacement and is a place, or several, and then is a node with a place `name.direction` for each.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mass {
    /// Identifier.
    pub name: String,
    /// Mass, kg.
    pub mass: f64,
    /// Its directions if it is a node, at most three, in the order in which laws take them; a normal is the last.
    pub directions: Vec<String>,
}

impl Mass {
    /// A mass with one displacement.
    pub fn new(name: impl Into<String>, mass: f64) -> Self {
        Mass { name: name.into(), mass, directions: Vec::new() }
    }

    /// The same mass free to move along several directions.
    #[must_use]
    pub fn along(mut self, directions: &[&str]) -> Self {
        self.directions = directions.iter().map(|&along| along.to_owned()).collect();
        self
    }
}

/// A spring, with a viscous damper in parallel to it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spring {
    /// The two places it joins.
    pub between: [String; 2],
    /// Stiffness, N/m; between rotations N m/rad.
    pub stiffness: f64,
    /// Viscous damping, kg/s; between rotations N m s/rad.
    pub damping: f64,
}

/// Two places or nodes that rub or touch: along each direction `u` is the displacement of the first minus that of the second, and the law's force `f` acts on the
/// first as `-f`, on the second as `+f`.
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

/// A force `amplitude · cos(harmonic · Ω t + phase)`; a harmonic 0 makes it constant.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Force {
    /// The mass it acts on.
    pub on: String,
    /// Amplitude, N; of a moment, on a rotation, N m.
    pub amplitude: f64,
    /// Phase lead, rad.
    pub phase: f64,
    /// Multiple of the drive frequency.
    pub harmonic: u32,
}

/// An imposed motion `amplitude · cos(harmonic · Ω t + phase)` of a place. The place is either one that exists only by this
/// motion, or a mass, which then is no degree of freedom any more. Several motions of one place add up.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Motion {
    /// The place that is moved.
    pub on: String,
    /// Amplitude, m; of a rotation rad.
    pub amplitude: f64,
    /// Phase lead, rad.
    pub phase: f64,
    /// Multiple of the drive frequency.
    pub harmonic: u32,
}
