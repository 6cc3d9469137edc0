//! Reads a study file: text to tree to statements, then resolves every case once, so that no
//! error is found later.
//!
//! - `reader`: state of the reader while it reads a file;
//! - `values`: from a node of the tree to a stated value;
//! - `kinds`: tables whose `kind` determines their keys;
//! - `data`: `[[data]]` and the files that it names;
//! - `disk`: `[disk]` and the pattern file that it names;
//! - `lists`: the lists of a model, and repeated entries;
//! - `mesh`: the mesh of `[structure]`, and the entries on its sets;
//! - `parameters`: `[parameters]`, `vary`, and overrides;
//! - `structure`: `[structure]` and its files;
//! - `structure_cache`: structures that stay in memory after their files were read;
//! - `template`: the model of a template.

mod data;
mod disk;
mod kinds;
mod lists;
mod mesh;
mod parameters;
mod reader;
mod structure;
mod structure_cache;
mod template;
mod values;

pub use reader::DataContents;
pub use structure_cache::{StructureCache, StructureCacheSettings};
pub use template::TemplateParameter;

use crate::case::assembled::LastAssembled;
use crate::case::study::{Parameter, Study, evaluate, stated_parameters};
use crate::case::values::ResolvedValue;
use crate::compile::compiled::{CompiledTable, CompiledValue};
use crate::compile::source_model::SourceModel;
use crate::compile::template_errors;
use crate::compile::torsion::use_moments_of_inertia;
use crate::kinds::check_data;
use crate::syntax::document::{self, TomlNode, TomlTable, TomlValue};
use crate::syntax::error::{Location, Problem, Source, StudyError};
use crate::syntax::schema::{self, FILE, MAX_FILE_BYTES};
use crate::syntax::suggest::suggest;
use kinds::StudyRequest;
use reader::Reader;
use std::collections::HashMap;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;
use template::{TemplateFile, template_and_table};

/// Reads the study at `path`; `overrides` are parameters and their new values, as in `--set Ft=3N`.
///
/// # Errors
/// [`StudyError`]: the file does not exist, is a folder or is too big, or [`read_bytes`]
/// refuses it.
pub fn read_file(path: &Path, overrides: &[(String, String)]) -> Result<Study, StudyError> {
    let name = path.display().to_string();
    let refuse = |message: String, help: Option<String>| StudyError::file(&name, message, help);
    let failed = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::NotFound => refuse("there is no such file".to_owned(), suggest_file(path)),
        std::io::ErrorKind::PermissionDenied => refuse("no permission to read the file".to_owned(), None),
        _ => refuse(format!("the file cannot be read: {error}"), None),
    };
    if std::fs::metadata(path).map_err(failed)?.is_dir() {
        let help = is_results(path).then(|| format!("`stickslip plot {name}` draws the results in this folder"));
        return Err(refuse("this is a folder; a study file (TOML) is needed".to_owned(), help));
    }
    if let Some((what, help)) = not_a_study(path) {
        return Err(refuse(format!("this is {what}; a study file (TOML) is needed"), Some(help)));
    }
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(failed)?;
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
    read_bytes(&name, &bytes, overrides)
}

/// File name extensions of results, with a description of such a file.
const RESULT_EXTENSIONS: [(&str, &str); 7] = [
    ("csv", "a table of numbers"),
    ("parquet", "a table of numbers"),
    ("json", "a record of results"),
    ("svg", "a figure"),
    ("png", "a figure"),
    ("pdf", "a figure"),
    ("html", "a page"),
];

/// Returns what a file is if its extension rules out a study, and what to do with it.
fn not_a_study(path: &Path) -> Option<(&'static str, String)> {
    let end = path.extension()?.to_str()?.to_lowercase();
    if let Some((_, what)) = RESULT_EXTENSIONS.iter().find(|(known, _)| *known == end) {
        let folder = path.parent().filter(|folder| is_results(folder));
        let help = match folder {
            Some(folder) => format!("`stickslip plot {}` draws the results in its folder", folder.display()),
            None => "`stickslip new TEMPLATE` writes a study file to start from".to_owned(),
        };
        return Some((what, help));
    }
    let matrices = ["mtx", "mat", "npz", "npy", "op4", "pch", "sti", "mas", "dof", "rsa", "full"];
    matrices.contains(&end.as_str()).then(|| {
        let help = format!("`stickslip inspect {}` lists its contents; a study uses it in [structure]", path.display());
        ("a file of matrices", help)
    })
}

