//! Conformance of every format, on every file of `data`: recognized, listed, read, refused if
//! truncated, and no panic on files of other formats.

use std::path::{Path, PathBuf};

use stickslip_formats::{Error, ErrorKind, TABLE, list_bytes, read_bytes};

/// Returns the files of matrices in `data`, with their names.
fn files() -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    // Without expected values, row names, and the script that creates all of them.
    paths.retain(|path| {
        !["bits", "dof", "mapping", "py"].iter().any(|ending| path.extension().is_some_and(|found| found == *ending))
    });
    let name = |path: &Path| path.file_name().expect("a name").to_string_lossy().into_owned();
    paths.iter().map(|path| (name(path), std::fs::read(path).expect("a file"))).collect()
}

/// Returns the name to request for a variable.
fn asked(name: &str) -> Option<&str> {
    Some(name).filter(|name| !name.is_empty())
}

/// Reads all matrices of a file. Returns the format and the number of matrices.
fn read_all(bytes: &[u8], format: Option<&str>) -> Result<(&'static str, usize), Error> {
    let mut found = ("", 0);
    for variable in list_bytes(bytes, format)?.iter().filter(|variable| variable.note.is_none()) {
        let matrix = read_bytes(bytes, format, asked(&variable.name))?;
        assert_eq!((matrix.rows(), matrix.columns()), (variable.rows, variable.columns), "{variable}");
        found = (matrix.origin().format, found.1 + 1);
    }
    Ok(found)
}

#[test]
fn every_file_is_found_and_every_format_has_a_file() {
    let mut found = Vec::new();
    for (name, bytes) in files() {
        let (format, count) = read_all(&bytes, None).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(count > 0, "{name}");
        assert_eq!(read_all(&bytes, Some(format)), Ok((format, count)), "{name}");
        found.push(format);
    }
    for format in TABLE {
        assert!(found.contains(&format.name), "no file of {} in tests/data", format.name);
        assert!(!format.summary.is_empty(), "{}", format.name);
        assert_eq!(TABLE.iter().filter(|other| other.name == format.name).count(), 1, "{}", format.name);
    }
}

#[test]
fn every_format_stands_in_the_book() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src/matrices.md");
    let page = std::fs::read_to_string(page).expect("the page of the book");
    for format in TABLE {
        assert!(page.contains(&format!("`{}`", format.name)), "docs/src/matrices.md does not list {}", format.name);
    }
}

#[test]
fn a_file_cut_anywhere_is_refused_or_read_without_panic() {
    for (name, bytes) in files() {
        let (format, _) = read_all(&bytes, None).unwrap_or_else(|error| panic!("{name}: {error}"));
        // The reader cannot know the number of digits of the last number, and
        // it does not read a right-hand side after a matrix.
        let last = 60.min(bytes.len() / 2);
        let mut refused = 0;
        let step = bytes.len().div_ceil(300);

        for length in (0..(bytes.len() - last)).step_by(step) {
            refused += usize::from(read_all(&bytes[..length], Some(format)).is_err());
        }
        // Files of lines without a header, and of cards, may end after any
        // line, and OUTPUT2 after any data block. All other files state their length.
        let open_end = [
            "coordinate",
            "abaqus-matrix-input",
            "nastran-dmig",
            "nastran-op2",
            "nastran-op4",
            "matlab",
            "hdf5",
            "abaqus-element",
        ];
        let most = (bytes.len() - last).div_ceil(step);
        assert!(refused > 0, "{name}");
        assert!(open_end.contains(&format) || refused == most, "{name}: {refused} of {most} refused");
    }
}

#[test]
fn a_file_of_another_format_is_refused_without_panic() {
    for (name, bytes) in files() {
        let (own, _) = read_all(&bytes, None).unwrap_or_else(|error| panic!("{name}: {error}"));
        for format in TABLE.iter().filter(|format| format.name != own) {
            let found = read_all(&bytes, Some(format.name));
            // Only lines that are valid in the other format too are accepted,
            // and they never form a matrix.
            assert!(found.is_err() || found == Ok(("", 0)), "{name} as {}: {found:?}", format.name);
        }
    }
}

#[test]
fn no_name_reads_nothing() {
    for (name, bytes) in files() {
        let found = read_bytes(&bytes, None, Some("no such name")).map(|_| ()).map_err(|error| error.kind);
        assert_eq!(found, Err(ErrorKind::Selection), "{name}");
        let found = read_bytes(&bytes, Some("no such format"), None).map(|_| ()).map_err(|error| error.kind);
        assert_eq!(found, Err(ErrorKind::Format), "{name}");
    }
    let check = |bytes: &[u8], part: &str| {
        let text = read_bytes(bytes, None, None).map(|_| ()).map_err(|error| error.to_string());
        assert!(text.as_ref().is_err_and(|text| text.contains(part)), "{text:?}");
    };
    check(b"", "the file is empty");
    check(b"hello\n", "matrix-market, hdf5, matlab");
    check(b"\x1f\x8b\x08", "gunzip");
}
