//! Tests of the outputs. One binary, so that linking is paid once.
//!
//! - `gallery`: the studies of the gallery, their page and their pictures.

mod gallery;
