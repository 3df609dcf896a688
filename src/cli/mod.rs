//! The command line: one file per command, and what they share.

mod check;
mod compare;
mod console;
mod demo;
mod design;
mod diagnose;
mod diagnosis_options;
mod discover;
mod effects;
mod export;
mod fit;
mod history;
mod new;
mod progress;
mod report;
mod revise;
mod simulate;
mod splitting;
#[cfg(feature = "studio")]
mod studio;
mod values;

use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{Parser, Subcommand, ValueEnum};

use console::{Console, exit_code, options_for};
#[cfg(feature = "studio")]
pub use studio::served;

// Where the commands find what they share with the studio.
use crate::error::Result;
use crate::eval::Backend;
use crate::project::{self, ledger, measurements, memory, workspace};

/// Learns sparse Hamiltonians from measured trajectories.
#[derive(Parser)]
#[command(
    name = "leverrier",
    version,
    about,
    arg_required_else_help = true,
    max_term_width = 100,
    after_help = "A first session:\n  \
        leverrier new swings.csv            writes swings.ham, a first spec\n  \
        leverrier check swings.ham          what would be searched, and in which data\n  \
        leverrier fit swings.ham            learns, prints, and writes swings.model.json\n  \
        leverrier export swings.ham latex   the equations for a paper\n\n\
        `leverrier COMMAND --help` has examples of each command; `leverrier demo` shows it all.\n\
        Exit codes: 0 done, 1 failed, 2 wrong usage."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// How results are printed: for people or for programs (docs/formats.md).
    #[arg(long, global = true, value_enum, default_value_t = Format::Text, display_order = 900)]
    format: Format,
}

/// How results are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Text,
    Json,
}

#[derive(Subcommand)]
enum Command {
    New(new::Arguments),
    Check(check::Arguments),
    Fit(fit::Arguments),
    Compare(compare::Arguments),
    Diagnose(diagnose::Arguments),
    Design(design::Arguments),
    Discover(discover::Arguments),
    Add(revise::Add),
    Remove(revise::Remove),
    Undo(history::Undo),
    History(history::History),
    Effects(effects::Arguments),
    Simulate(simulate::Arguments),
    Export(export::Arguments),
    Report(report::Arguments),
    #[cfg(feature = "studio")]
    Studio(studio::Arguments),
    Demo(demo::Arguments),
}

/// Runs the command that the process was started with.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return misused(&error),
    };
    let console = Console::new(cli.format);
    match carry_out(cli.command, &console) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if console::is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            let error = match options_for(error.kind()) {
                Some(options) => error.with_remedy(options),
                None => error,
            };
            console.error(&error);
            ExitCode::from(exit_code(&error))
        }
    }
}

fn carry_out(command: Command, console: &Console) -> Result<()> {
    // An evaluator that does not exist is an error before anything is done.
    Backend::requested()?;
    match command {
        Command::New(arguments) => new::run(&arguments, console),
        Command::Check(arguments) => check::run(&arguments, console),
        Command::Fit(arguments) => fit::run(&arguments, console),
        Command::Compare(arguments) => compare::run(&arguments, console),
        Command::Diagnose(arguments) => diagnose::run(&arguments, console),
        Command::Design(arguments) => design::run(&arguments, console),
        Command::Discover(arguments) => discover::run(&arguments, console),
        Command::Add(arguments) => revise::add(&arguments, console),
        Command::Remove(arguments) => revise::remove(&arguments, console),
        Command::Undo(arguments) => history::undo(&arguments, console),
        Command::History(arguments) => history::history(&arguments, console),
        Command::Effects(arguments) => effects::run(&arguments, console),
        Command::Simulate(arguments) => simulate::run(&arguments, console),
        Command::Export(arguments) => export::run(&arguments, console),
        Command::Report(arguments) => report::run(&arguments, console),
        #[cfg(feature = "studio")]
        Command::Studio(arguments) => studio::run(&arguments, console),
        Command::Demo(arguments) => demo::run(&arguments, console),
    }
}

/// Help and version go to standard output; everything else is wrong usage.
fn misused(error: &clap::Error) -> ExitCode {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            // A closed pipe is no failure.
            let _ = error.print();
            return ExitCode::SUCCESS;
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let _ = error.print();
            return ExitCode::from(2);
        }
        _ => {}
    }
    // Nothing was parsed, so the choice of JSON must be found in the raw arguments.
    let arguments: Vec<String> =
        std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
    let json = arguments.windows(2).any(|pair| pair == ["--format", "json"])
        || arguments.iter().any(|word| word == "--format=json");
    if json {
        let text = error.render().to_string();
        let text = text.strip_prefix("error: ").unwrap_or(&text);
        let (message, hint) = text.split_once("\n\n").unwrap_or((text, ""));
        let error = console::usage(message.trim(), hint.trim());
        Console::new(Format::Json).error(&error);
    } else {
        let _ = error.print();
    }
    ExitCode::from(2)
}
