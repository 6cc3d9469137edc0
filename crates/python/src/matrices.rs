//! Matrices of mass, damping and stiffness from NumPy and SciPy.

use crate::error;
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use stickslip::structure::{Structure, StructureError};
use stickslip_numerics::sparse::{Matrix, MatrixError};

/// The entries of a matrix: row, column, value.
pub type Entries = Vec<(usize, usize, f64)>;

/// Matrices over named places.
#[derive(Clone)]
pub struct Matrices {
    /// Names of the rows.
    pub places: Vec<String>,
    /// Mass (kg), damping (kg/s), stiffness (N/m).
    pub entries: [Entries; 3],
}

/// The entries of a square matrix of n rows: an array, or any sparse matrix of SciPy.
pub fn entries(value: &Bound<'_, PyAny>, n: usize, what: &str) -> PyResult<Entries> {
    let py = value.py();
    let size = |rows: usize, columns: usize| {
        let message =
            format!("the {what} matrix is {rows} x {columns}, and there are {n} names of places: it must be {n} x {n}");
        Err(error::model(py, message))
    };
    if value.hasattr("tocoo")? {
        let coo = value.call_method0("tocoo")?;
        let (rows, columns): (usize, usize) = coo.getattr("shape")?.extract()?;
        if (rows, columns) != (n, n) {
            return size(rows, columns);
        }
        let indices = |name: &str| coo.getattr(name)?.call_method1("astype", ("int64",));
        let (row, column, data) =
            (indices("row")?, indices("col")?, coo.getattr("data")?.call_method1("astype", ("float64",))?);
        let row: PyReadonlyArray1<'_, i64> = row.extract()?;
        let column: PyReadonlyArray1<'_, i64> = column.extract()?;
        let data: PyReadonlyArray1<'_, f64> = data.extract()?;
        let (row, column, data) = (row.as_array(), column.as_array(), data.as_array());
        return Ok(row
            .iter()
            .zip(column)
            .zip(data)
            .map(|((i, k), value)| (*i as usize, *k as usize, *value))
            .collect());
    }
    let array = py.import("numpy")?.call_method1("asarray", (value, "float64"))?;
    let Ok(array) = array.extract::<PyReadonlyArray2<'_, f64>>() else {
        return Err(error::model(py, format!("the {what} matrix must have two dimensions")));
    };
    let [rows, columns] = [array.shape()[0], array.shape()[1]];
    if (rows, columns) != (n, n) {
        return size(rows, columns);
    }
    let array = array.as_array();
    let all = array.indexed_iter().filter(|(_, value)| **value != 0.0);
    Ok(all.map(|((i, k), value)| (i, k, *value)).collect())
}

impl Matrices {
    /// The structure of these matrices and of `lumped` springs and masses, over the places of `lumped`; `row` says where a place stands there.
    pub fn structure(
        &self,
        py: Python<'_>,
        lumped: &Structure,
        row: &dyn Fn(&str) -> Option<usize>,
    ) -> PyResult<Structure> {
        let n = lumped.dofs();
        let mut rows = Vec::with_capacity(self.places.len());
        for place in &self.places {
            rows.push(row(place).ok_or_else(|| {
                let message = format!("`{place}` is a place of the matrices and cannot be moved: move a place of its own and tie it by a spring");
                error::model(py, message)
            })?);
        }
        let mut all = self.entries.clone();
        all.iter_mut().flatten().for_each(|(i, k, _)| (*i, *k) = (rows[*i], rows[*k]));
        for (i, k, values) in lumped.entries() {
            all.iter_mut().zip(values).for_each(|(entries, value)| entries.push((i, k, value)));
        }
        let refused = |what: &str, cause: &MatrixError| error::model(py, format!("the {what} matrix: {cause}"));
        let names = ["mass", "damping", "stiffness"];
        let mut made = Vec::new();
        for (what, entries) in names.into_iter().zip(all) {
            let entries = entries.into_iter().filter(|entry| entry.2 != 0.0);
            made.push(Matrix::from_triplets(n, entries).map_err(|cause| refused(what, &cause))?);
        }
        let wrong = |cause: StructureError| error::model(py, cause);
        match <[Matrix; 3]>::try_from(made) {
            Ok([mass, damping, stiffness]) => {
                Structure::sparse(lumped.places().to_vec(), mass, damping, stiffness).map_err(wrong)
            }
            Err(_) => unreachable!("three names make three matrices"),
        }
    }
}
