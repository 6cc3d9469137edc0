//! A matrix structure as a part of a model: its coordinates, matrices and places.
//!
//! For a disk, they cover all sectors.

use super::error::{Element, ModelError};
use super::{DiskPart, Model, Place, Substructure, SubstructureDamping};
use crate::structure::reduction::{ReducedMatrices, ReductionError, Row, StructureDamping};
use crate::structure::{
    BladeCache, ModalDamping, ReducedComponent, ReducedForm, Reduction, RingEntry, RingRow, SectorBasis, SectorCache,
};
use nalgebra::DMatrix;
use std::sync::Arc;
use stickslip_numerics::sparse::ModesError;

/// Entries of a matrix: (row, column, value).
pub(super) type Entries = Vec<(usize, usize, f64)>;

/// The substructure in its own coordinates. For a ring, the coordinates of all sectors, one
/// sector after the other.
#[derive(Default)]
pub(super) struct SubstructureParts {
    pub names: Vec<String>,
    /// Rows for each place of the model and each of its directions.
    pub places: Vec<Vec<Row>>,
    /// Entries of mass, damping and stiffness.
    pub entries: [Entries; 3],
    /// Entries of a ring of equal sectors, in addition.
    pub ring: Option<RingEntries>,
    /// Modal damping in addition to the damping entries, over its coordinates.
    pub modes: Option<ModalDamping>,
    pub reduced: Option<Arc<ReducedComponent>>,
}

/// The matrices of a ring of equal sectors.
pub(super) struct RingEntries {
    pub sectors: usize,
    /// Entries of mass, damping and stiffness in the rows of the first sector. Modal damping has
    /// the most, because it couples all sectors.
    pub entries: [Arc<Vec<RingEntry>>; 3],
}

impl RingEntries {
    /// Returns the entries of all sectors, each with `dofs` coordinates.
    pub fn around(&self, dofs: usize) -> [Entries; 3] {
        let next = |sector: usize, shift: i64| (sector as i64 + shift).rem_euclid(self.sectors as i64) as usize;
        self.entries.each_ref().map(|entries| {
            let all = (0..self.sectors).flat_map(|sector| entries.iter().map(move |entry| (sector, entry)));
            all.map(|(sector, &(row, column, shift, value))| {
                (sector * dofs + row, next(sector, shift) * dofs + column, value)
            })
            .collect()
        })
    }
}

impl SubstructureParts {
    pub fn new(substructure: &Substructure, model: &Model) -> Result<Self, ModelError> {
        let n = substructure.component.dofs();
        for (i, place) in model.places.iter().enumerate().filter(|(_, place)| place.view_of.is_none()) {
            for row in &place.rows {
                let wrong = |key, message: String| Err(ModelError::new(Element::Place(i), key, message));
                if let Some((at, _)) = row.iter().find(|(at, _)| *at >= n) {
                    return wrong("dof", format!("row {} does not exist; the structure has {n} rows", at + 1));
                }
                if row.iter().all(|(_, weight)| *weight == 0.0) || row.iter().any(|(_, weight)| !weight.is_finite()) {
                    return wrong("dof", "the weights must be finite numbers, not all zero".to_owned());
                }
            }
        }
        match (model.ring, &substructure.disk) {
            (Some(ring), Some(of)) => return SubstructureParts::ring(substructure, of, ring.sectors, model),
            // without a ring, places of all sectors would refer to one sector
            (None, Some(_)) => {
                let message = "a sector given by matrices needs a ring, which defines the number of sectors: create \
                               it with `Disk::ring`; for the whole ring without travelling waves, use `Ring { order: \
                               None, .. }`";
                return Err(ModelError::new(Element::Whole, "boundary", message));
            }
            (_, None) => {}
        }
        match substructure.reduction {
            Reduction::None { up_to } => SubstructureParts::full(substructure, up_to, model),
            _ => SubstructureParts::reduced(substructure, model),
        }
    }

