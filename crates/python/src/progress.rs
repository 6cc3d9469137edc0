//! Bars of progress: those of tqdm, if it is there, or a function of the caller's.

use pyo3::prelude::*;
use pyo3::types::PyBool;

/// What `progress` asks for: `None`, a bar, or the function that was given.
pub fn bar<'py>(
    py: Python<'py>,
    progress: Option<Bound<'py, PyAny>>,
    name: &str,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    match progress {
        None => Ok(None),
        Some(progress) if progress.is_none() => Ok(None),
        Some(progress) => match progress.cast::<PyBool>() {
            Ok(flag) if !flag.is_true() => Ok(None),
            // without tqdm there is none
            Ok(_) => {
                let bar = py.import("stickslip._progress")?.call_method1("bar", (name,))?;
                Ok((!bar.is_none()).then_some(bar))
            }
            Err(_) => Ok(Some(progress)),
        },
    }
}

/// Closes a bar that was made here; a function from elsewhere has nothing to close.
pub fn close(bar: Option<Bound<'_, PyAny>>) -> PyResult<()> {
    match bar {
        Some(bar) if bar.hasattr("_stickslip_close")? => bar.call_method0("_stickslip_close").map(|_| ()),
        _ => Ok(()),
    }
}
