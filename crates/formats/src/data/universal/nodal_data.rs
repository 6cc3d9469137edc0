//! Dataset 55: data at nodes, such as a mode shape.
//!
//! Columns: `N.node`, and `N.value_1`, … or `N.value_1_real`, `N.value_1_imaginary`, …; N is the
//! position of the dataset.

use super::fields::{Widths, append_numbers, integers};
use super::{TextSet, words};
use crate::data::{Column, DataFile};
use crate::error::Error;

/// Most values at a node that are accepted.
const MAX_VALUES: i64 = 100;

pub(super) fn read(set: &TextSet<'_>, file: &mut DataFile) -> Result<(), Error> {
    let position = set.position;
    for at in 0..5 {
        let text = words(&set.line(at, "its five titles")?);
        if !text.is_empty() && text != "NONE" {
            file.notes.push(format!("dataset {position}: {text}"));
        }
    }
    let kinds_line = set.line(5, "its types")?;
    let kinds = integers(&kinds_line)?;
    let [_, analysis, _, _, number, per_node, ..] = kinds[..] else {
        return Err(kinds_line.malformed("six types", &format!("{} numbers", kinds.len())));
    };
    if !(1..=MAX_VALUES).contains(&per_node) {
        return Err(kinds_line.malformed("a number of values per node", &per_node.to_string()));
    }
    let complex = match number {
        2 | 4 => false,
        5 | 6 => true,
        other => return Err(kinds_line.malformed("a type of data of 2, 4, 5 or 6", &other.to_string())),
    };
    let counts = integers(&set.line(6, "the numbers of its analysis")?)?;
    // mode number and frequency of normal and of complex modes
    let mut reals = Vec::new();
    append_numbers(&set.line(7, "the numbers of its analysis")?, Widths(&[13]), &mut reals)?;
    if let (2, [_, _, _, mode, ..], [frequency, ..]) = (analysis, &counts[..], &reals[..]) {
        file.notes.push(format!("dataset {position}: mode {mode}, {frequency} Hz"));
    }
    let per_node = per_node as usize * if complex { 2 } else { 1 };
    let (mut nodes, mut values) = (Vec::new(), vec![Vec::new(); per_node]);
    let mut lines = set.lines.iter().skip(8).filter(|line| !line.text.trim_ascii().is_empty());
    while let Some(line) = lines.next() {
        let node = integers(line)?.first().copied().unwrap_or_default();
        let mut own = Vec::new();
        while own.len() < per_node {
            let Some(more) = lines.next() else {
                return Err(line.malformed(&format!("{per_node} numbers below"), &own.len().to_string()));
            };
            append_numbers(more, Widths(&[13]), &mut own)?;
        }
        nodes.push(node as f64);
        values.iter_mut().zip(own).for_each(|(column, value)| column.push(value));
    }
    let mut push = |name: String, values: Vec<f64>| {
        file.columns.push(Column { name: format!("{position}.{name}"), values, ..Column::default() });
    };
    push("node".to_owned(), nodes);
    for (at, column) in values.into_iter().enumerate() {
        push(
            match (complex, at % 2) {
                (false, _) => format!("value_{}", at + 1),
                (true, 0) => format!("value_{}_real", at / 2 + 1),
                (true, _) => format!("value_{}_imaginary", at / 2 + 1),
            },
            column,
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::data::read_bytes;

    #[test]
    fn a_complex_mode_shape() {
        let text = b"    -1\n    55\nshape\nNONE\nNONE\nNONE\nNONE\n         1         2         2         8         5         2\n\
            \x20        2         4         1         3\n  1.21500e+02  1.00000e+00  5.00000e-03  0.00000e+00\n\
            \x20        7\n  1.00000e+00 -1.00000e+00  2.00000e+00 -2.00000e+00\n    -1\n";
        let file = read_bytes(text).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(file.column("1.node").expect("a column").values, [7.0]);
        assert_eq!(file.column("1.value_2_imaginary").expect("a column").values, [-2.0]);
        assert!(file.notes.iter().any(|note| note == "dataset 1: mode 3, 121.5 Hz"), "{:?}", file.notes);
    }
}
