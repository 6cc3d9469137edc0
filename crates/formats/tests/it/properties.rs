//! Properties of random matrices: writing and reading, any order of lines,
//! removed and permuted rows.

use std::collections::BTreeMap;

use proptest::prelude::*;
use stickslip_formats::{Matrix, Symmetry, read_bytes, write};

/// Numbers of all magnitudes, including zeros, which a matrix does not store.
fn value() -> impl Strategy<Value = f64> {
    prop_oneof![8 => any::<f64>().prop_filter("finite", |value| value.is_finite()), 2 => -10.0..10.0, 1 => Just(0.0)]
}

/// Size and entries, each position at most once.
fn entries(most: usize) -> impl Strategy<Value = (usize, usize, BTreeMap<(usize, usize), f64>)> {
    (1..=most, 1..=most).prop_flat_map(|(rows, columns)| {
        (Just(rows), Just(columns), prop::collection::btree_map((0..rows, 0..columns), value(), 0..40))
    })
}

/// One triangle of a square matrix, each position at most once, with an entry
/// in the last diagonal position.
fn triangle() -> impl Strategy<Value = (usize, Vec<(usize, usize, f64)>)> {
    (1..12_usize).prop_flat_map(|size| {
        let places = prop::collection::btree_map((0..size, 0..size), value(), 0..40);
        (Just(size), places).prop_map(|(size, places)| {
            let lower = places.into_iter().filter(|((row, column), _)| row >= column);
            let mut lower: BTreeMap<_, _> = lower.collect();
            lower.insert((size - 1, size - 1), 1.0);
            (size, lower.into_iter().map(|((row, column), value)| (row, column, value)).collect())
        })
    })
}

fn bits(matrix: &Matrix) -> Vec<(u32, u32, u64)> {
    matrix.entries().iter().map(|e| (e.row, e.column, e.value.to_bits())).collect()
}

fn text(triplets: &[(usize, usize, f64)], line: impl Fn(usize, usize, f64) -> String) -> Vec<u8> {
    triplets.iter().flat_map(|&(row, column, value)| line(row + 1, column + 1, value).into_bytes()).collect()
}

proptest! {
    #[test]
    fn what_is_written_reads_back((rows, columns, places) in entries(12)) {
        let triplets = places.iter().map(|(&(row, column), &value)| (row, column, value));
        let matrix = Matrix::new(rows, columns, Symmetry::General, triplets).expect("a matrix");
        let dense = |row, column| places.get(&(row, column)).copied().unwrap_or_default();
        for row in 0..rows {
            for column in 0..columns {
                prop_assert_eq!(matrix.get(row, column), dense(row, column));
            }
        }
        let folder = tempfile::tempdir().expect("a folder");
        for ending in ["mtx", "npz"] {
            let path = folder.path().join(format!("m.{ending}"));
            write(&path, &matrix).expect("a file");
            let back = read_bytes(&std::fs::read(&path).expect("a file"), None, None).expect("a matrix");
            prop_assert_eq!(bits(&back), bits(&matrix));
            prop_assert_eq!((back.rows(), back.columns(), back.is_symmetric()), (rows, columns, matrix.is_symmetric()));
        }
    }

    /// One triangle, the other, or both, in any order: every format of lines gives the same matrix.
    #[test]
    fn formats_of_lines_agree(
        (size, lower) in triangle(),
        keys in prop::collection::vec(any::<u32>(), 200),
        side in 0..3_usize,
    ) {
        let expected = Matrix::new(size, size, Symmetry::Symmetric, lower.clone()).expect("a matrix");
        let mut lines = Vec::new();
        for &(row, column, value) in &lower {
            if side != 1 || row == column {
                lines.push((row, column, value));
            }
            if side != 0 && row != column {
                lines.push((column, row, value));
            }
        }
        let mut keyed: Vec<_> = lines.into_iter().zip(keys).collect();
        keyed.sort_by_key(|&(_, key)| key);
        let lines: Vec<_> = keyed.into_iter().map(|(line, _)| line).collect();
        let mut dmig = b"DMIG,K,0,6,2\n".to_vec();
        dmig.extend(text(&lines, |row, column, value| format!("DMIG,K,{column},1,,{row},1,{value:e}\n")));
        let files = [
            text(&lines, |row, column, value| format!("{row} {column} {value:e}\n")),
            text(&lines, |row, column, value| format!("{row},1, {column},1, {value:e}\n")),
            dmig,
        ];
        for (at, file) in files.iter().enumerate() {
            let found = read_bytes(file, None, None).expect("a matrix");
            // Formats with row names omit rows without a line.
            let found = match found.names() {
                Some(_) => found.reordered(&(1..=size).map(|row| format!("{row}.x")).collect::<Vec<_>>()).expect("rows"),
                None => found,
            };
            prop_assert_eq!(bits(&found), bits(&expected), "format {}", at);
            prop_assert!(found.is_symmetric());
        }
    }

    #[test]
    fn rows_are_taken_out_and_put_elsewhere((size, lower) in triangle(), out in 0..12_usize, shift in 0..12_usize) {
        let names = |row: usize| format!("row {row}");
        let matrix = Matrix::new(size, size, Symmetry::Symmetric, lower).expect("a matrix");
        let matrix = matrix.with_names((0..size).map(names).collect()).expect("names");
        let left: Vec<usize> = (0..size).filter(|&row| row != out).collect();
        let smaller = matrix.clone().without_rows(&[out]).expect("a square matrix");
        prop_assert_eq!(smaller.rows(), left.len());
        for (at, &row) in left.iter().enumerate() {
            for (beside, &column) in left.iter().enumerate() {
                prop_assert_eq!(smaller.get(at, beside), matrix.get(row, column));
            }
            prop_assert_eq!(&smaller.names().expect("names")[at], &names(row));
        }
        let order: Vec<usize> = (0..size).map(|at| (at + shift) % size).collect();
        let moved = matrix.clone().reordered(&order.iter().copied().map(names).collect::<Vec<_>>()).expect("rows");
        for (at, &row) in order.iter().enumerate() {
            for (beside, &column) in order.iter().enumerate() {
                prop_assert_eq!(moved.get(at, beside), matrix.get(row, column));
            }
        }
    }
}
