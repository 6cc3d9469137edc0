//! Laws by name, with quantities as keyword arguments.

pub mod python_law;

use crate::{error, quantity};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use python_law::{Magnitude, PythonLaw};
use std::collections::BTreeMap;
use std::sync::Arc;
use stickslip::dimension::Dimension;
use stickslip::law::{self, LawInfo, MAX_DIRECTIONS, Parameter, SharedLaw};

/// The friction or contact law of a joint, made by `stickslip.law` or `stickslip.rate_law`.
///
/// A law is immutable. It can be copied and pickled. Pickling a law written in Python requires
/// that it is a module-level variable with its own name.
#[pyclass(frozen, module = "stickslip", name = "Law")]
pub struct PyLaw {
    pub law: SharedLaw,
    /// The Python implementation, if the law is written in Python.
    pub written: Option<Arc<PythonLaw>>,
}

/// A function and its arguments, from which a pickle recreates an object.
type PickleParts<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);

impl PyLaw {
    /// Wraps the law of a joint.
    pub fn of(law: SharedLaw) -> PyLaw {
        PyLaw { written: python_law::written(&law), law }
    }
}

#[pymethods]
impl PyLaw {
    /// Name, as in study files.
    #[getter]
    fn name(&self) -> &str {
        self.law.name()
    }

    /// The parameters in SI units.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let values = PyDict::new(py);
        let pairs = self.law.info().parameters.iter().zip(self.law.values());
        pairs.into_iter().try_for_each(|(parameter, value)| values.set_item(parameter.key, value))?;
        Ok(values)
    }

    /// Number of directions of the relative motion, 1 to 3.
    #[getter]
    fn directions(&self) -> usize {
        self.law.directions()
    }

    /// Compares the derivatives of a law written in Python with difference quotients.
    ///
    /// Returns the largest error, relative to the largest derivative of the same kind. Raises
    /// `ValueError` if the error exceeds ``tolerance``; the message names the derivative and
    /// the point.
    ///
    /// ``u`` (m), ``v`` (m/s) and ``z`` are the points of the comparison, with the shape (n,)
    /// or (directions, n) and (states, n). By default 64 points are drawn, up to 1 mm, 1 m/s
    /// and 0.9 ``state_scale``.
    ///
    /// >>> import stickslip
    /// >>> slopes = lambda u, v, z: [[2e9 * u**2, 0 * v]]
    /// >>> law = stickslip.rate_law(lambda u, v, z: 1e9 * u**3, derivatives=slopes)
    /// >>> law.check_derivatives()  # doctest: +ELLIPSIS
    /// Traceback (most recent call last):
    ///     ...
    /// ValueError: the derivative of `<lambda>` is wrong: the force by u is ...
    #[pyo3(signature = (u=None, v=None, z=None, *, tolerance=1e-5))]
    fn check_derivatives(
        slf: &Bound<'_, Self>,
        u: Option<Bound<'_, PyAny>>,
        v: Option<Bound<'_, PyAny>>,
        z: Option<Bound<'_, PyAny>>,
        tolerance: f64,
    ) -> PyResult<f64> {
        let Some(written) = &slf.get().written else {
            return Err(PyTypeError::new_err(
                "only a law made by `rate_law` can be checked: the derivatives of built-in laws are exact",
            ));
        };
        written.kernel.bind(slf.py()).call_method1("check_derivatives", (slf, u, v, z, tolerance))?.extract()
    }

    fn __eq__(&self, other: &PyLaw) -> bool {
        *self.law == *other.law
    }

    fn __hash__(&self) -> u64 {
        self.law
            .values()
            .iter()
            .fold(self.law.info() as *const LawInfo as u64, |hash, value| hash.rotate_left(7) ^ value.to_bits())
    }

    fn __repr__(&self) -> String {
        let pairs = self.law.info().parameters.iter().zip(self.law.values());
        let pairs: String = pairs.map(|(parameter, value)| format!(", {}={value}", parameter.key)).collect();
        format!("<stickslip.Law {}{pairs}>", self.name())
    }

    fn __copy__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    fn __deepcopy__<'py>(slf: Bound<'py, Self>, memo: Bound<'py, PyAny>) -> Bound<'py, Self> {
        let _ = memo; // The object is immutable.
        slf
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<PickleParts<'py>> {
        let (py, this) = (slf.py(), slf.get());
        if let Some(written) = &this.written {
            return written.kernel.bind(py).call_method1("pickled", (slf,))?.extract();
        }
        let values = this.law.values().into_pyobject(py)?;
        Ok((py.import("stickslip._core")?.getattr("_law")?, (this.name(), values).into_pyobject(py)?.into_any()))
    }

    /// The `_rate._Kernel` of a law written in Python.
    #[getter]
    fn _kernel(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.written.as_ref().map(|written| written.kernel.clone_ref(py))
    }

    /// Magnitude of its internal states.
    #[getter]
    fn _state_scale(&self) -> f64 {
        self.law.rate().map_or(1.0, |rate| rate.state_scale())
    }

    /// Returns the law with other values of its parameters, in SI units.
    fn _with(&self, py: Python<'_>, values: BTreeMap<String, f64>) -> PyResult<PyLaw> {
        let mut law = self.law.clone();
        for (key, value) in values {
            law = with(&law, &key, value).map_err(|message| error::model(py, message))?;
        }
        Ok(PyLaw { law, written: self.written.clone() })
    }
}

