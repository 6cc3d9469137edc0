//! The server: one page on 127.0.0.1 and the requests of its script.
//!
//! - `access`: the token, and the checks against requests of other pages;
//! - `assets`: the files of the page, which are part of the program;
//! - `routes`: what every address answers;
//! - `runs`: runs of studies, of which the newest of a page wins;
//! - `connections`: accepts connections and limits them;
//! - `timed_stream`: a connection whose client must read.

mod access;
mod assets;
mod connections;
mod routes;
mod runs;
mod timed_stream;

pub use access::Embedding;

use crate::study::catalog::{self, Catalog, Named, Source};
use access::Access;
use routes::State;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;
use stickslip_study::StudyError;
use tokio::sync::oneshot;

/// Settings of a server.
#[derive(Debug, Clone)]
pub struct Settings {
    /// First view of the page.
    pub start: Start,
    /// Folder whose study files are offered.
    pub folder: PathBuf,
    /// Port; 0 takes a free one. Default 0.
    pub port: u16,
    /// Number of threads of a run, for its record.
    pub threads: usize,
    /// Pages that may contain the page in a frame. Default [`Embedding::Never`].
    pub embedding: Embedding,
    /// The token of an earlier server, so that its open pages continue. Default none: a random
    /// token.
    pub token: Option<String>,
}

impl Settings {
    /// Default settings: the gallery of the current folder on a free port.
    pub fn new(start: Start) -> Settings {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        Settings { start, folder: PathBuf::from("."), port: 0, threads, embedding: Embedding::Never, token: None }
    }
}

/// First view of the page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Start {
    /// The templates and the study files of the folder.
    Gallery,
    /// A template.
    Template(String),
    /// A study file.
    File(PathBuf),
    /// The text of a study, and the name of its file for messages and relative paths.
    Text(Source),
}

/// Why the explorer does not start.
#[derive(Debug, thiserror::Error)]
pub enum ExploreError {
    /// There is no such template or file.
    #[error("{0}")]
    Study(String),
    /// The file is not a study.
    #[error(transparent)]
    Invalid(Box<StudyError>),
    /// The port cannot be opened.
    #[error("port {port} of 127.0.0.1 cannot be opened: {cause}; choose another one with --port")]
    Port {
        /// The port.
        port: u16,
        /// The reason.
        cause: std::io::Error,
    },
    /// The operating system refuses a thread or random numbers.
    #[error("the server cannot start: {0}")]
    System(String),
}

/// A running server. It ends when it is dropped.
#[derive(Debug)]
pub struct Server {
    address: String,
    port: u16,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Starts a server.
    ///
    /// # Errors
    /// An [`ExploreError`]: the study does not exist or is wrong, or the port is taken.
    ///
    /// # Example
    /// ```
    /// use stickslip_explore::{Server, Settings, Start};
    /// let server = Server::start(Settings::new(Start::Template("blade-couple".into()))).unwrap();
    /// assert!(server.address().starts_with("http://127.0.0.1:"));
    /// assert!(Server::start(Settings::new(Start::Template("blade-coupel".into()))).is_err());
    /// ```
    pub fn start(settings: Settings) -> Result<Server, ExploreError> {
        let named = match &settings.start {
            Start::File(path) => Some(Named::File(path.clone())),
            Start::Text(source) => Some(Named::Text(source.clone())),
            Start::Gallery | Start::Template(_) => None,
        };
        let catalog = Catalog::new(&settings.folder, named);
        let first = match &settings.start {
            Start::Gallery => None,
            Start::Template(name) => Some(format!("template:{name}")),
            Start::File(_) | Start::Text(_) => catalog.named_id(),
        };
        if let Some(id) = &first {
            let source = catalog.source(id).map_err(ExploreError::Study)?;
            catalog::check(&source).map_err(|error| ExploreError::Invalid(Box::new(error)))?;
        }
        let port = settings.port;
        let listener = TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, port)))
            .and_then(|listener| listener.set_nonblocking(true).map(|()| listener))
            .map_err(|cause| ExploreError::Port { port, cause })?;
        let port = listener.local_addr().map_err(|cause| ExploreError::Port { port, cause })?.port();
        let access = match settings.token {
            // shorter ones could be guessed
            Some(token) if token.len() < 32 => {
                return Err(ExploreError::System("a token needs at least 32 characters".to_owned()));
            }
            Some(token) => Access::with_token(port, settings.embedding, token),
            None => Access::new(port, settings.embedding).map_err(ExploreError::System)?,
        };
        let address = access.address();
        let state = Arc::new(State::new(catalog, access, first, settings.threads));
        let (end, ended) = oneshot::channel();
        let serve = move || connections::serve(listener, state, ended);
        let thread = std::thread::Builder::new().name("explorer".to_owned()).spawn(serve);
        let thread = thread.map_err(|error| ExploreError::System(error.to_string()))?;
        Ok(Server { address, port, end: Some(end), thread: Some(thread) })
    }

    /// Returns the address of the page with its token.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Returns the port.
    pub fn port(&self) -> u16 {
        self.port
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // the receiver is gone if the server has already ended
        let _ = self.end.take().map(|end| end.send(()));
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
