//! The state of a reader: its texts, the problems found, the parameters, and the current
//! repetition.

use super::structure_cache::StructureCache;
use crate::compile::repeat::{Iteration, Repetition};
use crate::data::DataTable;
use crate::syntax::error::{Location, Problem, Source, StudyError};
use crate::syntax::expression::Expression;
use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::sync::Arc;

/// Contents of files by their names.
pub type DataContents = BTreeMap<String, Vec<u8>>;

/// Reads one file and the template that it names.
#[derive(Default)]
pub(super) struct Reader {
    pub(super) sources: Vec<Arc<Source>>,
    /// Folder of the files that a study names.
    pub(super) folder: Option<PathBuf>,
    pub(super) problems: Vec<Problem>,
    /// Names of the parameters in order, and their indices by name.
    pub(super) names: Vec<String>,
    pub(super) index: HashMap<String, usize>,
    /// Index of the template's text among the sources.
    pub(super) template: Option<usize>,
    /// The repetition of the current entry, and the number of its current turn.
    pub(super) repetition: Repetition,
    pub(super) turn_number: usize,
    /// True if only the study file is read. Then only the names of a structure given by
    /// matrices are known.
    pub(super) study_file_only: bool,
    /// The tables of `[[data]]`; `None` before they are read, and if they cannot be.
    pub(super) data: Option<Arc<Vec<DataTable>>>,
    /// Structures that were read before.
    pub(super) structures: Option<Arc<StructureCache>>,
    /// Contents of files of `[[data]]`, by the name that the study states.
    pub(super) data_contents: Arc<DataContents>,
}

impl Reader {
    /// Returns all problems as one error.
    pub(super) fn error(&mut self, file: &str) -> StudyError {
        // Largest number of errors reported at once.
        self.problems.truncate(20);
        let error = StudyError::from_problems(&self.sources, std::mem::take(&mut self.problems));
        error.unwrap_or_else(|| StudyError::file(file, "the study could not be read", None))
    }

    /// Returns the path of a file that the study names, relative to its folder.
    pub(super) fn path_of(&self, name: &str) -> PathBuf {
        self.folder.as_deref().map_or_else(|| name.into(), |folder| folder.join(name))
    }

    /// Adds a text that is not in the file, and returns its location.
    pub(super) fn text(&mut self, name: String, text: String) -> Location {
        let span = 0..text.len();
        self.sources.push(Arc::new(Source { name, text }));
        Location { source: self.sources.len() - 1, span }
    }

    /// Returns the current turn of the repetition.
    pub(super) fn iteration(&self) -> Iteration<'_> {
        self.repetition.iteration(self.turn_number)
    }

    /// Compiles an expression over the parameters and the indices of the turn.
    pub(super) fn compile(&self, text: &str) -> Result<Expression, crate::syntax::units::TextError> {
        let iteration = self.iteration();
        let names: Vec<&str> = self.names.iter().map(String::as_str).chain(iteration.names()).collect();
        Expression::compile_with(text, &|name| self.index.get(name).copied(), &|name| iteration.value(name), &names)
    }
}
