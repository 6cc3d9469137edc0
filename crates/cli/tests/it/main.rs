//! Tests of the command `stickslip`. One binary, so that linking is paid once.
//!
//! - `command_line`: exit status, files, messages and bits of the results;
//! - `explore`: the explorer as a command;
//! - `golden`: texts as users read them;
//! - `inspect_data`: measured data;
//! - `mesh_chapter`: the commands of the book's page on meshes;
//! - `plot`: figures from stored results, and comparisons of runs;
//! - `stream`: runs that are killed, sharded, or lose their disk.

mod command_line;
mod explore;
mod golden;
mod inspect_data;
mod mesh_chapter;
mod plot;
mod stream;
