//! Field reports of Abaqus/CAE: text files `.rpt` with a table for each part.
//!
//! A line of dashes separates the titles, on one or two lines, from the rows. A blank line ends
//! them; smallest and largest values follow.

use super::blocks::{Block, Blocks, numbered_titles};
use super::{DataFile, DataFormat};
use crate::error::Error;
use crate::text::{Line, Lines};

pub(super) const FORMAT: DataFormat = DataFormat {
    name: "abaqus-report",
    summary: "field reports of Abaqus/CAE (.rpt): the columns node or element, and the variables, such as CPRESS",
    sniff: |bytes| contains(&bytes[..bytes.len().min(1024)], b"Field Output Report"),
    read,
};

fn contains(bytes: &[u8], words: &[u8]) -> bool {
    bytes.windows(words.len()).any(|window| window == words)
}

fn read(bytes: &[u8]) -> Result<DataFile, Error> {
    let mut tables: Vec<Block> = Vec::new();
    // the last filled lines above a line of dashes are titles
    let mut above: Vec<Line<'_>> = Vec::new();
    let mut part = String::new();
    let mut lines = Lines::new(bytes);
    while let Some(line) = lines.next() {
        let text = line.text.trim_ascii();
        if let Some(at) = text.windows(6).position(|window| window == b" part:") {
            part = String::from_utf8_lossy(text[at + 6..].trim_ascii()).into_owned();
        }
        // Length of a line of dashes above rows, at least; the lines below headings are shorter.
        if text.len() > 15 && text.iter().all(|byte| *byte == b'-') {
            let rows = rows(&mut lines)?;
            if let Some(first) = rows.first() {
                let titles = titles(&above, first.len());
                tables.push(Block { name: part.clone(), titles, rows });
            }
            above.clear();
        } else if text.is_empty() {
            above.clear();
        } else {
            above.push(line);
        }
    }
    let is_alone = tables.len() == 1;
    let mut blocks = Blocks::default();
    tables.into_iter().for_each(|table| {
        let name = if is_alone { String::new() } else { table.name };
        blocks.add(Block { name, ..table });
    });
    let remedy = "write the report with the values at nodes, not only their extremes";
    blocks.into_data("the report has no table of values", remedy)
}

/// Reads the rows up to a blank line.
fn rows(lines: &mut Lines<'_>) -> Result<Vec<Vec<f64>>, Error> {
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for line in lines.by_ref() {
        let row = line.words().map(|word| line.real(word)).collect::<Result<Vec<f64>, Error>>()?;
        if row.is_empty() {
            break;
        }
        if rows.first().is_some_and(|first| first.len() != row.len()) {
            let expected = format!("{} values as in the rows above", rows[0].len());
            return Err(line.malformed(&expected, &format!("{} values", row.len())));
        }
        rows.push(row);
    }
    Ok(rows)
}

/// Returns the titles of `width` columns: the words of the first line of titles.
fn titles(above: &[Line<'_>], width: usize) -> Vec<String> {
    let first = above.first().map_or_else(Default::default, |line| String::from_utf8_lossy(line.text));
    let first = first.replace("Node Label", "Node").replace("Element Label", "Element").replace("Int Pt", "Int");
    let words: Vec<String> = first
        .split_whitespace()
        .map(|word| match word {
            "Node" => "node".to_owned(),
            "Element" => "element".to_owned(),
            "Int" => "point".to_owned(),
            other => other.to_owned(),
        })
        .collect();
    if words.len() == width { words } else { numbered_titles(width) }
}
