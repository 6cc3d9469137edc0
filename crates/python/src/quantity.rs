//! Quantities from Python: numbers in SI units, or strings with units as in a study file.
//!
//! Frequencies are numbers in Hz, as in the tables.

use crate::error;
use pyo3::prelude::*;
use pyo3::types::{
    PyBool, PyByteArray, PyBytes, PyComplex, PyDict, PyFloat, PyFrozenSet, PyInt, PyMapping, PyMemoryView, PySet,
    PyString,
};
use std::f64::consts::PI;
use stickslip::dimension::Dimension;
use stickslip_study::expression::{Expression, quantity};

/// Returns a quantity of this dimension in SI units. `what` names the quantity in error
/// messages.
pub fn to_si(value: &Bound<'_, PyAny>, dimension: Dimension, what: &str) -> PyResult<f64> {
    let py = value.py();
    if let Ok(text) = value.cast::<PyString>() {
        return quantity(text.to_str()?, dimension).map_err(|fault| {
            let help = fault.help.map(|help| format!(" ({help})")).unwrap_or_default();
            error::model(py, format!("{what} = {:?}: {}{help}", text.to_string_lossy(), fault.message))
        });
    }
    let number = number(value)?.ok_or_else(|| {
        let unit =
            dimension.name_and_unit().map_or_else(|| dimension.to_string(), |(name, unit)| format!("{name} in {unit}"));
        error::model(
            py,
            format!("{what} must be a number in SI units or a string with a unit ({unit}), found {}", kind(value)),
        )
    })?;
    if !number.is_finite() {
        return Err(error::model(py, format!("{what} must be finite, found {number}")));
    }
    Ok(from_unit(number, dimension))
}

/// Returns a quantity of any dimension in SI units, and its dimension.
pub fn of_any_dimension(value: &Bound<'_, PyAny>, what: &str) -> PyResult<(f64, Dimension)> {
    let dimension = match value.cast::<PyString>() {
        Ok(text) => Expression::compile::<&str>(text.to_str()?, &[])
            .and_then(|expression| expression.evaluate(&[]))
            .map_err(|fault| {
                error::model(value.py(), format!("{what} = {:?}: {}", text.to_string_lossy(), fault.message))
            })?
            .dimension
            .unwrap_or(Dimension::NONE),
        Err(_) => Dimension::NONE,
    };
    Ok((to_si(value, dimension, what)?, dimension))
}

/// Returns one or several quantities in SI units.
///
/// The value is a number, a string, or a sequence of them such as an array. A `dimension` of
/// `None` accepts any dimension.
pub fn many(value: &Bound<'_, PyAny>, dimension: Option<Dimension>, what: &str) -> PyResult<Vec<f64>> {
    let one = |value: &Bound<'_, PyAny>| match dimension {
        Some(dimension) => to_si(value, dimension, what),
        None => Ok(of_any_dimension(value, what)?.0),
    };
    if value.cast::<PyString>().is_ok() || number(value)?.is_some() {
        return Ok(vec![one(value)?]);
    }
    let dimension = dimension.unwrap_or(Dimension::NONE);
    if let Some(numbers) = array(value, what)? {
        if let Some(number) = numbers.iter().find(|number| !number.is_finite()) {
            return Err(error::model(value.py(), format!("{what} must be finite, found {number}")));
        }
        return Ok(numbers.into_iter().map(|number| from_unit(number, dimension)).collect());
    }
    if !is_sequence(value)? {
        return Err(no_sequence(value, what));
    }
    value.try_iter()?.map(|item| one(&item?)).collect()
}

