//! Tests of the library with large structures. One binary, so that linking is paid once.
//!
//! - `reduction`: reductions against dense solutions of small structures;
//! - `rings`: rings of many nodes.

mod reduction;
mod rings;
