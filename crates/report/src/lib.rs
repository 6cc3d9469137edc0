//! Files, figures and pages from the datasets of Stickslip.
//!
//! A [`Dataset`] goes in; tables (`*.csv`), the record (`record.json`), a figure (`figure.svg`, `figure.png`), an
//! interactive figure (`figure.html`), a text for the terminal or a whole report come out. Nothing here computes
//! mechanics, needs a network, or looks at the fonts of the machine.
//!
//! The outputs are listed in [`output::TABLE`]: a new one is a new file and one line there.
//!
//! # Example
//! ```no_run
//! use stickslip_report::{Outputs, write_dataset};
//! # fn example(dataset: &stickslip_study::dataset::Dataset) -> Result<(), stickslip_report::ReportError> {
//! let files = write_dataset(dataset, std::path::Path::new("results"), &Outputs::all())?;
//! println!("{} files", files.len());
//! # Ok(())
//! # }
//! ```

mod axis;
mod clip;
mod colour;
pub mod compare;
pub mod csv;
pub mod file;
pub mod folder;
mod font;
mod frame;
pub mod html;
pub mod json;
pub mod output;
pub mod page;
pub mod png;
pub mod stored;
pub mod svg;
pub mod terminal;

#[cfg(test)]
mod samples;

pub use file::{Output, ReportError, write_file};
pub use folder::check_writable;
pub use output::{Outputs, write_dataset};
pub use page::{Claim, Page, PageTable, Section, Verdict};
pub use stickslip_study::dataset::{Dataset, Figure};
