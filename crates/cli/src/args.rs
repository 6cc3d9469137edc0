//! Command-line arguments. The doc comments of the items are the help texts that users see.

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use stickslip_report::stream::Shard;

/// Compute the vibration of structures with dry-friction joints
#[derive(Debug, Parser)]
#[command(name = "stickslip", version, about, long_about = None, max_term_width = 100)]
#[command(after_help = "Exit status: 0 if all points converged; 3 if results were written but some points failed; 2 \
                  if the input is wrong and nothing was written; 1 for any other error.")]
pub struct Cli {
    /// The command to run.
    #[command(subcommand)]
    pub command: Command,
}

/// All commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Compute every figure of Pust, Pesek, Radolfova (2015) and check the paper's claims
    Paper {
        #[command(flatten)]
        destination: Destination,
        /// Open the report in the browser
        #[arg(long)]
        open: bool,
    },
    /// Run study files
    Run {
        /// Study files (TOML); `-` reads standard input
        #[arg(required = true)]
        files: Vec<PathBuf>,
        #[command(flatten)]
        destination: Destination,
        /// Set a parameter, for example --set Ft=3N (repeatable)
        #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
        set: Vec<(String, String)>,
        /// Use this method instead of the one in the file
        #[arg(long)]
        method: Option<String>,
        /// Memory limit of a run, for example 4GB; a study that needs more is refused [default:
        /// 2GB, or the free memory if that is less]
        #[arg(long, value_name = "SIZE", value_parser = bytes)]
        memory: Option<u64>,
        /// Write only these outputs: csv, parquet, json, fitted, vtk, motion, svg, png,
        /// html (comma-separated)
        #[arg(long, value_delimiter = ',')]
        only: Vec<String>,
        /// Also write these outputs: parquet
        #[arg(long, value_delimiter = ',')]
        also: Vec<String>,
        /// Print the results as JSON on standard output, one line per study
        #[arg(long)]
        json: bool,
        /// Open the figure in the browser
        #[arg(long)]
        open: bool,
        /// Run again whenever a file changes, until Ctrl-C
        #[arg(long)]
        watch: bool,
        /// Resume an unfinished run; start from the beginning if there is none
        #[arg(long, conflicts_with_all = ["restart", "watch"])]
        resume: bool,
        /// Discard an unfinished run and start from the beginning
        #[arg(long)]
        restart: bool,
        /// Compute only part N of OF, for example on another machine; `stickslip merge` joins
        /// the parts and takes the output options
        #[arg(long, value_name = "N/OF", conflicts_with_all = ["only", "also", "json", "open", "watch"])]
        shard: Option<Shard>,
        /// Progress display: a bar on a terminal, or one JSON object per line on standard error
        /// for programs
        #[arg(long, value_name = "HOW", default_value = "bar")]
        progress: Progress,
    },
    /// Merge the parts of a study that `run --shard` computed, and draw its figure
    Merge {
        /// Folders of the parts, or the folder that contains them
        #[arg(required = true, value_name = "DIR")]
        folders: Vec<PathBuf>,
        /// Folder of the results; the study gets a subfolder with its name
        #[arg(short, long, default_value = "stickslip-out")]
        out: PathBuf,
        /// Write only these outputs: csv, parquet, json, fitted, vtk, motion, svg, png,
        /// html (comma-separated)
        #[arg(long, value_delimiter = ',')]
        only: Vec<String>,
        /// Also write these outputs: parquet
        #[arg(long, value_delimiter = ',')]
        also: Vec<String>,
        /// Open the figure in the browser
        #[arg(long)]
        open: bool,
    },
    /// Check study files without running them
    Check {
        /// Study files (TOML); `-` reads standard input
        #[arg(required = true)]
        files: Vec<PathBuf>,
        /// Set a parameter, for example --set Ft=3N (repeatable)
        #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
        set: Vec<(String, String)>,
        /// Use this method instead of the one in the file
        #[arg(long)]
        method: Option<String>,
        /// Memory limit of a run, for example 4GB; a study that needs more is refused [default:
        /// 2GB, or the free memory if that is less]
        #[arg(long, value_name = "SIZE", value_parser = bytes)]
        memory: Option<u64>,
        /// Write a picture of the contacts of the mesh to this PNG file: their nodes, and those
        /// without a counterpart
        #[arg(long, value_name = "PNG")]
        picture: Option<PathBuf>,
    },
    /// Draw stored results again, or several runs in one figure with a table of their
    /// differences
    Plot {
        /// Folders of results, for example stickslip-out/couple
        #[arg(required = true)]
        folders: Vec<PathBuf>,
        /// Draw all runs in one figure and compare them with the first
        #[arg(long)]
        overlay: bool,
        /// Draw the figure with the [figure] settings of this study file; nothing is computed
        #[arg(long, value_name = "FILE")]
        study: Option<PathBuf>,
        /// Folder that gets the folder of the comparison [default: stickslip-out]
        #[arg(short, long, requires = "overlay")]
        out: Option<PathBuf>,
        /// Write only these outputs: svg, png, html; with --overlay also csv and json
        /// (comma-separated)
        #[arg(long, value_delimiter = ',')]
        only: Vec<String>,
        /// Open the figure in the browser
        #[arg(long)]
        open: bool,
    },
    /// Describe matrix files (size, entries, symmetry, definiteness, row names; for stiffness
    /// and mass also the lowest frequencies) and files of measured data (columns, units,
    /// sampling, ranges, a plot)
    Inspect {
        /// Files with matrices, with the names of their rows, with measured data, or with a mesh
        #[arg(required = true)]
        files: Vec<PathBuf>,
        /// Format of the files, if their content does not show it
        #[arg(long)]
        format: Option<String>,
        /// Write a picture of the mesh with its sets to this PNG file
        #[arg(long, value_name = "PNG")]
        picture: Option<PathBuf>,
    },
    /// Reduce the structure of a study and save the reduced matrices as input for other studies
    Reduce {
        /// Study file (TOML) with a [structure]
        file: PathBuf,
        /// Folder for the matrices and for the TOML tables that refer to them
        #[arg(short, long)]
        out: PathBuf,
        /// Set a parameter, for example --set zeta=1% (repeatable)
        #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
        set: Vec<(String, String)>,
    },
    /// Explore a study in the browser: move its parameters and see the curves follow
    Explore {
        /// Study file, or name of a template; default: a page with the templates and the study
        /// files of this folder
        #[arg(value_name = "STUDY")]
        study: Option<String>,
        /// Port of 127.0.0.1; default: a free one
        #[arg(long, default_value_t = 0, hide_default_value = true)]
        port: u16,
        /// Print the address and do not open the browser
        #[arg(long)]
        no_open: bool,
        /// Number of threads; default: all cores
        #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
        threads: Option<u16>,
    },
    /// Create a study file from a template
    New {
        /// Name of the template (see `stickslip list templates`)
        template: String,
        /// File to write, which must not exist; default: NAME.toml with the template's name;
        /// `-` writes to standard output
        file: Option<PathBuf>,
    },
    /// List laws, methods, templates, study kinds or outputs
    List {
        /// Table to list; default: all
        what: Option<ListTopic>,
    },
    /// Print the JSON Schema of study files for editors
    Schema,
    /// Print a shell completion script
    Completions {
        /// Name of the shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page (roff)
    #[command(hide = true)]
    Man,
}

/// Destination of the results, and number of threads.
#[derive(Debug, Args)]
pub struct Destination {
    /// Folder of the results; each study gets a subfolder with its name
    #[arg(short, long, default_value = "stickslip-out")]
    pub out: PathBuf,
    /// Number of threads; default: all cores. The results do not depend on it
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

/// Kind of progress display.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Progress {
    /// A bar, if standard error is a terminal
    Bar,
    /// One JSON object per line
    Json,
    /// No progress display
    None,
}

/// Tables that `list` can print.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum ListTopic {
    /// Friction laws
    Laws,
    /// Methods
    Methods,
    /// Model templates
    Templates,
    /// Study kinds
    Studies,
    /// Columns that the key `output` of a study adds to its tables
    Outputs,
}

fn assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim().to_owned(), value.trim().to_owned())),
        _ => Err(format!("expected NAME=VALUE, for example Ft=3N, found `{text}`")),
    }
}

/// Parses a number of bytes: `4GB`, `500 MB`.
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
