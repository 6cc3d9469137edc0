//! Reads a study file: text to tree to statements, then every case once, so that nothing wrong is found later.

use crate::document::{self, Content, Entry, Node, Table};
use crate::error::{Place, Problem, Source, StudyError};
use crate::expression::{Expression, Value, is_reserved};
use crate::info::KindInfo;
use crate::kinds;
use crate::near::{nearest, one_of, shown};
use crate::repeat::{Index, Repetition, Turn};
use crate::schema::{
    self, FILE, Key, MOST_BYTES, MOST_ELEMENTS, MOST_MASSES, MOST_POINTS, Presence, STUDY, Takes, Within,
};
use crate::statement::{Environment, Quantity, Stated, StatedEntry, StatedTable};
use crate::study::{
    Lists, NamedTemplate, Parameter, Replaced, Structure, Study, Varied, VariedPoints, evaluate, model_of,
};
use crate::templates::{self, Template};
use crate::values::Given;
use std::collections::HashMap;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;
use stickslip::dimension::Dimension;
use stickslip::law::{self, LawInfo};
use stickslip::method;
use stickslip::model::{Model, is_identifier, is_place};

/// Most errors that are reported at once.
const MOST_ERRORS: usize = 20;

/// Largest value of an index: names stay short, and sums of indices exact.
const LARGEST_INDEX: u64 = 1_000_000;

/// Reads the study at `path`; `overrides` are parameters and their new values, as in `--set Ft=3N`.
///
/// # Errors
/// [`StudyError`]: the file is not there, is a folder, is too big, or what [`read_bytes`] refuses.
pub fn read_file(path: &Path, overrides: &[(String, String)]) -> Result<Study, StudyError> {
    let name = path.display().to_string();
    let refuse = |message: String, help: Option<String>| StudyError::file(&name, message, help);
    let failed = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::NotFound => refuse("there is no such file".to_owned(), sibling(path)),
        std::io::ErrorKind::PermissionDenied => refuse("the file may not be read".to_owned(), None),
        _ => refuse(format!("the file cannot be read: {error}"), None),
    };
    if std::fs::metadata(path).map_err(failed)?.is_dir() {
        return Err(refuse("this is a folder, a study file (TOML) is needed".to_owned(), None));
    }
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(failed)?;
    file.take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
    read_bytes(&name, &bytes, overrides)
}

/// A file beside `path` whose name is like it.
fn sibling(path: &Path) -> Option<String> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let names: Vec<String> = std::fs::read_dir(folder)
        .ok()?
        .flatten()
        .take(10_000)
        .filter_map(|f| f.file_name().into_string().ok())
        .collect();
    let near = nearest(path.file_name()?.to_str()?, names.iter().map(String::as_str))?;
    Some(format!("did you mean `{}`?", folder.join(near).display()))
}

/// Reads a study from the bytes of a file; `name` is the file's name for messages and for the study's own name.
///
/// # Errors
/// [`StudyError`]: the bytes are not UTF-8, or what [`read_study`] refuses.
pub fn read_bytes(name: &str, bytes: &[u8], overrides: &[(String, String)]) -> Result<Study, StudyError> {
    too_big(name, bytes.len())?;
    match std::str::from_utf8(bytes) {
        Ok(text) => read_study(name, text, overrides),
        Err(error) => {
            let valid = error.valid_up_to();
            let text = String::from_utf8_lossy(bytes).into_owned();
            let span = valid..valid + char::REPLACEMENT_CHARACTER.len_utf8();
            let message = format!("the file is not UTF-8 text: byte {:#04x} has no meaning here", bytes[valid]);
            let problem = Problem::new(&Place { source: 0, span }, "", message)
                .help("save the file as UTF-8; a binary file is no study");
            Err(StudyError::at(&[Arc::new(Source { name: name.to_owned(), text })], problem))
        }
    }
}

fn too_big(name: &str, bytes: usize) -> Result<(), StudyError> {
    if bytes as u64 <= MOST_BYTES {
        return Ok(());
    }
    let message = format!("the file is too big for a study: the limit is {} MiB", MOST_BYTES / (1024 * 1024));
    Err(StudyError::file(name, message, None))
}

/// Reads a study from its text. Every case is checked: a study that is returned can be run.
///
/// `name` is the file's name (its stem becomes the name of the study), `overrides` are parameters and their new values.
///
/// # Errors
/// [`StudyError`] with the first error in the order of the file, and others behind it.
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
    too_big(name, text.len())?;
    let mut reader = Reader::default();
    reader.text(name.to_owned(), text.to_owned());
    let study = reader.study(name, text, overrides);
    match study {
        Some(study) if reader.problems.is_empty() => {
            study.check()?;
            Ok(study)
        }
        _ => Err(reader.error(name)),
    }
}

/// The model of a template with its parameters, compiled.
pub(crate) struct CompiledTemplate {
    pub names: Vec<String>,
    /// Each has the dimension of its default, if that has any.
    pub parameters: Vec<Parameter>,
    order: Vec<usize>,
    structure: Structure,
    sources: Vec<Arc<Source>>,
}

impl CompiledTemplate {
    /// The values of the parameters; those that are `fixed` have that value, SI.
    pub fn values(&self, fixed: &[(usize, f64)]) -> Result<Vec<Value>, StudyError> {
        let values = evaluate(&self.names, &self.parameters, &self.order, &HashMap::new(), fixed);
        values.map_err(|problem| StudyError::at(&self.sources, problem))
    }