    fn full(substructure: &Substructure, up_to: f64, model: &Model) -> Result<Self, ModelError> {
        let (mass, own, stiffness) = substructure.component.matrices();
        let entries: Entries = mass.entries().collect();
        let springs: Entries = stiffness.entries().collect();
        let times = |entries: &Entries, factor: f64| -> Entries {
            let all = entries.iter().filter(|_| factor != 0.0);
            all.map(|(row, column, value)| (*row, *column, factor * value)).collect()
        };
        let mut modes = None;
        let mut modal = |ratio: f64, up_to: f64| {
            let (stiffness, damped) = substructure.component.modal_damping(ratio, up_to).map_err(reduction_error)?;
            modes = Some(damped).filter(|damped| !damped.is_empty());
            Ok::<_, ModelError>(times(&springs, stiffness))
        };
        let damping = match substructure.damping {
            SubstructureDamping::Own => own.map_or_else(Vec::new, |own| own.entries().collect()),
            SubstructureDamping::Rayleigh { mass, stiffness } => {
                [times(&entries, mass), times(&springs, stiffness)].concat()
            }
            SubstructureDamping::Ratio(ratio) => modal(ratio, up_to)?,
            SubstructureDamping::RatioUpTo { ratio, up_to } => modal(ratio, up_to)?,
        };
        let named = |(at, name): (usize, &String)| row_name(at, name);
        Ok(SubstructureParts {
            names: substructure.component.rows().iter().enumerate().map(named).collect(),
            places: model.places.iter().map(|place| place.displacements(&place.rows)).collect(),
            entries: [entries, damping, springs],
            modes,
            ring: None,
            reduced: None,
        })
    }

    fn reduced(substructure: &Substructure, model: &Model) -> Result<Self, ModelError> {
        let seen = Place::substructure_rows(&model.places);
        let component = substructure.component.reduced(&seen, &substructure.reduction).map_err(reduction_error)?;
        let ReducedForm::Alone(reduced) = component.form() else { return Ok(SubstructureParts::default()) };
        let damped = damping_law(substructure, &component).map(|damping| reduced.damped(&damping));
        let damped = damped.transpose().map_err(reduction_error)?;
        let reduced = damped.as_ref().unwrap_or(reduced);
        let entries = |matrix: &DMatrix<f64>| -> Entries {
            let all = (0..matrix.ncols()).flat_map(|k| (0..matrix.nrows()).map(move |i| (i, k)));
            all.map(|at| (at.0, at.1, matrix[at])).filter(|entry| entry.2 != 0.0).collect()
        };
        let ReducedMatrices { mass, damping, stiffness, ports, .. } = reduced;
        Ok(SubstructureParts {
            names: (1..=reduced.dofs()).map(|number| format!("coordinate {number}")).collect(),
            places: displacements(&model.places, ports),
            entries: [entries(mass), entries(damping), entries(stiffness)],
            ring: None,
            modes: None,
            reduced: Some(component),
        })
    }

