//! The `stickslip` command.

/// Prints a message on standard error; see [`messages`].
macro_rules! complain {
    ($($text:tt)*) => {
        $crate::messages::message(&format!($($text)*))
    };
}

mod args;
mod browser;
mod exit_status;
mod explore;
mod inspect;
mod inspect_data;
mod list;
mod merge;
mod messages;
mod plot;
mod progress;
mod reduce;
mod run;

use args::{Cli, Command};
use clap::{CommandFactory, Parser};
use exit_status::{Exit, print};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use stickslip_report::stream::StartMode;
use stickslip_study::templates;

fn main() -> ExitCode {
    let cli = Cli::parse();
    let exit = match cli.command {
        Command::Paper { destination, open } => run::paper(&destination, open),
        Command::Run {
            files,
            destination,
            set,
            method,
            memory,
            only,
            also,
            json,
            open,
            watch,
            resume,
            restart,
            shard,
            progress,
        } => {
            let request = run::Request { files: &files, set: &set, method: method.as_deref(), memory };
            let start = match (resume, restart || watch) {
                (true, _) => StartMode::Resume,
                (false, true) => StartMode::Restart,
                (false, false) => StartMode::First,
            };
            run::run(
                &request,
                &destination,
                &run::RunOptions { only: &only, also: &also, json, open, watch, start, shard, progress },
            )
        }
        Command::Merge { folders, out, only, also, open } => {
            merge::merge(&folders, &out, &merge::MergeOptions { only: &only, also: &also, open })
        }
        Command::Check { files, set, method, memory, picture } => run::check(
            &run::Request { files: &files, set: &set, method: method.as_deref(), memory },
            picture.as_deref(),
        ),
        Command::Plot { folders, overlay, study, out, only, open } => {
            let study = study.as_deref();
            plot::plot(&folders, &plot::PlotOptions { overlay, study, out: out.as_deref(), only: &only, open })
        }
        Command::Inspect { files, format, picture } => inspect::inspect(&files, format.as_deref(), picture.as_deref()),
        Command::Reduce { file, out, set } => reduce::reduce(&file, &set, &out),
        Command::Explore { study, port, no_open, threads } => {
            let open = if no_open { explore::OpenBrowser::No } else { explore::OpenBrowser::Yes };
            explore::explore(study.as_deref(), &explore::ExploreOptions { port, open, threads })
        }
        Command::New { template, file } => new(&template, file.as_deref()),
        Command::List { what } => print(&list::text(what)),
        Command::Schema => match serde_json::to_string_pretty(&stickslip_study::schema::json_schema()) {
            Ok(text) => print(&(text + "\n")),
            Err(error) => Exit::Failed(error.to_string()),
        },
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), "stickslip", &mut script);
            print(&String::from_utf8_lossy(&script))
        }
        Command::Man => {
            let mut page = Vec::new();
            match clap_mangen::Man::new(Cli::command()).render(&mut page) {
                Ok(()) => print(&String::from_utf8_lossy(&page)),
                Err(error) => Exit::Failed(error.to_string()),
            }
        }
    };
    if let Exit::Failed(message) = &exit {
        messages::error(message);
    }
    exit.code()
}

/// `stickslip new`: writes the study of a template to a file. The file name `-` prints the
/// study.
fn new(name: &str, file: Option<&Path>) -> Exit {
    let Some(template) = templates::find(name) else {
        let meant = templates::suggest(name).map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"));
        let names: Vec<&str> = templates::TABLE.iter().map(|t| t.name).collect();
        complain!("error: unknown template `{name}`{meant}; the templates are {}", names.join(", "));
        return Exit::WrongInput;
    };
    let own = PathBuf::from(format!("{name}.toml"));
    let file = file.unwrap_or(&own);
    if file == Path::new("-") {
        return print(template.study);
    }
    let written = std::fs::OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(file)
        .and_then(|mut f| f.write_all(template.study.as_bytes()));
    match written {
        Ok(()) => {
            complain!("wrote {}; run it with `stickslip run {}`", file.display(), file.display());
            Exit::Done
        }
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
            complain!(
                "error: {} already exists and is unchanged; give another file name, as in `stickslip new {name} \
                 other.toml`, or `-` to print the study",
                file.display()
            );
            Exit::WrongInput
        }
        Err(error) => Exit::Failed(format!("{}: {error}", file.display())),
    }
}
