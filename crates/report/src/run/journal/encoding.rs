//! Binary form of a result block: numbers by their bits, equal consecutive texts once.

use stickslip_study::dataset::{CellValues, Column, Table};
use stickslip_study::result_block::Block;

/// Appends a block and its wall time in s.
pub(super) fn write(block: &Block, time: f64, out: &mut Vec<u8>) {
    let number = |out: &mut Vec<u8>, value: usize| out.extend((value as u64).to_le_bytes());
    let text = |out: &mut Vec<u8>, text: &str| {
        number(out, text.len());
        out.extend(text.as_bytes());
    };
    number(out, block.units.start);
    number(out, block.units.end);
    out.extend(time.to_le_bytes());
    // Maps of texts and numbers always convert to JSON.
    text(out, &serde_json::to_string(&block.tally).unwrap_or_default());
    number(out, block.tables.len());
    for table in &block.tables {
        text(out, &table.name);
        number(out, table.columns.len());
        number(out, table.rows());
        for column in &table.columns {
            text(out, &column.name);
            match &column.values {
                CellValues::Number(values) => {
                    out.push(0);
                    values.iter().for_each(|value| out.extend(value.to_le_bytes()));
                }
                CellValues::Integer(values) => {
                    out.push(1);
                    values.iter().for_each(|value| out.extend(value.to_le_bytes()));
                }
                CellValues::Flag(values) => {
                    out.push(2);
                    out.extend(values.iter().map(|value| value.map_or(2, u8::from)));
                }
                CellValues::Text(values) => {
                    out.push(3);
                    // Consecutive rows mostly have equal texts.
                    for run in values.chunk_by(|a, b| a == b) {
                        number(out, run.len());
                        text(out, &run[0]);
                    }
                }
            }
        }
    }
}

/// Decodes a block and its time. Returns `None` for invalid bytes.
pub(super) fn read(mut bytes: &[u8]) -> Option<(Block, f64)> {
    let from = &mut bytes;
    let units = number(from)?..number(from)?;
    let time = f64::from_le_bytes(eight(from)?);
    let tally = serde_json::from_str(text(from)?).ok()?;
    let count = number(from)?;
    let mut tables = Vec::new();
    for _ in 0..count {
        let name = text(from)?.to_owned();
        let (count, rows) = (number(from)?, number(from)?);
        let mut columns = Vec::new();
        for _ in 0..count {
            columns.push(Column { name: text(from)?.to_owned(), values: values(from, rows)? });
        }
        tables.push(Table { name, columns });
    }
    Some((Block { units, tables, tally }, time))
}

fn values(from: &mut &[u8], rows: usize) -> Option<CellValues> {
    Some(match take(from, 1)? {
        [0] => CellValues::Number(
            take(from, rows.checked_mul(8)?)?
                .chunks_exact(8)
                .filter_map(|b| Some(f64::from_le_bytes(b.try_into().ok()?)))
                .collect(),
        ),
        [1] => CellValues::Integer(
            take(from, rows.checked_mul(8)?)?
                .chunks_exact(8)
                .filter_map(|b| Some(u64::from_le_bytes(b.try_into().ok()?)))
                .collect(),
        ),
        [2] => CellValues::Flag(
            take(from, rows)?
                .iter()
                .map(|b| [Some(false), Some(true)].get(usize::from(*b)).copied().flatten())
                .collect(),
        ),
        [3] => {
            let mut values: Vec<String> = Vec::new();
            while values.len() < rows {
                let (count, word) = (number(from)?, text(from)?);
                if count == 0 || count > rows - values.len() {
                    return None;
                }
                values.extend(std::iter::repeat_n(word.to_owned(), count));
            }
            CellValues::Text(values)
        }
        _ => return None,
    })
}

fn take<'a>(from: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (taken, rest) = from.split_at_checked(count)?;
    *from = rest;
    Some(taken)
}

fn eight(from: &mut &[u8]) -> Option<[u8; 8]> {
    take(from, 8)?.try_into().ok()
}

fn number(from: &mut &[u8]) -> Option<usize> {
    usize::try_from(u64::from_le_bytes(eight(from)?)).ok()
}

fn text<'a>(from: &mut &'a [u8]) -> Option<&'a str> {
    let length = number(from)?;
    std::str::from_utf8(take(from, length)?).ok()
}