    /// The model; parameters that are `fixed` have that value, SI.
    pub fn model(&self, fixed: &[(usize, f64)]) -> Result<Model, StudyError> {
        let environment = Environment { names: &self.names, values: self.values(fixed)? };
        let mut problems = Vec::new();
        let model = model_of(&self.structure, &environment, &mut problems);
        StudyError::all(&self.sources, problems).map_or(Ok(model), Err)
    }
}

/// Compiles the model of a template's file.
///
/// # Errors
/// [`StudyError`]: the file is wrong, which is none of a user's doing.
pub(crate) fn compile_template(row: &Template) -> Result<CompiledTemplate, StudyError> {
    let mut reader = Reader::default();
    let stated = reader.template(row);
    let order = stated.as_ref().and_then(|stated| reader.order(&stated.parameters, &[]));
    match (stated, order) {
        (Some(TemplateFile { parameters, lists, .. }), Some(order)) if reader.problems.is_empty() => {
            let structure = Structure { lists, template: None };
            Ok(CompiledTemplate { names: reader.names, parameters, order, structure, sources: reader.sources })
        }
        _ => Err(reader.error(row.name)),
    }
}

/// What a template's file states, but for its study.
struct TemplateFile {
    parameters: Vec<Parameter>,
    lists: Lists,
    /// The file among the sources.
    source: usize,
}

#[derive(Default)]
struct Reader {
    sources: Vec<Arc<Source>>,
    problems: Vec<Problem>,
    /// Parameters, in order, and their index by name.
    names: Vec<String>,
    index: HashMap<String, usize>,
    /// The repetition of the entry that is being read, and which of its turns.
    repetition: Repetition,
    number: usize,
}

