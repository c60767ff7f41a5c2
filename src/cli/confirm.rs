//! The question before something is deleted.

use super::{CliError, output};
use std::io::{IsTerminal, Write};

/// `--yes`.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub struct ConfirmArgs {
    /// Do not ask before deleting; needed where no terminal is there to ask at
    #[arg(long)]
    pub yes: bool,
}

impl ConfirmArgs {
    /// Demands that the question can be asked, before anything is done.
    ///
    /// # Errors
    /// [`CliError::Usage`] without a terminal and without `--yes`.
    pub fn can_ask(self) -> Result<(), CliError> {
        if self.yes || (std::io::stdin().is_terminal() && std::io::stderr().is_terminal()) {
            return Ok(());
        }
        Err(CliError::Usage(
            "this deletes and there is no terminal to ask at; nothing was done, --yes deletes without a question"
                .to_owned(),
        ))
    }

    /// Asks at the terminal, unless `--yes` answers.
    ///
    /// # Errors
    /// [`CliError::Failed`] where the answer is not yes.
    pub fn ask(self, what: &str) -> Result<(), CliError> {
        if self.yes {
            return Ok(());
        }
        self.can_ask()?;
        output::note(format_args!("{what}? [y/N] "));
        std::io::stderr().flush()?;
        let mut answer = String::new();
        std::io::stdin().read_line(&mut answer)?;
        if ["y", "yes"].contains(&answer.trim().to_lowercase().as_str()) {
            Ok(())
        } else {
            Err(CliError::Failed("nothing was deleted".to_owned()))
        }
    }
}
