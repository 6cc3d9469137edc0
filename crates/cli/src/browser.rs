//! Opens a file or an address in the browser, or in the program that the desktop uses for it.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Figure files in order of preference; the first existing one is opened.
const SHOWN: [&str; 3] = ["figure.html", "figure.svg", "figure.png"];

/// Returns the figure among the files of a run.
pub fn figure(files: &[PathBuf]) -> Option<&Path> {
    SHOWN
        .iter()
        .find_map(|name| files.iter().find(|file| file.file_name().is_some_and(|n| n == *name)))
        .map(PathBuf::as_path)
}

/// Asks the desktop to open the file, and does not wait for the program to end.
///
/// # Errors
/// A text, if there is no desktop or no suitable program.
pub fn show(file: &Path) -> Result<(), String> {
    // An absolute path that starts with a dash is not read as an option.
    let path = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
    open(&path, &file.display().to_string())
}

/// Asks the desktop to open an address in the browser.
///
/// # Errors
/// A text, if there is no desktop or no browser.
pub fn show_address(address: &str) -> Result<(), String> {
    open(Path::new(address), address)
}

fn open(target: &Path, name: &str) -> Result<(), String> {
    let (program, arguments): (&str, &[&str]) = if cfg!(target_os = "macos") {
        ("open", &[])
    } else if cfg!(windows) {
        ("cmd", &["/C", "start", ""])
    } else {
        ("xdg-open", &[])
    };
    let mut command = Command::new(program);
    command.args(arguments).arg(target).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let said = |reason: String| format!("cannot open {name}: {reason}; open it manually");
    let mut child = command.spawn().map_err(|error| said(format!("{program}: {error}")))?;
    // A program that fails ends soon. A successful one may run as long as the browser.
    let until = std::time::Instant::now() + FAILURE_TIMEOUT;
    while std::time::Instant::now() < until {
        match child.try_wait() {
            Ok(Some(status)) if status.success() => return Ok(()),
            Ok(Some(status)) => return Err(said(format!("{program} ended with {status}"))),
            _ => std::thread::sleep(FAILURE_TIMEOUT / 20),
        }
    }
    Ok(())
}

/// Time to wait for a failure of the program.
const FAILURE_TIMEOUT: std::time::Duration = std::time::Duration::from_secs(1);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interactive_figure_comes_first() {
        let files = ["o/curve.csv", "o/figure.svg", "o/figure.png", "o/figure.html"].map(PathBuf::from);
        assert_eq!(figure(&files), Some(Path::new("o/figure.html")));
        assert_eq!(figure(&files[..3]), Some(Path::new("o/figure.svg")));
        assert_eq!(figure(&files[..1]), None);
    }
}
