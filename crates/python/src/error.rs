//! Converts errors to Python exceptions with the text that the command prints.
//!
//! The classes are in `stickslip/_errors.py`, because Python defines their bases and attributes
//! more simply.

use miette::{GraphicalReportHandler, GraphicalTheme};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use stickslip_study::StudyError;

/// Creates an exception of a class in `stickslip._errors`.
pub fn exception(py: Python<'_>, class: &str, message: String) -> PyErr {
    with(py, class, message, |_| Ok(()))
}

fn with(py: Python<'_>, class: &str, message: String, fill: impl FnOnce(&Bound<'_, PyDict>) -> PyResult<()>) -> PyErr {
    let build = || {
        let attributes = PyDict::new(py);
        fill(&attributes)?;
        py.import("stickslip._errors")?.getattr(class)?.call((message,), Some(&attributes))
    };
    match build() {
        Ok(value) => PyErr::from_value(value),
        Err(error) => error,
    }
}

/// Creates the exception for a refused study.
///
/// Its text is the message of the command. File, line, column, key, reason and help are
/// attributes.
pub fn study(py: Python<'_>, error: &StudyError) -> PyErr {
    let mut text = String::new();
    let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor());
    if handler.render_report(&mut text, error).is_err() {
        text = error.to_string();
    }
    with(py, "StudyError", text, |attributes| {
        attributes.set_item("file", error.file_name())?;
        attributes.set_item("line", error.line())?;
        attributes.set_item("column", error.column())?;
        attributes.set_item("key", error.key())?;
        attributes.set_item("reason", error.message())?;
        attributes.set_item("help", error.help_text())
    })
}

/// Creates the exception for a refused model, law or quantity.
pub fn model(py: Python<'_>, error: impl ToString) -> PyErr {
    exception(py, "ModelError", error.to_string())
}

/// Creates the exception for a system that a method cannot solve.
pub fn method(py: Python<'_>, error: impl ToString) -> PyErr {
    exception(py, "MethodError", error.to_string())
}

/// Creates the exception for an orbit that was not found.
pub fn orbit(py: Python<'_>, error: impl ToString) -> PyErr {
    exception(py, "OrbitError", error.to_string())
}

/// Creates the exception for results that could not be made or written.
pub fn report(py: Python<'_>, error: impl ToString) -> PyErr {
    exception(py, "ReportError", error.to_string())
}