impl Reader {
    /// All problems as one error.
    fn error(&mut self, file: &str) -> StudyError {
        self.problems.truncate(MOST_ERRORS);
        let error = StudyError::all(&self.sources, std::mem::take(&mut self.problems));
        error.unwrap_or_else(|| StudyError::file(file, "the study could not be read", None))
    }

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
                Stated::Fixed(Given::Text(text)) => Some(text),
                _ => None,
            }
        };
        let title = words(self, "title");
        let source = words(self, "source");

        let (parameters, structure) = match named_template(&root) {
            Some((row, table)) => {
                let TemplateFile { parameters, lists, source } = self.template(row)?;
                let parameters = self.parameters(&root, parameters, overrides);
                (parameters, self.with_template(&root, row, lists, table, source))
            }
            None => {
                let parameters = self.parameters(&root, Vec::new(), overrides);
                (parameters, self.lists(&root).map(|lists| Structure { lists, template: None }))
            }
        };
        let (kind, study, vary) = self.request(&root)?;
        let method = self.method(&root);
        let figure = self.figure(&root);
        let mut parameters = parameters?;
        let mut varied = vary.and_then(|entry| self.vary(entry, &mut parameters)).unwrap_or_default();
        if !self.problems.is_empty() {
            return None;
        }
        let replaced = self.replace(&mut varied, &parameters, overrides);
        let order = self.order(&parameters, &varied)?;
        self.limit_points(&study, &varied)?;
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
            replaced,
            structure: structure?,
            study,
            method: method?,
            figure,
            memory: None,
        })
    }

    /// `[figure]`, empty if it is absent.
    fn figure(&mut self, root: &Table) -> StatedTable {
        let key = FILE.iter().find(|key| key.name == "figure");
        let stated = root.get("figure").zip(key).and_then(|(entry, key)| self.value(key, &entry.node));
        match stated {
            Some(Stated::Table(table)) => table,
            _ => StatedTable { place: Place::default(), entries: Vec::new(), turn: Default::default() },
        }
    }

    // ------------------------------------------------------------------------------------------ tables and keys

    /// Unknown and missing keys.
    fn check_keys(&mut self, table: &Table, keys: &[Key], owner: &str) {
        for entry in &table.entries {
            if !keys.iter().any(|key| key.name == entry.key) {
                let help = match nearest(&entry.key, keys.iter().map(|key| key.name)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => {
                        format!("the keys of {owner} are {}", one_of(keys.iter().map(|k| k.name)).replace(" or ", ", "))
                    }
                };
                let message = format!("{owner} has no key `{}`", shown(&entry.key));
                self.problems.push(Problem::new(&entry.key_place, shown(&entry.key), message).help(help));
            }
        }
        for key in keys.iter().filter(|key| key.presence == Presence::Required) {
            if table.get(key.name).is_none() {
                let message = format!("`{}` is missing in {owner}: {}", key.name, schema::described(&key.takes));
                let help = match key.takes {
                    Takes::Study => "add a table [study] with kind = \"response\" and a frequency".to_owned(),
                    _ => format!("add {} = {}", key.name, key.example),
                };
                self.problems.push(Problem::new(&table.place, key.name, message).help(help));
            }
        }
    }

    fn table(&mut self, table: &Table, keys: &[Key], owner: &str) -> StatedTable {
        self.check_keys(table, keys, owner);
        self.stated(table, keys)
    }

    /// The values of those keys that are known; unknown and missing ones are the matter of [`Reader::check_keys`].
    fn stated(&mut self, table: &Table, keys: &[Key]) -> StatedTable {
        let mut entries = Vec::with_capacity(keys.len());
        for key in keys {
            let (place, value) = match (table.get(key.name), key.presence) {
                (Some(entry), _) => (entry.node.place.clone(), self.value(key, &entry.node)),
                (None, Presence::Default(text)) => (table.place.clone(), self.standing_for(key, text, &table.place)),
                (None, _) => continue,
            };
            entries.extend(value.map(|value| StatedEntry { key: key.name, place, value }));
        }
        StatedTable { place: table.place.clone(), turn: String::new(), entries }
    }

    /// The value that stands for an absent key.
    fn standing_for(&mut self, key: &Key, text: &str, place: &Place) -> Option<Stated> {
        let value = match key.takes {
            Takes::Count(..) => {
                let whole = text.parse::<i64>().ok();
                Content::Number { value: whole.unwrap_or(0) as f64, whole }
            }
            Takes::Flag => Content::Flag(text == "true"),
            _ => Content::Text { text: text.to_owned(), inner: None },
        };
        self.value(key, &Node { place: place.clone(), value })
    }

    fn wrong_type(&mut self, key: &Key, node: &Node) -> Option<Stated> {
        let expected = schema::described(&key.takes);
        self.problems.push(
            Problem::new(&node.place, key.name, format!("expected {expected}, found {}", node.value.described()))
                .help(format!("write it as in {} = {}", key.name, key.example)),
        );
        None
    }

    fn value(&mut self, key: &Key, node: &Node) -> Option<Stated> {
        match (&key.takes, &node.value) {
            (Takes::Text, Content::Text { text, .. }) => Some(Stated::Fixed(Given::Text(text.clone()))),
            (Takes::Name, Content::Text { text, inner }) => {
                Some(Stated::Fixed(Given::Text(self.name(key.name, text, *inner, &node.place)?)))
            }
            (Takes::Names, Content::Text { text, inner }) => {
                Some(Stated::Names(vec![(self.name(key.name, text, *inner, &node.place)?, node.place.clone())]))
            }
            (Takes::Repeat, _) => None, // read before the other keys, whose values depend on it
            (Takes::Names, Content::List(list)) if !list.is_empty() => self.names(key, list),
            (Takes::Pair, Content::List(list)) if list.len() == 2 => self.names(key, list),
            (Takes::Pair, Content::List(list)) => {
                let message = format!("expected two names of places, found {}", list.len());
                let help = format!("write it as in {} = {}", key.name, key.example);
                self.problems.push(Problem::new(&node.place, key.name, message).help(help));
                None
            }
            (Takes::Quantity(dimension, within), Content::Text { .. } | Content::Number { .. }) => {
                let quantity = self.quantity(key.name, node)?;
                let (dimension, within, example) = (*dimension, *within, key.example);
                Some(Stated::Quantity { quantity, dimension, within, example })
            }
            (Takes::Count(from, to), Content::Number { whole: Some(whole), .. }) => {
                if (*from..=*to).contains(whole) {
                    return Some(Stated::Fixed(Given::Count(u64::try_from(*whole).unwrap_or(0))));
                }
                let message = format!("expected {}, found {whole}", schema::described(&key.takes));
                let problem = Problem::new(&node.place, key.name, message);
                let limit = key.name == "points" && *to == MOST_POINTS as i64 && whole > to;
                let help = limit.then(|| format!("the limit of a study is {MOST_POINTS} points"));
                self.problems.push(problem.maybe_help(help));
                None
            }
            (Takes::Flag, Content::Flag(flag)) => Some(Stated::Fixed(Given::Flag(*flag))),
            (Takes::Frequencies, Content::Text { .. } | Content::Number { .. }) => {
                Some(Stated::List(vec![self.quantity(key.name, node)?]))
            }
            (Takes::Frequencies, Content::List(list)) => {
                Some(Stated::List(self.quantities(key.name, list, &node.place)?))
            }
            (Takes::Frequencies, Content::Table(table)) if table.get("tolerance").is_some() => {
                let before = self.problems.len();
                let mut stated = self.table(table, schema::ADAPTIVE, &format!("the range of `{}`", shown(key.name)));
                let mut take = |key: &str| {
                    let at = stated.entries.iter().position(|entry| entry.key == key)?;
                    match stated.entries.swap_remove(at).value {
                        Stated::Quantity { quantity, .. } => Some(quantity),
                        _ => None,
                    }
                };
                let (from, to, tolerance) = (take("from"), take("to"), take("tolerance"));
                if self.problems.len() > before {
                    return None;
                }
                Some(Stated::Adaptive { from: from?, to: to?, tolerance: tolerance? })
            }
            (Takes::Frequencies, Content::Table(table)) => {
                let (from, to, points) = self.range(table, key.name)?;
                Some(Stated::Range { from, to, points })
            }
            (Takes::ByName(dimension), Content::Table(table)) => {
                let mut names = Vec::new();
                for entry in &table.entries {
                    let quantity = self.quantity(&entry.key, &entry.node)?;
                    names.push((entry.key.clone(), entry.key_place.clone(), quantity));
                }
                Some(Stated::ByName(names, *dimension))
            }
            (Takes::Table(keys), Content::Table(table)) => {
                Some(Stated::Table(self.table(table, keys, &format!("`{}`", key.name))))
            }
            (Takes::Law, Content::Table(table)) => self.law(table),
            (Takes::Choice(words), Content::Text { text, .. }) => {
                let words = words();
                if words.iter().any(|(word, _)| word == text) {
                    return Some(Stated::Fixed(Given::Text(text.clone())));
                }
                self.unknown_word(key.name, text, &node.place, words.iter().map(|(word, _)| *word).collect());
                None
            }
            _ => self.wrong_type(key, node),
        }
    }

    fn unknown_word(&mut self, key: &str, word: &str, place: &Place, words: Vec<&str>) {
        let message = format!("there is no `{}`, expected {}", shown(word), one_of(words.iter().copied()));
        let help = nearest(word, words).map(|near| format!("did you mean `{near}`?"));
        self.problems.push(Problem::new(place, key, message).maybe_help(help));
    }

    /// A name, with the indices of a repetition filled in. What names a place may be a direction of a node, `node.direction`.
    fn name(&mut self, key: &str, text: &str, inner: Option<usize>, place: &Place) -> Option<String> {
        let problem = match self.turn().name(text) {
            Ok(name) if is_identifier(&name) => return Some(name),
            Ok(name) if !matches!(key, "name" | "directions") && is_place(&name) => return Some(name),
            Ok(name) => {
                let message = format!("`{}` is no name: a letter first, then letters, digits and `_`", shown(&name));
                Problem::new(place, key, message)
            }
            Err(fault) if self.repetition.indices.is_empty() => {
                let help = "braces are for entries of lists that have an index: repeat = { i = 12 }";
                Problem::fault(place, inner, key, fault).help(help)
            }
            Err(fault) => Problem::fault(place, inner, key, fault),
        };
        self.problems.push(problem);
        None
    }

    fn turn(&self) -> Turn<'_> {
        self.repetition.turn(self.number)
    }

    fn names(&mut self, key: &Key, list: &[Node]) -> Option<Stated> {
        let mut names = Vec::with_capacity(list.len());
        for node in list {
            let Content::Text { text, inner } = &node.value else { return self.wrong_type(key, node) };
            names.push((self.name(key.name, text, *inner, &node.place)?, node.place.clone()));
        }
        Some(Stated::Names(names))
    }

    fn quantity(&mut self, key: &str, node: &Node) -> Option<Quantity> {
        let before = self.problems.len();
        let quantity = self.any_quantity(key, node);
        if let (None, Content::Text { text, .. }) = (&quantity, &node.value)
            && let Some((from, to)) = self.two_quantities(text)
        {
            self.problems.truncate(before);
            let message = "a text holds one quantity, this reads like a range";
            let help = format!(
                "where a range can stand, write it as {{ from = \"{}\", to = \"{}\", points = 101 }}",
                shown(from),
                shown(to)
            );
            self.problems.push(Problem::new(&node.place, key, message).help(help));
        }
        quantity
    }

    /// The two quantities of `14 Hz to 19 Hz`, and of what else people write for it.
    fn two_quantities<'a>(&self, text: &'a str) -> Option<(&'a str, &'a str)> {
        [" to ", "...", "..", "…", "–", " - ", "; "].iter().find_map(|word| {
            let (from, to) = text.split_once(word)?;
            let (from, to) = (from.trim(), to.trim());
            (self.compile(from).is_ok() && self.compile(to).is_ok()).then_some((from, to))
        })
    }

    fn any_quantity(&mut self, key: &str, node: &Node) -> Option<Quantity> {
        let place = &node.place;
        let problem = match &node.value {
            Content::Text { text, inner } => match self.compile(text) {
                Ok(expression) => {
                    return Some(Quantity { place: place.clone(), inner: *inner, text: text.clone(), expression });
                }
                Err(fault) => Problem::fault(place, *inner, key, fault),
            },
            Content::Number { value, .. } if value.is_finite() => {
                let text = value.to_string();
                return Some(Quantity {
                    place: place.clone(),
                    inner: None,
                    text,
                    expression: Expression::number(*value),
                });
            }
            Content::Number { value, .. } => {
                Problem::new(place, key, format!("a finite number is needed, found {value}"))
            }
            other => Problem::new(place, key, format!("expected a quantity, found {}", other.described()))
                .help("write a number with its unit in quotes, as in \"2 N\""),
        };
        self.problems.push(problem);
        None
    }

    fn compile(&self, text: &str) -> Result<Expression, crate::units::Fault> {
        let turn = self.turn();
        let names: Vec<&str> = self.names.iter().map(String::as_str).chain(turn.names()).collect();
        Expression::compile_with(text, &|name| self.index.get(name).copied(), &|name| turn.value(name), &names)
    }

    fn quantities(&mut self, key: &str, list: &[Node], place: &Place) -> Option<Vec<Quantity>> {
        if list.is_empty() {
            let problem = Problem::new(place, key, "the list is empty, at least one value is needed");
            self.problems.push(problem);
            return None;
        }
        list.iter().map(|node| self.quantity(key, node)).collect()
    }

    fn range(&mut self, table: &Table, owner: &str) -> Option<(Quantity, Quantity, usize)> {
        let before = self.problems.len();
        let mut stated = self.table(table, schema::RANGE, &format!("the range of `{}`", shown(owner)));
        if self.problems.len() > before {
            return None;
        }
        let mut take = |key: &str| {
            let at = stated.entries.iter().position(|entry| entry.key == key)?;
            Some(stated.entries.swap_remove(at).value)
        };
        match (take("from")?, take("to")?, take("points")?) {
            (
                Stated::Quantity { quantity: from, .. },
                Stated::Quantity { quantity: to, .. },
                Stated::Fixed(Given::Count(points)),
            ) => Some((from, to, usize::try_from(points).ok()?)),
            _ => None,
        }
    }

    /// The row named by `kind` in a table of laws, methods or study kinds.
    fn kind<T: 'static>(
        &mut self,
        table: &Table,
        (what, example): (&str, &str),
        rows: &'static [T],
        name: fn(&T) -> &'static str,
    ) -> Option<&'static T> {
        let words: Vec<&str> = rows.iter().map(name).collect();
        let Some(entry) = table.get("kind") else {
            let message = format!("`kind` is missing in {what}: one of {}", one_of(words));
            self.problems.push(Problem::new(&table.place, "kind", message).help(format!("add kind = \"{example}\"")));
            return None;
        };
        let place = &entry.node.place;
        match &entry.node.value {
            Content::Text { text, .. } => match rows.iter().find(|row| name(row) == text) {
                Some(row) => Some(row),
                None => {
                    self.unknown_word("kind", text, place, words);
                    None
                }
            },
            other => {
                let message = format!("expected one of {}, found {}", one_of(words), other.described());
                self.problems.push(Problem::new(place, "kind", message));
                None
            }
        }
    }

    fn law(&mut self, table: &Table) -> Option<Stated> {
        let row: &'static LawInfo = *self.kind(table, ("the law", "coulomb"), law::TABLE, |row| row.name)?;
        let mut keys = vec![schema::required("kind", Takes::Text, "law", "\"coulomb\"")];
        keys.extend(row.parameters.iter().map(|p| Key {
            name: p.key,
            takes: Takes::Quantity(p.dimension, crate::key::within(p.range)),
            presence: if p.default.is_some() { Presence::Optional } else { Presence::Required },
            doc: p.doc,
            example: example_of(p.dimension),
        }));
        Some(Stated::Law(row, self.table(table, &keys, &format!("law `{}`", row.name))))
    }

    fn method(&mut self, root: &Table) -> Option<StatedTable> {
        let absent = Table::default();
        let table = match root.get("method").map(|entry| &entry.node) {
            None => &absent,
            Some(Node { value: Content::Table(table), .. }) => table,
            Some(node) => {
                let message = format!("expected a table, found {}", node.value.described());
                self.problems
                    .push(Problem::new(&node.place, "method", message).help("write [method] and below it its kind"));
                return None;
            }
        };
        let row = match table.get("kind") {
            None => method::find("auto")?,
            Some(_) => self.kind(table, ("[method]", "auto"), method::TABLE, |row| row.name)?,
        };
        let mut keys = schema::METHOD.to_vec();
        keys.extend(row.options.iter().map(|option| Key {
            name: option.key,
            takes: if option.count {
                Takes::Count(1, 1_000_000)
            } else {
                Takes::Quantity(option.dimension, Within::Positive)
            },
            presence: Presence::Optional,
            doc: option.doc,
            example: if option.count { "15" } else { example_of(option.dimension) },
        }));
        Some(self.table(table, &keys, &format!("method `{}`", row.name)))
    }

    fn request<'a>(&mut self, root: &'a Table) -> Option<(&'static KindInfo, StatedTable, Option<&'a Entry>)> {
        let node = &root.get("study")?.node;
        let Content::Table(table) = &node.value else {
            let message = format!("expected a table, found {}", node.value.described());
            self.problems.push(Problem::new(&node.place, "study", message).help("write [study] and below it its kind"));
            return None;
        };
        let kind = &self.kind(table, ("[study]", "response"), kinds::TABLE, |row| row.info.name)?.info;
        let mut keys = STUDY.to_vec();
        keys.extend(kind.keys);
        // `vary` is not a value of the kind: it makes the cases
        let owner = format!("a study of kind `{}`", kind.name);
        self.check_keys(table, &keys, &owner);
        let rest: Vec<Key> = keys.into_iter().filter(|key| !matches!(key.takes, Takes::Vary)).collect();
        let stated = self.stated(table, &rest);
        Some((kind, stated, table.get("vary")))
    }

    // ------------------------------------------------------------------------------------------ the model

    /// Reads a template's file, first of all that has parameters: its texts know its own alone, whatever names a
    /// study adds.
    fn template(&mut self, row: &Template) -> Option<TemplateFile> {
        let source = self.text(format!("template {}", row.name), row.study.to_owned()).source;
        let root = match document::parse(row.study, source) {
            Ok(root) => root,
            Err(problem) => {
                self.problems.push(problem);
                return None;
            }
        };
        let mut parameters = self.parameters(&root, Vec::new(), &[])?;
        self.settle_dimensions(&mut parameters, &(0..self.names.len()).collect::<Vec<_>>())?;
        Some(TemplateFile { parameters, lists: self.lists(&root)?, source })
    }

    /// The model of a template, with the law that the study gives its joints.
    fn with_template(
        &mut self,
        root: &Table,
        row: &Template,
        mut lists: Lists,
        table: &Table,
        source: usize,
    ) -> Option<Structure> {
        for key in FILE.iter().filter(|key| matches!(key.takes, Takes::List(_))) {
            if let Some(entry) = root.get(key.name) {
                let message =
                    format!("the template `{}` brings its own model, `{}` cannot be added to it", row.name, key.name);
                let help = format!(
                    "change its parameters, or start from `stickslip new {}`, which writes it out as lists",
                    row.name
                );
                self.problems.push(Problem::new(&entry.node.place, key.name, message).help(help));
            }
        }
        let Some(Takes::Table(keys)) = FILE.iter().find(|key| key.name == "model").map(|key| key.takes) else {
            return None;
        };
        let table = self.table(table, keys, "[model]");
        if let Some(law) = table.entry("law") {
            for entry in lists.joint.iter_mut().flat_map(|joint| &mut joint.entries).filter(|e| e.key == law.key) {
                entry.clone_from(law);
            }
        }
        Some(Structure { lists, template: Some(NamedTemplate { table, source }) })
    }

    fn lists(&mut self, root: &Table) -> Option<Lists> {
        let mut lists = Lists::default();
        for key in FILE {
            let (node, name) = match root.get(key.name) {
                Some(entry) => (&entry.node, key.name),
                None => continue,
            };
            match (key.takes, &node.value) {
                // a template that is unknown, or no table at all
                (Takes::Table(keys), Content::Table(table)) => {
                    self.table(table, keys, &format!("[{name}]"));
                }
                (Takes::Table(_), _) => {
                    self.wrong_type(key, node);
                }
                (Takes::List(keys), Content::List(list)) => {
                    let most = if name == "mass" { MOST_MASSES } else { MOST_ELEMENTS };
                    let mut elements = 0;
                    for (i, node) in list.iter().enumerate() {
                        match &node.value {
                            Content::Table(table) => {
                                let owner = format!("{name} {}", i + 1);
                                let Some(repetition) = self.repetition(table, &owner) else { continue };
                                elements = repetition.count().saturating_add(elements);
                                if elements > most {
                                    let message = format!("{elements} elements; the limit is {most}");
                                    self.problems.push(Problem::new(&node.place, name, message));
                                    break;
                                }
                                let stated = self.repeated(table, keys, &owner, repetition);
                                lists.get_mut(name)?.extend(stated);
                            }
                            other => {
                                let message = format!("expected a table, found {}", other.described());
                                let problem = Problem::new(&node.place, name, message);
                                self.problems.push(problem.help(format!("write [[{name}]] and its keys below")));
                            }
                        }
                    }
                }
                (Takes::List(_), other) => {
                    let message = format!("expected a list of tables, found {}", other.described());
                    let problem = Problem::new(&node.place, name, message);
                    self.problems.push(problem.help(format!("write [[{name}]] with two brackets")));
                }
                _ => {}
            }
        }
        for spring in &lists.spring {
            if spring.entry("stiffness").is_none() && spring.entry("damping").is_none() && self.problems.is_empty() {
                let message = "a spring needs a stiffness, a damping, or both";
                self.problems
                    .push(Problem::new(&spring.place, "stiffness", message).help("add stiffness = \"105103 N/m\""));
            }
        }
        Some(lists)
    }

    /// The entries that one entry states, up to the first that is wrong.
    fn repeated(&mut self, table: &Table, keys: &[Key], owner: &str, repetition: Repetition) -> Vec<StatedTable> {
        self.repetition = repetition;
        let mut all = Vec::with_capacity(self.repetition.count());
        for number in 0..self.repetition.count() {
            self.number = number;
            let before = self.problems.len();
            let mut stated = self.table(table, keys, owner);
            let turn = self.turn().words();
            if !turn.is_empty() {
                for problem in &mut self.problems[before..] {
                    problem.message = format!("{} ({turn})", problem.message);
                }
                stated.turn = format!("{owner}, {turn}");
            }
            all.push(stated);
            if self.problems.len() > before {
                break;
            }
        }
        (self.repetition, self.number) = (Repetition::default(), 0);
        all
    }

    /// The indices of `repeat`; none if it is absent.
    fn repetition(&mut self, table: &Table, owner: &str) -> Option<Repetition> {
        let Some(entry) = table.get("repeat") else { return Some(Repetition::default()) };
        let before = self.problems.len();
        let mut refuse = |place: &Place, message: String, help: Option<&str>| {
            let problem = Problem::new(place, "repeat", message);
            self.problems.push(problem.maybe_help(help.map(str::to_owned)));
        };
        let example = Some("write it as in repeat = { i = 12 } or repeat = { i = [2, 11] }");
        let Content::Table(repeat) = &entry.node.value else {
            let message = format!("expected a table of indices in {owner}, found {}", entry.node.value.described());
            refuse(&entry.node.place, message, example);
            return None;
        };
        let mut indices = Vec::new();
        for Entry { key, key_place, node } in repeat.entries.iter().filter(|entry| entry.key != "wrap") {
            let whole = |node: &Node| match node.value {
                Content::Number { whole, .. } => whole.filter(|whole| whole.unsigned_abs() <= LARGEST_INDEX),
                _ => None,
            };
            let range = match &node.value {
                Content::List(list) if list.len() == 2 => whole(&list[0]).zip(whole(&list[1])),
                _ => whole(node).map(|times| (1, times)),
            };
            if !is_identifier(key) {
                let message = format!("`{}` is no index: a letter first, then letters, digits and `_`", shown(key));
                refuse(key_place, message, None);
            } else if is_reserved(key) {
                refuse(key_place, format!("`{key}` has a meaning of its own in expressions"), None);
            } else if self.index.contains_key(key) {
                let help = Some("give the index another name");
                refuse(key_place, format!("`{key}` is a parameter already"), help);
            } else {
                match range.filter(|(from, to)| from <= to) {
                    Some((from, to)) => indices.push(Index { name: key.clone(), from, to, wraps: false }),
                    None => {
                        let message = format!(
                            "expected a whole number of times, or [first, last], found {}",
                            match &node.value {
                                Content::List(_) => "another list".to_owned(),
                                other => other.described(),
                            }
                        );
                        refuse(&node.place, message, example);
                    }
                }
            }
        }
        if indices.is_empty() && self.problems.len() == before {
            let problem = Problem::new(&entry.node.place, "repeat", format!("an index is missing in {owner}"));
            self.problems.push(problem.maybe_help(example.map(str::to_owned)));
        }
        if let Some(wrap) = repeat.get("wrap") {
            self.wrap(wrap, &mut indices);
        }
        (self.problems.len() == before).then_some(Repetition { indices })
    }

    /// Which indices wrap around: all, none, or those named.
    fn wrap(&mut self, entry: &Entry, indices: &mut [Index]) {
        let node = &entry.node;
        let named: Vec<&Node> = match &node.value {
            Content::Flag(flag) => return indices.iter_mut().for_each(|index| index.wraps = *flag),
            Content::List(list) => list.iter().collect(),
            _ => vec![node],
        };
        for node in named {
            let Content::Text { text, .. } = &node.value else {
                let message = format!("expected true, or the name of an index, found {}", node.value.described());
                self.problems.push(Problem::new(&node.place, "wrap", message));
                return;
            };
            match indices.iter_mut().find(|index| index.name == *text) {
                Some(index) => index.wraps = true,
                None => {
                    let message = format!("there is no index `{}` in this entry", shown(text));
                    self.problems.push(Problem::new(&node.place, "wrap", message));
                }
            }
        }
    }

    // ------------------------------------------------------------------------------------------ parameters

    /// The parameters: those `given` by a template, whose values the file may replace, and those that the file adds.
    fn parameters(
        &mut self,
        root: &Table,
        given: Vec<Parameter>,
        overrides: &[(String, String)],
    ) -> Option<Vec<Parameter>> {
        let mut stated: Vec<(usize, &Node)> = Vec::new();
        if let Some(entry) = root.get("parameters") {
            let Content::Table(table) = &entry.node.value else {
                let message = format!("expected a table of quantities, found {}", entry.node.value.described());
                self.problems.push(Problem::new(&entry.node.place, "parameters", message));
                return None;
            };
            for entry in &table.entries {
                let problem = |message: String| Problem::new(&entry.key_place, shown(&entry.key), message);
                if !is_identifier(&entry.key) {
                    let message = "no name of a parameter: a letter first, then letters, digits and `_`";
                    self.problems.push(problem(message.to_owned()));
                } else if is_reserved(&entry.key) {
                    self.problems.push(problem(format!("`{}` has a meaning of its own in expressions", entry.key)));
                } else if let Some(&index) = self.index.get(&entry.key) {
                    stated.push((index, &entry.node));
                } else {
                    stated.push((self.names.len(), &entry.node));
                    self.index.insert(entry.key.clone(), self.names.len());
                    self.names.push(entry.key.clone());
                }
            }
        }
        let before = self.problems.len();
        let mut parameters = given;
        for (index, node) in stated {
            let name = self.names[index].clone();
            let Some(quantity) = self.quantity(&name, node) else { continue };
            match parameters.get_mut(index) {
                Some(parameter) => parameter.quantity = quantity,
                None => parameters.push(Parameter { quantity, dimension: None }),
            }
        }
        if self.problems.len() > before || parameters.len() < self.names.len() {
            return None;
        }
        self.override_with(&mut parameters, overrides)?;
        Some(parameters)
    }

    /// A text that is not in the file.
    fn text(&mut self, name: String, text: String) -> Place {
        let span = 0..text.len();
        self.sources.push(Arc::new(Source { name, text }));
        Place { source: self.sources.len() - 1, span }
    }

    fn override_with(&mut self, parameters: &mut [Parameter], overrides: &[(String, String)]) -> Option<()> {
        if overrides.is_empty() {
            return Some(());
        }
        self.settle_dimensions(parameters, &self.index.values().copied().collect::<Vec<_>>())?;
        for (name, text) in overrides {
            let place = self.text(format!("--set {}", shown(name)), text.clone());
            let Some(&index) = self.index.get(name) else {
                let message = format!("there is no parameter `{}` to set", shown(name));
                let help = match nearest(name, self.names.iter().map(String::as_str)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None if self.names.is_empty() => "the file has no [parameters]".to_owned(),
                    None => format!(
                        "the parameters are {}",
                        one_of(self.names.iter().take(20).map(String::as_str)).replace(" or ", ", ")
                    ),
                };
                self.problems.push(Problem::new(&place, shown(name), message).help(help));
                continue;
            };
            let node = Node { place, value: Content::Text { text: text.clone(), inner: Some(0) } };
            if let Some(quantity) = self.quantity(name, &node) {
                parameters[index].quantity = quantity;
            }
        }
        Some(())
    }

    /// Gives these parameters the dimension that they have in the file, so that other values must have it too.
    fn settle_dimensions(&mut self, parameters: &mut [Parameter], which: &[usize]) -> Option<()> {
        let order = self.order(parameters, &[])?;
        let values = match evaluate(&self.names, parameters, &order, &HashMap::new(), &[]) {
            Ok(values) => values,
            Err(problem) => {
                self.problems.push(problem);
                return None;
            }
        };
        for &index in which {
            parameters[index].dimension = parameters[index].dimension.or(values[index].dimension);
        }
        Some(())
    }

    fn vary(&mut self, entry: &Entry, parameters: &mut [Parameter]) -> Option<Vec<Varied>> {
        let Content::Table(table) = &entry.node.value else {
            let message = format!("expected a table from parameters to values, found {}", entry.node.value.described());
            let problem = Problem::new(&entry.node.place, "vary", message);
            self.problems.push(problem.help("write it as in vary = { Ft = [\"2 N\", \"4 N\"] }"));
            return None;
        };
        let mut varied = Vec::new();
        for entry in &table.entries {
            let Some(&index) = self.index.get(&entry.key) else {
                let message = format!("there is no parameter `{}` to vary", shown(&entry.key));
                let help = match nearest(&entry.key, self.names.iter().map(String::as_str)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("add it to [parameters] and use it in the model: {} = \"…\"", shown(&entry.key)),
                };
                self.problems.push(Problem::new(&entry.key_place, shown(&entry.key), message).help(help));
                continue;
            };
            let points = match &entry.node.value {
                Content::List(list) => self.quantities(&entry.key, list, &entry.node.place).map(VariedPoints::List),
                Content::Table(table) => {
                    self.range(table, &entry.key).map(|(from, to, points)| VariedPoints::Range { from, to, points })
                }
                _ => self.quantity(&entry.key, &entry.node).map(|quantity| VariedPoints::List(vec![quantity])),
            };
            varied.extend(points.map(|points| Varied { index, place: entry.node.place.clone(), points }));
        }
        let which: Vec<usize> = varied.iter().map(|varied| varied.index).collect();
        if self.problems.is_empty() {
            self.settle_dimensions(parameters, &which)?;
        }
        Some(varied)
    }

    /// A value from outside the file stands for all values that `vary` gives its parameter: one case has it.
    fn replace(
        &self,
        varied: &mut [Varied],
        parameters: &[Parameter],
        overrides: &[(String, String)],
    ) -> Vec<Replaced> {
        let mut replaced = Vec::new();
        for varied in varied {
            let name = &self.names[varied.index];
            let Some((_, text)) = overrides.iter().rfind(|(set, _)| set == name) else { continue };
            replaced.push(Replaced { name: name.clone(), text: text.trim().to_owned(), values: varied.points.len() });
            let quantity = parameters[varied.index].quantity.clone();
            varied.place = quantity.place.clone();
            varied.points = VariedPoints::List(vec![quantity]);
        }
        replaced
    }

    /// The order in which parameters can be evaluated; a circle is an error.
    fn order(&mut self, parameters: &[Parameter], varied: &[Varied]) -> Option<Vec<usize>> {
        let mut needs: Vec<Vec<usize>> =
            parameters.iter().map(|p| p.quantity.expression.parameters().collect()).collect();
        // a circle goes through one entry of each varied parameter, and the outer product contains that combination
        for varied in varied {
            needs[varied.index] = varied.points.quantities().flat_map(|q| q.expression.parameters()).collect();
        }
        match sorted(&needs) {
            Ok(order) => Some(order),
            Err(circle) => {
                let first = circle[0];
                let place = match varied.iter().find(|varied| varied.index == first) {
                    Some(varied) => &varied.place,
                    None => &parameters[first].quantity.place,
                };
                let mut shown: Vec<&str> = circle.iter().map(|&i| self.names[i].as_str()).collect();
                shown.push(shown[0]);
                if shown.len() > 12 {
                    shown.splice(6..shown.len() - 5, ["…"]);
                }
                let message = format!("the parameters need each other in a circle: {}", shown.join(" -> "));
                let problem = Problem::new(place, self.names[first].clone(), message);
                self.problems.push(problem.help("give one of them a value of its own"));
                None
            }
        }
    }

    fn limit_points(&mut self, study: &StatedTable, varied: &[Varied]) -> Option<()> {
        let cases = varied.iter().fold(1usize, |product, varied| product.saturating_mul(varied.points.len()));
        let frequency = study.entry("frequency");
        let frequencies = match frequency.map(|entry| &entry.value) {
            Some(Stated::List(list)) => list.len(),
            Some(Stated::Range { points, .. }) => *points,
            _ => 1,
        };
        if cases.saturating_mul(frequencies) <= MOST_POINTS {
            return Some(());
        }
        let (place, key) = match (frequency, varied.first()) {
            (Some(entry), _) if frequencies >= cases => (&entry.place, "frequency"),
            (_, Some(varied)) => (&varied.place, "vary"),
            _ => (&study.place, "frequency"),
        };
        let message =
            format!("{cases} cases times {frequencies} frequencies are too many: the limit is {MOST_POINTS} points");
        self.problems.push(Problem::new(place, key, message).help("split the study, or take fewer points"));
        None
    }
}

