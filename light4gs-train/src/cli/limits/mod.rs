//! `--limits`: how much a file may ask for, and how much a command makes at most.

pub(super) mod most;

use clap::{Args, ValueEnum};
use light4gs_codec::Limits;

/// Commands that open a file take this argument.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct LimitsArgument {
    /// How much memory and time reading the file may take.
    #[arg(long, value_enum, default_value = "default", value_name = "LIMITS")]
    limits: Choice,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Choice {
    /// For files of strangers: 256 MiB and about 2 seconds of one thread; more for a large file, in proportion to it.
    Default,
    /// For files that you trust: up to 64 GiB and half an hour.
    Large,
}

impl LimitsArgument {
    /// As the reader has them.
    pub(super) fn get(self) -> Limits {
        match self.limits {
            Choice::Default => Limits::default(),
            Choice::Large => Limits::large(),
        }
    }
}
