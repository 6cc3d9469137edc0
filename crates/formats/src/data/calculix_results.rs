//! Results of CalculiX and of other programs for CalculiX GraphiX: text files `.frd` with values at
//! nodes.
//!
//! A block begins with the line ` -4` and the name of the quantity, followed by a line ` -5` for
//! each component. A node has the line ` -1` with its number and six values of twelve characters,
//! and lines ` -2` with more of them; ` -3` ends the block. The format is in the manual of CalculiX
//! GraphiX, "Result Format".

use super::blocks::{Block, Blocks};
use super::{DataFile, DataFormat};
use crate::error::{Error, ErrorKind, Location};
use crate::text::{Line, Lines};

pub(super) const FORMAT: DataFormat = DataFormat {
    name: "calculix-frd",
    summary: "results at nodes of CalculiX (.frd): the columns QUANTITY.node, QUANTITY.COMPONENT, such as CONTACT.CPRESS",
    sniff: |bytes| [b"    1C", b"    1U"].iter().any(|begin| bytes.starts_with(*begin)),
    read,
};

/// Number of characters of a value.
const VALUE_WIDTH: usize = 12;
/// Number of characters of a node number in the long format, which CalculiX writes.
const NODE_WIDTH: usize = 10;

fn read(bytes: &[u8]) -> Result<DataFile, Error> {
    let mut blocks = Blocks::default();
    let mut open: Option<Block> = None;
    for line in Lines::new(bytes) {
        match (line.columns(0, 3), &mut open) {
            (b"-4", _) => {
                let name = String::from_utf8_lossy(line.columns(3, 13)).into_owned();
                open = Some(Block { name, titles: vec!["node".to_owned()], rows: Vec::new() });
            }
            (b"-5", Some(block)) => block.titles.push(String::from_utf8_lossy(line.columns(3, 13)).into_owned()),
            (b"-1", Some(block)) => {
                let node = line.integer(line.columns(3, 3 + NODE_WIDTH))?;
                block.rows.push(vec![node as f64]);
                push_values(&line, block)?;
            }
            (b"-2", Some(block)) if !block.rows.is_empty() => push_values(&line, block)?,
            (b"-3", Some(_)) => {
                if let Some(block) = open.take() {
                    blocks.add(complete(block, &line)?);
                }
            }
            // nodes and elements of the mesh, and headings
            _ => {}
        }
    }
    if open.is_some() {
        let remedy = "run the analysis again, or copy the file again";
        return Err(Error::new(ErrorKind::Truncated, Location::File, "the last result is not complete".into(), remedy));
    }
    let remedy = "request results at nodes as text, for example *CONTACT FILE or *NODE FILE in the deck";
    blocks.into_data("the file has no results at nodes", remedy)
}

/// Adds the values of a line to the last row.
fn push_values(line: &Line<'_>, block: &mut Block) -> Result<(), Error> {
    let Some(row) = block.rows.last_mut() else { return Ok(()) };
    for from in (3 + NODE_WIDTH..line.text.len()).step_by(VALUE_WIDTH) {
        let field = line.columns(from, from + VALUE_WIDTH);
        if !field.is_empty() {
            row.push(line.real(field)?);
        }
    }
    Ok(())
}

/// Removes the titles of components that the program computes from the others and does not store.
fn complete(mut block: Block, end: &Line<'_>) -> Result<Block, Error> {
    let width = block.rows.first().map_or(0, Vec::len);
    if block.rows.iter().any(|row| row.len() != width) || width > block.titles.len() {
        return Err(end.malformed(
            &format!("{} values at every node of {}", block.titles.len() - 1, block.name),
            "other numbers of values",
        ));
    }
    block.titles.truncate(width);
    Ok(block)
}
