//! `shapelex man` and `shapelex completions`: what shells and `man` want to know of the commands.

use super::parse::command;
use super::{CliError, output};
use clap_complete::Shell;
use std::path::PathBuf;

/// Arguments of `man`.
#[derive(Debug, clap::Args)]
pub struct ManArgs {
    /// Folder for a page per command, such as /usr/local/share/man/man1; without it the first page goes to stdout
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Arguments of `completions`.
#[derive(Debug, clap::Args)]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_enum, value_name = "SHELL")]
    pub shell: Shell,
}

/// Writes the manual.
///
/// # Errors
/// [`CliError::Failed`] where a page cannot be written.
pub fn man(args: &ManArgs, as_json: bool) -> Result<(), CliError> {
    let Some(dir) = &args.out else {
        let mut page = Vec::new();
        clap_mangen::Man::new(command()).render(&mut page)?;
        return output::bytes(&page);
    };
    std::fs::create_dir_all(dir).map_err(|error| CliError::at(dir, error))?;
    let command = command().disable_help_subcommand(true);
    let pages = pages(&command);
    clap_mangen::generate_to(command, dir).map_err(|error| CliError::at(dir, error))?;
    if as_json {
        output::json(&serde_json::json!({ "out": dir.display().to_string(), "pages": pages }))
    } else {
        output::line(&format!("{pages} pages in {}", dir.display()))
    }
}

/// Pages of a command and its subcommands.
fn pages(command: &clap::Command) -> usize {
    1 + command.get_subcommands().map(pages).sum::<usize>()
}

/// Writes a shell's completions to stdout.
///
/// # Errors
/// [`CliError::OutputClosed`] where nobody reads.
pub fn completions(args: &CompletionsArgs) -> Result<(), CliError> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command(), "shapelex", &mut script);
    output::bytes(&script)
}
