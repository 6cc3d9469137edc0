//! A section of the report with its claims.

use stickslip_report::{Claim, Section, Verdict};

/// A claim with a short name for the terminal.
#[derive(Debug, Clone)]
pub struct Finding {
    /// Short name.
    pub name: &'static str,
    /// The claim.
    pub claim: Claim,
}

/// Creates a finding from a claim, its measured values and the verdict.
pub fn finding(name: &'static str, text: &str, measured: String, verdict: Verdict) -> Finding {
    Finding { name, claim: Claim { text: text.to_owned(), measured, verdict } }
}

/// A section of the report, with its claims still separate.
#[derive(Debug, Clone, Default)]
pub struct ReportPart {
    /// The section.
    pub section: Section,
    /// Claims of the section.
    pub findings: Vec<Finding>,
}
