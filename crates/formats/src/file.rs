//! Loads files into memory.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{Error, ErrorKind, Location};

/// Maximum size of a file in bytes, 16 GiB: a sparse matrix of about 400 million entries as text.
pub const MAX_FILE_BYTES: u64 = 16 << 30;

/// Loads a whole file. Refuses devices and pipes, which have no known size.
pub(crate) fn load(path: &Path) -> Result<Vec<u8>, Error> {
    let failed = |error: std::io::Error| io(path, &error);
    let found = std::fs::metadata(path).map_err(failed)?;
    if found.is_dir() {
        let help = format!("give the path of a matrix file in it, such as {}", path.join("stiffness.mtx").display());
        let problem = "the path is a folder, not a file".to_owned();
        return Err(Error::new(ErrorKind::Io, Location::File, problem, help).with_path(path));
    }
    if !found.is_file() {
        let problem = "the path is a device or a pipe, which has no known size".into();
        return Err(Error::new(ErrorKind::TooLarge, Location::File, problem, "save its content to a file first")
            .with_path(path));
    }
    let mut bytes = Vec::new();
    if found.len() <= MAX_FILE_BYTES {
        bytes.try_reserve_exact(found.len() as usize).map_err(|error| failed(error.into()))?;
        // The file may grow while it is read.
        File::open(path).and_then(|file| file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes)).map_err(failed)?;
    }
    let size = found.len().max(bytes.len() as u64);
    if size <= MAX_FILE_BYTES {
        return Ok(bytes);
    }
    let problem = format!("the file has {size} bytes; the limit is {MAX_FILE_BYTES} bytes");
    let remedy = "save the matrix in binary (.npz, .mat), or export a smaller structure";
    Err(Error::new(ErrorKind::TooLarge, Location::File, problem, remedy).with_path(path))
}

/// Converts an error of the operating system.
pub(crate) fn io(path: &Path, error: &std::io::Error) -> Error {
    Error::new(ErrorKind::Io, Location::File, error.to_string(), "check the path and its permissions").with_path(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(path: &Path) -> ErrorKind {
        load(path).map(|bytes| bytes.len()).expect_err("no file of a known size").kind
    }

    #[test]
    fn only_files_of_a_known_size_are_read() -> std::io::Result<()> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("huge.mtx");
        // A sparse file: it takes no space on the disk.
        File::create(&path)?.set_len(MAX_FILE_BYTES + 1)?;
        assert_eq!(refused(&path), ErrorKind::TooLarge);
        assert_eq!(refused(folder.path()), ErrorKind::Io);
        assert_eq!(refused(&folder.path().join("none.mtx")), ErrorKind::Io);
        std::fs::write(&path, b"1 1 2.0\n")?;
        assert_eq!(load(&path).expect("a file"), b"1 1 2.0\n");
        Ok(())
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_pipes_are_refused_at_once() -> std::io::Result<()> {
        assert_eq!(refused(Path::new("/dev/zero")), ErrorKind::TooLarge);
        let pipe = tempfile::tempdir()?;
        let pipe = pipe.path().join("pipe");
        // The pipe has no writer, so opening it would block forever.
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status()?.success());
        assert_eq!(refused(&pipe), ErrorKind::TooLarge);
        Ok(())
    }
}
