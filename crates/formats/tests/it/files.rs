//! Files of real programs (see `data/make.py`) read back to the last bit.

use std::path::{Path, PathBuf};

use stickslip_formats::{ErrorKind, Matrix, MatrixReport, list, names, read, read_bytes, write};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

/// Returns size and entries of `NAME.bits`: the whole matrix with both triangles.
fn expected(name: &str) -> (usize, usize, Vec<(u32, u32, u64)>) {
    let text = std::fs::read_to_string(data(&format!("{name}.bits"))).expect("a file of expected bits");
    let mut lines = text.lines().map(|line| line.split(' ').collect::<Vec<_>>());
    let size = lines.next().expect("a line of sizes");
    let entries = lines.map(|words| {
        let number = |at: usize| words[at].parse().expect("an index");
        (number(0), number(1), u64::from_str_radix(words[2], 16).expect("16 hexadecimal digits"))
    });
    (size[0].parse().expect("rows"), size[1].parse().expect("columns"), entries.collect())
}

fn bits(matrix: &Matrix) -> Vec<(u32, u32, u64)> {
    let mut entries: Vec<_> = matrix.both_triangles().map(|e| (e.row, e.column, e.value.to_bits())).collect();
    entries.sort_by_key(|&(row, column, _)| (column, row));
    entries
}

/// The matrix `name` of a file has the bits of `expect`, and the file is recognized as `format`.
fn check(file: &str, name: Option<&str>, format: &str, expect: &str) -> Matrix {
    let matrix = read(data(file), None, name).unwrap_or_else(|error| panic!("{error}"));
    let (rows, columns, entries) = expected(expect);
    assert_eq!((matrix.rows(), matrix.columns()), (rows, columns), "{file}");
    assert_eq!(bits(&matrix), entries, "{file} {name:?}");
    assert_eq!(matrix.origin().format, format, "{file}");
    assert_eq!(matrix.origin().variable, name.unwrap_or_default(), "{file}");
    let symmetric = entries.iter().all(|&(row, column, value)| {
        entries.iter().any(|&(other_row, other_column, other)| (other_row, other_column, other) == (column, row, value))
    });
    assert_eq!(matrix.is_symmetric(), symmetric && rows == columns, "{file}");
    matrix
}

#[test]
fn numpy_arrays() {
    for file in ["stiffness.npy", "stiffness_big_endian.npy"] {
        check(file, None, "npy", "stiffness");
    }
    check("general_fortran.npy", None, "npy", "general");
    for file in ["dense.npz", "dense_compressed.npz"] {
        check(file, Some("K"), "npz", "stiffness");
        check(file, Some("M"), "npz", "mass");
    }
}

#[test]
fn rows_of_numbers_as_text() {
    for file in ["savetxt.txt", "rows.csv"] {
        check(file, None, "dense-text", "stiffness");
    }
}

/// `1000 [2 -1 0; -1 2 -1; 0 -1 1]`, from files with variations of their format.
#[test]
fn a_chain_of_three_in_every_variant() {
    for file in ["chain_no_banner.mtx", "chain_indented_banner.mtx", "chain_indented_comment.mtx"] {
        check(file, None, "matrix-market", "chain");
    }
    for file in ["chain_skipped_column.rsa", "chain_repeated_group.rsa"] {
        check(file, None, "harwell-boeing", "chain");
    }
    check("chain_digit.op4", Some("1MAT"), "nastran-op4", "chain");
    check("chain_blank.op4", None, "nastran-op4", "chain");
    check("chain_complex_beside.pch", Some("KAAX"), "nastran-dmig", "chain");
    let listed: Vec<_> =
        list(data("chain_complex_beside.pch"), None).expect("a list").iter().map(ToString::to_string).collect();
    assert_eq!(listed.join(", "), "KAAX (3 x 3), MAAX (3 x 3), VAX (2 x 1), K4CX (complex)");
}

#[test]
fn scipy_sparse_matrices() {
    for file in ["stiffness_csc.npz", "stiffness_csr.npz", "stiffness_int64.npz"] {
        check(file, None, "npz", "stiffness");
    }
    check("general_coo.npz", None, "npz", "general");
    check("general.rua", None, "harwell-boeing", "general");
}

#[test]
fn matrix_market_of_scipy() {
    check("stiffness.mtx", None, "matrix-market", "stiffness");
    check("general.mtx", None, "matrix-market", "general");
    check("general_array.mtx", None, "matrix-market", "general");
    check("whole_array.mtx", None, "matrix-market", "whole");
}

