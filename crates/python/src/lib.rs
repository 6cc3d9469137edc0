//! The Rust part `stickslip._core` of the Python package; the Python part is in
//! `python/stickslip`.

mod error;
mod explorer;
mod law;
mod lock;
mod model;
mod progress;
mod quantity;
mod residuals;
mod result;
mod study;
mod supervision;

use pyo3::prelude::*;

/// The Rust part of `stickslip`.
#[pymodule]
mod _core {
    use pyo3::prelude::*;
    use pyo3::types::PyDict;

    #[pymodule_export]
    use crate::explorer::PyExplorer;
    #[pymodule_export]
    use crate::law::{_law, _rate_law};
    #[pymodule_export]
    use crate::law::{PyLaw, law_by_name, laws};
    #[pymodule_export]
    use crate::lock::{_lock, Lock};
    #[pymodule_export]
    use crate::model::orbit::PyOrbit;
    #[pymodule_export]
    use crate::model::{_model, _orbit, PyModel};
    #[pymodule_export]
    use crate::residuals::PyResiduals;
    #[pymodule_export]
    use crate::result::{_result, _table, PyResultSet, Table};
    #[pymodule_export]
    use crate::study::{_joined, _study, PyStudy};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }

    /// Returns all templates as a dictionary from their names to their summaries.
    ///
    /// >>> import stickslip
    /// >>> "blade-couple" in stickslip.templates()
    /// True
    #[pyfunction]
    fn templates(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let all = PyDict::new(py);
        stickslip_study::templates::TABLE.iter().try_for_each(|one| all.set_item(one.name, one.summary()))?;
        Ok(all)
    }
}
