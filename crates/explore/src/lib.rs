//! The explorer: a study in the browser, computed again while its parameters move.
//!
//! [`Server::start`] serves one page on 127.0.0.1. The page changes quantities of a study file;
//! the server applies the changes to the text of the file, reads it like any other study, runs
//! it and returns its figure. The text on the screen is therefore a study file that gives the
//! same numbers.
//!
//! - `server`: connections, access, routes, and runs of which the newest wins;
//! - `study`: the quantities of a study file, changes of its text, and the answers of a run;
//! - `client/`: the page, as ES modules without a build step.

mod server;
mod study;

pub use server::{Embedding, ExploreError, Server, Settings, Start};
pub use study::{answer, catalog, change, fit, quantities, response_quantity, view};
