//! `[disk]`: what must hold between its keys, and the file of a mistuning pattern.

use super::reader::Reader;
use crate::disk::StatedDisk;
use crate::document::Table;
use crate::error::{Place, Problem};
use crate::key::Key;
use crate::near::shown;
use crate::statement::{Stated, StatedTable};
use crate::values::Given;
use std::io::Read;

/// Most bytes of a pattern file: a line for each of the most sectors, and much more.
const MOST_BYTES: u64 = 1 << 20;

impl Reader {
    pub(super) fn disk(&mut self, table: &Table, keys: &[Key]) -> Option<StatedDisk> {
        let stated = self.table(table, keys, "[disk]");
        let pattern = match stated.entry("mistuning").map(|entry| &entry.value) {
            Some(Stated::Table(mistuning)) => self.pattern(mistuning),
            _ => None,
        };
        Some(StatedDisk { table: stated, pattern })
    }

    /// The deviations of a file, if one is named.
    fn pattern(&mut self, mistuning: &StatedTable) -> Option<Vec<f64>> {
        let file = mistuning.entry("file").map(|entry| (&entry.value, entry.place.clone()));
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
                self.refuse_pattern(&place, message, help);
                None
            }
        }
    }

    fn refuse_pattern(&mut self, place: &Place, message: String, help: Option<&str>) {
        self.problems.push(Problem::new(place, "file", message).maybe_help(help.map(str::to_owned)));
    }

    fn pattern_of(&self, name: &str) -> Result<Vec<f64>, (String, Option<&'static str>)> {
        let path = self.folder.as_deref().map_or_else(|| name.into(), |folder| folder.join(name));
        let failed = |error: std::io::Error| {
            (
                format!("`{}` cannot be read: {error}", shown(&path.display().to_string())),
                Some("the name counts from the folder of the study file"),
            )
        };
        let mut text = String::new();
        let file = std::fs::File::open(&path).map_err(failed)?;
        file.take(MOST_BYTES + 1).read_to_string(&mut text).map_err(failed)?;
        if text.len() as u64 > MOST_BYTES {
            return Err((format!("`{}` is too big for a pattern: the limit is 1 MiB", shown(name)), None));
        }
        pattern(&text).map_err(|(line, message)| {
            let message = format!("`{}`, line {line}: {message}", shown(name));
            (message, Some("write a line `sector,deviation` and below it `0,0.012`, `1,-0.5 %` … for every sector"))
        })
    }
}

/// The deviations of a pattern by sector, or the line that is wrong and why.
fn pattern(text: &str) -> Result<Vec<f64>, (usize, String)> {
    let mut deviations: Vec<Option<f64>> = Vec::new();
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
    match lines.next() {
        Some((line, head)) if fields(head) != ["sector", "deviation"] => {
            return Err((line, format!("expected the columns sector,deviation, found `{}`", shown(head))));
        }
        Some(_) => {}
        None => return Err((1, "the file is empty".to_owned())),
    }
    for (line, text) in lines {
        let wrong = |message: String| Err((line, message));
        let fields = fields(text);
        let [sector, deviation] = &fields[..] else {
            return wrong(format!("expected a sector and its deviation, found `{}`", shown(text)));
        };
        let Some(sector) = sector.parse::<usize>().ok().filter(|sector| *sector < crate::schema::MOST_MASSES) else {
            return wrong(format!("`{}` is no number of a sector, from 0", shown(sector)));
        };
        let (number, unit) = match deviation.strip_suffix('%') {
            Some(percent) => (percent.trim(), 0.01),
            None => (deviation.as_str(), 1.0),
        };
        let Some(deviation) = number.parse::<f64>().ok().map(|n| n * unit).filter(|n| n.is_finite()) else {
            return wrong(format!("`{}` is no deviation such as 0.012 or 1.2 %", shown(deviation)));
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
            ("sector,deviation\n0\n", 2, "expected a sector and"),
        ] {
            let (at, message) = pattern(text).unwrap_err();
            assert!(at == line && message.contains(words), "{text}: {at} {message}");
        }
    }
}
