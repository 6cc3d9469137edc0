//! `stickslip merge`: merges the parts of a study.

use crate::exit_status::Exit;
use crate::run;
use std::path::{Path, PathBuf};
use stickslip_report::assemble::{Parts, assemble};
use stickslip_report::stored::study_of;
use stickslip_report::{check_writable, stream};

/// Options of the command.
pub struct MergeOptions<'a> {
    /// `--only`.
    pub only: &'a [String],
    /// `--also`.
    pub also: &'a [String],
    /// `--open`.
    pub open: bool,
}

/// Merges the parts into `out/NAME/`.
pub fn merge(folders: &[PathBuf], out: &Path, options: &MergeOptions<'_>) -> Exit {
    let outputs = match run::outputs(options.only, options.also) {
        Ok(outputs) => outputs,
        Err(exit) => return exit,
    };
    let wrong = |message: String| {
        crate::messages::error(&message);
        Exit::WrongInput
    };
    let journals = match stream::read_parts(folders) {
        Ok(journals) => journals,
        Err(error) => return wrong(error.to_string()),
    };
    let Some(first) = journals.first() else {
        return wrong(
            "nothing to merge: the folders contain no parts; give the folders that `stickslip run --shard` wrote"
                .to_owned(),
        );
    };
    let mut outline = first.head().outline.clone();
    // The wall time includes those of all parts and of their checks.
    outline.record.wall_time_s = journals.iter().map(|journal| journal.head().outline.record.wall_time_s).sum();
    let study = match study_of(&outline.record.study, first.folder()) {
        Ok(study) => study,
        Err(error) => return wrong(error.to_string()),
    };
    let folder = out.join(&outline.name);
    if let Err(error) = check_writable(&folder) {
        return Exit::Failed(error.to_string());
    }
    let staging = out.join(format!("{}.merging.{}", outline.name, std::process::id()));
    let parts = Parts { outline: &outline, journals: &journals, unjournaled: &[] };
    match assemble(&parts, &study, &outputs, out, &staging) {
        Err(error) => Exit::Failed(error.to_string()),
        Ok(assembled) => run::report(&assembled, &[], run::Display { json: false, open: options.open }),
    }
}
