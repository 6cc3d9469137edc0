//! A table of `[[data]]`: columns by the names that the study uses, in SI.

use super::column_unit::{STANDARD_GRAVITY, parse_title, split_name};
use crate::syntax::expression::dimension_text;
use crate::syntax::suggest::{alternatives, excerpt, suggest};
use std::collections::BTreeMap;
use stickslip::dimension::Dimension;
use stickslip_formats::data::{Column, DataFile, split_unit};

/// A table that the study names.
#[derive(Debug, Clone)]
pub(crate) struct DataTable {
    /// Name in the study.
    pub name: String,
    /// File name as stated.
    pub file: String,
    /// Titles of columns by their use.
    columns: BTreeMap<String, String>,
    /// The content of the file; `None` if it was not read.
    content: Option<DataFile>,
}

/// The reason why a column cannot be used, and what to do.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ColumnError {
    pub message: String,
    pub help: String,
}

/// A column, with the unit that the study adds.
struct FoundColumn<'a> {
    column: &'a Column,
    unit: &'a str,
}

impl DataTable {
    pub fn new(name: String, file: String, columns: BTreeMap<String, String>, content: Option<DataFile>) -> Self {
        DataTable { name, file, columns, content }
    }

    /// Returns the table with this name.
    ///
    /// # Errors
    /// There is none; the help lists the tables.
    pub fn find_in<'a>(tables: &'a [DataTable], name: &str) -> Result<&'a DataTable, ColumnError> {
        tables.iter().find(|table| table.name == name).ok_or_else(|| {
            let help = match tables {
                [] => "add [[data]] with `name` and `file`".to_owned(),
                known => format!("the tables are {}", alternatives(known.iter().map(|table| table.name.as_str()))),
            };
            ColumnError { message: format!("there is no [[data]] `{}`", excerpt(name)), help }
        })
    }

    /// Returns whether the file was read.
    pub fn is_read(&self) -> bool {
        self.content.is_some()
    }

    /// Returns the length of the longest column.
    pub fn rows(&self) -> usize {
        self.content.iter().flat_map(|content| &content.columns).map(|column| column.values.len()).max().unwrap_or(0)
    }

    /// Returns a CRC-32 of the values, which detects files that changed between two runs.
    pub fn checksum(&self) -> String {
        let mut hasher = crc32fast::Hasher::new();
        for column in self.content.iter().flat_map(|content| &content.columns) {
            hasher.update(column.name.as_bytes());
            column.values.iter().for_each(|value| hasher.update(&value.to_le_bytes()));
        }
        format!("{:08x}", hasher.finalize())
    }

    /// Returns the first use in `columns` whose column does not exist, with the error.
    pub fn unknown_column(&self) -> Option<(String, ColumnError)> {
        let unknown = self.columns.keys().find(|role| self.find(role).is_none())?;
        Some((unknown.clone(), self.missing(unknown)))
    }

    /// Returns whether the table has a column for this use.
    pub fn has(&self, role: &str) -> bool {
        self.find(role).is_some()
    }

    /// Returns the title of a column; `role` is its use or its name.
    pub fn title(&self, role: &str) -> Option<String> {
        self.find(role).map(|found| found.column.name.clone())
    }

    /// Returns the values of a column in SI; `role` is its use or its name.
    ///
    /// # Errors
    /// There is no such column, it contains texts, or it has another dimension.
    pub fn values(&self, role: &str, dimension: Dimension) -> Result<Vec<f64>, ColumnError> {
        let found = self.find(role).ok_or_else(|| self.missing(role))?;
        if found.has_two_units() {
            let (name, stated, own) = (excerpt(&found.column.name), found.unit, excerpt(&found.column.unit));
            let message = format!(
                "`columns` states the unit `{stated}` for `{name}` of `{}`, but the file states `{own}`",
                self.name
            );
            return Err(ColumnError { message, help: format!("write \"{name} [{own}]\", or correct the file") });
        }
        self.check_numbers(&found)?;
        let factor = factor(&found, dimension).map_err(|unit| {
            let message = format!(
                "the column `{}` of `{}` has {unit}, but {} is expected",
                excerpt(&found.column.name),
                self.name,
                dimension_text(dimension)
            );
            let help = format!(
                "state the unit of the column in [[data]]: columns = {{ {role} = \"{} [UNIT]\" }}",
                excerpt(&found.column.name)
            );
            ColumnError { message, help }
        })?;
        Ok(found.column.values.iter().map(|value| value * factor).collect())
    }

    /// Returns whether a column states its unit.
    pub fn has_unit(&self, role: &str) -> bool {
        self.find(role).is_some_and(|found| {
            !found.unit.is_empty() || !found.column.unit.is_empty() || split_name(&found.column.name).is_some()
        })
    }

    /// Returns an error if a column contains texts.
    fn check_numbers(&self, found: &FoundColumn<'_>) -> Result<(), ColumnError> {
        let Some(text) = &found.column.first_text else { return Ok(()) };
        let (name, text) = (excerpt(&found.column.name), excerpt(text));
        let message = format!("the column `{name}` of `{}` contains `{text}`, but numbers are expected", self.name);
        Err(ColumnError { message, help: "write a number in each row, or leave the field empty".to_owned() })
    }

    /// Returns the values of a column of numbers as they stand in the file.
    ///
    /// # Errors
    /// There is no such column, or it contains texts.
    pub fn plain_numbers(&self, role: &str) -> Result<Vec<f64>, ColumnError> {
        let found = self.find(role).ok_or_else(|| self.missing(role))?;
        self.check_numbers(&found)?;
        Ok(found.column.values.clone())
    }

    /// Returns the values of a column as they stand in the file; texts are numbered.
    ///
    /// # Errors
    /// There is no such column.
    pub fn plain_values(&self, role: &str) -> Result<Vec<f64>, ColumnError> {
        self.find(role).map(|found| found.column.values.clone()).ok_or_else(|| self.missing(role))
    }

    /// Finds a column by the title that `columns` states for a use, by its name, or by its name
    /// without the unit at its end.
    fn find<'a>(&'a self, role: &'a str) -> Option<FoundColumn<'a>> {
        let content = self.content.as_ref()?;
        if let Some(title) = self.columns.get(role) {
            let plain = content.column(title).map(|column| FoundColumn { column, unit: "" });
            let (name, unit) = split_unit(title);
            return plain.or_else(|| content.column(name).map(|column| FoundColumn { column, unit }));
        }
        let short = |column: &&Column| split_name(&column.name).is_some_and(|(begin, _)| begin == role);
        let column = content.column(role).or_else(|| content.columns.iter().find(short))?;
        Some(FoundColumn { column, unit: "" })
    }

    fn missing(&self, role: &str) -> ColumnError {
        let known: Vec<&str> =
            self.content.iter().flat_map(|content| &content.columns).map(|column| column.name.as_str()).collect();
        let wanted = self.columns.get(role).map_or(role, String::as_str);
        let message = format!("the table `{}` has no column `{}`", self.name, excerpt(wanted));
        let shown = alternatives(known.iter().take(12).copied()).replace(" or ", ", ");
        let help = match suggest(wanted, known.iter().copied()) {
            Some(near) => format!("did you mean `{near}`? The columns are {shown}"),
            None => format!("name it in [[data]]: columns = {{ {role} = \"NAME\" }}; the columns are {shown}"),
        };
        ColumnError { message, help }
    }
}