/// Returns whether a folder holds the results of a run.
fn is_results(folder: &Path) -> bool {
    folder.join("record.json").is_file()
}

/// Suggests a file in the same folder with a name similar to that of `path`.
fn suggest_file(path: &Path) -> Option<String> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let names: Vec<String> = std::fs::read_dir(folder)
        .ok()?
        .flatten()
        .take(10_000)
        .filter_map(|f| f.file_name().into_string().ok())
        .collect();
    let near = suggest(path.file_name()?.to_str()?, names.iter().map(String::as_str))?;
    Some(format!("did you mean `{}`?", folder.join(near).display()))
}

/// Reads a study from the bytes of a file. `name` is the file's name, for messages and for the
/// study's name.
///
/// # Errors
/// [`StudyError`]: the bytes are not UTF-8, or [`read_study`] refuses the text.
pub fn read_bytes(name: &str, bytes: &[u8], overrides: &[(String, String)]) -> Result<Study, StudyError> {
    check_size(name, bytes.len())?;
    match std::str::from_utf8(bytes) {
        Ok(text) => read_study(name, text, overrides),
        Err(error) => {
            let valid = error.valid_up_to();
            let text = String::from_utf8_lossy(bytes).into_owned();
            let span = valid..valid + char::REPLACEMENT_CHARACTER.len_utf8();
            let message = format!("the file is not UTF-8 text: byte {:#04x} is invalid here", bytes[valid]);
            let problem = Problem::new(&Location { source: 0, span }, "", message)
                .help("save the file as UTF-8; a study file is text, not binary");
            Err(StudyError::at_location(&[Arc::new(Source { name: name.to_owned(), text })], problem))
        }
    }
}

fn check_size(name: &str, bytes: usize) -> Result<(), StudyError> {
    if bytes as u64 <= MAX_FILE_BYTES {
        return Ok(());
    }
    let message = format!("the file is too large for a study: the limit is {} MiB", MAX_FILE_BYTES / (1024 * 1024));
    Err(StudyError::file(name, message, None))
}

/// Reads a study from its text. Every case is checked: a study that is returned can be run.
///
/// `name` is the file's name; its stem becomes the name of the study. `overrides` are
/// parameters and their new values.
///
/// # Errors
/// [`StudyError`] with the first error in the order of the file, followed by the others.
///
/// # Example
/// ```
/// use stickslip_study::{read_study, templates};
/// let text = templates::find("blade-couple").unwrap().study;
/// let study = read_study("couple.toml", text, &[]).unwrap();
/// assert_eq!((study.name(), study.cases()), ("couple", 4));
/// assert_eq!(study.case(0).unwrap().varied[0].text, "Ft = 2 N");
/// let study = read_study("couple.toml", text, &[("Ft".into(), "3 N".into())]).unwrap();
/// assert_eq!((study.cases(), study.case(0).unwrap().varied[0].text.as_str()), (1, "Ft = 3 N"));
/// let error = read_study("couple.toml", &text.replace("stiffness", "stifness"), &[]).unwrap_err();
/// assert_eq!(error.help_text(), Some("did you mean `stiffness`?"));
/// ```
pub fn read_study(name: &str, text: &str, overrides: &[(String, String)]) -> Result<Study, StudyError> {
    read(name, text, overrides, Reader::default())
}

/// Reads a study from its text as [`read_study`] does, and keeps the matrices of its structure
/// with their reductions, for the next version of the study.
///
/// # Errors
/// Those of [`read_study`].
pub fn read_study_with(name: &str, text: &str, structures: &Arc<StructureCache>) -> Result<Study, StudyError> {
    read(name, text, &[], Reader { structures: Some(structures.clone()), ..Reader::default() })
}