/// The template of `[model]`, with its table.
fn named_template(root: &Table) -> Option<(&'static Template, &Table)> {
    let Content::Table(table) = &root.get("model")?.node.value else { return None };
    let Content::Text { text, .. } = &table.get("template")?.node.value else { return None };
    Some((templates::find(text)?, table))
}

/// An example of a quantity, for messages.
fn example_of(dimension: Dimension) -> &'static str {
    match dimension {
        Dimension::FORCE => "\"2 N\"",
        Dimension::STIFFNESS => "\"10000 N/m\"",
        Dimension::INVERSE_VELOCITY => "\"25 s/mm\"",
        Dimension::VELOCITY => "\"0.1 mm/s\"",
        Dimension::NONE => "1e-9",
        Dimension::FREQUENCY => "\"121 Hz\"",
        Dimension::TIME => "\"1 ms\"",
        Dimension::LENGTH => "\"1 mm\"",
        Dimension::MASS => "\"182 g\"",
        Dimension::DAMPING => "\"0.2 kg/s\"",
        Dimension::CUBIC_STIFFNESS => "\"4e9 N/m^3\"",
        _ => "",
    }
}

/// Topological order of a graph, or a circle in it (starting at its lowest index). Not recursive: chains can be long.
fn sorted(needs: &[Vec<usize>]) -> Result<Vec<usize>, Vec<usize>> {
    #[derive(Clone, Copy, PartialEq)]
    enum State {
        New,
        Open,
        Done,
    }
    let mut state = vec![State::New; needs.len()];
    let mut order = Vec::with_capacity(needs.len());
    for root in 0..needs.len() {
        if state[root] != State::New {
            continue;
        }
        let mut path = vec![(root, 0)];
        state[root] = State::Open;
        while let Some((node, next)) = path.last_mut() {
            let node = *node;
            match needs[node].get(*next) {
                None => {
                    state[node] = State::Done;
                    order.push(node);
                    path.pop();
                }
                Some(&need) => {
                    *next += 1;
                    match state[need] {
                        State::New => {
                            state[need] = State::Open;
                            path.push((need, 0));
                        }
                        State::Open => {
                            let start = path.iter().position(|(n, _)| *n == need).unwrap_or(0);
                            let mut circle: Vec<usize> = path[start..].iter().map(|(n, _)| *n).collect();
                            let lowest = (0..circle.len()).min_by_key(|i| circle[*i]).unwrap_or(0);
                            circle.rotate_left(lowest);
                            return Err(circle);
                        }
                        State::Done => {}
                    }
                }
            }
        }
    }
    Ok(order)
}
