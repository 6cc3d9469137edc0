//! Files that a deck includes.

use crate::error::{Error, ErrorKind};
use crate::file::load;
use crate::text::Line;
use std::path::{Path, PathBuf};

/// Deepest nesting of included files.
const MAX_DEPTH: usize = 8;

/// Loads a file that a line includes, with its path. `folder` is the folder of the deck, and
/// `depth` the nesting of the file with this line.
///
/// # Errors
/// [`Error`]: the deck has no folder, the files are nested too deeply, or the file cannot be read.
pub(super) fn load_included(
    line: &Line,
    name: &str,
    folder: Option<&Path>,
    depth: usize,
) -> Result<(PathBuf, Vec<u8>), Error> {
    let refuse =
        |problem: String, remedy: &str| Err(Error::new(ErrorKind::Unsupported, line.location(), problem, remedy));
    let Some(folder) = folder else {
        return refuse(format!("the deck includes the file {name}"), "read the deck from its folder");
    };
    if depth == MAX_DEPTH {
        return refuse(format!("more than {MAX_DEPTH} files include each other"), "does a file include itself?");
    }
    let path = folder.join(name);
    let bytes = load(&path)?;
    Ok((path, bytes))
}
