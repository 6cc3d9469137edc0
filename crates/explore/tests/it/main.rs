//! Tests of the explorer. One binary, so that linking is paid once.
//!
//! - `browser`: the page in Chromium;
//! - `chromium`: drives the browser;
//! - `fit`: fits to measured data;
//! - `latency`: times in the browser, on request;
//! - `live`: structures that stay in memory, and searches that stop;
//! - `load`: the server under load, on request;
//! - `server`: requests, limits and errors;
//! - `solid`: structures with a mesh.

mod browser;
mod chromium;
mod fit;
mod latency;
mod live;
mod load;
mod server;
mod solid;
