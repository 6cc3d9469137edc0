//! The command line: what can be typed.

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use stickslip_report::stream::Shard;

/// How structures with dry-friction joints vibrate.
#[derive(Debug, Parser)]
#[command(name = "stickslip", version, about, long_about = None, max_term_width = 100)]
#[command(
    after_help = "Exit status: 0 all points converged; 3 results written, some points failed; 2 the input is wrong, nothing \
                        written; 1 anything else."
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Compute every figure of Pust, Pesek, Radolfova (2015) and check the paper's claims
    Paper {
        #[command(flatten)]
        destination: Destination,
        /// Show the report in the browser
        #[arg(long)]
        open: bool,
    },
    /// Run study files
    Run {
        /// Study files (TOML); `-` is standard input
        #[arg(required = true)]
        files: Vec<PathBuf>,
        #[command(flatten)]
        destination: Destination,
        /// Change a parameter, for example --set Ft=3N (may be given several times)
        #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
        set: Vec<(String, String)>,
        /// Use this method instead of the file's
        #[arg(long)]
        method: Option<String>,
        /// Memory that a run may take, for example 4GB; a study that needs more is refused [default: 2GB, or what is free]
        #[arg(long, value_name = "SIZE", value_parser = bytes)]
        memory: Option<u64>,
        /// Write only these outputs: csv, parquet, json, svg, png, html (comma between them)
        #[arg(long, value_delimiter = ',')]
        only: Vec<String>,
        /// Write these outputs too: parquet
        #[arg(long, value_delimiter = ',')]
        also: Vec<String>,
        /// Print the results as JSON on standard output, one line per study
        #[arg(long)]
        json: bool,
        /// Show the figure in the browser
        #[arg(long)]
        open: bool,
        /// Run again whenever a file changes, until Ctrl-C
        #[arg(long)]
        watch: bool,
        /// Go on where a run that did not end has stopped; begin anew if there is none
        #[arg(long, conflicts_with_all = ["restart", "watch"])]
        resume: bool,
        /// Throw away what a long run that did not end has kept
        #[arg(long)]
        restart: bool,
        /// Compute one part of so many, on as many machines as you like; `stickslip merge` joins them, and takes what outputs there are to be
        #[arg(long, value_name = "N/OF", conflicts_with_all = ["only", "also", "json", "open", "watch"])]
        shard: Option<Shard>,
        /// How progress is shown: a bar on a terminal, or for programs one JSON object a line on standard error
        #[arg(long, value_name = "HOW", default_value = "bar")]
        progress: Progress,
    },
    /// Join the parts of a study that `run --shard` has computed, and draw its figure
    Merge {
        /// Folders of the parts, or the folder in which they are
        #[arg(required = true, value_name = "DIR")]
        folders: Vec<PathBuf>,
        /// Folder of the results; the study gets a folder of its name in it
        #[arg(long, default_value = "stickslip-out")]
        out: PathBuf,
        /// Write only these outputs: csv, parquet, json, svg, png, html (comma between them)
        #[arg(long, value_delimiter = ',')]
        only: Vec<String>,
        /// Write these outputs too: parquet
        #[arg(long, value_delimiter = ',')]
        also: Vec<String>,
        /// Show the figure in the browser
        #[arg(long)]
        open: bool,
    },
    /// Check study files without running them
    Check {
        /// Study files (TOML); `-` is standard input
        #[arg(required = true)]
        files: Vec<PathBuf>,
        /// Change a parameter, for example --set Ft=3N (may be given several times)
        #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
        set: Vec<(String, String)>,
        /// Use this method instead of the file's
        #[arg(long)]
        method: Option<String>,
        /// Memory that a run may take, for example 4GB; a study that needs more is refused [default: 2GB, or what is free]
        #[arg(long, value_name = "SIZE", value_parser = bytes)]
        memory: Option<u64>,
    },
    /// Draw stored results again, or several runs in one figure with a table of their differences
    Plot {
        /// Folders of results, for example stickslip-out/couple
        #[arg(required = true)]
        folders: Vec<PathBuf>,
        /// Draw all runs in one figure and compare them with the first
        #[arg(long)]
        overlay: bool,
        /// Draw as this study file says in its [figure]; nothing is computed
        #[arg(long, value_name = "FILE")]
        study: Option<PathBuf>,
        /// Where the folder of the comparison goes [default: stickslip-out]
        #[arg(long, requires = "overlay")]
        out: Option<PathBuf>,
        /// Write only these: svg, png, html; with --overlay csv and json too (comma between them)
        #[arg(long, value_delimiter = ',')]
        only: Vec<String>,
        /// Show the figure in the browser
        #[arg(long)]
        open: bool,
    },
    /// Say what is in files of matrices: size, entries, symmetry, definiteness, names; of a pair the lowest frequencies
    Inspect {
        /// Files of matrices, and of the names of their rows
        #[arg(required = true)]
        files: Vec<PathBuf>,
        /// Their format, if it is not seen from their content
        #[arg(long)]
        format: Option<String>,
    },
    /// Save the structure of a study in few coordinates, to be read instead of the whole
    Reduce {
        /// Study file (TOML) with a [structure]
        file: PathBuf,
        /// Folder for the matrices and the tables that name them
        #[arg(long)]
        out: PathBuf,
        /// Change a parameter, for example --set zeta=1% (may be given several times)
        #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
        set: Vec<(String, String)>,
    },
    /// Start a study file from a template
    New {
        /// Template (see `stickslip list templates`)
        template: String,
        /// File to write, none that is there already; NAME.toml of the template when absent, `-` is standard output
        file: Option<PathBuf>,
    },
    /// List what there is
    List {
        /// What to list; everything when absent
        what: Option<What>,
    },
    /// Print the JSON Schema of study files, for editors
    Schema,
    /// Print a completion script
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page (roff)
    #[command(hide = true)]
    Man,
}

/// Where results go and how many threads compute them.
#[derive(Debug, Args)]
pub struct Destination {
    /// Folder of the results; each study gets a folder of its name in it
    #[arg(long, default_value = "stickslip-out")]
    pub out: PathBuf,
    /// Threads; all cores when absent. Results do not depend on it
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Progress {
    /// A bar, if standard error is a terminal
    Bar,
    /// One JSON object a line
    Json,
    /// Nothing
    None,
}

/// What `list` lists.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum What {
    /// Friction laws
    Laws,
    /// Methods
    Methods,
    /// Model templates
    Templates,
    /// Study kinds
    Studies,
    /// What `output` of a study can ask for
    Outputs,
}

fn assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim().to_owned(), value.trim().to_owned())),
        _ => Err(format!("expected NAME=VALUE, for example Ft=3N, found `{text}`")),
    }
}

/// A number of bytes: `4GB`, `500 MB`.
fn bytes(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let end = text.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    let power = match unit.trim().to_ascii_lowercase().as_str() {
        "b" | "" => 0,
        "k" | "kb" => 3,
        "m" | "mb" => 6,
        "g" | "gb" => 9,
        "t" | "tb" => 12,
        _ => return Err(format!("expected a size such as 4GB or 500MB, found `{text}`")),
    };
    match number.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok((value * 10f64.powi(power)) as u64),
        _ => Err(format!("expected a size such as 4GB or 500MB, found `{text}`")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units() {
        assert_eq!([bytes("4GB"), bytes("0.5 mb"), bytes("123")], [Ok(4_000_000_000), Ok(500_000), Ok(123)]);
        assert!(["", "GB", "-1GB", "4 apples", "0", "1.2.3GB"].iter().all(|text| bytes(text).is_err()));
    }
}
