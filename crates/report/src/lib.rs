//! Files, figures and pages from the datasets of Stickslip.
//!
//! The input is a [`Dataset`]. The outputs are:
//! - tables (`*.csv`, `*.parquet`) and the record (`record.json`),
//! - static figures (`figure.svg`, `figure.png`) and an interactive figure (`figure.html`),
//! - motions of a mesh, for ParaView (`fields.pvd`) and as a page (`motion.html`),
//! - a summary for the terminal,
//! - a report page.
//!
//! This crate computes no mechanics. It uses neither the network nor the fonts of the machine.
//!
//! [`output::TABLE`] lists the outputs. A new output is a new file and one line in that table.
//!
//! # Example
//! ```no_run
//! use stickslip_report::{Outputs, write_dataset};
//! # use stickslip_study::dataset::Dataset;
//! # fn example(dataset: &Dataset) -> Result<(), stickslip_report::ReportError> {
//! let files = write_dataset(dataset, std::path::Path::new("results"), &Outputs::all())?;
//! println!("{} files", files.len());
//! # Ok(())
//! # }
//! ```
//!
//! # Use from another program
//! A program can compute the units of a study one by one or in ranges and keep the tables in
//! memory. A callback reports every finished point, and a flag stops the run at any point.
//! ```
//! use std::sync::Arc;
//! use std::sync::atomic::{AtomicUsize, Ordering};
//! use stickslip_study::{read_study, run::{Context, check, figure_of_tables}};
//!
//! let text = stickslip_study::templates::find("blade-couple").unwrap().study;
//! let study = read_study("couple.toml", text, &[("kt".into(), "12 N/mm".into())]).unwrap();
//! let checked = check(&study).unwrap();
//! let points = Arc::new(AtomicUsize::new(0));
//! let counter = points.clone();
//! let finished = Arc::new(move || _ = counter.fetch_add(1, Ordering::Relaxed));
//! let context = Context { finished, ..Context::without_progress(1) };
//! // `context.stop.store(true, …)` ends the run early
//! let mut block = checked.block(0..2, &context).unwrap();
//! block.append(checked.block(2..checked.units(), &context).unwrap());
//! assert_eq!(points.load(Ordering::Relaxed), 964);
//! let curve = &block.tables[0];
//! let unit = |column: usize| (curve.columns[column].name.as_str(), curve.columns[column].unit());
//! assert_eq!(unit(2), ("blade1_amplitude_m", Some("m".to_owned())));
//! let figure = figure_of_tables(checked.study(), &block.tables);
//! assert!(stickslip_report::svg::to_svg(&figure).starts_with("<svg"));
//! assert!(stickslip_report::html::to_html(&figure, "plotly.js").contains("plotly.js"));
//! ```

mod base64;
pub mod compare;
mod fields;
mod figure;
mod moving_surface;
pub mod output;
pub mod page;
mod run;
pub mod terminal;

#[cfg(test)]
mod samples;

pub use base64::base64;
pub use figure::{contact_picture::contact_picture, html, mesh_picture::mesh_picture, png, svg};
pub use moving_surface::moving_surface;
pub use output::folder::check_writable;
pub use output::result_file::{Output, ReportError, write_file};
pub use output::{Outputs, write_dataset};
pub use page::{Claim, Page, PageTable, Section, Verdict};
pub use run::{assemble, journal, stored, stream};
pub use stickslip_study::dataset::{Dataset, Figure};
