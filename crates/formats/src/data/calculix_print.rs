//! Printed results of CalculiX: files `.dat` with tables below headings such as
//! `contact stress (slave node,press,tang1,tang2) for all contact elements and time 0.1E+01`.
//!
//! The components stand in parentheses. If a row has one number more, it begins with the node.

use super::blocks::{Block, Blocks, numbered_titles};
use super::{DataFile, DataFormat};
use crate::error::{Error, ErrorKind, Location};
use crate::text::Lines;

pub(super) const FORMAT: DataFormat = DataFormat {
    name: "calculix-dat",
    summary: "printed results of CalculiX (.dat): the columns QUANTITY.node, QUANTITY.COMPONENT, such as contact_stress.press",
    sniff: |bytes| Lines::new(&bytes[..bytes.len().min(4096)]).any(|line| heading(line.text).is_some()),
    read,
};

/// A heading: the quantity with its set, and the components.
struct Heading {
    name: String,
    components: Vec<String>,
}

fn read(bytes: &[u8]) -> Result<DataFile, Error> {
    let mut blocks = Blocks::default();
    let mut open: Option<(Heading, Vec<Vec<f64>>)> = None;
    for line in Lines::new(bytes) {
        if let Some(found) = heading(line.text) {
            close(&mut blocks, open.replace((found, Vec::new())))?;
        } else if let Some((_, rows)) = &mut open {
            let row: Option<Vec<f64>> = line.words().map(|word| line.real(word).ok()).collect();
            match row {
                Some(row) if !row.is_empty() => rows.push(row),
                Some(_) => {}
                // text ends the table
                None => close(&mut blocks, open.take())?,
            }
        }
    }
    close(&mut blocks, open)?;
    let remedy = "request results in the deck, for example *CONTACT PRINT with CSTR, or *NODE PRINT";
    blocks.into_data("the file has no results", remedy)
}

/// Reads a heading `QUANTITY (COMPONENTS) for set NAME and time T`.
fn heading(text: &[u8]) -> Option<Heading> {
    let text = std::str::from_utf8(text).ok()?.trim();
    let (quantity, rest) = text.split_once(" (")?;
    let (components, rest) = rest.split_once(')')?;
    let (of, _) = rest.split_once(" and time")?;
    let set = of.trim().strip_prefix("for set").map(str::trim);
    let name = set.map_or_else(|| quantity.to_owned(), |set| format!("{quantity} {set}")).replace(' ', "_");
    // several numbers identify a row of an element
    let components = components.split(',').map(|component| match component.trim() {
        "slave node" => "node".to_owned(),
        other => other.trim_end_matches('.').to_owned(),
    });
    Some(Heading { name, components: components.collect() })
}

/// Adds a table to the blocks.
fn close(blocks: &mut Blocks, open: Option<(Heading, Vec<Vec<f64>>)>) -> Result<(), Error> {
    let Some((Heading { name, components }, rows)) = open else { return Ok(()) };
    let width = rows.first().map_or(0, Vec::len);
    if rows.iter().any(|row| row.len() != width) {
        let problem = format!("the rows of `{name}` have different numbers of values");
        return Err(Error::new(ErrorKind::Malformed, Location::File, problem, "run the analysis again"));
    }
    let titles: Vec<String> = match width.checked_sub(components.len()) {
        Some(0) => components,
        Some(1) if components.iter().any(|component| component.contains("element+face")) => {
            // the element and its face are two numbers
            ["element".to_owned(), "face".to_owned()].into_iter().chain(components.into_iter().skip(1)).collect()
        }
        Some(1) => std::iter::once("node".to_owned()).chain(components).collect(),
        _ => numbered_titles(width),
    };
    blocks.add(Block { name, titles, rows });
    Ok(())
}
