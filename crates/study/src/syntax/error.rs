//! Errors in a study file: where, what was expected, what to do.

use crate::syntax::units::TextError;
use miette::{Diagnostic, LabeledSpan, MietteError, SourceCode, SourceSpan, SpanContents};
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

/// A text that contains values: the file, or the value of a `--set`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Source {
    pub name: String,
    pub text: String,
}

/// The position of a value: index of the source and byte range in its text.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Location {
    pub source: usize,
    pub span: Range<usize>,
}

/// An error that refers to its source by index.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Problem {
    pub location: Location,
    pub key: String,
    pub message: String,
    pub help: Option<String>,
}

impl Problem {
    pub fn new(location: &Location, key: impl Into<String>, message: impl Into<String>) -> Self {
        Problem { location: location.clone(), key: key.into(), message: message.into(), help: None }
    }

    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    pub fn maybe_help(mut self, help: Option<String>) -> Self {
        self.help = help;
        self
    }

    /// Builds the problem of a fault inside the text at `location`.
    ///
    /// `inner` is the byte of the source at which the text begins. It is `None` if the source
    /// does not contain the text literally; then the whole location is wrong.
    pub fn from_text_error(location: &Location, inner: Option<usize>, key: &str, fault: TextError) -> Self {
        let span = match inner {
            Some(start) => start + fault.span.start..start + fault.span.end,
            None => location.span.clone(),
        };
        let location = Location { source: location.source, span };
        Problem { location, key: key.to_owned(), message: fault.message, help: fault.help }
    }
}

/// The reason why a study is refused.
///
/// [`Display`](fmt::Display) writes one line with file, line and column. As a [`Diagnostic`] it
/// underlines the wrong value and carries the other errors of the same file as related errors.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyError(Box<ErrorDetails>);

#[derive(Debug, Clone, PartialEq)]
struct ErrorDetails {
    source: Arc<Source>,
    /// Byte range in the text, line and column; `None` for a file that could not be read.
    position: Option<(Range<usize>, usize, usize)>,
    key: Option<String>,
    message: String,
    help: Option<String>,
    related: Vec<StudyError>,
}

impl StudyError {
    /// Returns an error about a file as a whole.
    pub(crate) fn file(name: &str, message: impl Into<String>, help: Option<String>) -> Self {
        let source = Arc::new(Source { name: name.to_owned(), text: String::new() });
        StudyError(Box::new(ErrorDetails {
            source,
            position: None,
            key: None,
            message: message.into(),
            help,
            related: Vec::new(),
        }))
    }

    /// Returns an error at a location in one of the sources.
    pub(crate) fn at_location(sources: &[Arc<Source>], problem: Problem) -> Self {
        let source = match sources.get(problem.location.source) {
            Some(source) => Arc::clone(source),
            None => Arc::new(Source { name: String::new(), text: String::new() }),
        };
        let start = char_boundary(&source.text, problem.location.span.start);
        let end = char_boundary(&source.text, problem.location.span.end.max(start));
        let (line, column) = line_and_column(&source.text, start);
        StudyError(Box::new(ErrorDetails {
            source,
            position: Some((start..end, line, column)),
            key: (!problem.key.is_empty()).then_some(problem.key),
            message: problem.message,
            help: problem.help,
            related: Vec::new(),
        }))
    }

    /// Returns the first of several errors in file order, with the others attached.
    pub(crate) fn from_problems(sources: &[Arc<Source>], mut problems: Vec<Problem>) -> Option<Self> {
        problems.sort_by_key(|p| (p.location.source, p.location.span.start));
        // a repeated entry reports one mistake once
        problems.dedup_by(|later, first| later.location == first.location && later.key == first.key);
        let mut errors = problems.into_iter().map(|problem| StudyError::at_location(sources, problem));
        let mut first = errors.next()?;
        first.0.related = errors.collect();
        Some(first)
    }

    /// Name of the file as given; `--set NAME` for a value from the command line.
    pub fn file_name(&self) -> &str {
        &self.0.source.name
    }

    /// Line of the wrong value, from 1; `None` if the file could not be read at all.
    pub fn line(&self) -> Option<usize> {
        self.0.position.as_ref().map(|at| at.1)
    }

    /// Column of the wrong value in characters, from 1.
    pub fn column(&self) -> Option<usize> {
        self.0.position.as_ref().map(|at| at.2)
    }

    /// Key that the error is about, for example `stiffness`.
    pub fn key(&self) -> Option<&str> {
        self.0.key.as_deref()
    }

    /// States in one line what is wrong and what was expected.
    pub fn message(&self) -> &str {
        &self.0.message
    }

    /// States what to do.
    pub fn help_text(&self) -> Option<&str> {
        self.0.help.as_deref()
    }

    /// Returns the text that is wrong.
    pub fn underlined(&self) -> Option<&str> {
        self.0.position.as_ref().and_then(|(span, _, _)| self.0.source.text.get(span.clone()))
    }

    /// Returns the other errors that were found in the same file.
    pub fn others(&self) -> &[StudyError] {
        &self.0.related
    }
}

impl StudyError {
    /// Returns the bytes to underline if their lines and the adjacent lines are short enough to
    /// draw.
    fn drawable(&self) -> Option<&Range<usize>> {
        let (span, _, _) = self.0.position.as_ref()?;
        let text = &self.0.source.text;
        let back = |from: usize| text[..from].rfind('\n');
        let on = |from: usize| text[from..].find('\n').map_or(text.len(), |i| from + i);
        let start = back(span.start).map_or(0, |end| back(end).map_or(0, |i| i + 1));
        let end = on((on(span.end) + 1).min(text.len()));
        // Longest line that is drawn, bytes. A picture of a longer line is not readable, and
        // `miette` panics on columns above 65535.
        text[start..end].split('\n').all(|line| line.len() <= 2_000).then_some(span)
    }
}

/// Returns the nearest character boundary at or before `at`.
fn char_boundary(text: &str, at: usize) -> usize {
    let mut at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}

/// Returns line and column (in characters) of a byte, both from 1.
fn line_and_column(text: &str, at: usize) -> (usize, usize) {
    let before = &text[..at];
    let line = before.matches('\n').count() + 1;
    let start = before.rfind('\n').map_or(0, |i| i + 1);
    (line, before[start..].chars().count() + 1)
}

impl fmt::Display for StudyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:", self.0.source.name)?;
        if let Some((_, line, column)) = &self.0.position {
            write!(f, "{line}:{column}:")?;
        }
        match &self.0.key {
            Some(key) => write!(f, " `{key}`: {}", self.0.message),
            None => write!(f, " {}", self.0.message),
        }
    }
}

impl std::error::Error for StudyError {}

impl SourceCode for Source {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        before: usize,
        after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let inner = self.text.as_str().read_span(span, before, after)?;
        Ok(Box::new(miette::MietteSpanContents::new_named(
            self.name.clone(),
            inner.data(),
            *inner.span(),
            inner.line(),
            inner.column(),
            inner.line_count(),
        )))
    }
}

impl Diagnostic for StudyError {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.0.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.drawable().map(|_| &*self.0.source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let span = self.drawable()?;
        let label = LabeledSpan::new(Some("here".to_owned()), span.start, span.len());
        Some(Box::new(std::iter::once(label)))
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        if self.0.related.is_empty() {
            return None;
        }
        Some(Box::new(self.0.related.iter().map(|error| error as &dyn Diagnostic)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_count_characters() {
        assert_eq!(line_and_column("a\nµ = 1", 5), (2, 3));
        assert_eq!(char_boundary("µ", 1), 0);
        assert_eq!(char_boundary("µ", 9), 2);
    }
}
