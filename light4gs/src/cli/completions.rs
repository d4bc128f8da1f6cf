//! `completions`.

use clap::{Args, Command, CommandFactory};
use clap_complete::Shell;
use light4gs_train::error::TrainError;

use super::Cli;
use super::output::say;

#[derive(Debug, Args)]
pub(super) struct Completions {
    /// The shell that will read them.
    shell: Shell,
}

impl Completions {
    pub(super) fn run(self) -> Result<(), TrainError> {
        say(script(self.shell).trim_end())
    }
}

/// What completes the arguments of `light4gs` in a shell.
fn script(shell: Shell) -> String {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut shown(), "light4gs", &mut script);
    String::from_utf8(script).expect("names and help are UTF-8")
}

/// The command line without its hidden commands, which clap_complete would offer as well.
fn shown() -> Command {
    let whole = Cli::command();
    let commands = whole.get_subcommands().filter(|command| !command.is_hide_set()).cloned();
    Command::new("light4gs").version(env!("CARGO_PKG_VERSION")).subcommands(commands)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_of_help_is_completed_and_no_hidden_one() {
        let whole = Cli::command();
        assert!(whole.get_subcommands().any(|command| command.is_hide_set()), "nothing is hidden: test the rest alone");
        for shell in [Shell::Bash, Shell::Zsh, Shell::Fish, Shell::PowerShell, Shell::Elvish] {
            let script = script(shell);
            // `completions` is a variable in scripts for PowerShell and Elvish.
            for command in whole.get_subcommands().filter(|command| command.get_name() != "completions") {
                // As a word: `study` is a part of `study-task`.
                let of_name = |c: char| c.is_ascii_alphanumeric() || c == '-';
                let offered = script.split(|c| !of_name(c)).any(|word| word == command.get_name());
                assert_eq!(offered, !command.is_hide_set(), "{shell}: {}", command.get_name());
            }
        }
    }
}
