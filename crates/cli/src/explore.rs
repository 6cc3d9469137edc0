//! `stickslip explore`: a study in the browser.

use crate::browser;
use crate::exit_status::{Exit, print};
use crate::messages;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use stickslip_explore::{ExploreError, Server, Settings, Start};
use stickslip_study::templates;

/// Options of the explorer.
pub struct ExploreOptions {
    /// Port; 0 takes a free one.
    pub port: u16,
    /// Opening of the browser.
    pub open: OpenBrowser,
    /// Number of threads; all cores if absent.
    pub threads: Option<u16>,
}

/// Opening of the browser.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OpenBrowser {
    /// The browser shows the page.
    Yes,
    /// The address is printed only.
    No,
}

/// Runs `stickslip explore` until Ctrl-C.
pub fn explore(study: Option<&str>, options: &ExploreOptions) -> Exit {
    let start = match study.map(start_of).transpose() {
        Ok(start) => start.unwrap_or(Start::Gallery),
        Err(message) => {
            messages::error(&message);
            return Exit::WrongInput;
        }
    };
    let threads = match crate::run::pool(options.threads) {
        Ok(threads) => threads,
        Err(exit) => return exit,
    };
    let settings = Settings { folder: PathBuf::from("."), port: options.port, threads, ..Settings::new(start) };
    let server = match Server::start(settings) {
        Ok(server) => server,
        Err(ExploreError::Invalid(error)) => {
            crate::run::show(&error);
            return Exit::WrongInput;
        }
        Err(error @ ExploreError::Study(_)) => {
            messages::error(&error.to_string());
            return Exit::WrongInput;
        }
        Err(error) => return Exit::Failed(error.to_string()),
    };
    let (send, stopped) = mpsc::channel();
    // a program has one handler, and this is the first
    let _ = ctrlc::set_handler(move || _ = send.send(()));
    if let exit @ Exit::Failed(_) = print(&format!("explorer at {}  (Ctrl-C ends it)\n", server.address())) {
        return exit;
    }
    if options.open == OpenBrowser::Yes
        && let Err(message) = browser::show_address(server.address())
    {
        complain!("{message}");
    }
    // the handler owns the sender
    let _ = stopped.recv();
    drop(server);
    Exit::Done
}

/// Returns the file or the template that an argument names.
fn start_of(name: &str) -> Result<Start, String> {
    if Path::new(name).is_file() {
        return Ok(Start::File(PathBuf::from(name)));
    }
    if templates::find(name).is_some() {
        return Ok(Start::Template(name.to_owned()));
    }
    let hint =
        templates::suggest(name).map_or_else(String::new, |near| format!("; did you mean the template `{near}`?"));
    Err(format!("there is no study file and no template `{name}`{hint}"))
}
