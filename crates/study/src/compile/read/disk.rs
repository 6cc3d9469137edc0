//! Reads `[disk]`: checks between its keys, and the files that it names.
//!
//! The files are a mistuning pattern, the node pairs of both sides of a sector, the node
//! coordinates, and the nodes of the blade.

use super::reader::Reader;
use crate::case::values::ResolvedValue;
use crate::compile::compiled::{CompiledTable, CompiledValue};
use crate::compile::source_model::DiskSource;
use crate::syntax::document::TomlTable;
use crate::syntax::error::Problem;
use crate::syntax::key::Key;
use crate::syntax::suggest::excerpt;
use std::io::Read;
use stickslip::structure::NodeCoordinates;
use stickslip_formats::Error;
use stickslip_formats::mesh::{self, Mesh};

impl Reader {
    pub(super) fn disk(&mut self, table: &TomlTable, keys: &[Key]) -> Option<DiskSource> {
        let stated = self.table(table, keys, "[disk]");
        let pattern = match stated.entry("mistuning").map(|entry| &entry.value) {
            Some(CompiledValue::Table(mistuning)) => self.pattern(mistuning),
            _ => None,
        };
        let sides = self.csv(
            &stated,
            "boundary",
            ["low", "high"],
            "write a line `low,high` and below it `2,37` … for every pair",
        );
        let blade = self.csv(
            &stated,
            "blade",
            ["node"],
            "write a line `node` and below it the nodes of the blade, one per line",
        );
        let boundary = sides.map(|rows| rows.into_iter().map(|(_, [low, high])| (low, high)).collect());
        let blade = blade.map(|rows| rows.into_iter().map(|(_, [node])| node).collect());
        let nodes = self.nodes(&stated);
        Some(DiskSource { table: stated, pattern, boundary, nodes, blade })
    }

    /// Reads the node coordinates of a sector, if a file is named.
    fn nodes(&mut self, stated: &CompiledTable) -> Option<Vec<NodeCoordinates>> {
        let entry = stated.entry("nodes").filter(|_| !self.study_file_only)?;
        let CompiledValue::Fixed(ResolvedValue::Text(name)) = &entry.value else { return None };
        let path = self.path_of(name);
        let read = match mesh::read_if_mesh(&path) {
            Some(read) => read.map(|mesh| mesh_nodes(&mesh)).map_err(|error| {
                let Error { problem, remedy, .. } = error;
                (format!("`{}`: {problem}", excerpt(name)), Some(remedy))
            }),
            None => self.read_text(name).and_then(|text| {
                csv_nodes(&text).map_err(|(line, message)| {
                    let help = "write a line `node,x,y,z` and below it `12,0.5,0,3` … for every node, or name a mesh, \
                        such as an input deck with a *NODE block";
                    (format!("`{}`, line {line}: {message}", excerpt(name)), Some(help.to_owned()))
                })
            }),
        };
        let refuse = |(message, help): MessageAndHelp| Problem::new(&entry.location, "nodes", message).maybe_help(help);
        read.map_err(|problem| self.problems.push(refuse(problem))).ok()
    }

    /// Reads the rows of the CSV file that a key names.
    fn csv<const N: usize>(
        &mut self,
        stated: &CompiledTable,
        key: &'static str,
        columns: [&str; N],
        help: &str,
    ) -> Option<Vec<CsvRow<N>>> {
        let entry = stated.entry(key).filter(|_| !self.study_file_only)?;
        let CompiledValue::Fixed(ResolvedValue::Text(name)) = &entry.value else { return None };
        let refuse =
            |(message, help): (String, Option<String>)| Problem::new(&entry.location, key, message).maybe_help(help);
        let rows = self.read_text(name).and_then(|text| {
            csv(&text, columns).map_err(|(line, message)| {
                (format!("`{}`, line {line}: {message}", excerpt(name)), Some(help.to_owned()))
            })
        });
        rows.map_err(|problem| self.problems.push(refuse(problem))).ok()
    }

