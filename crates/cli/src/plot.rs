//! `stickslip plot`: draws stored results and comparisons of runs. It computes no points.

use crate::exit_status::{Exit, print};
use crate::run::{outputs, show, show_figure};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use stickslip_report::compare;
use stickslip_report::stored::{Stored, StoredError, read};
use stickslip_report::{Outputs, terminal::Terminal};
use stickslip_study::read_file;

/// Options of the command.
pub struct PlotOptions<'a> {
    /// `--overlay`.
    pub overlay: bool,
    /// `--study`.
    pub study: Option<&'a Path>,
    /// `--out`.
    pub out: Option<&'a Path>,
    /// `--only`.
    pub only: &'a [String],
    /// `--open`.
    pub open: bool,
}

/// Runs `stickslip plot`.
pub fn plot(folders: &[PathBuf], options: &PlotOptions<'_>) -> Exit {
    let outputs = match outputs(options.only, &[]) {
        Ok(outputs) => outputs,
        Err(exit) => return exit,
    };
    let mut runs = Vec::new();
    let mut wrong = false;
    // All results are read before anything is written.
    for folder in folders {
        match read(folder).map_err(Some).and_then(|run| with_figure_of(run, options.study).map_err(|()| None)) {
            Ok(run) => runs.push(run),
            Err(error) => {
                match error {
                    // The location in the recorded study helps the user.
                    Some(StoredError::Study { path, cause }) => {
                        complain!("error: {}: cannot read the study in this record", path.display());
                        show(&cause);
                    }
                    Some(error) => complain!("error: {error}"),
                    None => {}
                }
                wrong = true;
            }
        }
    }
    if wrong {
        return Exit::WrongInput;
    }
    for run in runs.iter().filter(|run| run.dataset.record.interrupted) {
        complain!(
            "warning: {}: the run was interrupted; the figure shows only the points finished before the interruption",
            run.folder.display()
        );
    }
    if options.overlay { overlay(&runs, options, &outputs) } else { each(&runs, options, &outputs) }
}

/// Applies the figure settings of the study file, if given. Errors have been printed.
fn with_figure_of(mut run: Stored, file: Option<&Path>) -> Result<Stored, ()> {
    let Some(file) = file else { return Ok(run) };
    let study = read_file(file, &run.overrides()).map_err(|error| show(&error))?;
    // The run may have taken its method from the command line.
    let study = match run.study.case(0).map(|case| study.clone().with_method(&case.method.name)) {
        Ok(Ok(study)) => study,
        _ => study,
    };
    if study.kind().name != run.dataset.kind {
        complain!(
            "error: {} is a study of the kind `{}`, but {} contains results of the kind `{}`: give the file of this \
             run",
            file.display(),
            study.kind().name,
            run.folder.display(),
            run.dataset.kind
        );
        return Err(());
    }
    if study.wants_references() && !run.study.wants_references() && run.dataset.kind == "response" {
        complain!(
            "warning: {} contains no reference curves; run the study again to compute them",
            run.folder.display()
        );
    }
    if !run.apply_figure_of(&study) {
        complain!(
            "warning: {} differs from the run in more than its figure; the figure shows the results stored in {}. \
             Run the study again to compute the other changes",
            file.display(),
            run.folder.display()
        );
    }
    Ok(run)
}

/// Draws every run in its folder.
fn each(runs: &[Stored], options: &PlotOptions<'_>, outputs: &Outputs) -> Exit {
    for run in runs {
        if run.dataset.figure.panels.is_empty() {
            complain!("warning: {}: the results contain nothing to draw", run.folder.display());
        }
        let files = match run.write_figure(outputs) {
            Ok(files) => files,
            Err(error) => return Exit::Failed(error.to_string()),
        };
        if std::io::stdout().is_terminal()
            && let exit @ Exit::Failed(_) = print(&Terminal::default().files(&files))
        {
            return exit;
        }
        if options.open {
            show_figure(&files);
        }
    }
    Exit::Done
}

/// Draws all runs in one figure, and prints their differences.
fn overlay(runs: &[Stored], options: &PlotOptions<'_>, outputs: &Outputs) -> Exit {
    let comparison = match compare::compare(runs) {
        Ok(comparison) => comparison,
        Err(error) => {
            complain!("error: {error}");
            return Exit::WrongInput;
        }
    };
    let out = options.out.unwrap_or(Path::new("stickslip-out"));
    let files = match compare::write(&comparison, out, outputs) {
        Ok(files) => files,
        Err(error) => return Exit::Failed(error.to_string()),
    };
    let colour = std::io::stdout().is_terminal();
    let width = terminal_size::terminal_size().filter(|_| colour).map(|(width, _)| usize::from(width.0));
    let exit = print(&Terminal { colour, width }.text(&compare::for_terminal(&comparison), &files));
    if options.open {
        show_figure(&files);
    }
    exit
}
