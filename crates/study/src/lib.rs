//! Study files of Stickslip: what a TOML file asks for, read, checked and run.

pub mod dataset;