#[test]
fn matlab_5_plain_and_compressed() {
    for file in ["v5.mat", "v5_compressed.mat"] {
        check(file, Some("K"), "matlab", "stiffness");
        check(file, Some("M"), "matlab", "mass");
        check(file, Some("G"), "matlab", "general");
        check(file, Some("bytes"), "matlab", "whole");
        check(file, Some("single"), "matlab", "whole");
        check(file, Some("model.K"), "matlab", "stiffness");
        check(file, Some("model.inner.M"), "matlab", "mass");
        let kind = |name| read(data(file), None, Some(name)).map(|_| ()).map_err(|error| error.kind);
        assert_eq!(kind("z"), Err(ErrorKind::Complex));
        assert_eq!(kind("label"), Err(ErrorKind::Unsupported));
        assert_eq!(kind("k"), Err(ErrorKind::Selection));
        let listed: Vec<_> = list(data(file), None).expect("a list").iter().map(ToString::to_string).collect();
        let all = "K (6 x 6), M (6 x 6), G (4 x 3), bytes (2 x 2), single (2 x 2), z (complex), label (text), \
            cells (a cell array), model.K (6 x 6), model.inner.M (6 x 6)";
        assert_eq!(listed.join(", "), all);
    }
}

#[test]
fn matlab_73_and_plain_hdf5() {
    check("v73.mat", Some("K"), "hdf5", "stiffness");
    check("v73.mat", Some("M"), "hdf5", "mass");
    check("v73.mat", Some("G"), "hdf5", "general");
    check("v73.mat", Some("Gd"), "hdf5", "general");
    check("v73.mat", Some("bytes"), "hdf5", "whole");
    check("v73.mat", Some("model.M"), "hdf5", "mass");
    let kind =
        |name| read(data("v73.mat"), None, Some(name)).map(|matrix| matrix.entries().len()).map_err(|error| error.kind);
    assert_eq!(kind("nothing"), Ok(0));
    assert_eq!(kind("z"), Err(ErrorKind::Complex));
    assert_eq!(kind("label"), Err(ErrorKind::Unsupported));
    check("plain.h5", Some("K"), "hdf5", "stiffness");
    check("plain.h5", Some("sub.G"), "hdf5", "general");
}

#[test]
fn matlab_files_of_octave() {
    for file in ["octave_v6.mat", "octave_v7.mat"] {
        check(file, Some("K"), "matlab", "stiffness");
        check(file, Some("M"), "matlab", "mass");
        check(file, Some("G"), "matlab", "general");
        check(file, Some("whole"), "matlab", "whole");
        check(file, Some("model.inner.M"), "matlab", "mass");
    }
    let kind = |name| read(data("octave.h5"), None, Some(name)).map(|_| ()).map_err(|error| error.kind);
    assert_eq!(kind("G"), Err(ErrorKind::Unsupported));
    check("octave.h5", Some("plain"), "hdf5", "stiffness");
}

#[test]
fn calculix_matrices_and_names() {
    let stiffness = check("bricks.sti", None, "coordinate", "bricks.sti");
    let mass = check("bricks.mas", None, "coordinate", "bricks.mas");
    // The file states many zeros: the mass does not couple different directions.
    assert!(mass.origin().zeros * 2 > mass.entries().len());
    let found = names::read(data("bricks.dof"), stiffness.rows()).expect("names");
    assert_eq!((found[0].as_str(), found.len()), ("2.x", 30));
    assert_eq!(names::read(data("bricks.dof"), 29).map_err(|error| error.kind), Err(ErrorKind::Names));
    let report = MatrixReport::new(&stiffness.with_names(found).expect("as many names as rows"));
    assert!(report.zero_diagonal.is_empty() && report.negative_diagonal.is_empty());
    let total: f64 = mass.both_triangles().map(|e| e.value).sum();
    // Ten nodes are at least partly free. The sum is less than three times the mass, 7.8e-9 (1
    // + 0.9666…), because directions do not couple.
    assert!(total > 1e-8 && total < 3.0 * 7.8e-9 * 2.0, "{total}");
}

#[test]
fn substructures_of_calculix() {
    let matrix = check("substructure.mtx", Some("stiffness"), "abaqus-element", "substructure");
    let expected = ["2.x", "9.x", "9.y", "9.z", "10.y", "12.x", "12.y", "12.z"].map(String::from);
    assert_eq!(matrix.names(), Some(&expected[..]));
}

#[test]
fn nastran_output4_of_pyyeti() {
    for kind in ["dense", "nonbigmat", "bigmat"] {
        for file in [format!("{kind}_text.op4"), format!("{kind}_little.op4")] {
            check(&file, Some("KAA"), "nastran-op4", "stiffness");
            check(&file, Some("GEN"), "nastran-op4", "general");
            assert_eq!(list(data(&file), None).expect("a list").len(), 3);
        }
    }
    check("bigmat_big_endian.op4", Some("KAA"), "nastran-op4", "stiffness");
    for file in ["output2.op2", "output2_64bit_big.op2"] {
        check(file, Some("KAA"), "nastran-op2", "stiffness");
        check(file, Some("GEN"), "nastran-op2", "general");
    }
}