/// Returns a law with another value (SI) of one parameter, or the reason why it is invalid.
pub fn with(law: &SharedLaw, key: &str, value: f64) -> Result<SharedLaw, String> {
    let changed = law.with_value(key, value).ok_or_else(|| format!("law `{}` has no parameter `{key}`", law.name()))?;
    // The symmetry of a law written in Python was tested when it was made.
    let checked = if python_law::is_written(law) {
        changed.check_consistency()
    } else {
        changed.check().map_err(|cause| cause.to_string())
    };
    match checked {
        Ok(()) if value.is_finite() => Ok(changed),
        Ok(()) => Err(format!("{}: `{key}` must be finite, found {value}", law.name())),
        Err(message) if python_law::is_written(law) => Err(format!("{}: {message}", law.name())),
        Err(message) => Err(message),
    }
}

/// Recreates a built-in law from its pickle: its name and all values in SI units.
#[pyfunction]
pub fn _law(py: Python<'_>, name: &str, values: Vec<f64>) -> PyResult<PyLaw> {
    let row = row(py, name)?;
    if values.len() != row.parameters.len() {
        return Err(error::model(
            py,
            format!("this is not a valid pickle of a law: `{name}` has {} parameters", row.parameters.len()),
        ));
    }
    let values = row.parameters.iter().map(|parameter| parameter.key).zip(values).collect();
    let law = row.build(&values).map_err(|cause| error::model(py, cause))?;
    Ok(PyLaw { law, written: None })
}

/// Returns the table row of a law, or an exception that lists the laws.
fn row(py: Python<'_>, name: &str) -> PyResult<&'static LawInfo> {
    law::find(name).ok_or_else(|| {
        let names: Vec<&str> = law::TABLE.iter().map(|row| row.name).collect();
        error::model(py, format!("unknown law `{name}`; the laws are {}", names.join(", ")))
    })
}

/// Creates a law by its name; ``stickslip.laws()`` lists the laws with their parameters.
///
/// Quantities are numbers in SI units or strings with units.
///
/// >>> import stickslip
/// >>> stickslip.law("jenkins", stiffness="10 N/mm", limit=2.0)
/// <stickslip.Law jenkins, stiffness=10000, limit=2>
#[pyfunction]
#[pyo3(name = "law", signature = (name, /, **parameters))]
pub fn law_by_name(py: Python<'_>, name: &str, parameters: Option<&Bound<'_, PyDict>>) -> PyResult<PyLaw> {
    let row = row(py, name)?;
    let mut given: BTreeMap<String, Bound<'_, PyAny>> = BTreeMap::new();
    for (key, value) in parameters.into_iter().flatten() {
        given.insert(key.extract()?, value);
    }
    if let Some(unknown) = given.keys().find(|key| row.parameters.iter().all(|parameter| parameter.key != **key)) {
        let keys: Vec<&str> = row.parameters.iter().map(|parameter| parameter.key).collect();
        return Err(error::model(
            py,
            format!("law `{name}` has no parameter `{unknown}`; its parameters are {}", keys.join(", ")),
        ));
    }
    let mut values: BTreeMap<&str, f64> = BTreeMap::new();
    // The dimension of a parameter may depend on the value of a parameter with a fixed
    // dimension.
    let (plain, raised): (Vec<&Parameter>, Vec<&Parameter>) =
        row.parameters.iter().partition(|parameter| parameter.power.is_none());
    for parameter in plain.into_iter().chain(raised) {
        let Some(value) = given.get(parameter.key) else { continue };
        let of = |key: &str| {
            let default = || row.parameters.iter().find(|other| other.key == key).and_then(|other| other.default);
            values.get(key).copied().or_else(default)
        };
        let dimension = parameter.dimension_for(of).unwrap_or(Dimension::NONE);
        let what = format!("`{}` of law `{name}`", parameter.key);
        values.insert(parameter.key, quantity::to_si(value, dimension, &what)?);
    }
    let law = row.build(&values).map_err(|cause| error::model(py, cause))?;
    Ok(PyLaw { law, written: None })
}

/// Returns all laws as a dictionary from their names to their summaries and parameters.
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
            parameters.set_item(parameter.key, format!("{}: {}", parameter.describe_values(), parameter.doc))?;
        }
        entry.set_item("summary", row.summary)?;
        entry.set_item("parameters", parameters)?;
        all.set_item(row.name, entry)?;
    }
    Ok(all)
}

