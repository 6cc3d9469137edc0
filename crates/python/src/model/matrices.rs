//! Mass, damping and stiffness matrices from NumPy and SciPy.

use crate::supervision::run_on_new_thread;
use crate::{error, quantity};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::HashMap;
use stickslip::model::Place;
use stickslip::structure::Component;
use stickslip_numerics::sparse::SparseMatrix;

/// Entries of a matrix: row, column, value.
pub(super) type Entries = Vec<(usize, usize, f64)>;

/// Returns the entries of an n x n matrix: an array, or any sparse matrix of SciPy.
fn entries(value: &Bound<'_, PyAny>, n: usize, what: &str) -> PyResult<Entries> {
    let py = value.py();
    let size = |rows: usize, columns: usize| {
        let message =
            format!("the {what} matrix is {rows} x {columns}, but the structure has {n} rows: it must be {n} x {n}");
        Err(error::model(py, message))
    };
    if py.import("numpy")?.call_method1("iscomplexobj", (value,))?.extract::<bool>()? {
        let message = format!(
            "the {what} matrix is complex, but structural matrices must be real: for a stiffness K (1 + jη) \
             give K, and state the loss as `damping` or `damping_ratio`"
        );
        return Err(error::model(py, message));
    }
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
    let no_matrix = || {
        let found = quantity::kind(value);
        error::model(
            py,
            format!("the {what} matrix must be an array of real numbers or a sparse matrix, found {found}"),
        )
    };
    let array = py.import("numpy")?.call_method1("asarray", (value,)).map_err(|_| no_matrix())?;
    if quantity::is_masked(value)? || !quantity::is_real(&array.getattr("dtype")?) {
        return Err(no_matrix());
    }
    let array = array.call_method1("astype", ("float64",))?;
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

/// Creates a structure from its mass (kg), optional damping (kg/s) and stiffness (N/m)
/// matrices.
pub fn component(
    py: Python<'_>,
    names: Vec<String>,
    mass: &Bound<'_, PyAny>,
    damping: Option<&Bound<'_, PyAny>>,
    stiffness: &Bound<'_, PyAny>,
) -> PyResult<Component> {
    let n = names.len();
    let matrix = |value: &Bound<'_, PyAny>, what: &str| {
        let made = SparseMatrix::from_triplets(n, entries(value, n, what)?.into_iter().filter(|entry| entry.2 != 0.0));
        made.map_err(|cause| error::model(py, format!("the {what} matrix: {cause}")))
    };
    let (mass, stiffness) = (matrix(mass, "mass")?, matrix(stiffness, "stiffness")?);
    let damping = damping.map(|damping| matrix(damping, "damping")).transpose()?;
    let made = run_on_new_thread(py, move || Component::new(names, mass, damping, stiffness))?;
    made.map_err(|cause| error::model(py, cause))
}

/// Returns the names of the n rows of a structure, and the places on it.
///
/// A list names every row, and `name.direction` defines nodes. A dictionary names selected
/// places: its values are row numbers, or for a node a dictionary from directions to rows.
pub fn places(py: Python<'_>, given: &Bound<'_, PyAny>, n: usize) -> PyResult<(Vec<String>, Vec<Place>)> {
    if let Ok(given) = given.cast::<PyDict>() {
        let mut places = Vec::new();
        let row = |row: &Bound<'_, PyAny>, name: &str| {
            let number: usize = row
                .extract()
                .map_err(|_| error::model(py, format!("the row of `{name}` must be a whole number from 0")))?;
            match number < n {
                true => Ok(vec![(number, 1.0)]),
                false => Err(error::model(
                    py,
                    format!(
                        "`{name}` refers to row {number}, but the last row of the matrices is {}",
                        n.saturating_sub(1)
                    ),
                )),
            }
        };
        for (name, at) in given {
            let name: String = name.extract()?;
            places.push(match at.cast::<PyDict>() {
                Err(_) => Place::new(name.as_str(), row(&at, &name)?),
                Ok(along) => {
                    let mut node = Place::node(name.as_str(), &[], Vec::new());
                    for (direction, at) in along {
                        node.directions.push(direction.extract()?);
                        node.rows.push(row(&at, &name)?);
                    }
                    node
                }
            });
        }
        return Ok((vec![String::new(); n], places));
    }
    let names: Vec<String> = given.extract()?;
    let mut places: Vec<Place> = Vec::new();
    let mut nodes: HashMap<&str, usize> = HashMap::new();
    for (row, name) in names.iter().enumerate() {
        let rows = vec![(row, 1.0)];
        match name.split_once('.') {
            None => places.push(Place::new(name.as_str(), rows)),
            Some((node, along)) => {
                let at = *nodes.entry(node).or_insert_with(|| {
                    places.push(Place::node(node, &[], Vec::new()));
                    places.len() - 1
                });
                places[at].directions.push(along.to_owned());
                places[at].rows.push(rows);
            }
        }
    }
    Ok((names, places))
}
