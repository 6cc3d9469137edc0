//! Runs on disk.
//!
//! - `journal`: a file of result blocks that survives an abort of the program.
//! - `stream`: runs that write a journal, can be resumed, and can be split into shards.
//! - `assemble`: makes the results from journals.
//! - `stored`: reads the results of a run from their folder.

pub mod assemble;
pub mod journal;
pub mod stored;
pub mod stream;
