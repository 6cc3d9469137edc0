//! Python packages as peers: a virtual environment under `target/` with one pinned package, and
//! a script for the measurement.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A package of the index, and the folder of its environment under `target/`.
pub struct Peer {
    pub package: &'static str,
    pub version: &'static str,
    pub folder: &'static str,
}

impl Peer {
    /// Runs `script` (in `benches/peers/`) with the JSON `input` and returns the printed lines.
    /// Creates the environment if it is missing.
    ///
    /// # Errors
    /// A message if Python or the index is not available, or if the script fails.
    pub fn measure(&self, script: &str, input: &str) -> Result<Vec<String>, String> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().map_err(|e| e.to_string())?;
        let folder = root.join("target").join(self.folder);
        let mut child = Command::new(self.python(&folder)?)
            .arg(root.join("benches/peers").join(script))
            // packages store their settings and caches here
            .current_dir(&folder)
            .env("HOME", &folder)
            .env("OMP_NUM_THREADS", "1")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| error.to_string())?;
        let mut pipe = child.stdin.take().ok_or("no standard input")?;
        let written = pipe.write_all(input.as_bytes());
        drop(pipe);
        let output = child.wait_with_output().map_err(|error| error.to_string())?;
        if !output.status.success() {
            return Err(format!("{script} ended with {}", output.status));
        }
        written.map_err(|error| error.to_string())?;
        Ok(String::from_utf8_lossy(&output.stdout).lines().map(str::to_owned).collect())
    }

    /// Returns the Python interpreter of the environment, with the package in the pinned
    /// version.
    fn python(&self, folder: &Path) -> Result<PathBuf, String> {
        let python = folder.join("bin/python");
        let run = |command: &mut Command| match command.stdout(Stdio::null()).status() {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => Err(format!("{command:?} ended with {status}")),
            Err(error) => Err(format!("{command:?}: {error}")),
        };
        let check =
            format!("from importlib.metadata import version as v; assert v('{}') == '{}'", self.package, self.version);
        if run(Command::new(&python).args(["-c", &check]).stderr(Stdio::null())).is_err() {
            run(Command::new("python3").args(["-m", "venv"]).arg(folder))?;
            let pinned = format!("{}=={}", self.package, self.version);
            run(Command::new(&python).args(["-m", "pip", "install", "--quiet", &pinned]))?;
        }
        Ok(python)
    }
}

/// Returns the number with `"key":` in a line of JSON.
pub fn number(line: &str, key: &str) -> Option<f64> {
    let rest = line.split_once(&format!("\"{key}\":"))?.1;
    rest.split([',', '}']).next()?.trim().parse().ok()
}
