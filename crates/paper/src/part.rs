//! A section of the report and its claims, as the figures hand them over.

use stickslip_report::{Claim, Section, Verdict};

/// A claim with the short name that the terminal shows.
#[derive(Debug, Clone)]
pub struct Finding {
    /// The short name.
    pub name: &'static str,
    /// The claim.
    pub claim: Claim,
}

/// A claim, what was measured of it, and the verdict.
pub fn finding(name: &'static str, text: &str, measured: String, verdict: Verdict) -> Finding {
    Finding { name, claim: Claim { text: text.to_owned(), measured, verdict } }
}

/// A section of the report before its claims are handed over.
#[derive(Debug, Clone, Default)]
pub struct Part {
    /// The section.
    pub section: Section,
    /// Its claims.
    pub findings: Vec<Finding>,
}