    /// Returns the parts of all sectors of a disk.
    fn ring(substructure: &Substructure, disk: &DiskPart, sectors: usize, model: &Model) -> Result<Self, ModelError> {
        let Substructure { component, reduction, .. } = substructure;
        if !model.places.len().is_multiple_of(sectors) {
            let message = format!(
                "{} places on {sectors} sectors: all sectors must have the same number of places",
                model.places.len()
            );
            return Err(ModelError::new(Element::Whole, "place", message));
        }
        let stated = &model.places[..model.places.len() / sectors];
        let unlike = model.places.iter().enumerate().find(|(i, place)| place.rows != stated[i % stated.len()].rows);
        if let Some((i, _)) = unlike {
            let message =
                "its rows differ from those in the first sector; all sectors must be observed at the same rows";
            return Err(ModelError::new(Element::Place(i), "dof", message));
        }
        let seen = Place::substructure_rows(stated);
        let kept = component.sector(&disk.boundary, sectors);
        let blade = match disk.deviations.iter().any(|deviation| *deviation != 0.0) {
            true => Some(kept.blade(component, &disk.blade)),
            false => None,
        };
        let blade = blade.transpose();
        let blade = blade.map_err(|error| ModelError::new(Element::Substructure, "blade", error.to_string()))?;
        let one = match (reduction, &blade) {
            (Reduction::None { .. }, _) => SectorParts::whole(substructure, &kept, &seen, blade.as_deref())?,
            (_, None) => SectorParts::reduced(substructure, (&kept, disk.basis), &seen, sectors)?,
            (_, Some(blade)) => {
                let component = match (*reduction, disk.basis) {
                    (Reduction::UpTo { up_to, .. }, Some(basis)) => {
                        kept.mistuned_by_size(blade, (&disk.deviations, &seen), (up_to, basis))
                    }
                    _ => kept.mistuned(blade, &disk.deviations, &seen, reduction),
                };
                return SubstructureParts::mistuned_ring(substructure, component.map_err(reduction_error)?, model);
            }
        };
        let n = one.names.len();
        let at = |sector: usize, shift: i64, row: usize| {
            (sector as i64 + shift).rem_euclid(sectors as i64) as usize * n + row
        };
        let ring = RingEntries { sectors, entries: one.entries };
        let equal = disk.deviations.iter().all(|deviation| *deviation == 0.0);
        let [mass, mut damping, mut stiffness] = if equal { Default::default() } else { ring.around(n) };
        let of_springs = match substructure.damping {
            SubstructureDamping::Rayleigh { stiffness, .. } => stiffness,
            _ => 0.0,
        };
        for (s, &deviation) in disk.deviations.iter().enumerate().filter(|(_, deviation)| **deviation != 0.0) {
            let more = one.of_blade.iter().map(|(i, k, value)| (at(s, 0, *i), at(s, 0, *k), deviation * value));
            stiffness.extend(more.clone());
            damping.extend(more.filter(|_| of_springs != 0.0).map(|(i, k, value)| (i, k, of_springs * value)));
        }
        let mut next = 0;
        let mut places = Vec::with_capacity(model.places.len());
        for (i, place) in model.places.iter().enumerate() {
            let s = i / stated.len();
            next = if i % stated.len() == 0 { 0 } else { next };
            if place.view_of.is_some() {
                places.push(Vec::new());
                continue;
            }
            let rows = one.places[next..next + place.rows.len()].iter();
            let rows = rows.map(|row| row.iter().map(|&(to, shift, weight)| (at(s, shift, to), weight)).collect());
            next += place.rows.len();
            places.push(place.displacements(&rows.collect::<Vec<Row>>()));
        }
        let names = (0..sectors).flat_map(|s| one.names.iter().map(move |name| format!("{name}, sector {s}")));
        Ok(SubstructureParts {
            names: names.collect(),
            places,
            entries: [mass, damping, stiffness],
            ring: equal.then_some(ring),
            modes: None,
            reduced: one.reduced,
        })
    }

    /// Returns a mistuned ring in its own modes.
    fn mistuned_ring(
        substructure: &Substructure,
        component: Arc<ReducedComponent>,
        model: &Model,
    ) -> Result<Self, ModelError> {
        let ReducedForm::Ring(modes) = component.form() else { return Err(reduction_error(ReductionError::NoPorts)) };
        let damping = modes.damped(damping_law(substructure, &component).as_ref()).map_err(reduction_error)?;
        let own = |of: usize| modes.own.iter().enumerate().map(|(k, own)| (k, k, own[of])).collect();
        Ok(SubstructureParts {
            names: (1..=modes.own.len()).map(|number| format!("mode {number}")).collect(),
            places: displacements(&model.places, &modes.seen),
            entries: [own(0), damping, own(1)],
            ring: None,
            modes: None,
            reduced: Some(component),
        })
    }
}

/// Returns the displacements of each place as weighted sums of the coordinates, from the rows of
/// all observed displacements. A view of another place has none.
fn displacements(places: &[Place], observed: &DMatrix<f64>) -> Vec<Vec<Row>> {
    let row = |row: usize| observed.row(row).iter().copied().enumerate().filter(|(_, w)| *w != 0.0).collect();
    let mut next = 0;
    let of_place = |place: &Place| {
        if place.view_of.is_some() {
            return Vec::new();
        }
        next += place.rows.len();
        place.displacements(&(next - place.rows.len()..next).map(row).collect::<Vec<Row>>())
    };
    places.iter().map(of_place).collect()
}

