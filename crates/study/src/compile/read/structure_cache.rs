//! Structures that stay in memory after their files were read, with their reductions.
//!
//! A program that reads many versions of one study, such as the explorer, then reads the
//! matrices once and reduces them once.

use super::structure::{ReadStructure, StatedFile};
use crate::syntax::error::Problem;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

/// Limits of a [`StructureCache`].
#[derive(Debug, Clone, Copy)]
pub struct StructureCacheSettings {
    /// Largest number of structures. Default 2: a designer compares two versions of a part.
    pub structures: usize,
    /// Largest number of stored reductions of a structure; with more, its files are read again.
    /// Default 24: two dozen frequency ranges, of 40 MB each for 70,000 rows and 70 modes.
    pub reductions: usize,
}

impl Default for StructureCacheSettings {
    fn default() -> Self {
        StructureCacheSettings { structures: 2, reductions: 24 }
    }
}

/// Structures by the files that state them. A file that changes on the disk is read again.
///
/// # Example
/// ```
/// use std::sync::Arc;
/// use stickslip_study::{StructureCache, read_study_with, templates};
/// let kept = Arc::new(StructureCache::default());
/// let text = templates::find("blade-couple").unwrap().study;
/// assert_eq!(read_study_with("couple.toml", text, &kept).unwrap().cases(), 4);
/// assert_eq!(kept.len(), 0);   // this study has no matrices
/// ```
#[derive(Debug, Default)]
pub struct StructureCache {
    /// The last used structure is the last one.
    kept: Mutex<Vec<KeptStructure>>,
    settings: StructureCacheSettings,
}

#[derive(Debug)]
struct KeptStructure {
    key: StructureKey,
    structure: ReadStructure,
}

/// The files of a structure, their state on the disk, and the units of their numbers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StructureKey {
    files: Vec<FileState>,
    units: String,
}

#[derive(Debug, Clone, PartialEq)]
struct FileState {
    key: &'static str,
    path: PathBuf,
    name: Option<String>,
    format: Option<String>,
    bytes: u64,
    modified: SystemTime,
}

impl StructureKey {
    /// Describes the files of a structure; `None` if the state of a file is not known.
    pub(super) fn new(stated: &[(&'static str, StatedFile)], units: &str, folder: &Path) -> Option<StructureKey> {
        let state = |(key, file): &(&'static str, StatedFile)| {
            let path = folder.join(&file.path);
            let data = std::fs::metadata(&path).ok()?;
            let (bytes, modified) = (data.len(), data.modified().ok()?);
            Some(FileState { key, path, name: file.name.clone(), format: file.format.clone(), bytes, modified })
        };
        let files = stated.iter().map(state).collect::<Option<Vec<_>>>()?;
        Some(StructureKey { files, units: units.to_owned() })
    }
}

impl StructureCache {
    /// Makes an empty cache with other limits.
    pub fn new(settings: StructureCacheSettings) -> StructureCache {
        StructureCache { kept: Mutex::default(), settings }
    }

    /// Returns the number of structures.
    pub fn len(&self) -> usize {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner).len()
    }

    /// Returns whether there is no structure.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns a structure, or reads it once. Concurrent requests wait for the first one.
    pub(super) fn get_or_read(
        &self,
        key: StructureKey,
        read: impl FnOnce() -> Result<ReadStructure, Problem>,
    ) -> Result<ReadStructure, Problem> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let known = kept.iter().position(|one| one.key == key).map(|index| kept.remove(index));
        let fresh = known.filter(|one| one.structure.component.stored_reductions() <= self.settings.reductions);
        let structure = match fresh {
            Some(one) => one.structure,
            None => read()?,
        };
        kept.push(KeptStructure { key, structure: structure.clone() });
        let excess = kept.len().saturating_sub(self.settings.structures);
        kept.drain(..excess);
        Ok(structure)
    }
}