#[test]
fn nastran_cards_of_pyyeti() {
    let nodes = ["7.x", "7.y", "9.x", "10.z", "100.x", "100.rz"].map(String::from);
    let file = "pyyeti.pch";
    assert_eq!(check(file, Some("KAAX"), "nastran-dmig", "punch").names(), Some(&nodes[..]));
    assert_eq!(check(file, Some("BAAX"), "nastran-dmig", "punch_tilted").names(), Some(&nodes[..]));
    // A row of zeros has no card.
    let left = ["7.x", "7.y", "10.z", "100.x", "100.rz"].map(String::from);
    assert_eq!(check(file, Some("MAAX"), "nastran-dmig", "punch_mass").names(), Some(&left[..]));
    let left = ["7.x", "7.y", "10.z"].map(String::from);
    assert_eq!(check(file, Some("PAX"), "nastran-dmig", "punch_rectangular").names(), Some(&left[..]));
    let listed: Vec<_> = list(data(file), None).expect("a list").iter().map(ToString::to_string).collect();
    assert_eq!(listed.join(", "), "KAAX (6 x 6), MAAX (5 x 5), BAAX (6 x 6), PAX (3 x 3)");
}

#[test]
fn abaqus_nastran_and_ansys_by_the_letter() {
    check("abaqus_coordinate.mtx", None, "coordinate", "abaqus");
    let nodes = ["7.x", "7.y", "9.x", "10.z", "100.x", "100.rz"].map(String::from);
    assert_eq!(check("abaqus_input.mtx", None, "abaqus-matrix-input", "abaqus").names(), Some(&nodes[..]));
    assert_eq!(check("punch.pch", Some("KAAX"), "nastran-dmig", "punch").names(), Some(&nodes[..]));
    let hbmat = check("hbmat.matrix", None, "harwell-boeing", "stiffness");
    assert_eq!(names::read(data("hbmat.mapping"), hbmat.rows()).expect("names"), nodes);
    let full = check("by_the_letter.full", Some("stiffness"), "ansys-full", "full_stiffness");
    assert_eq!(full.names(), Some(&["9.x", "9.z", "4.x", "4.y", "4.z"].map(String::from)[..]));
    check("by_the_letter.full", Some("mass"), "ansys-full", "full_mass");
}

#[test]
fn what_is_written_reads_back_to_the_last_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["stiffness.mtx", "general.mtx", "bricks.mas"] {
        let matrix = read(data(name), None, None).expect("a matrix");
        for ending in ["mtx", "npz"] {
            let path = folder.path().join(format!("copy.{ending}"));
            write(&path, &matrix).expect("a file");
            let back = read(&path, None, None).expect("a matrix");
            assert_eq!(bits(&back), bits(&matrix));
            assert_eq!(back.is_symmetric(), matrix.is_symmetric());
        }
    }
    let matrix = read(data("stiffness.mtx"), None, None).expect("a matrix");
    assert_eq!(write(folder.path().join("copy.mat"), &matrix).map_err(|error| error.kind), Err(ErrorKind::Format));
    let named = matrix.with_names(["a,b", "c", "", "d", "e", "f"].map(String::from).to_vec()).expect("names");
    let path = folder.path().join("names.csv");
    names::write(&path, &named).expect("a file");
    assert_eq!(names::read(&path, 6).expect("names"), named.names().expect("names"));
}

/// A byte order mark is not part of the text. The error for a nearly supported
/// format names the format and the remedy.
#[test]
fn what_is_nearly_known_is_called_by_its_name() {
    let text = std::fs::read(data("stiffness.mtx")).expect("a file");
    let marked = [&b"\xef\xbb\xbf"[..], &text].concat();
    assert_eq!(bits(&read_bytes(&marked, None, None).expect("a matrix")), expected("stiffness").2);
    let wide: Vec<u8> = [0xff, 0xfe].into_iter().chain(text.iter().flat_map(|byte| [*byte, 0])).collect();
    let error = read_bytes(&wide, None, None).expect_err("UTF-16").to_string();
    assert!(error.contains("UTF-16") && error.contains("UTF-8"), "{error}");
    // A 1 x 1 matrix K of doubles.
    let head = [0u32, 1, 1, 0, 2].into_iter().flat_map(u32::to_le_bytes);
    let old: Vec<u8> = head.chain(*b"K\0").chain(2.5f64.to_le_bytes()).collect();
    let error = read_bytes(&old, None, None).expect_err("version 4").to_string();
    assert!(error.contains("MATLAB version 4") && error.contains("-v7"), "{error}");
}
