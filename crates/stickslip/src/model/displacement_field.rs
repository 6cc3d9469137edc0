//! Displacements of all rows of a structure, from the coordinates of a model.
//!
//! The coordinates of the structure are its rows, or the coordinates `q` of its reduction with the
//! displacements `u = T q` of all rows. In a disk every sector has its own; the rows of its high
//! side follow the next sector. The coordinates of a mistuned disk are the modes of the whole ring.

use super::coordinates::Coordinates;
use super::name_resolution::Places;
use super::{DiskPart, Element, Model, ModelError, Place, Substructure};
use crate::structure::reduction::{ReductionError, RingShapes, Row};
use crate::structure::{CoordinateAxis, ReducedForm, Reduction, RingRow};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Displacements of all rows of the structure of a model.
///
/// # Example
/// A rod of 20 masses in three coordinates, which its end determines.
/// ```
/// use stickslip::model::{DisplacementField, Model, Place, Substructure, SubstructureDamping};
/// use stickslip::structure::{Component, Reduction, ReductionKind};
/// use stickslip_numerics::sparse::SparseMatrix;
/// let n = 20;
/// let springs = (0..n).flat_map(|i| {
///     let next = [(i, i + 1, -1e6), (i + 1, i, -1e6), (i + 1, i + 1, 1e6)];
///     std::iter::once((i, i, 1e6)).chain(next.into_iter().filter(move |_| i + 1 < n))
/// });
/// let stiffness = SparseMatrix::from_triplets(n, springs)?;
/// let mass = SparseMatrix::from_triplets(n, (0..n).map(|i| (i, i, 0.1)))?;
/// let end = Place::new("end", vec![(n - 1, 1.0)]);
/// let model = Model {
///     places: vec![end],
///     substructure: Some(Substructure {
///         component: Component::new(vec![String::new(); n], mass, None, stiffness)?,
///         damping: SubstructureDamping::Own,
///         reduction: Reduction::Modes {
///             modes: 2,
///             kind: ReductionKind::Rubin,
///             orders: 1,
///             up_to: 0.0,
///         },
///         earlier_reduction: None,
///         disk: None,
///     }),
///     ..Model::default()
/// };
/// let (system, field) = (model.assemble()?, DisplacementField::new(&model)?);
/// let q = vec![0.3; system.structure().dofs()];
/// let rows = field.rows(0, &q, &[]);
/// assert!(rows.len() == n && (rows[n - 1] - system.place_axes()[0].component(&q)).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct DisplacementField {
    /// The coordinates of the structure over the degrees of freedom and then the imposed
    /// displacements.
    coordinates: Vec<Row>,
    /// Modes of a mistuned ring over the coordinates of all sectors.
    ring_modes: Option<Arc<DMatrix<f64>>>,
    /// `T` of the structure, or of a sector without the rows of its high side; `None` if all rows
    /// are coordinates.
    shapes: Option<Arc<DMatrix<f64>>>,
    /// Number of degrees of freedom, without imposed displacements.
    free: usize,
    disk: Option<SectorRows>,
}

/// The rows of a sector.
#[derive(Debug, Clone)]
struct SectorRows {
    sectors: usize,
    /// Every row over the rows without the high side, of this and the next sector.
    rows: Vec<RingRow>,
    axis: Option<CoordinateAxis>,
}