/// Returns numbers without a unit from one number, an array or a sequence.
pub fn numbers(value: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<f64>> {
    let no_numbers = || {
        error::model(
            value.py(),
            format!("{what} must be one number or a list of numbers in SI units, found {}", kind(value)),
        )
    };
    if let Some(number) = number(value)? {
        return Ok(vec![number]);
    }
    if let Some(numbers) = array(value, what)? {
        return Ok(numbers);
    }
    if value.cast::<PyString>().is_ok() || !is_sequence(value)? {
        return Err(no_numbers());
    }
    value.try_iter()?.map(|item| number(&item?)?.ok_or_else(no_numbers)).collect()
}

/// Returns the number that a user would give for an SI value: Hz for frequencies, otherwise SI.
///
/// Passing the number back gives exactly the same SI value.
pub fn user_value(si: f64, dimension: Option<Dimension>) -> f64 {
    let is_frequency = |dimension| dimension == Dimension::FREQUENCY || dimension == Dimension::SWEEP_RATE;
    if !dimension.is_some_and(is_frequency) {
        return si;
    }
    let nearest = si / (2.0 * PI);
    // The exact inverse may be an adjacent floating-point number of the rounded quotient.
    let candidates = [nearest, nearest.next_up(), nearest.next_down()];
    candidates.into_iter().find(|hertz| 2.0 * hertz * PI == si).unwrap_or(nearest)
}

/// Converts Hz to rad/s with the same rounding as a unit in a study file.
fn from_unit(number: f64, dimension: Dimension) -> f64 {
    if dimension == Dimension::FREQUENCY { 2.0 * number * PI } else { number }
}

/// Returns a real number of Python or NumPy.
///
/// Returns `None` for other objects, such as sequences, complex or masked numbers, flags or
/// bytes.
pub fn number(value: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
    if value.cast::<PyFloat>().is_ok() {
        return value.extract().map(Some);
    }
    if value.cast::<PyBool>().is_ok() || value.cast::<PyComplex>().is_ok() || is_bytes(value) {
        return Ok(None);
    }
    if value.cast::<PyInt>().is_ok() {
        return value.extract().map(Some);
    }
    if let Ok(dtype) = value.getattr("dtype") {
        let plain =
            is_real(&dtype) && value.getattr("ndim").is_ok_and(|ndim| ndim.extract::<usize>().is_ok_and(|n| n == 0));
        return if plain && !is_masked(value)? { value.call_method0("item")?.extract().map(Some) } else { Ok(None) };
    }
    // Fractions, decimals and other numbers.
    Ok(if value.hasattr("__float__")? && !value.hasattr("__len__")? { value.extract().ok() } else { None })
}

/// Returns the numbers of a one-dimensional numeric array, such as a NumPy array or a pandas
/// column.
///
/// Returns `None` for other objects.
fn array(value: &Bound<'_, PyAny>, what: &str) -> PyResult<Option<Vec<f64>>> {
    let py = value.py();
    if !value.hasattr("__array__")? || is_masked(value)? {
        return Ok(None);
    }
    let numpy = py.import("numpy")?;
    let array = numpy.call_method1("asarray", (value,))?;
    if !is_real(&array.getattr("dtype")?) {
        return Ok(None);
    }
    let ndim: usize = array.getattr("ndim")?.extract()?;
    if ndim != 1 {
        return Err(error::model(
            py,
            format!("{what} must be one number or a list of them, found an array of {ndim} dimensions"),
        ));
    }
    let array = numpy.call_method1("asarray", (array, "float64"))?;
    let array: numpy::PyReadonlyArray1<'_, f64> = array.extract()?;
    Ok(Some(array.as_array().iter().copied().collect()))
}

/// Returns `true` for integer and real types, and `false` for flags, complex numbers, texts or
/// times.
pub fn is_real(dtype: &Bound<'_, PyAny>) -> bool {
    let kind = dtype.getattr("kind").and_then(|kind| kind.extract::<String>());
    kind.is_ok_and(|kind| matches!(kind.as_str(), "f" | "i" | "u"))
}

pub fn is_masked(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    value.is_instance(&value.py().import("numpy.ma")?.getattr("MaskedArray")?)
}

fn is_bytes(value: &Bound<'_, PyAny>) -> bool {
    value.cast::<PyBytes>().is_ok() || value.cast::<PyByteArray>().is_ok() || value.cast::<PyMemoryView>().is_ok()
}

/// Returns `true` for an ordered sequence of values, but not for a dictionary or a set.
fn is_sequence(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    let unordered =
        value.cast::<PyDict>().is_ok() || value.cast::<PySet>().is_ok() || value.cast::<PyFrozenSet>().is_ok();
    if unordered || is_bytes(value) || is_masked(value)? || value.try_iter().is_err() {
        return Ok(false);
    }
    let abc = value.py().import("collections.abc")?;
    Ok(!value.is_instance(&abc.getattr("Mapping")?)? && !value.is_instance(&abc.getattr("Set")?)?)
}

fn no_sequence(value: &Bound<'_, PyAny>, what: &str) -> PyErr {
    let message = format!(
        "{what} must be one value or a list of them, numbers in SI units or strings with units, found {}",
        kind(value)
    );
    error::model(value.py(), message)
}

/// Returns a mapping as a dictionary.
pub fn dictionary<'py>(value: &Bound<'py, PyAny>, what: &str) -> PyResult<Bound<'py, PyDict>> {
    if let Ok(dict) = value.cast::<PyDict>() {
        return Ok(dict.clone());
    }
    if !value.is_instance(&value.py().import("collections.abc")?.getattr("Mapping")?)? {
        return Err(error::model(value.py(), format!("{what} must be a dictionary, found {}", kind(value))));
    }
    let dict = PyDict::new(value.py());
    dict.update(value.cast::<PyMapping>()?)?;
    Ok(dict)
}

/// Returns the type name of an object for messages.
pub fn kind(value: &Bound<'_, PyAny>) -> String {
    let name = value.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string());
    match value.getattr("dtype").and_then(|dtype| dtype.str().map(|text| text.to_string())) {
        Ok(dtype) if dtype != name => format!("{name} of {dtype}"),
        _ => name,
    }
}
