//! Residuals of an identification, for solvers and samplers in Python.

use crate::study::PyStudy;
use crate::supervision::run_on_new_thread;
use crate::{error, quantity};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::sync::Arc;
use stickslip_study::kinds::identify;

/// Weighted residuals of a study of kind ``identify`` over its fitted parameters, in SI units.
///
/// A residual is the fitted value minus the measured one, divided by the standard deviation that
/// ``weight`` states. SciPy's ``least_squares`` takes ``values``, ``jacobian`` and ``bounds``.
///
/// A pickle contains the study, and reads the measured rows again from its files, unless `identify`
/// received their columns.
#[pyclass(frozen, module = "stickslip", name = "Residuals")]
pub struct PyResiduals {
    residuals: Arc<identify::Residuals>,
    study: Py<PyStudy>,
    index: usize,
}

impl PyResiduals {
    /// Computes with the residuals at parameters.
    fn at<'py, T: Send + 'static>(
        &self,
        x: &Bound<'py, PyAny>,
        compute: impl FnOnce(&identify::Residuals, &[f64]) -> Result<T, String> + Send + 'static,
    ) -> PyResult<T> {
        let (py, residuals, x) = (x.py(), self.residuals.clone(), quantity::numbers(x, "`x`")?);
        run_on_new_thread(py, move || compute(&residuals, &x))?.map_err(|cause| error::model(py, cause))
    }
}

#[pymethods]
impl PyResiduals {
    /// Collects the measured rows of case ``index`` of a study.
    #[new]
    #[pyo3(signature = (study, index=0))]
    fn new(py: Python<'_>, study: Py<PyStudy>, index: usize) -> PyResult<PyResiduals> {
        let residuals =
            identify::Residuals::new(&study.get().study, index).map_err(|cause| error::study(py, &cause))?;
        Ok(PyResiduals { residuals: Arc::new(residuals), study, index })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        Ok((py.get_type::<PyResiduals>().into_any(), (self.study.clone_ref(py), self.index).into_pyobject(py)?))
    }

    /// Names of the fitted parameters.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.residuals.names()
    }

    /// Lower and upper bounds of the parameters.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>) {
        let bounds = self.residuals.bounds();
        let end = |which: usize| PyArray1::from_iter(py, bounds.iter().map(|ends| ends[which]));
        (end(0), end(1))
    }

    /// The values at which a search begins.
    #[getter]
    fn start<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.residuals.start())
    }

    /// Returns the residuals at ``x``.
    ///
    /// Raises :class:`ModelError` outside of the bounds, and where the model has no residuals.
    fn values<'py>(&self, py: Python<'py>, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_vec(py, self.at(x, identify::Residuals::values)?))
    }

    /// Returns the derivatives of the residuals at ``x``: one row per residual, one column per
    /// parameter.
    fn jacobian<'py>(&self, py: Python<'py>, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found = self.at(x, identify::Residuals::derivatives)?;
        // Storage is column by column; the transpose gives the rows.
        PyArray1::from_slice(py, found.transpose().as_slice()).reshape([found.nrows(), found.ncols()])
    }
}
