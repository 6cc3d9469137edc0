//! Tests of the readers and writers of matrix files. One binary, so that linking is paid once.
//!
//! - `conformance`: every format on every file of `tests/data`;
//! - `data_files`: measured data of real programs, and damaged files;
//! - `files`: files of real programs, to the last bit;
//! - `fuzz`: damaged files, and the memory that reading takes;
//! - `meshes`: meshes of other programs, and damaged ones;
//! - `properties`: random matrices, written and read.

mod conformance;
mod data_files;
mod files;
mod fuzz;
mod meshes;
mod properties;