/// One sector as a part of a ring.
struct SectorParts {
    names: Vec<String>,
    /// One row for each observed displacement.
    places: Vec<RingRow>,
    entries: [Arc<Vec<RingEntry>>; 3],
    /// Stiffness entries of the blade for a relative deviation of one, if the blades differ.
    of_blade: Vec<(usize, usize, f64)>,
    reduced: Option<Arc<ReducedComponent>>,
}

impl SectorParts {
    fn whole(
        substructure: &Substructure,
        kept: &SectorCache,
        seen: &[Row],
        blade: Option<&BladeCache>,
    ) -> Result<Self, ModelError> {
        let sector = &kept.sector;
        let damping = match substructure.damping {
            SubstructureDamping::Own => sector.damping.clone().unwrap_or_default(),
            SubstructureDamping::Rayleigh { mass, stiffness } => {
                [scaled(&sector.mass, mass), scaled(&sector.stiffness, stiffness)].concat()
            }
            SubstructureDamping::Ratio(_) | SubstructureDamping::RatioUpTo { .. } => return Err(modal_damping_error()),
        };
        let rows = substructure.component.rows();
        Ok(SectorParts {
            names: sector.kept.iter().map(|&row| row_name(row, &rows[row])).collect(),
            places: seen.iter().map(|row| sector.row(row)).collect(),
            entries: [sector.mass.clone(), damping, sector.stiffness.clone()].map(Arc::new),
            of_blade: blade.map_or_else(Vec::new, |blade| blade.entries().to_vec()),
            reduced: None,
        })
    }

    fn reduced(
        substructure: &Substructure,
        (kept, basis): (&SectorCache, Option<SectorBasis>),
        seen: &[Row],
        sectors: usize,
    ) -> Result<Self, ModelError> {
        let component = match (substructure.reduction, basis) {
            (Reduction::UpTo { up_to, .. }, Some(basis)) => kept.reduced_by_size(seen, up_to, basis),
            _ => kept.reduced(seen, &substructure.reduction),
        };
        let component = component.map_err(reduction_error)?;
        let ReducedForm::Sector(sector) = component.form() else {
            return Err(reduction_error(ReductionError::NoPorts));
        };
        let damping = match damping_law(substructure, &component) {
            Some(law) => sector.damped(&law, sectors).map_err(reduction_error)?,
            None => Arc::new(sector.damping.clone().unwrap_or_default()),
        };
        let mut places = vec![RingRow::new(); seen.len()];
        sector.ports.iter().for_each(|&(port, at, shift, weight)| places[port].push((at, shift, weight)));
        Ok(SectorParts {
            names: (1..=sector.dofs()).map(|number| format!("coordinate {number}")).collect(),
            places,
            entries: [Arc::new(sector.mass.clone()), damping, Arc::new(sector.stiffness.clone())],
            of_blade: Vec::new(),
            reduced: Some(component),
        })
    }
}

/// Returns the name of a row of the matrices.
fn row_name(at: usize, name: &str) -> String {
    if name.is_empty() { format!("row {}", at + 1) } else { format!("row {name}") }
}

fn scaled(entries: &[RingEntry], factor: f64) -> Vec<RingEntry> {
    let all = entries.iter().filter(|_| factor != 0.0);
    all.map(|&(row, column, shift, value)| (row, column, shift, factor * value)).collect()
}

fn reduction_error(error: ReductionError) -> ModelError {
    let key = match &error {
        ReductionError::Modes(ModesError::Negative { .. }) => "stiffness",
        ReductionError::Modes(ModesError::NegativeMass) => "mass",
        _ => "reduce",
    };
    ModelError::new(Element::Substructure, key, error.to_string())
}

/// Returns the damping of a reduced component, unless a matrix defines the damping.
fn damping_law(substructure: &Substructure, component: &ReducedComponent) -> Option<StructureDamping> {
    match substructure.damping {
        SubstructureDamping::Own => None,
        SubstructureDamping::Ratio(ratio) => Some(StructureDamping::Ratio { ratio, up_to: component.intended_up_to() }),
        SubstructureDamping::RatioUpTo { ratio, up_to } => Some(StructureDamping::Ratio { ratio, up_to }),
        SubstructureDamping::Rayleigh { mass, stiffness } => Some(StructureDamping::Rayleigh { mass, stiffness }),
    }
}

