//! `man`.

use std::fs;
use std::path::PathBuf;

use clap::{Args, CommandFactory};
use light4gs_data::DataError;
use light4gs_train::error::TrainError;

use super::Cli;

#[derive(Debug, Args)]
pub(super) struct Man {
    /// Folder for the pages, as share/man/man1; it is made.
    #[arg(long)]
    out: PathBuf,
}

impl Man {
    pub(super) fn run(self) -> Result<(), TrainError> {
        fs::create_dir_all(&self.out).map_err(DataError::io("create", &self.out))?;
        clap_mangen::generate_to(Cli::command(), &self.out).map_err(DataError::io("write pages to", &self.out))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use clap_markdown::{MarkdownOptions, help_markdown_command_custom};

    use super::*;

    /// Set, the test of docs/cli.md writes it instead of comparing it.
    const WRITE: &str = "LIGHT4GS_WRITE_CLI";

    #[test]
    fn the_page_of_all_commands_is_what_help_says() {
        const BEGIN: &str = "<!-- help -->\n";
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../docs/cli.md");
        let page = fs::read_to_string(&path).unwrap();
        let (head, _) = page.split_once(BEGIN).expect("the page has the marker");
        let options = MarkdownOptions::new().show_footer(false).show_table_of_contents(false);
        let help = help_markdown_command_custom(&Cli::command(), &options);
        // From the first command on: what comes before repeats the head of the page.
        let commands = help.find("## `light4gs quickstart").expect("the first command");
        let expected = format!("{head}{BEGIN}{}\n", with_examples_as_code(help[commands..].trim_end()));
        if std::env::var_os(WRITE).is_some() {
            fs::write(&path, expected).unwrap();
        } else {
            let stale = page.lines().zip(expected.lines()).find(|(found, expected)| found != expected);
            assert!(
                page == expected,
                "docs/cli.md is stale from {stale:?} on: run this test with {WRITE}=1, which writes it"
            );
        }
    }

    /// Lines that `--help` indents are commands.
    fn with_examples_as_code(markdown: &str) -> String {
        let mut lines: Vec<&str> = Vec::new();
        let mut inside = false;
        for line in markdown.lines() {
            let is_command = line.starts_with("  light4gs ");
            match (inside, is_command) {
                (false, true) => lines.extend(["", "```sh"]),
                (true, false) => lines.push("```"),
                _ => {}
            }
            inside = is_command;
            lines.push(if is_command { line.trim_start() } else { line });
        }
        lines.join("\n").replace("\n\n\n", "\n")
    }

    #[test]
    fn every_command_of_help_has_a_page_and_no_hidden_one() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("man1");
        Man { out: out.clone() }.run().unwrap();
        for command in Cli::command().get_subcommands() {
            let page = out.join(format!("light4gs-{}.1", command.get_name()));
            assert_eq!(page.exists(), !command.is_hide_set(), "{}", command.get_name());
        }
        let page = fs::read_to_string(out.join("light4gs-synth.1")).unwrap();
        assert!(page.contains(r"\-\-resolution") && page.contains("Width and height in pixels"), "{page}");
        assert!(fs::read_to_string(out.join("light4gs.1")).unwrap().contains("light4gs\\-synth(1)"));
    }

    #[test]
    fn a_file_in_place_of_the_folder_is_wrong_input() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("file");
        fs::write(&out, "").unwrap();
        let error = Man { out: out.clone() }.run().unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains(&out.display().to_string()), "{error}");
    }
}
