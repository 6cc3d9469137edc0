//! Computes every figure of the paper and compares its claims with measured numbers.
//!
//! This is the command `stickslip paper`. The study files under `studies/paper/` run like any
//! other. One module per group of figures measures the results and compares them with the
//! paper's text. The module `verdict` contains the decision rules.
//!
//! Source: Pust, Pesek, Radolfova: Blade couple with dry friction connection, Applied and
//! Computational Mechanics 9 (2015) 31-40.

mod accuracy;
mod additional_cases;
mod finding;
mod loops;
mod measure;
mod optimum;
mod responses;
mod studies;
mod text;
mod verdict;

use additional_cases::AdditionalCases;
use finding::{Finding, ReportPart};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use stickslip_report::{Outputs, Page, ReportError, Section, Verdict, write_dataset};
use stickslip_study::StudyError;
use stickslip_study::run::{Context, run};
use studies::{FILES, Results, read};

/// Result of the command.
#[derive(Debug)]
pub struct Outcome {
    /// Text for the terminal.
    pub summary: String,
    /// Number of points without a result.
    pub failed: u64,
    /// Path of the page with figures and claims.
    pub report: PathBuf,
}

/// Reason why the figures cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PaperError {
    /// A study cannot run here, for example because it needs more memory than available.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A file cannot be written.
    #[error(transparent)]
    Report(#[from] ReportError),
}

/// Amount of computation, which tests reduce.
struct Effort {
    points: Option<usize>,
    outputs: Outputs,
}

/// Computes all figures of the paper and writes them with the report under `out`.
///
/// Each figure has a folder of results. The page `report.html` shows each figure with the
/// paper's claims, the measured numbers and a verdict. `say` receives one line per figure.
///
/// An interrupted run writes the finished figures and measures the complete ones.
///
/// # Errors
/// [`PaperError`] if a file cannot be written or a study cannot run here. Earlier figures stay.
///
/// # Example
/// ```no_run
/// use stickslip_study::run::Context;
/// let context = Context::without_progress(1);
/// let outcome = stickslip_paper::paper("out".as_ref(), &context, &|line| eprintln!("{line}"))?;
/// print!("{}", outcome.summary);
/// # Ok::<(), stickslip_paper::PaperError>(())
/// ```
pub fn paper(out: &Path, context: &Context, say: &dyn Fn(&str)) -> Result<Outcome, PaperError> {
    produce(out, context, say, &Effort { points: None, outputs: Outputs::defaults() })
}

fn produce(out: &Path, context: &Context, say: &dyn Fn(&str), effort: &Effort) -> Result<Outcome, PaperError> {
    let mut results = Results::default();
    for (name, _) in FILES {
        if context.stopped() {
            break;
        }
        let study = read(name, effort.points, &[])?;
        let dataset = run(&study, context)?;
        write_dataset(&dataset, out, &effort.outputs)?;
        let points: u64 = dataset.record.points.values().sum();
        let failed = dataset.failures.len();
        let failed = if failed > 0 { format!(", {failed} failed") } else { String::new() };
        say(&format!("{}: {points} points{failed}, {:.2} s", dataset.title, dataset.record.wall_time_s));
        results.insert(study, dataset);
    }
    say("Additional cases for the claims: other slip limits, contact stiffnesses, frequencies");
    let additional = AdditionalCases::new(context, effort.points);
    let parts: Vec<ReportPart> = [
        loops::exact(&results),
        loops::approximate(&results, &additional),
        loops::coulomb(&results),
        responses::figure6(&results, &additional),
        responses::figure7(&results, &additional),
        responses::dependence(&results, &additional),
        responses::figure8(&results),
        responses::figure10(&results),
        responses::optimum(&additional),
        responses::laws(&results),
        Some(accuracy::inferred_values(&additional)),
        Some(accuracy::error_measures(&results)),
    ]
    .into_iter()
    .flatten()
    .collect();
    // An interrupted run does not replace a complete report.
    let whole = out.join("report.html");
    let cut_short = context.stopped() && whole.exists();
    let report = if cut_short { out.join("report.interrupted.html") } else { whole };
    let summary = summary(&report, &parts, &results);
    page(parts).write(&report)?;
    Ok(Outcome { summary, failed: results.failed(), report })
}