impl DisplacementField {
    /// Prepares the displacements of a model. Without a structure given by matrices it has no rows.
    ///
    /// # Errors
    /// [`ModelError`] if the model is invalid, or its structure cannot be reduced.
    pub fn new(model: &Model) -> Result<DisplacementField, ModelError> {
        let Some(substructure) = &model.substructure else {
            let coordinates = Vec::new();
            return Ok(DisplacementField { coordinates, ring_modes: None, shapes: None, free: 0, disk: None });
        };
        let unknown = |error: ReductionError| ModelError::new(Element::Substructure, "reduce", error.to_string());
        let coordinates = Coordinates::new(model, &Places::new(model)?)?;
        let (mut ring_modes, mut shapes, mut disk) = (None, None, None);
        let count = match (model.ring, &substructure.disk) {
            (Some(ring), Some(part)) => {
                let kept = substructure.component.sector(&part.boundary, ring.sectors);
                disk = Some(SectorRows {
                    sectors: ring.sectors,
                    rows: kept.sector.rows().to_vec(),
                    axis: part.boundary.axis(),
                });
                let reduced = coordinates.reduced.as_ref().map(|reduced| reduced.form());
                let ring_shapes = match reduced {
                    Some(ReducedForm::Ring(_)) => Some(ring_shapes(model, substructure, part).map_err(unknown)?),
                    _ => None,
                };
                let sector = match (reduced, &ring_shapes) {
                    (_, Some(shapes)) => Some(&shapes.sector),
                    (Some(ReducedForm::Sector(sector)), _) => Some(sector),
                    _ => None,
                };
                shapes =
                    sector.map(|sector| Arc::new(DMatrix::from_column_slice(sector.n, sector.dofs(), &sector.basis)));
                ring_modes = ring_shapes.as_ref().map(|shapes| shapes.columns.clone());
                match &ring_modes {
                    Some(modes) => modes.ncols(),
                    None => ring.sectors * shapes.as_ref().map_or(kept.sector.dofs, |shapes| shapes.ncols()),
                }
            }
            _ => {
                if !matches!(substructure.reduction, Reduction::None { .. }) {
                    let seen = Place::substructure_rows(&model.places);
                    shapes = Some(substructure.component.shapes(&seen, &substructure.reduction).map_err(unknown)?);
                }
                shapes.as_ref().map_or(substructure.component.dofs(), |shapes| shapes.ncols())
            }
        };
        let free = coordinates.free;
        let coordinates = (0..count).map(|at| coordinates.of_substructure(at)).collect();
        Ok(DisplacementField { coordinates, ring_modes, shapes, free, disk })
    }

    /// Returns the number of sectors of a disk; 1 without a disk.
    pub fn sectors(&self) -> usize {
        self.disk.as_ref().map_or(1, |disk| disk.sectors)
    }

    /// Returns the axis of a disk about which each sector is rotated from the one before it.
    pub fn axis(&self) -> Option<CoordinateAxis> {
        self.disk.as_ref().and_then(|disk| disk.axis)
    }

    /// Returns the displacements of all rows of a sector, m, for those of the degrees of freedom
    /// of the model and the imposed displacements. Those of a sector are along its own axes.
    ///
    /// # Panics
    /// If there are fewer values than coordinates of the structure.
    pub fn rows(&self, sector: usize, displacement: &[f64], imposed: &[f64]) -> Vec<f64> {
        let value = |at: usize| if at < self.free { displacement[at] } else { imposed[at - self.free] };
        let own = |row: &Row| row.iter().map(|(at, weight)| weight * value(*at)).sum::<f64>();
        let Some(disk) = &self.disk else {
            let q = DVector::from_iterator(self.coordinates.len(), self.coordinates.iter().map(own));
            return self.shapes.as_ref().map_or_else(|| q.clone(), |shapes| shapes.as_ref() * &q).as_slice().to_vec();
        };
        let of_modes = self.ring_modes.as_ref().map(|modes| {
            let q = DVector::from_iterator(self.coordinates.len(), self.coordinates.iter().map(own));
            modes.as_ref() * q
        });
        let all = of_modes.as_ref().map_or(self.coordinates.len(), DVector::len);
        let each = all / disk.sectors;
        let kept = [sector, (sector + 1) % disk.sectors].map(|sector| {
            let range = sector * each..(sector + 1) * each;
            let q = match &of_modes {
                Some(all) => all.rows(range.start, each).into_owned(),
                None => DVector::from_iterator(each, self.coordinates[range].iter().map(own)),
            };
            self.shapes.as_ref().map_or_else(|| q.clone(), |shapes| shapes.as_ref() * &q)
        });
        let row = |row: &RingRow| row.iter().map(|(at, shift, weight)| weight * kept[*shift as usize][*at]).sum();
        disk.rows.iter().map(row).collect()
    }
}

/// Returns the shapes of the modes of a mistuned ring.
fn ring_shapes(model: &Model, substructure: &Substructure, part: &DiskPart) -> Result<RingShapes, ReductionError> {
    let sectors = model.ring.map_or(1, |ring| ring.sectors);
    let stated = &model.places[..model.places.len() / sectors];
    let seen = Place::substructure_rows(stated);
    let kept = substructure.component.sector(&part.boundary, sectors);
    let blade = kept.blade(&substructure.component, &part.blade).map_err(|_| ReductionError::NoPorts)?;
    let found = kept.mistuned_with_shapes(&blade, &part.deviations, &seen, &substructure.reduction)?;
    match found.form() {
        ReducedForm::Ring(modes) => modes.shapes.clone().ok_or(ReductionError::NoPorts),
        _ => Err(ReductionError::NoPorts),
    }
}
