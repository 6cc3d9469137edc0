//! Displacements of all rows of a structure, from the coordinates of a model.
//!
//! The coordinates of the structure are the first of a model: its rows, or the coordinates `q` of
//! its reduction with the displacements `u = T q` of all rows.

use super::{Element, Model, ModelError, Place, Substructure};
use crate::structure::Reduction;
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
/// let rows = field.rows(&q);
/// assert!(rows.len() == n && (rows[n - 1] - system.place_axes()[0].component(&q)).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct DisplacementField {
    /// `T`; `None` if all rows are coordinates.
    shapes: Option<Arc<DMatrix<f64>>>,
    rows: usize,
}

impl DisplacementField {
    /// Returns why the displacements of all rows of a model are not available: it is a disk, or it
    /// has imposed motions, which change its coordinates.
    pub fn refusal(model: &Model) -> Option<&'static str> {
        match (model.ring.is_some(), model.motions.is_empty()) {
            (true, _) => Some("the displacements of all nodes of a disk are not available"),
            (_, false) => Some("the displacements of all nodes are not available with imposed motions"),
            _ => None,
        }
    }

    /// Prepares the displacements of a model. Without a structure given by matrices it has no rows.
    ///
    /// # Errors
    /// [`ModelError`] for a [`DisplacementField::refusal`], or if the structure cannot be reduced.
    pub fn new(model: &Model) -> Result<DisplacementField, ModelError> {
        if let Some(message) = DisplacementField::refusal(model) {
            return Err(ModelError::new(Element::Whole, "fields", message.to_owned()));
        }
        let Some(Substructure { component, reduction, .. }) = &model.substructure else {
            return Ok(DisplacementField { shapes: None, rows: 0 });
        };
        let rows = component.dofs();
        if let Reduction::None { .. } = reduction {
            return Ok(DisplacementField { shapes: None, rows });
        }
        let seen = Place::substructure_rows(&model.places);
        let shapes = component.shapes(&seen, reduction);
        let shapes = shapes.map_err(|error| ModelError::new(Element::Substructure, "reduce", error.to_string()))?;
        Ok(DisplacementField { shapes: Some(shapes), rows })
    }

    /// Returns the displacements of all rows, m, for those of the degrees of freedom of the model.
    ///
    /// # Panics
    /// If there are fewer degrees of freedom than coordinates of the structure.
    pub fn rows(&self, displacement: &[f64]) -> Vec<f64> {
        match &self.shapes {
            None => displacement[..self.rows].to_vec(),
            Some(shapes) => {
                let q = DVector::from_column_slice(&displacement[..shapes.ncols()]);
                (shapes.as_ref() * q).as_slice().to_vec()
            }
        }
    }
}