/// Parses a size of a law written in Python: a number, or the name of a parameter.
fn magnitude(
    given: &Bound<'_, PyAny>,
    what: &str,
    law: &str,
    parameters: &[(String, Dimension)],
) -> PyResult<Magnitude> {
    let py = given.py();
    if let Ok(name) = given.cast::<PyString>() {
        let at = parameters.iter().position(|(parameter, _)| *name == parameter.as_str());
        return at.map(Magnitude::Parameter).ok_or_else(|| {
            error::model(
                py,
                format!(
                    "`{what}` of law `{law}` must be a number or the name of a parameter, found {:?}",
                    name.to_string_lossy()
                ),
            )
        });
    }
    match quantity::number(given)? {
        Some(number) if number > 0.0 && (number.is_finite() || what == "scale") => Ok(Magnitude::Number(number)),
        _ => Err(error::model(py, format!("`{what}` of law `{law}` must be more than zero, found {given}"))),
    }
}

/// Creates a law in rate form from Python functions; `stickslip.rate_law` wraps this function.
#[pyfunction]
#[pyo3(signature = (name, kernel, *, directions, states, parameters, state_scale, scale, odd, passive))]
#[allow(clippy::too_many_arguments)] // one argument for each keyword of `rate_law`
pub fn _rate_law(
    py: Python<'_>,
    name: &str,
    kernel: Py<PyAny>,
    directions: usize,
    states: usize,
    parameters: &Bound<'_, PyDict>,
    state_scale: &Bound<'_, PyAny>,
    scale: &Bound<'_, PyAny>,
    odd: bool,
    passive: bool,
) -> PyResult<PyLaw> {
    if !(1..=MAX_DIRECTIONS).contains(&directions) {
        return Err(error::model(py, format!("a law has 1 to {MAX_DIRECTIONS} directions, found {directions}")));
    }
    let (mut keys, mut values) = (Vec::new(), Vec::new());
    for (key, value) in parameters {
        let key: String = key.extract()?;
        if !stickslip::model::is_identifier(&key) {
            return Err(error::model(
                py,
                format!("the name of parameter `{key}` of law `{name}` must consist of letters, digits and _"),
            ));
        }
        let (value, dimension) = quantity::of_any_dimension(&value, &format!("`{key}` of law `{name}`"))?;
        keys.push((key, dimension));
        values.push(value);
    }
    let mut law = PythonLaw::new(name, kernel, &keys);
    (law.directions, law.states, law.odd, law.passive) = (directions, states, odd, passive);
    law.state_scale = magnitude(state_scale, "state_scale", name, &keys)?;
    law.scale = magnitude(scale, "scale", name, &keys)?;
    let written = law.register();
    let law = written.law(values);
    law.check_consistency().map_err(|message| error::model(py, format!("law `{name}`: {message}")))?;
    Ok(PyLaw { law, written: Some(written) })
}
