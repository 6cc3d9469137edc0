//! Exit status of a command, and printing on standard output.

use std::io::Write;
use std::process::ExitCode;

/// Result of a command, which determines the exit status.
#[derive(Debug)]
pub enum Ending {
    /// All points converged.
    Done,
    /// Results were written, but some points failed.
    SomeFailed,
    /// The input is wrong and nothing was written. The error has been printed.
    WrongInput,
    /// Any other failure, as text.
    Failed(String),
}

impl Ending {
    /// Returns the exit status.
    pub fn code(&self) -> ExitCode {
        match self {
            Ending::Done => ExitCode::SUCCESS,
            Ending::Failed(_) => ExitCode::from(1),
            Ending::WrongInput => ExitCode::from(2),
            Ending::SomeFailed => ExitCode::from(3),
        }
    }
}

/// Prints on standard output. A closed pipe (`| head`) is not an error.
pub fn print(text: &str) -> Ending {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Ending::Failed(error.to_string()),
        _ => Ending::Done,
    }
}