/// Reads a study from its text as [`read_study`] does. `data` has the contents of files that
/// `[[data]]` names; other files are read.
///
/// # Errors
/// Those of [`read_study`], and contents of a file that the study does not name.
///
/// # Example
/// ```
/// use std::{collections::BTreeMap, sync::Arc};
/// use stickslip_study::read_study_with_data;
/// let text = "schema = 1\n\
///     [[data]]\nname = \"rig\"\nfile = \"rig.csv\"\n\
///     [[motion]]\non = \"mover\"\namplitude = \"1 mm\"\n\
///     [[joint]]\nname = \"pad\"\nbetween = [\"mover\", \"ground\"]\n\
///     law = { kind = \"cubic\", stiffness = 1.0 }\n\
///     [study]\nkind = \"hysteresis\"\nfrequency = \"1 Hz\"\n";
/// let columns = b"time_s,force_N\n0,1\n1,2\n".to_vec();
/// let data = Arc::new(BTreeMap::from([("rig.csv".to_owned(), columns)]));
/// assert_eq!(read_study_with_data("pad", text, &[], &data).unwrap().cases(), 1);
/// let other = text.replace("rig.csv", "test.csv");
/// let error = read_study_with_data("pad", &other, &[], &data).unwrap_err();
/// assert!(error.to_string().contains("test.csv"));
/// ```
pub fn read_study_with_data(
    name: &str,
    text: &str,
    overrides: &[(String, String)],
    data: &Arc<DataContents>,
) -> Result<Study, StudyError> {
    read(name, text, overrides, Reader { data_contents: data.clone(), ..Reader::default() })
}

/// Reads the study of stored results, for names only.
///
/// The files that its text names may be missing. A study with `[structure]` that was read this
/// way cannot be run.
///
/// # Errors
/// Those of [`read_study`].
pub fn read_for_results(name: &str, text: &str, overrides: &[(String, String)]) -> Result<Study, StudyError> {
    read(name, text, overrides, Reader { study_file_only: true, ..Reader::default() })
}

fn read(name: &str, text: &str, overrides: &[(String, String)], mut reader: Reader) -> Result<Study, StudyError> {
    check_size(name, text.len())?;
    reader.folder = Path::new(name).parent().map(Path::to_owned);
    reader.text(name.to_owned(), text.to_owned());
    let study = reader.study(name, text, overrides);
    match study {
        Some(study) if reader.problems.is_empty() => {
            study.check()?;
            check_data(&study)?;
            Ok(study)
        }
        _ => Err(reader.error(name)),
    }
}

/// Reads a study from a document of another program.
///
/// The document is a table of tables, lists, texts, numbers and truth values, with the keys of
/// a study file. Errors are located in the TOML text of the document.
///
/// # Errors
/// [`StudyError`]: [`read_study`] refuses the text, or a value does not exist in TOML, such as
/// null.
///
/// # Example
/// ```
/// use stickslip_study::{
///     read_document,
///     run::{Context, run},
/// };
/// let document = serde_json::json!({
///     "schema": 1,
///     "parameters": { "a": "2 mm" },
///     "motion": [{ "on": "mover", "amplitude": "a" }],
///     "joint": [{
///         "name": "pad",
///         "between": ["mover", "ground"],
///         "law": { "kind": "jenkins", "stiffness": 1e3, "limit": "1 N" },
///     }],
///     "study": { "kind": "hysteresis", "frequency": "1 Hz" },
/// });
/// let study = read_document("pad", &document, &[("a".into(), "3 mm".into())]).unwrap();
/// let dataset = run(&study, &Context::without_progress(1)).unwrap();
/// let loss = dataset.tables[1].numbers("dissipation_J").unwrap()[0];
/// assert!((loss - 4.0 * 1.0 * (3e-3 - 1e-3)).abs() < 1e-12); // 4 limit (a - limit/stiffness)
/// ```
pub fn read_document(
    name: &str,
    document: &impl serde::Serialize,
    overrides: &[(String, String)],
) -> Result<Study, StudyError> {
    match toml::to_string(document) {
        Ok(text) => read_study(name, &text, overrides),
        Err(error) => Err(StudyError::file(name, format!("the document is not a valid study: {error}"), None)),
    }
}

