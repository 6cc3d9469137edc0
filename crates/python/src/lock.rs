//! The lock of a campaign's folder: only one process at a time writes into the folder.

use crate::error;
use pyo3::prelude::*;
use std::fs::{File, OpenOptions, TryLockError};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// A file that is locked until it is released or the process ends.
#[pyclass(frozen, module = "stickslip._core", name = "_Lock")]
pub struct Lock(Mutex<Option<File>>);

#[pymethods]
impl Lock {
    /// Releases the lock.
    fn release(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

/// Locks the file at this path and creates it if necessary.
///
/// Returns `None` if another process holds the lock. On a file system without locks, nothing is
/// locked.
#[pyfunction]
pub fn _lock(py: Python<'_>, path: PathBuf) -> PyResult<Option<Lock>> {
    let file = OpenOptions::new().create(true).truncate(false).write(true).open(&path);
    let file = file.map_err(|cause| error::report(py, format!("cannot write {}: {cause}", path.display())))?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Ok(None),
        _ => Ok(Some(Lock(Mutex::new(Some(file))))),
    }
}