    /// Reads the deviations of a file, if a file is named.
    fn pattern(&mut self, mistuning: &CompiledTable) -> Option<Vec<f64>> {
        let file = mistuning.entry("file").map(|entry| (&entry.value, entry.location.clone()));
        if self.study_file_only && file.is_some() {
            return None;
        }
        let Some((CompiledValue::Fixed(ResolvedValue::Text(name)), location)) = file else {
            if mistuning.entry("deviation").is_none() {
                let message = "`deviation` or `file` is missing in the mistuning";
                let problem = Problem::new(&mistuning.location, "mistuning", message);
                self.problems.push(problem.help("add deviation = \"2 %\" and seed = 7, or file = \"pattern.csv\""));
            }
            return None;
        };
        for key in ["deviation", "seed"] {
            if let Some(entry) = mistuning.entry(key) {
                let message = format!("`{key}` and `file` exclude each other: the file contains the deviations");
                self.problems.push(Problem::new(&entry.location, key, message).help("remove one of them"));
            }
        }
        match self.read_pattern(name) {
            Ok(pattern) => Some(pattern),
            Err((message, help)) => {
                self.problems.push(Problem::new(&location, "file", message).maybe_help(help));
                None
            }
        }
    }

    fn read_pattern(&self, name: &str) -> Result<Vec<f64>, MessageAndHelp> {
        pattern(&self.read_text(name)?).map_err(|(line, message)| {
            let message = format!("`{}`, line {line}: {message}", excerpt(name));
            let help = "write a line `sector,deviation` and below it `0,0.012`, `1,-0.5 %` … for every sector";
            (message, Some(help.to_owned()))
        })
    }

    /// Reads a file whose path is relative to the folder of the study.
    fn read_text(&self, name: &str) -> Result<String, MessageAndHelp> {
        // Largest size of a file in bytes: lines for a million nodes.
        let max_bytes = 1 << 26;
        let path = self.path_of(name);
        let failed = |error: std::io::Error| {
            let message = format!("`{}` cannot be read: {error}", excerpt(&path.display().to_string()));
            (message, Some("the path is relative to the folder of the study file".to_owned()))
        };
        let mut text = String::new();
        let file = std::fs::File::open(&path).map_err(failed)?;
        file.take(max_bytes + 1).read_to_string(&mut text).map_err(failed)?;
        if text.len() as u64 > max_bytes {
            return Err((format!("`{}` is too large: the limit is 64 MiB", excerpt(name)), None));
        }
        Ok(text)
    }
}

/// Message and help.
type MessageAndHelp = (String, Option<String>);

/// Number of the line, from 1, and its fields.
type CsvRow<const N: usize> = (usize, [String; N]);

