//! Quantities: numbers in SI, or strings with units as in a study file. Frequencies are numbers in Hz, as in the tables.

use crate::error;
use pyo3::prelude::*;
use pyo3::types::PyString;
use std::f64::consts::PI;
use stickslip::dimension::Dimension;
use stickslip_study::expression::quantity;

/// A quantity of this dimension, in SI; `what` says whose it is, for the message.
pub fn si(value: &Bound<'_, PyAny>, dimension: Dimension, what: &str) -> PyResult<f64> {
    let py = value.py();
    if let Ok(text) = value.cast::<PyString>() {
        return quantity(text.to_str()?, dimension).map_err(|fault| {
            let help = fault.help.map(|help| format!(" ({help})")).unwrap_or_default();
            error::model(py, format!("{what} = {:?}: {}{help}", text.to_string_lossy(), fault.message))
        });
    }
    let number: f64 = value.extract().map_err(|_| {
        let unit =
            dimension.name_and_unit().map_or_else(|| dimension.to_string(), |(name, unit)| format!("{name} ({unit})"));
        let kind = value.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string());
        error::model(py, format!("{what} must be a {unit}: a number in SI or a string with a unit, found {kind}"))
    })?;
    if !number.is_finite() {
        return Err(error::model(py, format!("{what} must be finite, found {number}")));
    }
    // the unit of frequencies in all tables; the rounding is that of the unit in a study file
    Ok(if dimension == Dimension::FREQUENCY { 2.0 * number * PI } else { number })
}

/// One quantity or many of them, in SI: a number, a string, or a sequence of them such as an array.
pub fn many(value: &Bound<'_, PyAny>, dimension: Dimension, what: &str) -> PyResult<Vec<f64>> {
    if value.cast::<PyString>().is_ok() || value.extract::<f64>().is_ok_and(|_| value.len().is_err()) {
        return Ok(vec![si(value, dimension, what)?]);
    }
    if let Ok(array) = value.extract::<numpy::PyReadonlyArray1<'_, f64>>() {
        let numbers: Vec<f64> = array.as_array().iter().copied().collect();
        if let Some(number) = numbers.iter().find(|number| !number.is_finite()) {
            return Err(error::model(value.py(), format!("{what} must be finite, found {number}")));
        }
        let factor = |number: f64| if dimension == Dimension::FREQUENCY { 2.0 * number * PI } else { number };
        return Ok(numbers.into_iter().map(factor).collect());
    }
    value.try_iter()?.map(|one| si(&one?, dimension, what)).collect()
}
