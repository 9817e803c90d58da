//! The `hgrid` command.

use std::env;
use std::io::{self, Write as _};
use std::process::ExitCode;

use hgrid_lab::cli::{Cli, Command};
use hgrid_lab::{animate, compare, figures, info, notices, pack, pages, render, table, validate};

fn main() -> ExitCode {
    let cli = match Cli::of_words(env::args_os().skip(1)) {
        Ok(cli) => cli,
        Err(error) => return printed(&error),
    };
    let is_first_try = env::args_os().len() == 1;
    let result = match cli.command {
        Command::Render(args) => render::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Pack(args) => pack::run(&args),
        Command::Validate(args) => validate::run(&args),
        Command::Table(args) => table::run(&args),
        Command::Figures(args) => figures::run(&args),
        Command::Animate(args) => animate::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Report(args) => pages::run(&args),
        Command::FirstBuild(args) => compare::first::run(&args),
    };
    match result {
        Ok(()) => {
            if is_first_try {
                let _ = writeln!(io::stdout(), "next: hgrid YOUR.ply, or hgrid --help");
            }
            ExitCode::SUCCESS
        }
        Err(error) if is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            notices::say(&format!("error: {}", message(&error)));
            ExitCode::FAILURE
        }
    }
}

/// Prints help, the version or what is wrong with the words, and returns the status.
fn printed(words: &clap::Error) -> ExitCode {
    // Not `exit` of the error, which reports success even if there is no room for the help.
    match words.print().map_err(anyhow::Error::new) {
        Err(error) if !words.use_stderr() && !is_closed_pipe(&error) => {
            notices::say(&format!("error: {}", message(&error)));
            ExitCode::FAILURE
        }
        _ => u8::try_from(words.exit_code()).map_or(ExitCode::FAILURE, ExitCode::from),
    }
}

/// Returns the error of standard output, if it is one: those of files have the names of these around them.
fn of_output(error: &anyhow::Error) -> Option<&io::Error> {
    error.chain().next()?.downcast_ref()
}

/// Returns the message of an error. Files have their names in it, and standard output gets one.
fn message(error: &anyhow::Error) -> String {
    let output = of_output(error).map_or("", |_| "cannot write to standard output: ");
    format!("{output}{error:#}")
}

/// Returns true if the reader of the output, such as `head`, has closed it. A file that is a pipe is not the output.
fn is_closed_pipe(error: &anyhow::Error) -> bool {
    of_output(error).is_some_and(|cause| cause.kind() == io::ErrorKind::BrokenPipe)
}
