//! Binary form of a model for pickles, without the laws of its joints, which are separate.

use super::matrices::Entries;
use serde::{Deserialize, Serialize};
use stickslip::law::SharedLaw;
use stickslip::model::{
    Body, Force, FrequencyForce, Joint, Mass, Model, Motion, Place, Ring, SectorDistribution, Spring, Substructure,
    SubstructureDamping,
};
use stickslip::structure::{Component, Reduction};
use stickslip_numerics::sparse::SparseMatrix;

/// Distribution of forces and of imposed motions around a disk.
type Arounds = [Vec<Option<SectorDistribution>>; 2];

/// Name, mass, inertia matrix, directions.
type StoredBody = (String, f64, [[f64; 3]; 3], Vec<String>);

#[derive(Serialize, Deserialize)]
struct StoredModel {
    /// Name, mass, directions.
    masses: Vec<(String, f64, Vec<String>)>,
    bodies: Vec<StoredBody>,
    /// Ends, stiffness, damping.
    springs: Vec<([String; 2], f64, f64)>,
    /// Name, ends.
    joints: Vec<(String, [String; 2])>,
    /// Place, amplitude, phase, harmonic.
    forces: Vec<(String, f64, f64, u32)>,
    /// Index of the force, amplitude per frequency and per squared frequency.
    frequency_forces: Vec<(usize, f64, f64)>,
    motions: Vec<(String, f64, f64, u32)>,
    around: [Vec<Option<StoredAround>>; 2],
    /// Number of sectors, flag for equal sectors, order.
    ring: Option<(usize, bool, Option<usize>)>,
    structure: Option<StoredStructure>,
    views: Vec<StoredView>,
}

/// Name, directions, rows, and the mass or body of a point or a face.
type StoredView = (String, Vec<String>, Vec<Entry>, String);

#[derive(Serialize, Deserialize)]
enum StoredAround {
    EngineOrder(i64),
    NodalDiameter(i64),
    Sector(usize),
}

/// A structure by matrices, as made by `from_matrices`.
#[derive(Serialize, Deserialize)]
struct StoredStructure {
    rows: Vec<String>,
    mass: Entries,
    damping: Option<Entries>,
    stiffness: Entries,
    damping_ratio: Option<f64>,
    /// Highest frequency of interest in rad/s.
    reduce: Option<f64>,
    /// Name, directions, rows.
    places: Vec<(String, Vec<String>, Vec<Entry>)>,
}

type Entry = Vec<(usize, f64)>;

/// Returns the parts of a model as bytes, without a structure that belongs to a study.
pub fn bytes(model: &Model, around: &Arounds, of_study: bool) -> Result<Vec<u8>, String> {
    let around = around.each_ref().map(|all| {
        let stored = |around: &SectorDistribution| match *around {
            SectorDistribution::EngineOrder(order) => StoredAround::EngineOrder(order),
            SectorDistribution::NodalDiameter(diameter) => StoredAround::NodalDiameter(diameter),
            SectorDistribution::Sector(sector) => StoredAround::Sector(sector),
        };
        all.iter().map(|around| around.as_ref().map(stored)).collect()
    });
    let structure = model.substructure.as_ref().filter(|_| !of_study);
    let stored = StoredModel {
        masses: model.masses.iter().map(|mass| (mass.name.clone(), mass.mass, mass.directions.clone())).collect(),
        bodies: model.bodies.iter().map(|b| (b.name.clone(), b.mass, b.inertia, b.directions.clone())).collect(),
        springs: model
            .springs
            .iter()
            .map(|spring| (spring.between.clone(), spring.stiffness, spring.damping))
            .collect(),
        joints: model.joints.iter().map(|joint| (joint.name.clone(), joint.between.clone())).collect(),
        forces: model.forces.iter().map(|one| (one.on.clone(), one.amplitude, one.phase, one.harmonic)).collect(),
        frequency_forces: model.frequency_forces.iter().map(|one| (one.force, one.linear, one.quadratic)).collect(),
        motions: model.motions.iter().map(|one| (one.on.clone(), one.amplitude, one.phase, one.harmonic)).collect(),
        around,
        ring: model.ring.map(|ring| (ring.sectors, ring.equal, ring.order)),
        structure: structure.map(|structure| StoredStructure::of(structure, &model.places)),
        views: model.places.iter().filter_map(stored_view).collect(),
    };
    rmp_serde::to_vec(&stored).map_err(|cause| cause.to_string())
}

