//! `stickslip paper`: every figure of the paper, and its claims beside measured numbers.

use std::error::Error;
use std::path::Path;
use stickslip_study::run::Context;

/// How the job ended.
pub struct Outcome {
    /// What the terminal shows.
    pub summary: String,
    /// Points without a result.
    pub failed: u64,
}

/// Computes and writes everything.
pub fn paper(
    _out: &Path,
    _context: &Context<'_>,
    _say: &dyn Fn(&str),
) -> Result<Outcome, Box<dyn Error + Send + Sync>> {
    Err("not there yet".into())
}
