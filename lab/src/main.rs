//! The `hgrid` command.

use std::io::Write as _;
use std::process::ExitCode;

use clap::Parser as _;
use hgrid_lab::cli::{Cli, Command, RenderArgs};
use hgrid_lab::{animate, compare, figures, pages, render, table};

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Some(Command::Render(args)) => render::run(&args),
        Some(Command::Table(args)) => table::run(&args),
        Some(Command::Figures(args)) => figures::run(&args),
        Some(Command::Animate(args)) => animate::run(&args),
        Some(Command::Compare(args)) => compare::run(&args),
        Some(Command::Report(args)) => pages::run(&args),
        Some(Command::FirstBuild(args)) => compare::first::run(&args),
        None => render::run(&RenderArgs::parse_from(["hgrid"])).and_then(|()| {
            let next = "next: hgrid render YOUR.ply, or hgrid render --help";
            Ok(writeln!(std::io::stdout(), "{next}")?)
        }),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