impl Reader {
    fn study(&mut self, file: &str, text: &str, overrides: &[(String, String)]) -> Option<Study> {
        let root = match document::parse(text, 0) {
            Ok(root) => root,
            Err(problem) => {
                self.problems.push(problem);
                return None;
            }
        };
        self.check_keys(&root, FILE, "the file");
        if let Some(entry) = root.get("schema") {
            let key = FILE.iter().find(|key| key.name == "schema")?;
            let before = self.problems.len();
            self.value(key, &entry.node);
            if let Some(problem) = self.problems.get_mut(before) {
                problem.help = Some(format!("this program reads schema {}", schema::VERSION));
                return None; // another schema has other keys
            }
        }
        let words = |reader: &mut Reader, name: &str| -> Option<String> {
            let key = FILE.iter().find(|key| key.name == name)?;
            match reader.value(key, &root.get(name)?.node)? {
                CompiledValue::Fixed(ResolvedValue::Text(text)) => Some(text),
                _ => None,
            }
        };
        let title = words(self, "title");
        let source = words(self, "source");

        self.data = self.data(&root).map(Arc::new);
        if self.data.is_some() {
            self.check_data_contents();
        }
        let (parameters, structure) = match template_and_table(&root) {
            Some((row, table)) => {
                let TemplateFile { parameters, lists, source } = self.template(row)?;
                let parameters = self.parameters(&root, parameters, overrides);
                (parameters, self.with_template(&root, row, lists, table, source))
            }
            None => {
                let parameters = self.parameters(&root, Vec::new(), overrides);
                (parameters, self.model_from_lists(&root, file))
            }
        };
        let StudyRequest { kind, stated: mut study, vary, over } = self.request(&root)?;
        let method = self.method(&root);
        let figure = self.figure(&root);
        let mut parameters = parameters?;
        let mut structure = structure;
        if let Some(structure) = &mut structure {
            self.moments_of_inertia(structure, &mut study, &parameters);
        }
        let mut listed = vary.and_then(|entry| self.vary(entry, &mut parameters)).unwrap_or_default();
        if let Some(over) = over {
            let mapped = self.over(&root, over, &mut parameters, &listed).unwrap_or_default();
            listed.extend(mapped);
        }
        let (sample, mut varied) = self.sample(&root, &mut parameters, &listed).unwrap_or_default();
        varied.extend(listed);
        if !self.problems.is_empty() {
            return None;
        }
        let replaced = self.replace(&mut varied, &parameters, overrides);
        let order = self.order(&parameters, &varied)?;
        let mut structure = structure?;
        if let Some(template) = &mut structure.template {
            let choice = varied.iter().map(|varied| (varied.index, (varied, 0))).collect();
            let stated = stated_parameters(&parameters, &choice);
            let user_parameters = |index: usize| template_errors::user_parameters(template.source, &stated, [index]);
            let names =
                |index: usize| user_parameters(index).into_iter().map(|index| self.names[index].clone()).collect();
            template.given = (0..parameters.len()).map(names).collect();
        }
        self.limit_points(&study, &varied, sample)?;
        let stem = Path::new(file).file_stem().and_then(|stem| stem.to_str()).unwrap_or("study").to_owned();
        Some(Study {
            title: title.unwrap_or_else(|| stem.clone()),
            name: stem,
            source,
            text: text.to_owned(),
            kind,
            overrides: overrides.to_vec(),
            sources: std::mem::take(&mut self.sources),
            names: std::mem::take(&mut self.names),
            parameters,
            order,
            varied,
            sample,
            replaced,
            structure,
            study,
            method: method?,
            figure,
            data: self.data.take()?,
            memory: None,
            assembled: LastAssembled::default(),
        })
    }

    /// Turns a model of moments of inertia into one of rotations.
    fn moments_of_inertia(&mut self, structure: &mut SourceModel, study: &mut CompiledTable, parameters: &[Parameter]) {
        // problems of the parameters are reported later
        let known = self.problems.len();
        let order = self.order(parameters, &[]);
        self.problems.truncate(known);
        let values = order.and_then(|order| evaluate(&self.names, parameters, &order, &HashMap::new(), &[]).ok());
        if let Err(problem) = use_moments_of_inertia(structure, study, &values.unwrap_or_default()) {
            self.problems.push(problem);
        }
    }

    /// Reads the model that the file states itself, without a template.
    fn model_from_lists(&mut self, root: &TomlTable, file: &str) -> Option<SourceModel> {
        let mut lists = self.lists(root)?;
        let matrices = match root.get("structure").map(|entry| &entry.node) {
            Some(TomlNode { value: TomlValue::Table(table), .. }) => Some(self.matrices(table, file)?),
            Some(other) => {
                let key = FILE.iter().find(|key| key.name == "structure")?;
                return self.wrong_type(key, other).and(None);
            }
            None => None,
        };
        let mesh = self.expand_sets(&mut lists, matrices.as_ref(), mesh::DiskRotation::new(root))?;
        Some(SourceModel { lists, template: None, matrices, mesh })
    }
}