/// Parses a CSV file with these columns in any order. The error is the wrong line and the
/// reason.
fn csv<const N: usize>(text: &str, columns: [&str; N]) -> Result<Vec<CsvRow<N>>, (usize, String)> {
    let mut lines = text
        .trim_start_matches('\u{feff}')
        .lines()
        .enumerate()
        .map(|(i, line)| (i + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let fields = |line: &str| -> Vec<String> {
        let separator = if line.contains(';') { ';' } else { ',' };
        line.split(separator).map(|field| field.trim().trim_matches('"').to_owned()).collect()
    };
    let Some((line, head)) = lines.next() else { return Err((1, "the file is empty".to_owned())) };
    let names = fields(head);
    let positions = columns.map(|column| names.iter().position(|name| name == column));
    if names.len() != N || positions.contains(&None) {
        return Err((line, format!("expected the columns {}, found `{}`", columns.join(","), excerpt(head))));
    }
    let row = |(line, text): (usize, &str)| {
        let fields = fields(text);
        if fields.len() != N || fields.iter().any(String::is_empty) {
            return Err((line, format!("expected {}, found `{}`", columns.join(","), excerpt(text))));
        }
        Ok((line, positions.map(|at| at.and_then(|at| fields.get(at)).cloned().unwrap_or_default())))
    };
    lines.map(row).collect()
}

/// Parses a node from the fields of its line.
fn node_of(line: usize, name: &str, at: [&str; 3]) -> Result<NodeCoordinates, (usize, String)> {
    let number = |text: &str| {
        // the exponent letter of Fortran
        let value = text.trim().replace(['d', 'D'], "e").parse::<f64>().ok().filter(|value| value.is_finite());
        value
            .ok_or_else(|| (line, format!("`{}` is not a valid coordinate of node `{}`", excerpt(text), excerpt(name))))
    };
    let [x, y, z] = at.map(number);
    Ok((name.to_owned(), [x?, y?, z?]))
}

/// Parses the nodes of a CSV file. The error is the wrong line and the reason.
fn csv_nodes(text: &str) -> Result<Vec<NodeCoordinates>, (usize, String)> {
    let rows = csv(text, ["node", "x", "y", "z"])?.into_iter();
    rows.map(|(line, [node, x, y, z])| node_of(line, &node, [&x, &y, &z])).collect()
}

/// Returns the nodes of a mesh by the names that rows have.
fn mesh_nodes(mesh: &Mesh) -> Vec<NodeCoordinates> {
    mesh.nodes().iter().map(|node| (node.number.to_string(), node.position)).collect()
}

/// Parses the deviations of a pattern by sector. The error is the wrong line and the reason.
fn pattern(text: &str) -> Result<Vec<f64>, (usize, String)> {
    let mut deviations: Vec<Option<f64>> = Vec::new();
    for (line, [sector, deviation]) in csv(text, ["sector", "deviation"])? {
        let wrong = |message: String| Err((line, message));
        let Some(sector) = sector.parse::<usize>().ok().filter(|sector| *sector < crate::syntax::schema::MAX_MASSES)
        else {
            return wrong(format!("`{}` is not a valid sector number; sectors count from 0", excerpt(&sector)));
        };
        let (number, unit) = match deviation.strip_suffix('%') {
            Some(percent) => (percent.trim(), 0.01),
            None => (deviation.as_str(), 1.0),
        };
        let Some(deviation) = number.parse::<f64>().ok().map(|n| n * unit).filter(|n| n.is_finite()) else {
            return wrong(format!("`{}` is not a deviation such as 0.012 or 1.2 %", excerpt(&deviation)));
        };
        if deviations.len() <= sector {
            deviations.resize(sector + 1, None);
        }
        if deviations[sector].replace(deviation).is_some() {
            return wrong(format!("sector {sector} appears twice"));
        }
    }
    let missing = deviations.iter().position(Option::is_none);
    if let Some(sector) = missing {
        return Err((text.lines().count(), format!("sector {sector} is missing")));
    }
    Ok(deviations.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests {
    use super::{csv_nodes, mesh_nodes, pattern};

    #[test]
    fn nodes_are_read_from_tables_and_decks() {
        let expected = vec![("7".to_owned(), [1.0, -25.0, 0.0]), ("12".to_owned(), [0.5, 0.0, 3.0])];
        assert_eq!(csv_nodes("x,y,node,z\n1,-2.5e1,7,0\n0.5,0,12,3\n").unwrap(), expected);
        let deck = "** a sector\n*HEADING\n1, 2, 3\n*Node, NSET=all\n7, 1.0, -2.5D1\n** a comment\n12, .5, , 3.\n*NODE PRINT\nU\n";
        let mesh = stickslip_formats::mesh::read_bytes(deck.as_bytes()).unwrap();
        assert_eq!(mesh_nodes(&mesh), expected);
        assert!(csv_nodes("node,x,y,z\n7,1,2\n").unwrap_err().1.contains("expected node,x,y,z"));
    }

    #[test]
    fn patterns_are_read_in_any_order() {
        assert_eq!(pattern("sector,deviation\n1, -0.02\n0,1 %\r\n# that is all\n").unwrap(), [0.01, -0.02]);
        assert_eq!(pattern("\u{feff}\"sector\";\"deviation\"\n0;0.5\n").unwrap(), [0.5]);
    }

    #[test]
    fn wrong_patterns_are_refused_with_their_line() {
        for (text, line, words) in [
            ("", 1, "empty"),
            ("blade,deviation\n0,1", 1, "expected the columns"),
            ("sector,deviation\n0,1\n0,2\n", 3, "twice"),
            ("sector,deviation\n0,1\n2,2\n", 3, "sector 1 is missing"),
            ("sector,deviation\n-1,1\n", 2, "not a valid sector number"),
            ("sector,deviation\n999999999,1\n", 2, "not a valid sector number"),
            ("sector,deviation\n0,nan\n", 2, "not a deviation"),
            ("sector,deviation\n0\n", 2, "expected sector,deviation"),
        ] {
            let (at, message) = pattern(text).unwrap_err();
            assert!(at == line && message.contains(words), "{text}: {at} {message}");
        }
    }
}
