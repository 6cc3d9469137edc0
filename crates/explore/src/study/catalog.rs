//! The studies that the explorer offers: the templates, and the study files of one folder.
//!
//! A request names a study by its entry. No other file can be read through the explorer.

use serde::Serialize;
use std::path::{Path, PathBuf};
use stickslip_study::{StudyError, read_study, templates};

/// The studies that are offered.
#[derive(Debug, Clone)]
pub struct Catalog {
    folder: PathBuf,
    settings: CatalogSettings,
    /// The study with which the explorer started.
    named: Option<Named>,
}

/// The study with which the explorer started. It may be outside the folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Named {
    /// A file.
    File(PathBuf),
    /// A text that a program holds, such as a notebook.
    Text(Source),
}

/// Limits of a catalog.
#[derive(Debug, Clone, Copy)]
pub struct CatalogSettings {
    /// Largest number of files of the folder that are offered. Default 200: more do not fit on a
    /// page that a person reads.
    pub files: usize,
    /// Largest size of a study file, bytes. Default 1 MiB: a study by hand has kilobytes.
    pub bytes: u64,
}

impl Default for CatalogSettings {
    fn default() -> Self {
        CatalogSettings { files: 200, bytes: 1 << 20 }
    }
}

/// An entry of the catalog.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Entry {
    /// Identifier in requests: `template:NAME` or `file:NAME`.
    pub id: String,
    /// Name.
    pub name: String,
    /// One line that describes the study.
    pub summary: String,
    /// Kind of the study.
    pub kind: String,
}

/// A study of the catalog: its name for messages and relative files, and its text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Name of the file; for a template its name with `.toml`.
    pub file: String,
    /// The text.
    pub text: String,
}

impl Named {
    fn id(&self) -> String {
        match self {
            Named::File(path) => file_id(path),
            Named::Text(source) => file_id(Path::new(&source.file)),
        }
    }
}

impl Catalog {
    /// Offers the templates and the study files of a folder, and the study `named` if there is
    /// one.
    pub fn new(folder: &Path, named: Option<Named>) -> Catalog {
        Catalog { folder: folder.to_owned(), settings: CatalogSettings::default(), named }
    }

    /// Returns the identifier of the named study.
    pub fn named_id(&self) -> Option<String> {
        self.named.as_ref().map(Named::id)
    }

    /// Returns all entries: the templates, then the files in alphabetical order.
    pub fn entries(&self) -> Vec<Entry> {
        let of_template = |template: &templates::Template| Entry {
            id: format!("template:{}", template.name),
            name: template.name.to_owned(),
            summary: template.summary().to_owned(),
            kind: kind_of(template.study),
        };
        templates::TABLE.iter().map(of_template).chain(self.files().iter().filter_map(|path| self.file(path))).collect()
    }

    /// Returns the study of an entry.
    ///
    /// # Errors
    /// A sentence, if there is no such entry, or if its file cannot be read.
    ///
    /// # Example
    /// ```
    /// use stickslip_explore::catalog::Catalog;
    /// let catalog = Catalog::new(std::path::Path::new("."), None);
    /// assert!(catalog.source("template:blade-couple").unwrap().text.contains("blade1"));
    /// assert!(catalog.source("file:../../etc/passwd").is_err());
    /// ```
    pub fn source(&self, id: &str) -> Result<Source, String> {
        if let Some(template) = id.strip_prefix("template:").and_then(templates::find) {
            return Ok(Source { file: format!("{}.toml", template.name), text: template.study.to_owned() });
        }
        let named = match &self.named {
            Some(Named::Text(source)) if file_id(Path::new(&source.file)) == id => return Ok(source.clone()),
            Some(Named::File(path)) => Some(path.clone()),
            Some(Named::Text(_)) | None => None,
        };
        let mut files = named.into_iter().chain(self.files());
        let path = files.find(|path| file_id(path) == id).ok_or_else(|| format!("there is no study `{id}`"))?;
        let text = self.text(&path).ok_or_else(|| format!("{} cannot be read as a study file", path.display()))?;
        Ok(Source { file: path.display().to_string(), text })
    }

    /// Returns the paths of the TOML files of the folder.
    fn files(&self) -> Vec<PathBuf> {
        let Ok(folder) = std::fs::read_dir(&self.folder) else { return Vec::new() };
        let is_study = |path: &PathBuf| path.extension().is_some_and(|end| end == "toml") && path.is_file();
        let mut files: Vec<PathBuf> = folder.flatten().map(|entry| entry.path()).filter(is_study).collect();
        files.sort();
        files.truncate(self.settings.files);
        files
    }

    fn text(&self, path: &Path) -> Option<String> {
        let small = std::fs::metadata(path).is_ok_and(|data| data.is_file() && data.len() <= self.settings.bytes);
        std::fs::read_to_string(path).ok().filter(|_| small)
    }

    /// Returns the entry of a file; `None` if it is not a study, such as `Cargo.toml`.
    fn file(&self, path: &Path) -> Option<Entry> {
        let text = self.text(path)?;
        let kind = kind_of(&text);
        let name = path.file_stem()?.to_str()?.to_owned();
        (!kind.is_empty()).then(|| Entry { id: file_id(path), name, summary: title_of(&text), kind })
    }
}

/// Returns the identifier of a file in the catalog.
fn file_id(path: &Path) -> String {
    format!("file:{}", path.file_name().unwrap_or_default().to_string_lossy())
}

fn kind_of(text: &str) -> String {
    let document: Option<toml_edit::DocumentMut> = text.parse().ok();
    let kind = document.as_ref().and_then(|document| document.get("study")?.get("kind")?.as_str());
    kind.filter(|kind| stickslip_study::kinds::find(kind).is_some()).unwrap_or_default().to_owned()
}

fn title_of(text: &str) -> String {
    let document: Option<toml_edit::DocumentMut> = text.parse().ok();
    document.as_ref().and_then(|document| document.get("title")?.as_str()).unwrap_or_default().to_owned()
}

/// Checks that a file is a study, so that the explorer fails before it opens a page.
///
/// # Errors
/// [`StudyError`]: the text is not a study.
pub(crate) fn check(source: &Source) -> Result<(), StudyError> {
    read_study(&source.file, &source.text, &[]).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_study_files_of_the_folder_are_offered() {
        let folder = tempfile::tempdir().unwrap();
        let study = templates::find("element").unwrap().study;
        for (name, text) in [("a.toml", study), ("Cargo.toml", "[package]\nname = \"a\"\n"), ("b.txt", study)] {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let catalog = Catalog::new(folder.path(), None);
        let files: Vec<Entry> = catalog.entries().into_iter().filter(|entry| entry.id.starts_with("file:")).collect();
        assert_eq!(files.iter().map(|entry| entry.id.as_str()).collect::<Vec<_>>(), ["file:a.toml"]);
        assert_eq!(catalog.source("file:a.toml").unwrap().text, study);
        for id in ["file:b.txt", "file:../a.toml", "file:/etc/passwd", "template:none", "a.toml"] {
            assert!(catalog.source(id).is_err(), "{id}");
        }
        assert_eq!(catalog.entries().len(), templates::TABLE.len() + 1);
    }
}
