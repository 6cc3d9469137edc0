//! What a reader knows while it reads: its texts, what was wrong so far, the parameters, and the turn of a repetition.

use crate::error::{Location, Problem, Source, StudyError};
use crate::expression::Expression;
use crate::repeat::{Repetition, Turn};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

/// Most errors that are reported at once.
const MOST_ERRORS: usize = 20;

/// Reads one file, and the template that it names.
#[derive(Default)]
pub(super) struct Reader {
    pub(super) sources: Vec<Arc<Source>>,
    /// Where files are that a study names.
    pub(super) folder: Option<PathBuf>,
    pub(super) problems: Vec<Problem>,
    /// Parameters, in order, and their index by name.
    pub(super) names: Vec<String>,
    pub(super) index: HashMap<String, usize>,
    /// The file of the template that is named, among the sources.
    pub(super) template: Option<usize>,
    /// The repetition of the entry that is being read, and which of its turns.
    pub(super) repetition: Repetition,
    pub(super) number: usize,
    /// Whether no files beside the study's own are read, so that only names are known of a structure by its matrices.
    pub(super) without_files: bool,
}

impl Reader {
    /// All problems as one error.
    pub(super) fn error(&mut self, file: &str) -> StudyError {
        self.problems.truncate(MOST_ERRORS);
        let error = StudyError::all(&self.sources, std::mem::take(&mut self.problems));
        error.unwrap_or_else(|| StudyError::file(file, "the study could not be read", None))
    }

    /// A text that is not in the file.
    pub(super) fn text(&mut self, name: String, text: String) -> Location {
        let span = 0..text.len();
        self.sources.push(Arc::new(Source { name, text }));
        Location { source: self.sources.len() - 1, span }
    }

    /// The turn of the repetition that is being read.
    pub(super) fn turn(&self) -> Turn<'_> {
        self.repetition.turn(self.number)
    }

    /// An expression over the parameters, and over the indices of the turn.
    pub(super) fn compile(&self, text: &str) -> Result<Expression, crate::units::Fault> {
        let turn = self.turn();
        let names: Vec<&str> = self.names.iter().map(String::as_str).chain(turn.names()).collect();
        Expression::compile_with(text, &|name| self.index.get(name).copied(), &|name| turn.value(name), &names)
    }
}
