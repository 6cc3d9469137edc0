//! Reads `[[data]]` and the files that it names.

use super::reader::Reader;
use crate::case::values::ResolvedValue;
use crate::compile::compiled::{CompiledTable, CompiledValue};
use crate::data::DataTable;
use crate::syntax::document::TomlTable;
use crate::syntax::error::{Location, Problem};
use crate::syntax::schema::FILE;
use crate::syntax::suggest::{alternatives, excerpt};
use stickslip_formats::data;

impl Reader {
    /// Reads the tables; an absent list is empty. `None` if a problem was found.
    pub(super) fn data(&mut self, root: &TomlTable) -> Option<Vec<DataTable>> {
        let Some(entry) = root.get("data") else { return Some(Vec::new()) };
        let key = FILE.iter().find(|key| key.name == "data")?;
        let Some(CompiledValue::Tables(tables)) = self.value(key, &entry.node) else { return None };
        let mut read: Vec<DataTable> = Vec::new();
        for table in &tables {
            let data = self.data_table(table)?;
            if read.iter().any(|other| other.name == data.name) {
                let message = format!("there are two tables of data `{}`", excerpt(&data.name));
                self.problems.push(Problem::new(table.location_of("name", None), "name", message).help("rename one"));
                return None;
            }
            read.push(data);
        }
        Some(read)
    }

    /// Reports contents of a file that no table names.
    pub(super) fn check_data_contents(&mut self) {
        let tables = self.data.as_ref().map_or(&[][..], |tables| tables);
        let is_read = |name: &String| tables.iter().any(|table| table.file == *name);
        let Some(unread) = self.data_contents.keys().find(|name| !is_read(name)) else { return };
        let message = format!("columns are given for `{unread}`, but no [[data]] has this `file`");
        let files = names_of(tables.iter().map(|table| &table.file));
        let help = if tables.is_empty() { "add a [[data]]".to_owned() } else { format!("the files are {files}") };
        self.problems.push(Problem::new(&Location { source: 0, span: 0..0 }, "data", message).help(help));
    }

    fn data_table(&mut self, table: &CompiledTable) -> Option<DataTable> {
        let text = |key: &str| match table.entry(key).map(|entry| &entry.value) {
            Some(CompiledValue::Fixed(ResolvedValue::Text(text))) => Some(text.clone()),
            _ => None,
        };
        let (name, file) = (text("name")?, text("file")?);
        let columns = match table.entry("columns").map(|entry| &entry.value) {
            Some(CompiledValue::Fixed(ResolvedValue::Texts(columns))) => columns.clone(),
            _ => Default::default(),
        };
        if self.study_file_only {
            return Some(DataTable::new(name, file, columns, None));
        }
        let content = match self.data_contents.get(&file) {
            Some(content) => data::read_bytes(content),
            None => data::read(self.path_of(&file)),
        };
        match content {
            Ok(content) => {
                let data = DataTable::new(name, file, columns, Some(content));
                let wrong = data.unknown_column();
                if let Some((role, error)) = wrong {
                    let location = table.location_of("columns", Some(&role));
                    self.problems.push(Problem::new(location, role, error.message).help(error.help));
                    return None;
                }
                Some(data)
            }
            Err(error) => {
                let (location, remedy) = (table.location_of("file", None), error.remedy.clone());
                let message = error.to_string();
                let message = message.strip_suffix(&format!("; {remedy}")).unwrap_or(&message).to_owned();
                let remedy = match self.data_contents.is_empty() || self.data_contents.contains_key(&file) {
                    true => remedy,
                    false => format!("columns are given for {}, not for `{file}`", names_of(self.data_contents.keys())),
                };
                self.problems.push(Problem::new(location, "file", message).help(remedy));
                None
            }
        }
    }
}

fn names_of<'a>(files: impl Iterator<Item = &'a String>) -> String {
    alternatives(files.map(String::as_str))
}
