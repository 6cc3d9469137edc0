//! Progress bars of tqdm if it is installed, or a callback of the caller.

use pyo3::prelude::*;
use pyo3::types::PyBool;

/// Returns the progress callback: none, a bar, or the given function.
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
            // Without tqdm there is no bar.
            Ok(_) => {
                let bar = py.import("stickslip._progress")?.call_method1("bar", (name,))?;
                Ok((!bar.is_none()).then_some(bar))
            }
            Err(_) => Ok(Some(progress)),
        },
    }
}

/// Closes a bar made by [`bar`]. A function of the caller needs no closing.
pub fn close(bar: Option<Bound<'_, PyAny>>) -> PyResult<()> {
    match bar {
        Some(bar) if bar.hasattr("_stickslip_close")? => bar.call_method0("_stickslip_close").map(|_| ()),
        _ => Ok(()),
    }
}
