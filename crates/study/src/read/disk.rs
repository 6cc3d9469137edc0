//! `[disk]`: what must hold between its keys, and the files that it names: a mistuning pattern, the node pairs of a sector's sides, the nodes of
//! its blade.

use super::reader::Reader;
use crate::disk::StatedDisk;
use crate::document::Table;
use crate::error::Problem;
use crate::key::Key;
use crate::near::shown;
use crate::statement::{Stated, StatedTable};
use crate::values::Given;
use std::io::Read;

/// Most bytes of a file: lines for a million nodes.
const MOST_BYTES: u64 = 1 << 26;

impl Reader {
    pub(super) fn disk(&mut self, table: &Table, keys: &[Key]) -> Option<StatedDisk> {
        let stated = self.table(table, keys, "[disk]");
        let pattern = match stated.entry("mistuning").map(|entry| &entry.value) {
            Some(Stated::Table(mistuning)) => self.pattern(mistuning),
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
            "write a line `node` and below it the nodes of the blade, one in a line",
        );
        let boundary = sides.map(|rows| rows.into_iter().map(|(_, [low, high])| (low, high)).collect());
        let blade = blade.map(|rows| rows.into_iter().map(|(_, [node])| node).collect());
        Some(StatedDisk { table: stated, pattern, boundary, blade })
    }

    /// The rows of a CSV file that a key names.
    fn csv<const N: usize>(
        &mut self,
        stated: &StatedTable,
        key: &'static str,
        columns: [&str; N],
        help: &str,
    ) -> Option<Vec<CsvRow<N>>> {
        let entry = stated.entry(key).filter(|_| !self.without_files)?;
        let Stated::Fixed(Given::Text(name)) = &entry.value else { return None };
        let refuse =
            |(message, help): (String, Option<String>)| Problem::new(&entry.place, key, message).maybe_help(help);
        let rows = self.text_of(name).and_then(|text| {
            csv(&text, columns).map_err(|(line, message)| {
                (format!("`{}`, line {line}: {message}", shown(name)), Some(help.to_owned()))
            })
        });
        rows.map_err(|problem| self.problems.push(refuse(problem))).ok()
    }

    /// The deviations of a file, if one is named.
    fn pattern(&mut self, mistuning: &StatedTable) -> Option<Vec<f64>> {
        let file = mistuning.entry("file").map(|entry| (&entry.value, entry.place.clone()));
        if self.without_files && file.is_some() {
            return None;
        }
        let Some((Stated::Fixed(Given::Text(name)), place)) = file else {
            if mistuning.entry("deviation").is_none() {
                let message = "`deviation` or `file` is missing in the mistuning";
                let problem = Problem::new(&mistuning.place, "mistuning", message);
                self.problems.push(problem.help("add deviation = \"2 %\" and seed = 7, or file = \"pattern.csv\""));
            }
            return None;
        };
        for key in ["deviation", "seed"] {
            if let Some(entry) = mistuning.entry(key) {
                let message = format!("the file has the deviations, `{key}` says nothing beside it");
                self.problems.push(Problem::new(&entry.place, key, message).help("take one of the two out"));
            }
        }
        match self.pattern_of(name) {
            Ok(pattern) => Some(pattern),
            Err((message, help)) => {
                self.problems.push(Problem::new(&place, "file", message).maybe_help(help));
                None
            }
        }
    }

    fn pattern_of(&self, name: &str) -> Result<Vec<f64>, Refused> {
        pattern(&self.text_of(name)?).map_err(|(line, message)| {
            let message = format!("`{}`, line {line}: {message}", shown(name));
            let help = "write a line `sector,deviation` and below it `0,0.012`, `1,-0.5 %` … for every sector";
            (message, Some(help.to_owned()))
        })
    }

    /// The text of a file beside the study.
    fn text_of(&self, name: &str) -> Result<String, Refused> {
        let path = self.folder.as_deref().map_or_else(|| name.into(), |folder| folder.join(name));
        let failed = |error: std::io::Error| {
            let message = format!("`{}` cannot be read: {error}", shown(&path.display().to_string()));
            (message, Some("the name counts from the folder of the study file".to_owned()))
        };
        let mut text = String::new();
        let file = std::fs::File::open(&path).map_err(failed)?;
        file.take(MOST_BYTES + 1).read_to_string(&mut text).map_err(failed)?;
        if text.len() as u64 > MOST_BYTES {
            return Err((format!("`{}` is too big: the limit is 64 MiB", shown(name)), None));
        }
        Ok(text)
    }
}

/// What is wrong, and what to do about it.
type Refused = (String, Option<String>);

/// Number of the line, from 1, and its fields.
type CsvRow<const N: usize> = (usize, [String; N]);

/// The lines of a CSV file that has these columns, in any order, or the line that is wrong and why.
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
    let at = columns.map(|column| names.iter().position(|name| name == column));
    if names.len() != N || at.contains(&None) {
        return Err((line, format!("expected the columns {}, found `{}`", columns.join(","), shown(head))));
    }
    let row = |(line, text): (usize, &str)| {
        let fields = fields(text);
        if fields.len() != N || fields.iter().any(String::is_empty) {
            return Err((line, format!("expected {}, found `{}`", columns.join(","), shown(text))));
        }
        Ok((line, at.map(|at| at.and_then(|at| fields.get(at)).cloned().unwrap_or_default())))
    };
    lines.map(row).collect()
}

/// The deviations of a pattern by sector, or the line that is wrong and why.
fn pattern(text: &str) -> Result<Vec<f64>, (usize, String)> {
    let mut deviations: Vec<Option<f64>> = Vec::new();
    for (line, [sector, deviation]) in csv(text, ["sector", "deviation"])? {
        let wrong = |message: String| Err((line, message));
        let Some(sector) = sector.parse::<usize>().ok().filter(|sector| *sector < crate::schema::MOST_MASSES) else {
            return wrong(format!("`{}` is no number of a sector, from 0", shown(&sector)));
        };
        let (number, unit) = match deviation.strip_suffix('%') {
            Some(percent) => (percent.trim(), 0.01),
            None => (deviation.as_str(), 1.0),
        };
        let Some(deviation) = number.parse::<f64>().ok().map(|n| n * unit).filter(|n| n.is_finite()) else {
            return wrong(format!("`{}` is no deviation such as 0.012 or 1.2 %", shown(&deviation)));
        };
        if deviations.len() <= sector {
            deviations.resize(sector + 1, None);
        }
        if deviations[sector].replace(deviation).is_some() {
            return wrong(format!("sector {sector} stands twice"));
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
    use super::pattern;

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
            ("sector,deviation\n-1,1\n", 2, "no number of a sector"),
            ("sector,deviation\n999999999,1\n", 2, "no number of a sector"),
            ("sector,deviation\n0,nan\n", 2, "no deviation"),
            ("sector,deviation\n0\n", 2, "expected sector,deviation"),
        ] {
            let (at, message) = pattern(text).unwrap_err();
            assert!(at == line && message.contains(words), "{text}: {at} {message}");
        }
    }
}
