//! Files into memory, and what the system says if that fails.

use std::path::Path;

use crate::error::{Error, Kind, Location};

pub(crate) fn load(path: &Path) -> Result<Vec<u8>, Error> {
    std::fs::read(path).map_err(|error| io(path, &error))
}

pub(crate) fn io(path: &Path, error: &std::io::Error) -> Error {
    Error::new(Kind::Io, Location::File, error.to_string(), "check the path and its permissions").of(path)
}
