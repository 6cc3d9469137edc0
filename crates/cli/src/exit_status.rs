//! Exit status of a command, and printing on standard output.

use std::io::Write;
use std::process::ExitCode;

/// Result of a command, which determines the exit status.
#[derive(Debug)]
pub enum Exit {
    /// All points converged.
    Done,
    /// Results were written, but some points failed.
    SomeFailed,
    /// The input is wrong and nothing was written. The error has been printed.
    WrongInput,
    /// Any other failure, as text.
    Failed(String),
}

impl Exit {
    /// Returns the exit status.
    pub fn code(&self) -> ExitCode {
        match self {
            Exit::Done => ExitCode::SUCCESS,
            Exit::Failed(_) => ExitCode::from(1),
            Exit::WrongInput => ExitCode::from(2),
            Exit::SomeFailed => ExitCode::from(3),
        }
    }
}

/// Prints on standard output. A closed pipe (`| head`) is not an error.
pub fn print(text: &str) -> Exit {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Exit::Failed(error.to_string()),
        _ => Exit::Done,
    }
}