fn modal_damping_error() -> ModelError {
    let message = "a damping ratio needs the modes of the ring, which are computed only with a reduction; use \
                   `rayleigh` or a damping matrix, or remove `reduce = false`";
    ModelError::new(Element::Substructure, "modal_damping", message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Disk, Force, GROUND, Mass, Place, SectorDistribution, Spring};
    use crate::structure::{Boundary, Component};
    use stickslip_numerics::sparse::SparseMatrix;

    const DEVIATIONS: [f64; 5] = [0.03, -0.02, 0.0, 0.01, -0.04];

    fn force() -> Vec<Force> {
        vec![Force { on: "tip".into(), amplitude: 1.0, phase: 0.0, harmonic: 1 }]
    }

    /// A sector of masses: a disk mass with a spring to the next sector, and a blade of two
    /// masses whose springs deviate.
    fn by_masses(deviation: f64) -> Model {
        let spring = |a: &str, b: &str, stiffness| Spring { between: [a.into(), b.into()], stiffness, damping: 0.0 };
        let blade = 1.0 + deviation;
        Model {
            masses: vec![Mass::new("disk", 2.0), Mass::new("middle", 0.3), Mass::new("tip", 0.2)],
            springs: vec![
                spring("disk", GROUND, 30.0),
                spring("disk", "next.disk", 20.0),
                spring("disk", "middle", 5.0 * blade),
                spring("middle", "tip", 3.0 * blade),
            ],
            forces: force(),
            ..Model::default()
        }
    }

    /// The corresponding sector by matrices: rows 0 and 1 are the low and the high side of the
    /// disk, rows 2 and 3 are the blade.
    fn by_matrices(deviation: f64, reduction: Reduction, damping: SubstructureDamping) -> Model {
        let springs = [(0, 1, 20.0), (0, 2, 5.0), (2, 3, 3.0)];
        let linked = springs.into_iter().flat_map(|(a, b, k)| [(a, a, k), (b, b, k), (a, b, -k), (b, a, -k)]);
        let stiffness = SparseMatrix::from_triplets(4, linked.chain([(0, 0, 30.0)])).unwrap();
        // the mass on the boundary may be on either side
        let mass = SparseMatrix::from_triplets(4, [(0, 0, 1.5), (1, 1, 0.5), (2, 2, 0.3), (3, 3, 0.2)]).unwrap();
        let names = ["1.x", "2.x", "3.x", "4.x"].map(str::to_owned).to_vec();
        let component = Component::new(names, mass, None, stiffness).unwrap();
        let boundary = Boundary::of_nodes(component.rows(), &[("1".into(), "2".into())], None).unwrap();
        let disk = Some(DiskPart { boundary, blade: vec![2, 3], deviations: vec![deviation], basis: None });
        Model {
            substructure: Some(Substructure { component, damping, reduction, earlier_reduction: None, disk }),
            places: vec![Place::new("rim", vec![(1, 1.0)]), Place::new("tip", vec![(3, 1.0)])],
            forces: force(),
            ..Model::default()
        }
    }

    fn ring(sector: impl Fn(f64) -> Model, around: SectorDistribution, deviations: &[f64]) -> Model {
        let disk = Disk { sectors: 5, forces: vec![around], motions: vec![] };
        disk.ring(|s| sector(deviations.get(s).copied().unwrap_or(0.0))).unwrap()
    }

    /// If only one row carries the blade, its energy is that of its springs, and the matrices
    /// equal those of masses and springs.
    #[test]
    fn a_ring_of_matrices_is_that_of_its_masses() {
        for deviations in [&[][..], &DEVIATIONS] {
            let own = |d| by_matrices(d, Reduction::None { up_to: 0.0 }, SubstructureDamping::Own);
            let wave = SectorDistribution::EngineOrder(2);
            let (matrices, masses) = (ring(own, wave, deviations), ring(by_masses, wave, deviations));
            assert_eq!(matrices.ring, masses.ring);
            let (matrices, masses) = (matrices.assemble().unwrap(), masses.assemble().unwrap());
            assert_eq!(matrices.places()[2..4], ["rim_1", "tip_1"]);
            assert_eq!(
                matrices.place_axes()[8].rows(),
                [(0, 1.0)],
                "the high side of the last sector is the low one of the first"
            );
            for (a, b) in [
                (matrices.structure().mass(), masses.structure().mass()),
                (matrices.structure().stiffness(), masses.structure().stiffness()),
            ] {
                assert!((a - b).amax() < 1e-13, "{a} {b}");
            }
            assert_eq!(matrices.excitation_harmonics(), masses.excitation_harmonics());
            assert_eq!(matrices.cyclic().is_some(), deviations.is_empty());
        }
    }

    /// With as many modes as rows of the sector, the reduction is exact. A damping ratio
    /// applies to every mode of the ring.
    #[test]
    fn all_coordinates_are_the_whole_ring() {
        let how = Reduction::Modes { modes: 3, kind: crate::structure::ReductionKind::Rubin, orders: 1, up_to: 0.0 };
        let damped = |d| by_matrices(d, how, SubstructureDamping::Ratio(0.01));
        for deviations in [&[][..], &[1e-12; 5], &DEVIATIONS] {
            let few = ring(damped, SectorDistribution::Sector(1), deviations);
            let whole = ring(by_masses, SectorDistribution::Sector(1), deviations);
            let (few, whole) = (few.survey().unwrap(), whole.survey().unwrap());
            assert_eq!(few.dofs(), 15);
            for (a, b) in few.free().elastic.iter().zip(&whole.free().elastic) {
                assert!((a.omega / b.omega - 1.0).abs() < 1e-10, "{} {}", a.omega, b.omega);
                // up to two thirds of the highest mode
                if a.omega < 3.9 {
                    assert!((a.damping / 0.01 - 1.0).abs() < 1e-9, "{} {}", a.omega, a.damping);
                }
            }
        }
    }

    /// A basis that is extended to a higher range has the modes of that range, also with different
    /// blades.
    #[test]
    fn an_extended_basis_has_the_modes_of_its_range() {
        let how = Reduction::UpTo { up_to: 3.0, tolerance: 1e-4, kind: None };
        for deviations in [&[][..], &DEVIATIONS] {
            let by_matrices = |d| by_matrices(d, how, SubstructureDamping::Own);
            let model = ring(by_matrices, SectorDistribution::Sector(1), deviations);
            let few = model.assemble().unwrap();
            let own = model.substructure.as_ref().unwrap().with_extended_range(few.reduced().unwrap(), 4.0);
            assert!(own.disk.as_ref().unwrap().basis.is_some());
            let larger = Model { substructure: Some(own), ..model }.assemble().unwrap();
            assert!(larger.reduced().unwrap().error().is_nan() && larger.reduced().unwrap().up_to() == 12.0);
            let whole = ring(by_masses, SectorDistribution::Sector(1), deviations).survey().unwrap();
            let found = larger.structure().full();
            let found = crate::structure::reduction::natural(&found.mass, &found.stiffness).unwrap().0;
            for (a, b) in found.iter().zip(&whole.free().elastic) {
                assert!((a.sqrt() / b.omega - 1.0).abs() < 1e-9, "{} {}", a.sqrt(), b.omega);
            }
            assert_eq!(found.len(), whole.free().elastic.len());
        }
    }

    #[test]
    fn wrong_sectors_are_refused() {
        let mut model = by_matrices(0.1, Reduction::None { up_to: 0.0 }, SubstructureDamping::Own);
        let assembled = |model: &Model| ring(|_| model.clone(), SectorDistribution::EngineOrder(1), &[]).assemble();
        model.substructure.as_mut().unwrap().disk.as_mut().unwrap().blade = vec![1];
        assert!(assembled(&model).unwrap_err().message.contains("boundary of the sector"));
        model.substructure.as_mut().unwrap().disk.as_mut().unwrap().blade = vec![];
        assert!(assembled(&model).unwrap_err().message.contains("has no node"));
        model.substructure.as_mut().unwrap().disk.as_mut().unwrap().blade = vec![0, 2, 3];
        assert!(assembled(&model).unwrap_err().message.contains("boundary of the sector"));
        model.substructure.as_mut().unwrap().disk = None;
        let disk = Disk { sectors: 5, ..Disk::default() };
        assert!(disk.ring(|_| model.clone()).unwrap_err().message.contains("node pairs"));
    }
}
