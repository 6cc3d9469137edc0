//! Tests of study files: read, checked, run. One binary, so that linking is paid once.
//!
//! - `bad_studies`: files that must be refused;
//! - `bodies`: rigid bodies;
//! - `book`: the generated parts and the studies of the book;
//! - `continuation`: performance curves, nonlinear modes and branches;
//! - `dampers`: templates of dampers against closed forms;
//! - `disks`: bladed disks;
//! - `file_formats`: matrices in the formats of other programs;
//! - `good_studies`: files that must be read, and their contents;
//! - `identify`: parameters identified from made data;
//! - `incomplete_models`: random studies with absent parts;
//! - `initial_states`: transients that begin with held places;
//! - `key_examples`: the example of every key;
//! - `laws_and_kinds`: every law in every study kind;
//! - `nodes`: nodes with several directions;
//! - `random`: generator of random studies;
//! - `random_studies`: random studies of every kind;
//! - `records`: forces and motions from records;
//! - `repetition`: repeated entries;
//! - `reported_values`: small studies against values from Python;
//! - `responses`: results of a response against closed forms;
//! - `results`: results as typed values;
//! - `structure`: structures given by matrices;
//! - `summary`: the summary of a study before it runs.

mod bad_studies;
mod bodies;
mod book;
mod continuation;
mod dampers;
mod disks;
mod file_formats;
mod good_studies;
mod identify;
mod incomplete_models;
mod initial_states;
mod key_examples;
mod laws_and_kinds;
mod nodes;
mod random;
mod random_studies;
mod records;
mod repetition;
mod reported_values;
mod responses;
mod results;
mod structure;
mod summary;
