//! How a command ends, and what it prints.

use std::io::Write;
use std::process::ExitCode;

/// How a command ends; the numbers are those of the exit status.
#[derive(Debug)]
pub enum Ending {
    /// All points converged.
    Done,
    /// Results are written, some points failed.
    SomeFailed,
    /// The input is wrong; nothing was written. The report has been printed.
    WrongInput,
    /// Anything else, in words.
    Failed(String),
}

impl Ending {
    /// The exit status.
    pub fn code(&self) -> ExitCode {
        match self {
            Ending::Done => ExitCode::SUCCESS,
            Ending::Failed(_) => ExitCode::from(1),
            Ending::WrongInput => ExitCode::from(2),
            Ending::SomeFailed => ExitCode::from(3),
        }
    }
}

/// Prints on standard output; a reader that has gone away (`| head`) is no error.
pub fn print(text: &str) -> Ending {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Ending::Failed(error.to_string()),
        _ => Ending::Done,
    }
}
