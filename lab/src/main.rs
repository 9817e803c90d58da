//! The `hgrid` command.

use std::env;
use std::io::{self, Write as _};
use std::process::ExitCode;

use hgrid_lab::cli::{Cli, Command};
use hgrid_lab::{animate, compare, figures, info, pack, pages, render, table, validate};

fn main() -> ExitCode {
    let cli = Cli::of_words(env::args_os().skip(1)).unwrap_or_else(|error| error.exit());
    let is_first_try = env::args_os().len() == 1;
    let result = match cli.command {
        Command::Render(args) => render::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Pack(args) => pack::run(&args),
        Command::Validate(args) => validate::run(&args),
        Command::Table(args) => args.race.check().and_then(|()| table::run(&args)),
        Command::Figures(args) => args.race.check().and_then(|()| figures::run(&args)),
        Command::Animate(args) => {
            args.tuning.check("--method", &[args.method]).and_then(|()| animate::run(&args))
        }
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
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Returns true if the reader of the output, such as `head`, has closed it.
fn is_closed_pipe(error: &anyhow::Error) -> bool {
    let mut causes = error.chain().filter_map(|cause| cause.downcast_ref::<io::Error>());
    causes.any(|cause| cause.kind() == io::ErrorKind::BrokenPipe)
}
