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
    use super::*;

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
