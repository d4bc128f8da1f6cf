//! `--limits`: the memory and the time that a file may take, and the most output of a command.

pub(super) mod most;

use clap::{Args, ValueEnum};
use light4gs_codec::Limits;

/// An argument of commands that open a file.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct LimitsArgument {
    /// The memory and the time that reading the file may take.
    #[arg(long, value_enum, default_value = "default", value_name = "LIMITS")]
    limits: Choice,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Choice {
    /// For untrusted files: 256 MiB and about 2 seconds on one thread; more for a large file, in proportion to its size.
    Default,
    /// For files that you trust: up to 64 GiB and half an hour.
    Large,
}

impl LimitsArgument {
    /// The reader's limits.
    pub(super) fn get(self) -> Limits {
        match self.limits {
            Choice::Default => Limits::default(),
            Choice::Large => Limits::large(),
        }
    }
}
