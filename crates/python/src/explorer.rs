//! The explorer of a study, in a frame of a notebook or in the browser.

use crate::error;
use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use stickslip_explore::catalog::Source;
use stickslip_explore::{Embedding, ExploreError, Server, Settings, Start};

/// A running explorer. A notebook shows it in a frame; ``address`` opens in a browser on the same
/// machine. It ends with ``stop`` or with the program.
#[pyclass(frozen, module = "stickslip", name = "Explorer")]
pub struct PyExplorer {
    server: Mutex<Option<Server>>,
    /// Address of the page, with its token.
    #[pyo3(get)]
    address: String,
    height: u32,
}

impl PyExplorer {
    /// Starts the explorer of a study.
    pub fn start(py: Python<'_>, source: Source, port: u16, height: u32) -> PyResult<PyExplorer> {
        let settings = Settings {
            folder: PathBuf::from("."),
            port,
            embedding: Embedding::LocalPages,
            ..Settings::new(Start::Text(source))
        };
        let started = py.detach(|| Server::start(settings));
        let server = started.map_err(|cause| match cause {
            ExploreError::Invalid(cause) => error::study(py, &cause),
            other => PyOSError::new_err(other.to_string()),
        })?;
        let address = server.address().to_owned();
        Ok(PyExplorer { server: Mutex::new(Some(server)), address, height })
    }
}

#[pymethods]
impl PyExplorer {
    /// Ends the explorer.
    fn stop(&self, py: Python<'_>) {
        let server = self.server.lock().unwrap_or_else(PoisonError::into_inner).take();
        py.detach(|| drop(server));
    }

    fn _repr_html_(&self) -> String {
        format!(
            "<iframe src=\"{}\" title=\"Stickslip explorer\" style=\"width: 100%; height: {}px; border: 0\"></iframe>",
            self.address, self.height
        )
    }

    fn __repr__(&self) -> String {
        format!("<Explorer at {}>", self.address)
    }
}
