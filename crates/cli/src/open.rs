//! Shows a file in the browser, or whatever the desktop opens it with.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Figures and reports, the first one that was written is shown.
const SHOWN: [&str; 3] = ["figure.html", "figure.svg", "figure.png"];

/// The file among those of a run that a reader wants to see.
pub fn figure(files: &[PathBuf]) -> Option<&Path> {
    SHOWN
        .iter()
        .find_map(|name| files.iter().find(|file| file.file_name().is_some_and(|n| n == *name)))
        .map(PathBuf::as_path)
}

/// Asks the desktop to show the file and does not wait for it.
///
/// # Errors
/// In words: there is no desktop, or no program for it.
pub fn show(file: &Path) -> Result<(), String> {
    let (program, arguments): (&str, &[&str]) = if cfg!(target_os = "macos") {
        ("open", &[])
    } else if cfg!(windows) {
        ("cmd", &["/C", "start", ""])
    } else {
        ("xdg-open", &[])
    };
    // a path that begins with a dash is no option
    let path = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
    let mut command = Command::new(program);
    command.args(arguments).arg(path).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let said = |reason: String| format!("{} cannot be shown: {reason}; open it by hand", file.display());
    let mut child = command.spawn().map_err(|error| said(format!("{program}: {error}")))?;
    // a program that refuses says so soon, one that shows the file may live as long as the browser
    let until = std::time::Instant::now() + PATIENCE;
    while std::time::Instant::now() < until {
        match child.try_wait() {
            Ok(Some(status)) if status.success() => return Ok(()),
            Ok(Some(status)) => return Err(said(format!("{program} ended with {status}"))),
            _ => std::thread::sleep(PATIENCE / 20),
        }
    }
    Ok(())
}

/// How long a refusal is waited for.
const PATIENCE: std::time::Duration = std::time::Duration::from_secs(1);

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