impl FoundColumn<'_> {
    /// Returns true if the study file states another unit than the data file.
    fn has_two_units(&self) -> bool {
        let own = self.column.unit.as_str();
        if self.unit.is_empty() || own.is_empty() || self.unit == own {
            return false;
        }
        match (parse_title(self.unit), parse_title(own)) {
            (Some(stated), Some(own)) => stated.dimension != own.dimension || stated.si_value("1") != own.si_value("1"),
            _ => true,
        }
    }
}

/// Returns the factor from the column to SI of this dimension. The error says which unit the
/// column has.
fn factor(found: &FoundColumn<'_>, dimension: Dimension) -> Result<f64, String> {
    let stated = [found.unit, found.column.unit.as_str()].into_iter().find(|unit| !unit.is_empty());
    if stated == Some("g") && dimension == Dimension::ACCELERATION {
        return Ok(STANDARD_GRAVITY);
    }
    let unit = match stated {
        Some(text) => Some(parse_title(text).ok_or_else(|| format!("the unit `{}`", excerpt(text)))?),
        None => split_name(&found.column.name).map(|(_, unit)| unit),
    };
    match unit {
        Some(unit) if unit.dimension == dimension => Ok(unit.si_value("1")),
        // a radian is a pure number to many programs
        Some(unit) => {
            let dimension = dimension_text(unit.dimension);
            Err(match stated {
                Some(stated) => format!("the unit `{stated}` ({dimension})"),
                None => format!("a unit of {dimension} in its name"),
            })
        }
        // a number without unit is ambiguous as a frequency: hertz or rad/s
        None if dimension == Dimension::FREQUENCY => Err("the unit Hz or rad/s, which it does not state".to_owned()),
        None if dimension == Dimension::PRESSURE => Err("the unit Pa or MPa, which it does not state".to_owned()),
        None => Ok(1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(columns: &[(&str, &str)]) -> DataTable {
        let content =
            stickslip_formats::data::read_bytes(b"frequency_Hz,F [kN],a [g],x\n10,1,2,3\n20,4,5,6\n").expect("a table");
        let columns = columns.iter().map(|(role, title)| ((*role).to_owned(), (*title).to_owned())).collect();
        DataTable::new("sweep".to_owned(), "sweep.csv".to_owned(), columns, Some(content))
    }

    #[test]
    fn columns_are_found_by_use_and_converted_to_si() {
        let data = table(&[("force", "F"), ("response", "x [mm]"), ("static", "F [N]")]);
        let value = |role: &str, dimension| data.values(role, dimension).map(|values| values[1]);
        assert_eq!(value("frequency", Dimension::FREQUENCY), Ok(20.0 * std::f64::consts::TAU));
        assert_eq!(value("force", Dimension::FORCE), Ok(4000.0));
        assert_eq!(value("a", Dimension::ACCELERATION), Ok(5.0 * STANDARD_GRAVITY));
        assert_eq!(value("response", Dimension::LENGTH), Ok(6.0 * 1e-3));
        assert_eq!(value("x", Dimension::FORCE), Ok(6.0));
        for (role, dimension, part) in [
            ("force", Dimension::LENGTH, "has the unit `kN`"),
            ("static", Dimension::FORCE, "states the unit `N` for `F` of `sweep`, but the file states `kN`"),
            ("x", Dimension::FREQUENCY, "Hz or rad/s"),
            ("frequence", Dimension::FREQUENCY, "no column `frequence`"),
        ] {
            let error = data.values(role, dimension).expect_err(role);
            assert!(error.message.contains(part) && !error.help.is_empty(), "{error:?}");
        }
        assert_eq!(table(&[("force", "G")]).unknown_column().map(|(role, _)| role), Some("force".to_owned()));
    }
}
