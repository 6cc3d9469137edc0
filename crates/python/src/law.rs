//! Laws by name, with quantities as keyword arguments.

use crate::python_law::Written;
use crate::{error, quantity};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::sync::Arc;
use stickslip::dimension::Dimension;
use stickslip::law::{self, LawInfo, MOST_DIRECTIONS, Parameter, SharedLaw};

/// What happens where two places rub or touch; made by `stickslip.law` or `stickslip.rate_law`.
#[pyclass(frozen, module = "stickslip", name = "Law")]
pub struct PyLaw {
    pub law: SharedLaw,
    /// The law behind it, if it is written in Python.
    pub written: Option<Arc<Written>>,
}

#[pymethods]
impl PyLaw {
    /// Name, as in study files.
    #[getter]
    fn name(&self) -> &str {
        self.law.name()
    }

    /// The parameters in SI.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let values = PyDict::new(py);
        let pairs = self.law.info().parameters.iter().zip(self.law.values());
        pairs.into_iter().try_for_each(|(parameter, value)| values.set_item(parameter.key, value))?;
        Ok(values)
    }

    /// Directions of relative motion, 1 to 3.
    #[getter]
    fn directions(&self) -> usize {
        self.law.directions()
    }

    fn __repr__(&self) -> String {
        let pairs = self.law.info().parameters.iter().zip(self.law.values());
        let pairs: String = pairs.map(|(parameter, value)| format!(", {}={value}", parameter.key)).collect();
        format!("<stickslip.Law {}{pairs}>", self.name())
    }
}

/// The row of a law, or an exception that names those that there are.
fn row(py: Python<'_>, name: &str) -> PyResult<&'static LawInfo> {
    law::find(name).ok_or_else(|| {
        let names: Vec<&str> = law::TABLE.iter().map(|row| row.name).collect();
        error::model(py, format!("there is no law `{name}`; there are {}", names.join(", ")))
    })
}

/// A law by its name; ``stickslip.laws()`` lists them with their parameters.
///
/// Quantities are numbers in SI or strings with units.
///
/// >>> import stickslip
/// >>> stickslip.law("jenkins", stiffness="10 N/mm", limit=2.0)
/// <stickslip.Law jenkins, stiffness=10000, limit=2>
#[pyfunction]
#[pyo3(name = "law", signature = (name, /, **parameters))]
pub fn named(py: Python<'_>, name: &str, parameters: Option<&Bound<'_, PyDict>>) -> PyResult<PyLaw> {
    let row = row(py, name)?;
    let mut given: BTreeMap<String, Bound<'_, PyAny>> = BTreeMap::new();
    for (key, value) in parameters.into_iter().flatten() {
        given.insert(key.extract()?, value);
    }
    if let Some(unknown) = given.keys().find(|key| row.parameters.iter().all(|parameter| parameter.key != **key)) {
        let keys: Vec<&str> = row.parameters.iter().map(|parameter| parameter.key).collect();
        return Err(error::model(py, format!("law `{name}` has no parameter `{unknown}`; it has {}", keys.join(", "))));
    }
    let mut values: BTreeMap<&str, f64> = BTreeMap::new();
    // a dimension may depend on the value of another parameter, which has none itself
    let (plain, raised): (Vec<&Parameter>, Vec<&Parameter>) =
        row.parameters.iter().partition(|parameter| parameter.power.is_none());
    for parameter in plain.into_iter().chain(raised) {
        let Some(value) = given.get(parameter.key) else { continue };
        let of = |key: &str| {
            let default = || row.parameters.iter().find(|other| other.key == key).and_then(|other| other.default);
            values.get(key).copied().or_else(default)
        };
        let dimension = parameter.dimension_under(of).unwrap_or(Dimension::NONE);
        let what = format!("`{}` of law `{name}`", parameter.key);
        values.insert(parameter.key, quantity::si(value, dimension, &what)?);
    }
    let law = row.build(&values).map_err(|cause| error::model(py, cause))?;
    Ok(PyLaw { law, written: None })
}

/// All laws: a dictionary from their names to their summaries and parameters.
///
/// >>> import stickslip
/// >>> stickslip.laws()["coulomb"]["parameters"]["limit"].split(":")[0]
/// 'force (N), zero or more'
#[pyfunction]
pub fn laws(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let all = PyDict::new(py);
    for row in law::TABLE {
        let (entry, parameters) = (PyDict::new(py), PyDict::new(py));
        for parameter in row.parameters {
            parameters.set_item(parameter.key, format!("{}: {}", parameter.takes(), parameter.doc))?;
        }
        entry.set_item("summary", row.summary)?;
        entry.set_item("parameters", parameters)?;
        all.set_item(row.name, entry)?;
    }
    Ok(all)
}

/// A law in rate form from Python's functions; `stickslip.rate_law` wraps it.
#[pyfunction]
#[pyo3(signature = (name, value, linearise, *, directions, states, state_scale, scale, odd, passive))]
#[allow(clippy::too_many_arguments)] // one for each keyword of `rate_law`
pub fn _rate_law(
    py: Python<'_>,
    name: &str,
    value: Py<PyAny>,
    linearise: Py<PyAny>,
    directions: usize,
    states: usize,
    state_scale: f64,
    scale: f64,
    odd: bool,
    passive: bool,
) -> PyResult<PyLaw> {
    if !(1..=MOST_DIRECTIONS).contains(&directions) {
        return Err(error::model(py, format!("a law has 1 to {MOST_DIRECTIONS} directions, found {directions}")));
    }
    if !(state_scale.is_finite() && state_scale > 0.0 && scale > 0.0) {
        let message = format!(
            "`scale` and `state_scale` of law `{name}` must be more than zero, found {scale} and {state_scale}"
        );
        return Err(error::model(py, message));
    }
    let mut law = Written::new(name, value, linearise);
    (law.directions, law.states, law.odd, law.passive) = (directions, states, odd, passive);
    (law.state_scale, law.scale) = (state_scale, scale);
    let written = Arc::new(law);
    Ok(PyLaw { law: written.law(), written: Some(written) })
}
