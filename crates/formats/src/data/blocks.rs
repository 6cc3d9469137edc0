//! Blocks of results of a finite-element program: rows of numbers with titles, for one quantity
//! at one time.

use super::{Column, DataFile};
use crate::error::{Error, ErrorKind, Location};

/// The blocks of a file. Of several blocks with the same name, the last one counts.
#[derive(Default)]
pub(super) struct Blocks {
    blocks: Vec<Block>,
    /// Number of blocks that a later one replaced.
    replaced: usize,
}

/// The rows of a quantity.
pub(super) struct Block {
    /// Name of the quantity; empty for the only one of a file.
    pub name: String,
    /// Titles of the columns.
    pub titles: Vec<String>,
    /// The rows, with as many numbers each.
    pub rows: Vec<Vec<f64>>,
}

impl Blocks {
    /// Adds a block; one without rows is ignored.
    pub fn add(&mut self, block: Block) {
        if block.rows.is_empty() {
            return;
        }
        match self.blocks.iter_mut().find(|known| known.name == block.name) {
            Some(known) => {
                *known = block;
                self.replaced += 1;
            }
            None => self.blocks.push(block),
        }
    }

    /// Returns the columns `QUANTITY.TITLE` of all blocks.
    ///
    /// # Errors
    /// There is no block: `problem` says what the file has not, `remedy` what to do.
    pub fn into_data(self, problem: &str, remedy: &str) -> Result<DataFile, Error> {
        if self.blocks.is_empty() {
            return Err(Error::new(ErrorKind::Truncated, Location::File, problem.to_owned(), remedy));
        }
        let columns = self.blocks.iter().flat_map(|block| {
            block.titles.iter().enumerate().map(|(at, title)| Column {
                name: if block.name.is_empty() { title.clone() } else { format!("{}.{title}", block.name) },
                values: block.rows.iter().map(|row| row[at]).collect(),
                ..Column::default()
            })
        });
        let columns = columns.collect();
        let notes = match self.replaced {
            0 => Vec::new(),
            count => {
                let plural = if count == 1 { "" } else { "s" };
                vec![format!("only the last result of each quantity is used; {count} earlier result{plural} left out")]
            }
        };
        Ok(DataFile { columns, notes, ..DataFile::default() })
    }
}

/// Returns titles for columns whose titles are unknown.
pub(super) fn numbered_titles(width: usize) -> Vec<String> {
    (1..=width).map(|at| format!("column_{at}")).collect()
}