/// Recreates a model from its parts and laws.
pub fn model(bytes: &[u8], laws: Vec<SharedLaw>) -> Result<(Model, Arounds), String> {
    let stored: StoredModel =
        rmp_serde::from_slice(bytes).map_err(|cause| format!("this is not a valid pickle of a model: {cause}"))?;
    if stored.joints.len() != laws.len() {
        return Err(format!(
            "this is not a valid pickle of a model: {} joints and {} laws",
            stored.joints.len(),
            laws.len()
        ));
    }
    let (substructure, places) = stored.structure.map(StoredStructure::made).transpose()?.unzip();
    let joints = stored.joints.into_iter().zip(laws);
    let view = |(name, directions, rows, of): StoredView| Place {
        directions,
        rows,
        ..Place::new(name, Vec::new()).as_view_of(of)
    };
    let model = Model {
        substructure,
        places: places.unwrap_or_default().into_iter().chain(stored.views.into_iter().map(view)).collect(),
        masses: stored.masses.into_iter().map(|(name, mass, directions)| Mass { name, mass, directions }).collect(),
        bodies: stored
            .bodies
            .into_iter()
            .map(|(name, mass, inertia, directions)| Body { name, mass, inertia, directions })
            .collect(),
        springs: stored
            .springs
            .into_iter()
            .map(|(between, stiffness, damping)| Spring { between, stiffness, damping })
            .collect(),
        joints: joints.map(|((name, between), law)| Joint { name, between, law }).collect(),
        forces: stored
            .forces
            .into_iter()
            .map(|(on, amplitude, phase, harmonic)| Force { on, amplitude, phase, harmonic })
            .collect(),
        frequency_forces: stored
            .frequency_forces
            .into_iter()
            .map(|(force, linear, quadratic)| FrequencyForce { force, linear, quadratic })
            .collect(),
        motions: stored
            .motions
            .into_iter()
            .map(|(on, amplitude, phase, harmonic)| Motion { on, amplitude, phase, harmonic })
            .collect(),
        ring: stored.ring.map(|(sectors, equal, order)| Ring { sectors, equal, order }),
    };
    let around = stored.around.map(|all| {
        let made = |around: StoredAround| match around {
            StoredAround::EngineOrder(order) => SectorDistribution::EngineOrder(order),
            StoredAround::NodalDiameter(diameter) => SectorDistribution::NodalDiameter(diameter),
            StoredAround::Sector(sector) => SectorDistribution::Sector(sector),
        };
        all.into_iter().map(|around| around.map(made)).collect()
    });
    Ok((model, around))
}

fn stored_view(place: &Place) -> Option<StoredView> {
    let of = place.view_of.clone()?;
    Some((place.name.clone(), place.directions.clone(), place.rows.clone(), of))
}

impl StoredStructure {
    fn of(structure: &Substructure, places: &[Place]) -> StoredStructure {
        let (mass, damping, stiffness) = structure.component.matrices();
        let entries = |matrix: &SparseMatrix| matrix.entries().collect();
        StoredStructure {
            rows: structure.component.rows().to_vec(),
            mass: entries(mass),
            damping: damping.map(entries),
            stiffness: entries(stiffness),
            damping_ratio: match structure.damping {
                SubstructureDamping::Ratio(ratio) => Some(ratio),
                _ => None,
            },
            reduce: match structure.reduction {
                Reduction::UpTo { up_to, .. } => Some(up_to),
                _ => None,
            },
            places: places
                .iter()
                .filter(|place| place.view_of.is_none())
                .map(|place| (place.name.clone(), place.directions.clone(), place.rows.clone()))
                .collect(),
        }
    }

    fn made(self) -> Result<(Substructure, Vec<Place>), String> {
        let n = self.rows.len();
        let matrix = |entries: Entries| SparseMatrix::from_triplets(n, entries).map_err(|cause| cause.to_string());
        let (mass, stiffness) = (matrix(self.mass)?, matrix(self.stiffness)?);
        let damping = self.damping.map(matrix).transpose()?;
        let component = Component::new(self.rows, mass, damping, stiffness).map_err(|cause| cause.to_string())?;
        let structure = Substructure {
            component,
            damping: self.damping_ratio.map_or(SubstructureDamping::Own, SubstructureDamping::Ratio),
            reduction: self.reduce.map_or(Reduction::None { up_to: 0.0 }, Reduction::up_to),
            earlier_reduction: None,
            disk: None,
        };
        let place = |(name, directions, rows)| Place { directions, rows, ..Place::new(name, Vec::new()) };
        Ok((structure, self.places.into_iter().map(place).collect()))
    }
}