fn page(parts: Vec<ReportPart>) -> Page {
    Page {
        title: "Blade couple with dry friction connection: figures and claims".to_owned(),
        introduction: vec![
            "Every figure of Pust, Pesek, Radolfova: Blade couple with dry friction connection, Applied and \
             Computational Mechanics 9 (2015) 31-40, computed again and compared with the claims of its text."
                .to_owned(),
            format!(
                "Every verdict follows from the measured number by a fixed rule. Two quantities are similar up \
                 to {:.0} %, approximately the same up to {:.0} %, and not similar beyond {:.0} %. A frequency \
                 matches within {} Hz, half the step in which the paper prints it. A claim about several cases \
                 needs all of them; it holds with a qualification if only some agree. Friction is exact Coulomb \
                 friction unless stated otherwise. The last sections compare the paper's arctangent law, and \
                 list the data that the paper does not state and that had to be inferred.",
                100.0 * verdict::SIMILAR,
                100.0 * verdict::APPROXIMATE,
                100.0 * verdict::DIFFERENT,
                verdict::PRINTED
            ),
        ],
        sections: parts
            .into_iter()
            .map(|part| Section { claims: part.findings.into_iter().map(|f| f.claim).collect(), ..part.section })
            .collect(),
    }
}

/// Returns the claims as text for the terminal.
fn summary(report: &Path, parts: &[ReportPart], results: &Results) -> String {
    let mut text = String::new();
    for part in parts.iter().filter(|part| !part.findings.is_empty()) {
        let _ = writeln!(text, "{}", part.section.heading);
        for Finding { name, claim } in &part.findings {
            let _ = writeln!(text, "  {name:<64} {}", claim.verdict.words());
        }
    }
    let claims: Vec<Verdict> = parts.iter().flat_map(|part| &part.findings).map(|f| f.claim.verdict).collect();
    let count = |verdict| claims.iter().filter(|v| **v == verdict).count();
    let _ = writeln!(
        text,
        "{} claims: {} hold, {} hold with a qualification, {} do not hold",
        claims.len(),
        count(Verdict::Holds),
        count(Verdict::HoldsWithQualification),
        count(Verdict::DoesNotHold)
    );
    for dataset in results.all().filter(|dataset| !dataset.failures.is_empty()) {
        let _ = writeln!(text, "{}: {} points failed, see record.json", dataset.name, dataset.failures.len());
    }
    let _ = writeln!(text, "{}", report.display());
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, atomic::AtomicBool};

    fn reduced(stop: bool) -> (tempfile::TempDir, Outcome) {
        let out = tempfile::tempdir().unwrap();
        let context = Context { stop: Arc::new(AtomicBool::new(stop)), ..Context::without_progress(1) };
        let effort = Effort { points: Some(25), outputs: Outputs::select(&["csv", "json", "svg"]).unwrap() };
        let outcome = produce(out.path(), &context, &|_| (), &effort).unwrap();
        (out, outcome)
    }

    #[test]
    fn the_job_writes_every_figure_and_the_report() {
        let (out, outcome) = reduced(false);
        assert_eq!(outcome.failed, 0, "{}", outcome.summary);
        for (name, _) in FILES {
            for file in ["record.json", "figure.svg"] {
                assert!(out.path().join(name).join(file).is_file(), "{name}/{file}");
            }
        }
        let report = std::fs::read_to_string(out.path().join("report.html")).unwrap();
        for heading in
            ["Fig. 2", "Figs. 3 and 4", "Fig. 6", "Fig. 7", "Fig. 8", "Fig. 10", "Data that the paper does not state"]
        {
            assert!(report.contains(&format!("<h2>{heading}")), "{heading}");
        }
        // A claim without readable numbers would be missing.
        assert!(
            outcome.summary.contains("28 claims:") && outcome.summary.contains("report.html"),
            "{}",
            outcome.summary
        );
    }

    #[test]
    fn a_job_stopped_at_once_leaves_a_report_without_claims() {
        let (out, outcome) = reduced(true);
        assert!(outcome.summary.contains("0 claims"), "{}", outcome.summary);
        assert!(out.path().join("report.html").is_file());
    }

    /// An interrupted run writes its report under a different name if a report exists.
    #[test]
    fn an_interrupted_job_does_not_replace_a_report() {
        let out = tempfile::tempdir().unwrap();
        let whole = out.path().join("report.html");
        std::fs::write(&whole, "whole").unwrap();
        let context = Context { stop: Arc::new(AtomicBool::new(true)), ..Context::without_progress(1) };
        let effort = Effort { points: Some(25), outputs: Outputs::select(&["json"]).unwrap() };
        let outcome = produce(out.path(), &context, &|_| (), &effort).unwrap();
        assert_eq!(std::fs::read_to_string(&whole).unwrap(), "whole");
        assert!(outcome.report.ends_with("report.interrupted.html") && outcome.report.is_file());
        assert!(outcome.summary.contains("report.interrupted.html"), "{}", outcome.summary);
    }
}
