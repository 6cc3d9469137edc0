//! Writes `fitted.toml`: the study file with the values that an identification found.

use crate::output::result_file::{File, Output, ReportError};
use stickslip_study::dataset::Dataset;
use stickslip_study::results::fitted_study;

/// The output `fitted`.
pub const OUTPUT: Output = Output {
    name: "fitted",
    summary: "fitted.toml: the study with identified values, for the folder of the study",
    make: files,
    sink: None,
    is_default: true,
};

fn files(dataset: &Dataset) -> Result<Vec<File>, ReportError> {
    Ok(fitted_study(dataset).map(|text| File::new("fitted.toml", text)).into_iter().collect())
}
