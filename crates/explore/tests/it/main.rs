//! Tests of the explorer. One binary, so that linking is paid once.
//!
//! - `browser`: the page in Chromium;
//! - `chromium`: drives the browser;
//! - `server`: requests, limits and errors.

mod browser;
mod chromium;
mod server;
