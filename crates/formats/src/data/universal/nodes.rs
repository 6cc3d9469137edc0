//! Datasets 15 and 2411: nodes with coordinates; dataset 2412: elements with their nodes.
//!
//! Columns: `N.node`, `N.x`, `N.y`, `N.z`; `N.element`, `N.type`, `N.node_1`, …; N is the position
//! of the dataset.

use super::TextSet;
use super::fields::{Widths, append_numbers, integers};
use crate::data::{Column, DataFile};
use crate::error::Error;

/// Types of beam elements, which have a line of orientations before their nodes.
const BEAMS: [i64; 5] = [11, 21, 22, 23, 24];

/// Coordinates of nodes.
#[derive(Default)]
struct Nodes {
    label: Vec<f64>,
    coordinates: [Vec<f64>; 3],
}

impl Nodes {
    fn push(&mut self, label: f64, coordinates: &[f64]) {
        self.label.push(label);
        self.coordinates.iter_mut().zip(coordinates).for_each(|(axis, value)| axis.push(*value));
    }

    fn into_columns(self, position: usize, file: &mut DataFile) {
        let [x, y, z] = self.coordinates;
        for (name, values) in [("node", self.label), ("x", x), ("y", y), ("z", z)] {
            let label = if name == "node" { "" } else { "coordinate" };
            let name = format!("{position}.{name}");
            file.columns.push(Column { name, label: label.to_owned(), values, ..Column::default() });
        }
    }
}

/// Reads dataset 15: a line for every node, `4I10, 3E13.5`.
pub(super) fn read_single(set: &TextSet<'_>, file: &mut DataFile) -> Result<(), Error> {
    let mut nodes = Nodes::default();
    for line in set.lines.iter().filter(|line| !line.text.trim_ascii().is_empty()) {
        let mut numbers = Vec::new();
        append_numbers(line, Widths(&[10, 10, 10, 10, 13, 13, 13]), &mut numbers)?;
        if numbers.len() < 7 {
            return Err(line
                .malformed("node, two systems, colour and three coordinates", &format!("{} numbers", numbers.len())));
        }
        nodes.push(numbers[0], &numbers[4..7]);
    }
    nodes.into_columns(set.position, file);
    Ok(())
}

/// Reads dataset 2411: two lines for every node, `4I10` and `3D25.16`.
pub(super) fn read_double(set: &TextSet<'_>, file: &mut DataFile) -> Result<(), Error> {
    let mut nodes = Nodes::default();
    let filled: Vec<_> = set.lines.iter().filter(|line| !line.text.trim_ascii().is_empty()).collect();
    for pair in filled.chunks(2) {
        let label = integers(pair[0])?.first().copied().unwrap_or_default();
        let Some(line) = pair.get(1) else { return Err(pair[0].malformed("a line of coordinates below", "none")) };
        let mut coordinates = Vec::new();
        append_numbers(line, Widths(&[25]), &mut coordinates)?;
        if coordinates.len() < 3 {
            return Err(line.malformed("three coordinates", &format!("{} numbers", coordinates.len())));
        }
        nodes.push(label as f64, &coordinates);
    }
    nodes.into_columns(set.position, file);
    Ok(())
}

/// Reads dataset 2412. Elements with fewer nodes than others have NaN in the remaining columns.
pub(super) fn read_elements(set: &TextSet<'_>, file: &mut DataFile) -> Result<(), Error> {
    let (mut elements, mut kinds) = (Vec::new(), Vec::new());
    let mut nodes: Vec<Vec<i64>> = Vec::new();
    let mut lines = set.lines.iter().filter(|line| !line.text.trim_ascii().is_empty());
    while let Some(line) = lines.next() {
        let head = integers(line)?;
        let [label, kind, _, _, _, count, ..] = head[..] else {
            return Err(line.malformed(
                "element, type, two properties, colour and number of nodes",
                &format!("{} numbers", head.len()),
            ));
        };
        // no element type has more nodes
        if !(0..=100).contains(&count) {
            return Err(line.malformed("a number of nodes", &count.to_string()));
        }
        if BEAMS.contains(&kind) {
            lines.next();
        }
        let mut own = Vec::new();
        while own.len() < count as usize {
            let Some(more) = lines.next() else {
                return Err(line.malformed(&format!("{count} nodes"), &own.len().to_string()));
            };
            own.extend(integers(more)?);
        }
        own.truncate(count as usize);
        elements.push(label as f64);
        kinds.push(kind as f64);
        nodes.push(own);
    }
    let most = nodes.iter().map(Vec::len).max().unwrap_or(0);
    let position = set.position;
    let mut push = |name: String, values: Vec<f64>| {
        file.columns.push(Column { name: format!("{position}.{name}"), values, ..Column::default() });
    };
    push("element".to_owned(), elements);
    push("type".to_owned(), kinds);
    for at in 0..most {
        push(
            format!("node_{}", at + 1),
            nodes.iter().map(|own| own.get(at).map_or(f64::NAN, |node| *node as f64)).collect(),
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::data::read_bytes;

    #[test]
    fn nodes_and_elements() {
        let text = b"    -1\n    15\n         1         0         0         8-2.40000e+00-9.50000e-01 0.00000e+00\n    -1\n    -1\n  2412\n\
            \x20        1        11         2         1         7         2\n         0         1         1\n         1         2\n\
            \x20        2        44         2         1         7         4\n         1         2         3         4\n    -1\n";
        let file = read_bytes(text).unwrap_or_else(|error| panic!("{error}"));
        let values = |name: &str| file.column(name).expect("a column").values.clone();
        assert_eq!((values("1.x"), values("1.y")), (vec![-2.4], vec![-0.95]));
        assert_eq!((values("2.type"), values("2.node_2")), (vec![11.0, 44.0], vec![2.0, 2.0]));
        assert!(values("2.node_4")[0].is_nan() && values("2.node_4")[1] == 4.0);
    }
}
